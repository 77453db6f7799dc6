"""The base of pymoo's population-based algorithms with operators for trail plans."""

import copy
import functools
import inspect
import sys
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import Field
from pymoo.core.algorithm import Algorithm
from pymoo.core.crossover import Crossover
from pymoo.core.duplicate import DuplicateElimination, NoDuplicateElimination
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling

from botohe_moo.algorithms import base
from botohe_moo.algorithms.base import BudgetedAlgorithm, MaxTies, PopulationArchive, Threads
from botohe_moo.algorithms.genetic import sampling as samplings
from botohe_moo.base.parameters import (
    Probability,
    check_keywords,
    check_weights,
    checked,
    signature_parameters,
)
from botohe_moo.base.types import FloatArray, ObjectArray
from botohe_moo.operators import variation
from botohe_moo.operators.variation import KINDS, find_operator, make_operator
from botohe_moo.problem import FrontOutput
from botohe_moo.trails import TrailPlan

PopulationSize: TypeAlias = Annotated[int, Field(ge=2, le=1_000_000)]
# The name of one operator, or of several with their weights.
Named: TypeAlias = str | Mapping[str, float]

# Chosen from the ablation that `make bench` prints (results/operators/ablation.csv).
DEFAULT_CROSSOVER = "splice"
DEFAULT_MUTATION: Mapping[str, float] = {"ruin": 1.0, "share": 0.2}


