"""Performing runs on a Dask cluster; workers without the same code get none."""

import operator
import pkgutil
import queue
import re
import socket
import threading
import time
import warnings
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from botohe_moo.study.file.digest import code_mismatch, installed_versions
from botohe_moo.study.file.model import StudyError
from botohe_moo.study.run.pool import Outcomes, SandboxPool
from botohe_moo.study.run.task import Outcome, Task, failure

_SECONDS_BETWEEN_CHECKS = 0.2
_SECONDS_TO_CONNECT = 10
_SECONDS_BETWEEN_COUNTS = 1.0  # of the workers
_SECONDS_WITHOUT_WORKERS = 3.0  # before a warning
_SECONDS_TO_ANSWER = 30.0  # for a worker that imports everything first
_MOST_DEATHS = 3  # of workers with the same run
_LAST_PORT = 65_535
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?([^\s/:]+|\[[^\s/\]]+\]):(?P<port>\d+)")
# By name: a worker that lacks the function could not unpickle it.
_CHECK = f"{code_mismatch.__module__}:{code_mismatch.__name__}"


def dask_outcomes(tasks: Sequence[Task], *, address: str, stopped: Callable[[], bool]) -> Outcomes:
    """Perform runs on a Dask cluster; yield their outcomes as they end.

    Workers need nothing of this machine's disk. Those that lack this package or an algorithm, or
    have another version of them, get no runs, and a warning says so; so it is with workers that
    join later. ``stopped`` is asked five times a second; when it is true, waiting runs are
    cancelled, and the others are not waited for.
    """
    with _connected(address) as client:
        cluster = _Cluster(client, address, deque(tasks))
        try:
            while cluster.has_work and not stopped():
                cluster.update()
                try:
                    future = cluster.ended.get(timeout=_SECONDS_BETWEEN_CHECKS)
                except queue.Empty:
                    continue
                if done := cluster.take(future):
                    yield done
        finally:
            cluster.cancel()


def check_address(address: str) -> None:
    """Raise a StudyError unless ``address`` may be that of a Dask scheduler."""
    found = _ADDRESS.fullmatch(address)
    if found is None or int(found["port"]) > _LAST_PORT:
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
    check_address(address)
    connect: Any = Client  # untyped
    host, _, port = address.rpartition("://")[2].rpartition(":")
    where = host.strip("[]"), int(port)
    try:
        # A client without a scheduler leaves threads behind that log errors when the process ends.
        socket.create_connection(where, timeout=_SECONDS_TO_CONNECT).close()
        return _within(
            2 * _SECONDS_TO_CONNECT,
            lambda: connect(address, timeout=_SECONDS_TO_CONNECT, set_as_default=False),
        )
    except (OSError, ValueError, TypeError, OverflowError) as error:  # a timeout is an OSError
        said = str(error).partition("\n")[0]
        raise StudyError(f"No Dask scheduler answers at {address!r} ({said}).") from None


def _within(seconds: float, make: Callable[[], Any]) -> Any:
    """Call ``make`` with a time limit: a client waits for ever if the server is not Dask's."""
    made: queue.SimpleQueue[tuple[Any, Exception | None]] = queue.SimpleQueue()

    def act() -> None:
        try:
            made.put((make(), None))
        except Exception as error:
            made.put((None, error))

    threading.Thread(target=act, daemon=True).start()
    try:
        result, error = made.get(timeout=seconds)
    except queue.Empty:
        raise TimeoutError(f"no answer within {seconds:g} seconds") from None
    if error is not None:
        raise error
    return result


@dataclass
class _Worker:
    """A worker; it gets as many runs at a time as it has threads, if its code is the same."""

    n_threads: int
    check: Any  # the future of the check of its code; None once it has ended
    checked_at: float
    fit: bool = False


