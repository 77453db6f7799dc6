"""Node-link JSON, the mission format of this package; other formats write its content, too."""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import fields
from numbers import Real
from typing import Any

import numpy as np
from pydantic import AliasChoices, BaseModel, Field

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import validated
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import ONLY_KIND, Kind, MissionError, read_label, whose

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
        own["kinds"] = [
            {f.name: v for f in fields(kind) if (v := getattr(kind, f.name)) != f.default}
            for kind in mission.kinds
        ]
    # The mission's own values win over those of its graph, in whose places they stand.
    kept = {"name": None} | graph.graph | own | {"name": mission.name}
    kept.pop("robots" if "kinds" in own else "kinds", None)
    if mission.pays == "arrival" and "pays" not in graph.graph:
        del kept["pays"]
    about = {"directed": True, "multigraph": False, "graph": _entry("the graph", kept)}
    return {**about, "nodes": nodes, "edges": arcs}


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
