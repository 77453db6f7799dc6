"""Performing runs on a Dask cluster."""

import contextlib
import socket
import threading
import time
import warnings
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from typing import Any
from urllib.parse import urlsplit

from botohe_moo.study.model import StudyError, installed_versions
from botohe_moo.study.pool import WorkerPool
from botohe_moo.study.task import Outcome, Task, code_mismatch, failure

_SECONDS_BETWEEN_LOOKS = 0.2
_SECONDS_TO_CONNECT = 10
_SECONDS_TO_FETCH = 60.0  # an outcome, when its run has ended
_RETRIES = 3  # of a run whose worker fails; Dask's own limit holds for workers that die


def dask_outcomes(
    tasks: Sequence[Task], *, address: str, stopped: Callable[[], bool]
) -> Generator[tuple[Task, Outcome], None, None]:
    """Perform runs on a Dask cluster; yield their outcomes as they end.

    Workers need no access to this machine's disk. A worker that lacks this package or an
    algorithm, or has another version of it, gets no runs; if it joins later, its runs fail and say
    why. If a worker dies, Dask gives its runs to another. ``stopped`` is asked five times a second;
    when it is true, waiting runs are cancelled, and the others are not waited for.
    """
    with _connected(address) as client:
        import distributed

        as_completed: Any = distributed.as_completed  # untyped

        fit = _fit_workers(client, address, tasks)
        started = time.time_ns()
        keys = [f"run-{task.run.digest}-{started}" for task in tasks]
        futures = client.map(_perform_on_worker, tasks, key=keys, retries=_RETRIES, workers=fit)
        task_of = dict(zip(keys, tasks, strict=True))
        try:
            with client.as_current():
                finished: Any = as_completed(futures)
            del futures  # each is released when its outcome is there
            while task_of and not stopped():
                for future in finished.next_batch(block=False):
                    if (outcome := _outcome(future)) is not None:
                        yield task_of.pop(future.key), outcome
                    else:
                        finished.add(future)
                if client.status != "running":
                    raise StudyError(_GONE)
                time.sleep(_SECONDS_BETWEEN_LOOKS)
        finally:
            client.cancel([*finished.futures])


def _fit_workers(client: Any, address: str, tasks: Sequence[Task]) -> list[str] | None:
    """Return the workers that have the same code, None if all have; warn of the others."""
    algorithms = {task.run.algorithm.label: task.run.algorithm for task in tasks}
    answers: dict[str, Any] = client.run(
        code_mismatch, installed_versions(), [*algorithms.values()], on_error="return"
    )
    if not answers:
        warnings.warn(f"{address} has no Dask workers; waiting for one.", stacklevel=3)
    unfit = {worker: why for worker, why in answers.items() if why is not None}
    for worker, why in unfit.items():
        said = why if isinstance(why, str) else f"cannot use botohe-moo ({why})"
        said = " ".join(said.split())
        warnings.warn(f"the Dask worker {worker} gets no runs: it {said}.", stacklevel=3)
    if unfit and len(unfit) == len(answers):
        raise StudyError(f"No worker of the Dask cluster at {address} can perform runs.")
    return [worker for worker in answers if worker not in unfit] if unfit else None


_GONE = (
    "The Dask scheduler is gone. All runs that are finished are kept; run the study again to go on."
)


def _outcome(future: Any) -> Outcome | None:
    """Return what a run's future holds; None if it was lost with its worker, and is made again."""
    if future.status == "cancelled":
        raise StudyError(_GONE)
    if future.status not in ("finished", "error"):
        return None
    try:
        outcome: Outcome = future.result(timeout=_SECONDS_TO_FETCH)
    except TimeoutError:
        return None
    except OSError:
        raise StudyError(_GONE) from None
    except Exception as error:
        return failure(f"the Dask worker failed ({type(error).__name__}: {error})")
    return outcome


# One pool serves all threads of a Dask worker; its processes end with the worker's.
_POOL = WorkerPool()


def _perform_on_worker(task: Task) -> Outcome:
    outcome: Outcome
    [(_, outcome)] = _POOL.perform([task])
    return outcome


def check_address(address: str) -> tuple[str, int]:
    """Return host and port of a Dask scheduler's address; raise a StudyError if it has none."""
    parts = urlsplit(address if "://" in address else f"tcp://{address}")
    with contextlib.suppress(ValueError):  # a port above 65 535
        if parts.scheme in ("tcp", "tls") and parts.hostname and parts.port:
            return parts.hostname, parts.port
    raise StudyError(
        f"Expected the address of a Dask scheduler, such as tcp://host:8786, got {address!r}."
    )


def _connected(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise StudyError(
            "A Dask cluster needs the package distributed: pip install 'botohe-moo[dask]'."
        ) from None
    connect: Any = Client  # untyped
    host_and_port = check_address(address)
    client: Future[Any] = Future()

    def make_client() -> None:
        try:
            # A client that finds no scheduler leaves threads behind that log errors at exit.
            socket.create_connection(host_and_port, timeout=_SECONDS_TO_CONNECT).close()
            client.set_result(connect(address, timeout=_SECONDS_TO_CONNECT, set_as_default=False))
        except Exception as error:
            client.set_exception(error)

    # A client waits for ever if the server is not a scheduler, but for example its dashboard.
    threading.Thread(target=make_client, daemon=True).start()
    try:
        return client.result(timeout=2 * _SECONDS_TO_CONNECT)
    except Exception as error:
        reason = str(error).partition("\n")[0] or "it does not answer as one"
        raise StudyError(f"No Dask scheduler answers at {address!r} ({reason}).") from None
