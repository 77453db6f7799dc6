"""GraphML, as networkx, Gephi and yEd write it, to and from node-link data."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET
from xml.parsers import expat

import networkx as nx

from botohe_moo._base.checks import quoted
from botohe_moo.mission.formats.nodelink import graph_from
from botohe_moo.mission.validation import MissionError

_NAMESPACE = "http://graphml.graphdrawing.org/xmlns"
_LONGEST = 200  # characters of what a parser says
_NOT_IN_XML = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_TYPES = {bool: "boolean", int: "long", float: "double", str: "string"}
_PARSERS: dict[str, Callable[[str], object]] = {
    "boolean": {"true": True, "1": True, "false": False, "0": False}.__getitem__,
    "integer": int,  # Gephi's name for it
    "int": int,
    "long": int,
    "float": float,
    "double": float,
}
# Left in the graph's attributes by networkx' reader.
_BOOKKEEPING = ("node_default", "edge_default")


class _Key(NamedTuple):
    name: str
    type: str
    scope: str
    default: str | None


def read_graphml(data: bytes, /) -> tuple[nx.Graph[Any], list[str]]:
    """Read GraphML with one graph; see `botohe_moo.mission.formats.nodelink.graph_from`.

    Node labels are the nodes' ids, hence strings, and so is the base, whatever its declared type. A
    value that is not of its declared type stays a string, and the mission's validation names its
    node or arc. Document types are refused: they could define entities that grow without end.
    """
    root = _parse(data)
    if root.tag.rpartition("}")[2] != "graphml":
        raise MissionError(f"expected the XML element graphml, got {quoted(root.tag)}")
    graphs = root.findall("{*}graph")
    if len(graphs) != 1:
        raise MissionError(f"expected one graph in the GraphML, found {len(graphs)}")
    found = graphs[0]
    keys = _keys(root)
    edges = found.findall(".//{*}edge")
    directed = found.get("edgedefault") == "directed"
    faults = [
        f"arc {quoted(edge.get('source'))} -> {quoted(edge.get('target'))}: "
        "expected it to be directed"
        for edge in edges
        if edge.get("directed", str(directed).lower()) not in ("true", "1")
    ]
    directed = directed or len(faults) < len(edges)  # some tools say it at every arc only
    if found.find(".//{*}hyperedge") is not None:
        faults.append("expected arcs from one node to another, found hyperedges")
    content = {
        "directed": directed,
        "graph": _values(found, "graph", keys, faults),
        "nodes": [_entry(node, "node", keys, faults, "id") for node in found.findall(".//{*}node")],
        "edges": [_entry(edge, "edge", keys, faults, "source", "target") for edge in edges],
    }
    graph, omitted = graph_from(content)
    return graph, faults + omitted if directed else []


def _parse(data: bytes) -> ET.Element:
    guard = expat.ParserCreate()
    guard.StartDoctypeDeclHandler = _refuse_document_type
    try:
        guard.Parse(data, True)
        return ET.fromstring(data)
    except expat.ExpatError as error:
        where = f"line {error.lineno}, column {error.offset + 1}"
        found = expat.ErrorString(error.code)
        raise MissionError(f"{where}: expected XML, found: {found}") from None
    except MissionError:
        raise
    except (LookupError, ValueError, ET.ParseError) as error:  # an unknown encoding
        raise MissionError(f"expected XML, found: {str(error)[:_LONGEST]}") from None


def _refuse_document_type(name: str, *_: object) -> None:
    raise MissionError(
        f"expected XML without a document type, found <!DOCTYPE {quoted(name)[1:-1]}>; "
        "remove that declaration"
    )


def _keys(root: ET.Element) -> dict[str, _Key | None]:
    """Read the declared attributes; None for drawing instructions of yEd."""
    keys: dict[str, _Key | None] = {}
    for element in root.findall("{*}key"):
        keys[element.get("id", "")] = None
        if (name := element.get("attr.name")) is not None:
            type_, scope = element.get("attr.type", "string"), element.get("for", "all")
            default = element.findtext("{*}default")
            keys[element.get("id", "")] = _Key(name, type_, scope, default)
    return keys


def _values(
    element: ET.Element, scope: str, keys: dict[str, _Key | None], faults: list[str]
) -> dict[str, Any]:
    values = {
        key.name: _value(key, key.default)
        for key in keys.values()
        if key is not None and key.default is not None and key.scope in (scope, "all")
    }
    given = set()
    for data in element.findall("{*}data"):
        name = data.get("key", "")
        if name not in keys:
            faults.append(f"the {scope} data {quoted(name)}: there is no key of that id")
        elif (key := keys[name]) is not None:
            if key.name in given:
                faults.append(f"the {scope} data {quoted(key.name)}: is there more than once")
            given.add(key.name)
            values[key.name] = _value(key, data.text or "")
    return {name: value for name, value in values.items() if name not in _BOOKKEEPING}


def _value(key: _Key, text: str) -> Any:
    text = _line_ends(text)
    if key.name == "base" and key.scope in ("graph", "all"):
        return text
    try:
        return _PARSERS[key.type](text.strip().lower())
    except (KeyError, ValueError):
        return text


def _line_ends(text: str) -> str:
    """Normalise line ends as XML's readers do, also those written as ``&#13;``."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _entry(
    element: ET.Element, scope: str, keys: dict[str, _Key | None], faults: list[str], *labels: str
) -> dict[str, Any]:
    values = _values(element, scope, keys, faults)
    entry = {key: value for key, value in values.items() if key not in labels}
    ends = {label: _line_ends(text) for label, text in element.attrib.items() if label in labels}
    entry = {**entry, **ends}
    position = [entry.get("x"), entry.get("y")]
    if scope == "node" and "pos" in entry:
        owner = f"node {quoted(entry.get('id'))}"
        faults.append(f"{owner}: expected its place as the numbers x and y, found the data 'pos'")
    elif scope == "node" and all(type(p) in (int, float) for p in position):
        del entry["x"], entry["y"]
        entry["pos"] = position
    return entry


