"""What a search works with: cheapest paths, the front and its trails, what it remembers, scratch.

Trails are shared by many plans: each is stored once, as long as some plan has it. A child differs
from its parent in one trail, so that the memory and the time that it takes depend on the length of
that trail, not on the size of the team.

Cheapest paths to every node are searched before the search begins.
On missions of up to ``FULL_UP_TO`` nodes a row holds the paths to a node from all nodes. On larger
ones it holds those from the ``NEAR`` nodes that are cheapest to come from, so that memory grows
with the number of nodes, not with its square. Only the ways to the base are known from everywhere.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray, IntArray, OffsetArray, Record, RecordArray, SeedArray
from botohe_moo.core.compile import at_once, helper, shared
from botohe_moo.core.evaluate import Reached, new_reached
from botohe_moo.core.ordered import OrderedFront
from botohe_moo.core.paths import (
    ANYWHERE,
    Near,
    Paths,
    new_near,
    new_paths,
    search_near,
    search_paths,
)
from botohe_moo.core.threads import apart
from botohe_moo.core.walk import Visits, new_visits
from botohe_moo.core.world import CHECKING, Graph, World

FULL_UP_TO = 1_000
NEAR = 200

FAR = 1e300  # what a path costs where there is none: finite, so that 0 times it is 0
UNKNOWN = -1  # instead of an entry, where no path is known

_N_NEIGHBOURS = 12
_ENTRY = np.dtype(
    [("cost", np.float64), ("length", np.float64)]
    + [(name, np.int32) for name in ("source", "arc", "onward")]
)

# A plan that gains less than this, relative, counts as one that the front has already: the
# objectives of children are computed in another order of operations than those of the front.
TOLERANCE = CHECKING

NEVER = np.int64(1) << 40  # the position of a node that a trail does not visit
NOT_STORED = -1  # instead of the number of a trail

# How many children a parent has, and how many plans are drawn for it to be chosen among.
N_CHILDREN, N_DRAWN = 24, 2
# The same while the search is busy: a plan has entered the front within ``BUSY`` evaluations.
N_CHILDREN_BUSY, N_DRAWN_BUSY, BUSY = 8, 8, 100
# How many trails a parent may need, beside those of a whole new plan.
N_TRAILS = N_CHILDREN + 1

# How many plans wait for ruin and recreate, one after another: a short run does not compile it.
QUEUE = 32

TIMED_EVERY = 8  # the time of moves is taken of every so many parents, since taking it costs some

MOST_GOALS = 64  # how many nodes a move visits at most

_STORE = np.dtype([(name, np.int64) for name in ("arcs", "visits", "spare")])
_TRAIL = np.dtype(
    [
        ("first_arc", np.int64),
        ("end_arc", np.int64),
        ("n_arcs", np.int64),
        ("first_visit", np.int64),
        ("n_visits", np.int64),
        ("n_users", np.int64),
        ("alive", np.float64),
        ("hash", np.uint64),
    ]
)
_MEMORY = ("idle", "n_waiting", "most_waiting", "n_parents")
MEMORY = np.dtype([("newest", np.float64), *((name, np.int64) for name in _MEMORY)])
_PARENT = ("place", "robot", "n_chosen", "n_touched", "layer", "table")
_CHILD = ("length", "prefix", "n_middle", "suffix", "n_goals", "n_piece", "n_legs", "mark")
_MOVE = ("n_steps", "adopted")
_DRAFT = np.dtype(
    [(name, np.int64) for name in (*_PARENT, *_CHILD, *_MOVE)]
    + [(name, np.float64) for name in ("at", "others", "survivors", "value", "slope")]
)
_STEP = np.dtype(
    [(name, np.int64) for name in ("arc", "node")]
    + [(name, np.float64) for name in ("survival", "alive", "gained", "ahead", "home", "walked")]
)
_CASE = np.dtype(
    [(name, np.float64) for name in ("alive", "gained", "carried", "aboard")]
    + [("first", np.int64)]
)
_LOAD = np.dtype([(name, np.float64) for name in ("carried", "to_depot")])
_NODE = np.dtype(
    [(name, np.int64) for name in ("met", "seen")]
    + [(name, np.float64) for name in ("marginal", "unreached", "later")]
)
_ARC = np.dtype([(name, np.int64) for name in ("position", "mark", "place")])
_LEG = np.dtype(
    [(name, np.int64) for name in ("before", "after", "following", "tour")]
    + [(name, np.float64) for name in ("cost", "length", "danger", "survival")]
    + [(name, np.float64) for name in ("alive", "ahead")]
)
_SLACK = np.dtype([(name, np.float64) for name in ("danger", "length")])
TALLY = np.dtype([(name, np.int64) for name in ("tried", "entered", "ticks")])


class Routes(NamedTuple):
    """Cheapest paths, a row for every node where they lead to.

    There may be several tables, one after another: by expected survivals, and by those of
    scenarios. Each parent's children are made with one of them.
    """

    n_known: OffsetArray  # entries in each row (n_tables · n_nodes)
    # Where a path begins (``source``, ascending along the known part of a row), its ``cost`` and
    # its ``length``, its first ``arc``, −1 at the goal itself, and the entry, in the same row, of
    # that arc's head (``onward``; n_tables · n_nodes, n_entries).
    entries: RecordArray
    # Of each node, the others that are cheapest to reach (n_tables · n_nodes, n_near).
    near: OffsetArray
    # Costs of the cheapest paths from each node to all (``leaving``), and to it from all
    # (``coming``), and the lengths of these paths (n_tables · n_nodes, n_nodes). Without travel
    # budgets there are no lengths, and on missions of more than ``FULL_UP_TO`` nodes neither.
    leaving: FloatArray
    coming: FloatArray
    leaving_length: FloatArray
    coming_length: FloatArray
    # What a unit of length costs in the layer of each node (n_nodes), and whether lengths cost
    # anything.
    per_length: FloatArray
    prices_length: bool


def find_routes(worlds: Sequence[World], per_length: FloatArray) -> Routes:
    """Search all cheapest paths, a table for the costs of each world.

    ``per_length`` is what a unit of length adds to the costs of arcs in the layer of each node.
    """
    first, n_tables = worlds[0], len(worlds)
    n_nodes, is_full = first.graph.n_nodes, first.graph.n_nodes <= FULL_UP_TO
    n_known = np.zeros(n_tables * n_nodes, np.int64)
    shape = n_tables * n_nodes, n_nodes if is_full else NEAR
    entries = np.empty(shape, _ENTRY).view(np.recarray)
    entries.cost, entries.length = FAR, 0.0
    nears = []
    parts = (np.split(of, n_tables) for of in (n_known, entries))
    for world, known, found in zip(worlds, *parts, strict=True):
        nears.append(new_near(n_nodes, _N_NEIGHBOURS))
        used = np.zeros(world.graph.n_arcs, np.int64)  # every path may take all arcs
        _search_all(world.graph, new_paths(world), used, nears[-1], known, found)
    none, prices_length = np.empty((0, 0)), first.limits.has_budgets
    costs = entries["cost"].copy() if is_full else none
    lengths = entries["length"].copy() if is_full and prices_length else none
    return Routes(
        n_known=n_known,
        entries=entries,
        near=np.concatenate([near.nodes for near in nears]),
        leaving=_turned(costs, n_tables),
        coming=costs,
        leaving_length=_turned(lengths, n_tables),
        coming_length=lengths,
        per_length=per_length,
        prices_length=prices_length,
    )


def _turned(costs: FloatArray, n_tables: int) -> FloatArray:
    """Return tables with rows for where paths begin, of tables with rows for where they lead to."""
    return np.concatenate([table.T.copy() for table in np.split(costs, n_tables)])


@at_once(lambda graph, *_: 1e-5 * graph.n_nodes * graph.n_arcs)
def _search_all(
    graph: Graph,
    paths: Paths,
    used: OffsetArray,
    near: Near,
    n_known: OffsetArray,
    entries: RecordArray,
) -> None:
    graph, paths, near = shared(graph), shared(paths), shared(near)
    for node in range(graph.reward.shape[0]):
        search_near(graph, paths, used, near, node)
        n = search_paths(graph, paths, used, 1, node, ANYWHERE, entries.shape[1], True)
        n_known[node] = _fill_row(graph, paths, n, entries[node])


@helper
def _fill_row(graph: Graph, paths: Paths, n: int, row: RecordArray) -> int:
    """Fill in the row of a goal from the last search, which found ``n`` paths; return its size."""
    place, n_nodes = paths.heap_nodes, paths.met.shape[0]
    is_full = row.shape[0] == n_nodes
    found = -paths.n_searches[0]
    for i in range(n):
        paths.met[paths.order[i]] = found  # negative, as no search marks nodes
    n_known = 0
    for node in range(n_nodes):
        if is_full or paths.met[node] == found:
            place[node] = n_known
            n_known += 1
    for i in range(n):  # the nearest first, so that the rest of a path is known
        node = paths.order[i]
        entry, arc = row[place[node]], paths.entry[node]
        entry.cost, entry.source, entry.arc = paths.distance[node], node, arc
        entry.onward, entry.length = place[node], 0.0
        if arc >= 0:
            entry.onward = place[graph.head[arc]]
            entry.length = graph.length[arc] + row[entry.onward].length
    return n_known


@helper
def route_entry(routes: Routes, goal: int, node: int) -> int:
    """Return the entry of the path from ``node`` in a goal's row, or ``UNKNOWN``."""
    row = routes.entries[goal]
    if routes.leaving.shape[0] > 0:
        return node if row[node].cost < FAR else UNKNOWN
    low, high = 0, routes.n_known[goal]
    while low < high:
        middle = (low + high) // 2
        if row[middle].source < node:
            low = middle + 1
        else:
            high = middle
    known = low < routes.n_known[goal] and row[low].source == node
    return low if known else UNKNOWN


