"""Pictures of a mission: rewards, dangers and team, the trails of a plan, and pheromone."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, Literal, get_args

import networkx as nx
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from botohe_moo._base.checks import check_choice
from botohe_moo._base.types import BoolArray, FloatArray
from botohe_moo._base.words import counted, probability_text
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.algorithms import check_table
from botohe_moo.plots.draw.canvas import Canvas, colour_by_value, open_axes
from botohe_moo.plots.draw.maps import draw_named_nodes, key_of
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.style import (
    MUTED,
    PHEROMONE,
    REWARD,
    SURVIVAL,
    Colour,
    colours,
    theme,
    tint,
)
from botohe_moo.plots.draw.texts import objectives_text, title_above
from botohe_moo.plots.draw.trails import draw_trails, robot_styles
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd

PheromoneKind = Literal["reward", "survival"]

_MAX_ZONES = 8
_WIDEST = 5.0  # points: the arc of most pheromone


def plot_mission(
    mission: Mission,
    plan: TrailPlan | None = None,
    *,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a mission and, if given, the trails of a plan on it.

    Nodes are coloured by reward, hollow where there is none, and the base is a square. Arcs are
    coloured by survival: one straight line where both directions are equally dangerous, an arrow
    bowed to its right for every other arc. From two to eight zones are shaded. Nodes lie at their
    attribute ``pos``, or in a reproducible layout if any has none. The line under the title says so
    where positions of some nodes are not used, or where there is no room for names of nodes.

    Parameters
    ----------
    mission
        Mission to draw.
    plan
        Plan whose trails to draw, one colour per robot, each keeping to the right of its arcs.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on, colour bars and legend included. One will be created if not given.

    Raises
    ------
    PlanError
        If the mission does not allow ``plan``.
    ValueError
        If the ``pos`` of a node is not two finite numbers.

    Examples
    --------
    >>> from botohe_moo import load_mission, plot_mission
    >>> from botohe_moo.plots import save_plot
    >>> toy = load_mission("toy")
    >>> save_plot(plot_mission(toy, toy.plan([[1, 2, 4, 2, 1], [1]])), "mission.png")
    """
    check_mission(mission)
    notes = layout_notes(mission)
    if plan is not None:
        notes.insert(0, objectives_text(*mission.evaluate([plan])[0]))
    xy = node_positions(mission)
    with theme():
        ax = open_axes(xy, ax)
        arrays = mission.arrays
        # Arcs that differ from their opposites in survival, or have none.
        bowed = (arrays.reverse < 0) | (arrays.survival[arrays.reverse] != arrays.survival)
        paid, fills = arrays.reward > 0, np.ones((arrays.n_nodes, 4))
        fills[paid] = colour_by_value(ax, arrays.reward[paid], REWARD, "reward", slot=0, low=0.0)
        zones = _zones(mission)
        _add_legend(ax, mission, plan, zones)
        arc_colours = colour_by_value(ax, arrays.survival, SURVIVAL, "survival", slot=1)
        canvas = Canvas.measure(ax, xy)
        _shade_zones(canvas, mission, zones)
        lines = _draw_arcs(canvas, mission, arc_colours, bowed, faint=plan is not None)
        if plan is not None:
            arcs = zip(arrays.tail[bowed].tolist(), arrays.head[bowed].tolist(), strict=True)
            lines = draw_trails(canvas, plan, robot_styles(plan.n_robots), bowed=set(arcs))
        notes += draw_named_nodes(canvas, mission, fills, lines)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _draw_arcs(
    canvas: Canvas, mission: Mission, arc_colours: FloatArray, bowed: BoolArray, *, faint: bool
) -> FloatArray:
    """Draw all arcs, and return points on them (n_arcs, n_points, 2)."""
    tail, head = mission.arrays.tail, mission.arrays.head
    once = ~bowed & (tail < head)
    # Hundreds of arrows at full width would merge into a carpet.
    width = (1.0 if faint else 1.8) * min(1.0, max(0.4, 12 / max(len(tail), 1) ** 0.5))
    style: dict[str, Any] = {"alpha": 0.6 if faint else 1.0, "zorder": 1}
    points = canvas.curves(tail, head, bowed)
    lines, arrows = arc_colours[once], arc_colours[bowed]
    canvas.draw_lines(points[once], colors=lines, linewidths=width, label="_lines", **style)
    widths = np.full(len(arrows), width)
    canvas.draw_arrows(tail[bowed], head[bowed], colours=arrows, widths=widths, **style)
    return points


def _zones(mission: Mission) -> dict[str, Colour]:
    """Return the colours of zones; none for one zone alone, or too many to tell apart."""
    named = mission.graph.nodes(data="zone")
    zones = list(dict.fromkeys(str(zone) for _, zone in named if zone is not None))
    if not 2 <= len(zones) <= _MAX_ZONES:
        return {}
    return {zone: tint(c, 0.17) for zone, c in zip(zones, colours(len(zones)), strict=True)}


def _shade_zones(canvas: Canvas, mission: Mission, zones: dict[str, Colour]) -> None:
    arrays, wide = mission.arrays, 4.2 * canvas.radius
    zone_of = np.array([str(mission.graph.nodes[node].get("zone")) for node in mission.nodes])
    for zone, colour in zones.items():
        inside = zone_of == zone
        within = inside[arrays.tail] & inside[arrays.head]
        tail, head = arrays.tail[within], arrays.head[within]
        # Hulls of neighbouring floors overlap; a band along a zone's own arcs rarely does.
        bands = canvas.curves(tail, head, bowed=False)
        canvas.draw_lines(bands, colors=[colour], linewidths=wide, zorder=0, label="_zone")
        cycles = nx.cycle_basis(nx.Graph(zip(tail.tolist(), head.tolist(), strict=True)))
        rooms = PolyCollection([canvas.xy[cycle] for cycle in cycles], color=colour, zorder=0)
        canvas.ax.add_collection(rooms, autolim=False)
        x, y = canvas.xy[inside].T
        canvas.ax.scatter(x, y, s=wide**2, color=colour, linewidths=0, zorder=0)


