"""The picture of a case study: a mission, how it was solved, and what was found, on one page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from string import ascii_lowercase
from typing import get_args

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.decide import representatives
from botohe_moo.decide.fronts import check_row
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.canvas import frame_of, open_axes
from botohe_moo.plots.draw.places import node_positions
from botohe_moo.plots.draw.sheets import add_reach_bar
from botohe_moo.plots.draw.style import theme
from botohe_moo.plots.draw.titles import retitle, title_above
from botohe_moo.plots.front import plot_front
from botohe_moo.plots.mission import plot_mission
from botohe_moo.plots.pheromone import Kind, plot_pheromone
from botohe_moo.plots.plan import PlanOnMap
from botohe_moo.plots.study.curves import plot_curves
from botohe_moo.trails import Plans, TrailPlan

_WIDTH, _RIGHT = 15.0, 1.0  # inches: of the parts of a line, and right of them for the key
_TITLE, _ABOVE = 0.35, 0.75  # inches: over the page, over each part
_MOST = 4  # parts of a line
_CHART = 2.8  # inches: least height of axes that are not a map


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
        The pheromone of every arc, as for :func:`plot_pheromone`. Without it none is drawn.
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
    front = _chart("the front", partial(plot_front, objectives, mission, highlight=rows))
    found = [_plan_panel(mission, batch[row], f"plan {row}") for row in rows]
    found[-1] = replace(found[-1], has_key=True)
    if trace is None:
        lines = [[_mission_panel(mission), front]]
    else:
        # Names of algorithms stand right of the curves.
        progress = _chart("progress", partial(plot_curves, trace), right=1.9)
        lines, found = [[_mission_panel(mission), progress]], [front, *found]
    n_lines = -(-len(found) // _MOST)
    parts = np.array_split(np.arange(len(found)), n_lines)
    lines += [[found[i] for i in part] for part in parts]
    if pheromone is not None:
        lines.append([_pheromone_panel(mission, pheromone, kind) for kind in get_args(Kind)])
    with theme():
        axes = _draw(lines, _aspect(mission))
        fig = axes[0].figure.figure
        head = mission.title if title is None else title
        fig.text(
            0.1 / fig.get_figwidth(),
            1.0,
            head,
            fontsize=15,
            fontweight="bold",
            va="top",
        )
    return axes[0]


@dataclass(frozen=True)
class _Panel:
    """A part of the page, drawn on axes; the inches around them are for all that is not inside."""

    name: str
    draw: Callable[[Axes], object]
    is_map: bool
    left: float
    right: float
    below: float
    has_key: bool = False  # of the shades of nodes, right of it


def _mission_panel(mission: Mission) -> _Panel:
    return _Panel("the mission", lambda ax: plot_mission(mission, ax=ax), True, 0.1, 1.3, 0.6)


def _chart(name: str, plot: Callable[..., Axes], *, right: float = 0.3) -> _Panel:
    return _Panel(name, lambda ax: plot(ax=ax), False, 0.85, right, 0.65)


def _plan_panel(mission: Mission, plan: TrailPlan, name: str) -> _Panel:
    shown = PlanOnMap.of(mission, plan)

    def draw(ax: Axes) -> None:
        open_axes(shown.xy, ax)
        notes = shown.draw_team(ax)
        title_above(ax, name, "; ".join([shown.objectives, *shown.at_base, *notes]))

    return _Panel(name, draw, True, 0.1, 0.1, 0.1)


def _pheromone_panel(mission: Mission, pheromone: pd.DataFrame, kind: Kind) -> _Panel:
    def draw(ax: Axes) -> None:
        plot_pheromone(mission, pheromone, kind=kind, ax=ax)

    return _Panel("pheromone", draw, True, 0.1, 1.3, 0.1)


def _draw(lines: Sequence[Sequence[_Panel]], aspect: float) -> list[Axes]:
    """Open a page, and draw every line of panels on it, one below the other."""
    heights = [max(_height(panel, _WIDTH / len(line), aspect) for panel in line) for line in lines]
    total = _TITLE + sum(heights)
    fig = plt.figure(figsize=(_WIDTH + _RIGHT, total))
    axes: list[Axes] = []
    letters = iter(ascii_lowercase)
    top = total - _TITLE
    for line, height in zip(lines, heights, strict=True):
        wide = _WIDTH / len(line)
        for i, panel in enumerate(line):
            width = wide - panel.left - panel.right
            high = width * aspect if panel.is_map else height - _ABOVE - panel.below
            place = (i * wide + panel.left, top - _ABOVE - high, width, high)
            full = (_WIDTH + _RIGHT, total)
            ax = fig.add_axes(tuple(np.divide(place, (*full, *full))))
            panel.draw(ax)
            if panel.has_key:
                add_reach_bar(ax)
            retitle(ax, f"({next(letters)}) {panel.name}")
            axes.append(ax)
        top -= height
    return axes


def _height(panel: _Panel, wide: float, aspect: float) -> float:
    inner = (wide - panel.left - panel.right) * aspect if panel.is_map else _CHART
    return _ABOVE + inner + panel.below


def _aspect(mission: Mission) -> float:
    """Give the height of a map of the mission in parts of its width."""
    _, half = frame_of(node_positions(mission))
    return float(half[1] / half[0])
