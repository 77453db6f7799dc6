"""Expected team reward and expected number of survivors of many trail plans."""

from typing import TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.compile import everywhere, kernel

# What may be wrong with a trail; ``evaluate`` reports the first fault as
# (kind, plan, robot, position), all zero when there is none.
VALID = 0
EMPTY_TRAIL = 1
UNKNOWN_NODE = 2
NOT_FROM_BASE = 3
NOT_BACK_AT_BASE = 4
MISSING_ARC = 5
ARC_USED_TWICE = 6
BAD_OFFSETS = 7

_LINEAR_SEARCH_UP_TO = 12

Chance = TypeVar("Chance", float, FloatArray)


@kernel
def find_arc(first: OffsetArray, head: IntArray, tail_node: int, head_node: int) -> int:
    """Give the index of the arc between two nodes, or -1.

    The arcs of node v are ``first[v]`` to ``first[v + 1]``, their heads ascending.
    """
    low, high = first[tail_node], first[tail_node + 1]
    while high - low > _LINEAR_SEARCH_UP_TO:
        middle = (low + high) // 2
        if head[middle] <= head_node:
            low = middle
        else:
            high = middle
    for arc in range(low, high):
        if head[arc] == head_node:
            return arc
    return -1


@everywhere
def either(one: Chance, other: Chance) -> Chance:
    """Give the chance that one of two robots or the other reaches a node: 1 − (1 − p)(1 − q).

    No term is negative, so that small chances keep their digits, which differences from 1 lose.
    """
    return one + (1.0 - one) * other


@kernel
def _precedes(nodes: IntArray, offsets: OffsetArray, one: int, other: int) -> bool:
    """Tell whether trail ``one`` comes before trail ``other`` in lexicographic order."""
    start, stop = offsets[one], offsets[one + 1]
    other_start, other_stop = offsets[other], offsets[other + 1]
    for i in range(min(stop - start, other_stop - other_start)):
        difference = nodes[start + i] - nodes[other_start + i]
        if difference != 0:
            return bool(difference < 0)
    return bool(stop - start < other_stop - other_start)


@kernel
def evaluate(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    reward: FloatArray,
    base: int,
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    objectives: FloatArray,
) -> tuple[int, int, int, int]:
    """Write E[R] and E[S] of every plan into ``objectives``, validating each trail on the way.

    Robots are visited in the lexicographic order of their trails, so that two orders of the same
    trails give the same floating-point numbers.

    Parameters
    ----------
    first, head, survival
        The arcs, grouped by tail node: offsets (n_nodes + 1), heads and survivals (n_arcs).
    reward
        Reward of every node (n_nodes).
    base
        Index of the base.
    nodes, offsets
        The trails, ragged: trail t is ``nodes[offsets[t]:offsets[t + 1]]``; plan i owns the
        trails ``i * n_robots`` to ``(i + 1) * n_robots``.
    n_robots
        Trails per plan, at least one.
    objectives
        Output (n_plans, 2): E[R] in rewards, E[S] in robots. Rows from a faulty plan on are left.

    Returns
    -------
    tuple of int
        (kind, plan, robot, position) of the first fault; kind is ``VALID`` where there is none.
    """
    n_nodes = reward.shape[0]
    reached = np.empty(n_nodes)
    touched_by_plan = np.full(n_nodes, -1, np.int64)
    visited_by_trail = np.full(n_nodes, -1, np.int64)
    used_by_trail = np.full(head.shape[0], -1, np.int64)
    touched = np.empty(n_nodes, np.int32)
    order = np.empty(n_robots, np.int64)

    for plan in range(objectives.shape[0]):
        for k in range(n_robots):
            trail = plan * n_robots + k
            if offsets[trail] < 0 or offsets[trail + 1] > nodes.shape[0]:
                return BAD_OFFSETS, plan, k, 0
            place = k
            while place > 0 and _precedes(nodes, offsets, trail, order[place - 1]):
                order[place] = order[place - 1]
                place -= 1
            order[place] = trail

        n_touched = 0
        survivors = 0.0
        for k in range(n_robots):
            trail = order[k]
            robot = trail - plan * n_robots
            start, stop = offsets[trail], offsets[trail + 1]
            if start >= stop:
                return EMPTY_TRAIL, plan, robot, 0
            if nodes[start] != base:
                known = 0 <= nodes[start] < n_nodes
                return NOT_FROM_BASE if known else UNKNOWN_NODE, plan, robot, 0
            alive = 1.0
            here = base
            for position in range(start, stop):
                if position > start:
                    there = nodes[position]
                    if there < 0 or there >= n_nodes:
                        return UNKNOWN_NODE, plan, robot, position - start
                    arc = find_arc(first, head, here, there)
                    if arc < 0:
                        return MISSING_ARC, plan, robot, position - start
                    if used_by_trail[arc] == trail:
                        return ARC_USED_TWICE, plan, robot, position - start
                    used_by_trail[arc] = trail
                    alive *= survival[arc]
                    here = there
                if visited_by_trail[here] != trail:
                    visited_by_trail[here] = trail
                    if touched_by_plan[here] != plan:
                        touched_by_plan[here] = plan
                        reached[here] = alive
                        touched[n_touched] = here
                        n_touched += 1
                    else:
                        reached[here] = either(reached[here], alive)
            if here != base:
                return NOT_BACK_AT_BASE, plan, robot, stop - start - 1
            survivors += alive

        expected_reward = 0.0
        for i in range(n_touched):
            expected_reward += reward[touched[i]] * reached[touched[i]]
        objectives[plan, 0] = expected_reward
        objectives[plan, 1] = survivors
    return VALID, 0, 0, 0


