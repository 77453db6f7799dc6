"""What a search works with: its rule, what it remembers, and scratch."""

from typing import Any, NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans.evaluate import Team, new_team

# A plan that gains less than this, relative, is taken for one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = 1e-12

NEVER = np.int64(1) << 40

# The search is busy when a plan has entered the front within this many evaluations.
BUSY = 100

# Plans that are refilled one after another, when as many wait for it.
REFILLED_AT_ONCE = 32

_MEMORY = np.dtype([("newest", np.float64), ("idle", np.int64), ("n_waiting", np.int64)])
_PARENT = ("at", "robot", "chosen", "touched")
_CHILD = ("length", "prefix", "middle", "suffix", "goals", "piece", "legs", "mark")
_DRAFT = np.dtype(
    [(name, np.int64) for name in (*_PARENT, *_CHILD)]
    + [(name, np.float64) for name in ("others", "survivors")]
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

    n_children: int = 24  # of a parent; a third of that as long as the search is busy
    # Plans among which a parent is chosen, by the area that its neighbours leave it divided by how
    # often it has been a parent; four times as many (but 1 stays 1) as long as the search is busy.
    n_drawn: int = 2
    # With what probability a parent is refilled, at least: on its n-th turn it is 1 / n² or more.
    p_refill: float = 0.02
    min_survival: float = 0.0  # survival floor of every robot
    max_length: float = np.inf  # travel budget of every robot

    @property
    def n_added(self) -> int:
        """How many trails and plans a parent adds at most: its children, and one to spare."""
        return self.n_children + 1


class Workspace(NamedTuple):
    """What a search remembers, and scratch, which holds nothing between two parents."""

    # E[S] of the plan that has just entered the front, −1 where none has (``newest``), how many
    # plans have been evaluated since one entered (``idle``), and how many wait to be refilled
    # (``n_waiting``).
    memory: Record
    waiting: FloatArray  # E[S] of each of these (REFILLED_AT_ONCE)
    # How often each kind of move gave a child, and one that entered (2, N_KINDS).
    tally: OffsetArray
    states: SeedArray  # the search's random numbers (1, 2)
    weights: FloatArray  # how likely each kind of move is, relative, summed up to each (N_KINDS)
    # Of the parent: its block of the front, in the directory (``at``), the ``robot`` at hand, how
    # many nodes the others reach (``touched``), and E[R] and E[S] of these (``others`` and
    # ``survivors``). Of the trail: how many arcs it has (``length``). Of the child: how many arcs
    # are kept from the trail's start (``prefix``), how many are new (``middle``), from which
    # position the trail is kept to its end (``suffix``), how many ``goals`` there are, and arcs in
    # the ``piece``. Of a refill: how many robots are ``chosen``, how many ``legs`` their tours
    # have. And the last ``mark``.
    draft: Record
    # At each position of the trail (n_arcs + 1) the ``node`` and the ``arc`` that leaves it; the
    # probability to get there (``alive``); what was collected up to there (``gained``), and what a
    # robot sure to be there that had collected nothing would collect from there on (``ahead``); and
    # how long the trail is up to there (``walked``).
    steps: RecordArray
    # What the other robots leave of each node's reward, 0 at the base (``left``); the probability
    # that none of them reaches it, −1 where none may (``unreached``); the position of the trail's
    # first visit, ``NEVER`` where there is none (``met``); and scratch: ``seen`` holds marks,
    # ``later`` what a later visit gains.
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
    # Trails of the parent's plan, and of the child's (n_robots).
    parent: OffsetArray
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
    """Return the scratch of a search, beside what it remembers: ``memory`` to ``weights``."""
    n_nodes, n_arcs = graph.n_nodes, graph.n_arcs
    nodes, arcs = np.zeros(n_nodes, _NODE), np.zeros(n_arcs, _ARC)
    nodes["left"], nodes["unreached"], nodes["met"] = graph.reward, -1.0, NEVER
    nodes["left"][graph.base] = 0.0
    arcs["position"] = -1
    return Workspace(
        **remembered,
        draft=np.zeros(1, _DRAFT).view(np.recarray)[0],
        steps=np.zeros(n_arcs + 1, _STEP).view(np.recarray),
        nodes=nodes.view(np.recarray),
        arcs=arcs.view(np.recarray),
        middle=np.empty(n_arcs, np.int64),
        child=np.empty(n_arcs, np.int64),
        goals=np.empty(max(MOST_GOALS, n_nodes), np.int64),
        piece=np.empty(n_arcs, np.int64),
        touched=np.empty(n_nodes, np.int64),
        team=new_team(n_nodes),
        parent=np.empty(n_robots, np.int64),
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
