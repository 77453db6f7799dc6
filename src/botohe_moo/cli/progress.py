"""Progress on standard error: a bar that moves, or lines where there is no terminal."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import timedelta
from typing import TYPE_CHECKING, Any

from numba.core import event

from botohe_moo.base.messages import counted
from botohe_moo.cli.common import harmless, say

if TYPE_CHECKING:
    from botohe_moo.solving import Progress
    from botohe_moo.study.runner import Plan

_SECONDS_BETWEEN_LINES = 6.0
_SECONDS_BETWEEN_UPDATES = 0.5  # computing the area takes a while on large fronts

Show = Callable[..., None]
"""Takes words, and optionally how much is done and of how much."""


@contextmanager
def showing(words: str, *, every: float = _SECONDS_BETWEEN_LINES) -> Iterator[Show]:
    """Show words, beside a bar or in lines, until the function that is yielded shows others.

    A bar without a total moves to and fro. Where standard error is not a terminal, the words are
    printed every few seconds. It is also shown when kernels are being compiled.
    """
    latest = words
    # rich would call it a terminal if FORCE_COLOR is set, as it often is for logs.
    is_terminal = sys.stderr is not None and sys.stderr.isatty()
    with _bar() if is_terminal else _lines(every) as put:

        def show(words: str, done: float = 0.0, total: float | None = None) -> None:
            nonlocal latest
            latest = words
            put(words, done, total)

        show(words)
        listener = _CompilingListener(lambda begins: put("compiling" if begins else latest))
        with event.install_listener("numba:compile", listener):
            yield show


class _CompilingListener(event.Listener):
    """Calls a function when numba begins to compile a kernel, and when the kernel is compiled.

    Functions that the kernel calls are compiled in between, which is not reported.
    """

    def __init__(self, note: Callable[[bool], None]) -> None:
        self._note = note
        self._depth = 0
        self._is_first = True

    def on_start(self, event: Any) -> None:  # noqa: ARG002
        if self._is_first:
            say("compiling for this machine, once.")
            self._is_first = False
        self._depth += 1
        if self._depth == 1:
            self._note(True)

    def on_end(self, event: Any) -> None:  # noqa: ARG002
        self._depth -= 1
        if self._depth == 0:
            self._note(False)


@contextmanager
def _bar() -> Iterator[Show]:
    from rich import progress
    from rich.console import Console

    bar = progress.Progress(
        progress.BarColumn(bar_width=16),
        progress.TaskProgressColumn(),
        progress.TextColumn("{task.fields[words]} ", markup=False),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
        progress.TextColumn("left"),
        console=Console(stderr=True),
        redirect_stdout=False,
    )
    task = bar.add_task("", total=None, words="")
    bar.start()

    def put(words: str, done: float = 0.0, total: float | None = None) -> None:
        given = None if total is None else done  # without a total, both stay as they are
        bar.update(task, words=harmless(words), completed=given, total=total)

    try:
        yield put
    finally:
        with suppress(OSError):  # the terminal has been closed
            bar.stop()


@contextmanager
def _lines(every: float) -> Iterator[Show]:
    latest, over, started = "", threading.Event(), time.monotonic()

    def put(words: str, *_: object) -> None:
        nonlocal latest
        latest = words

    def speak() -> None:
        while not over.wait(every):
            say(f"{latest}, {timedelta(seconds=int(time.monotonic() - started))}")

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    try:
        yield put
    finally:
        over.set()
        thread.join()


@contextmanager
def showing_search(total: int) -> Iterator[Progress]:
    """Show how many evaluations are done, and the area of the front."""
    with showing("starting") as show:
        shown_at = -math.inf

        def progress(evaluations: int, area: Callable[[], float]) -> None:
            nonlocal shown_at
            elapsed = time.perf_counter() - shown_at
            if elapsed >= _SECONDS_BETWEEN_UPDATES or evaluations >= total:
                shown_at = time.perf_counter()
                show(f"{evaluations:,} evaluations  area {area():.4f}", evaluations, total)

        yield progress


class StudyProgress:
    """Counts the runs and bounds of a study that end, and shows their number."""

    def __init__(self, show: Show) -> None:
        self._show_words = show
        self._shares: dict[str, float] = {}  # of their budgets, that runs at work have spent
        self._n: Counter[str] = Counter()

    def __call__(self, about: Any, news: Any) -> None:
        """Note a study's plan, a front or the outcome of a run, or the bound of a mission."""
        from botohe_moo.study.perform import Outcome, Record
        from botohe_moo.study.runner import Plan

        if isinstance(news, Plan):
            self._begin(news)
        elif isinstance(news, Record):
            budget = about.mission.budget
            both = ((news.evaluations, budget.evaluations), (news.seconds, budget.seconds))
            share = max(spent / allowed for spent, allowed in both if allowed)
            self._shares[about.digest] = min(share, 1.0)
        elif isinstance(news, Outcome):
            self._shares.pop(about.digest, None)
            self._n.update(ended=1, failed=news.status == "failed")
            if news.status != "done":
                which = f"{about.algorithm.label} on {about.mission.label}, seed {about.seed}"
                say(f"{which}: {news.status}: {news.error}")
        else:
            self._n.update(bounded=1)
            if isinstance(news, str):
                say(f"bound of {about.label}: failed: {news}")
        self._show()

    def _begin(self, plan: Plan) -> None:
        """Print how many runs are finished, and how many are left."""
        self._n.update(runs=len(plan.missing), bounds=len(plan.unbounded))
        there = len(plan.runs) - self._n["runs"]
        say(f"{len(plan.runs)} runs: {there} are there, {self._n['runs']} to go.")
        if n_bounds := self._n["bounds"]:
            say(f"{counted(n_bounds, 'bound')} to compute when the runs are done.")

    def _show(self) -> None:
        n = self._n
        failed = f", {n['failed']} failed" if n["failed"] else ""
        bounds = f", {n['bounded']} of {n['bounds']} bounds" if n["bounds"] else ""
        done, total = n["ended"] + sum(self._shares.values()), n["runs"]
        # Bounds get a bar of their own, from which the time they take is estimated.
        if n["bounds"] and n["ended"] == n["runs"]:
            done, total = n["bounded"], n["bounds"]
        self._show_words(f"{n['ended']} of {n['runs']} runs{failed}{bounds}", done, total)
