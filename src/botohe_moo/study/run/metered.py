"""Problems that count evaluations themselves, for algorithms that might not."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.search.archive import PlanArchive
from botohe_moo.trails import PlanBatch

__all__ = ["BudgetSpentError", "CountedBOTOHE", "Meter", "MeteredBOTOHE"]


class BudgetSpentError(Exception):
    """Ends a run from within an evaluation: the budget is spent."""


@dataclass
class Meter:
    """What all copies of a problem have evaluated together.

    Attributes
    ----------
    spent
        Plans evaluated so far.
    watch
        Is called when some have been.
    """

    spent: int = 0
    watch: Callable[[], None] = lambda: None

    def count(self, n_plans: int) -> None:
        """Count plans that are evaluated.

        Parameters
        ----------
        n_plans
            How many.
        """
        self.spent += n_plans
        if n_plans:
            self.watch()

    def __reduce__(self) -> tuple[type[Meter], tuple[int]]:
        return Meter, (self.spent,)  # nobody watches a copy that an algorithm stores

    def __deepcopy__(self, memo: dict[int, Any]) -> Meter:
        return self  # pymoo copies algorithms with their problem; there is one meter


class CountedBOTOHE(BOTOHE):
    """BOTOHE that counts what it evaluates.

    Parameters
    ----------
    mission
        What to plan for.
    min_survival
        Survival floor of every robot, in [0, 1].

    Attributes
    ----------
    meter
        The count, shared by copies of the problem.
    """

    def __init__(self, mission: Mission, *, min_survival: float = 0.0) -> None:
        super().__init__(mission, min_survival=min_survival)
        self.meter = Meter()

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of many plans, and count them.

        Parameters
        ----------
        batch
            Plans for the mission's team.

        Returns
        -------
        numpy.ndarray
            F of shape (n, 2), to be minimised.
        """
        self.meter.count(len(batch))
        return super().evaluate_batch(batch)


class MeteredBOTOHE(CountedBOTOHE):
    """BOTOHE that refuses to evaluate more plans than the budget, and archives what it evaluates.

    pymoo looks at ``("n_eval", N)`` between generations, so that a population of 70 spends 1 050
    of 1 000 evaluations. Here the last generation is cut off where the budget is.

    Parameters
    ----------
    mission
        What to plan for.
    min_survival
        Survival floor of every robot, in [0, 1].
    evaluations
        Budget; None for no limit.

    Attributes
    ----------
    meter
        The count, shared by copies of the problem.
    archive
        All non-dominated feasible plans among those evaluated, shared by copies, too.
    """

    def __init__(
        self, mission: Mission, *, min_survival: float = 0.0, evaluations: int | None = None
    ) -> None:
        super().__init__(mission, min_survival=min_survival)
        self.evaluations = sys.maxsize if evaluations is None else evaluations
        self.archive = PlanArchive(mission.robots)

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of many plans, as far as the budget goes.

        Parameters
        ----------
        batch
            Plans for the mission's team, valid ones unless ``allow_invalid`` is set.

        Returns
        -------
        numpy.ndarray
            F of shape (n, 2), to be minimised.

        Raises
        ------
        BudgetSpentError
            If the budget does not allow all of them; those it allows have been archived.
        PlanError
            If a plan is not valid.
        """
        allowed = batch[: max(self.evaluations - self.meter.spent, 0)]
        F = super().evaluate_batch(allowed)
        feasible, objectives = allowed, -F
        if self.n_ieq_constr:
            kept = np.flatnonzero((self.constrain_batch(allowed) <= 0).all(axis=1))
            feasible, objectives = allowed.take(kept), objectives[kept]
        if len(feasible):
            self.archive.absorb(feasible, objectives)
        if len(allowed) < len(batch):
            raise BudgetSpentError
        return F

    def __deepcopy__(self, memo: dict[int, Any]) -> MeteredBOTOHE:
        return self
