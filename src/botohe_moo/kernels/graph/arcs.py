"""Single arcs of a graph."""

from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph

_LINEAR_SEARCH_UP_TO = 12


@helper
def find_arc(graph: Graph, tail: int, head: int) -> int:
    """Give the arc between two nodes, which the graph must have, or −1."""
    low, high = graph.first[tail], graph.first[tail + 1]
    while high - low > _LINEAR_SEARCH_UP_TO:
        middle = (low + high) // 2
        if graph.head[middle] <= head:
            low = middle
        else:
            high = middle
    for arc in range(low, high):
        if graph.head[arc] == head:
            return arc
    return -1
