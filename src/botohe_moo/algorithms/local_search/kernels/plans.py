"""Plans of the front: made parents, laid out for children to be made of them, and inserted.

The trails of all robots but one are fixed. To that robot a node is worth what the others leave of
its reward, so that the rest of the search sees a single robot. A child keeps a prefix of its trail,
goes on along new arcs, and ends with a suffix of it. Its E[S] follows from three products, and its
E[R] is bounded before the suffix is walked.
"""

import numpy as np

from botohe_moo._base.types import OffsetArray
from botohe_moo.algorithms.local_search.kernels.trail_store import TrailStore, discard, release
from botohe_moo.algorithms.local_search.kernels.workspace import (
    NEVER,
    PATIENCE,
    PATIENCE_KINDS,
    TOLERANCE,
    Search,
    Workspace,
)
from botohe_moo.core.compile import helper
from botohe_moo.core.evaluate import begin_team, combine, team_reward
from botohe_moo.core.graph import Graph, limit_at
from botohe_moo.core.kinds import (
    AT_NEXT_DEPOT,
    AT_THIS_DEPOT,
    CARRIED,
    aboard_at,
    aboard_of,
    behind_kind,
    chance_at,
    credit_carried,
    credit_of,
    has_kinds,
    layer_of,
    origin_of,
    reward_at,
    start_of,
)
from botohe_moo.core.ordered import (
    OrderedFront,
    add_place,
    best_reward,
    find_dominated,
    find_place,
    place_before,
    remove_place,
)
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.trails import sort_trails

NOT_STORED = -1  # instead of the number of a trail

# The probability that the next parent is the plan that has just entered the front.
P_NEWEST = 0.9


@helper
def find_plan(front: OrderedFront, survivors: float) -> tuple[int, int]:
    """Find the plan with an E[S]; where it has left, the next safer one, or else the safest."""
    block, place = find_place(front, survivors)
    return (block, place) if block < front.n.blocks else place_before(front, block, place)


@helper
def pop_newest(work: Workspace) -> float:
    """Return E[S] of the plan that entered the front last, if it is the next parent; else −1."""
    newest = work.memory.newest
    work.memory.newest = -1.0
    return newest if newest >= 0.0 and uniform(work.states, 0) < P_NEWEST else -1.0


@helper
def is_stuck(search: Search) -> bool:
    """Return whether no plan has entered the front for long."""
    patience = PATIENCE_KINDS if has_kinds(search.graph.kinds) else PATIENCE
    return bool(search.work.memory.idle > patience)


@helper
def acquire_parent(search: Search, block: int, place: int) -> None:
    """Make a plan of the front the parent, and draw the robot that changes."""
    store, front, work = search.store, search.front, search.work
    draft, parent = work.draft, work.parent
    slot = front.places[front.directory[block], place].slot
    for k in range(parent.shape[0]):
        parent[k] = front.plan[slot, k]
        store.trails[parent[k]].n_users += 1
    draft.block, draft.n_chosen, draft.robot = block, 0, below(work.states, parent.shape[0])


@helper
def release_parent(search: Search) -> None:
    """Release the parent's trails, and leave nodes as they were before ``evaluate_others``."""
    clear_others(search.graph, search.work)
    for k in range(search.work.parent.shape[0]):
        release(search.store, search.work.parent[k])


