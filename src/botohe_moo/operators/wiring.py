"""Operators as algorithms and study files speak of them: by their names, or names with weights."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.sampling import Sampling

from botohe_moo._base.checks import ParameterError, check_weights, quoted
from botohe_moo._base.types import ObjectArray, Rng
from botohe_moo.operators.base import Mixture
from botohe_moo.operators.crossover import MixedCrossover
from botohe_moo.operators.mutation import MixedMutation, PlanMutation
from botohe_moo.operators.naming import (
    BUILT_IN,
    check_operator,
    find_operator,
    make_operator,
)
from botohe_moo.operators.repair import PlanRepair
from botohe_moo.operators.sampling import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
)
from botohe_moo.problem import BOTOHE

# One operator's name, or several with their weights.
Weights: TypeAlias = str | Mapping[str, float]

# Chosen from the ablation that `make bench` prints (results/operators/ablation.csv).
DEFAULT_CROSSOVER: Mapping[str, float] = {"exchange": 1.0, "splice": 3.0}
DEFAULT_MUTATION: Mapping[str, float] = {"ruin": 1.0, "moves": 0.5, "share": 0.2}


def _weights(what: str, given: Any, *, needed: str = "") -> dict[str, float]:
    """Read one name, or a mapping from names to weights; those of weight 0 are left out."""
    if isinstance(given, str):
        return {given: 1.0}
    if not isinstance(given, Mapping):
        known = f"{', '.join(BUILT_IN[what])}, a registered name or module:Class"
        expected = f"{what} to be one of {known}, a mapping from them to weights"
        message = f"Expected {expected}, or a pymoo operator, got {quoted(given)}."
        raise ParameterError(message, what)
    for name in given:
        find_operator(what, name)
    weights = check_weights(what, given, given, needed=needed)
    return {name: weight for name, weight in weights.items() if weight}


def _made(what: str, weights: Mapping[str, float], plans: type, **offered: Any) -> dict[Any, float]:
    """Make several operators; only those for plans can be mixed."""
    made = {name: make_operator(what, name, **offered) for name in weights}
    for name, operator in made.items():
        if len(made) > 1:
            check_operator(what, name, operator, plans)
    return {made[name]: weight for name, weight in weights.items()}


def make_repair(given: str | PlanRepair) -> PlanRepair:
    """Make the repair of that name: ``safest-path``, ``truncate``, ``penalty`` or another's."""
    if isinstance(given, PlanRepair):
        return given
    made = make_operator("repair", given)
    check_operator("repair", given, made, PlanRepair)
    return made  # type: ignore[no-any-return]


def make_sampling(given: Weights | Sampling | Any, *, corners: bool = True) -> Sampling:
    """Make a sampling of ``guided``, ``random`` and others, given one name or names with weights.

    A pymoo sampling is given back; to trail plans others are added where they are too few. With
    ``corners`` the corners of the front are among the plans.
    """
    if isinstance(given, Sampling):
        return given
    if not isinstance(given, str | Mapping):
        rest = GuidedTrailSampling()
        return GivenSampling(given, CornerSampling(rest) if corners else rest)
    made = _made("sampling", _weights("sampling", given, needed="sampling"), PlanSampling)
    first = next(iter(made))
    if not isinstance(first, PlanSampling):
        return first
    sampling = MixedSampling(made)
    return CornerSampling(sampling) if corners else sampling


def make_crossover(
    given: Weights | Crossover, *, prob: float, repair: PlanRepair, n_offsprings: int = 2
) -> Crossover:
    """Make a crossover of ``exchange``, ``splice`` and others; a pymoo crossover is given back.

    Without any weight above 0, no pair is crossed.
    """
    if isinstance(given, Crossover):
        return given
    weights = _weights("crossover", given)
    if not weights.keys() <= BUILT_IN["crossover"].keys():
        offered = {"prob": prob, "repair": repair, "n_offsprings": n_offsprings}
        made = _made("crossover", weights, Crossover, **offered)
        return next(iter(made)) if len(made) == 1 else _CrossoverMixture(made, prob=prob)
    total = sum(weights.values())
    return MixedCrossover(
        prob_splice=weights.get("splice", 0.0) / total if total else 0.0,
        prob=prob if total else 0.0,
        n_offsprings=n_offsprings,
        repair=repair,
    )


def make_mutation(given: Weights | Mutation, *, prob: float, repair: PlanRepair) -> Mutation:
    """Make a mutation of ``home``, ``moves``, ``ruin``, ``share`` and others.

    A pymoo mutation is given back.
    """
    if isinstance(given, Mutation):
        return given
    weights = _weights("mutation", given, needed="mutation")
    made = _made("mutation", weights, PlanMutation, prob=prob, repair=repair)
    first = next(iter(made))
    return MixedMutation(made, prob=prob) if isinstance(first, PlanMutation) else first


class _CrossoverMixture(Crossover):
    """One of several crossovers, drawn for each pair; their own ``prob`` does not matter."""

    def __init__(self, crossovers: Mapping[Crossover, float], *, prob: float) -> None:
        self.mixture = Mixture("crossover", Crossover, crossovers)
        shapes = {(part.n_parents, part.n_offsprings) for part in self.mixture.parts}
        if len(shapes) > 1:
            found = " and ".join(f"{parents} and {born}" for parents, born in sorted(shapes))
            raise ParameterError(
                "Expected crossovers that are mixed to have as many parents and children as each "
                f"other, got {found}.",
                "crossover",
            )
        super().__init__(*shapes.pop(), prob=prob)

    def _do(
        self, problem: BOTOHE, X: ObjectArray, *args: Any, random_state: Rng, **options: Any
    ) -> ObjectArray:
        children = np.empty((self.n_offsprings, *X.shape[1:]), dtype=object)
        shares = self.mixture.draw(random_state, X.shape[1])
        for part, chosen in zip(self.mixture.parts, shares, strict=True):
            if len(chosen):
                pairs = X[:, chosen]
                children[:, chosen] = part._do(
                    problem, pairs, *args, random_state=random_state, **options
                )
        return children
