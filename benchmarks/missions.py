"""Missions that several benchmarks draw."""

from typing import Any

import networkx as nx
import numpy as np

from botohe_moo import Mission


def one_way(nodes: int) -> Mission:
    """Draw as many arcs again as a cycle of one-way arcs has."""
    rng = np.random.default_rng(nodes // 40 + 40)
    arcs = [(node, (node + 1) % nodes) for node in range(nodes)]
    arcs += [tuple(rng.choice(nodes, 2, replace=False).tolist()) for _ in range(nodes)]
    return drawn_on(nx.DiGraph(arcs), nodes // 40 + 40)


def drawn_on(graph: Any, seed: int) -> Mission:
    """Draw rewards and survivals for two robots that leave the first node."""
    rng = np.random.default_rng(seed)
    drawn: nx.DiGraph[Any] = nx.convert_node_labels_to_integers(graph).to_directed()
    for node in drawn:
        drawn.nodes[node]["reward"] = float(rng.uniform(0.1, 1.0))
    for arc in drawn.edges:
        drawn.edges[arc]["survival"] = float(rng.uniform(0.9, 1.0))
    return Mission(drawn, base=0, robots=2)
