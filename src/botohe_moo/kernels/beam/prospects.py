"""What a partial trail may come to: by going home at once, by what lies ahead, and at most.

All that a hop needs is compiled into the loop of the search (``inline``), and helpers are handed
the few tuples of arrays that they read: calls with many arrays would take as long as the work.
"""

from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray, SeedArray
from botohe_moo.kernels.beam.labels import Label, hash_keys
from botohe_moo.kernels.colony.construct import leads_home
from botohe_moo.kernels.compile import inline, kernel
from botohe_moo.kernels.graph.old_paths import way_home

# Share of what still looks worth its danger that counts when labels are ranked. Measured on the
# case studies: without, beams run home too early; above a half they put off going home.
FORESIGHT = 0.5

# Relative gains below this are not searched for: they would be rounding, not reward.
_TOLERANCE = 1e-12


class Ground(NamedTuple):
    """What a robot walks on, and what is known before any robot is planned.

    Attributes
    ----------
    first, tail, head, cost, survival, homeward, home
        The walk graph (see ``WalkGraph``).
    near, reach
        From ``nearest``.
    """

    first: OffsetArray
    tail: IntArray
    head: IntArray
    cost: FloatArray
    survival: FloatArray
    homeward: IntArray
    home: FloatArray
    near: IntArray
    reach: FloatArray


class Task(NamedTuple):
    """What a trail is to be found for; see ``best_trail``."""

    base: int
    balanced: bool
    survival_weight: float
    least: float


class Search(NamedTuple):
    """What a search for a trail computes once, and what its searches for ways home write on."""

    danger: FloatArray  # what going to a near node costs, for a robot alive for sure
    arc_keys: SeedArray
    node_keys: SeedArray
    n_homes: OffsetArray  # ways home looked for (1)
    met: OffsetArray
    distance: FloatArray
    entry: IntArray
    keys: FloatArray
    held: IntArray
    path: IntArray


class Prospect(NamedTuple):
    """What a label may come to.

    Attributes
    ----------
    bound
        What it comes to at most.
    rank
        By which labels are ranked; see ``best_trail``.
    closed
        Value of the trail that goes home at once; −1 where that cannot be the best one known.
    survives
        Chance to survive that trail; −1 where no way leads home, or none is worth looking for.
    """

    bound: float
    rank: float
    closed: float
    survives: float


@kernel
def new_search(ground: Ground, survival_weight: float) -> Search:
    """Prepare for one trail.

    Parameters
    ----------
    ground
        Where.
    survival_weight
        What surviving for sure is worth.
    """
    n_arcs = ground.head.shape[0]
    n_nodes, n_near = ground.near.shape
    danger = np.empty((n_nodes, n_near))
    for node in range(n_nodes):
        for i in range(n_near):
            home_after = ground.reach[node, i] * ground.home[ground.near[node, i]]
            danger[node, i] = survival_weight * (ground.home[node] - home_after)
    keys = hash_keys(n_arcs + n_nodes)
    return Search(
        danger,
        keys[:n_arcs],
        keys[n_arcs:],
        np.zeros(1, np.int64),
        np.full(n_nodes, -1, np.int64),
        np.empty(n_nodes),
        np.empty(n_nodes, np.int32),
        np.empty(n_arcs + 1),
        np.empty(n_arcs + 1, np.int32),
        np.empty(n_nodes, np.int32),
    )


@inline
def enough(best_value: float) -> float:
    """Give what a label must be able to come to more than.

    Parameters
    ----------
    best_value
        Value of the best trail known.
    """
    return best_value + _TOLERANCE * best_value


@inline
def _stay(ground: Ground, task: Task, label: Label) -> float:
    """Give what surviving is worth to a robot that turns home and finds every arc free."""
    return float(task.survival_weight * label.alive * ground.home[label.node])


@inline
def is_hopeless(ground: Ground, task: Task, label: Label, best_value: float) -> bool:
    """Tell cheaply that a label cannot keep the floor, or cannot beat the best trail known.

    Parameters
    ----------
    ground, task
        Where, and what for.
    label
        The label.
    best_value
        Value of the best trail known.
    """
    most = label.value + label.alive * label.left + _stay(ground, task, label)
    return label.alive * ground.home[label.node] < task.least or most <= enough(best_value)


