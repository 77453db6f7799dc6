"""Plans under other survivals than expected, and without some of their robots."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo.base.messages import check_integer, check_number, quoted
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.core import evaluate as kernels
from botohe_moo.decide.judging import Candidates
from botohe_moo.decide.losses import worst_losses
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch, Plans

if TYPE_CHECKING:
    import pandas as pd


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
        objectives = _evaluate(mission, front.batch, mission.world.graph.survival**exponent)
        low, high = np.minimum(low, objectives), np.maximum(high, objectives)
        regret = np.maximum(regret, _regrets(objectives))
    columns: dict[str, Any] = {"plan_id": np.arange(len(front.plans))}
    for column, name in enumerate(("reward", "survivors")):
        columns[name] = front.objectives[:, column]
        columns[f"{name}_low"], columns[f"{name}_high"] = low[:, column], high[:, column]
        columns[f"{name}_regret"] = regret[:, column]
    return pd.DataFrame(columns)


def _mission_arcs(mission: Mission) -> OffsetArray:
    """Return for each arc of ``mission.world`` which arc of the mission it is, of all kinds."""
    n, graph = len(mission.nodes), mission.world.graph
    tail, head = np.array([graph.tail, graph.head])
    arcs = sorted(mission.index(u) * n + mission.index(v) for u, v in mission.graph.edges)
    found: OffsetArray = np.searchsorted(arcs, tail % n * n + head % n)
    return found


def _evaluate(mission: Mission, batch: PlanBatch, survival: FloatArray) -> FloatArray:
    """Compute the objectives (n_plans, 2) with other survivals of the arcs."""
    survival.setflags(write=False)  # as numba has compiled it
    values = kernels.new_values(len(batch), batch.n_robots)
    world = mission.world
    world = world._replace(graph=world.graph._replace(survival=survival))
    kernels.evaluate(world, *batch.arrays, True, values)
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

    front, losses = Candidates(mission, plans), _check_losses(mission, "alpha", alpha)
    worst = [worst_losses(mission, plan, losses) for plan in front.plans]
    left, lost = zip(*worst, strict=True)
    columns = {"reward": front.objectives[:, 0], "reward_left": left, "lost": lost}
    return pd.DataFrame({"plan_id": np.arange(len(front)), **columns})


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
    front, losses = Candidates(mission, plans), _check_losses(mission, "losses", losses)
    return np.array([worst_losses(mission, plan, losses)[0] for plan in front.plans])


def _check_losses(mission: Mission, name: str, losses: int) -> int:
    return check_integer(name, losses, at_least=0, at_most=mission.robots)
