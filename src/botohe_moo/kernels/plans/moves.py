"""Moves that change one trail and leave it a trail.

Seven are those of the simulated annealing in Simon, Richley, Overbey and Perez-Lavin, PeerJ
Computer Science, 2025; an eighth deletes loops, a ninth takes detours. A trail lies in a buffer,
with a length, and moves work in place. No move uses a missing arc, or uses an arc twice; none but
detours inserts the base, on their way. They see the mission's arcs, without the self-loop.
"""

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.plans.detours import take_detour
from botohe_moo.kernels.plans.evaluate import find_arc
from botohe_moo.kernels.rng import uniform

# The kinds of moves, as indices into their weights.
INSERT = 0
DELETE = 1
SUBSTITUTE = 2
SWAP = 3
GRAB = 4
DELETE_SEGMENT = 5
REVERSE = 6
N_PUBLISHED = 7
DELETE_LOOP = 7  # ours
DETOUR = 8
N_KINDS = 9

# Instead of a length: the move cannot be made, and the trail is as it was.
CANNOT = -1

# How many detours are tried where none of the moves drawn could be made.
_LAST_TRIES = 10


@kernel
def mark_trail(
    first: OffsetArray,
    head: IntArray,
    nodes: IntArray,
    length: int,
    used: OffsetArray,
    mark: int,
) -> None:
    """Set ``used`` to ``mark`` at every arc of a trail."""
    for i in range(length - 1):
        used[find_arc(first, head, nodes[i], nodes[i + 1])] = mark


@kernel
def _between(
    first: OffsetArray,
    head: IntArray,
    base: int,
    tail_node: int,
    head_node: int,
    used: OffsetArray,
    mark: int,
    states: SeedArray,
    which: int,
) -> int:
    """Draw a node, not the base, to which and from which unused arcs lead; -1 if there is none."""
    n = 0
    drawn = -1
    for arc in range(first[tail_node], first[tail_node + 1]):
        node = head[arc]
        if used[arc] == mark or node == base:
            continue
        onward = find_arc(first, head, node, head_node)
        if onward < 0 or used[onward] == mark:
            continue
        n += 1
        if n == 1 or uniform(states, which) * n < 1.0:
            drawn = node
    return drawn


@kernel
def _cut(nodes: IntArray, length: int, start: int, stop: int) -> int:
    """Take the positions ``start`` to ``stop`` out of a trail; give its new length."""
    for i in range(stop, length):
        nodes[start + i - stop] = nodes[i]
    return length - (stop - start)


@kernel
def _open(nodes: IntArray, length: int, at: int, size: int) -> int:
    """Make room for ``size`` nodes before position ``at``; give the trail's new length."""
    for i in range(length - 1, at - 1, -1):
        nodes[i + size] = nodes[i]
    return length + size


@kernel
def _insert(
    first: OffsetArray,
    head: IntArray,
    base: int,
    nodes: IntArray,
    length: int,
    position: int,
    used: OffsetArray,
    mark: int,
    states: SeedArray,
    which: int,
) -> int:
    last = position == length - 1  # behind the return to base, where another loop opens
    onward = nodes[0] if last else nodes[position + 1]  # the base, as an integer like the others
    node = _between(first, head, base, nodes[position], onward, used, mark, states, which)
    if node < 0:
        return CANNOT
    length = _open(nodes, length, position + 1, 2 if last else 1)
    nodes[position + 1] = node
    nodes[length - 1] = base
    return length


@kernel
def _delete(
    first: OffsetArray,
    head: IntArray,
    nodes: IntArray,
    length: int,
    start: int,
    stop: int,
    used: OffsetArray,
    mark: int,
) -> int:
    """Delete the nodes from ``start`` to before ``stop``, by the arc that joins what is left."""
    before, after = nodes[start - 1], nodes[stop]
    arc = find_arc(first, head, before, after)
    if arc < 0:
        return CANNOT
    if used[arc] == mark:
        inside = False
        for i in range(start, stop + 1):
            inside = inside or (nodes[i - 1] == before and nodes[i] == after)
        if not inside:
            return CANNOT
    return _cut(nodes, length, start, stop)


@kernel
def _delete_loop(nodes: IntArray, length: int, position: int, states: SeedArray, which: int) -> int:
    """Delete what lies between a visit to a node and another one, drawn uniformly."""
    n = 0
    drawn = position
    for i in range(length):
        if i != position and nodes[i] == nodes[position]:
            n += 1
            if n == 1 or uniform(states, which) * n < 1.0:
                drawn = i
    if n == 0:
        return CANNOT
    return _cut(nodes, length, min(position, drawn) + 1, max(position, drawn) + 1)


