"""GraphML, as networkx, Gephi and yEd write it."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from typing import Any
from xml.etree import ElementTree as ET

import networkx as nx

from botohe_moo.base.messages import quoted
from botohe_moo.base.numbers import FLAGS
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import BY_KIND, MissionError, whose

_DEFAULTS = ("node_default", "edge_default")  # which networkx writes as defaults
_REMEDY = "a .json file can hold it."
_TYPES: dict[str, Callable[[str], Any]] = dict.fromkeys(("int", "integer", "long"), int)
_TYPES |= dict.fromkeys(("float", "double"), float)
_TYPES |= {"string": str, "boolean": lambda text: FLAGS[text.lower()]}


def read_graphml(source: Source) -> Draft:
    """Read GraphML.

    Labels are the ids of nodes, hence texts. The attributes ``x`` and ``y`` become ``pos``, and a
    name that yEd has drawn on a node becomes ``label``. A MissionError names the values that are
    not of their declared type.

    networkx' own reader would take the places of yEd's drawings for ``x`` and ``y``, add nodes that
    only arcs name, and stop at the first value that is not of its type.
    """
    try:
        root = ET.fromstring(source.data)
    except (ET.ParseError, LookupError, ValueError) as error:  # also of an unknown encoding
        raise MissionError(f"expected GraphML, found {quoted(str(error))}") from None
    if len(graphs := root.findall("{*}graph")) != 1:
        raise MissionError(f"expected GraphML with one directed graph, found {len(graphs)} graphs")
    graph = graphs[0]
    keys = {key.get("id"): key for key in root.iterfind("{*}key")}
    defaults = [(key.get("for"), i, key.findall("{*}default")) for i, key in keys.items()]
    faults = ["expected edges only, found a hyperedge" for _ in graph.iterfind("{*}hyperedge")]

    def row(element: ET.Element, *names: str) -> Row:
        labels, tag = tuple(map(element.get, names)), element.tag.rpartition("}")[2]
        owner = whose(*labels) if labels else "the graph"
        values = [(i, value) for of, i, found in defaults if of in (tag, "all") for value in found]
        values += [(data.get("key"), data) for data in element.iterfind("{*}data")]
        attributes: dict[str, Any] = {}
        for i, value in values:
            if i not in keys:
                faults.append(f"{owner}: there is no key {quoted(i)}")
                continue
            if drawn := value.findtext(".//{*}NodeLabel", "").strip():
                attributes.setdefault("label", drawn)
            name, kind = keys[i].get("attr.name"), keys[i].get("attr.type", "string")
            text = value.text or ""
            # What yEd draws, and empty cells.
            if name is None or len(value) or not (text or kind == "string"):
                continue
            try:
                attributes[name] = _TYPES[kind](text)
            except (KeyError, ValueError):
                of = kind if kind in _TYPES else f"{quoted(kind)}, one of {', '.join(_TYPES)}"
                faults.append(f"{owner}: expected {quoted(name)} of type {of}, got {quoted(text)}")
        if {"x", "y"} <= attributes.keys() and "pos" not in attributes:
            attributes["pos"] = [attributes.pop("x"), attributes.pop("y")]
        faults.extend(f"{owner}: expected {n}, found none" for n in names if element.get(n) is None)
        return Row("the GraphML", tuple(label or "" for label in labels), attributes)

    nodes = [row(node, "id") for node in graph.iterfind(".//{*}node")]
    arcs = [row(arc, "source", "target") for arc in graph.iterfind(".//{*}edge")]
    about, default = row(graph).attributes, str(graph.get("edgedefault") == "directed").lower()
    arrows = [arc.get("directed", default) == "true" for arc in graph.iterfind(".//{*}edge")]
    directed = all(arrows) if arrows else default == "true"
    try:
        about |= {"kinds": json.loads(about["kinds"])} if "kinds" in about else {}
    except (TypeError, ValueError) as error:
        faults.append(f"expected kinds as JSON, got {quoted(about.pop('kinds'))}: {error}")
    return Draft(nodes, arcs, about, faults, directed=directed)


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
        _flatten(whose(label), node)
    for *ends, arc in graph.edges(data=True):
        _flatten(whose(*ends), arc)
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


# No other format has this suffix.
GRAPHML = Format((".graphml",), lambda _: True, read_graphml, write_graphml)
