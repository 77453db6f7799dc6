"""Moves of the Pareto local search: each cuts a trail somewhere and reconnects it.

A move chooses a prefix and a suffix of the trail, nodes to visit between them, and a piece of arcs
to take after these; safest paths join them. Where a child would use an arc twice, the loop in
between is cut out, so that every child is a trail, on any graph.
"""

import numpy as np

from botohe_moo._base.types import SeedArray
from botohe_moo.kernels.compile import helper, inlined
from botohe_moo.kernels.fronts.ordered import OrderedFront, best_reward, draw_place
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.routes import (
    UNKNOWN,
    Routes,
    route_entry,
    search_near,
    search_routes,
)
from botohe_moo.kernels.local_search.trail_store import TrailStore
from botohe_moo.kernels.local_search.workspace import TOLERANCE, SearchRule, Workspace
from botohe_moo.kernels.rng import uniform

# The kinds of moves, as indices into their weights; the first are numbers of nodes to visit.
SHORTCUT = 0
VISIT = 1
VISIT_TWO = 2
SPLICE = 3
GRAFT = 4
SWAP_LOOPS = 5
REVERSE = 6
ADOPT = 7
N_KINDS = 8

# How many nodes nearby are compared, at most, when one is chosen to be visited: one, two or three.
_MOST_COMPARED = 3

# How much rather a step leads to a node that is worth something than to another.
_FRESH = 4.0

# How often a path may go round an arc that is used already.
_MAX_DETOURS = 4


@inlined
def _below(states: SeedArray, n: int) -> int:
    return int(uniform(states, 0) * n)


@inlined
def _take_arc(work: Workspace, arc: int) -> None:
    """Let the child take an arc; when it has taken it before, what came in between goes."""
    now, arcs = work.now, work.arcs
    taken = arcs[arc]
    if 0 <= taken.position < now.prefix:
        now.prefix, now.middle = taken.position + 1, 0
        now.mark += 1
    elif taken.mark == now.mark:
        for i in range(taken.place + 1, now.middle):
            arcs[work.middle[i]].mark = -1
        now.middle = taken.place + 1
    else:
        taken.mark, taken.place = now.mark, now.middle
        work.middle[now.middle] = arc
        now.middle += 1


@inlined
def _is_taken(work: Workspace, arc: int) -> bool:
    now, taken = work.now, work.arcs[arc]
    kept = taken.position >= 0 and (taken.position < now.prefix or taken.position >= now.suffix)
    return bool(kept or taken.mark == now.mark)


@inlined
def _way_round(graph: Graph, routes: Routes, work: Workspace, goal: int, here: int) -> int:
    """Give the arc from here, not taken yet, from which the goal is reached the safest; or −1."""
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


@inlined
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


@inlined
def _draw_segment(work: Workspace, rule: SearchRule, n_short: int) -> None:
    """Draw a segment of the trail to cut out: short, or any."""
    now, states = work.now, work.states
    low = _below(states, now.length + 1)
    if uniform(states, 0) < rule.p_short:
        high = min(now.length, low + _below(states, n_short + 1))
    else:
        high = _below(states, now.length + 1)
    now.prefix, now.suffix = min(low, high), max(low, high)


@inlined
def _draw_visits(
    graph: Graph, routes: Routes, work: Workspace, rule: SearchRule, n_visits: int
) -> None:
    """Draw nodes to visit: the richest of a few nearby, by what others leave of it, or any."""
    states, near = work.states, routes.near
    here = work.steps[work.now.prefix].node
    n_near = near.shape[1]
    for i in range(n_visits):
        if uniform(states, 0) >= rule.p_near:
            here = _below(states, graph.reward.shape[0])
        else:
            if near[here, 0] < 0:
                search_near(graph, routes, here)
            best = near[here, _below(states, n_near)]
            for _ in range(_below(states, _MOST_COMPARED)):
                node = near[here, _below(states, n_near)]
                if work.nodes[node].left > work.nodes[best].left:
                    best = node
            here = best
        work.goals[i] = here
    work.now.goals = n_visits


