"""The rules of missions and plans, and messages about what breaks them."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import chain
from numbers import Integral
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo.base.messages import FaultsError, as_float, listed, most_alike, quoted

ONLY_KIND = "robot"  # the name of the kind of a mission that lists none
PAYS = ("arrival", "return")
_Read = Callable[[Mapping[str, Any]], Mapping[str, Any]]


@dataclass(frozen=True)
class Kind:
    """Robots of one kind.

    Which arcs a kind survives, and what it collects, are attributes of arcs and nodes:
    ``survival`` and ``share``.

    Parameters
    ----------
    name
        The kind's name in survivals, shares, tables and pictures. It has no ``:``, ``,`` or ``=``,
        and no blanks around it.
    robots
        Number of robots of this kind, at least 1.
    start, end
        Labels of the nodes where their trails begin and end; default: the base.
    min_survival
        Survival floor of each robot, in [0, 1]; 0 sets none.
    max_length
        Travel budget of each robot, at least 0; default: the mission's.
    aboard
        Labels of nodes that pay on return and that each robot has visited before it starts. It
        carries the reward of such a node with probability ``share``, and delivers it at the first
        depot.

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
        """Return the same valid kind with numbers and tuples of Python's own types."""
        longest = None if self.max_length is None else float(self.max_length)
        n, least, aboard = int(self.robots), float(self.min_survival), tuple(self.aboard)
        return replace(self, robots=n, min_survival=least, max_length=longest, aboard=aboard)

    def ends(self, base: Hashable) -> tuple[Hashable, Hashable]:
        """Return the labels where trails begin and end in a mission with this base."""
        return base if self.start is None else self.start, base if self.end is None else self.end


class MissionError(FaultsError):
    """A mission that cannot be planned for.

    Parameters
    ----------
    faults
        Everything that is wrong. Each fault names a node or an arc, and the value found. They are
        kept as a tuple; the message shows the first hundred.
    source
        The mission or the file; the message begins with it.

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

    def __init__(self, faults: Iterable[str], source: str = "The mission") -> None:
        super().__init__(faults, source)


def blamed_on(source: str, error: Exception) -> MissionError:
    """Return an error as one of the mission or file that is called ``source``.

    Where it is about another file, such as a map, its faults begin with the name of that file.
    """
    faults = getattr(error, "faults", [str(error).removeprefix(f"{source}: ").rstrip(".")])
    inner = getattr(error, "source", source)
    where = "" if inner in (source, "The mission", "The file") else f"{inner}: "
    return MissionError([f"{where}{fault}" for fault in faults], source)


class PlanError(ValueError):
    """A trail plan that is not valid for its mission; names the robot, the position and the arc.

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


def read_kinds(kinds: Any, read: _Read = dict) -> tuple[tuple[Kind, ...], list[str]]:
    """Return kinds, which files hold as mappings, and what is wrong with their form or names.

    None lists no kinds. ``read`` converts the attributes of each.
    """
    if kinds is None:
        return (), []
    found, faults = read_listed("kinds", Kind, kinds, read)
    if not found and not faults:
        faults.append("expected at least one kind, got none")
    return tuple(found), faults or _kind_name_faults(found)


def read_listed(
    what: str, kind: Any, given: Any, read: _Read = dict
) -> tuple[list[Any], list[str]]:
    """Return kinds or scenarios, which files hold as mappings, and what is wrong with their form.

    ``read`` converts the attributes of each.
    """
    if isinstance(given, str | Mapping) or not isinstance(given, Iterable):
        return [], [f"expected {what} to be a list of {what}, got {quoted(given)}"]
    found, faults, known = [], list[str](), [field.name for field in fields(kind)]
    for i, one in enumerate(given):
        own = vars(one) if isinstance(one, kind) else one
        own = read(own) if isinstance(own, Mapping) else None
        if own is None:
            expected = f"a {kind.__name__}, or an object"
            faults.append(f"{what}[{i}]: expected {expected}, got {quoted(one)}")
        elif unknown := [str(name) for name in own if name not in known]:
            of = f"of a {kind.__name__.lower()}{most_alike(unknown[0], known)}"
            faults.append(f"{what}[{i}]: there is no {quoted(unknown[0])} {of}")
        else:
            found.append(kind(**{**dict.fromkeys(known[:2]), **own}))  # None breaks a rule
    return found, faults


