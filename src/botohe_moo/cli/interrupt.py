"""Ctrl-C while libraries load: the process ends at once with a message, without a traceback.

Imported before everything else, so it imports nothing that takes time.
"""

import os
import signal

__all__ = ["INTERRUPTED", "end_on_interrupt", "ending_on_interrupt"]

INTERRUPTED = 130


def end_on_interrupt() -> None:
    """Let Ctrl-C end the process instead of raising KeyboardInterrupt.

    Imports would print its traceback, and some libraries swallow it.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


class _EndingOnInterrupt:
    def __enter__(self) -> None:
        try:
            end_on_interrupt()
        except ValueError:
            return  # only the main thread may handle signals

    def __exit__(self, *_: object) -> None:
        if signal.getsignal(signal.SIGINT) is _end:
            signal.signal(signal.SIGINT, signal.default_int_handler)


ending_on_interrupt = _EndingOnInterrupt()
"""Lets Ctrl-C end the process within a ``with`` block."""


def _end(*_: object) -> None:
    try:
        os.write(2, b"botohe: interrupted\n")
    finally:
        os._exit(INTERRUPTED)
