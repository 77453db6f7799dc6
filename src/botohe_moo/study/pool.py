"""Processes of this machine that perform runs: one that hangs or crashes loses no other run.

Each process is in one of these states. Messages of the process are pairs of a kind and a content::

    started ──ready──> preparing ──begin──> running ──end──> started, with the next task
                       (600 s)              (its seconds)
                                            │    ^
                                            └────┘ record

The answer to ``ready`` is a task. A bound has no ``begin``. From every state a process goes to
``dead``: it crashes, SIGALRM ends it when the time of its state is up, or the pool kills it. Its
task then gets what was recorded and why it ended, and the next task gets another process.
"""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Generator, Iterable
from dataclasses import replace
from itertools import islice
from multiprocessing.connection import Pipe, wait
from typing import Any, TypeVar

from botohe_moo.study import task as t
from botohe_moo.study.model import Run
from botohe_moo.study.perform import verify

_SECONDS_BETWEEN_LOOKS = 0.1
_SECONDS_TO_DIE = 5.0  # the system may be writing a core dump
_MOST_OUTPUT = 4_000  # bytes of what a process printed last, which are kept

Given = TypeVar("Given", t.Task, t.BoundTask)


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
        note: Callable[[t.Task, t.Record], None] = lambda _task, _record: None,
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
            Called with each record of a run when it is made.
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
        threads = {name: os.environ.get(name, "1") for name in t.THREAD_SETTINGS}
        with childs_end:
            self._process = subprocess.Popen(
                # -P: a file of the current folder must not stand in for a standard module.
                [sys.executable, "-P", "-m", "botohe_moo.study.worker"],
                stdin=childs_end.fileno(),
                stdout=self._output,
                stderr=self._output,
                env={**os.environ, **threads, "PYTHONPATH": path},
                start_new_session=True,  # Ctrl-C is for the runner alone
            )

    def take(self, task: t.Task | t.BoundTask) -> None:
        """Keep a task until the process is ready for it."""
        self._task = task
        self._records: list[t.Record] = []
        self._began: str | None = None
        self._environment: dict[str, Any] | None = None

    def advance(self, note: Callable[[t.Task, t.Record], None]) -> Any:
        """Handle the next message, if there is one; return the task's result if it was the last."""
        task = self._task
        kind, content = self._receive()
        if kind == "ready":
            with contextlib.suppress(OSError):  # it has died, and the next message says so
                self.connection.send(task)
        elif kind == "begin":
            self._began, self._environment = content
        elif kind == "record" and isinstance(task, t.Task):
            add_record(self._records, content)
            note(task, content)
        elif kind == "end":
            if isinstance(task, t.BoundTask):
                return content
            if task.run.algorithm.origin["source"] is not None:
                self.close()  # code of the user's own might leave something behind
            return self._completed(task, content)
        elif kind == "died":
            status, output = self._last_words()
            if isinstance(task, t.Task) and status == -signal.SIGALRM:
                return self._completed(task, _killed(task, self._began, self._records))
            by = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
            error = f"its process died ({by})"
            if isinstance(task, t.BoundTask):
                return error
            last = self._records[-1] if self._records else None
            return self._completed(task, t.failure(error, output, last))
        return None

    def _completed(self, task: t.Task, outcome: t.Outcome) -> t.Outcome:
        checked = checked_outcome(task.run, outcome, self._records)
        return replace(checked, environment=self._environment or t.environment(), began=self._began)

    def _receive(self) -> tuple[str, Any]:
        """Return the next message; ``("", None)`` if there is none yet, ``died`` after the last."""
        has_died = self._process.poll() is not None
        if has_died:
            self._kill()  # processes that it has started may hold the connection open
        try:
            if self.connection.poll():
                message: tuple[str, Any] = self.connection.recv()
                return message
        except (EOFError, OSError):  # it may have died in the middle of a message
            has_died = True
        return ("died" if has_died else "", None)

    def _last_words(self) -> tuple[int, str | None]:
        """Close; return how the process ended, as ``Popen`` does, and what it printed last."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_SECONDS_TO_DIE)
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - _MOST_OUTPUT))
        output = self._output.read().decode(errors="replace").strip()
        self.close()
        return self._process.returncode, output or None

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


def add_record(records: list[t.Record], record: t.Record) -> None:
    """Add a record; it replaces one at the same number of evaluations."""
    if records and records[-1].evaluations == record.evaluations:
        records.pop()
    records.append(record)


def checked_outcome(run: Run, outcome: t.Outcome, records: list[t.Record]) -> t.Outcome:
    """Return the outcome of a run with its records; a failed run has none.

    The final front is evaluated again in this process, where no algorithm has run. If its
    objectives are not those that were recorded, the run has failed.
    """
    last = records[-1] if records else None
    if outcome.status == "failed":
        return outcome
    if last is not None and last.plans is not None:
        try:
            verify(run, *last.plans)
        except Exception as error:  # of a problem of your own, too
            return t.failure(f"{type(error).__name__}: {error}", traceback.format_exc(), last)
    # Only the last record's plans are kept.
    return replace(
        outcome, records=(*(replace(record, plans=None) for record in records[:-1]), *records[-1:])
    )


def _killed(task: t.Task, began: str | None, records: list[t.Record]) -> t.Outcome:
    """Return the outcome of a run that has ended at its time limit."""
    last = records[-1] if records else None
    budget = task.run.mission.budget
    if began is None:
        return t.failure(f"killed: it did not start within {t.MOST_SECONDS_TO_START:g} s")
    if budget.seconds is None:
        return t.failure(
            f"killed: it had evaluated no plan for {task.patience:g} s; a budget of seconds "
            "would have ended it, --patience allows it more",
            last=last,
        )
    killed = t.failure(
        f"killed: {budget.grace_seconds:g} s after its {budget.seconds:g} s were up it had still "
        "not come to the end of an iteration",
        last=last,
    )
    return replace(killed, status="timeout", stopped_by="limit", seconds=budget.seconds)
