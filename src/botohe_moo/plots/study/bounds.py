"""The line in pictures of areas that no front reaches beyond."""

from collections.abc import Iterable
from typing import Literal

from matplotlib.axes import Axes

from botohe_moo.plots.draw.style import MUTED

_LEAST_ROOM = 0.01  # of areas, beyond the largest one that was found


def draw_bound(
    axes: Iterable[Axes], bound: float, low: float, high: float, which: Literal["x", "y"]
) -> tuple[float, str]:
    """Draw a dashed line at the area ``bound``; give the end of the axis, and words for the line.

    Areas shown are from ``low`` to ``high``. Where the line would more than double that, there is
    none, and the words say so.
    """
    words = f"no front reaches more than {bound:.4f}"
    if bound > high + max(high - low, _LEAST_ROOM):
        return high, f"; {words}, off the axis"
    for ax in axes:
        draw = ax.axhline if which == "y" else ax.axvline
        draw(bound, color=MUTED, linestyle="--", linewidth=1.0, zorder=1, gid="bound")
    return max(high, bound), f"; dashed: {words}"
