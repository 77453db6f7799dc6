"""Performing runs on the workers of a Dask cluster that have the same code."""

import contextlib
import socket
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from typing import Any
from urllib.parse import urlsplit

from botohe_moo.study.file.code import code_mismatch
from botohe_moo.study.file.model import StudyError, installed_versions
from botohe_moo.study.run.pool import WorkerPool
from botohe_moo.study.run.task import Outcome, Task, failure

_SECONDS_BETWEEN_CHECKS = 0.2
_SECONDS_TO_CONNECT = 10
_SECONDS_TO_FETCH = 60.0  # an outcome, when its run has ended
_SECONDS_WITHOUT_WORKERS = 3.0  # before a warning


def dask_outcomes(
    tasks: Sequence[Task], *, address: str, stopped: Callable[[], bool]
) -> Generator[tuple[Task, Outcome], None, None]:
    """Perform runs on a Dask cluster; yield their outcomes as they end.

    Workers need no access to this machine's disk. Workers that lack this package or an algorithm,
    or have another version of them, get no runs, and a warning says so; the same holds for workers
    that join later. If a worker dies, Dask gives its runs to another. ``stopped`` is asked five
    times a second; when it is true, waiting runs are cancelled, and the others are not waited for.
    """
    waiting, running = deque(tasks), dict[Any, tuple[Task, set[str]]]()
    with _connected(address) as client:
        workers = _FitWorkers(client, address, tasks)
        try:
            while (waiting or running) and not stopped():
                threads = workers.count_threads()
                for future, (task, allowed) in list(running.items()):
                    is_lost = allowed.isdisjoint(threads)  # its workers have left
                    if not (is_lost or future.done()):
                        continue
                    del running[future]
                    outcome = None if is_lost else _outcome(future)
                    if outcome is not None:
                        yield task, outcome
                    else:
                        future.cancel()
                        waiting.append(task)
                while waiting and len(running) < sum(threads.values()):
                    task = waiting.popleft()
                    key = f"run-{task.run.digest}-{time.time_ns()}"
                    future = client.submit(_perform_on_worker, task, key=key, workers=[*threads])
                    running[future] = task, set(threads)
                _wait_for_any(client, running)
        finally:
            client.cancel([*running])


def _wait_for_any(client: Any, running: dict[Any, Any]) -> None:
    import distributed

    wait: Any = distributed.wait  # untyped
    if not running:
        time.sleep(_SECONDS_BETWEEN_CHECKS)
        return
    with client.as_current(), contextlib.suppress(TimeoutError, distributed.CancelledError):
        wait([*running], timeout=_SECONDS_BETWEEN_CHECKS, return_when="FIRST_COMPLETED")


def _outcome(future: Any) -> Outcome | None:
    """Return what a run's future holds; None if it was lost together with the worker.

    Dask gives up a run after several workers have died while they performed it.
    """
    from distributed import CancelledError

    try:
        outcome: Outcome = future.result(timeout=_SECONDS_TO_FETCH)
    except (TimeoutError, CancelledError):
        return None
    except Exception as error:
        return failure(f"the Dask worker failed ({type(error).__name__}: {error})")
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


class _FitWorkers:
    """The workers of a cluster that have the same code; each is asked for it when first seen."""

    def __init__(self, client: Any, address: str, tasks: Sequence[Task]) -> None:
        self._client = client
        self._address = address
        algorithms = (task.run.algorithm for task in tasks)
        self._algorithms = [*{algorithm.label: algorithm for algorithm in algorithms}.values()]
        self._is_fit: dict[str, bool] = {}  # by address
        self._idle_since = time.monotonic()

    def count_threads(self) -> dict[str, int]:
        """Return the number of threads of each fit worker, by its address."""
        try:
            threads: dict[str, int] = self._client.nthreads()
            if new := threads.keys() - self._is_fit.keys():
                self._check(sorted(new))
        except (OSError, ValueError, TypeError, RuntimeError):  # the connection is closed
            raise StudyError(
                "The Dask scheduler is gone. All runs that are finished are kept; run the study "
                "again to go on."
            ) from None
        fit = {address: n for address, n in threads.items() if self._is_fit.get(address)}
        if fit:
            self._idle_since = time.monotonic()
        elif time.monotonic() - self._idle_since > _SECONDS_WITHOUT_WORKERS:
            warnings.warn(
                f"no worker of the Dask cluster at {self._address} can perform runs; waiting for "
                "one that can.",
                stacklevel=2,
            )
        return fit

    def _check(self, addresses: list[str]) -> None:
        """Note which workers have the same code; warn of the others."""
        answers = self._client.run(
            code_mismatch,
            installed_versions(),
            self._algorithms,
            workers=addresses,
            on_error="return",
        )
        for address, answer in answers.items():
            if isinstance(answer, OSError):  # it has left; if it comes back, it is asked again
                continue
            self._is_fit[address] = answer is None
            if isinstance(answer, Exception):
                reason = " ".join(str(answer).split())
                answer = f"cannot use botohe-moo ({reason})"
            if answer is not None:
                warnings.warn(f"the Dask worker {address} gets no runs: it {answer}.", stacklevel=2)


# One pool serves all threads of a Dask worker; its processes end with the worker's.
_POOL = WorkerPool()


def _perform_on_worker(task: Task) -> Outcome:
    outcome: Outcome
    [(_, outcome)] = _POOL.perform([task])
    return outcome
