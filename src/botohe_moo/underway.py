"""Missions under way: plans made anew, missions that are played, and what replanning is worth."""

from __future__ import annotations

import math
import multiprocessing
import os
import re
import time
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.base import files
from botohe_moo.base import messages as m
from botohe_moo.base.parameters import NotNegative, check
from botohe_moo.base.types import FloatArray, Rng
from botohe_moo.decide.fronts import survivor_prices
from botohe_moo.decide.wishes import label_text, node_of
from botohe_moo.mission import underway as u
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.rules import by_kind
from botohe_moo.mission.underway import Event, EventError, RobotState, UnderWay, under_way
from botohe_moo.trails import PlanBatch, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Event",
    "EventError",
    "PlayedMission",
    "PlayedStep",
    "PolicyOutcomes",
    "Replan",
    "UnderWay",
    "play_mission",
    "read_events",
    "replan",
    "simulate_policy",
    "under_way",
]

POLICIES = {
    "static": "the plan stays as it is",
    "losses": "the plan is made anew after each loss",
    "arrivals": "the plan is made anew whenever robots get to a node",
    "one by one": "robots go one after another, that with most hops first",
    "shortest first": "robots go one after another, that with fewest hops first",
}
_ORDERS = {"one by one": max, "shortest first": min}  # which trail goes next
_EVALUATIONS_OF_A_PRICE = 2_000
_AT_ONCE = 25  # missions that a worker plays before it hands them over


def read_events(mission: Mission, path: str | os.PathLike[str]) -> list[Event]:
    r"""Read what has happened from a CSV file with the columns ``robot``, ``event`` and ``node``.

    Rows are in the order of the events, as in the log of a mission. A column ``time`` is ignored.
    Robots are rows of the plan, from 0, or names of kinds of one robot. Events are ``reached``,
    ``lost`` and ``home``, as for :class:`Event`; the node may be empty where it may be None. Labels
    are written as in wishes.

    Parameters
    ----------
    mission
        The mission, which knows the nodes.
    path
        The file.

    Raises
    ------
    EventError
        If a column is missing or unknown, or a row has too few or too many cells or an unknown
        node. All such rows are listed.
    ValueError
        If the file is not a table.

    Examples
    --------
    >>> from pathlib import Path
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import read_events
    >>> written = Path("events.csv").write_text("robot,event,node\n0,lost,4\n")
    >>> print(*read_events(load_mission("toy"), "events.csv"))
    robot 0 lost on the way to 4
    """
    check_mission(mission)
    frame = files.read_table(path)
    columns = [str(column).strip().lower() for column in frame.columns]
    known = {"time", "robot", "event", "node"}
    if not {"robot", "event"} <= set(columns) <= known or len(columns) > len(set(columns)):
        expected = "the columns robot, event and node, and perhaps time"
        raise EventError(f"{path}: expected {expected}, found {m.quoted(', '.join(columns))}.")
    events, faults = [], []
    for where, given in files.filled_cells(frame, columns, str(path)):
        name = given.get("robot", "")
        robot = int(name) if re.fullmatch(r"-?[0-9]+", name) else name
        try:
            node = node_of(mission, given["node"]) if "node" in given else None
            events.append(Event(given.get("event", "").lower(), robot, node, where))
        except ValueError as error:
            faults.append(f"{where}: {error}")
    if faults:
        raise EventError("\n".join(faults))
    return events


