"""Plans under other survivals than expected, and without some of their robots."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo.base.parameters import NotNegative, Positive, check
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.core import evaluate as kernels
from botohe_moo.decide.fronts import objectives_of
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import collected
from botohe_moo.trails import Plans, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

_MAX_SETS = 1_000_000  # of robots that are lost
_CELLS = 2**20  # numbers that are computed at once
_LOG_OF_ZERO = -750.0  # exp of it is 0


def robustness(
    mission: Mission,
    plans: Plans,
    *,
    factors: Iterable[float] = (0.5, 2.0),
    spread: float = 0.0,
    n_draws: int = 100,
    seed: int = 1,
) -> pd.DataFrame:
    """Compute the objectives of plans if the survivals are wrong, and their regret.

    In each case the survival ω of each arc becomes ω^h. There is one case for each factor h, the
    same for all arcs: 2 doubles every hazard, −log ω, and 0.5 halves it. With ``spread`` there are
    also ``n_draws`` in which h is drawn for each arc, the same for all kinds of robots: log-normal,
    with a median of 1. The expected case, h = 1, is always among them.

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
    n_draws
        How many cases are drawn, at least 1.
    seed
        Seed of these draws, at least 0.

    Returns
    -------
    pandas.DataFrame
        A row for each plan: ``plan_id``, ``reward`` and ``survivors`` as expected; ``reward_low``,
        ``reward_high``, ``survivors_low`` and ``survivors_high``, the band over all cases;
        ``reward_regret`` and ``survivors_regret``, the largest regret over all cases. In one case
        the regret in reward is how much more reward one of these plans would have had with no fewer
        survivors, the regret in survivors how many more survivors with no less reward; both are 0
        for a plan that stays non-dominated.

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

    factors = [check("each of factors", factor, Positive) for factor in factors]
    spread = check("spread", spread, NotNegative)
    n_draws = check("n_draws", n_draws, int, ge=1)
    rng = np.random.default_rng(check("seed", seed, int, ge=0))
    objectives = objectives_of(mission, batch := check_mission(mission).batch(plans))
    world, n = mission.world, len(mission.nodes)
    # Of each arc of the world which arc of the mission it is: an arc is as wrong for all kinds.
    tail, head = np.array([world.graph.tail, world.graph.head]) % n
    arcs = sorted(mission.index(u) * n + mission.index(v) for u, v in mission.graph.edges)
    arc_of = np.searchsorted(arcs, tail * n + head)
    exponents = [np.full(len(arcs), factor) for factor in factors]
    if spread:
        normals = (rng.standard_normal(len(arcs)) for _ in range(n_draws))
        exponents += [np.exp(spread * normal) for normal in normals]
    cases = [objectives]
    for exponent in exponents:
        survival = world.graph.survival ** exponent[arc_of]
        survival.setflags(write=False)  # as numba has compiled it
        values = kernels.new_values(len(batch), batch.n_robots)
        wrong = world._replace(graph=world.graph._replace(survival=survival))
        kernels.evaluate(wrong, *batch.arrays, True, values)
        cases.append(values.objectives)
    regret = np.max([_regrets(found) for found in cases], axis=0)
    low, high = np.min(cases, axis=0), np.max(cases, axis=0)
    columns: dict[str, Any] = {"plan_id": np.arange(len(batch))}
    for column, name in enumerate(("reward", "survivors")):
        columns[name] = objectives[:, column]
        columns[f"{name}_low"], columns[f"{name}_high"] = low[:, column], high[:, column]
        columns[f"{name}_regret"] = regret[:, column]
    return pd.DataFrame(columns)


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


