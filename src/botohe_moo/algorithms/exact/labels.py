"""All trails that some best team may need, by labels: partial trails that leave the base.

A trail matters to a team by the probabilities that its robot reaches each goal (a node with reward)
and that it survives; for a team of one robot by its reward and survival. Team objectives rise with
each of them, so a trail that is at least as good as another one in all of them can replace it in
any plan. A label is dropped where a known trail is at least as good as the label can still become
in each of them, or where another label dominates it.

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

After the last goal that a robot reaches for the first time, it goes home by the safest way over
unused arcs. So trails end where a label has just reached a goal, and a label goes on only as long
as it may still reach one.

With a travel budget the safest way home may be too long, and the best one a compromise. So trails
also end where a label has come to the base arc by arc, and a label goes on as long as it may come
there by a safer way than those that are known.
"""

from typing import Any, NamedTuple, TypeVar

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray, SeedArray
from botohe_moo.core.compile import helper, inlined, kernel, shared
from botohe_moo.core.paths import ANYWHERE, Paths, new_paths, search_paths
from botohe_moo.core.rng import hash_keys
from botohe_moo.core.world import CHECKING, Shortest, World

SHELF = 32  # trails that are skipped together where none can be as good

# A label: the label that it goes on from and the arc by which, −1 for the first one; the node where
# it ends; the label before it in its chain, or −1; the probability to get there, and how long it
# is; and a hash of the node and the goals reached.
LABEL = np.dtype(
    [(name, np.int64) for name in ("parent", "arc", "node", "before")]
    + [("alive", np.float64), ("length", np.float64), ("key", np.uint64)]
)
# A trail: the label and the arc after which it goes home by the safest way, and the probability to
# survive it. Parents below 0 number trails known from elsewhere.
TRAIL = np.dtype([("parent", np.int64), ("arc", np.int64), ("survives", np.float64)])
# How many labels and trails there are, and the next label to go on from.
PROGRESS = np.dtype([(name, np.int64) for name in ("n_labels", "next", "n_trails")])
Table = TypeVar("Table", bound=tuple[Any, ...])


class LabelTable(NamedTuple):
    """Labels, one a row; those at the same node that have reached the same goals are chained."""

    rows: RecordArray  # as ``LABEL``
    # Probability to have reached each goal, 0 where it has not been visited (n, n_goals).
    reached: FloatArray
    used: SeedArray  # bits of the arcs that it cannot use any more (n, n_words)
    # The last label of each chain, −1 for none, at the place that the low bits of its key give; the
    # number of places is a power of two, and at most that of rows. Each place has one chain.
    last: OffsetArray


class TrailTable(NamedTuple):
    """Trails, one a row, each better in something than every one before it.

    ``SHELF`` of them lie on a shelf.
    """

    rows: RecordArray  # as ``TRAIL``
    # Probability to reach each goal; for a single robot the share of the reward (n, n_columns).
    reached: FloatArray
    # The largest survival, and the largest of each column, of the trails on each shelf.
    shelf_survives: FloatArray
    shelf_reached: FloatArray


class CurrentLabel(NamedTuple):
    """Scratch: a label, and what it may still reach."""

    row: RecordArray  # as ``LABEL`` (1)
    # Which arcs it cannot use any more (n_arcs), and the same as bits (n_words).
    used: OffsetArray
    bits: SeedArray
    # Probability to have reached each goal, and the most that this may become (n_goals).
    reached: FloatArray
    prospect: FloatArray
    column: FloatArray  # one row of ``TrailTable.reached``
    paths: Paths  # the safest ways from its node over arcs that it can use
    reach: FloatArray  # survival of these, 0 where there is none (n_nodes)
    homeward: OffsetArray  # whether arcs that it can use lead home from each node (n_nodes)


class LabelSearch(NamedTuple):
    """A search for all trails that teams may need."""

    world: World  # of a plain mission, whose base has no reward
    goal: OffsetArray  # of each node, which goal it is, −1 for those without reward (n_nodes)
    reward: FloatArray  # of each goal (n_goals)
    # Keys for hashes of nodes and of goals.
    node_keys: SeedArray
    goal_keys: SeedArray
    labels: LabelTable
    trails: TrailTable
    progress: RecordArray  # as ``PROGRESS`` (1)
    current: CurrentLabel


