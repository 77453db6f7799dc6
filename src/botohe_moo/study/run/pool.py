"""Workers of this machine: threads, each of which performs its runs in a sandbox."""

import threading
from collections.abc import Callable, Generator, Sequence

import joblib

from botohe_moo.study.run.sandbox import Sandbox
from botohe_moo.study.run.task import Outcome, Record, Task

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
        with self._lock:
            sandbox = self._idle.pop() if self._idle else Sandbox()
        try:
            return sandbox.perform(task, stopped=stopped, note=note)
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
    sandboxes = SandboxPool()
    closed = threading.Event()

    def perform(task: Task) -> tuple[Task, Outcome | None]:
        def is_over() -> bool:
            return stopped() or closed.is_set()

        if is_over():
            return task, None
        return task, sandboxes.perform(
            task, stopped=is_over, note=lambda record: note(task, record)
        )

    # Threads suffice: the work is done in the sandboxes' processes.
    parallel = joblib.Parallel(
        n_jobs=workers, backend="threading", return_as="generator_unordered", batch_size=1
    )
    try:
        for task, outcome in parallel(joblib.delayed(perform)(task) for task in tasks):
            if outcome is not None:
                yield task, outcome
    finally:
        closed.set()
        sandboxes.close()
