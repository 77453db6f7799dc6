"""Pareto local search."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from botohe_moo.algorithms import base
from botohe_moo.algorithms.base import Archive, ArchiveAlgorithm, PopulationArchive, Threads
from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.algorithms.local_search.engine import Islands, LocalSearch, LocalSearchSettings
from botohe_moo.algorithms.local_search.risk import WorstScenarios
from botohe_moo.base.types import FloatArray, ObjectArray
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

# Partial trails that the search for the first plans keeps. Wider ones take longer, and the search
# itself soon makes up for what they miss; on large missions narrow ones take a second or two.
_WIDE_BEAM, _NARROW_BEAM = 20, 5
_WIDE_UP_TO = 20_000  # nodes times robots

_FIRST_GENERATION = 100

# Evaluations: with more, the search is compiled meanwhile. The first iteration knows no pace yet.
_SOON = 1_000


class ParetoLocalSearch(ArchiveAlgorithm):
    """Pareto local search: plans of the front, changed in one trail, back into the front.

    The search keeps all non-dominated plans. It takes one of them as a parent, and one of its
    robots, and makes children in which that robot's trail is cut and reconnected: through other
    nodes, with a piece of a trail of another plan, or by a whole one. Children that no plan
    dominates enter the front. When nothing has entered for long, another robot often takes a trail
    of another plan first, so that the search gets to where single changes do not lead. All of it
    runs in a kernel, many evaluations to an iteration (a pymoo generation).

    Parameters
    ----------
    evaluations_per_generation
        Evaluations of each island in one pymoo generation. The first generations are shorter: 100,
        and then a tenth of what has been evaluated.
    moves
        How likely each move is to be drawn, relative, by name; those left out are not drawn.
        ``shortcut``, ``visit``, ``visit-two``: cut out a segment, and reconnect by safest paths
        through no node, one, or two. ``splice``: go on along another plan's trail to its end.
        ``graft``: replace a segment by one of another plan's trail. ``adopt``: take over a whole
        trail. ``swap-loops``: walk the loops at a node in another order. Default:
        ``DEFAULT_MOVES``.
    prob_recreate
        How likely a parent is ruined and recreated instead, at least: stops of one robot or several
        are removed, and the nodes inserted that gain most for their danger. The n-th time that a
        plan is a parent this happens with probability 1 / n², or 1 / 2 over the number of plans in
        the front, if that is more. Plans wait for it until there are 32, or 8 on each of several
        islands. When no plan has entered the front for long, some walks go on from plans that are a
        little worse. With 0, and where nodes times kinds are more than 1 000, no plan is ruined.
        Default: 0.02 if nodes times robots are at most 1 000, else 0, since it takes long then.
    greedy_start
        Whether to begin with plans that
        :func:`~botohe_moo.algorithms.greedy.plan_sequentially` makes for reward alone, for
        the whole team and for fewer robots, beside the plan in which all robots stay at base. Not
        where rewards count on return: fronts are better without these plans there.
    max_size
        Plans that the front keeps after each generation; None keeps all. While there are more, the
        plan that contributes the least area is removed.
    n_islands
        Searches that go on side by side after 20 000 evaluations, once the front has 50 plans.
        Whenever about 50 plans have entered their fronts, they exchange these (migration). The
        result depends on their number.
    n_threads
        Threads that run the islands; the result does not depend on their number.
    sampling
        Trail plans to start from, evaluated first: an iterable of plans, or ``X`` of another
        result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE` or overrides its
        evaluation.

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated plans found so far (``plans``, ``objectives``): one for each pair of
        objectives, to 1e-12 of either.
    statistics : pandas.DataFrame
        What each move brought: a row a move, and one for ruin and recreate, with the children
        ``tried``, the plans that ``entered`` the front, and the ``seconds`` spent on it.
    move_counts : dict
        The same by name, without seconds: what :class:`~botohe_moo.Solution` records.

    Notes
    -----
    Paquete, Chiarandini and Stützle, "Pareto local optimum sets in the biobjective traveling
    salesman problem: an experimental study", in Metaheuristics for Multiobjective Optimisation,
    2004, keep a front and search from its plans. Here moves are drawn, not enumerated, and trails
    of different plans are combined, as genetic algorithms do.

    The run ends before its budget is spent where no move makes another plan: on a mission of one
    node, or where all moves need trails of other plans and there are none.

    A child counts as an evaluation also when an upper bound of its E[R], computed before its trail
    has been walked to the end, shows that it cannot enter.

    Where the problem has a ``risk``, one search goes on in turns of up to 1 000 evaluations, or as
    many as there are plans, each with other weights of the scenarios, so that plans get better in
    their own worst ones. Three tenths of a turn are children of single plans, ruined and recreated,
    which ``statistics`` leaves out. Islands and ``max_size`` do not count then.

    Islands are a cooperative parallel search in which all processes share one archive: Crainic and
    Toulouse, "Parallel meta-heuristics", in Handbook of Metaheuristics, 2010.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, ParetoLocalSearch, area_indicator, load_mission
    >>> mission = load_mission("art_museum")
    >>> result = minimize(BOTOHE(mission), ParetoLocalSearch(), ("n_eval", 5_000), seed=1)
    >>> area_indicator(-result.F, mission) > 0.5
    True
    """

    evaluates_in_kernels = True
    honours_risk = True

    @base.tuned_by(LocalSearchSettings)
    def __init__(
        self,
        *,
        evaluations_per_generation: Annotated[int, Field(ge=1, le=1_000_000_000)] = 20_000,
        greedy_start: bool = True,
        n_threads: Threads = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=1, sampling=sampling, **options)
        self.evaluations_per_generation = evaluations_per_generation
        self.greedy_start = greedy_start
        self.n_threads = n_threads

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        settings = LocalSearchSettings(**base.settings_of(self, LocalSearchSettings))
        given: Any = {"random_state": self.random_state, "settings": settings}
        if problem.risk is not None:
            self._search: Islands = WorstScenarios(problem, self.archive, **given)
            return
        self._search = Islands(problem.mission, problem.world, n_threads=self.n_threads, **given)
        constrain = problem.constrain_batch if problem.n_ieq_constr else None
        self.archive = _SearchArchive(self._search.first, problem.mission.robots, constrain)

    def _initialize_advance(self, **_: Any) -> None:
        problem: BOTOHE = self.problem
        mission = problem.mission
        if self.sampling:
            mission.evaluate(self.sampling)  # names what is wrong with plans from elsewhere
        if self.n_left > _SOON:
            self._search.first.prepare()
        plans = [*self.sampling, mission.stay_home(problem.world)]
        if self.greedy_start and not mission.has_returns and len(plans) < self.n_left:
            wide = len(mission.nodes) * mission.robots <= _WIDE_UP_TO
            planner = SequentialPlanner(
                mission, problem.world, beam_width=_WIDE_BEAM if wide else _NARROW_BEAM
            )
            plans += planner.plans(1.0)
        batch = mission.batch(plans)[: self.n_left]
        if problem.risk is not None:
            self.evaluate_plans(batch)
        else:
            self.evaluator.n_eval += len(batch)
            if problem.n_ieq_constr:
                batch = batch.take((problem.constrain_batch(batch) <= 0).all(axis=1))
            self._search.first.insert(batch)
        if self.n_left:
            self._advance()

    @property
    def statistics(self) -> pd.DataFrame:
        """What each move brought; the class describes it."""
        return self._search.statistics

    @property
    def move_counts(self) -> dict[str, dict[str, int]]:
        """What each move brought, as plain numbers; the class describes it."""
        return self._search.move_counts

    def _advance(self, **_: Any) -> None:
        n = max(_FIRST_GENERATION, self.evaluator.n_eval // 10)
        most = self.evaluations_per_generation * self._search.n_running
        n = min(n, most, self.n_left)
        n_evaluated = self._search.run(n)
        self.evaluator.n_eval += n_evaluated
        if n_evaluated < n:  # no move makes another plan
            self.termination.force_termination = True


class _SearchArchive(PopulationArchive):
    """The current front of a search, read when it is asked for, plans only when they are.

    Writing all plans of a large team takes longer than many a generation. Only the search inserts
    plans.
    """

    def __init__(
        self,
        search: LocalSearch,
        n_robots: int,
        constrain: Callable[[PlanBatch], FloatArray] | None,
    ) -> None:
        super().__init__(n_robots, max_ties=1, constrain=constrain)
        self._search = search
        self._plans_version = -1  # of the search, when they were read

    def __len__(self) -> int:
        return len(self._search)

    @property
    def objectives(self) -> FloatArray:
        return self._search.objectives()

    @property
    def version(self) -> int:
        return self._search.version

    @property
    def front(self) -> Archive:
        if self._plans_version != self._search.version:
            batch, objectives, numbers = self._search.plans()
            self._front = Archive(objectives, self._front.hashes, numbers, batch)
            self._plans_version = self._search.version
        return self._front
