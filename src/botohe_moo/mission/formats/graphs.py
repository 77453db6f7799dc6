"""Graphs as networkx writes them: node-link JSON, the mission format of this package, and GraphML.

Other formats write the content of a node-link file, too.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import fields
from numbers import Real
from typing import Any
from xml.etree import ElementTree as ET

import networkx as nx
import numpy as np
from pydantic import AliasChoices, BaseModel, Field

from botohe_moo.base.files import FLAGS
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import validated
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import BY_KIND, ONLY_KIND, Kind, MissionError, read_label, whose
from botohe_moo.mission.scenarios import Scenario

as_json = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode


class _Content(BaseModel, defer_build=True, strict=True):
    directed: bool = False
    multigraph: bool = False
    graph: dict[str, Any] = {}
    nodes: list[Any]
    edges: list[Any] = Field(validation_alias=AliasChoices("edges", "links"))  # as networkx < 3.4


def is_node_link(source: Source) -> bool:
    """Return whether a file is node-link JSON, with any faults."""
    return isinstance(source.json.get("nodes"), list) and "adjacency" not in source.json


def read_node_link(source: Source) -> Draft:
    """Read node-link JSON.

    networkx' own ``node_link_graph`` would add nodes that only arcs name, let the last of several
    equal nodes or arcs win, and keep the base's label as a list. A MissionError names what is not
    node-link data.
    """
    content = validated(source.json, _Content)
    faults = ["expected at most one arc from a node to another"] if content.multigraph else []
    nodes = [*_rows("nodes", content.nodes, "id")]
    arcs = [*_rows("edges", content.edges, "source", "target")]
    return Draft(nodes, arcs, content.graph, faults, content.directed)


def _rows(table: str, entries: list[Any], *names: str) -> Iterator[Row]:
    """Split entries into their labels, which have some names, and their attributes."""
    for i, entry in enumerate(entries):
        where = f"{table}[{i}]"
        if not isinstance(entry, dict) or not entry.keys() >= {*names}:
            expected = f"an object with {' and '.join(names)}"
            raise MissionError(f"{where}: expected {expected}, got {quoted(entry)}")
        labels = tuple(entry[name] for name in names)
        yield Row(where, labels, {key: entry[key] for key in entry if key not in names})


def mission_content(mission: Mission) -> dict[str, Any]:
    """Convert a mission to node-link data; a ValueError names what JSON cannot hold."""
    graph = mission.graph
    nodes = [_entry(whose(node), of, id=plain_label(node)) for node, of in graph.nodes(data=True)]
    label_of = {node: entry["id"] for node, entry in zip(graph, nodes, strict=True)}
    arcs = []
    for tail, head, of in graph.edges(data=True):
        ends = {"source": label_of[tail], "target": label_of[head]}
        arcs.append(_entry(whose(tail, head), of, **ends))
    own = {attribute: getattr(mission, attribute) for attribute in ("base", "robots", "pays")}
    if _has_kinds(mission):
        own["kinds"] = [*map(_changed, mission.kinds)]
    own["scenarios"] = [_scenario_entry(of, label_of) for of in mission.scenarios]
    # The mission's own values win over those of its graph, in whose places they stand.
    kept = {"name": None} | graph.graph | own | {"name": mission.name}
    kept.pop("robots" if "kinds" in own else "kinds", None)
    if not mission.scenarios:
        del kept["scenarios"]
    if mission.pays == "arrival" and "pays" not in graph.graph:
        del kept["pays"]
    about = {"directed": True, "multigraph": False, "graph": _entry("the graph", kept)}
    return {**about, "nodes": nodes, "edges": arcs}


def _scenario_entry(scenario: Scenario, label_of: Mapping[Any, Any]) -> dict[str, Any]:
    """Return a scenario as JSON holds it; :func:`scenarios.read_scenarios` reads it."""
    arcs, nodes = scenario.survival.items(), scenario.reward.items()
    own = _changed(scenario)
    own["survival"] = [[label_of[u], label_of[v], number] for (u, v), number in arcs]
    own["reward"] = [[label_of[v], number] for v, number in nodes]
    return {name: value for name, value in own.items() if value != []}


def _changed(of: Kind | Scenario) -> dict[str, Any]:
    """Return the parameters of a kind or a scenario that are not at their defaults."""
    return {f.name: v for f in fields(of) if (v := getattr(of, f.name)) != f.default}


def _has_kinds(mission: Mission) -> bool:
    """Return whether a mission has kinds, and not a number of robots only."""
    values: Any = (*mission.graph.nodes(data="share"), *mission.graph.edges(data="survival"))
    is_plain = mission.kinds == (Kind(ONLY_KIND, mission.robots),)
    return not is_plain or any(isinstance(value, Mapping) for *_, value in values)


def write_node_link(mission: Mission) -> bytes:
    """Write a mission as node-link JSON, one line for each node and arc."""
    content = mission_content(mission)
    lines = [f' "{key}": {as_json(content[key])}' for key in ("directed", "multigraph", "graph")]
    for key in ("nodes", "edges"):
        entries = ",".join(f"\n  {as_json(entry)}" for entry in content[key])
        lines.append(f' "{key}": [{entries}\n ]')
    return "{{\n{}\n}}\n".format(",\n".join(lines)).encode()


def plain_label(label: Hashable) -> object:
    """Convert a label to a JSON value from which an equal label is read."""
    try:
        plain = _plain(label)
        if label != read_label(plain):
            raise ValueError(f"it would come back as {quoted(plain)}")
    except (TypeError, ValueError) as error:
        raise ValueError(f"Node {quoted(label)} cannot be saved by its label: {error}.") from None
    return plain


def _entry(owner: str, attributes: Mapping[str, Any], **labels: Any) -> dict[str, Any]:
    """Return labels and attributes as JSON holds them; a ValueError names their owner."""
    try:
        if taken := labels.keys() & attributes.keys():
            raise ValueError(f"{min(taken)!r} is the name of a label")
        return {**labels, **_plain(attributes)}
    except (TypeError, ValueError) as error:
        raise ValueError(f"{owner}: {quoted(attributes)} cannot be saved: {error}.") from None


def _plain(value: object) -> Any:
    """Return what is read again of ``value`` if it is written as JSON."""
    return json.loads(json.dumps(value, default=_number, allow_nan=False))


def _number(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Real):
        return float(value)
    raise TypeError(f"JSON has no {type(value).__name__}")


NODE_LINK = Format((".json",), is_node_link, read_node_link, write_node_link)

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
    for name in {"kinds", "scenarios"} & about.keys():
        try:
            about[name] = json.loads(about[name])
        except (TypeError, ValueError) as error:
            faults.append(f"expected {name} as JSON, got {quoted(about.pop(name))}: {error}")
    return Draft(nodes, arcs, about, faults, directed=directed)


def write_graphml(mission: Mission) -> bytes:
    """Write a mission as GraphML; a ValueError names what GraphML cannot hold."""
    graph: nx.Graph[Any] = nx.node_link_graph(mission_content(mission), edges="edges")
    for name in {"kinds", "scenarios"} & graph.graph.keys():
        graph.graph[name] = json.dumps(graph.graph[name], ensure_ascii=False)
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
