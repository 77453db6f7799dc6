"""Showing the progress of a search, and of a study: a bar, or lines where there is no terminal."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Self

from botohe_moo._base.words import counted
from botohe_moo.cli.shell import harmless

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from botohe_moo.solving import Progress
    from botohe_moo.study.file.model import Run, StudyMission
    from botohe_moo.study.planning import Plan
    from botohe_moo.study.run.task import Outcome, Record

_SECONDS_BETWEEN_UPDATES = 0.1


def is_terminal() -> bool:
    """Tell whether standard error is a terminal."""
    # rich would also take FORCE_COLOR, which many set for logs, for a terminal.
    return sys.stderr is not None and sys.stderr.isatty()


def new_bar(width: int, words: str) -> Bar:
    """Make a bar on standard error, with words as rich formats them, and the time left."""
    from rich import progress
    from rich.console import Console

    return progress.Progress(
        progress.BarColumn(bar_width=width),
        progress.TaskProgressColumn(),
        progress.TextColumn(words),
        progress.TimeRemainingColumn(),
        progress.TextColumn("left"),
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


_SECONDS_BETWEEN_LINES = 60.0  # where there is no terminal to draw a bar on
_SECONDS_BETWEEN_TRIALS = 10.0  # that are shown there
_STEPS = 1_000  # of a run, so that the bar moves within one


@contextmanager
def showing_trials(say: Callable[[str], None]) -> Iterator[Callable[[str], None]]:
    """Show the words given to what it yields, in a line that changes, or in one now and then."""
    if is_terminal():
        from rich.console import Console
        from rich.text import Text

        with Console(stderr=True).status("reading") as status:
            yield lambda tried: status.update(Text(harmless(_trial(tried))))
        return
    said_at = -math.inf

    def show(tried: str) -> None:
        nonlocal said_at
        if time.monotonic() - said_at >= _SECONDS_BETWEEN_TRIALS:
            said_at = time.monotonic()
            say(_trial(tried))

    yield show


def _trial(tried: str) -> str:
    return f"{tried}; what is not compiled yet is compiled first, which may take minutes."


class ProgressWatcher:
    """Shows a study's progress on standard error: a bar, or lines where there is no terminal."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._lock = threading.Lock()
        self._shares: dict[str, float] = {}
        self._n_ended = self._n_runs = self._n_failed = 0
        self._n_bounded = self._n_bounds = 0
        self._bar: Bar | None = None
        self._said_at = time.monotonic()

    def __enter__(self) -> Self:
        if is_terminal():
            words = "{task.fields[words]} "
            self._bar = new_bar(24, words)
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            with suppress(OSError):  # the terminal has been closed
                self._bar.stop()

    def begin(self, plan: Plan) -> None:
        """Say how many runs are finished, and how many are to go."""
        for fault in plan.damaged.values():
            self._say(f"{fault}; the run is performed again.")
        for fault in plan.damaged_bounds.values():
            self._say(f"{fault}; the bound is computed again.")
        self._n_runs, self._n_bounds = len(plan.missing), len(plan.unbounded)
        there = len(plan.runs) - self._n_runs
        again = f", {len(plan.failed)} of them failed before" if plan.failed else ""
        self._say(f"{len(plan.runs)} runs: {there} are there, {self._n_runs} to go{again}.")
        if self._n_bounds:
            self._say(f"{counted(self._n_bounds, 'bound')} to compute when the runs are done.")
        if self._bar is not None:
            n_first = self._n_runs or self._n_bounds
            self._task = self._bar.add_task("", total=n_first * _STEPS, words=self._words())

    def record(self, run: Run, record: Record) -> None:
        """Note which part of its budget a run has spent."""
        budget = run.mission.budget
        both = ((record.evaluations, budget.evaluations), (record.seconds, budget.seconds))
        share = max(spent / allowed for spent, allowed in both if allowed)
        with self._lock:
            self._shares[run.digest] = min(share, 1.0)
            self._show()

    def end(self, run: Run, outcome: Outcome) -> None:
        """Note that a run has ended."""
        with self._lock:
            self._shares.pop(run.digest, None)
            self._n_ended += 1
            if outcome.status != "done":
                self._n_failed += outcome.status == "failed"
                self._say(
                    f"{run.algorithm.label} on {run.mission.label}, seed {run.seed}: "
                    f"{outcome.status}: {outcome.error}"
                )
            self._show()
            if self._bar is not None and self._is_bounding:
                # Bounds take another time than runs do.
                self._bar.reset(self._task, total=self._n_bounds * _STEPS, words=self._words())

    def end_bound(self, mission: StudyMission, error: str | None) -> None:
        """Note that a mission is bounded, or why not."""
        with self._lock:
            self._n_bounded += 1
            if error is not None:
                self._say(f"bound of {mission.label}: failed: {error}")
            self._show()

    def _show(self) -> None:
        if self._bar is not None:
            steps = (self._n_bounded or self._n_ended + sum(self._shares.values())) * _STEPS
            self._bar.update(self._task, completed=steps, words=self._words())
        elif time.monotonic() - self._said_at > _SECONDS_BETWEEN_LINES:
            self._said_at = time.monotonic()
            self._say(self._words())

    @property
    def _is_bounding(self) -> bool:
        return self._n_bounds > 0 and self._n_ended == self._n_runs

    def _words(self) -> str:
        failed = f", {self._n_failed} failed" if self._n_failed else ""
        bounds = f", {self._n_bounded} of {self._n_bounds} bounds" if self._n_bounds else ""
        return f"{self._n_ended} of {self._n_runs} runs{failed}{bounds}"
