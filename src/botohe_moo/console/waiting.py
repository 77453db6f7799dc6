"""What a long run owes to those who wait: a progress bar, and a Ctrl-C that loses nothing."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from contextlib import contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING, Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

__all__ = ["hold_interrupt", "progress_bar"]

_SECONDS_BETWEEN_UPDATES = 0.1


class _Show(Protocol):
    def __call__(self, evaluations: int, *, last: bool) -> None: ...


def _show_nothing(evaluations: int, *, last: bool) -> None: ...


@contextmanager
def hold_interrupt(*, answer: str | None = None) -> Iterator[threading.Event]:
    """Let Ctrl-C set an event instead of breaking off; pressed again, it breaks off as usual.

    Changes nothing outside the main thread, which alone may handle signals, and where Ctrl-C is to
    be ignored, as it is for jobs in the background.

    Parameters
    ----------
    answer
        What to say on standard error at once, however long the step takes that is going on.
    """
    pressed = threading.Event()
    usual = signal.getsignal(signal.SIGINT)
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or usual is None or usual is signal.SIG_IGN:
        yield pressed
        return

    say_once = _Answer(answer)

    def note(*_: object) -> None:
        # Not the usual handler: if that ends the process at once, nothing is put in order.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        pressed.set()
        say_once()  # before whoever looks at the event says something

    signal.signal(signal.SIGINT, note)
    try:
        with _calling(say_once) if answer else nullcontext():
            yield pressed
    finally:
        signal.signal(signal.SIGINT, usual)


class _Answer:
    """Says something on standard error, the first time it is called."""

    def __init__(self, answer: str | None) -> None:
        self._answer = answer
        self._lock = threading.Lock()

    def __call__(self) -> None:
        with self._lock:
            answer, self._answer = self._answer, None
            if answer is None:
                return
            # Not by rich or sys.stderr, whose locks the main thread may hold; below the bar.
            line = f"{os.linesep if os.isatty(2) else ''}botohe: {answer}{os.linesep}"
            with suppress(OSError):
                os.write(2, line.encode())


@contextmanager
def _calling(function: Callable[[], None]) -> Iterator[None]:
    """Call a function in a thread of its own as soon as Ctrl-C is pressed.

    Python calls handlers between two steps of the main thread, which may be inside of a kernel for
    minutes. Kernels hold no lock, though, and a signal is written to the wakeup descriptor at once.
    """

    def wait() -> None:
        while came := os.read(reader, 1):
            if came[0] == signal.SIGINT:
                function()

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


@contextmanager
def progress_bar(total: int, area: Callable[[], float], *, shown: bool) -> Iterator[_Show]:
    """Show evaluations, area and the time left on standard error, if that is a terminal.

    Parameters
    ----------
    total
        Evaluations that are planned.
    area
        Gives the area; asked only when it is about to be shown.
    shown
        Whether a bar is wanted at all.

    Yields
    ------
    callable
        Takes the number of evaluations so far, and whether they are the last.
    """
    # rich would also take FORCE_COLOR, which many set for logs, for a terminal.
    if not (shown and sys.stderr is not None and sys.stderr.isatty()):
        yield _show_nothing
        return
    columns = (
        BarColumn(bar_width=16),
        TaskProgressColumn(),
        TextColumn("{task.completed:,.0f} evaluations  area {task.fields[area]:.4f} "),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Progress(*columns, console=Console(stderr=True), redirect_stdout=False) as bar:
        task = bar.add_task("", total=total, area=0.0)
        shown_at = 0.0

        def show(evaluations: int, *, last: bool) -> None:
            nonlocal shown_at
            now = time.perf_counter()
            if last or now - shown_at >= _SECONDS_BETWEEN_UPDATES:
                shown_at = now
                bar.update(task, completed=evaluations, area=area())

        yield show
