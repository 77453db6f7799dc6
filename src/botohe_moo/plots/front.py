"""The picture of a front: what plans are expected to bring, and the area they dominate."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import moocore
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from botohe_moo.base.messages import counted, quoted
from botohe_moo.base.types import FloatArray
from botohe_moo.decide.fronts import check_objectives, check_row, front_rows
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission, check_mission, numbers_digest
from botohe_moo.plots.draw.style import INK, MARKERS, MUTED, colours, new_axes, theme, tint
from botohe_moo.plots.draw.texts import Space, title_above

if TYPE_CHECKING:
    from botohe_moo.bounds import FrontBound

OBJECTIVES = ("expected team reward E[R]", "expected number of survivors E[S]")
_STAIRS = "_stairs"  # label by which the fronts on axes are counted
_CROWD = 150  # points; the rims of more would cover other points
_RING = 5.5  # points: radius of the rings around highlighted plans


def plot_front(
    objectives: ArrayLike,
    mission: Mission | None = None,
    *,
    highlight: int | Sequence[int] | Mapping[int, str] | None = None,
    label: str | None = None,
    bound: FrontBound | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw plans in objective space and shade the area that they dominate.

    Call it again with the same ``ax`` and another ``label`` to lay fronts over each other.

    Parameters
    ----------
    objectives
        Shape (n_plans, 2): expected team reward E[R] and expected number of survivors E[S], both
        to be maximised, in any order. Dominated plans are drawn paler and bound no area.
    mission
        Mission of the plans. With it the axes reach to the total reward and to the number of
        robots, and the area is the normalised one, in [0, 1]; without it, it is E[R] times E[S].
        By default that of ``bound``, if one is given.
    highlight
        Rows of ``objectives``, counted from 0, to ring and to number: ``plan 7``. A mapping gives
        them names, too: ``{7: "knee"}`` is ``plan 7: knee``.
    label
        Name of the front. Area and number of plans are then in the legend instead of the title.
    bound
        What no plan exceeds, of :func:`bound_front`. The area between the front and it is shaded,
        too, and the legend says how large it is.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on. One will be created if not given.

    Raises
    ------
    TypeError
        If ``mission`` is not a Mission, or ``bound`` not a FrontBound.
    ValueError
        If ``objectives`` has another shape or is not finite, ``highlight`` names no row of it, or
        ``bound`` is of another mission, or a plan lies above it.

    Examples
    --------
    >>> from botohe_moo import plot_front, solve
    >>> from botohe_moo.plots import save_plot
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> ax = plot_front(solution.objectives, solution.mission, highlight={1: "bold"})
    >>> save_plot(ax, "front.png", "front.pdf")
    """
    points = np.asarray(objectives, dtype=float)
    points = check_objectives(points.reshape(-1, 2) if points.shape == (0,) else points)
    chosen = _rows(highlight, len(points))
    if bound is not None:
        mission = _mission_of(bound, mission)
        bound.check("objectives", points)
    corners = staircase(points)
    summary = front_summary(points, mission)
    with theme():
        if ax is None:
            ax = new_axes(7.2, 5.2)
        drawn = sum(line.get_label() == _STAIRS for line in ax.lines)
        _draw_front(ax, points, corners, drawn, f"{label}: {summary}" if label else None)
        if bound is not None:
            _shade_gap(ax, corners, bound, bound.gap(points), label)
        if label or bound is not None:
            ax.legend(loc="upper right", framealpha=0.9)
        _set_axes(ax, mission)
        if title is None:
            title = ax.get_title(loc="left") if mission is None else mission.title
        title_above(ax, title, "" if label else summary)
        _ring_plans(ax, points, chosen)
    return ax


def staircase(objectives: FloatArray) -> FloatArray:
    """Return the corners of the area that plans (n_plans, 2) dominate, both columns maximised.

    Shape (2 n + 2, 2) for n distinct non-dominated plans, from the highest on the vertical axis
    down to the farthest on the horizontal one and back to the origin; (0, 2) for none.

    >>> staircase(np.array([[1.0, 2.0], [3.0, 1.0], [1.0, 1.0]])).tolist()
    [[0.0, 2.0], [1.0, 2.0], [1.0, 1.0], [3.0, 1.0], [3.0, 0.0], [0.0, 0.0]]
    """
    front = objectives[front_rows(objectives)[::-1]]
    if not len(front):
        return np.empty((0, 2))
    reward, survivors = front.T
    right = np.concatenate([[0.0], np.repeat(reward, 2), [0.0]])
    up = np.concatenate([np.repeat(survivors, 2), [0.0, 0.0]])
    return np.column_stack([right, up])


