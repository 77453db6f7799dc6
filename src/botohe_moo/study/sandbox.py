"""Processes for runs: what loops for ever, crashes or fills the memory takes only its run along."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

from botohe_moo.study.environment import THREAD_SETTINGS, environment
from botohe_moo.study.perform import Outcome, Record, Task, failure

__all__ = ["Sandbox", "SandboxPool"]

_SECONDS_BETWEEN_LOOKS = 0.1
_MOST_SECONDS_TO_START = 600.0  # kernels are compiled then, perhaps on a slow machine
_LINES_OF_LAST_WORDS = 20


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
            Is given every record.

        Returns
        -------
        Outcome
            With all records; None if the run was stopped.
        """
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._start()
        try:
            return self._follow(task, stopped, note)
        except BaseException:
            self.close()
            raise

    def _start(self) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)  # noqa: PTH109
        threads = {name: os.environ.get(name, "1") for name in THREAD_SETTINGS}
        self._process = subprocess.Popen(
            # -P: a file of the current folder must not stand in for a standard module.
            [sys.executable, "-P", "-m", "botohe_moo.study.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **threads, "PYTHONPATH": path},
            start_new_session=True,  # Ctrl-C is for the runner alone
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._tasks = Connection(os.dup(self._process.stdin.fileno()), readable=False)
        self._answers = Connection(os.dup(self._process.stdout.fileno()), writable=False)
        self._process.stdin.close()
        self._process.stdout.close()

    def _follow(
        self, task: Task, stopped: Callable[[], bool], note: Callable[[Record], None]
    ) -> Outcome | None:
        records: list[Record] = []
        found: dict[str, Any] = environment()
        deadline = time.monotonic() + _MOST_SECONDS_TO_START
        try:
            self._tasks.send(task)
            while True:
                while not self._answers.poll(_SECONDS_BETWEEN_LOOKS):
                    if stopped():
                        self.close()
                        return None
                    if time.monotonic() > deadline:
                        self.close()
                        return self._killed(task, records, found)
                kind, content, seen_in = self._answers.recv()
                found = seen_in or found
                if kind == "begin":
                    deadline = time.monotonic() + (
                        float("inf") if task.seconds is None else task.seconds + task.grace_seconds
                    )
                elif kind == "records":
                    for record in content:
                        if records and records[-1].evaluations == record.evaluations:
                            records.pop()
                        records.append(record)
                    if records:
                        note(records[-1])
                else:
                    return _complete(content, records, found)
        except (EOFError, OSError):  # the other end is no more
            return self._crashed(records, found)

    def _killed(self, task: Task, records: list[Record], found: dict[str, Any]) -> Outcome:
        last = records[-1] if records else None
        if task.seconds is None:
            outcome = failure(f"killed: it did not start within {_MOST_SECONDS_TO_START:g} s")
            return replace(outcome, environment=found)
        return Outcome(
            status="timeout",
            stopped_by="limit",
            evaluations=last.evaluations if last else 0,
            seconds=task.seconds,
            recording_seconds=0.0,
            records=tuple(_without_plans(records)),
            error=(
                f"killed: {task.grace_seconds:g} s after its {task.seconds:g} s were up it had "
                "still not come to the end of an iteration"
            ),
            environment=found,
        )

    def _crashed(self, records: list[Record], found: dict[str, Any]) -> Outcome:
        process, said = self._process, self._last_words()
        status = process.wait() if process is not None else 0
        self.close()
        how = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
        outcome = failure(
            f"its process died ({how})", said or None, records[-1] if records else None
        )
        return replace(outcome, environment=found)

    def _last_words(self) -> str:
        self._said.seek(0)
        lines = self._said.read().decode(errors="replace").splitlines()
        return "\n".join(lines[-_LINES_OF_LAST_WORDS:])

    def close(self) -> None:
        """End the process, whatever it does."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._tasks.close()
            self._answers.close()
            self._said.close()
            self._process = None


def _complete(outcome: Outcome, records: list[Record], found: dict[str, Any]) -> Outcome:
    """Put together what was sent piece by piece; a failed run has no result."""
    kept = () if outcome.status == "failed" else tuple(_without_plans(records))
    return replace(outcome, records=kept, environment=found)


def _without_plans(records: list[Record]) -> list[Record]:
    """Keep the plans of the last record only."""
    return [*(replace(record, plans=None) for record in records[:-1]), *records[-1:]]


class SandboxPool:
    """Sandboxes that are used again, for workers that are threads."""

    def __init__(self) -> None:
        self._idle: list[Sandbox] = []
        self._lock = threading.Lock()

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
                self._idle.append(sandbox)

    def close(self) -> None:
        """End all processes that are not at work."""
        with self._lock:
            while self._idle:
                self._idle.pop().close()
