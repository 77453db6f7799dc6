"""Children of a trail: new arcs between a prefix and a suffix of it, and what they gain.

Safest paths join what a move has chosen. Where a child would use an arc twice, the loop in between
is cut out, so that every child is a trail, on any graph.
"""

import numpy as np

from botohe_moo.algorithms.local_search.kernels.plans import collect
from botohe_moo.algorithms.local_search.kernels.routes import UNKNOWN, route_entry
from botohe_moo.algorithms.local_search.kernels.state import TOLERANCE, Search, Workspace
from botohe_moo.core.compile import helper
from botohe_moo.core.ordered import best_reward
from botohe_moo.core.rng import uniform
from botohe_moo.core.world import Graph, Returns

# The weight of a step to a node with something to collect, beside 1 for a step to another.
_FRESH = 4.0


@helper
def _append_arc(work: Workspace, arc: int) -> None:
    """Append an arc to the child; if it has the arc already, cut out the loop in between."""
    draft, arcs = work.draft, work.arcs
    used = arcs[arc]
    if 0 <= used.position < draft.prefix:
        draft.prefix, draft.n_middle = used.position + 1, 0
        draft.mark += 1
    elif used.mark == draft.mark:
        for i in range(used.place + 1, draft.n_middle):
            arcs[work.middle[i]].mark = -1
        draft.n_middle = used.place + 1
    else:
        used.mark, used.place = draft.mark, draft.n_middle
        work.middle[draft.n_middle] = arc
        draft.n_middle += 1


@helper
def _is_used(work: Workspace, arc: int) -> bool:
    """Return whether the child has an arc."""
    draft, used = work.draft, work.arcs[arc]
    kept = used.position >= 0 and (used.position < draft.prefix or used.position >= draft.suffix)
    return bool(kept or used.mark == draft.mark)


@helper
def _append_path(search: Search, node: int, goal: int) -> bool:
    """Append the safest path between two nodes; return whether one is known.

    On large missions, ways to the base are stored apart from other paths.
    """
    graph, routes, work = search.world.graph, search.routes, search.work
    is_end, n_entries = goal == search.world.team.end[goal], routes.entries.shape[1]
    is_homeward = is_end and n_entries < routes.entries.shape[0]
    entry = 0 if is_homeward else route_entry(routes, goal, node)
    if entry == UNKNOWN:
        return False
    while node != goal:
        if is_homeward:
            arc = search.world.ways.homeward[node]
        else:
            arc = routes.entries[goal, entry].arc
            entry = routes.entries[goal, entry].onward
        _append_arc(work, arc)
        node = graph.head[arc]
    return True


@helper
def _append_steps(graph: Graph, work: Workspace, node: int, n_steps: int) -> int:
    """Append arcs drawn at random, preferably to nodes with something to collect.

    Returns the node where they end. It stops early at a node where all arcs are used.
    """
    for _ in range(n_steps):
        total = 0.0
        drawn = -1
        for arc in range(graph.first[node], graph.first[node + 1]):
            if _is_used(work, arc):
                continue
            head = work.nodes[graph.head[arc]]
            weight = _FRESH if head.marginal > 0.0 and head.met > work.draft.prefix else 1.0
            total += weight
            if uniform(work.states, 0) * total < weight:
                drawn = arc
        if drawn < 0:
            break
        _append_arc(work, drawn)
        node = graph.head[drawn]
    return node


@helper
def connect_child(search: Search) -> bool:
    """Write the child's new arcs; return whether there is a child that differs from the trail.

    From the prefix it takes ``n_steps`` random steps, visits the goals, takes the piece, and goes
    on to the suffix.
    """
    graph, work = search.world.graph, search.work
    draft = work.draft
    draft.n_middle = 0
    draft.mark += 1
    node, end = work.steps[draft.prefix].node, work.steps[draft.suffix].node
    if draft.n_steps > 0:
        node = _append_steps(graph, work, node, draft.n_steps)
    for i in range(draft.n_goals + 1):
        goal = work.goals[i] if i < draft.n_goals else end
        if not _append_path(search, node, goal):
            return False
        node = goal
        if i == draft.n_goals - 1:
            for j in range(draft.n_piece):
                _append_arc(work, work.piece[j])
                node = graph.head[work.piece[j]]
    return _join_suffix(work)


