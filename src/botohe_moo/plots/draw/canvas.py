"""Drawing a mission's graph: nodes, labels, and the course of arcs."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, IdentityTransform
from scipy.spatial import KDTree

from botohe_moo.base.types import BoolArray, FloatArray, IntArray
from botohe_moo.plots.draw.background import Background
from botohe_moo.plots.draw.style import new_axes

# Of maps behind the graph: they are not to be darker than arcs, and white is to stay as it is.
_FAINT = LinearSegmentedColormap.from_list("faint", [(0.5, 0.5, 0.5, 0.0), (0.5, 0.5, 0.5, 0.5)])
_BEND = 0.07  # how far an arrow bows to its right, in parts of its length
_STEPS = np.linspace(0, 1, 17)[None, :, None]


def frame_of(xy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the centre of a map of the nodes at ``xy`` (n_nodes, 2), and half its sides."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    longest = float((high - low).max())
    # A path drawn as a straight line still needs room above and below it.
    half = np.maximum((high - low) / 2, 0.2 * longest) + 0.075 * longest
    if longest == 0:
        half = np.array([1.0, 0.4])
    return (low + high) / 2, half


def open_axes(xy: FloatArray, ax: Axes | None, background: Background | None = None) -> Axes:
    """Prepare ``ax``, or a new figure of a fitting shape, for a picture of the nodes at ``xy``.

    The ``background`` is drawn as far as the picture of the nodes reaches.
    """
    centre, half = frame_of(xy)
    if ax is None:
        ax = new_axes(8.0, float(np.clip(6.6 * half[1] / half[0] + 1.0, 3.5, 8.0)))
    ax.set_xlim(centre[0] - half[0], centre[0] + half[0])
    ax.set_ylim(centre[1] - half[1], centre[1] + half[1])
    ax.set_aspect("equal")
    ax.set_axis_off()
    if background is not None:
        ax.imshow(background.shares, _FAINT, vmin=0, vmax=1, extent=background.extent, zorder=-1)
    return ax


def add_colour_bar(ax: Axes, colours: ScalarMappable, label: str, slot: int | None = None) -> None:
    """Put a colour bar right of ``ax``, as part of it: in the upper half (``slot`` 0) or the lower.

    Without a ``slot`` it takes both.
    """
    low, height = (0.1, 0.8) if slot is None else (0.55 - 0.53 * slot, 0.43)
    bar = ax.inset_axes((1.02, low, 0.022, height))
    drawn = ax.figure.colorbar(colours, cax=bar, label=label)
    drawn.outline.set_visible(False)
    bar.yaxis.label.set_parse_math(True)  # the theme does not, for the sake of users' texts
    bar.tick_params(length=2.5)


def colour_by_value(
    ax: Axes,
    values: FloatArray,
    palette: Colormap,
    label: str,
    *,
    slot: int,
    span: tuple[float, float] | None = None,
) -> FloatArray:
    """Add a colour bar for values (n), and return their colours (n, 4).

    The palette is for values from ``span[0]`` to ``span[1]``, by default for those that there are.
    """
    if not len(values):
        return np.empty((0, 4))
    low, high = (values.min(), values.max()) if span is None else span
    colours = ScalarMappable(Normalize(float(low), float(high)), palette)
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


@dataclass(frozen=True)
class Canvas:
    """Axes whose scale is known, so that sizes in points fit distances in data units."""

    ax: Axes  # with limits, legend and colour bars in place
    xy: FloatArray  # positions of the nodes (n_nodes, 2)
    scale: float  # points per data unit
    radius: float  # of a node, in points
    spacing: float  # points between most nodes and the nearest other one

    @classmethod
    def measure(cls, ax: Axes, xy: FloatArray, *, smallest: float = 3.8) -> Self:
        """Compute the scale that ``ax`` will be drawn at, and the node size that suits it."""
        root = ax.figure.figure
        if (engine := root.get_layout_engine()) is not None:
            engine.execute(root)
        ax.apply_aspect()
        left, right = ax.get_xlim()
        scale = ax.get_window_extent().width / root.dpi * 72 / (right - left)
        spacing = crowding(xy) * scale
        radius = float(np.clip(0.36 * spacing, smallest, 10.5))
        return cls(ax, xy, scale, radius, spacing)

    def draw_nodes(
        self,
        base: int,
        fills: FloatArray,
        *,
        radii: FloatArray,
        edges: Sequence[str],
        depots: IntArray,
    ) -> None:
        """Draw circles of ``radii`` points, the largest on top, and base and depots as squares."""
        x, y = self.xy.T
        by_size = np.argsort(radii, kind="stable")
        by_size = by_size[(by_size != base) & (radii[by_size] > 0)]
        is_depot = np.isin(by_size, depots)
        for order, marker, name in (
            (by_size[~is_depot], "o", "_nodes"),
            (by_size[is_depot], "s", "_depots"),
        ):
            if len(order) or marker == "o":
                self.ax.scatter(
                    x[order],
                    y[order],
                    s=(2 * radii[order]) ** 2,
                    c=fills[order],
                    marker=marker,
                    edgecolors=[edges[i] for i in order],
                    linewidths=np.minimum(0.7, 0.2 * radii[order]).tolist(),
                    zorder=4,
                    label=name,
                )
        self.ax.scatter(
            x[base],
            y[base],
            s=(2 * max(self.radius, 4.0)) ** 2,
            c=[fills[base]],
            marker="s",
            edgecolors="black",
            linewidths=1.6,
            zorder=5,
            label="_base",
        )

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
        self,
        tail: IntArray,
        head: IntArray,
        *,
        colours: FloatArray,
        widths: FloatArray,
        **style: Any,
    ) -> None:
        """Draw one arrow per arc, bowed to its right so that both directions are seen."""
        points = self.curves(tail, head, bowed=True)
        self.draw_lines(points, colors=colours, linewidths=widths, label="_arrows", **style)
        sizes = np.minimum(2.4 + 2.4 * widths, 1.1 * self.radius + widths)
        along = self.xy[head] - self.xy[tail]
        # The quadratic curve runs parallel to its chord half-way.
        self.draw_heads(points[:, _STEPS.size // 2], along, colours=colours, sizes=sizes, **style)

    def draw_heads(
        self,
        at: FloatArray,
        towards: FloatArray,
        *,
        colours: Sequence[Any] | FloatArray,
        sizes: FloatArray,
        **style: Any,
    ) -> None:
        """Draw arrowheads of ``sizes`` points, centred ``at`` data points."""
        angles = np.arctan2(towards[:, 1], towards[:, 0])
        head = Path([(0.6, 0.0), (-0.4, 0.45), (-0.4, -0.45), (0.6, 0.0)], closed=True)
        heads = PathCollection(
            [head.transformed(Affine2D().rotate(angle)) for angle in angles],
            sizes=sizes**2,
            offsets=at,
            offset_transform=self.ax.transData,
            facecolors=colours,
            linewidths=0,
            **{"label": "_heads", **style},
        )
        heads.set_transform(IdentityTransform())
        self.ax.add_collection(heads, autolim=False)
