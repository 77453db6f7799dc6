"""The best trail of one robot, by beam search over partial trails.

Labels are partial trails that leave the base; a level holds those of one number of hops.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.beam.labels import (
    Label,
    Labels,
    Standing,
    doubled,
    find,
    first_label,
    new_labels,
    new_table,
    stand_at,
    standing_at_base,
    write_label,
)
from botohe_moo.kernels.beam.prospects import (
    Ground,
    Search,
    Task,
    enough,
    is_hopeless,
    judge,
    new_search,
    write_way_home,
)
from botohe_moo.kernels.compile import inline, kernel

# A search keeps no more labels than this, whatever its width: a few hundred megabytes.
MAX_LABELS = 5_000_000


class _Children(NamedTuple):
    """Labels of the next level, and from their prospects what decides which of them go on."""

    labels: Labels
    bound: FloatArray
    rank: FloatArray


class _Best(NamedTuple):
    """The best trail known: its value, and the label and the arc after which it goes home."""

    value: float
    label: int
    arc: int


@inline
def _child(
    ground: Ground, search: Search, ahead: FloatArray, labels: Labels, parent: int, arc: int
) -> Label:
    """Go on by one arc from the label at hand."""
    label, node = labels[parent], ground.head[arc]
    fresh = ahead[node]
    alive = label.alive * ground.survival[arc]
    return Label(
        parent,
        arc,
        node,
        alive,
        label.value + alive * fresh,
        label.left - fresh,
        label.used ^ search.arc_keys[arc],
        label.seen ^ search.node_keys[node] if fresh > 0.0 else label.seen,
    )


@kernel
def _expand(
    ground: Ground,
    task: Task,
    search: Search,
    standing: Standing,
    labels: Labels,
    low: int,
    high: int,
    best: _Best,
    children: _Children,
) -> tuple[int, _Best]:
    """Go on by one hop from the labels ``low`` to ``high``.

    A child is left out that cannot get home, or home with probability ``least``; that cannot beat
    the best trail known; or that another child equals in node and arcs used, at no less value.
    Gives how many children there are, and the best trail known now.
    """
    used, ahead, found = standing.used, standing.ahead, children.labels
    nodes, hashes = found["node"], found["used"]
    table = new_table(len(found))
    n = 0
    for parent in range(low, high):
        stand_at(labels, parent, standing)
        here = labels[parent].node
        for arc in range(ground.first[here], ground.first[here + 1]):
            if used[arc] == 1 or ground.head[arc] == here:  # the latter is the base's self-loop
                continue
            child = _child(ground, search, ahead, labels, parent, arc)
            if is_hopeless(ground, task, child, best.value):
                continue
            key = search.node_keys[child.node]
            slot = find(table, nodes, hashes, child.node, child.used, key)
            if table[slot] >= 0 and found[table[slot]].value >= child.value:
                continue
            prospect = judge(ground, task, search, used, ahead, child, best.value)
            if prospect.survives < task.least:
                continue
            if prospect.closed > best.value:
                best = _Best(prospect.closed, parent, arc)
            if table[slot] < 0:
                table[slot] = n
                n += 1
            row = table[slot]
            write_label(found, row, child)
            children.bound[row], children.rank[row] = prospect.bound, prospect.rank
    return n, best


@kernel
def _select(labels: Labels, order: OffsetArray, node_keys: SeedArray, width: int) -> OffsetArray:
    """Choose the children that go on; ``order`` lists the candidates, the best ranked first.

    When there are more than ``width``, first the best of each kind: children at the same node that
    have visited the same nodes of any worth mostly come to the same.
    """
    if len(order) <= width:
        return order
    table, nodes, kinds = new_table(len(order)), labels["node"], labels["seen"]
    chosen, others = np.empty(width, np.int64), np.empty(len(order), np.int64)
    n = n_others = 0
    for child in order:
        slot = find(table, nodes, kinds, nodes[child], kinds[child], node_keys[nodes[child]])
        if table[slot] >= 0:
            others[n_others] = child
            n_others += 1
        elif n < width:
            table[slot] = chosen[n] = child
            n += 1
    chosen[n:] = others[: width - n]
    return chosen


@kernel
def _room(ground: Ground, labels: Labels, low: int, high: int) -> _Children:
    """Make room for all children of the labels ``low`` to ``high``."""
    n = 0
    for label in range(low, high):
        here = labels[label].node
        n += ground.first[here + 1] - ground.first[here]
    return _Children(new_labels(n), np.empty(n), np.empty(n))


@kernel
def _trail(
    ground: Ground, base: int, search: Search, standing: Standing, labels: Labels, best: _Best
) -> IntArray:
    """Give the arcs of the best trail."""
    if best.arc < 0:
        return np.empty(0, np.int32)
    stand_at(labels, best.label, standing)
    n_before = int(standing.used.sum())
    standing.used[best.arc] = 1
    n_home = write_way_home(ground, base, search, standing.used, ground.head[best.arc])
    arcs = np.empty(n_before + 1 + n_home, np.int32)
    label = best.label
    for i in range(n_before - 1, -1, -1):
        arcs[i] = labels[label].arc
        label = labels[label].parent
    arcs[n_before] = best.arc
    arcs[n_before + 1 :] = search.path[:n_home]
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
    task = Task(base, balanced, survival_weight, least)
    search = new_search(ground, survival_weight)
    standing = standing_at_base(base, worth, len(ground.head))
    labels = new_labels(1024)
    write_label(labels, 0, first_label(base, worth))
    best = _Best(worth[base] + survival_weight, -1, -1)  # to stay at base
    cut = False
    low, high = 0, 1
    while low < high:
        children = _room(ground, labels, low, high)
        n, best = _expand(ground, task, search, standing, labels, low, high, best, children)
        order = np.argsort(-children.rank[:n], kind="mergesort")
        order = order[children.bound[order] > enough(best.value)]
        room = min(width, MAX_LABELS - high)
        cut = cut or len(order) > room
        low = high
        for child in _select(children.labels, order, search.node_keys, room):
            if high == len(labels):
                labels = doubled(labels)
            labels[high] = children.labels[child]
            high += 1
    return _trail(ground, base, search, standing, labels, best), best.value, cut
