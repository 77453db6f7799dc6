"""Pictures of a mission: rewards, dangers and team, the trails of a plan, or pheromone."""

from __future__ import annotations

import math
import os
from collections import defaultdict
from typing import TYPE_CHECKING, Literal, get_args

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
from botohe_moo.plots import canvas as maps
from botohe_moo.plots import site as where
from botohe_moo.plots import style as look
from botohe_moo.plots.canvas import Canvas, colour_by_value, open_axes, robot_styles
from botohe_moo.plots.shared import check_table
from botohe_moo.plots.style import objectives_text, title_above
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
    behind = where.read_background(background, mission)
    notes, site = where.layout_notes(mission), where.Site(mission, kind)
    if plan is not None:
        notes.insert(0, objectives_text(*mission.evaluate([plan])[0]))
    if kind is not None:
        notes.append(f"arcs and rewards of {kind}")
    if site.all_return:
        notes.append(where.ALL_RETURN)
    with look.theme():
        ax = open_axes(mission, ax, behind)
        fills, arc_colours = _colour_site(ax, mission, site, kind)
        zones = _zones(mission)
        robots = [i for i, one in enumerate(mission.kind_of) if kind in (None, one.name)]
        handles = maps.place_handles(mission, site)
        handles += [Patch(color=colour, label=zone) for zone, colour in zones.items()]
        if plan is not None:
            handles += _trail_handles(mission, plan, robots)
        _add_legend(ax, handles, dash=2.4 if len(mission.kinds) > 1 else 1.5)
        canvas = Canvas(ax, mission, site)
        _shade_zones(canvas, zones)
        canvas.shade_kinds()
        lines = _draw_arcs(canvas, arc_colours, faint=plan is not None)
        if plan is not None:
            arcs = zip(site.tail[site.bowed].tolist(), site.head[site.bowed].tolist(), strict=True)
            trails, styles = mission.trails(plan), robot_styles(mission)
            shown = [trails[i] for i in robots], [styles[i] for i in robots]
            lines = canvas.draw_trails(*shown, bowed=set(arcs))
        notes += canvas.draw_named_nodes(fills, lines)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _colour_site(
    ax: Axes, mission: Mission, site: where.Site, kind: str | None
) -> tuple[FloatArray, FloatArray]:
    """Add both colour bars, and return the colours of nodes and of arcs (n, 4)."""
    # The same scales on the maps of all kinds.
    most, survival = float(mission.rewards.max()), mission.world.graph.survival
    span = float(survival.min(initial=1.0)), float(survival.max(initial=0.0))
    paid, fills = site.reward > 0, np.ones((len(site.reward), 4))
    rewards, palette = site.reward[paid], look.REWARD
    fills[paid] = colour_by_value(ax, rewards, palette, "reward", (0.0, most), 0)
    label = "survival"
    if len(mission.kinds) > 1:
        label += " (safest kind)" if kind is None else f" of {kind}"
    return fills, colour_by_value(ax, site.safest, look.SURVIVAL, label, span, 1)


def _draw_arcs(canvas: Canvas, arc_colours: FloatArray, *, faint: bool) -> FloatArray:
    """Draw all arcs, and return points on them (n_arcs, n_points, 2)."""
    site = canvas.site
    tail, head, bowed, once = site.tail, site.head, site.bowed, site.once & ~site.bowed
    # Hundreds of arrows at full width would merge into a carpet.
    width = (1.0 if faint else 1.8) * min(1.0, max(0.4, 12 / max(len(tail), 1) ** 0.5))
    style: look.Style = {"alpha": 0.6 if faint else 1.0, "zorder": 1}
    points = canvas.curves(tail, head, bowed)
    lines, arrows = arc_colours[once], arc_colours[bowed]
    canvas.draw_lines(points[once], colors=lines, linewidths=width, label="_lines", **style)
    widths = np.full(len(arrows), width)
    canvas.draw_arrows(tail[bowed], head[bowed], arrows, widths, **style)
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


def _add_legend(ax: Axes, handles: list[Artist], *, dash: float) -> None:
    """Add a legend below, of as many columns as fit; ``dash`` is the length of its lines."""
    place: look.Style = {"loc": "upper center", "bbox_to_anchor": (0.55, -0.01)}
    place |= {"columnspacing": 1.5, "handlelength": dash}
    for columns in (4, 3, 2, 1):
        legend = ax.legend(handles=handles, ncols=columns, **place)
        # Colour bars stand beside the axes, and the legend may reach below them.
        if legend.get_window_extent().width <= 1.25 * ax.get_window_extent().width:
            break


def _trail_handles(mission: Mission, plan: TrailPlan, robots: list[int]) -> list[Artist]:
    survival, trails = mission.robot_survival([plan])[0].tolist(), mission.trails(plan)
    says = [
        f"survives with {probability_text(chance, 2)}"
        if len(trail) > 1
        else f"stays at {where.place_name(mission, trail[0])}"
        for chance, trail in zip(survival, trails, strict=True)
    ]
    names, styles = where.robot_names(mission), robot_styles(mission)
    return [styles[i].key(f"{names[i]}: {says[i]}") for i in robots]


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
        If ``kind`` is unknown, a column or an arc of the mission is missing, an arc is there
        twice, there are rows of several kinds of robots, or a value is out of range.

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
        canvas.draw_arrows(tail, head, colours[order], widths, zorder=1)
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
    if len(found) != 1:
        raise ValueError(f"Expected rows of one kind of robots, got kinds {found}.")
    check_choice("pheromone's kind", found[0], [kind.name for kind in mission.kinds])
    return found[0]


def _arc_values(
    mission: Mission, site: where.Site, pheromone: pd.DataFrame, kind: PheromoneKind
) -> FloatArray:
    """Return the pheromone of the site's arcs, in their order."""
    check_table("pheromone", pheromone, ("tail", "head", kind))
    found = defaultdict(list)
    for tail, head, value in pheromone[["tail", "head", kind]].itertuples(index=False):
        found[tail, head].append(value)
    ends = zip(site.tail, site.head, strict=True)
    arcs = [(mission.nodes[tail], mission.nodes[head]) for tail, head in ends]
    for tail, head in arcs:
        if len(of_arc := found[tail, head]) != 1 or not 0 <= of_arc[0] < math.inf:
            expected = "one row for each arc, with a finite pheromone of at least 0"
            raise ValueError(f"Expected {expected}, got {of_arc} for {tail!r} -> {head!r}.")
    return np.array([found[arc][0] for arc in arcs], float)