@helper
def _join_suffix(work: Workspace) -> bool:
    """Cut out loops between the new arcs and the suffix, where they have an arc in common.

    Returns whether the child is a new trail.
    """
    draft, middle = work.draft, work.middle
    last = -1
    for i in range(draft.n_middle):
        position = work.arcs[middle[i]].position
        if position >= draft.suffix:
            draft.suffix = position + 1
            last = i
    if last >= 0:
        draft.n_middle = last + 1
    if draft.n_middle != draft.suffix - draft.prefix:
        return True
    for i in range(draft.n_middle):  # noqa: SIM110 - any() would make a generator
        if middle[i] != work.steps[draft.prefix + i].arc:
            return True
    return False


@helper
def write_child(work: Workspace) -> int:
    """Write all arcs of the child to ``work.child``; return how many there are."""
    draft, child = work.draft, work.child
    for i in range(draft.prefix):
        child[i] = work.steps[i].arc
    n = draft.prefix
    for i in range(draft.n_middle):
        child[n] = work.middle[i]
        n += 1
    for i in range(draft.suffix, draft.length):
        child[n] = work.steps[i].arc
        n += 1
    return int(n)


@helper
def evaluate_child(search: Search, returns: Returns | None) -> float:
    """Return what the robot collects by the child; −1 if the child cannot enter the front."""
    graph, limits, front, work = search.world.graph, search.world.limits, search.front, search.work
    draft, steps, nodes = work.draft, work.steps, work.nodes
    draft.mark += 1
    mark, prefix, suffix, length = draft.mark, draft.prefix, draft.suffix, draft.length
    carried = 0.0
    alive, gained = steps[prefix].alive, steps[prefix].gained
    if returns is not None:
        carried = work.loads[prefix].carried
    for i in range(draft.n_middle):
        arc = work.middle[i]
        alive *= graph.survival[arc]
        node, worth = nodes[graph.head[arc]], 0.0
        if node.met > prefix and node.seen != mark:
            node.seen, worth = mark, node.marginal
        gained, carried = collect(returns, graph.head[arc], worth, alive, gained, carried)
    ratio = alive / steps[suffix].alive
    home = steps[length].alive * ratio
    if home < limits.floors[draft.robot]:
        return -1.0
    if limits.has_budgets:
        walked = steps[prefix].walked + steps[length].walked - steps[suffix].walked
        for i in range(draft.n_middle):
            walked += graph.length[work.middle[i]]
        if walked > limits.budgets[draft.robot]:
            return -1.0
    needed = best_reward(front, (draft.survivors + home) * (1.0 - TOLERANCE))
    ahead = steps[suffix].ahead
    if returns is not None:
        ahead += carried * work.loads[suffix].to_depot
    bound = (draft.others + gained + alive * ahead) * (1.0 + TOLERANCE)
    if needed >= bound:
        return -1.0
    for i in range(suffix + 1, length + 1):
        node, worth = nodes[steps[i].node], 0.0
        if node.met > prefix and node.seen != mark:
            node.seen, worth = mark, node.marginal
        there = steps[i].alive * ratio
        gained, carried = collect(returns, steps[i].node, worth, there, gained, carried)
    return float(gained) if (draft.others + gained) * (1.0 - TOLERANCE) > needed else -1.0


@helper
def evaluate_trail(search: Search, trail: int) -> float:
    """Return what the robot collects by a stored trail; −1 if that child cannot enter the front."""
    reward, store, work = search.world.team.reward, search.store, search.work
    draft, nodes, taken = work.draft, work.nodes, store.trails[trail]
    gained = 0.0
    for i in range(taken.first_visit, taken.first_visit + taken.n_visits):
        node = np.int64(store.node[i])  # of the mission: the share is part of the reach
        gained += reward[node] * abs(nodes[node].unreached) * store.reach[i]
    needed = best_reward(search.front, (draft.survivors + taken.alive) * (1.0 - TOLERANCE))
    return gained if (draft.others + gained) * (1.0 - TOLERANCE) > needed else -1.0
