"""Graphs of missions that are made by hand, the faults of some, and what Nav2 makes of files."""

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


def team_site(**changes):
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


def feature(shape, at, **properties):
    """A feature of GeoJSON."""
    geometry = {"type": shape, "coordinates": at}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def faults_of(*given, make=Mission, **options):
    """Return what is wrong with a mission."""
    with pytest.raises(MissionError) as caught:
        make(*given, **options)
    return list(caught.value.faults)


def loaded_by_nav2(content):
    """What Nav2's loader makes of a file: points by id, and lines; it takes no other types.

    Ids of points and lines are all different, as its documentation says.
    """

    def check(value):
        if isinstance(value, dict):
            for inner in value.values():
                check(inner)
        else:
            values = value if isinstance(value, list) else [value]
            assert all(isinstance(one, bool | int | float | str) for one in values)

    points, lines, ids = {}, [], []
    for feature in content["features"]:
        own = feature["properties"]
        check(own.get("metadata", {}))
        ids.append(own["id"])
        assert isinstance(own.get("frame", ""), str)
        assert isinstance(own.get("cost", 0), int | float)
        assert isinstance(own.get("overridable", True), bool)
        operations = own.get("operations", [])
        for operation in operations.values() if isinstance(operations, dict) else operations:
            assert {type(operation[key]) for key in ("type", "trigger")} == {str}
        if feature["geometry"]["type"] == "Point":
            points[own["id"]] = tuple(feature["geometry"]["coordinates"][:2])
        else:
            assert {own["startid"], own["endid"]} <= points.keys()
            lines.append(own)
    assert all(type(number) is int and 0 <= number < 2**32 for number in ids)
    assert len(ids) == len({*ids})
    return points, lines
