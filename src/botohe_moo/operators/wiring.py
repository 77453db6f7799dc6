"""Operators by name, as algorithms and study files speak of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias, TypeVar

from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.sampling import Sampling

from botohe_moo._base.checks import check_flag, check_number, nearest_first
from botohe_moo.operators.crossover import MixedCrossover, TrailExchange, TrailSplice
from botohe_moo.operators.mutation import (
    MixedMutation,
    PlanMutation,
    RuinRecreate,
    SendHome,
    ShareTrails,
    TrailMoves,
)
from botohe_moo.operators.repair import (
    PenaltyOnly,
    PlanRepair,
    SafestPathRepair,
    TruncateRepair,
)
from botohe_moo.operators.sampling import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
    RandomTrailSampling,
)

__all__ = [
    "CROSSOVERS",
    "DEFAULT_CROSSOVER",
    "DEFAULT_MUTATION",
    "MUTATIONS",
    "REPAIRS",
    "SAMPLINGS",
    "Weights",
    "make_crossover",
    "make_mutation",
    "make_repair",
    "make_sampling",
]

Made = TypeVar("Made")

# One operator's name, or several with their weights.
Weights: TypeAlias = str | Mapping[str, float]

SAMPLINGS: dict[str, Callable[[], PlanSampling]] = {
    "guided": GuidedTrailSampling,
    "random": RandomTrailSampling,
}
CROSSOVERS = {"exchange": TrailExchange, "splice": TrailSplice}
MUTATIONS: dict[str, Callable[..., PlanMutation]] = {
    "home": SendHome,
    "moves": TrailMoves,
    "ruin": RuinRecreate,
    "share": ShareTrails,
}
# Chosen from the ablation that `make bench` prints (results/operators/ablation.csv).
DEFAULT_CROSSOVER: Mapping[str, float] = {"exchange": 1.0, "splice": 3.0}
DEFAULT_MUTATION: Mapping[str, float] = {"ruin": 1.0, "moves": 0.5, "share": 0.2}
REPAIRS: dict[str, Callable[[], PlanRepair]] = {
    "penalty": PenaltyOnly,
    "safest-path": SafestPathRepair,
    "truncate": TruncateRepair,
}


def _named(what: str, name: Any, known: Mapping[str, Made]) -> Made:
    if not isinstance(name, str) or name not in known:
        among = ", ".join(nearest_first(str(name), known))
        raise ValueError(f"Expected {what} among {among}, got {name!r}.")
    return known[name]


def _weights(what: str, given: Any, known: Mapping[str, Any]) -> dict[str, float]:
    """Read one name, or a mapping from names to weights; those of weight 0 are left out."""
    if isinstance(given, str):
        given = {given: 1.0}
    if not isinstance(given, Mapping):
        names = ", ".join(known)
        raise ValueError(
            f"Expected {what} to be one of {names}, a mapping from them to weights, or a pymoo "
            f"operator, got {given!r}."
        )
    weights = {}
    for name, weight in given.items():
        _named(what, name, known)
        if weight := check_number(f"weight of {what} {name!r}", weight, at_least=0):
            weights[name] = weight
    return weights


def make_repair(given: str | PlanRepair) -> PlanRepair:
    """Make the repair of that name: ``safest-path``, ``truncate`` or ``penalty``.

    Raises
    ------
    ValueError
        If there is none; names those there are.
    """
    return given if isinstance(given, PlanRepair) else _named("repair", given, REPAIRS)()


def make_sampling(given: Weights | Sampling | Any, *, corners: bool = True) -> Sampling:
    """Make a sampling of ``guided`` and ``random``.

    Parameters
    ----------
    given
        A name, a mapping from names to weights, a pymoo sampling, which is given back, or trail
        plans, to which others are added where they are too few.
    corners
        Whether the corners of the front are among the plans.

    Raises
    ------
    ValueError
        If a name is unknown, or a weight out of its range.
    TypeError
        If something given is no trail plan.
    """
    corners = check_flag("corners", corners)
    if isinstance(given, Sampling):
        return given
    if not isinstance(given, str | Mapping):
        rest = GuidedTrailSampling()
        return GivenSampling(given, CornerSampling(rest) if corners else rest)
    weights = _weights("sampling", given, SAMPLINGS)
    if not weights:
        raise ValueError(f"Expected a sampling of weight above 0, got {given!r}.")
    sampling = MixedSampling({SAMPLINGS[name](): weight for name, weight in weights.items()})
    return CornerSampling(sampling) if corners else sampling


def make_crossover(
    given: Weights | Crossover,
    *,
    prob: float,
    repair: PlanRepair,
    n_offsprings: int = 2,
) -> Crossover:
    """Make a crossover of ``exchange`` and ``splice``.

    Parameters
    ----------
    given
        A name, a mapping from names to weights, or a pymoo crossover, which is given back.
    prob, repair, n_offsprings
        As for :class:`PlanCrossover`; no weights are those of probability 0.

    Raises
    ------
    ValueError
        If a name is unknown, or a weight or ``prob`` is out of its range.
    """
    if isinstance(given, Crossover):
        return given
    weights = _weights("crossover", given, CROSSOVERS)
    total = sum(weights.values())
    prob = check_number("prob_crossover", prob, at_least=0, at_most=1)
    return MixedCrossover(
        prob_splice=weights.get("splice", 0.0) / total if total else 0.0,
        prob=prob if total else 0.0,
        n_offsprings=n_offsprings,
        repair=repair,
    )


def make_mutation(given: Weights | Mutation, *, prob: float, repair: PlanRepair) -> Mutation:
    """Make a mutation of ``home``, ``moves``, ``ruin`` and ``share``.

    Parameters
    ----------
    given
        A name, a mapping from names to weights, or a pymoo mutation, which is given back.
    prob, repair
        As for :class:`PlanMutation`.

    Raises
    ------
    ValueError
        If a name is unknown, or a weight or ``prob`` is out of its range.
    """
    if isinstance(given, Mutation):
        return given
    weights = _weights("mutation", given, MUTATIONS)
    if not weights:
        raise ValueError(f"Expected a mutation of weight above 0, got {given!r}.")
    prob = check_number("prob_mutation", prob, at_least=0, at_most=1)
    made = {MUTATIONS[name](repair=repair): weight for name, weight in weights.items()}
    return MixedMutation(made, prob=prob)
