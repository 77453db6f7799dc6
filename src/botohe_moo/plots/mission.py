"""Picture of a mission: rewards, dangers and team, and the trails of a plan."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import networkx as nx
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from botohe_moo.base.messages import check_choice
from botohe_moo.base.numbers import probability_text
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.background import read_background
from botohe_moo.plots.draw.canvas import Canvas, colour_by_value, open_axes
from botohe_moo.plots.draw.kinds import ALL_RETURN, place_handles, shade_kinds
from botohe_moo.plots.draw.maps import draw_named_nodes, key_of
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.site import Site, place_name, robot_names, site_of
from botohe_moo.plots.draw.style import REWARD, SURVIVAL, Colour, colours, theme, tint
from botohe_moo.plots.draw.texts import objectives_text, title_above
from botohe_moo.plots.draw.trails import draw_trails, robot_styles
from botohe_moo.trails import TrailPlan

_MAX_ZONES = 8


def plot_mission(
    mission: Mission,
    plan: TrailPlan | None = None,
    *,
    kind: str | None = None,
    background: str | os.PathLike[str] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a mission and, if given, the trails of a plan on it.

    Nodes are coloured by reward, hollow where there is none, and the base is a square. Arcs are
    coloured by survival: one straight line where both directions are equally dangerous, an arrow
    bowed to its right for every other arc. From two to eight zones are shaded. Nodes lie at their
    attribute ``pos``, or in a reproducible layout if any has none. The line under the title says so
    where positions of some nodes are not used, or where there is no room for names of nodes.

    If there are several kinds of robots, the colour of an arc is its survival for the kind that it
    is safest for. Arcs and nodes that not all kinds can take or collect are shaded in the colours
    of those that can. A triangle marks where a kind starts, and a hollow one where it ends. Depots
    are squares, and nodes that pay on return have a ring, unless all do.

    Parameters
    ----------
    mission
        Mission to draw.
    plan
        Plan whose trails to draw, one colour per robot, each keeping to the right of its arcs. Of
        several kinds each has a colour, and its robots differ in dash.
    kind
        Name of a kind of robots, to draw the arcs that these can take, what they survive and what
        they can collect, and only their trails.
    background
        File of a map of the site, YAML as for ROS's map server, to draw faintly behind the graph.
        Its origin and resolution are in the units of ``pos``.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on, colour bars and legend included. One will be created if not given.

    Raises
    ------
    PlanError
        If the mission does not allow ``plan``.
    ValueError
        If the ``pos`` of a node is not two finite numbers, there is no such kind, the background
        cannot be read, or there is one and not all nodes have positions.

    Examples
    --------
    >>> from botohe_moo import load_mission, plot_mission
    >>> from botohe_moo.plots import save_plot
    >>> toy = load_mission("toy")
    >>> save_plot(plot_mission(toy, toy.plan([[1, 2, 4, 2, 1], [1]])), "mission.png")
    """
    check_mission(mission)
    if kind is not None:
        check_choice("kind", kind, [one.name for one in mission.kinds])
    behind = read_background(background, mission)
    notes = layout_notes(mission)
    if plan is not None:
        notes.insert(0, objectives_text(*mission.evaluate([plan])[0]))
    xy, site = node_positions(mission), site_of(mission, kind)
    if kind is not None:
        notes.append(f"arcs and rewards of {kind}")
    if site.all_return:
        notes.append(ALL_RETURN)
    with theme():
        ax = open_axes(xy, ax, behind)
        fills, arc_colours = _colour_site(ax, mission, site, kind)
        zones = _zones(mission)
        robots = [i for i, one in enumerate(mission.kind_of) if kind in (None, one.name)]
        _add_legend(ax, mission, site, zones, _trail_handles(mission, plan, robots))
        canvas = Canvas.measure(ax, xy)
        _shade_zones(canvas, mission, site, zones)
        shade_kinds(canvas, mission, site)
        lines = _draw_arcs(canvas, site, arc_colours, faint=plan is not None)
        if plan is not None:
            arcs = zip(site.tail[site.bowed].tolist(), site.head[site.bowed].tolist(), strict=True)
            trails, styles = mission.trails(plan), robot_styles(mission)
            shown = [trails[i] for i in robots], [styles[i] for i in robots]
            lines = draw_trails(canvas, *shown, bowed=set(arcs))
        notes += draw_named_nodes(canvas, mission, site, fills, lines)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _colour_site(
    ax: Axes, mission: Mission, site: Site, kind: str | None
) -> tuple[FloatArray, FloatArray]:
    """Add both colour bars, and return the colours of nodes and of arcs (n, 4)."""
    # The same scales on the maps of all kinds.
    most, survival = mission.rewards.max(), mission.world.graph.survival
    span = survival.min(initial=1.0), survival.max(initial=0.0)
    paid, fills = site.reward > 0, np.ones((len(site.reward), 4))
    fills[paid] = colour_by_value(ax, site.reward[paid], REWARD, "reward", slot=0, span=(0.0, most))
    label = "survival"
    if len(mission.kinds) > 1:
        label += " (safest kind)" if kind is None else f" of {kind}"
    return fills, colour_by_value(ax, site.safest, SURVIVAL, label, slot=1, span=span)