def write_graphml(content: dict[str, Any]) -> bytes:
    """Write node-link data as GraphML; a ValueError names what GraphML cannot hold."""
    root = ET.Element("graphml", xmlns=_NAMESPACE)
    graph = ET.Element("graph", edgedefault="directed")
    ids: dict[tuple[str, str, str], str] = {}
    entries = [("graph", "the graph", graph, content["graph"])]
    for node in content["nodes"]:
        label = _text("a node's label", node.pop("id"))
        element = ET.SubElement(graph, "node", id=label)
        entries.append(("node", f"node {quoted(label)}", element, _with_coordinates(label, node)))
    for arc in content["edges"]:
        tail, head = arc.pop("source"), arc.pop("target")
        element = ET.SubElement(graph, "edge", source=tail, target=head)
        entries.append(("edge", f"arc {quoted(tail)} -> {quoted(head)}", element, arc))
    for scope, owner, element, attributes in entries:
        for position, (id_, text) in enumerate(_data(scope, owner, attributes, ids)):
            data = ET.Element("data", key=id_)
            data.text = text
            element.insert(position, data)
    for (scope, name, type_), id_ in ids.items():
        declared = {"id": id_, "for": scope, "attr.name": name, "attr.type": type_}
        ET.SubElement(root, "key", declared)
    root.append(graph)
    ET.indent(root, " ")
    written: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"


def _data(
    scope: str, owner: str, attributes: dict[str, Any], ids: dict[tuple[str, str, str], str]
) -> Iterator[tuple[str, str]]:
    for name, value in attributes.items():
        if name in _BOOKKEEPING:
            continue
        if type(value) not in _TYPES:
            raise _unwritable(
                f"{owner}: attribute {quoted(name)}, {quoted(value)}, is not a number, boolean or "
                "string, and GraphML has nothing else"
            )
        key = (scope, _text("an attribute's name", name), _TYPES[type(value)])
        text = str(value).lower() if isinstance(value, bool) else str(value)
        yield ids.setdefault(key, f"d{len(ids)}"), _text(f"{owner}: attribute {quoted(name)}", text)


def _with_coordinates(label: str, node: dict[str, Any]) -> dict[str, Any]:
    if "pos" not in node:
        return node
    numbers = isinstance(node["pos"], list) and all(type(p) in (int, float) for p in node["pos"])
    if not numbers or len(node["pos"]) != 2 or "x" in node or "y" in node:
        expected = "expected pos to be [x, y] for GraphML's attributes x and y"
        raise _unwritable(f"node {quoted(label)}: {expected}, got {quoted(node)}")
    x, y = node.pop("pos")
    return {**node, "x": x, "y": y}


def _text(what: str, value: object) -> str:
    if not isinstance(value, str):
        expected = f"expected {what} to be a string, as GraphML knows no other"
        raise _unwritable(f"{expected}, got {quoted(value)}")
    if forbidden := _NOT_IN_XML.search(value):
        found = forbidden.group()
        raise _unwritable(f"{what}: XML has no character {found!r}, got {quoted(value)}")
    return value


def _unwritable(reason: str) -> ValueError:
    return ValueError(f"{reason}; a .json file can hold it.")
