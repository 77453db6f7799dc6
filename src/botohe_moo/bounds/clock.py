"""Time as work that is counted, so that the real time does not decide what is proved next."""

from __future__ import annotations

import math

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
