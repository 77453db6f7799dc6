"""The one model under all kernels: a mission's graph, team, limits and ways as arrays.

Each kind of robots has a copy of every node, its layer of the graph: if the mission has n nodes,
its node v is node ``k * n + v`` of kind k. No arc leads from one layer to another, and arcs that a
kind must not take are not in its layer. So trails are sequences of nodes of one layer, and whatever
kernels keep of arcs and nodes they keep of each kind. A team of one kind has one layer.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.core.compile import begin_run, helper, inlined

# Relative tolerances. Searches plan with limits that are loosened by ``PLANNING``, and plans are
# checked with ``CHECKING``: rounding never makes a plan that a search has found infeasible.
PLANNING, CHECKING = 0.5e-12, 1e-12

# Where rewards are credited: at the next depot, on arrival, or on arrival at a depot, where all
# rewards that the robot carries are credited, too.
AT_NEXT_DEPOT, ON_ARRIVAL, AT_THIS_DEPOT = 0, 1, 2

# Among up to this many arcs a head is looked for one by one, after a binary search among more.
_LINEAR_SEARCH_UP_TO = 12


class Graph(NamedTuple):
    """The arcs of all layers, grouped by tail, and the nodes; all arrays are read-only.

    Indices of nodes and arcs are 64-bit integers everywhere, so that no helper is compiled twice.
    """

    # The arcs that leave node v are ``first[v]`` to ``first[v + 1]`` (n_nodes + 1).
    first: OffsetArray
    # The nodes that each arc leaves and enters (n_arcs); heads ascend within a node's arcs.
    tail: OffsetArray
    head: OffsetArray
    # Of each scenario, its probability (n_scenarios), and the probability to survive each arc, in
    # [0, 1] (n_scenarios, n_arcs). A mission without scenarios has one.
    probability: FloatArray
    survival: FloatArray
    # For heuristics: the expected survival of each arc over all scenarios, in (0, 1]; what path
    # searches minimise, −log of it if nothing else is said; and the length, at least 0 (n_arcs).
    mean_survival: FloatArray
    cost: FloatArray
    length: FloatArray
    # The arc from each arc's head to its tail, −1 where there is none (n_arcs).
    reverse: OffsetArray
    # The arcs that enter node v are ``entering[first_entering[v]:first_entering[v + 1]]``.
    first_entering: OffsetArray
    entering: OffsetArray
    # For heuristics: what a robot that gets to each node expects there, at least 0 (n_nodes).
    reward: FloatArray
    # Whether as many arcs enter every node as leave it, and trails end where they begin: then no
    # trail meets a dead end.
    balanced: bool

    @property
    def n_nodes(self) -> int:
        """Number of nodes in all layers."""
        return len(self.reward)

    @property
    def n_arcs(self) -> int:
        """Number of arcs, without the self-loops that end a colony's trails."""
        return len(self.head)

    @property
    def n_scenarios(self) -> int:
        """Number of scenarios, at least 1."""
        return len(self.probability)


class Team(NamedTuple):
    """The robots, and what they are worth to nodes."""

    reward: FloatArray  # expected reward of each node of the mission, at least 0
    # The reward of node v of the mission in scenario s, times the probability of s, is at
    # s · n_nodes + v, where n_nodes are those of all layers (n_scenarios · n_nodes).
    worth: FloatArray
    # Of each node of the layers: the node of the mission that it is a copy of; the probability that
    # a robot that gets there collects its reward; and where trails of its layer end (n_nodes).
    origin: OffsetArray
    share: FloatArray
    end: OffsetArray
    # Of each robot: where its trail begins; the first robot of its kind, and the one behind the
    # last (n_robots).
    start: OffsetArray
    first: OffsetArray
    stop: OffsetArray

    @property
    def n_kinds(self) -> int:
        """Number of kinds of robots."""
        return len(self.origin) // len(self.reward)


