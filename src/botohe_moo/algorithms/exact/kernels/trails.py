"""All trails that some best team may need, by labels: partial trails that leave the base.

A trail matters to a team by the probabilities that its robot reaches each goal (a node with reward,
the base excepted) and that it survives; for a team of one robot by its reward and survival. Team
objectives rise with each of them, so a trail that is at least as good as another one in all of them
can replace it in any plan. A label is dropped where a known trail is at least as good as the label
can still become in each of them, or where another label dominates it (see ``labels``).

After the last goal that a robot reaches for the first time, it goes home by the safest way over
unused arcs. So trails end where a label has just reached a goal, and a label goes on only as long
as it may still reach one.

With a travel budget the safest way home may be too long, and the best one a compromise. So trails
also end where a label has come to the base arc by arc, and a label goes on as long as it may come
there by a safer way than those that are known.
"""

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray
from botohe_moo.algorithms.exact.kernels.labels import (
    ROUNDING,
    add_label,
    has,
    is_dominated,
    look_ahead,
    look_around,
)
from botohe_moo.algorithms.exact.kernels.tables import SHELF, LabelRule, LabelSearch, TrailTable
from botohe_moo.core.compile import helper, inlined, kernel


@kernel
def add_trails(
    trails: TrailTable, progress: RecordArray, others: TrailTable, order: OffsetArray
) -> None:
    """Add other trails in an order, except those that a known one is at least as good as."""
    for i in range(order.shape[0]):
        row, reached = others.rows[order[i]], others.reached[order[i]]
        _add_trail(trails, progress, row.parent, row.arc, reached, row.survives)


@kernel
def grow(search: LabelSearch, n_looks: int, again: bool) -> bool:
    """Extend at most ``n_looks`` labels in the order in which they were found.

    If ``again``, labels are left out that a label or a trail found since then dominates. Returns
    whether there may be no room for the extensions of the next label.
    """
    graph, labels, state = search.graph, search.labels, search.progress[0]
    if state.n_labels == 0:
        _begin(search)
    for _ in range(n_looks):
        parent = state.next
        if parent == state.n_labels:
            return False
        node = labels.rows[parent].node
        degree = graph.first[node + 1] - graph.first[node]
        n_free = len(search.trails.rows) - state.n_trails
        if min(len(labels.rows) - state.n_labels, n_free) < degree:
            return True
        state.next += 1
        if again and _has_become_needless(search, parent):
            continue
        for arc in range(graph.first[node], graph.first[node + 1]):
            if not has(labels.used[parent], arc):
                _extend(search, parent, arc)
    return False


@helper
def _begin(search: LabelSearch) -> None:
    """Put the label of a robot that has not left the base into the first row."""
    labels, current = search.labels, search.current
    for place in range(labels.last.shape[0]):
        labels.last[place] = -1
    for arc in range(current.used.shape[0]):
        current.used[arc] = 0
    for goal in range(current.reached.shape[0]):
        current.reached[goal] = 0.0
    row = current.row[0]
    row.parent, row.arc, row.node = -1, -1, search.graph.base
    row.alive, row.length = 1.0, 0.0
    look_around(search)
    if look_ahead(search) > 0.0:
        add_label(search)


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
def _has_become_needless(search: LabelSearch, label: int) -> bool:
    """Return whether another label dominates this one, or a trail is as good as it can become."""
    _copy_label(search, label)
    look_around(search)
    survives = look_ahead(search)
    if is_dominated(search, label):
        return True
    current = search.current
    as_column(search.rule, current.prospect, current.column)
    return _is_covered(search.trails, search.progress[0].n_trails, current.column, survives)


@helper
def _extend(search: LabelSearch, parent: int, arc: int) -> None:
    """Extend a label by an arc; add the new label, the trail that goes home from there, or both."""
    graph, rule, current, trails = search.graph, search.rule, search.current, search.trails
    _copy_label(search, parent)
    row, node = current.row[0], graph.head[arc]
    row.parent, row.arc, row.node = parent, arc, node
    row.alive *= graph.survival[arc]
    row.length += graph.length[arc]
    current.used[arc] = 1
    look_around(search)
    home = row.alive * current.reach[graph.base]
    if home <= 0.0:  # a dead end, or one to any precision
        return
    goal = rule.goal[node]
    is_fresh = goal >= 0 and current.reached[goal] == 0.0
    if is_fresh:
        current.reached[goal] = row.alive
    survives = look_ahead(search)
    if is_dominated(search, -1):
        return
    if is_fresh or (node == graph.base and rule.short is not None):
        if home >= rule.limits.min_survival and _go_home(search) <= rule.limits.max_length:
            _add_trail(trails, search.progress, parent, arc, current.column, home)
        look_ahead(search)  # the way home has been written over the prospects
    if survives <= 0.0 or survives < rule.limits.min_survival * (1.0 - ROUNDING):
        return
    as_column(rule, current.prospect, current.column)
    if not _is_covered(trails, search.progress[0].n_trails, current.column, survives):
        add_label(search)


@helper
def _go_home(search: LabelSearch) -> float:
    """Return the length of the trail that goes home by the safest way.

    What it reaches is written to ``current.column``.
    """
    graph, rule, current = search.graph, search.rule, search.current
    for goal in range(current.reached.shape[0]):
        current.prospect[goal] = current.reached[goal]
    node, entry, length = graph.base, current.paths.entry, current.row[0].length
    while entry[node] >= 0:
        length += graph.length[entry[node]]
        goal = rule.goal[node]
        if goal >= 0 and current.reached[goal] == 0.0:
            current.prospect[goal] = current.row[0].alive * current.reach[node]
        node = graph.tail[entry[node]]
    as_column(rule, current.prospect, current.column)
    return float(length)


@helper
def as_column(rule: LabelRule, reached: FloatArray, column: FloatArray) -> None:
    """Write what ``TrailTable`` keeps of the probabilities to reach each goal."""
    collected = total = 0.0
    for goal in range(reached.shape[0]):
        collected += rule.reward[goal] * reached[goal]
        total += rule.reward[goal]
        if not rule.single:
            column[goal] = reached[goal]
    if rule.single:
        column[0] = collected / total if total > 0.0 else 0.0


@helper
def _is_covered(trails: TrailTable, n_trails: int, reached: FloatArray, survives: float) -> bool:
    """Return whether a known trail is at least as good in everything."""
    best, all_reached = trails.shelf_survives, trails.shelf_reached
    for shelf in range((n_trails + SHELF - 1) // SHELF):
        if not _is_as_good(best[shelf], all_reached, shelf, reached, survives):
            continue
        for trail in range(shelf * SHELF, min(n_trails, (shelf + 1) * SHELF)):
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


@helper
def _add_trail(
    trails: TrailTable,
    progress: RecordArray,
    parent: int,
    arc: int,
    reached: FloatArray,
    survives: float,
) -> None:
    """Put a trail into the next row, which must be free, unless a known one is as good."""
    n = progress[0].n_trails
    if _is_covered(trails, n, reached, survives):
        return
    progress[0].n_trails += 1
    row, shelf = trails.rows[n], n // SHELF
    row.parent, row.arc, row.survives = parent, arc, survives
    most = trails.shelf_survives[shelf] if n % SHELF > 0 else 0.0
    trails.shelf_survives[shelf] = max(most, survives)
    for column in range(reached.shape[0]):
        trails.reached[n, column] = reached[column]
        most = trails.shelf_reached[shelf, column] if n % SHELF > 0 else 0.0
        trails.shelf_reached[shelf, column] = max(most, reached[column])
