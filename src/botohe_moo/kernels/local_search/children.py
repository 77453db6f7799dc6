"""Children of a trail: new arcs joined between a prefix and a suffix of it, and what they gain.

Safest paths join what a move has chosen. Where a child would use an arc twice, the loop in between
is cut out, so that every child is a trail, on any graph.
"""

import numpy as np

from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.fronts.ordered import OrderedFront, best_reward
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.routes import UNKNOWN, Routes, route_entry, search_routes
from botohe_moo.kernels.local_search.trail_store import TrailStore
from botohe_moo.kernels.local_search.workspace import TOLERANCE, SearchRule, Workspace
from botohe_moo.kernels.rng import uniform

# How much more likely a step leads to a node that is worth something than to another.
_FRESH = 4.0


@helper
def _take_arc(work: Workspace, arc: int) -> None:
    """Let the child take an arc; if it has taken it before, the loop in between is cut out."""
    draft, arcs = work.draft, work.arcs
    taken = arcs[arc]
    if 0 <= taken.position < draft.prefix:
        draft.prefix, draft.middle = taken.position + 1, 0
        draft.mark += 1
    elif taken.mark == draft.mark:
        for i in range(taken.place + 1, draft.middle):
            arcs[work.middle[i]].mark = -1
        draft.middle = taken.place + 1
    else:
        taken.mark, taken.place = draft.mark, draft.middle
        work.middle[draft.middle] = arc
        draft.middle += 1


@helper
def _is_taken(work: Workspace, arc: int) -> bool:
    draft, taken = work.draft, work.arcs[arc]
    kept = taken.position >= 0 and (taken.position < draft.prefix or taken.position >= draft.suffix)
    return bool(kept or taken.mark == draft.mark)


@helper
def _way_round(graph: Graph, routes: Routes, work: Workspace, goal: int, here: int) -> int:
    """Return the arc from here, not taken yet, from which the goal is reached the safest; or −1."""
    least = np.inf
    best = -1
    for arc in range(graph.first[here], graph.first[here + 1]):
        if _is_taken(work, arc):
            continue
        entry = route_entry(routes, goal, graph.head[arc])
        if entry == UNKNOWN:
            continue
        cost = graph.cost[arc] + routes.entries[goal, entry].cost
        if cost < least:
            least, best = cost, arc
    return best


@helper
def _follow(
    graph: Graph, routes: Routes, work: Workspace, here: int, goal: int, n_detours: int
) -> bool:
    """Let the child take the safest path to a node; False where none is known.

    Up to ``n_detours`` times it leaves that path where an arc is taken already; not on the way to
    the base of a large mission, which is kept apart from the others.
    """
    straight_home = goal == graph.base and routes.entries.shape[1] < routes.entries.shape[0]
    entry = 0
    if not straight_home:
        if routes.n_known[goal] == 0:
            search_routes(graph, routes, goal)
        entry = route_entry(routes, goal, here)
        if entry == UNKNOWN:
            return False
    while here != goal:
        if straight_home:
            arc = graph.homeward[here]
        else:
            arc = routes.entries[goal, entry].arc
            entry = routes.entries[goal, entry].onward
            if n_detours > 0 and _is_taken(work, arc):
                n_detours -= 1
                other = _way_round(graph, routes, work, goal, here)
                if other >= 0:
                    arc = other
                    entry = route_entry(routes, goal, graph.head[arc])
        _take_arc(work, arc)
        here = graph.head[arc]
    return True


@helper
def _take_steps(graph: Graph, work: Workspace, here: int, n_steps: int) -> int:
    """Let the child walk along drawn arcs, preferably to where there is something to collect.

    Returns the node that it comes to; it stops early where all arcs are taken.
    """
    for _ in range(n_steps):
        total = 0.0
        drawn = -1
        for arc in range(graph.first[here], graph.first[here + 1]):
            if _is_taken(work, arc):
                continue
            node = work.nodes[graph.head[arc]]
            weight = _FRESH if node.left > 0.0 and node.met > work.draft.prefix else 1.0
            total += weight
            if uniform(work.states, 0) * total < weight:
                drawn = arc
        if drawn < 0:
            break
        _take_arc(work, drawn)
        here = graph.head[drawn]
    return here


