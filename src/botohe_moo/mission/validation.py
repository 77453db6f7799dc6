"""The validation of missions and plans: what is wrong with them, in words."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from operator import index
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, most_alike, quoted
from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.mission.attributes import PAYS, attribute_faults, is_amount
from botohe_moo.mission.kinds import Kind, by_kind
from botohe_moo.trails import PlanBatch

_SEPARATORS = frozenset(":,=")  # of the name of a kind from what follows it
_ROUNDING = 1e-12  # relative: what rounding may change along a way
_MOST_ROBOTS = 1_000_000  # of a kind: missions list them
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
    faults = [*_kind_faults(kinds, graph, pays)]
    if not all(isinstance(kind.name, str) for kind in kinds):
        return faults  # by which the rest would have to be called
    if pays not in PAYS:
        faults.append(f"expected pays to be 'arrival' or 'return', got {quoted(pays)}")
    if kinds:
        n_robots = sum(kind.robots for kind in kinds if team_size_fault(kind.robots) is None)
        if robots is not None and robots != n_robots and not faults:
            found = f"robots of all kinds together, or none, got {quoted(robots)}"
            faults.append(f"expected robots to be {n_robots}, the {found}")
    elif robots is None:
        faults.append("expected robots to be an integer >= 1, found no graph attribute 'robots'")
    elif fault := team_size_fault(robots):
        faults.append(fault)
    budget = graph.graph.get("max_length")
    if budget is not None and not is_amount(budget):
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


def _aboard_faults(kind: Kind, graph: nx.DiGraph[Any], pays: object) -> Iterator[str]:
    if isinstance(kind.aboard, str) or not isinstance(kind.aboard, Sequence):
        yield f"expected aboard to be a list of nodes, got {quoted(kind.aboard)}"
        return
    for i, label in enumerate(kind.aboard):
        if label in kind.aboard[:i]:
            yield f"aboard: {quoted(label)} is there more than once"
        elif label not in graph:
            near = most_alike(str(label), map(str, graph))
            yield f"aboard {quoted(label)}: there is no such node{near}"
        elif graph.nodes[label].get("pays", pays) != "return" or graph.nodes[label].get("depot"):
            yield f"aboard {quoted(label)}: expected a node that pays on return"


def _kind_faults(kinds: Sequence[Kind], graph: nx.DiGraph[Any], pays: object) -> Iterator[str]:
    yield from kind_name_faults(kinds)
    for kind in kinds:
        who = f"kind {quoted(kind.name)}"
        if fault := team_size_fault(kind.robots):
            yield f"{who}: {fault}"
        elif kind.robots > _MOST_ROBOTS:
            yield f"{who}: expected robots <= {_MOST_ROBOTS:,}, got {quoted(kind.robots)}"
        if not 0 <= as_float(kind.min_survival) <= 1:
            yield f"{who}: expected min_survival in [0, 1], got {quoted(kind.min_survival)}"
        if kind.max_length is not None and not is_amount(kind.max_length):
            yield f"{who}: expected a finite max_length >= 0, got {quoted(kind.max_length)}"
        for name, label in (("start", kind.start), ("end", kind.end)):
            if label is not None and label not in graph:
                near = most_alike(str(label), map(str, graph))
                yield f"{who}: {name} {quoted(label)}: there is no such node{near}"
        yield from (f"{who}: {fault}" for fault in _aboard_faults(kind, graph, pays))


def kind_name_faults(kinds: Sequence[Kind]) -> Iterator[str]:
    """List the faults of the names of kinds, by which all else of them is called."""
    for i, kind in enumerate(kinds):
        who = f"kind {quoted(kind.name)}"
        if not isinstance(kind.name, str) or not kind.name.strip():
            yield f"{who}: expected a name, a text that is not blank"
        elif not (
            kind.name == kind.name.strip()
            and kind.name.isprintable()
            and _SEPARATORS.isdisjoint(kind.name)
        ):
            where = "stand in columns survival:NAME and in --kind NAME=ROBOTS,..."
            expected = "a printable name without : , = and blanks around it"
            yield f"{who}: expected {expected}, as names {where}"
        elif kind.name in [other.name for other in kinds[:i]]:
            yield f"{who}: there are two kinds of this name"


def _kind_way_faults(
    graph: nx.DiGraph[Any], base: Hashable, kinds: Sequence[Kind]
) -> Iterator[str]:
    for kind in kinds:
        start, end = kind.ends(base)
        taken: nx.DiGraph[Any] = nx.DiGraph()
        taken.add_nodes_from(graph)
        for tail, head, arc in graph.edges(data=True):
            if (survival := by_kind(arc["survival"], [kind])[0]) > 0:
                taken.add_edge(tail, head, danger=-math.log(survival), length=arc.get("length", 1))
        who = f"kind {quoted(kind.name)}"
        way = f"way from its start {quoted(start)} to its end {quoted(end)}"
        is_open = taken.number_of_edges() == graph.number_of_edges()
        if start == end == base and len(kinds) == 1 and is_open:
            yield from _way_faults(taken, base)
        elif not nx.has_path(taken, start, end):
            yield f"{who}: has no {way}"
        else:
            safest = math.exp(-nx.dijkstra_path_length(taken, start, end, "danger"))
            if safest < kind.min_survival * (1 - _ROUNDING):
                expected = f"min_survival to be at most {safest:.6g}, that of the safest {way}"
                yield f"{who}: expected {expected}, got {quoted(kind.min_survival)}"
            shortest = nx.dijkstra_path_length(taken, start, end, "length")
            own = graph.graph.get("max_length") if kind.max_length is None else kind.max_length
            if own is not None and shortest > own * (1 + _ROUNDING):
                expected = f"max_length to be at least {shortest:.6g}, that of the shortest {way}"
                yield f"{who}: expected {expected}, got {quoted(own)}"


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


def fault_text(mission: Any, batch: PlanBatch, fault: Sequence[int]) -> str:
    """Describe a fault that the kernel ``evaluate`` found: its kind, plan, robot and position.

    ``mission`` is the `Mission`, whose module imports this one.
    """
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
