"""Missions that are played: robots that move and are lost, with plans made anew or not."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.mission.kinds import by_kind
from botohe_moo.mission.model import Mission
from botohe_moo.mission.underway import RobotState, left_of, pay, robots_at_start
from botohe_moo.trails import TrailPlan
from botohe_moo.underway.replanning import replan_left

_ORDERS = {"one by one": max, "one by one, shortest first": min}  # which trail goes next
POLICIES = ("static", "losses", "arrivals", *_ORDERS)


class Policy(NamedTuple):
    """When plans are made anew, and how."""

    name: str
    price: float
    evaluations: int
    limits: Limits


class Played(NamedTuple):
    """What has come of a mission: the reward, survivors, replans, and the seconds that these took.

    The reward is to be expected where a share is not 1.
    """

    reward: float
    survivors: int
    replans: int
    seconds: float


def play(
    mission: Mission,
    plan: TrailPlan,
    policy: Policy,
    dangers: FloatArray,
    random_state: np.random.Generator,
) -> Played:
    """Play one mission; ``dangers`` are the random numbers of each robot's hops."""
    robots = robots_at_start(mission, plan)
    index_of_kind = {kind.name: k for k, kind in enumerate(mission.kinds)}
    moving, replans, seconds = -1, 0, 0.0
    while movers := [robot for robot in robots if _has_hops(robot)]:
        if order := _ORDERS.get(policy.name):
            if moving not in [robot.number for robot in movers]:
                moving = order(movers, key=lambda robot: len(robot.trail) - robot.at).number
            movers = [robots[moving]]
        has_lost = False
        for robot in movers:
            arc = mission.graph.edges[robot.trail[robot.at], robot.trail[robot.at + 1]]
            kind = index_of_kind[robot.kind.name]
            survival = by_kind(arc["survival"], mission.kinds)[kind]
            if dangers[robot.number, robot.at] < survival:
                robot.at += 1
            else:
                robot.state, has_lost = "lost", True
        if policy.name == "static" or not _is_time(policy.name, movers, has_lost):
            continue
        if all(robot.state == "lost" for robot in robots):
            break
        began = time.perf_counter()
        left = left_of(mission, robots, policy.limits)
        new = replan_left(left, policy.price, policy.evaluations, random_state)
        for number, trail in zip(left.robots, left.mission.labels(new.plan), strict=True):
            robot = robots[number]
            robot.trail = (*robot.trail[: robot.at], *trail)
        replans, seconds = replans + 1, seconds + time.perf_counter() - began
    survivors = sum(robot.state != "lost" for robot in robots)
    return Played(pay(mission, robots)[1], survivors, replans, seconds)


def _has_hops(robot: RobotState) -> bool:
    return robot.state == "out" and robot.at + 1 < len(robot.trail)


def _is_time(policy: str, moved: Sequence[RobotState], has_lost: bool) -> bool:
    """Return whether it is time to make a plan anew."""
    if policy == "arrivals":
        return True
    if policy in _ORDERS:
        return has_lost or not _has_hops(moved[0])
    return has_lost
