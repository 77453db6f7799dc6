"""Where runs are performed: in processes of this machine, or in those of a Dask cluster.

A process that hangs or crashes loses no other run. Its standard input is a connection to the
process that has started it. Each process is in one of these states. It sends the messages that are
in brackets::

    started ──[None]──> at work ──[result]──> started, with the next task
                        │    ^
                        └────┘ [Record]

The answer to None is a task. From every state a process goes to ``dead``: it crashes, SIGALRM ends
it when the time of its run is up, or the pool kills it. Its task then gets what was recorded and
why it ended, and the next task gets another process.
"""

import contextlib
import functools
import math
import os
import platform
import random
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent import futures
from dataclasses import dataclass, replace
from importlib.metadata import version
from itertools import islice
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from llvmlite.binding import get_host_cpu_name  # type: ignore[import-untyped]
from numba.core import event

from botohe_moo.base.runtime import n_cpus
from botohe_moo.base.types import FloatArray
from botohe_moo.study.model import PATIENCE, Run, StudyError, StudyMission, check_code, digest_of
from botohe_moo.study.perform import Outcome, Record, in_a_line, perform, verify

_SECONDS_BETWEEN_LOOKS = 0.1
_SECONDS_TO_DIE = 5.0  # the system may be writing a core dump
_SECONDS_TO_CONNECT = 10
_MOST_OUTPUT = 4_000  # bytes of what a process printed last, which are kept
_PACKAGES = ("numpy", "numba", "llvmlite", "pymoo", "moocore", "scipy", "networkx")


@dataclass(frozen=True)
class BoundTask:
    """A mission whose front is to be bounded."""

    mission: StudyMission
    front: FloatArray  # E[R] and E[S] of the points that its runs have found (n, 2)
    seconds: float


_WORK = "from botohe_moo.study.pool import work; work()"
Given = TypeVar("Given", Run, BoundTask)


class WorkerPool:
    """Processes that perform one task after another.

    Each has a connection of its own, and one thread serves them all: a process that is killed in
    the middle of a message disturbs no other.
    """

    def __init__(self) -> None:
        self._idle: list[_Worker] = []

    def perform(
        self,
        tasks: Iterable[Given],
        *,
        workers: int = 1,
        stopped: Callable[[], bool] = lambda: False,
        note: Callable[[Run, Record], Any] = lambda _run, _record: None,
    ) -> Generator[tuple[Given, Any], None, None]:
        """Perform tasks, several at a time; yield each with its result as they end.

        The result of a run is its outcome. The result of a bound is a FrontBound, or a line that
        says why there is none. Several threads may call this at the same time.

        Parameters
        ----------
        tasks
            Runs or bounds.
        workers
            Most processes at a time.
        stopped
            Asked ten times a second; when it is true, all tasks end without a result.
        note
            Called with each run and record when it is made.
        """
        waiting, busy = iter(tasks), dict[Any, tuple[Given, _Worker]]()
        try:
            while not stopped():
                for task in islice(waiting, workers - len(busy)):
                    try:
                        worker = self._idle.pop()
                    except IndexError:  # there is none, or another thread has taken it
                        worker = _Worker()
                    worker.take(task)
                    busy[worker.connection] = task, worker
                if not busy:
                    return
                wait(busy, _SECONDS_BETWEEN_LOOKS)
                for connection, (task, worker) in list(busy.items()):
                    result = worker.advance(note)
                    if result is not None:
                        del busy[connection]
                        if not worker.closed:
                            self._idle.append(worker)
                        yield task, result
        finally:
            for _, worker in busy.values():
                worker.close()

    def close(self) -> None:
        """End the processes that wait for a task."""
        while self._idle:
            self._idle.pop().close()


