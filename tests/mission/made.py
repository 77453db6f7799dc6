"""Graphs of missions that are made by hand, and the faults of those that are none."""

import networkx as nx
import pytest

from botohe_moo.mission import Kind, Mission, MissionError

DRONE, ROVER = Kind("drone", 2, start="roof", end="roof"), Kind("rover", 1)
BOTH = (DRONE, ROVER)


def harbour(**changes):
    """A ring of three nodes, both ways, but for the arc from the buoy to the dock."""
    graph = nx.DiGraph(title="A small harbour", base="dock", robots=2)
    graph.add_node("dock", reward=1)
    graph.add_node("reef", reward=5, pos=[0, 1])
    graph.add_node(("buoy", 2), reward=0.5)
    graph.add_edge("dock", "reef", survival=0.9)
    graph.add_edge("reef", "dock", survival=0.8)
    graph.add_edge("reef", ("buoy", 2), survival=0.5)
    graph.add_edge(("buoy", 2), "reef", survival=1)
    graph.add_edge("dock", ("buoy", 2), survival=0.25)
    return changed(graph, **changes)


def site(**changes):
    """A dock and a roof with a lab between them, for ``BOTH``."""
    graph = nx.DiGraph(base="dock")
    graph.add_node("dock", reward=0)
    graph.add_node("lab", reward=5, share={"drone": 0.5})
    graph.add_node("roof", reward=1, share={"rover": 0})
    for one, other, survival in (
        ("dock", "lab", {"drone": 0.5, "rover": 0.9}),
        ("lab", "roof", {"drone": 0.8, "rover": 0}),
    ):
        graph.add_edge(one, other, survival=survival)
        graph.add_edge(other, one, survival=survival)
    return changed(graph, **changes)


def changed(graph, /, **changes):
    """Change attributes: of ``graph``, of a node ``lab``, of an arc ``dock_lab``."""
    for whose, attributes in changes.items():
        if whose == "graph":
            graph.graph.update(attributes)
        elif "_" in whose:
            graph.edges[tuple(whose.split("_"))].update(attributes)
        else:
            graph.nodes[whose].update(attributes)
    return graph


def faults_of(graph, **given):
    """Return what is wrong with a mission."""
    with pytest.raises(MissionError) as caught:
        Mission(graph, **given)
    return list(caught.value.faults)
