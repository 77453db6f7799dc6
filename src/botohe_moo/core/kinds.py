"""Kinds of robots, and rewards that are credited on return.

Each kind has a copy of every node, its layer of the graph: if the mission has n nodes, its node v
is node ``k * n + v`` of kind k. No arc leads from one layer to another, and arcs that a kind must
not take are not in its layer. So trails are sequences of nodes of one layer, and whatever kernels
keep of arcs and nodes they keep of each kind.

A mission of one kind whose robots start and end at the base, and whose nodes pay on arrival, has no
``Kinds``. Numba leaves out of its kernels what a test for None excludes, if the value that is
tested is an argument of the function.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.core.compile import helper, inlined

# Where rewards are credited: at the next depot, on arrival, or on arrival at a depot, where all
# rewards that the robot carries are credited, too.
AT_NEXT_DEPOT, ON_ARRIVAL, AT_THIS_DEPOT = 0, 1, 2

CARRIED = -1.0  # instead of a probability, of visits that have not been credited yet


class Kinds(NamedTuple):
    """What kernels know of several kinds of robots, or of rewards on return."""

    # Of each node (n_nodes): the node of the mission that it is a copy of; the probability that a
    # robot that gets there collects its reward; where that is credited; and where trails end.
    origin: OffsetArray
    share: FloatArray
    credit: OffsetArray
    end: OffsetArray
    reward: FloatArray  # reward of each node of the mission
    # Of each robot (n_robots): where its trail begins; the first robot of its kind, and the one
    # behind the last.
    start: OffsetArray
    first: OffsetArray
    stop: OffsetArray
    # What robots carry from the start: nodes of the mission, and which of these each robot has
    # (n_robots).
    aboard: OffsetArray
    aboard_first: OffsetArray
    aboard_stop: OffsetArray
    has_returns: bool  # whether some node that may bring something pays on return


@inlined
def origin_of(kinds: Kinds | None, node: int) -> int:
    """Return the node of the mission that a node is a copy of."""
    if kinds is None:
        return node
    return int(kinds.origin[node])


@inlined
def start_of(kinds: Kinds | None, base: int, robot: int) -> int:
    """Return the node where a robot's trail begins.

    ``robot`` may also be the number of a trail among those of all plans.
    """
    if kinds is None:
        return base
    return int(kinds.start[robot % kinds.start.shape[0]])


@inlined
def aboard_of(kinds: Kinds | None, robot: int) -> tuple[int, int]:
    """Return the first place of what a robot carries from the start, and the one behind the last.

    ``robot`` may also be the number of a trail among those of all plans.
    """
    if kinds is None:
        return 0, 0
    robot %= kinds.start.shape[0]
    return int(kinds.aboard_first[robot]), int(kinds.aboard_stop[robot])


@inlined
def aboard_at(kinds: Kinds | None, layer: int, i: int) -> int:
    """Return the node of a layer whose reward is carried, by its place in ``Kinds.aboard``."""
    if kinds is None:
        return 0
    return int(layer + kinds.aboard[i])


@inlined
def end_of(kinds: Kinds | None, base: int, node: int) -> int:
    """Return where the trails end of the kind of robots that a node belongs to."""
    if kinds is None:
        return base
    return int(kinds.end[node])


@inlined
def reward_at(kinds: Kinds | None, reward: FloatArray, node: int) -> float:
    """Return the reward of a node of the mission; ``reward`` is that of the graph."""
    if kinds is None:
        return float(reward[node])
    return float(kinds.reward[node])


@inlined
def has_kinds(kinds: Kinds | None) -> bool:
    """Return whether there are kinds, or rewards on return."""
    return kinds is not None


@inlined
def has_returns(kinds: Kinds | None) -> bool:
    """Return whether rewards of some nodes count on return."""
    return False if kinds is None else bool(kinds.has_returns)


@inlined
def credit_of(kinds: Kinds | None, node: int) -> int:
    """Return where the reward of a node is credited."""
    if kinds is None:
        return ON_ARRIVAL
    return int(kinds.credit[node])


@inlined
def is_listed(kinds: Kinds | None, reward: FloatArray, node: int) -> bool:
    """Return whether visits to a node are listed; with kinds, only those that may bring something.

    So every kernel adds up the same numbers in the same order. ``reward`` is that of the graph.
    """
    return True if kinds is None else bool(reward[node] > 0.0)


@inlined
def chance_at(kinds: Kinds | None, node: int, alive: float) -> float:
    """Return with what probability a visit is credited, or ``CARRIED`` if that is not known yet.

    The robot is the first time at the node, with probability ``alive``.
    """
    if kinds is None:
        return alive
    return CARRIED if kinds.credit[node] == AT_NEXT_DEPOT else alive * kinds.share[node]


@helper
def credit_carried(
    kinds: Kinds | None,
    layer: int,
    nodes: IntArray | OffsetArray,
    chances: FloatArray,
    first: int,
    stop: int,
    alive: float,
) -> int:
    """Credit what is carried of the visits from ``first`` to ``stop``, which is returned.

    The robot is at a depot with probability ``alive``; 0 at the end, where the rest is lost.
    ``nodes`` are those of the mission, ``layer`` the first node of the robot's kind.
    """
    if kinds is None:
        return stop
    if kinds.has_returns:  # else nothing is carried
        for i in range(first, stop):
            if chances[i] == CARRIED:
                chances[i] = alive * kinds.share[layer + nodes[i]]
    return stop


def kind_ranges(kinds: Kinds | None, n_robots: int) -> tuple[OffsetArray, OffsetArray]:
    """Return the first robot of each robot's kind, and the one behind the last (n_robots)."""
    if kinds is None:
        return np.zeros(n_robots, np.int64), np.full(n_robots, n_robots)
    return kinds.first, kinds.stop


def n_kinds(kinds: Kinds | None) -> int:
    """Return how many kinds there are."""
    return 1 if kinds is None else len(kinds.origin) // len(kinds.reward)


@inlined
def likely_chance(kinds: Kinds | None, home: FloatArray, node: int, alive: float) -> float:
    """Return with what probability a visit is credited if the robot then goes straight home.

    ``home`` is that of the graph.
    """
    if kinds is None:
        return alive
    credited = alive * kinds.share[node]
    return float(credited * home[node] if kinds.credit[node] == AT_NEXT_DEPOT else credited)


@inlined
def layer_of(kinds: Kinds | None, node: int) -> int:
    """Return the first node of the layer of a node."""
    if kinds is None:
        return 0
    return int(node - kinds.origin[node])


@inlined
def loop_at(kinds: Kinds | None, n_arcs: int, node: int) -> int:
    """Return the self-loop at the end of trails that visit a node: behind all arcs, by kind."""
    if kinds is None:
        return n_arcs
    return int(n_arcs + node // kinds.reward.shape[0])


@inlined
def n_origins(kinds: Kinds | None, n_nodes: int) -> int:
    """Return how many nodes the mission has; ``n_nodes`` is how many the graph has."""
    if kinds is None:
        return n_nodes
    return int(kinds.reward.shape[0])


@inlined
def first_of_kind(kinds: Kinds | None, robot: int) -> int:
    """Return the first robot of a robot's kind."""
    if kinds is None:
        return 0
    return int(kinds.first[robot])


@inlined
def behind_kind(kinds: Kinds | None, n_robots: int, robot: int) -> int:
    """Return the robot behind the last one of a robot's kind, of ``n_robots`` in all."""
    if kinds is None:
        return n_robots
    return int(kinds.stop[robot])
