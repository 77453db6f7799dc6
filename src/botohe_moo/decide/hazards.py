"""Plans under other survivals than expected, and without some of their robots."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo._base.checks import check_integer, check_number, quoted
from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.decide.judging import Candidates
from botohe_moo.kernels.graph.kinds import AT_NEXT_DEPOT, AT_THIS_DEPOT
from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import collect_probabilities
from botohe_moo.trails import PlanBatch, Plans, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

_MAX_SUBSETS = 100_000  # a plan takes a second


def robustness(
    mission: Mission,
    plans: Plans,
    *,
    factors: Iterable[float] = (0.5, 2.0),
    spread: float = 0.0,
    n_scenarios: int = 100,
    seed: int = 1,
) -> pd.DataFrame:
    """Compute the objectives of plans if the survivals are wrong, and their regret.

    In a scenario the survival ω of each arc becomes ω^h. There is one scenario for each factor h,
    the same for all arcs: 2 doubles every hazard, −log ω, and 0.5 halves it. With ``spread`` there
    are also ``n_scenarios`` in which h is drawn for each arc, the same for all kinds of robots:
    log-normal, with a median of 1. The expected case, h = 1, is always among the scenarios.

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans.
    factors
        Factors on all hazards, each above 0; may be none.
    spread
        Standard deviation of log h for single arcs, at least 0; at 0 none are drawn.
    n_scenarios
        How many scenarios are drawn, at least 1.
    seed
        Seed of these draws, at least 0.

    Returns
    -------
    pandas.DataFrame
        A row for each plan: ``plan_id``, ``reward`` and ``survivors`` as expected; ``reward_low``,
        ``reward_high``, ``survivors_low`` and ``survivors_high``, the band over all scenarios;
        ``reward_regret`` and ``survivors_regret``, the largest regret over all scenarios. In one
        scenario the regret in reward is how much more reward one of these plans would have had with
        no fewer survivors, the regret in survivors how many more survivors with no less reward;
        both are 0 for a plan that stays non-dominated.

    Raises
    ------
    ValueError
        If there is no plan, or a parameter is out of its range.
    PlanError
        If a plan is not valid for the mission.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import robustness
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([[1, 2, 4, 2, 1], [1]]), toy.plan([[1], [1]])]
    >>> table = robustness(toy, plans, factors=[2])
    >>> table[["reward", "reward_low", "reward_regret"]].round(2).values.tolist()
    [[3.24, 2.62, 0.0], [0.0, 0.0, 0.0]]
    """
    import pandas as pd

    if not isinstance(factors, Iterable) or isinstance(factors, str):
        raise ValueError(f"Expected factors to be a sequence of numbers, got {quoted(factors)}.")
    factors = [check_number("each of factors", factor, above=0) for factor in factors]
    spread = check_number("spread", spread, at_least=0)
    n_scenarios = check_integer("n_scenarios", n_scenarios, at_least=1)
    rng = np.random.default_rng(check_integer("seed", seed, at_least=0))
    front = Candidates(mission, plans)
    arc_of = _mission_arcs(mission)
    exponents = [np.full(len(arc_of), factor) for factor in factors]
    if spread:
        n_arcs = len(mission.graph.edges)
        drawn = (rng.standard_normal(n_arcs)[arc_of] for _ in range(n_scenarios))
        exponents += [np.exp(spread * normal) for normal in drawn]
    low, high = front.objectives.copy(), front.objectives.copy()
    regret = _regrets(front.objectives)
    for exponent in exponents:
        objectives = _evaluate(mission, front.batch, mission.arrays.survival**exponent)
        low, high = np.minimum(low, objectives), np.maximum(high, objectives)
        regret = np.maximum(regret, _regrets(objectives))
    columns: dict[str, Any] = {"plan_id": np.arange(len(front.plans))}
    for column, name in enumerate(("reward", "survivors")):
        columns[name] = front.objectives[:, column]
        columns[f"{name}_low"], columns[f"{name}_high"] = low[:, column], high[:, column]
        columns[f"{name}_regret"] = regret[:, column]
    return pd.DataFrame(columns)


def _mission_arcs(mission: Mission) -> OffsetArray:
    """Return for each arc of ``mission.arrays`` which arc of the mission it is, of all kinds."""
    n, (tail, head) = len(mission.nodes), np.array([mission.arrays.tail, mission.arrays.head])
    arcs = sorted(mission.index(u) * n + mission.index(v) for u, v in mission.graph.edges)
    found: OffsetArray = np.searchsorted(arcs, tail % n * n + head % n)
    return found


def _evaluate(mission: Mission, batch: PlanBatch, survival: FloatArray) -> FloatArray:
    """Compute the objectives (n_plans, 2) with other survivals of the arcs."""
    survival.setflags(write=False)  # as numba has compiled it
    values = kernels.new_values(len(batch), batch.n_robots)
    graph = mission.arrays._replace(survival=survival)
    kernels.evaluate(graph, *batch.arrays, batch.n_robots, True, values)
    return values.objectives


def _regrets(objectives: FloatArray) -> FloatArray:
    """Compute each plan's regret in both objectives (n_plans, 2), as in :func:`robustness`."""
    regrets = np.empty_like(objectives)
    for column in (0, 1):
        wanted, kept = objectives[:, column], objectives[:, 1 - column]
        order = np.argsort(-kept, kind="stable")
        best = np.maximum.accumulate(wanted[order])
        last = np.searchsorted(-kept[order], -kept, side="right") - 1  # equals count, too
        regrets[:, column] = best[last] - wanted
    return regrets


