"""The progress bar of a search."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from botohe_moo.solving import Progress

__all__ = ["progress_bar"]

_SECONDS_BETWEEN_UPDATES = 0.1


@contextmanager
def progress_bar(total: int) -> Iterator[Progress | None]:
    """Show evaluations, area and the time left on standard error, if that is a terminal.

    Yields the callable for ``solve``'s ``progress``; None if nothing is shown.
    """
    # rich would also show it if FORCE_COLOR is set, as it often is for logs.
    if sys.stderr is None or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        BarColumn(bar_width=16),
        TaskProgressColumn(),
        TextColumn("{task.completed:,.0f} evaluations  area {task.fields[area]:.4f} "),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Progress(*columns, console=Console(stderr=True), redirect_stdout=False) as bar:
        task = bar.add_task("", total=total, area=0.0)
        shown_at = -_SECONDS_BETWEEN_UPDATES

        def show(evaluations: int, area: Callable[[], float]) -> None:
            nonlocal shown_at
            now = time.perf_counter()
            if evaluations >= total or now - shown_at >= _SECONDS_BETWEEN_UPDATES:
                shown_at = now
                bar.update(task, completed=evaluations, area=area())

        yield show
