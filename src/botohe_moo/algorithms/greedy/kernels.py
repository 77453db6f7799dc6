"""The best trail of one robot, by beam search over partial trails.

A label is a partial trail that leaves the start, known by its last arc and the label before it.
Walking up its parents gives the arcs that it has used and the nodes that it has visited. Parents
have smaller numbers than their children. A level holds the labels of one number of hops.
"""

from typing import Any, NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray, RecordArray, SeedArray
from botohe_moo.core.compile import at_once, helper, inlined, shared
from botohe_moo.core.paths import (
    Near,
    Paths,
    leads_home,
    new_paths,
    search_near,
    way_along,
    way_within,
)
from botohe_moo.core.rng import hash_keys, mixed
from botohe_moo.core.world import CHECKING, Shortest, World

# A search keeps at most as many labels, whatever its width: a few hundred megabytes.
MAX_LABELS = 5_000_000

# The share of what lies ahead and looks worth its danger that counts when labels are ranked.
# Measured on the case studies: without it, beams run home too early; above a half, too late.
FORESIGHT = 0.5

_LEAST_TABLE = 16  # slots of a hash table

LABEL = np.dtype(
    [
        # The label that this one goes on from, and the arc by which; −1 for the first one.
        ("parent", np.int64),
        ("arc", np.int64),
        ("node", np.int64),  # where it ends
        ("alive", np.float64),  # probability to get there
        ("length", np.float64),  # sum of the lengths of its arcs
        ("value", np.float64),  # worth collected
        ("left", np.float64),  # worth of all nodes not visited
        ("used", np.uint64),  # hash of the set of arcs used
        ("seen", np.uint64),  # hash of the set of nodes visited that are worth something
        ("key", np.uint64),  # by which children are found in the hash table
        ("bound", np.float64),  # what decides which children go on; see ``best_trail``
        ("rank", np.float64),
    ]
)
# The value of the best trail known, and how many arcs it has; 0 if it is the safest way from the
# start.
BEST = np.dtype([("value", np.float64), ("n_arcs", np.int64)])


class BeamRule(NamedTuple):
    """What to search for, and how widely; see ``best_trail``."""

    robot: int
    trail: int  # the number of all trails of the robot: n_robots + robot
    worth: FloatArray  # what each node is worth to a robot that surely reaches it (n_nodes)
    survival_weight: float  # what surviving for sure is worth, at least 0
    width: int  # labels that go on from each level, at least 1


class Beam(NamedTuple):
    """Scratch of searches for trails."""

    best: RecordArray  # a ``BEST`` (1)
    trail: OffsetArray  # the arcs of the best trail (n_arcs)
    labels: RecordArray  # all labels that went on, as ``LABEL``, level by level
    children: RecordArray  # of the last level, as ``LABEL``; some go on as labels
    table: OffsetArray  # a hash table of children, −1 where a slot is empty
    # Children in order, and scratch to sort them.
    order: OffsetArray
    spare: OffsetArray
    # Of the current label: ``BeamRule.trail`` for the arcs it has used, 0 for the others (n_arcs);
    # how often it has visited each node, and the worth of each node that it has not visited, 0 for
    # the others (n_nodes).
    used: OffsetArray
    visits: OffsetArray
    ahead: FloatArray
    paths: Paths
    keys: SeedArray  # for hashes: of each arc and of each node, by its index


def new_beam(world: World, width: int, max_labels: int = MAX_LABELS) -> Beam:
    """Return room for searches of this width; it takes memory only as far as it is used."""
    n_arcs, n_nodes = world.graph.n_arcs, world.graph.n_nodes
    n_labels = min(max_labels, 1 + width * n_arcs)
    n_children = min(width, n_labels) * int(np.diff(world.graph.first).max())
    return Beam(
        best=np.zeros(1, BEST).view(np.recarray),
        trail=np.empty(n_arcs, np.int64),
        labels=np.empty(n_labels, LABEL).view(np.recarray),
        children=np.empty(n_children, LABEL).view(np.recarray),
        table=np.empty(max(_LEAST_TABLE, 4 * n_children), np.int64),
        order=np.empty(n_children, np.int64),
        spare=np.empty(n_children, np.int64),
        used=np.empty(n_arcs, np.int64),
        visits=np.empty(n_nodes, np.int64),
        ahead=np.empty(n_nodes),
        paths=new_paths(world),
        keys=hash_keys(max(n_arcs, n_nodes)),
    )


