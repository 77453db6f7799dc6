"""Threads that take turns with what they share, and run kernels side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock


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
