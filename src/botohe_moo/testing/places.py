"""The missions that algorithms are checked on: small enough for all, and new for each check."""

from __future__ import annotations

from typing import Any

import networkx as nx
import numpy as np

from botohe_moo.mission.generators import random
from botohe_moo.mission.model import Mission


def streets() -> Mission:
    """Eight nodes, arcs there and back, two robots."""
    return random(nodes=8, arc_probability=0.4, robots=2, seed=3)


def one_way() -> Mission:
    """Six nodes on two rings that share the base; no arc has a reverse."""
    graph: nx.DiGraph[Any] = nx.DiGraph()
    for node in range(6):
        graph.add_node(node, reward=float(node))
    nx.add_cycle(graph, [0, 1, 2, 3], survival=0.9)
    nx.add_cycle(graph, [0, 4, 5], survival=0.8)
    graph.add_edge(2, 4, survival=0.95)
    return Mission(graph, base=0, robots=2, name="one-way")


def alone() -> Mission:
    """The streets, with one robot."""
    return streets().with_robots(1)


def measured() -> Mission:
    """The streets, with lengths."""
    plain = streets()
    graph: nx.DiGraph[Any] = nx.DiGraph(plain.graph)
    rng = np.random.default_rng(3)
    for arc in sorted(graph.edges):
        graph.edges[arc]["length"] = float(rng.uniform(0.5, 1.5))
    return Mission(graph, base=plain.base, robots=2, name="measured")
