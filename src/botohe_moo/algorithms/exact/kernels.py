"""The kernels of the exact front: trails that some best team may need, then teams of them.

Trails are found by labels: partial trails that leave the base.

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

Teams are multisets of K such trails, found by branch and bound.

Robots choose trails one after another, in ascending order, so that each multiset comes up once. A
bound on what further robots add follows from the diminishing returns of reward. n of them add at
most the sum of what each would add alone to the team as it is. This is at most n times a point of
the upper concave hull of (reward added, survival) over the trails left to choose from. A team is
given up when no point of its bound gets beyond the front. What a trail adds only shrinks as the
team grows: a trail that has been given up for a robot is not tried again for those after it.
"""

from typing import Any, NamedTuple, TypeVar

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray, RecordArray, SeedArray
from botohe_moo.core.compile import helper, inlined, kernel, shared
from botohe_moo.core.ordered import OrderedFront, best_reward, find_place, insert
from botohe_moo.core.paths import ANYWHERE, Paths, new_paths, search_paths
from botohe_moo.core.rng import hash_keys
from botohe_moo.core.world import CHECKING, Shortest, World, keeps

SHELF = 32  # trails that are skipped together where none can be as good
_PLACES = 2**18  # for chains of labels: a power of two

# A label: the label that it goes on from, −1 for the first one; the node where it ends; the label
# before it in its chain, or −1; the probability to get there, and how long it is; and a hash of the
# node and the goals reached.
LABEL = np.dtype(
    [(name, np.int64) for name in ("parent", "node", "before")]
    + [("alive", np.float64), ("length", np.float64), ("key", np.uint64)]
)
# A trail: the label and the arc after which it goes home by the safest way, and the probability to
# survive it. The trail that stays at base has no parent: −1.
TRAIL = np.dtype([("parent", np.int64), ("arc", np.int64), ("survives", np.float64)])
# How many labels and trails there are, and the next label to go on from.
PROGRESS = np.dtype([(name, np.int64) for name in ("n_labels", "next", "n_trails")])
Table = TypeVar("Table", bound=tuple[Any, ...])


class LabelTable(NamedTuple):
    """Labels, one a row. The row behind the last one is that of the label that is being made."""

    rows: RecordArray  # as ``LABEL``
    # Probability to have reached each goal, 0 where it has not been visited (n, n_goals).
    reached: FloatArray
    used: SeedArray  # bits of the arcs that it cannot use any more (n, n_words)


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


class LabelSearch(NamedTuple):
    """A search for all trails that teams may need."""

    world: World  # of a plain mission, whose base has no reward
    goal: OffsetArray  # of each node, which goal it is, −1 for those without reward (n_nodes)
    reward: FloatArray  # of each goal (n_goals)
    # Keys for hashes of nodes and of goals.
    node_keys: SeedArray
    goal_keys: SeedArray
    labels: LabelTable
    # Labels are chained by the low bits of their keys: the last one of each chain, −1 for none.
    last: OffsetArray
    trails: TrailTable
    progress: RecordArray  # as ``PROGRESS`` (1)
    # Scratch for the label that is being made: which arcs it cannot use any more (n_arcs), the most
    # that its probability to reach each goal may become (n_goals), and a row of
    # ``TrailTable.reached``;
    used: OffsetArray
    prospect: FloatArray
    column: FloatArray
    # the safest ways from its node over arcs that it can use, the survival of these, 0 where there
    # is none, and whether arcs that it can use lead home from each node (n_nodes).
    paths: Paths
    reach: FloatArray
    homeward: OffsetArray