class _Worker:
    """A process, the connection to it, its task, and what is known of that so far."""

    def __init__(self) -> None:
        self.connection, childs_end = Pipe()
        self.closed = False
        self._output = tempfile.TemporaryFile()  # noqa: SIM115
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)  # noqa: PTH109
        with childs_end:
            self._process = subprocess.Popen(
                # -P: a file of the current folder must not stand in for a standard module.
                [sys.executable, "-P", "-c", _WORK],
                stdin=childs_end.fileno(),
                stdout=self._output,
                stderr=self._output,
                env={**os.environ, **thread_settings(), "PYTHONPATH": path},
                start_new_session=True,  # Ctrl-C is for the runner alone
            )

    def take(self, task: Run | BoundTask) -> None:
        """Keep a task until the process is ready for it."""
        self._task = task
        self._records: dict[int, Record] = {}  # by evaluations
        self._began: str | None = None

    def advance(self, note: Callable[[Run, Record], Any]) -> Any:
        """Handle the next message, if there is one; return the task's result if it was the last."""
        task = self._task
        has_died = self._process.poll() is not None
        if has_died:
            self._kill()  # processes that it has started may hold the connection open
        try:
            if not self.connection.poll():
                return self._died() if has_died else None
            message = self.connection.recv()
            if message is None:
                self._began = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
                self.connection.send(task)
                return None
        except (EOFError, OSError):  # it may have died in the middle of a message
            return self._died()
        if isinstance(task, BoundTask):
            return message
        if isinstance(message, Record):
            self._records[message.evaluations] = message
            note(task, message)
            return None
        if task.algorithm.origin["source"] is not None:
            self.close()  # code of the user's own might leave something behind
        return self._completed(task, message)

    def _completed(self, run: Run, outcome: Outcome) -> Outcome:
        checked = checked_outcome(run, outcome, [*self._records.values()])
        return replace(checked, environment=environment(), began=self._began)

    def _died(self) -> Outcome | str:
        """Close; return the outcome of a run whose process has died, or why there is no bound."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_SECONDS_TO_DIE)
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - _MOST_OUTPUT))
        output = self._output.read().decode(errors="replace").strip() or None
        self.close()
        task, status = self._task, self._process.returncode
        by = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        error = f"its process died ({by})"
        if isinstance(task, BoundTask):
            return error
        spent = [(record.evaluations, record.seconds) for record in self._records.values()]
        evaluations, seconds = spent[-1] if spent else (0, 0.0)
        ended = Outcome(evaluations=evaluations, seconds=seconds, error=error, traceback=output)
        if status == -signal.SIGALRM:
            ended = replace(ended, **_limit_of(task), traceback=None)
        return self._completed(task, ended)

    def close(self) -> None:
        """Kill the process and all processes that it has started."""
        self.closed = True
        self._kill()
        self._process.wait()
        self.connection.close()
        self._output.close()

    def _kill(self) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)


def _limit_of(run: Run) -> dict[str, Any]:
    """Describe the end of a run that took longer than it may."""
    budget = run.mission.budget
    if budget.seconds is None:
        return {"error": f"killed: it had evaluated no plan for {run.patience:g} s (--patience)"}
    return {
        "status": "timeout",
        "stopped_by": "limit",
        "seconds": budget.seconds,
        "error": f"killed: {budget.grace_seconds:g} s after its {budget.seconds:g} s were up",
    }


def checked_outcome(run: Run, outcome: Outcome, records: Sequence[Record]) -> Outcome:
    """Return the outcome of a run with its records; a failed run has none.

    The final front is evaluated again in this process, where no algorithm has run. If its
    objectives are not those that were recorded, the run has failed.
    """
    if outcome.status == "failed" or not records:
        return outcome
    *before, last = records
    try:
        if last.plans is not None:
            verify(run, *last.plans)
    except Exception as error:  # of a problem of your own, too
        said, trace = in_a_line(error), traceback.format_exc()
        failed: Any = {"status": "failed", "stopped_by": "error", "error": said, "traceback": trace}
        return replace(outcome, **failed)
    # Only the last record's plans are kept.
    return replace(outcome, records=(*(replace(each, plans=None) for each in before), last))


def thread_settings() -> dict[str, str]:
    """Return the settings of other libraries' thread pools for runs: one thread, if not set.

    More would take cores from other workers, and make nothing faster here.
    """
    names = (f"{pool}_NUM_THREADS" for pool in ("OMP", "OPENBLAS", "MKL", "NUMBA"))
    return {name: os.environ.get(name, "1") for name in names}


@functools.cache
def environment() -> dict[str, Any]:
    """Return the environment of runs on this machine, a row of the table ``environments``."""
    columns: dict[str, Any] = {
        "botohe_moo": version("botohe-moo"),
        "commit": _commit(),
        "python": platform.python_version(),
        "packages": " ".join(f"{name}=={version(name)}" for name in _PACKAGES),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.node(),
        "processor": get_host_cpu_name(),
        "n_cpus": n_cpus(),
        "threads": " ".join(f"{name}={number}" for name, number in thread_settings().items()),
    }
    return {"environment": digest_of(columns), **columns}


def _commit() -> str | None:
    """Return the commit of this package's source, with + if changed; None if it is installed."""
    root = Path(__file__).parents[3]
    if not (root / ".git").exists() or not shutil.which("git"):
        return None
    # A process may be killed while it asks, and must leave no lock behind.
    git = ["git", "--no-optional-locks", "-C", str(root), "describe", "--always", "--dirty=+"]
    asked = subprocess.run([*git, "--abbrev=40", "--exclude=*"], capture_output=True, text=True)
    return asked.stdout.strip() or None


# In the process of runs and bounds.


def work() -> None:
    """Perform one task after another until the connection is closed."""
    connection = Connection(os.dup(0))
    # An algorithm that reads from standard input finds its end.
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    threading.Thread(target=_end_with_parent, args=(connection.fileno(),), daemon=True).start()
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    event.register("numba:compiler_lock", _Paused())
    with contextlib.suppress(EOFError, OSError):
        while True:
            connection.send(None)
            task: Run | BoundTask = connection.recv()
            if isinstance(task, BoundTask):
                result = perform_bound(task)
            else:
                result = _run(task, connection.send)
            _end_unless_within(math.inf)
            connection.send(result)