class _Cluster:
    """The workers of a cluster, and the runs that they perform."""

    def __init__(self, client: Any, address: str, waiting: deque[Task]) -> None:
        self.ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._client = client
        self._address = address
        self._waiting = waiting
        origins = {
            (task.algorithm, *task.origin.values()): (task.algorithm, task.parameters, task.origin)
            for task in waiting
        }
        self._origins = [*origins.values()]  # one task for each code that is run
        self._workers: dict[str, _Worker] = {}
        self._running: dict[Any, tuple[Task, str]] = {}  # by future, with the worker's address
        self._n_deaths: dict[str, int] = {}
        self._n_submitted = 0
        self._counted_at = float("-inf")
        self._idle_since: float | None = time.monotonic()

    @property
    def has_work(self) -> bool:
        """Whether there are runs that have not ended, or outcomes that were not taken yet."""
        return bool(self._waiting or self._running) or not self.ended.empty()

    def update(self) -> None:
        """Take note of workers that joined or left, and give runs to those that are free."""
        now = time.monotonic()
        if now - self._counted_at >= _SECONDS_BETWEEN_COUNTS:
            self._counted_at = now
            self._count()
        busy = Counter(address for _, address in self._running.values())
        for address, worker in self._workers.items():
            while worker.fit and self._waiting and busy[address] < worker.n_threads:
                task = self._waiting.popleft()
                future = self._submit(address, f"run-{task.digest}", _perform_on_worker, task)
                self._running[future] = task, address
                busy[address] += 1
        self._warn_if_idle(now)

    def _count(self) -> None:
        try:
            there = self._client.nthreads()
        except (OSError, ValueError, TypeError, RuntimeError):  # the connection is closed
            raise StudyError(
                "The Dask scheduler is gone. All runs that are finished are kept; run the study "
                "again to go on."
            ) from None
        for address in self._workers.keys() - there.keys():
            del self._workers[address]
        for future, (task, address) in list(self._running.items()):
            if address not in self._workers:
                del self._running[future]
                future.cancel()
                self._died(task)
        for address in there.keys() - self._workers.keys():
            function = self._submit(address, "find", pkgutil.resolve_name, _CHECK)
            check = self._submit(
                address, "check", operator.call, function, installed_versions(), self._origins
            )
            self._workers[address] = _Worker(there[address], check, time.monotonic())

    def _died(self, task: Task) -> None:
        n = self._n_deaths[task.digest] = self._n_deaths.get(task.digest, 0) + 1
        if n < _MOST_DEATHS:
            self._waiting.append(task)
        else:
            self.ended.put((task, failure(f"{n} Dask workers died while they performed it")))

    def _submit(self, address: str, name: str, act: Callable[..., Any], *arguments: Any) -> Any:
        self._n_submitted += 1
        future = self._client.submit(
            act,
            *arguments,
            key=f"{name}-{self._n_submitted}-{time.time_ns()}",
            workers=[address],
            pure=False,
        )
        future.add_done_callback(self.ended.put)
        return future

    def _warn_if_idle(self, now: float) -> None:
        """Warn once whenever no worker has been able to perform runs for a while."""
        if not self._waiting or any(
            worker.fit or (worker.check and now - worker.checked_at < _SECONDS_TO_ANSWER)
            for worker in self._workers.values()
        ):
            self._idle_since = now
        elif self._idle_since is not None and now - self._idle_since >= _SECONDS_WITHOUT_WORKERS:
            self._idle_since = None
            warnings.warn(
                f"no worker of the Dask cluster at {self._address} can perform runs; waiting for "
                "one that can.",
                stacklevel=2,
            )

    def take(self, future: Any) -> tuple[Task, Outcome] | None:
        """Take note of a future that has ended; give task and outcome if it was a run's."""
        if isinstance(future, tuple):
            return future
        if future in self._running:
            task, _ = self._running.pop(future)
            if _is_lost(future):
                self._died(task)
                return None
            if error := future.exception():
                said = f"the Dask worker failed ({type(error).__name__}: {error})"
                return task, failure(said)
            return task, future.result()
        for address, worker in self._workers.items():
            if worker.check == future:
                worker.check = None
                self._note_check(address, worker, future)
                break
        return None

    def _note_check(self, address: str, worker: _Worker, future: Any) -> None:
        """Take note of whether a worker's code is the same; warn if it is not."""
        if _is_lost(future):  # if the worker is still there, the next count checks it again
            del self._workers[address]
            return
        error = future.exception()
        if error is None:
            worker.fit = future.result() is None
            said = f"it {future.result()}"
        else:
            said = f"{type(error).__name__}: {error}".partition("\n")[0]
            other = "import" if isinstance(error, ImportError) else "use its"
            said = f"it cannot {other} botohe-moo ({said})"
        if not worker.fit:
            warnings.warn(f"the Dask worker {address} gets no runs: {said}.", stacklevel=2)

    def cancel(self) -> None:
        """Cancel everything that has not ended."""
        checks = [worker.check for worker in self._workers.values() if worker.check]
        self._client.cancel([*self._running, *checks])


def _is_lost(future: Any) -> bool:
    """Tell whether a future ended without a result, as when its worker or the scheduler dies."""
    return future.status in ("cancelled", "lost")


# One for all threads of a Dask worker; its processes end with the worker's.
_ON_WORKER = SandboxPool()


def _perform_on_worker(task: Task) -> Outcome | None:
    return _ON_WORKER.perform(task, stopped=lambda: False, note=lambda _: None)
