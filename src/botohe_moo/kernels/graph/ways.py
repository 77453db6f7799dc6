"""Ways through whole graphs, once for a mission: what leads where, and the way of each robot."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from botohe_moo._base.types import BoolArray, OffsetArray
from botohe_moo.kernels.graph.graph import Graph, Limits, with_costs
from botohe_moo.kernels.graph.kinds import AT_NEXT_DEPOT, AT_THIS_DEPOT

Way: TypeAlias = tuple[list[int], float, float]  # its nodes, its survival and its length


def leading(tail: OffsetArray, head: OffsetArray, goals: Sequence[int], n_nodes: int) -> BoolArray:
    """Return which nodes are a goal or have a way to one, along arcs from tail to head."""
    leads = np.isin(np.arange(n_nodes), goals)
    while (new := leads[head] & ~leads[tail]).any():  # once for each arc of the longest way
        leads[tail[new]] = True
    return leads


def uncollected(graph: Graph) -> OffsetArray:
    """Return the nodes of a mission whose reward no kind can collect.

    A reward on return needs a way on to a depot. The base is one.
    """
    if (kinds := graph.kinds) is None:
        return np.empty(0, np.int64)
    depots = np.flatnonzero(kinds.credit == AT_THIS_DEPOT).tolist()
    pays = (kinds.credit != AT_NEXT_DEPOT) | leading(graph.tail, graph.head, depots, graph.n_nodes)
    collects = (pays & (graph.reward > 0.0)).reshape(-1, len(kinds.reward)).any(axis=0)
    return np.flatnonzero((kinds.reward > 0.0) & ~collects)


def ways_to_ends(graph: Graph, limits: Limits) -> list[Way]:
    """Return each robot's safest way from its start to its end, or the shortest if it is too long.

    ``graph`` has kinds.
    """
    ways: dict[int, Way] = {}
    starts: list[int] = [] if graph.kinds is None else graph.kinds.start.tolist()
    for start in dict.fromkeys(starts):
        ways[start] = _way_home(graph, start)
        if limits.budgets is not None and ways[start][2] > limits.budgets[start]:
            ways[start] = _way_home(with_costs(graph, graph.length), start)
    return [ways[start] for start in starts]


def _way_home(graph: Graph, node: int) -> Way:
    """Return the cheapest way home from a node."""
    way, survival, length = [node], 1.0, 0.0
    while (arc := int(graph.homeward[way[-1]])) >= 0:
        way.append(int(graph.head[arc]))
        survival *= float(graph.survival[arc])
        length += float(graph.length[arc])
    return way, survival, length
