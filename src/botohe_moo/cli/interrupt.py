"""Ctrl-C where nothing is lost by ending at once, as while libraries load: a word, no traceback.

It imports nothing that takes time, for it has to be there before what does.
"""

import os
import signal

__all__ = ["INTERRUPTED", "end_on_interrupt", "ending_on_interrupt"]

INTERRUPTED = 130


def end_on_interrupt() -> None:
    """Let Ctrl-C end the process, where it is what raises KeyboardInterrupt.

    An exception would not do: imports make tracebacks of it, and some libraries swallow it.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


class _EndingOnInterrupt:
    def __enter__(self) -> None:
        try:
            end_on_interrupt()
        except ValueError:
            return  # another thread imports; only the main one may handle signals

    def __exit__(self, *_: object) -> None:
        if signal.getsignal(signal.SIGINT) is _end:
            signal.signal(signal.SIGINT, signal.default_int_handler)


ending_on_interrupt = _EndingOnInterrupt()
"""Lets Ctrl-C end the process for a while."""


def _end(*_: object) -> None:
    try:
        os.write(2, b"botohe: interrupted\n")
    finally:
        os._exit(INTERRUPTED)
