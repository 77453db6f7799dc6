"""Work that is counted, and threads that take turns with what they share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock

from botohe_moo.core.compile import own_time


class Clock:
    """Counts work, in seconds that a usual processor takes for it.

    What is done next depends on counted work alone: one seed leads to the same bounds, however fast
    a machine is. The real time only ends it, after ``seconds``.
    """

    def __init__(self, seconds: float, n_threads: int = 1) -> None:
        self.seconds, self._n_threads = seconds, n_threads
        self._began = own_time()
        self._is_ended = False
        self.now = 0.0  # work that is done, of all threads as if they worked side by side

    def count(self, seconds: float) -> None:
        """Count the work of one thread."""
        self.now += seconds / self._n_threads

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning, without those of compiling."""
        return own_time() - self._began

    @property
    def left(self) -> float:
        """Seconds until the end, at least 0."""
        return max(0.0, self.seconds - self.elapsed)

    def most(self, n: int, seconds: float) -> int:
        """Return how often work of so many seconds can be done until the end, at most ``n`` times.

        The pace is that of the work so far.
        """
        pace = (1.0 + self.now) / (1.0 + self.elapsed)  # which is 1 at the beginning
        return int(min(n, pace * self.left / seconds))

    def end(self) -> None:
        """Let the time be over: what there was no time for would have to come next."""
        self._is_ended = True

    def is_over(self, until: float = math.inf) -> bool:
        """Return whether so much work is done, or the time is over."""
        return self.now > until or self._is_ended or self.elapsed > self.seconds


class _Stopped(BaseException):
    """Another thread has failed, or was interrupted."""


class Turns:
    """Lets ``n_threads`` work, one at a time; only :meth:`aside` they are side by side."""

    def __init__(self, n_threads: int) -> None:
        self.n_threads = n_threads
        self._lock = Lock()
        self._is_stopped = False

    def repeat(self, work: Callable[[], bool]) -> None:
        """Call a function from all threads, from each until it returns False.

        An error of one thread, or Ctrl-C, ends the others at the end of their kernels.
        """
        if self.n_threads == 1:
            while work():
                pass
            return
        with ThreadPoolExecutor(self.n_threads) as pool:
            try:
                calls = [pool.submit(self._repeat, work) for _ in range(self.n_threads)]
                for call in calls:
                    call.result()
            except BaseException:
                self._is_stopped = True
                raise

    def _repeat(self, work: Callable[[], bool]) -> None:
        with self._lock:
            try:
                while not self._is_stopped and work():
                    pass
            except _Stopped:
                pass
            except BaseException:
                self._is_stopped = True
                raise

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Let others have their turns: for kernels, which use nothing that changes."""
        if not self._lock.locked():  # there is one thread
            yield
            return
        self._lock.release()
        try:
            yield
        finally:
            self._lock.acquire()
        if self._is_stopped:
            raise _Stopped
