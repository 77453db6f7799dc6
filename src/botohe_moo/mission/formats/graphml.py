"""GraphML, as networkx, Gephi and yEd write it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import networkx as nx

from botohe_moo._base.checks import quoted
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import BY_KIND, MissionError

# What its reader raises for wrong files is not declared.
_OF_NETWORKX = (nx.NetworkXError, ET.ParseError, LookupError, ValueError, TypeError, AttributeError)
_DEFAULTS = ("node_default", "edge_default")  # where networkx keeps them
_REMEDY = "a .json file can hold it."
_FLAGS = {"true": True, "1": True, "false": False, "0": False}
# What a value of a declared type is called, and how it is read.
_TYPES: dict[str, tuple[str, Callable[[str], Any]]] = {
    "string": ("a text", str),
    "boolean": ("true or false", lambda text: _FLAGS[text.lower()]),
    **dict.fromkeys(("int", "integer", "long"), ("an integer", int)),
    **dict.fromkeys(("float", "double"), ("a number", float)),
}


def read_graphml(source: Source) -> Draft:
    """Read GraphML with networkx.

    Labels are the ids of nodes, hence texts. The node attributes ``x`` and ``y`` become ``pos``,
    and a name that yEd has drawn becomes ``label``. ``kinds`` are JSON. A MissionError names the
    values that are not of their declared type.
    """
    faults: list[str] = []
    try:
        root = ET.fromstring(source.data)
        drawn = _without_drawings(root)
        # networkx reads all values as texts, whose types stand before their names.
        for key in root.findall("{*}key[@attr.name]"):
            key.set("attr.name", f"{key.get('attr.type', 'string')}:{key.get('attr.name')}")
            key.set("attr.type", "string")
        found = nx.parse_graphml(ET.tostring(root, "unicode"), force_multigraph=True)
    except _OF_NETWORKX as error:
        said = f"{type(error).__name__}: {quoted(str(error))}"  # which may quote a whole file
        raise MissionError(f"expected GraphML with one directed graph, found {said}") from None
    if (n_graphs := len(root.findall("{*}graph"))) > 1:
        raise MissionError(f"expected GraphML with one directed graph, found {n_graphs} graphs")

    def row(owner: str, labels: tuple[str, ...], texts: Mapping[str, str]) -> Row:
        attributes: dict[str, Any] = {}
        for key, text in texts.items():
            kind, _, name = key.partition(":")
            if kind not in _TYPES:
                known = ", ".join(_TYPES)
                faults.append(f"{owner}: expected {name} of a type among {known}, got {kind!r}")
                continue
            expected, convert = _TYPES[kind]
            try:
                attributes[name] = convert(text)
            except (KeyError, ValueError):
                faults.append(f"{owner}: expected {expected} as {name}, got {quoted(text)}")
        if "x" in attributes and "y" in attributes and "pos" not in attributes:
            attributes["pos"] = [attributes.pop("x"), attributes.pop("y")]
        return Row("the GraphML", labels, attributes)

    of_nodes, of_arcs = (found.graph.pop(key, {}) for key in _DEFAULTS)
    nodes, arcs = [], []
    for node, texts in found.nodes(data=True):
        given = of_nodes | drawn.get(node, {}) | texts
        nodes.append(row(f"node {quoted(node)}", (node,), given))
    for tail, head, texts in found.edges(data=True):
        arc = f"arc {quoted(tail)} -> {quoted(head)}"
        arcs.append(row(arc, (tail, head), of_arcs | texts))
    graph = row("the graph", (), found.graph).attributes
    try:
        if (text := graph.get("kinds")) is not None:
            graph["kinds"] = json.loads(text)
    except (TypeError, ValueError) as error:
        raise MissionError(f"expected kinds as JSON, got {quoted(text)}: {error}") from None
    return Draft(nodes, arcs, graph, faults, directed=found.is_directed())


def _without_drawings(root: ET.Element) -> dict[str | None, dict[str, str]]:
    """Remove what yEd draws; return the names on its nodes.

    networkx would take the places of drawings for the attributes ``x`` and ``y``.
    """
    names = {}
    for owner in list(root.iter()):
        for drawing in [data for data in owner.findall("{*}data") if len(data)]:
            owner.remove(drawing)
            if name := drawing.findtext(".//{*}NodeLabel", "").strip():
                names[owner.get("id")] = {"string:label": name}
    return names


def write_graphml(mission: Mission) -> bytes:
    """Write a mission as GraphML; a ValueError names what GraphML cannot hold."""
    graph: nx.Graph[Any] = nx.node_link_graph(mission_content(mission), edges="edges")
    if "kinds" in graph.graph:
        graph.graph["kinds"] = json.dumps(graph.graph["kinds"], ensure_ascii=False)
    _flatten("the graph", graph.graph)
    for label, node in graph.nodes(data=True):
        if not isinstance(label, str):
            expected = "a label that is text, as all labels in GraphML"
            raise ValueError(f"Node {quoted(label)}: expected {expected}; {_REMEDY}")
        if node.get("pos") is not None and not {"x", "y"} & node.keys():
            node["x"], node["y"] = node.pop("pos")
        _flatten(f"node {quoted(label)}", node)
    for tail, head, arc in graph.edges(data=True):
        _flatten(f"arc {quoted(tail)} -> {quoted(head)}", arc)
    written = io.BytesIO()
    nx.write_graphml_xml(graph, written)
    return written.getvalue() + b"\n"


def _flatten(owner: str, attributes: dict[str, Any]) -> None:
    """Replace mappings from kinds by a column for each; a ValueError names what cannot be held."""
    given = [*attributes.items()]
    attributes.clear()
    for name, value in given:
        if name in BY_KIND and isinstance(value, Mapping):
            attributes |= {f"{name}:{kind}": number for kind, number in value.items()}
        elif name in _DEFAULTS or isinstance(value, bool | int | float | str):
            attributes[name] = value
        else:
            expected = f"numbers, booleans and texts, got {quoted(value)} for {quoted(name)}"
            raise ValueError(f"{owner}: expected {expected}; {_REMEDY}")


def is_graphml(source: Source) -> bool:
    """Return whether a file may be GraphML: it alone has its suffix."""
    return b"graphml" in source.data


GRAPHML = Format((".graphml",), is_graphml, read_graphml, write_graphml)
