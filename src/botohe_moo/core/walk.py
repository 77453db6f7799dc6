"""One walk for all who ask what a robot's trail visits, and what it collects there."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.core.compile import array_maker, helper, inlined
from botohe_moo.core.world import (
    AT_NEXT_DEPOT,
    AT_THIS_DEPOT,
    Returns,
    World,
    aboard_at,
    aboard_of,
    layer_of,
)

CARRIED = -1.0  # instead of a probability, of visits that have not been credited yet


class Visits(NamedTuple):
    """Scratch of walks: what a trail visits that may be worth something."""

    # The nodes of the mission in the order of first visits, what robots carry from the start
    # before these; and the probability that each is credited (n_nodes).
    node: OffsetArray
    chance: FloatArray
    seen: OffsetArray  # the last walk that came to each node of the layers (n_nodes)
    n_walks: OffsetArray  # how many walks there have been (1)


@array_maker
def new_visits(n_nodes: int) -> Visits:
    """Return scratch for walks through a graph of ``n_nodes`` nodes."""
    return Visits(
        np.empty(n_nodes, np.int64),
        np.empty(n_nodes),
        np.zeros(n_nodes, np.int64),
        np.zeros(1, np.int64),
    )


@helper
def walk(
    world: World,
    returns: Returns | None,
    arcs: IntArray | OffsetArray,
    n_arcs: int,
    robot: int,
    visits: Visits,
) -> tuple[int, float, float]:
    """List what a robot visits on a trail, and with what probability each reward is credited.

    A reward that counts on arrival is credited with share · (probability to get there), one on
    return with share · (probability to get to the next depot), or 0 if there is none. Returns how
    many visits there are, and the survival and the length of the trail. ``returns`` are those of
    the world.
    """
    graph, source = world.graph, world.team.start[robot]
    visits.n_walks[0] += 1
    n = _visit(world, returns, visits, source, 1.0, _load(world, returns, visits, robot))
    alive, length = 1.0, 0.0
    for i in range(n_arcs):
        arc = arcs[i]
        alive *= graph.survival[arc]
        length += graph.length[arc]
        n = _visit(world, returns, visits, graph.head[arc], alive, n)
    _credit_carried(world, returns, visits, source, n, 0.0)  # the rest is lost
    return n, alive, length


@inlined
def _load(world: World, returns: Returns | None, visits: Visits, robot: int) -> int:
    """List what a robot carries from the start as visits, and return how many they are."""
    if returns is None:
        return 0
    layer, n = layer_of(world.team, world.team.start[robot]), 0
    first, stop = aboard_of(returns, robot)
    for i in range(first, stop):
        node = aboard_at(returns, layer, i)
        visits.seen[node] = visits.n_walks[0]
        visits.node[n], visits.chance[n] = world.team.origin[node], CARRIED
        n += 1
    return n


@inlined
def _visit(
    world: World, returns: Returns | None, visits: Visits, node: int, alive: float, n: int
) -> int:
    """Note that a robot gets to a node, with probability ``alive``, after ``n`` visits.

    Returns how many visits there are then.
    """
    team = world.team
    if visits.seen[node] != visits.n_walks[0]:
        visits.seen[node] = visits.n_walks[0]
        if world.graph.reward[node] > 0.0:
            visits.node[n], visits.chance[n] = team.origin[node], alive * team.share[node]
            if returns is not None and returns.credit[node] == AT_NEXT_DEPOT:
                visits.chance[n] = CARRIED
            n += 1
    if returns is not None and returns.credit[node] == AT_THIS_DEPOT:
        _credit_carried(world, returns, visits, node, n, alive)
    return n


@helper
def _credit_carried(
    world: World, returns: Returns | None, visits: Visits, node: int, n: int, alive: float
) -> None:
    """Credit what is carried of ``n`` visits at a depot, with probability ``alive``."""
    if returns is None:
        return
    layer = layer_of(world.team, node)
    for i in range(n):
        if visits.chance[i] == CARRIED:
            visits.chance[i] = alive * world.team.share[layer + visits.node[i]]
