"""Tours of robots that are refilled: the best nodes are inserted where they cost least.

A tour is the stops of one robot's trail, in order: the nodes that it visits for their reward. A leg
leads from each stop to the next, along the cheapest path.
"""

import numpy as np

from botohe_moo.algorithms.local_search.kernels.children import connect_child, write_child
from botohe_moo.algorithms.local_search.kernels.plans import NOT_STORED, add_within_limits
from botohe_moo.algorithms.local_search.kernels.routes import Routes, search_costs
from botohe_moo.algorithms.local_search.kernels.trail_store import TrailStore
from botohe_moo.algorithms.local_search.kernels.workspace import TOLERANCE, Search, Workspace
from botohe_moo.core.compile import helper
from botohe_moo.core.graph import Graph, limit_at
from botohe_moo.core.kinds import (
    AT_NEXT_DEPOT,
    AT_THIS_DEPOT,
    Kinds,
    aboard_at,
    aboard_of,
    credit_of,
    end_of,
    has_kinds,
    has_returns,
    n_origins,
    start_of,
)
from botohe_moo.core.rng import below, uniform

NONE = -1  # instead of a leg or a node
# Instead of a node's cheapest leg, where that has been split and the next has to be found. Until
# then the node's last insertion cost is a lower bound.
UNKNOWN = -1

# Smaller costs count as this much, since worth is divided by them.
_LEAST_COST = 1e-300

# The probability that a tour may use up the limits; and by how much its danger may differ from the
# trail's otherwise, on the scale of logarithms.
P_FULL, SPREAD = 0.5, 0.6


@helper
def build_tour(search: Search, which: int) -> None:
    """Build a tour of some of the stops of a chosen robot's trail, which are marked as seen."""
    graph, routes, work = search.graph, search.routes, search.work
    draft, slack, goals = work.draft, work.slacks[which], work.goals
    _draw_slack(search, which)
    source = start_of(graph.kinds, graph.base, work.chosen[which])
    n = _draw_stops(graph, search.store, work, which, source)
    end = end_of(graph.kinds, graph.base, source)
    search_costs(graph, routes, source)
    work.nodes[source].seen = draft.mark
    begun, stopped = aboard_of(graph.kinds, work.chosen[which])
    for i in range(begun, stopped):
        work.nodes[aboard_at(graph.kinds, draft.layer, i)].seen = draft.mark
    stop, work.first[which] = source, draft.n_legs
    for i in range(n + 1):
        is_last = i == n
        after = end if is_last else goals[i]
        search_costs(graph, routes, after)
        _set_leg(routes, work, draft.n_legs, stop, after)
        leg = work.legs[draft.n_legs]
        leg.following, leg.tour = NONE if is_last else draft.n_legs + 1, which
        slack.danger -= leg.danger
        slack.length -= leg.length
        work.nodes[after].seen = draft.mark
        draft.n_legs += 1
        stop = after


@helper
def _draw_slack(search: Search, which: int) -> None:
    """Draw how dangerous and how long a tour may get: about as the trail is, or up to the limits.

    Where there is a travel budget but no survival floor, danger may grow as much as length.
    """
    graph, store, work, limits = search.graph, search.store, search.work, search.limits
    slack, states = work.slacks[which], work.states
    trail = store.trails[work.parent[work.chosen[which]]]
    slack.danger, slack.length = -np.log(trail.alive), np.inf
    if trail.n_arcs == 0:  # the robot may leave the base, with a survival of 1 / e or more
        slack.danger = uniform(states, 0)
    slack.danger *= np.exp(SPREAD * (2.0 * uniform(states, 0) - 1.0))
    is_full = uniform(states, 0) < P_FULL
    source = start_of(graph.kinds, graph.base, work.chosen[which])
    longest = limit_at(limits.max_length, limits.budgets, source)
    least = limit_at(limits.min_survival, limits.floors, source)
    if longest < np.inf:
        length = 0.0
        for i in range(trail.first_arc, trail.end_arc):
            length += graph.length[store.arc[i]]
        slack.length = min(longest, length * (1.0 + SPREAD))
        if is_full:
            slack.length = longest
            # By a finite factor, so that a danger of 0 stays 0.
            slack.danger *= min(longest / max(length, _LEAST_COST), 1.0 / _LEAST_COST)
    if least > 0.0:
        most = -np.log(least)
        slack.danger = most if is_full else min(slack.danger, most)


