"""pymoo's population-based algorithms, wired with operators for trail plans and an archive."""

from __future__ import annotations

import copy
import inspect
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from pymoo.algorithms.moo.moead import ParallelMOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.sms import SMSEMOA, LeastHypervolumeContributionSurvival
from pymoo.algorithms.moo.spea2 import SPEA2, SPEA2Survival
from pymoo.core.algorithm import Algorithm
from pymoo.core.crossover import Crossover
from pymoo.core.duplicate import DuplicateElimination, NoDuplicateElimination
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling
from pymoo.decomposition.tchebicheff import Tchebicheff
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

from botohe_moo._checks import check_integer, check_number
from botohe_moo._types import FloatArray, ObjectArray
from botohe_moo.algorithms.base import MAX_TIES, check_budget, check_options, evaluations_left
from botohe_moo.archive import PlanArchive
from botohe_moo.operators.duplicates import PlanDuplicates
from botohe_moo.operators.repair import PenaltyOnly, PlanRepair
from botohe_moo.operators.wiring import (
    DEFAULT_CROSSOVER,
    DEFAULT_MUTATION,
    make_crossover,
    make_mutation,
    make_repair,
    make_sampling,
)
from botohe_moo.problem import BOTOHE, FrontOutput
from botohe_moo.trails import TrailPlan

__all__ = ["PlanMOEAD", "PlanNSGA2", "PlanSMSEMOA", "PlanSPEA2", "PopulationAlgorithm"]


_MAX_SIZE = 1_000_000