def _add_legend(
    ax: Axes, mission: Mission, plan: TrailPlan | None, zones: dict[str, Colour]
) -> None:
    hollow: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "white", "markersize": 9}
    square = {"marker": "s", "markeredgecolor": "black", "markeredgewidth": 2, **hollow}
    circle = {"marker": "o", "markeredgecolor": MUTED, "markeredgewidth": 1.1, **hollow}
    base = f"{counted(mission.robots, 'robot')} at base {mission.base}"
    handles: list[Artist] = [Line2D([], [], label=base, **square)]
    if (np.delete(mission.arrays.reward, mission.arrays.base) == 0).any():
        handles.append(Line2D([], [], label="no reward", **circle))
    handles += [Patch(color=colour, label=zone) for zone, colour in zones.items()]
    if plan is not None:
        handles += _trail_handles(mission, plan)
    for columns in (4, 3, 2, 1):
        legend = ax.legend(
            handles=handles,
            ncols=columns,
            loc="upper center",
            bbox_to_anchor=(0.55, -0.01),
            handlelength=1.5,
            columnspacing=1.5,
        )
        # Colour bars stand beside the axes, and the legend may reach below them.
        if legend.get_window_extent().width <= 1.25 * ax.get_window_extent().width:
            break


def _trail_handles(mission: Mission, plan: TrailPlan) -> list[Artist]:
    handles: list[Artist] = []
    survival = mission.robot_survival([plan])[0].tolist()
    for robot, style in enumerate(robot_styles(plan.n_robots)):
        stays = len(plan.trails[robot]) == 1
        says = "stays at base" if stays else f"survives with {probability_text(survival[robot], 2)}"
        handles.append(key_of(f"robot {robot}: {says}", style))
    return handles


def plot_pheromone(
    mission: Mission,
    pheromone: pd.DataFrame,
    *,
    kind: PheromoneKind = "reward",
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw every arc as wide and as dark as its pheromone.

    Parameters
    ----------
    mission
        Mission that the pheromone lies on.
    pheromone
        One row per arc: node labels ``tail`` and ``head``, and ``reward`` and ``survival``, the
        pheromone of either kind (finite, at least 0). The base's self-loop is not drawn.
    kind
        Which of the two to draw.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on, colour bar included. One will be created if not given.

    Raises
    ------
    ValueError
        If ``kind`` is unknown, a column or an arc of the mission is missing, an arc is there
        twice, or a value is out of range.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOACO, BOTOHE, load_mission
    >>> from botohe_moo.plots import plot_pheromone, save_plot
    >>> toy = load_mission("toy")
    >>> colony = minimize(BOTOHE(toy), BOACO(n_ants=20), ("n_gen", 5), seed=1).algorithm
    >>> save_plot(plot_pheromone(toy, colony.pheromone_maps, kind="survival"), "pheromone.png")
    """
    check_choice("kind", kind, get_args(PheromoneKind))
    check_mission(mission)
    values = _arc_values(mission, pheromone, kind)
    xy = node_positions(mission)
    notes = [f"pheromone for {kind}", *layout_notes(mission)]
    with theme():
        ax = open_axes(xy, ax)
        label, arrays = rf"pheromone $\tau_{kind[0].upper()}$", mission.arrays
        arc_colours = colour_by_value(ax, values, PHEROMONE, label, slot=0, low=0.0)
        canvas = Canvas.measure(ax, xy)
        # What is darkest is drawn last, on top.
        order = np.argsort(values, kind="stable")
        share = values[order] / (values.max(initial=0.0) or 1.0)
        canvas.draw_arrows(
            arrays.tail[order],
            arrays.head[order],
            colours=arc_colours[order],
            widths=0.3 + share * min(_WIDEST, 0.5 * canvas.radius),
            zorder=1,
        )
        arcs = canvas.curves(arrays.tail, arrays.head, bowed=True)
        notes += draw_named_nodes(canvas, mission, np.ones((len(xy), 4)), arcs)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _arc_values(mission: Mission, pheromone: pd.DataFrame, kind: PheromoneKind) -> FloatArray:
    """Return the pheromone of the mission's arcs, in the order of its arrays."""
    check_table("pheromone", pheromone, ("tail", "head", kind))
    ends = list(zip(pheromone["tail"].tolist(), pheromone["head"].tolist(), strict=True))
    for (tail, head), n_rows in Counter(ends).items():
        if n_rows > 1:
            raise ValueError(f"Expected one row per arc, got {tail!r} -> {head!r} twice.")
    found = dict(zip(ends, pheromone[kind].tolist(), strict=True))
    arrays, nodes = mission.arrays, mission.nodes
    arcs = [(nodes[u], nodes[v]) for u, v in zip(arrays.tail, arrays.head, strict=True)]
    if absent := [f"{tail!r} -> {head!r}" for tail, head in arcs if (tail, head) not in found]:
        raise ValueError(f"Expected a row for every arc, missing: {', '.join(absent)}.")
    values = np.array([found[arc] for arc in arcs], float)
    if not (np.isfinite(values) & (values >= 0)).all():
        raise ValueError(f"Expected finite pheromone of at least 0, got {values.tolist()}.")
    return values
