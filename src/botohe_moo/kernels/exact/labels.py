"""Labels of the search for all trails: what one may still get, and which stand for which.

Label A stands for label B at the same node when A has used no arc that B may still need, reached
every goal at least as probably, and is alive at least as probably. Proof: any way on from B is one
from A, too. A goal that B first reaches on it, with alive(B) · x, A either reaches there, too, with
alive(A) · x, or has reached before, with no less than alive(A); both are no less. Goals that B has
reached before, A has reached at least as probably. And A survives with alive(A) times what the way
on is survived with. With a travel budget A must be no longer than B, too, so that it can go
wherever B can. What B may still need are the unused arcs that lie between it and the base: an
arc that no unused arcs lead to, or from which none lead home, counts as used; with a travel budget
also one over which B cannot get home within it.

For one robot the objective is linear in the probabilities, and less is needed for A to stand for
B: its collected reward, less what B could still collect at goals that only A has reached, is at
least that of B.

Only labels that have reached the same goals are compared. For teams hardly any others stand for
each other. For a single robot more labels are kept this way (half as many again on the art museum),
and the search still ends sooner.
"""

import math

import numpy as np

from botohe_moo._base.types import RecordArray, SeedArray
from botohe_moo.kernels.compile import helper, inlined
from botohe_moo.kernels.exact.tables import CurrentLabel, LabelRule, LabelTable
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.graph.paths import ANYWHERE, search_paths

# What a limit is missed by less, when it is computed in another order, goes on.
ROUNDING = 1e-12


@inlined
def has(bits: SeedArray, i: int) -> bool:
    """Tell whether bit ``i`` is set."""
    return bool((bits[i >> 6] >> np.uint64(i & 63)) & np.uint64(1))


@inlined
def put(bits: SeedArray, i: int) -> None:
    """Set bit ``i``."""
    bits[i >> 6] |= np.uint64(1) << np.uint64(i & 63)


@inlined
def has_budget(rule: LabelRule) -> bool:
    """Tell whether there is a travel budget."""
    return rule.limits.max_length < math.inf


@helper
def look_around(graph: Graph, rule: LabelRule, current: CurrentLabel, node: int) -> None:
    """Find the safest ways from a node over arcs that can be used, and give up arcs of no use.

    ``current.used`` and ``current.length`` are read; the former gets the arcs of no use, and
    ``current.bits`` all arcs that cannot be used.
    """
    reach, paths, used, n_nodes = current.reach, current.paths, current.used, graph.reward.shape[0]
    if has_budget(rule):
        _give_up_what_is_too_far(graph, rule, current, node)
    for v in range(n_nodes):
        reach[v] = 0.0
    reach[node] = 1.0
    n = search_paths(graph, paths, used, 1, node, ANYWHERE, n_nodes, False)
    for i in range(1, n):
        arc = paths.entry[paths.order[i]]
        reach[paths.order[i]] = reach[graph.tail[arc]] * graph.survival[arc]
    _look_home(graph, rule, current)
    for word in range(current.bits.shape[0]):
        current.bits[word] = 0
    for arc in range(graph.head.shape[0]):
        if reach[graph.tail[arc]] == 0.0 or current.homeward[graph.head[arc]] == 0:
            used[arc] = 1
        if used[arc] == 1:
            put(current.bits, arc)


@helper
def _give_up_what_is_too_far(
    graph: Graph, rule: LabelRule, current: CurrentLabel, node: int
) -> None:
    """Give up the arcs over which the current label cannot get home within the travel budget."""
    paths, short, n_nodes = current.paths, rule.short, graph.reward.shape[0]
    longest = rule.limits.max_length * (1.0 + ROUNDING) - current.length[0]
    n = search_paths(short, paths, current.used, 1, node, ANYWHERE, n_nodes, False)
    for i in range(n):
        tail = paths.order[i]
        for arc in range(graph.first[tail], graph.first[tail + 1]):
            length = paths.distance[tail] + graph.length[arc]
            if length + short.home[graph.head[arc]] > longest:
                current.used[arc] = 1