@helper
def _draw_stops(graph: Graph, store: TrailStore, work: Workspace, which: int, source: int) -> int:
    """Draw which stops of a trail stay, write them to ``work.goals``, and return how many."""
    goals, states = work.goals, work.states
    trail = store.trails[work.parent[work.chosen[which]]]
    n = 0
    if has_returns(graph.kinds):
        n = _list_stops(graph, graph.kinds, store, work, which, source)
    else:
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            node = work.draft.layer + np.int64(store.node[i])
            if work.nodes[node].left > 0.0 and node != source:
                goals[n] = node
                n += 1
    if n == 0:
        return n
    share = uniform(states, 0)
    n_removed = 1 + int((n - 1) * share * share)  # mostly few
    in_a_row = uniform(states, 0) < 0.5
    first = below(states, n - n_removed + 1)
    for _ in range(n_removed):
        n -= 1
        removed = first if in_a_row else below(states, n + 1)
        for i in range(removed, n):
            goals[i] = goals[i + 1]
    return n


@helper
def _list_stops(
    graph: Graph,
    kinds: Kinds | None,
    store: TrailStore,
    work: Workspace,
    which: int,
    source: int,
) -> int:
    """List the stops of a trail, with the depots where it leaves something, as ``_draw_stops``."""
    if kinds is None:  # of an argument: then numba compiles nothing of what follows
        return 0
    goals, layer = work.goals, work.draft.layer
    trail = store.trails[work.parent[work.chosen[which]]]
    first, stop = aboard_of(kinds, work.chosen[which])
    n, visit, end = 0, trail.first_visit + stop - first, trail.first_visit + trail.n_visits
    is_loaded = stop > first
    if visit < end and layer + store.node[visit] == source:
        visit += 1
        is_loaded = is_loaded or credit_of(kinds, source) == AT_NEXT_DEPOT
    for i in range(trail.first_arc, trail.end_arc):
        node, is_first = graph.head[store.arc[i]], False
        if visit < end and layer + store.node[visit] == node:
            is_first = work.nodes[node].left > 0.0
            visit += 1
        credit = credit_of(kinds, node)
        if is_first or (is_loaded and credit == AT_THIS_DEPOT):
            goals[n] = node
            n += 1
            is_loaded = credit == AT_NEXT_DEPOT or (is_loaded and credit != AT_THIS_DEPOT)
    if n > 0 and goals[n - 1] == end_of(kinds, graph.base, source):  # where the tour ends anyway
        n -= 1
    return n


@helper
def _set_leg(routes: Routes, work: Workspace, number: int, before: int, after: int) -> None:
    """Set the two stops of a leg, and compute what it costs."""
    leg = work.legs[number]
    leg.before, leg.after = before, after
    leg.cost, leg.length = routes.leaving[before, after], 0.0
    leg.danger = leg.cost
    if routes.per_length > 0.0:
        leg.length = routes.leaving_length[before, after]
        leg.danger -= routes.per_length * leg.length
    leg.survival = np.exp(-leg.danger)


