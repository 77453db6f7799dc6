"""Maps of plans: sheets of them, grey ground, trails, shaded nodes, and texts."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba
from matplotlib.lines import Line2D

from botohe_moo.base.types import FloatArray
from botohe_moo.mission import Mission
from botohe_moo.plots.draw.background import Background
from botohe_moo.plots.draw.canvas import Canvas, add_colour_bar, crowding, frame_of, open_axes
from botohe_moo.plots.draw.kinds import mark_places
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.site import Site, site_of
from botohe_moo.plots.draw.style import INK, MUTED, REACH
from botohe_moo.plots.draw.texts import Space, text_size, title_above
from botohe_moo.plots.draw.trails import RobotStyle, Trails, draw_trails

_GROUND = "#c9c9c9"

# In points:
_SMALLEST = 1.6  # least radius of a node on a trail
_LEGIBLE = 2.2  # least radius of a node for arcs off the trails to be drawn
_DOTS = 1.5  # least distance between nodes for those off the trails to be drawn
_NUMBERS = 6.5  # height of numbers beside nodes
_NAMES = 8.0  # height of names beside nodes
_FAR = 30.0  # how far a text may be from its node
_NEAR = 1.5  # the same for the names of many nodes
_ROOM = 20.0  # distance between most nodes at which numbers have room

# In inches:
_NAME = 0.34  # height of the name over each map
_ABOVE = 0.8  # height of the title over all maps
_RIGHT = 0.95  # width of the key right of all maps
_GAP = 0.15  # between maps

_MANY = 40  # nodes; the names of more stand close to them
_SPOTS = 60  # most places that are tried for a robot's name on a part of its trail
_LINE = 14  # most letters in a line of numbers beside a node
_SHAPE = 1.4  # the preferred width of a figure, divided by its height
_EMPTY = 0.25  # what a place costs when the shape is chosen, so that few stay empty


def open_sheet(
    mission: Mission,
    n_small: int,
    span: int,
    background: Background | None = None,
    *,
    widest: float = 5.2,
    room: float = 0.0,
) -> list[Axes]:
    """Open a figure with large axes, ``span`` times as wide and high as the maps beside them.

    On the small maps most nodes are ``room`` points apart, or as far as numbers need, unless a map
    would be wider than ``widest`` inches.
    """
    xy = node_positions(mission)
    _, half = frame_of(xy)
    # In points, on a map an inch wide; nodes may lie on each other.
    spacing = max(72 * crowding(xy) / (2 * half[0]), 1e-9)
    inner = float(np.clip(max(room, _ROOM) / spacing, 4.2, widest))
    wide, high = inner + _GAP, inner * half[1] / half[0] + _NAME
    cells = n_small + span**2

    def cost(shape: tuple[int, int]) -> float:
        n_columns, n_rows = shape
        distance = abs(np.log(wide * n_columns / (high * n_rows) / _SHAPE))
        return float(distance + _EMPTY * n_columns * n_rows)

    shapes = [(n, max(span, -(-cells // n))) for n in range(span, cells + 1)]
    n_columns, n_rows = min(shapes, key=cost)
    width, height = n_columns * wide + _RIGHT, _ABOVE + n_rows * high
    fig = plt.figure(figsize=(width, height))
    # Every cell has a name above it, so the highest ones begin below that.
    grid = fig.add_gridspec(
        n_rows,
        n_columns,
        left=0.1 / width,
        right=1 - (_RIGHT + _GAP - 0.1) / width,
        bottom=0.1 / height,
        top=1 - (_ABOVE + _NAME - 0.1) / height,
        wspace=_GAP / inner,
        hspace=_NAME / (high - _NAME),
    )
    places = [(i, j) for i, j in np.ndindex(n_rows, n_columns) if max(i, j) >= span][:n_small]
    cells_of_maps = [grid[:span, :span], *(grid[place] for place in places)]
    axes = [fig.add_subplot(cell) for cell in cells_of_maps]
    for ax in axes[1:]:
        open_axes(xy, ax, background)
    return axes


def title_sheet(first: Axes, title: str, words: str) -> None:
    """Write title and words above all maps."""
    width = first.figure.figure.get_figwidth() - _RIGHT
    title_above(first, title, words, width=width, lift=72 * _NAME)


def add_reach_bar(*maps: Axes) -> None:
    """Put the key of the nodes' shades right of the highest of the rightmost maps."""
    ax = max(maps, key=lambda ax: (round(ax.get_position().x1, 6), ax.get_position().y1))
    add_colour_bar(ax, ScalarMappable(Normalize(0, 1), REACH), "probability of being reached")