@at_once(lambda world, near, rule, _: 7e-6 * rule.width * world.graph.n_arcs * near.nodes.shape[1])
def best_trail(world: World, near: Near, rule: BeamRule, beam: Beam) -> tuple[int, float, bool]:
    """Find a closed trail of the greatest value for one robot; write its arcs to ``beam.trail``.

    A trail's value is Σ over the nodes it visits of worth · (probability to reach the node), and
    ``survival_weight`` · (probability to survive the trail).

    Labels go on hop by hop, also those that are back at the end. Each is closed at once by the way
    home that ``way_within`` finds, so that no good trail is lost when labels are dropped; a label
    without such a way is dropped. If the usual way home is blocked, another one is looked for only
    if there are limits, or it may lead to the best trail known. Of labels that end at the same node
    and have used the same arcs the most valuable stays. A label is left out if it could not beat
    the best trail known even by reaching every node not visited by its safest path. Of the rest the
    ``width`` labels go on that rank highest by

    value + survival_weight · (survival of going home) + FORESIGHT · (probability to be here) ·
    Σ over near nodes v not visited of max(0, worth of v · reach of v − what the detour over v
    costs in survival_weight · (survival of going home)),

    one of each kind first, where labels of a kind are at the same node and have visited the same
    nodes of any worth. Ties go by the order of arcs. Time and memory grow with the width, with the
    number of hops, and with the arcs that leave a node. The search ends when there is no more room
    for labels.

    Returns how many arcs the trail has (0 if none is better than the safest way from start to end,
    or than staying where both are the same), its value, and whether any label was dropped because
    the beam was too narrow. If none was, and there is no travel budget, no trail is better by more
    than 10⁻¹² of the value, unless 64-bit hashes collide. The value is −1 where even the safest way
    is too long, and no shorter way is found.
    """
    world, near, rule, beam = shared(world), shared(near), shared(rule), shared(beam)
    best, labels, children = beam.best[0], beam.labels, beam.children
    _begin(world, rule, beam)
    low, high, n_hops, cut = 0, 1, 0, False
    while low < high:
        n_hops += 1
        n = _rank(beam, _expand(world, near, rule, beam, low, high, n_hops))
        n_go_on = min(rule.width, len(labels) - high)
        if n > n_go_on:
            cut = True
            _choose(beam, n, n_go_on)
        low = high
        for i in range(min(n, n_go_on)):
            labels[high] = children[beam.order[i]]
            high += 1
    return best.n_arcs, best.value, cut


@helper
def _begin(world: World, rule: BeamRule, beam: Beam) -> None:
    """Make row 0 the label of a robot at its start; the best trail known is the safest way."""
    graph, homeward, worth = world.graph, world.ways.homeward, rule.worth
    best, label, start, left = beam.best[0], beam.labels[0], world.team.start[rule.robot], 0.0
    for arc in range(beam.used.shape[0]):
        beam.used[arc] = 0
    for node in range(worth.shape[0]):
        left += worth[node]
        beam.visits[node], beam.ahead[node] = 0, worth[node]
    beam.visits[start], beam.ahead[start] = 1, 0.0
    label.parent = label.arc = -1
    label.node, label.alive, label.length = start, 1.0, 0.0
    label.value, label.left = worth[start], left - worth[start]
    label.used = label.seen = np.uint64(0)
    value, alive, length, node = worth[start], 1.0, 0.0, start
    while homeward[node] >= 0:
        arc = homeward[node]
        alive *= graph.mean_survival[arc]
        length += graph.length[arc]
        node = graph.head[arc]
        value += alive * worth[node]
    is_too_long = _is_too_far(world, world.ways.shortest, rule.robot, node, length)
    best.value = -1.0 if is_too_long else value + alive * rule.survival_weight
    best.n_arcs = 0


@helper
def _stand_at(beam: Beam, rule: BeamRule, label: int) -> None:
    """Make the next label the current one.

    Only the arcs that it does not share with the one before are taken back and added: mostly few,
    however long the trails are.
    """
    labels, used, visits, ahead = beam.labels, beam.used, beam.visits, beam.ahead
    before = max(0, label - 1)
    while before != label:
        if before > label:
            at = labels[before]
            node, before = at.node, at.parent
            used[at.arc] -= rule.trail
            visits[node] -= 1
            if visits[node] == 0:
                ahead[node] = rule.worth[node]
        else:
            at = labels[label]
            node, label = at.node, at.parent
            used[at.arc] += rule.trail
            visits[node] += 1
            ahead[node] = 0.0