def by_scenario(mission: Mission, plans: Plans) -> pd.DataFrame:
    """Compute what plans are expected to bring in each scenario.

    Parameters
    ----------
    mission
        A mission with scenarios.
    plans
        Its plans.

    Returns
    -------
    pandas.DataFrame
        One row for each plan and scenario: ``plan``, the row in ``plans``, ``scenario``, its
        ``probability``, E[R] as ``reward`` and E[S] as ``survivors``.

    Raises
    ------
    ValueError
        If the mission has no scenarios, or there is no plan.
    PlanError
        If a plan is not valid for the mission.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import by_scenario
    >>> mission = load_mission("toy", scenarios=["storm=0.25,factor=3"])
    >>> by_scenario(mission, [mission.plan([[1, 2, 4, 2, 1], [1]])]).round(2)
       plan   scenario  probability  reward  survivors
    0     0      storm         0.25    2.13       1.28
    1     0  otherwise         0.75    3.24       1.66
    """
    import pandas as pd

    if not check_mission(mission).scenarios:
        raise ValueError(f"Expected a mission with scenarios, got {mission!r}.")
    batch = mission.batch(plans)
    objectives_of(mission, batch)  # checks them
    values = np.stack([one.evaluate(batch) for _, one in mission.in_scenarios], axis=1)
    n_plans, n_scenarios = values.shape[:2]
    columns = {
        "plan": np.repeat(np.arange(n_plans), n_scenarios),
        "scenario": [scenario.name for scenario in mission.scenarios] * n_plans,
        "probability": [scenario.probability for scenario in mission.scenarios] * n_plans,
    }
    columns |= dict(zip(("reward", "survivors"), values.reshape(-1, 2).T, strict=True))
    return pd.DataFrame(columns)


def worst_case(mission: Mission, plans: Plans, losses: int = 1) -> FloatArray:
    """Compute the least E[R] of plans over all sets of robots that never leave, (n_plans,).

    A robot that never leaves collects only what it has where it starts.

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans.
    losses
        How many robots never leave, from 0 to all of them.

    Returns
    -------
    numpy.ndarray
        The least E[R] of each plan.

    Raises
    ------
    ValueError
        If there is no plan, ``losses`` is out of its range, or there are more than a million sets
        of so many robots.
    PlanError
        If a plan is not valid for the mission.

    Notes
    -----
    The robust multiple-path orienteering problem: Shi, Zhou and Tokekar, "Robust multiple-path
    orienteering problem: securing against adversarial attacks", Robotics: Science and Systems,
    2020.

    Examples
    --------
    >>> from botohe_moo import load_mission, worst_case
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([[1, 2, 4, 2, 1], [1]]), toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])]
    >>> worst_case(toy, plans).round(2).tolist()
    [0.0, 0.9]
    """
    objectives_of(mission, batch := check_mission(mission).batch(plans))  # checks them
    losses = check("losses", losses, int, ge=0, le=mission.robots)
    return np.array([worst_loss(mission, plan, losses) for plan in batch])


def worst_loss(mission: Mission, plan: TrailPlan, losses: int) -> float:
    """Compute the worst case of a valid plan; see :func:`botohe_moo.worst_case`."""
    sets = _sets(mission.robots, losses)
    # Of each robot, if it follows its trail, and if it never leaves.
    plans = plan, TrailPlan(trail[:1] for trail in plan.trails)
    size, worst = mission.robots * len(mission.nodes), np.inf
    cases = []
    with np.errstate(divide="ignore"):
        for probability, case in mission.in_scenarios:
            both = [np.maximum(np.log(1 - collected(case, of)), _LOG_OF_ZERO) for of in plans]
            cases.append((*both, probability * case.rewards))
    for some in np.array_split(sets, -(-len(sets) * size // _CELLS)):
        lost, rewards = np.zeros((len(some), mission.robots)), np.zeros(len(some))
        np.put_along_axis(lost, some, 1.0, axis=1)
        for logs, logs_at_start, worth in cases:
            by_nobody = np.exp((1 - lost) @ logs + lost @ logs_at_start)
            rewards += (1 - by_nobody) @ worth
        worst = min(worst, float(rewards.min()))
    return worst


@lru_cache(maxsize=1)
def _sets(n_robots: int, losses: int) -> OffsetArray:
    """List the sets of so many robots (n_sets, losses)."""
    n_sets = comb(n_robots, losses)
    if n_sets > _MAX_SETS:
        expected = f"at most {_MAX_SETS:,} sets of robots that never leave"
        raise ValueError(f"Expected {expected}, got {n_sets:,}: {losses} of {n_robots} robots.")
    sets = np.array(list(combinations(range(n_robots), losses)), dtype=np.int64)
    return sets.reshape(n_sets, losses)
