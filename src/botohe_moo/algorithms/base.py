"""Base classes of algorithms: exact budgets, and an archive of all non-dominated plans."""

import functools
import inspect
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from typing import Annotated, Any, NamedTuple, Self, TypeAlias, get_type_hints

import moocore
import numpy as np
from pydantic import Field
from pymoo.core.algorithm import Algorithm
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.core.result import Result
from pymoo.core.termination import TerminateIfAll, Termination
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import SameResult, check_keywords, checked
from botohe_moo.base.types import FloatArray, ObjectArray, OffsetArray, SeedArray
from botohe_moo.core.compile import begin_run, remaining
from botohe_moo.core.walk import are_new, keep_front, plan_hashes
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE, FrontOutput, overrides
from botohe_moo.trails import PlanBatch, TrailPlan, listed_plans


class Archive(NamedTuple):
    """Non-dominated plans by descending objectives."""

    objectives: FloatArray  # (n_plans, n_objectives)
    hashes: SeedArray  # of each plan's multiset of trails (n_plans)
    ids: OffsetArray  # a number that no other plan ever gets (n_plans)
    plans: PlanBatch


class PlanArchive:
    """Non-dominated plans by descending objectives.

    Plans with equal objectives but different trails stay, the first ``max_ties`` of them; repeated
    plans are dropped.
    """

    def __init__(self, n_robots: int, *, max_ties: int = 1_000, n_objectives: int = 2) -> None:
        self.max_ties = max_ties
        nothing = np.empty(0, np.uint64), np.empty(0, np.int64), PlanBatch.from_plans([], n_robots)
        self._front = Archive(np.empty((0, n_objectives)), *nothing)
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._front.ids)

    @property
    def objectives(self) -> FloatArray:
        """The objectives of each plan, to be maximised (n, n_objectives); read-only."""
        view = self._front.objectives.view()
        view.flags.writeable = False
        return view

    @property
    def front(self) -> Archive:
        """The arrays themselves; not to be changed."""
        return self._front

    @property
    def plans(self) -> PlanBatch:
        """The plans, in the order of ``objectives``."""
        return self.front.plans

    @property
    def version(self) -> int:
        """A number that grows whenever the archive changes: more than any of the plans' ids."""
        return self._next_id

    def insert(self, batch: PlanBatch, objectives: FloatArray) -> OffsetArray:
        """Insert evaluated plans, with their objectives, that the archive does not dominate.

        Returns the indices of the batch's own Pareto set, by descending objectives.
        """
        old, n_old = self._front, len(self)
        hashes = plan_hashes(*batch.arrays, batch.n_robots)
        members = _pareto_rows(objectives, hashes, len(batch))
        new = members[are_new(objectives, hashes, members, old.objectives, old.hashes)]
        if not len(new):
            return members
        objectives = np.concatenate([old.objectives, objectives[new]])
        hashes = np.concatenate([old.hashes, hashes[new]])
        rows = _pareto_rows(objectives, hashes, self.max_ties)
        if (rows >= n_old).any():
            ids = np.append(old.ids, self._next_id + new)
            plans = PlanBatch.concatenate([old.plans, batch.take(new)]).take(rows)
            self._front = Archive(objectives[rows], hashes[rows], ids[rows], plans)
            self._next_id += len(batch)
        return members


def _pareto_rows(objectives: FloatArray, hashes: SeedArray, max_ties: int) -> OffsetArray:
    """Return the rows of the Pareto set by descending objectives, each plan once.

    Plans with equal objectives stay in their order; objectives that are NaN are left out.
    """
    order = np.lexsort(-objectives.T[::-1])
    if objectives.shape[1] > 2:
        order = order[np.isfinite(objectives[order]).all(axis=1)]
        nondominated = moocore.is_nondominated(objectives[order], maximise=True, keep_weakly=True)
        order = order[nondominated]
    return order[: keep_front(objectives, hashes, order, max_ties)]


