"""Ruin and recreate: some stops of some robots are removed, and the best nodes inserted instead.

A tour is the stops of one robot's trail, in order: the nodes that it visits for their reward. A leg
leads from each stop to the next, along the cheapest path. Nodes are inserted where they cost least.

Schrimpf, Schneider, Stamm-Wilbrandt and Dueck, "Record breaking optimization results using the
ruin and recreate principle", Journal of Computational Physics 159(2), 2000. A walk goes on from
plans that are a little worse, less and less so: Dueck and Scheuer, "Threshold accepting", Journal
of Computational Physics 90(1), 1990.

It is a kernel of its own, which short runs need not compile.
"""

import math

import numpy as np

from botohe_moo.algorithms.local_search.kernels import plans, state
from botohe_moo.algorithms.local_search.kernels.moves import connect_child, write_child
from botohe_moo.algorithms.local_search.kernels.state import Search, Workspace
from botohe_moo.core.compile import at_once, helper, shared, ticks
from botohe_moo.core.ordered import nearest_place, slope_at
from botohe_moo.core.rng import below, uniform

NONE = -1  # instead of a leg or a node
# Instead of a node's cheapest leg, where that has been split and the next has to be found. Until
# then the node's last insertion cost is a lower bound.
UNKNOWN = -1

# Smaller costs count as this much, since worth is divided by them; and smaller survivals.
_LEAST_COST = _LEAST_SURVIVAL = 1e-300

# Costs differ by up to this at random, so that chance decides between legs into which a node may be
# inserted at the same cost. If it were always the first, fronts would be worse (10 000 evaluations
# on the power plant: 0.3382 instead of 0.3392).
SHUFFLED = 1e-12

# The probability that a tour may use up the limits; and by how much its danger may differ from the
# trail's otherwise, on the scale of logarithms.
P_FULL, SPREAD = 0.5, 0.6

# Where trails have limits, the probability that gains are squared before they are divided by costs,
# so that large rewards come before what is near.
P_SQUARED = 0.5

N_RECREATED = 4  # how many children a ruined plan has
# The probability that a second robot is changed together with the one drawn, that a third follows
# it, and so on.
P_PAIR = 0.7
# Once the search is stuck, the probability that the children are the steps of a walk instead, how
# many steps it has for each node of the mission, and which share of its value the plan may lose at
# the first step. Without walks, rewards on missions without danger were up to 5 % lower.
P_WALK, N_WALK, THRESHOLD = 0.08, 8, 0.05


@at_once(lambda search, n: 3e-6 * min(n, 128) * search.world.graph.n_nodes**2)
def recreate(search: Search, n_most: int) -> int:
    """Ruin and recreate plans that wait for it, and those that enter the front meanwhile.

    Returns how many children they had. These are fewer than ``n_most`` where no plan waits any
    more, or where there may be no room for another child.
    """
    search = shared(search)
    work, memory = search.work, search.work.memory
    tally = work.tallies[work.tallies.shape[0] - 1]
    n, before = 0, ticks()
    while n < n_most and memory.n_waiting > 0 and state.has_room(search):
        survivors = plans.pop_newest(work)
        if survivors < 0.0:
            memory.n_waiting -= 1
            survivors = work.waiting[memory.n_waiting]
        _select_robots(search, survivors)
        n += _recreate_parent(search, n_most - n)
        plans.release_parent(search)
    tally.tried += n
    tally.ticks += ticks() - before
    return n


@helper
def _select_robots(search: Search, survivors: float) -> None:
    """Make the plan with an E[S] the parent, draw robots to change, and evaluate the others.

    A walk weighs E[R] and E[S] as the front weighs them at the plan; at its end of most reward,
    only E[R] counts.
    """
    front, work, draft = search.front, search.work, search.work.draft
    place = nearest_place(front, survivors)
    plans.acquire_parent(search, place)
    found = front.slots[front.order[place]]
    found.tried += 1
    draft.slope = slope_at(front, place) if place > 0 else 0.0
    draft.value = found.reward + draft.slope * found.survivors
    plans.draw_table(search)
    _draw_robots(search)
    plans.evaluate_others(search.world, search.store, work)


