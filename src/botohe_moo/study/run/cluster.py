"""A Dask cluster as workers: each is asked what it has before it is given runs."""

from __future__ import annotations

import operator
import pkgutil
import queue
import re
import socket
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from botohe_moo.study.file.code_here import installed_versions, other_code
from botohe_moo.study.run.pool import Outcomes
from botohe_moo.study.run.sandbox import SandboxPool
from botohe_moo.study.run.task import Outcome, Task, failure
from botohe_moo.study.store.manifest import StudyError

__all__ = ["check_address", "dask_outcomes"]

_SECONDS_BETWEEN_LOOKS = 0.2
_SECONDS_TO_CONNECT = 10
_SECONDS_BETWEEN_COUNTS = 1.0  # of the workers that are there
_SECONDS_WITHOUT_WORKERS = 3.0  # before that is said
_SECONDS_TO_ANSWER = 30.0  # for a worker that imports everything first
_MOST_DEATHS = 3  # of workers with the same run
_LAST_PORT = 65_535
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?([^\s/:]+|\[[^\s/\]]+\]):(?P<port>\d+)")
# By name, for a worker cannot even read a function that it has not.
_QUESTION = f"{other_code.__module__}:{other_code.__name__}"


def dask_outcomes(tasks: Sequence[Task], *, address: str, stopped: Callable[[], bool]) -> Outcomes:
    """Perform runs on a Dask cluster, whose workers need nothing of this machine's disk.

    Workers that lack this package or an algorithm, or have another version of them, get no runs; a
    warning says so. Those that join later are asked, too.

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
        If ``distributed`` is not installed, nobody answers at the address, or nobody does any more.
    """
    with _connected(address) as client:
        crew = _Crew(client, address, deque(tasks))
        try:
            while crew.has_work and not stopped():
                crew.look_after()
                try:
                    future = crew.ended.get(timeout=_SECONDS_BETWEEN_LOOKS)
                except queue.Empty:
                    continue
                if done := crew.take(future):
                    yield done
        finally:
            crew.cancel()


def check_address(address: str) -> None:
    """Make sure that something may be the address of a Dask scheduler.

    Raises
    ------
    StudyError
        If it may not.
    """
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
        # A client that finds nobody leaves threads behind that complain when the process ends.
        socket.create_connection(where, timeout=_SECONDS_TO_CONNECT).close()
        return _within(
            2 * _SECONDS_TO_CONNECT,
            lambda: connect(address, timeout=_SECONDS_TO_CONNECT, set_as_default=False),
        )
    except (OSError, ValueError, TypeError, OverflowError) as error:  # a timeout is an OSError
        said = str(error).partition("\n")[0]
        raise StudyError(f"No Dask scheduler answers at {address!r} ({said}).") from None


def _within(seconds: float, make: Callable[[], Any]) -> Any:
    """Give what is made in time: a client waits for ever where somebody does not speak Dask."""
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
    """What is known of a worker.

    Attributes
    ----------
    n_threads
        Runs it may have at a time.
    asked
        The question that it has not answered yet; None if it has.
    asked_at
        When it was asked.
    fit
        Whether it may get runs.
    at_work
        The runs it has.
    """

    n_threads: int
    asked: Any
    asked_at: float
    fit: bool = False
    at_work: set[Any] = field(default_factory=set)


