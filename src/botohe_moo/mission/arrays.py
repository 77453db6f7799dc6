"""A mission as kernels see it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo.kernels.graph.graph import Graph, new_graph

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable

    import networkx as nx


def as_arrays(graph: nx.DiGraph[Any], index: dict[Any, int], base: Hashable) -> Graph:
    """Put a valid graph into arrays.

    Parameters
    ----------
    graph
        A mission's graph.
    index
        The number of each node, in the graph's order.
    base
        Label of the base.
    """
    labelled: Iterable[tuple[Any, Any, float]] = graph.edges(data="survival")
    arcs = sorted((index[u], index[v], s) for u, v, s in labelled)
    return new_graph(
        tail=np.array([u for u, _, _ in arcs], np.int64),
        head=np.array([v for _, v, _ in arcs], np.int64),
        survival=np.array([s for _, _, s in arcs], np.float64),
        reward=np.array([r for _, r in graph.nodes(data="reward")], np.float64),
        base=index[base],
    )
