"""Bi-objective ant colony optimisation: the colony, and the pymoo algorithm."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field

from botohe_moo.algorithms import base
from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies, PlanArchive, Threads
from botohe_moo.algorithms.bo_aco import kernels
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.base.parameters import Count, NotNegative, Positive, Probability
from botohe_moo.base.types import FloatArray, ObjectArray, OffsetArray
from botohe_moo.core.paths import new_paths
from botohe_moo.core.rng import seed_states
from botohe_moo.core.threads import in_spans
from botohe_moo.core.world import World, brought_home
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

# Trails of an iteration times arcs: with fewer, one thread builds them in the time that it takes to
# start others.
_MUCH = 50_000


Evaporation: TypeAlias = Annotated[float, Field(gt=0, lt=1)]
InitialPheromone: TypeAlias = Positive | Literal["bounds"]


@dataclass(frozen=True, kw_only=True)
class ColonySettings:
    """How ants weigh arcs and pheromone changes; :class:`BOACO` documents the parameters.

    Defaults are the first settings of the paper.
    """

    n_ants: Count = 100
    evaporation: Evaporation = 0.04
    heuristic: bool = True
    pheromone: bool = True
    allocation: Literal["sequential", "concurrent"] = "sequential"
    pheromone_per_robot: bool = False
    initial_pheromone: InitialPheromone = 1.0
    reward_epsilon: Positive = 0.05
    survival_epsilon: Positive = 0.01
    unvisited_bonus: NotNegative = 0.0
    exploration: NotNegative = 0.0
    pooled_deposit: bool = True


# Those with which the curves were made that PeerJ Computer Science published in 2025.
JOURNAL_BONUS, JOURNAL_EXPLORATION = 0.05, 0.01


class Colony:
    """Ants that build plans, and the pheromone they leave.

    Ants plan with the limits of ``world``. Plans are built by ``n_threads``, on which results do
    not depend: each ant has its own generator, whose seed is drawn from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        world: World,
        settings: ColonySettings,
        *,
        n_threads: int = 1,
        random_state: np.random.Generator,
    ) -> None:
        self.settings = settings
        self.n_threads = n_threads
        self._world = world
        self._states = seed_states(random_state, settings.n_ants)
        self._heuristic = _new_heuristic(world, settings)
        self._pheromone = _new_pheromone(mission, settings)
        self._builds: dict[int, kernels.Build] = {}  # of each thread
        self._deposited_version = -1  # of the archive, when its deposit was last summed up
        # Arguments of ``learn`` that the last iteration has left for the next one.
        self._to_learn: tuple[kernels.Depositors, kernels.Depositors, bool] | None = None

    @property
    def pheromone(self) -> FloatArray:
        """Reward and survival pheromone of the arcs (n_maps, n_arcs + n_kinds, 2).

        Each robot has a map, or all share one; behind the arcs come the self-loops with which
        trails end, one for each kind of robots.
        """
        self._catch_up()
        return self._pheromone.levels

    def construct(self, n_ants: int) -> PlanBatch:
        """Build a plan for each of ``n_ants`` ants, at most those of the settings.

        The ants' weights on the objectives are spread evenly. Robots are in the order of planning.
        """
        self._catch_up()
        is_much = n_ants * self._world.n_robots * self._world.graph.n_arcs > _MUCH
        build = partial(self._construct_span, n_ants)
        spans = in_spans(n_ants, self.n_threads if is_much else 1, build)
        return spans[0] if len(spans) == 1 else PlanBatch.concatenate(spans)

    def _construct_span(self, n_ants: int, part: int, begin: int, end: int) -> PlanBatch:
        """Build the plans of the ants ``begin`` to ``end``, in the thread with number ``part``."""
        if part not in self._builds:
            self._builds[part] = self._new_build()
        build = self._builds[part]
        if build.n_ants != n_ants:
            build = build._replace(n_ants=n_ants)
        for last in (build.scratch.tabulated, build.scratch.used, build.scratch.visited):
            last.fill(-1)
        nodes, offsets = kernels.construct(self._world, build, begin, end)
        return PlanBatch._wrap(nodes, offsets, self._world.n_robots)

    def _new_build(self) -> kernels.Build:
        world, levels = self._world, self._pheromone.levels
        concurrent = self.settings.allocation == "concurrent"
        limits = world.limits
        is_careful = not world.graph.balanced or limits.has_floors or limits.has_budgets
        rule = self.settings.n_ants, self.settings.exploration, concurrent
        paths = new_paths(world) if is_careful else None
        scratch = kernels.new_scratch(world, len(levels), concurrent, self._states)
        return kernels.Build(*rule, self._heuristic, levels, paths, scratch)

    def learn(
        self, batch: PlanBatch, objectives: FloatArray, members: OffsetArray, archive: PlanArchive
    ) -> None:
        """Evaporate and deposit pheromone, if the colony has any.

        ``objectives`` are E[R] and E[S] of the iteration's plans, and ``members`` the indices of
        its Pareto set. ``archive`` holds the global Pareto set, or what the colony knows of it.
        """
        if not self.settings.pheromone or len(archive) == 0:
            return
        self._catch_up()
        everyone, kept = np.arange(len(archive)), archive.front
        self._to_learn = (
            kernels.Depositors(objectives, members, *batch.arrays),
            kernels.Depositors(kept.objectives, everyone, *kept.plans.arrays),
            archive.version != self._deposited_version,
        )
        self._deposited_version = archive.version

    def _catch_up(self) -> None:
        """Learn what the last iteration has found, if it has not been learned yet.

        ``learn`` is called only when ants build again, so that a first front need not compile it.
        """
        if self._to_learn is not None:
            rule = kernels.LearnRule(self.settings.evaporation, self.settings.pooled_deposit)
            graph, n_nodes = self._world.graph, len(self._world.team.reward)
            kernels.learn(graph, n_nodes, rule, *self._to_learn, self._pheromone)
            self._to_learn = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_builds": {}}