class _Crew:
    """The workers of a cluster, and the runs they have."""

    def __init__(self, client: Any, address: str, waiting: deque[Task]) -> None:
        self.ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._client = client
        self._address = address
        self._waiting = waiting
        self._origins = {task.algorithm: task.origin for task in waiting}
        self._workers: dict[str, _Worker] = {}
        self._at_work: dict[Any, tuple[Task, str]] = {}
        self._n_deaths: dict[str, int] = {}
        self._n_asked = 0
        self._counted_at = float("-inf")
        self._idle_since: float | None = time.monotonic()

    @property
    def has_work(self) -> bool:
        """Whether there are runs that have not ended, or outcomes that nobody has taken."""
        return bool(self._waiting or self._at_work) or not self.ended.empty()

    def look_after(self) -> None:
        """See who has come and gone, and give everybody something to do."""
        now = time.monotonic()
        if now - self._counted_at >= _SECONDS_BETWEEN_COUNTS:
            self._counted_at = now
            self._count()
        for address, worker in self._workers.items():
            while worker.fit and self._waiting and len(worker.at_work) < worker.n_threads:
                task = self._waiting.popleft()
                future = self._submit(address, f"run-{task.digest}", _perform_on_worker, task)
                worker.at_work.add(future)
                self._at_work[future] = task, address
        self._complain(now)

    def _count(self) -> None:
        try:
            there = self._client.nthreads()
        except (OSError, ValueError, TypeError, RuntimeError):  # the connection is closed
            raise _gone() from None
        for address in self._workers.keys() - there.keys():
            for future in self._workers.pop(address).at_work:
                task, _ = self._at_work.pop(future)
                future.cancel()
                self._died(task)
        for address in there.keys() - self._workers.keys():
            question = self._submit(address, "find", pkgutil.resolve_name, _QUESTION)
            asked = self._submit(
                address, "ask", operator.call, question, installed_versions(), self._origins
            )
            self._workers[address] = _Worker(there[address], asked, time.monotonic())

    def _died(self, task: Task) -> None:
        n = self._n_deaths[task.digest] = self._n_deaths.get(task.digest, 0) + 1
        if n < _MOST_DEATHS:
            self._waiting.append(task)
        else:
            self.ended.put((task, failure(f"{n} Dask workers died while they performed it")))

    def _submit(self, address: str, name: str, act: Callable[..., Any], *arguments: Any) -> Any:
        self._n_asked += 1
        future = self._client.submit(
            act,
            *arguments,
            key=f"{name}-{self._n_asked}-{time.time_ns()}",
            workers=[address],
            pure=False,
        )
        future.add_done_callback(self.ended.put)
        return future

    def _complain(self, now: float) -> None:
        """Say once that there is nobody, whenever there is nobody for a while."""
        if not self._waiting or any(
            worker.fit or (worker.asked and now - worker.asked_at < _SECONDS_TO_ANSWER)
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
        """Take note of what a worker has done; give the outcome if that was a run.

        Parameters
        ----------
        future
            What has ended, or a run and its outcome.
        """
        if isinstance(future, tuple):
            return future
        if future in self._at_work:
            task, address = self._at_work.pop(future)
            if address in self._workers:
                self._workers[address].at_work.discard(future)
            if _is_lost(future):
                self._died(task)
                return None
            return task, _outcome_of(future)
        for address, worker in self._workers.items():
            if worker.asked == future:
                worker.asked = None
                self._judge(address, worker, future)
                break
        return None

    def _judge(self, address: str, worker: _Worker, future: Any) -> None:
        """Hear what a worker has answered."""
        if _is_lost(future):  # with the worker, as the next count shows, or it is asked again
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
        """Take back what has not ended."""
        questions = [worker.asked for worker in self._workers.values() if worker.asked]
        self._client.cancel([*self._at_work, *questions])


def _gone() -> StudyError:
    return StudyError(
        "The Dask scheduler is gone. All runs that are finished are kept; run the study again "
        "to go on."
    )


def _is_lost(future: Any) -> bool:
    """Tell whether a future ended without a result, as when its worker or the scheduler dies."""
    return future.status in ("cancelled", "lost")


def _outcome_of(future: Any) -> Outcome:
    error = future.exception()
    if error is None:
        outcome: Outcome = future.result()
        return outcome
    return failure(f"the Dask worker failed ({type(error).__name__}: {error})")


# One for all threads of a Dask worker; its processes end with the worker's.
_ON_WORKER = SandboxPool()


def _perform_on_worker(task: Task) -> Outcome | None:
    return _ON_WORKER.perform(task, stopped=lambda: False, note=lambda _: None)