@helper
def evaluate_others(graph: Graph, store: TrailStore, work: Workspace) -> None:
    """Compute what the parent's other robots collect, with the base, and what they leave."""
    draft, nodes, touched = work.draft, work.nodes, work.touched
    kinds = graph.kinds
    draft.n_touched, draft.survivors = 0, 0.0
    draft.others = 0.0 if has_kinds(kinds) else graph.reward[graph.base]
    draft.layer = layer_of(kinds, start_of(kinds, graph.base, draft.robot))
    for k in range(work.parent.shape[0]):
        is_changed = k == draft.robot
        for i in range(1, draft.n_chosen):
            is_changed |= k == work.chosen[i]
        if is_changed:
            continue
        trail = store.trails[work.parent[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            index, reach = np.int64(store.node[i]), store.reach[i]
            node = nodes[index]
            if node.unreached < 0.0:
                node.unreached = 1.0
                touched[draft.n_touched] = index
                draft.n_touched += 1
            # As a sum: small chances would lose their digits in the reward less what is left.
            draft.others += reward_at(kinds, graph.reward, int(index)) * node.unreached * reach
            node.unreached *= 1.0 - reach
        draft.survivors += trail.alive
    for i in range(draft.n_touched):
        index = draft.layer + touched[i]
        nodes[index].left = graph.reward[index] * nodes[touched[i]].unreached


@helper
def clear_others(graph: Graph, work: Workspace) -> None:
    """Leave nodes as they were before ``evaluate_others``."""
    for i in range(work.draft.n_touched):
        index = work.draft.layer + work.touched[i]
        work.nodes[index].left = graph.reward[index]
        work.nodes[work.touched[i]].unreached = -1.0


@helper
def lay_out(graph: Graph, store: TrailStore, work: Workspace, trail: int) -> None:
    """Compute the steps of the trail that is to be changed; ``clear_trail`` undoes it."""
    steps, nodes = work.steps, work.nodes
    start, length = store.trails[trail].first_arc, store.trails[trail].n_arcs
    kinds, loads = graph.kinds, work.loads
    work.draft.length = length
    source = start_of(kinds, graph.base, work.draft.robot)
    nodes[source].met = 0
    alive, gained, walked, carried = 1.0, 0.0, 0.0, 0.0
    if has_kinds(kinds):
        first, stop = aboard_of(kinds, work.draft.robot)
        for i in range(first, stop):
            node = nodes[aboard_at(kinds, layer_of(kinds, source), i)]
            node.met = 0
            carried += node.left
        if credit_of(kinds, source) == AT_NEXT_DEPOT:
            carried += nodes[source].left
        else:
            gained = nodes[source].left
        if credit_of(kinds, source) == AT_THIS_DEPOT:
            gained, carried = gained + carried, 0.0
        loads[0].carried = carried
    steps[0].node, steps[0].alive, steps[0].gained = source, alive, gained
    steps[0].walked = walked
    for i in range(length):
        arc = np.int64(store.arc[start + i])
        head = graph.head[arc]
        steps[i].arc = arc
        work.arcs[arc].position = i
        alive *= graph.survival[arc]
        walked += graph.length[arc]
        credit = credit_of(kinds, head)
        if nodes[head].met == NEVER:
            nodes[head].met = i + 1
            if credit == AT_NEXT_DEPOT:
                carried += nodes[head].left
            else:
                gained += nodes[head].left * alive
        if has_kinds(kinds):
            if credit == AT_THIS_DEPOT:
                gained += carried * alive
                carried = 0.0
            loads[i + 1].carried = carried
        steps[i + 1].node, steps[i + 1].alive, steps[i + 1].gained = head, alive, gained
        steps[i + 1].walked = walked
    # Backwards: where a node comes again later, only its earlier visit counts.
    ahead = to_depot = 0.0
    steps[length].ahead = ahead
    if has_kinds(kinds):
        loads[length].to_depot = to_depot
    for i in range(length - 1, -1, -1):
        after = steps[i + 1]
        node = nodes[after.node]
        if node.later > 0.0:
            ahead -= node.later / after.alive
        credit, worth = credit_of(kinds, after.node), node.left
        survival = graph.survival[steps[i].arc]
        if credit == AT_NEXT_DEPOT:
            worth *= to_depot
        node.later = worth * after.alive
        ahead = survival * (ahead + worth)
        steps[i].ahead = ahead
        if has_kinds(kinds):
            to_depot = survival if credit == AT_THIS_DEPOT else survival * to_depot
            loads[i].to_depot = to_depot


@helper
def clear_trail(graph: Graph, work: Workspace) -> None:
    """Leave the workspace as it was before ``lay_out``."""
    nodes, steps = work.nodes, work.steps
    first, stop = aboard_of(graph.kinds, work.draft.robot)
    layer = layer_of(graph.kinds, steps[0].node)
    for i in range(first, stop):
        nodes[aboard_at(graph.kinds, layer, i)].met = NEVER
    for i in range(work.draft.length):
        node = steps[i + 1].node
        work.arcs[steps[i].arc].position = -1
        nodes[node].met, nodes[node].later = NEVER, 0.0
    nodes[steps[0].node].met = NEVER


@helper
def add_trail(graph: Graph, store: TrailStore, work: Workspace, robot: int, length: int) -> int:
    """Store a robot's trail of the first ``length`` arcs in ``work.child``; return its number.

    It has one user. The store must have room (``fits``).
    """
    n, nodes = store.n, work.nodes
    work.draft.mark += 1
    mark = work.draft.mark
    n.spare -= 1
    trail = store.spare[n.spare]
    added = store.trails[trail]
    added.first_arc, added.n_arcs, added.first_visit = n.arcs, length, n.visits
    kinds = graph.kinds
    source = start_of(kinds, graph.base, robot)
    nodes[source].seen = mark
    alive, uncredited, layer = 1.0, n.visits, layer_of(kinds, source)
    first, stop = aboard_of(kinds, robot)
    for i in range(first, stop):
        node = aboard_at(kinds, layer, i)
        nodes[node].seen = mark
        store.node[n.visits], store.reach[n.visits] = origin_of(kinds, node), CARRIED
        n.visits += 1
    if has_kinds(kinds) and graph.reward[source] > 0.0:
        store.node[n.visits] = origin_of(kinds, source)
        store.reach[n.visits] = chance_at(kinds, source, alive)
        n.visits += 1
    if has_kinds(kinds) and credit_of(kinds, source) == AT_THIS_DEPOT:
        uncredited = credit_carried(
            kinds, layer, store.node, store.reach, uncredited, n.visits, alive
        )
    for i in range(length):
        arc = work.child[i]
        store.arc[n.arcs + i] = arc
        alive *= graph.survival[arc]
        node = graph.head[arc]
        if graph.reward[node] > 0.0 and nodes[node].seen != mark:
            nodes[node].seen = mark
            store.node[n.visits] = origin_of(kinds, node)
            store.reach[n.visits] = chance_at(kinds, node, alive)
            n.visits += 1
        if has_kinds(kinds) and credit_of(kinds, node) == AT_THIS_DEPOT:
            uncredited = credit_carried(
                kinds, layer, store.node, store.reach, uncredited, n.visits, alive
            )
    if has_kinds(kinds):  # what is carried at the end is lost
        credit_carried(kinds, layer, store.node, store.reach, uncredited, n.visits, 0.0)
    n.arcs += length
    added.end_arc, added.n_visits = n.arcs, n.visits - added.first_visit
    added.alive, added.n_users, added.hash = alive, 1, 0
    return int(trail)


@helper
def add_within_limits(search: Search, robot: int, length: int) -> int:
    """Store a trail as ``add_trail`` does; return ``NOT_STORED`` if it does not keep the limits."""
    graph, store, work, limits = search.graph, search.store, search.work, search.limits
    source, walked = start_of(graph.kinds, graph.base, robot), 0.0
    if limits.max_length < np.inf:
        for i in range(length):
            walked += graph.length[work.child[i]]
    trail = add_trail(graph, store, work, robot, length)
    is_safe = store.trails[trail].alive >= limit_at(limits.min_survival, limits.floors, source)
    if is_safe and walked <= limit_at(limits.max_length, limits.budgets, source):
        return trail
    discard(store, trail)
    return NOT_STORED


@helper
def evaluate_trails(graph: Graph, store: TrailStore, work: Workspace) -> tuple[float, float]:
    """Return E[R] and E[S] of the plan in ``work.trails``, with the bits of ``evaluate``."""
    team = work.team
    begin_team(team)
    if not has_kinds(graph.kinds):
        combine(team, graph.base, 1.0)
    survivors = 0.0
    for k in range(work.trails.shape[0]):
        trail = store.trails[work.trails[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            combine(team, np.int64(store.node[i]), store.reach[i])
        survivors += trail.alive
    return team_reward(graph, team), survivors


@helper
def insert(
    store: TrailStore,
    front: OrderedFront,
    trails: OffsetArray,
    reward: float,
    survivors: float,
    tolerance: float,
) -> bool:
    """Insert a plan into the front, and remove those that it dominates.

    It enters only if no plan of the front is as good, but for a relative ``tolerance``. Returns
    whether it has entered.
    """
    if best_reward(front, survivors * (1.0 - tolerance)) >= reward * (1.0 - tolerance):
        return False
    no_more = survivors * (1.0 + TOLERANCE)  # survivors, but for rounding
    while True:
        block, place = find_dominated(front, reward, no_more)
        if block < 0:
            break
        slot = remove_place(front, block, place)
        for k in range(front.plan.shape[1]):
            release(store, front.plan[slot, k])
    slot = add_place(front, reward, survivors)
    for k in range(trails.shape[0]):
        front.plan[slot, k] = trails[k]
        store.trails[trails[k]].n_users += 1
    return True


@helper
def insert_trails(search: Search, tolerance: float) -> None:
    """Insert the plan of ``work.trails`` into the front, as ``insert`` does."""
    store, work = search.store, search.work
    # Arcs are numbered by tail, then by head: the order by arcs is that by nodes.
    starts, stops = store.trails["first_arc"], store.trails["end_arc"]
    first, n_robots = 0, work.trails.shape[0]
    while first < n_robots:  # a kind after another
        stop = behind_kind(search.graph.kinds, n_robots, first)
        sort_trails(store.arc, starts, stops, work.trails[first:stop])
        first = stop
    reward, survivors = evaluate_trails(search.graph, store, work)
    if insert(store, search.front, work.trails, reward, survivors, tolerance):
        work.memory.newest, work.memory.idle = survivors, 0
