"""Drawing trails side by side: robots that use the same arc have lanes along it."""

from collections import Counter
from itertools import pairwise

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray
from botohe_moo.mission import Mission
from botohe_moo.plots.draw.canvas import Canvas, bowed_arcs
from botohe_moo.plots.draw.style import Colour
from botohe_moo.trails import TrailPlan


def lanes(plan: TrailPlan) -> list[tuple[int, int, int, int]]:
    """Give robot, tail, head and lane of each passage along an arc, in the order of the trails.

    Lanes count from 0 for robots on the same arc; those of the opposite arc lie on the other side.
    """
    taken: Counter[tuple[int, int]] = Counter()
    passages = []
    for robot, trail in enumerate(plan.trails):
        for arc in pairwise(trail):
            passages.append((robot, *arc, taken[arc]))
            taken[arc] += 1
    return passages


def draw_trails(canvas: Canvas, mission: Mission, plan: TrailPlan, colours: list[Colour]) -> None:
    """Draw the trails of ``plan`` on the right-hand side of their arcs, with arrowheads."""
    passages = lanes(plan)
    if not passages:
        return
    robot, tail, head, lane = np.array(passages, dtype=np.int32).T
    arrays, bowed = mission.arrays, bowed_arcs(mission)
    arcs_bowed = set(zip(arrays.tail[bowed].tolist(), arrays.head[bowed].tolist(), strict=True))
    bows = np.array([arc in arcs_bowed for arc in zip(tail.tolist(), head.tolist(), strict=True)])
    # The lanes of an arc should fit under the nodes at its ends, as long as they stay legible.
    gap = float(np.clip(canvas.radius / (lane.max() + 0.5), 1.9, 3.2))
    width = 0.75 * gap
    points = canvas.curves(tail, head, bows)
    along = points[:, -1] - points[:, 0]
    length = np.maximum(np.hypot(*along.T), 1e-12)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1) / length[:, None]
    # A bow keeps clear of the opposite arc by itself.
    offset = (lane + np.where(bows, 0.0, 0.5)) * gap / canvas.scale
    points = points + (right * offset[:, None])[:, None]
    ink = np.array(colours)[robot]
    canvas.draw_lines(points, colors="white", linewidths=width + 1.2, zorder=2, gid="casing")
    canvas.draw_lines(points, colors=ink, linewidths=width, zorder=3, gid="trails")
    _draw_directions(canvas, points, length * canvas.scale, lane, ink)


def _draw_directions(
    canvas: Canvas, points: FloatArray, length: FloatArray, lane: IntArray, ink: FloatArray
) -> None:
    free = length - 2 * canvas.radius
    # Arrowheads of opposite and neighbouring lanes must not lie side by side.
    sizes = np.minimum(np.clip(1.3 * canvas.radius, 5.5, 8.0), free / 2.2)
    ahead = 0.6 * sizes + np.where(free > 5 * sizes, 1.1 * sizes * (lane % 2), 0.0)
    legible = sizes > 3.0
    part = 0.5 + ahead[legible] / length[legible]
    step = part * (points.shape[1] - 1)
    row, before = np.arange(len(step)), step.astype(int)
    start, end = points[legible][row, before], points[legible][row, before + 1]
    canvas.draw_heads(
        start + (end - start) * (step - before)[:, None],
        end - start,
        colours=ink[legible],
        sizes=sizes[legible],
        zorder=3,
        gid="trail heads",
    )
