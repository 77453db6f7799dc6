"""What replanning is worth: missions that are played, with plans that stay or are made anew."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from botohe_moo._base.checks import check_integer
from botohe_moo._base.types import FloatArray
from botohe_moo.decide.playing import POLICIES, Played, Policy, play, policies_of
from botohe_moo.mission.model import Mission
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd

_AT_ONCE = 25  # missions that a worker plays before it says so


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
    tried = ("static", *(name for name in names if name != "static"))
    policies = policies_of(mission, plan, tried, price, evaluations, min_survival, max_length)
    missions = check_integer("missions", missions, at_least=2)
    seed = check_integer("seed", seed, at_least=0)
    workers = check_integer("workers", workers, at_least=1)
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
            results[policy.name].append(play(mission, plan, policy, seed, number))
    return results


def _worth(played: Iterable[Played], price: float) -> FloatArray:
    return np.array([one.reward + price * one.survivors for one in played])
