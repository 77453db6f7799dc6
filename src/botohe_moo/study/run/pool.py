"""Workers of this machine: threads, each of which performs its runs in a sandbox."""

import contextlib
import threading
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeVar

import joblib

from botohe_moo.study.run.sandbox import Sandbox
from botohe_moo.study.run.task import BoundTask, Outcome, Record, Task

if TYPE_CHECKING:
    from botohe_moo.search.bounds import FrontBound

Given = TypeVar("Given", Task, BoundTask)
Found = TypeVar("Found")
FoundBounds = Generator[tuple[BoundTask, "FrontBound | str"], None, None]
Outcomes = Generator[tuple[Task, Outcome], None, None]


class SandboxPool:
    """Sandboxes for workers that are threads; they are reused."""

    def __init__(self) -> None:
        self._idle: list[Sandbox] = []
        self._lock = threading.Lock()
        self._closed = False

    def perform(
        self, task: Task, *, stopped: Callable[[], bool], note: Callable[[Record], None]
    ) -> Outcome | None:
        """Perform a run in a free sandbox, as :meth:`Sandbox.perform` does."""
        with self._lent() as sandbox:
            return sandbox.perform(task, stopped=stopped, note=note)

    def bound(self, task: BoundTask, *, stopped: Callable[[], bool]) -> "FrontBound | str | None":
        """Bound a mission in a free sandbox, as :meth:`Sandbox.bound` does."""
        with self._lent() as sandbox:
            return sandbox.bound(task, stopped=stopped)

    @contextlib.contextmanager
    def _lent(self) -> Iterator[Sandbox]:
        with self._lock:
            sandbox = self._idle.pop() if self._idle else Sandbox()
        try:
            yield sandbox
        finally:
            with self._lock:
                if self._closed:
                    sandbox.close()
                else:
                    self._idle.append(sandbox)

    def close(self) -> None:
        """End all idle processes now, and the others when their run has ended."""
        with self._lock:
            self._closed = True
            while self._idle:
                self._idle.pop().close()


def local_outcomes(
    tasks: Sequence[Task],
    *,
    workers: int,
    stopped: Callable[[], bool],
    note: Callable[[Task, Record], None],
) -> Outcomes:
    """Perform runs on this machine, several at a time; yield their outcomes as they end.

    ``stopped`` is asked ten times a second; when it is true, all runs end without an outcome.
    ``note`` is given what runs have recorded, as they go.
    """

    def perform(task: Task, sandboxes: SandboxPool, is_over: Callable[[], bool]) -> Outcome | None:
        return sandboxes.perform(task, stopped=is_over, note=lambda record: note(task, record))

    return _done(perform, tasks, workers, stopped)


def local_bounds(
    tasks: Iterable[BoundTask], *, workers: int, stopped: Callable[[], bool]
) -> FoundBounds:
    """Bound missions on this machine, several at a time; yield the bounds as they are found.

    A text says why there is none. ``stopped`` is asked ten times a second; when it is true, all end
    without a bound.
    """

    def bound(
        task: BoundTask, sandboxes: SandboxPool, is_over: Callable[[], bool]
    ) -> "FrontBound | str | None":
        return sandboxes.bound(task, stopped=is_over)

    return _done(bound, tasks, workers, stopped)


def _done(
    act: Callable[[Given, SandboxPool, Callable[[], bool]], Found | None],
    tasks: Iterable[Given],
    workers: int,
    stopped: Callable[[], bool],
) -> Generator[tuple[Given, Found], None, None]:
    """Do tasks in sandboxes, several at a time; yield what comes of those that were not stopped."""
    sandboxes = SandboxPool()
    closed = threading.Event()

    def is_over() -> bool:
        return stopped() or closed.is_set()

    def do(task: Given) -> tuple[Given, Found | None]:
        return task, None if is_over() else act(task, sandboxes, is_over)

    # Threads suffice: the work is done in the sandboxes' processes.
    parallel = joblib.Parallel(
        n_jobs=workers, backend="threading", return_as="generator_unordered", batch_size=1
    )
    try:
        for task, found in parallel(joblib.delayed(do)(task) for task in tasks):
            if found is not None:
                yield task, found
    finally:
        closed.set()
        sandboxes.close()