def by_kind(value: object, kinds: Sequence[Kind]) -> list[float]:
    """Return the number of an attribute for each kind; 1 for kinds that a mapping leaves out."""
    if isinstance(value, Mapping):
        return [float(value.get(kind.name, 1.0)) for kind in kinds]
    return [float(value)] * len(kinds)  # type: ignore[arg-type]


def read_label(value: object) -> Hashable:
    """Convert a JSON value to a node label; raises ValueError if it cannot be one."""
    if isinstance(value, list):
        return tuple(None if item is None else read_label(item) for item in value)
    if value is None or not isinstance(value, Hashable):
        expected = "a string, a number, a boolean or a list of them"
        raise ValueError(f"expected a label, {expected}, got {quoted(value)}")
    return value


def within(low: float, high: float = math.nextafter(math.inf, 0)) -> Callable[[Any], bool]:
    """Return the test for a number in [low, high]; by default, for a finite one."""
    # Most values are floats; as_float takes longer.
    return lambda value: low <= (value if type(value) is float else as_float(value)) <= high


def _is_count(value: Any) -> bool:
    return isinstance(value, Integral) and as_float(value) >= 1


def is_list(value: Any) -> bool:
    """Return whether a value is a list, a tuple or an array of one dimension."""
    is_sequence = isinstance(value, Sequence) and not isinstance(value, str | bytes)
    return is_sequence or getattr(value, "ndim", 0) == 1  # an array


def is_mapping(value: Any) -> bool:
    """Return whether a value is a mapping."""
    return isinstance(value, Mapping)


def _is_place(value: Any) -> bool:
    return is_list(value) and len(value) == 2 and all(math.isfinite(as_float(x)) for x in value)


def is_name(value: Any) -> bool:
    """Return whether a kind or a scenario may have this name."""
    is_plain = isinstance(value, str) and value.isprintable() and value == value.strip() != ""
    return is_plain and {*value}.isdisjoint(":,=")


# A rule is what is expected of an attribute, the test that a valid value passes, and the default.
# The default of an attribute that has to be given does not pass.
Rule = tuple[str, Callable[[Any], bool], Any]
Rules = Mapping[str, Rule]
_MAX_LENGTH: Rule = ("a finite max_length >= 0", lambda v: v is None or within(0)(v), None)
_PAYS = ("pays to be 'arrival' or 'return'", lambda v: isinstance(v, str) and v in PAYS, PAYS[0])
_SHARE: Rule = ("share in [0, 1]", within(0, 1), 1.0)
_OF_MISSIONS: Rules = {
    "robots": ("robots to be an integer >= 1", lambda v: v is None or _is_count(v), None),
    "pays": _PAYS,
    "max_length": _MAX_LENGTH,
}
_OF_KINDS: Rules = {
    "robots": ("robots to be an integer in [1, 1000000]", lambda v: _is_count(v) and v <= 1e6, 0),
    "min_survival": ("min_survival in [0, 1]", within(0, 1), 0.0),
    "max_length": _MAX_LENGTH,
    "aboard": ("aboard to be a list of nodes", is_list, ()),
}
OF_NODES: Rules = {
    "reward": ("a finite reward >= 0", within(0), None),
    "pos": ("pos [x, y], two finite numbers", lambda v: v is None or _is_place(v), None),
    "share": _SHARE,
    "pays": _PAYS,
    "depot": ("depot to be true or false", lambda v: isinstance(v, bool | np.bool_), False),
}
_OF_ARCS: Rules = {
    "survival": ("survival in (0, 1]", within(math.ulp(0), 1), None),
    "length": ("a finite length >= 0", within(0), 1.0),
}
# Attributes of nodes and arcs that plans depend on, or that pictures and files show.
KNOWN = {*OF_NODES, *_OF_ARCS, "zone", "label", "name", "id"}
# Attributes that may be mappings from kinds to numbers, and the rules of these numbers.
BY_KIND: Rules = {"survival": ("survival in [0, 1]", within(0, 1), None), "share": _SHARE}


