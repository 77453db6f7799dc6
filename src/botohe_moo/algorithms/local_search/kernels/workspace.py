"""What a search works with: the mission, the front, what it remembers, and scratch."""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.algorithms.local_search.kernels.routes import Routes
from botohe_moo.algorithms.local_search.kernels.trail_store import TrailStore
from botohe_moo.core.apart import apart
from botohe_moo.core.evaluate import Team, new_team
from botohe_moo.core.graph import Graph, Limits
from botohe_moo.core.kinds import has_kinds, has_returns
from botohe_moo.core.ordered import OrderedFront

# A plan that gains less than this, relative, counts as one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = 1e-12

# The position of a node that a trail does not visit.
NEVER = np.int64(1) << 40

# How many children a parent has, and how many plans are drawn for it to be chosen among.
N_CHILDREN, N_DRAWN = 24, 2
# The same while the search is busy: a plan has entered the front within ``BUSY`` evaluations.
N_CHILDREN_BUSY, N_DRAWN_BUSY, BUSY = 8, 8, 100
# The search is stuck when no plan has entered the front within as many evaluations; and the same
# with kinds, or rewards on return, where more fronts are small.
PATIENCE, PATIENCE_KINDS = 2_000, 500

# How many plans wait until they are refilled, one after another: a short run compiles no refilling.
REFILLED_AT_ONCE = 32
# And where several searches go on side by side, so that none takes much longer than the others.
REFILLED_IN_LANES = 8

MOST_GOALS = 64  # how many nodes a move visits at most

_COUNTS = ("idle", "n_waiting", "most_waiting")
MEMORY = np.dtype([("newest", np.float64), *((name, np.int64) for name in _COUNTS)])
_PARENT = ("block", "robot", "n_chosen", "n_touched", "layer")
_CHILD = ("length", "prefix", "n_middle", "suffix", "n_goals", "n_piece", "n_legs", "mark")
_DRAFT = np.dtype(
    [(name, np.int64) for name in (*_PARENT, *_CHILD)]
    + [(name, np.float64) for name in ("others", "survivors", "value", "slope")]
)
_STEP = np.dtype(
    [(name, np.int64) for name in ("arc", "node")]
    + [(name, np.float64) for name in ("alive", "gained", "ahead", "walked")]
)
_LOAD = np.dtype([(name, np.float64) for name in ("carried", "to_depot")])
_NODE = np.dtype(
    [(name, np.int64) for name in ("met", "seen")]
    + [(name, np.float64) for name in ("left", "unreached", "later")]
)
_ARC = np.dtype([(name, np.int64) for name in ("position", "mark", "place")])
_LEG = np.dtype(
    [(name, np.int64) for name in ("before", "after", "following", "tour")]
    + [(name, np.float64) for name in ("cost", "length", "danger", "survival")]
    + [(name, np.float64) for name in ("alive", "ahead")]
)
_SLACK = np.dtype([(name, np.float64) for name in ("danger", "length")])


