"""The one graph under all kernels: a mission's arcs and nodes as arrays."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.kinds import Kinds

# Among up to this many arcs a head is looked for one by one, after a binary search among more.
_LINEAR_SEARCH_UP_TO = 12


class Graph(NamedTuple):
    """A mission's graph, its arcs grouped by tail node; all arrays are read-only.

    Indices of nodes and arcs are 64-bit integers everywhere, so that no helper is compiled twice.
    """

    # The arcs that leave node v are ``first[v]`` to ``first[v + 1]`` (n_nodes + 1).
    first: OffsetArray
    # The nodes that each arc leaves and enters (n_arcs); heads ascend within a node's arcs.
    tail: OffsetArray
    head: OffsetArray
    # Probability to survive each arc, in (0, 1], and −log of it, at least 0 (n_arcs).
    survival: FloatArray
    cost: FloatArray
    length: FloatArray  # length of each arc, at least 0 (n_arcs)
    # The arc from each arc's head to its tail, −1 where there is none (n_arcs).
    reverse: OffsetArray
    # The arcs that enter node v are ``entering[first_entering[v]:first_entering[v + 1]]``.
    first_entering: OffsetArray
    entering: OffsetArray
    # Reward of each node, at least 0 (n_nodes); with kinds, what a robot that gets there expects.
    reward: FloatArray
    # The arc by which the safest way home leaves each node, −1 at the base; and the survival of
    # that way, 1 at the base (n_nodes).
    homeward: OffsetArray
    home: FloatArray
    base: int  # index of the base
    # Whether as many arcs enter every node as leave it, so that no trail meets a dead end.
    balanced: bool
    kinds: Kinds | None = None

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.reward)

    @property
    def n_arcs(self) -> int:
        """Number of arcs; the base's self-loop, which ends a colony's trails, is not among them."""
        return len(self.head)

    @property
    def numbers(self) -> list[Any]:
        """The arrays that objectives depend on."""
        always = self.tail, self.head, self.survival, self.reward
        lengths = [self.length] if (self.length != 1.0).any() else []  # by default all are 1
        return [*always, *lengths, *(self.kinds or ())[:-1]]

    def __reduce__(self) -> tuple[object, ...]:
        return _read_only, tuple(self)  # numpy unpickles arrays as writable ones


class Limits(NamedTuple):
    """The limits that the robots of a plan keep; with kinds, the strictest of any kind."""

    min_survival: float = 0.0  # survival floor; 0 sets none
    max_length: float = math.inf  # travel budget: the largest sum of its arcs' lengths
    # With kinds, floor and budget of the kind of each node (n_nodes).
    floors: FloatArray | None = None
    budgets: FloatArray | None = None

    @property
    def bind(self) -> bool:
        """Return whether there is any limit."""
        return self.min_survival > 0.0 or self.max_length < math.inf

    def loosened(self, by: float) -> Limits:
        """Return limits that allow a little more, by a relative amount."""
        less, more = 1.0 - by, 1.0 + by
        floors, budgets = self.floors, self.budgets
        return Limits(
            self.min_survival * less,
            self.max_length * more,
            None if floors is None else floors * less,
            None if budgets is None else budgets * more,
        )

    def with_floor(self, least: float) -> Limits:
        """Return the same limits with a survival floor that is at least ``least``."""
        floors = self.floors
        if floors is not None:
            floors = np.maximum(floors, least)
        return self._replace(min_survival=max(self.min_survival, least), floors=floors)


NO_LIMITS = Limits()


def limits_of_kinds(floors: Sequence[float], budgets: Sequence[float], n_nodes: int) -> Limits:
    """Return the limits of kinds, each of which has ``n_nodes`` nodes."""
    by_node = (np.repeat(np.array(of, np.float64), n_nodes) for of in (floors, budgets))
    return Limits(max(floors), min(budgets), *by_node)


@inlined
def limit_at(strictest: float, by_node: FloatArray | None, node: int) -> float:
    """Return a limit of a robot at a node: the strictest of all, if there are no kinds."""
    if by_node is None:
        return strictest
    return float(by_node[node])


def new_graph(
    tail: OffsetArray,
    head: OffsetArray,
    survival: FloatArray,
    length: FloatArray,
    reward: FloatArray,
    base: int,
    kinds: Kinds | None = None,
) -> Graph:
    """Prepare a valid mission's graph; its arcs are sorted by tail, then by head."""
    n_nodes, n_arcs = len(reward), len(head)
    leaving = np.bincount(tail, minlength=n_nodes)
    n_entering = np.bincount(head, minlength=n_nodes)
    first = np.concatenate([[0], np.cumsum(leaving)])
    cost = -np.log(survival) + 0.0  # no negative zeros
    is_closed = kinds is None or bool((kinds.end[kinds.start] == kinds.start).all())
    forth, back = tail * n_nodes + head, head * n_nodes + tail
    found = np.minimum(np.searchsorted(forth, back), max(0, n_arcs - 1))
    first_entering = np.concatenate([[0], np.cumsum(n_entering)])
    entering = np.argsort(head, kind="stable")
    graph = Graph(
        first=first,
        tail=tail,
        head=head,
        survival=survival,
        cost=cost,
        length=length,
        reverse=np.where(forth[found] == back, found, -1),
        first_entering=first_entering,
        entering=entering,
        reward=reward,
        homeward=np.full(n_nodes, -1),
        home=np.ones(n_nodes),
        base=base,
        balanced=is_closed and bool(np.array_equal(leaving, n_entering)),
        kinds=kinds,
    )
    homeward, _, home = _ways_home(graph)
    return _read_only(*graph._replace(homeward=homeward, home=home))