@helper
def join_child(graph: Graph, routes: Routes, work: Workspace, n_steps: int, n_detours: int) -> bool:
    """Make the child that a move has chosen; False where there is none, or it equals the trail.

    Behind the prefix it takes ``n_steps`` steps, visits the goals, and takes the piece.
    """
    draft = work.draft
    draft.middle = 0
    draft.mark += 1
    here, end = work.steps[draft.prefix].node, work.steps[draft.suffix].node
    if n_steps > 0:
        here = _take_steps(graph, work, here, n_steps)
    for i in range(draft.goals + 1):
        goal = work.goals[i] if i < draft.goals else end
        if not _follow(graph, routes, work, here, goal, n_detours):
            return False
        here = goal
        if i == draft.goals - 1:
            for j in range(draft.piece):
                _take_arc(work, work.piece[j])
                here = graph.head[work.piece[j]]
    return _meet_suffix(work)


@helper
def _meet_suffix(work: Workspace) -> bool:
    """Cut out the loop in between where the suffix has an arc of the middle; tell a new child."""
    draft, middle = work.draft, work.middle
    again = -1
    for i in range(draft.middle):
        position = work.arcs[middle[i]].position
        if position >= draft.suffix:
            draft.suffix = position + 1
            again = i
    if again >= 0:
        draft.middle = again + 1
    if draft.middle != draft.suffix - draft.prefix:
        return True
    for i in range(draft.middle):  # noqa: SIM110 - any() would make a generator
        if middle[i] != work.steps[draft.prefix + i].arc:
            return True
    return False


@helper
def write_child(work: Workspace) -> int:
    """Write the child's arcs; return how many there are."""
    draft, child = work.draft, work.child
    for i in range(draft.prefix):
        child[i] = work.steps[i].arc
    n = draft.prefix
    for i in range(draft.middle):
        child[n] = work.middle[i]
        n += 1
    for i in range(draft.suffix, draft.length):
        child[n] = work.steps[i].arc
        n += 1
    return int(n)


@helper
def appraise(graph: Graph, front: OrderedFront, work: Workspace, rule: SearchRule) -> float:
    """Return what the robot gains by a child, if this enters the front; −1 if it does not."""
    draft, steps, nodes = work.draft, work.steps, work.nodes
    draft.mark += 1
    mark, prefix, suffix, length = draft.mark, draft.prefix, draft.suffix, draft.length
    alive, gained = steps[prefix].alive, steps[prefix].gained
    for i in range(draft.middle):
        arc = work.middle[i]
        alive *= graph.survival[arc]
        node = nodes[graph.head[arc]]
        if node.met > prefix and node.seen != mark:
            node.seen = mark
            gained += node.left * alive
    ratio = alive / steps[suffix].alive
    home = steps[length].alive * ratio
    if home < rule.min_survival:
        return -1.0
    if rule.max_length < np.inf:
        walked = steps[prefix].walked + steps[length].walked - steps[suffix].walked
        for i in range(draft.middle):
            walked += graph.length[work.middle[i]]
        if walked > rule.max_length:
            return -1.0
    needed = best_reward(front, (draft.survivors + home) * (1.0 - TOLERANCE))
    bound = (draft.others + gained + alive * steps[suffix].ahead) * (1.0 + TOLERANCE)
    if needed >= bound:
        return -1.0
    for i in range(suffix + 1, length + 1):
        node = nodes[steps[i].node]
        if node.met > prefix and node.seen != mark:
            node.seen = mark
            gained += node.left * steps[i].alive * ratio
    return float(gained) if (draft.others + gained) * (1.0 - TOLERANCE) > needed else -1.0


@helper
def appraise_trail(store: TrailStore, front: OrderedFront, work: Workspace, trail: int) -> float:
    """Return the same as ``appraise`` for a child in which the robot takes a stored trail."""
    draft, taken = work.draft, store.trails[trail]
    gained = 0.0
    for i in range(taken.first_visit, taken.first_visit + taken.n_visits):
        gained += work.nodes[store.node[i]].left * store.reach[i]
    needed = best_reward(front, (draft.survivors + taken.alive) * (1.0 - TOLERANCE))
    return gained if (draft.others + gained) * (1.0 - TOLERANCE) > needed else -1.0
