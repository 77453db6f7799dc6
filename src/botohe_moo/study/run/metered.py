"""Problems that count evaluations themselves, for algorithms that may not."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import PlanError
from botohe_moo.problem import BOTOHE
from botohe_moo.search.archive import PlanArchive
from botohe_moo.trails import PlanBatch


class BudgetSpentError(Exception):
    """Ends a run within an evaluation: the budget is spent."""


@dataclass
class Meter:
    """Counts the plans that all copies of a problem evaluate, and calls ``watch`` each time."""

    spent: int = 0
    watch: Callable[[], None] = lambda: None

    def count(self, n_plans: int) -> None:
        """Count evaluated plans."""
        self.spent += n_plans
        if n_plans:
            self.watch()

    def __reduce__(self) -> "tuple[type[Meter], tuple[int]]":
        return Meter, (self.spent,)  # a copy that an algorithm stores is not watched

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self  # pymoo copies the problem with the algorithm; they share one meter


class CountedBOTOHE(BOTOHE):
    """BOTOHE that counts what it evaluates; copies of the problem share its ``meter``."""

    def __init__(self, mission: Mission, **limits: Any) -> None:
        super().__init__(mission, **limits)
        self.meter = Meter()

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of many plans, and count them."""
        self.meter.count(len(batch))
        return super().evaluate_batch(batch)


class MeteredBOTOHE(CountedBOTOHE):
    """BOTOHE that evaluates no more plans than the budget allows, and archives them.

    pymoo checks ``("n_eval", N)`` between generations, so that a population of 70 spends 1 050 of
    1 000 evaluations. Here the last generation is cut off at the budget. The ``archive`` holds all
    non-dominated feasible plans that were evaluated; copies of the problem share it.
    """

    def __init__(self, mission: Mission, *, evaluations: int | None = None, **limits: Any) -> None:
        super().__init__(mission, **limits)
        self.evaluations = sys.maxsize if evaluations is None else evaluations
        self.archive = PlanArchive(mission.robots)

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of plans; a BudgetSpentError if not all of them are allowed."""
        allowed = batch[: max(self.evaluations - self.meter.spent, 0)]
        F = super().evaluate_batch(allowed)
        feasible, objectives = allowed, -F
        if self.n_ieq_constr:
            kept = np.flatnonzero((self.constrain_batch(allowed) <= 0).all(axis=1))
            feasible, objectives = allowed.take(kept), objectives[kept]
        if len(feasible):
            self.archive.insert(feasible, objectives)
        if len(allowed) < len(batch):
            raise BudgetSpentError
        return F

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self


@contextlib.contextmanager
def blamed(problem: BOTOHE, method: str) -> Iterator[None]:
    """Name a problem of one's own in the ValueError that becomes of whatever a method raises."""
    try:
        yield
    except PlanError:  # the algorithm is to blame
        raise
    except Exception as error:
        kind, found = type(problem), f"{type(error).__name__}: {error}"
        raise ValueError(f"{kind.__module__}:{kind.__qualname__}.{method}: {found}") from error


class _Blamed(BOTOHE):
    """Stands before a problem of one's own, which errors of its methods name."""

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        with blamed(self, "evaluate_batch"):
            return super().evaluate_batch(batch)

    def constrain_batch(self, batch: PlanBatch) -> FloatArray:
        with blamed(self, "constrain_batch"):
            return super().constrain_batch(batch)


def counting(base: type[CountedBOTOHE], kind: type[BOTOHE]) -> Any:
    """Derive from a problem's class one that counts, or meters, and has the same name."""
    if kind is BOTOHE:
        return base

    def __reduce_ex__(self: BOTOHE, _: object) -> tuple[object, ...]:  # noqa: N807
        return _revive, (base, kind), self.__dict__

    names = {"__module__": kind.__module__, "__qualname__": kind.__qualname__}
    return type(kind.__name__, (base, _Blamed, kind), {**names, "__reduce_ex__": __reduce_ex__})


def _revive(base: type[CountedBOTOHE], kind: type[BOTOHE]) -> Any:
    """Make an empty problem for unpickling: classes made here have no name to be found by."""
    found = counting(base, kind)
    return found.__new__(found)
