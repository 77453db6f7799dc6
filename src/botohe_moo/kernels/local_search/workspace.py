"""What a search works with: its rule, what it remembers, and one trail of one plan laid out.

With the other robots' trails fixed, a node is worth to this robot what they leave of its reward:
the rest of the search sees a single robot. A child keeps a prefix of the trail, goes on along new
arcs, and ends with a suffix of it; its E[S] follows from three products, and its E[R] is bounded
before the suffix is walked.
"""

from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.kernels.compile import helper
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.local_search.trail_store import TrailStore, comes_before
from botohe_moo.kernels.plans.evaluate import either

# A plan that gains less than this, relative, is taken for one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = 1e-12

NEVER = np.int64(1) << 40

_MEMORY = np.dtype([("newest", np.float64), ("idle", np.int64)])
_COUNTS = ("at", "robot", "alone", "touched", "length", "prefix", "middle", "suffix", "goals")
_NOW = np.dtype(
    [(name, np.int64) for name in (*_COUNTS, "piece", "mark")]
    + [(name, np.float64) for name in ("others", "survivors")]
)
_STEP = np.dtype(
    [
        ("arc", np.int64),
        ("node", np.int64),
        ("alive", np.float64),
        ("gained", np.float64),
        ("ahead", np.float64),
    ]
)
_NODE = np.dtype(
    [
        ("left", np.float64),
        ("met", np.int64),
        ("seen", np.int64),
        ("unreached", np.float64),
        ("later", np.float64),
        ("chance", np.float64),
    ]
)
_ARC = np.dtype([("position", np.int64), ("mark", np.int64), ("place", np.int64)])
_MOST_GOALS = 64


class SearchRule(NamedTuple):
    """How to search; :class:`~botohe_moo.ParetoLocalSearch` documents what users may set."""

    # Children of a parent before the next is drawn; and as long as the search is busy.
    n_children: int = 24
    n_children_busy: int = 8
    busy: int = 100  # it is when a plan has entered the front within so many evaluations
    # With what probability the next parent is the plan that has just entered the front.
    p_newest: float = 0.9
    p_end: float = 0.1  # with what probability the parent is the plan of most reward
    # Plans among which a parent is chosen, by the area that its neighbours leave it divided by how
    # often it has been a parent; and as long as the search is busy.
    n_drawn: int = 2
    n_drawn_busy: int = 8
    # After so many evaluations without a plan that enters the front, with what probability the
    # other robots of a parent stay as they are for ``n_alone`` evaluations, and the search goes on
    # from a front of trails of the one robot.
    patience: int = 2_000
    p_alone: float = 0.1
    n_alone: int = 500
    # With what probability the other plan of a move is one near the parent: of its block of the
    # front, or of one of the two beside that.
    p_neighbour: float = 0.5
    # With what probability a segment that is cut out has at most ``n_short`` arcs.
    p_short: float = 0.6
    n_short: int = 4
    p_near: float = 0.8  # with what probability a node to visit is drawn among those near
    # With what probability each visit is one step instead, along an arc drawn, be it safe or not.
    p_step: float = 0.3
    # With what probability two visits are followed by another, and that by another, and so on.
    p_more: float = 0.6
    # With what probability two trails are joined where they meet, if they do at the node drawn.
    p_meet: float = 0.9
    # With what probability safest paths go round arcs that the trail uses already.
    p_detour: float = 0.3
    min_survival: float = 0.0  # survival floor of every robot

    @property
    def most_new(self) -> int:
        """How many trails and plans a parent adds at most: its children, and one to spare."""
        return max(self.n_children, self.n_children_busy) + 1