@dataclass(frozen=True)
class Replan:
    """The best rest of a plan at a price, and the front of all rests.

    Attributes
    ----------
    left
        What is left of the mission and of its plan.
    price
        The price of a survivor, as reward.
    plan
        The plan of ``left.mission`` that is worth most: its reward, and its survivors at the price.
    objectives, before
        Its E[R] and E[S], and those of the rest of the running plan. Rewards that count already
        are ``left.banked``.
    plans, front
        All plans found that are not dominated, by descending reward, and their objectives.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission, replan
    >>> from botohe_moo.underway import Replan
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> found = replan(toy, plan, [Event("home", 1)], price=50)
    >>> isinstance(found, Replan), found.left.banked
    (True, 1.0)
    """

    left: UnderWay
    price: float
    plan: TrailPlan
    objectives: FloatArray
    before: FloatArray
    plans: tuple[TrailPlan, ...]
    front: FloatArray

    @property
    def gain(self) -> float:
        """How much more the new plan is worth than the rest of the old one, as reward; >= 0."""
        worths = (float(r + self.price * s) for r, s in (self.objectives, self.before))
        return next(worths) - next(worths)

    def __str__(self) -> str:
        price = f"{m.price_text(self.price).capitalize()}."
        if self.gain <= 0.0:
            return f"{price} What is left of the plan stays as it is.{self._scenarios}"
        more = (self.objectives - self.before).tolist()
        reward, survivors = map(m.difference_text, more, ("reward", "survivors"))
        return f"{price} The new plan has {reward} and {survivors}.{self._scenarios}"

    @property
    def _scenarios(self) -> str:
        """A sentence on how probable scenarios are by now; empty without any."""
        found = sorted(self.left.mission.scenarios, key=lambda scenario: -scenario.probability)
        known = m.listed(f"{scenario.name} {scenario.probability:.2g}" for scenario in found)
        return f" After these events, scenarios are as probable as: {known}." if known else ""


def replan(
    mission: Mission,
    plan: TrailPlan,
    events: Iterable[Event],
    *,
    price: float | None = None,
    evaluations: int = 400,
    seed: int = 1,
    min_survival: float = 0.0,
    max_length: float | None = None,
) -> Replan:
    """Make a plan anew for what is left of a mission after some events.

    A Pareto local search starts from the rest of the running plan, so that no plan found is worse.

    Parameters
    ----------
    mission, plan, events
        As for :func:`botohe_moo.underway.under_way`.
    price
        The price of a survivor, as reward, at least 0; :func:`botohe_moo.decide.survivor_price`
        gives that of a plan of a front. Default: the price that the plan implies, on a front which
        a local search of 2 000 evaluations finds from it.
    evaluations
        Plans to evaluate, at least 0.
    seed
        Seed of the search, at least 0.
    min_survival, max_length
        As for :func:`botohe_moo.underway.under_way`.

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    PlanError, EventError, MissionError
        As for :func:`botohe_moo.underway.under_way`.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission, replan
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> new = replan(toy, plan, [Event("lost", 0)], price=1)
    >>> new.left.mission.robots, new.gain >= 0
    (1, True)
    """
    evaluations = check("evaluations", evaluations, int, ge=0)
    generator = np.random.default_rng(check("seed", seed, int, ge=0))
    left = under_way(
        check_mission(mission), plan, events, min_survival=min_survival, max_length=max_length
    )
    price = _price_of(mission, plan, price, min_survival, max_length)
    return _replan_left(left, price, evaluations, generator)


def _replan_left(left: UnderWay, price: float, evaluations: int, random_state: Rng) -> Replan:
    """Make a plan anew for what is left of a mission, as `replan` does."""
    rest = left.mission
    batch, objectives = _search(rest, (), left.plan, evaluations, random_state)
    plans = list(batch)
    [before] = rest.evaluate([left.plan])
    worth = objectives @ np.array([1.0, price])
    best = int(np.argmax(worth))
    same = np.isclose(objectives, before, rtol=1e-12, atol=0.0).all(axis=1)
    if same.any() and np.isclose(worth[same][0], worth[best], rtol=1e-12, atol=0.0):
        best = int(np.argmax(same))
        plans[best], objectives[best] = left.plan, before
    return Replan(left, price, plans[best], objectives[best], before, tuple(plans), objectives)


def _search(
    mission: Mission, limits: tuple[Any, ...], plan: TrailPlan, evaluations: int, random_state: Rng
) -> tuple[PlanBatch, FloatArray]:
    """Search from a plan, and from one where all robots stay; return plans and objectives."""
    search = LocalSearch(mission, Costs(mission.limited(*limits)), random_state=random_state)
    search.insert(mission.batch([plan, mission.stay_home()]))
    search.run(evaluations)
    return search.plans()[:2]


