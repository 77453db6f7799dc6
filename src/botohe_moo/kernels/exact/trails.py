"""All trails that some best team may need, by labels: partial trails that leave the base.

A trail matters to a team by the probabilities that its robot reaches each goal (a node with reward,
the base excepted) and that it survives; for a team of one robot by its reward and survival. Team
objectives rise with each of them, so a trail that is at least as good as another in all of them
replaces it in any plan. In the same way it replaces a label when it is at least as good as that
label can still get in each of them: the label is dropped. So is a label for which another one
stands (see ``labels``).

After the last goal that a robot is the first time at, it goes home by the safest way over unused
arcs. So trails end where a label has just reached a goal, and a label goes on only as long as it
may still reach one.

With a travel budget the safest way home may be too long, and the best one a compromise. So trails
end also where a label has come to the base arc by arc, and a label goes on as long as it may still
come there by a way that is safer than those that are known.
"""

from botohe_moo._base.types import FloatArray, OffsetArray, RecordArray
from botohe_moo.kernels.compile import helper, kernel
from botohe_moo.kernels.exact.labels import (
    ROUNDING,
    add_label,
    has,
    has_budget,
    is_needless,
    look_ahead,
    look_around,
)
from botohe_moo.kernels.exact.tables import (
    SHELF,
    CurrentLabel,
    LabelRule,
    LabelTable,
    TrailTable,
)
from botohe_moo.kernels.graph.graph import Graph


@kernel
def add_trails(
    trails: TrailTable, progress: RecordArray, others: TrailTable, order: OffsetArray
) -> None:
    """Add other trails in an order, but for those that a known one is at least as good as."""
    for i in range(order.shape[0]):
        row = others.rows[order[i]]
        reached = others.reached[order[i]]
        _add_trail(trails, progress, row.parent, row.arc, reached, row.survives)


@kernel
def grow(
    graph: Graph,
    rule: LabelRule,
    labels: LabelTable,
    trails: TrailTable,
    progress: RecordArray,
    current: CurrentLabel,
    n_looks: int,
    again: bool,
) -> bool:
    """Go on from at most ``n_looks`` labels as they were found, first from the base.

    If ``again``, each label is looked at again first: what has been found since may stand for it,
    or be as good as all it can become. Tells whether it ended because there may be no room for what
    the next label becomes.
    """
    state = progress[0]
    if state.n_labels == 0:
        _begin(graph, rule, labels, progress, current)
    for _ in range(n_looks):
        parent = state.next
        if parent == state.n_labels:
            return False
        node = labels.rows[parent].node
        degree = graph.first[node + 1] - graph.first[node]
        room = min(len(labels.rows) - state.n_labels, len(trails.rows) - state.n_trails)
        if room < degree:
            return True
        state.next += 1
        if again and _is_settled(graph, rule, labels, trails, progress, current, parent):
            continue
        for arc in range(graph.first[node], graph.first[node + 1]):
            if not has(labels.used[parent], arc):
                _step(graph, rule, labels, trails, progress, current, parent, arc)
    return False


@helper
def _begin(
    graph: Graph, rule: LabelRule, labels: LabelTable, progress: RecordArray, current: CurrentLabel
) -> None:
    """Put the label of a robot that has not left the base into the first row."""
    for place in range(labels.last.shape[0]):
        labels.last[place] = -1
    for arc in range(current.used.shape[0]):
        current.used[arc] = 0
    for goal in range(current.reached.shape[0]):
        current.reached[goal] = 0.0
    current.length[0] = 0.0
    look_around(graph, rule, current, graph.base)
    if look_ahead(graph, rule, current, graph.base, 1.0) > 0.0:
        add_label(rule, labels, progress, current, -1, -1, graph.base, 1.0)


@helper
def _is_settled(
    graph: Graph,
    rule: LabelRule,
    labels: LabelTable,
    trails: TrailTable,
    progress: RecordArray,
    current: CurrentLabel,
    label: int,
) -> bool:
    """Tell whether a label stands for this one, or a trail is as good as all it can become."""
    _copy(labels, label, current)
    row = labels.rows[label]
    look_around(graph, rule, current, row.node)
    survives = look_ahead(graph, rule, current, row.node, row.alive)
    if is_needless(rule, labels, current, row.node, row.alive, label):
        return True
    as_column(rule, current.prospect, current.column)
    return _is_covered(trails, progress[0].n_trails, current.column, survives)


