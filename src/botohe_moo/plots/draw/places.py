"""Where nodes lie on paper; without matplotlib, so that places are checked before a search."""

from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.mission import Mission

_MAX_KAMADA_KAWAI = 60  # its cost grows with the square of the nodes


def node_positions(mission: Mission) -> FloatArray:
    """Give places (n_nodes, 2): attributes ``pos``, or a reproducible layout if any lacks one.

    Nor is there a map where all nodes are at one place.
    """
    graph = mission.graph
    places = dict(graph.nodes(data="pos"))
    laid_out = any(place is None for place in places.values())
    if not laid_out:
        given = np.array([_point(node, place) for node, place in places.items()])
        laid_out = len(given) > 1 and bool((given == given[0]).all())
    if laid_out:
        ties: nx.Graph[Any] = nx.Graph(graph.edges)
        ties.add_nodes_from(graph)
        if len(ties) <= _MAX_KAMADA_KAWAI:
            places = nx.kamada_kawai_layout(ties, weight=None)
        else:
            places = nx.spring_layout(ties, seed=0, weight=None)
    xy = np.array([_point(node, places[node]) for node in mission.nodes])
    # Pages are wider than high, and a layout has no up and down of its own.
    return xy[:, ::-1] if laid_out and np.ptp(xy[:, 1]) > np.ptp(xy[:, 0]) else xy


def _point(node: Any, place: Any) -> tuple[float, float]:
    try:
        x, y = (float(part) for part in place)
    except (TypeError, ValueError):
        x = y = np.nan
    if not np.isfinite([x, y]).all():
        raise ValueError(f"Node {node!r}: expected pos [x, y], two finite numbers, got {place!r}.")
    return x, y