def _price_of(mission: Mission, plan: TrailPlan, price: float | None, *limits: Any) -> float:
    """Check the price of a survivor; if there is none, compute the one that a plan implies.

    That is the price on a front which a short local search finds from the plan, always with the
    same seed, since a plan implies one price.
    """
    if price is not None:
        return float(check("price", price, NotNegative))
    generator = np.random.default_rng(1)
    _, front = _search(mission, limits, plan, _EVALUATIONS_OF_A_PRICE, generator)
    return float(survivor_prices(front, mission.evaluate([plan])[0, 1]))


@dataclass(frozen=True)
class PlayedStep:
    """A step of a mission that was played: each robot that moves tries one arc.

    Attributes
    ----------
    events
        What happened to the robots that moved.
    trails
        The trail of each robot after the step: where it has been, and where it is to go, by the new
        plan if one was made. That of a lost robot ends with the node to which it was on its way.
    at
        The position on its trail of the node where each robot is; or, if it is lost, came from.
    lost
        The robots that are lost by now.
    collected
        The reward that counts by now, by node; only of nodes of which some does.
    replan
        The plan made anew after these events, if one was. Its ``before`` and ``objectives`` are
        what is expected from now on without it and with it.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import PlayedStep, play_mission
    >>> toy = load_mission("toy")
    >>> start = play_mission(toy, toy.plan([[1, 2, 1], [1]]), price=1).steps[0]
    >>> isinstance(start, PlayedStep), start.trails, start.at
    (True, ((1, 2, 1), (1,)), (0, 0))
    """

    events: tuple[Event, ...]
    trails: tuple[tuple[Hashable, ...], ...]
    at: tuple[int, ...]
    lost: tuple[int, ...]
    collected: dict[Hashable, float]
    replan: Replan | None

    @property
    def reward(self) -> float:
        """The reward that counts by now."""
        return math.fsum(self.collected.values())


