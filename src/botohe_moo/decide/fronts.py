"""Fronts: the plans that are not dominated, the price of a survivor, knees and representatives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from botohe_moo import objectives
from botohe_moo.base.messages import difference_text, short_text
from botohe_moo.base.parameters import check
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import PlanBatch, Plans

# Plans, or their objectives E[R] and E[S] (n_plans, 2).
PlansOrObjectives = Plans | FloatArray

# Objectives divided by their `scales` that differ by less are equal: sums are rounded.
SLACK = 1e-9

_ROWS = 10  # of a table that does not show all plans


def objectives_of(mission: Mission, given: PlansOrObjectives) -> FloatArray:
    """Return the objectives (n_plans, 2) of plans; objectives themselves are checked."""
    check_mission(mission)
    listed: Any = given if isinstance(given, np.ndarray) else list(given)
    if not len(listed):
        raise ValueError("Expected at least one plan, got none.")
    try:
        points = np.array(listed, float)
    except (TypeError, ValueError):  # plans
        points = mission.evaluate(listed)
    return check_objectives(points, "plans or objectives")


def check_objectives(points: NDArray[Any], expected: str = "objectives") -> FloatArray:
    """Check that objectives are of shape (n_plans, 2), finite and at least 0."""
    values = objectives.check_objectives(expected, points)
    if (values < 0).any():
        row = int(np.argmax((values < 0).any(axis=1)))
        found, remedy = values[row].tolist(), "pymoo's F holds their negatives: give -result.F"
        raise ValueError(f"Expected objectives of at least 0, got {found} in row {row}; {remedy}.")
    return values


def scales(mission: Mission) -> FloatArray:
    """Return the scales of both objectives: the total reward, or 1 if that is 0, and the team."""
    return np.array([mission.total_reward or 1.0, mission.robots])


def front_rows(objectives: FloatArray) -> OffsetArray:
    """Return the rows of the non-dominated plans, by descending reward; the first of equal ones."""
    order = np.lexsort((-objectives[:, 1], -objectives[:, 0]))
    survivors = objectives[order, 1]
    before = np.maximum.accumulate(np.append(-np.inf, survivors))[:-1]
    return order[survivors > before]  # type: ignore[no-any-return]


def check_row(name: str, row: object, n_plans: int) -> int:
    """Check the index of a plan, counted from 0."""
    return int(check(name, row, int, ge=0, le=n_plans - 1))


def survivor_price(mission: Mission, plans: PlansOrObjectives, index: int) -> float:
    """Compute the price of a survivor at a plan of a front: the reward that one more costs there.

    It is the slope of the front's convex hull at the plan's survivors; where two edges of the hull
    meet, their mean. So it is what a survivor is worth to someone who chooses this plan. It is 0
    where no plan trades reward for survivors.

    Parameters
    ----------
    mission, plans
        As for :func:`knees`.
    index
        Row of the plan, from 0.

    Raises
    ------
    ValueError
        As for :func:`knees`, or if there is no such row.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import survivor_price
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> survivor_price(load_mission("toy"), front, 1)
    4.0
    """
    objectives = objectives_of(mission, plans)
    row = check_row("index", index, len(objectives))
    return float(survivor_prices(objectives, objectives[row, 1]))


def survivor_prices(objectives: FloatArray, survivors: FloatArray) -> FloatArray:
    """Compute the price of a survivor where a front has these numbers of survivors (n)."""
    hull: list[FloatArray] = []
    for point in objectives[front_rows(objectives)]:  # by ascending survivors
        while len(hull) > 1 and _is_below(hull[-1], hull[-2], point):
            hull.pop()
        hull.append(point)
    if len(hull) == 1:
        return np.zeros(np.shape(survivors))
    rewards, corners = np.array(hull).T
    slopes = -np.diff(rewards) / np.diff(corners)
    edges = [np.searchsorted(corners[1:-1], survivors, side) for side in ("left", "right")]
    return slopes[edges].mean(axis=0)  # type: ignore[no-any-return]


def _is_below(point: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Return whether a point of a front lies on or below the line between two others."""
    (reward, survivors), (more, fewer) = point - one, other - one
    return bool(reward * fewer <= more * survivors)


@dataclass(frozen=True)
class TradeOff:
    """The difference between a plan and another one of the front; ``str`` says it.

    Attributes
    ----------
    index
        Row of the other plan.
    reward, survivors
        E[R] and E[S] of the other plan minus those of this one.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import TradeOff, neighbours
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.5], [0, 2]]  # E[R] and E[S] of four plans
    >>> neighbours(toy, front, 1)[1] == TradeOff(index=2, reward=-3.0, survivors=0.5)
    True
    """

    index: int
    reward: float
    survivors: float

    def __str__(self) -> str:
        both = [difference_text(self.reward, "reward")]
        both.insert(self.reward > 0, difference_text(self.survivors, "survivors"))
        word = "for" if self.reward * self.survivors < 0 else "and"
        return f"plan {self.index} has {both[0]} {word} {both[1]}"


def neighbours(mission: Mission, plans: PlansOrObjectives, index: int) -> tuple[TradeOff, ...]:
    """Find the plans beside a plan on the front, and the differences to them.

    They are the plan with the next larger reward, and that with the next larger number of
    survivors, where there are such plans.

    Parameters
    ----------
    mission, plans, index
        As for :func:`survivor_price`, which also says what is raised.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import neighbours
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> print(*neighbours(toy, front, 0))  # nothing has more reward
    plan 1 has 1 more survivors for 1 less reward
    """
    objectives = objectives_of(mission, plans)
    index = check_row("index", index, len(objectives))
    rows = front_rows(objectives)  # by descending reward
    gain = (objectives[rows] - objectives[index]) / scales(mission)
    found = [*rows[gain[:, 0] > SLACK][-1:], *rows[gain[:, 1] > SLACK][:1]]
    differences = objectives[found] - objectives[index]
    pairs = zip(found, differences.tolist(), strict=True)
    return tuple(dict.fromkeys(TradeOff(int(row), *both) for row, both in pairs))