class PopulationAlgorithm(Algorithm):
    """What this package adds to a population-based algorithm of pymoo's.

    Operators for trail plans, an external archive, and an exact budget. The population and its
    selection stay what pymoo makes them; ``opt``, and with it the result, is the set of all
    non-dominated feasible plans that were evaluated.

    To be put before a class of pymoo's: ``class PlanNSGA2(PopulationAlgorithm, NSGA2)``.

    Parameters
    ----------
    arguments
        What the pymoo class is made with besides its operators.
    sampling
        Plans to start from: ``guided``, ``random``, a mapping from these to weights, a pymoo
        sampling, or trail plans, to which guided ones are added where they are too few.
    corners
        Whether the corners of the front, everybody at home and the greedy plan for reward alone,
        are among the plans to start from.
    crossover
        ``exchange``, ``splice``, a mapping from these to weights, or a pymoo crossover.
    mutation
        ``home``, ``moves``, ``ruin``, ``share``, a mapping from these to weights, or a pymoo
        mutation.
    repair
        What makes valid plans of the operators' drafts: ``safest-path``, ``truncate`` or
        ``penalty`` (nothing; faults count as constraint violation), or a :class:`PlanRepair`.
        Operators that are given as objects have their own.
    prob_crossover, prob_mutation
        Probability of crossing a pair and of changing a child, in [0, 1].
    max_ties
        Plans with equal objectives but different trails that the archive keeps, at least 1.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or an operator is none.

    Attributes
    ----------
    plan_archive : PlanArchive
        All non-dominated feasible plans found so far.
    repair : PlanRepair
        The repair of the operators that were given by name; ``repair.counts`` tells what it did.
    """

    pop: Population
    is_initialized: bool
    eliminate_duplicates: DuplicateElimination

    # Children of each pair.
    _n_children = 2

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """State the operators' parameters in the signature of a class that takes any."""
        super().__init_subclass__(**kwargs)
        if "__signature__" in vars(cls):
            return
        own = list(inspect.signature(cls.__init__).parameters.values())[1:]
        operators = [
            parameter
            for parameter in inspect.signature(PopulationAlgorithm.__init__).parameters.values()
            if parameter.kind is parameter.KEYWORD_ONLY
        ]
        cls.__signature__ = inspect.Signature([*own[:-1], *operators, own[-1]])

    def __init__(
        self,
        arguments: Mapping[str, Any],
        *,
        sampling: str
        | Mapping[str, float]
        | Sampling
        | Iterable[TrailPlan]
        | ObjectArray = "guided",
        corners: bool = True,
        crossover: str | Mapping[str, float] | Crossover = DEFAULT_CROSSOVER,
        mutation: str | Mapping[str, float] | Mutation = DEFAULT_MUTATION,
        repair: str | PlanRepair = "safest-path",
        prob_crossover: float = 0.9,
        prob_mutation: float = 0.7,
        max_ties: int = 1_000,
        **options: Any,
    ) -> None:
        check_options(self, options)
        self.max_ties = check_integer("max_ties", max_ties, at_least=1, at_most=MAX_TIES)
        self.plan_archive = PlanArchive(1)
        self._least_infeasible: Population | None = None
        made = make_repair(repair)
        operators = {
            "sampling": make_sampling(sampling, corners=corners),
            "crossover": make_crossover(
                crossover, prob=prob_crossover, repair=made, n_offsprings=self._n_children
            ),
            "mutation": make_mutation(mutation, prob=prob_mutation, repair=made),
        }
        super().__init__(**{"output": FrontOutput(), **arguments, **operators, **options})
        self.repair = made
        if self._n_children == 1 and operators["crossover"].n_offsprings != 1:
            raise ValueError(
                f"Expected a crossover with n_offsprings = 1 for {type(self).__name__}, got "
                f"{operators['crossover'].n_offsprings}."
            )
        if getattr(self.mating, "crossover", None) is not operators["crossover"]:
            raise ValueError(
                f"{type(self).__name__} mates in a way of its own, which trail plans do not have."
            )
        self.mating.selection = _picklable(self.mating.selection)
        if not isinstance(self.eliminate_duplicates, NoDuplicateElimination):
            self.eliminate_duplicates = PlanDuplicates()
            for part in (self.initialization, self.mating):
                part.eliminate_duplicates = self.eliminate_duplicates
        # pymoo's own default looks for convergence in a design space that plans do not have.
        self.termination = options.get("termination")

    def setup(self, problem: Any, **kwargs: Any) -> Algorithm:
        """Prepare to solve ``problem``; pymoo's ``minimize`` calls this.

        Without any termination the run ends after 100 000 evaluations.

        Parameters
        ----------
        problem
            What to solve.
        **kwargs
            pymoo's options, such as ``termination`` and ``seed``.

        Raises
        ------
        TypeError
            If ``problem`` is no :class:`BOTOHE`.
        ValueError
            If the budget is less than one evaluation.
        """
        if not isinstance(problem, BOTOHE):
            raise TypeError(f"Expected a BOTOHE problem, got {type(problem).__name__}.")
        if any(isinstance(repair, PenaltyOnly) for repair in self._repairs()):
            problem = problem.allowing_invalid()
        if self.termination is None and kwargs.get("termination") is None:
            kwargs["termination"] = ("n_eval", 100_000)
        self.plan_archive = PlanArchive(problem.mission.robots, max_ties=self.max_ties)
        super().setup(problem, **kwargs)
        check_budget(self.termination)
        return self

    def _repairs(self) -> list[object]:
        """List the repairs of all operators, also of those that were given as objects."""
        mutation = self.mating.mutation
        parts = getattr(getattr(mutation, "mixture", None), "parts", (mutation,))
        return [getattr(part, "plan_repair", None) for part in (self.mating.crossover, *parts)]

    def infill(self) -> Population | None:
        """Give the plans to evaluate next, no more than the budget allows."""
        infills = super().infill()
        return None if infills is None else infills[: evaluations_left(self)]

    def advance(self, infills: Population | None = None, **kwargs: Any) -> Any:
        """Archive what was evaluated, and let pymoo's algorithm go on.

        Parameters
        ----------
        infills
            Evaluated plans.
        **kwargs
            Whatever the pymoo class takes.
        """
        if infills is not None:
            self._archive(infills)
        return super().advance(infills, **kwargs)

    def _archive(self, evaluated: Population) -> None:
        constrained = self.problem.has_constraints()
        feasible = evaluated[evaluated.get("feas")] if constrained else evaluated
        if len(feasible):
            batch = self.problem.mission.batch(feasible.get("X"))
            self.plan_archive.absorb(batch, -feasible.get("F"), feasible)

    @property
    def opt(self) -> Population | None:
        """The archive; the least infeasible plan as long as nothing feasible was found."""
        if len(self.plan_archive):
            return self.plan_archive.population()
        return self._least_infeasible

    @opt.setter
    def opt(self, value: Population | None) -> None:
        self._least_infeasible = value


