"""GraphML, as networkx, Gephi and yEd write it."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
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
_LONGEST = 200  # letters of what networkx says
_DEFAULTS = ("node_default", "edge_default")  # where networkx keeps them
_FLAGS = {"true": True, "1": True, "false": False, "0": False}
# What a value of a declared type is called, and how networkx reads it.
_TYPES: dict[str, tuple[str, Any]] = {
    "string": ("a text", str),
    "boolean": (
        "true or false",
        lambda text: {"true": 1, "false": 0, "1": 1, "0": 0}[text.lower()],
    ),
    **dict.fromkeys(("int", "integer", "long"), ("an integer", int)),
    **dict.fromkeys(("float", "double"), ("a number", float)),
}


def read_graphml(source: Source) -> Draft:
    """Read GraphML with networkx.

    Labels are the ids of nodes, hence texts. The node attributes ``x`` and ``y`` become ``pos``,
    and a name that yEd has drawn becomes ``label``. ``kinds`` are JSON. A MissionError names the
    values that are not of their declared type.
    """
    try:
        root = ET.fromstring(source.data)
        if (n_graphs := len(root.findall("{*}graph"))) > 1:
            raise MissionError(f"expected GraphML with one directed graph, found {n_graphs} graphs")
        names = _without_drawings(root)
        if faults := list(_value_faults(root)):
            raise MissionError(faults)
        found = nx.parse_graphml(ET.tostring(root, "unicode"), force_multigraph=True)
    except MissionError:
        raise
    except _OF_NETWORKX as error:
        said = f"{type(error).__name__}: {error}"[:_LONGEST]  # which may quote a whole file
        raise MissionError(f"expected GraphML with one directed graph, found {said}") from None
    of_nodes, of_arcs = (found.graph.pop(key, {}) for key in _DEFAULTS)
    nodes = [
        Row("the GraphML", (node,), _placed({**of_nodes, **names.get(node, {}), **attributes}))
        for node, attributes in found.nodes(data=True)
    ]
    arcs = [
        Row("the GraphML", (tail, head), {**of_arcs, **attributes})
        for tail, head, attributes in found.edges(data=True)
    ]
    if (text := found.graph.get("kinds")) is not None:
        try:
            found.graph["kinds"] = json.loads(text)
        except (TypeError, ValueError) as error:
            raise MissionError(f"expected kinds as JSON, got {quoted(text)}: {error}") from None
    return Draft(nodes, arcs, found.graph, directed=found.is_directed())


def _without_drawings(root: ET.Element) -> dict[str | None, dict[str, str]]:
    """Remove what yEd draws; return the names on its nodes.

    networkx would take the places of drawings for the attributes ``x`` and ``y``.
    """
    names = {}
    for owner in list(root.iter()):
        for drawing in [data for data in owner.findall("{*}data") if len(data)]:
            owner.remove(drawing)
            if name := drawing.findtext(".//{*}NodeLabel", "").strip():
                names[owner.get("id")] = {"label": name}
    return names


def _value_faults(root: ET.Element) -> Iterator[str]:
    """List the values that are not of their declared type; networkx does not say whose they are."""
    keys = {key.get("id"): key for key in root.findall("{*}key")}
    values = [("the default", key, key.findtext("{*}default")) for key in keys.values()]
    for owner in root.iter():
        named = "the graph" if owner.get("id") is None else f"node {owner.get('id')!r}"
        if owner.get("source"):
            named = f"arc {owner.get('source')!r} -> {owner.get('target')!r}"
        found = [data for data in owner.findall("{*}data") if data.get("key") in keys]
        values += [(named, keys[data.get("key")], data.text) for data in found]
    for named, key, text in values:
        kind = key.get("attr.type", "string")
        expected, convert = _TYPES.get(kind, (f"a type among {', '.join(_TYPES)}", None))
        try:
            if text is not None:
                convert(text)
        except (KeyError, TypeError, ValueError):
            got = quoted(text if kind in _TYPES else kind)
            yield f"{named}: expected {expected} as {key.get('attr.name')}, got {got}"


def _placed(attributes: dict[str, Any]) -> dict[str, Any]:
    if "x" in attributes and "y" in attributes and "pos" not in attributes:
        attributes["pos"] = [attributes.pop("x"), attributes.pop("y")]
    return attributes


def write_graphml(mission: Mission) -> bytes:
    """Write a mission as GraphML; a ValueError names what GraphML cannot hold."""
    content = mission_content(mission)
    of_mission = content["graph"]
    if "kinds" in of_mission:
        of_mission["kinds"] = json.dumps(of_mission["kinds"], ensure_ascii=False)
    graph: nx.DiGraph[Any] = nx.DiGraph(**_writable("the graph", of_mission))
    for node in content["nodes"]:
        label = node.pop("id")
        if not isinstance(label, str):
            raise ValueError(
                f"Node {quoted(label)}: expected a label that is text, as all labels in GraphML; a "
                ".json file can hold it."
            )
        if node.get("pos") is not None and not {"x", "y"} & node.keys():
            node["x"], node["y"] = node.pop("pos")
        graph.add_nodes_from([(label, _writable(f"node {quoted(label)}", node))])
    for arc in content["edges"]:
        tail, head = arc.pop("source"), arc.pop("target")
        attributes = _writable(f"arc {quoted(tail)} -> {quoted(head)}", arc)
        graph.add_edges_from([(tail, head, attributes)])
    written = io.BytesIO()
    nx.write_graphml_xml(graph, written)
    return written.getvalue() + b"\n"


def _writable(owner: str, attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes with a column for each number of a kind; a ValueError names others."""
    split: dict[str, Any] = {}
    for name, value in attributes.items():
        if name in BY_KIND and isinstance(value, Mapping):
            split |= {f"{name}:{kind}": number for kind, number in value.items()}
        elif name in _DEFAULTS or isinstance(value, bool | int | float | str):
            split[name] = value
        else:
            raise ValueError(
                f"{owner}: expected numbers, booleans and texts, as GraphML holds them, got "
                f"{quoted(value)} for {quoted(name)}; a .json file can hold it."
            )
    return split


def is_graphml(source: Source) -> bool:
    """Return whether a file may be GraphML: it alone has its suffix."""
    return b"graphml" in source.data


GRAPHML = Format((".graphml",), is_graphml, read_graphml, write_graphml)
