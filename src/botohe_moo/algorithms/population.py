"""pymoo's population-based algorithms, wired with operators for trail plans and an archive."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
from pymoo.algorithms.moo.moead import ParallelMOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.sms import SMSEMOA, LeastHypervolumeContributionSurvival
from pymoo.algorithms.moo.spea2 import SPEA2, SPEA2Survival
from pymoo.core.algorithm import Algorithm
from pymoo.core.crossover import Crossover
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling
from pymoo.decomposition.tchebicheff import Tchebicheff
from pymoo.operators.survival.rank_and_crowding import RankAndCrowding

from botohe_moo._checks import check_integer, check_number
from botohe_moo._types import FloatArray
from botohe_moo.algorithms.base import check_budget, check_options, evaluations_left
from botohe_moo.archive import PlanArchive
from botohe_moo.operators.duplicates import PlanDuplicates
from botohe_moo.operators.repair import PenaltyOnly, PlanRepair
from botohe_moo.operators.wiring import (
    Weights,
    make_crossover,
    make_mutation,
    make_repair,
    make_sampling,
)
from botohe_moo.problem import BOTOHE, FrontOutput

__all__ = ["PlanMOEAD", "PlanNSGA2", "PlanSMSEMOA", "PlanSPEA2", "PopulationAlgorithm"]


class PopulationAlgorithm(Algorithm):
    """What this package adds to a population-based algorithm of pymoo's.

    Operators for trail plans, an external archive, and an exact budget. The population and its
    selection stay what pymoo makes them; ``opt``, and with it the result, is the set of all
    non-dominated feasible plans that were evaluated.

    To be put before a class of pymoo's: ``class PlanNSGA2(PopulationAlgorithm, NSGA2)``.

    Parameters
    ----------
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
    n_children
        Children of each pair, 1 or 2.
    max_ties
        Plans with equal objectives but different trails that the archive keeps, at least 1.
    **options
        Those of the pymoo class.

    Attributes
    ----------
    plan_archive : PlanArchive
        All non-dominated feasible plans found so far.
    repair : PlanRepair
        The repair of the operators that were given by name; ``repair.counts`` tells what it did.
    """

    pop: Population
    is_initialized: bool

    def __init__(
        self,
        *,
        sampling: Weights | Sampling | Any,
        corners: bool,
        crossover: Weights | Crossover,
        mutation: Weights | Mutation,
        repair: str | PlanRepair,
        prob_crossover: float,
        prob_mutation: float,
        max_ties: int,
        n_children: int = 2,
        **options: Any,
    ) -> None:
        self.max_ties = check_integer("max_ties", max_ties, at_least=1)
        self.plan_archive = PlanArchive(1)
        self._least_infeasible: Population | None = None
        made = make_repair(repair)
        super().__init__(
            sampling=make_sampling(sampling, corners=corners),
            crossover=make_crossover(
                crossover, prob=prob_crossover, repair=made, n_offsprings=n_children
            ),
            mutation=make_mutation(mutation, prob=prob_mutation, repair=made),
            **{"output": FrontOutput(), **options},
        )
        self.repair = made
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
        if isinstance(self.repair, PenaltyOnly) and not problem.allow_invalid:
            problem = problem.allowing_invalid()
        if self.termination is None and kwargs.get("termination") is None:
            kwargs["termination"] = ("n_eval", 100_000)
        self.plan_archive = PlanArchive(
            problem.mission.robots,
            max_ties=self.max_ties,
            constrain=problem.constrain_batch if problem.n_ieq_constr else None,
        )
        super().setup(problem, **kwargs)
        check_budget(self.termination)
        return self

    def infill(self) -> Population | None:
        """Give the plans to evaluate next, no more than the budget allows."""
        infills = super().infill()
        if infills is None:
            return None
        return infills[: evaluations_left(self)]

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
            feasible = infills[infills.get("feas")]
            if len(feasible):
                batch = self.problem.mission.batch(feasible.get("X"))
                self.plan_archive.absorb(batch, -feasible.get("F"))
        return super().advance(infills, **kwargs)

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
    sampling, corners, crossover, mutation, repair, prob_crossover, prob_mutation, max_ties
        As for :class:`PopulationAlgorithm`.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

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
    >>> result = minimize(BOTOHE(load_mission("toy")), PlanNSGA2(), ("n_eval", 1_000), seed=1)
    >>> result.algorithm.evaluator.n_eval
    1000
    """

    def __init__(
        self,
        *,
        pop_size: int = 100,
        n_offsprings: int | None = None,
        sampling: Weights | Sampling | Any = "guided",
        corners: bool = False,
        crossover: Weights | Crossover = {"exchange": 1, "splice": 1},
        mutation: Weights | Mutation = {"ruin": 1, "share": 0.2, "home": 0.05},
        repair: str | PlanRepair = "safest-path",
        prob_crossover: float = 0.9,
        prob_mutation: float = 1.0,
        max_ties: int = 1_000,
        **options: Any,
    ) -> None:
        check_options(self, options)
        super().__init__(
            pop_size=check_integer("pop_size", pop_size, at_least=2),
            n_offsprings=check_offsprings(n_offsprings),
            sampling=sampling,
            corners=corners,
            crossover=crossover,
            mutation=mutation,
            repair=repair,
            prob_crossover=prob_crossover,
            prob_mutation=prob_mutation,
            max_ties=max_ties,
            survival=RankAndCrowding(),
            eliminate_duplicates=PlanDuplicates(),
            **options,
        )


def check_offsprings(n_offsprings: int | None) -> int | None:
    """Give ``n_offsprings``, or raise the ValueError that says what was expected."""
    return None if n_offsprings is None else check_integer("n_offsprings", n_offsprings, at_least=1)
