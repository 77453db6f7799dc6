"""Ctrl-C and SIGTERM where nothing is lost by ending at once: a word, and no traceback.

It imports nothing that takes time, since it has to work before the libraries that do are loaded.
"""

import os
import signal
from contextlib import suppress
from typing import Any

INTERRUPTED = 130

_ANSWERED = (signal.SIGINT, signal.SIGTERM)
_DEFAULTS = (signal.default_int_handler, signal.SIG_DFL)


def end_on_interrupt() -> None:
    """Let Ctrl-C end the process, unless it has a handler already; imports would swallow it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


class _EndingOnInterrupt:
    """While libraries load, SIGTERM is answered as Ctrl-C is.

    Not for longer: within a kernel, Python would not call the handler for minutes.
    """

    def __init__(self) -> None:
        self._depth = 0  # a module that is loaded may load another one that uses it, too
        self._usual: dict[signal.Signals, Any] = {}

    def __enter__(self) -> None:
        self._depth += 1
        if self._depth > 1:
            return
        self._usual = {}
        with suppress(ValueError):  # only the main thread may handle signals
            for number in _ANSWERED:
                if signal.getsignal(number) in _DEFAULTS:
                    self._usual[number] = signal.signal(number, _end)

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if self._depth == 0:
            for number, usual in self._usual.items():
                signal.signal(number, usual)


ending_on_interrupt = _EndingOnInterrupt()
"""Lets Ctrl-C and SIGTERM end the process while libraries load."""


def _end(number: int, _: object) -> None:
    try:
        os.write(
            2, b"botohe: interrupted\n" if number == signal.SIGINT else b"botohe: terminated\n"
        )
    finally:
        if number != signal.SIGINT:  # the exit status tells which signal it was
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        os._exit(INTERRUPTED)
