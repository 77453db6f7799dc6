"""Refilling trails: stops are dropped, and the best nodes put in where they cost least.

Ruin and recreate: Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking optimization
results using the ruin and recreate principle", Journal of Computational Physics 159(2), 2000. A
walk goes on from plans that are a little worse, less and less so: Dueck and Scheuer, "Threshold
accepting", Journal of Computational Physics 90(1), 1990.

A tour is the stops of one robot's trail, in order: the nodes that it visits for their reward. A leg
leads from each stop to the next, along the cheapest path.
"""

import numpy as np

from botohe_moo.kernels.compile import helper, inlined
from botohe_moo.kernels.fronts.ordered import OrderedFront, best_reward
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.admission import add_trail, enter_team, evaluate_trails
from botohe_moo.kernels.local_search.children import join_child, write_child
from botohe_moo.kernels.local_search.layout import clear_others, set_aside
from botohe_moo.kernels.local_search.routes import Routes, search_costs
from botohe_moo.kernels.local_search.trail_store import (
    TrailStore,
    comes_before,
    fits,
    release,
    take_back,
)
from botohe_moo.kernels.local_search.workspace import TOLERANCE, SearchRule, Workspace
from botohe_moo.kernels.rng import below, uniform

# Instead of a leg: none follows.
NONE = -1
# Instead of a leg: that where a node cost least is gone, and now it costs as much or more.
UNSURE = -1

# What costs less, −log of a survival, counts as this much, for worth to be divided by it.
_LEAST_COST = 1e-300


@inlined
def choose_robots(work: Workspace, rule: SearchRule) -> None:
    """Draw which robots are refilled together: the one at hand, or others with it."""
    now, chosen, states, n_robots = work.now, work.chosen, work.states, work.held.shape[0]
    for k in range(n_robots):
        chosen[k] = k
    chosen[now.robot], chosen[0] = 0, now.robot
    now.chosen = 1
    while now.chosen < n_robots and uniform(states, 0) < rule.p_pair:
        other = now.chosen + below(states, n_robots - now.chosen)
        chosen[now.chosen], chosen[other] = chosen[other], chosen[now.chosen]
        now.chosen += 1


@inlined
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


@inlined
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


@inlined
def _look(graph: Graph, routes: Routes, work: Workspace, node: int) -> None:
    """Find the leg where a node costs least."""
    search_costs(graph, routes, node)
    leaving, coming = routes.leaving[node], routes.coming[node]
    least, best = np.inf, 0
    for number in range(work.now.legs):
        leg = work.legs[number]
        more = coming[leg.before] + leaving[leg.after] - leg.cost
        best = number if more < least else best
        least = min(least, more)
    work.extra[node], work.place[node] = least, best


@inlined
def _give_room(
    graph: Graph, store: TrailStore, work: Workspace, rule: SearchRule, which: int
) -> None:
    """Draw how dangerous and how long a tour may get: about as the trail is, or up to the limits.

    Where there is a travel budget but no floor, danger may grow as the length does.
    """
    room, states = work.rooms[which], work.states
    trail = store.trails[work.held[work.chosen[which]]]
    room.danger, room.length = -np.log(trail.alive), np.inf
    if trail.n_arcs == 0:  # the robot may leave: down to a survival of 1 / e
        room.danger = uniform(states, 0)
    room.danger *= np.exp(rule.spread * (2.0 * uniform(states, 0) - 1.0))
    is_full = uniform(states, 0) < rule.p_full
    if rule.max_length < np.inf:
        length = 0.0
        for i in range(trail.first_arc, trail.first_arc + trail.n_arcs):
            length += graph.length[store.arc[i]]
        room.length = min(rule.max_length, length * (1.0 + rule.spread))
        if is_full:
            room.length = rule.max_length
            # At most finite: a trail without danger gets no room for any.
            room.danger *= min(rule.max_length / max(length, _LEAST_COST), 1.0 / _LEAST_COST)
    if rule.min_survival > 0.0:
        most = -np.log(rule.min_survival)
        room.danger = most if is_full else min(room.danger, most)