@helper
def fill_tours(search: Search) -> None:
    """Insert nodes that are not marked into the tours until no more fit.

    What each is worth is what the other robots leave of its reward, lowered at random.
    """
    graph, routes, work = search.graph, search.routes, search.work
    draft, nodes, worth, legs = work.draft, work.nodes, work.worth, work.legs
    states, first = work.states, draft.layer
    behind = first + n_origins(graph.kinds, graph.reward.shape[0])
    cheapest = work.cheapest_leg[first:behind]
    noise = uniform(states, 0)
    for node in range(first, behind):
        work.insertion_cost[node], worth[node] = np.inf, 0.0
        if nodes[node].left > 0.0 and nodes[node].seen != draft.mark:
            worth[node] = nodes[node].left * (1.0 - noise * uniform(states, 0))
    for number in range(draft.n_legs):
        _update_insertion_costs(graph, routes, work, number)
    for which in range(draft.n_chosen):
        _evaluate_tour(graph, work, which)
    while True:
        best = _find_best_node(graph, routes, work)
        if best == NONE:
            break
        search_costs(graph, routes, best)
        number = work.cheapest_leg[best]
        _insert_node(routes, work, number, best)
        worth[best] = 0.0
        for i in range(cheapest.shape[0]):
            cheapest[i] = UNKNOWN if cheapest[i] == number else cheapest[i]
        _update_insertion_costs(graph, routes, work, number)
        _update_insertion_costs(graph, routes, work, draft.n_legs - 1)
        _evaluate_tour(graph, work, legs[number].tour)


@helper
def _update_insertion_costs(graph: Graph, routes: Routes, work: Workspace, number: int) -> None:
    """Compute what it costs to insert each node into a leg, and note whether that is least."""
    n, first = n_origins(graph.kinds, graph.reward.shape[0]), work.draft.layer
    leg = work.legs[number]
    # The part of each array that belongs to the layer: indices that begin at 0 are faster.
    costs, cheapest = work.insertion_cost[first : first + n], work.cheapest_leg[first : first + n]
    leaving = routes.leaving[leg.before][first : first + n]
    coming = routes.coming[leg.after][first : first + n]
    leg_cost = leg.cost
    for node in range(n):
        cost = leaving[node] + coming[node] - leg_cost
        is_less = cost < costs[node]
        costs[node] = cost if is_less else costs[node]
        cheapest[node] = number if is_less else cheapest[node]


@helper
def _evaluate_tour(graph: Graph, work: Workspace, which: int) -> None:
    """Compute with what probability each leg of a tour is begun, and what lies ahead of it."""
    legs, loads, order, nodes = work.legs, work.leg_loads, work.goals, work.nodes
    n, alive, carried, kinds = 0, 1.0, 0.0, graph.kinds
    first, stop = aboard_of(kinds, work.chosen[which])
    for i in range(first, stop):
        carried += nodes[aboard_at(kinds, work.draft.layer, i)].left
    number = work.first[which]
    while number != NONE:
        leg = legs[number]
        order[n] = number
        n += 1
        leg.alive = alive
        alive *= leg.survival
        if has_kinds(kinds):
            credit = credit_of(kinds, leg.before)
            carried = 0.0 if credit == AT_THIS_DEPOT else carried
            carried += nodes[leg.before].left if credit == AT_NEXT_DEPOT else 0.0
            loads[order[n - 1]].carried = carried
        number = leg.following
    ahead = to_depot = 0.0
    for i in range(n - 1, -1, -1):
        leg = legs[order[i]]
        leg.ahead = ahead * leg.survival
        worth = nodes[leg.before].left
        if has_kinds(kinds):
            is_depot = credit_of(kinds, leg.after) == AT_THIS_DEPOT
            to_depot = leg.survival if is_depot else leg.survival * to_depot
            loads[order[i]].to_depot = to_depot
            worth *= to_depot if credit_of(kinds, leg.before) == AT_NEXT_DEPOT else 1.0
        ahead = leg.ahead + worth


