"""pymoo's genetic algorithms, wired with operators for trail plans: by name or by dotted path."""

import functools
import inspect
from collections.abc import Callable, Mapping
from pkgutil import resolve_name
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.algorithms.moo.moead import ParallelMOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.sms import SMSEMOA
from pymoo.algorithms.moo.spea2 import SPEA2
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.decomposition.tchebicheff import Tchebicheff

from botohe_moo.algorithms.genetic.population import (
    PopulationAlgorithm,
    PopulationSize,
    even_weights,
)
from botohe_moo.base.parameters import Count, Probability, checked
from botohe_moo.base.types import FloatArray
from botohe_moo.problem import BOTOHE


class PlanGeneticAlgorithm(PopulationAlgorithm):
    """A genetic algorithm of pymoo's with operators for trail plans.

    Write it before a class of pymoo's, like :class:`PopulationAlgorithm`, whose options it takes.

    Parameters
    ----------
    arguments
        What the pymoo class is made with besides its operators and both sizes.
    pop_size
        Plans in the population.
    n_offsprings
        Plans that a generation adds; default: as pymoo has it, mostly the size of the population.
    **options
        Operators, and pymoo's own options.
    """

    @checked
    def __init__(
        self,
        arguments: Mapping[str, Any] = MappingProxyType({}),
        *,
        pop_size: PopulationSize = 100,
        n_offsprings: Count | None = None,
        **options: Any,
    ) -> None:
        sizes = {"pop_size": pop_size} | ({"n_offsprings": n_offsprings} if n_offsprings else {})
        super().__init__({**sizes, **arguments}, **options)


class PlanNSGA2(PlanGeneticAlgorithm, NSGA2):
    """NSGA-II with operators for trail plans.

    Its parameters are ``pop_size``, ``n_offsprings`` (plans that a generation adds, by default
    ``pop_size``) and those of :class:`PopulationAlgorithm`.

    Notes
    -----
    Deb, Pratap, Agarwal and Meyarivan, "A fast and elitist multiobjective genetic algorithm:
    NSGA-II", IEEE Transactions on Evolutionary Computation 6(2), 2002.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, load_mission
    >>> from botohe_moo.algorithms import PlanNSGA2
    >>> algorithm = PlanNSGA2(pop_size=50, mutation="ruin")
    >>> result = minimize(BOTOHE(load_mission("art_museum")), algorithm, ("n_eval", 120), seed=1)
    >>> result.algorithm.evaluator.n_eval
    120
    """


class PlanSMSEMOA(PlanGeneticAlgorithm, SMSEMOA):
    """SMS-EMOA with operators for trail plans.

    Its parameters are ``pop_size``, ``n_offsprings`` (plans that a generation adds, by default
    ``pop_size``) and those of :class:`PopulationAlgorithm`.

    Notes
    -----
    Beume, Naujoks and Emmerich, "SMS-EMOA: multiobjective selection based on dominated
    hypervolume", European Journal of Operational Research 181(3), 2007.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, area_indicator, load_mission
    >>> from botohe_moo.algorithms import PlanSMSEMOA
    >>> toy = load_mission("toy")
    >>> algorithm = PlanSMSEMOA(pop_size=20, mutation={"ruin": 2, "share": 1})
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """


class PlanSPEA2(PlanGeneticAlgorithm, SPEA2):
    """SPEA2 with operators for trail plans.

    Its parameters are ``pop_size``, ``n_offsprings`` (plans that a generation adds, by default
    ``pop_size``) and those of :class:`PopulationAlgorithm`.

    Notes
    -----
    Zitzler, Laumanns and Thiele, "SPEA2: improving the strength Pareto evolutionary algorithm",
    TIK report 103, ETH Zurich, 2001.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, area_indicator, load_mission
    >>> from botohe_moo.algorithms import PlanSPEA2
    >>> toy = load_mission("toy")
    >>> algorithm = PlanSPEA2(pop_size=20, crossover="splice")
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """


class _BoundedTchebicheff(Tchebicheff):
    """Tchebicheff with each objective measured by its bound."""

    def __init__(self, bounds: FloatArray) -> None:
        super().__init__()
        self.bounds = bounds

    def _do(self, F: FloatArray, weights: FloatArray, **_: Any) -> FloatArray:
        distances: FloatArray = np.abs(F - self.utopian_point) / self.bounds * weights
        return np.asarray(distances.max(axis=1))


