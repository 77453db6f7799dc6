"""GraphML, as networkx, Gephi and yEd write it."""

from __future__ import annotations

import io
import re
from typing import Any
from xml.etree import ElementTree as ET

import networkx as nx

from botohe_moo._base.checks import quoted
from botohe_moo.mission.formats.nodelink import graph_of
from botohe_moo.mission.validation import MissionError

_LONGEST = 200  # characters of what a parser says
_NOT_IN_XML = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# What its reader raises for wrong values and types is not declared.
_OF_NETWORKX = (nx.NetworkXError, ET.ParseError, LookupError, ValueError, TypeError, AttributeError)
_DEFAULTS = ("node_default", "edge_default")  # where networkx keeps them


def read_graphml(data: bytes, /) -> nx.Graph[Any]:
    """Read GraphML with networkx.

    Node labels are the nodes' ids, hence strings, and so is the base, whatever its declared type.
    The node attributes ``x`` and ``y`` become ``pos``. A MissionError is raised for what is not
    GraphML, and for arcs that are there more than once.
    """
    try:
        root = ET.fromstring(data)
        _remove_drawings(root)
        found = nx.parse_graphml(ET.tostring(root, "unicode"), force_multigraph=True)
    except _OF_NETWORKX as error:
        said = f"{type(error).__name__}: {error}"[:_LONGEST]
        raise MissionError(f"expected GraphML with one directed graph, found {said}") from None
    if not found.is_directed():
        return nx.Graph(found)
    own = {key: value for key, value in found.graph.items() if key not in _DEFAULTS}
    if "base" in own:
        own["base"] = str(own["base"])
    of_nodes, of_arcs = (found.graph.get(key, {}) for key in _DEFAULTS)
    return graph_of(
        own,
        [
            ("the GraphML", (label,), _with_pos({**of_nodes, **attributes}))
            for label, attributes in found.nodes(data=True)
        ],
        [
            ("the GraphML", (tail, head), {**of_arcs, **attributes})
            for tail, head, attributes in found.edges(data=True)
        ],
    )


def _remove_drawings(root: ET.Element) -> None:
    """Remove what yEd draws: networkx would take its places for the attributes ``x`` and ``y``."""
    for owner in list(root.iter()):
        for drawing in [data for data in owner.findall("{*}data") if len(data)]:
            owner.remove(drawing)


def _with_pos(attributes: dict[str, Any]) -> dict[str, Any]:
    place = [attributes.get("x"), attributes.get("y")]
    if all(type(part) in (int, float) for part in place):
        del attributes["x"], attributes["y"]
        attributes["pos"] = place
    return attributes


def write_graphml(content: dict[str, Any]) -> bytes:
    """Write node-link data as GraphML; a ValueError names what GraphML cannot hold."""
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.graph.update(_writable("the graph", content["graph"]))
    for node in content["nodes"]:
        label = node.pop("id")
        owner = f"node {quoted(label)}"
        if not (isinstance(label, str) and _is_writable(label)):
            raise _unwritable(f"{owner}: expected a label of letters that XML has")
        graph.add_node(label)
        graph.nodes[label].update(_writable(owner, _with_coordinates(node)))
    for arc in content["edges"]:
        ends = arc.pop("source"), arc.pop("target")
        graph.add_edge(*ends)
        graph.edges[ends].update(_writable(f"arc {quoted(ends[0])} -> {quoted(ends[1])}", arc))
    written = io.BytesIO()
    nx.write_graphml_xml(graph, written)
    return written.getvalue() + b"\n"


def _with_coordinates(node: dict[str, Any]) -> dict[str, Any]:
    place = node.get("pos")
    if not isinstance(place, list) or len(place) != 2 or "x" in node or "y" in node:
        return node
    del node["pos"]
    return {**node, "x": place[0], "y": place[1]}


def _writable(owner: str, attributes: dict[str, Any]) -> dict[str, Any]:
    for name, value in attributes.items():
        if name not in _DEFAULTS and not (_is_writable(name) and _is_writable(value)):
            raise _unwritable(
                f"{owner}: expected numbers, booleans and texts of letters that XML has, got "
                f"{quoted(value)} for {quoted(name)}"
            )
    return attributes


def _is_writable(value: object) -> bool:
    if isinstance(value, str):
        return not _NOT_IN_XML.search(value)
    return isinstance(value, bool | int | float)


def _unwritable(reason: str) -> ValueError:
    return ValueError(f"{reason}; a .json file can hold it.")
