"""Node-link JSON, the mission format; GraphML is converted to and from its data."""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Iterable, Mapping
from numbers import Integral, Real
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError

_KEYS = {"directed": bool, "multigraph": bool, "graph": dict, "nodes": list, "edges": list}
_WORDS = {bool: "true or false", dict: "an object", list: "a list"}

# Where an entry is in its file, its labels, and its attributes.
Entry = tuple[str, tuple[Any, ...], Mapping[str, Any]]


def read_node_link(data: bytes, /) -> nx.Graph[Any]:
    """Read node-link JSON in UTF-8.

    networkx' own ``node_link_graph`` would add nodes that only arcs name, let the last of several
    equal nodes or arcs win, and keep the base's label as a list. A MissionError is raised for what
    is not node-link data, and as in `graph_of`.
    """
    text = decode(data)
    try:
        content = json.loads(text, object_pairs_hook=_object)
    except MissionError:
        raise
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise MissionError(f"{where}: expected JSON, found: {error.msg}") from None
    except ValueError as error:  # an integer of thousands of digits
        raise MissionError(f"expected JSON of numbers in range, found: {error}") from None
    if not isinstance(content, dict):
        raise MissionError(f"expected node-link data, a JSON object, got {quoted(content)}")
    content = {"directed": False, "multigraph": False, "graph": {}, **content}
    if faults := _key_faults(content):
        raise MissionError(faults)
    if not content["directed"] or content["multigraph"]:
        return nx.MultiDiGraph() if content["multigraph"] else nx.Graph()  # which are refused
    own = content["graph"]
    nodes = [_entry(f"nodes[{i}]", entry, "id") for i, entry in enumerate(content["nodes"])]
    arcs = [
        _entry(f"edges[{i}]", entry, "source", "target") for i, entry in enumerate(content["edges"])
    ]
    if "base" in own:
        own["base"] = read_label(own["base"])
    return graph_of(own, nodes, arcs)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON, which has each key once."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        again = next(key for key in keys if keys.count(key) > 1)
        raise MissionError(f"expected each key once in an object, found {quoted(again)} again")
    return found


