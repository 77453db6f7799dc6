"""A problem that counts its evaluations, for algorithms that do not count them exactly."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.base.types import FloatArray
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch


class BudgetSpentError(Exception):
    """Ends a run in the middle of an evaluation, because its budget is spent."""


@dataclass
class Meter:
    """The number of evaluations and their limit, which all copies of a metered problem share."""

    allowed: int = sys.maxsize  # evaluations
    archive: PlanArchive | None = None  # gets all feasible plans that are evaluated
    progress: Callable[[], Any] | None = None  # called after evaluations
    spent: int = 0  # evaluations


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
        """Compute the objectives of plans; raise a BudgetSpentError if not all are allowed."""
        meter = self.meter
        allowed = batch[: max(meter.allowed - meter.spent, 0)]
        if len(allowed) == 0 < len(batch):
            raise BudgetSpentError
        meter.spent += len(allowed)
        F = self.problem.evaluate_batch(allowed)
        if meter.progress is not None:
            meter.progress()
        if meter.archive is not None:
            feasible, objectives = allowed, -self.checked("F", F, len(allowed))
            if self.n_ieq_constr:
                rows = np.flatnonzero((self.constrain_batch(allowed) <= 0).all(axis=1))
                feasible, objectives = allowed.take(rows), objectives[rows]
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
        """The bounds that the problem states."""
        return self.problem.objective_bounds

    def allowing_invalid(self) -> "MeteredBOTOHE":
        """Return the same problem with ``allow_invalid``; it shares the meter."""
        return MeteredBOTOHE(self.problem.allowing_invalid(), self.meter)

    def checked(self, what: str, values: Any, n_plans: int) -> FloatArray:
        """Check values as the problem does, so that an error names its class."""
        return self.problem.checked(what, values, n_plans)

    def name(self) -> str:
        """Return the problem's name."""
        return self.problem.name()

    def __getattr__(self, name: str) -> Any:
        """Return an attribute that only the problem's class has, such as a method of its own."""
        if name.startswith("_"):  # copy and pickle ask for these before there is a problem
            raise AttributeError(name)
        return getattr(self.problem, name)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # pymoo copies the problem with the algorithm; both count together