@inlined
def _draw_stops(store: TrailStore, work: Workspace, which: int) -> int:
    """Write those stops of a trail that are not dropped to ``work.goals``; give how many."""
    goals, states = work.goals, work.states
    trail = store.trails[work.held[work.chosen[which]]]
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
def _open_tour(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    work: Workspace,
    rule: SearchRule,
    which: int,
    mark: int,
) -> None:
    """Make a tour of the stops of a trail, some of which are dropped."""
    now, room, goals = work.now, work.rooms[which], work.goals
    _give_room(graph, store, work, rule, which)
    n = _draw_stops(store, work, which)
    search_costs(graph, routes, graph.base)
    here, work.first[which] = graph.base, now.legs
    for i in range(n + 1):
        is_last = i == n
        there = graph.base if is_last else goals[i]
        search_costs(graph, routes, there)
        _lay_leg(routes, work, now.legs, here, there, NONE if is_last else now.legs + 1)
        leg = work.legs[now.legs]
        leg.tour = which
        room.danger -= leg.danger
        room.length -= leg.length
        work.nodes[there].seen = mark
        now.legs += 1
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


@inlined
def _best_node(graph: Graph, routes: Routes, work: Workspace) -> int:
    """Give the node that gains most for its cost of those that there is room for; or ``NONE``.

    What a node gains is its worth, less what the danger on the way to it and back takes from the
    stops behind it; for a small cost c, 1 / (1 + c) stands for exp(−c).
    """
    extra, worth, legs = work.extra, work.worth, work.legs
    best, most = NONE, 0.0
    for node in range(graph.reward.shape[0]):
        if worth[node] <= most * extra[node]:
            continue
        if work.place[node] == UNSURE:
            _look(graph, routes, work, node)
        leg, more = legs[work.place[node]], max(extra[node], _LEAST_COST)
        room, there = work.rooms[leg.tour], routes.leaving[leg.before, node]
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
def _fill_tours(graph: Graph, routes: Routes, work: Workspace, mark: int) -> None:
    """Put nodes into the tours as long as there is room; their worth is lowered by chance."""
    now, nodes, place, worth, legs = work.now, work.nodes, work.place, work.worth, work.legs
    states, n_nodes = work.states, graph.reward.shape[0]
    noise = uniform(states, 0)
    for node in range(n_nodes):
        work.extra[node], worth[node] = np.inf, 0.0
        if nodes[node].left > 0.0 and nodes[node].seen != mark:
            worth[node] = nodes[node].left * (1.0 - noise * uniform(states, 0))
    for number in range(now.legs):
        _offer(graph, routes, work, number)
    for which in range(now.chosen):
        _walk_tour(work, which)
    while True:
        best = _best_node(graph, routes, work)
        if best == NONE:
            break
        number, new = place[best], now.legs
        leg, room = legs[number], work.rooms[legs[number].tour]
        room.danger += leg.danger
        room.length += leg.length
        search_costs(graph, routes, best)
        _lay_leg(routes, work, new, best, leg.after, leg.then)
        _lay_leg(routes, work, number, leg.before, best, new)
        legs[new].tour = leg.tour
        room.danger -= leg.danger + legs[new].danger
        room.length -= leg.length + legs[new].length
        now.legs += 1
        worth[best] = 0.0
        for node in range(n_nodes):
            place[node] = UNSURE if place[node] == number else place[node]
        _offer(graph, routes, work, number)
        _offer(graph, routes, work, new)
        _walk_tour(work, leg.tour)


@helper
def _store_tour(
    graph: Graph, routes: Routes, store: TrailStore, work: Workspace, rule: SearchRule, which: int
) -> int:
    """Store a trail along the cheapest paths of a tour, and give its number.

    Where it does not keep the limits, it is that of the robot as it was.
    """
    now, legs = work.now, work.legs
    now.goals = now.piece = now.length = now.prefix = now.suffix = 0
    work.steps[0].node = graph.base
    number = work.first[which]
    while legs[number].then != NONE:
        work.goals[now.goals] = legs[number].after
        now.goals += 1
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
        trail = work.held[work.chosen[which]]
        store.trails[trail].n_users += 1
    return trail


