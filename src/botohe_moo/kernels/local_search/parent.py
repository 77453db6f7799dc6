"""One trail of one plan, laid out so that changing it costs what changes.

With the other robots' trails fixed, a node is worth to this robot what they leave of its reward:
the rest of the search sees a single robot. A child keeps a prefix of the trail, goes on along new
arcs, and ends with a suffix of it; its E[S] follows from three products, and its E[R] is bounded
before the suffix is walked.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import part
from botohe_moo.kernels.local_search.trail_store import TrailStore

# Indices into ``Workspace.now``.
LENGTH = 0  # arcs of the trail
N_TOUCHED = 1  # nodes that other robots reach
PREFIX = 2  # of the child: arcs kept from the start of the trail,
N_MIDDLE = 3  # new arcs,
SUFFIX = 4  # and the position from which the trail is kept to its end
MARK = 5  # number of the last child
WANTED = 6  # node whose paths have to be searched before there can be a child, or −1
N_NOW = 7

NEVER = np.int64(1) << 40

# States that a search for a best response remembers; a power of two.
N_KNOWN = 1 << 14


class Ground(NamedTuple):
    """What the search knows of a mission.

    Attributes
    ----------
    first, tail, head, survival, cost
        The arcs, grouped by tail node; cost is −log(survival).
    reverse
        Of each arc, the one between the same nodes the other way round, −1 where there is none.
    reward
        Of each node.
    near
        For each node others, the safest to reach first (n_nodes, n_near).
    home
        Survival of the safest path home from each node.
    by_return, return_reach
        For each node those with a reward, the safest to visit and get home from first, and the
        survival of the safest path to them (n_nodes, most_visits); empty where the mission is not
        small.
    key
        Random numbers: two for each node.
    base
        Index of the base.
    most_visits
        How many nodes have a reward.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    survival: FloatArray
    cost: FloatArray
    reverse: IntArray
    reward: FloatArray
    near: IntArray
    home: FloatArray
    by_return: IntArray
    return_reach: FloatArray
    key: SeedArray
    base: int
    most_visits: int


class Workspace(NamedTuple):
    """Scratch that a search uses again and again; holds nothing between two parents.

    Attributes
    ----------
    now
        ``LENGTH`` to ``WANTED``.
    left
        What the other robots leave of each node's reward, 0 at the base (n_nodes).
    unreached, touched
        Probability that none of them reaches a node, −1 where none may, and which may.
    arc, node
        The trail: arcs (n_arcs), and the nodes they lead from and to (n_arcs + 1).
    position
        Of each arc on the trail, −1 elsewhere (n_arcs).
    met
        Position of the first visit to each node, ``NEVER`` elsewhere (n_nodes).
    again
        Position of the next visit to the node at each position, −1 where it is the last.
    alive, gained, ahead
        At each position: probability to get there, what was collected up to there, and what a
        robot sure to be there that had collected nothing would collect from there on.
    onward, visited
        Next arc to be tried from each position, and a hash of what has been visited up to there
        (n_arcs + 1), see ``respond``.
    known, known_to, known_alive, known_gained
        States that ``respond`` has been in: a hash, which call that was, and with what probability
        and gain (``N_KNOWN``).
    middle, middle_mark, middle_place
        The child's new arcs, and for each arc of the mission the last child that took it, and
        where.
    seen
        Last child that met each node (n_nodes).
    fresh
        What each node is worth to a robot that ``respond`` sends out, 0 once visited (n_nodes).
    later, later_gain
        Scratch of ``lay_out`` (n_nodes).
    trails, held, alone
        Trails of the child's plan, and of the parent's (n_robots), and a single one (1).
    product, reached, reached_by
        Scratch of ``evaluate_trails`` (n_nodes).
    child
        The child's arcs (n_arcs).
    """

    now: OffsetArray
    left: FloatArray
    unreached: FloatArray
    touched: IntArray
    arc: IntArray
    node: IntArray
    position: OffsetArray
    met: OffsetArray
    again: OffsetArray
    alive: FloatArray
    gained: FloatArray
    ahead: FloatArray
    middle: IntArray
    middle_mark: OffsetArray
    middle_place: OffsetArray
    seen: OffsetArray
    later: OffsetArray
    later_gain: FloatArray
    fresh: FloatArray
    trails: IntArray
    onward: OffsetArray
    visited: SeedArray
    known: SeedArray
    known_to: OffsetArray
    known_alive: FloatArray
    known_gained: FloatArray
    held: IntArray
    alone: IntArray
    product: FloatArray
    reached: IntArray
    reached_by: OffsetArray
    child: IntArray


