"""The best trail of one robot, by beam search over partial trails.

Labels are partial trails that leave the base; a level holds those of one number of hops. What
each hop needs is compiled into one loop (``inline``), and helpers are handed the few tuples of
arrays that they read: calls with many arrays would take as long as the search itself.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import inline, kernel
from botohe_moo.kernels.construct import leads_home
from botohe_moo.kernels.labels import (
    Label,
    Labels,
    Standing,
    doubled,
    find,
    first_label,
    hash_keys,
    new_labels,
    new_table,
    stand_at,
    standing_at_base,
    write_label,
)
from botohe_moo.kernels.paths import way_home

# Share of what still looks worth its danger that counts when labels are ranked. Measured on the
# case studies: without, beams run home too early; above a half they put off going home.
FORESIGHT = 0.5

# A search keeps no more labels than this, whatever its width: a few hundred megabytes.
MAX_LABELS = 5_000_000

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


class _Task(NamedTuple):
    """As for ``best_trail``."""

    base: int
    balanced: bool
    survival_weight: float
    least: float


class _Search(NamedTuple):
    """What a search for a trail computes once, and what its searches for ways home write on."""

    danger: FloatArray  # what going to a near node costs, for a robot alive for sure
    arc_keys: SeedArray
    node_keys: SeedArray
    n_homes: OffsetArray  # ways home looked for (1)
    met: OffsetArray
    distance: FloatArray
    entry: IntArray
    keys: FloatArray
    held: IntArray
    path: IntArray


class _Prospect(NamedTuple):
    """What a label may come to."""

    bound: float  # at most
    rank: float
    closed: float  # by going home at once; -1 where that cannot make the best trail known
    survives: float  # chance to survive that; -1 where there is no way, or no need, to go home


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


@kernel
def _new_search(ground: Ground, survival_weight: float) -> _Search:
    n_arcs = ground.head.shape[0]
    n_nodes, n_near = ground.near.shape
    danger = np.empty((n_nodes, n_near))
    for node in range(n_nodes):
        for i in range(n_near):
            home_after = ground.reach[node, i] * ground.home[ground.near[node, i]]
            danger[node, i] = survival_weight * (ground.home[node] - home_after)
    keys = hash_keys(n_arcs + n_nodes)
    return _Search(
        danger,
        keys[:n_arcs],
        keys[n_arcs:],
        np.zeros(1, np.int64),
        np.full(n_nodes, -1, np.int64),
        np.empty(n_nodes),
        np.empty(n_nodes, np.int32),
        np.empty(n_arcs + 1),
        np.empty(n_arcs + 1, np.int32),
        np.empty(n_nodes, np.int32),
    )


@inline
def _enough(best_value: float) -> float:
    """Give what a label must be able to come to more than."""
    return best_value + _TOLERANCE * best_value


@inline
def _stay(ground: Ground, task: _Task, label: Label) -> float:
    """Give what surviving is worth to a robot that turns home and finds every arc free."""
    return float(task.survival_weight * label.alive * ground.home[label.node])


@inline
def _is_hopeless(ground: Ground, task: _Task, label: Label, best_value: float) -> bool:
    """Tell cheaply that a label cannot keep the floor, or cannot beat the best trail known."""
    most = label.value + label.alive * label.left + _stay(ground, task, label)
    return label.alive * ground.home[label.node] < task.least or most <= _enough(best_value)


@inline
def _look_ahead(
    near: IntArray,
    reach: FloatArray,
    danger: FloatArray,
    ahead: FloatArray,
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
        worth = ahead[near[node, i]]
        brings = reach[node, i] * worth
        most += brings
        nearby += worth
        promise += max(0.0, brings - danger[node, i])
    if n_near < n_nodes - 1:
        most += max(0.0, left - nearby) * reach[node, n_near - 1]
    return most, promise


@inline
def _is_blocked(ground: Ground, base: int, used: OffsetArray, node: int) -> bool:
    """Tell whether the safest way home with every arc free takes an arc that is used."""
    here = node
    while here != base and used[ground.homeward[here]] != 1:
        here = ground.head[ground.homeward[here]]
    return here != base


@kernel
def _gets_home(ground: Ground, base: int, search: _Search, used: OffsetArray, node: int) -> bool:
    """Tell whether unused arcs lead home."""
    search.n_homes[0] += 1
    return leads_home(
        ground.first,
        ground.head,
        ground.homeward,
        base,
        node,
        used,
        1,
        search.met,
        int(search.n_homes[0]),
        search.held,
    )


@inline
def _way_home(ground: Ground, base: int, search: _Search, used: OffsetArray, node: int) -> int:
    """Write the safest way home over unused arcs; give its length, −1 where there is none."""
    search.n_homes[0] += 1
    return way_home(
        ground.first,
        ground.tail,
        ground.head,
        ground.cost,
        ground.homeward,
        base,
        used,
        1,
        node,
        int(search.n_homes[0]),
        search.met,
        search.distance,
        search.entry,
        search.keys,
        search.held,
        search.path,
    )


@inline
def _close(
    ground: Ground,
    task: _Task,
    search: _Search,
    used: OffsetArray,
    ahead: FloatArray,
    label: Label,
    best_value: float,
) -> tuple[float, float]:
    """Send a robot home at once: give value and survival of the trail, as in ``_Prospect``."""
    value, survives = label.value, label.alive
    detour = task.least > 0.0 or value + _stay(ground, task, label) > best_value
    if not detour and _is_blocked(ground, task.base, used, label.node):
        back = task.balanced or _gets_home(ground, task.base, search, used, label.node)
        return -1.0, survives if back else -1.0
    n_hops = _way_home(ground, task.base, search, used, label.node)
    if n_hops < 0:
        return -1.0, -1.0
    for i in range(n_hops):
        arc = search.path[i]
        survives *= ground.survival[arc]
        value += survives * ahead[ground.head[arc]]
    return value + task.survival_weight * survives, survives


@inline
def _judge(
    ground: Ground,
    task: _Task,
    search: _Search,
    used: OffsetArray,
    ahead: FloatArray,
    child: Label,
    best_value: float,
) -> _Prospect:
    """Look ahead and home from a child of the label at hand."""
    fresh = ahead[child.node]
    used[child.arc], ahead[child.node] = 1, 0.0
    most, promise = _look_ahead(
        ground.near, ground.reach, search.danger, ahead, child.node, child.left
    )
    stay = _stay(ground, task, child)
    bound = child.value + child.alive * most + stay
    closed = survives = -1.0
    if bound > _enough(best_value):
        closed, survives = _close(ground, task, search, used, ahead, child, best_value)
    used[child.arc], ahead[child.node] = 0, fresh
    rank = child.value + stay + FORESIGHT * child.alive * promise
    return _Prospect(bound, rank, closed, survives)


@inline
def _child(
    ground: Ground, search: _Search, ahead: FloatArray, labels: Labels, parent: int, arc: int
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
    task: _Task,
    search: _Search,
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
            if _is_hopeless(ground, task, child, best.value):
                continue
            key = search.node_keys[child.node]
            slot = find(table, nodes, hashes, child.node, child.used, key)
            if table[slot] >= 0 and found[table[slot]].value >= child.value:
                continue
            prospect = _judge(ground, task, search, used, ahead, child, best.value)
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
    ground: Ground, base: int, search: _Search, standing: Standing, labels: Labels, best: _Best
) -> IntArray:
    """Give the arcs of the best trail."""
    if best.arc < 0:
        return np.empty(0, np.int32)
    stand_at(labels, best.label, standing)
    n_before = int(standing.used.sum())
    standing.used[best.arc] = 1
    n_home = _way_home(ground, base, search, standing.used, ground.head[best.arc])
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
    task = _Task(base, balanced, survival_weight, least)
    search = _new_search(ground, survival_weight)
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
        order = order[children.bound[order] > _enough(best.value)]
        room = min(width, MAX_LABELS - high)
        cut = cut or len(order) > room
        low = high
        for child in _select(children.labels, order, search.node_keys, room):
            if high == len(labels):
                labels = doubled(labels)
            labels[high] = children.labels[child]
            high += 1
    return _trail(ground, base, search, standing, labels, best), best.value, cut
