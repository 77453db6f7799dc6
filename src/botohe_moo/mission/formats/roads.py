"""Graphs of roads as others draw them: what of them can be a mission, and what is left out."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import networkx as nx

from botohe_moo._base.checks import as_float, quoted
from botohe_moo.mission.formats.nodelink import Entry, graph_of

_MOST_NAMED = 5


def road_graph(
    of_mission: Mapping[str, Any],
    nodes: Iterable[Entry],
    arcs: Iterable[Entry],
    *,
    arc: str,
    node: str,
    left_out: Mapping[str, Iterable[str]],
    notes: Sequence[str] = (),
) -> nx.DiGraph[Any]:
    """Make a graph as `graph_of` does, without what cannot be part of a mission.

    Of parallel arcs the safest one stays. It, arcs from a node to itself, and nodes that the base
    does not reach or that have no way back are left out. A warning names them, what ``left_out``
    lists, and ends with ``notes``. In its words arcs are of the kind ``arc``, and nodes are a
    ``node``.
    """
    nodes, arcs = list(nodes), list(arcs)
    of_labels = [
        where
        for entries, names in ((nodes, ("id",)), (arcs, ("source", "target")))
        for where, _, attributes in entries
        if [attributes.pop(name) for name in names if name in attributes]
    ]
    kept, loops, parallel = _simple(arcs)
    graph = graph_of(of_mission, nodes, kept)
    base = of_mission["base"]
    if base not in graph:
        return graph  # which is refused
    joined = {base, *(nx.descendants(graph, base) & nx.ancestors(graph, base))}
    lost = [label for label in graph if label not in joined]
    graph.remove_nodes_from(lost)
    listed = {
        **left_out,
        "attributes id, source and target, which are labels in mission files": of_labels,
        f"{arc}s from a {node} to itself": loops,
        f"{arc}s parallel to one that is at least as safe": parallel,
        f"{node}s that the base does not reach, or that have no way back": map(quoted, lost),
    }
    texts = [text for what, names in listed.items() if (text := _named(what, names))]
    said = [f"Left out {'; '.join(texts)}."] if texts else []
    if said := [*said, *notes]:
        warnings.warn(" ".join(said), stacklevel=2)
    return graph


def _simple(arcs: Iterable[Entry]) -> tuple[list[Entry], list[str], list[str]]:
    """Return the safest arc between any two nodes, and which are left out: loops, and others."""
    safest: dict[tuple[Any, ...], Entry] = {}
    loops, parallel = [], []
    for arc in arcs:
        where, ends, attributes = arc
        if ends[0] == ends[1]:
            loops.append(where)
            continue
        rival = safest.setdefault(ends, arc)
        if rival is not arc:
            is_safer = as_float(attributes["survival"]) > as_float(rival[2]["survival"])
            parallel.append(rival[0] if is_safer else where)
            if is_safer:
                safest[ends] = arc
    return list(safest.values()), loops, parallel


def _named(what: str, names: Iterable[str]) -> str:
    """Return the text that names what is left out, empty if nothing is.

    The two arcs of a road are one.
    """
    listed = list(dict.fromkeys(names))
    shown = ", ".join(listed[:_MOST_NAMED]) + ", …" * (len(listed) > _MOST_NAMED)
    return f"{what}: {shown} ({len(listed)} in all)" if listed else ""