def decode(data: bytes, remedy: str = "") -> str:
    """Decode UTF-8, with or without a byte order mark; a MissionError ends with the remedy."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"the byte {data[error.start]:#04x} at position {error.start}"
        raise MissionError(f"expected text in UTF-8, found {found}{remedy}") from None


def _key_faults(content: dict[str, Any]) -> list[str]:
    faults = []
    for key, kind in _KEYS.items():
        if key not in content:
            hint = ', but "links": nx.node_link_data(graph, edges="edges") writes "edges"'
            hint = hint if key == "edges" and "links" in content else ""
            faults.append(f'expected the key "{key}", {_WORDS[kind]}; found no such key{hint}')
        elif not isinstance(content[key], kind):
            found = quoted(content[key])
            faults.append(f'expected the key "{key}" to hold {_WORDS[kind]}, got {found}')
    return faults


def _entry(where: str, entry: object, *keys: str) -> Entry:
    """Split an entry into its labels and its attributes."""
    if not isinstance(entry, dict):
        raise MissionError(f"{where}: expected an object, got {quoted(entry)}")
    if missing := [key for key in keys if key not in entry]:
        raise MissionError(f'{where}: found no key "{missing[0]}" in {quoted(entry)}')
    try:
        labels = tuple(read_label(entry.pop(key)) for key in keys)
    except ValueError as error:
        raise MissionError(f"{where}: {error}") from None
    return where, labels, entry


def read_label(value: object) -> Hashable:
    """Convert a JSON value to a node label; raises ValueError if it cannot be one."""
    if isinstance(value, list):
        return tuple(None if item is None else read_label(item) for item in value)
    if value is None or isinstance(value, dict):
        expected = "a string, a number, a boolean or a list of them"
        raise ValueError(f"expected a label, {expected}, got {quoted(value)}")
    return value


def graph_of(
    own: Mapping[str, Any], nodes: Iterable[Entry], arcs: Iterable[Entry]
) -> nx.DiGraph[Any]:
    """Make a graph with attributes of its own, of entries for its nodes and for its arcs.

    A MissionError lists the nodes and arcs that are there more than once, and the arcs whose ends
    are not among the nodes.
    """
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.graph.update(own)
    faults = []
    for where, (label,), attributes in nodes:
        if label in graph:
            faults.append(f"{where}: node {quoted(label)} is listed more than once")
        graph.add_node(label)
        graph.nodes[label].update(attributes)  # whose names may be those of parameters
    for where, (tail, head), attributes in arcs:
        arc = f"{where}: arc {quoted(tail)} -> {quoted(head)}"
        unknown = [label for label in dict.fromkeys((tail, head)) if label not in graph]
        faults += [f"{arc}: there is no node {quoted(label)}" for label in unknown]
        if graph.has_edge(tail, head):
            faults.append(f"{arc} is listed more than once")
        if not unknown:
            graph.add_edge(tail, head)
            graph.edges[tail, head].update(attributes)
    if faults:
        raise MissionError(faults)
    return graph


def mission_content(mission: Mission) -> dict[str, Any]:
    """Convert a mission to node-link data; a ValueError names what JSON cannot hold."""
    graph = mission.graph
    own = {"name": None, **graph.graph, "base": None}
    own.update(name=mission.name, robots=mission.robots)  # not the graph's, which may differ
    own = _attributes("the graph", own) | {"base": plain_label(mission.base)}
    nodes = [
        {"id": plain_label(node), **_attributes(f"node {quoted(node)}", attributes, "id")}
        for node, attributes in graph.nodes(data=True)
    ]
    arcs = []
    for tail, head, attributes in graph.edges(data=True):
        arc = f"arc {quoted(tail)} -> {quoted(head)}"
        ends = {"source": plain_label(tail), "target": plain_label(head)}
        arcs.append({**ends, **_attributes(arc, attributes, "source", "target")})
    return {"directed": True, "multigraph": False, "graph": own, "nodes": nodes, "edges": arcs}


def write_node_link(content: dict[str, Any]) -> bytes:
    """Write node-link data as JSON, one line for each node and arc."""
    written = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
    lines = [f' "{key}": {written(content[key])}' for key in ("directed", "multigraph", "graph")]
    for key in ("nodes", "edges"):
        entries = ",".join(f"\n  {written(entry)}" for entry in content[key])
        lines.append(f' "{key}": [{entries}\n ]')
    return "{{\n{}\n}}\n".format(",\n".join(lines)).encode()


def plain_label(label: Hashable) -> object:
    """Convert a label to a JSON value from which an equal label is read."""
    try:
        plain = _plain(label)
        if label == read_label(plain):
            return plain
        reason = f"it would come back as {quoted(plain)}"
    except ValueError as error:
        reason = str(error)
    raise ValueError(f"Node {quoted(label)} cannot be saved under its label: {reason}.")


def _attributes(owner: str, attributes: dict[Any, Any], *reserved: str) -> dict[str, Any]:
    plain = {}
    for key, value in attributes.items():
        if not isinstance(key, str) or key in reserved:
            expected = f"a string other than {' and '.join(reserved)}" if reserved else "a string"
            found = f"expected {expected} as an attribute's name, got {quoted(key)}"
            raise ValueError(f"{owner}: {found}.")
        try:
            plain[key] = _plain(value)
        except ValueError as error:
            raise ValueError(
                f"{owner}: attribute {quoted(key)}, {quoted(value)}, cannot be saved: {error}."
            ) from None
    return plain


def _plain(value: Any) -> Any:
    """Convert ``value`` to JSON's own types; raises ValueError."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        if not math.isfinite(value):
            raise ValueError("JSON has no infinite numbers and no NaN")
        return float(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return {key: _plain(item) for key, item in value.items()}
    raise ValueError(f"JSON has no {type(value).__name__}")
