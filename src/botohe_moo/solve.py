"""From a mission and an algorithm to a front, as tables and pictures: one call, one folder."""

from __future__ import annotations

import json
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pymoo.core.algorithm import Algorithm
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from botohe_moo._types import FloatArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import TrailPlan

__all__ = ["Solution", "prepare_folder", "search"]

_SECONDS_BETWEEN_UPDATES = 0.1


@dataclass(frozen=True, eq=False)
class Solution:
    """What a search found, and how.

    Attributes
    ----------
    mission
        What was planned for.
    plans
        The non-dominated plans, by descending expected reward.
    objectives
        Their E[R] and E[S] (n_plans, 2).
    algorithm, parameters, seed
        What searched: the algorithm's name, its parameters as given, and the seed.
    evaluations
        Trail plans that were evaluated.
    seconds
        How long the search took.
    interrupted
        Whether it was stopped before its budget was spent.
    """

    mission: Mission
    plans: tuple[TrailPlan, ...]
    objectives: FloatArray
    algorithm: str
    parameters: dict[str, Any]
    seed: int
    evaluations: int
    seconds: float
    interrupted: bool

    @property
    def area(self) -> float:
        """The front's area indicator, in [0, 1]."""
        return area_indicator(self.objectives, self.mission)

    @property
    def front(self) -> pd.DataFrame:
        """The front as a table: ``plan_id``, ``reward`` (E[R]) and ``survivors`` (E[S])."""
        return pd.DataFrame(
            {
                "plan_id": np.arange(len(self.plans)),
                "reward": self.objectives[:, 0],
                "survivors": self.objectives[:, 1],
            }
        )

    def describe(self) -> str:
        """Say in words and a table what was found."""
        pace = self.evaluations / self.seconds if self.seconds > 0 else float("inf")
        stopped = "stopped after" if self.interrupted else "spent"
        return (
            f"\n{self.front.to_string(index=False, float_format='{:.4f}'.format)}\n\n"
            f"{self.algorithm}, seed {self.seed}: {stopped} {self.evaluations} evaluations in "
            f"{self.seconds:.1f} s ({pace:,.0f} a second)\n"
            f"area {self.area:.4f}, {len(self.plans)} plans on the front"
        )

    def to_json(self) -> str:
        """Write everything but the pictures: how it was found, and each plan with its trails."""
        content = {
            "mission": self.mission.name,
            "robots": self.mission.robots,
            "total_reward": self.mission.total_reward,
            "algorithm": self.algorithm,
            "parameters": self.parameters,
            "seed": self.seed,
            "evaluations": self.evaluations,
            "interrupted": self.interrupted,
            "area": self.area,
            "version": version("botohe-moo"),
            "plans": [
                {
                    "plan_id": i,
                    "reward": float(reward),
                    "survivors": float(survivors),
                    "trails": self.mission.labels(plan),
                }
                for i, (plan, (reward, survivors)) in enumerate(
                    zip(self.plans, self.objectives, strict=True)
                )
            ],
        }
        return json.dumps(content, indent=1, default=repr) + "\n"

    def write(self, folder: Path) -> list[Path]:
        """Write ``front.csv``, ``plans.json``, ``front.png`` and ``mission.png``.

        All four are complete before the first of them takes its place.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        from botohe_moo.plots import plot_front, plot_mission, save_plot

        names = ("front.csv", "plans.json", "front.png", "mission.png")
        with tempfile.TemporaryDirectory(prefix=".botohe-", dir=folder) as made:
            draft = Path(made)
            self.front.to_csv(draft / names[0], index=False)
            (draft / names[1]).write_text(self.to_json(), encoding="utf-8")
            save_plot(plot_front(self.objectives, self.mission), draft / names[2])
            save_plot(plot_mission(self.mission), draft / names[3])
            for name in names:
                (draft / name).replace(folder / name)
        return [folder / name for name in names]


def prepare_folder(folder: Path) -> Path:
    """Make sure that ``folder`` can be written to, before a search is spent on it.

    Raises
    ------
    OSError
        If it cannot be made or written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".botohe-", dir=folder):
        return folder


def search(
    mission: Mission,
    algorithm: Algorithm,
    *,
    name: str,
    parameters: dict[str, Any] | None = None,
    evaluations: int = 100_000,
    seed: int = 1,
    progress: bool = True,
) -> Solution:
    """Run an algorithm on a mission until its budget is spent, or Ctrl-C is pressed.

    Parameters
    ----------
    mission
        What to plan for.
    algorithm
        A pymoo algorithm for :class:`BOTOHE`, not set up yet.
    name, parameters
        What to call it in the solution.
    evaluations
        Budget: trail plans to evaluate.
    seed
        Seed of all random numbers.
    progress
        Whether to show a progress bar, with the area and the time left, on standard error.

    Returns
    -------
    Solution
        What was found so far, even if the search was interrupted.
    """
    termination = ("n_eval", evaluations)
    algorithm.setup(BOTOHE(mission), termination=termination, seed=seed)
    started = time.perf_counter()
    with _watch_interrupt() as interrupt, _bar(evaluations, shown=progress) as show:
        while algorithm.has_next() and not interrupt.is_set():
            algorithm.next()
            show(algorithm)
    seconds = time.perf_counter() - started
    opt = algorithm.opt
    objectives = -opt.get("F") if opt is not None and len(opt) else np.empty((0, 2))
    plans = [individual.X[0] for individual in opt] if len(objectives) else []
    order = np.lexsort((objectives[:, 1], -objectives[:, 0]))
    return Solution(
        mission=mission,
        plans=tuple(plans[i] for i in order),
        objectives=objectives[order],
        algorithm=name,
        parameters=parameters or {},
        seed=seed,
        evaluations=algorithm.evaluator.n_eval,
        seconds=seconds,
        interrupted=algorithm.has_next(),
    )


@contextmanager
def _watch_interrupt() -> Iterator[threading.Event]:
    """Let the first Ctrl-C set an event, so that a step is never left half-done; the next kills."""
    pressed = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield pressed
        return
    usual = signal.getsignal(signal.SIGINT)

    def stop(*_: object) -> None:
        pressed.set()
        signal.signal(signal.SIGINT, usual)

    signal.signal(signal.SIGINT, stop)
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, usual)


@contextmanager
def _bar(evaluations: int, *, shown: bool) -> Iterator[Any]:
    """Show evaluations, area and the time left; the area is reckoned only when it is shown."""
    columns = (
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.completed:,.0f} evaluations  area {task.fields[area]:.4f}"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not (shown and console.is_terminal)) as bar:
        task = bar.add_task("", total=evaluations, area=0.0)
        shown_at = 0.0

        def show(algorithm: Algorithm) -> None:
            nonlocal shown_at
            now, finished = time.perf_counter(), not algorithm.has_next()
            if bar.disable or (now - shown_at < _SECONDS_BETWEEN_UPDATES and not finished):
                return
            shown_at = now
            opt = algorithm.opt
            mission = algorithm.problem.mission
            area = area_indicator(-opt.get("F"), mission) if opt is not None and len(opt) else 0.0
            bar.update(task, completed=algorithm.evaluator.n_eval, area=area)

        yield show