def new_search(world: World, n: int) -> LabelSearch:
    """Return a search whose only label and whose only trail are a robot's that stays at base.

    It has room for ``n`` labels and as many trails: a multiple of ``SHELF``.
    """
    graph, is_goal, base = world.graph, world.graph.reward > 0.0, world.team.start[0]
    n_nodes, n_arcs, n_goals = graph.n_nodes, graph.n_arcs, int(is_goal.sum())
    n_columns, keys = 1 if world.n_robots == 1 else n_goals, hash_keys(2 * n_nodes)
    search = LabelSearch(
        world=world,
        goal=np.where(is_goal, np.cumsum(is_goal) - 1, -1),
        reward=graph.reward[is_goal],
        node_keys=keys[:n_nodes].copy(),
        goal_keys=keys[n_nodes:].copy(),
        labels=LabelTable(
            rows=np.zeros(n, LABEL).view(np.recarray),
            reached=np.zeros((n, n_goals)),
            used=np.zeros((n, n_arcs // 64 + 1), np.uint64),
        ),
        last=np.full(_PLACES, -1),
        trails=TrailTable(
            rows=np.zeros(n, TRAIL).view(np.recarray),
            reached=np.zeros((n, n_columns)),
            shelf_survives=np.zeros(n // SHELF),
            shelf_reached=np.zeros((n // SHELF, n_columns)),
        ),
        progress=np.zeros(1, PROGRESS).view(np.recarray),
        used=np.zeros(n_arcs, np.int64),
        prospect=np.zeros(n_goals),
        column=np.zeros(n_columns),
        paths=new_paths(world),
        reach=np.zeros(n_nodes),
        homeward=np.zeros(n_nodes, np.int64),
    )
    search.labels.rows[0] = -1, base, -1, 1.0, 0.0, search.node_keys[base]
    search.last[_place_of(search.node_keys[base])] = 0
    search.trails.rows[0] = -1, -1, 1.0
    search.trails.shelf_survives[0] = 1.0
    search.progress[0] = 1, 0, 1
    return search


def doubled(table: Table) -> Table:
    """Return a copy of a named tuple of arrays with room for twice as many rows."""
    larger = [
        np.concatenate([column, np.zeros_like(column)]).view(type(column)) for column in table
    ]
    return type(table)(*larger)


def n_bytes(*tables: tuple[Any, ...]) -> int:
    """Count the bytes of named tuples of arrays."""
    return sum(column.nbytes for table in tables for column in table)


@inlined
def _place_of(key: np.uint64) -> int:
    """Return the number of the chain of a key."""
    return int(np.int64(key & np.uint64(_PLACES - 1)))


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
        if min(labels.rows.shape[0] - state.n_labels - 1, n_free) < degree:
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
    world, labels, state = search.world, search.labels, search.progress[0]
    node, base, floor = world.graph.head[arc], world.team.start[0], world.limits.floors[0]
    row, before = labels.rows[state.n_labels], labels.rows[parent]
    reached = labels.reached[state.n_labels]
    row.parent, row.node = parent, node
    row.alive = before.alive * world.graph.mean_survival[arc]
    row.length = before.length + world.graph.length[arc]
    row.key = before.key ^ search.node_keys[before.node] ^ search.node_keys[node]
    for goal in range(reached.shape[0]):
        reached[goal] = labels.reached[parent, goal]
    for each in range(search.used.shape[0]):
        search.used[each] = has(labels.used[parent], each)
    search.used[arc] = 1
    look_around(search)
    home, goal = row.alive * search.reach[base], search.goal[node]
    if home <= 0.0:  # a dead end, or one to any precision
        return
    is_fresh = goal >= 0 and reached[goal] == 0.0
    if is_fresh:
        reached[goal] = row.alive
        row.key = row.key ^ search.goal_keys[goal]
    survives = _look_ahead(search)
    if _is_dominated(search):
        return
    if is_fresh or (node == base and world.ways.shortest is not None):
        if keeps(world.limits, 0, home, _go_home(search)):
            _add_trail(search, parent, arc, search.column, home)
        _look_ahead(search)  # the way home has been written over the prospects
    if survives <= 0.0 or survives < floor * (1.0 - CHECKING):
        return
    as_column(search, search.prospect, search.column)
    if not _is_covered(search, search.column, survives):
        place = _place_of(row.key)
        row.before, search.last[place] = search.last[place], state.n_labels
        state.n_labels += 1


@helper
def look_around(search: LabelSearch) -> None:
    """Find the safest ways from the label that is being made over arcs that it can use.

    Arcs of no use are marked as used, too, and the label's bits are written.
    """
    world, graph, paths, used = search.world, search.world.graph, search.paths, search.used
    reach, homeward, n_nodes = search.reach, search.homeward, search.reach.shape[0]
    label, base = search.progress[0].n_labels, world.team.start[0]
    node, bits = search.labels.rows[label].node, search.labels.used[label]
    _mark_arcs_too_far(search, world.ways.shortest)
    n, everywhere = 0, graph.balanced and world.ways.shortest is None  # what is reached leads home
    if not everywhere:
        n = search_paths(graph, paths, used, 1, base, ANYWHERE, n_nodes, True)
    for v in range(n_nodes):
        reach[v], homeward[v] = 0.0, everywhere
    for i in range(n):
        homeward[paths.order[i]] = 1
    reach[node] = 1.0
    n = search_paths(graph, paths, used, 1, node, ANYWHERE, n_nodes, False)
    for i in range(1, n):
        arc = paths.entry[paths.order[i]]
        reach[paths.order[i]] = reach[graph.tail[arc]] * graph.mean_survival[arc]
    for word in range(bits.shape[0]):
        bits[word] = 0
    for arc in range(used.shape[0]):
        if reach[graph.tail[arc]] == 0.0 or homeward[graph.head[arc]] == 0:
            used[arc] = 1
        if used[arc] == 1:
            bits[arc >> 6] |= np.uint64(1) << np.uint64(arc & 63)


@helper
def _mark_arcs_too_far(search: LabelSearch, shortest: Shortest | None) -> None:
    """Mark arcs over which the label cannot get home within the travel budget as used."""
    if shortest is None:
        return
    graph, paths, used = search.world.graph, search.paths, search.used
    row = search.labels.rows[search.progress[0].n_labels]
    longest = search.world.limits.budgets[0] * (1.0 + CHECKING) - row.length
    n_nodes = search.reach.shape[0]
    n = search_paths(shortest.graph, paths, used, 1, row.node, ANYWHERE, n_nodes, False)
    for i in range(n):
        tail = paths.order[i]
        for arc in range(graph.first[tail], graph.first[tail + 1]):
            length = paths.distance[tail] + graph.length[arc]
            if length + shortest.length[graph.head[arc]] > longest:
                used[arc] = 1


@helper
def _look_ahead(search: LabelSearch) -> float:
    """Write ``prospect`` of the label that is being made, after a call of ``look_around``.

    Returns the most with which a robot may survive that goes on to a goal that it has not reached,
    or, with a travel budget, to the base; −1 where it can do neither.
    """
    world, prospect, label = search.world, search.prospect, search.progress[0].n_labels
    row, reached, survives = search.labels.rows[label], search.labels.reached[label], -1.0
    for goal in range(reached.shape[0]):
        prospect[goal] = reached[goal]
    for node in range(search.goal.shape[0]):
        goal = search.goal[node]
        if goal < 0 or reached[goal] > 0.0 or search.homeward[node] == 0:
            continue
        reach = row.alive * search.reach[node]
        if reach > 0.0:
            prospect[goal] = reach
            survives = max(survives, reach * world.ways.home[node])
    if world.ways.shortest is not None and row.node != world.team.start[0]:
        survives = max(survives, row.alive * search.reach[world.team.start[0]])
    return survives


@helper
def _go_home(search: LabelSearch) -> float:
    """Return the length of the trail that goes home by the safest way.

    What it reaches is written to ``column``.
    """
    graph, entry, prospect = search.world.graph, search.paths.entry, search.prospect
    label, node = search.progress[0].n_labels, search.world.team.start[0]
    row, reached = search.labels.rows[label], search.labels.reached[label]
    length = row.length
    for goal in range(reached.shape[0]):
        prospect[goal] = reached[goal]
    while entry[node] >= 0:
        length += graph.length[entry[node]]
        goal = search.goal[node]
        if goal >= 0 and reached[goal] == 0.0:
            prospect[goal] = row.alive * search.reach[node]
        node = graph.tail[entry[node]]
    as_column(search, prospect, search.column)
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
    """Return whether some label of the table dominates the one that is being made."""
    rows, has_budget = search.labels.rows, search.world.ways.shortest is not None
    own = rows[search.progress[0].n_labels]
    label = search.last[_place_of(own.key)]
    while label >= 0:
        row = rows[label]
        same = row.key == own.key and row.node == own.node and row.alive >= own.alive
        if same and not (has_budget and row.length > own.length) and _dominates(search, label):
            return True
        label = row.before
    return False


@inlined
def _dominates(search: LabelSearch, label: int) -> bool:
    """Return whether a label at the same node, and alive as probably, dominates the new one."""
    labels, new = search.labels, search.progress[0].n_labels
    for word in range(labels.used.shape[1]):
        if labels.used[label, word] & ~labels.used[new, word]:
            return False
    ahead = 0.0
    for goal in range(search.reward.shape[0]):
        known, own = labels.reached[label, goal], labels.reached[new, goal]
        if search.world.team.start.shape[0] > 1:
            if known < own:
                return False
        else:
            if known > 0.0 and own == 0.0:
                own = search.prospect[goal]
            ahead += search.reward[goal] * (known - own)
    return ahead >= 0.0


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


# The state of a search: whose turn it is to choose, −1 before it begins; and how many choices have
# been looked at.
TURN = np.dtype([("robot", np.int64), ("n_looks", np.int64)])
# A robot: how many trails it may choose from, the position of the one that it has chosen or tries
# next, and how many are on the hull of its choices; E[R] and E[S] of the robots before it.
ROBOT = np.dtype(
    [(name, np.int64) for name in ("n_listed", "at", "n_hull")]
    + [(name, np.float64) for name in ("reward", "survivors")]
)


class Choices(NamedTuple):
    """Trails to choose from, and those that the robots have chosen."""

    # Of each trail its survival, which descends (n_trails), and the probability to reach each goal
    # (n_trails, n_goals).
    survives: FloatArray
    reached: FloatArray
    # By how much of reward and of survivors a team must be better to count as better (2).
    slack: FloatArray
    turn: RecordArray  # a ``TURN`` (1)
    robots: RecordArray  # as ``ROBOT`` (n_robots)
    # For each robot the trails that it may choose and what each adds to the robots before it, and
    # the upper concave hull of these choices, by ascending gain (n_robots, n_trails).
    listed: OffsetArray
    gain: FloatArray
    hull_gain: FloatArray
    hull_survives: FloatArray
    # For each robot the reward of each goal, times the probability that none before it gets there
    # (n_robots, n_goals).
    left: FloatArray


def new_choices(
    survives: FloatArray, reached: FloatArray, reward: FloatArray, slack: FloatArray, n_robots: int
) -> Choices:
    """Return room for a search in which no robot has chosen."""
    shape = (n_robots, len(survives))
    choices = Choices(
        survives=survives,
        reached=reached,
        slack=slack,
        turn=np.array([(-1, 0)], TURN).view(np.recarray),
        robots=np.zeros(n_robots, ROBOT).view(np.recarray),
        listed=np.zeros(shape, np.int64),
        gain=np.zeros(shape),
        hull_gain=np.zeros(shape),
        hull_survives=np.zeros(shape),
        left=np.zeros((n_robots, len(reward))),
    )
    choices.listed[0], choices.left[0] = np.arange(len(survives)), reward
    choices.robots["n_listed"][0] = len(survives)
    return choices


@helper
def _make_hull(choices: Choices, robot: int) -> None:
    """Find the upper concave hull of a robot's choices, which come by descending survival."""
    xs, ys = choices.hull_gain[robot], choices.hull_survives[robot]
    n = 0
    for i in range(choices.robots[robot].n_listed):
        x, y = choices.gain[robot, i], choices.survives[choices.listed[robot, i]]
        if n > 0 and x <= xs[n - 1]:
            continue
        while n > 0 and ys[n - 1] <= y:
            n -= 1
        while n > 1 and (ys[n - 2] - ys[n - 1]) * (x - xs[n - 1]) >= (ys[n - 1] - y) * (
            xs[n - 1] - xs[n - 2]
        ):
            n -= 1
        xs[n], ys[n] = x, y
        n += 1
    choices.robots[robot].n_hull = n


@helper
def _is_hopeful(
    choices: Choices, front: OrderedFront, robot: int, reward: float, survivors: float
) -> bool:
    """Return whether a team with E[R] and E[S] may get beyond the front by robots after ``robot``.

    They choose from the hull of that robot.
    """
    n_more = choices.robots.shape[0] - robot - 1
    reward -= choices.slack[0]
    survivors -= choices.slack[1]
    if n_more == 0:
        return best_reward(front, survivors) < reward
    gain, alive = choices.hull_gain[robot], choices.hull_survives[robot]
    last = choices.robots[robot].n_hull - 1
    most_reward, most_survivors = reward + n_more * gain[last], survivors + n_more * alive[0]
    # The front is a staircase: the bound gets beyond it where it gets beyond an inner corner.
    place = find_place(front, most_survivors)
    if place == front.n.plans:
        return True
    right = 0
    while True:
        corner_reward = front.slots[front.order[place]].reward
        if most_reward <= corner_reward:
            return False
        place -= 1
        if place < 0:
            return True
        each = (corner_reward - reward) / n_more
        while right < last and gain[right] < each:
            right += 1
        if right == 0:
            return True
        share = (gain[right] - each) / (gain[right] - gain[right - 1])
        bound = survivors + n_more * (alive[right] + share * (alive[right - 1] - alive[right]))
        if bound > front.slots[front.order[place]].survivors:
            return True


@helper
def _list_choices(choices: Choices, front: OrderedFront, robot: int) -> None:
    """List the trails that a robot may choose, given those before it."""
    before, own = choices.robots[max(0, robot - 1)], choices.robots[robot]
    start, n = before.at, before.n_listed - before.at
    for i in range(n):
        trail, gain = choices.listed[max(0, robot - 1), start + i], 0.0
        for goal in range(choices.left.shape[1]):
            gain += choices.left[robot, goal] * choices.reached[trail, goal]
        choices.listed[robot, i], choices.gain[robot, i] = trail, gain
    own.n_listed, own.at = n, 0
    if robot + 1 < choices.robots.shape[0]:
        _make_hull(choices, robot)
    n_kept = 0
    for i in range(n):
        trail, gain = choices.listed[robot, i], choices.gain[robot, i]
        reward, survivors = own.reward + gain, own.survivors + choices.survives[trail]
        if _is_hopeful(choices, front, robot, reward, survivors):
            choices.listed[robot, n_kept], choices.gain[robot, n_kept] = trail, gain
            n_kept += 1
    own.n_listed = n_kept


@kernel
def choose_teams(choices: Choices, front: OrderedFront, n_looks: int, most_reward: bool) -> bool:
    """Go on with the search for teams; return whether it has ended.

    It pauses after a number of looks at choices, and where the front has no room. With
    ``most_reward`` only the most rewarding team is looked for: teams are put into the front as if
    all robots survived for sure.
    """
    choices, front = shared(choices), shared(front)
    state, n_robots = choices.turn[0], choices.robots.shape[0]
    limit = state.n_looks + n_looks
    if state.robot < 0:
        state.robot = 0
        _list_choices(choices, front, 0)
    while state.n_looks < limit and front.n.spare > 0:
        robot, own = state.robot, choices.robots[state.robot]
        if own.at == own.n_listed:
            if robot == 0:
                return True
            state.robot -= 1
            choices.robots[robot - 1].at += 1
            continue
        state.n_looks += 1
        trail = choices.listed[robot, own.at]
        reward = own.reward + choices.gain[robot, own.at]
        survivors = own.survivors + choices.survives[trail]
        if not _is_hopeful(choices, front, robot, reward, survivors):
            own.at += 1
        elif robot + 1 < n_robots:
            state.robot += 1
            state.n_looks += own.n_listed - own.at
            after = choices.robots[robot + 1]
            after.reward, after.survivors = reward, survivors
            for goal in range(choices.left.shape[1]):
                missed = 1.0 - choices.reached[trail, goal]
                choices.left[robot + 1, goal] = choices.left[robot, goal] * missed
            _list_choices(choices, front, robot + 1)
        else:
            slot = insert(front, reward, np.inf if most_reward else survivors)
            for i in range(n_robots):
                front.plan[slot, i] = choices.listed[i, choices.robots[i].at]
            own.at += 1
    return False
