"""Moves of the Pareto local search: each cuts a trail somewhere and reconnects it.

A move chooses a prefix and a suffix of the trail, nodes to visit between them, and a piece of arcs
to take after these.
"""

import numpy as np

from botohe_moo.algorithms.local_search.kernels.children import connect_child
from botohe_moo.algorithms.local_search.kernels.routes import Routes, search_near
from botohe_moo.algorithms.local_search.kernels.workspace import MOST_GOALS, Search, Workspace
from botohe_moo.core.compile import helper
from botohe_moo.core.graph import Graph
from botohe_moo.core.kinds import behind_kind, first_of_kind, n_origins
from botohe_moo.core.ordered import draw_place
from botohe_moo.core.rng import below, uniform

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

# A node to visit is the best of one, two or three nodes nearby.
_MOST_COMPARED = 3

# The probability that safest paths avoid arcs that the trail uses already, and how often at most.
P_DETOUR, _MAX_DETOURS = 0.3, 4

# Probabilities:
# that the other plan of a move is near the parent, in its block of the front or one beside it;
_P_NEIGHBOUR = 0.5
# that a segment that is cut out is short, and how many arcs it has at most then;
_P_SHORT, _N_SHORT = 0.6, 4
# that a node to visit is drawn among those nearby, rather than among all;
_P_NEAR = 0.8
# that a move takes steps along any arcs, safe or not, instead of visits;
_P_STEP = 0.3
# that two visits are followed by a third, that by a fourth, and so on;
_P_MORE = 0.6
# that two trails are joined at the node drawn if they meet there.
_P_MEET = 0.9


@helper
def make_child(search: Search, kind: int) -> bool:
    """Make a child by a move; return whether there is one that differs from the trail."""
    draft, states = search.work.draft, search.work.states
    n_detours = _MAX_DETOURS if uniform(states, 0) < P_DETOUR else 0
    n_steps = draft.n_goals = draft.n_piece = 0
    made = True
    if kind <= VISIT_TWO:
        _draw_segment(search.work, _N_SHORT)
        n_visits = kind
        while 1 < n_visits < MOST_GOALS and uniform(states, 0) < _P_MORE:
            n_visits += 1
        if n_visits > 0 and uniform(states, 0) < _P_STEP:
            n_steps = n_visits
        else:
            _draw_visits(search.graph, search.routes, search.work, n_visits)
    elif kind == SWAP_LOOPS:
        made = _draw_loops(search.work)
    elif kind == REVERSE:
        made = _draw_reversed(search.graph, search.work)
    else:
        made = _draw_piece(search, kind == SPLICE)
    return made and connect_child(search, n_steps, n_detours)


@helper
def _draw_segment(work: Workspace, n_short: int) -> None:
    """Draw a segment of the trail to cut out: short, or of any length."""
    draft, states = work.draft, work.states
    low = below(states, draft.length + 1)
    if uniform(states, 0) < _P_SHORT:
        high = min(draft.length, low + below(states, n_short + 1))
    else:
        high = below(states, draft.length + 1)
    draft.prefix, draft.suffix = min(low, high), max(low, high)


@helper
def _draw_visits(graph: Graph, routes: Routes, work: Workspace, n_visits: int) -> None:
    """Draw nodes to visit: any node, or one nearby where the other robots leave much reward."""
    states, near = work.states, routes.near
    node = work.steps[work.draft.prefix].node
    n_near = near.shape[1]
    for i in range(n_visits):
        if uniform(states, 0) >= _P_NEAR:
            n_nodes = n_origins(graph.kinds, graph.reward.shape[0])
            node = work.draft.layer + below(states, n_nodes)
        else:
            if near[node, 0] < 0:
                search_near(graph, routes, node)
            best = near[node, below(states, n_near)]
            for _ in range(below(states, _MOST_COMPARED)):
                other = near[node, below(states, n_near)]
                if work.nodes[other].left > work.nodes[best].left:
                    best = other
            node = best
        work.goals[i] = node
    work.draft.n_goals = n_visits


@helper
def draw_trail(search: Search, robot: int) -> int:
    """Draw a trail that a robot may take, of a plan near the parent or of any plan."""
    front, work, kinds = search.front, search.work, search.graph.kinds
    states, n_robots = work.states, search.front.plan.shape[1]
    if uniform(states, 0) < _P_NEIGHBOUR:
        block = min(front.n.blocks - 1, max(0, work.draft.block + below(states, 3) - 1))
        place = below(states, front.size[front.directory[block]])
    else:
        block, place = draw_place(front, states)
    slot = front.places[front.directory[block], place].slot
    first = first_of_kind(kinds, robot)
    donor = first + below(states, behind_kind(kinds, n_robots, robot) - first)
    return int(np.int64(front.plan[slot, donor]))


@helper
def _draw_piece(search: Search, to_end: bool) -> bool:
    """Draw a piece of a trail of another plan to replace a segment of this trail.

    With ``to_end`` it reaches to the end of that trail. Where the trails meet at an end of the
    piece, they are mostly joined there.
    """
    graph, store, work = search.graph, search.store, search.work
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
def _draw_reversed(graph: Graph, work: Workspace) -> bool:
    """Draw a segment to walk in the other direction; a segment that is a loop stays one.

    Croes, "A method for solving traveling-salesman problems", Operations Research 6(6), 1958.
    """
    draft, steps = work.draft, work.steps
    _draw_segment(work, _N_SHORT + 2)
    low, high = draft.prefix, draft.suffix
    if high < low + 2:
        return False
    work.goals[0], draft.n_goals = steps[high - 1].node, 1
    for i in range(high - 2, low, -1):
        arc = graph.reverse[steps[i].arc]
        if arc < 0:
            return False
        work.piece[high - 2 - i] = arc
    draft.n_piece = high - 2 - low
    return True


@helper
def _draw_loops(work: Workspace) -> bool:
    """Draw two loops, one after the other at a node, to swap: survival stays as it is."""
    draft, steps = work.draft, work.steps
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
