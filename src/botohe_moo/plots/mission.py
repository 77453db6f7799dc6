"""Pictures of a mission: rewards, dangers and team, or pheromone."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Literal, get_args

import networkx as nx
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.patches import Patch

from botohe_moo.base.messages import check_choice
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots import canvas as maps
from botohe_moo.plots import site as where
from botohe_moo.plots import style as look
from botohe_moo.plots.canvas import Canvas, colour_by_value, open_axes
from botohe_moo.plots.style import check_table, title_above

if TYPE_CHECKING:
    import pandas as pd

PheromoneKind = Literal["reward", "survival"]

_MAX_ZONES = 8
_WIDEST = 5.0  # points: the arc of most pheromone


def plot_mission(
    mission: Mission,
    *,
    background: str | os.PathLike[str] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw a mission.

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
    background
        File of a map of the site, YAML as for ROS's map server, to draw faintly behind the graph.
        Its origin and resolution are in the units of ``pos``.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on, colour bars and legend included. One will be created if not given.

    Raises
    ------
    ValueError
        If the ``pos`` of a node is not two finite numbers, the background cannot be read,
        or there is one and not all nodes have positions.

    Examples
    --------
    >>> from botohe_moo import load_mission, plot_mission
    >>> from botohe_moo.plots import save_plot
    >>> save_plot(plot_mission(load_mission("toy")), "mission.png")
    """
    check_mission(mission)
    behind = where.read_background(background, mission)
    notes, site = where.layout_notes(mission), where.Site(mission)
    if site.all_return:
        notes.append(where.ALL_RETURN)
    with look.theme():
        ax = open_axes(mission, ax, behind)
        fills, arc_colours = _colour_site(ax, site, several=len(mission.kinds) > 1)
        zones = _zones(mission)
        handles = maps.place_handles(mission, site)
        handles += [Patch(color=colour, label=zone) for zone, colour in zones.items()]
        place: look.Style = {"loc": "upper center", "bbox_to_anchor": (0.55, -0.01)}
        ax.legend(handles=handles, ncols=4, columnspacing=1.5, handlelength=1.5, **place)
        canvas = Canvas(ax, mission, site)
        _shade_zones(canvas, zones)
        canvas.shade_kinds()
        lines = _draw_arcs(canvas, arc_colours)
        notes += canvas.draw_named_nodes(fills, lines)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _colour_site(ax: Axes, site: where.Site, *, several: bool) -> tuple[FloatArray, FloatArray]:
    """Add both colour bars, and return the colours of nodes and of arcs (n, 4)."""
    paid, fills, safest = site.reward > 0, np.ones((len(site.reward), 4)), site.safest
    span = 0.0, float(site.reward.max())
    fills[paid] = colour_by_value(ax, site.reward[paid], look.REWARD, "reward", span, 0)
    label = "survival (safest kind)" if several else "survival"
    span = float(safest.min(initial=1.0)), float(safest.max(initial=0.0))
    return fills, colour_by_value(ax, safest, look.SURVIVAL, label, span, 1)


def _draw_arcs(canvas: Canvas, arc_colours: FloatArray) -> FloatArray:
    """Draw all arcs, and return points on them (n_arcs, n_points, 2)."""
    site = canvas.site
    tail, head, bowed, once = site.tail, site.head, site.bowed, site.once & ~site.bowed
    # Hundreds of arrows at full width would merge into a carpet.
    width = 1.8 * min(1.0, max(0.4, 12 / max(len(tail), 1) ** 0.5))
    points = canvas.curves(tail, head, bowed)
    style: look.Style = {"linewidths": width, "zorder": 1, "label": "_lines"}
    canvas.draw_lines(points[once], colors=arc_colours[once], **style)
    widths = np.full(bowed.sum(), width)
    canvas.draw_arrows(tail[bowed], head[bowed], arc_colours[bowed], widths)
    return points


def _zones(mission: Mission) -> dict[str, look.Colour]:
    """Return the colours of zones; none for one zone alone, or too many to tell apart."""
    named = mission.graph.nodes(data="zone")
    zones = list(dict.fromkeys(str(zone) for _, zone in named if zone is not None))
    if not 2 <= len(zones) <= _MAX_ZONES:
        return {}
    taken = len(mission.kinds) if len(mission.kinds) > 1 else 0  # by what only some kinds can do
    free = look.colours(taken + len(zones))[taken:]
    return {zone: look.tint(colour, 0.17) for zone, colour in zip(zones, free, strict=True)}


def _shade_zones(canvas: Canvas, zones: dict[str, look.Colour]) -> None:
    wide, site, mission = 4.2 * canvas.radius, canvas.site, canvas.mission
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
        canvas.mark(np.flatnonzero(inside), wide / 2, color=colour, zorder=0, label="_in zone")


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
        pheromone of either kind (finite, at least 0). The base's self-loop is not drawn. If there
        are several kinds of robots, the rows of one of them, which the column ``kind`` names.
    kind
        Which of the two to draw.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on, colour bar included. One will be created if not given.

    Raises
    ------
    ValueError
        If ``kind`` is unknown, a column or an arc of the mission is missing, there are rows of
        several kinds of robots, or a value is out of range.

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
    robots = _kind_in(mission, pheromone)
    site = where.Site(mission, robots)
    values = _arc_values(mission, site, pheromone, kind)
    most = float(values.max(initial=0.0))
    of = "" if robots is None else f" of {robots}"
    notes = [f"pheromone{of} for {kind}", *where.layout_notes(mission)]
    with look.theme():
        ax = open_axes(mission, ax)
        label = rf"pheromone $\tau_{kind[0].upper()}$"
        colours = colour_by_value(ax, values, look.PHEROMONE, label, (0.0, most), 0)
        canvas = Canvas(ax, mission, site)
        # What is darkest is drawn last, on top.
        order = np.argsort(values, kind="stable")
        widths = 0.3 + values[order] / (most or 1.0) * min(_WIDEST, 0.5 * canvas.radius)
        tail, head = site.tail[order], site.head[order]
        canvas.draw_arrows(tail, head, colours[order], widths)
        arcs = canvas.curves(site.tail, site.head, bowed=True)
        notes += canvas.draw_named_nodes(np.ones((len(canvas.xy), 4)), arcs)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _kind_in(mission: Mission, pheromone: pd.DataFrame) -> str | None:
    """Return which of several kinds of robots has laid the pheromone."""
    if len(mission.kinds) == 1:
        return None
    check_table("pheromone", pheromone, ("kind",))
    found = [str(name) for name in pheromone["kind"].unique()]
    if len(found) != 1 or found[0] not in [kind.name for kind in mission.kinds]:
        raise ValueError(f"Expected rows of one kind of robots of the mission, got kinds {found}.")
    return found[0]


def _arc_values(
    mission: Mission, site: where.Site, pheromone: pd.DataFrame, kind: PheromoneKind
) -> FloatArray:
    """Return the pheromone of the site's arcs, in their order."""
    check_table("pheromone", pheromone, ("tail", "head", kind))
    ends = zip(pheromone["tail"], pheromone["head"], strict=True)
    found = dict(zip(ends, pheromone[kind], strict=True))
    ends = zip(site.tail, site.head, strict=True)
    arcs = [(mission.nodes[tail], mission.nodes[head]) for tail, head in ends]
    for arc in arcs:
        if not 0 <= found.get(arc, math.nan) < math.inf:
            expected = f"a finite pheromone of at least 0 for {arc[0]!r} -> {arc[1]!r}"
            raise ValueError(f"Expected {expected}, got {found.get(arc)}.")
    return np.array([found[arc] for arc in arcs], float)
