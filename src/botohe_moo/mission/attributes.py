"""What attributes of nodes and arcs may be, and what is wrong with them, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, most_alike, quoted
from botohe_moo.mission.kinds import Kind


def is_amount(value: object) -> bool:
    """Return whether a value is a finite number, at least 0."""
    return 0 <= as_float(value) < math.inf


def _is_place(value: Any) -> bool:
    try:
        x, y = map(as_float, value)
    except (TypeError, ValueError):
        return value is None
    return math.isfinite(x) and math.isfinite(y)


PAYS = ("arrival", "return")

_Rules = dict[str, tuple[str, Callable[[Any], bool]]]
_OF_NODES: _Rules = {
    "reward": ("a finite reward >= 0", is_amount),
    "pos": ("pos [x, y], two finite numbers", _is_place),
    "share": ("share in [0, 1]", lambda value: 0 <= as_float(value) <= 1),
    "pays": (
        "pays to be 'arrival' or 'return'",
        lambda value: isinstance(value, str) and value in PAYS,
    ),
    "depot": ("depot to be true or false", lambda value: isinstance(value, bool | np.bool_)),
}
_OF_ARCS: _Rules = {
    "survival": ("survival in (0, 1]", lambda value: 0 < as_float(value) <= 1),
    "length": ("a finite length >= 0", is_amount),
}
_OPTIONAL = ("pos", "length", "share", "pays", "depot")
# Attributes that may have a number for each kind, and what the number may be then.
BY_KIND: _Rules = {
    "survival": ("survival in [0, 1]", lambda value: 0 <= as_float(value) <= 1),
    "share": _OF_NODES["share"],
}


def attribute_of(column: str) -> str | None:
    """Return the attribute of which a column, ``survival:drone``, has the numbers of one kind."""
    name, colon, _ = column.partition(":")
    return name if colon and name in BY_KIND else None


def attribute_faults(graph: nx.DiGraph[Any], kinds: Sequence[Kind] = ()) -> Iterator[str]:
    """List the attributes of nodes and arcs that are missing or wrong.

    Numbers for a kind that there is not are one fault, however many nodes and arcs have them.
    """
    unknown: dict[tuple[str, str], list[str]] = {}
    for node, attributes in graph.nodes(data=True):
        for kind in _unknown(attributes.get("share"), kinds):
            unknown.setdefault(("share", kind), []).append(f"node {quoted(node)}")
    for tail, head, attributes in graph.edges(data=True):
        for kind in _unknown(attributes.get("survival"), kinds):
            arc = f"arc {quoted(tail)} -> {quoted(head)}"
            unknown.setdefault(("survival", kind), []).append(arc)
    for (name, kind), (first, *others) in unknown.items():
        near = most_alike(kind, [known.name for known in kinds])
        where = f"{first} and {len(others)} more" if others else first
        yield f"{where}: {name} of kind {quoted(kind)}: there is no such kind{near}"
    for node, attributes in graph.nodes(data=True):
        for fault in _faults_of(attributes, _OF_NODES, kinds):
            yield f"node {quoted(node)}: {fault}"
    for tail, head, attributes in graph.edges(data=True):
        for fault in _faults_of(attributes, _OF_ARCS, kinds):
            yield f"arc {quoted(tail)} -> {quoted(head)}: {fault}"


def _unknown(value: object, kinds: Sequence[Kind]) -> list[str]:
    """Return the kinds of an attribute that the mission does not list, as texts."""
    if not isinstance(value, Mapping) or not kinds:
        return []
    names = [kind.name for kind in kinds]
    return [str(kind) for kind in value if kind not in names]


def _faults_by_kind(name: str, value: Mapping[Any, Any], kinds: Sequence[Kind]) -> Iterator[str]:
    """List the faults of an attribute that has a number for each kind."""
    names = [kind.name for kind in kinds]
    expected, is_valid = BY_KIND[name]
    for kind, number in value.items():
        if kind in names and not is_valid(number):
            yield f"expected {expected} of kind {quoted(kind)}, got {quoted(number)}{_hint(number)}"
    # A kind that is not listed may be the missing one, misspelt.
    if name == "survival" and not _unknown(value, kinds):
        for kind in names:
            if kind not in value:
                yield f"expected {expected} of kind {quoted(kind)}, found none"


def _faults_of(
    attributes: Mapping[str, Any], rules: _Rules, kinds: Sequence[Kind]
) -> Iterator[str]:
    for name in attributes:
        if attribute := attribute_of(str(name)):  # in GraphML it would be read as that of a kind
            found = f"found an attribute {quoted(name)}, which stands in tables and GraphML only"
            yield f"expected {attribute} to be a mapping from kinds to numbers, {found}"
    for name, (expected, is_valid) in rules.items():
        if name not in attributes:
            if name not in _OPTIONAL:
                yield f"expected {expected}, found no attribute {name!r}"
        elif kinds and name in BY_KIND and isinstance(attributes[name], Mapping):
            yield from _faults_by_kind(name, attributes[name], kinds)
        elif not is_valid(value := attributes[name]):
            no_kinds = isinstance(value, Mapping) and name in BY_KIND
            hint = "; the mission lists no kinds" if no_kinds else _hint(value)
            yield f"expected {expected}, got {quoted(value)}{hint}"


def _hint(value: object) -> str:
    return "; write numbers with a point" if isinstance(value, str) and "," in value else ""