def _draw_arcs(canvas: Canvas, site: Site, arc_colours: FloatArray, *, faint: bool) -> FloatArray:
    """Draw all arcs, and return points on them (n_arcs, n_points, 2)."""
    tail, head, bowed = site.tail, site.head, site.bowed
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
    taken = len(mission.kinds) if len(mission.kinds) > 1 else 0  # by what only some kinds can do
    free = colours(taken + len(zones))[taken:]
    return {zone: tint(colour, 0.17) for zone, colour in zip(zones, free, strict=True)}


def _shade_zones(canvas: Canvas, mission: Mission, site: Site, zones: dict[str, Colour]) -> None:
    wide = 4.2 * canvas.radius
    zone_of = np.array([str(mission.graph.nodes[node].get("zone")) for node in mission.nodes])
    for zone, colour in zones.items():
        inside = zone_of == zone
        within = inside[site.tail] & inside[site.head]
        tail, head = site.tail[within], site.head[within]
        # Hulls of neighbouring floors overlap; a band along a zone's own arcs rarely does.
        bands = canvas.curves(tail, head, bowed=False)
        canvas.draw_lines(bands, colors=[colour], linewidths=wide, zorder=0, label="_zone")
        cycles = nx.cycle_basis(nx.Graph(zip(tail.tolist(), head.tolist(), strict=True)))
        rooms = PolyCollection([canvas.xy[cycle] for cycle in cycles], color=colour, zorder=0)
        canvas.ax.add_collection(rooms, autolim=False)
        x, y = canvas.xy[inside].T
        canvas.ax.scatter(x, y, s=wide**2, color=colour, linewidths=0, zorder=0)


def _add_legend(
    ax: Axes, mission: Mission, site: Site, zones: dict[str, Colour], trails: Sequence[Artist]
) -> None:
    handles = place_handles(mission, site)
    handles += [Patch(color=colour, label=zone) for zone, colour in zones.items()]
    handles += trails
    for columns in (4, 3, 2, 1):
        legend = ax.legend(
            handles=handles,
            ncols=columns,
            loc="upper center",
            bbox_to_anchor=(0.55, -0.01),
            handlelength=2.4 if len(mission.kinds) > 1 else 1.5,  # for dashes
            columnspacing=1.5,
        )
        # Colour bars stand beside the axes, and the legend may reach below them.
        if legend.get_window_extent().width <= 1.25 * ax.get_window_extent().width:
            break


def _trail_handles(mission: Mission, plan: TrailPlan | None, robots: Sequence[int]) -> list[Artist]:
    if plan is None:
        return []
    handles: list[Artist] = []
    survival, trails = mission.robot_survival([plan])[0].tolist(), mission.trails(plan)
    names, styles = robot_names(mission), robot_styles(mission)
    for i in robots:
        says = f"survives with {probability_text(survival[i], 2)}"
        if len(trails[i]) == 1:
            says = f"stays at {place_name(mission, trails[i][0])}"
        handles.append(key_of(f"{names[i]}: {says}", styles[i]))
    return handles
