"""Node-link JSON, the mission format; GraphML is converted to and from its data."""

from __future__ import annotations

import contextlib
import json
import math
from collections import Counter
from collections.abc import Hashable, Iterator
from numbers import Integral, Real
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError

_MAX_DEPTH = 50
# Checked by the validation of the mission.
_CHECKED = {
    "the graph": ("base", "robots", "max_length"),
    "node": ("reward",),
    "arc": ("survival", "length"),
}


def read_node_link(data: bytes, /) -> tuple[nx.Graph[Any], list[str]]:
    """Read node-link JSON in UTF-8, in which no object has a key twice; see `graph_from`."""
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
    return graph_from(content)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        (twice, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise MissionError(
            f"expected each key once in an object, found {quoted(twice)} again in {quoted(content)}"
        )
    return content


def decode(data: bytes, remedy: str = "") -> str:
    """Decode UTF-8, with or without a byte order mark; a MissionError ends with the remedy."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"the byte {data[error.start]:#04x} at position {error.start}"
        raise MissionError(f"expected text in UTF-8, found {found}{remedy}") from None


def graph_from(content: object) -> tuple[nx.Graph[Any], list[str]]:
    """Make a graph from node-link data.

    networkx' own ``node_link_graph`` would add nodes that only arcs name, let the last of several
    equal nodes or arcs win, and keep the base's label as a list.

    Gives the graph, empty if it is not directed and simple, and the faults: nodes and arcs that had
    to be left out, and attributes that no file can hold. A MissionError is raised if a key is
    missing or of a wrong type.
    """
    if not isinstance(content, dict):
        raise MissionError(f"expected node-link data, a JSON object, got {quoted(content)}")
    content = {"directed": False, "multigraph": False, "graph": {}, **content}
    if faults := _key_faults(content):
        raise MissionError(faults)
    if not content["directed"] or content["multigraph"]:
        return nx.Graph() if not content["multigraph"] else nx.MultiDiGraph(), []
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.graph.update(content["graph"])
    faults += _value_faults("the graph", "the graph", content["graph"])
    faults += [
        f"the graph: expected {key} to be text, got {quoted(content['graph'][key])}"
        for key in ("name", "title")
        if isinstance(content["graph"].get(key), dict | list)
    ]
    if "base" in graph.graph:
        with contextlib.suppress(ValueError):  # not a label, hence not a node either
            graph.graph["base"] = read_label(graph.graph["base"])
    for position, entry in enumerate(content["nodes"]):
        faults += _add_node(graph, f"nodes[{position}]", entry)
    for position, entry in enumerate(content["edges"]):
        faults += _add_arc(graph, f"edges[{position}]", entry)
    return graph, faults


def _key_faults(content: dict[str, Any]) -> list[str]:
    faults = []
    for key, kind, words in (
        ("directed", bool, "true or false"),
        ("multigraph", bool, "true or false"),
        ("graph", dict, "an object"),
        ("nodes", list, "a list"),
        ("edges", list, "a list"),
    ):
        if key not in content:
            hint = ""
            if key == "edges" and "links" in content:
                hint = ', but "links": nx.node_link_data(graph, edges="edges") writes "edges"'
            faults.append(f'expected the key "{key}", {words}; found no such key{hint}')
        elif not isinstance(content[key], kind):
            faults.append(f'expected the key "{key}" to hold {words}, got {quoted(content[key])}')
    return faults


def read_label(value: object) -> Hashable:
    """Convert a JSON value to a node label; raises ValueError if it cannot be one."""
    if value is None or isinstance(value, dict) or value != value:
        expected = "a string, a number, a boolean or a list of them"
        raise ValueError(f"expected a label, {expected}, got {quoted(value)}")
    plain: Hashable | list[Any] = _plain(value)
    if isinstance(plain, list):
        return tuple(None if item is None else read_label(item) for item in plain)
    return plain


def _value_faults(kind: str, owner: str, attributes: dict[str, Any]) -> Iterator[str]:
    """List the attributes that could not be written again."""
    for key, value in attributes.items():
        if key not in _CHECKED[kind]:
            try:
                _encodable(key)
                _plain(value)
            except ValueError as error:
                yield f"{owner}: attribute {quoted(key)}, {quoted(value)}: {error}"


def _add_node(graph: nx.DiGraph[Any], where: str, entry: object) -> list[str]:
    try:
        (label,), attributes = _labels(entry, "id")
    except ValueError as error:
        return [f"{where}: {error}"]
    if label in graph:
        return [f"node {quoted(label)}: is listed more than once, again as {where}"]
    graph.add_node(label)
    graph.nodes[label].update(attributes)
    return list(_value_faults("node", f"node {quoted(label)}", attributes))


def _add_arc(graph: nx.DiGraph[Any], where: str, entry: object) -> list[str]:
    try:
        (tail, head), attributes = _labels(entry, "source", "target")
    except ValueError as error:
        return [f"{where}: {error}"]
    arc = f"arc {quoted(tail)} -> {quoted(head)}"
    unknown = [label for label in dict.fromkeys((tail, head)) if label not in graph]
    if unknown:
        return [f"{arc}: there is no node {quoted(label)}" for label in unknown]
    if graph.has_edge(tail, head):
        return [f"{arc}: is listed more than once, again as {where}"]
    graph.add_edge(tail, head)
    graph.edges[tail, head].update(attributes)
    return list(_value_faults("arc", arc, attributes))


def _labels(entry: object, *keys: str) -> tuple[list[Hashable], dict[str, Any]]:
    """Split an entry into the labels under ``keys`` and its attributes."""
    if not isinstance(entry, dict):
        raise ValueError(f"expected an object, got {quoted(entry)}")
    if missing := [key for key in keys if key not in entry]:
        raise ValueError(f'found no key "{missing[0]}" in {quoted(entry)}')
    labels = []
    for key in keys:
        try:
            labels.append(read_label(entry[key]))
        except ValueError as error:
            raise ValueError(f'"{key}": {error}') from None
    return labels, {key: value for key, value in entry.items() if key not in keys}


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


def _plain(value: Any, depth: int = 0) -> Any:
    """Convert ``value`` to JSON's own types; raises ValueError."""
    if depth > _MAX_DEPTH:
        raise ValueError(f"it is nested too deeply, more than {_MAX_DEPTH} times")
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _encodable(value)
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        if not math.isfinite(value):
            raise ValueError("JSON has no infinite numbers and no NaN")
        return float(value)
    if isinstance(value, list | tuple):
        return [_plain(item, depth + 1) for item in value]
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return {_encodable(key): _plain(item, depth + 1) for key, item in value.items()}
    raise ValueError(f"JSON has no {type(value).__name__}")


def _encodable(text: str) -> str:
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{quoted(text)} is not valid Unicode text") from None
    return text