@helper
def _hold_in_order(store: TrailStore, work: Workspace) -> bool:
    """Write the child's trails to ``work.trails``; tell whether it is another plan."""
    is_new = False
    for k in range(work.held.shape[0]):
        trail = work.refilled[k]
        is_new = is_new or trail != work.held[k]
        place = k
        while place > 0 and comes_before(store, trail, work.trails[place - 1]):
            work.trails[place] = work.trails[place - 1]
            place -= 1
        work.trails[place] = trail
    return is_new


@helper
def _make_child(
    graph: Graph, routes: Routes, store: TrailStore, work: Workspace, rule: SearchRule
) -> bool:
    """Refill the chosen robots together; tell whether that makes another plan.

    Its trails are in ``work.refilled``, by robot, and in ``work.trails``, in order.
    """
    now = work.now
    now.mark += 1
    mark, now.legs = now.mark, 0
    for which in range(now.chosen):
        _open_tour(graph, routes, store, work, rule, which, mark)
    _fill_tours(graph, routes, work, mark)
    for k in range(work.held.shape[0]):
        work.refilled[k] = work.held[k]
    for which in range(now.chosen):
        trail = _store_tour(graph, routes, store, work, rule, which)
        work.refilled[work.chosen[which]] = trail
    return _hold_in_order(store, work)


@helper
def _value(graph: Graph, store: TrailStore, work: Workspace) -> float:
    """Give what the plan that is held is worth to a walk."""
    for k in range(work.held.shape[0]):
        work.trails[k] = work.held[k]
    reward, survivors = evaluate_trails(graph, store, work)
    return float(reward + work.now.slope * survivors)


@helper
def refill(
    graph: Graph,
    routes: Routes,
    store: TrailStore,
    front: OrderedFront,
    work: Workspace,
    rule: SearchRule,
    n_most: int,
) -> int:
    """Make children of the parent by refilling, and give how many.

    Either ``n_refills`` children of the parent, or a walk, which goes on from each child that loses
    no more than allowed of E[R] and E[S], weighed as the front weighs them at the parent.
    """
    now, memory, n_robots = work.now, work.memory, work.held.shape[0]
    p_walk = rule.p_walk if memory.idle > rule.busy else 0.0
    if p_walk > 0.0:
        p_walk = max(p_walk, 1.0 / front.n.plans)
    is_walk = uniform(work.states, 0) < p_walk
    n_steps = min(n_most, rule.n_walk * graph.reward.shape[0] if is_walk else rule.n_refills)
    value = _value(graph, store, work) if is_walk else 0.0
    for step in range(n_steps):
        if not fits(graph, store, n_robots) or front.n.spare < 2:
            return step
        if is_walk and step > 0:
            clear_others(graph, work)
            now.robot = below(work.states, n_robots)
            choose_robots(work, rule)
            set_aside(graph, store, work)
        goes_on = False
        memory.idle += 1
        if _make_child(graph, routes, store, work, rule):
            reward, survivors = evaluate_trails(graph, store, work)
            needed = best_reward(front, survivors * (1.0 - TOLERANCE))
            if reward * (1.0 - TOLERANCE) > needed:
                enter_team(store, front, work, reward, survivors)
            child = reward + now.slope * survivors
            allowed = rule.threshold * (1.0 - step / n_steps)
            goes_on = is_walk and child >= value * (1.0 - allowed)
            value = child if goes_on else value
        for which in range(now.chosen - 1, -1, -1):
            robot = work.chosen[which]
            dropped = work.held[robot] if goes_on else work.refilled[robot]
            work.held[robot] = work.refilled[robot] if goes_on else work.held[robot]
            if goes_on:
                release(store, dropped)
            else:
                take_back(store, dropped)
    return n_steps