class Workspace(NamedTuple):
    """What a search remembers, and scratch, which holds nothing between two parents."""

    # E[S] of the plan that has just entered the front, −1 where none has (``newest``), and how many
    # plans have been evaluated since one entered (``idle``).
    memory: Record
    # How often each kind of move gave a child, and one that entered (2, N_KINDS).
    tally: OffsetArray
    states: SeedArray  # the search's random numbers (1, 2)
    weights: FloatArray  # how likely each kind of move is, relative, summed up to each (N_KINDS)
    # Of the parent: its block of the front, in the directory (``at``), the ``robot`` at hand, how
    # many more evaluations it goes on ``alone``, how many nodes the others reach (``touched``), and
    # E[R] and E[S] of these (``others`` and ``survivors``). Of the trail: how many arcs it has
    # (``length``). Of the child: how many arcs are kept from the trail's start (``prefix``), how
    # many are new (``middle``), from which position the trail is kept to its end (``suffix``), how
    # many ``goals`` there are, and arcs in the ``piece``. And the last ``mark``.
    now: Record
    # At each position of the trail (n_arcs + 1) the ``node`` and the ``arc`` that leaves it; the
    # probability to get there (``alive``); what was collected up to there (``gained``), and what a
    # robot sure to be there that had collected nothing would collect from there on (``ahead``).
    steps: RecordArray
    # What the other robots leave of each node's reward, 0 at the base (``left``); the probability
    # that none of them reaches it, −1 where none may (``unreached``); the position of the trail's
    # first visit, ``NEVER`` where there is none (``met``); and scratch: ``seen`` holds marks,
    # ``later`` what a later visit gains, ``chance`` that the team reaches it.
    nodes: RecordArray
    # Of each arc, its ``position`` on the trail or −1; the ``mark`` of the last child that took it,
    # and its ``place`` among that child's new arcs.
    arcs: RecordArray
    # The child's new arcs, and all of them (n_arcs).
    middle: OffsetArray
    child: OffsetArray
    # Nodes that a child visits between its prefix and its suffix, and arcs that it takes then.
    goals: OffsetArray
    piece: OffsetArray
    # Nodes that the other robots reach, and that the team does (n_nodes).
    touched: OffsetArray
    reached: OffsetArray
    # Trails of the parent's plan, and of the child's (n_robots), and a single one (1).
    held: OffsetArray
    trails: OffsetArray
    single: OffsetArray


def new_memory() -> Record:
    """Give the memory of a search that has not begun."""
    memory: Record = np.zeros(1, _MEMORY).view(np.recarray)[0]
    memory.newest = -1.0
    return memory


def new_workspace(graph: Graph, n_robots: int, **remembered: Any) -> Workspace:
    """Make the scratch of a search, beside what it remembers: ``memory`` to ``weights``."""
    n_nodes, n_arcs = graph.n_nodes, graph.n_arcs
    nodes, arcs = np.zeros(n_nodes, _NODE), np.zeros(n_arcs, _ARC)
    nodes["left"], nodes["unreached"], nodes["met"] = graph.reward, -1.0, NEVER
    nodes["left"][graph.base] = 0.0
    arcs["position"] = -1
    return Workspace(
        **remembered,
        now=np.zeros(1, _NOW).view(np.recarray)[0],
        steps=np.zeros(n_arcs + 1, _STEP).view(np.recarray),
        nodes=nodes.view(np.recarray),
        arcs=arcs.view(np.recarray),
        middle=np.empty(n_arcs, np.int64),
        child=np.empty(n_arcs, np.int64),
        goals=np.empty(_MOST_GOALS, np.int64),
        piece=np.empty(n_arcs, np.int64),
        touched=np.empty(n_nodes, np.int64),
        reached=np.empty(n_nodes, np.int64),
        held=np.empty(n_robots, np.int64),
        trails=np.empty(n_robots, np.int64),
        single=np.empty(1, np.int64),
    )


@helper
def add_trail(graph: Graph, store: TrailStore, work: Workspace, length: int) -> int:
    """Store a trail, which one plan has, and give its number; the store has room (``fits``).

    Its arcs are the first ones in ``work.child``.
    """
    n, nodes = store.n, work.nodes
    work.now.mark += 1
    mark = work.now.mark
    n.spare -= 1
    trail = store.spare[n.spare]
    added = store.trails[trail]
    added.first_arc, added.n_arcs, added.first_visit = n.arcs, length, n.visits
    nodes[graph.base].seen = mark
    alive = 1.0
    for i in range(length):
        arc = work.child[i]
        store.arc[n.arcs + i] = arc
        alive *= graph.survival[arc]
        node = graph.head[arc]
        if graph.reward[node] > 0.0 and nodes[node].seen != mark:
            nodes[node].seen = mark
            store.node[n.visits], store.reach[n.visits] = node, alive
            n.visits += 1
    n.arcs += length
    added.n_visits = n.visits - added.first_visit
    added.alive, added.n_users = alive, 1
    return int(trail)