@kernel
def _swap(
    first: OffsetArray,
    head: IntArray,
    nodes: IntArray,
    length: int,
    low: int,
    high: int,
    used: OffsetArray,
    mark: int,
) -> int:
    """Let the nodes at two inner positions change places."""
    one, other = nodes[low], nodes[high]
    if one == other:
        return CANNOT
    for i in range(4):
        # The hops to and from the first position, then those to and from the second.
        if i == 0:
            tail_node, head_node = nodes[low - 1], other
        elif i == 1:
            tail_node, head_node = other, one if high == low + 1 else nodes[low + 1]
        elif i == 2:
            tail_node, head_node = other if high == low + 1 else nodes[high - 1], one
        else:
            tail_node, head_node = one, nodes[high + 1]
        arc = find_arc(first, head, tail_node, head_node)
        if arc < 0:
            return CANNOT
        if used[arc] == mark:
            given_up = False
            for at in (low - 1, low, high - 1, high):
                given_up = given_up or (nodes[at] == tail_node and nodes[at + 1] == head_node)
            if not given_up:
                return CANNOT
    nodes[low], nodes[high] = other, one
    return length


@kernel
def _reverse(first: OffsetArray, head: IntArray, nodes: IntArray, length: int) -> int:
    for i in range(length - 1):
        if find_arc(first, head, nodes[i + 1], nodes[i]) < 0:
            return CANNOT
    for i in range(length // 2):
        nodes[i], nodes[length - 1 - i] = nodes[length - 1 - i], nodes[i]
    return length


@kernel
def move_trail(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    base: int,
    nodes: IntArray,
    length: int,
    kind: int,
    used: OffsetArray,
    mark: int,
    states: SeedArray,
    which: int,
) -> int:
    """Try one move of a kind, in place, at positions and with nodes drawn uniformly.

    - ``INSERT``: a node between two consecutive ones, or behind the return to base, which opens
      another loop;
    - ``DELETE``: a node, by the arc between its neighbours; where they are one, the spur goes;
    - ``SUBSTITUTE``: another node for one;
    - ``SWAP``: two nodes change places;
    - ``GRAB``: from a node to a neighbour and straight back;
    - ``DELETE_SEGMENT``: two or more consecutive nodes, by the arc that joins what is left;
    - ``REVERSE``: the whole trail;
    - ``DELETE_LOOP``: what lies between two visits to a node, with one of them;
    - ``DETOUR``: another way, mostly by way of a node drawn among all, from a position to the same
      one, which inserts a loop, or to a later one; short spans are drawn as often as long ones.

    Positions are drawn first, among the inner ones (for ``INSERT`` and ``GRAB`` among those behind
    which a node may come, for ``DELETE_LOOP`` among all), then a node or a visit, among those that
    are possible there.

    Parameters
    ----------
    first, head, survival, base
        The mission's arcs, grouped by tail node, and its base.
    nodes, length
        A valid trail, in a buffer of at least n_arcs + 1 nodes.
    kind
        ``INSERT`` to ``DETOUR``.
    used, mark
        ``used[a] == mark`` for just the trail's arcs (``mark_trail``). Left so, hence the marks of
        the trail as it was.
    states, which
        Random numbers, advanced.

    Returns
    -------
    int
        The trail's new length; ``CANNOT`` where the move cannot be made, and nothing has changed.
    """
    if kind == INSERT:
        at = int(uniform(states, which) * length)
        return _insert(first, head, base, nodes, length, at, used, mark, states, which)
    if kind == GRAB:
        at = int(uniform(states, which) * max(1, length - 1))
        node = _between(first, head, base, nodes[at], nodes[at], used, mark, states, which)
        if node < 0:
            return CANNOT
        length = _open(nodes, length, at + 1, 2)
        nodes[at + 1], nodes[at + 2] = node, nodes[at]
        return length
    if kind == DETOUR:
        return take_detour(first, head, survival, base, nodes, length, used, mark, states, which)
    n_inner = length - 2
    if n_inner < 1:
        return CANNOT
    if kind == REVERSE:
        return _reverse(first, head, nodes, length)
    if kind == DELETE_LOOP:
        at = int(uniform(states, which) * length)
        return _delete_loop(nodes, length, at, states, which)
    low = 1 + int(uniform(states, which) * n_inner)
    if kind == DELETE:
        if nodes[low - 1] == nodes[low + 1]:  # a spur
            return _cut(nodes, length, low, low + 2)
        return _delete(first, head, nodes, length, low, low + 1, used, mark)
    if kind == SUBSTITUTE:
        node = _between(
            first, head, base, nodes[low - 1], nodes[low + 1], used, mark, states, which
        )
        if node < 0:
            return CANNOT
        nodes[low] = node
        return length
    if n_inner < 2:
        return CANNOT
    high = 1 + int(uniform(states, which) * (n_inner - 1))
    high += high >= low
    low, high = min(low, high), max(low, high)
    if kind == SWAP:
        return _swap(first, head, nodes, length, low, high, used, mark)
    return _delete(first, head, nodes, length, low, high + 1, used, mark)


@kernel
def survive_trail(
    first: OffsetArray, head: IntArray, survival: FloatArray, nodes: IntArray, length: int
) -> float:
    """Multiply the survivals along a trail, in the order and with the bits of ``evaluate``."""
    alive = 1.0
    for i in range(length - 1):
        alive *= survival[find_arc(first, head, nodes[i], nodes[i + 1])]
    return alive


@kernel
def change_trail(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    base: int,
    min_survival: float,
    weights: FloatArray,
    max_tries: int,
    nodes: IntArray,
    length: int,
    spare: IntArray,
    used: OffsetArray,
    mark: int,
    states: SeedArray,
    which: int,
) -> int:
    """Make one move, in place, of a kind drawn with given weights.

    Drawn again, kind and all, when it cannot be made, or would leave the robot a lesser chance to
    survive than ``min_survival``. Where none could be made, a few detours are tried.

    Parameters
    ----------
    first, head, survival, base, nodes, length, states, which
        As for ``move_trail``.
    min_survival
        Survival floor, which the trail keeps; 0 sets none.
    weights
        How likely each kind is to be drawn, relative (up to ``N_KINDS``; those left out are not).
    max_tries
        How often to draw.
    spare
        Scratch as long as ``nodes``; used with a floor only.
    used, mark
        Scratch (n_arcs), in which no entry is ``mark`` yet.

    Returns
    -------
    int
        The trail's new length; ``CANNOT`` where no draw could be made, and nothing has changed.
    """
    mark_trail(first, head, nodes, length, used, mark)
    n_kinds = weights.shape[0]
    total = 0.0
    for kind in range(n_kinds):
        total += weights[kind]
    for attempt in range(max_tries + _LAST_TRIES):
        kind = DETOUR
        if attempt < max_tries:
            left = uniform(states, which) * total - weights[0]
            kind = 0
            while left >= 0.0 and kind < n_kinds - 1:
                kind += 1
                left -= weights[kind]
            if weights[kind] <= 0.0:  # rounding has run past the last kind that may be drawn
                continue
        if min_survival > 0.0:
            for i in range(length):
                spare[i] = nodes[i]
        changed = move_trail(
            first, head, survival, base, nodes, length, kind, used, mark, states, which
        )
        if changed == CANNOT:
            continue
        if min_survival <= 0.0:
            return changed
        if survive_trail(first, head, survival, nodes, changed) >= min_survival:
            return changed
        for i in range(length):
            nodes[i] = spare[i]
    return CANNOT


@kernel
def change_plans(
    first: OffsetArray,
    head: IntArray,
    survival: FloatArray,
    base: int,
    min_survival: float,
    weights: FloatArray,
    max_tries: int,
    every_robot: bool,
    nodes: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    states: SeedArray,
    which: int,
) -> tuple[IntArray, OffsetArray]:
    """Change one trail, drawn uniformly, or every trail of every plan of a batch by one move.

    Parameters
    ----------
    first, head, survival, base, min_survival, weights, max_tries, states, which
        As for ``change_trail``. A trail with which no draw can be made stays as it is.
    every_robot
        Whether every trail of a plan is changed.
    nodes, offsets, n_robots
        Valid plans of the mission, ragged.

    Returns
    -------
    tuple
        The nodes and offsets of the plans, changed; new arrays.
    """
    n_arcs, n_trails = head.shape[0], offsets.shape[0] - 1
    used = np.full(n_arcs, -1, np.int64)
    trail_nodes = np.empty(n_arcs + 1, np.int32)
    spare = np.empty(n_arcs + 1, np.int32)
    changed_nodes = np.empty(nodes.shape[0] + 2 * n_trails, np.int32)  # most moves add two at most
    changed_offsets = np.zeros(n_trails + 1, np.int64)
    chosen = size = 0
    for trail in range(n_trails):
        robot = trail % n_robots
        if robot == 0 and not every_robot:
            chosen = int(uniform(states, which) * n_robots)
        length = offsets[trail + 1] - offsets[trail]
        for i in range(length):
            trail_nodes[i] = nodes[offsets[trail] + i]
        if every_robot or robot == chosen:
            changed = change_trail(
                first,
                head,
                survival,
                base,
                min_survival,
                weights,
                max_tries,
                trail_nodes,
                length,
                spare,
                used,
                trail,
                states,
                which,
            )
            length = length if changed == CANNOT else changed
        if size + length > changed_nodes.shape[0]:
            larger = np.empty(2 * (size + length), np.int32)
            larger[:size] = changed_nodes[:size]
            changed_nodes = larger
        for i in range(length):
            changed_nodes[size + i] = trail_nodes[i]
        size += length
        changed_offsets[trail + 1] = size
    return changed_nodes[:size].copy(), changed_offsets