@helper
def _find_best_node(graph: Graph, routes: Routes, work: Workspace) -> int:
    """Return the node that fits and has the largest gain per insertion cost, or ``NONE``.

    A node gains its worth, less what the danger of the detour takes from the stops after it. For
    small costs c, 1 / (1 + c) takes the place of exp(−c).
    """
    legs, loads, best, highest = work.legs, work.leg_loads, NONE, 0.0
    n, first = n_origins(graph.kinds, graph.reward.shape[0]), work.draft.layer
    costs, worth = work.insertion_cost[first : first + n], work.worth[first : first + n]
    cheapest = work.cheapest_leg[first : first + n]
    for i in range(n):
        if worth[i] <= highest * costs[i]:
            continue
        node = first + i
        if cheapest[i] == UNKNOWN:
            _find_cheapest_leg(graph, routes, work, node)
        leg, cost = legs[cheapest[i]], max(costs[i], _LEAST_COST)
        slack, way = work.slacks[leg.tour], routes.leaving[leg.before, node]
        danger = cost
        if routes.per_length > 0.0:
            length = routes.leaving_length[leg.before, node]
            longer = length + routes.coming_length[leg.after, node] - leg.length
            if longer > slack.length:
                continue
            way -= routes.per_length * length
            danger = max(0.0, cost - routes.per_length * longer)
        if danger > slack.danger + TOLERANCE:
            continue
        gain = leg.alive * (worth[i] / (1.0 + way) - leg.ahead * danger / (1.0 + danger))
        if has_kinds(graph.kinds):
            load = loads[cheapest[i]]
            if credit_of(graph.kinds, node) == AT_NEXT_DEPOT:
                paid = worth[i] * load.to_depot / (1.0 + danger)
                gain = leg.alive * (paid - leg.ahead * danger / (1.0 + danger))
            gain -= leg.alive * load.carried * load.to_depot * danger / (1.0 + danger)
        if gain > highest * cost:
            best, highest = node, gain / cost
    return best


@helper
def _find_cheapest_leg(graph: Graph, routes: Routes, work: Workspace, node: int) -> None:
    """Find the leg where inserting a node costs least."""
    search_costs(graph, routes, node)
    leaving, coming = routes.leaving[node], routes.coming[node]
    least, cheapest = np.inf, 0
    for number in range(work.draft.n_legs):
        leg = work.legs[number]
        cost = coming[leg.before] + leaving[leg.after] - leg.cost
        cheapest = number if cost < least else cheapest
        least = min(least, cost)
    work.insertion_cost[node], work.cheapest_leg[node] = least, cheapest


@helper
def _insert_node(routes: Routes, work: Workspace, number: int, node: int) -> None:
    """Split a leg in two by a node; the second is the last one of ``work.legs`` then."""
    legs, added = work.legs, work.draft.n_legs
    leg, slack = legs[number], work.slacks[legs[number].tour]
    slack.danger += leg.danger
    slack.length += leg.length
    legs[added].following, legs[added].tour = leg.following, leg.tour
    leg.following = added
    _set_leg(routes, work, added, node, leg.after)
    _set_leg(routes, work, number, leg.before, node)
    slack.danger -= leg.danger + legs[added].danger
    slack.length -= leg.length + legs[added].length
    work.draft.n_legs += 1


@helper
def store_tour(search: Search, which: int) -> int:
    """Store the trail of a tour's cheapest paths, and return its number.

    Where it does not keep the limits, the robot keeps its trail.
    """
    graph, store, work = search.graph, search.store, search.work
    draft, legs = work.draft, work.legs
    robot = work.chosen[which]
    source = start_of(graph.kinds, graph.base, robot)
    # It replaces a trail that goes from its start straight to its end.
    draft.n_goals = draft.n_piece = draft.prefix = 0
    draft.suffix = draft.length = 1
    work.steps[0].arc = NONE
    work.steps[0].node, work.steps[1].node = source, end_of(graph.kinds, graph.base, source)
    number = work.first[which]
    while legs[number].following != NONE:
        work.goals[draft.n_goals] = legs[number].after
        draft.n_goals += 1
        number = legs[number].following
    trail = NOT_STORED
    if connect_child(search, 0, 0):
        trail = add_within_limits(search, robot, write_child(work))
    if trail == NOT_STORED:
        trail = work.parent[robot]
        store.trails[trail].n_users += 1
    return int(trail)