class PopulationAlgorithm(BudgetedAlgorithm):
    """A population-based algorithm of pymoo's with operators for trail plans.

    Its result is an archive of all non-dominated feasible plans that were evaluated, and its budget
    is exact. The population and its selection stay pymoo's. Write it before a class of pymoo's:
    ``class PlanNSGA2(PopulationAlgorithm, NSGA2)``.

    Parameters
    ----------
    arguments
        What the pymoo class is made with besides its operators, as in the example; by default
        nothing.
    sampling
        Plans to start from: ``guided``, ``random``, a mapping from these to weights, a pymoo
        sampling, or trail plans; if these are too few, guided ones are added. All operators may
        also be named as other packages register them, or as ``module:Class``.
    corners
        Whether the corners of the front, everybody at home and the greedy plan for reward alone,
        are among the plans to start from.
    crossover
        ``splice``, a mapping from names to weights, or a pymoo crossover.
    mutation
        ``ruin``, ``share``, a mapping from names to weights, or a pymoo mutation.
    repair
        How drafts of operators become valid plans: ``safest-path``, ``truncate``, ``penalty`` (not
        at all; faults count as constraint violation), or a :class:`PlanRepair`. Operators that are
        given as objects have repairs of their own.
    prob_crossover, prob_mutation
        Probability of crossing a pair and of changing a child.
    max_ties
        Plans with equal objectives but different trails that the archive keeps.
    n_threads
        Threads that repair plans on large missions; the result does not depend on it.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TypeError
        If an option is unknown.

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated feasible plans found so far.
    settings : dict
        The operators and their probabilities as they were given.
    repair : PlanRepair
        The repair of the operators that were given by name; ``repair.counts`` says what it did.

    Examples
    --------
    >>> from pymoo.algorithms.moo.nsga2 import NSGA2
    >>> from botohe_moo import solve
    >>> from botohe_moo.algorithms import PopulationAlgorithm
    >>> class MyNSGA2(PopulationAlgorithm, NSGA2):
    ...     '''NSGA-II with populations of 30.'''
    ...     def __init__(self, **options):
    ...         super().__init__({"pop_size": 30}, **options)
    >>> solve("toy", MyNSGA2(mutation="ruin"), evaluations=200).evaluations
    200
    """

    pop: Population
    is_initialized: bool
    archive: PopulationArchive
    eliminate_duplicates: DuplicateElimination

    _n_children = 2  # of each pair

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """State the operators' parameters in the signature of a class that takes any."""
        super().__init_subclass__(**kwargs)
        stated = dict(inspect.signature(cls.__init__).parameters)
        if any(parameter.kind is parameter.VAR_KEYWORD for parameter in stated.values()):
            inherited = inspect.signature(PopulationAlgorithm.__init__).parameters
            for name, parameter in inherited.items():
                if parameter.kind is parameter.KEYWORD_ONLY:
                    stated.setdefault(name, parameter)
        shown = [p for name, p in stated.items() if name not in ("self", "arguments")]
        cls.__signature__ = inspect.Signature(sorted(shown, key=lambda p: p.kind))

    @checked
    def __init__(
        self,
        arguments: Mapping[str, Any] = MappingProxyType({}),
        *,
        sampling: Named | Sampling | Iterable[TrailPlan] | ObjectArray = "guided",
        corners: bool = True,
        crossover: Named | Crossover = DEFAULT_CROSSOVER,
        mutation: Named | Mutation = DEFAULT_MUTATION,
        repair: str | variation.PlanRepair = "safest-path",
        prob_crossover: Probability = 0.9,
        prob_mutation: Probability = 0.7,
        max_ties: MaxTies = 1_000,
        n_threads: Threads = 1,
        **options: Any,
    ) -> None:
        base.check_options(self, options)
        mro = type(self).__mro__
        pymoos = mro[mro.index(BudgetedAlgorithm) + 1 :]
        known = {p.name for kind in pymoos for p in signature_parameters(kind)}
        check_keywords(pymoos[0], arguments, known.union(base.PYMOO_OPTIONS))
        self.max_ties = max_ties
        self.settings = {
            "sampling": sampling,
            "corners": corners,
            "crossover": crossover,
            "mutation": mutation,
            "repair": repair,
            "prob_crossover": prob_crossover,
            "prob_mutation": prob_mutation,
        }
        self._least_infeasible: Population | None = None
        if isinstance(repair, variation.PlanRepair):
            made = repair
        else:
            made = make_operator("repair", repair, variation.PlanRepair)
        made.n_threads = self.n_threads = n_threads
        if not isinstance(crossover, Crossover):
            n, prob = self._n_children, prob_crossover
            pairs = make_parts("crossover", crossover, prob=prob, repair=made, n_offsprings=n)
            none = variation.TrailSplice(prob=0.0, n_offsprings=n)
            crossover = variation.MixedCrossover(pairs, prob=prob) if pairs else none
        if not isinstance(mutation, Mutation):
            what, prob = "mutation", prob_mutation
            parts = make_parts(what, mutation, needed=what, prob=prob, repair=made)
            mutation = variation.MixedMutation(parts, prob=prob)
        operators = {
            "sampling": make_sampling(sampling, corners=corners),
            "crossover": crossover,
            "mutation": mutation,
        }
        # Copies: the survivals that pymoo's signatures hold remember the fronts of other runs.
        defaults = {
            name: copy.deepcopy(parameter.default)
            for name, parameter in inspect.signature(pymoos[0]).parameters.items()
            if parameter.default is not parameter.empty
        }
        given = {**defaults, "output": FrontOutput(), **arguments, **operators, **options}
        super().__init__(**given)
        self.archive = PopulationArchive(1)
        self.repair = made
        self._adapt_mating(crossover, pymoos)
        # pymoo's own default looks for convergence in a design space that plans do not have.
        self.termination = options.get("termination")

    def _adapt_mating(self, crossover: Crossover, pymoos: Iterable[type]) -> None:
        """Make the mating of pymoo's class work on trail plans; a ValueError says why it cannot."""
        name = type(self).__name__
        if self._n_children == 1 and crossover.n_offsprings != 1:
            expected = f"a crossover with n_offsprings = 1 for {name}"
            raise ValueError(f"Expected {expected}, got {crossover.n_offsprings}.")
        if getattr(self.mating, "crossover", None) is not crossover:
            raise ValueError(f"{name} mates in a way of its own, which trail plans do not have.")
        self.mating.selection = _picklable(self.mating.selection, pymoos)
        if not isinstance(self.eliminate_duplicates, NoDuplicateElimination):
            self.eliminate_duplicates = variation.PlanDuplicates()
            for part in (self.initialization, self.mating):
                part.eliminate_duplicates = self.eliminate_duplicates

    def setup(self, problem: Any, **kwargs: Any) -> Algorithm:
        """Prepare to solve ``problem``; pymoo's ``minimize`` calls this.

        Parameters
        ----------
        problem
            A :class:`BOTOHE`. A TypeError is raised for another problem, and for more than two
            objectives if the algorithm has directions for two.
        **kwargs
            pymoo's options, such as ``termination`` (default: 100 000 evaluations; a ValueError is
            raised for less than one) and ``seed``.
        """
        base.check_problem(problem)
        directions = getattr(self, "ref_dirs", None)
        if directions is not None and directions.shape[1] != problem.n_obj:
            wanted = f"searches for fronts of {directions.shape[1]} objectives"
            found = f"{type(problem).__name__} has {problem.n_obj}"
            raise TypeError(f"{type(self).__name__} {wanted}, and {found}.")
        if any(isinstance(repair, variation.PenaltyOnly) for repair in self._repairs()):
            problem = problem.allowing_invalid()
        self.archive = PopulationArchive(
            problem.mission.robots, max_ties=self.max_ties, n_objectives=problem.n_obj
        )
        return super().setup(problem, **kwargs)

    def _repairs(self) -> list[object]:
        """Return the repairs of all operators, also of those that were given as objects."""
        found: list[object] = []
        for operator in (self.mating.crossover, self.mating.mutation):
            mixture = getattr(operator, "mixture", None)
            parts = mixture.parts if isinstance(mixture, variation.Mixture) else (operator,)
            found += [getattr(part, "plan_repair", None) for part in parts]
        return found

    def infill(self) -> Population | None:
        """Return the plans to evaluate next, no more than the budget allows."""
        infills = super().infill()
        return None if infills is None else infills[: self.n_left]

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
            self.problem.checked("F", infills.get("F"), len(infills))
            feasible = infills[infills.get("feas")] if self.problem.has_constraints() else infills
            if len(feasible):
                batch = self.problem.mission.batch(feasible.get("X"))
                self.archive.insert(batch, -feasible.get("F"), feasible)
        return super().advance(infills, **kwargs)

    @property
    def opt(self) -> Population | None:
        """The archive; the least infeasible plan as long as nothing feasible was found."""
        if len(self.archive):
            return self.archive.population()
        return self._least_infeasible

    @opt.setter
    def opt(self, value: Population | None) -> None:
        self._least_infeasible = value


