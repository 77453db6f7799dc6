"""Stopping a study: Ctrl-C, and what systems send to processes that shall end."""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from botohe_moo._base.interrupts import hold_interrupt

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["Stop", "hold_stop"]

# Batch systems and ``docker stop`` send the one, a terminal that is closed the other.
_LIKE_CTRL_C = (signal.SIGTERM, signal.SIGHUP)


@dataclass
class Stop:
    """Whether a study is to stop, and by which signal.

    Attributes
    ----------
    pressed
        Is set when it is to stop.
    signal
        Number of the signal that has set it.
    """

    pressed: threading.Event
    signal: int = signal.SIGINT

    def is_set(self) -> bool:
        """Tell whether the study is to stop."""
        return self.pressed.is_set()


@contextmanager
def hold_stop() -> Iterator[Stop]:
    """Let Ctrl-C, SIGTERM and SIGHUP ask for a stop; the second one breaks off at once.

    Signals that are ignored, as by ``nohup``, or that somebody else handles, stay as they are;
    outside the main thread, which alone may handle signals, all do.
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
