"""Problems that count evaluations themselves, for algorithms that may not."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.problem import BOTOHE
from botohe_moo.search.archive import PlanArchive
from botohe_moo.trails import PlanBatch


class BudgetSpentError(Exception):
    """Ends a run within an evaluation: the budget is spent."""


@dataclass
class Meter:
    """The number of evaluations and their limit, which all copies of a metered problem share."""

    evaluations: int = sys.maxsize  # allowed
    archive: PlanArchive | None = None  # gets all feasible plans that are evaluated
    progress: Callable[[], Any] | None = None  # called after evaluations
    spent: int = 0


class MeteredBOTOHE(BOTOHE):
    """A problem that counts what it evaluates, and evaluates no more plans than are allowed.

    pymoo checks ``("n_eval", N)`` between generations, so that a population of 70 spends 1 050 of
    1 000 evaluations. Here the last generation is cut off at the budget.

    Parameters
    ----------
    problem
        What evaluates: BOTOHE, or a problem of your own.
    meter
        The count and its limit.
    """

    def __init__(self, problem: BOTOHE, meter: Meter) -> None:
        self.__dict__.update(vars(problem))
        self.problem = problem
        self.meter = meter

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of plans; a BudgetSpentError if not all of them are allowed."""
        meter = self.meter
        allowed = batch[: max(meter.evaluations - meter.spent, 0)]
        if len(allowed) == 0 < len(batch):
            raise BudgetSpentError
        meter.spent += len(allowed)
        F = self.problem.evaluate_batch(allowed)
        if meter.progress is not None:
            meter.progress()
        if meter.archive is not None:
            feasible, objectives = allowed, -self.checked("F", F, len(allowed))
            if self.n_ieq_constr:
                kept = np.flatnonzero((self.constrain_batch(allowed) <= 0).all(axis=1))
                feasible, objectives = allowed.take(kept), objectives[kept]
            if len(feasible):
                meter.archive.insert(feasible, objectives)
        if len(allowed) < len(batch):
            raise BudgetSpentError
        return F

    def constrain_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the problem's constraints."""
        return self.problem.constrain_batch(batch)

    @property
    def objective_bounds(self) -> tuple[float, float]:
        """What the problem states."""
        return self.problem.objective_bounds

    def allowing_invalid(self) -> "MeteredBOTOHE":
        """Return the same problem with ``allow_invalid``; it shares the meter."""
        return MeteredBOTOHE(self.problem.allowing_invalid(), self.meter)

    def checked(self, what: str, values: Any, n_plans: int) -> FloatArray:
        """Refuse values in the name of the problem."""
        return self.problem.checked(what, values, n_plans)

    def name(self) -> str:
        """Return the problem's name."""
        return self.problem.name()

    def __getattr__(self, name: str) -> Any:
        """Return what only the class of the problem has, such as methods for its own algorithm."""
        if name.startswith("_"):  # also asked for before there is a problem, by copy and pickle
            raise AttributeError(name)
        return getattr(self.problem, name)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # pymoo copies the problem with the algorithm; both count together
