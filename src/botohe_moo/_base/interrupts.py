"""A Ctrl-C that loses nothing: long steps end where what was found can be kept."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress


@contextmanager
def hold_interrupt(*, answer: str | None = None) -> Iterator[threading.Event]:
    """Let Ctrl-C set an event instead of breaking off; pressed again, it breaks off as usual.

    Nothing changes outside the main thread, which alone may handle signals, and where Ctrl-C is
    ignored, as for jobs in the background. ``answer`` is printed on standard error at once, however
    long the current step takes.
    """
    pressed = threading.Event()
    usual = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or usual is None or usual is signal.SIG_IGN:
        yield pressed
        return

    def note(*_: object) -> None:
        # Not the usual handler: if that ends the process at once, nothing is put in order.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        pressed.set()

    signal.signal(signal.SIGINT, note)
    try:
        with _answering(answer) if answer else nullcontext():
            yield pressed
    finally:
        signal.signal(signal.SIGINT, usual)


@contextmanager
def _answering(answer: str) -> Iterator[None]:
    """Answer the first Ctrl-C on standard error, in a thread of its own.

    Python calls handlers between two steps of the main thread, which may be inside of a kernel for
    minutes. Kernels hold no lock, though, and a signal is written to the wakeup descriptor at once.
    """

    def wait() -> None:
        while (came := os.read(reader, 1)) and came[0] != signal.SIGINT:
            pass
        if came:
            # Not by rich or sys.stderr, whose locks the main thread may hold; below the bar.
            line = f"{os.linesep if os.isatty(2) else ''}botohe: {answer}{os.linesep}"
            with suppress(OSError):
                os.write(2, line.encode())

    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    usual = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(usual)
        os.close(writer)  # which ends the thread
        thread.join()
        os.close(reader)
