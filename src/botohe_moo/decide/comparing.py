"""The difference between two plans, in numbers and in words."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from botohe_moo.decide.fronts import arc_counts, difference_text, distances
from botohe_moo.decide.wishes import label_text
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import PlanBatch, TrailPlan

_SHOWN = 8  # nodes in a sentence


@dataclass(frozen=True)
class Change:
    """The difference that a robot makes between two plans.

    Attributes
    ----------
    robot, other_robot
        The robot in the first plan, and the one that it is matched with in the second, from 0.
    survival, other_survival
        Probabilities that they survive.
    gained, lost
        Nodes that only the second, or only the first of them visits.
    same, stayed, stays
        Whether their trails are the same, whether the first of them stays at base, and whether the
        second does.
    kind
        The name of their kind; None if all robots are of one kind.
    start
        The node where they start; None for the base.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Change, compare
    >>> toy = load_mission("toy")
    >>> found = compare(toy, toy.plan([[1, 2, 1], [1]]), toy.plan([[1, 2, 4, 2, 1], [1]]))
    >>> found.robots[0].gained, found.robots[1].same
    ((4,), True)
    """

    robot: int
    other_robot: int
    survival: float
    other_survival: float
    gained: tuple[Hashable, ...]
    lost: tuple[Hashable, ...]
    same: bool
    stayed: bool
    stays: bool
    kind: str | None = None
    start: Hashable | None = None


@dataclass(frozen=True, eq=False)
class Difference:
    """The difference of two plans; ``str`` describes it in sentences.

    Attributes
    ----------
    reward, survivors
        How much more E[R] and E[S] the second plan has; below 0 if it has less.
    gained, lost
        Nodes that only the second, or only the first plan visits.
    visitors
        Nodes that both plans visit with different numbers of robots, and both numbers.
    at_base
        Numbers of robots that stay at base, or where else they start, in the first and in the
        second plan.
    robots
        The change of each robot, in the order of the first plan.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Difference, compare
    >>> toy = load_mission("toy")
    >>> found = compare(toy, toy.plan([[1, 2, 1], [1]]), toy.plan([[1, 2, 4, 2, 1], [1]]))
    >>> round(found.reward, 2), found.gained, found.at_base
    (3.24, (4,), (1, 1))
    >>> print(found.sentences[-1])
    Robot 0 also visits 4, at the same survival.
    """

    reward: float
    survivors: float
    gained: tuple[Hashable, ...]
    lost: tuple[Hashable, ...]
    visitors: dict[Hashable, tuple[int, int]]
    at_base: tuple[int, int]
    robots: tuple[Change, ...]

    @cached_property
    def sentences(self) -> tuple[str, ...]:
        """All this in words."""
        return tuple(_sentences(self))

    def __str__(self) -> str:
        return "\n".join(self.sentences)


def compare(mission: Mission, first: TrailPlan, second: TrailPlan) -> Difference:
    """Compare two plans: rewards, survivors, nodes, and the trails of matched robots.

    Robots of a kind are identical, so each robot of the first plan is matched with one of the
    second, of its kind. The sum of the distances of their trails, ``1 − |A ∩ B| / |A ∪ B|`` of
    their arcs, is the smallest.

    Parameters
    ----------
    mission
        The mission.
    first, second
        Two plans of it.

    Raises
    ------
    PlanError
        If a plan is not valid for the mission.
    TypeError
        If one is not a TrailPlan.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import compare
    >>> toy = load_mission("toy")
    >>> first, second = toy.plan([[1, 2, 1], [1]]), toy.plan([[1], [1, 3, 2, 4, 2, 3, 1]])
    >>> print(compare(toy, first, second))
    The second plan has 4.14 more reward and as many survivors.
    Only the second plan visits 3 and 4.
    Robot 0 (1 in the second plan) also visits 3 and 4, at the same survival.
    """
    batch = check_mission(mission).batch([first, second])
    before, after = mission.evaluate(batch)
    survival = mission.robot_survival(batch)
    visits, other_visits = (
        [set(trail) for trail in mission.labels(plan)] for plan in (first, second)
    )
    robots = []
    has_kinds, kind_of = len(mission.kinds) > 1, mission.kind_of
    for robot, other in _matched(mission, batch, first, second):
        kind, start = kind_of[robot], kind_of[robot].start
        nodes, other_nodes = visits[robot], other_visits[other]
        trail, other_trail = first.trails[robot], second.trails[other]
        change = Change(
            robot=robot,
            other_robot=other,
            survival=float(survival[0, robot]),
            other_survival=float(survival[1, other]),
            gained=_in_order(mission, other_nodes - nodes),
            lost=_in_order(mission, nodes - other_nodes),
            same=trail == other_trail,
            stayed=len(trail) == 1,
            stays=len(other_trail) == 1,
            kind=kind.name if has_kinds else None,
            start=None if start == mission.base else start,
        )
        robots.append(change)
    visited, other_visited = set().union(*visits), set().union(*other_visits)
    counts = {
        node: (sum(node in nodes for nodes in visits), sum(node in nodes for nodes in other_visits))
        for node in _in_order(mission, visited & other_visited - {mission.base})
    }
    reward, survivors = (after - before).tolist()
    return Difference(
        reward=reward,
        survivors=survivors,
        gained=_in_order(mission, other_visited - visited),
        lost=_in_order(mission, visited - other_visited),
        visitors={node: both for node, both in counts.items() if both[0] != both[1]},
        at_base=(_n_at_base(first), _n_at_base(second)),
        robots=tuple(robots),
    )


def _n_at_base(plan: TrailPlan) -> int:
    return sum(len(trail) == 1 for trail in plan.trails)


def _matched(
    mission: Mission, batch: PlanBatch, first: TrailPlan, second: TrailPlan
) -> list[tuple[int, int]]:
    """Match the robots of two plans, kind by kind; equal trails come first, then the nearest."""
    from scipy.optimize import linear_sum_assignment

    counts, other_counts = np.split(arc_counts(batch, per_robot=True), 2)
    # Trails of the same arcs in another order have no distance, but are not equal.
    differ = [[trail != other for other in second.trails] for trail in first.trails]
    apart = distances(counts, other_counts) + 1e-9 * np.array(differ)
    kind_of = np.repeat(np.arange(len(mission.kinds)), [kind.robots for kind in mission.kinds])
    apart[kind_of[:, None] != kind_of] = np.inf
    rows, columns = linear_sum_assignment(apart)
    return list(zip(rows.tolist(), columns.tolist(), strict=True))


def _in_order(mission: Mission, nodes: set[Hashable]) -> tuple[Hashable, ...]:
    return tuple(sorted(nodes, key=mission.index))


def _sentences(found: Difference) -> list[str]:
    if all(change.same for change in found.robots):
        return ["The plans are the same."]
    reward = difference_text(found.reward, "reward")
    survivors = difference_text(found.survivors, "survivors")
    sentences = [f"The second plan has {reward} and {survivors}."]
    for which, nodes in (("second", found.gained), ("first", found.lost)):
        if nodes:
            sentences.append(f"Only the {which} plan visits {_named(nodes)}.")
    for kind, sign in (("More", 1), ("Fewer", -1)):
        nodes = tuple(node for node, (a, b) in found.visitors.items() if (b - a) * sign > 0)
        if nodes:
            sentences.append(f"{kind} robots visit {_named(nodes)}.")
    before, after = found.at_base
    if before != after:
        kind = "More" if after > before else "Fewer"
        from_base = all(change.start is None for change in found.robots)
        where = "at base" if from_base else "where they start"
        sentences.append(f"{kind} robots stay {where} ({after} instead of {before}).")
    return sentences + [_sentence(change) for change in found.robots if not change.same]


def _sentence(change: Change) -> str:
    said = [change.kind] if change.kind is not None else []
    if change.robot != change.other_robot:
        said.append(f"{change.other_robot} in the second plan")
    robot = f"Robot {change.robot}" + (f" ({', '.join(said)})" if said else "")
    start = None if change.start is None else label_text(change.start)
    if change.stays:
        return f"{robot} stays at {start or 'base'} instead of visiting {_named(change.lost)}."
    before, after = change.survival, change.other_survival
    as_safe = abs(after - before) <= 1e-9
    survives = f"survives with {' instead of '.join(_apart(after, before))}"
    if not change.gained and not change.lost:
        if as_safe:
            return f"{robot} visits the same nodes by another trail that is as safe."
        kind = "safer" if after > before else "more dangerous"
        return f"{robot} visits the same nodes by a {kind} trail: it {survives}."
    visits = f"leaves {start or 'the base'} and visits" if change.stayed else "also visits"
    parts = [f"{visits} {_named(change.gained)}"] if change.gained else []
    parts += [f"no longer visits {_named(change.lost)}"] if change.lost else []
    end = "at the same survival" if as_safe else f"and {survives}"
    return f"{robot} {' and '.join(parts)}, {end}."


def _apart(one: float, other: float) -> tuple[str, str]:
    """Write two probabilities with as many digits as tell them apart, at least four."""
    digits = 4
    while digits < 12 and f"{one:.{digits}g}" == f"{other:.{digits}g}":
        digits += 1
    return f"{one:.{digits}g}", f"{other:.{digits}g}"


def _named(nodes: Sequence[Hashable]) -> str:
    shown = [label_text(node) for node in nodes[:_SHOWN]]
    if len(nodes) > _SHOWN:
        shown.append(f"{len(nodes) - _SHOWN} more")
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"
