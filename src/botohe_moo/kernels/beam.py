"""The best trail of one robot, by beam search over partial trails.

Labels are partial trails that leave the base; a level holds those of one number of hops. A label
knows its parent and its last arc, so that walking up its parents gives the arcs it has used and
the nodes it has visited.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.construct import leads_home
from botohe_moo.kernels.paths import _pop, _push, way_home

# Share of what still looks worth its danger that counts when labels are ranked. Measured on the
# case studies: without, beams run home too early; above a half they put off going home.
FORESIGHT = 0.5

# A search keeps no more labels than this, whatever its width: a few hundred megabytes.
MAX_LABELS = 5_000_000

# What ``_home_from`` gives instead of a length.
_NO_WAY, _SOME_WAY = -1, -2

# Relative gains below this are not searched for: they would be rounding, not reward.
_TOLERANCE = 1e-12


class Ground(NamedTuple):
    """What a robot walks on, and what is known before any robot is planned.

    Attributes
    ----------
    first, tail, head, cost, survival, homeward, home
        The walk graph (see ``WalkGraph``).
    near, reach
        From ``nearest``.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    cost: FloatArray
    survival: FloatArray
    homeward: IntArray
    home: FloatArray
    near: IntArray
    reach: FloatArray


class _Labels(NamedTuple):
    """Partial trails, one a row."""

    parent: OffsetArray  # row of the label that this one goes on from, -1 for the start
    arc: IntArray  # the last arc, -1 for the start
    alive: FloatArray  # probability to get here
    value: FloatArray  # worth collected
    left: FloatArray  # worth of all nodes not visited
    used: SeedArray  # hash of the set of arcs used
    seen: SeedArray  # hash of the set of nodes visited that are worth something


class _Scratch(NamedTuple):
    """What a search writes on."""

    worth_ahead: FloatArray  # worth of each node that the label at hand has not visited
    danger: FloatArray  # what going to a near node costs, for a robot alive for sure
    arc_keys: SeedArray
    node_keys: SeedArray
    standing: OffsetArray  # the label at hand
    used: OffsetArray  # 1 for the arcs it has used
    visits: OffsetArray  # how often it has visited each node
    n_searches: OffsetArray
    met: OffsetArray
    distance: FloatArray
    entry: IntArray
    keys: FloatArray
    held: IntArray
    path: IntArray


@kernel
def nearest(
    first: OffsetArray,
    head: IntArray,
    cost: FloatArray,
    survival: FloatArray,
    near: IntArray,
    reach: FloatArray,
) -> None:
    """Find the nodes that are safest to reach from each node.

    Parameters
    ----------
    first, head, cost, survival
        The walk graph (see ``WalkGraph``).
    near
        Output (n_nodes, n_near), n_near < n_nodes: for each node others, the safest to reach first.
    reach
        Output (n_nodes, n_near): survival of the safest path to each of them.
    """
    n_nodes, n_arcs, n_near = first.shape[0] - 1, head.shape[0], near.shape[1]
    met, settled = np.full(n_nodes, -1, np.int64), np.full(n_nodes, -1, np.int64)
    distance, alive = np.empty(n_nodes), np.empty(n_nodes)
    keys, held = np.empty(n_arcs + 1), np.empty(n_arcs + 1, np.int32)
    for source in range(n_nodes):
        met[source], distance[source], alive[source] = source, 0.0, 1.0
        size = _push(keys, held, 0, 0.0, source)
        n = -1  # the source itself comes first
        while size > 0 and n < n_near:
            size = _pop(keys, held, size)
            here, key = held[size], keys[size]
            if settled[here] == source:
                continue
            settled[here] = source
            if n >= 0:
                near[source, n], reach[source, n] = here, alive[here]
            n += 1
            for arc in range(first[here], first[here + 1]):
                there = head[arc]
                reached = key + cost[arc]
                if met[there] == source and distance[there] <= reached:
                    continue
                met[there], distance[there] = source, reached
                alive[there] = alive[here] * survival[arc]
                size = _push(keys, held, size, reached, there)


