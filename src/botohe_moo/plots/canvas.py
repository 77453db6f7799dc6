"""Maps of missions: axes of a known scale, nodes, arcs, trails, what kinds can do, and names."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, IdentityTransform
from scipy.spatial import KDTree

from botohe_moo.base.messages import counted
from botohe_moo.base.types import BoolArray, FloatArray, IntArray
from botohe_moo.mission.model import Mission
from botohe_moo.plots import style as look
from botohe_moo.plots.site import Background, Site, node_positions, only_some
from botohe_moo.plots.style import Space

# Maps behind the graph are not to be darker than arcs, and white is to stay as it is.
_FAINT = LinearSegmentedColormap.from_list("faint", [(0.5, 0.5, 0.5, 0.0), (0.5, 0.5, 0.5, 0.5)])
_BEND = 0.07  # how far an arrow bows to its right, in parts of its length
_STEPS = np.linspace(0, 1, 17)[None, :, None]
_HEAD = Path([(0.6, 0.0), (-0.4, 0.45), (-0.4, -0.45), (0.6, 0.0)], closed=True)
_CIRCLES = Path.make_compound_path(Path.circle(radius=0.5), Path.circle(radius=0.33))

# On and off, in widths of the line. Five differ at a glance; then colours differ, and names.
_DASHES = ((), (5.0, 1.6), (1.2, 1.2), (6.0, 1.5, 1.2, 1.5), (2.6, 1.3))
_CYCLE = 10  # colours of the palette, after which they repeat
_LIGHTEST = 0.5  # luminance of a line on white paper
_APART = 24.0  # points walked between arrowheads on arcs that are too short for one each

_MARKERS = "^v<>"  # of kinds, since several may start at one node
_STRENGTH = 0.42  # of the colours of shades
# In radii of a node:
_BAND = 1.2  # width of the shade along an arc
_HALO = 1.7  # radius of the shade around a node
_RING = 1.32  # radius of a ring
_TRIANGLE = 1.55  # half the side of a triangle behind a node

NAMES = 8.0  # points: height of names beside nodes
FAR = 30.0  # points: how far a text may be from its node
MANY = 40  # nodes; the names of more stand in them or close to them

Trails = Sequence[Sequence[int]]  # of node indices of a mission
Span = tuple[float, float]


def frame_of(xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the centre of a map of the nodes at ``xy`` (n_nodes, 2), and half its sides."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    longest = float((high - low).max())
    # A path drawn as a straight line still needs room above and below it.
    half = np.maximum((high - low) / 2, 0.2 * longest) + 0.075 * longest
    return (low + high) / 2, half if longest else np.array([1.0, 0.4])


def open_axes(mission: Mission, ax: Axes | None, background: Background | None = None) -> Axes:
    """Prepare ``ax``, or a new figure of a fitting shape, for a map of a mission.

    The ``background`` is drawn as far as the nodes reach.
    """
    centre, half = frame_of(node_positions(mission))
    if ax is None:
        ax = look.new_axes(8.0, float(np.clip(6.6 * half[1] / half[0] + 1.0, 3.5, 8.0)))
    low, high = centre - half, centre + half
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    ax.set_axis_off()
    if background is not None:
        ax.imshow(background.shares, _FAINT, vmin=0, vmax=1, extent=background.extent, zorder=-1)
    return ax


def add_colour_bar(ax: Axes, colours: ScalarMappable, label: str, slot: int) -> None:
    """Put a colour bar right of ``ax``, as part of it: in the upper half (``slot`` 0) or lower."""
    bar = ax.inset_axes((1.02, 0.55 - 0.53 * slot, 0.022, 0.43))
    drawn = ax.figure.colorbar(colours, cax=bar, label=label)
    drawn.outline.set_visible(False)
    bar.yaxis.label.set_parse_math(True)  # the theme does not, for the sake of users' texts
    bar.tick_params(length=2.5)


def colour_by_value(
    ax: Axes, values: FloatArray, palette: Colormap, label: str, span: Span, slot: int
) -> FloatArray:
    """Add a colour bar for values from ``span[0]`` to ``span[1]``; return colours of ``values``.

    Shapes (n,) and (n, 4). Without values there is no bar.
    """
    if not len(values):
        return np.empty((0, 4))
    colours = ScalarMappable(Normalize(*span), palette)
    add_colour_bar(ax, colours, label, slot)  # which widens the range of equal values
    return np.asarray(colours.to_rgba(values))


def crowding(xy: FloatArray) -> float:
    """Return the distance that four of five nodes keep from the nearest other one."""
    return float(np.percentile(KDTree(xy).query(xy, k=2)[0][:, 1], 20)) if len(xy) > 1 else np.inf


def shifted(points: FloatArray, aside: FloatArray | float) -> FloatArray:
    """Move lines (n, n_points, 2) by ``aside`` to the right of the way from their start to end."""
    along = points[:, -1] - points[:, 0]
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    right /= np.maximum(np.hypot(*along.T), 1e-12)[:, None]
    return np.asarray(points + (right * np.asarray(aside)[..., None])[:, None])


class RobotStyle(NamedTuple):
    """How a robot is drawn, and what it is called on maps."""

    name: str
    colour: look.Colour
    dash: tuple[float, ...]  # empty for a solid line

    def key(self, text: str) -> Line2D:
        """Return the robot's line, for a legend."""
        dash: Any = 0.0, self.dash or None
        return Line2D([], [], color=self.colour, linestyle=dash, linewidth=2.4, label=text)