class Workspace(NamedTuple):
    """What a search remembers, and scratch that holds nothing between two parents."""

    # E[S] of the plan that entered the front last, −1 once it has been a parent (``newest``); how
    # many plans have been evaluated since one entered (``idle``); how many wait to be refilled
    # (``n_waiting``), and how many may (``most_waiting``).
    memory: Record
    waiting: FloatArray  # E[S] of each plan that waits (REFILLED_AT_ONCE)
    states: SeedArray  # the search's random numbers (1, 2)
    weights: FloatArray  # how likely each kind of move is, relative, summed up to each (N_KINDS)
    # Of the parent: its ``block`` of the front, in the directory; the ``robot`` that changes, and
    # the first node of its kind's layer (``layer``); how many nodes the others reach
    # (``n_touched``), and E[R] and E[S] of these (``others`` and ``survivors``). Of the trail: how
    # many arcs it has (``length``). Of the child: how many arcs are kept from the trail's start
    # (``prefix``), how many are new (``n_middle``), from which position the trail is kept to its
    # end (``suffix``), how many goals there are (``n_goals``), and arcs in the piece (``n_piece``).
    # Of a refill: how many robots are refilled (``n_chosen``), how many legs their tours have
    # (``n_legs``), and what the parent (``value``) and a survivor (``slope``) are worth to a walk.
    # And the last ``mark``.
    draft: Record
    # At each position of the trail (n_arcs + 1) the ``node``, and the ``arc`` that leaves it; the
    # probability to get there (``alive``); what was collected up to there (``gained``); what a
    # robot that starts there would collect from there on (``ahead``); and how long the trail is up
    # to there (``walked``).
    steps: RecordArray
    # At each position, with kinds, the rewards that are carried (``carried``), and the probability
    # to get from there to the next depot (``to_depot``).
    loads: RecordArray
    # Of each node, what the other robots leave of its reward, 0 at the base (``left``); the
    # probability that none of them reaches it, −1 where none may (``unreached``); the position of
    # the trail's first visit, or ``NEVER`` (``met``); and scratch: the last mark (``seen``), and
    # what a later visit gains (``later``).
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
    touched: OffsetArray  # nodes that the other robots reach (n_nodes)
    team: Team  # scratch of evaluations
    # Trails of the parent, and of the child, in lexicographic order (n_robots).
    parent: OffsetArray
    trails: OffsetArray
    # Robots, those that are refilled first (``chosen``); the trails of a refilled plan
    # (``refilled``; n_robots); how much more danger, −log of a survival, and length each tour may
    # take (``slacks``); and the first leg of each tour (``first``).
    chosen: OffsetArray
    refilled: OffsetArray
    slacks: RecordArray
    first: OffsetArray
    # Legs of all tours: the stops ``before`` and ``after`` it; the leg that follows; its ``tour``;
    # its ``cost``, ``length``, ``danger`` and ``survival``; with what probability it is begun
    # (``alive``), and what a robot that begins it collects behind it (``ahead``).
    legs: RecordArray
    # With kinds, what a robot carries that begins each leg, and with what probability it gets to
    # the next depot, as in ``loads``. Apart from ``legs``, which have to be small to be fast.
    leg_loads: RecordArray
    # Of each node, what it is ``worth``, what it costs to insert it where this is cheapest, and
    # the leg where that is (n_nodes).
    worth: FloatArray
    insertion_cost: FloatArray
    cheapest_leg: OffsetArray


class Search(NamedTuple):
    """A search: the mission, the front and its trails, and what the kernels need beside these."""

    graph: Graph
    routes: Routes
    store: TrailStore
    front: OrderedFront
    work: Workspace
    limits: Limits
    # The least probability with which a parent is refilled, 0 for never; see ``_waits_for_refill``.
    p_refill: float


def new_workspace(
    graph: Graph,
    n_robots: int,
    *,
    memory: Record,
    waiting: FloatArray,
    states: SeedArray,
    weights: FloatArray,
) -> Workspace:
    """Return a workspace of what a search remembers, with new scratch."""
    n_nodes, n_arcs = graph.n_nodes, graph.n_arcs
    n_stops = 2 * n_nodes if has_returns(graph.kinds) else n_nodes  # of a tour, depots among them
    n_legs = (n_stops + 1) * (n_robots + 1)
    nodes, arcs = np.zeros(n_nodes, _NODE), np.zeros(n_arcs, _ARC)
    nodes["left"], nodes["unreached"], nodes["met"] = graph.reward, -1.0, NEVER
    if graph.kinds is None:  # all robots collect it, whatever they do
        nodes["left"][graph.base] = 0.0
    arcs["position"] = -1
    work = Workspace(
        memory=memory,
        waiting=waiting,
        states=states,
        weights=weights,
        draft=np.zeros(1, _DRAFT).view(np.recarray)[0],
        steps=np.zeros(max(2, n_arcs + 1), _STEP).view(np.recarray),  # two for ``store_tour``
        loads=np.zeros(n_arcs + 1, _LOAD).view(np.recarray),
        nodes=nodes.view(np.recarray),
        arcs=arcs.view(np.recarray),
        middle=np.empty(n_arcs, np.int64),
        child=np.empty(n_arcs, np.int64),
        goals=np.empty(max(MOST_GOALS, n_stops), np.int64),
        piece=np.empty(n_arcs, np.int64),
        touched=np.empty(n_nodes, np.int64),
        team=new_team(n_nodes),
        parent=np.empty(n_robots, np.int64),
        trails=np.empty(n_robots, np.int64),
        chosen=np.zeros(n_robots, np.int64),
        refilled=np.zeros(n_robots, np.int64),
        slacks=np.zeros(n_robots, _SLACK).view(np.recarray),
        first=np.zeros(n_robots, np.int64),
        legs=np.zeros(n_legs, _LEG).view(np.recarray),
        leg_loads=np.zeros(n_legs if has_kinds(graph.kinds) else 0, _LOAD).view(np.recarray),
        worth=np.empty(n_nodes),
        insertion_cost=np.empty(n_nodes),
        cheapest_leg=np.zeros(n_nodes, np.int64),
    )
    scratch: Workspace = apart(work)
    return scratch._replace(memory=memory, waiting=waiting, states=states)
