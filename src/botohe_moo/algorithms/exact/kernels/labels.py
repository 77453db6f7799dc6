"""Labels of the search for all trails: what they may still reach, and which others they dominate.

Label A dominates label B at the same node when A has used no arc that B may still need, reached
every goal at least as probably, and is alive at least as probably. Proof: every way on from B is
also one from A. Take a goal that B reaches for the first time on this way, with alive(B) · x. A
either reaches it on the way too, with alive(A) · x, or has reached it before, with alive(A) or
more; neither is less. Goals that B has reached before, A has reached at least as probably. And A
survives with alive(A) times the survival of the way. With a travel budget A must also be no longer
than B, so that it can go wherever B can.

The arcs that B may still need are the unused ones that lie between it and the base. An arc counts
as used where no unused arcs lead to it or from it home, and with a travel budget also where B
cannot get home over it within the budget.

For one robot the objective is linear in the probabilities, and a weaker condition is enough: the
reward that A has collected, less what B could still collect at goals that only A has reached, is at
least that of B.

Only labels that have reached the same goals are compared. For teams hardly any others dominate each
other. For one robot this keeps more labels (half as many again on the art museum), and the search
is still faster.
"""

import numpy as np

from botohe_moo._base.types import SeedArray
from botohe_moo.algorithms.exact.kernels.tables import LabelSearch
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.graph import Graph
from botohe_moo.core.paths import ANYWHERE, search_paths

# Labels that miss a limit by no more than this, relative, are kept: sums and products in another
# order differ.
ROUNDING = 1e-12


@inlined
def has(bits: SeedArray, i: int) -> bool:
    """Return whether bit ``i`` is set."""
    return bool((bits[i >> 6] >> np.uint64(i & 63)) & np.uint64(1))


@inlined
def put(bits: SeedArray, i: int) -> None:
    """Set bit ``i``."""
    bits[i >> 6] |= np.uint64(1) << np.uint64(i & 63)


@helper
def look_around(search: LabelSearch) -> None:
    """Find the safest ways from the current label over arcs that it can use.

    Arcs of no use are marked as used, and ``current.bits`` is written.
    """
    graph, current = search.graph, search.current
    reach, paths, used, n_nodes = current.reach, current.paths, current.used, graph.reward.shape[0]
    node = current.row[0].node
    _mark_arcs_too_far(search, search.rule.short)
    _find_ways_home(search)
    for v in range(n_nodes):
        reach[v] = 0.0
    reach[node] = 1.0
    n = search_paths(graph, paths, used, 1, node, ANYWHERE, n_nodes, False)
    for i in range(1, n):
        arc = paths.entry[paths.order[i]]
        reach[paths.order[i]] = reach[graph.tail[arc]] * graph.survival[arc]
    for word in range(current.bits.shape[0]):
        current.bits[word] = 0
    for arc in range(graph.head.shape[0]):
        if reach[graph.tail[arc]] == 0.0 or current.homeward[graph.head[arc]] == 0:
            used[arc] = 1
        if used[arc] == 1:
            put(current.bits, arc)


@helper
def _mark_arcs_too_far(search: LabelSearch, short: Graph | None) -> None:
    """Mark arcs over which the current label cannot get home within the travel budget as used."""
    if short is None:
        return
    graph, current = search.graph, search.current
    paths, used, row, n_nodes = current.paths, current.used, current.row[0], graph.reward.shape[0]
    longest = search.rule.limits.max_length * (1.0 + ROUNDING) - row.length
    n = search_paths(short, paths, used, 1, row.node, ANYWHERE, n_nodes, False)
    for i in range(n):
        tail = paths.order[i]
        for arc in range(graph.first[tail], graph.first[tail + 1]):
            length = paths.distance[tail] + graph.length[arc]
            if length + short.home[graph.head[arc]] > longest:
                used[arc] = 1


@helper
def _find_ways_home(search: LabelSearch) -> None:
    """Find the nodes from which arcs that the current label can use lead home."""
    graph, homeward = search.graph, search.current.homeward
    everywhere = graph.balanced and search.rule.short is None  # what can be reached leads home
    for v in range(homeward.shape[0]):
        homeward[v] = 1 if everywhere else 0
    if everywhere:
        return
    n_nodes, paths = homeward.shape[0], search.current.paths
    n = search_paths(graph, paths, search.current.used, 1, graph.base, ANYWHERE, n_nodes, True)
    for i in range(n):
        homeward[paths.order[i]] = 1


@helper
def look_ahead(search: LabelSearch) -> float:
    """Write ``prospect`` of the current label, after a call of ``look_around``.

    Returns the most with which a robot may survive that goes on to a goal that it has not reached,
    or, with a travel budget, to the base; −1 where it can do neither.
    """
    graph, rule, current, survives = search.graph, search.rule, search.current, -1.0
    reached, prospect, row = current.reached, current.prospect, current.row[0]
    for goal in range(reached.shape[0]):
        prospect[goal] = reached[goal]
    for node in range(rule.goal.shape[0]):
        goal = rule.goal[node]
        if goal < 0 or reached[goal] > 0.0 or current.homeward[node] == 0:
            continue
        reach = row.alive * current.reach[node]
        if reach > 0.0:
            prospect[goal] = reach
            survives = max(survives, reach * graph.home[node])
    if rule.short is not None and row.node != graph.base:
        survives = max(survives, row.alive * current.reach[graph.base])
    return survives


@helper
def is_dominated(search: LabelSearch, itself: int) -> bool:
    """Return whether some label of the table, except ``itself``, dominates the current one."""
    labels, rule, current = search.labels, search.rule, search.current.row[0]
    key = _key_of(search)
    label = labels.last[np.int64(key & np.uint64(labels.last.shape[0] - 1))]
    while label >= 0:
        row = labels.rows[label]
        same = label != itself and row.key == key and row.node == current.node
        same = same and (rule.short is None or row.length <= current.length)
        if same and row.alive >= current.alive and _dominates(search, label):
            return True
        label = row.before
    return False


@inlined
def _dominates(search: LabelSearch, label: int) -> bool:
    """Return whether a label at the same node, and alive as probably, dominates the current one."""
    labels, rule, current = search.labels, search.rule, search.current
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
def _key_of(search: LabelSearch) -> np.uint64:
    """Hash the node of the current label and the goals that it has reached."""
    reached = search.current.reached
    key: np.uint64 = search.rule.node_keys[search.current.row[0].node]
    for goal in range(reached.shape[0]):
        if reached[goal] > 0.0:
            key ^= search.rule.goal_keys[goal]
    return key


@helper
def add_label(search: LabelSearch) -> None:
    """Put the current label into the next row of the table, for which there must be room."""
    labels, current = search.labels, search.current
    n = search.progress[0].n_labels
    search.progress[0].n_labels += 1
    # By their fields: copying records whole goes byte by byte.
    row, copied = labels.rows[n], current.row[0]
    row.parent, row.arc, row.node = copied.parent, copied.arc, copied.node
    row.alive, row.length, row.key = copied.alive, copied.length, _key_of(search)
    for goal in range(current.reached.shape[0]):
        labels.reached[n, goal] = current.reached[goal]
    for word in range(current.bits.shape[0]):
        labels.used[n, word] = current.bits[word]
    place = np.int64(row.key & np.uint64(labels.last.shape[0] - 1))
    row.before, labels.last[place] = labels.last[place], n
