"""The process in which runs are performed: ``python -m botohe_moo.study.run.child``.

It reads tasks from its standard input and writes what happens to its standard output, as long as
the process at the other end lives.
"""

from __future__ import annotations

import contextlib
import os
import random
import select
import signal
import threading
import time
from multiprocessing.connection import Connection

import numpy as np

from botohe_moo.study.file.code_here import other_code
from botohe_moo.study.run.environment import environment
from botohe_moo.study.run.perform import perform, warm_up
from botohe_moo.study.run.task import Task, failure

__all__ = ["main"]

_SECONDS_BETWEEN_MAILS = 0.2
_SIGNS = 10  # of life within the patience that a run may need
_MOST_SECONDS_BETWEEN_SIGNS = 10.0


def main() -> None:
    """Perform one task after another until nobody sends any."""
    # What an algorithm prints must not come between what is sent.
    answers = Connection(os.dup(1), readable=False)
    os.dup2(2, 1)
    tasks = Connection(os.dup(0), writable=False)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)  # nor may it read what is not for it
    threading.Thread(target=_end_with_parent, args=(tasks.fileno(),), daemon=True).start()

    warm: set[tuple[str, str]] = set()
    while True:
        try:
            task: Task = tasks.recv()
        except EOFError:
            return
        if other := other_code({"version": task.version}, {task.algorithm: task.origin}):
            answers.send(("end", task.digest, failure(f"the worker {other}"), environment()))
            continue
        key = task.algorithm, repr(task.parameters)
        if key not in warm:
            warm.add(key)
            with contextlib.suppress(Exception):  # which the run will raise again, and report
                warm_up(task)
        mail = _Mail(answers, task)
        mail.send("begin", time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()))
        # Algorithms are given a generator of their own; those that draw from everybody's all the
        # same shall at least draw the same again.
        random.seed(task.seed)
        np.random.seed(task.seed % 2**32)  # noqa: NPY002
        outcome = perform(task, mail.put, mail.show_progress)
        mail.send_records()
        mail.send("end", outcome)


class _Mail:
    """Tells of a run; records together, for one at a time would take longer than what they record.

    A run that may be killed sends each at once, for it may never come to send the next.
    """

    def __init__(self, answers: Connection, task: Task) -> None:
        self._answers = answers
        self._digest = task.digest
        self._process = os.getpid()
        self._pause = 0.0 if task.seconds is not None else _SECONDS_BETWEEN_MAILS
        self._waiting: list[object] = []
        self._sent_at = time.monotonic()
        self._shown_at = self._sent_at
        self._shown_every = min(task.patience / _SIGNS, _MOST_SECONDS_BETWEEN_SIGNS)

    def put(self, record: object) -> None:
        self._waiting.append(record)
        if time.monotonic() - self._sent_at >= self._pause:
            self.send_records()

    def show_progress(self) -> None:
        """Give a sign of life now and then."""
        now = time.monotonic()
        if now - self._shown_at >= self._shown_every:
            self._shown_at = now
            self.send("progress", None)

    def send_records(self) -> None:
        self.send("records", self._waiting)
        self._waiting = []
        self._sent_at = time.monotonic()

    def send(self, kind: str, content: object) -> None:
        if os.getpid() != self._process:  # a copy that an algorithm has made
            os._exit(0)
        self._answers.send((kind, self._digest, content, environment()))


def _end_with_parent(descriptor: int) -> None:
    """Wait until the other end of standard input is closed, and end this process."""
    poll = select.poll()
    poll.register(descriptor, 0)  # hanging up is reported unasked
    poll.poll()
    if os.getpgid(0) == os.getpid():  # with all that algorithms have started
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    main()
