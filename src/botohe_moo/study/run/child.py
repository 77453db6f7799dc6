"""The process of runs and of bounds: ``python -m botohe_moo.study.run.child``.

It reads tasks from its standard input and writes messages to its standard output, until the process
that started it ends.
"""

import contextlib
import math
import os
import random
import select
import signal
import threading
import time
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

import numpy as np

from botohe_moo.study.file.digest import code_mismatch
from botohe_moo.study.run.environment import environment
from botohe_moo.study.run.perform import perform, warm_up
from botohe_moo.study.run.task import BoundTask, Task, failure

if TYPE_CHECKING:
    from botohe_moo.search.bounds import FrontBound

_SECONDS_BETWEEN_MESSAGES = 0.2
_SIGNS_OF_LIFE = 10  # within the patience that a run may need
_MOST_SECONDS_BETWEEN_SIGNS = 10.0


def main() -> None:
    """Perform one task after another until the connection is closed."""
    # What an algorithm prints must not come between the messages.
    messages = Connection(os.dup(1), readable=False)
    os.dup2(2, 1)
    tasks = Connection(os.dup(0), writable=False)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)  # nor may it read the tasks
    threading.Thread(target=_end_with_parent, args=(tasks.fileno(),), daemon=True).start()

    warm: set[tuple[str, str]] = set()
    while True:
        try:
            task: Task | BoundTask = tasks.recv()
        except EOFError:
            return
        if isinstance(task, BoundTask):
            messages.send(("end", task.digest, _bound(task), environment()))
            continue
        origin = task.algorithm, task.parameters, task.origin
        if mismatch := code_mismatch({"version": task.version}, [origin]):
            messages.send(("end", task.digest, failure(f"the worker {mismatch}"), environment()))
            continue
        key = task.algorithm, repr(task.parameters)
        if key not in warm:
            warm.add(key)
            with contextlib.suppress(Exception):  # the run will raise and report it
                warm_up(task)
        reporter = _Reporter(messages, task)
        reporter.send("begin", time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()))
        # Algorithms have a generator of their own. Those that draw from the global ones should at
        # least draw the same numbers again.
        random.seed(task.seed)
        np.random.seed(task.seed % 2**32)  # noqa: NPY002
        outcome = perform(task, reporter.put, reporter.show_progress)
        reporter.send_records()
        reporter.send("end", outcome)


def _bound(task: BoundTask) -> "FrontBound | str":
    # Imported late: runs do not need it.
    from botohe_moo.study.run.bound import find_bound, warm_up_bounds

    with contextlib.suppress(Exception):  # the bound will raise and report it
        warm_up_bounds(floor=task.min_survival > 0, budget=task.max_length < math.inf)
    return find_bound(task)


class _Reporter:
    """Sends messages about a run: records in batches, since sending each would cost too much.

    A run that may be killed sends each record at once.
    """

    def __init__(self, messages: Connection, task: Task) -> None:
        self._messages = messages
        self._digest = task.digest
        self._process = os.getpid()
        self._pause = 0.0 if task.seconds is not None else _SECONDS_BETWEEN_MESSAGES
        self._waiting: list[object] = []
        self._sent_at = time.monotonic()
        self._shown_at = self._sent_at
        self._shown_every = min(task.patience / _SIGNS_OF_LIFE, _MOST_SECONDS_BETWEEN_SIGNS)

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
        if os.getpid() != self._process:  # a copy that an algorithm has forked
            os._exit(0)
        self._messages.send((kind, self._digest, content, environment()))


def _end_with_parent(descriptor: int) -> None:
    """Wait until the other end of standard input is closed, and end this process."""
    poll = select.poll()
    poll.register(descriptor, 0)  # a closed connection is always reported
    poll.poll()
    if os.getpgid(0) == os.getpid():  # and everything that algorithms have started
        os.killpg(0, signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    main()
