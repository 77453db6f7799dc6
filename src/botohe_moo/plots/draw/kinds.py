"""What maps show of kinds of robots: where they start and end, and what only some can do."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path

from botohe_moo.base.messages import counted
from botohe_moo.base.types import FloatArray, IntArray
from botohe_moo.mission import Mission
from botohe_moo.plots.draw.canvas import Canvas, shifted
from botohe_moo.plots.draw.site import Site, only_some
from botohe_moo.plots.draw.style import INK, MUTED, tint
from botohe_moo.plots.draw.trails import kind_inks

_STRENGTH = 0.42  # of the colours of shades
# In radii of a node:
_BAND = 1.2  # width of the shade along an arc
_HALO = 1.7  # radius of the shade around a node
_RING = 1.32  # radius of a ring
_TRIANGLE = 1.55  # half the side of a triangle behind a node

ALL_RETURN = "all rewards count on return"
_LEAST = 6.5  # points: the same, at least

_MARKERS = "^v<>"  # of kinds, since several may start at one node
_CIRCLES = Path.make_compound_path(Path.circle(radius=0.5), Path.circle(radius=0.33))


def shade_kinds(canvas: Canvas, mission: Mission, site: Site) -> None:
    """Shade arcs and nodes that only some kinds can take or collect, in the colours of these."""
    shades = [tint(ink, _STRENGTH) for ink in kind_inks(mission)]
    points = canvas.curves(site.tail, site.head, site.bowed)
    once = site.bowed | (site.tail < site.head)
    for kinds, arcs in only_some(site.survival > 0).items():
        width = _BAND * canvas.radius / len(kinds)
        for i, kind in enumerate(kinds):
            aside = (i - (len(kinds) - 1) / 2) * width / canvas.scale
            band, colour = shifted(points[arcs & once], aside), [shades[kind]]
            canvas.draw_lines(band, colors=colour, linewidths=width, zorder=0.5, label="_only")
    for kinds, nodes in only_some(site.collects).items():
        for i, kind in enumerate(kinds):
            radius = canvas.radius * (1 + (_HALO - 1) * (1 - i / len(kinds)))
            _behind(canvas, np.flatnonzero(nodes), radius, zorder=0.6, color=[shades[kind]])


def mark_places(canvas: Canvas, mission: Mission, site: Site, radii: FloatArray) -> None:
    """Put triangles behind starts and, hollow, ends; and rings around what pays on return.

    ``radii`` (n_nodes) are those of the nodes, in points.
    """
    if len(site.returning) and not site.all_return:
        ring: dict[str, Any] = {"facecolor": "white", "edgecolor": INK, "linewidths": 0.6}
        wide = _RING * radii[site.returning]
        _behind(canvas, site.returning, wide, zorder=3.9, label="_rings", **ring)
    if not site.has_ends:
        return
    inks = kind_inks(mission)
    for kind, (start, end) in zip(site.kinds, site.ends, strict=True):
        look: dict[str, Any] = {"marker": _marker(kind), "edgecolor": inks[kind], "linewidths": 1.4}
        half = max(_TRIANGLE * canvas.radius, _LEAST)
        _behind(canvas, [start], half, zorder=1.6, facecolor=inks[kind], label="_start", **look)
        if end != start:
            _behind(canvas, [end], half, zorder=1.5, facecolor="white", label="_end", **look)


def place_notes(site: Site) -> list[str]:
    """Write what the marks of places mean, for maps without a legend of them."""
    notes = []
    if site.has_ends:
        hollow = ", hollow ones: ends" if any(start != end for start, end in site.ends) else ""
        notes.append(f"triangles: starts{hollow}")
    if len(site.depots):
        notes.append("thin squares: depots")
    if len(site.returning):
        notes.append(ALL_RETURN if site.all_return else "rings: pay on return")
    return notes


def place_handles(mission: Mission, site: Site) -> list[Artist]:
    """Return the keys of the team, of where it starts, and of nodes and arcs, for a legend."""
    hollow: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "white", "markersize": 9}
    square = {"marker": "s", "markeredgecolor": "black", "markeredgewidth": 2, **hollow}
    circle = {"marker": "o", "markeredgecolor": MUTED, "markeredgewidth": 1.1, **hollow}
    inked = {"markeredgecolor": INK, "markeredgewidth": 0.8, **hollow}
    base = f"base {mission.base}"
    if not site.has_ends:
        base = f"{counted(mission.robots, 'robot')} at {base}"
    handles: list[Artist] = [Line2D([], [], label=base, **square)]
    inks = kind_inks(mission)
    if site.has_ends:
        for kind, ends in zip(site.kinds, site.ends, strict=True):
            look = hollow | {"marker": _marker(kind), "color": inks[kind], "markersize": 8}
            look["markerfacecolor"] = inks[kind]
            handles.append(Line2D([], [], label=_team_text(mission, kind, *ends), **look))
    if len(site.depots):
        handles.append(Line2D([], [], label="depot", **inked | {"marker": "s"}))
    if len(site.returning) and not site.all_return:
        ring = inked | {"marker": _CIRCLES, "markersize": 11}
        handles.append(Line2D([], [], label="pays on return", **ring))
    if (np.delete(site.reward, site.base) == 0).any():
        handles.append(Line2D([], [], label="no reward", **circle))
    for kinds in {**only_some(site.survival > 0), **only_some(site.collects)}:
        names = " and ".join(mission.kinds[kind].name for kind in kinds)
        shade = [tint(inks[kind], _STRENGTH) for kind in kinds]
        hatch: dict[str, Any] = {"hatch": "||", "edgecolor": shade[1]} if len(kinds) > 1 else {}
        handles.append(Patch(facecolor=shade[0], label=f"only {names}", **hatch))
    return handles


def _team_text(mission: Mission, kind: int, start: int, end: int) -> str:
    of_kind = mission.kinds[kind]
    who = f"{of_kind.robots} {of_kind.name}"
    if len(mission.kinds) == 1:
        who = counted(of_kind.robots, "robot")
    first, last = mission.nodes[start], mission.nodes[end]
    return f"{who} at {first}" if start == end else f"{who} from {first} to {last}"


def _marker(kind: int) -> str:
    return _MARKERS[kind % len(_MARKERS)]


def _behind(
    canvas: Canvas, nodes: IntArray | list[int], radius: FloatArray | float, **style: Any
) -> None:
    """Draw marks of ``radius`` points behind nodes."""
    look: dict[str, Any] = {"linewidths": 0, "label": "_behind", "clip_on": False}
    x, y = canvas.xy[nodes].T
    canvas.ax.scatter(x, y, s=(2 * np.asarray(radius)) ** 2, **look | style)
