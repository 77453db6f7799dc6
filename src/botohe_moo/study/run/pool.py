"""Workers of this machine: threads, each of which performs its runs in a sandbox."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence

import joblib

from botohe_moo.study.run.sandbox import SandboxPool
from botohe_moo.study.run.task import Outcome, Record, Task

__all__ = ["Outcomes", "local_outcomes"]

Outcomes = Iterator[tuple[Task, Outcome]]


def local_outcomes(
    tasks: Sequence[Task],
    *,
    workers: int,
    stopped: Callable[[], bool],
    note: Callable[[Task, Record], None],
) -> Outcomes:
    """Perform runs on this machine, several at a time.

    Parameters
    ----------
    tasks
        The runs.
    workers
        How many at a time, at least 1.
    stopped
        Asked ten times a second; when it says so, all runs end without an outcome.
    note
        Is given what runs have recorded, as they go.

    Yields
    ------
    tuple
        A task and its outcome, in the order in which they end.
    """
    sandboxes = SandboxPool()
    given_up = threading.Event()

    def perform(task: Task) -> tuple[Task, Outcome | None]:
        def is_over() -> bool:
            return stopped() or given_up.is_set()

        if is_over():
            return task, None
        return task, sandboxes.perform(
            task, stopped=is_over, note=lambda record: note(task, record)
        )

    # Threads suffice, for the work is done in the processes they look after.
    parallel = joblib.Parallel(
        n_jobs=workers, backend="threading", return_as="generator_unordered", batch_size=1
    )
    try:
        for task, outcome in parallel(joblib.delayed(perform)(task) for task in tasks):
            if outcome is not None:
                yield task, outcome
    finally:
        given_up.set()
        sandboxes.close()
