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

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.compile import inlined

# Where rewards are credited: at the next depot, on arrival, or on arrival at a depot, where all
# rewards that the robot carries are credited, too.
AT_NEXT_DEPOT, ON_ARRIVAL, AT_THIS_DEPOT = 0, 1, 2


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


@inlined
def origin_of(kinds: Kinds | None, node: int) -> int:
    """Return the node of the mission that a node is a copy of."""
    if kinds is None:
        return node
    return int(kinds.origin[node])


@inlined
def start_of(kinds: Kinds | None, base: int, robot: int) -> int:
    """Return the node where a robot's trail begins."""
    if kinds is None:
        return base
    return int(kinds.start[robot])


@inlined
def end_of(kinds: Kinds | None, base: int, node: int) -> int:
    """Return the node where trails end that visit a node."""
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
def credit_of(kinds: Kinds | None, node: int) -> int:
    """Return where the reward of a node is credited."""
    if kinds is None:
        return ON_ARRIVAL
    return int(kinds.credit[node])


@inlined
def share_of(kinds: Kinds | None, node: int) -> float:
    """Return the probability that a robot that gets to a node collects its reward."""
    if kinds is None:
        return 1.0
    return float(kinds.share[node])


@inlined
def layer_of(kinds: Kinds | None, robot: int) -> int:
    """Return the first node of the layer of a robot's kind."""
    if kinds is None:
        return 0
    start = kinds.start[robot]
    return int(start - kinds.origin[start])


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
