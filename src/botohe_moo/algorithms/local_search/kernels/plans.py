"""Plans of the front: made parents, laid out for children to be made of them, and inserted.

The trails of all robots but one are fixed. To that robot a node is worth its marginal reward, so
that the rest of the search sees a single robot. A child keeps a prefix of its trail, goes on along
new arcs, and ends with a suffix of it. Its E[S] follows from three products, and its E[R] is
bounded before the suffix is walked.
"""

import numpy as np

from botohe_moo.algorithms.local_search.kernels import state
from botohe_moo.algorithms.local_search.kernels.state import Search, TrailStore, Workspace
from botohe_moo.base.types import OffsetArray
from botohe_moo.core import ordered
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.evaluate import begin_plan, combine, expected_reward
from botohe_moo.core.ordered import OrderedFront
from botohe_moo.core.rng import GOLDEN, below, hash_step, mixed, uniform
from botohe_moo.core.walk import sort_trails, walk
from botohe_moo.core.world import (
    AT_NEXT_DEPOT,
    AT_THIS_DEPOT,
    Returns,
    World,
    aboard_at,
    aboard_of,
    credit_of,
    keeps,
    layer_of,
)

# The probability that the next parent is the plan that has just entered the front.
P_NEWEST = 0.9
# The search is stuck when no plan has entered the front within this many evaluations.
PATIENCE = 2_000


@helper
def pop_newest(work: Workspace) -> float:
    """Return E[S] of the plan that entered the front last, if it is the next parent; else −1."""
    newest = work.memory.newest
    work.memory.newest = -1.0
    return newest if newest >= 0.0 and uniform(work.states, 0) < P_NEWEST else -1.0


@helper
def is_stuck(work: Workspace) -> bool:
    """Return whether no plan has entered the front for long."""
    return bool(work.memory.idle > PATIENCE)


@helper
def acquire_parent(search: Search, place: int) -> None:
    """Make a plan of the front the parent, and draw the robot that changes."""
    store, front, work = search.store, search.front, search.work
    draft, parent = work.draft, work.parent
    slot = front.order[place]
    for k in range(parent.shape[0]):
        parent[k] = front.plan[slot, k]
        store.trails[parent[k]].n_users += 1
    draft.place, draft.at, draft.n_chosen = place, front.slots[slot].survivors, 0
    draft.robot = below(work.states, parent.shape[0])


@inlined
def draw_table(search: Search) -> None:
    """Draw the table of paths that the parent's children are made with."""
    n_nodes = search.world.graph.reward.shape[0]
    n_tables = search.routes.near.shape[0] // n_nodes
    drawn = below(search.work.states, n_tables) if n_tables > 1 else 0
    search.work.draft.table = drawn * n_nodes


@helper
def release_parent(search: Search) -> None:
    """Release the parent's trails, and leave nodes as they were before ``evaluate_others``."""
    clear_others(search.world, search.work)
    for k in range(search.work.parent.shape[0]):
        state.release(search.store, search.work.parent[k])