@helper
def put_in_order(store: TrailStore, work: Workspace, trail: int) -> None:
    """Write the parent's trails to ``work.trails``, with another one for the robot at hand."""
    n = 0
    placed = False
    for k in range(work.held.shape[0]):
        if k == work.now.robot:
            continue
        if not placed and comes_before(store, trail, work.held[k]):
            work.trails[n] = trail
            placed = True
            n += 1
        work.trails[n] = work.held[k]
        n += 1
    if not placed:
        work.trails[n] = trail


@helper
def evaluate_trails(graph: Graph, store: TrailStore, work: Workspace) -> tuple[float, float]:
    """Give E[R] and E[S] of the plan in ``work.trails``: the bits of ``evaluate``."""
    nodes, reached = work.nodes, work.reached
    work.now.mark += 1
    mark = work.now.mark
    n = 0
    survivors = 0.0
    for k in range(work.trails.shape[0]):
        trail = store.trails[work.trails[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            node = np.int64(store.node[i])
            here = nodes[node]
            if here.seen != mark:
                here.seen, here.chance = mark, store.reach[i]
                reached[n] = node
                n += 1
            else:
                here.chance = either(here.chance, store.reach[i])
        survivors += trail.alive
    expected_reward = graph.reward[graph.base]
    for i in range(n):
        expected_reward += graph.reward[reached[i]] * nodes[reached[i]].chance
    return expected_reward, survivors


@helper
def set_aside(graph: Graph, store: TrailStore, work: Workspace) -> None:
    """Let the others of the robots in ``held`` go first; ``clear_others`` undoes it.

    The base's reward is theirs.
    """
    now, nodes, touched = work.now, work.nodes, work.touched
    now.touched, now.others, now.survivors = 0, graph.reward[graph.base], 0.0
    for k in range(work.held.shape[0]):
        if k == now.robot:
            continue
        trail = store.trails[work.held[k]]
        for i in range(trail.first_visit, trail.first_visit + trail.n_visits):
            node, reach = np.int64(store.node[i]), store.reach[i]
            here = nodes[node]
            if here.unreached < 0.0:
                here.unreached = 1.0
                touched[now.touched] = node
                now.touched += 1
            # Small chances keep their digits so, which the reward minus what is left would lose.
            now.others += graph.reward[node] * here.unreached * reach
            here.unreached *= 1.0 - reach
        now.survivors += trail.alive
    for i in range(now.touched):
        here = nodes[touched[i]]
        here.left = graph.reward[touched[i]] * here.unreached


@helper
def clear_others(graph: Graph, work: Workspace) -> None:
    """Leave the workspace as it was before ``set_aside``."""
    for i in range(work.now.touched):
        node = work.touched[i]
        work.nodes[node].left, work.nodes[node].unreached = graph.reward[node], -1.0


@helper
def lay_out(graph: Graph, store: TrailStore, work: Workspace, trail: int) -> None:
    """Lay out the trail that is to be changed, when the others have been set aside.

    ``clear_trail`` undoes it.
    """
    steps, nodes = work.steps, work.nodes
    start, length = store.trails[trail].first_arc, store.trails[trail].n_arcs
    work.now.length = length
    nodes[graph.base].met = 0
    alive, gained = 1.0, 0.0
    steps[0].node, steps[0].alive, steps[0].gained = graph.base, alive, gained
    for i in range(length):
        arc = np.int64(store.arc[start + i])
        node = graph.head[arc]
        steps[i].arc = arc
        work.arcs[arc].position = i
        alive *= graph.survival[arc]
        if nodes[node].met == NEVER:
            nodes[node].met = i + 1
            gained += nodes[node].left * alive
        steps[i + 1].node, steps[i + 1].alive, steps[i + 1].gained = node, alive, gained
    # Backwards: what lies ahead when nothing has been collected; a node that comes again later
    # counts now instead.
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
    for i in range(work.now.length):
        node = steps[i + 1].node
        work.arcs[steps[i].arc].position = -1
        nodes[node].met, nodes[node].later = NEVER, 0.0
    nodes[graph.base].met = NEVER