def _call(module: str, function: str, /, *args: Any, **kwargs: Any) -> Any:
    """Call a function by its name, as a partial that can be pickled."""
    return getattr(sys.modules[module], function)(*args, **kwargs)


def _picklable(selection: Any, kinds: Iterable[type]) -> Any:
    """Return a tournament that finds its comparison by name, in a module of the classes.

    pymoo decorates some comparisons so that they cannot be pickled. A run that cannot be pickled
    cannot be resumed or sent to another process.
    """
    compare = getattr(selection, "func_comp", None)
    for module in {kind.__module__ for kind in kinds}:
        for name, value in vars(sys.modules[module]).items():
            if compare is not None and value is compare:
                selection = copy.copy(selection)
                selection.func_comp = functools.partial(_call, module, name)
                return selection
    return selection


def even_weights(n: int) -> FloatArray:
    """Spread ``n`` weights on two objectives evenly, shape (n, 2)."""
    weights = np.linspace(0, 1, n)
    return np.column_stack([weights, 1 - weights])


def make_parts(
    kind: str, given: Any, wanted: type | None = None, *, needed: str = "", **offered: Any
) -> dict[Any, float]:
    """Make operators of one name, or of a mapping from names to weights; return their weights.

    Those of weight 0 are left out. ``offered`` are parameters that they may take.
    """
    weights = {given: 1.0} if isinstance(given, str) else given
    weights = check_weights(kind, weights, weights, needed=needed)
    for name in weights:  # also of weight 0
        find_operator(kind, name)
    named = {name: weight for name, weight in weights.items() if weight}
    return {make_operator(kind, k, wanted or KINDS[kind], **offered): w for k, w in named.items()}


def make_sampling(given: Named | Sampling | Any, *, corners: bool = True) -> Sampling:
    """Make a sampling of ``guided``, ``random`` and others, from one name or names with weights.

    A pymoo sampling is returned as it is. Where trail plans are given but too few, guided ones are
    added. With ``corners`` the corners of the front are among the plans.
    """
    if isinstance(given, Sampling):
        return given
    if not isinstance(given, str | Mapping):
        rest = samplings.GuidedTrailSampling()
        return samplings.GivenSampling(given, samplings.CornerSampling(rest) if corners else rest)
    is_one = isinstance(given, str) or len([weight for weight in given.values() if weight]) == 1
    wanted = Sampling if is_one else samplings.PlanSampling  # pymoo's only by itself
    parts = make_parts("sampling", given, wanted, needed="sampling")
    if not all(isinstance(part, samplings.PlanSampling) for part in parts):
        return next(iter(parts))
    sampling = samplings.MixedSampling(parts)
    return samplings.CornerSampling(sampling) if corners else sampling