class TrailStore(NamedTuple):
    """Trails by number: their arcs, and what they reach."""

    n: Record  # how many ``arcs`` and ``visits`` are in use, and how many trails are ``spare``
    # Of each trail, where its arcs and visits begin, and its arcs end; how many there are; how many
    # plans have it (``n_users``); with what probability a robot survives it (``alive``); and the
    # ``hash`` of where it begins and of its arcs.
    trails: RecordArray
    arc: IntArray  # the arcs of all trails, one trail after another
    # What each trail visits in each scenario, in order: nodes of the mission that may be worth
    # something, as indices of ``Team.worth``, and the probability that each is credited.
    node: IntArray
    reach: FloatArray
    spare: OffsetArray  # numbers that are free, as a stack


class Workspace(NamedTuple):
    """What a search remembers, and scratch that holds nothing between two parents."""

    # E[S] of the plan that entered the front last, −1 once it has been a parent (``newest``); how
    # many plans have been evaluated since one entered (``idle``); how many wait for ruin and
    # recreate (``n_waiting``), and how many may (``most_waiting``); and how many parents there were
    # (``n_parents``).
    memory: Record
    waiting: FloatArray  # E[S] of each plan that waits (QUEUE)
    states: SeedArray  # the search's random numbers (1, 2)
    weights: FloatArray  # how likely each move is, relative, summed up to each (n_moves)
    # Of each move, and last of ruin and recreate, how many children were ``tried``, how many plans
    # ``entered`` the front, and how many ticks of the processor's counter it took (n_moves + 1).
    tallies: RecordArray
    # Of the parent: its ``place`` in the front, or the one next to its E[S] (``at``) once it has
    # left; the ``robot`` that changes, and the first node of its kind's layer (``layer``); the
    # first row of its ``table`` of paths; how much the others reach (``n_touched``), and their E[R]
    # and E[S] (``others`` and ``survivors``). Of the trail: how many arcs it has (``length``). Of
    # the child: how many arcs are kept from the trail's start (``prefix``), how many are new
    # (``n_middle``), from which position the trail is kept to its end (``suffix``), how many goals
    # there are (``n_goals``), and arcs in the piece (``n_piece``). Of a move: how many random steps
    # it begins with (``n_steps``), and which stored trail it takes as a whole, or ``NOT_STORED``
    # (``adopted``). Of ruin and recreate: how many robots are changed (``n_chosen``), how many legs
    # their tours have (``n_legs``), and what the parent (``value``) and a survivor (``slope``) are
    # worth to a walk. And the last ``mark``.
    draft: Record
    # In each scenario at each position of the trail (n_scenarios, n_arcs + 1) the ``node``, and the
    # ``arc`` that leaves it; the probability to survive the arc that leads there (``survival``),
    # and all arcs from the start (``alive``); what was collected up to there (``gained``); what a
    # robot that starts there would collect from there on, or more (``ahead``); the probability to
    # get from there to the end (``home``); and how long the trail is up to there (``walked``).
    steps: RecordArray
    # At each of these, with rewards on return, those that are ``carried``, and the probability to
    # get from there to the next depot (``to_depot``).
    loads: RecordArray
    # In each scenario: the reward that the robot carries from the start (``aboard``); and of a
    # child where its suffix begins, the probability to get there (``alive``), what it has
    # ``gained``, and what it has ``carried`` there; and the ``first`` of its ``nodes``
    # (n_scenarios).
    cases: RecordArray
    # Of each node: its ``marginal`` reward, given the other robots' trails; the probability that
    # none of them collects it, −1 where none may (``unreached``); the position of the trail's first
    # visit, or ``NEVER`` (``met``); and scratch: the last mark (``seen``), and what a later visit
    # gains (``later``). If there are several scenarios, the first n_nodes are what a robot expects
    # over all of them; those of each scenario follow, with rewards weighted by its probability.
    # And what ``marginal`` is where no other robot collects anything (``alone``).
    nodes: RecordArray
    alone: FloatArray
    # Of each arc, its ``position`` on the trail or −1; the ``mark`` of the last child that took it,
    # and its ``place`` among that child's new arcs.
    arcs: RecordArray
    # The child's new arcs, and all of them (n_arcs).
    middle: OffsetArray
    child: OffsetArray
    # Nodes that a child visits between its prefix and its suffix, and arcs that it takes then.
    goals: OffsetArray
    piece: OffsetArray
    touched: OffsetArray  # which of ``nodes`` the other robots reach
    # Scratch of evaluations.
    visits: Visits
    reached: Reached
    # Trails of the parent, and of the child, in lexicographic order (n_robots).
    parent: OffsetArray
    trails: OffsetArray
    # Robots, those that are changed first (``chosen``); the trails of a recreated plan
    # (``recreated``; n_robots); how much more danger, −log of a survival, and length each tour may
    # take (``slacks``); and the first leg of each tour (``first``).
    chosen: OffsetArray
    recreated: OffsetArray
    slacks: RecordArray
    first: OffsetArray
    # Legs of all tours: the stops ``before`` and ``after`` it; the leg that follows; its ``tour``;
    # its ``cost``, ``length``, ``danger`` and ``survival``; with what probability it is begun
    # (``alive``), and what a robot that begins it collects behind it (``ahead``).
    legs: RecordArray
    order: OffsetArray  # the legs of a tour in order (n_legs)
    # Of each node, what it is ``worth``, what it costs to insert it where this is cheapest, and
    # the leg where that is (n_nodes).
    worth: FloatArray
    insertion_cost: FloatArray
    cheapest_leg: OffsetArray