def _mission_of(bound: FrontBound, mission: Mission | None) -> Mission:
    """Return the mission of a bound; a TypeError or ValueError if it does not fit ``mission``."""
    from botohe_moo.bounds import FrontBound  # late: few pictures have a bound

    if not isinstance(bound, FrontBound):
        raise TypeError(f"Expected bound to be a FrontBound, got {quoted(bound)}.")
    if mission is None:
        return bound.mission
    if numbers_digest(check_mission(mission)) != numbers_digest(bound.mission):
        wanted, found = (f"{one.name!r} with {one.team}" for one in (mission, bound.mission))
        raise ValueError(f"Expected a bound of the mission {wanted}, got one of {found}.")
    return mission


def _rows(
    highlight: int | Sequence[int] | Mapping[int, str] | None, n_plans: int
) -> dict[int, str]:
    """Return the rows to mark, with their texts."""
    names: Any = highlight
    if not isinstance(highlight, Mapping):
        rows = [] if highlight is None else np.atleast_1d(highlight).tolist()
        names = dict.fromkeys(rows, "")
    for row in names:
        check_row("highlight", row, n_plans)
    return {row: f"plan {row}: {name}" if name else f"plan {row}" for row, name in names.items()}


def front_summary(points: FloatArray, mission: Mission | None) -> str:
    """Write the area that plans dominate, and their number."""
    if mission is not None:
        area = f"{area_indicator(points, mission):.4f}"
    else:
        area = f"{moocore.hypervolume(points, ref=[0, 0], maximise=True) if len(points) else 0:.3g}"
    return f"area {area}, {counted(len(points), 'plan')}"


def _draw_front(
    ax: Axes, points: FloatArray, corners: FloatArray, drawn: int, label: str | None
) -> None:
    colour, marker = colours(drawn + 1)[-1], MARKERS[drawn % len(MARKERS)]
    ax.fill(*corners.T, facecolor=colour, alpha=0.16, linewidth=0, zorder=1, label="_area")
    ax.plot(*corners[:-1].T, color=colour, linewidth=1.0, zorder=2, label=_STAIRS)
    dominated = ~np.asarray(moocore.is_nondominated(points, maximise=True, keep_weakly=True))
    crowded = len(points) > _CROWD
    style: dict[str, Any] = {
        "marker": marker,
        "linestyle": "none",
        "markersize": 3.5 if crowded else 5.0,
        "markeredgecolor": "white",
        "markeredgewidth": 0.0 if crowded else 0.5,
        "clip_on": False,
    }
    if dominated.any():
        pale = tint(colour, 0.55)
        ax.plot(*points[dominated].T, **style, color=pale, zorder=2.5, label="_dominated")
    ax.plot(*points[~dominated].T, **style, color=colour, zorder=3, label=label or "_front")


def _shade_gap(
    ax: Axes, corners: FloatArray, bound: FrontBound, gap: float, label: str | None
) -> None:
    """Shade what lies between a front, whose corners are given, and a bound."""
    more = f"at most {100 * gap:.2f} % more area"
    if math.isinf(gap):
        more = f"area at most {bound.area:.4f}"
    highest = staircase(bound.points)
    # Back along the front, so that what it dominates is left out.
    between = np.concatenate([highest, corners[::-1]])
    name = f"{label}, open: {more}" if label else f"open: {more}"
    ax.fill(*between.T, facecolor=MUTED, alpha=0.25, linewidth=0, zorder=1, label=name)
    ax.plot(*highest[:-1].T, color=MUTED, linewidth=1.0, zorder=1.5, label="_bound")


def _ring_plans(ax: Axes, points: FloatArray, chosen: Mapping[int, str]) -> None:
    """Ring chosen plans and write what they are beside them, where no two texts overlap."""
    figure = ax.figure.figure
    if chosen and (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
    drawn = [np.asarray(line.get_xydata(), dtype=float) for line in ax.lines]
    space = Space(ax, points[list(chosen)], _RING, np.concatenate(drawn))
    for row, text in chosen.items():
        ax.plot(
            *points[[row]].T,
            marker="o",
            markersize=2 * _RING,
            markerfacecolor="none",
            markeredgecolor=INK,
            markeredgewidth=1.6,
            clip_on=False,
            zorder=4,
            label="_highlight",
        )
        space.write_beside(points[row], text, 9.5, reach=60.0, bold=True)


def _set_axes(ax: Axes, mission: Mission | None) -> None:
    ax.set(xlabel=OBJECTIVES[0], ylabel=OBJECTIVES[1])
    if mission is not None:
        ax.set(xlim=(0, mission.total_reward or 1.0), ylim=(0, mission.robots))
        ax.yaxis.set_major_locator(MaxNLocator(nbins=6, steps=[1, 2, 5, 10]))
        return
    # There may be several fronts, which must all stay in view.
    reach = 1.05 * np.clip([ax.dataLim.x1, ax.dataLim.y1], 0.0, None)
    ax.set(xlim=(0, reach[0] or 1.0), ylim=(0, reach[1] or 1.0))
