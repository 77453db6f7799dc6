"""Signals that ask for a stop set a flag, instead of breaking off."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


class Stop(threading.Event):
    """Set when a stop is asked for; ``signal`` is the number of the signal that did."""

    signal = 0


@contextmanager
def hold_signals(*numbers: int, handled: bool = False) -> Iterator[Stop]:
    """Let signals set an event; one that comes a second time raises KeyboardInterrupt.

    A signal that is ignored, as under ``nohup`` or for jobs in the background, is left alone; so is
    one that has a handler of its own, unless ``handled``. Outside the main thread, which alone may
    handle signals, all are left alone.
    """
    stop = Stop()
    usual: dict[int, Any] = {}
    for number in numbers if threading.current_thread() is threading.main_thread() else ():
        handler = signal.getsignal(number)
        if handler in _DEFAULTS or (handled and callable(handler)):
            usual[number] = handler

    def note(number: int, _: object) -> None:
        # Not the usual handler, which may end the process at once, without any cleaning up.
        signal.signal(number, signal.default_int_handler)
        if not stop.signal:  # another signal may come while the event is being set
            stop.signal = number
            stop.set()

    for number in usual:
        signal.signal(number, note)
    try:
        yield stop
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