@helper
def _look_home(graph: Graph, rule: LabelRule, current: CurrentLabel) -> None:
    """Find the nodes from which arcs that can be used lead home."""
    homeward, waiting = current.homeward, current.paths.order
    everywhere = graph.balanced and not has_budget(rule)  # what can be reached leads home
    for v in range(homeward.shape[0]):
        homeward[v] = 1 if everywhere else 0
    if everywhere:
        return
    homeward[graph.base], waiting[0] = 1, graph.base
    n = 1
    while n > 0:
        n -= 1
        at = waiting[n]
        for i in range(graph.first_entering[at], graph.first_entering[at + 1]):
            arc = graph.entering[i]
            tail = graph.tail[arc]
            if homeward[tail] == 0 and current.used[arc] != 1:
                homeward[tail], waiting[n] = 1, tail
                n += 1


@helper
def look_ahead(
    graph: Graph, rule: LabelRule, current: CurrentLabel, node: int, alive: float
) -> float:
    """Write ``prospect`` of a label after ``look_around``, given the probability to get there.

    Gives at most with what probability the robot survives if it goes on to a goal that it has not
    reached, or with a travel budget goes on to the base; −1 where it can do neither.
    """
    survives = -1.0
    reached, prospect = current.reached, current.prospect
    for goal in range(reached.shape[0]):
        prospect[goal] = reached[goal]
    for there in range(rule.goal.shape[0]):
        goal = rule.goal[there]
        if goal < 0 or reached[goal] > 0.0 or current.homeward[there] == 0:
            continue
        reach = alive * current.reach[there]
        if reach > 0.0:
            prospect[goal] = reach
            survives = max(survives, reach * graph.home[there])
    if has_budget(rule) and node != graph.base:
        survives = max(survives, alive * current.reach[graph.base])
    return survives


@helper
def is_needless(
    rule: LabelRule, labels: LabelTable, current: CurrentLabel, node: int, alive: float, itself: int
) -> bool:
    """Tell whether some known label, other than ``itself``, stands for the one at hand."""
    key = _key_of(rule, current, node)
    label = labels.last[np.int64(key & np.uint64(labels.last.shape[0] - 1))]
    while label >= 0:
        row = labels.rows[label]
        same = label != itself and row.key == key and row.node == node
        same = same and not (has_budget(rule) and row.length > current.length[0])
        if same and row.alive >= alive and _stands_for(rule, labels, label, current):
            return True
        label = row.before
    return False


@inlined
def _stands_for(rule: LabelRule, labels: LabelTable, label: int, current: CurrentLabel) -> bool:
    """Tell whether a label at the same node, as probably alive, makes the one at hand needless."""
    for word in range(current.bits.shape[0]):
        if labels.used[label, word] & ~current.bits[word]:
            return False
    if not rule.single:
        for goal in range(current.reached.shape[0]):
            if labels.reached[label, goal] < current.reached[goal]:
                return False
        return True
    ahead = 0.0
    for goal in range(current.reached.shape[0]):
        known, own = labels.reached[label, goal], current.reached[goal]
        if known > 0.0 and own == 0.0:
            own = current.prospect[goal]
        ahead += rule.reward[goal] * (known - own)
    return ahead >= 0.0


@inlined
def _key_of(rule: LabelRule, current: CurrentLabel, node: int) -> np.uint64:
    """Hash a node and the goals that the label at hand has reached."""
    key: np.uint64 = rule.node_keys[node]
    for goal in range(current.reached.shape[0]):
        if current.reached[goal] > 0.0:
            key ^= rule.goal_keys[goal]
    return key


@helper
def add_label(
    rule: LabelRule,
    labels: LabelTable,
    progress: RecordArray,
    current: CurrentLabel,
    parent: int,
    arc: int,
    node: int,
    alive: float,
) -> None:
    """Put the label at hand into the next row, and into its chain; there must be room for it."""
    n = progress[0].n_labels
    progress[0].n_labels += 1
    row = labels.rows[n]
    row.parent, row.arc, row.node, row.alive = parent, arc, node, alive
    row.length = current.length[0]
    row.key = _key_of(rule, current, node)
    for goal in range(current.reached.shape[0]):
        labels.reached[n, goal] = current.reached[goal]
    for word in range(current.bits.shape[0]):
        labels.used[n, word] = current.bits[word]
    place = np.int64(row.key & np.uint64(labels.last.shape[0] - 1))
    row.before, labels.last[place] = labels.last[place], n
