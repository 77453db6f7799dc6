"""A process for runs: one that hangs, crashes or fills the memory loses no other run."""

import contextlib
import fcntl
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import IO, TYPE_CHECKING, Any

from botohe_moo.study.run.environment import THREAD_SETTINGS, environment
from botohe_moo.study.run.perform import verify
from botohe_moo.study.run.task import BoundTask, Outcome, Record, Task, failure

if TYPE_CHECKING:
    from botohe_moo.search.bounds import FrontBound

_SECONDS_BETWEEN_LOOKS = 0.1
_MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine
_SECONDS_TO_DIE = 5.0  # a core may be written meanwhile
_MOST_OUTPUT = 4_000  # bytes


@dataclass
class _RunState:
    """What is known of a run that is being performed."""

    task: Task
    environment: dict[str, Any]
    deadline: float
    began: str | None = None
    records: list[Record] = field(default_factory=list)

    def note(self, record: Record) -> None:
        """Add a record; it replaces one at the same number of evaluations."""
        if self.records and self.records[-1].evaluations == record.evaluations:
            self.records.pop()
        self.records.append(record)

    def failed(self, error: str, where: str | None = None) -> Outcome:
        last = self.records[-1] if self.records else None
        return self._completed(failure(error, where, last))

    def _completed(self, outcome: Outcome, records: tuple[Record, ...] = ()) -> Outcome:
        return replace(outcome, records=records, environment=self.environment, began=self.began)

    def ended(self, outcome: Outcome) -> Outcome:
        """Give the outcome with its records; a failed run has none.

        The final front is evaluated again in this process, where no algorithm has run.
        """
        last = self.records[-1] if self.records else None
        if outcome.status != "failed" and last is not None and last.plans is not None:
            try:
                verify(self.task, *last.plans)
            except ValueError as error:
                return self.failed(str(error))
        # Only the last record's plans are kept.
        kept = [replace(record, plans=None) for record in self.records[:-1]] + self.records[-1:]
        return self._completed(outcome, () if outcome.status == "failed" else tuple(kept))

    def killed(self) -> Outcome:
        """Give the outcome of a run that had to be killed; its last front is evaluated again."""
        task, last = self.task, self.records[-1] if self.records else None
        if self.began is None:
            return self.failed(f"killed: it did not start within {_MOST_SECONDS_TO_START:g} s")
        if task.seconds is None:
            return self.failed(
                f"killed: it had evaluated no plan for {task.patience:g} s; a budget of seconds "
                "would have ended it, --patience allows it more"
            )
        outcome = Outcome(
            status="timeout",
            stopped_by="limit",
            evaluations=last.evaluations if last else 0,
            seconds=task.seconds,
            recording_seconds=0.0,
            error=(
                f"killed: {task.grace_seconds:g} s after its {task.seconds:g} s were up it had "
                "still not come to the end of an iteration"
            ),
        )
        return self.ended(outcome)


def _most_seconds(task: Task) -> float:
    """Give how long a run may take, or without a budget of seconds, go without an evaluation."""
    if task.seconds is not None:
        return task.seconds + task.grace_seconds
    ours = task.origin["package"] == "botohe-moo" and task.origin["source"] is None
    return math.inf if ours else task.patience


