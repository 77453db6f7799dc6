"""Whether kernels are being compiled: known to those who show progress, who need not load numba."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_told: list[Callable[[bool], object]] = []


@contextmanager
def when_compiling(tell: Callable[[bool], object]) -> Iterator[None]:
    """Call a function with True when a kernel begins to be compiled, and with False at its end."""
    _told.append(tell)
    try:
        yield
    finally:
        _told.remove(tell)


def say_compiling(compiling: bool) -> None:
    """Call all that want to know."""
    for tell in _told:
        tell(compiling)