@helper
def _draw_robots(search: Search) -> None:
    """Draw which robots change, of the kind of ``draft.robot``, and with it; see ``chosen``."""
    work, team = search.work, search.world.team
    draft, chosen, states = work.draft, work.chosen, work.states
    first = team.first[draft.robot]
    n_robots = team.stop[draft.robot] - first
    for k in range(n_robots):
        chosen[k] = first + k
    chosen[draft.robot - first], chosen[0] = first, draft.robot
    draft.n_chosen = 1
    while draft.n_chosen < n_robots and uniform(states, 0) < P_PAIR:
        other = draft.n_chosen + below(states, n_robots - draft.n_chosen)
        chosen[draft.n_chosen], chosen[other] = chosen[other], chosen[draft.n_chosen]
        draft.n_chosen += 1


@helper
def _recreate_parent(search: Search, n_most: int) -> int:
    """Make children of the parent, at most ``n_most``, insert them, and return how many.

    In a walk, a child that is not too bad is the next parent.
    """
    store, work = search.store, search.work
    n_nodes, tally = search.world.team.reward.shape[0], work.tallies[work.tallies.shape[0] - 1]
    is_walk = plans.is_stuck(work) and uniform(work.states, 0) < P_WALK
    n_children = min(n_most, N_WALK * n_nodes if is_walk else N_RECREATED)
    for child in range(n_children):
        if not state.has_room(search):
            return child
        if is_walk and child > 0:
            _draw_other_robots(search)
        work.memory.idle += 1
        is_next = False
        if _make_child(search):
            tally.entered += plans.insert_trails(search, state.TOLERANCE)
            is_next = is_walk and _is_good_enough(search, THRESHOLD * (1.0 - child / n_children))
        for which in range(work.draft.n_chosen - 1, -1, -1):
            robot = work.chosen[which]
            if is_next:
                state.release(store, work.parent[robot])
                work.parent[robot] = work.recreated[robot]
            else:
                state.release(store, work.recreated[robot])
    return n_children


@helper
def _draw_other_robots(search: Search) -> None:
    """Draw anew which robots of the parent change, and evaluate the others."""
    world, work = search.world, search.work
    plans.clear_others(world, work)
    work.draft.robot = below(work.states, work.parent.shape[0])
    _draw_robots(search)
    plans.evaluate_others(world, search.store, work)


@helper
def _is_good_enough(search: Search, loss: float) -> bool:
    """Return whether the child loses at most this share of its parent's value; note its own."""
    draft = search.work.draft
    reward, survivors = plans.evaluate_trails(search.world, search.store, search.work)
    value = reward + draft.slope * survivors
    if value < draft.value * (1.0 - loss):
        return False
    draft.value = value
    return True


@helper
def _make_child(search: Search) -> bool:
    """Recreate the tours of the chosen robots together; return whether that makes another plan.

    Its trails are in ``work.recreated``, by robot, and in ``work.trails``.
    """
    work, draft = search.work, search.work.draft
    draft.mark += 1
    draft.n_legs = 0
    for which in range(draft.n_chosen):
        _build_tour(search, which)
    _fill_tours(search)
    for k in range(work.parent.shape[0]):
        work.recreated[k] = work.parent[k]
    is_new = False
    for which in range(draft.n_chosen):
        robot = work.chosen[which]
        work.recreated[robot] = _store_tour(search, which)
        is_new = is_new or work.recreated[robot] != work.parent[robot]
    for k in range(work.parent.shape[0]):
        work.trails[k] = work.recreated[k]
    return is_new


@helper
def _build_tour(search: Search, which: int) -> None:
    """Build a tour of some of the stops of a chosen robot's trail, which are marked as seen."""
    world, work = search.world, search.work
    draft, slack = work.draft, work.slacks[which]
    _draw_slack(search, which)
    source, goals = world.team.start[work.chosen[which]], work.goals
    n, end = _draw_stops(search, which, source), world.team.end[source]
    work.nodes[source].seen = draft.mark
    stop, work.first[which] = source, draft.n_legs
    for i in range(n + 1):
        is_last = i == n
        after = end if is_last else goals[i]
        _set_leg(search, draft.n_legs, stop, after)
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
    graph, limits, store, work = search.world.graph, search.world.limits, search.store, search.work
    slack, states, robot = work.slacks[which], work.states, work.chosen[which]
    trail = store.trails[work.parent[robot]]
    slack.danger, slack.length = -math.log(max(trail.alive, _LEAST_SURVIVAL)), np.inf
    if trail.n_arcs == 0:  # the robot may leave the base, with a survival of 1 / e or more
        slack.danger = uniform(states, 0)
    slack.danger *= math.exp(SPREAD * (2.0 * uniform(states, 0) - 1.0))
    is_full = uniform(states, 0) < P_FULL
    longest, least = limits.budgets[robot], limits.floors[robot]
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
        most = -math.log(least)
        slack.danger = most if is_full else min(slack.danger, most)


