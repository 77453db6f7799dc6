"""Children of a trail: the moves that make them, how they are connected, and what they gain.

A move cuts a trail somewhere and reconnects it. It is a function of the search that returns whether
it found a child. It reads the trail that changes (``work.steps``), the numbers of all trails of the
parent (``work.parent``) and the store. In ``work.draft`` it writes up to which position the trail
is kept (``prefix``) and from which on (``suffix``); between both, ``n_steps`` random arcs,
``n_goals`` nodes to visit (``work.goals``) and ``n_piece`` arcs (``work.piece``), joined by safest
paths; or a stored trail to take instead (``adopted``). ``MOVES`` declares all moves.

Where a child would use an arc twice, the loop in between is cut out, so that every child is a
trail, on any graph.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from botohe_moo.algorithms.local_search.kernels import state
from botohe_moo.algorithms.local_search.kernels.plans import collect
from botohe_moo.algorithms.local_search.kernels.state import Search, Workspace
from botohe_moo.core import ordered
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.rng import below, uniform
from botohe_moo.core.world import Graph, Returns

# A node to visit is the best of one, two or three nodes nearby.
_MOST_COMPARED = 3

# Probabilities:
# that the other plan of a move is near the parent in the front;
_P_NEIGHBOUR = 0.5
# that a segment that is cut out is short, and how many arcs it has at most then;
_P_SHORT, _N_SHORT = 0.6, 4
# that a node to visit is drawn among those nearby, rather than among all;
_P_NEAR = 0.8
# that a move takes steps along any arcs, safe or not, instead of visits;
_P_STEP = 0.6
# that two visits are followed by a third, that by a fourth, and so on;
_P_MORE = 0.6
# that two trails are joined at the node drawn if they meet there;
_P_MEET = 0.9

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
    is_end, table = goal == search.world.team.end[goal], work.draft.table
    is_homeward = is_end and routes.leaving.shape[0] == 0
    entry = 0 if is_homeward else state.route_entry(routes, table + goal, node)
    if entry == state.UNKNOWN:
        return False
    row = routes.entries[table + goal]
    while node != goal:
        if is_homeward:
            arc = search.world.ways.homeward[node]
        else:
            arc = row[entry].arc
            entry = row[entry].onward
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
    node, end = work.steps[0, draft.prefix].node, work.steps[0, draft.suffix].node
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
        if middle[i] != work.steps[0, draft.prefix + i].arc:
            return True
    return False


@helper
def write_child(work: Workspace) -> int:
    """Write all arcs of the child to ``work.child``; return how many there are."""
    draft, child = work.draft, work.child
    for i in range(draft.prefix):
        child[i] = work.steps[0, i].arc
    n = draft.prefix
    for i in range(draft.n_middle):
        child[n] = work.middle[i]
        n += 1
    for i in range(draft.suffix, draft.length):
        child[n] = work.steps[0, i].arc
        n += 1
    return int(n)


@helper
def evaluate_child(search: Search, returns: Returns | None) -> float:
    """Return what the robot collects by the child; −1 if the child cannot enter the front."""
    graph, limits, front, work = search.world.graph, search.world.limits, search.front, search.work
    draft, nodes = work.draft, work.nodes
    draft.mark += 1
    mark, prefix, suffix, length = draft.mark, draft.prefix, draft.suffix, draft.length
    home, bound = 0.0, draft.others
    for scenario in range(graph.probability.shape[0]):
        case, steps = work.cases[scenario], work.steps[scenario]
        survival, carried, first = graph.survival[scenario], 0.0, case.first
        alive, gained = steps[prefix].alive, steps[prefix].gained
        if returns is not None:
            carried = work.loads[scenario, prefix].carried
        for i in range(draft.n_middle):
            arc = work.middle[i]
            alive *= survival[arc]
            node, worth = nodes[first + graph.head[arc]], 0.0
            if node.met > prefix and node.seen != mark:
                node.seen, worth = mark, node.marginal
            gained, carried = collect(returns, graph.head[arc], worth, alive, gained, carried)
        case.alive, case.gained, case.carried = alive, gained, carried
        home += graph.probability[scenario] * (alive * steps[suffix].home)
        ahead = steps[suffix].ahead
        if returns is not None:
            ahead += carried * work.loads[scenario, suffix].to_depot
        bound += gained + alive * ahead
    if home < limits.floors[draft.robot]:
        return -1.0
    if limits.has_budgets:
        steps = work.steps[0]
        walked = steps[prefix].walked + steps[length].walked - steps[suffix].walked
        for i in range(draft.n_middle):
            walked += graph.length[work.middle[i]]
        if walked > limits.budgets[draft.robot]:
            return -1.0
    needed = ordered.best_reward(front, (draft.survivors + home) * (1.0 - state.TOLERANCE))
    if needed >= bound * (1.0 + state.TOLERANCE):
        return -1.0
    collected = 0.0
    for scenario in range(graph.probability.shape[0]):
        case, steps = work.cases[scenario], work.steps[scenario]
        alive, gained, carried, first = case.alive, case.gained, case.carried, case.first
        for i in range(suffix + 1, length + 1):
            alive *= steps[i].survival
            node, worth = nodes[first + steps[i].node], 0.0
            if node.met > prefix and node.seen != mark:
                node.seen, worth = mark, node.marginal
            gained, carried = collect(returns, steps[i].node, worth, alive, gained, carried)
        collected += gained
    is_enough = (draft.others + collected) * (1.0 - state.TOLERANCE) > needed
    return float(collected) if is_enough else -1.0


@helper
def evaluate_trail(search: Search, trail: int) -> float:
    """Return what the robot collects by a stored trail; −1 if that child cannot enter the front."""
    worth, store, work = search.world.team.worth, search.store, search.work
    draft, nodes, taken = work.draft, work.nodes, store.trails[trail]
    gained, shift = 0.0, work.cases[0].first
    for i in range(taken.first_visit, taken.first_visit + taken.n_visits):
        node = np.int64(store.node[i])  # of the mission: the share is part of the reach
        gained += worth[node] * abs(nodes[shift + node].unreached) * store.reach[i]
    needed = ordered.best_reward(
        search.front, (draft.survivors + taken.alive) * (1.0 - state.TOLERANCE)
    )
    return gained if (draft.others + gained) * (1.0 - state.TOLERANCE) > needed else -1.0


@helper
def _draw_segment(work: Workspace) -> None:
    """Draw a segment of the trail to cut out: short, or of any length."""
    draft, states = work.draft, work.states
    low = below(states, draft.length + 1)
    if uniform(states, 0) < _P_SHORT:
        high = min(draft.length, low + below(states, _N_SHORT + 1))
    else:
        high = below(states, draft.length + 1)
    draft.prefix, draft.suffix = min(low, high), max(low, high)


@helper
def _visit(search: Search, n_visits: int) -> bool:
    """Replace a segment by safest paths through nodes, or by as many random arcs.

    Of two visits there may be more.
    """
    draft, states = search.work.draft, search.work.states
    _draw_segment(search.work)
    while 1 < n_visits < state.MOST_GOALS and uniform(states, 0) < _P_MORE:
        n_visits += 1
    if n_visits > 0 and uniform(states, 0) < _P_STEP:
        draft.n_steps = n_visits
    else:
        _draw_visits(search, n_visits)
    return True


@helper
def _draw_visits(search: Search, n_visits: int) -> None:
    """Draw nodes to visit: any node, or one nearby of much marginal reward."""
    work = search.work
    states, near, nodes = work.states, search.routes.near, work.nodes
    node, n_near = work.steps[0, work.draft.prefix].node, near.shape[1]
    for i in range(n_visits):
        if uniform(states, 0) >= _P_NEAR:
            node = work.draft.layer + below(states, search.world.team.reward.shape[0])
        else:
            row = work.draft.table + node
            best = near[row, below(states, n_near)]
            for _ in range(below(states, _MOST_COMPARED)):
                other = near[row, below(states, n_near)]
                if nodes[other].marginal > nodes[best].marginal:
                    best = other
            node = best
        work.goals[i] = node
    work.draft.n_goals = n_visits


@helper
def draw_trail(search: Search, robot: int) -> int:
    """Draw a trail that a robot may take, of a plan near the parent or of any plan."""
    front, team, states = search.front, search.world.team, search.work.states
    if uniform(states, 0) < _P_NEIGHBOUR:
        slot = ordered.draw_near(front, states, search.work.draft.place)
    else:
        slot = ordered.draw_slot(front, states)
    donor = team.first[robot] + below(states, team.stop[robot] - team.first[robot])
    return int(np.int64(front.plan[slot, donor]))


@helper
def _graft(search: Search, to_end: int) -> bool:
    """Replace a segment by a piece of another plan's trail; with ``to_end``, go on to its end.

    Where the trails meet at an end of the
    piece, they are mostly joined there.
    """
    graph, store, work = search.world.graph, search.store, search.work
    draft, states, nodes = work.draft, work.states, work.nodes
    donor = store.trails[draw_trail(search, draft.robot)]
    start, n_arcs, length = donor.first_arc, donor.n_arcs, draft.length
    if n_arcs == 0:
        return False
    begin = below(states, n_arcs) + 1
    entrance = graph.head[store.arc[start + begin - 1]]
    low = below(states, length + 1)
    if uniform(states, 0) < _P_MEET and nodes[entrance].met <= length:
        low = nodes[entrance].met
    end, high = n_arcs, length
    if not to_end:
        end = begin + below(states, n_arcs - begin + 1)
        leaving = graph.head[store.arc[start + end - 1]]
        high = low + below(states, length + 1 - low)
        if uniform(states, 0) < _P_MEET and low <= nodes[leaving].met <= length:
            high = nodes[leaving].met
    draft.prefix, draft.suffix = low, high
    work.goals[0], draft.n_goals = entrance, 1
    for i in range(begin, end):
        work.piece[i - begin] = store.arc[start + i]
    draft.n_piece = end - begin
    return True


@helper
def _swap_loops(search: Search, _: int) -> bool:
    """Draw two loops, one after the other at a node, to swap: survival stays as it is."""
    work = search.work
    draft, steps = work.draft, work.steps[0]
    low = below(work.states, draft.length + 1)
    middle = high = -1
    for i in range(low + 1, draft.length + 1):
        if steps[i].node == steps[low].node:
            if middle >= 0:
                high = i
                break
            middle = i
    if high < 0:
        return False
    draft.prefix, draft.suffix = low, high
    work.goals[0], draft.n_goals = steps[low].node, 1
    draft.n_piece = high - low
    for i in range(low, high):
        later = i - low + high - middle if i < middle else i - middle
        work.piece[later] = steps[i].arc
    return True


@helper
def _adopt(search: Search, _: int) -> bool:
    """Take over a whole trail of another plan."""
    search.work.draft.adopted = draw_trail(search, search.work.draft.robot)
    return True


class Move(NamedTuple):
    """A move: its name, how likely it is to be drawn by default, relative, and what makes it."""

    name: str
    weight: float
    make: Callable[[Search, int], bool]
    argument: int = 0  # what ``make`` takes beside the search


# results/moves/summary.csv has areas without each move in turn.
MOVES = (
    Move("shortcut", 0.07, _visit, 0),
    Move("visit", 0.18, _visit, 1),
    Move("visit-two", 0.11, _visit, 2),
    Move("splice", 0.25, _graft, 1),
    Move("graft", 0.25, _graft),
    Move("swap-loops", 0.02, _swap_loops),
    Move("adopt", 0.1, _adopt),
)
N_MOVES = len(MOVES)


def _chained(number: int) -> Callable[[Search, int], bool]:
    """Return a function that makes a move by its number, from this one on."""
    _, _, make, argument = MOVES[number]
    if number == N_MOVES - 1:
        return inlined(lambda search, _: make(search, argument))
    make_later = _chained(number + 1)

    @inlined
    def make_move(search: Search, move: int) -> bool:
        return make(search, argument) if move == number else make_later(search, move)

    return make_move


_make_move = _chained(0)


@helper
def make_child(search: Search, move: int) -> bool:
    """Make a child by a move; return whether there is one that differs from the trail."""
    draft = search.work.draft
    draft.n_steps = draft.n_goals = draft.n_piece = 0
    draft.adopted = state.NOT_STORED
    if not _make_move(search, move):
        return False
    return draft.adopted != state.NOT_STORED or connect_child(search)
