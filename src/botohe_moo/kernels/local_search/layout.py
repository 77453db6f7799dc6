"""One trail of one plan laid out, for children to be made of it.

With the other robots' trails fixed, a node is worth to this robot what they leave of its reward:
the rest of the search sees a single robot. A child keeps a prefix of the trail, goes on along new
arcs, and ends with a suffix of it; its E[S] follows from three products, and its E[R] is bounded
before the suffix is walked.
"""

import numpy as np

from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.fronts.ordered import OrderedFront, find_place
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.trail_store import TrailStore, release
from botohe_moo.kernels.local_search.workspace import NEVER, Workspace
from botohe_moo.kernels.rng import below, uniform

# With what probability the next parent is the plan that has just entered the front.
P_NEWEST = 0.9


@helper
def find_plan(front: OrderedFront, survivors: float) -> tuple[int, int]:
    """Find the plan with an E[S]; where it has left the front, one that survives as well."""
    at, place = find_place(front, survivors)
    if at == front.n.blocks:
        at -= 1
        place = front.size[front.directory[at]] - 1
    return at, place


@helper
def take_newest(work: Workspace) -> float:
    """Return E[S] of the plan that has just entered the front, if it is to be next; else −1."""
    newest = work.memory.newest
    work.memory.newest = -1.0
    return newest if newest >= 0.0 and uniform(work.states, 0) < P_NEWEST else -1.0


@helper
def hold(store: TrailStore, front: OrderedFront, work: Workspace, at: int, place: int) -> None:
    """Let a plan of the front be the parent, and draw one of its robots; ``let_go`` undoes it."""
    draft, parent, states = work.draft, work.parent, work.states
    slot = front.places[front.directory[at], place].slot
    for k in range(parent.shape[0]):
        parent[k] = front.plan[slot, k]
        store.trails[parent[k]].n_users += 1
    draft.at, draft.chosen, draft.robot = at, 0, below(states, parent.shape[0])


@helper
def let_go(store: TrailStore, work: Workspace) -> None:
    """Release the trails of the parent."""
    for k in range(work.parent.shape[0]):
        release(store, work.parent[k])


@helper
def set_aside(graph: Graph, store: TrailStore, work: Workspace) -> None:
    """Let the parent's other robots go first; ``clear_others`` undoes it.

    The base's reward is theirs.
    """
    draft, nodes, touched = work.draft, work.nodes, work.touched
    draft.touched, draft.others, draft.survivors = 0, graph.reward[graph.base], 0.0
    for k in range(work.parent.shape[0]):
        is_changed = k == draft.robot
        for i in range(1, draft.chosen):
            is_changed |= k == work.chosen[i]
        if is_changed:
            continue
        trail = store.trails[work.parent[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            node, reach = np.int64(store.node[i]), store.reach[i]
            here = nodes[node]
            if here.unreached < 0.0:
                here.unreached = 1.0
                touched[draft.touched] = node
                draft.touched += 1
            # Small chances keep their digits so, which the reward minus what is left would lose.
            draft.others += graph.reward[node] * here.unreached * reach
            here.unreached *= 1.0 - reach
        draft.survivors += trail.alive
    for i in range(draft.touched):
        here = nodes[touched[i]]
        here.left = graph.reward[touched[i]] * here.unreached


@helper
def clear_others(graph: Graph, work: Workspace) -> None:
    """Leave the workspace as it was before ``set_aside``."""
    for i in range(work.draft.touched):
        node = work.touched[i]
        work.nodes[node].left, work.nodes[node].unreached = graph.reward[node], -1.0


@helper
def lay_out(graph: Graph, store: TrailStore, work: Workspace, trail: int) -> None:
    """Lay out the trail that is to be changed, when the others have been set aside.

    ``clear_trail`` undoes it.
    """
    steps, nodes = work.steps, work.nodes
    start, length = store.trails[trail].first_arc, store.trails[trail].n_arcs
    work.draft.length = length
    nodes[graph.base].met = 0
    alive, gained, walked = 1.0, 0.0, 0.0
    steps[0].node, steps[0].alive, steps[0].gained = graph.base, alive, gained
    steps[0].walked = walked
    for i in range(length):
        arc = np.int64(store.arc[start + i])
        node = graph.head[arc]
        steps[i].arc = arc
        work.arcs[arc].position = i
        alive *= graph.survival[arc]
        walked += graph.length[arc]
        if nodes[node].met == NEVER:
            nodes[node].met = i + 1
            gained += nodes[node].left * alive
        steps[i + 1].node, steps[i + 1].alive, steps[i + 1].gained = node, alive, gained
        steps[i + 1].walked = walked
    # Backwards: what lies ahead when nothing has been collected; a node that comes again later
    # counts here instead.
    ahead = 0.0
    steps[length].ahead = ahead
    for i in range(length - 1, -1, -1):
        after = steps[i + 1]
        here = nodes[after.node]
        if here.later > 0.0:
            ahead -= here.later / after.alive
        here.later = here.left * after.alive
        ahead = graph.survival[steps[i].arc] * (ahead + here.left)
        steps[i].ahead = ahead


@helper
def clear_trail(graph: Graph, work: Workspace) -> None:
    """Leave the workspace as it was before ``lay_out``."""
    nodes, steps = work.nodes, work.steps
    for i in range(work.draft.length):
        node = steps[i + 1].node
        work.arcs[steps[i].arc].position = -1
        nodes[node].met, nodes[node].later = NEVER, 0.0
    nodes[graph.base].met = NEVER