@helper
def _expand(
    world: World, near: Near, rule: BeamRule, beam: Beam, low: int, high: int, n_hops: int
) -> int:
    """Go on by one hop from the labels of the last level; return how many children there are.

    Children are left out that cannot get home within the limits or beat the best trail known, or
    if another child has the same node and arcs used, and as much value. They have ``n_hops`` hops.
    """
    graph, home, robot = world.graph, world.ways.home, rule.robot
    best, labels, children, table = beam.best[0], beam.labels, beam.children, beam.table
    used, ahead, keys, n, n_most = beam.used, beam.ahead, beam.keys, 0, 0
    for parent in range(low, high):
        n_most += graph.first[labels[parent].node + 1] - graph.first[labels[parent].node]
    size = _empty_table(table, n_most)
    for parent in range(low, high):
        label, tail = labels[parent], labels[parent].node
        before, way, gained, unseen = label.alive, label.length, label.value, label.left
        _stand_at(beam, rule, parent)
        for arc in range(graph.first[tail], graph.first[tail + 1]):
            if used[arc] == rule.trail:
                continue
            node, child = graph.head[arc], children[n]
            alive, length = before * graph.mean_survival[arc], way + graph.length[arc]
            fresh = ahead[node]
            value, left = gained + alive * fresh, unseen - fresh
            stay = rule.survival_weight * alive * home[node]
            if value + alive * left + stay <= _enough(best):
                continue
            if _is_too_far(world, world.ways.shortest, robot, node, length):
                continue
            if alive * home[node] < world.limits.floors[robot]:
                continue
            child.parent, child.arc, child.node = parent, arc, node
            child.alive, child.length, child.value, child.left = alive, length, value, left
            child.used = label.used ^ keys[arc]
            child.seen = label.seen ^ keys[node] if fresh > 0.0 else label.seen
            child.key = mixed(child.used + np.uint64(node))
            slot = _find(beam, size, child.key)
            known = table[slot]
            if known >= 0 and children[known].value >= value:
                continue
            used[arc], ahead[node] = rule.trail, 0.0
            _judge(world, near, rule, beam, child, stay)
            value, n_home = -1.0, -1
            if child.bound > _enough(best):
                value, n_home = _close(world, world.ways.shortest, rule, beam, child, stay)
            used[arc], ahead[node] = 0, fresh
            if n_home < 0:
                continue
            if value > best.value:
                best.value, best.n_arcs = value, n_hops + n_home
                _write_trail(beam, child, n_hops, n_home)
            if known >= 0:
                children[known] = child
            else:
                table[slot] = n
                n += 1
    return n


@inlined
def _enough(best: Any) -> float:
    """Return what is surely better than the best trail known: smaller gains would be rounding."""
    value = best.value
    return float(value + CHECKING * value)


@inlined
def _is_too_far(
    world: World, shortest: Shortest | None, robot: int, node: int, length: float
) -> bool:
    """Return whether a trail of some length cannot visit a node within the travel budget."""
    if shortest is None:
        return False
    return bool(length + shortest.length[node] > world.limits.budgets[robot])


@inlined
def _judge(world: World, near: Near, rule: BeamRule, beam: Beam, child: Any, stay: float) -> None:
    """Write ``bound`` and ``rank`` of a child of the current label.

    The bound counts the most that all nodes not visited could bring together; the rank, what near
    nodes bring beyond the danger of going home by them. Near nodes that are too far from home for
    the travel budget do not count.
    """
    node, length, alive, home = child.node, child.length, child.alive, world.ways.home
    n_nodes, n_near = near.nodes.shape
    if n_near > 0 and near.nodes[node, 0] < 0:
        search_near(world.graph, beam.paths, beam.used, near, node)
    most = promise = nearby = 0.0
    for i in range(n_near):
        there, reach = near.nodes[node, i], near.reach[node, i]
        worth = beam.ahead[there]
        nearby += worth
        if _is_too_far(world, world.ways.shortest, rule.robot, there, length):
            continue
        brings = reach * worth
        danger = rule.survival_weight * (home[node] - reach * home[there])
        most += brings
        promise += max(0.0, brings - danger)
    if n_near < n_nodes - 1:
        most += max(0.0, child.left - nearby) * near.reach[node, n_near - 1]
    value = child.value + stay
    child.bound = child.value + alive * most + stay
    child.rank = value + FORESIGHT * alive * promise


