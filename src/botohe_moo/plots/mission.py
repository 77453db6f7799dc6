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

from botohe_moo._base.words import counted
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.canvas import (
    MAX_LABELLED,
    Canvas,
    add_colour_bar,
    bowed_arcs,
    open_axes,
)
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
    mission: Mission, plan: TrailPlan | None = None, *, ax: Axes | None = None
) -> Axes:
    """Draw a mission and, if given, the trails of a plan on it.

    Nodes are coloured by reward, hollow where there is none, and the base is a square. Arcs are
    coloured by survival: one straight line where both directions are equally dangerous, an arrow
    bowed to its right for every other arc. From two to eight zones are shaded. Nodes lie at their
    attribute ``pos``, or in a reproducible layout if any has none; up to 40 nodes are labelled. The
    line under the title says so where positions of some nodes are not used, or nodes not labelled.

    Parameters
    ----------
    mission
        Mission to draw.
    plan
        Plan whose trails to draw, one colour per robot, each keeping to the right of its arcs.
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
    if len(mission.nodes) > MAX_LABELLED:
        notes.append(f"the {len(mission.nodes):,} nodes are not labelled")
    if plan is not None:
        reward, survivors = mission.evaluate([plan])[0]
        notes.insert(0, f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}")
    xy = node_positions(mission)
    with theme():
        ax = open_axes(xy, ax)
        title_above(ax, mission.title, "; ".join(notes))
        fills = _reward_fills(ax, mission)
        zones = _zones(mission)
        _add_legend(ax, mission, plan, zones)
        arc_colours = _arc_colours(ax, mission)
        canvas = Canvas.measure(ax, xy)
        _shade_zones(canvas, mission, zones)
        _draw_arcs(canvas, mission, arc_colours, faint=plan is not None)
        if plan is not None:
            arcs, bowed = mission.arrays, bowed_arcs(mission)
            pairs = zip(arcs.tail[bowed].tolist(), arcs.head[bowed].tolist(), strict=True)
            draw_trails(canvas, plan, robot_styles(plan.n_robots), bowed=set(pairs))
        canvas.draw_nodes(mission, fills)
    return ax


def _reward_fills(ax: Axes, mission: Mission) -> list[Any]:
    reward = mission.arrays.reward
    if not reward.any():
        return ["white"] * len(reward)
    palette, norm = reward_palette(), colour_range(reward, low=0.0)
    add_colour_bar(ax, palette, norm, "reward", slot=0)
    return [palette(norm(value)) if value > 0 else "white" for value in reward]


def _arc_colours(ax: Axes, mission: Mission) -> NDArray[Any]:
    survival = mission.arrays.survival
    if not len(survival):
        return np.empty((0, 4))
    palette, norm = survival_palette(), colour_range(survival)
    add_colour_bar(ax, palette, norm, "survival", slot=1)
    return np.asarray(palette(norm(survival)))


def _draw_arcs(canvas: Canvas, mission: Mission, arc_colours: NDArray[Any], *, faint: bool) -> None:
    tail, head = mission.arrays.tail, mission.arrays.head
    bowed = bowed_arcs(mission)
    once = ~bowed & (tail < head)
    # Hundreds of arrows at full width would merge into a carpet.
    width = (1.0 if faint else 1.8) * min(1.0, max(0.4, 12 / max(len(tail), 1) ** 0.5))
    alpha = 0.6 if faint else 1.0
    straight = canvas.curves(tail[once], head[once], bowed[once])
    canvas.draw_lines(
        straight, colors=arc_colours[once], linewidths=width, alpha=alpha, label="_lines", zorder=1
    )
    canvas.draw_arrows(
        tail[bowed],
        head[bowed],
        colours=arc_colours[bowed],
        widths=np.full(int(bowed.sum()), width),
        alpha=alpha,
        zorder=1,
    )


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
    trails = [] if plan is None else _trail_handles(mission, plan)
    # Colour bars stand beside the axes, and the legend may reach below them.
    room = 1.25 * ax.get_window_extent().width
    for columns in (4, 3, 2, 1):
        blanks = -len(handles) % columns if len(handles) + len(trails) > columns else 0
        rows = [*handles, *(Line2D([], [], linestyle="none", label=" ") for _ in range(blanks))]
        rows += trails  # which begin a row of their own
        legend = ax.legend(
            # Legends fill column by column; this one is read row by row.
            handles=[handle for i in range(columns) for handle in rows[i::columns]],
            loc="upper center",
            bbox_to_anchor=(0.55, -0.01),
            ncols=columns,
            frameon=False,
            handlelength=1.5,
            handletextpad=0.6,
            columnspacing=1.5,
        )
        if legend.get_window_extent().width <= room:
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
