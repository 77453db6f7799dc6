"""Kinds of robots: what a mission says of them, and the graph of each kind."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from operator import index
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import most_alike, quoted
from botohe_moo._base.types import OffsetArray
from botohe_moo.kernels.graph.graph import (
    Graph,
    Limits,
    join_layers,
    new_graph,
    with_costs,
)
from botohe_moo.kernels.graph.kinds import AT_NEXT_DEPOT, AT_THIS_DEPOT, ON_ARRIVAL, Kinds

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


def graph_of_kinds(
    graph: nx.DiGraph[Any],
    base: Hashable,
    kinds: Sequence[Kind],
    pays: str,
    index_of: Mapping[Any, int],
) -> Graph:
    """Return a valid mission's graph as kernels take it; ``index_of`` numbers its nodes."""
    arcs = sorted(
        (index_of[u], index_of[v], by_kind(arc["survival"], kinds), float(arc.get("length", 1.0)))
        for u, v, arc in graph.edges(data=True)
    )
    tail, head = (np.array([arc[i] for arc in arcs], np.int64) for i in (0, 1))
    survival = np.array([s for _, _, s, _ in arcs], np.float64).reshape(-1, len(kinds))
    length = np.array([d for *_, d in arcs], np.float64)
    nodes = dict(graph.nodes(data=True))
    reward = np.array([node["reward"] for node in nodes.values()], np.float64)
    share = np.array([by_kind(node.get("share", 1.0), kinds) for node in nodes.values()])
    ends = [tuple(index_of[label] for label in kind.ends(base)) for kind in kinds]
    credit = np.array([_credit(node, pays) for node in nodes.values()])
    credit[index_of[base]] = AT_THIS_DEPOT
    is_plain = len(kinds) == 1 and ends[0] == (index_of[base],) * 2 and bool((share == 1.0).all())
    is_plain &= bool((survival > 0.0).all()) and not (reward[credit == AT_NEXT_DEPOT] > 0.0).any()
    aboard = [[index_of[v] for v in kind.aboard if reward[index_of[v]] > 0.0] for kind in kinds]
    if is_plain:
        return new_graph(tail, head, survival[:, 0], length, reward, index_of[base])
    layers, shares = [], []
    for k, (start, end) in enumerate(ends):
        stays, is_open = _passable(tail, head, survival[:, k] > 0.0, start, end, len(reward))
        shares.append(np.where(is_open, share[:, k], 0.0))
        shares[-1][aboard[k]] = share[aboard[k], k]  # also of nodes that are closed now
        aboard[k] = [node for node in aboard[k] if node != start]  # which the trail visits
        arrays = tail[stays], head[stays], survival[stays, k], length[stays]
        layers.append(new_graph(*arrays, reward * shares[-1], end))
    n, counts = len(reward), [kind.robots for kind in kinds]
    first = np.cumsum([0, *counts])
    kind_of = np.repeat(np.arange(len(kinds)), counts)
    n_aboard = np.cumsum([0, *map(len, aboard)])
    described = Kinds(
        origin=np.tile(np.arange(n), len(kinds)),
        share=np.concatenate(shares),
        credit=np.tile(credit, len(kinds)),
        end=np.repeat([end + k * n for k, (_, end) in enumerate(ends)], n),
        reward=reward,
        start=np.array([ends[k][0] + k * n for k in kind_of.tolist()]),
        first=first[kind_of],
        stop=first[kind_of + 1],
        aboard=np.array([node for nodes in aboard for node in nodes], np.int64),
        aboard_first=n_aboard[kind_of],
        aboard_stop=n_aboard[kind_of + 1],
        has_returns=bool(((credit == AT_NEXT_DEPOT) & (reward > 0.0)).any()),
    )
    return join_layers(layers, described)


def uncollected(graph: Graph) -> OffsetArray:
    """Return the nodes of a mission that pay, though no kind can collect their reward.

    A reward on return needs a way on to a depot.
    """
    kinds = graph.kinds
    if kinds is None:
        return np.empty(0, np.int64)
    ways = nx.DiGraph(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    depots = np.flatnonzero(kinds.credit == AT_THIS_DEPOT).tolist()
    ways.add_edges_from((depot, -1) for depot in depots)  # to one node behind all depots
    is_credited = kinds.credit != AT_NEXT_DEPOT
    is_credited[list(nx.ancestors(ways, -1))] = True
    collects = (is_credited & (graph.reward > 0.0)).reshape(-1, len(kinds.reward))
    return np.flatnonzero((kinds.reward > 0.0) & ~collects.any(axis=0))


def ways_to_ends(graph: Graph, limits: Limits) -> list[list[int]]:
    """Return each robot's safest way from its start to its end, or the shortest if it is too long.

    ``graph`` has kinds.
    """
    if graph.kinds is None:
        raise TypeError("Expected a graph with kinds.")
    ways = []
    for start in graph.kinds.start.tolist():
        way, length = _way_home(graph, start)
        if limits.budgets is not None and length > limits.budgets[start]:
            way, _ = _way_home(with_costs(graph, graph.length), start)
        ways.append(way)
    return ways


def _way_home(graph: Graph, node: int) -> tuple[list[int], float]:
    """Return the nodes of the cheapest way home from a node, and its length."""
    way, length = [node], 0.0
    while (arc := int(graph.homeward[way[-1]])) >= 0:
        way.append(int(graph.head[arc]))
        length += float(graph.length[arc])
    return way, length


def _credit(node: Mapping[str, Any], pays: str) -> int:
    if node.get("depot", False):
        return AT_THIS_DEPOT
    return AT_NEXT_DEPOT if node.get("pays", pays) == "return" else ON_ARRIVAL


def _passable(
    tail: OffsetArray, head: OffsetArray, stays: Any, start: int, end: int, n_nodes: int
) -> tuple[Any, Any]:
    """Return which arcs and which nodes a kind can use on a way from its start to its end."""
    ways: nx.DiGraph[Any] = nx.DiGraph()
    ways.add_nodes_from(range(n_nodes))
    ways.add_edges_from(zip(tail[stays].tolist(), head[stays].tolist(), strict=True))
    used = (nx.descendants(ways, start) | {start}) & (nx.ancestors(ways, end) | {end})
    is_open = np.zeros(n_nodes, bool)
    is_open[list(used)] = True
    return stays & is_open[tail] & is_open[head], is_open