class Limits(NamedTuple):
    """The limits that each robot's trail keeps."""

    floors: FloatArray  # survival floors: the least product of survivals; 0 sets none (n_robots)
    budgets: FloatArray  # travel budgets: the largest sum of lengths; inf sets none (n_robots)
    has_budgets: bool  # whether there is any travel budget: kernels ask

    @property
    def has_floors(self) -> bool:
        """Whether there is any survival floor."""
        return bool((self.floors > 0.0).any())

    def loosened(self, by: float) -> Limits:
        """Return limits that allow a little more, by a relative amount."""
        return self._replace(floors=self.floors * (1.0 - by), budgets=self.budgets * (1.0 + by))


def new_limits(floors: Sequence[float], budgets: Sequence[float], counts: Sequence[int]) -> Limits:
    """Return the limits of a team, from those of its kinds and how many robots each has."""
    by_robot = [np.repeat(np.array(of, np.float64), counts) for of in (floors, budgets)]
    return Limits(by_robot[0], by_robot[1], any(budget < math.inf for budget in budgets))


class Shortest(NamedTuple):
    """The shortest ways to the end of each layer, as ``Ways`` has the cheapest ones."""

    graph: Graph  # with lengths as costs
    homeward: OffsetArray
    length: FloatArray  # of each way (n_nodes)


class Ways(NamedTuple):
    """From each node, a way to the end of its layer."""

    # The arc by which the cheapest way leaves each node, −1 at the end; and the survival of that
    # way, 1 at the end (n_nodes).
    homeward: OffsetArray
    home: FloatArray
    shortest: Shortest | None  # None without travel budgets


class Returns(NamedTuple):
    """Rewards that count when they are brought to a depot."""

    credit: OffsetArray  # where the reward of each node is credited (n_nodes)
    # What robots carry from the start: nodes of the mission, and which of these each robot has
    # (n_robots).
    aboard: OffsetArray
    first: OffsetArray
    stop: OffsetArray


class World(NamedTuple):
    """What kernels know of a mission.

    Numba leaves out of its kernels what a test for None excludes, if the value that is tested is an
    argument of the function: where it matters ``returns`` is handed over beside the world.
    """

    graph: Graph
    team: Team
    limits: Limits
    ways: Ways
    returns: Returns | None  # None where all rewards count on arrival

    @property
    def n_robots(self) -> int:
        """Number of robots."""
        return len(self.team.start)

    def numbers(self, is_plain: bool) -> list[Any]:
        """Return the arrays that objectives depend on; those of a plain mission are fewer."""
        graph, team = self.graph, self.team
        numbers = [graph.tail, graph.head, graph.survival, graph.reward]
        if graph.n_scenarios > 1:
            numbers += [graph.probability, team.worth]
        if (graph.length != 1.0).any():  # by default all are 1
            numbers.append(graph.length)
        if is_plain:
            return numbers
        of_nodes = [team.origin, team.share, *(self.returns or ())[:1], team.end, team.reward]
        return [*numbers, *of_nodes, team.start, team.first, team.stop, *(self.returns or ())[1:]]

    @property
    def is_plain(self) -> bool:
        """Whether all robots are alike, collect what they reach, and start where they end.

        A mission with several scenarios is not plain.
        """
        team = self.team
        return (
            team.n_kinds == 1
            and self.graph.n_scenarios == 1
            and self.returns is None
            and bool((team.share == 1.0).all() and (team.end[0] == team.start).all())
        )

    def with_limits(self, limits: Limits) -> World:
        """Return the same world with other limits."""
        shortest = self.ways.shortest
        if limits.has_budgets and shortest is None:
            graph = self.graph._replace(cost=self.graph.length)
            homeward, length, _ = cheapest_ways(graph, self.team.end)
            shortest = Shortest(graph, homeward, length)
        ways = self.ways._replace(shortest=shortest if limits.has_budgets else None)
        return read_only(*self._replace(limits=limits, ways=ways))

    def with_costs(self, cost: FloatArray) -> World:
        """Return the same world with other costs of arcs, and the cheapest ways by these."""
        graph = self.graph._replace(cost=cost)
        homeward, _, home = cheapest_ways(graph, self.team.end)
        return read_only(*self._replace(graph=graph, ways=Ways(homeward, home, self.ways.shortest)))

    def __reduce__(self) -> tuple[object, ...]:
        return read_only, tuple(self)  # numpy unpickles arrays as writable ones


