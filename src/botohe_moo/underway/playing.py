"""Missions that are played: robots that move and are lost, with plans made anew or not."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from botohe_moo.base.messages import check_choice, check_integer
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.rules import by_kind
from botohe_moo.mission.underway import (
    Event,
    RobotState,
    apply_events,
    remaining_mission,
    robots_at_start,
    settle_rewards,
)
from botohe_moo.trails import TrailPlan
from botohe_moo.underway.played import PlayedMission, PlayedStep
from botohe_moo.underway.replanning import Replan, check_price, replan_left

POLICIES = {
    "static": "the plan stays as it is",
    "losses": "the plan is made anew after each loss",
    "arrivals": "the plan is made anew whenever robots get to a node",
    "one by one": "robots go one after another, that with most hops first; the plan is made anew "
    "when one is home or lost",
    "shortest first": "as one by one, but that with fewest hops goes first",
}
_ORDERS = {"one by one": max, "shortest first": min}  # which trail goes next


class Policy(NamedTuple):
    """When plans are made anew, and how; and the robots of the plan at the start."""

    name: str
    price: float
    evaluations: int
    robots: tuple[RobotState, ...]


class Played(NamedTuple):
    """What has come of a mission: the reward, survivors, replans, and the seconds that these took.

    The reward is to be expected where a share is not 1.
    """

    reward: float
    survivors: int
    replans: int
    seconds: float


def play_mission(
    mission: Mission,
    plan: TrailPlan,
    policy: str = "losses",
    *,
    price: float | None = None,
    seed: int = 1,
    number: int = 0,
    evaluations: int = 400,
    min_survival: float = 0.0,
    max_length: float | None = None,
) -> PlayedMission:
    """Play one mission of those that `simulate_policy` plays, and record each step.

    Parameters
    ----------
    mission, plan, price, seed, evaluations, min_survival, max_length
        As for :func:`botohe_moo.simulate_policy`.
    policy
        One of those of :func:`botohe_moo.simulate_policy`.
    number
        Which of the missions of this seed, from 0.

    Raises
    ------
    ValueError
        If the policy is unknown, or a parameter is out of its range.
    PlanError
        If the plan is not valid for the mission, or does not keep the limits.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import play_mission
    >>> toy = load_mission("toy")
    >>> played = play_mission(toy, toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]]), price=2)
    >>> print(played.sentences[-1])
    Step 10: 1 robot moves on. The mission ends with 10 reward and 1 of 2 robots.
    """
    seed = check_integer("seed", seed, at_least=0)
    given = evaluations, min_survival, max_length
    [made] = policies_of(mission, plan, [policy], price, *given)
    number = check_integer("number", number, at_least=0)
    steps: list[PlayedStep] = []
    end = play(mission, made, seed, number, steps)
    return PlayedMission(
        mission, plan, policy, made.price, seed, number, tuple(steps), end.reward, end.survivors
    )


def policies_of(
    mission: Mission,
    plan: TrailPlan,
    names: Sequence[str],
    price: float | None,
    evaluations: int,
    min_survival: float,
    max_length: float | None,
) -> list[Policy]:
    """Return policies for a plan, all of which is checked."""
    for name in names:
        check_choice("policy", name, tuple(POLICIES))
    evaluations = check_integer("evaluations", evaluations, at_least=0)
    limits = check_mission(mission).limits(min_survival, max_length)
    robots = tuple(robots_at_start(mission, plan, limits))
    price = check_price(mission, plan, price, mission.limited(min_survival, max_length))
    return [Policy(name, price, evaluations, robots) for name in names]


def play(
    mission: Mission,
    policy: Policy,
    seed: int,
    number: int,
    steps: list[PlayedStep] | None = None,
) -> Played:
    """Play a mission, by its number among those of a seed; add what happens to ``steps``."""
    generator = np.random.default_rng([seed, number])
    dangers = generator.random((mission.robots, len(mission.graph.edges)))
    robots = list(policy.robots)
    moving, replans, seconds = -1, 0, 0.0
    if steps is not None:
        steps.append(_step(mission, robots, (), None))
    while movers := [robot for robot in robots if _has_hops(robot)]:
        if order := _ORDERS.get(policy.name):
            if moving not in [robot.number for robot in movers]:
                moving = order(movers, key=lambda robot: len(robot.trail) - robot.at).number
            movers = [robots[moving]]
        events, new = tuple(_moved(mission, robot, dangers) for robot in movers), None
        robots = apply_events(robots, events)
        is_time = _is_time(policy.name, [robots[robot.number] for robot in movers])
        if is_time and any(robot.state != "lost" for robot in robots):
            began = time.perf_counter()
            left = remaining_mission(mission, robots)
            new = replan_left(left, policy.price, policy.evaluations, generator)
            for row, trail in zip(left.robots, left.mission.labels(new.plan), strict=True):
                gone = robots[row].trail[: robots[row].at]
                robots[row] = replace(robots[row], trail=(*gone, *trail))
            replans, seconds = replans + 1, seconds + time.perf_counter() - began
        if steps is not None:
            steps.append(_step(mission, robots, events, new))
    survivors = sum(robot.state != "lost" for robot in robots)
    return Played(settle_rewards(mission, robots).banked, survivors, replans, seconds)


def _moved(mission: Mission, robot: RobotState, dangers: FloatArray) -> Event:
    """Return what happens to a robot on its next arc."""
    tail, head = robot.trail[robot.at : robot.at + 2]
    [survival] = by_kind(mission.graph.edges[tail, head]["survival"], [robot.kind])
    survives = dangers[robot.number, robot.at] < survival
    return Event("reached" if survives else "lost", robot.number, head)


def _step(
    mission: Mission,
    robots: Sequence[RobotState],
    events: tuple[Event, ...],
    replan: Replan | None,
) -> PlayedStep:
    """Record what has happened, and where robots are now."""
    left = settle_rewards(mission, robots).left
    rewards = {node: float(mission.graph.nodes[node]["reward"]) for node in left}
    lost = tuple(robot.number for robot in robots if robot.state == "lost")
    return PlayedStep(
        events,
        tuple(
            robot.trail[: robot.at + 2] if robot.number in lost else robot.trail for robot in robots
        ),
        tuple(robot.at for robot in robots),
        lost,
        {node: rewards[node] - pays for node, pays in left.items() if pays < rewards[node]},
        replan,
    )


def _has_hops(robot: RobotState) -> bool:
    return robot.state == "out" and robot.at + 1 < len(robot.trail)


def _is_time(policy: str, moved: Sequence[RobotState]) -> bool:
    """Return whether it is time to make a plan anew."""
    if policy in ("static", "arrivals"):
        return policy == "arrivals"
    has_lost = any(robot.state == "lost" for robot in moved)
    return has_lost or (policy in _ORDERS and not _has_hops(moved[0]))