def faults_of(given: Mapping[str, Any], rules: Rules, names: Sequence[str] = ()) -> Iterator[str]:
    """List what is wrong with attributes.

    Attributes in ``BY_KIND`` may be mappings from the names of kinds, if these are given.
    """
    for name, (expected, holds, default) in rules.items():
        if holds(value := given.get(name, default)):
            continue
        if names and name in BY_KIND and isinstance(value, Mapping):
            # If there are unknown kinds, one may be the missing kind, misspelt.
            asked = names if value.keys() <= {*names} else [kind for kind in names if kind in value]
            expected, *test = BY_KIND[name]
            of_kinds = {kind: (f"{expected} of kind {quoted(kind)}", *test) for kind in asked}
            yield from faults_of(value, of_kinds)
        else:
            hint = "; write a number, such as 0.95" if isinstance(value, str) and holds(1) else ""
            found = "found none" if value is None else f"got {quoted(value)}{hint}"
            yield f"expected {expected}, {found}"


def whose(*labels: Hashable) -> str:
    """Name a node by its label, or an arc by those of its ends."""
    return f"{'arc' if len(labels) > 1 else 'node'} {' -> '.join(map(quoted, labels))}"


def attribute_of(column: str) -> str | None:
    """Return the attribute that a column such as ``survival:drone`` holds for one kind."""
    name, colon, _ = column.partition(":")
    return name if colon and name in BY_KIND else None


def attribute_faults(graph: nx.DiGraph[Any], kinds: Sequence[Kind] = ()) -> list[str]:
    """List what is wrong with the attributes of nodes and arcs.

    A kind that the mission does not list is one fault, however many nodes and arcs name it.
    """
    known = [kind.name for kind in kinds]
    names = known or [ONLY_KIND]
    faults: list[str] = []
    unknown: dict[tuple[str, str], list[str]] = {}
    nodes = (((node,), given, OF_NODES) for node, given in graph.nodes(data=True))
    arcs = (((tail, head), given, _OF_ARCS) for tail, head, given in graph.edges(data=True))
    for labels, given, rules in chain(nodes, arcs):
        faults += [f"{whose(*labels)}: {fault}" for fault in faults_of(given, rules, names)]
        for name, value in given.items():
            if name not in rules and (attribute := attribute_of(str(name))):
                expected = f"expected {attribute} to be a mapping from kinds to numbers"
                found = f"found {quoted(name)}, which stands in tables and GraphML only"
                faults.append(f"{whose(*labels)}: {expected}, {found}")
            elif name in rules and name in BY_KIND and isinstance(value, Mapping):
                for kind in [str(kind) for kind in value if kind not in names]:
                    unknown.setdefault((name, kind), []).append(whose(*labels))
    for (name, kind), where in unknown.items():
        near = most_alike(kind, known) or "; the mission lists no kinds"
        fault = f"{name} of kind {quoted(kind)}: no such kind{near}"
        faults.insert(0, f"{listed(where, most=1)}: {fault}")
    return faults


def _kind_name_faults(kinds: Sequence[Kind]) -> list[str]:
    names = [kind.name for kind in kinds]
    expected = "a printable name without : , = and blanks around it"
    where = "for columns survival:NAME and --kind NAME=ROBOTS"
    wrong = [f"{quoted(n)}: expected {expected}, {where}" for n in names if not is_name(n)]
    twice = dict.fromkeys(n for i, n in enumerate(names) if n in names[:i])
    rivals = [f"{quoted(name)}: there are two kinds of this name" for name in twice]
    return [f"kind {fault}" for fault in wrong or rivals]


