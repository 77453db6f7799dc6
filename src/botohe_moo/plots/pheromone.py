"""Picture of the pheromone that a colony has laid."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from matplotlib.axes import Axes

from botohe_moo.base.messages import check_choice
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.plots.draw.algorithms import check_table
from botohe_moo.plots.draw.canvas import Canvas, colour_by_value, open_axes
from botohe_moo.plots.draw.maps import draw_named_nodes
from botohe_moo.plots.draw.places import layout_notes, node_positions
from botohe_moo.plots.draw.site import Site, site_of
from botohe_moo.plots.draw.style import PHEROMONE, theme
from botohe_moo.plots.draw.texts import title_above

if TYPE_CHECKING:
    import pandas as pd

PheromoneKind = Literal["reward", "survival"]

_WIDEST = 5.0  # points: the arc of most pheromone


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
    xy, site = node_positions(mission), site_of(mission, robots)
    values = _arc_values(mission, site, pheromone, kind)
    of = "" if robots is None else f" of {robots}"
    notes = [f"pheromone{of} for {kind}", *layout_notes(mission)]
    with theme():
        ax = open_axes(xy, ax)
        label = rf"pheromone $\tau_{kind[0].upper()}$"
        arc_colours = colour_by_value(
            ax, values, PHEROMONE, label, slot=0, span=(0.0, values.max(initial=0.0))
        )
        canvas = Canvas.measure(ax, xy)
        # What is darkest is drawn last, on top.
        order = np.argsort(values, kind="stable")
        share = values[order] / (values.max(initial=0.0) or 1.0)
        canvas.draw_arrows(
            site.tail[order],
            site.head[order],
            colours=arc_colours[order],
            widths=0.3 + share * min(_WIDEST, 0.5 * canvas.radius),
            zorder=1,
        )
        arcs = canvas.curves(site.tail, site.head, bowed=True)
        notes += draw_named_nodes(canvas, mission, site, np.ones((len(xy), 4)), arcs)
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
    mission: Mission, site: Site, pheromone: pd.DataFrame, kind: PheromoneKind
) -> FloatArray:
    """Return the pheromone of the site's arcs, in their order."""
    check_table("pheromone", pheromone, ("tail", "head", kind))
    ends = list(zip(pheromone["tail"].tolist(), pheromone["head"].tolist(), strict=True))
    for (tail, head), n_rows in Counter(ends).items():
        if n_rows > 1:
            raise ValueError(f"Expected one row per arc, got {tail!r} -> {head!r} twice.")
    found = dict(zip(ends, pheromone[kind].tolist(), strict=True))
    nodes = mission.nodes
    arcs = [(nodes[u], nodes[v]) for u, v in zip(site.tail, site.head, strict=True)]
    if absent := [f"{tail!r} -> {head!r}" for tail, head in arcs if (tail, head) not in found]:
        raise ValueError(f"Expected a row for every arc, missing: {', '.join(absent)}.")
    values = np.array([found[arc] for arc in arcs], float)
    if not (np.isfinite(values) & (values >= 0)).all():
        raise ValueError(f"Expected finite pheromone of at least 0, got {values.tolist()}.")
    return values