@helper
def find_arc(graph: Graph, tail: int, head: int) -> int:
    """Return the arc between two nodes; −1 where there is none."""
    low, high = graph.first[tail], graph.first[tail + 1]
    while high - low > _LINEAR_SEARCH_UP_TO:
        middle = (low + high) // 2
        if graph.head[middle] <= head:
            low = middle
        else:
            high = middle
    for arc in range(low, high):
        if graph.head[arc] == head:
            return arc
    return -1


def with_costs(graph: Graph, cost: FloatArray) -> Graph:
    """Return the same graph with other costs of arcs, so that path searches minimise these.

    ``homeward`` leads along the cheapest way home then, and ``home`` is the cost of that way, 0 at
    the base.
    """
    graph = graph._replace(cost=cost)
    homeward, home, _ = _ways_home(graph)
    return _read_only(*graph._replace(homeward=homeward, home=home))


def _ways_home(graph: Graph) -> tuple[OffsetArray, FloatArray, FloatArray]:
    """Find the cheapest way home from every node by Dijkstra's algorithm, from the ends backwards.

    Returns the first arc of each way, its cost and its survival. In Python, since it runs once for
    every mission: compiling it would take longer. Ties go to the node of the smallest index.
    """
    n_nodes, survival = graph.n_nodes, graph.survival
    distance, homeward, home = [math.inf] * n_nodes, np.full(n_nodes, -1), np.ones(n_nodes)
    starts, arcs = graph.first_entering.tolist(), graph.entering.tolist()
    tails, costs = graph.tail.tolist(), graph.cost.tolist()
    ends = [graph.base] if graph.kinds is None else np.unique(graph.kinds.end).tolist()
    heap = [(0.0, end) for end in ends]
    for end in ends:
        distance[end] = 0.0
    while heap:
        key, far = heapq.heappop(heap)
        if key > distance[far]:
            continue
        for arc in arcs[starts[far] : starts[far + 1]]:
            near, reached = tails[arc], key + costs[arc]
            if reached < distance[near]:
                distance[near], homeward[near] = reached, arc
                home[near] = survival[arc] * home[far]
                heapq.heappush(heap, (reached, near))
    return homeward, np.array(distance), home


def _read_only(*fields: object) -> Graph:
    for field in fields:
        for array in field if isinstance(field, Kinds) else (field,):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)
    return Graph(*fields)  # type: ignore[arg-type]