class Chances(NamedTuple):
    """The probability of each scenario, and survivals in it, as ``Graph`` has them."""

    probability: FloatArray
    survival: FloatArray


def new_world(
    tail: OffsetArray,
    head: OffsetArray,
    chances: Chances,
    length: FloatArray,
    reward: FloatArray,
    team: Team,
    limits: Limits,
    returns: Returns | None,
) -> World:
    """Prepare a valid mission; its arcs are sorted by tail, then by head.

    ``length`` and ``reward`` are as ``Graph`` has them.
    """
    probability, survival = chances
    n_nodes, n_arcs = len(reward), len(head)
    leaving = np.bincount(tail, minlength=n_nodes)
    n_entering = np.bincount(head, minlength=n_nodes)
    is_closed = bool((team.end[team.start] == team.start).all())
    forth, back = tail * n_nodes + head, head * n_nodes + tail
    found = np.minimum(np.searchsorted(forth, back), max(0, n_arcs - 1))
    mean = survival[0]
    if len(survival) > 1:  # of 1 in all scenarios, sums may be 1.0000000000000002
        mean = np.clip(probability @ survival, math.ulp(0.0), 1.0)
    graph = Graph(
        first=np.concatenate([[0], np.cumsum(leaving)]),
        tail=tail,
        head=head,
        probability=probability,
        survival=np.ascontiguousarray(survival),
        mean_survival=mean,
        cost=-np.log(mean) + 0.0,  # no negative zeros
        length=length,
        reverse=np.where(forth[found] == back, found, -1),
        first_entering=np.concatenate([[0], np.cumsum(n_entering)]),
        entering=np.argsort(head, kind="stable"),
        reward=reward,
        balanced=is_closed and bool(np.array_equal(leaving, n_entering)),
    )
    homeward, _, home = cheapest_ways(graph, team.end)
    return World(graph, team, limits, Ways(homeward, home, None), returns).with_limits(limits)


def cheapest_ways(graph: Graph, end: OffsetArray) -> tuple[OffsetArray, FloatArray, FloatArray]:
    """Find the cheapest way to its end from every node by Dijkstra's algorithm, backwards.

    Returns the first arc of each way, its cost and its survival. In Python, since it runs once for
    every mission: compiling it would take longer. Ties go to the node of the smallest index.
    """
    n_nodes, survival = graph.n_nodes, graph.mean_survival
    distance, homeward, home = [math.inf] * n_nodes, np.full(n_nodes, -1), np.ones(n_nodes)
    starts, arcs = graph.first_entering.tolist(), graph.entering.tolist()
    tails, costs = graph.tail.tolist(), graph.cost.tolist()
    heap = [(0.0, end) for end in np.unique(end).tolist()]
    for _, end_ in heap:
        distance[end_] = 0.0
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


def read_only(*parts: Any) -> World:
    """Return a world of some parts, all of whose arrays become read-only."""
    world = World(*parts)
    begin_run()
    for part in (*world, world.ways.shortest):
        for array in part or ():
            if isinstance(array, np.ndarray):
                array.setflags(write=False)
    return world


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


@inlined
def keeps(limits: Limits, robot: int, alive: float, length: float) -> bool:
    """Return whether a trail of some survival and length keeps a robot's limits."""
    return bool(alive >= limits.floors[robot] and length <= limits.budgets[robot])


@inlined
def layer_of(team: Team, node: int) -> int:
    """Return the first node of the layer of a node."""
    return int(node - team.origin[node])


