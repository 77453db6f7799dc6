"""The picture of a colony's memory: how much pheromone lies on every arc."""

from typing import Literal, get_args

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo._base.checks import check_frame
from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.canvas import Canvas, add_colour_bar, open_axes
from botohe_moo.plots.draw.maps import draw_nodes
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.style import colour_range, pheromone_palette, theme
from botohe_moo.plots.draw.titles import title_above

Kind = Literal["reward", "survival"]

_WIDEST = 5.0


def plot_pheromone(
    mission: Mission,
    pheromone: pd.DataFrame,
    *,
    kind: Kind = "reward",
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
        pheromone of either kind (finite, at least 0). The base's self-loop is not drawn.
    kind
        Which of the two to draw.
    title
        Name of the picture. Default: the mission's title.
    ax
        Axes to draw on, colour bar included. One will be created if not given.

    Raises
    ------
    ValueError
        If ``kind`` is unknown, a column or an arc of the mission is missing or an arc is there
        twice, an arc is not the mission's, or a value is out of range.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOACO, BOTOHE, load_mission
    >>> from botohe_moo.plots import plot_pheromone, save_plot
    >>> toy = load_mission("toy")
    >>> colony = minimize(BOTOHE(toy), BOACO(n_ants=20), ("n_gen", 5), seed=1).algorithm
    >>> save_plot(plot_pheromone(toy, colony.pheromone_maps, kind="survival"), "pheromone.png")
    """
    if kind not in get_args(Kind):
        raise ValueError(f"Expected kind to be one of {', '.join(get_args(Kind))}, got {kind!r}.")
    check_mission(mission)
    values = _arc_values(mission, pheromone, kind)
    xy = node_positions(mission)
    notes = [f"pheromone for {kind}", *layout_notes(mission)]
    with theme():
        ax = open_axes(xy, ax)
        palette, arrays = pheromone_palette(), mission.arrays
        if len(values):
            norm = colour_range(values, low=0.0)
            add_colour_bar(ax, palette, norm, rf"pheromone $\tau_{kind[0].upper()}$", slot=0)
        canvas = Canvas.measure(ax, xy)
        if len(values):
            # What is darkest is drawn last, on top.
            order = np.argsort(values, kind="stable")
            share = values[order] / (values.max() or 1.0)
            canvas.draw_arrows(
                arrays.tail[order],
                arrays.head[order],
                colours=np.asarray(palette(norm(values[order]))),
                widths=0.3 + share * min(_WIDEST, 0.5 * canvas.radius),
                zorder=1,
            )
        arcs = canvas.curves(arrays.tail, arrays.head, np.ones(arrays.n_arcs, dtype=bool))
        notes += draw_nodes(canvas, mission, np.ones((len(xy), 4)), arcs)
        title_above(ax, mission.title if title is None else title, "; ".join(notes))
    return ax


def _arc_values(mission: Mission, pheromone: pd.DataFrame, kind: Kind) -> FloatArray:
    """Pheromone of the mission's arcs, in the order of its arrays."""
    check_frame("pheromone", pheromone)
    needed = ("tail", "head", kind)
    if missing := [column for column in needed if column not in pheromone.columns]:
        raise ValueError(f"Expected pheromone with columns {needed}, it lacks {missing}.")
    found: dict[tuple[object, object], float] = {}
    rows = zip(*(pheromone[column].tolist() for column in needed), strict=True)
    for tail, head, amount in rows:
        if tail == head == mission.base:
            continue
        if not mission.graph.has_edge(tail, head):
            raise ValueError(f"Mission {mission.name!r} has no arc {tail!r} -> {head!r}.")
        if (tail, head) in found:
            raise ValueError(f"Expected one row per arc, got {tail!r} -> {head!r} twice.")
        if not (np.isfinite(amount) and amount >= 0):
            raise ValueError(
                f"Expected finite pheromone of at least 0 on {tail!r} -> {head!r}, got {amount!r}."
            )
        found[tail, head] = float(amount)
    arrays, nodes = mission.arrays, mission.nodes
    arcs = [(nodes[u], nodes[v]) for u, v in zip(arrays.tail, arrays.head, strict=True)]
    if absent := [f"{tail!r} -> {head!r}" for tail, head in arcs if (tail, head) not in found]:
        raise ValueError(f"Expected a row for every arc, missing: {', '.join(absent)}.")
    return np.array([found[arc] for arc in arcs])
