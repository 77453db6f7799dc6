"""Bi-objective ant colony optimisation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field

from botohe_moo._base.checks import ParameterError
from botohe_moo._base.types import FloatArray, ObjectArray, OffsetArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Count, NotNegative, Positive, Probability, SameResult
from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies, settings_of
from botohe_moo.problem import BOTOHE
from botohe_moo.search.archive import PlanArchive
from botohe_moo.search.colony import Allocation, AntThreads, Colony, ColonyRule, exchange_archives
from botohe_moo.search.local_search import IterationSearch
from botohe_moo.trails import PlanBatch, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

Evaporation: TypeAlias = Annotated[float, Field(gt=0, lt=1)]
Pheromone: TypeAlias = Positive | Literal["bounds"]
Threads: TypeAlias = Annotated[int, Field(ge=1, le=1_024), SameResult()]


class BOACO(ArchiveAlgorithm):
    """Bi-objective ant colony optimisation (BO-ACO).

    Every iteration (a pymoo generation) each ant builds one trail plan, robot by robot and hop by
    hop. From node v it takes an arc to v' that the trail has not used yet with probability
    proportional to (τ_R η_R)^(1 − λ) (τ_S η_S)^λ, and ends the trail by the base's self-loop.
    The ants' λ are spread evenly over [0, 1], from all for reward to all for survival. The plans
    of the iteration's Pareto set and of the archive, the Pareto set over all iterations, deposit
    pheromone on their arcs in proportion to their E[R] and E[S].

    Defaults are the first settings of the paper; :meth:`journal` gives those of its curves.

    Parameters
    ----------
    n_ants
        Ants: evaluations per iteration. Several colonies share them. A single ant has λ = 1/2.
    evaporation
        Share ρ of the pheromone that evaporates in an iteration.
    heuristic
        Whether heuristics guide the ants; without, η_R = η_S = 1.
    pheromone
        Whether pheromone guides the ants; without, τ_R = τ_S = 1.
    allocation
        How the robots' trails are allocated: ``"sequential"``, one robot's whole trail after
        another's, or ``"concurrent"``, all robots out at once, which take one hop each in turn
        until they end their trails. "Earlier" robots are then all others, by their trails so far.
    local_search
        Share of each iteration's plans that a local search improves: those of its Pareto set first,
        then others, drawn. What it finds deposits pheromone with the iteration's plans.
    local_search_evaluations
        Evaluations of the local search for each of those plans, within the same iteration.
    n_colonies
        Colonies with pheromone and random numbers of their own, at most ``n_ants``, each with λ
        over all of [0, 1]. ``archive`` is common, but each colony deposits by its own iteration's
        Pareto set, and by an archive of plans that it found or was given.
    exchange_every
        After how many iterations each of several colonies is given the archive by which the one
        before it deposits, the first one the last's; None for never.
    pheromone_per_robot
        Whether each robot has its own pair of pheromone maps; otherwise the robots share one.
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
    pooled_deposit
        Whether both Pareto sets deposit as one multiset, divided by its size P, or one after the
        other, each divided by its own size.
    max_ties
        Plans with equal objectives but different trails that the archive keeps. The journal version
        keeps all; where no arc is dangerous, their number has no bound.
    n_threads
        Threads that build plans; the result does not depend on it.
    sampling
        Trail plans to start from, which deposit pheromone from the first iteration on: an iterable
        of plans, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TypeError
        If an option is unknown, the problem is not a :class:`BOTOHE`, or overrides its evaluation
        where there is a local search.

    Attributes
    ----------
    archive : PlanArchive
        All non-dominated plans found so far (``plans``, ``objectives``). Their pymoo population
        (``pop`` and ``opt``) is made when it is read.
    colonies : list of Colony
        The colonies, as soon as there is a problem; ``colony`` is the first of them.

    Notes
    -----
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025; after Iredi, Merkle and Middendorf,
    "Bi-criterion optimization with multi colony ant algorithms", EMO 2001.

    The allocations are the sequential and the deterministic-concurrent one of Ke, Archetti and
    Feng, "Ants can solve the team orienteering problem", Computers & Industrial Engineering 54(3),
    2008. Several colonies are those of Iredi, Merkle and Middendorf with the same λ in each and
    pheromone updated by origin, except that a colony's plans need not be in all colonies' common
    front to deposit; plans go round as in Middendorf, Reischle and Schmeck, "Multi colony ant
    algorithms", Journal of Heuristics 8(3), 2002. The local search is that of
    :class:`ParetoLocalSearch`, from the plans of one iteration only; the paper proposes it as
    future work.

    No budget is overdrawn: the last iteration has as many ants as evaluations are left. Where some
    node has more arcs in than out, ants draw again when no unused arcs lead home from the node that
    they chose; where the problem has limits, when no way home is found that keeps them. With a
    travel budget the safest way home is tried, then the shortest one: a plan is never built in
    which a robot could only get home by a compromise between both.

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

    @checked
    def __init__(
        self,
        *,
        n_ants: Count = 100,
        evaporation: Evaporation = 0.04,
        heuristic: bool = True,
        pheromone: bool = True,
        allocation: Allocation = "sequential",
        local_search: Probability = 0.0,
        local_search_evaluations: Annotated[int, Field(ge=1, le=10_000)] = 30,
        n_colonies: Annotated[int, Field(ge=1)] = 1,
        exchange_every: Annotated[int, Field(ge=1)] | None = 10,
        pheromone_per_robot: bool = False,
        initial_pheromone: Pheromone = 1.0,
        reward_epsilon: Positive = 0.05,
        survival_epsilon: Positive = 0.01,
        unvisited_bonus: NotNegative = 0.0,
        exploration: NotNegative = 0.0,
        pooled_deposit: bool = True,
        max_ties: MaxTies = 1_000,
        n_threads: Threads = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=max_ties, sampling=sampling, **options)
        if n_colonies > n_ants:
            message = f"Expected n_colonies <= n_ants = {n_ants}, got {n_colonies}."
            raise ParameterError(message, "n_colonies")
        self.n_ants = n_ants
        self.evaporation = evaporation
        self.heuristic = heuristic
        self.pheromone = pheromone
        self.allocation = allocation
        self.local_search = local_search
        self.evaluates_in_kernels = local_search > 0
        self.local_search_evaluations = local_search_evaluations
        self.n_colonies = n_colonies
        self.exchange_every = exchange_every
        self.pheromone_per_robot = pheromone_per_robot
        self.initial_pheromone = initial_pheromone
        self.reward_epsilon = reward_epsilon
        self.survival_epsilon = survival_epsilon
        self.unvisited_bonus = unvisited_bonus
        self.exploration = exploration
        self.pooled_deposit = pooled_deposit
        self.n_threads = n_threads

    @classmethod
    def journal(
        cls,
        *,
        evaporation: Evaporation = 0.1,
        initial_pheromone: Pheromone = "bounds",
        unvisited_bonus: NotNegative = 0.05,
        exploration: NotNegative = 0.01,
        pooled_deposit: bool = False,
        **parameters: Any,
    ) -> Self:
        """Return the colony with which the paper's journal version made its published curves.

        Parameters
        ----------
        evaporation, initial_pheromone, unvisited_bonus, exploration, pooled_deposit
            As for the class, with that version's values.
        **parameters
            Any other parameter of the class.

        Notes
        -----
        Simon, Richley, Overbey and Perez-Lavin, PeerJ Computer Science, 2025.
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

        One row an arc, with the columns ``tail`` and ``head`` (node labels; the base's self-loop
        has the base as both), ``reward`` and ``survival`` (the two pheromones), and before them
        ``colony`` where there are several, and ``robot`` where each has maps of its own.
        """
        import pandas as pd  # half of the time that importing this module would take

        if self.problem is None:
            raise RuntimeError("There is no pheromone before the algorithm has a problem.")
        graph, nodes = self.problem.mission.arrays, self.problem.mission.nodes
        tails, heads = (
            pd.Series([nodes[i] for i in [*ends, graph.base]], dtype=object)
            for ends in (graph.tail, graph.head)
        )
        columns = ["colony", "robot", "tail", "head", "reward", "survival"]
        maps = [
            pd.DataFrame(dict(zip(columns, [number, robot, tails, heads, *levels.T], strict=True)))
            for number, colony in enumerate(self.colonies)
            for robot, levels in enumerate(colony.pheromone)
        ]
        several = {"colony": self.n_colonies > 1, "robot": self.pheromone_per_robot}
        single = [name for name, is_there in several.items() if not is_there]
        return pd.concat(maps, ignore_index=True).drop(columns=single)

    @property
    def colony(self) -> Colony:
        """The first colony."""
        return self.colonies[0]

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        mission = problem.mission
        reward, survival = mission.total_reward or 1.0, float(mission.robots)
        if self.initial_pheromone != "bounds":
            reward = survival = float(self.initial_pheromone)
        rule = ColonyRule(
            initial_reward_pheromone=reward,
            initial_survival_pheromone=survival,
            **settings_of(self, ColonyRule),
        )
        self._improver: IterationSearch | None = None
        if self.local_search > 0:
            self._improver = IterationSearch(
                mission,
                share=self.local_search,
                evaluations_each=self.local_search_evaluations,
                limits=problem.planning_limits,
                random_state=self.random_state,
            )
        self._threads = AntThreads(self.n_threads)
        self.colonies = [
            Colony(
                mission,
                rule,
                n_ants=share,
                threads=self._threads,
                limits=problem.planning_limits,
                random_state=self.random_state,
            )
            for share in _shares(self.n_ants, self.n_colonies)
        ]
        self._origins: list[PlanArchive] = [self.archive]  # by which the colonies deposit
        if self.n_colonies > 1:
            self._origins = [
                PlanArchive(mission.robots, max_ties=self.max_ties) for _ in self.colonies
            ]

    def _advance(self, **_: Any) -> None:
        n_ants = min(self.n_ants, self._n_left())
        if n_ants == 0:  # the plans to start from have spent the budget
            return
        if self.n_colonies > 1 and self.n_iter == 1 and len(self.archive):
            for origin in self._origins:  # every colony is given the plans to start from
                origin.insert(self.archive.plans, self.archive.objectives.copy())
        shares = _shares(n_ants, self.n_colonies)
        for colony, origin, share in zip(self.colonies, self._origins, shares, strict=True):
            if self._improver is not None:  # it may have spent what was left
                share = min(share, self._n_left())
            if share == 0:
                continue
            batch = colony.construct(share)
            objectives, members = self._take_in(batch)
            if self._improver is not None:
                batch, objectives, members = self._improve(
                    self._improver, batch, objectives, members
                )
            if origin is not self.archive:
                origin.insert(batch.take(members), objectives[members])
            colony.learn(batch, objectives, members, origin)
        if self.n_colonies > 1 and self.exchange_every and self.n_iter % self.exchange_every == 0:
            exchange_archives(self._origins)

    def _improve(
        self,
        improver: IterationSearch,
        batch: PlanBatch,
        objectives: FloatArray,
        members: OffsetArray,
    ) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Add what a local search makes of an iteration's plans to what is known of them."""
        improved, gained, n_evaluated = improver.improve(
            batch, members, self.random_state, self._n_left()
        )
        self.evaluator.n_eval += n_evaluated
        if len(improved) == 0:
            return batch, objectives, members
        whole = PlanBatch.concatenate([batch, improved])
        objectives = np.vstack([objectives, gained])
        return whole, objectives, self.archive.insert(whole, objectives)

    def _finalize(self) -> None:
        self._threads.close()


def _shares(n: int, parts: int) -> list[int]:
    """Split ``n`` into shares that differ by at most 1; with a smaller ``n``, none is larger."""
    return [n // parts + (part < n % parts) for part in range(parts)]