class Given(NamedTuple):
    """Plans for a front to take over; a trail that several plans have is given once."""

    plan: IntArray  # numbers of each plan's trails (n_plans, n_robots)
    # Trail t is ``nodes[offsets[t]:offsets[t + 1]]``.
    nodes: IntArray | OffsetArray
    offsets: OffsetArray
    objectives: FloatArray  # E[R] and E[S] of each plan, inf where they are not known (n_plans, 2)
    tried: OffsetArray  # how often each plan has been a parent (n_plans)
    hash: SeedArray  # of each trail, 0 where it is not known
    # Scratch: the number of each trail in the store, ``NOT_STORED`` before it was needed.
    stored: OffsetArray


class Search(NamedTuple):
    """A search: the mission, the front and its trails, and what the kernels need beside these."""

    world: World  # with lengths in the costs of arcs, where there are travel budgets
    routes: Routes
    store: TrailStore
    front: OrderedFront
    work: Workspace
    # The least probability with which a parent is ruined and recreated instead; 0 for never.
    p_recreate: float


def new_workspace(
    world: World,
    *,
    memory: Record,
    waiting: FloatArray,
    states: SeedArray,
    weights: FloatArray,
    tallies: RecordArray,
) -> Workspace:
    """Return a workspace of what a search remembers, with new scratch."""
    n_nodes, n_arcs, n_robots = world.graph.n_nodes, world.graph.n_arcs, world.n_robots
    n_scenarios, on_return = world.graph.n_scenarios, world.returns is not None
    n_legs = (n_nodes + 1) * (n_robots + 1)
    alone = _rewards_alone(world)
    nodes, arcs = np.zeros(len(alone), _NODE), np.zeros(n_arcs, _ARC)
    nodes["marginal"], nodes["unreached"], nodes["met"] = alone, -1.0, NEVER
    arcs["position"] = -1
    n_steps = max(2, n_arcs + 1)  # two for ``_store_tour``
    cases = np.zeros(n_scenarios, _CASE)
    cases["first"] = np.arange(len(alone) - n_scenarios * n_nodes, len(alone), n_nodes)
    work = Workspace(
        memory=memory,
        waiting=waiting,
        states=states,
        weights=weights,
        tallies=tallies,
        draft=np.zeros(1, _DRAFT).view(np.recarray)[0],
        steps=np.zeros((n_scenarios, n_steps), _STEP).view(np.recarray),
        loads=np.zeros((n_scenarios, n_steps if on_return else 0), _LOAD).view(np.recarray),
        cases=cases.view(np.recarray),
        nodes=nodes.view(np.recarray),
        alone=alone,
        arcs=arcs.view(np.recarray),
        middle=np.empty(n_arcs, np.int64),
        child=np.empty(n_arcs, np.int64),
        goals=np.empty(max(MOST_GOALS, n_nodes), np.int64),
        piece=np.empty(n_arcs, np.int64),
        touched=np.empty(len(world.team.worth), np.int64),
        visits=new_visits(n_nodes, n_scenarios),
        reached=new_reached(len(world.team.worth)),
        parent=np.empty(n_robots, np.int64),
        trails=np.empty(n_robots, np.int64),
        chosen=np.zeros(n_robots, np.int64),
        recreated=np.zeros(n_robots, np.int64),
        slacks=np.zeros(n_robots, _SLACK).view(np.recarray),
        first=np.zeros(n_robots, np.int64),
        legs=np.zeros(n_legs, _LEG).view(np.recarray),
        order=np.empty(n_legs, np.int64),
        worth=np.empty(n_nodes),
        insertion_cost=np.empty(n_nodes),
        cheapest_leg=np.zeros(n_nodes, np.int64),
    )
    scratch: Workspace = apart(work)
    return scratch._replace(memory=memory, waiting=waiting, states=states, tallies=tallies)