@kernel
def _mixed(number: int) -> np.uint64:
    """Hash an index to 64 bits, as SplitMix64 finishes its numbers."""
    mixed = np.uint64(number + 1) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


@kernel
def _labels(n: int) -> _Labels:
    return _Labels(
        np.empty(n, np.int64),
        np.empty(n, np.int32),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n, np.uint64),
        np.empty(n, np.uint64),
    )


@kernel
def _copy_label(source: _Labels, row: int, target: _Labels, to: int) -> None:
    target.parent[to], target.arc[to] = source.parent[row], source.arc[row]
    target.alive[to], target.value[to] = source.alive[row], source.value[row]
    target.left[to] = source.left[row]
    target.used[to], target.seen[to] = source.used[row], source.seen[row]


@kernel
def _scratch(ground: Ground, base: int, worth: FloatArray, survival_weight: float) -> _Scratch:
    n_nodes, n_arcs, n_near = worth.shape[0], ground.head.shape[0], ground.near.shape[1]
    danger = np.empty((n_nodes, n_near))
    for node in range(n_nodes):
        for i in range(n_near):
            home_after = ground.reach[node, i] * ground.home[ground.near[node, i]]
            danger[node, i] = survival_weight * (ground.home[node] - home_after)
    arc_keys, node_keys = np.empty(n_arcs, np.uint64), np.empty(n_nodes, np.uint64)
    for arc in range(n_arcs):
        arc_keys[arc] = _mixed(arc)
    for node in range(n_nodes):
        node_keys[node] = _mixed(n_arcs + node)
    visits, worth_ahead = np.zeros(n_nodes, np.int64), worth.copy()
    visits[base], worth_ahead[base] = 1, 0.0
    return _Scratch(
        worth_ahead,
        danger,
        arc_keys,
        node_keys,
        np.zeros(1, np.int64),
        np.zeros(n_arcs, np.int64),
        visits,
        np.zeros(1, np.int64),
        np.full(n_nodes, -1, np.int64),
        np.empty(n_nodes),
        np.empty(n_nodes, np.int32),
        np.empty(n_arcs + 1),
        np.empty(n_arcs + 1, np.int32),
        np.empty(n_nodes, np.int32),
    )


@kernel
def _stand_at(
    ground: Ground, worth: FloatArray, labels: _Labels, label: int, scratch: _Scratch
) -> None:
    """Mark what a label has used and visited, and no longer what the label before it had.

    Parents have smaller numbers than their children, so that the way up from both labels ends
    where they part: mostly not far, however long the trails are.
    """
    before, scratch.standing[0] = scratch.standing[0], label
    while before != label:
        leave = before > label
        arc = labels.arc[before] if leave else labels.arc[label]
        node = ground.head[arc]
        if leave:
            scratch.used[arc] -= 1
            scratch.visits[node] -= 1
            if scratch.visits[node] == 0:
                scratch.worth_ahead[node] = worth[node]
            before = labels.parent[before]
        else:
            scratch.used[arc] += 1
            scratch.visits[node] += 1
            scratch.worth_ahead[node] = 0.0
            label = labels.parent[label]


@kernel
def _look_ahead(
    near: IntArray,
    reach: FloatArray,
    danger: FloatArray,
    worth_ahead: FloatArray,
    node: int,
    left: float,
) -> tuple[float, float]:
    """Judge what nodes not visited offer a robot that is at ``node`` for sure.

    Gives the most that all of them together could bring, and what those near promise over the
    danger of going there before going home.
    """
    n_nodes, n_near = near.shape
    most = promise = nearby = 0.0
    for i in range(n_near):
        worth = worth_ahead[near[node, i]]
        brings = reach[node, i] * worth
        most += brings
        nearby += worth
        promise += max(0.0, brings - danger[node, i])
    if n_near < n_nodes - 1:
        most += max(0.0, left - nearby) * reach[node, n_near - 1]
    return most, promise


