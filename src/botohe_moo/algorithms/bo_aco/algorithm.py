"""Bi-objective ant colony optimisation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, Self

import numpy as np
from pydantic import Field

from botohe_moo.algorithms import base
from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies, Threads
from botohe_moo.algorithms.bo_aco import colony
from botohe_moo.algorithms.bo_aco.colony import Colony, ColonySettings
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.base.parameters import Count, NotNegative, Probability
from botohe_moo.base.types import FloatArray, ObjectArray, OffsetArray
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, TrailPlan

if TYPE_CHECKING:
    import pandas as pd


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
        evaporation: colony.Evaporation = 0.1,
        initial_pheromone: colony.InitialPheromone = "bounds",
        unvisited_bonus: NotNegative = colony.JOURNAL_BONUS,
        exploration: NotNegative = colony.JOURNAL_EXPLORATION,
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
        return colony.tabulate_pheromone(self.problem.mission, self.colony)

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        self._improver: LocalSearch | None = None
        if self.local_search > 0:
            costs = Costs(problem.world)
            self._improver = LocalSearch(problem.mission, costs, random_state=self.random_state)
        self.colony = Colony(
            problem.mission,
            problem.world,
            ColonySettings(**base.settings_of(self, ColonySettings)),
            n_threads=self.n_threads,
            random_state=self.random_state,
        )

    def _advance(self, **_: Any) -> None:
        n_ants = min(self.n_ants, self.n_left)
        if n_ants == 0:  # the plans to start from took the whole budget
            return
        batch = self.colony.construct(n_ants)
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
