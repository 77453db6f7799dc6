"""The picture of a case study: a mission, how it was solved, and what was found, on one page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from string import ascii_lowercase
from typing import get_args

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.base.types import FloatArray
from botohe_moo.decide import representatives
from botohe_moo.decide.fronts import check_row
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.algorithms import check_table
from botohe_moo.plots.draw.canvas import frame_of, open_axes
from botohe_moo.plots.draw.maps import add_reach_bar
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.plots.draw.style import theme
from botohe_moo.plots.draw.texts import title_above
from botohe_moo.plots.front import plot_front
from botohe_moo.plots.mission import plot_mission
from botohe_moo.plots.pheromone import PheromoneKind, plot_pheromone
from botohe_moo.plots.plan import DrawnPlan
from botohe_moo.plots.study.curves import plot_curves
from botohe_moo.trails import Plans, TrailPlan

# In inches:
_WIDTH = 15.0  # of the panels of a line together
_RIGHT = 1.0  # right of them, for the key
_TITLE = 0.35  # above all lines
_ABOVE = 0.75  # above each line
_BELOW = 0.65  # below each line
_KEYS = 0.55  # the same more, for the keys of kinds of robots
_CHART = 2.8  # least height of a line

_MOST = 4  # panels of a line
_KINDS: tuple[PheromoneKind, ...] = get_args(PheromoneKind)


def plot_case_study(
    mission: Mission,
    plans: Plans,
    *,
    chosen: Sequence[int] | None = None,
    trace: pd.DataFrame | None = None,
    pheromone: pd.DataFrame | None = None,
    title: str | None = None,
) -> Axes:
    """Draw a mission, the progress of its search, its front with chosen plans, and the pheromone.

    Parameters
    ----------
    mission, plans
        As for :func:`plot_choices`.
    chosen
        Rows of the plans to draw on maps, from 0. Default: the three representatives of
        :func:`botohe_moo.decide.representatives`.
    trace
        Rows of one mission in a study's trace, as for :func:`plot_curves`: how the area grows.
        Without it that is not drawn.
    pheromone
        The pheromone of every arc, as for :func:`plot_pheromone`, but of all kinds of robots.
        Without it none is drawn.
    title
        Name of the picture. Default: the mission's title.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the map of the mission; its figure holds all the others.

    Raises
    ------
    PlanError, TypeError
        As for :func:`plot_choices`; a TypeError also if ``trace`` or ``pheromone`` is not a
        DataFrame.
    ValueError
        If there is no plan, ``chosen`` names none or no row of it, or as for :func:`plot_curves`
        and :func:`plot_pheromone`.

    Notes
    -----
    It shows what the figures of Simon, Richley, Overbey and Perez-Lavin, "Bi-objective
    trail-planning for a robot team orienteering in a hazardous environment", 2025, show of the art
    museum.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.plots import plot_case_study, save_plot
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> save_plot(plot_case_study(solution.mission, solution.plans, chosen=[0, 2]), "case.png")
    """
    check_mission(mission)
    batch = mission.batch(plans)
    objectives = mission.evaluate(batch)
    rows = representatives(mission, batch, 3) if chosen is None else tuple(chosen)
    if not rows:
        raise ValueError("Expected chosen to name at least one plan, got none.")
    for row in rows:
        check_row("chosen", row, len(batch))
    draw_front = partial(plot_front, objectives, mission, highlight=rows)
    front = _Panel("the front", draw_front, right=0.3, is_map=False)
    found = [_plan_panel(mission, batch[row], f"plan {row}", row == rows[-1]) for row in rows]
    keys = _KEYS if len(mission.kinds) > 1 else 0.0
    lines = [[_Panel("the mission", partial(plot_mission, mission), right=1.4, keys=keys)]]
    if trace is None:
        lines[0].append(front)
    else:
        # Names of algorithms may stand right of the curves.
        curves = partial(plot_curves, trace)
        lines[0].append(_Panel("progress", curves, right=1.9, is_map=False))
        found = [front, *found]
    parts = np.array_split(np.arange(len(found)), -(-len(found) // _MOST))
    lines += [[found[i] for i in part] for part in parts]
    if pheromone is not None:
        tables = [pheromone]
        if len(mission.kinds) > 1:
            check_table("pheromone", pheromone, ("kind",))
            tables = [rows for _, rows in pheromone.groupby("kind", sort=False)]
        for table in tables:
            draws = [partial(plot_pheromone, mission, table, kind=kind) for kind in _KINDS]
            lines.append([_Panel("pheromone", draw, right=1.4) for draw in draws])
    with theme():
        axes = _draw_page(lines, node_positions(mission))
        fig = axes[0].figure.figure
        head = mission.title if title is None else title
        fig.text(0.1 / fig.get_figwidth(), 1.0, head, fontsize=15, fontweight="bold", va="top")
    return axes[0]


@dataclass(frozen=True)
class _Panel:
    """A part of the page."""

    name: str
    draw: Callable[..., object]  # takes a title and axes
    right: float = 0.1  # inches right of the axes
    keys: float = 0.0  # inches more below the line
    is_map: bool = True

    @property
    def left(self) -> float:
        """Inches left of the axes: for the name and the numbers of an axis, if there is one."""
        return 0.1 if self.is_map else 0.85


def _plan_panel(mission: Mission, plan: TrailPlan, name: str, has_key: bool) -> _Panel:
    shown = DrawnPlan(mission, plan)

    def draw(*, title: str, ax: Axes) -> None:
        open_axes(node_positions(mission), ax)
        notes = shown.draw_team(ax)
        title_above(ax, title, "; ".join([shown.objectives, *shown.staying, *notes]))
        if has_key:
            add_reach_bar(ax)

    return _Panel(name, draw)


def _draw_page(lines: Sequence[Sequence[_Panel]], xy: FloatArray) -> list[Axes]:
    """Open a page, and draw every line of panels on it, one below the other."""
    _, half = frame_of(xy)
    aspect = half[1] / half[0]
    highs = []  # of the axes of each line
    keys = [max(panel.keys for panel in line) for line in lines]
    for line in lines:
        inner = [_WIDTH / len(line) - panel.left - panel.right for panel in line if panel.is_map]
        highs.append(max([_CHART, *(aspect * width for width in inner)]))
    full = np.array(
        [_WIDTH + _RIGHT, _TITLE + sum(highs) + (_ABOVE + _BELOW) * len(lines) + sum(keys)]
    )
    fig, axes, letters = plt.figure(figsize=tuple(full)), [], iter(ascii_lowercase)
    top = full[1] - _TITLE
    for line, high, more in zip(lines, highs, keys, strict=True):
        wide = _WIDTH / len(line)
        for i, panel in enumerate(line):
            width = wide - panel.left - panel.right
            height = width * aspect if panel.is_map else high
            place = (i * wide + panel.left, top - _ABOVE - height, width, height)
            ax = fig.add_axes(tuple(np.divide(place, (*full, *full))))
            panel.draw(title=f"({next(letters)}) {panel.name}", ax=ax)
            axes.append(ax)
        top -= _ABOVE + high + _BELOW + more
    return axes