class PopulationArchive(PlanArchive):
    """An archive that makes pymoo's individuals when they are read.

    To make them in every iteration would cost more than the iteration itself. ``constrain``
    returns the constraints G of a batch (n, n_ieq_constr).
    """

    def __init__(
        self,
        n_robots: int,
        *,
        constrain: Callable[[PlanBatch], FloatArray] | None = None,
        **options: int,
    ) -> None:
        super().__init__(n_robots, **options)
        self._constrain = constrain
        self._individuals: dict[int, Individual] = {}
        self._population, self._made = Population(), 0  # when ``version`` was that

    def insert(
        self,
        batch: PlanBatch,
        objectives: FloatArray,
        individuals: Sequence[Individual] | None = None,
    ) -> OffsetArray:
        """Insert evaluated plans that the archive does not dominate, as :class:`PlanArchive` does.

        ``individuals`` are the same plans as pymoo's individuals, if there are any; ``population``
        then returns these.
        """
        first, members = self.version, super().insert(batch, objectives)
        if individuals is not None:
            ids = self.front.ids
            self._individuals |= {i: individuals[i - first] for i in ids[ids >= first].tolist()}
        return members

    def add(self, infills: Population) -> Self:  # noqa: ARG002
        """Return the archive itself: pymoo calls this after an iteration."""
        return self

    def population(self) -> Population:
        """Return the plans as pymoo's individuals, which are made once for every plan."""
        if self._made != self.version:
            known, plans, objectives = self._individuals, self.plans, self.objectives
            constraints = [None] * len(plans) if not self._constrain else self._constrain(plans)
            self._individuals = {
                key: known.get(key) or _individual(plans[i], objectives[i], constraints[i])
                for i, key in enumerate(self.front.ids.tolist())
            }
            self._population = Population.create(*self._individuals.values())
            self._made = self.version
        return self._population


def _individual(
    plan: TrailPlan, objectives: FloatArray, constraints: FloatArray | None
) -> Individual:
    """Return an evaluated individual of pymoo's, which minimises."""
    individual = Individual(X=np.array([plan], dtype=object), F=-objectives)
    if constraints is not None:
        individual.set("G", constraints)
    individual.evaluated.update(("F", "G", "H"))
    return individual


MaxTies: TypeAlias = Annotated[int, Field(ge=1, le=1_000_000_000)]
MOST_THREADS = 1_024
Threads: TypeAlias = Annotated[int, Field(ge=1, le=MOST_THREADS), SameResult()]

PYMOO_OPTIONS = sorted({*inspect.signature(Algorithm).parameters} - {"archive", "kwargs"})


class BudgetedAlgorithm(Algorithm):
    """A pymoo algorithm that never spends more evaluations than its termination allows."""

    deterministic = False
    """Whether every seed gives the same result."""

    @classmethod
    def supports(cls, mission: Mission) -> bool:  # noqa: ARG003
        """Return whether the algorithm can plan for a mission; ``setup`` refuses others by name.

        An algorithm that takes all robots to be alike, or all rewards to count on arrival, gives
        ``mission.is_plain``.

        Examples
        --------
        >>> from botohe_moo import BOACO, Exact, load_mission
        >>> mission = load_mission("drones_and_rovers")
        >>> BOACO.supports(mission), Exact.supports(mission)
        (True, False)
        """
        return True

    def setup(self, problem: Any, **kwargs: Any) -> Algorithm:
        """Prepare to solve ``problem``; without any termination, for 100 000 evaluations.

        pymoo's default looks for convergence of the variables, which are numbers there. A
        ValueError is raised for a termination that allows no evaluation, a TypeError for a mission
        that the algorithm does not support.
        """
        mission = problem.mission
        if not self.supports(mission):
            which = f"mission {quoted(mission.name)}, which has {mission.specialities}"
            raise TypeError(f"{type(self).__name__} does not support {which}.")
        if self.termination is None and kwargs.get("termination") is None:
            kwargs["termination"] = ("n_eval", 100_000)
        begin_run()
        super().setup(problem, **kwargs)
        if budget(self.termination) < 1:
            found = f"{budget(self.termination):g}"
            raise ValueError(f"Expected a budget of at least 1 evaluation, got {found}.")
        return self

    def next(self) -> None:
        """Run one iteration, as pymoo's loop does."""
        spent = self.evaluator.n_eval
        with remaining(self.n_left / spent if spent else 1.0):
            super().next()

    @property
    def n_left(self) -> int:
        """The number of evaluations that the budget still allows."""
        left = budget(self.termination) - self.evaluator.n_eval
        return max(0, math.ceil(left)) if left < sys.maxsize else sys.maxsize