def new_search(world: World, n: int) -> LabelSearch:
    """Return a search whose only label is that of a robot that has not left the base.

    It has room for ``n`` labels and as many trails: a power of two, and a multiple of ``SHELF``.
    """
    graph, is_goal = world.graph, world.graph.reward > 0.0
    n_nodes, n_arcs, n_goals = graph.n_nodes, graph.n_arcs, int(is_goal.sum())
    n_words, keys = n_arcs // 64 + 1, hash_keys(2 * n_nodes)
    current = CurrentLabel(
        row=np.zeros(1, LABEL).view(np.recarray),
        used=np.zeros(n_arcs, np.int64),
        bits=np.zeros(n_words, np.uint64),
        reached=np.zeros(n_goals),
        prospect=np.zeros(n_goals),
        column=np.zeros(1 if world.n_robots == 1 else n_goals),
        paths=new_paths(world),
        reach=np.zeros(n_nodes),
        homeward=np.zeros(n_nodes, np.int64),
    )
    search = LabelSearch(
        world=world,
        goal=np.where(is_goal, np.cumsum(is_goal) - 1, -1),
        reward=graph.reward[is_goal],
        node_keys=keys[:n_nodes].copy(),
        goal_keys=keys[n_nodes:].copy(),
        labels=new_labels(n, n_goals, n_words),
        trails=new_trails(n, len(current.column)),
        progress=np.zeros(1, PROGRESS).view(np.recarray),
        current=current,
    )
    base = world.team.start[0]
    search.labels.rows[0] = -1, -1, base, -1, 1.0, 0.0, search.node_keys[base]
    search.labels.last[int(search.node_keys[base]) & (n - 1)] = 0
    search.progress["n_labels"] = 1
    return search


def new_labels(n: int, n_goals: int, n_words: int) -> LabelTable:
    """Return room for ``n`` labels, a power of two."""
    return LabelTable(
        rows=np.zeros(n, LABEL).view(np.recarray),
        reached=np.zeros((n, n_goals)),
        used=np.zeros((n, n_words), np.uint64),
        last=np.full(n, -1, np.int64),
    )