class PlanNSGA2(PopulationAlgorithm, NSGA2):
    """NSGA-II with operators for trail plans.

    Parameters
    ----------
    pop_size
        Plans in the population, at least 2.
    n_offsprings
        Plans that a generation adds, at least 1; default: as many as the population holds.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Notes
    -----
    Deb, Pratap, Agarwal and Meyarivan, "A fast and elitist multiobjective genetic algorithm:
    NSGA-II", IEEE Transactions on Evolutionary Computation 6(2), 2002.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, load_mission
    >>> algorithm = PlanNSGA2(pop_size=50, mutation="ruin")
    >>> result = minimize(BOTOHE(load_mission("art_museum")), algorithm, ("n_eval", 120), seed=1)
    >>> result.algorithm.evaluator.n_eval
    120
    """

    def __init__(
        self, *, pop_size: int = 100, n_offsprings: int | None = None, **options: Any
    ) -> None:
        arguments = genetic_sizes(pop_size, n_offsprings)
        super().__init__({**arguments, "survival": RankAndCrowding()}, **options)


class PlanSPEA2(PopulationAlgorithm, SPEA2):
    """SPEA2 with operators for trail plans.

    Parameters
    ----------
    pop_size
        Plans in the population, at least 2.
    n_offsprings
        Plans that a generation adds, at least 1; default: as many as the population holds.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Notes
    -----
    Zitzler, Laumanns and Thiele, "SPEA2: improving the strength Pareto evolutionary algorithm",
    TIK report 103, ETH Zurich, 2001.
    """

    def __init__(
        self, *, pop_size: int = 100, n_offsprings: int | None = None, **options: Any
    ) -> None:
        # Of their own: those that pymoo's signature holds remember the fronts of other runs.
        arguments = genetic_sizes(pop_size, n_offsprings)
        super().__init__({**arguments, "survival": SPEA2Survival(normalize=True)}, **options)


class PlanSMSEMOA(PopulationAlgorithm, SMSEMOA):
    """SMS-EMOA with operators for trail plans.

    Parameters
    ----------
    pop_size
        Plans in the population, at least 2.
    n_offsprings
        Plans that a generation adds, at least 1; default: as many as the population holds.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Notes
    -----
    Beume, Naujoks and Emmerich, "SMS-EMOA: multiobjective selection based on dominated
    hypervolume", European Journal of Operational Research 181(3), 2007.
    """

    def __init__(
        self, *, pop_size: int = 100, n_offsprings: int | None = None, **options: Any
    ) -> None:
        arguments = genetic_sizes(pop_size, n_offsprings)
        survival = LeastHypervolumeContributionSurvival()
        super().__init__({**arguments, "survival": survival}, **options)


class _BoundedTchebicheff(Tchebicheff):
    """Tchebicheff with each objective measured by its bound."""

    def __init__(self, bounds: FloatArray) -> None:
        super().__init__()
        self.bounds = bounds

    def _do(self, F: FloatArray, weights: FloatArray, **_: Any) -> FloatArray:
        distances: FloatArray = np.abs(F - self.utopian_point) / self.bounds * weights
        worst: FloatArray = distances.max(axis=1)
        return worst


