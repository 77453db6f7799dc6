"""Progress bars, and the one of a search."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.progress import Progress as Bar

    from botohe_moo.solving import Progress

_SECONDS_BETWEEN_UPDATES = 0.1


def is_terminal() -> bool:
    """Tell whether standard error is a terminal."""
    # rich would also take FORCE_COLOR, which many set for logs, for a terminal.
    return sys.stderr is not None and sys.stderr.isatty()


def new_bar(width: int, words: str) -> Bar:
    """Make a bar on standard error, with words as rich formats them, and the time left."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    return Progress(
        BarColumn(bar_width=width),
        TaskProgressColumn(),
        TextColumn(words),
        TimeRemainingColumn(),
        TextColumn("left"),
        console=Console(stderr=True),
        redirect_stdout=False,
    )


@contextmanager
def progress_bar(total: int) -> Iterator[Progress | None]:
    """Show evaluations, area and the time left on standard error, if that is a terminal.

    Yields what takes the number of evaluations so far, and a function that gives the area, called
    when it is about to be shown; None where nothing is shown. ``total`` evaluations are planned.
    """
    if not is_terminal():
        yield None
        return
    words = "{task.completed:,.0f} evaluations  area {task.fields[area]:.4f} "
    with new_bar(16, words) as bar:
        task = bar.add_task("", total=total, area=0.0)
        shown_at = -_SECONDS_BETWEEN_UPDATES

        def show(evaluations: int, area: Callable[[], float]) -> None:
            nonlocal shown_at
            now = time.perf_counter()
            if evaluations >= total or now - shown_at >= _SECONDS_BETWEEN_UPDATES:
                shown_at = now
                bar.update(task, completed=evaluations, area=area())

        yield show
