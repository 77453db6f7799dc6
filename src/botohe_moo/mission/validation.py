"""The validation of missions and plans: what is wrong with them, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from operator import index
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, most_alike, quoted
from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.mission.kinds import Kind, by_kind
from botohe_moo.trails import PlanBatch

if TYPE_CHECKING:
    from botohe_moo.mission.model import Mission

_MAX_SHOWN = 100  # a file may have a million faults
_FAULTS = {
    kernels.BAD_OFFSETS: "expected the batch's offsets to cut its nodes into trails",
    kernels.EMPTY_TRAIL: "expected a trail of at least one node, the base, got an empty one",
    kernels.MISSING_ARC: "is missing in",
    kernels.ARC_USED_TWICE: "is used twice in this trail; a trail uses an arc at most once, in",
}


class MissionError(ValueError):
    """A mission that cannot be planned for.

    Parameters
    ----------
    faults
        Everything that is wrong, each naming a node or an arc and the value found; kept as a
        tuple. The message has the first hundred of them.
    source
        The mission or file, to begin the message with.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import Mission, MissionError
    >>> graph = nx.DiGraph([("dock", "reef")])
    >>> nx.set_node_attributes(graph, {"dock": 0, "reef": -1}, "reward")
    >>> nx.set_edge_attributes(graph, 1.5, "survival")
    >>> try:
    ...     Mission(graph, base="dock", robots=1)
    ... except MissionError as error:
    ...     for fault in error.faults:
    ...         print(fault)
    node 'reef': expected a finite reward >= 0, got -1
    arc 'dock' -> 'reef': expected survival in (0, 1], got 1.5
    node 'reef': has no way back to base 'dock'
    """

    def __init__(self, faults: list[str] | str, source: str = "The mission") -> None:
        self.faults = (faults,) if isinstance(faults, str) else tuple(faults)
        self.source = source
        if len(self.faults) == 1:
            message = f"{source}: {self.faults[0]}"
        else:
            shown = [f"{source} has {len(self.faults)} faults:", *self.faults[:_MAX_SHOWN]]
            if (more := len(self.faults) - _MAX_SHOWN) > 0:
                shown.append(f"and {more} more")
            message = "\n  - ".join(shown)
        super().__init__(message)

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (list(self.faults), self.source)


def graph_faults(
    graph: Any, base: Hashable, robots: object, kinds: Sequence[Kind], pays: object
) -> list[str]:
    """List the faults of a mission; a base or team size of None was not given.

    Without ``kinds`` all robots are of one kind.
    """
    if not isinstance(graph, nx.DiGraph) or graph.is_multigraph():
        return [_not_a_digraph(graph)]
    faults = [*_kind_faults(kinds, graph)]
    if pays not in PAYS:
        faults.append(f"expected pays to be 'arrival' or 'return', got {quoted(pays)}")
    if kinds:
        n_robots = sum(kind.robots for kind in kinds if team_size_fault(kind.robots) is None)
        if robots is not None and robots != n_robots and not faults:
            faults.append(f"expected no robots beside kinds, which have {n_robots}, got {robots!r}")
    elif robots is None:
        faults.append("expected robots to be an integer >= 1, found no graph attribute 'robots'")
    elif fault := team_size_fault(robots):
        faults.append(fault)
    budget = graph.graph.get("max_length")
    if budget is not None and not _is_amount(budget):
        faults.append(f"expected a finite max_length >= 0, got {quoted(budget)}")
    faults += attribute_faults(graph, kinds)
    for node in nx.nodes_with_selfloops(graph):
        arc = f"arc {quoted(node)} -> {quoted(node)}"
        faults.append(f"{arc}: a node must not have an arc to itself")
    if base is None:
        faults.append("expected the label of the base, found no graph attribute 'base'")
    elif base not in graph:
        near = most_alike(str(base), map(str, graph))
        faults.append(f"base {quoted(base)}: there is no such node{near}")
    elif not kinds:
        faults += _way_faults(graph, base)
    elif not faults:  # which ways there are depends on what each kind survives
        faults += _kind_way_faults(graph, base, kinds)
    return faults


def _kind_faults(kinds: Sequence[Kind], graph: nx.DiGraph[Any]) -> Iterator[str]:
    for i, kind in enumerate(kinds):
        who = f"kind {quoted(kind.name)}"
        if not isinstance(kind.name, str) or not kind.name.strip():
            yield f"{who}: expected a name, a text that is not blank"
        elif kind.name in [other.name for other in kinds[:i]]:
            yield f"{who}: there are two kinds of this name"
        if fault := team_size_fault(kind.robots):
            yield f"{who}: {fault}"
        if not 0 <= as_float(kind.min_survival) <= 1:
            yield f"{who}: expected min_survival in [0, 1], got {quoted(kind.min_survival)}"
        if kind.max_length is not None and not _is_amount(kind.max_length):
            yield f"{who}: expected a finite max_length >= 0, got {quoted(kind.max_length)}"
        for name, label in (("start", kind.start), ("end", kind.end)):
            if label is not None and label not in graph:
                near = most_alike(str(label), map(str, graph))
                yield f"{who}: {name} {quoted(label)}: there is no such node{near}"


def _kind_way_faults(
    graph: nx.DiGraph[Any], base: Hashable, kinds: Sequence[Kind]
) -> Iterator[str]:
    for kind in kinds:
        start, end = kind.ends(base)
        arcs: Any = graph.edges(data="survival")
        taken: nx.DiGraph[Any] = nx.DiGraph()
        taken.add_nodes_from(graph)
        taken.add_edges_from((u, v) for u, v, survival in arcs if by_kind(survival, [kind])[0] > 0)
        if start == end == base and len(kinds) == 1:
            yield from _way_faults(taken, base)
        elif not nx.has_path(taken, start, end):
            ways = f"has no way from its start {quoted(start)} to its end {quoted(end)}"
            yield f"kind {quoted(kind.name)}: {ways}"


def team_size_fault(robots: object) -> str | None:
    """Describe the fault of a team size, if it has one."""
    try:
        if isinstance(robots, bool | np.bool_) or index(robots) < 1:  # type: ignore[arg-type]
            raise TypeError
    except TypeError:
        return f"expected robots to be an integer >= 1, got {quoted(robots)}"
    return None


def _not_a_digraph(graph: Any) -> str:
    found = type(graph).__name__
    if isinstance(graph, nx.Graph):
        if graph.is_multigraph():
            return f"expected at most one arc from a node to another (nx.DiGraph), got a {found}"
        return (
            f"expected directed arcs (nx.DiGraph), got a {found}; "
            "graph.to_directed() makes every edge passable both ways"
        )
    return f"expected an nx.DiGraph, got {quoted(graph)}"


def _is_amount(value: object) -> bool:
    return 0 <= as_float(value) < math.inf


def _is_place(value: Any) -> bool:
    try:
        x, y = map(as_float, value)
    except (TypeError, ValueError):
        return value is None
    return math.isfinite(x) and math.isfinite(y)


_Rules = dict[str, tuple[str, Callable[[Any], bool]]]
PAYS = ("arrival", "return")
_OF_NODES: _Rules = {
    "reward": ("a finite reward >= 0", _is_amount),
    "pos": ("pos [x, y], two finite numbers", _is_place),
    "share": ("share in [0, 1]", lambda value: 0 <= as_float(value) <= 1),
    "pays": ("pays to be 'arrival' or 'return'", lambda value: value in PAYS),
    "depot": ("depot to be true or false", lambda value: isinstance(value, bool | np.bool_)),
}
_OF_ARCS: _Rules = {
    "survival": ("survival in (0, 1]", lambda value: 0 < as_float(value) <= 1),
    "length": ("a finite length >= 0", _is_amount),
}
_OPTIONAL = ("pos", "length", "share", "pays", "depot")
# Attributes with a number for each kind, and what the number may be then.
_BY_KIND: _Rules = {
    "survival": ("survival in [0, 1]", lambda value: 0 <= as_float(value) <= 1),
    "share": _OF_NODES["share"],
}


def attribute_faults(graph: nx.DiGraph[Any], kinds: Sequence[Kind] = ()) -> Iterator[str]:
    """List the attributes of nodes and arcs that are missing or wrong."""
    for node, attributes in graph.nodes(data=True):
        for fault in _faults_of(attributes, _OF_NODES, kinds):
            yield f"node {quoted(node)}: {fault}"
    for tail, head, attributes in graph.edges(data=True):
        for fault in _faults_of(attributes, _OF_ARCS, kinds):
            yield f"arc {quoted(tail)} -> {quoted(head)}: {fault}"


def _faults_by_kind(name: str, value: Mapping[Any, Any], kinds: Sequence[Kind]) -> Iterator[str]:
    """List the faults of an attribute that has a number for each kind."""
    names = [kind.name for kind in kinds]
    expected, is_valid = _BY_KIND[name]
    for kind, number in value.items():
        if kind not in names:
            yield f"{name} of kind {quoted(kind)}: there is no such kind"
        elif not is_valid(number):
            yield f"expected {expected} of kind {quoted(kind)}, got {quoted(number)}"
    if name == "survival":
        for kind in names:
            if kind not in value:
                yield f"expected {expected} of kind {quoted(kind)}, found none"


def _faults_of(
    attributes: Mapping[str, Any], rules: _Rules, kinds: Sequence[Kind]
) -> Iterator[str]:
    for name, (expected, is_valid) in rules.items():
        if name not in attributes:
            if name not in _OPTIONAL:
                yield f"expected {expected}, found no attribute {name!r}"
        elif kinds and name in _BY_KIND and isinstance(attributes[name], Mapping):
            yield from _faults_by_kind(name, attributes[name], kinds)
        elif not is_valid(value := attributes[name]):
            hint = ""
            if isinstance(value, str) and "," in value:
                hint = "; write numbers with a point"
            elif isinstance(value, Mapping) and name in _BY_KIND:
                hint = "; the mission lists no kinds"
            yield f"expected {expected}, got {quoted(value)}{hint}"


def _way_faults(graph: nx.DiGraph[Any], base: Hashable) -> Iterator[str]:
    reachable = nx.descendants(graph, base) | {base}
    returning = nx.ancestors(graph, base) | {base}
    for node in graph:
        if node not in reachable:
            yield f"node {quoted(node)}: cannot be reached from base {quoted(base)}"
        if node not in returning:
            yield f"node {quoted(node)}: has no way back to base {quoted(base)}"


class PlanError(ValueError):
    """A trail plan is not valid for the mission; names the robot, the position and the arc.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.mission import PlanError
    >>> try:
    ...     load_mission("toy").plan([[1, 2], [1]])
    ... except PlanError as error:
    ...     print(error)
    Robot 0, position 1: expected the trail to end at base 1, got 2.
    """


def trail_indices(
    mission: str, index: Mapping[Any, int], robot: int, trail: Sequence[Hashable]
) -> list[int]:
    """Convert the node labels of a robot's trail to indices; ``mission`` is the mission's name."""
    if isinstance(trail, str | bytes) or not isinstance(trail, Sequence | np.ndarray):
        raise PlanError(f"Robot {robot}: expected a sequence of node labels, got {quoted(trail)}.")
    if len(trail) == 0:
        raise PlanError(f"Robot {robot}: {_FAULTS[kernels.EMPTY_TRAIL]}.")
    indices = []
    for position, label in enumerate(trail):
        try:
            indices.append(index[read_label(label)])
        except (KeyError, TypeError, ValueError):
            raise PlanError(
                f"Robot {robot}, position {position}: mission {quoted(mission)} has no node "
                f"{quoted(label)}."
            ) from None
    return indices


def read_label(value: object) -> Hashable:
    """Convert a JSON value to a node label; raises ValueError if it cannot be one."""
    if isinstance(value, list):
        return tuple(None if item is None else read_label(item) for item in value)
    if value is None or isinstance(value, dict):
        expected = "a string, a number, a boolean or a list of them"
        raise ValueError(f"expected a label, {expected}, got {quoted(value)}")
    return value


def fault_text(mission: Mission, batch: PlanBatch, fault: Sequence[int]) -> str:
    """Describe a fault that the kernel ``evaluate`` found: its kind, plan, robot and position."""
    what, plan, robot, position = fault
    nodes, kind = mission.nodes, mission.kind_of[robot]
    where = f"Robot {robot}" if len(batch) == 1 else f"Plan {plan}, robot {robot}"
    if what in (kernels.EMPTY_TRAIL, kernels.BAD_OFFSETS):
        return f"{where}: {_FAULTS[what]}."
    begin = batch.offsets[plan * batch.n_robots + robot]
    node = int(batch.nodes[begin + position])
    where = f"{where}, position {position}"
    if what == kernels.UNKNOWN_NODE:
        known = f"mission {quoted(mission.name)} has {mission.arrays.n_nodes} nodes"
        return f"{where}: node index {node} is unknown, {known}."
    layer, place = divmod(node, len(nodes))
    label, other = nodes[place], mission.kinds[layer]
    if what in (kernels.NOT_FROM_BASE, kernels.NOT_BACK_AT_BASE):
        is_start = what == kernels.NOT_FROM_BASE
        expected = kind.ends(mission.base)[0 if is_start else 1]
        at = f"{'base' if expected == mission.base else 'node'} {quoted(expected)}"
        of = "" if other == kind else f" of kind {quoted(other.name)}"
        does = f"expected the trail to {'begin' if is_start else 'end'} at {at}"
        return f"{where}: {does}, got {quoted(label)}{of}."
    tail, problem = nodes[int(batch.nodes[begin + position - 1]) % len(nodes)], _FAULTS[what]
    if what == kernels.MISSING_ARC and mission.graph.has_edge(tail, label):
        problem = f"cannot be taken by kind {quoted(kind.name)} in"
    arc = f"arc {quoted(tail)} -> {quoted(label)}"
    return f"{where}: {arc} {problem} mission {quoted(mission.name)}."