def _rewards_alone(world: World) -> FloatArray:
    """Return what nodes are worth to a robot that is alone, as ``Workspace.alone`` has it."""
    team, n_nodes, n_scenarios = world.team, world.graph.n_nodes, world.graph.n_scenarios
    worth: FloatArray = team.worth.reshape(n_scenarios, n_nodes)
    by_scenario: FloatArray = worth[:, team.origin] * team.share
    return by_scenario[0] if n_scenarios == 1 else np.append(by_scenario.sum(axis=0), by_scenario)


def new_store(n_trails: int, n_arcs: int, n_visits: int) -> TrailStore:
    """Return a store with room for some trails, and for the arcs and visits of all of them."""
    parts = TrailStore(
        n=np.zeros(1, _STORE).view(np.recarray)[0],
        trails=np.zeros(n_trails, _TRAIL).view(np.recarray),
        arc=np.zeros(n_arcs, np.int32),
        node=np.zeros(n_visits, np.int32),
        reach=np.zeros(n_visits),
        spare=np.arange(n_trails)[::-1].copy(),
    )
    store: TrailStore = apart(parts)
    store.n.spare = n_trails
    return store


def copy_trails(store: TrailStore, into: TrailStore) -> None:
    """Copy trails that some plan has into an empty store, without gaps; they keep their numbers."""
    used = np.flatnonzero(store.trails["n_users"])
    trails = into.trails[used] = store.trails[used]
    arcs = ragged(trails["first_arc"], trails["n_arcs"])
    visits = ragged(trails["first_visit"], trails["n_visits"])
    into.arc[: len(arcs)] = store.arc[arcs]
    into.node[: len(visits)], into.reach[: len(visits)] = store.node[visits], store.reach[visits]
    into.trails["end_arc"][used] = np.cumsum(trails["n_arcs"])
    into.trails["first_arc"][used] = into.trails["end_arc"][used] - trails["n_arcs"]
    into.trails["first_visit"][used] = np.cumsum(trails["n_visits"]) - trails["n_visits"]
    into.n.arcs, into.n.visits = len(arcs), len(visits)
    free = np.flatnonzero(into.trails["n_users"] == 0)[::-1]
    into.spare[: len(free)] = free
    into.n.spare = len(free)


def ragged(first: OffsetArray, lengths: OffsetArray) -> OffsetArray:
    """Return the indices of stretches of an array, one stretch after another."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(first - before, lengths) + np.arange(lengths.sum())


@helper
def has_room(search: Search) -> bool:
    """Return whether there is room for what one parent needs, however long its trails are."""
    store, graph = search.store, search.world.graph
    n, n_trails = store.n, max(N_TRAILS, search.work.parent.shape[0] + 1)
    return bool(
        search.front.n.spare > N_CHILDREN
        and n.spare >= n_trails
        and n.arcs + n_trails * graph.head.shape[0] <= store.arc.shape[0]
        and n.visits + n_trails * search.world.team.worth.shape[0] <= store.node.shape[0]
    )


@helper
def release(store: TrailStore, trail: int) -> None:
    """Note that a trail has one user less; where none is left, its number is free.

    So is its room, if it was stored last.
    """
    n, left = store.n, store.trails[trail]
    left.n_users -= 1
    if left.n_users > 0:
        return
    store.spare[n.spare] = trail
    n.spare += 1
    if left.end_arc == n.arcs and left.first_visit + left.n_visits == n.visits:
        n.arcs, n.visits = left.first_arc, left.first_visit