def after_losses(mission: Mission, plans: Plans, alpha: int = 1) -> pd.DataFrame:
    """Compute E[R] of the remaining robots after the worst loss of robots before the start.

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans.
    alpha
        How many robots are lost, from 0 to all of them.

    Returns
    -------
    pandas.DataFrame
        A row for each plan: ``plan_id``, ``reward`` as planned, ``reward_left``, the E[R] of the
        other robots on the same trails, and ``lost``, the robots whose loss costs most, a tuple of
        their numbers from 0. All subsets are compared; of equal ones the first is named. A robot
        that is lost before the start collects only what it has where it starts.

    Raises
    ------
    ValueError
        If there is no plan, ``alpha`` is out of its range, or there are more than 100 000 subsets.
    PlanError
        If a plan is not valid for the mission.

    Notes
    -----
    The robust team orienteering problem: Shi, Zhou and Tokekar, "Robust multiple-path orienteering
    problem: securing against adversarial attacks", Robotics: Science and Systems, 2020.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import after_losses
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> after_losses(toy, [plan], 1)[["reward", "reward_left", "lost"]].round(2).values.tolist()
    [[3.24, 0.0, (0,)]]
    """
    import pandas as pd

    alpha = check_integer("alpha", alpha, at_least=0, at_most=check_mission(mission).robots)
    if (n_subsets := comb(mission.robots, alpha)) > _MAX_SUBSETS:
        raise ValueError(
            f"Expected at most {_MAX_SUBSETS:,} subsets of robots, got {n_subsets:,} of {alpha} "
            f"among {mission.robots}; lower alpha."
        )
    front = Candidates(mission, plans)
    subsets = np.array(list(combinations(range(mission.robots), alpha)), dtype=np.int64)
    left, lost = [], []
    for plan in front.plans:
        rewards = _rewards_without(mission, plan, subsets)
        worst = int(rewards.argmin())
        left.append(float(rewards[worst]))
        lost.append(tuple(subsets[worst].tolist()))
    columns = {"reward": front.objectives[:, 0], "reward_left": left, "lost": lost}
    return pd.DataFrame({"plan_id": np.arange(len(front.plans)), **columns})


def _rewards_without(mission: Mission, plan: TrailPlan, subsets: OffsetArray) -> FloatArray:
    """Compute E[R] of a plan without the robots of each subset (n_subsets, alpha)."""
    present = np.ones((plan.n_robots, len(subsets)), dtype=bool)
    np.put_along_axis(present, subsets.T, False, axis=0)
    collected, at_start = collect_probabilities(mission, plan), _collected_at_start(mission)
    rewards, base = np.zeros(len(subsets)), mission.index(mission.base)
    for node in [base, *np.setdiff1d(np.flatnonzero(collected.any(axis=0)), base)]:
        visitors = np.flatnonzero(collected[:, node])
        chances = (of[visitors, node, None] for of in (collected, at_start))
        missed = 1 - np.where(present[visitors], *chances)
        rewards += mission.rewards[node] * (1 - missed.prod(axis=0))
    return rewards


def _collected_at_start(mission: Mission) -> FloatArray:
    """Compute with what probability robots that never leave collect rewards (robots, n_nodes)."""
    collected, kinds = np.zeros((mission.robots, len(mission.nodes))), mission.arrays.kinds
    if kinds is None:
        collected[:, mission.arrays.base] = 1.0
    else:
        paid = kinds.credit[kinds.start] != AT_NEXT_DEPOT
        where = np.arange(mission.robots), kinds.origin[kinds.start]
        collected[where] = kinds.share[kinds.start] * paid
        for robot in np.flatnonzero(kinds.credit[kinds.start] == AT_THIS_DEPOT):
            aboard = kinds.aboard[kinds.aboard_first[robot] : kinds.aboard_stop[robot]]
            layer = kinds.start[robot] - kinds.origin[kinds.start[robot]]
            collected[robot, aboard] = kinds.share[layer + aboard]
    return collected
