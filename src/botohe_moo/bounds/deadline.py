"""The end of the time that a bound may take."""

from __future__ import annotations

from collections.abc import Callable

from botohe_moo.core.compile import own_time


class Deadline:
    """The end of so many seconds, in which compiling does not count.

    Attributes
    ----------
    work
        Seconds that a usual processor takes for what was done, as far as it was counted: what is
        done next depends on it, and so not on the speed of a machine.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._began = own_time()
        self._is_over = False
        self.work = 0.0

    @property
    def elapsed(self) -> float:
        """Seconds since the beginning."""
        return own_time() - self._began

    @property
    def left(self) -> float:
        """Seconds until the end, at least 0."""
        return max(0.0, self.seconds - self.elapsed)

    def run(self, steps: Callable[[int], int], n_most: int, seconds: float) -> bool:
        """Make up to ``n_most`` steps of ``seconds`` each; return whether they were enough.

        ``steps`` is called with how many there is time for. It returns how many it has made, as a
        negative number if more were needed. If then only time was short, the time is over.
        """
        n_left = int(min(n_most, self.left / seconds))
        n = steps(n_left)
        self.work += seconds * abs(n)
        if -n > n_left and n_left < n_most:
            self.end()
        return n >= 0

    def end(self) -> None:
        """Let the time be over."""
        self._is_over = True

    def is_over(self) -> bool:
        """Return whether the time is over."""
        return self._is_over or self.elapsed > self.seconds
