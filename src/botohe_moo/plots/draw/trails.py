"""Trails on a map: one line a robot, side by side where robots share an arc, with arrowheads."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray
from botohe_moo.mission import Mission
from botohe_moo.plots.draw.canvas import Canvas, shifted
from botohe_moo.plots.draw.site import robot_names
from botohe_moo.plots.draw.style import Colour, colours, luminance

Trails = Sequence[Sequence[int]]  # of node indices of a mission

# On and off, in widths of the line. Five differ at a glance; then colours differ, and names.
_DASHES = ((), (5.0, 1.6), (1.2, 1.2), (6.0, 1.5, 1.2, 1.5), (2.6, 1.3))
_CYCLE = 10  # colours of the palette, after which they repeat
_LIGHTEST = 0.5  # luminance of a line on white paper
_APART = 24.0  # points walked between arrowheads on arcs that are too short for one each


@dataclass(frozen=True)
class RobotStyle:
    """How a robot is drawn, and what it is called on maps."""

    name: str
    colour: Colour
    dash: tuple[float, ...]  # empty for a solid line


def robot_styles(mission: Mission) -> list[RobotStyle]:
    """Return a name, a colour and a dash for each robot.

    If there are several kinds, each has a colour, and its robots differ in dash: "drone 0". Else
    fifty pairs of colour and dash differ, and robots are R0, R1, ...
    """
    if len(mission.kinds) > 1:
        inks, names = kind_inks(mission), robot_names(mission)
        of = [(ink, i) for ink, k in zip(inks, mission.kinds, strict=True) for i in range(k.robots)]
        looks = [(ink, _DASHES[i % len(_DASHES)]) for ink, i in of]
        return [RobotStyle(name, *look) for name, look in zip(names, looks, strict=True)]
    return [
        RobotStyle(f"R{i}", _as_ink(colour), _DASHES[(i + i // _CYCLE) % len(_DASHES)])
        for i, colour in enumerate(colours(mission.robots))
    ]


def kind_inks(mission: Mission) -> list[Colour]:
    """Return the colour of each kind of robots."""
    return [_as_ink(colour) for colour in colours(len(mission.kinds))]


def _as_ink(colour: Colour) -> Colour:
    """Darken a colour that would be too light for a line on white."""
    factor = min(1.0, _LIGHTEST / luminance(colour)) ** (1 / 2.2)
    red, green, blue = (part * factor for part in colour)
    return red, green, blue


def lanes(trails: Trails) -> list[tuple[int, int, int, int]]:
    """Return robot, tail, head and lane of each passage along an arc, in the order of the trails.

    Lanes count from 0 for robots on the same arc; those of the opposite arc lie on the other side.
    """
    taken: Counter[tuple[int, int]] = Counter()
    passages = []
    for robot, trail in enumerate(trails):
        for arc in pairwise(trail):
            passages.append((robot, *arc, taken[arc]))
            taken[arc] += 1
    return passages


def draw_trails(
    canvas: Canvas,
    trails: Trails,
    styles: Sequence[RobotStyle],
    *,
    bowed: Collection[tuple[int, int]] = frozenset(),
) -> FloatArray:
    """Draw trails on the right-hand side of their arcs, with arrowheads.

    Arcs are straight lines, but those in ``bowed``, pairs of node indices, bow to their right.
    Returns the points of each passage (n_passages, n_points, 2), in the order of the trails.
    """
    passages = lanes(trails)
    if not passages:
        return np.empty((0, 0, 2))
    robot, tail, head, lane = np.array(passages, dtype=np.int32).T
    bows = np.array([passage[1:3] in bowed for passage in passages])
    # The lanes of an arc should fit under the nodes at its ends, as long as they stay legible.
    gap = float(np.clip(canvas.radius / (lane.max() + 0.5), 1.9, 3.2))
    width = 0.75 * gap
    points = canvas.curves(tail, head, bows)
    along = points[:, -1] - points[:, 0]
    length = np.maximum(np.hypot(*along.T), 1e-12) * canvas.scale
    # A bow keeps clear of the opposite arc by itself.
    points = shifted(points, (lane + np.where(bows, 0.0, 0.5)) * gap / canvas.scale)
    ink = np.array([style.colour for style in styles])[robot]
    walked = _walked(robot, length)
    dashes = [styles[i].dash for i in robot]
    canvas.draw_lines(points, colors="white", linewidths=width + 1.2, zorder=2, label="_casing")
    canvas.draw_lines(
        points,
        colors=ink,
        linewidths=width,
        # They go on where the robot's last passage ended.
        linestyles=[
            (way / width % sum(dash), dash) if dash else (0.0, None)
            for way, dash in zip(walked.tolist(), dashes, strict=True)
        ],
        zorder=3,
        label="_trails",
    )
    _draw_directions(canvas, points, length, walked, lane, ink)
    return points


def _walked(robot: IntArray, length: FloatArray) -> FloatArray:
    """Return how far the robot of each passage has walked before it; robots are in order."""
    before = np.cumsum(length) - length
    return np.asarray(before - before[np.searchsorted(robot, robot)])


def _draw_directions(
    canvas: Canvas,
    points: FloatArray,
    length: FloatArray,
    walked: FloatArray,
    lane: IntArray,
    ink: FloatArray,
) -> None:
    free = length - 2 * canvas.radius
    # Arrowheads of opposite and neighbouring lanes must not lie side by side.
    sizes = np.minimum(np.clip(1.3 * canvas.radius, 5.5, 8.0), free / 2.2)
    ahead = 0.6 * sizes + np.where(free > 5 * sizes, 1.1 * sizes * (lane % 2), 0.0)
    shown = sizes > 3.0
    some = ~shown & ((walked + length) // _APART > walked // _APART)
    sizes[some], ahead[some] = 6.0, 0.0
    shown |= some
    part = 0.5 + ahead[shown] / length[shown]
    step = part * (points.shape[1] - 1)
    row, before = np.arange(len(step)), step.astype(int)
    start, end = points[shown][row, before], points[shown][row, before + 1]
    canvas.draw_heads(
        start + (end - start) * (step - before)[:, None],
        end - start,
        colours=ink[shown],
        sizes=sizes[shown],
        zorder=3,
        label="_trail heads",
    )
