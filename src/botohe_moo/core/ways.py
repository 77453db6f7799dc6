"""Reachability, and each robot's way to its end, computed once for a mission."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import BoolArray, OffsetArray
from botohe_moo.core.graph import Graph, Limits, limit_at, with_costs
from botohe_moo.core.kinds import AT_NEXT_DEPOT, AT_THIS_DEPOT


class Way(NamedTuple):
    """A way through a graph, with its survival and its length."""

    nodes: list[int]
    survival: float
    length: float


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
        if ways[start].length > limit_at(limits.max_length, limits.budgets, start):
            ways[start] = _way_home(with_costs(graph, graph.length), start)
    return [ways[start] for start in starts]


def _way_home(graph: Graph, node: int) -> Way:
    """Return the cheapest way home from a node."""
    way, survival, length = [node], 1.0, 0.0
    while (arc := int(graph.homeward[way[-1]])) >= 0:
        way.append(int(graph.head[arc]))
        survival *= float(graph.survival[arc])
        length += float(graph.length[arc])
    return Way(way, survival, length)


def failing_ways(graph: Graph, limits: Limits) -> dict[int, tuple[Way, float, float]]:
    """Return ways to ends that do not keep limits, by the first robot of each kind.

    Beside each way, which may not even lead to the end, are the robot's survival floor and travel
    budget.
    """
    if (kinds := graph.kinds) is None:  # trails end where they start
        return {}
    failing, ways = {}, ways_to_ends(graph, limits)
    for robot in np.unique(kinds.first).tolist():
        start = kinds.start[robot]
        least = limit_at(limits.min_survival, limits.floors, start)
        longest = limit_at(limits.max_length, limits.budgets, start)
        way = ways[robot]
        keeps = way.survival >= least and way.length <= longest
        if way.nodes[-1] != kinds.end[start] or not keeps:
            failing[robot] = way, least, longest
    return failing