@helper
def _close(
    world: World, shortest: Shortest | None, rule: BeamRule, beam: Beam, child: Any, stay: float
) -> tuple[float, int]:
    """Send a child of the current label home; return the value of the closed trail.

    Also returns how many arcs ``paths.path`` adds, −1 where no way leads home within the limits.
    The value is −1 where the trail cannot be better than the best one known.
    """
    graph, used, paths, node = world.graph, beam.used, beam.paths, child.node
    value, alive = child.value, child.alive
    is_free = shortest is None and world.limits.floors[rule.robot] == 0.0
    may_be_best = not is_free or value + stay > beam.best[0].value
    usual = world.ways.homeward
    if not may_be_best and way_along(graph, usual, paths, used, rule.trail, node) < 0:
        return -1.0, 0 if graph.balanced or leads_home(world, paths, used, rule.trail, node) else -1
    n = way_within(world, shortest, paths, used, rule.trail, node, alive, child.length)
    for i in range(n):
        arc = paths.path[i]
        alive *= graph.mean_survival[arc]
        value += alive * beam.ahead[graph.head[arc]]
    return value + rule.survival_weight * alive, n


@helper
def _rank(beam: Beam, n_children: int) -> int:
    """List the children that may become the best trail, the highest rank first.

    Returns how many there are. Equal ranks stay in order.
    """
    children, order, enough, n = beam.children, beam.order, _enough(beam.best[0]), 0
    for child in range(n_children):
        if children[child].bound > enough:
            order[n] = child
            n += 1
    _sort_descending(children["rank"], order, beam.spare, n)
    return n


@helper
def _choose(beam: Beam, n: int, n_go_on: int) -> None:
    """Put the children that go on first in the order: the best of each kind, then others.

    Children of a kind are at the same node and have visited the same nodes of any worth: mostly
    they become the same trails.
    """
    children, table, order, others = beam.children, beam.table, beam.order, beam.spare
    size, n_chosen, n_others = _empty_table(table, n), 0, 0
    for i in range(n):
        row = order[i]
        child = children[row]
        child.key = mixed(child.seen + np.uint64(child.node))
        slot = _find(beam, size, child.key)
        if table[slot] >= 0:
            others[n_others] = row
            n_others += 1
        elif n_chosen < n_go_on:
            table[slot] = order[n_chosen] = row
            n_chosen += 1
    for i in range(n_go_on - n_chosen):
        order[n_chosen + i] = others[i]


@inlined
def _write_trail(beam: Beam, child: Any, n_hops: int, n_home: int) -> None:
    """Write the trail of a child with ``n_hops`` hops, and the way home that was found."""
    arc, label = child.arc, child.parent
    for i in range(n_hops - 1, -1, -1):
        beam.trail[i] = arc
        arc, label = beam.labels[label].arc, beam.labels[label].parent
    for i in range(n_home):
        beam.trail[n_hops + i] = beam.paths.path[i]


@inlined
def _empty_table(table: OffsetArray, n: int) -> int:
    """Empty as much of a hash table as ``n`` children need; return the size of that part.

    It is a power of two, at least 2n and less than 4n, or 16.
    """
    size = _LEAST_TABLE
    while size < 2 * n:
        size *= 2
    for slot in range(size):
        table[slot] = -1
    return size


@inlined
def _find(beam: Beam, size: int, key: np.uint64) -> int:
    """Find the slot of the child with a key, or the empty one where it belongs."""
    table, children, last = beam.table, beam.children, size - 1
    slot = np.int64(key & np.uint64(last))
    while table[slot] >= 0 and children[table[slot]].key != key:
        slot = (slot + 1) & last
    return int(slot)


@helper
def _sort_descending(keys: FloatArray, order: OffsetArray, spare: OffsetArray, n: int) -> None:
    """Sort the first ``n`` indices in ``order`` by their keys, the largest first.

    Equal ones stay in order; the place of NaN is undefined. ``spare`` is scratch. This is a merge
    sort from the bottom up, since numpy's own sorting takes seconds to compile.
    """
    width = 1
    while width < n:
        for start in range(0, n, 2 * width):
            middle, stop = min(start + width, n), min(start + 2 * width, n)
            left, right = start, middle
            for i in range(start, stop):
                takes_right = left == middle
                if left < middle and right < stop:
                    takes_right = keys[order[right]] > keys[order[left]]
                if takes_right:
                    spare[i] = order[right]
                    right += 1
                else:
                    spare[i] = order[left]
                    left += 1
        for i in range(n):
            order[i] = spare[i]
        width *= 2
