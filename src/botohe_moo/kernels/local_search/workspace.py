"""What a search works with: its rule, what it remembers, and scratch."""

from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.kernels.graph.graph import Graph

# A plan that gains less than this, relative, is taken for one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = 1e-12

NEVER = np.int64(1) << 40

_MEMORY = np.dtype([("newest", np.float64), ("idle", np.int64)])
_PARENT = ("at", "robot", "chosen", "touched")
_CHILD = ("length", "prefix", "middle", "suffix", "goals", "piece", "legs", "mark")
_NOW = np.dtype(
    [(name, np.int64) for name in (*_PARENT, *_CHILD)]
    + [(name, np.float64) for name in ("others", "survivors", "slope")]
)
_STEP = np.dtype(
    [
        ("arc", np.int64),
        ("node", np.int64),
        ("alive", np.float64),
        ("gained", np.float64),
        ("ahead", np.float64),
        ("walked", np.float64),
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
_LEG = np.dtype(
    [(name, np.int64) for name in ("before", "after", "then", "tour")]
    + [(name, np.float64) for name in ("cost", "length", "danger", "survival", "alive", "ahead")]
)
_ROOM = np.dtype([(name, np.float64) for name in ("danger", "length")])
MOST_GOALS = 64


class SearchRule(NamedTuple):
    """How to search; :class:`~botohe_moo.ParetoLocalSearch` documents what users may set."""

    # Children of a parent before the next is drawn; and as long as the search is busy.
    n_children: int = 24
    n_children_busy: int = 8
    busy: int = 100  # it is when a plan has entered the front within so many evaluations
    # With what probability the next parent is the plan that has just entered the front.
    p_newest: float = 0.9
    # With what probability the parent is the plan of most reward; and where all its robots survive.
    p_end: float = 0.1
    p_safe_end: float = 0.4
    # Plans among which a parent is chosen, by the area that its neighbours leave it divided by how
    # often it has been a parent; and as long as the search is busy.
    n_drawn: int = 2
    n_drawn_busy: int = 8
    # After so many evaluations without a plan that enters the front, with what probability another
    # robot of a parent takes a trail of another plan, so that two of its trails change.
    patience: int = 2_000
    p_other: float = 0.5
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
    # With what probability a parent is refilled instead, ``n_refills`` times, at least: the n-th
    # time that a plan is a parent, it is 1 / n² or more. Then, with what probability another
    # robot's trail is refilled with that of the robot at hand, and yet another, and so on.
    p_refill: float = 0.02
    n_refills: int = 4
    p_pair: float = 0.7
    # With what probability there is room up to the limits; otherwise danger may differ from that of
    # the trail by so much, on the scale of logarithms.
    p_full: float = 0.5
    spread: float = 0.6
    # Unless the search is busy, with what probability that is a walk, of ``n_walk`` steps for each
    # node, and which share of a plan's value its first step may lose.
    p_walk: float = 0.08
    n_walk: int = 8
    threshold: float = 0.05
    min_survival: float = 0.0  # survival floor of every robot
    max_length: float = np.inf  # travel budget of every robot

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
    # many nodes the others reach (``touched``), and E[R] and E[S] of these (``others`` and
    # ``survivors``). Of the trail: how many arcs it has (``length``). Of the child: how many arcs
    # are kept from the trail's start (``prefix``), how many are new (``middle``), from which
    # position the trail is kept to its end (``suffix``), how many ``goals`` there are, and arcs in
    # the ``piece``. And the last ``mark``.
    now: Record
    # At each position of the trail (n_arcs + 1) the ``node`` and the ``arc`` that leaves it; the
    # probability to get there (``alive``); what was collected up to there (``gained``), and what a
    # robot sure to be there that had collected nothing would collect from there on (``ahead``); and
    # how long the trail is up to there (``walked``).
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
    # Trails of the parent's plan, and of the child's (n_robots).
    held: OffsetArray
    trails: OffsetArray
    # Of the robots that are refilled together (``chosen``, the first of them): the trails of all
    # robots then (``refilled``; n_robots), how much more danger, −log of a survival, and length
    # there is room for (``rooms``), and the first leg of each tour (``first``).
    chosen: OffsetArray
    refilled: OffsetArray
    rooms: RecordArray
    first: OffsetArray
    # Legs of all tours: the stops ``before`` and ``after`` it, the leg that follows (``then``),
    # which ``tour`` it is of, its ``cost``, ``length``, ``danger`` and ``survival``, with what
    # probability it is begun (``alive``), and what is collected behind it then (``ahead``).
    legs: RecordArray
    # Of each node, what it is ``worth``, what it costs ``extra`` in the leg where it costs least,
    # and which leg that is (``place``; n_nodes).
    extra: FloatArray
    place: OffsetArray
    worth: FloatArray


def new_memory() -> RecordArray:
    """Return the memory of a search that has not begun, as an array of one record.

    A record alone would not do: numpy writes to a copy of one that was unpickled.
    """
    memory = np.zeros(1, _MEMORY).view(np.recarray)
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
        goals=np.empty(max(MOST_GOALS, n_nodes), np.int64),
        piece=np.empty(n_arcs, np.int64),
        touched=np.empty(n_nodes, np.int64),
        reached=np.empty(n_nodes, np.int64),
        held=np.empty(n_robots, np.int64),
        trails=np.empty(n_robots, np.int64),
        chosen=np.zeros(n_robots, np.int64),
        refilled=np.zeros(n_robots, np.int64),
        rooms=np.zeros(n_robots, _ROOM).view(np.recarray),
        first=np.zeros(n_robots, np.int64),
        legs=np.zeros(n_nodes * (n_robots + 1), _LEG).view(np.recarray),
        extra=np.empty(n_nodes),
        place=np.zeros(n_nodes, np.int64),
        worth=np.empty(n_nodes),
    )