def key_of(text: str, style: RobotStyle) -> Line2D:
    """Return the line of a robot, for a legend."""
    dash: Any = 0.0, style.dash or None
    return Line2D([], [], color=style.colour, linestyle=dash, linewidth=2.4, label=text)


def name_map(ax: Axes, text: str, style: RobotStyle | None = None) -> None:
    """Name a map above its upper left corner, with the line of its robot."""
    key = Line2D([], [], linestyle="none", label=text) if style is None else key_of(text, style)
    ax.legend(
        handles=[key],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        borderaxespad=0.1,
        borderpad=0.2,
        handlelength=0.0 if style is None else 2.4,
        handletextpad=0.0 if style is None else 0.8,
        fontsize=9.5,
        frameon=False,
    )


class PlanMap:
    """A map of trails, and of nodes shaded by how likely they are reached, on grey ground.

    There are trails of some robots, in the mission's node indices, with a style for each, and
    ``reach`` (n_nodes) are the probabilities. ``notes`` are what has to be said about the map.
    """

    def __init__(
        self,
        ax: Axes,
        mission: Mission,
        trails: Trails,
        styles: Sequence[RobotStyle],
        reach: FloatArray,
    ) -> None:
        xy, site = node_positions(mission), site_of(mission)
        self.mission, self.trails, self.styles = mission, trails, styles
        self.canvas = canvas = Canvas.measure(ax, xy, smallest=_SMALLEST)
        self.fills = np.asarray(REACH(reach))
        self.notes = layout_notes(mission)
        self.is_legible = canvas.radius >= _LEGIBLE
        if self.is_legible:
            away, edge = 0.8 * canvas.radius, MUTED
            if _draw_ground(canvas, site):
                self.notes.append("grey arrows: one way only")
        else:
            away, edge = 0.25 * canvas.spacing if canvas.spacing >= _DOTS else 0.0, _GROUND
            self.fills[reach == 0] = to_rgba(edge)
            missing = "arcs" if away else "nodes and arcs"
            self.notes.append(f"{missing} off the trails are too small to draw")
        self.points = draw_trails(canvas, trails, styles)  # (n_passages, n_points, 2)
        radii = np.where(reach > 0, canvas.radius, away)
        mark_places(canvas, mission, site, radii)
        edges = [INK if there else edge for there in reach > 0]
        canvas.draw_nodes(site.base, self.fills, radii=radii, edges=edges, depots=site.depots)
        drawn = (reach > 0) | self.is_legible
        self.space = Space(ax, xy[drawn], canvas.radius, self.points[:, ::2])

    def name_nodes(self) -> None:
        """Write the names of nodes into or beside them, first of those visited.

        Names of many nodes stand close to them, so that it is clear which node each belongs to.
        """
        visited = sorted({node for trail in self.trails for node in trail})
        order = list(dict.fromkeys([*visited, *range(len(self.fills))]))
        far = _FAR if len(order) <= _MANY else _NEAR if self.is_legible else 0.0
        names = {node: str(self.mission.nodes[node]) for node in order}
        self.notes += label_nodes(self.space, self.canvas.xy, names, self.fills, reach=far)

    def number_visits(self) -> list[str]:
        """Write the numbers of the only robot's visits, from 1 after the base; return notes."""
        if not self.is_legible:
            return ["too small to number"]
        (trail,) = self.trails
        visits: dict[int, list[str]] = {}
        for i, node in enumerate(trail[1:], start=1):
            visits.setdefault(node, []).append(str(i))
        texts = {node: fill(", ".join(numbers), _LINE) for node, numbers in visits.items()}
        longest_first = dict(sorted(texts.items(), key=lambda item: -len(item[1])))
        return label_nodes(
            self.space,
            self.canvas.xy,
            longest_first,
            self.fills,
            size=_NUMBERS,
            reach=_FAR,
            what="numbers",
        )

    def name_robots(self) -> None:
        """Write the names of robots on their trails, up to three times on long ones."""
        stops = np.cumsum([len(trail) - 1 for trail in self.trails])
        parts = np.split(self.points, stops[:-1])
        for style, passages in zip(self.styles, parts, strict=True):
            for part in np.array_split(passages, min(3, -(-len(passages) // 8)) or 1):
                if len(part):
                    self._name_robot(style, part)

    def _name_robot(self, style: RobotStyle, passages: FloatArray) -> None:
        """Write a robot's name on one of these passages, or else right beside one."""
        width, height = text_size(style.name, 7.0)
        on = passages[:, 4:13:2].reshape(-1, 2)
        on = on[:: -(-len(on) // _SPOTS)]
        aside = (width / 2 + 5) / self.canvas.scale * np.array([(0, 0), (1, 0), (-1, 0), (0, 1)])
        at = (on + aside[:, None]).reshape(-1, 2)
        costs = np.where(np.arange(len(at)) < len(on), 0.0, 1e6)
        best = self.space.place(self.space.in_points(at), width + 4, height + 2, costs)
        if best is not None:
            x, y = at[best]
            self.canvas.ax.text(
                x,
                y,
                style.name,
                fontsize=7.0,
                fontweight="bold",
                ha="center",
                va="center_baseline",
                bbox={"boxstyle": "round,pad=0.18", "fc": "white", "ec": style.colour},
                zorder=7,
                label="_robot",
            )


def name_room(mission: Mission) -> float:
    """Return the points between nodes at which most of their names have room."""
    widths = [text_size(str(node), _NAMES)[0] for node in mission.nodes]
    return float(np.percentile(widths, 80)) + 4.0


def label_nodes(
    space: Space,
    xy: FloatArray,
    texts: Mapping[int, str],
    fills: FloatArray,
    *,
    size: float = _NAMES,
    reach: float = 0.0,
    what: str = "names of nodes",
) -> list[str]:
    """Write texts into nodes, or up to ``reach`` points beside them, and note if some are missing.

    Without ``reach`` texts are only written into nodes.
    """
    missing = 0
    for node, text in texts.items():
        is_inside = space.write_inside(xy[node], text, fills[node])
        if not is_inside and not (reach and space.write_beside(xy[node], text, size, reach=reach)):
            missing += 1
    return [f"no room for {'some' if missing < len(texts) else 'the'} {what}"] if missing else []


def draw_named_nodes(
    canvas: Canvas, mission: Mission, site: Site, fills: FloatArray, arcs: FloatArray
) -> list[str]:
    """Draw and name all nodes of a mission, and return notes; ``arcs`` (n, 2) are points of arcs.

    A node without reward has a grey rim.
    """
    edges = [INK if reward > 0 else MUTED for reward in site.reward]
    radii = np.full(len(edges), canvas.radius)
    mark_places(canvas, mission, site, radii)
    canvas.draw_nodes(site.base, fills, radii=radii, edges=edges, depots=site.depots)
    space = Space(canvas.ax, canvas.xy, canvas.radius, arcs)
    names = dict(enumerate(map(str, mission.nodes)))
    return label_nodes(space, canvas.xy, names, fills, reach=_FAR if len(names) <= _MANY else 0.0)


def _draw_ground(canvas: Canvas, site: Site) -> bool:
    """Draw arcs in grey: lines that can be walked both ways, and arrows, if any, for one way."""
    points = canvas.curves(site.tail, site.head, bowed=False)
    both = points[(site.reverse >= 0) & (site.tail < site.head)]
    once = points[site.reverse < 0]
    for points, name in ((both, "both ways"), (once, "one way")):
        canvas.draw_lines(points, colors=_GROUND, linewidths=0.9, zorder=1, label=f"_{name}")
    if len(once):
        # Before the middle, where the arrowheads of trails are.
        canvas.draw_heads(
            once[:, once.shape[1] // 3],
            once[:, -1] - once[:, 0],
            colours=[MUTED],
            sizes=np.full(len(once), 6.0),
            zorder=1,
            label="_ways",
        )
    return len(once) > 0