@kernel
def evaluate_drafts(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    reward: FloatArray,
    base: int,
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    objectives: FloatArray,
    faults: FloatArray,
    alive: FloatArray,
) -> None:
    """Write E[R] and E[S] of plans that need not be valid, and how far they are from it.

    A robot walks its trail up to the first fault, where it is lost. The arithmetic is that of
    ``evaluate``, so that valid plans get the same bits.

    Parameters
    ----------
    first, head, survival, reward, base, nodes, offsets, n_robots
        As for ``evaluate``.
    objectives
        Output (n_plans, 2): E[R] in rewards, E[S] in robots.
    faults
        Output (n_plans): trails that do not begin or do not end at base, missing arcs, and arcs
        that are used again.
    alive
        Output (n_plans, n_robots): the probability that each robot survives.
    """
    n_nodes = reward.shape[0]
    reached = np.empty(n_nodes)
    touched_by_plan = np.full(n_nodes, -1, np.int64)
    visited_by_trail = np.full(n_nodes, -1, np.int64)
    used_by_trail = np.full(head.shape[0], -1, np.int64)
    touched = np.empty(n_nodes, np.int32)
    order = np.empty(n_robots, np.int64)

    for plan in range(objectives.shape[0]):
        for k in range(n_robots):
            trail = plan * n_robots + k
            place = k
            while place > 0 and _precedes(nodes, offsets, trail, order[place - 1]):
                order[place] = order[place - 1]
                place -= 1
            order[place] = trail
        n_touched = n_faults = 0
        survivors = 0.0
        for k in range(n_robots):
            trail = order[k]
            start, stop = offsets[trail], offsets[trail + 1]
            here = nodes[start] if stop > start else -1
            lost = here != base
            n_faults += lost
            walked = 1.0
            for position in range(start, stop):
                if position > start:
                    there = nodes[position]
                    arc = -1
                    if 0 <= here < n_nodes and 0 <= there < n_nodes:
                        arc = find_arc(first, head, here, there)
                    here = there
                    if arc < 0 or used_by_trail[arc] == trail:
                        n_faults += 1
                        lost = True
                    if arc >= 0:
                        used_by_trail[arc] = trail
                        if not lost:
                            walked *= survival[arc]
                if not lost and visited_by_trail[here] != trail:
                    visited_by_trail[here] = trail
                    if touched_by_plan[here] != plan:
                        touched_by_plan[here] = plan
                        reached[here] = walked
                        touched[n_touched] = here
                        n_touched += 1
                    else:
                        reached[here] = either(reached[here], walked)
            if here != base:
                n_faults += 1
                lost = True
            alive[plan, trail - plan * n_robots] = 0.0 if lost else walked
            if not lost:
                survivors += walked

        expected_reward = 0.0
        for i in range(n_touched):
            expected_reward += reward[touched[i]] * reached[touched[i]]
        objectives[plan, 0] = expected_reward
        objectives[plan, 1] = survivors
        faults[plan] = n_faults


@kernel
def trail_arcs(
    first: OffsetArray,
    head: IntArray,
    loop: int,
    nodes: IntArray,
    offsets: OffsetArray,
    arcs: IntArray,
) -> None:
    """Write the arc that leaves each node of valid trails, for the last one ``loop``."""
    for trail in range(len(offsets) - 1):
        last = offsets[trail + 1] - 1
        for i in range(offsets[trail], last):
            arcs[i] = find_arc(first, head, nodes[i], nodes[i + 1])
        arcs[last] = loop
