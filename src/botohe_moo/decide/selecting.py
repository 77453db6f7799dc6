"""A handful of plans that are really different."""

import numpy as np
from numpy.typing import NDArray

from botohe_moo._base.checks import check_integer
from botohe_moo._base.types import FloatArray, IntArray
from botohe_moo.decide.judging import Candidates
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch, Plans

_MAX_PLANS = 500  # the time grows with the third power of the plans


def representatives(mission: Mission, plans: Plans, k: int = 5) -> tuple[int, ...]:
    """Select ``k`` plans that stand for all: really different ones, from all parts of the front.

    The front, by descending reward, is cut into ``k`` segments, and each is represented by one of
    its plans, so that the sum of the distances of all plans to their representatives is as small as
    possible. The distance of two plans is 1 − |A ∩ B| / |A ∪ B| of the multisets of their arcs.

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

    Notes
    -----
    k-medoids (Kaufman and Rousseeuw, "Finding Groups in Data", 1990) whose groups are segments, by
    dynamic programming, hence exactly. Of more than 500 plans, 500 at equal distances in the order
    of the front are looked at.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> toy = load_mission("toy")
    >>> trails = [[1], [1, 2, 1], [1, 2, 4, 2, 1], [1, 3, 2, 4, 2, 3, 1]]
    >>> representatives(toy, [toy.plan([trail, [1]]) for trail in trails], k=2)
    (2, 0)
    """
    k = check_integer("k", k, at_least=1)
    front = Candidates(mission, plans)
    order = np.lexsort((front.objectives[:, 1], -front.objectives[:, 0]))
    if len(order) > _MAX_PLANS:
        order = order[np.linspace(0, len(order) - 1, _MAX_PLANS).round().astype(int)]
    if len(order) <= k:
        return tuple(order.tolist())
    counts = arc_counts(front.batch.take(order), per_robot=False)
    return tuple(int(order[row]) for row in _segment_medoids(distances(counts, counts), k))


def arc_counts(batch: PlanBatch, *, per_robot: bool) -> FloatArray:
    """Count how often each plan, or each robot's trail, uses each arc that any of them uses."""
    lengths = np.diff(batch.offsets)
    trails = np.repeat(np.arange(len(lengths)), lengths)
    hops = trails[1:] == trails[:-1]
    tail, head = (ends[hops].astype(np.int64) for ends in (batch.nodes[:-1], batch.nodes[1:]))
    arcs, column = np.unique(tail << 32 | head, return_inverse=True)
    owners = trails[1:][hops] // (1 if per_robot else batch.n_robots)
    counts = np.zeros((len(lengths) // (1 if per_robot else batch.n_robots), len(arcs)))
    np.add.at(counts, (owners, column), 1)
    return counts


def distances(ours: FloatArray, others: FloatArray) -> FloatArray:
    """Compute 1 − |A ∩ B| / |A ∪ B| of multisets (n, n_arcs) and (m, n_arcs), in [0, 1] (n, m)."""
    from scipy.spatial.distance import cdist

    apart = cdist(ours, others, "cityblock")
    union = (ours.sum(axis=1)[:, None] + others.sum(axis=1) + apart) / 2
    found: FloatArray = np.divide(apart, union, out=np.zeros_like(apart), where=union > 0)
    return found


def _segment_medoids(apart: FloatArray, k: int) -> list[int]:
    """Cut 0, 1, ..., n − 1 into ``k`` segments with medoids nearest to all of their members."""
    costs, medoids = _segments(apart)
    n = len(apart)
    best = costs[0].copy()  # of the first rows up to each, in one segment
    cuts: list[IntArray] = []
    for _ in range(1, k):
        total = np.append(np.inf, best[:-1])[:, None] + costs  # the last segment begins with a row
        cuts.append(total.argmin(axis=0))
        best = total.min(axis=0)
    chosen, end = [], n - 1
    for begins in [*reversed(cuts), np.zeros(n, np.int64)]:
        start = int(begins[end])
        chosen.append(int(medoids[start, end]))
        end = start - 1
    return chosen[::-1]


def _segments(apart: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Give the cost and the medoid of each segment, from its first to its last row (n, n)."""
    n = len(apart)
    costs, medoids = np.full((n, n), np.inf), np.zeros((n, n), np.int64)
    outside = np.tri(n, k=-1, dtype=bool)  # a medoid lies within its segment
    for first in range(n):
        sums = apart[first:, first:].cumsum(axis=1)
        sums[outside[first:, first:]] = np.inf
        medoids[first, first:] = first + sums.argmin(axis=0)
        costs[first, first:] = sums.min(axis=0)
    return costs, medoids