@helper
def _copy(labels: LabelTable, label: int, current: CurrentLabel) -> None:
    """Take a label in hand."""
    current.length[0] = labels.rows[label].length
    for arc in range(current.used.shape[0]):
        current.used[arc] = has(labels.used[label], arc)
    for goal in range(current.reached.shape[0]):
        current.reached[goal] = labels.reached[label, goal]


@helper
def _step(
    graph: Graph,
    rule: LabelRule,
    labels: LabelTable,
    trails: TrailTable,
    progress: RecordArray,
    current: CurrentLabel,
    parent: int,
    arc: int,
) -> None:
    """Go on from a label by one arc; what is worth it becomes a label, a trail, or both."""
    node = graph.head[arc]
    alive = labels.rows[parent].alive * graph.survival[arc]
    _copy(labels, parent, current)
    current.used[arc] = 1
    current.length[0] += graph.length[arc]
    look_around(graph, rule, current, node)
    if alive * current.reach[graph.base] <= 0.0:  # a dead end, or one to any precision
        return
    goal = rule.goal[node]
    fresh = goal >= 0 and current.reached[goal] == 0.0
    if fresh:
        current.reached[goal] = alive
    survives = look_ahead(graph, rule, current, node, alive)
    if is_needless(rule, labels, current, node, alive, -1):
        return
    if fresh or (node == graph.base and has_budget(rule)):
        home = alive * current.reach[graph.base]
        if home >= rule.limits.min_survival and _is_short_enough(graph, rule, current):
            _look_on_the_way_home(graph, rule, current, alive)
            _add_trail(trails, progress, parent, arc, current.column, home)
        look_ahead(graph, rule, current, node, alive)
    if survives <= 0.0 or survives < rule.limits.min_survival * (1.0 - ROUNDING):
        return
    as_column(rule, current.prospect, current.column)
    if not _is_covered(trails, progress[0].n_trails, current.column, survives):
        add_label(rule, labels, progress, current, parent, arc, node, alive)


@helper
def _is_short_enough(graph: Graph, rule: LabelRule, current: CurrentLabel) -> bool:
    """Tell whether the label at hand, gone home by the safest way, keeps the travel budget."""
    at, length = graph.base, current.length[0]
    while current.paths.entry[at] >= 0:
        length += graph.length[current.paths.entry[at]]
        at = graph.tail[current.paths.entry[at]]
    return bool(length <= rule.limits.max_length)


@helper
def _look_on_the_way_home(
    graph: Graph, rule: LabelRule, current: CurrentLabel, alive: float
) -> None:
    """Write to ``current.column`` what the trail reaches that goes home by the safest way."""
    for goal in range(current.reached.shape[0]):
        current.prospect[goal] = current.reached[goal]
    at = graph.base
    while current.paths.entry[at] >= 0:
        goal = rule.goal[at]
        if goal >= 0 and current.reached[goal] == 0.0:
            current.prospect[goal] = alive * current.reach[at]
        at = graph.tail[current.paths.entry[at]]
    as_column(rule, current.prospect, current.column)


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
    """Tell whether a known trail is at least as good in everything."""
    for shelf in range((n_trails + SHELF - 1) // SHELF):
        if trails.shelf_survives[shelf] < survives:
            continue
        possible = True
        for column in range(reached.shape[0]):
            if trails.shelf_reached[shelf, column] < reached[column]:
                possible = False
                break
        if not possible:
            continue
        for trail in range(shelf * SHELF, min(n_trails, (shelf + 1) * SHELF)):
            better = trails.rows[trail].survives >= survives
            for column in range(reached.shape[0]):
                if not better:
                    break
                better = trails.reached[trail, column] >= reached[column]
            if better:
                return True
    return False


@helper
def _add_trail(
    trails: TrailTable,
    progress: RecordArray,
    parent: int,
    arc: int,
    reached: FloatArray,
    survives: float,
) -> None:
    """Put a trail into the next row, unless one that is known is at least as good.

    There must be room for it.
    """
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
