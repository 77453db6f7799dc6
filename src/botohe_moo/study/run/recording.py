"""When a run's front is recorded, and how."""

import bisect
import math
import sys
import time
from collections.abc import Callable

import numpy as np

from botohe_moo.search.archive import PlanArchive
from botohe_moo.study.run.task import Record, Task


def record_counts(
    *, evaluations: int | None, per_decade: int, start: float, at: tuple[int, ...]
) -> list[int]:
    """List the numbers of evaluations at which a front is recorded.

    They are log-spaced, ``per_decade`` in a tenfold, from ``start`` times the budget to the budget,
    so that any smaller budget can be read off afterwards; without a budget from 1 to 10¹².
    ``at`` are further numbers.
    """
    end = 10**12 if evaluations is None else evaluations
    first = 1.0 if evaluations is None else max(1.0, start * end)
    n = math.floor(per_decade * math.log10(end / first) + 1e-9)
    spaced = {round(end * 10 ** (-i / per_decade)) for i in range(n + 1)}
    return sorted({math.ceil(first), *spaced, *(count for count in at if count <= end)})


class Recorder:
    """Measures an algorithm's own time, and sends a record of its front whenever one is due."""

    def __init__(
        self, task: Task, archive: Callable[[], PlanArchive], send: Callable[[Record], None]
    ) -> None:
        self._archive = archive
        self._send = send
        self._whole = task.seconds is not None  # it may be killed before it can send its plans
        self._counts = record_counts(
            evaluations=task.evaluations, per_decade=task.per_decade, start=task.start, at=task.at
        )
        self._next = self._counts[0]
        self.recording = 0.0
        self._started = time.perf_counter()

    def elapsed(self) -> float:
        """Give the algorithm's own time so far."""
        return time.perf_counter() - self._started - self.recording

    def watch(self, evaluations: int) -> None:
        """Record the front if a record is due after so many evaluations."""
        if evaluations >= self._next:
            began = time.perf_counter()
            self._record(evaluations, began - self._started - self.recording, whole=self._whole)
            passed = bisect.bisect_right(self._counts, evaluations)
            self._next = self._counts[passed] if passed < len(self._counts) else sys.maxsize
            self.recording += time.perf_counter() - began

    def last(self, evaluations: int, seconds: float) -> None:
        """Record the final front with its plans, and what was spent altogether."""
        began = time.perf_counter()
        self._record(evaluations, seconds, whole=True)
        self.recording += time.perf_counter() - began

    def _record(self, evaluations: int, seconds: float, *, whole: bool) -> None:
        archive = self._archive()
        if not len(archive):
            return
        objectives = archive.objectives
        different = np.ones(len(objectives), bool)
        different[1:] = (objectives[1:] != objectives[:-1]).any(axis=1)
        self._send(
            Record(
                evaluations=evaluations,
                seconds=seconds,
                objectives=objectives[different],
                ties=int(len(objectives) - different.sum()),
                plans=(archive.plans, objectives.copy()) if whole else None,
            )
        )
