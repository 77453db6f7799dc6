"""The rules of missions and plans, and what is wrong with one that breaks them, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from operator import index
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, most_alike, quoted
from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.trails import PlanBatch

ONLY_KIND = "robot"  # the name of the kind of a mission that lists none


@dataclass(frozen=True)
class Kind:
    """Robots of one kind.

    What a kind survives and what it can collect are attributes of arcs and nodes: ``survival`` and
    ``share``.

    Parameters
    ----------
    name
        By which survivals, shares, tables and pictures refer to the kind: without ``:``, ``,`` and
        ``=``, and without blanks around it.
    robots
        How many robots of this kind there are, at least 1.
    start, end
        Labels of the nodes where their trails begin and end; default: the base.
    min_survival
        Survival floor of each of them, in [0, 1]; 0 sets none.
    max_length
        Travel budget of each of them, at least 0; default: that of the mission.
    aboard
        Labels of nodes that pay on return, and where each of them has been before it starts: with
        the probability ``share`` it carries the reward, which counts at the first depot.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import Kind, Mission
    >>> graph = nx.DiGraph()
    >>> graph.add_node("dock", reward=0)
    >>> graph.add_node("reef", reward=5)
    >>> graph.add_edge("dock", "reef", survival={"boat": 0.9, "diver": 0.5})
    >>> graph.add_edge("reef", "dock", survival={"boat": 0.9, "diver": 0.5})
    >>> mission = Mission(graph, base="dock", kinds=[Kind("boat", 1), Kind("diver", 2)])
    >>> mission.robots
    3
    """

    name: str
    robots: int
    start: Hashable | None = None
    end: Hashable | None = None
    min_survival: float = 0.0
    max_length: float | None = None
    aboard: tuple[Hashable, ...] = ()

    def normalized(self) -> Kind:
        """Return the same valid kind with numbers and tuples of Python's types."""
        longest = None if self.max_length is None else float(self.max_length)
        least, n = float(self.min_survival), index(self.robots)
        aboard = tuple(self.aboard)
        return replace(self, robots=n, min_survival=least, max_length=longest, aboard=aboard)

    def ends(self, base: Hashable) -> tuple[Hashable, Hashable]:
        """Return where trails start and end in a mission with this base."""
        return base if self.start is None else self.start, base if self.end is None else self.end


def read_kinds(kinds: Any) -> tuple[tuple[Kind, ...], list[str]]:
    """Return kinds, which files hold as mappings, and the faults of what is not a kind.

    None lists no kinds.
    """
    if kinds is None:
        return (), []
    if isinstance(kinds, str | Mapping | Kind) or not isinstance(kinds, Iterable):
        return (), [f"expected kinds to be a list of kinds, got {quoted(kinds)}"]
    read, faults, known = [], [], [field.name for field in fields(Kind)]
    for i, kind in enumerate(kinds):
        if isinstance(kind, Kind):
            read.append(kind)
        elif not isinstance(kind, Mapping):
            faults.append(f"kinds[{i}]: expected a Kind, or an object, got {quoted(kind)}")
        elif unknown := [name for name in kind if name not in known]:
            near = most_alike(str(unknown[0]), known)
            faults.append(f"kinds[{i}]: there is no {quoted(unknown[0])} of a kind{near}")
        elif missing := [name for name in ("name", "robots") if name not in kind]:
            faults.append(f"kinds[{i}]: expected {missing[0]}, found none in {quoted(kind)}")
        else:
            read.append(Kind(**kind))
    if not read and not faults:
        faults.append("expected at least one kind, got none")
    return tuple(read), faults


def by_kind(value: object, kinds: Sequence[Kind], default: float = 1.0) -> list[float]:
    """Return an attribute for each kind: one number, or a number for each name."""
    if isinstance(value, Mapping):
        return [float(value.get(kind.name, default)) for kind in kinds]
    return [float(value)] * len(kinds)  # type: ignore[arg-type]


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