@kernel
def _home_from(
    ground: Ground,
    base: int,
    balanced: bool,
    node: int,
    thorough: bool,
    scratch: _Scratch,
) -> int:
    """Look for the safest way home over arcs that the label at hand has not used.

    Writes it and gives its length; ``_NO_WAY`` where there is none. Unless ``thorough`` it gives
    ``_SOME_WAY`` where the usual way home is blocked, but another one exists.
    """
    scratch.n_searches[0] += 1
    search = int(scratch.n_searches[0])
    if not thorough:
        here = node
        while here != base and scratch.used[ground.homeward[here]] != 1:
            here = ground.head[ground.homeward[here]]
        if here != base:
            found = balanced or leads_home(
                ground.first,
                ground.head,
                ground.homeward,
                base,
                node,
                scratch.used,
                1,
                scratch.met,
                search,
                scratch.held,
            )
            return _SOME_WAY if found else _NO_WAY
    return way_home(
        ground.first,
        ground.tail,
        ground.head,
        ground.cost,
        ground.homeward,
        base,
        scratch.used,
        1,
        node,
        search,
        scratch.met,
        scratch.distance,
        scratch.entry,
        scratch.keys,
        scratch.held,
        scratch.path,
    )


@kernel
def _find(
    table: OffsetArray,
    arcs: IntArray,
    hashes: SeedArray,
    value: np.uint64,
    head: IntArray,
    node: int,
    node_key: np.uint64,
) -> int:
    """Give the slot of the child at ``node`` whose hash is ``value``, or where it belongs."""
    last = table.shape[0] - 1
    slot = np.int64((value ^ node_key) & np.uint64(last))
    while table[slot] >= 0:
        known = table[slot]
        if hashes[known] == value and head[arcs[known]] == node:
            break
        slot = (slot + 1) & last
    return int(slot)


@kernel
def _table(n: int) -> OffsetArray:
    size = 16
    while size < 2 * n:
        size *= 2
    return np.full(size, -1, np.int64)