class PlanMOEAD(PopulationAlgorithm, ParallelMOEAD):
    """MOEA/D with operators for trail plans.

    The weights are spread evenly; objectives are measured by their bounds, total reward and team
    size. A feasible plan replaces an infeasible one, and of two infeasible ones that which violates
    less. All children of a generation are made before the first replaces a neighbour (pymoo's
    ``ParallelMOEAD``): its one-by-one variant cannot be pickled within a run.

    Parameters
    ----------
    pop_size
        Weights, and plans in the population, at least 2.
    n_neighbors
        Weights whose plans mate, and that a child may replace, at least 2; no more than
        ``pop_size`` are taken.
    prob_neighbor_mating
        Probability of mating among neighbours rather than all, in [0, 1].
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Notes
    -----
    Zhang and Li, "MOEA/D: a multiobjective evolutionary algorithm based on decomposition", IEEE
    Transactions on Evolutionary Computation 11(6), 2007; constraints as in Jan and Khanum, "A
    study of two penalty-parameterless constraint handling techniques in the framework of MOEA/D",
    Applied Soft Computing 13(1), 2013.
    """

    # pymoo draws one of each mating's children, but from pools that mix matings.
    _n_children = 1

    indices: Any

    def __init__(
        self,
        *,
        pop_size: int = 100,
        n_neighbors: int = 20,
        prob_neighbor_mating: float = 0.9,
        **options: Any,
    ) -> None:
        pop_size = genetic_sizes(pop_size, None)["pop_size"]
        n_neighbors = check_integer("n_neighbors", n_neighbors, at_least=2)
        arguments = {
            "ref_dirs": even_weights(pop_size),
            "n_neighbors": min(n_neighbors, pop_size),
            "prob_neighbor_mating": check_number(
                "prob_neighbor_mating", prob_neighbor_mating, at_least=0, at_most=1
            ),
        }
        super().__init__(arguments, **options)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        distances = np.abs(self.ref_dirs[:, :1] - self.ref_dirs[:, 0])
        self.neighbors = np.argsort(distances, axis=1, kind="stable")[:, : self.n_neighbors]
        mission = problem.mission
        bounds = np.array([mission.total_reward or 1.0, float(mission.robots)])
        self.decomposition = _BoundedTchebicheff(bounds)

    def _initialize_advance(self, infills: Population, **kwargs: Any) -> None:
        super()._initialize_advance(infills, **kwargs)
        self.ideal = (_feasible(infills) if infills.get("feas").any() else infills).get("F").min(0)
        if len(infills) <= self.pop_size:
            return
        # More plans to start from than weights: each weight takes its best.
        best = infills[infills.get("CV")[:, 0] == infills.get("CV").min()]
        values = self.decomposition.do(
            best.get("F"), self.ref_dirs, _type="many_to_many", ideal_point=self.ideal
        )
        self.pop = best[values.argmin(axis=0)]

    def infill(self) -> Population | None:
        """Give the plans to evaluate next, no more than the budget allows."""
        infills = super().infill()
        if infills is not None and self.indices is not None:
            self.indices = self.indices[: len(infills)]
        return infills

    def _advance(self, infills: Population, **_: Any) -> None:
        # As pymoo's, but for the ideal point, which is that of feasible plans alone.
        self.ideal = np.vstack([self.ideal, _feasible(infills).get("F")]).min(axis=0)
        for k, child in zip(self.indices, infills, strict=True):
            self._replace(k, child)

    def _replace(self, k: int, off: Any) -> None:
        pop, near = self.pop, self.neighbors[k]
        weights = self.ref_dirs[near]
        values = self.decomposition.do(pop[near].get("F"), weights, ideal_point=self.ideal)
        value = self.decomposition.do(off.F[np.newaxis], weights, ideal_point=self.ideal)
        violations = pop[near].get("CV")[:, 0]
        violation = off.CV[0]
        better = (violation < violations) | ((violation == violations) & (value < values))
        pop[near[better]] = off


class _NamedFunction:
    """A function of a module's, found anew after unpickling."""

    def __init__(self, module: str, name: str) -> None:
        self.module, self.name = module, name

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return getattr(sys.modules[self.module], self.name)(*args, **kwargs)


def _picklable(selection: Any) -> Any:
    """Give a tournament that refers to its comparison by name.

    pymoo decorates some of them in a way that pickle cannot follow; a run that cannot be pickled
    cannot be resumed or sent to another process.
    """
    compare = getattr(selection, "func_comp", None)
    for module in [name for name in sys.modules if name.startswith("pymoo.algorithms.moo.")]:
        for name, value in vars(sys.modules[module]).items():
            if compare is not None and value is compare:
                selection = copy.copy(selection)
                selection.func_comp = _NamedFunction(module, name)
                return selection
    return selection


def _feasible(plans: Population) -> Population:
    return plans[plans.get("feas")]


def genetic_sizes(pop_size: int, n_offsprings: int | None) -> dict[str, Any]:
    """Give the sizes that genetic algorithms take; a ValueError says which is out of its range."""
    sizes = {"pop_size": check_integer("pop_size", pop_size, at_least=2, at_most=_MAX_SIZE)}
    if n_offsprings is not None:
        sizes["n_offsprings"] = check_integer(
            "n_offsprings", n_offsprings, at_least=1, at_most=_MAX_SIZE
        )
    return sizes


def even_weights(n: int) -> FloatArray:
    """Spread ``n`` weights on two objectives evenly, shape (n, 2)."""
    weights = np.linspace(0, 1, n)
    return np.column_stack([weights, 1 - weights])