@helper
def evaluate_others(world: World, store: TrailStore, work: Workspace) -> None:
    """Compute what the parent's other robots collect, and the marginal rewards that are left."""
    draft, nodes, touched, first = work.draft, work.nodes, work.touched, work.cases[0].first
    draft.n_touched, draft.survivors, draft.others = 0, 0.0, 0.0
    draft.layer = layer_of(world.team, world.team.start[draft.robot])
    for k in range(work.parent.shape[0]):
        if _is_changed(work, k):
            continue
        trail = store.trails[work.parent[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            index, reach = np.int64(store.node[i]), store.reach[i]
            node = nodes[first + index]
            if node.unreached < 0.0:
                node.unreached = 1.0
                touched[draft.n_touched] = first + index
                draft.n_touched += 1
            # As a sum: small chances would lose their digits in the reward less what is left.
            draft.others += world.team.worth[index] * node.unreached * reach
            node.unreached *= 1.0 - reach
        draft.survivors += trail.alive
    for i in range(draft.n_touched):
        index, unreached = draft.layer + touched[i], nodes[touched[i]].unreached
        nodes[index].marginal = work.alone[index] * unreached
        if first > 0:
            node = nodes[index % first]
            node.marginal = max(0.0, node.marginal - work.alone[index] * (1.0 - unreached))
    _load(world, work)


@helper
def _load(world: World, work: Workspace) -> None:
    """Note what changed robots carry from the start; on the way it counts no more."""
    nodes, cases = work.nodes, work.cases
    for scenario in range(cases.shape[0]):
        cases[scenario].aboard = 0.0
    for k in range(work.parent.shape[0]):
        first, stop = aboard_of(world.returns, k) if _is_changed(work, k) else (0, 0)
        for i in range(first, stop):
            index = aboard_at(world.returns, work.draft.layer, i)
            for scenario in range(cases.shape[0]):
                node = nodes[cases[scenario].first + index]
                cases[scenario].aboard += node.marginal
                node.marginal = 0.0
            nodes[index].marginal = 0.0


@inlined
def _is_changed(work: Workspace, robot: int) -> bool:
    """Return whether a robot's trail is to be changed."""
    found: bool = robot == work.draft.robot
    for i in range(1, work.draft.n_chosen):
        found |= robot == work.chosen[i]
    return found


@helper
def clear_others(world: World, work: Workspace) -> None:
    """Leave nodes as they were before ``evaluate_others``."""
    draft, nodes, shift = work.draft, work.nodes, work.cases[0].first
    for i in range(draft.n_touched):
        index = draft.layer + work.touched[i]
        nodes[index].marginal = work.alone[index]
        nodes[work.touched[i]].unreached = -1.0
        if shift > 0:
            nodes[index % shift].marginal = work.alone[index % shift]
    for k in range(work.parent.shape[0]):
        first, stop = aboard_of(world.returns, k) if _is_changed(work, k) else (0, 0)
        for i in range(first, stop):
            index = aboard_at(world.returns, draft.layer, i)
            while index < nodes.shape[0]:
                nodes[index].marginal = work.alone[index]
                index += world.graph.reward.shape[0]


@helper
def lay_out(
    world: World, returns: Returns | None, store: TrailStore, work: Workspace, trail: int
) -> None:
    """Compute the steps of the trail that is to be changed; ``clear_trail`` undoes it."""
    start, length = store.trails[trail].first_arc, store.trails[trail].n_arcs
    work.draft.length = length
    for scenario in range(work.cases.shape[0]):
        _lay_out(world, returns, store, work, start, scenario)
        _look_ahead(returns, work, scenario)
    for i in range(length, -1, -1) if work.cases[0].first > 0 else range(0):
        work.nodes[work.steps[0, i].node].met = i


@inlined
def _lay_out(
    world: World,
    returns: Returns | None,
    store: TrailStore,
    work: Workspace,
    start: int,
    scenario: int,
) -> None:
    """Compute the steps in a scenario of a trail whose arcs begin at ``start``."""
    graph, steps, nodes = world.graph, work.steps[scenario], work.nodes
    survival, first = graph.survival[scenario], work.cases[scenario].first
    source = world.team.start[work.draft.robot]
    nodes[first + source].met = 0
    alive, walked, carried = 1.0, 0.0, work.cases[scenario].aboard
    marginal = nodes[first + source].marginal
    gained, carried = collect(returns, source, marginal, 1.0, 0.0, carried)
    steps[0].node, steps[0].alive, steps[0].gained, steps[0].walked = source, 1.0, gained, 0.0
    if returns is not None:
        work.loads[scenario, 0].carried = carried
    for i in range(work.draft.length):
        arc = np.int64(store.arc[start + i])
        head, worth = graph.head[arc], 0.0
        steps[i].arc = arc
        work.arcs[arc].position = i
        after = steps[i + 1]
        after.survival = survival[arc]
        alive *= after.survival
        walked += graph.length[arc]
        node = nodes[first + head]
        if node.met == state.NEVER:
            node.met, worth = i + 1, node.marginal
        gained, carried = collect(returns, head, worth, alive, gained, carried)
        if returns is not None:
            work.loads[scenario, i + 1].carried = carried
        after.node, after.alive, after.gained, after.walked = head, alive, gained, walked


@inlined
def collect(
    returns: Returns | None, node: int, worth: float, alive: float, gained: float, carried: float
) -> tuple[float, float]:
    """Return what is gained and carried once a robot is at a node, with probability ``alive``.

    ``worth`` is the node's marginal reward at the first visit, else 0.
    """
    credit = credit_of(returns, node)
    if credit == AT_NEXT_DEPOT:
        carried += worth
    else:
        gained += worth * alive
    if credit == AT_THIS_DEPOT:
        gained, carried = gained + carried * alive, 0.0
    return gained, carried


@helper
def _look_ahead(returns: Returns | None, work: Workspace, scenario: int) -> None:
    """Compute, backwards, what a robot that starts at each position would collect from there on.

    Where a node comes again later, only its earlier visit counts; both count where nobody gets.
    """
    steps, nodes, length = work.steps[scenario], work.nodes, work.draft.length
    first = work.cases[scenario].first
    ahead, to_depot, home = 0.0, 0.0, 1.0
    steps[length].ahead, steps[length].home = ahead, home
    if returns is not None:
        work.loads[scenario, length].to_depot = to_depot
    for i in range(length - 1, -1, -1):
        after = steps[i + 1]
        node = nodes[first + after.node]
        if node.later > 0.0:
            ahead -= node.later / after.alive
        credit, worth = credit_of(returns, after.node), node.marginal
        survival = after.survival
        if credit == AT_NEXT_DEPOT:
            worth *= to_depot
        node.later = worth * after.alive
        ahead = survival * (ahead + worth)
        home *= survival
        steps[i].ahead, steps[i].home = ahead, home
        if returns is not None:
            to_depot = survival if credit == AT_THIS_DEPOT else survival * to_depot
            work.loads[scenario, i].to_depot = to_depot


@helper
def clear_trail(work: Workspace, n_nodes: int) -> None:
    """Leave the workspace as it was before ``lay_out``, on a graph of ``n_nodes`` nodes."""
    nodes, steps, length = work.nodes, work.steps[0], work.draft.length
    for i in range(length):
        work.arcs[steps[i].arc].position = -1
    for first in range(0, nodes.shape[0], n_nodes):
        for i in range(length + 1):
            node = nodes[first + steps[i].node]
            node.met, node.later = state.NEVER, 0.0


@helper
def add_trail(search: Search, robot: int, length: int) -> int:
    """Store a robot's trail of the first ``length`` arcs in ``work.child``; return its number.

    It has one user. The store must have room. ``NOT_STORED`` is returned where the trail does not
    keep the robot's limits.
    """
    world, store, work = search.world, search.store, search.work
    n, visits = store.n, work.visits
    graph, team = world.graph, world.team
    n_visits, alive, walked = walk(graph, team, world.returns, work.child, length, robot, visits)
    if not keeps(world.limits, robot, alive, walked):
        return state.NOT_STORED
    n.spare -= 1
    trail = store.spare[n.spare]
    added = store.trails[trail]
    added.first_arc, added.n_arcs, added.end_arc = n.arcs, length, n.arcs + length
    added.first_visit, added.n_visits = n.visits, n_visits
    added.alive, added.n_users = alive, 1
    bits = GOLDEN ^ np.uint64(team.start[robot])
    for i in range(length):
        store.arc[n.arcs + i] = work.child[i]
        bits = hash_step(bits, work.child[i])
    added.hash = mixed(bits)
    for i in range(n_visits):
        store.node[n.visits + i], store.reach[n.visits + i] = visits.node[i], visits.chance[i]
    n.arcs += length
    n.visits += n_visits
    return int(trail)


@helper
def evaluate_trails(world: World, store: TrailStore, work: Workspace) -> tuple[float, float]:
    """Return E[R] and E[S] of the plan in ``work.trails``, with the bits of ``evaluate``."""
    reached, survivors = work.reached, 0.0
    begin_plan(reached)
    for k in range(work.trails.shape[0]):
        trail = store.trails[work.trails[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            combine(reached, np.int64(store.node[i]), store.reach[i])
        survivors += trail.alive
    return expected_reward(world.team.worth, reached), survivors


@helper
def remove_plan(store: TrailStore, front: OrderedFront, place: int) -> None:
    """Remove a plan from the front, and release its trails."""
    slot = ordered.remove_place(front, place)
    for k in range(front.plan.shape[1]):
        state.release(store, front.plan[slot, k])


@helper
def _insert(
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
    if ordered.best_reward(front, survivors * (1.0 - tolerance)) >= reward * (1.0 - tolerance):
        return False
    no_more = survivors * (1.0 + state.TOLERANCE)  # survivors, but for rounding
    place = ordered.find_dominated(front, reward, no_more)
    while place >= 0:
        remove_plan(store, front, place)
        place = ordered.find_dominated(front, reward, no_more)
    slot = ordered.add_place(front, reward, survivors)
    for k in range(trails.shape[0]):
        front.plan[slot, k] = trails[k]
        store.trails[trails[k]].n_users += 1
    return True


@helper
def insert_trails(search: Search, tolerance: float) -> bool:
    """Insert the plan of ``work.trails`` into the front, as ``_insert`` does."""
    store, work, stop_of = search.store, search.work, search.world.team.stop
    # Arcs are numbered by tail, then by head: the order by arcs is that by nodes.
    starts, stops = store.trails["first_arc"], store.trails["end_arc"]
    first, n_robots = 0, work.trails.shape[0]
    while first < n_robots:  # a kind after another
        stop = stop_of[first]
        sort_trails(store.arc, starts, stops, work.trails[first:stop])
        first = stop
    reward, survivors = evaluate_trails(search.world, store, work)
    entered = _insert(store, search.front, work.trails, reward, survivors, tolerance)
    if entered:
        work.memory.newest, work.memory.idle = survivors, 0
        work.draft.place = ordered.nearest_place(search.front, work.draft.at)
    return entered
