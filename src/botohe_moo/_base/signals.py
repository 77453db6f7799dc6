"""Signals that ask for a stop: the current step is ended first."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


class Stop(threading.Event):
    """Set when a stop is asked for; ``signal`` is the number of the last signal that did."""

    signal = 0


@contextmanager
def hold_signals(*numbers: int) -> Iterator[Stop]:
    """Let signals set an event instead of breaking off; one that comes again breaks off as usual.

    A signal that is ignored, as under ``nohup`` or for jobs in the background, or that has another
    handler, is left alone. So are all signals outside the main thread, which alone may handle them.
    """
    stop = Stop()
    usual: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        usual = {number: signal.getsignal(number) for number in numbers}
        usual = {number: handler for number, handler in usual.items() if handler in _DEFAULTS}

    def note(number: int, _: object) -> None:
        # Not the usual handler, which may end the process at once, without any cleaning up.
        signal.signal(number, signal.default_int_handler)
        stop.signal = number
        stop.set()

    for number in usual:
        signal.signal(number, note)
    try:
        yield stop
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