class PlanMOEAD(PopulationAlgorithm, ParallelMOEAD):
    """MOEA/D with operators for trail plans.

    The weights are spread evenly. Objectives are divided by their bounds, total reward and team
    size. A feasible plan replaces an infeasible one; of two infeasible plans, the one with the
    smaller violation replaces the other. This is pymoo's ``ParallelMOEAD``, since ``MOEAD`` cannot
    be pickled within a run.

    Parameters
    ----------
    pop_size
        Weights, and plans in the population.
    n_neighbors
        Neighbouring weights whose plans mate, and whose plan a child may replace; at most
        ``pop_size``.
    prob_neighbor_mating
        Probability of mating among neighbours rather than all.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Notes
    -----
    Zhang and Li, "MOEA/D: a multiobjective evolutionary algorithm based on decomposition", IEEE
    Transactions on Evolutionary Computation 11(6), 2007; constraints as in Jan and Khanum, "A
    study of two penalty-parameterless constraint handling techniques in the framework of MOEA/D",
    Applied Soft Computing 13(1), 2013.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, area_indicator, load_mission
    >>> from botohe_moo.algorithms import PlanMOEAD
    >>> toy = load_mission("toy")
    >>> algorithm = PlanMOEAD(pop_size=20)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """

    # pymoo draws one of each mating's children, but from pools that mix matings.
    _n_children = 1

    indices: Any

    @checked
    def __init__(
        self,
        *,
        pop_size: PopulationSize = 100,
        n_neighbors: Annotated[int, Field(ge=2)] = 20,
        prob_neighbor_mating: Probability = 0.9,
        **options: Any,
    ) -> None:
        arguments = {
            "ref_dirs": even_weights(pop_size),
            "n_neighbors": min(n_neighbors, pop_size),
            "prob_neighbor_mating": prob_neighbor_mating,
        }
        super().__init__(arguments, **options)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        distances = np.abs(self.ref_dirs[:, :1] - self.ref_dirs[:, 0])
        self.neighbors = np.argsort(distances, axis=1, kind="stable")[:, : self.n_neighbors]
        bounds = np.array(problem.objectives.bounds)
        self.decomposition = _BoundedTchebicheff(np.where(bounds > 0, bounds, 1.0))

    def _initialize_advance(self, infills: Population, **kwargs: Any) -> None:
        super()._initialize_advance(infills, **kwargs)
        self._update_ideal()
        if len(infills) <= self.pop_size:
            return
        # More plans to start from than weights: each weight takes its best.
        best = infills[infills.get("CV")[:, 0] == infills.get("CV").min()]
        values = self.decomposition.do(
            best.get("F"), self.ref_dirs, _type="many_to_many", ideal_point=self.ideal
        )
        self.pop = best[values.argmin(axis=0)]

    def _advance(self, infills: Population, **_: Any) -> None:
        self._update_ideal()
        for weight, child in zip(self.indices, infills, strict=False):  # or the budget has ended
            self._replace(weight, child)

    def _update_ideal(self) -> None:
        """Set the ideal point to that of the archive; pymoo's includes infeasible plans."""
        if len(self.archive):
            self.ideal = -self.archive.objectives.max(axis=0)

    def _replace(self, weight: int, child: Individual) -> None:
        """Replace each plan of a neighbouring weight that is worse than the child by the child."""
        near = self.neighbors[weight]
        rivals, weights = self.pop[near], self.ref_dirs[near]
        values = self.decomposition.do(rivals.get("F"), weights, ideal_point=self.ideal)
        value = self.decomposition.do(child.F[np.newaxis], weights, ideal_point=self.ideal)
        violations, violation = rivals.get("CV")[:, 0], child.CV[0]
        better = (violation < violations) | ((violation == violations) & (value < values))
        self.pop[near[better]] = child


# Parameters of pymoo's that this package sets, or the caller of ``minimize``.
_TAKEN_CARE_OF = frozenset(
    {"sampling", "crossover", "mutation", "repair", "eliminate_duplicates", "output", "mating"}
    | {"pop_size", "n_offsprings"}
)
# Objects that belong to the algorithm: users do not give them.
_INNER = frozenset({"selection", "survival"})