def _label_faults(kind: Kind, graph: nx.DiGraph[Any], pays: object) -> Iterator[str]:
    """List what is wrong with the nodes that a kind names."""
    for name, label in (("start", kind.start), ("end", kind.end)):
        if label is not None and label not in graph:
            yield no_such_node(name, label, graph)
    aboard = list(kind.aboard) if is_list(kind.aboard) else []
    for i, label in enumerate(aboard):
        node = graph.nodes[label] if label in graph else {}
        if label not in graph:
            yield no_such_node("aboard", label, graph)
        elif node.get("pays", pays) != "return" or node.get("depot") or label in aboard[:i]:
            yield f"aboard {quoted(label)}: expected a node that pays on return, listed once"


def no_such_node(name: str, label: Hashable, graph: nx.DiGraph[Any]) -> str:
    """Describe the fault of an attribute that names an unknown node."""
    near = most_alike(str(label), map(str, graph))
    return f"{name} {quoted(label)}: no such node{near}"


def graph_faults(graph: Any, kinds: Sequence[Kind], given: Mapping[str, Any]) -> list[str]:
    """List what is wrong with a mission on a graph.

    ``given`` has ``pays``, and may have ``base``, ``robots`` and ``max_length``. Without ``kinds``
    all robots are of one kind.
    """
    if not isinstance(graph, nx.DiGraph) or graph.is_multigraph():
        found = f"an nx.{type(graph).__name__}" if isinstance(graph, nx.Graph) else quoted(graph)
        remedy = "; graph.to_directed() makes edges passable both ways" * (type(graph) is nx.Graph)
        return [f"expected an nx.DiGraph, got {found}{remedy}"]
    base, robots, faults = given.get("base"), given.get("robots"), list[str]()
    for kind in kinds:
        wrong = chain(faults_of(vars(kind), _OF_KINDS), _label_faults(kind, graph, given["pays"]))
        faults += [f"kind {quoted(kind.name)}: {fault}" for fault in wrong]
    faults += faults_of(given, _OF_MISSIONS)
    if not kinds and robots is None:
        faults.append("expected robots, an integer >= 1, found none: give robots")
    elif kinds and not faults and robots not in (None, n := sum(kind.robots for kind in kinds)):
        found = f"robots of all kinds together, or none, got {quoted(robots)}"
        faults.append(f"expected robots to be {n}, the {found}")
    faults += attribute_faults(graph, kinds)
    loops = nx.nodes_with_selfloops(graph)
    faults += [f"{whose(v, v)}: a node must not have an arc to itself" for v in loops]
    if base is None:
        faults.append("expected base, the label of a node, found none: give base")
    elif base not in graph:
        faults.append(no_such_node("base", base, graph))
    elif not kinds or (len(kinds) == 1 and not faults and {*kinds[0].ends(base)} == {base}):
        faults += _way_faults(graph, base)
    return faults


def _way_faults(graph: nx.DiGraph[Any], base: Hashable) -> list[str]:
    ways = {
        "cannot be reached from": {base, *nx.descendants(graph, base)},
        "has no way back to": {base, *nx.ancestors(graph, base)},
    }
    wrong = [(node, fault) for node in graph for fault, nodes in ways.items() if node not in nodes]
    return [f"{whose(node)}: {fault} base {quoted(base)}" for node, fault in wrong]


def trail_indices(mission: Any, robot: int, trail: Sequence[Hashable]) -> list[int]:
    """Convert the node labels of a robot's trail in a `Mission` to indices."""
    if not is_list(trail) or len(trail) == 0:
        raise PlanError(f"Robot {robot}: expected a sequence of node labels, got {quoted(trail)}.")
    indices: list[int] = []
    for label in trail:
        try:
            indices.append(mission.index(read_label(label)))
        except (KeyError, TypeError, ValueError):
            where = f"Robot {robot}, position {len(indices)}: mission {quoted(mission.name)}"
            raise PlanError(f"{where} has no node {quoted(label)}.") from None
    return indices