@kernel
def _expand(
    ground: Ground,
    base: int,
    balanced: bool,
    worth: FloatArray,
    survival_weight: float,
    least: float,
    labels: _Labels,
    low: int,
    high: int,
    best: tuple[float, int, int],
    scratch: _Scratch,
    children: _Labels,
    bound: FloatArray,
    rank: FloatArray,
) -> tuple[int, tuple[float, int, int]]:
    """Go on by one hop from the labels ``low`` to ``high``.

    A child is left out that cannot get home, or home with probability ``least``; that cannot beat
    the best trail known; or that another child equals in node and arcs used, at no less value.

    Parameters
    ----------
    ground, base, balanced, worth, survival_weight, least
        As for ``best_trail``.
    labels, low, high
        The level.
    best
        The best trail known: its value, and the label and the arc after which it goes home (−1
        and −1 for the trail that stays at base).
    scratch
        For this search.
    children, bound, rank
        Output: labels of the next level, the most each could come to, and how they are ranked.

    Returns
    -------
    tuple
        How many children there are, and the best trail known now.
    """
    first, head, survival, home = ground.first, ground.head, ground.survival, ground.home
    used, ahead = scratch.used, scratch.worth_ahead  # taken out of their tuples once: it shows
    near, reach, danger, path = ground.near, ground.reach, scratch.danger, scratch.path
    node_keys, arc_keys = scratch.node_keys, scratch.arc_keys
    parents, arcs, hashes, values = children.parent, children.arc, children.used, children.value
    table = _table(rank.shape[0])
    best_value, best_label, best_arc = best
    n = 0
    for label in range(low, high):
        here = head[labels.arc[label]] if labels.parent[label] >= 0 else base
        _stand_at(ground, worth, labels, label, scratch)
        for arc in range(first[here], first[here + 1]):
            there = head[arc]
            if used[arc] == 1 or there == here:  # the latter is the base's self-loop
                continue
            alive = labels.alive[label] * survival[arc]
            stay = survival_weight * alive * home[there]
            fresh = ahead[there]
            value = labels.value[label] + alive * fresh
            left = labels.left[label] - fresh
            enough = best_value + _TOLERANCE * best_value
            if alive * home[there] < least or value + alive * left + stay <= enough:
                continue
            hashed = labels.used[label] ^ arc_keys[arc]
            slot = _find(table, arcs, hashes, hashed, head, there, node_keys[there])
            known = table[slot]
            if known >= 0 and values[known] >= value:
                continue
            ahead[there] = 0.0
            most, promise = _look_ahead(near, reach, danger, ahead, there, left)
            n_hops = _NO_WAY
            if value + alive * most + stay > enough:
                used[arc] = 1
                thorough = least > 0.0 or value + stay > best_value
                n_hops = _home_from(ground, base, balanced, there, thorough, scratch)
                used[arc] = 0
            closed, survives = value, alive
            for i in range(n_hops):
                survives *= survival[path[i]]
                closed += survives * ahead[head[path[i]]]
            closed += survival_weight * survives
            ahead[there] = fresh
            if n_hops == _NO_WAY or survives < least:
                continue
            if n_hops >= 0 and closed > best_value:
                best_value, best_label, best_arc = closed, label, arc
            if known < 0:
                known = table[slot] = n
                n += 1
            parents[known], arcs[known], hashes[known] = label, arc, hashed
            children.alive[known], values[known], children.left[known] = alive, value, left
            kind = labels.seen[label]
            children.seen[known] = kind ^ node_keys[there] if fresh > 0.0 else kind
            bound[known] = value + alive * most + stay
            rank[known] = value + stay + FORESIGHT * alive * promise
    return n, (best_value, best_label, best_arc)


@kernel
def _select(
    ground: Ground,
    children: _Labels,
    order: OffsetArray,
    node_keys: SeedArray,
    width: int,
) -> OffsetArray:
    """Choose the children that go on; ``order`` lists the candidates, the best ranked first.

    When there are more than ``width``, first the best of each kind: children at the same node that
    have visited the same nodes of any worth mostly come to the same.
    """
    if len(order) <= width:
        return order
    table = _table(len(order))
    chosen, others = np.empty(width, np.int64), np.empty(len(order), np.int64)
    n = n_others = 0
    for child in order:
        node = ground.head[children.arc[child]]
        kind = children.seen[child]
        slot = _find(table, children.arc, children.seen, kind, ground.head, node, node_keys[node])
        if table[slot] >= 0:
            others[n_others] = child
            n_others += 1
        elif n < width:
            table[slot] = chosen[n] = child
            n += 1
    chosen[n:] = others[: width - n]
    return chosen


@kernel
def _trail(
    ground: Ground,
    base: int,
    worth: FloatArray,
    labels: _Labels,
    label: int,
    last_arc: int,
    scratch: _Scratch,
) -> IntArray:
    """Give the arcs of the trail that goes home by the safest way after a label and an arc."""
    if last_arc < 0:
        return np.empty(0, np.int32)
    _stand_at(ground, worth, labels, label, scratch)
    n_before = int(scratch.used.sum())
    scratch.used[last_arc] = 1
    n_home = _home_from(ground, base, True, ground.head[last_arc], True, scratch)
    arcs = np.empty(n_before + 1 + n_home, np.int32)
    for i in range(n_before - 1, -1, -1):
        arcs[i] = labels.arc[label]
        label = labels.parent[label]
    arcs[n_before] = last_arc
    arcs[n_before + 1 :] = scratch.path[:n_home]
    return arcs


