"""The end of the time that a bound may take."""

from __future__ import annotations

from botohe_moo.core.compile import own_time

_MOVES_A_SECOND = 1e7  # of a search, on a usual processor


class Deadline:
    """The end of so many seconds, in which compiling does not count."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._began = own_time()
        self._is_over = False

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return own_time() - self._began

    @property
    def left(self) -> float:
        """Seconds until the end, at least 0."""
        return max(0.0, self.seconds - self.elapsed)

    def most_moves(self, n_most: int) -> int:
        """Return how many moves a search can make until the end, at most ``n_most``."""
        return int(min(n_most, _MOVES_A_SECOND * self.left))

    def end(self) -> None:
        """Let the time be over."""
        self._is_over = True

    def is_over(self) -> bool:
        """Return whether the time is over."""
        return self._is_over or self.elapsed > self.seconds
