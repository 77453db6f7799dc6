"""Drafts of new plans out of known ones: what crossover and mutation hand to a repair.

A draft is any sequence of nodes per robot. Plans are ragged arrays as everywhere; each kernel
draws from one state of random numbers, in the order of the plans.
"""

import numpy as np

from botohe_moo._base.types import IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.rng import uniform

# Which crossover a mating gets.
EXCHANGE = 0
SPLICE = 1


@kernel
def _below(states: SeedArray, n: int) -> int:
    """Draw an integer from 0 to n − 1."""
    return int(uniform(states, 0) * n)


@kernel
def _copy(source: IntArray, start: int, stop: int, target: IntArray, size: int) -> int:
    """Append ``source[start:stop]``; give the new size."""
    for i in range(start, stop):
        target[size] = source[i]
        size += 1
    return size


@kernel
def _shuffle(states: SeedArray, items: OffsetArray) -> None:
    for i in range(len(items) - 1, 0, -1):
        j = _below(states, i + 1)
        items[i], items[j] = items[j], items[i]


@kernel
def _shared_place(
    states: SeedArray,
    nodes: IntArray,
    start: int,
    stop: int,
    others: IntArray,
    other_start: int,
    other_stop: int,
    counts: OffsetArray,
) -> tuple[int, int]:
    """Draw a place inside each of two trails where both are at the same node.

    Uniform over the pairs of such places; (−1, −1) where there is none. ``counts`` is scratch
    (n_nodes), zero before and after; nodes that are unknown are shared by nobody.
    """
    n_nodes = counts.shape[0]
    for j in range(other_start + 1, other_stop - 1):
        if 0 <= others[j] < n_nodes:
            counts[others[j]] += 1
    n = 0
    for i in range(start + 1, stop - 1):
        if 0 <= nodes[i] < n_nodes:
            n += counts[nodes[i]]
    one = other = -1
    left = _below(states, n) if n > 0 else -1
    for i in range(start + 1, stop - 1 if n > 0 else start):
        here = counts[nodes[i]] if 0 <= nodes[i] < n_nodes else 0
        if left < here:
            one = i
            break
        left -= here
    for j in range(other_start + 1, other_stop - 1):
        if 0 <= others[j] < n_nodes:
            counts[others[j]] = 0
        if one >= 0 and others[j] == nodes[one]:
            if left == 0:
                other = j
            left -= 1
    return one, other


@kernel
def _draw_robot_out(states: SeedArray, offsets: OffsetArray, plan: int, n_robots: int) -> int:
    """Draw a robot that leaves the base, any robot where none does; give its trail."""
    n = 0
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        n += offsets[trail + 1] - offsets[trail] > 1
    if n == 0:
        return plan * n_robots + _below(states, n_robots)
    left = _below(states, n)
    for trail in range(plan * n_robots, (plan + 1) * n_robots):
        if offsets[trail + 1] - offsets[trail] > 1:
            if left == 0:
                return trail
            left -= 1
    return -1


@kernel
def cross(
    nodes: IntArray,
    offsets: OffsetArray,
    others: IntArray,
    other_offsets: OffsetArray,
    n_robots: int,
    n_nodes: int,
    kinds: OffsetArray,
    states: SeedArray,
    drafts: IntArray,
    draft_offsets: OffsetArray,
) -> None:
    """Draft two children of each pair of plans.

    Parameters
    ----------
    nodes, offsets, others, other_offsets
        The first and the second parents, ragged.
    n_robots, n_nodes
        Trails per plan; nodes of the mission.
    kinds
        Of each pair: with ``EXCHANGE`` the children share out whole trails, a random part of
        those of one parent and the rest of the other's; with ``SPLICE`` one trail of each parent
        goes on as the other's from a node that both visit (where there is none the two trails
        change places).
    states
        State of the random numbers (1, 2), advanced.
    drafts, draft_offsets
        Output: the children of pair m are the plans 2m and 2m + 1; as many nodes as all parents
        have, and 2 · n_pairs · n_robots + 1 offsets.
    """
    order, other_order = np.arange(n_robots), np.arange(n_robots)
    counts = np.zeros(n_nodes, np.int64)
    size = at = 0
    draft_offsets[0] = 0
    for pair in range(len(kinds)):
        one, other = pair * n_robots, pair * n_robots
        if kinds[pair] == EXCHANGE:
            _shuffle(states, order)
            _shuffle(states, other_order)
            cut = 1 + _below(states, n_robots - 1)
            for child in range(2):
                for k in range(n_robots):
                    if (k < cut) == (child == 0):
                        t = one + order[k]
                        size = _copy(nodes, offsets[t], offsets[t + 1], drafts, size)
                    else:
                        t = other + other_order[k]
                        size = _copy(others, other_offsets[t], other_offsets[t + 1], drafts, size)
                    at += 1
                    draft_offsets[at] = size
            continue
        s = _draw_robot_out(states, offsets, pair, n_robots)
        t = _draw_robot_out(states, other_offsets, pair, n_robots)
        p, q = _shared_place(
            states,
            nodes,
            offsets[s],
            offsets[s + 1],
            others,
            other_offsets[t],
            other_offsets[t + 1],
            counts,
        )
        if p < 0:
            p, q = offsets[s], other_offsets[t]
        for k in range(one, one + n_robots):
            if k == s:
                size = _copy(nodes, offsets[s], p, drafts, size)
                size = _copy(others, q, other_offsets[t + 1], drafts, size)
            else:
                size = _copy(nodes, offsets[k], offsets[k + 1], drafts, size)
            at += 1
            draft_offsets[at] = size
        for k in range(other, other + n_robots):
            if k == t:
                size = _copy(others, other_offsets[t], q, drafts, size)
                size = _copy(nodes, p, offsets[s + 1], drafts, size)
            else:
                size = _copy(others, other_offsets[k], other_offsets[k + 1], drafts, size)
            at += 1
            draft_offsets[at] = size