@kernel
def best_trail(
    ground: Ground,
    base: int,
    balanced: bool,
    worth: FloatArray,
    survival_weight: float,
    least: float,
    width: int,
) -> tuple[IntArray, float, bool]:
    """Find a closed trail of the greatest value for one robot.

    A trail's value is Σ over the nodes it visits of worth · (probability to reach the node), and
    ``survival_weight`` · (probability to survive the trail).

    Labels go on hop by hop, also those that are back at base. Each is closed at once by the safest
    way home over arcs it has not used, so that no good trail is lost when labels are dropped;
    where there is no such way the label is none. (Where the usual way home is blocked, another one
    is looked for only if it may lead to the best trail known.) Labels that end at the same node and
    have used the same arcs are one state, of which the most valuable stays. A label stays out that
    could not beat the best trail known, were every node not visited reached by its safest path.
    Of the rest the ``width`` go on that rank highest by

    value + survival_weight · (survival of going home) + FORESIGHT · (probability to be here) ·
    Σ over near nodes v not visited of max(0, worth of v · reach of v − what the detour over v
    costs in survival_weight · (survival of going home)),

    one of each kind first, where labels of a kind are at the same node and have visited the same
    nodes of any worth. Ties go by the order of arcs.

    Parameters
    ----------
    ground
        The walk graph, and the nodes near each node.
    base
        Where the trail begins and ends.
    balanced
        Whether as many arcs enter every node as leave it, so that there always is a way home.
    worth
        Of each node at least 0, to a robot that reaches it for sure (n_nodes).
    survival_weight
        What surviving for sure is worth, at least 0.
    least
        Survival floor: the least probability to survive the trail; 0 sets none.
    width
        Labels that go on from each level, at least 1. Time and memory grow with it, with the
        number of hops, and with the arcs that leave a node; the search ends when it has kept
        ``MAX_LABELS``.

    Returns
    -------
    tuple
        The arcs of the trail, without the self-loop that ends it (none for the trail that stays
        at base), its value, and whether any label was dropped for want of width. If none was, no
        trail is better by more than a 10⁻¹² of the value (but for a collision of 64-bit hashes).
    """
    scratch = _scratch(ground, base, worth, survival_weight)
    labels = _labels(1024)
    labels.parent[0], labels.arc[0], labels.alive[0] = -1, -1, 1.0
    labels.value[0], labels.left[0] = worth[base], worth.sum() - worth[base]
    labels.used[0], labels.seen[0] = np.uint64(0), np.uint64(0)
    best = (worth[base] + survival_weight, -1, -1)
    cut = False
    low, high = 0, 1
    while low < high:
        n_arcs = 0
        for label in range(low, high):
            here = ground.head[labels.arc[label]] if labels.parent[label] >= 0 else base
            n_arcs += ground.first[here + 1] - ground.first[here]
        children = _labels(n_arcs)
        bound, rank = np.empty(n_arcs), np.empty(n_arcs)
        n, best = _expand(
            ground,
            base,
            balanced,
            worth,
            survival_weight,
            least,
            labels,
            low,
            high,
            best,
            scratch,
            children,
            bound,
            rank,
        )
        order = np.argsort(-rank[:n], kind="mergesort")
        order = order[bound[order] > best[0] + _TOLERANCE * best[0]]
        room = min(width, MAX_LABELS - high)
        cut = cut or len(order) > room
        low = high
        for child in _select(ground, children, order, scratch.node_keys, room):
            if high == labels.parent.shape[0]:
                labels = _doubled(labels)
            _copy_label(children, child, labels, high)
            high += 1
    arcs = _trail(ground, base, worth, labels, best[1], best[2], scratch)
    return arcs, best[0], cut


@kernel
def _doubled(labels: _Labels) -> _Labels:
    n = labels.parent.shape[0]
    larger = _labels(2 * n)
    for row in range(n):
        _copy_label(labels, row, larger, row)
    return larger