@dataclass(frozen=True)
class PlayedMission:
    """A mission that was played, as `play_mission` returns it.

    Attributes
    ----------
    mission, plan, policy, price, seed, number
        As for :func:`play_mission`.
    steps
        The start, at which nothing has happened yet, and each step after it.
    reward, survivors
        The reward collected and the robots that came back. Where a ``share`` is not 1, the reward
        is an expectation.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import PlayedMission, play_mission
    >>> toy = load_mission("toy")
    >>> played = play_mission(toy, toy.stay_home(), price=1)
    >>> isinstance(played, PlayedMission), len(played.steps)
    (True, 1)
    >>> print(played)
    No robot is lost. The mission ends with 0 reward and 2 of 2 robots.
    """

    mission: Mission
    plan: TrailPlan
    policy: str
    price: float
    seed: int
    number: int
    steps: tuple[PlayedStep, ...]
    reward: float
    survivors: int

    def __str__(self) -> str:
        losses = [loss for step in self.steps for loss in self._losses(step, "")]
        replans = sum(step.replan is not None for step in self.steps)
        anew = f" The plan is made anew {m.counted(replans, 'time')}." if replans else ""
        lost = f"Lost: {', '.join(losses)}." if losses else "No robot is lost."
        return f"{lost}{anew} {self._end()}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """What happened in each step, in words."""
        return tuple(" ".join(self._sentences(i)) for i in range(len(self.steps)))

    @property
    def table(self) -> pd.DataFrame:
        """A row for each step.

        The columns are ``step``, ``reward`` (that counts by now), ``robots`` (not lost by now),
        ``lost`` (in this step), ``replanned``, and, if it was, what is expected from then on:
        ``reward_before``, ``survivors_before``, ``reward_after`` and ``survivors_after``.
        """
        import pandas as pd

        columns = ["step", "reward", "robots", "lost", "replanned"]
        columns += ["reward_before", "survivors_before", "reward_after", "survivors_after"]
        rows = []
        for number, step in enumerate(self.steps):
            robots, new = self.mission.robots - len(step.lost), step.replan
            row = [number, step.reward, robots, len(self._losses(step)), new is not None]
            expected = [math.nan] * 4 if new is None else [*new.before, *new.objectives]
            rows.append([*row, *expected])
        return pd.DataFrame(rows, columns=columns)

    def _sentences(self, number: int) -> Iterator[str]:
        step = self.steps[number]
        if number == 0:
            [expected] = self.mission.evaluate([self.plan]).tolist()
            yield f"Start: {_expected(expected)} expected."
        else:
            moved = len(step.events)
            on = f"{m.counted(moved, 'robot')} move{'s' if moved == 1 else ''} on"
            yield f"Step {number}: {', '.join(self._losses(step)) or on}."
        if step.replan is not None:
            now = f"{_expected(step.replan.objectives)} expected from now on"
            if step.replan.gain <= 0.0:
                yield f"The plan is made anew and stays as it is: {now}."
            else:
                before = " and ".join(map(m.short_text, step.replan.before))
                yield f"The plan is made anew: {now}, instead of {before}."
        if number == len(self.steps) - 1:
            yield self._end()

    def _losses(self, step: PlayedStep, verb: str = "is lost ") -> list[str]:
        """Write which robots are lost in a step, and where."""
        lost = [int(event.robot) for event in step.events if event.what == "lost"]
        ways = {robot: map(label_text, step.trails[robot][-2:]) for robot in lost}
        return [
            f"{self.mission.kind_of[robot].name} {robot} {verb}between {' and '.join(way)}"
            for robot, way in ways.items()
        ]

    def _end(self) -> str:
        team = m.counted(self.mission.robots, "robot")
        reward = m.short_text(self.reward)
        return f"The mission ends with {reward} reward and {self.survivors} of {team}."


def _expected(objectives: Iterable[float]) -> str:
    reward, survivors = map(m.short_text, objectives)
    return f"{reward} reward and {survivors} survivors"


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
    number = check("number", number, int, ge=0)
    limits, steps = (min_survival, max_length), list[PlayedStep]()
    start = _start(mission, plan, [policy], price, seed, evaluations, *limits)
    end = start.play(policy, number, steps)
    outcome = float(end["reward"]), int(end["survivors"])
    return PlayedMission(mission, plan, policy, start.price, seed, number, tuple(steps), *outcome)


def _start(
    mission: Mission,
    plan: TrailPlan,
    policies: Sequence[str],
    price: float | None,
    seed: int,
    evaluations: int,
    *limits: Any,
) -> _Start:
    """Return the start of missions that are played with a plan, after all is checked."""
    for policy in policies:
        m.check_choice("policy", policy, tuple(POLICIES))
    seed = check("seed", seed, int, ge=0)
    evaluations = check("evaluations", evaluations, int, ge=0)
    robots = u.robots_at_start(mission, plan, check_mission(mission).limits(*limits))
    price = _price_of(mission, plan, price, *limits)
    return _Start(mission, robots, price, seed, evaluations)


class _Start(NamedTuple):
    """The start of missions that are played: the robots of a plan, and how it is made anew."""

    mission: Mission
    robots: list[RobotState]
    price: float
    seed: int
    evaluations: int

    def play_all(self, policies: Sequence[str], number: int) -> list[dict[str, object]]:
        """Play a mission, by its number among those of the seed, under each policy."""
        return [
            {"policy": policy, "mission": number, **self.play(policy, number)}
            for policy in policies
        ]

    def play(
        self, policy: str, number: int, steps: list[PlayedStep] | None = None
    ) -> dict[str, float]:
        """Play a mission under a policy, return its outcome, and add what happens to ``steps``.

        Where a share is not 1, the reward is an expectation.
        """
        mission, robots = self.mission, self.robots
        generator, true = np.random.default_rng([self.seed, number]), mission
        if mission.scenarios:  # all robots meet the same one
            chances = [p for p, _ in mission.in_scenarios]
            drawn = generator.choice(len(chances), p=np.divide(chances, math.fsum(chances)))
            true = mission.in_scenarios[int(drawn)][1]
        dangers = generator.random((mission.robots, len(mission.graph.edges)))
        moving, replans, seconds = -1, 0, 0.0
        if steps is not None:
            steps.append(_step(true, robots, (), None))
        while movers := [robot for robot in robots if _has_hops(robot)]:
            if order := _ORDERS.get(policy):
                if moving not in [robot.number for robot in movers]:
                    moving = order(movers, key=lambda robot: len(robot.trail) - robot.at).number
                movers = [robots[moving]]
            events, new = tuple(_moved(true, robot, dangers) for robot in movers), None
            robots = u.apply_events(robots, events)
            is_time = _is_time(policy, [robots[robot.number] for robot in movers])
            if is_time and any(robot.state != "lost" for robot in robots):
                began = time.perf_counter()
                left = u.remaining_mission(mission, robots)
                new = _replan_left(left, self.price, self.evaluations, generator)
                for row, trail in zip(left.robots, left.mission.labels(new.plan), strict=True):
                    gone = robots[row].trail[: robots[row].at]
                    robots[row] = replace(robots[row], trail=(*gone, *trail))
                replans, seconds = replans + 1, seconds + time.perf_counter() - began
            if steps is not None:
                steps.append(_step(true, robots, events, new))
        survivors = sum(robot.state != "lost" for robot in robots)
        reward = u.settle_rewards(true, robots).banked(true)
        outcome = {"reward": reward, "survivors": survivors}
        return outcome | {"replans": replans, "seconds": seconds}


def _moved(mission: Mission, robot: RobotState, dangers: FloatArray) -> Event:
    """Return what happens to a robot on its next arc."""
    tail, head = robot.trail[robot.at : robot.at + 2]
    [survival] = by_kind(mission.graph.edges[tail, head]["survival"], [robot.kind])
    survives = dangers[robot.number, robot.at] < survival
    return Event("reached" if survives else "lost", robot.number, head)


def _step(
    mission: Mission, robots: Sequence[RobotState], events: tuple[Event, ...], replan: Replan | None
) -> PlayedStep:
    """Record what has happened, and where robots are now."""
    rewards = zip(mission.nodes, mission.rewards.tolist(), strict=True)
    left = u.settle_rewards(mission, robots).left
    collected = {node: pays - left[node] for node, pays in rewards if left[node] < pays}
    lost = tuple(robot.number for robot in robots if robot.state == "lost")
    trails = tuple(r.trail[: r.at + 2] if r.number in lost else r.trail for r in robots)
    at = tuple(robot.at for robot in robots)
    return PlayedStep(events, trails, at, lost, collected, replan)


def _has_hops(robot: RobotState) -> bool:
    return robot.state == "out" and robot.at + 1 < len(robot.trail)


def _is_time(policy: str, moved: Sequence[RobotState]) -> bool:
    """Return whether it is time to make a plan anew."""
    if policy in ("static", "arrivals"):
        return policy == "arrivals"
    has_lost = any(robot.state == "lost" for robot in moved)
    return has_lost or (policy in _ORDERS and not _has_hops(moved[0]))


@dataclass(frozen=True)
class PolicyOutcomes:
    """Outcomes of missions that were played under some policies.

    Attributes
    ----------
    mission, plan
        The mission and the plan with which each starts.
    price
        What a survivor is worth, as reward.
    played
        A row for each policy and mission that was played, with the columns ``policy``, ``mission``
        (its number), ``reward``, ``survivors``, ``replans`` and ``seconds`` (of all replans). Where
        a share is not 1, the reward is an expectation.

    Examples
    --------
    >>> from botohe_moo import load_mission, simulate_policy
    >>> from botohe_moo.underway import PolicyOutcomes
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> outcomes = simulate_policy(toy, plan, "losses", price=2, missions=20)
    >>> isinstance(outcomes, PolicyOutcomes), len(outcomes.played)
    (True, 40)
    """

    mission: Mission
    plan: TrailPlan
    price: float
    played: pd.DataFrame

    @property
    def table(self) -> pd.DataFrame:
        """A row for each policy: means of missions, and what they are worth.

        The columns are ``policy``, ``reward``, ``survivors``, ``gain`` (what a mission is worth
        more than with the plan as it is, at the price), ``gain_se`` (its standard error),
        ``replans`` (of a mission) and ``seconds`` (of a replan).
        """
        import pandas as pd

        worth = self.played["reward"] + self.price * self.played["survivors"]
        by_policy = self.played.assign(worth=worth).groupby("policy", sort=False)
        base = by_policy.get_group("static")["worth"].to_numpy()
        rows = []
        for name, played in by_policy:
            gains, replans = played["worth"].to_numpy() - base, played["replans"].sum()
            rows.append(
                {
                    "policy": name,
                    "reward": played["reward"].mean(),
                    "survivors": played["survivors"].mean(),
                    "gain": gains.mean(),
                    "gain_se": gains.std(ddof=1) / len(gains) ** 0.5,
                    "replans": played["replans"].mean(),
                    "seconds": played["seconds"].sum() / max(1, replans),
                }
            )
        return pd.DataFrame(rows)

    def __str__(self) -> str:
        table = self.table.round(4).to_string(index=False)
        return f"{m.price_text(self.price).capitalize()}.\n{table}"


def simulate_policy(
    mission: Mission,
    plan: TrailPlan,
    policy: str | Sequence[str] = ("losses", "one by one"),
    *,
    price: float | None = None,
    missions: int = 1_000,
    seed: int = 1,
    evaluations: int = 400,
    min_survival: float = 0.0,
    max_length: float | None = None,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> PolicyOutcomes:
    """Play missions under policies of replanning, and with the plan as it is.

    All policies meet the same dangers: hop i of robot k is survived if a number, drawn once for
    each mission, robot and hop, is less than the survival of its arc.

    Parameters
    ----------
    mission, plan
        A mission, and a plan of it.
    policy
        When a plan is made anew, one or more of: ``"losses"``, after each; ``"arrivals"``, whenever
        robots get to a node; ``"one by one"``, where robots go one after another, that with most
        hops first, and each is planned for when the one before is home or lost;
        ``"shortest first"``, the same, but that with fewest hops goes first; ``"static"``, never,
        which is always played.
    price
        What a survivor is worth, as reward; default: what the plan implies, as for :func:`replan`.
    missions
        How many are played under each policy, at least 2.
    seed
        Seed of all random numbers, at least 0.
    evaluations
        Of each replan, at least 0.
    min_survival, max_length
        The limits of the plan, as for :func:`botohe_moo.underway.under_way`.
    workers
        Processes that play missions, at least 1; the outcomes do not depend on their number. In a
        script, more than one need ``if __name__ == "__main__":``.
    progress
        Called with the number of missions played, after each.

    Raises
    ------
    ValueError
        If a policy is unknown, or a parameter is out of its range.
    PlanError
        If the plan is not valid for the mission, or does not keep the limits.

    Examples
    --------
    >>> from botohe_moo import load_mission, simulate_policy
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> outcomes = simulate_policy(toy, plan, "losses", price=2, missions=20)
    >>> outcomes.table["policy"].tolist()
    ['static', 'losses']
    """
    import pandas as pd

    names = [policy] if isinstance(policy, str) else list(policy)
    names = list(dict.fromkeys(["static", *names]))
    missions = check("missions", missions, int, ge=2)
    workers = check("workers", workers, int, ge=1)
    start = _start(mission, plan, names, price, seed, evaluations, min_survival, max_length)
    play, numbers = partial(start.play_all, names), range(missions)
    rows = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        # The pool starts no process before it has something to do.
        spread = partial(pool.map, chunksize=_AT_ONCE) if workers > 1 else map
        for n_played, found in enumerate(spread(play, numbers), start=1):
            rows += found
            if progress is not None:
                progress(n_played)
    rows.sort(key=lambda row: names.index(str(row["policy"])))
    return PolicyOutcomes(mission, plan, start.price, pd.DataFrame(rows))
