"""A handful of plans that are really different."""

import numpy as np

from botohe_moo._base.checks import check_integer
from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.decide.fronts import front_rows, objectives_of, scales
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import PlanBatch, Plans


def representatives(mission: Mission, plans: Plans, k: int = 5) -> tuple[int, ...]:
    """Select ``k`` plans that represent the front: one from each part of the front.

    The front, by descending reward, is cut into ``k`` segments of equal length, in objectives
    divided by the total reward and the number of robots. Each is represented by its medoid, the
    plan with the smallest sum of distances to the others. The distance of two plans is
    ``1 − |A ∩ B| / |A ∪ B|`` of the multisets of their arcs. For segments without a plan, those
    plans of the front are added, one after another, that are farthest from all selected ones. Plans
    that are dominated, or equal another in both objectives, are only added if the front has fewer
    than ``k`` plans.

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans, in any order.
    k
        How many, at least 1; of fewer plans all are returned.

    Returns
    -------
    tuple of int
        Rows of the plans, by descending reward. The same for the same plans, always.

    Raises
    ------
    ValueError
        If there is no plan, or ``k`` is not an integer of at least 1.
    PlanError
        If a plan is not valid for the mission.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import representatives
    >>> toy = load_mission("toy")
    >>> out = [1, 3, 2, 4, 2, 3, 1]
    >>> teams = [[[1], [1]], [out, [1]], [out, [1, 2, 4, 2, 1]], [out, out]]
    >>> representatives(toy, [toy.plan(team) for team in teams], k=2)
    (3, 0)
    """
    k = check_integer("k", k, at_least=1)
    batch = check_mission(mission).batch(plans)
    objectives = objectives_of(mission, batch)
    rows = front_rows(objectives)
    dominated = np.setdiff1d(np.arange(len(batch)), rows)
    order = np.append(rows, dominated)
    counts = arc_counts(batch.take(order), per_robot=False)
    segments = _segments(objectives[rows] / scales(mission), k)
    chosen = []
    for segment in np.unique(segments):
        members = np.flatnonzero(segments == segment)
        apart = distances(counts[members], counts[members])
        chosen.append(int(members[apart.sum(axis=1).argmin()]))
    for end in (len(rows), len(order)):  # others only if the front has too few
        _add_farthest(chosen, counts[:end], k)
    found = order[chosen]
    by_reward = np.lexsort((objectives[found, 1], -objectives[found, 0]))
    return tuple(found[by_reward].tolist())


def _add_farthest(chosen: list[int], counts: FloatArray, k: int) -> None:
    """Add the plan that is farthest from all chosen ones, until there are ``k``, or all."""
    while len(chosen) < min(k, len(counts)):
        nearest = distances(counts, counts[chosen]).min(axis=1)
        nearest[chosen] = -1
        chosen.append(int(nearest.argmax()))


def _segments(points: FloatArray, k: int) -> OffsetArray:
    """Return which of ``k`` equally long segments of the way along all points each is in (n)."""
    way = np.append(0.0, np.hypot(*np.diff(points, axis=0).T).cumsum())
    segments: OffsetArray = np.minimum((way / (way[-1] or 1.0) * k).astype(np.int64), k - 1)
    return segments


def arc_counts(batch: PlanBatch, *, per_robot: bool) -> FloatArray:
    """Count how often each plan, or each robot's trail, uses each arc that any of them uses."""
    lengths = np.diff(batch.offsets)
    trails = np.repeat(np.arange(len(lengths)), lengths)
    hops = trails[1:] == trails[:-1]
    tail, head = (ends[hops].astype(np.int64) for ends in (batch.nodes[:-1], batch.nodes[1:]))
    arcs, column = np.unique(tail << 32 | head, return_inverse=True)
    n_shared = 1 if per_robot else batch.n_robots
    counts = np.zeros((len(lengths) // n_shared, len(arcs)))
    np.add.at(counts, (trails[1:][hops] // n_shared, column), 1)
    return counts


def distances(ours: FloatArray, others: FloatArray) -> FloatArray:
    """Compute 1 − |A ∩ B| / |A ∪ B| of multisets (n, n_arcs) and (m, n_arcs), in [0, 1] (n, m)."""
    most = int(max(ours.max(initial=0), others.max(initial=0)))
    # Of multisets: how many are in both at least once, twice, and so on.
    levels = range(1, most + 1)
    shared = sum((1.0 * (ours >= n) @ (others >= n).T for n in levels), np.zeros(()))
    union = ours.sum(axis=1)[:, None] + others.sum(axis=1) - shared
    apart = union - shared
    found: FloatArray = np.divide(apart, union, out=np.zeros_like(apart), where=union > 0)
    return found