def _new_pheromone(mission: Mission, settings: ColonySettings) -> kernels.Pheromone:
    n_maps = mission.robots if settings.pheromone_per_robot else 1
    shape = n_maps, mission.world.graph.n_arcs + len(mission.kinds), 2
    levels = np.ones(shape)
    if settings.pheromone and settings.initial_pheromone == "bounds":
        levels[:] = mission.total_reward or 1.0, mission.robots
    elif settings.pheromone:
        levels[:] = settings.initial_pheromone
    return kernels.Pheromone(np.maximum(levels, kernels.LEAST), np.zeros(shape), np.zeros(shape))


def _new_heuristic(world: World, settings: ColonySettings) -> kernels.Heuristic:
    survival = np.append(world.graph.mean_survival, np.ones(world.team.n_kinds))
    if not settings.heuristic:
        nothing = np.zeros(len(survival))
        return kernels.Heuristic(0.0, nothing, nothing, nothing)
    heads = np.append(world.graph.head, np.unique(world.team.end))
    reward = brought_home(world, world.graph.reward)[heads]
    with np.errstate(over="ignore"):
        gain = (settings.unvisited_bonus + survival * reward) / settings.reward_epsilon
    gain = np.minimum(gain, np.exp(kernels.LOG_HIGH))
    least, logs = (
        float(np.log(settings.reward_epsilon)),
        np.log(settings.survival_epsilon + survival),
    )
    return kernels.Heuristic(least, logs, gain, np.log1p(gain))