def _run(run: Run, send: Callable[[Any], None]) -> Outcome:
    """Perform a run, and send its records; a run that takes too long ends the process."""
    _end_unless_within(PATIENCE)
    try:
        check_code(run)
    except Exception as error:  # whatever the algorithm's module raises
        return Outcome(error=in_a_line(error), traceback=traceback.format_exc())
    # Algorithms have generators of their own. One that draws from a global generator nevertheless
    # should draw the same numbers each time.
    random.seed(run.seed)
    np.random.seed(run.seed)  # noqa: NPY002
    evaluated = functools.partial(_end_unless_within, run.seconds_allowed)
    evaluated()
    unlimited = run.mission.budget.seconds is None
    return perform(run, send, evaluated if unlimited else lambda: None)


def perform_bound(task: BoundTask) -> Any:
    """Bound the front of a mission; an exception becomes a line that says what it was."""
    # Imported late: runs do not need it.
    from botohe_moo.bounds import bound_front

    mission = task.mission
    try:
        return bound_front(
            mission.mission,
            front=task.front,
            time_limit=task.seconds,
            min_survival=mission.min_survival,
            max_length=mission.longest,
        )
    except Exception as error:
        return in_a_line(error)


class _Paused(event.Listener):
    """Stops the clock of a run while numba compiles, which is not the algorithm's own time."""

    def __init__(self) -> None:
        self._left: list[float] = []  # seconds, once for each function within another

    def on_start(self, _event: Any) -> None:
        self._left.append(signal.setitimer(signal.ITIMER_REAL, 0.0)[0])

    def on_end(self, _event: Any) -> None:
        if left := self._left.pop():
            signal.setitimer(signal.ITIMER_REAL, left)


def _end_unless_within(seconds: float) -> None:
    """Let SIGALRM end this process, unless this function is called again within the time."""
    signal.setitimer(signal.ITIMER_REAL, 0.0 if seconds == math.inf else seconds)


def _end_with_parent(descriptor: int) -> None:
    """Wait until the other end of the connection is closed, and end this process."""
    poll = select.poll()
    poll.register(descriptor, 0)  # a closed connection is always reported
    poll.poll()
    if os.getpgid(0) == os.getpid():  # and everything that algorithms have started
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


# On a Dask cluster.


def dask_outcomes(
    runs: Sequence[Run], *, address: str, stopped: Callable[[], bool]
) -> Generator[tuple[Run, Outcome], None, None]:
    """Perform runs on a Dask cluster; yield their outcomes as they end.

    Workers need no access to this machine's disk. Runs of a worker that has another version of this
    package or an algorithm fail, and say why. If a worker dies, Dask gives its runs to another.
    ``stopped`` is asked five times a second; when it is true, waiting runs are cancelled, and the
    others are not waited for.
    """
    try:
        import distributed

        connect: Any = distributed.Client  # untyped
        client = connect(address, timeout=_SECONDS_TO_CONNECT, set_as_default=False)
    except ImportError:
        raise StudyError("Dask is not installed: pip install 'botohe-moo[dask]'.") from None
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise StudyError(f"No Dask scheduler answers at {address!r} ({reason}).") from None
    with client:
        answers = client.run(environment, on_error="return")
        for worker, answer in answers.items():
            if isinstance(answer, Exception):  # it would end, and its runs would wait for others
                raise StudyError(f"{worker} cannot perform runs: {in_a_line(answer)}.")
        if not answers:
            warnings.warn(f"{address} has no Dask workers; waiting for one.", stacklevel=3)
        # Retries are of a run whose worker fails; Dask's own limit holds for workers that die.
        executor = client.get_executor(pure=False, retries=3)
        run_of = {executor.submit(_perform_on_worker, run): run for run in runs}
        try:
            while run_of and not stopped():
                ended, _ = futures.wait(run_of, 0.2, futures.FIRST_COMPLETED)
                for future in ended:
                    yield run_of.pop(future), _outcome(future)
        finally:
            executor.shutdown(wait=False)


def _outcome(future: futures.Future[Outcome]) -> Outcome:
    try:
        return future.result()
    except (futures.CancelledError, OSError):
        raise StudyError("The Dask scheduler is gone; run the study again to go on.") from None
    except Exception as error:
        return Outcome(error=f"the Dask worker failed ({in_a_line(error)})")


# One pool serves all threads of a Dask worker; its processes end with the worker's.
_POOL = WorkerPool()


def _perform_on_worker(run: Run) -> Outcome:
    outcome: Outcome
    [(_, outcome)] = _POOL.perform([run])
    return outcome
