"""What a search found: a front of plans, as a table, as JSON and as a folder of files."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["PictureError", "Solution", "check_folder", "check_picture", "place_fault"]

_FILES = ("front.csv", "plans.json", "front.png", "mission.png")
_OF_STUDIES = ("study.json", "study.yaml")
_ROWS_SHOWN = 40
_LONG_START = 0.5  # seconds; compiled kernels start within milliseconds


class PictureError(RuntimeError):
    """A picture that cannot be drawn; names it and the reason."""


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
    seconds, startup_seconds
        How long the search took, and what of it passed before its first step was done: on a new
        machine kernels are compiled then.
    interrupted
        Whether it was stopped before its budget was spent.
    source
        What :func:`load_mission` made the mission from, where that is known.
    min_survival
        The survival floor; 0 where there was none.
    """

    mission: Mission
    plans: tuple[TrailPlan, ...]
    objectives: FloatArray
    algorithm: str
    parameters: Mapping[str, Any]
    seed: int
    evaluations: int
    seconds: float
    interrupted: bool
    startup_seconds: float = 0.0
    source: Mapping[str, Any] = field(default_factory=dict)
    min_survival: float = 0.0

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
        table = self.front.to_string(
            index=False, float_format="{:.4f}".format, max_rows=_ROWS_SHOWN
        )
        start = self.startup_seconds if self.startup_seconds >= _LONG_START else 0.0
        seconds = self.seconds - start
        # A long start is not what an evaluation costs, nor is the rest all of the evaluations.
        known = seconds > 0 and not start
        pace = f" ({self.evaluations / seconds:,.0f} a second)" if known else ""
        started = f", after {start:.0f} s to compile and start" if start else ""
        stopped = "stopped after" if self.interrupted else "spent"
        n_plans = "1 plan" if len(self.plans) == 1 else f"{len(self.plans)} plans"
        return (
            f"{table if self.plans else 'no plans'}\n\n"
            f"{self.algorithm}, seed {self.seed}: {stopped} {self.evaluations:,} evaluations in "
            f"{seconds:.1f} s{pace}{started}\n"
            f"area {self.area:.4f}, {n_plans} on the front"
        )

    def to_json(self) -> str:
        """Write everything but the pictures: how it was found, and each plan with its trails.

        Trails are lists of node labels. What JSON cannot hold is written as Python shows it.
        """
        content = {
            "mission": self.mission.name,
            "mission_source": self.source,
            "robots": self.mission.robots,
            "total_reward": self.mission.total_reward,
            "algorithm": self.algorithm,
            "parameters": self.parameters,
            "seed": self.seed,
            "min_survival": self.min_survival,
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
        return json.dumps(content, indent=1, default=_plain) + "\n"

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``front.csv``, ``plans.json``, ``front.png`` and ``mission.png``.

        Each takes its place complete, or not at all. Should a picture fail, the tables are
        written all the same: they may have cost hours.

        Parameters
        ----------
        folder
            Where to; made if it does not exist.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        PictureError
            If a picture cannot be drawn.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".botohe-", dir=folder) as made:
            draft = Path(made)
            self._draft_tables(draft)
            try:
                self._draft_pictures(draft)
            finally:
                for name in _FILES:
                    if (draft / name).exists():
                        (draft / name).replace(folder / name)
                    else:  # an earlier search's picture, which does not go with these tables
                        (folder / name).unlink(missing_ok=True)
        return [folder / name for name in _FILES]

    def _draft_tables(self, folder: Path) -> None:
        self.front.to_csv(folder / _FILES[0], index=False)
        (folder / _FILES[1]).write_text(self.to_json(), encoding="utf-8")

    def _draft_pictures(self, folder: Path) -> None:
        from botohe_moo.plots import plot_front, plot_mission

        _draw(folder / _FILES[2], plot_front, self.objectives, self.mission)
        _draw(folder / _FILES[3], plot_mission, self.mission)


def _draw(path: Path, plot: Callable[..., Axes], *shown: Any) -> None:
    from botohe_moo.plots import save_plot

    try:
        save_plot(plot(*shown), path)
    except OSError:
        raise
    except Exception as error:  # fonts may fail on what a mission's texts hold
        reason = f"{type(error).__name__}: {str(error).strip()}".partition("\n")[0]
        raise PictureError(f"{path.name} cannot be drawn ({reason}).") from error


def check_folder(folder: Path) -> None:
    """Make sure, before a search is spent on it, that files can be written to a folder.

    Parameters
    ----------
    folder
        Need not exist; nothing is left of the trial.

    Raises
    ------
    OSError
        If it cannot be made or written to, or holds a study: names it.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".botohe-", dir=folder):
            pass
        for name in _FILES:
            if (folder / name).is_dir():
                raise IsADirectoryError(f"{name} is a folder in it")
        for name in _OF_STUDIES:
            if (folder / name).exists():
                raise FileExistsError(f"it holds a study, as {name} says")
    except OSError as error:
        reason = "it is a file" if folder.is_file() else error.strerror or error
        raise OSError(f"{folder}: expected a folder to write to; {reason}.") from None
    finally:
        for path in missing:
            with contextlib.suppress(OSError):
                path.rmdir()


def check_picture(mission: Mission) -> None:
    """Make sure, before a search is spent on it, that a mission can be drawn.

    Raises
    ------
    ValueError
        If a node's ``pos`` is no place: names it.
    """
    if fault := place_fault(mission):
        raise ValueError(f"Mission {mission.name!r}: {fault}")


def place_fault(mission: Mission) -> str | None:
    """Say which node's ``pos`` is no place; None where places are right, or have to be found."""
    from botohe_moo.plots.draw.places import node_positions

    if any(place is None for _, place in mission.graph.nodes(data="pos")):
        return None  # they will be laid out, which takes its time
    try:
        node_positions(mission)
    except ValueError as error:
        return str(error)
    return None


def _plain(value: object) -> object:
    """Give what JSON can hold instead of ``value``."""
    return value.item() if isinstance(value, np.generic) else repr(value)