@dataclass(frozen=True)
class Mark:
    """A plan that is marked on a front.

    Attributes
    ----------
    index
        Row of the plan.
    name, definition
        Its name, and its definition.
    reward, survivors
        Its E[R] and E[S].

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Mark, knees
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> print(knees(toy, front)[0])
    plan 1 (reward 7, survivors 1): farthest above the chord between the end points of the front
    """

    index: int
    name: str
    definition: str
    reward: float
    survivors: float

    def __str__(self) -> str:
        where = f"reward {short_text(self.reward)}, survivors {short_text(self.survivors)}"
        return f"plan {self.index} ({where}): {self.definition}"


def knees(mission: Mission, plans: PlansOrObjectives) -> tuple[Mark, ...]:
    """Mark where a front bends: the plan farthest above its chord, and that of largest E[R]·E[S].

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans, or their objectives E[R] and E[S] (n_plans, 2).

    Returns
    -------
    tuple of Mark
        Both marks, which may be the same plan. The end points are the plans of most reward and of
        most survivors. Where no plan lies above their chord, as on a front of one or two plans,
        only the largest product is marked. Of equal plans the first is marked.

    Raises
    ------
    ValueError
        If there is no plan, or what is given are not objectives.

    Notes
    -----
    Distances from the chord: Das, "On characterizing the knee of the Pareto curve based on
    normal-boundary intersection", Structural Optimization 18, 1999. Neither mark depends on the
    units of the objectives; the chord's depends on where the front ends.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import knees
    >>> toy = load_mission("toy")  # a total reward of 10, and 2 robots
    >>> for mark in knees(toy, [[8, 0], [7, 1], [4, 1.4], [0, 2]]):
    ...     print(mark.index, mark.name)
    1 farthest from the chord
    1 largest product
    """
    objectives = objectives_of(mission, plans)
    rows = front_rows(objectives)
    scaled = objectives[rows] / scales(mission)
    (right, low), (left, high) = scaled[0], scaled[-1]
    above = (high - low) * (scaled[:, 0] - right) + (right - left) * (scaled[:, 1] - low)
    product = "largest product"
    found = [(product, f"{product} of expected reward and expected survivors", scaled.prod(axis=1))]
    if above.max() > 1e-12:
        why = "farthest above the chord between the end points of the front"
        found.insert(0, ("farthest from the chord", why, above))
    marked = [(int(rows[values.argmax()]), name, why) for name, why, values in found]
    return tuple(Mark(row, name, why, *objectives[row].tolist()) for row, name, why in marked)


def front_table(
    mission: Mission, plans: Plans, objectives: FloatArray, *, all_plans: bool = False
) -> tuple[str, int]:
    """Lay out a front with the price of a survivor, and mark its knee; return the number of rows.

    There are some ten rows: the ends of the front, its knee, and representatives; or all.
    """
    n_plans = len(objectives)
    if not n_plans:
        return "no plans", 0
    knee, rows = knees(mission, objectives)[0].index, range(n_plans)
    shown: Sequence[int] = rows
    if n_plans > _ROWS and not all_plans:
        marked = {0, n_plans - 1, knee}
        shown = sorted(marked.union(representatives(mission, plans, _ROWS - len(marked))))
    prices = survivor_prices(objectives, objectives[:, 1])
    lines = ["plan_id  expected reward  expected survivors  price of a survivor"]
    for row in shown:
        reward, survivors = objectives[row].tolist()
        mark = "  knee" if row == knee and n_plans > 2 else ""
        price = short_text(prices[row])
        lines.append(f"{row:>7}  {reward:>15.4f}  {survivors:>18.4f}  {price:>19}{mark}")
    return "\n".join(lines), len(shown)


def representatives(mission: Mission, plans: Plans, k: int = 5) -> tuple[int, ...]:
    """Select ``k`` plans that represent the front: one from each part of the front.

    The front, by descending reward, is cut into ``k`` segments of equal length, in objectives
    divided by the total reward and the number of robots. Each is represented by its medoid, the
    plan with the smallest sum of distances to the others. The distance of two plans is
    ``1 − |A ∩ B| / |A ∪ B|`` of the multisets of their arcs. A segment without a plan has no
    representative.

    Parameters
    ----------
    mission
        The mission.
    plans
        Its plans, in any order.
    k
        How many segments, at least 1.

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
    k = check("k", k, int, ge=1)
    batch = check_mission(mission).batch(plans)
    objectives = objectives_of(mission, batch)
    rows = front_rows(objectives)
    counts = arc_counts(batch.take(rows), per_robot=False)
    points = objectives[rows] / scales(mission)
    way = np.append(0.0, np.hypot(*np.diff(points, axis=0).T).cumsum())
    segments = np.minimum((way / (way[-1] or 1.0) * k).astype(np.int64), k - 1)
    chosen = []
    for segment in np.unique(segments):
        members = np.flatnonzero(segments == segment)
        apart = distances(counts[members], counts[members])
        chosen.append(int(rows[members[apart.sum(axis=1).argmin()]]))
    return tuple(chosen)


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
    # Not by scipy, whose import the first front would wait for.
    common = np.stack([np.minimum(ours, other).sum(axis=1) for other in others], axis=1)
    union = ours.sum(axis=1)[:, None] + others.sum(axis=1) - common
    shared: FloatArray = np.divide(common, union, out=np.ones(common.shape), where=union > 0)
    return 1.0 - shared
