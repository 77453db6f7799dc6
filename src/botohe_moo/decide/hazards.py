"""Plans under other survivals than expected, and without some of their robots."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from itertools import combinations
from math import comb
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from botohe_moo.base.messages import check_integer, check_number, quoted
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
_TIE = 1e-12  # of the reward: sets that are as bad


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
    objectives = objectives_of(mission, batch := check_mission(mission).batch(plans))
    world, n = mission.world, len(mission.nodes)
    # Of each arc of the world which arc of the mission it is: an arc is as wrong for all kinds.
    tail, head = np.array([world.graph.tail, world.graph.head]) % n
    arcs = sorted(mission.index(u) * n + mission.index(v) for u, v in mission.graph.edges)
    arc_of = np.searchsorted(arcs, tail * n + head)
    exponents = [np.full(len(arc_of), factor) for factor in factors]
    if spread:
        drawn = (rng.standard_normal(len(arcs))[arc_of] for _ in range(n_scenarios))
        exponents += [np.exp(spread * normal) for normal in drawn]
    scenarios = [objectives]
    for exponent in exponents:
        survival = world.graph.survival**exponent
        survival.setflags(write=False)  # as numba has compiled it
        values = kernels.new_values(len(batch), batch.n_robots)
        wrong = world._replace(graph=world.graph._replace(survival=survival))
        kernels.evaluate(wrong, *batch.arrays, True, values)
        scenarios.append(values.objectives)
    regret = np.max([_regrets(found) for found in scenarios], axis=0)
    low, high = np.min(scenarios, axis=0), np.max(scenarios, axis=0)
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


def after_losses(mission: Mission, plans: Plans, alpha: int = 1) -> pd.DataFrame:
    """Compute E[R] after the worst loss of robots before the start, and say which robots these are.

    Parameters
    ----------
    mission, plans
        As for :func:`worst_case`, which also says what is raised.
    alpha
        How many robots are lost, from 0 to all of them.

    Returns
    -------
    pandas.DataFrame
        A row for each plan: ``plan_id``, ``reward`` as planned, ``reward_left``, the
        :func:`worst_case`, and ``lost``, the robots whose loss costs most, a tuple of their numbers
        from 0; of equal ones the first. None where ``reward_left`` is a bound.

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

    rewards = objectives_of(mission, batch := check_mission(mission).batch(plans))[:, 0]
    alpha = check_integer("alpha", alpha, at_least=0, at_most=mission.robots)
    worst = [worst_losses(mission, plan, alpha) for plan in batch]
    table = pd.DataFrame(worst, columns=["reward_left", "lost"])
    table.insert(0, "reward", rewards)
    return table.rename_axis("plan_id").reset_index()


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
        Exact where there are at most a million sets of so many robots; else a lower bound.

    Raises
    ------
    ValueError
        If there is no plan, or ``losses`` is out of its range.
    PlanError
        If a plan is not valid for the mission.

    Notes
    -----
    The robust multiple-path orienteering problem: Shi, Zhou and Tokekar, "Robust multiple-path
    orienteering problem: securing against adversarial attacks", Robotics: Science and Systems,
    2020. The lower bound is the largest of three. E[R] is submodular in the set of robots that
    leave, so a loss costs at most what the lost robots collect alone; it is monotone, so at least
    what the best of the others collects alone is left; and no loss costs more than one that is the
    worst at each node.

    Examples
    --------
    >>> from botohe_moo import load_mission, worst_case
    >>> toy = load_mission("toy")
    >>> plans = [toy.plan([[1, 2, 4, 2, 1], [1]]), toy.plan([[1, 2, 4, 2, 1], [1, 3, 1]])]
    >>> worst_case(toy, plans).round(2).tolist()
    [0.0, 0.9]
    """
    objectives_of(mission, batch := check_mission(mission).batch(plans))  # checks them
    losses = check_integer("losses", losses, at_least=0, at_most=mission.robots)
    return np.array([worst_losses(mission, plan, losses)[0] for plan in batch])


def worst_losses(
    mission: Mission, plan: TrailPlan, losses: int
) -> tuple[float, tuple[int, ...] | None]:
    """Compute the worst case of a valid plan, and which robots are lost; None if it is a bound.

    See :func:`botohe_moo.worst_case`.
    """
    found = collected(mission, plan)
    at_start = collected(mission, TrailPlan(trail[:1] for trail in plan.trails))
    paying = np.flatnonzero(found.any(axis=0) & (mission.rewards > 0))
    chances = _Chances(mission.rewards[paying], 1 - found[:, paying], 1 - at_start[:, paying])
    if comb(mission.robots, losses) > _MAX_SETS:
        return chances.bound(losses), None
    sets = _sets(mission.robots, losses)
    left = chances.rewards_without(sets)
    worst = int((left <= left.min() + _TIE * chances.rewards.sum()).argmax())
    return float(left[worst]), tuple(sets[worst].tolist())


@lru_cache(maxsize=1)
def _sets(n_robots: int, losses: int) -> OffsetArray:
    """List the sets of so many robots (n_sets, losses)."""
    sets = np.array(list(combinations(range(n_robots), losses)), dtype=np.int64)
    return sets.reshape(comb(n_robots, losses), losses)


class _Chances(NamedTuple):
    """Rewards (n_rewards), and the probabilities that a robot does not collect them.

    Those are of shape (n_robots, n_rewards): if it follows its trail, and if it never leaves.
    """

    rewards: FloatArray
    missed: FloatArray
    missed_at_start: FloatArray

    def rewards_without(self, sets: OffsetArray) -> FloatArray:
        """Compute E[R] without the robots of each set (n_sets, losses)."""
        with np.errstate(divide="ignore"):
            logs, logs_at_start = (np.maximum(np.log(of), _LOG_OF_ZERO) for of in self[1:])
        left, n_at_once = np.empty(len(sets)), max(1, _CELLS // max(1, self.missed.size))
        for first in range(0, len(sets), n_at_once):
            some = sets[first : first + n_at_once]
            lost = np.zeros((len(some), len(self.missed)))
            np.put_along_axis(lost, some, 1.0, axis=1)
            by_nobody = np.exp((1 - lost) @ logs + lost @ logs_at_start)
            left[first : first + n_at_once] = (1 - by_nobody) @ self.rewards
        return left

    def bound(self, losses: int) -> float:
        """Bound the worst case from below; see :func:`botohe_moo.worst_case`."""
        n = len(self.missed)
        [none], [all_robots], alone = (self.rewards_without(_sets(n, k)) for k in (n, 0, n - 1))
        alone = np.sort(alone)
        by_sum = all_robots - (alone - none)[-losses:].sum()
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(self.missed > 0, self.missed_at_start / self.missed, np.inf)
        lost = np.zeros(self.missed.shape, dtype=bool)
        np.put_along_axis(lost, ratio.argsort(axis=0)[-losses:], True, axis=0)
        by_nobody = np.where(lost, self.missed_at_start, self.missed).prod(axis=0)
        return float(max(by_sum, alone[-losses - 1], (1 - by_nobody) @ self.rewards))