@helper
def _draw_stops(search: Search, which: int, source: int) -> int:
    """Draw which stops of a trail stay, write them to ``work.goals``, and return how many."""
    goals, states = search.work.goals, search.work.states
    n = _list_stops(search, which, source)
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
def _list_stops(search: Search, which: int, source: int) -> int:
    """List the stops of a trail."""
    store, work, n = search.store, search.work, 0
    trail = store.trails[work.parent[work.chosen[which]]]
    # In each scenario the trail visits the same nodes.
    for i in range(trail.first_visit, trail.first_visit + trail.n_visits // work.cases.shape[0]):
        node = work.draft.layer + np.int64(store.node[i])
        if work.nodes[node].marginal > 0.0 and node != source:
            work.goals[n] = node
            n += 1
    return n


@helper
def _set_leg(search: Search, number: int, before: int, after: int) -> None:
    """Set the two stops of a leg, and compute what it costs."""
    leg, routes = search.work.legs[number], search.routes
    leg.before, leg.after = before, after
    table = search.work.draft.table
    leg.cost, leg.length = routes.leaving[table + before, after], 0.0
    leg.danger = leg.cost
    if routes.prices_length:
        leg.length = routes.leaving_length[table + before, after]
        leg.danger -= routes.per_length[before] * leg.length
    leg.survival = math.exp(-leg.danger)
    leg.cost += SHUFFLED * uniform(search.work.states, 0)


@helper
def _fill_tours(search: Search) -> None:
    """Insert nodes that are not marked into the tours until no more fit.

    What each is worth is its marginal reward, lowered at random.
    """
    world, work = search.world, search.work
    draft, nodes, worth, legs = work.draft, work.nodes, work.worth, work.legs
    states, first, limits = work.states, draft.layer, world.limits
    behind = first + world.team.reward.shape[0]
    cheapest = work.cheapest_leg[first:behind]
    noise = uniform(states, 0)
    floor, budget = limits.floors[work.chosen[0]], limits.budgets[work.chosen[0]]
    is_squared = (floor > 0.0 or budget < np.inf) and uniform(states, 0) < P_SQUARED
    for node in range(first, behind):
        work.insertion_cost[node], worth[node] = np.inf, 0.0
        marginal = nodes[node].marginal
        if marginal > 0.0 and nodes[node].seen != draft.mark:
            worth[node] = marginal * (1.0 - noise * uniform(states, 0))
    for number in range(draft.n_legs):
        _update_insertion_costs(search, number)
    for which in range(draft.n_chosen):
        _evaluate_tour(work, which)
    while True:
        best = _find_best_node(search, is_squared)
        if best == NONE:
            break
        number = work.cheapest_leg[best]
        _insert_node(search, number, best)
        worth[best] = 0.0
        for i in range(cheapest.shape[0]):
            cheapest[i] = UNKNOWN if cheapest[i] == number else cheapest[i]
        _update_insertion_costs(search, number)
        _update_insertion_costs(search, draft.n_legs - 1)
        _evaluate_tour(work, legs[number].tour)


@helper
def _update_insertion_costs(search: Search, number: int) -> None:
    """Compute what it costs to insert each node into a leg, and note whether that is least."""
    routes, work = search.routes, search.work
    n, first = search.world.team.reward.shape[0], work.draft.layer
    leg = work.legs[number]
    # The part of each array that belongs to the layer: indices that begin at 0 are faster.
    costs, cheapest = work.insertion_cost[first : first + n], work.cheapest_leg[first : first + n]
    leaving = routes.leaving[work.draft.table + leg.before][first : first + n]
    coming = routes.coming[work.draft.table + leg.after][first : first + n]
    leg_cost = leg.cost
    for node in range(n):
        cost = leaving[node] + coming[node] - leg_cost
        is_less = cost < costs[node]
        costs[node] = cost if is_less else costs[node]
        cheapest[node] = number if is_less else cheapest[node]


@helper
def _evaluate_tour(work: Workspace, which: int) -> None:
    """Compute with what probability each leg of a tour is begun, and what lies ahead of it."""
    legs, order = work.legs, work.order
    n, alive, number = 0, 1.0, work.first[which]
    while number != NONE:
        leg = legs[number]
        order[n] = number
        n += 1
        leg.alive = alive
        alive *= leg.survival
        number = leg.following
    ahead = 0.0
    for i in range(n - 1, -1, -1):
        leg = legs[order[i]]
        leg.ahead = ahead * leg.survival
        ahead = leg.ahead + work.nodes[leg.before].marginal


@helper
def _find_best_node(search: Search, is_squared: bool) -> int:
    """Return the node that fits and has the largest gain per insertion cost, or ``NONE``.

    With ``is_squared`` it is that of the largest square of the gain.

    A node gains its worth, less what the danger of the detour takes from the stops after it, as if
    all rewards counted on arrival. For small costs c, 1 / (1 + c) takes the place of exp(−c).
    """
    routes, work = search.routes, search.work
    legs, best, highest = work.legs, NONE, 0.0
    n, first = search.world.team.reward.shape[0], work.draft.layer
    per_length, table = routes.per_length[first], work.draft.table
    costs, worth = work.insertion_cost[first : first + n], work.worth[first : first + n]
    cheapest = work.cheapest_leg[first : first + n]
    for i in range(n):
        most = worth[i] * worth[i] if is_squared else worth[i]
        if most <= highest * costs[i]:
            continue
        node = first + i
        if cheapest[i] == UNKNOWN:
            _find_cheapest_leg(search, node)
        leg, cost = legs[cheapest[i]], max(costs[i], _LEAST_COST)
        slack, way = work.slacks[leg.tour], routes.leaving[table + leg.before, node]
        danger = cost
        if routes.prices_length:
            length = routes.leaving_length[table + leg.before, node]
            longer = length + routes.coming_length[table + leg.after, node] - leg.length
            if longer > slack.length:
                continue
            way -= per_length * length
            danger = max(0.0, cost - per_length * longer)
        if danger > slack.danger + state.TOLERANCE:
            continue
        gain = leg.alive * (worth[i] / (1.0 + way) - leg.ahead * danger / (1.0 + danger))
        if is_squared:
            gain *= max(gain, 0.0)
        if gain > highest * cost:
            best, highest = node, gain / cost
    return best


@helper
def _find_cheapest_leg(search: Search, node: int) -> None:
    """Find the leg where inserting a node costs least."""
    routes, work, table = search.routes, search.work, search.work.draft.table
    leaving, coming = routes.leaving[table + node], routes.coming[table + node]
    least, cheapest = np.inf, 0
    for number in range(work.draft.n_legs):
        leg = work.legs[number]
        cost = coming[leg.before] + leaving[leg.after] - leg.cost
        cheapest = number if cost < least else cheapest
        least = min(least, cost)
    work.insertion_cost[node], work.cheapest_leg[node] = least, cheapest


@helper
def _insert_node(search: Search, number: int, node: int) -> None:
    """Split a leg in two by a node; the second is the last one of ``work.legs`` then."""
    work = search.work
    legs, added = work.legs, work.draft.n_legs
    leg, slack = legs[number], work.slacks[legs[number].tour]
    slack.danger += leg.danger
    slack.length += leg.length
    legs[added].following, legs[added].tour = leg.following, leg.tour
    leg.following = added
    _set_leg(search, added, node, leg.after)
    _set_leg(search, number, leg.before, node)
    slack.danger -= leg.danger + legs[added].danger
    slack.length -= leg.length + legs[added].length
    work.draft.n_legs += 1


@helper
def _store_tour(search: Search, which: int) -> int:
    """Store the trail of a tour's cheapest paths, and return its number.

    Where it does not keep the limits, the robot keeps its trail.
    """
    team, store, work = search.world.team, search.store, search.work
    draft, legs, robot = work.draft, work.legs, work.chosen[which]
    source = team.start[robot]
    # It replaces a trail that goes from its start straight to its end.
    draft.n_goals = draft.n_piece = draft.prefix = draft.n_steps = 0
    draft.suffix = draft.length = 1
    steps = work.steps[0]
    steps[0].arc = NONE
    steps[0].node, steps[1].node = source, team.end[source]
    number = work.first[which]
    while legs[number].following != NONE:
        work.goals[draft.n_goals] = legs[number].after
        draft.n_goals += 1
        number = legs[number].following
    trail = state.NOT_STORED
    if connect_child(search):
        trail = plans.add_trail(search, robot, write_child(work))
    if trail == state.NOT_STORED:
        trail = work.parent[robot]
        store.trails[trail].n_users += 1
    return int(trail)
