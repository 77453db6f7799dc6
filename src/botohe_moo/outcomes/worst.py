"""The worst case of a plan: the robots whose loss costs most never leave."""

from __future__ import annotations

import math
from itertools import combinations, islice

import numpy as np

from botohe_moo._base.checks import check_integer
from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes.reaching import collect_probabilities
from botohe_moo.trails import Plans, TrailPlan

MAX_SETS = 1_000_000
_AT_ONCE = 4_096  # sets whose rewards are computed at once


def worst_case(
    mission: Mission, plans: Plans, losses: int = 1, *, max_sets: int = MAX_SETS
) -> FloatArray:
    """Compute the least E[R] of each plan if some robots never leave.

    Parameters
    ----------
    mission, plans
        A mission, and plans that are valid for it; otherwise a PlanError is raised.
    losses
        How many robots never leave, of 0 to all.
    max_sets
        If there are more sets of as many robots, a lower bound is given instead of the least E[R].

    Returns
    -------
    numpy.ndarray
        Shape (n_plans,), in rewards.

    Notes
    -----
    All sets of robots are enumerated. E[R] is submodular in the set of robots, so that a loss costs
    at most what the lost robots would bring alone, which gives the bound. Shi, Zhou and Tokekar,
    "Robust multiple-path orienteering problem: Securing against adversarial attacks", 2023, choose
    paths by it.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.outcomes import worst_case
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])
    >>> worst_case(toy, [plan], 1).round(3).tolist(), worst_case(toy, [plan], 2).tolist()
    ([0.9], [0.0])
    """
    batch = check_mission(mission).batch(plans)
    losses = check_integer("losses", losses, at_least=0, at_most=mission.robots)
    max_sets = check_integer("max_sets", max_sets, at_least=1)
    return np.array([_of_plan(mission, plan, losses, max_sets) for plan in batch])


def _of_plan(mission: Mission, plan: TrailPlan, losses: int, max_sets: int) -> float:
    reward, missed = mission.rewards, 1.0 - collect_probabilities(mission, plan)
    n_robots, n_kept = mission.robots, mission.robots - losses
    if math.comb(n_robots, losses) > max_sets:
        alone = np.sort((1.0 - missed) @ reward)
        whole = float(reward @ (1.0 - missed.prod(axis=0)))
        return max(0.0, whole - float(alone[n_kept:].sum()))
    worst, sets = math.inf, combinations(range(n_robots), n_kept)
    while kept := list(islice(sets, _AT_ONCE)):
        rows = np.array(kept, np.int64).reshape(len(kept), n_kept)
        left = np.ones((len(rows), len(reward)))
        for column in rows.T:
            left *= missed[column]
        worst = min(worst, float(((1.0 - left) @ reward).min()))
    return worst
