"""Processes for runs: what loops for ever, crashes or fills the memory takes only its run along."""

from __future__ import annotations

import contextlib
import fcntl
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from typing import IO, Any

from botohe_moo.study.run.environment import THREAD_SETTINGS, environment
from botohe_moo.study.run.perform import verify
from botohe_moo.study.run.task import Outcome, Record, Task, failure

__all__ = ["Sandbox", "SandboxPool"]

_SECONDS_BETWEEN_LOOKS = 0.1
_MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine
_SECONDS_TO_DIE = 5.0  # a core may be written meanwhile
_LAST_WORDS = 4_000  # bytes


@dataclass
class _Story:
    """What is known of a run while it goes on."""

    task: Task
    environment: dict[str, Any]
    deadline: float
    began: str | None = None
    records: list[Record] = field(default_factory=list)

    def note(self, record: Record) -> None:
        """Add a record; a later one at the same number of evaluations stands for both."""
        if self.records and self.records[-1].evaluations == record.evaluations:
            self.records.pop()
        self.records.append(record)

    def failed(self, error: str, where: str | None = None) -> Outcome:
        last = self.records[-1] if self.records else None
        return self._told(failure(error, where, last))

    def _told(self, outcome: Outcome, records: tuple[Record, ...] = ()) -> Outcome:
        return replace(outcome, records=records, environment=self.environment, began=self.began)

    def ended(self, outcome: Outcome) -> Outcome:
        """Put together what was sent piece by piece; a failed run has no result.

        The final front is evaluated again, here, where no algorithm has been.
        """
        last = self.records[-1] if self.records else None
        if outcome.status != "failed" and last is not None and last.plans is not None:
            try:
                verify(self.task, *last.plans)
            except ValueError as error:
                return self.failed(str(error))
        # Only the last record's plans are kept.
        kept = [replace(record, plans=None) for record in self.records[:-1]] + self.records[-1:]
        return self._told(outcome, () if outcome.status == "failed" else tuple(kept))

    def killed(self) -> Outcome:
        """Tell of a run that had to be killed; what it had recorded is evaluated again."""
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
    """Say for how long a run may go on, without budget of seconds from its last evaluation on."""
    if task.seconds is not None:
        return task.seconds + task.grace_seconds
    return math.inf if task.origin["package"] == "botohe-moo" else task.patience


class Sandbox:
    """A process that performs one run after another, and is replaced when it has to be killed."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def perform(
        self, task: Task, *, stopped: Callable[[], bool], note: Callable[[Record], None]
    ) -> Outcome | None:
        """Perform a run.

        Parameters
        ----------
        task
            The run.
        stopped
            Asked ten times a second; ends the run when it says so.
        note
            Is given the latest record whenever there are new ones.

        Returns
        -------
        Outcome
            With all records; None if the run was stopped.
        """
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._start()
        try:
            outcome = self._follow(task, stopped, note)
        except BaseException:
            self.close()
            raise
        if task.origin["source"] is not None:  # who knows what it leaves behind for other runs
            self.close()
        return outcome

    def _start(self) -> None:
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115
        fcntl.fcntl(self._said, fcntl.F_SETFL, os.O_RDWR | os.O_APPEND)  # it will be cut
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)  # noqa: PTH109
        threads = {name: os.environ.get(name, "1") for name in THREAD_SETTINGS}
        process = subprocess.Popen(
            # -P: a file of the current folder must not stand in for a standard module.
            [sys.executable, "-P", "-m", "botohe_moo.study.run.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
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
        story = _Story(task, environment(), time.monotonic() + _MOST_SECONDS_TO_START)
        self._said.truncate(0)  # what earlier runs have said
        with contextlib.suppress(OSError):  # it died while nobody looked: seen below
            self._tasks.send(task)
        while True:
            if stopped():
                self.close()
                return None
            answer = self._answer()
            if answer is None:
                if time.monotonic() > story.deadline:
                    self.close()
                    return story.killed()
                continue
            kind, digest, content, seen_in = answer
            if digest not in (task.digest, None):  # from a copy of the process, of another run
                continue
            story.environment = seen_in or story.environment
            if kind == "died":
                return self._died(story)
            if kind == "end":
                return story.ended(content)
            if kind == "begin":
                story.began = content
                story.deadline = time.monotonic() + _most_seconds(task)
            elif kind == "progress":
                if task.seconds is None:
                    story.deadline = time.monotonic() + _most_seconds(task)
            else:
                for record in content:
                    story.note(record)
                if content:
                    note(content[-1])

    def _answer(self) -> tuple[str, str | None, Any, dict[str, Any] | None] | None:
        """Give what the process says next, or that it died; None if it says nothing for a while."""
        assert self._process is not None
        try:
            if self._answers.poll(_SECONDS_BETWEEN_LOOKS):
                return self._answers.recv()  # type: ignore[no-any-return]
            # A process of its own that it leaves behind keeps the connection open.
            if self._process.poll() is None or self._answers.poll(0):
                return None
        except Exception:  # the other end is no more, or somebody else has written to it
            pass
        return "died", None, None, None

    def _died(self, story: _Story) -> Outcome:
        process, said = self._process, self._last_words()
        assert process is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_SECONDS_TO_DIE)  # it may still be about to
        status = process.poll()
        self.close()
        if status is None:
            return story.failed("its process closed the connection", said or None)
        known = {member.value: member.name for member in signal.Signals}
        how = f"signal {known.get(-status, -status)}" if status < 0 else f"exit status {status}"
        return story.failed(f"its process died ({how})", said or None)

    def _last_words(self) -> str:
        size = self._said.seek(0, os.SEEK_END)
        self._said.seek(max(0, size - _LAST_WORDS))
        return self._said.read().decode(errors="replace").strip()

    def close(self) -> None:
        """End the process and all it has started, whatever they do."""
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            self._tasks.close()
            self._answers.close()
            self._said.close()
            self._process = None


class SandboxPool:
    """Sandboxes that are used again, for workers that are threads."""

    def __init__(self) -> None:
        self._idle: list[Sandbox] = []
        self._lock = threading.Lock()
        self._closed = False

    def perform(
        self, task: Task, *, stopped: Callable[[], bool], note: Callable[[Record], None]
    ) -> Outcome | None:
        """Perform a run in a sandbox that is free; as :meth:`Sandbox.perform`.

        Parameters
        ----------
        task, stopped, note
            As there.
        """
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
        """End all processes: those at work when their run has ended or been stopped."""
        with self._lock:
            self._closed = True
            while self._idle:
                self._idle.pop().close()