@kernel
def ruin(
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    n_nodes: int,
    max_via: int,
    states: SeedArray,
    drafts: IntArray,
    draft_offsets: OffsetArray,
) -> int:
    """Cut a random segment out of one trail of each plan, and put in nodes to visit instead.

    Parameters
    ----------
    nodes, offsets, n_robots
        The plans, ragged.
    n_nodes
        Nodes of the mission, every one of which may be put in.
    max_via
        How many nodes are put in at most; every number up to it is equally likely.
    states
        State of the random numbers (1, 2), advanced.
    drafts, draft_offsets
        Output: as many nodes as the plans have and ``max_via`` + 1 more for each, and as many
        offsets.

    Returns
    -------
    int
        How many nodes were written.
    """
    size = at = 0
    draft_offsets[0] = 0
    for plan in range((len(offsets) - 1) // n_robots):
        chosen = plan * n_robots + _below(states, n_robots)
        for trail in range(plan * n_robots, (plan + 1) * n_robots):
            start, stop = offsets[trail], offsets[trail + 1]
            if trail != chosen:
                size = _copy(nodes, start, stop, drafts, size)
            else:
                low = start + _below(states, stop - start)
                high = start + _below(states, stop - start)
                low, high = min(low, high), max(low, high)
                n_via = _below(states, max_via + 1)
                if n_via == 0 and high - low < 2 and max_via > 0:
                    n_via = 1  # or nothing would change
                size = _copy(nodes, start, low + 1, drafts, size)
                for _ in range(n_via):
                    drafts[size] = _below(states, n_nodes)
                    size += 1
                # Without anything in between, a node does not follow itself.
                size = _copy(nodes, high if n_via > 0 else max(high, low + 1), stop, drafts, size)
            at += 1
            draft_offsets[at] = size
    return size


@kernel
def send_home(
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    base: int,
    states: SeedArray,
    drafts: IntArray,
    draft_offsets: OffsetArray,
) -> int:
    """Let one robot of each plan that leaves the base stay there; arguments as for ``ruin``."""
    size = at = 0
    draft_offsets[0] = 0
    for plan in range((len(offsets) - 1) // n_robots):
        chosen = _draw_robot_out(states, offsets, plan, n_robots)
        for trail in range(plan * n_robots, (plan + 1) * n_robots):
            if trail == chosen:
                drafts[size] = base
                size += 1
            else:
                size = _copy(nodes, offsets[trail], offsets[trail + 1], drafts, size)
            at += 1
            draft_offsets[at] = size
    return size


@kernel
def share(
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    n_nodes: int,
    prob_copy: float,
    states: SeedArray,
    drafts: IntArray,
    draft_offsets: OffsetArray,
) -> int:
    """Let one robot of each plan take over another's trail, or two robots swap how they go on.

    They swap from a node that both visit, where there is none from any place of their trails.

    Parameters
    ----------
    nodes, offsets, n_robots, n_nodes, states
        As for ``ruin``.
    prob_copy
        Probability of taking over rather than swapping.
    drafts, draft_offsets
        Output: twice as many nodes as the plans have will do, and as many offsets.

    Returns
    -------
    int
        How many nodes were written.
    """
    counts = np.zeros(n_nodes, np.int64)
    size = at = 0
    draft_offsets[0] = 0
    for plan in range((len(offsets) - 1) // n_robots):
        one = other = -1
        p = q = 0
        if n_robots > 1:
            one = _draw_robot_out(states, offsets, plan, n_robots)
            other = plan * n_robots + _below(states, n_robots - 1)
            other += other >= one
            p, q = offsets[one], offsets[one]
            if uniform(states, 0) >= prob_copy:
                p, q = _shared_place(
                    states,
                    nodes,
                    offsets[one],
                    offsets[one + 1],
                    nodes,
                    offsets[other],
                    offsets[other + 1],
                    counts,
                )
                if p < 0:
                    p = offsets[one] + _below(states, offsets[one + 1] - offsets[one])
                    q = offsets[other] + _below(states, offsets[other + 1] - offsets[other])
        copied = one >= 0 and p == offsets[one] and q == p
        for trail in range(plan * n_robots, (plan + 1) * n_robots):
            if trail == other and copied:
                size = _copy(nodes, offsets[one], offsets[one + 1], drafts, size)
            elif trail == one and not copied:
                size = _copy(nodes, offsets[one], p, drafts, size)
                size = _copy(nodes, q, offsets[other + 1], drafts, size)
            elif trail == other:
                size = _copy(nodes, offsets[other], q, drafts, size)
                size = _copy(nodes, p, offsets[one + 1], drafts, size)
            else:
                size = _copy(nodes, offsets[trail], offsets[trail + 1], drafts, size)
            at += 1
            draft_offsets[at] = size
    return size