# Classes that cannot keep what all algorithms promise, and why, by module.
_REFUSED = {
    "pymoo.algorithms.soo": "it minimises one objective",
    "pymoo.algorithms.moo.ctaea": (
        "it never ends where there are fewer plans than directions, which is what leaving out "
        "duplicates does"
    ),
    "pymoo.algorithms.moo.dnsga2": "it evaluates plans beside any budget, for problems that change",
    "pymoo.algorithms.moo.kgb": "it evaluates plans beside any budget, for problems that change",
    "pymoo.algorithms.moo.moead": "it is wired already, as 'moead'",
    "pymoo.algorithms.moo.omni": "it measures distances between real vectors",
    "pymoo.algorithms.moo.pinsga2": "it asks for answers at the keyboard",
}

_DIRECTIONS = """

Parameters
----------
ref_dirs
    Directions, shape (n, 2), as many as plans in the population; default: ``pop_size`` of them,
    spread evenly.
"""


def wired(path: str, found: Callable[..., Any]) -> Callable[..., Any]:
    """Return a class of pymoo's with this package's operators; return other factories as they are.

    A ValueError is raised for a class of pymoo's that is not population-based or cannot be wired.
    """
    if getattr(found, "__module__", "").partition(".")[0] != "pymoo":
        return found
    if not (isinstance(found, type) and issubclass(found, GeneticAlgorithm)):
        expected = "a population-based class of pymoo's, derived from GeneticAlgorithm"
        raise ValueError(f"Algorithm {path!r}: expected {expected}, got {found!r}.")
    for module, reason in _REFUSED.items():
        if f"{found.__module__}.".startswith(f"{module}."):
            raise ValueError(f"Algorithm {path!r}: cannot be wired; {reason}.")
    return _wire(path, found)


@functools.cache
def _wire(path: str, wrapped: type[GeneticAlgorithm]) -> type[PlanGeneticAlgorithm]:
    """Derive a class from one of pymoo's; it states the parameters of both."""
    own = {
        name: parameter
        for name, parameter in inspect.signature(wrapped).parameters.items()
        if name not in _TAKEN_CARE_OF and parameter.kind is parameter.POSITIONAL_OR_KEYWORD
    }
    directed = "ref_dirs" in own
    directions = _DIRECTIONS if directed else ""
    if directed:
        own["ref_dirs"] = own["ref_dirs"].replace(default=None, annotation=np.ndarray | None)

    class Wired(PlanGeneticAlgorithm, wrapped):
        __doc__ = f"{wrapped.__name__} of pymoo's, with operators for trail plans.{directions}"

        @checked
        def __init__(self, *, pop_size: PopulationSize = 100, **parameters: Any) -> None:
            arguments = {name: parameters.pop(name) for name in own if name in parameters}
            if directed:  # there are as many plans as directions
                if arguments.get("ref_dirs") is None:
                    arguments["ref_dirs"] = even_weights(pop_size)
                pop_size = len(arguments["ref_dirs"])
            super().__init__(arguments, pop_size=pop_size, **parameters)

        def __reduce_ex__(self, _: object) -> tuple[object, ...]:
            return _revive, (path,), self.__dict__

    Wired.__name__ = Wired.__qualname__ = wrapped.__name__
    inherited = inspect.signature(PlanGeneticAlgorithm).parameters.values()
    pop_size, n_offsprings, *operators, _ = inherited
    shown = [_stated(parameter) for name, parameter in own.items() if name not in _INNER]
    Wired.__signature__ = inspect.Signature([pop_size, n_offsprings, *shown, *operators])
    return Wired


def _stated(parameter: inspect.Parameter) -> inspect.Parameter:
    """Return a keyword-only parameter, with the type of its default where pymoo states none."""
    shown = type(parameter.default)
    annotation = parameter.annotation
    if annotation is parameter.empty and shown in (int, float, bool, str):
        annotation = shown
    return parameter.replace(kind=parameter.KEYWORD_ONLY, annotation=annotation)


def _revive(path: str) -> PlanGeneticAlgorithm:
    """Make an empty instance for unpickling: pickle does not find derived classes by name."""
    found = _wire(path, resolve_name(path))
    return found.__new__(found)
