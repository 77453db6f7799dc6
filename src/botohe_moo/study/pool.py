"""Workers: threads of this machine, or a Dask cluster; each performs its runs in a sandbox."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import joblib

from botohe_moo.study.sandbox import SandboxPool
from botohe_moo.study.tables import StudyError
from botohe_moo.study.task import Outcome, Record, Task, failure

__all__ = ["dask_outcomes", "local_outcomes"]

_SECONDS_BETWEEN_LOOKS = 0.2
_SECONDS_TO_CONNECT = 10

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


def dask_outcomes(tasks: Sequence[Task], *, address: str, stopped: Callable[[], bool]) -> Outcomes:
    """Perform runs on a Dask cluster, whose workers need nothing of this machine's disk.

    Parameters
    ----------
    tasks
        The runs.
    address
        Of the scheduler, such as ``tcp://host:8786``.
    stopped
        Asked five times a second; when it says so, runs that wait are cancelled and those that go
        on are not waited for.

    Yields
    ------
    tuple
        A task and its outcome, in the order in which they end.

    Raises
    ------
    StudyError
        If ``distributed`` is not installed, or nobody answers at the address.
    """
    try:
        from distributed import Client
    except ImportError:
        raise StudyError(
            "A Dask cluster needs the package distributed: pip install 'botohe-moo[dask]'."
        ) from None
    connect: Any = Client  # untyped
    try:
        client = connect(address, timeout=_SECONDS_TO_CONNECT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:  # a timeout is an OSError
        said = str(error).partition("\n")[0]
        raise StudyError(f"No Dask scheduler answers at {address!r} ({said}).") from None
    ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
    with client:
        waiting = {
            client.submit(_perform_on_worker, task, key=f"run-{task.digest}", pure=False): task
            for task in tasks
        }
        for future in waiting:
            future.add_done_callback(ended.put)
        try:
            while waiting and not stopped():
                try:
                    future = ended.get(timeout=_SECONDS_BETWEEN_LOOKS)
                except queue.Empty:
                    continue
                yield waiting.pop(future), _outcome_of(future)
        finally:
            client.cancel(list(waiting))


def _outcome_of(future: Any) -> Outcome:
    if future.status in ("cancelled", "lost"):
        raise StudyError(
            "The Dask scheduler is gone. All runs that are finished are kept; run the study again "
            "to go on."
        )
    error = future.exception()
    if error is None:
        outcome: Outcome = future.result()
        return outcome
    return failure(f"the Dask worker failed ({type(error).__name__}: {error})")


# One for all threads of a Dask worker; its processes end with the worker's.
_ON_WORKER = SandboxPool()


def _perform_on_worker(task: Task) -> Outcome | None:
    return _ON_WORKER.perform(task, stopped=lambda: False, note=lambda _: None)