@inlined
def _take_steps(graph: Graph, work: Workspace, here: int, n_steps: int) -> int:
    """Let the child walk along arcs drawn, rather to where there is something to collect.

    Gives the node that it comes to; it stops early where all arcs are taken.
    """
    for _ in range(n_steps):
        total = 0.0
        drawn = -1
        for arc in range(graph.first[here], graph.first[here + 1]):
            if _is_taken(work, arc):
                continue
            node = work.nodes[graph.head[arc]]
            weight = _FRESH if node.left > 0.0 and node.met > work.now.prefix else 1.0
            total += weight
            if uniform(work.states, 0) * total < weight:
                drawn = arc
        if drawn < 0:
            break
        _take_arc(work, drawn)
        here = graph.head[drawn]
    return here


@inlined
def draw_trail(front: OrderedFront, work: Workspace, rule: SearchRule) -> int:
    """Draw a trail of another plan: of one near the parent, or of any."""
    states = work.states
    if uniform(states, 0) < rule.p_neighbour:
        at = min(front.n.blocks - 1, max(0, work.now.at + _below(states, 3) - 1))
        place = _below(states, front.size[front.directory[at]])
    else:
        at, place = draw_place(front, states)
    slot = front.places[front.directory[at], place].slot
    return int(np.int64(front.plan[slot, _below(states, front.plan.shape[1])]))


@inlined
def _draw_piece(
    graph: Graph, store: TrailStore, work: Workspace, donor: int, to_end: bool, p_meet: float
) -> bool:
    """Draw a segment, or the end, of another trail in place of one of this.

    With probability ``p_meet`` they are joined where the trails meet, if they do at the node drawn.
    """
    now, states, nodes = work.now, work.states, work.nodes
    length, start, donated = now.length, store.trails[donor].first_arc, store.trails[donor].n_arcs
    if donated == 0:
        return False
    begin = _below(states, donated) + 1
    entrance = graph.head[store.arc[start + begin - 1]]
    low = _below(states, length + 1)
    if uniform(states, 0) < p_meet and nodes[entrance].met <= length:
        low = nodes[entrance].met
    end, high = donated, length
    if not to_end:
        end = begin + _below(states, donated - begin + 1)
        leaving = graph.head[store.arc[start + end - 1]]
        high = low + _below(states, length + 1 - low)
        if uniform(states, 0) < p_meet and low <= nodes[leaving].met <= length:
            high = nodes[leaving].met
    now.prefix, now.suffix = low, high
    work.goals[0], now.goals = entrance, 1
    for i in range(begin, end):
        work.piece[i - begin] = store.arc[start + i]
    now.piece = end - begin
    return True


@inlined
def _draw_reversed(graph: Graph, work: Workspace, rule: SearchRule) -> bool:
    """Draw a segment to walk the other way round.

    Croes, "A method for solving traveling-salesman problems", Operations Research 6(6), 1958. Where
    the segment is a loop it stays one.
    """
    now, steps = work.now, work.steps
    _draw_segment(work, rule, rule.n_short + 2)
    low, high = now.prefix, now.suffix
    if high < low + 2:
        return False
    work.goals[0], now.goals = steps[high - 1].node, 1
    for i in range(high - 2, low, -1):
        arc = graph.reverse[steps[i].arc]
        if arc < 0:
            return False
        work.piece[high - 2 - i] = arc
    now.piece = high - 2 - low
    return True


@inlined
def _draw_loops(work: Workspace) -> bool:
    """Draw two loops, one after the other at a node, to change places: survival stays as it is."""
    now, steps = work.now, work.steps
    low = _below(work.states, now.length + 1)
    middle = high = -1
    for i in range(low + 1, now.length + 1):
        if steps[i].node == steps[low].node:
            if middle >= 0:
                high = i
                break
            middle = i
    if high < 0:
        return False
    now.prefix, now.suffix = low, high
    work.goals[0], now.goals = steps[low].node, 1
    now.piece = high - low
    for i in range(low, high):
        later = i - low + high - middle if i < middle else i - middle
        work.piece[later] = steps[i].arc
    return True


