"""What replanning is worth: missions that are played, with plans that stay or are made anew."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from botohe_moo._base.checks import check_choice, check_integer, check_number
from botohe_moo._base.types import FloatArray
from botohe_moo.decide.replanning import replan_left
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.mission.kinds import by_kind
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.underway import RobotState, left_of, pay, robots_at_start
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd

POLICIES = ("static", "losses", "arrivals", "one by one")
_AT_ONCE = 25  # missions that a worker plays before it says so


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


def simulate_policy(
    mission: Mission,
    plan: TrailPlan,
    policy: str | Sequence[str] = POLICIES,
    *,
    price: float,
    missions: int = 1_000,
    seed: int = 1,
    evaluations: int = 400,
    min_survival: float = 0.0,
    max_length: float | None = None,
    workers: int = 1,
    progress: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """Play missions, and compare what comes of them under each policy with the plan as it is.

    All policies meet the same dangers: hop i of robot k is survived if a number, drawn once for
    each mission, robot and hop, is less than the survival of its arc.

    Parameters
    ----------
    mission, plan
        A mission, and a plan of it.
    policy
        When a plan is made anew: ``"losses"``, after each; ``"arrivals"``, whenever robots get to a
        node; ``"one by one"``, where robots go one after another, that with most hops first, and
        each is planned for when the one before is home or lost; ``"static"``, never.
    price
        What a survivor is worth, as reward; see :func:`robot_price`.
    missions
        How many are played under each policy, at least 2.
    seed
        Seed of all random numbers, at least 0.
    evaluations
        Of each replan, at least 0.
    min_survival, max_length
        The limits of the plan, as for :func:`under_way`.
    workers
        Processes that play missions, at least 1; the table does not depend on their number.
    progress
        Called with the number of missions played, whenever some have been.

    Returns
    -------
    pandas.DataFrame
        A row for each policy, with the columns ``policy``, ``reward`` and ``survivors`` (means),
        ``gain`` (what a mission is worth more than under the static policy, at the price),
        ``gain_se`` (its standard error), ``replans`` (a mission) and ``ms_each``.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import simulate_policy
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> table = simulate_policy(toy, plan, "losses", price=2, missions=20)
    >>> bool(table["gain"][0] >= 0)
    True
    """
    import pandas as pd

    names = [policy] if isinstance(policy, str) else list(policy)
    for name in names:
        check_choice("policy", name, POLICIES)
    price = check_number("price", price, at_least=0)
    missions = check_integer("missions", missions, at_least=2)
    seed = check_integer("seed", seed, at_least=0)
    evaluations = check_integer("evaluations", evaluations, at_least=0)
    check_mission(mission).evaluate([plan])
    workers = check_integer("workers", workers, at_least=1)
    limits = mission.limits(min_survival, max_length)
    tried = ("static", *(name for name in names if name != "static"))
    policies = [Policy(name, price, evaluations, limits) for name in tried]
    blocks = [range(i, min(i + _AT_ONCE, missions)) for i in range(0, missions, _AT_ONCE)]
    play_block = partial(_play_missions, mission, plan, policies, seed)
    results: dict[str, list[Played]] = {name: [] for name in tried}
    with ExitStack() as stack:
        mapped = map
        if workers > 1 and len(blocks) > 1:
            context = multiprocessing.get_context("spawn")
            pool = ProcessPoolExecutor(min(workers, len(blocks)), mp_context=context)
            mapped = stack.enter_context(pool).map  # type: ignore[assignment]
        for block, found in zip(blocks, mapped(play_block, blocks), strict=True):
            for name, played in found.items():
                results[name] += played
            if progress is not None:
                progress(block.stop)
    base = _worth(results["static"], price)
    rows = []
    for name in names:
        played = results[name]
        gains = _worth(played, price) - base
        replans = sum(one.replans for one in played)
        rows.append(
            {
                "policy": name,
                "reward": np.mean([one.reward for one in played]),
                "survivors": np.mean([one.survivors for one in played]),
                "gain": gains.mean(),
                "gain_se": gains.std(ddof=1) / missions**0.5,
                "replans": replans / missions,
                "ms_each": 1e3 * sum(one.seconds for one in played) / max(1, replans),
            }
        )
    return pd.DataFrame(rows)


def _play_missions(
    mission: Mission,
    plan: TrailPlan,
    policies: Sequence[Policy],
    seed: int,
    numbers: Iterable[int],
) -> dict[str, list[Played]]:
    """Play some missions under each policy, by their numbers."""
    results: dict[str, list[Played]] = {policy.name: [] for policy in policies}
    for number in numbers:
        for policy in policies:
            generator = np.random.default_rng([seed, number])
            dangers = generator.random((mission.robots, len(mission.graph.edges)))
            results[policy.name].append(play(mission, plan, policy, dangers, generator))
    return results


def _worth(played: Iterable[Played], price: float) -> FloatArray:
    return np.array([one.reward + price * one.survivors for one in played])


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
        if policy.name == "one by one":
            if moving not in [robot.number for robot in movers]:
                moving = max(movers, key=lambda robot: len(robot.trail) - robot.at).number
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
    if policy == "one by one":
        return has_lost or not _has_hops(moved[0])
    return has_lost
