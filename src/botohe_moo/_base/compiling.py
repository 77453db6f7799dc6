"""Whether kernels are being compiled, for displays of progress, which need not load numba."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[bool], object]] = []


@contextmanager
def when_compiling(tell: Callable[[bool], object]) -> Iterator[None]:
    """Call a function with True when a kernel begins to be compiled, and with False at its end."""
    _listeners.append(tell)
    try:
        yield
    finally:
        _listeners.remove(tell)


def say_compiling(compiling: bool) -> None:
    """Call all functions that are to be called."""
    for tell in _listeners:
        tell(compiling)