def new_trails(n: int, n_columns: int) -> TrailTable:
    """Return room for ``n`` trails, a multiple of ``SHELF``."""
    return TrailTable(
        rows=np.zeros(n, TRAIL).view(np.recarray),
        reached=np.zeros((n, n_columns)),
        shelf_survives=np.zeros(n // SHELF),
        shelf_reached=np.zeros((n // SHELF, n_columns)),
    )


def doubled(table: Table) -> Table:
    """Return a copy of a named tuple of arrays with room for twice as many rows."""
    larger = [
        np.concatenate([column, np.zeros_like(column)]).view(type(column)) for column in table
    ]
    return type(table)(*larger)


def chained_again(labels: LabelTable, n_labels: int) -> LabelTable:
    """Chain all labels again, after the table has got room for more chains."""
    labels.last[:] = -1
    rows = labels.rows[:n_labels]
    place = (rows["key"] & np.uint64(len(labels.last) - 1)).astype(np.int64)
    order = np.argsort(place, kind="stable")  # chain by chain, the oldest label first
    follows = place[order[1:]] == place[order[:-1]]
    rows["before"] = -1
    rows["before"][order[1:][follows]] = order[:-1][follows]
    labels.last[place[order]] = order  # the last one of each place stays
    return labels


def n_bytes(*tables: tuple[Any, ...]) -> int:
    """Count the bytes of named tuples of arrays."""
    return sum(column.nbytes for table in tables for column in table)


@inlined
def has(bits: SeedArray, i: int) -> bool:
    """Return whether bit ``i`` is set."""
    return bool((bits[i >> 6] >> np.uint64(i & 63)) & np.uint64(1))


@kernel
def grow(search: LabelSearch, n_looks: int) -> bool:
    """Extend at most ``n_looks`` labels in the order in which they were found.

    Returns whether there may be no room for the extensions of the next label.
    """
    search = shared(search)
    graph, labels, state = search.world.graph, search.labels, search.progress[0]
    for _ in range(n_looks):
        parent = state.next
        if parent == state.n_labels:
            return False
        node = labels.rows[parent].node
        degree = graph.first[node + 1] - graph.first[node]
        n_free = search.trails.rows.shape[0] - state.n_trails
        if min(labels.rows.shape[0] - state.n_labels, n_free) < degree:
            return True
        state.next += 1
        for arc in range(graph.first[node], graph.first[node + 1]):
            if not has(labels.used[parent], arc):
                _extend(search, parent, arc)
    return False


@kernel
def add_trails(search: LabelSearch, others: TrailTable, order: OffsetArray) -> None:
    """Add other trails in an order, except those that a known one is at least as good as."""
    search = shared(search)
    for i in range(order.shape[0]):
        row, reached = others.rows[order[i]], others.reached[order[i]]
        _add_trail(search, row.parent, row.arc, reached, row.survives)


@helper
def _extend(search: LabelSearch, parent: int, arc: int) -> None:
    """Extend a label by an arc; add the new label, the trail that goes home from there, or both."""
    world, current = search.world, search.current
    _copy_label(search, parent)
    row, node, base = current.row[0], world.graph.head[arc], world.team.start[0]
    row.parent, row.arc, row.node = parent, arc, node
    row.alive *= world.graph.survival[arc]
    row.length += world.graph.length[arc]
    current.used[arc] = 1
    look_around(search)
    home = row.alive * current.reach[base]
    if home <= 0.0:  # a dead end, or one to any precision
        return
    goal = search.goal[node]
    is_fresh = goal >= 0 and current.reached[goal] == 0.0
    if is_fresh:
        current.reached[goal] = row.alive
    survives = _look_ahead(search)
    if _is_dominated(search):
        return
    floor = world.limits.floors[0]
    if is_fresh or (node == base and world.ways.shortest is not None):
        if home >= floor and _go_home(search) <= world.limits.budgets[0]:
            _add_trail(search, parent, arc, current.column, home)
        _look_ahead(search)  # the way home has been written over the prospects
    if survives <= 0.0 or survives < floor * (1.0 - CHECKING):
        return
    as_column(search, current.prospect, current.column)
    if not _is_covered(search, current.column, survives):
        _add_label(search)


@helper
def _copy_label(search: LabelSearch, label: int) -> None:
    """Make a label of the table the current one."""
    labels, current = search.labels, search.current
    row, copied = current.row[0], labels.rows[label]
    row.node, row.alive, row.length = copied.node, copied.alive, copied.length
    for arc in range(current.used.shape[0]):
        current.used[arc] = has(labels.used[label], arc)
    for goal in range(current.reached.shape[0]):
        current.reached[goal] = labels.reached[label, goal]


@helper
def look_around(search: LabelSearch) -> None:
    """Find the safest ways from the current label over arcs that it can use.

    Arcs of no use are marked as used, and ``current.bits`` is written.
    """
    graph, current = search.world.graph, search.current
    reach, paths, used, n_nodes = current.reach, current.paths, current.used, graph.reward.shape[0]
    node = current.row[0].node
    _mark_arcs_too_far(search, search.world.ways.shortest)
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
            current.bits[arc >> 6] |= np.uint64(1) << np.uint64(arc & 63)


@helper
def _mark_arcs_too_far(search: LabelSearch, shortest: Shortest | None) -> None:
    """Mark arcs over which the current label cannot get home within the travel budget as used."""
    if shortest is None:
        return
    graph, current = search.world.graph, search.current
    paths, used, row, n_nodes = current.paths, current.used, current.row[0], graph.reward.shape[0]
    longest = search.world.limits.budgets[0] * (1.0 + CHECKING) - row.length
    n = search_paths(shortest.graph, paths, used, 1, row.node, ANYWHERE, n_nodes, False)
    for i in range(n):
        tail = paths.order[i]
        for arc in range(graph.first[tail], graph.first[tail + 1]):
            length = paths.distance[tail] + graph.length[arc]
            if length + shortest.length[graph.head[arc]] > longest:
                used[arc] = 1


@helper
def _find_ways_home(search: LabelSearch) -> None:
    """Find the nodes from which arcs that the current label can use lead home."""
    world, current = search.world, search.current
    homeward, n_nodes = current.homeward, current.homeward.shape[0]
    # What can be reached leads home.
    everywhere = world.graph.balanced and world.ways.shortest is None
    for v in range(n_nodes):
        homeward[v] = 1 if everywhere else 0
    if everywhere:
        return
    base, paths = world.team.start[0], current.paths
    n = search_paths(world.graph, paths, current.used, 1, base, ANYWHERE, n_nodes, True)
    for i in range(n):
        homeward[paths.order[i]] = 1


@helper
def _look_ahead(search: LabelSearch) -> float:
    """Write ``prospect`` of the current label, after a call of ``look_around``.

    Returns the most with which a robot may survive that goes on to a goal that it has not reached,
    or, with a travel budget, to the base; −1 where it can do neither.
    """
    world, current, survives = search.world, search.current, -1.0
    reached, prospect, row = current.reached, current.prospect, current.row[0]
    for goal in range(reached.shape[0]):
        prospect[goal] = reached[goal]
    for node in range(search.goal.shape[0]):
        goal = search.goal[node]
        if goal < 0 or reached[goal] > 0.0 or current.homeward[node] == 0:
            continue
        reach = row.alive * current.reach[node]
        if reach > 0.0:
            prospect[goal] = reach
            survives = max(survives, reach * world.ways.home[node])
    if world.ways.shortest is not None and row.node != world.team.start[0]:
        survives = max(survives, row.alive * current.reach[world.team.start[0]])
    return survives


@helper
def _go_home(search: LabelSearch) -> float:
    """Return the length of the trail that goes home by the safest way.

    What it reaches is written to ``current.column``.
    """
    graph, current = search.world.graph, search.current
    for goal in range(current.reached.shape[0]):
        current.prospect[goal] = current.reached[goal]
    node, entry, length = search.world.team.start[0], current.paths.entry, current.row[0].length
    while entry[node] >= 0:
        length += graph.length[entry[node]]
        goal = search.goal[node]
        if goal >= 0 and current.reached[goal] == 0.0:
            current.prospect[goal] = current.row[0].alive * current.reach[node]
        node = graph.tail[entry[node]]
    as_column(search, current.prospect, current.column)
    return float(length)


@helper
def as_column(search: LabelSearch, reached: FloatArray, column: FloatArray) -> None:
    """Write what ``TrailTable`` keeps of the probabilities to reach each goal."""
    if search.world.team.start.shape[0] > 1:
        for goal in range(reached.shape[0]):
            column[goal] = reached[goal]
        return
    collected = total = 0.0
    for goal in range(reached.shape[0]):
        collected += search.reward[goal] * reached[goal]
        total += search.reward[goal]
    column[0] = collected / total if total > 0.0 else 0.0


@helper
def _is_dominated(search: LabelSearch) -> bool:
    """Return whether some label of the table dominates the current one."""
    labels, current = search.labels, search.current.row[0]
    has_budget, key = search.world.ways.shortest is not None, _key_of(search)
    label = labels.last[np.int64(key & np.uint64(labels.last.shape[0] - 1))]
    while label >= 0:
        row = labels.rows[label]
        same = row.key == key and row.node == current.node
        same = same and not (has_budget and row.length > current.length)
        if same and row.alive >= current.alive and _dominates(search, label):
            return True
        label = row.before
    return False


@inlined
def _dominates(search: LabelSearch, label: int) -> bool:
    """Return whether a label at the same node, and alive as probably, dominates the current one."""
    labels, current = search.labels, search.current
    for word in range(current.bits.shape[0]):
        if labels.used[label, word] & ~current.bits[word]:
            return False
    if search.world.team.start.shape[0] > 1:
        for goal in range(current.reached.shape[0]):
            if labels.reached[label, goal] < current.reached[goal]:
                return False
        return True
    ahead = 0.0
    for goal in range(current.reached.shape[0]):
        known, own = labels.reached[label, goal], current.reached[goal]
        if known > 0.0 and own == 0.0:
            own = current.prospect[goal]
        ahead += search.reward[goal] * (known - own)
    return ahead >= 0.0


@inlined
def _key_of(search: LabelSearch) -> np.uint64:
    """Hash the node of the current label and the goals that it has reached."""
    reached = search.current.reached
    key: np.uint64 = search.node_keys[search.current.row[0].node]
    for goal in range(reached.shape[0]):
        if reached[goal] > 0.0:
            key ^= search.goal_keys[goal]
    return key


@helper
def _add_label(search: LabelSearch) -> None:
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


@helper
def _add_trail(
    search: LabelSearch, parent: int, arc: int, reached: FloatArray, survives: float
) -> None:
    """Put a trail into the next row, which must be free, unless a known one is as good."""
    if _is_covered(search, reached, survives):
        return
    trails, n = search.trails, search.progress[0].n_trails
    search.progress[0].n_trails += 1
    row, shelf, is_first = trails.rows[n], n // SHELF, n % SHELF == 0
    row.parent, row.arc, row.survives = parent, arc, survives
    most = 0.0 if is_first else trails.shelf_survives[shelf]
    trails.shelf_survives[shelf] = max(most, survives)
    for column in range(reached.shape[0]):
        trails.reached[n, column] = reached[column]
        most = 0.0 if is_first else trails.shelf_reached[shelf, column]
        trails.shelf_reached[shelf, column] = max(most, reached[column])


@helper
def _is_covered(search: LabelSearch, reached: FloatArray, survives: float) -> bool:
    """Return whether a known trail is at least as good in everything."""
    trails, n = search.trails, search.progress[0].n_trails
    best, all_reached = trails.shelf_survives, trails.shelf_reached
    for shelf in range((n + SHELF - 1) // SHELF):
        if not _is_as_good(best[shelf], all_reached, shelf, reached, survives):
            continue
        for trail in range(shelf * SHELF, min(n, (shelf + 1) * SHELF)):
            alive = trails.rows[trail].survives
            if _is_as_good(alive, trails.reached, trail, reached, survives):
                return True
    return False


@inlined
def _is_as_good(
    alive: float, all_reached: FloatArray, row: int, reached: FloatArray, survives: float
) -> bool:
    """Return whether ``alive`` and a row of probabilities to reach goals are as good as others."""
    if alive < survives:
        return False
    column = 0
    while column < reached.shape[0] and all_reached[row, column] >= reached[column]:
        column += 1
    return bool(column == reached.shape[0])