@inline
def _look_ahead(
    near: IntArray,
    reach: FloatArray,
    danger: FloatArray,
    ahead: FloatArray,
    node: int,
    left: float,
) -> tuple[float, float]:
    """Judge what nodes not visited offer a robot that is at ``node`` for sure.

    Gives the most that all of them together could bring, and what those near promise over the
    danger of going there before going home.
    """
    n_nodes, n_near = near.shape
    most = promise = nearby = 0.0
    for i in range(n_near):
        worth = ahead[near[node, i]]
        brings = reach[node, i] * worth
        most += brings
        nearby += worth
        promise += max(0.0, brings - danger[node, i])
    if n_near < n_nodes - 1:
        most += max(0.0, left - nearby) * reach[node, n_near - 1]
    return most, promise


@inline
def _is_blocked(ground: Ground, base: int, used: OffsetArray, node: int) -> bool:
    """Tell whether the safest way home with every arc free takes an arc that is used."""
    here = node
    while here != base and used[ground.homeward[here]] != 1:
        here = ground.head[ground.homeward[here]]
    return here != base


@kernel
def _gets_home(ground: Ground, base: int, search: Search, used: OffsetArray, node: int) -> bool:
    """Tell whether unused arcs lead home."""
    search.n_homes[0] += 1
    return leads_home(
        ground.first,
        ground.head,
        ground.homeward,
        base,
        node,
        used,
        1,
        search.met,
        int(search.n_homes[0]),
        search.held,
    )


@inline
def write_way_home(ground: Ground, base: int, search: Search, used: OffsetArray, node: int) -> int:
    """Write the safest way home over unused arcs to ``search.path``.

    Parameters
    ----------
    ground, base
        Where, and where home is.
    search
        Changed in place.
    used
        1 for the arcs that must not be taken.
    node
        Where the way begins.

    Returns
    -------
    int
        How many arcs it has; −1 where there is none.
    """
    search.n_homes[0] += 1
    return way_home(
        ground.first,
        ground.tail,
        ground.head,
        ground.cost,
        ground.homeward,
        base,
        used,
        1,
        node,
        int(search.n_homes[0]),
        search.met,
        search.distance,
        search.entry,
        search.keys,
        search.held,
        search.path,
    )


@inline
def _close(
    ground: Ground,
    task: Task,
    search: Search,
    used: OffsetArray,
    ahead: FloatArray,
    label: Label,
    best_value: float,
) -> tuple[float, float]:
    """Send a robot home at once: give value and survival of the trail, as in ``Prospect``."""
    value, survives = label.value, label.alive
    detour = task.least > 0.0 or value + _stay(ground, task, label) > best_value
    if not detour and _is_blocked(ground, task.base, used, label.node):
        back = task.balanced or _gets_home(ground, task.base, search, used, label.node)
        return -1.0, survives if back else -1.0
    n_hops = write_way_home(ground, task.base, search, used, label.node)
    if n_hops < 0:
        return -1.0, -1.0
    for i in range(n_hops):
        arc = search.path[i]
        survives *= ground.survival[arc]
        value += survives * ahead[ground.head[arc]]
    return value + task.survival_weight * survives, survives


@inline
def judge(
    ground: Ground,
    task: Task,
    search: Search,
    used: OffsetArray,
    ahead: FloatArray,
    child: Label,
    best_value: float,
) -> Prospect:
    """Look ahead and home from a child of the label at hand.

    Parameters
    ----------
    ground, task
        Where, and what for.
    search
        Changed in place.
    used, ahead
        Of the label at hand (see ``Standing``); changed, and changed back.
    child
        The child.
    best_value
        Value of the best trail known.
    """
    fresh = ahead[child.node]
    used[child.arc], ahead[child.node] = 1, 0.0
    most, promise = _look_ahead(
        ground.near, ground.reach, search.danger, ahead, child.node, child.left
    )
    stay = _stay(ground, task, child)
    bound = child.value + child.alive * most + stay
    closed = survives = -1.0
    if bound > enough(best_value):
        closed, survives = _close(ground, task, search, used, ahead, child, best_value)
    used[child.arc], ahead[child.node] = 0, fresh
    rank = child.value + stay + FORESIGHT * child.alive * promise
    return Prospect(bound, rank, closed, survives)
