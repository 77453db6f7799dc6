"""Tours of robots that are refilled: the best nodes are put in where they cost least.

A tour is the stops of one robot's trail, in order: the nodes that it visits for their reward. A leg
leads from each stop to the next, along the cheapest path.
"""

import numpy as np

from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.children import join_child, write_child
from botohe_moo.kernels.local_search.insertion import add_trail
from botohe_moo.kernels.local_search.routes import Routes, search_costs
from botohe_moo.kernels.local_search.trail_store import TrailStore, take_back
from botohe_moo.kernels.local_search.workspace import TOLERANCE, SearchRule, Workspace
from botohe_moo.kernels.rng import below, uniform

# Instead of a leg or a node: there is none.
NONE = -1
# Instead of a leg: that where a node cost least is gone, and it costs as much or more elsewhere.
UNSURE = -1

# What costs less, −log of a survival, counts as this much, for worth to be divided by it.
_LEAST_COST = 1e-300

# With what probability there is room up to the limits; otherwise danger may differ from that of
# the trail by as much as this, on the scale of logarithms.
P_FULL, SPREAD = 0.5, 0.6


@helper
def _lay_leg(
    routes: Routes, work: Workspace, number: int, before: int, after: int, then: int
) -> None:
    """Lay a leg from one stop to the next, which another leg leaves then."""
    leg = work.legs[number]
    leg.before, leg.after, leg.then = before, after, then
    leg.cost, leg.length = routes.leaving[before, after], 0.0
    leg.danger = leg.cost
    if routes.has_lengths:
        leg.length = routes.leaving_length[before, after]
        leg.danger -= routes.per_length * leg.length
    leg.survival = np.exp(-leg.danger)


@helper
def _offer(graph: Graph, routes: Routes, work: Workspace, number: int) -> None:
    """Let all nodes come into a leg, if they cost less there than elsewhere."""
    extra, place, leg = work.extra, work.place, work.legs[number]
    cost = leg.cost
    leaving, coming = routes.leaving[leg.before], routes.coming[leg.after]
    for node in range(graph.reward.shape[0]):
        more = leaving[node] + coming[node] - cost
        is_less = more < extra[node]
        extra[node] = more if is_less else extra[node]
        place[node] = number if is_less else place[node]


@helper
def _look(graph: Graph, routes: Routes, work: Workspace, node: int) -> None:
    """Find the leg where a node costs least."""
    search_costs(graph, routes, node)
    leaving, coming = routes.leaving[node], routes.coming[node]
    least, best = np.inf, 0
    for number in range(work.draft.legs):
        leg = work.legs[number]
        more = coming[leg.before] + leaving[leg.after] - leg.cost
        best = number if more < least else best
        least = min(least, more)
    work.extra[node], work.place[node] = least, best


@helper
def _give_room(
    graph: Graph, store: TrailStore, work: Workspace, rule: SearchRule, which: int
) -> None:
    """Draw how dangerous and how long a tour may get: about as the trail is, or up to the limits.

    Where there is a travel budget but no floor, danger may grow as the length does.
    """
    room, states = work.rooms[which], work.states
    trail = store.trails[work.parent[work.chosen[which]]]
    room.danger, room.length = -np.log(trail.alive), np.inf
    if trail.n_arcs == 0:  # the robot may leave: down to a survival of 1 / e
        room.danger = uniform(states, 0)
    room.danger *= np.exp(SPREAD * (2.0 * uniform(states, 0) - 1.0))
    is_full = uniform(states, 0) < P_FULL
    if rule.max_length < np.inf:
        length = 0.0
        for i in range(trail.first_arc, trail.first_arc + trail.n_arcs):
            length += graph.length[store.arc[i]]
        room.length = min(rule.max_length, length * (1.0 + SPREAD))
        if is_full:
            room.length = rule.max_length
            # At most finite: a trail without danger gets no room for any.
            room.danger *= min(rule.max_length / max(length, _LEAST_COST), 1.0 / _LEAST_COST)
    if rule.min_survival > 0.0:
        most = -np.log(rule.min_survival)
        room.danger = most if is_full else min(room.danger, most)


@helper
def _draw_stops(store: TrailStore, work: Workspace, which: int) -> int:
    """Write those stops of a trail that are not dropped to ``work.goals``; return how many."""
    goals, states = work.goals, work.states
    trail = store.trails[work.parent[work.chosen[which]]]
    n = 0
    for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
        node = np.int64(store.node[i])
        if work.nodes[node].left > 0.0:
            goals[n] = node
            n += 1
    if n == 0:
        return n
    share = uniform(states, 0)
    n_dropped = 1 + int((n - 1) * share * share)  # mostly few
    in_a_row = uniform(states, 0) < 0.5
    at = below(states, n - n_dropped + 1)
    for _ in range(n_dropped):
        n -= 1
        at = at if in_a_row else below(states, n + 1)
        for i in range(at, n):
            goals[i] = goals[i + 1]
    return n