def new_workspace(ground: Ground, n_robots: int) -> Workspace:
    """Make the scratch of a search.

    Parameters
    ----------
    ground, n_robots
        The mission, and its robots.
    """
    n_nodes, n_arcs = len(ground.reward), len(ground.head)
    n_known = N_KNOWN if len(ground.by_return) else 0
    left = ground.reward.copy()
    left[ground.base] = 0.0
    return Workspace(
        now=np.zeros(N_NOW, np.int64),
        left=left,
        unreached=np.full(n_nodes, -1.0),
        touched=np.empty(n_nodes, np.int32),
        arc=np.empty(n_arcs, np.int32),
        node=np.empty(n_arcs + 1, np.int32),
        position=np.full(n_arcs, -1, np.int64),
        met=np.full(n_nodes, NEVER, np.int64),
        again=np.empty(n_arcs + 1, np.int64),
        alive=np.empty(n_arcs + 1),
        gained=np.empty(n_arcs + 1),
        ahead=np.empty(n_arcs + 1),
        middle=np.empty(n_arcs, np.int32),
        middle_mark=np.full(n_arcs, -1, np.int64),
        middle_place=np.empty(n_arcs, np.int64),
        seen=np.full(n_nodes, -1, np.int64),
        later=np.full(n_nodes, -1, np.int64),
        later_gain=np.empty(n_nodes),
        fresh=np.empty(n_nodes),
        trails=np.empty(n_robots, np.int32),
        onward=np.empty(n_arcs + 1, np.int64),
        visited=np.zeros(n_arcs + 1, np.uint64),
        known=np.zeros(n_known, np.uint64),
        known_to=np.zeros(n_known, np.int64),
        known_alive=np.zeros(n_known),
        known_gained=np.zeros(n_known),
        held=np.empty(n_robots, np.int32),
        alone=np.empty(1, np.int32),
        product=np.empty(n_nodes),
        reached=np.empty(n_nodes, np.int32),
        reached_by=np.full(n_nodes, -1, np.int64),
        child=np.empty(n_arcs, np.int32),
    )


@part
def set_aside(
    ground: Ground, store: TrailStore, work: Workspace, robot: int
) -> tuple[float, float]:
    """Let the other robots go first: give their E[R], the base's included, and E[S].

    Parameters
    ----------
    ground, store
        The mission, and its trails.
    work
        ``held`` is the plan; ``left``, ``unreached`` and ``touched`` are written.
    robot
        Which robot stays.
    """
    left, unreached, touched = work.left, work.unreached, work.touched
    expected_reward = ground.reward[ground.base]
    survivors = 0.0
    n = 0
    for k in range(work.held.shape[0]):
        if k == robot:
            continue
        trail = work.held[k]
        start = store.visits_from[trail]
        for i in range(start, start + store.n_visits[trail]):
            node = store.node[i]
            if unreached[node] < 0.0:
                unreached[node] = 1.0
                touched[n] = node
                n += 1
            # Small chances keep their digits so, which the reward minus what is left would lose.
            expected_reward += ground.reward[node] * unreached[node] * store.reach[i]
            unreached[node] *= 1.0 - store.reach[i]
        survivors += store.alive[trail]
    for i in range(n):
        left[touched[i]] = ground.reward[touched[i]] * unreached[touched[i]]
    work.now[N_TOUCHED] = n
    return expected_reward, survivors


@part
def lay_out(ground: Ground, store: TrailStore, work: Workspace, trail: int) -> None:
    """Lay out the trail that is to be changed; ``left`` has been written.

    Parameters
    ----------
    ground, store
        The mission, and its trails.
    work
        ``arc`` to ``ahead`` are written.
    trail
        Its number.
    """
    left = work.left
    start, length = store.arcs_from[trail], store.n_arcs[trail]
    work.now[LENGTH] = length
    work.node[0] = ground.base
    work.met[ground.base] = 0
    alive, gained = 1.0, 0.0
    work.alive[0], work.gained[0] = alive, gained
    for i in range(length):
        arc = store.arc[start + i]
        node = ground.head[arc]
        work.arc[i] = arc
        work.position[arc] = i
        work.node[i + 1] = node
        alive *= ground.survival[arc]
        if work.met[node] == NEVER:
            work.met[node] = i + 1
            gained += left[node] * alive
        work.alive[i + 1], work.gained[i + 1] = alive, gained
    # Backwards: what lies ahead when nothing has been collected; a node that comes again later
    # counts now instead.
    work.ahead[length] = 0.0
    work.again[length] = -1
    work.later[work.node[length]] = length
    work.later_gain[work.node[length]] = 0.0
    for i in range(length - 1, -1, -1):
        node = work.node[i + 1]
        ahead = work.ahead[i + 1]
        if i + 1 < length:
            work.again[i + 1] = work.later[node]
            if work.later[node] >= 0:
                ahead -= work.later_gain[node] / work.alive[i + 1]
        work.later[node] = i + 1
        work.later_gain[node] = left[node] * work.alive[i + 1]
        work.ahead[i] = ground.survival[work.arc[i]] * (ahead + left[node])
    work.again[0] = work.later[ground.base] if length > 0 else -1


@part
def clear_others(ground: Ground, work: Workspace) -> None:
    """Leave the workspace as it was before ``set_aside``."""
    for i in range(work.now[N_TOUCHED]):
        node = work.touched[i]
        work.left[node] = ground.reward[node]
        work.unreached[node] = -1.0


@part
def clear_trail(ground: Ground, work: Workspace) -> None:
    """Leave the workspace as it was before ``lay_out``."""
    for i in range(work.now[LENGTH]):
        work.position[work.arc[i]] = -1
        work.met[work.node[i + 1]] = NEVER
        work.later[work.node[i + 1]] = -1
    work.met[ground.base] = NEVER
    work.later[ground.base] = -1
