"""Moves of the Pareto local search: each cuts a trail somewhere and reconnects it.

A move is a function of the search that returns whether it found a child. It reads the trail that
changes (``work.steps``), the numbers of all trails of the parent (``work.parent``) and the store.
In ``work.draft`` it writes up to which position the trail is kept (``prefix``) and from which on
(``suffix``); between both, ``n_steps`` random arcs, ``n_goals`` nodes to visit (``work.goals``) and
``n_piece`` arcs (``work.piece``), joined by safest paths; or a stored trail to take instead
(``adopted``). ``MOVES`` declares all moves.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from botohe_moo.algorithms.local_search.kernels import state
from botohe_moo.algorithms.local_search.kernels.children import connect_child
from botohe_moo.algorithms.local_search.kernels.state import Search, Workspace
from botohe_moo.core import ordered
from botohe_moo.core.compile import helper, inlined
from botohe_moo.core.rng import below, uniform

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
    node, n_near = work.steps[work.draft.prefix].node, near.shape[1]
    for i in range(n_visits):
        if uniform(states, 0) >= _P_NEAR:
            node = work.draft.layer + below(states, search.world.team.reward.shape[0])
        else:
            best = near[node, below(states, n_near)]
            for _ in range(below(states, _MOST_COMPARED)):
                other = near[node, below(states, n_near)]
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


# results/local-search/moves.csv has areas without each move in turn.
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