@helper
def open_tour(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    work: Workspace,
    rule: SearchRule,
    which: int,
    mark: int,
) -> None:
    """Make a tour of the stops of a trail, some of which are dropped."""
    draft, room, goals = work.draft, work.rooms[which], work.goals
    _give_room(graph, store, work, rule, which)
    n = _draw_stops(store, work, which)
    search_costs(graph, routes, graph.base)
    here, work.first[which] = graph.base, draft.legs
    for i in range(n + 1):
        is_last = i == n
        there = graph.base if is_last else goals[i]
        search_costs(graph, routes, there)
        _lay_leg(routes, work, draft.legs, here, there, NONE if is_last else draft.legs + 1)
        leg = work.legs[draft.legs]
        leg.tour = which
        room.danger -= leg.danger
        room.length -= leg.length
        work.nodes[there].seen = mark
        draft.legs += 1
        here = there


@helper
def _walk_tour(work: Workspace, which: int) -> None:
    """Note with what probability each leg of a tour is begun, and what is expected from then on."""
    legs, order, nodes = work.legs, work.goals, work.nodes
    n, alive = 0, 1.0
    number = work.first[which]
    while number != NONE:
        leg = legs[number]
        order[n] = number
        n += 1
        leg.alive = alive
        alive *= leg.survival
        number = leg.then
    ahead = 0.0
    for i in range(n - 1, -1, -1):
        leg = legs[order[i]]
        leg.ahead = ahead * leg.survival
        ahead = leg.ahead + nodes[leg.before].left


@helper
def _best_node(graph: Graph, routes: Routes, work: Workspace) -> int:
    """Return the node that gains most for its cost of those that there is room for; or ``NONE``.

    What a node gains is its worth, less what the danger on the way to it and back takes from the
    stops behind it; for a small cost c, 1 / (1 + c) is used for exp(−c).
    """
    extra, worth, place, legs = work.extra, work.worth, work.place, work.legs
    leaving, rooms = routes.leaving, work.rooms
    best, most = NONE, 0.0
    for node in range(graph.reward.shape[0]):
        if worth[node] <= most * extra[node]:
            continue
        if place[node] == UNSURE:
            _look(graph, routes, work, node)
        leg, more = legs[place[node]], max(extra[node], _LEAST_COST)
        room, there = rooms[leg.tour], leaving[leg.before, node]
        danger = more
        if routes.has_lengths:
            way = routes.leaving_length[leg.before, node]
            longer = way + routes.coming_length[leg.after, node] - leg.length
            if longer > room.length:
                continue
            there -= routes.per_length * way
            danger = max(0.0, more - routes.per_length * longer)
        if danger > room.danger + TOLERANCE:
            continue
        gain = leg.alive * (worth[node] / (1.0 + there) - leg.ahead * danger / (1.0 + danger))
        if gain > most * more:
            best, most = node, gain / more
    return best


@helper
def fill_tours(graph: Graph, routes: Routes, work: Workspace, mark: int) -> None:
    """Put nodes into the tours as long as there is room; their worth is lowered by chance."""
    draft, nodes, place, worth, legs = work.draft, work.nodes, work.place, work.worth, work.legs
    states, n_nodes = work.states, graph.reward.shape[0]
    noise = uniform(states, 0)
    for node in range(n_nodes):
        work.extra[node], worth[node] = np.inf, 0.0
        if nodes[node].left > 0.0 and nodes[node].seen != mark:
            worth[node] = nodes[node].left * (1.0 - noise * uniform(states, 0))
    for number in range(draft.legs):
        _offer(graph, routes, work, number)
    for which in range(draft.chosen):
        _walk_tour(work, which)
    while True:
        best = _best_node(graph, routes, work)
        if best == NONE:
            break
        number, new = place[best], draft.legs
        leg, room = legs[number], work.rooms[legs[number].tour]
        room.danger += leg.danger
        room.length += leg.length
        search_costs(graph, routes, best)
        _lay_leg(routes, work, new, best, leg.after, leg.then)
        _lay_leg(routes, work, number, leg.before, best, new)
        legs[new].tour = leg.tour
        room.danger -= leg.danger + legs[new].danger
        room.length -= leg.length + legs[new].length
        draft.legs += 1
        worth[best] = 0.0
        for node in range(n_nodes):
            place[node] = UNSURE if place[node] == number else place[node]
        _offer(graph, routes, work, number)
        _offer(graph, routes, work, new)
        _walk_tour(work, leg.tour)


@helper
def store_tour(
    graph: Graph, routes: Routes, store: TrailStore, work: Workspace, rule: SearchRule, which: int
) -> int:
    """Store a trail along the cheapest paths of a tour, and give its number.

    Where it does not keep the limits, it is that of the robot as it was.
    """
    draft, legs = work.draft, work.legs
    draft.goals = draft.piece = draft.length = draft.prefix = draft.suffix = 0
    work.steps[0].node = graph.base
    number = work.first[which]
    while legs[number].then != NONE:
        work.goals[draft.goals] = legs[number].after
        draft.goals += 1
        number = legs[number].then
    join_child(graph, routes, work, 0, 0)
    n = write_child(work)
    length = 0.0
    if rule.max_length < np.inf:
        for i in range(n):
            length += graph.length[work.child[i]]
    trail = add_trail(graph, store, work, n)
    if store.trails[trail].alive < rule.min_survival or length > rule.max_length:
        take_back(store, trail)
        trail = work.parent[work.chosen[which]]
        store.trails[trail].n_users += 1
    return trail