@inlined
def change(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    kind: int,
) -> bool:
    """Make a child by a move; False where there is none, or it equals the trail."""
    now, states = work.now, work.states
    n_detours = _MAX_DETOURS if uniform(states, 0) < rule.p_detour else 0
    n_steps = now.goals = now.piece = 0
    made = True
    if kind <= VISIT_TWO:
        _draw_segment(work, rule, rule.n_short)
        n_visits = kind
        while 1 < n_visits < work.goals.shape[0] and uniform(states, 0) < rule.p_more:
            n_visits += 1
        if n_visits > 0 and uniform(states, 0) < rule.p_step:
            n_steps = n_visits
        else:
            _draw_visits(graph, routes, work, rule, n_visits)
    elif kind == SWAP_LOOPS:
        made = _draw_loops(work)
    elif kind == REVERSE:
        made = _draw_reversed(graph, work, rule)
    else:
        donor = draw_trail(front, work, rule)
        made = _draw_piece(graph, store, work, donor, kind == SPLICE, rule.p_meet)
    if not made:
        return False
    now.middle = 0
    now.mark += 1
    here, end = work.steps[now.prefix].node, work.steps[now.suffix].node
    if n_steps > 0:
        here = _take_steps(graph, work, here, n_steps)
    for i in range(now.goals + 1):
        goal = work.goals[i] if i < now.goals else end
        if not _follow(graph, routes, work, here, goal, n_detours):
            return False
        here = goal
        if i == now.goals - 1:
            for j in range(now.piece):
                _take_arc(work, work.piece[j])
                here = graph.head[work.piece[j]]
    return _meet_suffix(work)


@inlined
def _meet_suffix(work: Workspace) -> bool:
    """Cut out the loop in between where the suffix has an arc of the middle; tell a new child."""
    now, middle = work.now, work.middle
    again = -1
    for i in range(now.middle):
        position = work.arcs[middle[i]].position
        if position >= now.suffix:
            now.suffix = position + 1
            again = i
    if again >= 0:
        now.middle = again + 1
    if now.middle != now.suffix - now.prefix:
        return True
    for i in range(now.middle):  # noqa: SIM110 - any() would make a generator
        if middle[i] != work.steps[now.prefix + i].arc:
            return True
    return False


@helper
def write_child(work: Workspace) -> int:
    """Write the child's arcs; give how many there are."""
    now, child = work.now, work.child
    for i in range(now.prefix):
        child[i] = work.steps[i].arc
    n = now.prefix
    for i in range(now.middle):
        child[n] = work.middle[i]
        n += 1
    for i in range(now.suffix, now.length):
        child[n] = work.steps[i].arc
        n += 1
    return int(n)


@inlined
def appraise(
    graph: Graph,
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    others: float,
    survivors: float,
) -> tuple[float, float]:
    """Give what the robot gains by a child, and survives, if this enters the front; −1 if not.

    ``others`` and ``survivors`` are E[R] and E[S] of the other robots.
    """
    now, steps, nodes = work.now, work.steps, work.nodes
    now.mark += 1
    mark, prefix, suffix, length = now.mark, now.prefix, now.suffix, now.length
    alive, gained = steps[prefix].alive, steps[prefix].gained
    for i in range(now.middle):
        arc = work.middle[i]
        alive *= graph.survival[arc]
        node = nodes[graph.head[arc]]
        if node.met > prefix and node.seen != mark:
            node.seen = mark
            gained += node.left * alive
    ratio = alive / steps[suffix].alive
    home = steps[length].alive * ratio
    if home < rule.min_survival:
        return -1.0, home
    needed = best_reward(front, (survivors + home) * (1.0 - TOLERANCE))
    bound = (others + gained + alive * steps[suffix].ahead) * (1.0 + TOLERANCE)
    if needed >= bound:
        return -1.0, home
    for i in range(suffix + 1, length + 1):
        node = nodes[steps[i].node]
        if node.met > prefix and node.seen != mark:
            node.seen = mark
            gained += node.left * steps[i].alive * ratio
    return (gained if (others + gained) * (1.0 - TOLERANCE) > needed else -1.0), home


@inlined
def adopt(
    store: TrailStore,
    front: OrderedFront,
    work: Workspace,
    trail: int,
    others: float,
    survivors: float,
) -> tuple[float, float]:
    """Give the same as ``appraise`` for a child that takes a stored trail."""
    taken = store.trails[trail]
    gained = 0.0
    for i in range(taken.first_visit, taken.first_visit + taken.n_visits):
        gained += work.nodes[store.node[i]].left * store.reach[i]
    needed = best_reward(front, (survivors + taken.alive) * (1.0 - TOLERANCE))
    return (gained if (others + gained) * (1.0 - TOLERANCE) > needed else -1.0), taken.alive
