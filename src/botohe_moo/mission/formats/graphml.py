"""GraphML, as networkx, Gephi and yEd write it."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree as ET

import networkx as nx

from botohe_moo._base.checks import quoted
from botohe_moo.mission.formats.columns import column_faults, join_columns, split_columns
from botohe_moo.mission.formats.nodelink import Entry, convert_ends, graph_of
from botohe_moo.mission.rules import MissionError, kind_name_faults, read_kinds

# What its reader raises for wrong values and types is not declared.
_OF_NETWORKX = (nx.NetworkXError, ET.ParseError, LookupError, ValueError, TypeError, AttributeError)
_LONGEST = 200  # letters of what networkx says
_DEFAULTS = ("node_default", "edge_default")  # where networkx keeps them
_NUMBERS = ("int", "long", "float", "double")


def read_graphml(data: bytes, /) -> nx.Graph[Any]:
    """Read GraphML with networkx.

    Node labels are the nodes' ids, hence strings, and so is the base, whatever its declared type.
    The node attributes ``x`` and ``y`` become ``pos``, those of one kind as in `join_columns`;
    ``kinds`` are JSON. A MissionError is raised for what is not GraphML of one graph, for values
    that are not of their type, and as in `graph_of`.
    """
    try:
        root = ET.fromstring(data)
        if (n_graphs := len(root.findall("{*}graph"))) > 1:
            raise MissionError(f"expected GraphML with one directed graph, found {n_graphs} graphs")
        _remove_drawings(root)
        if faults := list(_value_faults(root)):
            raise MissionError(faults)
        found = nx.parse_graphml(ET.tostring(root, "unicode"), force_multigraph=True)
    except MissionError:
        raise
    except _OF_NETWORKX as error:
        said = f"{type(error).__name__}: {error}"[:_LONGEST]  # which may quote a whole file
        raise MissionError(f"expected GraphML with one directed graph, found {said}") from None
    if not found.is_directed():
        return nx.Graph(found)
    graph_attributes = {key: value for key, value in found.graph.items() if key not in _DEFAULTS}
    if "base" in graph_attributes:
        graph_attributes["base"] = str(graph_attributes["base"])
    kinds = _read_kinds(graph_attributes)
    of_nodes, of_arcs = (found.graph.get(key, {}) for key in _DEFAULTS)
    nodes: list[Entry] = [
        ("the GraphML", (label,), _with_pos({**of_nodes, **attributes}))
        for label, attributes in found.nodes(data=True)
    ]
    arcs: list[Entry] = [
        ("the GraphML", (tail, head), {**of_arcs, **attributes})
        for tail, head, attributes in found.edges(data=True)
    ]
    columns = dict.fromkeys(column for *_, row in (*nodes, *arcs) for column in row)
    if faults := column_faults(columns, kinds):
        raise MissionError(faults)
    join_columns(nodes, kinds)
    join_columns(arcs, kinds)
    return graph_of(graph_attributes, nodes, arcs)


def _read_kinds(graph_attributes: dict[str, Any]) -> list[str]:
    """Read the attribute ``kinds``, and return the names of the kinds."""
    if (text := graph_attributes.get("kinds")) is not None:
        try:
            graph_attributes["kinds"] = json.loads(text)
        except (TypeError, ValueError) as error:
            raise MissionError(f"expected kinds as JSON, got {quoted(text)}: {error}") from None
        convert_ends(graph_attributes["kinds"], str)
    kinds, wrong = read_kinds(graph_attributes.get("kinds"))
    if faults := [*wrong, *kind_name_faults(kinds)]:
        raise MissionError(faults)
    return [kind.name for kind in kinds]


def _remove_drawings(root: ET.Element) -> None:
    """Remove what yEd draws: networkx would take its places for the attributes ``x`` and ``y``."""
    for owner in list(root.iter()):
        for drawing in [data for data in owner.findall("{*}data") if len(data)]:
            owner.remove(drawing)


def _value_faults(root: ET.Element) -> Iterator[str]:
    """List the values that should be numbers and are not; networkx does not say whose they are."""
    names = {
        key.get("id"): key.get("attr.name")
        for key in root.findall("{*}key")
        if key.get("attr.type") in _NUMBERS
    }
    for owner in root.iter():
        for data in owner.findall("{*}data"):
            name = names.get(data.get("key"))
            if name is not None and not _is_number(data.text):
                arc = f"arc {owner.get('source')!r} -> {owner.get('target')!r}"
                whose = arc if owner.get("source") else f"node {owner.get('id')!r}"
                yield f"{whose}: expected a number as {name}, got {quoted(data.text)}"


def _is_number(text: str | None) -> bool:
    try:
        float(text or "")
    except ValueError:
        return False
    return True


def _with_pos(attributes: dict[str, Any]) -> dict[str, Any]:
    place = [attributes.get("x"), attributes.get("y")]
    if all(type(part) in (int, float) for part in place):
        del attributes["x"], attributes["y"]
        attributes["pos"] = place
    return attributes


def write_graphml(content: dict[str, Any]) -> bytes:
    """Write node-link data as GraphML; a ValueError names what GraphML cannot hold."""
    of_mission = content["graph"]
    if "kinds" in of_mission:
        of_mission = {**of_mission, "kinds": json.dumps(of_mission["kinds"], ensure_ascii=False)}
    graph: nx.DiGraph[Any] = nx.DiGraph(**_writable("the graph", of_mission))
    for node in content["nodes"]:
        label = node.pop("id")
        if not isinstance(label, str):
            raise ValueError(
                f"Node {quoted(label)}: expected a label that is text, as all labels in GraphML; a "
                ".json file can hold it."
            )
        attributes = _writable(f"node {quoted(label)}", _with_coordinates(node))
        graph.add_nodes_from([(label, attributes)])
    for arc in content["edges"]:
        tail, head = arc.pop("source"), arc.pop("target")
        attributes = _writable(f"arc {quoted(tail)} -> {quoted(head)}", arc)
        graph.add_edges_from([(tail, head, attributes)])
    written = io.BytesIO()
    nx.write_graphml_xml(graph, written)
    return written.getvalue() + b"\n"


def _with_coordinates(node: dict[str, Any]) -> dict[str, Any]:
    if node.get("pos") is None or "x" in node or "y" in node:
        return node
    x, y = node.pop("pos")
    return {**node, "x": x, "y": y}


def _writable(owner: str, attributes: dict[str, Any]) -> dict[str, Any]:
    attributes = split_columns(attributes)
    for name, value in attributes.items():
        if name not in _DEFAULTS and not isinstance(value, bool | int | float | str):
            raise ValueError(
                f"{owner}: expected numbers, booleans and texts, as GraphML holds them, got "
                f"{quoted(value)} for {quoted(name)}; a .json file can hold it."
            )
    return attributes