@inlined
def loop_at(graph: Graph, team: Team, node: int) -> int:
    """Return the self-loop at the end of trails that visit a node: behind all arcs, by kind."""
    return int(graph.head.shape[0] + node // team.reward.shape[0])


def brought_home(world: World, worth: FloatArray) -> FloatArray:
    """Return what nodes are worth to a robot that goes straight home from them (n_nodes).

    A reward on return is then expected as far as the safest way home is survived.
    """
    if world.returns is None:
        return worth
    return np.where(world.returns.credit == AT_NEXT_DEPOT, worth * world.ways.home, worth)


@inlined
def credit_of(returns: Returns | None, node: int) -> int:
    """Return where the reward of a node is credited."""
    if returns is None:
        return ON_ARRIVAL
    return int(returns.credit[node])


@inlined
def aboard_of(returns: Returns | None, robot: int) -> tuple[int, int]:
    """Return where the list of what a robot carries from the start begins and ends."""
    if returns is None:
        return 0, 0
    return int(returns.first[robot]), int(returns.stop[robot])


@inlined
def aboard_at(returns: Returns | None, layer: int, i: int) -> int:
    """Return the node of a layer whose reward is carried, by its place in ``Returns.aboard``."""
    if returns is None:
        return 0
    return int(layer + returns.aboard[i])


class Way(NamedTuple):
    """A way through a graph, with its survival over all scenarios and its length."""

    nodes: list[int]
    survival: float
    length: float


def ways_to_ends(world: World) -> list[Way]:
    """Return each robot's safest way from start to end, or the shortest if that is too long."""
    shortest, ways = world.ways.shortest, []
    for start, budget in zip(world.team.start.tolist(), world.limits.budgets, strict=True):
        way = _way_along(world.graph, world.ways.homeward, start)
        if shortest is not None and way.length > budget:
            way = _way_along(world.graph, shortest.homeward, start)
        ways.append(way)
    return ways


def _way_along(graph: Graph, homeward: OffsetArray, node: int) -> Way:
    way, survival, length = [node], np.ones(graph.n_scenarios), 0.0
    while (arc := int(homeward[way[-1]])) >= 0:
        way.append(int(graph.head[arc]))
        survival *= graph.survival[:, arc]
        length += float(graph.length[arc])
    return Way(way, float(graph.probability @ survival), length)


def failing_ways(world: World) -> Iterator[tuple[int, Way]]:
    """List ways to ends that do not keep the limits, with the first robot of each kind.

    Such a way may not even lead to the end.
    """
    team, ways = world.team, ways_to_ends(world)
    for robot in np.unique(team.first).tolist():
        way = ways[robot]
        arrives = way.nodes[-1] == team.end[team.start[robot]]
        if not (arrives and keeps(world.limits, robot, way.survival, way.length)):
            yield robot, way


def leading(tail: OffsetArray, head: OffsetArray, goals: Sequence[int], n_nodes: int) -> BoolArray:
    """Return which nodes are a goal or have a way to one, along arcs from tail to head."""
    leads = np.isin(np.arange(n_nodes), goals)
    while (new := leads[head] & ~leads[tail]).any():  # once for each arc of the longest way
        leads[tail[new]] = True
    return leads


def uncollected(world: World) -> OffsetArray:
    """Return the nodes of a mission whose reward no kind can collect.

    A reward on return needs a way on to a depot. The base is one.
    """
    graph, team, returns = world.graph, world.team, world.returns
    collects = graph.reward > 0.0
    if returns is not None:
        depots = np.flatnonzero(returns.credit == AT_THIS_DEPOT).tolist()
        leads = leading(graph.tail, graph.head, depots, graph.n_nodes)
        collects &= (returns.credit != AT_NEXT_DEPOT) | leads
    by_kind = collects.reshape(-1, len(team.reward)).any(axis=0)
    return np.flatnonzero((team.reward > 0.0) & ~by_kind)