def tabulate_pheromone(mission: Mission, colony: Colony) -> pd.DataFrame:
    """Return the pheromone of a colony, a row for each arc, as :attr:`BOACO.pheromone_maps`."""
    import pandas as pd  # here, since importing it takes as long as importing all else

    graph, nodes, kinds = mission.world.graph, mission.nodes, mission.kinds
    loops = np.unique(mission.world.team.end)
    tails, heads = np.append(graph.tail, loops), np.append(graph.head, loops)
    labels = np.fromiter(nodes, object, len(nodes))
    arcs = {
        "kind": [kinds[k].name for k in tails // len(nodes)],
        "tail": labels[tails % len(nodes)],
        "head": labels[heads % len(nodes)],
    }
    maps = [
        pd.DataFrame({"robot": robot, **arcs, "reward": levels[:, 0], "survival": levels[:, 1]})
        for robot, levels in enumerate(colony.pheromone)
    ]
    table = pd.concat(maps, ignore_index=True)
    if len(kinds) == 1:
        table = table.drop(columns="kind")
    return table if colony.settings.pheromone_per_robot else table.drop(columns="robot")


class BOACO(ArchiveAlgorithm):
    """Bi-objective ant colony optimisation (BO-ACO).

    Every iteration (a pymoo generation) each ant builds one trail plan, robot by robot and hop by
    hop. From node v it takes an arc to v' that the trail has not used yet with probability
    proportional to (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, and ends the trail by the base's self-loop.
    The ants' λ are spread evenly over [0, 1], from reward alone to survival alone. Plans of the
    iteration's Pareto set and of the archive, the Pareto set over all iterations, deposit pheromone
    on their arcs in proportion to their E[R] and E[S].

    Defaults are the first settings of the paper; :meth:`journal` returns those of its curves.

    Parameters
    ----------
    n_ants
        Ants: evaluations per iteration. A single ant has λ = 1/2.
    evaporation
        Share ρ of the pheromone that evaporates in an iteration.
    heuristic
        Whether heuristics guide the ants; without, η_R = η_S = 1.
    pheromone
        Whether pheromone guides the ants; without, τ_R = τ_S = 1.
    allocation
        ``"sequential"``, one robot's whole trail after another's, or ``"concurrent"``: all robots
        are out at once, and take one hop each in turn. "Earlier" robots are then all others.
    local_search
        Share of each iteration's plans that a local search improves: its Pareto set first, then
        others at random. The plans found deposit pheromone with the iteration's.
    local_search_evaluations
        Evaluations of the local search for each of those plans.
    pheromone_per_robot
        Whether each robot has its own pheromone maps.
    initial_pheromone
        Pheromone on every arc at the start; ``"bounds"`` starts τ_R at the mission's total reward
        and τ_S at its number of robots.
    reward_epsilon
        Added to η_R.
    survival_epsilon
        Added to η_S = ω.
    unvisited_bonus
        Added to ω·r in η_R for a node not in the trail yet:
        η_R = reward_epsilon + (unvisited_bonus + ω·r) · (probability that no earlier robot
        reaches the node). It is reward_epsilon for a node already in the trail, and the base.
    exploration
        Every candidate's weight is raised by exploration · (mean weight) / (number of candidates).
        A candidate that breaks a limit is left out, and the others are weighed anew.
    pooled_deposit
        Whether both Pareto sets deposit as one multiset, divided by its size, or one after the
        other, each divided by its own size.
    max_ties
        Plans with equal objectives that the archive keeps; the journal version keeps all.
    n_threads
        Threads that build plans on large missions; the result does not depend on it.
    sampling
        Trail plans to start from, which deposit pheromone, too, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated plans found so far (``plans``, ``objectives``).
    colony : Colony
        The ants and their pheromone, once there is a problem.

    Notes
    -----
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025; after Iredi, Merkle and Middendorf,
    "Bi-criterion optimization with multi colony ant algorithms", EMO 2001.

    The allocations are the sequential and the deterministic-concurrent one of Ke, Archetti and
    Feng, "Ants can solve the team orienteering problem", Computers & Industrial Engineering 54(3),
    2008. The local search is that of :class:`ParetoLocalSearch`.

    The last iteration has as many ants as evaluations are left. An ant draws again when no unused
    arcs lead home within the limits from the node that it chose. With a travel budget it looks for
    the safest way home, then for the shortest one, never for a compromise between both.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission
    >>> toy = load_mission("toy")
    >>> algorithm = BOACO(n_ants=20)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> area_indicator(-result.F, toy) > 0.5
    True
    """

    @base.tuned_by(ColonySettings)
    def __init__(
        self,
        *,
        local_search: Probability = 0.0,
        local_search_evaluations: Annotated[int, Field(ge=1, le=10_000)] = 30,
        max_ties: MaxTies = 1_000,
        n_threads: Threads = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=max_ties, sampling=sampling, **options)
        self.local_search = local_search
        self.local_search_evaluations = local_search_evaluations
        self.evaluates_in_kernels = local_search > 0
        self.n_threads = n_threads

    @classmethod
    def journal(
        cls,
        *,
        evaporation: Evaporation = 0.1,
        initial_pheromone: InitialPheromone = "bounds",
        unvisited_bonus: NotNegative = JOURNAL_BONUS,
        exploration: NotNegative = JOURNAL_EXPLORATION,
        pooled_deposit: bool = False,
        **parameters: Any,
    ) -> Self:
        """Return the colony that made the curves published in PeerJ Computer Science, 2025.

        Parameters
        ----------
        evaporation, initial_pheromone, unvisited_bonus, exploration, pooled_deposit
            As for the class, with that version's values.
        **parameters
            Any other parameter of the class.
        """
        return cls(
            evaporation=evaporation,
            initial_pheromone=initial_pheromone,
            unvisited_bonus=unvisited_bonus,
            exploration=exploration,
            pooled_deposit=pooled_deposit,
            **parameters,
        )

    @property
    def pheromone_maps(self) -> pd.DataFrame:
        """The current pheromone on each arc; a RuntimeError is raised before there is a problem.

        Its columns are ``robot`` if each has maps of its own, ``tail`` and ``head`` (node labels;
        the base's self-loop has twice the base), ``reward`` and ``survival``.
        """
        if self.problem is None:
            raise RuntimeError("There is no pheromone before the algorithm has a problem.")
        return tabulate_pheromone(self.problem.mission, self.colony)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        self._improver: LocalSearch | None = None
        if self.local_search > 0:
            costs = Costs(problem.world)
            self._improver = LocalSearch(problem.mission, costs, random_state=self.random_state)
        settings = ColonySettings(**base.settings_of(self, ColonySettings))
        how = {"n_threads": self.n_threads, "random_state": self.random_state}
        self.colony = Colony(problem.mission, problem.world, settings, **how)

    def _advance(self, **_: Any) -> None:
        batch = self.colony.construct(min(self.n_ants, self.n_left))
        batch, objectives, members = self._improve(batch, *self.evaluate_plans(batch))
        self.colony.learn(batch, objectives, members, self.archive)

    def _improve(
        self, batch: PlanBatch, objectives: FloatArray, members: OffsetArray
    ) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Return an iteration's plans together with what a local search makes of them, if any.

        It starts from a share of the plans: from those of the Pareto set first.
        """
        search = self._improver
        if search is None:
            return batch, objectives, members
        n_chosen = max(1, round(self.local_search * len(batch)))
        others = np.setdiff1d(np.arange(len(batch)), members)
        drawn = np.concatenate(list(map(self.random_state.permutation, (members, others))))
        search.restart()
        search.insert(batch.take(np.sort(drawn[:n_chosen])))
        n_given = search.version
        n_most = min(self.n_left, n_chosen * self.local_search_evaluations)
        self.evaluator.n_eval += search.run(n_most)
        plans, gained, numbers = search.plans()
        found = numbers >= n_given
        batch = PlanBatch.concatenate([batch, plans.take(found)])
        objectives = np.vstack([objectives, gained[found]])
        return batch, objectives, self.archive.insert(batch, objectives)


class RandomTrails(BOACO):
    """Ants without heuristics and pheromone: every unused arc is equally likely.

    Parameters
    ----------
    n_ants
        Plans per iteration.
    n_threads
        Threads that build plans; the result does not depend on it.
    sampling
        Trail plans to start from, as for :class:`BOACO`.
    **options
        pymoo's own, as for :class:`BOACO`.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, RandomTrails, area_indicator, load_mission
    >>> toy = load_mission("toy")
    >>> algorithm = RandomTrails(n_ants=50)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> result.algorithm.evaluator.n_eval
    200
    """

    def __init__(
        self,
        *,
        n_ants: Count = 100,
        n_threads: Threads = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        blind = {"heuristic": False, "pheromone": False}
        super().__init__(n_ants=n_ants, n_threads=n_threads, sampling=sampling, **blind, **options)
