"""Maps of plans: grey ground, trails, nodes shaded by how likely they are reached, and texts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from botohe_moo._base.types import FloatArray
from botohe_moo.mission import Mission
from botohe_moo.plots.draw.canvas import MAX_LABELLED, Canvas
from botohe_moo.plots.draw.space import PAD, Space, text_size, write_beside
from botohe_moo.plots.draw.style import INK, MUTED, reach_palette, readable_on
from botohe_moo.plots.draw.trails import RobotStyle, draw_trails
from botohe_moo.trails import TrailPlan

_GROUND = "#c9c9c9"
_SMALLEST = 1.6  # points: radius of a node on a trail
_LEGIBLE = 2.2  # points: radius of a node from which on arcs off the trails are drawn
_DOTS = 1.5  # points between nodes from which on those off the trails are drawn at all
_INSIDE, _BESIDE, _NAMES = 5.8, 6.5, 8.0  # points of letters: least in a node, numbers, names
_STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_FAR, _NEAR = 30.0, 1.5  # points that texts may stand away from few nodes, and from many
_SPOTS = 60  # where a robot's name may stand, on a part of its trail
_LINE = 10  # columns of numbers beside a node before a new line


@dataclass(frozen=True)
class PlanMap:
    """A map of trails that is drawn, to be written on."""

    canvas: Canvas
    points: FloatArray  # of each passage (n_passages, n_points, 2)
    fills: NDArray[Any]  # colours of the nodes (n_nodes, 4)
    space: Space
    notes: list[str]  # what has to be said about it

    def name_nodes(self, mission: Mission, plan: TrailPlan) -> int:
        """Write the names of nodes into or beside them, first of those visited; give how many fit.

        Names of many nodes stand close to them, so that it is clear which node each belongs to.
        """
        named = [str(label) for label in mission.nodes]
        sizes = [self._inside(text) for text in named]
        n_nodes, written = len(named), 0
        far = _FAR if n_nodes <= MAX_LABELLED else _NEAR if self.canvas.radius >= _LEGIBLE else 0.0
        away = np.ones(n_nodes, dtype=bool)
        away[plan.nodes] = False
        for node in np.argsort(away, kind="stable").tolist():
            text, size, offset = named[node], sizes[node], np.zeros(2)
            if not size and far:
                beside = self._beside(self.space, node, text, _NAMES, reach=far)
                size, offset = (0.0, offset) if beside is None else (_NAMES, beside)
            if size:
                self._write(node, text, offset, size, "node name")
                written += 1
        return written

    def number_visits(self, trail: Sequence[int]) -> int:
        """Write the numbers of visits, from 1 after the base: of all, or of as many as have room.

        Give 1 if all are numbered, or k if every k-th is; 0 if there is no room for any.
        """
        visits: dict[int, list[int]] = {}
        for i, node in enumerate(trail[1:], start=1):
            visits.setdefault(node, []).append(i)
        for step in _STEPS:
            room, placed = self.space.copy(), []
            chosen = {v: [str(i) for i in ns if i % step == 0] for v, ns in visits.items()}
            # The longest first: they find room the least.
            for node, shown in sorted(chosen.items(), key=lambda item: -len(item[1])):
                if not shown:
                    continue
                found = self._place_numbers(room, node, shown)
                if found is None:
                    break
                placed.append((node, *found))
            else:
                for node, text, offset, size in placed:
                    self._write(node, text, offset, size, "visits")
                return step if placed else 0
        return 0

    def name_robots(self, plan: TrailPlan, styles: Sequence[RobotStyle]) -> None:
        """Write the names of robots on their trails, up to three times on long ones."""
        own = np.split(self.points, np.cumsum(np.diff(plan.offsets) - 1)[:-1])
        for style, passages in zip(styles, own, strict=True):
            for part in np.array_split(passages, min(3, -(-len(passages) // 8)) or 1):
                if len(part):
                    self._name_robot(style, part)

    def _name_robot(self, style: RobotStyle, passages: FloatArray) -> None:
        """Write a robot's name on one of these passages, or else right beside one."""
        width, height = text_size(style.name, 7.0)
        at = passages[:, 4:13:2].reshape(-1, 2) * self.canvas.scale
        along = (passages[:, -1] - passages[:, 0]).repeat(5, axis=0)
        along /= np.maximum(np.hypot(*along.T), 1e-12)[:, None]
        aside = np.column_stack([along[:, 1], -along[:, 0]]) * (width / 2 + 5)
        step = -(-len(at) // _SPOTS)
        for spots in (at, np.concatenate([at + aside, at - aside])):
            found = self.space.place(spots[::step], width + 4, height + 2)
            if found is not None:
                frame = {"boxstyle": "round,pad=0.18", "fc": "white", "ec": style.colour}
                look: dict[str, Any] = {"fontsize": 7.0, "fontweight": "bold", "bbox": frame}
                look |= {"ha": "center", "va": "center_baseline", "zorder": 7, "label": "_robot"}
                x, y = found / self.canvas.scale
                self.canvas.ax.text(x, y, style.name, **look)
                return

    def _place_numbers(
        self, room: Space, node: int, numbers: Sequence[str]
    ) -> tuple[str, FloatArray, float] | None:
        text = ", ".join(numbers)
        if size := self._inside(text):
            return text, np.zeros(2), size
        lines = [""]
        for number in numbers:
            if lines[-1] and len(lines[-1]) + len(number) + 2 > _LINE:
                lines.append("")
            lines[-1] += f"{number}, "
        for told in (text, "\n".join(lines).replace(", \n", ",\n").removesuffix(", ")):
            offset = self._beside(room, node, told, _BESIDE)
            if offset is not None:
                return told, offset, _BESIDE
        return None

    def _inside(self, text: str) -> float:
        """Give the size of letters in which a text fits into a node; 0 if it does not."""
        room = 1.75 * self.canvas.radius
        size = min(9.0, 0.6 * room, room / max(text_size(text, 1.0)[0], 1e-9))
        return size if size >= _INSIDE else 0.0

    def _beside(
        self, room: Space, node: int, text: str, size: float, *, reach: float = _FAR
    ) -> FloatArray | None:
        return room.beside(self.canvas.xy[node] * self.canvas.scale, text, size, reach=reach)

    def _write(self, node: int, text: str, offset: FloatArray, size: float, name: str) -> None:
        colour = INK if offset.any() else readable_on(self.fills[node])
        look: dict[str, Any] = {"radius": self.canvas.radius, "color": colour, "fontsize": size}
        write_beside(self.canvas.ax, self.canvas.xy[node], offset, text, label=f"_{name}", **look)


def name_room(mission: Mission) -> float:
    """Give the points between nodes at which most of their names have room beside each other."""
    widths = [text_size(str(node), _NAMES)[0] for node in mission.nodes]
    return float(np.percentile(widths, 80)) + 2 * PAD


def draw_map(
    ax: Axes,
    mission: Mission,
    xy: FloatArray,
    plan: TrailPlan,
    styles: Sequence[RobotStyle],
    reach: FloatArray,
) -> PlanMap:
    """Draw trails, and nodes shaded by the probabilities ``reach`` (n_nodes) on grey ground.

    The plan may have fewer trails than the team has robots.
    """
    canvas = Canvas.measure(ax, xy, smallest=_SMALLEST)
    fills = np.asarray(reach_palette()(reach))
    fills[reach == 0] = 1.0
    notes = []
    if canvas.radius >= _LEGIBLE:
        if _draw_ground(canvas, mission):
            notes.append("grey arrows: one way only")
        _draw_nodes(canvas, reach == 0, fills, 0.8 * canvas.radius, MUTED, "others")
    elif canvas.spacing >= _DOTS:
        notes.append("arcs off the trails are too small to draw")
        dots = np.full_like(fills, 0.82)
        _draw_nodes(canvas, reach == 0, dots, 0.25 * canvas.spacing, "none", "others")
    else:
        notes.append("nodes and arcs off the trails are too small to draw")
    points = draw_trails(canvas, plan, styles)
    away = np.arange(len(xy)) != mission.arrays.base
    _draw_nodes(canvas, (reach > 0) & away, fills, canvas.radius, INK, "nodes")
    square: dict[str, Any] = {"marker": "s", "edgecolors": "black", "linewidths": 1.4, "zorder": 5}
    size = (2 * max(canvas.radius, 4.0)) ** 2
    (x, y) = xy[~away].T
    ax.scatter(x, y, s=size, facecolors=fills[~away], **square, label="_base")
    drawn = (reach > 0) | (canvas.radius >= _LEGIBLE)
    low, high = np.array([ax.get_xlim(), ax.get_ylim()]).T * canvas.scale
    lines = points[:, ::2].reshape(-1, 2) * canvas.scale
    space = Space(xy[drawn] * canvas.scale, canvas.radius, (low, high), lines)
    return PlanMap(canvas, points, fills, space, notes)


def _draw_ground(canvas: Canvas, mission: Mission) -> bool:
    """Draw arcs in grey: lines that can be walked both ways, and arrows, if any, for one way."""
    arrays = mission.arrays
    arcs = list(zip(arrays.tail.tolist(), arrays.head.tolist(), strict=True))
    known = set(arcs)
    both = [(u, v) for u, v in arcs if u < v and (v, u) in known]
    once = [(u, v) for u, v in arcs if (v, u) not in known]
    for pairs, name in ((both, "both ways"), (once, "one way")):
        tail, head = np.array(pairs, dtype=np.int32).reshape(-1, 2).T
        points = canvas.curves(tail, head, np.zeros(len(tail), dtype=bool))
        canvas.draw_lines(points, colors=_GROUND, linewidths=0.9, zorder=1, label=f"_{name}")
    if once:
        # Before the middle, where the arrowheads of trails are.
        along, at = points[:, -1] - points[:, 0], points[:, points.shape[1] // 3]
        sizes = np.full(len(once), 6.0)
        canvas.draw_heads(at, along, colours=[MUTED], sizes=sizes, zorder=1, label="_ways")
    return bool(once)


def _draw_nodes(
    canvas: Canvas,
    chosen: NDArray[np.bool_],
    fills: NDArray[Any],
    radius: float,
    edge: str,
    name: str,
) -> None:
    x, y = canvas.xy[chosen].T
    look: dict[str, Any] = {"facecolors": fills[chosen], "edgecolors": edge, "zorder": 4}
    canvas.ax.scatter(
        x, y, s=(2 * radius) ** 2, linewidths=min(0.6, 0.2 * radius), **look, label=f"_{name}"
    )
