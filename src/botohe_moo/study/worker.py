"""The process of runs and of bounds: ``python -m botohe_moo.study.worker``.

Its standard input is a connection to the process that has started it, which explains the messages:
:mod:`botohe_moo.study.pool`.
"""

import contextlib
import functools
import math
import os
import random
import select
import signal
import threading
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numba.core import event

from botohe_moo.study.model import PATIENCE, Run, check_code
from botohe_moo.study.perform import Outcome, in_a_line, perform
from botohe_moo.study.pool import BoundTask


def main() -> None:
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


if __name__ == "__main__":
    main()
