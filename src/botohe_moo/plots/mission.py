"""The picture of a mission: rewards, dangers, base and team, and the trails of a plan."""

import math
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray
from botohe_moo._base.words import counted
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.canvas import (
    Canvas,
    add_colour_bar,
    bowed_arcs,
    open_axes,
)
from botohe_moo.plots.draw.maps import draw_nodes
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.style import (
    MUTED,
    Colour,
    colour_range,
    colours,
    reward_palette,
    survival_palette,
    theme,
    tint,
)
from botohe_moo.plots.draw.titles import title_above
from botohe_moo.plots.draw.trails import draw_trails, robot_styles
from botohe_moo.trails import TrailPlan

_MAX_ZONES = 8


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
        reward, survivors = mission.evaluate([plan])[0]
        notes.insert(0, f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}")
    xy = node_positions(mission)
    with theme():
        ax = open_axes(xy, ax)
        fills = _reward_fills(ax, mission)
        zones = _zones(mission)
        _add_legend(ax, mission, plan, zones)
        arc_colours = _arc_colours(ax, mission)
        canvas = Canvas.measure(ax, xy)
        _shade_zones(canvas, mission, zones)
        lines = _draw_arcs(canvas, mission, arc_colours, faint=plan is not None)
        if plan is not None:
            arcs, bowed = mission.arrays, bowed_arcs(mission)
            pairs = zip(arcs.tail[bowed].tolist(), arcs.head[bowed].tolist(), strict=True)
            lines = draw_trails(canvas, plan, robot_styles(plan.n_robots), bowed=set(pairs))
        notes += draw_nodes(canvas, mission, fills, lines)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _reward_fills(ax: Axes, mission: Mission) -> NDArray[Any]:
    reward = mission.arrays.reward
    fills = np.ones((len(reward), 4))
    if reward.any():
        palette, norm = reward_palette(), colour_range(reward, low=0.0)
        add_colour_bar(ax, palette, norm, "reward", slot=0)
        fills[reward > 0] = palette(norm(reward[reward > 0]))
    return fills


def _arc_colours(ax: Axes, mission: Mission) -> NDArray[Any]:
    survival = mission.arrays.survival
    if not len(survival):
        return np.empty((0, 4))
    palette, norm = survival_palette(), colour_range(survival)
    add_colour_bar(ax, palette, norm, "survival", slot=1)
    return np.asarray(palette(norm(survival)))


def _draw_arcs(
    canvas: Canvas, mission: Mission, arc_colours: NDArray[Any], *, faint: bool
) -> FloatArray:
    """Draw all arcs, and return points on them (n_arcs, n_points, 2)."""
    tail, head = mission.arrays.tail, mission.arrays.head
    bowed = bowed_arcs(mission)
    once = ~bowed & (tail < head)
    # Hundreds of arrows at full width would merge into a carpet.
    width = (1.0 if faint else 1.8) * min(1.0, max(0.4, 12 / max(len(tail), 1) ** 0.5))
    alpha = 0.6 if faint else 1.0
    points = canvas.curves(tail, head, bowed)
    look: dict[str, Any] = {"linewidths": width, "alpha": alpha, "zorder": 1}
    canvas.draw_lines(points[once], colors=arc_colours[once], label="_lines", **look)
    canvas.draw_arrows(
        tail[bowed],
        head[bowed],
        colours=arc_colours[bowed],
        widths=np.full(int(bowed.sum()), width),
        alpha=alpha,
        zorder=1,
    )
    return points


def _zones(mission: Mission) -> dict[str, Colour]:
    """Zones worth shading, with their colours; none for one alone or too many to tell apart."""
    named = [zone for _, zone in mission.graph.nodes(data="zone") if zone is not None]
    zones = list(dict.fromkeys(str(zone) for zone in named))
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
        bands = canvas.curves(tail, head, np.zeros(len(tail), dtype=bool))
        canvas.draw_lines(bands, colors=[colour], linewidths=wide, zorder=0, label="_zone")
        cycles = nx.cycle_basis(nx.Graph(zip(tail.tolist(), head.tolist(), strict=True)))
        rooms = PolyCollection([canvas.xy[cycle] for cycle in cycles], color=colour, zorder=0)
        canvas.ax.add_collection(rooms, autolim=False)
        x, y = canvas.xy[inside].T
        canvas.ax.scatter(x, y, s=wide**2, color=colour, linewidths=0, zorder=0)


def _add_legend(
    ax: Axes, mission: Mission, plan: TrailPlan | None, zones: dict[str, Colour]
) -> None:
    team = counted(mission.robots, "robot")
    hollow: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "white", "markersize": 9}
    square = {"marker": "s", "markeredgecolor": "black", "markeredgewidth": 2, **hollow}
    circle = {"marker": "o", "markeredgecolor": MUTED, "markeredgewidth": 1.1, **hollow}
    base = f"{team} at base {mission.base}"
    handles: list[Artist] = [Line2D([], [], label=base, **square)]
    if (np.delete(mission.arrays.reward, mission.arrays.base) == 0).any():
        handles.append(Line2D([], [], label="no reward", **circle))
    handles += [Patch(color=colour, label=zone) for zone, colour in zones.items()]
    if plan is not None:
        handles += _trail_handles(mission, plan)
    look: dict[str, Any] = {"frameon": False, "handlelength": 1.5, "columnspacing": 1.5}
    for columns in (4, 3, 2, 1):
        legend = ax.legend(
            handles=handles, ncols=columns, loc="upper center", bbox_to_anchor=(0.55, -0.01), **look
        )
        # Colour bars stand beside the axes, and the legend may reach below them.
        if legend.get_window_extent().width <= 1.25 * ax.get_window_extent().width:
            break


def _trail_handles(mission: Mission, plan: TrailPlan) -> list[Artist]:
    handles: list[Artist] = []
    for robot, (trail, style) in enumerate(
        zip(mission.labels(plan), robot_styles(plan.n_robots), strict=True)
    ):
        odds = math.prod(mission.graph.edges[arc]["survival"] for arc in pairwise(trail))
        shown = f"{odds:.2f}" if odds >= 0.005 else "<0.01"
        says = f"survives with {shown}" if len(trail) > 1 else "stays at base"
        look: dict[str, Any] = {"color": style.colour, "linestyle": style.line, "linewidth": 2.4}
        handles.append(Line2D([], [], label=f"robot {robot}: {says}", **look))
    return handles
