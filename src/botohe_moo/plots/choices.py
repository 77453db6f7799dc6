"""The picture of a choice: the front with its marks, and maps of the plans that are marked."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

from botohe_moo.decide import Mark, knees, representatives
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.sheets import (
    add_reach_bar_right,
    name_map,
    open_sheet,
)
from botohe_moo.plots.draw.style import INK, theme
from botohe_moo.plots.draw.titles import title_above
from botohe_moo.plots.front import front_summary, plot_front, staircase
from botohe_moo.plots.plan import PlanOnMap
from botohe_moo.trails import Plans

# The marker of each mark, and a letter that looks like it.
_SIGNS = {"farthest from the chord": ("D", "◆"), "largest product": ("*", "☆")}


def plot_choices(
    mission: Mission, plans: Plans, *, k: int = 5, title: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a front with its knee and ``k`` representatives, and a map of each of them.

    Plans have the numbers of their rows in ``plans``, from 0. A diamond marks the plan that is
    farthest from the chord of the front, a star that of the largest E[R] times E[S]: marks, not
    verdicts. On the maps nodes are the darker the more likely any robot reaches them.

    Parameters
    ----------
    mission, plans
        As for :func:`botohe_moo.decide.choose`.
    k
        How many representatives, as for :func:`botohe_moo.decide.representatives`.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes for the front, which is then drawn without maps. By default a figure with both will
        be created.

    Returns
    -------
    matplotlib.axes.Axes
        The axes of the front.

    Raises
    ------
    PlanError
        If the mission does not allow one of the plans.
    TypeError
        If ``mission`` is not a Mission, or something in ``plans`` not a TrailPlan.
    ValueError
        If there is no plan, or ``k`` is not an integer of at least 1.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.plots import plot_choices, save_plot
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> save_plot(plot_choices(solution.mission, solution.plans, k=2), "choices.png")
    """
    check_mission(mission)
    batch = mission.batch(plans)
    objectives = mission.evaluate(batch)
    marks = knees(mission, objectives)
    chosen = representatives(mission, batch, k)
    rows = sorted({*chosen, *(mark.index for mark in marks)}, key=lambda row: -objectives[row, 0])
    notes = [front_summary(objectives, staircase(objectives), mission)]
    if len(batch) > 1:
        notes.append(f"numbered: the knee, and {len(chosen)} representatives")
    with theme():
        others: list[Axes] = []
        if ax is None:
            ax, *others = open_sheet(mission, len(rows), 2)
            add_reach_bar_right(others)
            # Inches for the names and numbers of its axes.
            inner = np.array([0.75, 0.6]) * ax.figure.figure.dpi / ax.figure.bbox.size
            place = ax.get_position()
            ax.set_position(Bbox(np.array([place.min + inner, place.max])))
        plot_front(objectives, mission, highlight=rows, ax=ax)
        for mark in marks:
            _draw_mark(ax, mark)
        ax.legend(loc="best", framealpha=0.9, handletextpad=0.2)
        for row, own in zip(rows, others, strict=False):  # none beside given axes
            shown = PlanOnMap(mission, batch[row])
            notes += shown.draw_team(own)
            signs = "".join(_SIGNS[mark.name][1] for mark in marks if mark.index == row)
            parts = [f"plan {row} {signs}".strip() + f": {shown.objectives}", *shown.at_base]
            name_map(own, "; ".join(parts))
        title_above(ax, mission.title if title is None else title, "; ".join(dict.fromkeys(notes)))
    return ax


def _draw_mark(ax: Axes, mark: Mark) -> None:
    """Draw the sign of a mark at its plan, and tell it in the legend."""
    dark = _SIGNS[mark.name][0] == "D"
    # The white star is seen on the diamond, too.
    fill: dict[str, Any] = {"markersize": 7.0 if dark else 7.5, "linestyle": "none"}
    fill |= {"markerfacecolor": INK if dark else "white", "markeredgecolor": INK}
    fill |= {"markeredgewidth": 0.8, "marker": _SIGNS[mark.name][0], "clip_on": False}
    label = f"{mark.name}: plan {mark.index}"
    ax.plot([mark.reward], [mark.survivors], label=label, zorder=5, **fill)
