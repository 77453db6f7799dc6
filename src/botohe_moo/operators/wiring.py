"""Operators by name, as algorithms and study files speak of them."""

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.sampling import Sampling

from botohe_moo._base.checks import ParameterError, check_choice, check_weights, quoted
from botohe_moo.operators.crossover import MixedCrossover, TrailExchange, TrailSplice
from botohe_moo.operators.mutation import (
    MixedMutation,
    PlanMutation,
    RuinRecreate,
    SendHome,
    ShareTrails,
    TrailMoves,
)
from botohe_moo.operators.repair import PenaltyOnly, PlanRepair, SafestPathRepair, TruncateRepair
from botohe_moo.operators.sampling import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
    RandomTrailSampling,
)

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


def _weights(
    what: str, given: Any, known: Mapping[str, Any], *, needed: str = ""
) -> dict[str, float]:
    """Read one name, or a mapping from names to weights; those of weight 0 are left out."""
    if isinstance(given, str):
        check_choice(what, given, known)
        return {given: 1.0}
    if not isinstance(given, Mapping):
        expected = f"{what} to be one of {', '.join(known)}, a mapping from them to weights"
        message = f"Expected {expected}, or a pymoo operator, got {quoted(given)}."
        raise ParameterError(message, what)
    weights = check_weights(what, given, known, needed=needed)
    return {name: weight for name, weight in weights.items() if weight}


def make_repair(given: str | PlanRepair) -> PlanRepair:
    """Make the repair of that name: ``safest-path``, ``truncate`` or ``penalty``."""
    if isinstance(given, PlanRepair):
        return given
    check_choice("repair", given, REPAIRS)
    return REPAIRS[given]()


def make_sampling(given: Weights | Sampling | Any, *, corners: bool = True) -> Sampling:
    """Make a sampling of ``guided`` and ``random``, given one name or several with their weights.

    A pymoo sampling is given back; to trail plans others are added where they are too few. With
    ``corners`` the corners of the front are among the plans.
    """
    if isinstance(given, Sampling):
        return given
    if not isinstance(given, str | Mapping):
        rest = GuidedTrailSampling()
        return GivenSampling(given, CornerSampling(rest) if corners else rest)
    weights = _weights("sampling", given, SAMPLINGS, needed="sampling")
    sampling = MixedSampling({SAMPLINGS[name](): weight for name, weight in weights.items()})
    return CornerSampling(sampling) if corners else sampling


def make_crossover(
    given: Weights | Crossover, *, prob: float, repair: PlanRepair, n_offsprings: int = 2
) -> Crossover:
    """Make a crossover of ``exchange`` and ``splice``; a pymoo crossover is given back.

    Without any weight above 0, no pair is crossed.
    """
    if isinstance(given, Crossover):
        return given
    weights = _weights("crossover", given, CROSSOVERS)
    total = sum(weights.values())
    return MixedCrossover(
        prob_splice=weights.get("splice", 0.0) / total if total else 0.0,
        prob=prob if total else 0.0,
        n_offsprings=n_offsprings,
        repair=repair,
    )


def make_mutation(given: Weights | Mutation, *, prob: float, repair: PlanRepair) -> Mutation:
    """Make a mutation of ``home``, ``moves``, ``ruin`` and ``share``; a pymoo one is given back."""
    if isinstance(given, Mutation):
        return given
    weights = _weights("mutation", given, MUTATIONS, needed="mutation")
    made = {MUTATIONS[name](repair=repair): weight for name, weight in weights.items()}
    return MixedMutation(made, prob=prob)