class Sandbox:
    """A process that performs one run after another, and is replaced when it has to be killed.

    It bounds missions, too.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def perform(
        self, task: Task, *, stopped: Callable[[], bool], note: Callable[[Record], None]
    ) -> Outcome | None:
        """Perform a run; give its outcome with all records, None if it was stopped.

        ``stopped`` is asked ten times a second and ends the run when it is true; ``note`` is given
        the latest record whenever there are new ones.
        """
        with self._closed_by_errors():
            outcome = self._follow(task, stopped, note)
        if task.origin["source"] is not None:  # its code might leave something behind
            self.close()
        return outcome

    def bound(self, task: BoundTask, *, stopped: Callable[[], bool]) -> "FrontBound | str | None":
        """Bound the front of a mission; say what went wrong, or give None if it was stopped.

        ``stopped`` is asked ten times a second and ends the process when it is true.
        """
        with self._closed_by_errors():
            self._send(task)
            while not stopped():
                message = self._receive()
                if message is None:
                    continue
                kind, digest, content, _ = message
                if kind == "died":
                    return self._last_words()[0]
                if (kind, digest) == ("end", task.digest):
                    return content  # type: ignore[no-any-return]
            self.close()
        return None

    @contextlib.contextmanager
    def _closed_by_errors(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            self.close()
            raise

    def _send(self, task: Task | BoundTask) -> None:
        """Give a task to the process, which is started if there is none."""
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._start()
        self._output.truncate(0)  # what earlier tasks have printed
        with contextlib.suppress(OSError):  # it has died in between: seen when it should answer
            self._tasks.send(task)

    def _start(self) -> None:
        self._output: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        fcntl.fcntl(self._output, fcntl.F_SETFL, os.O_RDWR | os.O_APPEND)  # it gets truncated
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)  # noqa: PTH109
        threads = {name: os.environ.get(name, "1") for name in THREAD_SETTINGS}
        process = subprocess.Popen(
            # -P: a file of the current folder must not stand in for a standard module.
            [sys.executable, "-P", "-m", "botohe_moo.study.run.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._output,
            env={**os.environ, **threads, "PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C is for the runner alone
        )
        assert process.stdin is not None
        assert process.stdout is not None
        self._tasks = Connection(os.dup(process.stdin.fileno()), readable=False)
        self._answers = Connection(os.dup(process.stdout.fileno()), writable=False)
        process.stdin.close()
        process.stdout.close()
        self._process = process

    def _follow(
        self, task: Task, stopped: Callable[[], bool], note: Callable[[Record], None]
    ) -> Outcome | None:
        self._send(task)
        state = _RunState(task, environment(), time.monotonic() + _MOST_SECONDS_TO_START)
        while True:
            if stopped():
                self.close()
                return None
            message = self._receive()
            if message is None:
                if time.monotonic() > state.deadline:
                    self.close()
                    return state.killed()
                continue
            kind, digest, content, seen_in = message
            if digest not in (task.digest, None):  # of another run, from a copy of the process
                continue
            state.environment = seen_in or state.environment
            if kind == "died":
                return state.failed(*self._last_words())
            if kind == "end":
                return state.ended(content)
            if kind == "begin":
                state.began = content
                state.deadline = time.monotonic() + _most_seconds(task)
            elif kind == "progress":
                if task.seconds is None:
                    state.deadline = time.monotonic() + _most_seconds(task)
            else:
                for record in content:
                    state.note(record)
                if content:
                    note(content[-1])

    def _receive(self) -> tuple[str, str | None, Any, dict[str, Any] | None] | None:
        """Receive the next message, or that the process died; None if there is none for a while."""
        assert self._process is not None
        try:
            if self._answers.poll(_SECONDS_BETWEEN_LOOKS):
                return self._answers.recv()  # type: ignore[no-any-return]
            # A process that it has started and left behind keeps the connection open.
            if self._process.poll() is None or self._answers.poll(0):
                return None
        except Exception:  # the connection is closed, or something else was written to it
            pass
        return "died", None, None, None

    def _last_words(self) -> tuple[str, str | None]:
        """Say how the process died, and give what it had printed last; None if that is nothing."""
        process = self._process
        assert process is not None
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - _MOST_OUTPUT))
        output = self._output.read().decode(errors="replace").strip()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_SECONDS_TO_DIE)  # it may still be about to
        status = process.poll()
        self.close()
        if status is None:
            return "its process closed the connection", output or None
        known = {member.value: member.name for member in signal.Signals}
        how = f"signal {known.get(-status, -status)}" if status < 0 else f"exit status {status}"
        return f"its process died ({how})", output or None

    def close(self) -> None:
        """End the process and all it has started, whatever they do."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            self._tasks.close()
            self._answers.close()
            self._output.close()
            self._process = None
