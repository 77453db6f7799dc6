"""Stopping a study by a signal: Ctrl-C, SIGTERM or SIGHUP."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from botohe_moo._base.interrupts import hold_interrupt

# Sent by batch systems and ``docker stop``, and by a terminal that is closed.
_LIKE_CTRL_C = (signal.SIGTERM, signal.SIGHUP)


@dataclass
class Stop:
    """Whether a study is to stop, and which signal has asked for it."""

    pressed: threading.Event
    signal: int = signal.SIGINT

    def is_set(self) -> bool:
        """Tell whether the study is to stop."""
        return self.pressed.is_set()


@contextmanager
def hold_stop() -> Iterator[Stop]:
    """Let Ctrl-C, SIGTERM and SIGHUP ask for a stop; the second one breaks off at once.

    Signals that are ignored, as under ``nohup``, or have another handler, stay as they are; so do
    all outside the main thread, which alone may handle signals.
    """
    with hold_interrupt() as pressed:
        stop = Stop(pressed)

        def note(number: int, _: object) -> None:
            stop.signal = number
            pressed.set()
            signal.signal(number, signal.SIG_DFL)

        ours = []
        if threading.current_thread() is threading.main_thread():
            ours = [n for n in _LIKE_CTRL_C if signal.getsignal(n) is signal.SIG_DFL]
        for number in ours:
            signal.signal(number, note)
        try:
            yield stop
        finally:
            for number in ours:
                signal.signal(number, signal.SIG_DFL)
