"""Where nodes lie on paper; without matplotlib, so that places are checked before a search."""

from typing import Any

import networkx as nx
import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.mission import Mission
from botohe_moo.mission.hazards import places_of

_MAX_KAMADA_KAWAI = 60  # its cost grows with the square of the nodes


def node_positions(mission: Mission) -> FloatArray:
    """Return places (n_nodes, 2): attributes ``pos``, or a reproducible layout if any lacks one.

    There is also a layout where all nodes are at one place.
    """
    given = places_of(mission.graph.nodes)
    if not layout_notes(mission) and len(given) == len(mission.nodes):
        return np.array([given[node] for node in mission.nodes])
    graph = mission.graph
    ties: nx.Graph[Any] = nx.Graph(graph.edges)
    ties.add_nodes_from(graph)
    if len(ties) <= _MAX_KAMADA_KAWAI:
        layout = nx.kamada_kawai_layout(ties, weight=None)
    else:
        layout = nx.spring_layout(ties, seed=0, weight=None)
    xy = np.array([layout[node] for node in mission.nodes])
    # Pages are wider than high, and a layout has no up and down of its own.
    return xy[:, ::-1] if np.ptp(xy[:, 1]) > np.ptp(xy[:, 0]) else xy


def layout_notes(mission: Mission) -> list[str]:
    """Write that places on the map are made up, and why; nothing if they are the positions."""
    places, n_nodes = places_of(mission.graph.nodes), len(mission.nodes)
    n_without = n_nodes - len(places)
    if n_nodes == 1 or (not n_without and len({*places.values()}) > 1):
        return []
    if not places:
        why = "the mission has no positions"
    elif n_without:
        why = f"{n_without} of {n_nodes} nodes have no position"
    else:
        why = "all nodes have the same position"
    return [f"the places of the nodes on this map are made up: {why}"]