def robot_styles(mission: Mission) -> list[RobotStyle]:
    """Return a name, a colour and a dash for each robot.

    If there are several kinds, each has a colour, and its robots differ in dash: "drone 0". Else
    fifty pairs of colour and dash differ, and robots are R0, R1, ...
    """
    inks: list[look.Colour] = []
    numbers: list[int] = []
    if len(mission.kinds) > 1:
        names = [f"{kind.name} {i}" for i, kind in enumerate(mission.kind_of)]
        for ink, kind in zip(kind_inks(mission), mission.kinds, strict=True):
            inks += [ink] * kind.robots
            numbers += range(kind.robots)
    else:
        team = range(mission.robots)
        names, numbers = [f"R{i}" for i in team], [i + i // _CYCLE for i in team]
        inks = [_as_ink(colour) for colour in look.colours(mission.robots)]
    dashes = [_DASHES[i % len(_DASHES)] for i in numbers]
    return list(map(RobotStyle, names, inks, dashes))


def kind_inks(mission: Mission) -> list[look.Colour]:
    """Return the colour of each kind of robots."""
    return [_as_ink(colour) for colour in look.colours(len(mission.kinds))]


def _as_ink(colour: look.Colour) -> look.Colour:
    """Darken a colour that would be too light for a line on white."""
    factor = min(1.0, _LIGHTEST / look.luminance(colour)) ** (1 / 2.2)
    red, green, blue = (part * factor for part in colour)
    return red, green, blue


class Canvas:
    """A mission on axes whose scale is known, so that sizes in points fit distances on the map.

    The axes have their limits, legend and colour bars already. ``scale`` is points per data unit,
    ``radius`` that of a node in points, ``spacing`` the points between most nodes and the nearest
    other one.
    """

    def __init__(self, ax: Axes, mission: Mission, site: Site, *, smallest: float = 3.8) -> None:
        self.ax, self.mission, self.site, self.xy = ax, mission, site, node_positions(mission)
        root = ax.figure.figure
        if (engine := root.get_layout_engine()) is not None:
            engine.execute(root)
        ax.apply_aspect()
        left, right = ax.get_xlim()
        self.scale = ax.get_window_extent().width / root.dpi * 72 / (right - left)
        self.spacing = crowding(self.xy) * self.scale
        self.radius = float(np.clip(0.36 * self.spacing, smallest, 10.5))

    def curves(self, tail: IntArray, head: IntArray, bowed: BoolArray | bool) -> FloatArray:
        """Return points along arcs (n, n_points, 2): straight, or ``bowed`` to the right."""
        start, end = self.xy[tail][:, None], self.xy[head][:, None]
        along = end - start
        right = np.stack([along[..., 1], -along[..., 0]], axis=-1)
        bend = np.where(bowed, _BEND, 0.0)[..., None, None]
        return np.asarray(start + _STEPS * along + 4 * bend * _STEPS * (1 - _STEPS) * right)

    def draw_lines(self, points: FloatArray, **style: Any) -> None:
        """Draw one line through each row of ``points`` (n, n_points, 2)."""
        lines = LineCollection(list(points), capstyle="round", **style)
        self.ax.add_collection(lines, autolim=False)

    def draw_arrows(
        self, tail: IntArray, head: IntArray, colours: FloatArray, widths: FloatArray
    ) -> None:
        """Draw one arrow per arc, bowed to its right so that both directions are seen."""
        points = self.curves(tail, head, bowed=True)
        self.draw_lines(points, colors=colours, linewidths=widths, zorder=1, label="_arrows")
        sizes = np.minimum(2.4 + 2.4 * widths, 1.1 * self.radius + widths)
        at, along = points[:, _STEPS.size // 2], self.xy[head] - self.xy[tail]
        # The quadratic curve runs parallel to its chord half-way.
        self.draw_heads(at, along, sizes, facecolors=colours, zorder=1, label="_heads")

    def draw_heads(
        self, at: FloatArray, towards: FloatArray, sizes: FloatArray, **style: Any
    ) -> None:
        """Draw arrowheads of ``sizes`` points, centred ``at`` data points."""
        angles = np.arctan2(towards[:, 1], towards[:, 0])
        heads = [_HEAD.transformed(Affine2D().rotate(angle)) for angle in angles]
        style |= {"offsets": at, "offset_transform": self.ax.transData, "linewidths": 0}
        drawn = PathCollection(heads, sizes=sizes**2, **style)
        drawn.set_transform(IdentityTransform())
        self.ax.add_collection(drawn, autolim=False)

    def mark(self, nodes: IntArray | list[int], radii: FloatArray | float, **style: Any) -> None:
        """Draw a mark of ``radii`` points at each of the nodes, circles without rims by default."""
        x, y = self.xy[nodes].T
        default: look.Style = {"linewidths": 0, "label": "_behind", "clip_on": False}
        self.ax.scatter(x, y, s=(2 * np.asarray(radii)) ** 2, **default | style)

    def draw_nodes(self, fills: FloatArray, radii: FloatArray, edges: Sequence[str]) -> None:
        """Draw circles of ``radii`` points, the largest on top, and base and depots as squares.

        Behind them are triangles at starts and, hollow, at ends; and rings if a node pays on
        return. Shapes are (n_nodes, 4), (n_nodes,) and (n_nodes,).
        """
        site = self.site
        self._mark_places(radii)
        by_size = np.argsort(radii, kind="stable")
        by_size = by_size[(by_size != site.base) & (radii[by_size] > 0)]
        is_depot = np.isin(by_size, site.depots)
        depots, others = by_size[is_depot], by_size[~is_depot]
        for nodes, marker, name in ((others, "o", "_nodes"), (depots, "s", "_depots")):
            if len(nodes) or marker == "o":
                style = {"c": fills[nodes], "edgecolors": [edges[i] for i in nodes], "zorder": 4}
                rims = np.minimum(0.7, 0.2 * radii[nodes])
                self.mark(nodes, radii[nodes], **style, marker=marker, linewidths=rims, label=name)
        style = {"c": fills[[site.base]], "edgecolors": "black", "linewidths": 1.6, "zorder": 5}
        self.mark([site.base], max(self.radius, 4.0), **style, marker="s", label="_base")

    def _mark_places(self, radii: FloatArray) -> None:
        site = self.site
        if len(site.returning) and not site.all_return:
            ring = {"facecolor": "white", "edgecolor": look.INK, "linewidths": 0.6}
            wide = _RING * radii[site.returning]
            self.mark(site.returning, wide, zorder=3.9, label="_rings", **ring)
        if not site.has_ends:
            return
        inks, half = kind_inks(self.mission), max(_TRIANGLE * self.radius, 6.5)
        for kind, (start, end) in zip(site.kinds, site.ends, strict=True):
            marker = _MARKERS[kind % len(_MARKERS)]
            rim = {"marker": marker, "edgecolor": inks[kind], "linewidths": 1.4}
            self.mark([start], half, zorder=1.6, facecolor=inks[kind], label="_start", **rim)
            if end != start:
                self.mark([end], half, zorder=1.5, facecolor="white", label="_end", **rim)

    def shade_kinds(self) -> None:
        """Shade arcs and nodes that only some kinds can take or collect, in their colours."""
        site, shades = self.site, [look.tint(ink, _STRENGTH) for ink in kind_inks(self.mission)]
        points = self.curves(site.tail, site.head, site.bowed)
        for kinds, arcs in only_some(site.survival > 0).items():
            width = _BAND * self.radius / len(kinds)
            for i, kind in enumerate(kinds):
                aside = (i - (len(kinds) - 1) / 2) * width / self.scale
                band, colour = shifted(points[arcs & site.once], aside), [shades[kind]]
                self.draw_lines(band, colors=colour, linewidths=width, zorder=0.5, label="_only")
        for kinds, nodes in only_some(site.collects).items():
            for i, kind in enumerate(kinds):
                radius = self.radius * (1 + (_HALO - 1) * (1 - i / len(kinds)))
                self.mark(np.flatnonzero(nodes), radius, zorder=0.6, color=[shades[kind]])

    def draw_named_nodes(self, fills: FloatArray, arcs: FloatArray) -> list[str]:
        """Draw and name all nodes, and return notes; ``arcs`` (n, 2) are points of arcs.

        A node without reward has a grey rim.
        """
        edges = [look.INK if reward > 0 else look.MUTED for reward in self.site.reward]
        self.draw_nodes(fills, np.full(len(edges), self.radius), edges)
        space = Space(self.ax, self.xy, self.radius, arcs)
        names = dict(enumerate(map(str, self.mission.nodes)))
        return self.label_nodes(space, names, fills, reach=FAR if len(names) <= MANY else 0.0)

    def label_nodes(
        self,
        space: Space,
        texts: Mapping[int, str],
        fills: FloatArray,
        *,
        size: float = NAMES,
        reach: float = FAR,
        what: str = "names of nodes",
    ) -> list[str]:
        """Write texts into nodes, or up to ``reach`` points beside them; note if some are missing.

        Without ``reach`` texts are only written into nodes.
        """
        missing = 0
        for node, text in texts.items():
            at = self.xy[node]
            if not space.write_inside(at, text, fills[node]):
                missing += not (reach and space.write_beside(at, text, size, reach=reach))
        return [f"no room for some {what}"] if missing else []

    def draw_trails(self, trails: Trails, styles: Sequence[RobotStyle]) -> FloatArray:
        """Draw trails on the right-hand side of their arcs, side by side, with arrowheads.

        Returns the points of each passage (n_passages, n_points, 2), in the order of the trails.
        """
        passages = _passages(trails)
        if not passages:
            return np.empty((0, 0, 2))
        robot, tail, head, lane = np.array(passages, dtype=np.int32).T
        # The lanes of an arc should fit under the nodes at its ends, as long as they stay legible.
        gap = float(np.clip(self.radius / (lane.max() + 0.5), 1.9, 3.2))
        width = 0.75 * gap
        points = shifted(self.curves(tail, head, bowed=False), (lane + 0.5) * gap / self.scale)
        along = self.xy[head] - self.xy[tail]
        length = np.maximum(np.hypot(*along.T), 1e-12) * self.scale
        ink = np.array([style.colour for style in styles])[robot]
        # How far the robot of each passage has walked before it; robots are in order.
        walked = np.cumsum(length) - length
        walked -= walked[np.searchsorted(robot, robot)]
        # Dashes go on where the robot's last passage ended.
        dashes = zip(walked.tolist(), (styles[i].dash for i in robot), strict=True)
        lines = [(way / width % sum(on), on) if on else (0.0, None) for way, on in dashes]
        self.draw_lines(points, colors="white", linewidths=width + 1.2, zorder=2, label="_casing")
        style: look.Style = {"colors": ink, "linewidths": width, "linestyles": lines}
        self.draw_lines(points, **style, zorder=3, label="_trails")
        sizes = np.minimum(np.clip(1.3 * self.radius, 5.5, 8.0), (length - 2 * self.radius) / 2.2)
        # Of arcs that are too short for an arrowhead each, some have one.
        is_short = sizes <= 3.0
        sizes[is_short] = 6.0
        shown = ~is_short | ((walked + length) // _APART > walked // _APART)
        # Beyond the middle, so that those of opposite and neighbouring lanes do not meet.
        at = points[np.arange(len(points)), _STEPS.size // 2 + 1 + 2 * (lane % 2)]
        heads: look.Style = {"facecolors": ink[shown], "zorder": 3, "label": "_trail heads"}
        self.draw_heads(at[shown], along[shown], sizes[shown], **heads)
        return points


def _passages(trails: Trails) -> list[tuple[int, int, int, int]]:
    """Return robot, tail, head and lane: how many robots have taken the arc before."""
    taken: Counter[tuple[int, int]] = Counter()
    passages = []
    for robot, trail in enumerate(trails):
        for arc in pairwise(trail):
            passages.append((robot, *arc, taken[arc]))
            taken[arc] += 1
    return passages


def place_handles(mission: Mission, site: Site) -> list[Artist]:
    """Return the keys of the team, of where it starts, and of nodes and arcs, for a legend."""

    def mark(label: str, marker: Any, edge: Any, width: float, **more: Any) -> Line2D:
        style = {"marker": marker, "markeredgecolor": edge, "markeredgewidth": width}
        style |= {"linestyle": "none", "markerfacecolor": "white", "markersize": 9}
        return Line2D([], [], label=label, **style | more)

    at = "" if site.has_ends else f"{counted(mission.robots, 'robot')} at "
    handles: list[Artist] = [mark(f"{at}base {mission.base}", "s", "black", 2)]
    inks = kind_inks(mission)
    if site.has_ends:
        for kind, ends in zip(site.kinds, site.ends, strict=True):
            start, end = (mission.nodes[node] for node in ends)
            way = f"at {start}" if start == end else f"from {start} to {end}"
            team = f"{mission.kinds[kind].name}: {mission.kinds[kind].robots} {way}"
            fill = {"markerfacecolor": inks[kind], "markersize": 8}
            handles.append(mark(team, _MARKERS[kind % len(_MARKERS)], inks[kind], 1, **fill))
    if len(site.depots):
        handles.append(mark("depot", "s", look.INK, 0.8))
    if len(site.returning) and not site.all_return:
        handles.append(mark("pays on return", _CIRCLES, look.INK, 0.8, markersize=11))
    if (np.delete(site.reward, site.base) == 0).any():
        handles.append(mark("no reward", "o", look.MUTED, 1.1))
    for kinds in {**only_some(site.survival > 0), **only_some(site.collects)}:
        names = " and ".join(mission.kinds[kind].name for kind in kinds)
        shade = [look.tint(inks[kind], _STRENGTH) for kind in kinds]
        colours: look.Style = {"facecolor": shade[0], "edgecolor": shade[-1], "linewidth": 2}
        handles.append(Patch(label=f"only {names}", **colours))
    return handles