class ArchiveAlgorithm(BudgetedAlgorithm):
    """A pymoo algorithm whose optimum is an archive of all non-dominated plans it evaluated.

    A subclass builds the plans of one iteration in ``_advance`` and hands them to
    ``evaluate_plans``, which evaluates them, counts them and inserts them into the archive.
    ``n_left`` is how many evaluations the budget still allows. pymoo individuals are made when
    ``opt`` or ``pop`` is read.

    Parameters
    ----------
    max_ties
        Plans with equal objectives but different trails that the archive keeps.
    sampling
        Trail plans to start from: an iterable of plans, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TypeError
        If an option is unknown, or ``sampling`` does not hold plans only.

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated plans found so far (``plans``, ``objectives``).

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.algorithms import ArchiveAlgorithm, RandomTrailSampling
    >>> class Draw(ArchiveAlgorithm):
    ...     '''Draw trails at random, a hundred plans at a time.'''
    ...     def _advance(self, **_):
    ...         size = min(100, self.n_left)
    ...         drawn = RandomTrailSampling().sample_batch(self.problem, size, self.random_state)
    ...         self.evaluate_plans(drawn)
    >>> solve("toy", Draw(), evaluations=250).evaluations
    250
    """

    is_initialized: bool
    evaluates_in_kernels = False
    """Whether objectives are computed in kernels, without the methods of the problem.

    Problems that override ``evaluate_batch`` or ``constrain_batch`` are then refused.
    """
    honours_risk = False
    """Whether ``risk`` of a problem is honoured, although objectives are computed in kernels."""

    @checked
    def __init__(
        self,
        *,
        max_ties: MaxTies = 1_000,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        check_options(self, options)
        self.max_ties = max_ties
        self.sampling = [] if sampling is None else listed_plans(sampling)
        super().__init__(archive=PopulationArchive(1), **{"output": FrontOutput(), **options})

    def setup(self, problem: Any, **kwargs: Any) -> Algorithm:
        """Prepare to solve ``problem``; pymoo's ``minimize`` calls this.

        Parameters
        ----------
        problem
            A :class:`BOTOHE`. A TypeError is raised for another problem, and for one that overrides
            what kernels compute.
        **kwargs
            pymoo's own: ``termination``, ``seed``, ... A ValueError is raised for a budget of less
            than one evaluation.
        """
        check_problem(problem)
        unused = {"_evaluate": "override evaluate_batch, which all algorithms use that can."}
        if self.evaluates_in_kernels:
            why = "it evaluates plans inside a kernel. Algorithms such as BOACO use it."
            unused = {"evaluate_batch": why, "constrain_batch": why, **unused}
        for method, why in unused.items():
            if overrides(problem, method):
                found = f"{type(problem).__name__} overrides {method}"
                raise TypeError(f"{found}, which {type(self).__name__} does not call: {why}")
        if self.evaluates_in_kernels and not self.honours_risk and problem.risk is not None:
            raise TypeError(f"{type(self).__name__} cannot plan for risk: it computes E[R] itself.")
        return super().setup(problem, **kwargs)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        self.archive = PopulationArchive(
            problem.mission.robots,
            max_ties=self.max_ties,
            n_objectives=problem.n_obj,
            constrain=problem.constrain_batch if problem.n_ieq_constr else None,
        )

    def advance(self, infills: Population | None = None, **_: Any) -> Result | None:  # noqa: ARG002
        """Run one iteration; pymoo's ``next`` calls this.

        Unlike pymoo's own, it returns the optimum only at the end: to make a population of it in
        every iteration would take time.

        Parameters
        ----------
        infills
            None: pymoo evaluates nothing.
        **_
            What pymoo hands over besides.
        """
        if self.is_initialized:
            self._advance()
        else:
            self.n_iter = 1
            self._initialize_advance()
            self.is_initialized = True
        self._post_advance()
        if not self.termination.has_terminated():
            return None
        self.finalize()
        return self.result()

    def ask(self) -> Population | None:
        """Refuse, by a TypeError, to hand out plans: the algorithm evaluates them itself."""
        raise TypeError(f"{type(self).__name__} evaluates its own plans: call next(), not ask().")

    def _initialize_advance(self, **_: Any) -> None:
        if self.sampling:
            batch = self.problem.mission.batch(self.sampling)
            self.problem.mission.evaluate(batch)  # checks the plans, which a subclass may not do
            self.evaluate_plans(batch[: self.n_left])
        if self.n_left:  # else the plans to start from have spent the budget
            self._advance()

    def evaluate_plans(self, batch: PlanBatch) -> tuple[FloatArray, OffsetArray]:
        """Evaluate plans, and insert the feasible ones into the archive.

        Returns their objectives (n, n_objectives), and the indices of the Pareto set of the
        feasible ones.
        """
        problem = self.problem
        batch = problem.mission.batch(batch)  # a TypeError names what is not a plan
        self.evaluator.n_eval += len(batch)
        objectives = -problem.checked("F", problem.evaluate_batch(batch), len(batch))
        if problem.n_ieq_constr == 0 and not overrides(problem, "constrain_batch"):
            return objectives, self.archive.insert(batch, objectives)
        constraints = problem.checked("G", problem.constrain_batch(batch), len(batch))
        feasible = np.flatnonzero((constraints <= 0).all(axis=1))
        members = self.archive.insert(batch.take(feasible), objectives[feasible])
        return objectives, feasible[members]

    def _set_optimum(self) -> None:
        pass  # the archive is the optimum, at all times

    # pymoo assigns pop and opt in its loop. Both are the archive, as a population that is made when
    # it is read: an iteration in which nobody reads it takes no time for it.

    @property
    def opt(self) -> Population | None:
        """The archive as a pymoo population; None as long as it is empty."""
        return self.archive.population() if len(self.archive) else None

    @opt.setter
    def opt(self, value: Population | None) -> None: ...

    pop = opt


def settings_of(algorithm: Algorithm, kind: type[Any]) -> dict[str, Any]:
    """Return those parameters of an algorithm that are fields of a dataclass, by name."""
    names = [field.name for field in fields(kind)]
    return {name: getattr(algorithm, name) for name in names if hasattr(algorithm, name)}


def tuned_by(kind: type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a constructor take the fields of a search's settings, a dataclass, as its parameters.

    They become attributes of the algorithm, and types and defaults are those of the dataclass.
    """

    def decorated(init: Callable[..., None]) -> Callable[..., None]:
        hints = get_type_hints(kind, include_extras=True)
        how = inspect.Parameter.KEYWORD_ONLY
        stated = {
            f.name: inspect.Parameter(f.name, how, default=f.default, annotation=hints[f.name])
            for f in fields(kind)
        }

        @functools.wraps(init)
        def call(self: Any, **given: Any) -> None:
            settings = kind(**{name: given.pop(name) for name in stated.keys() & given.keys()})
            init(self, **given)
            for name in stated:
                setattr(self, name, getattr(settings, name))

        own = inspect.signature(init).parameters.values()
        first, *others = own  # this is ``self``
        together: Any = [first, *stated.values(), *others]
        call.__signature__ = inspect.Signature(together)  # type: ignore[attr-defined]
        return checked(call)

    return decorated


def check_options(algorithm: Algorithm, options: Iterable[str]) -> None:
    """Raise a TypeError for unknown options, which pymoo's algorithms would ignore.

    It names the class of this package that was given one, not a class derived from it.
    """
    mro = type(algorithm).__mro__
    kind = next(each for each in mro if each.__module__.startswith("botohe_moo."))
    check_keywords(kind, options, PYMOO_OPTIONS)


def check_problem(problem: Any) -> None:
    """Raise a TypeError if a problem is not a BOTOHE."""
    if not isinstance(problem, BOTOHE):
        raise TypeError(f"Expected a BOTOHE problem, got {type(problem).__name__}.")


def budget(termination: Termination) -> float:
    """Return the evaluations that a termination allows."""
    return _limit(termination, MaximumFunctionCallTermination, "n_max_evals")


def generation_limit(termination: Termination) -> float:
    """Return the generations that a termination allows."""
    return _limit(termination, MaximumGenerationTermination, "n_max_gen")


def _limit(termination: Termination, kind: type, attribute: str) -> float:
    """Return the limit of a termination of some kind, or of those that it combines."""
    if isinstance(termination, kind):
        limit = getattr(termination, attribute)
        return math.inf if limit is None else float(limit)
    # pymoo's classes have two names for what they combine.
    parts = [*getattr(termination, "terminations", ()), *getattr(termination, "criteria", ())]
    whole = max if isinstance(termination, TerminateIfAll) else min
    return whole((_limit(part, kind, attribute) for part in parts), default=math.inf)
