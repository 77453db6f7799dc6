"""The difference between two plans, robot by robot."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo.base.numbers import difference_text
from botohe_moo.decide.fronts import arc_counts, distances
from botohe_moo.decide.wishes import label_text
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd

_SHOWN = 8  # nodes in a sentence


@dataclass(frozen=True, eq=False)
class Difference:
    """The difference of two plans; ``str`` describes it, a line for each robot that changes.

    Attributes
    ----------
    reward, survivors
        How much more E[R] and E[S] the second plan has; below 0 if it has less.
    gained, lost
        Nodes that only the second, or only the first plan visits.
    table
        A row for each robot of the first plan: ``robot`` and ``other_robot``, the one that it is
        matched with in the second, from 0; the name of their ``kind``; ``survival`` and
        ``other_survival``, the probabilities that they survive; ``gained`` and ``lost``, the nodes
        that only the second, or only the first of them visits; and ``same``, whether their trails
        are the same.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Difference, compare
    >>> toy = load_mission("toy")
    >>> found = compare(toy, toy.plan([[1, 2, 1], [1]]), toy.plan([[1, 2, 4, 2, 1], [1]]))
    >>> round(found.reward, 2), found.gained
    (3.24, (4,))
    >>> found.table[["robot", "survival", "other_survival", "gained"]].round(3)
       robot  survival  other_survival gained
    0      0     0.656           0.656   (4,)
    1      1     1.000           1.000     ()
    """

    reward: float
    survivors: float
    gained: tuple[Hashable, ...]
    lost: tuple[Hashable, ...]
    table: pd.DataFrame

    @property
    def sentences(self) -> tuple[str, ...]:
        """The lines of ``str``."""
        if self.table["same"].all():
            return ("The plans are the same.",)
        reward = difference_text(self.reward, "reward")
        survivors = difference_text(self.survivors, "survivors")
        lines = [f"The second plan has {reward} and {survivors}."]
        several = len(set(self.table["kind"])) > 1
        changed: Iterable[Any] = self.table[~self.table["same"]].itertuples()
        for change in changed:
            kind = f"{change.kind}, " if several else ""
            before, after = _apart(change.survival, change.other_survival)
            parts = [f"survival {before} -> {after}" if before != after else f"survival {before}"]
            parts += [f"also visits {_named(change.gained)}"] if change.gained else []
            parts += [f"no longer visits {_named(change.lost)}"] if change.lost else []
            parts += [] if change.gained or change.lost else ["another trail to the same nodes"]
            then = f"robot {change.other_robot} in the second plan"
            lines.append(f"Robot {change.robot} ({kind}{then}): {'; '.join(parts)}.")
        return tuple(lines)

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
    >>> first, second = toy.plan([[1, 2, 1], [1]]), toy.plan([[1], [1, 2, 4, 2, 1]])
    >>> print(compare(toy, first, second))
    The second plan has 3.24 more reward and the same survivors.
    Robot 0 (robot 1 in the second plan): survival 0.6561; also visits 4.
    """
    import pandas as pd

    batch = check_mission(mission).batch([first, second])
    reward, survivors = np.diff(mission.evaluate(batch), axis=0)[0].tolist()
    before, after = mission.robot_survival(batch).tolist()
    ours, others = ([*map(set, mission.labels(plan))] for plan in (first, second))

    def in_order(nodes: set[Hashable]) -> tuple[Hashable, ...]:
        return tuple(sorted(nodes, key=mission.index))

    matched = _matched(mission, first, second)
    columns = {
        "robot": range(mission.robots),
        "other_robot": matched,
        "kind": [kind.name for kind in mission.kind_of],
        "survival": before,
        "other_survival": [after[k] for k in matched],
        "gained": [in_order(others[k] - own) for own, k in zip(ours, matched, strict=True)],
        "lost": [in_order(own - others[k]) for own, k in zip(ours, matched, strict=True)],
        "same": [first.trails[i] == second.trails[k] for i, k in enumerate(matched)],
    }
    visited, other_visited = set().union(*ours), set().union(*others)
    gained, lost = in_order(other_visited - visited), in_order(visited - other_visited)
    return Difference(reward, survivors, gained, lost, pd.DataFrame(columns))


def _matched(mission: Mission, first: TrailPlan, second: TrailPlan) -> list[int]:
    """Match the robots of two plans, kind by kind; equal trails come first, then the nearest."""
    from scipy.optimize import linear_sum_assignment

    batch = mission.batch([first, second])
    counts, other_counts = np.split(arc_counts(batch, per_robot=True), 2)
    # Trails of the same arcs in another order have no distance, but are not equal.
    differ = [[trail != other for other in second.trails] for trail in first.trails]
    apart = distances(counts, other_counts) + 1e-9 * np.array(differ)
    kinds = np.array([mission.kinds.index(kind) for kind in mission.kind_of])
    apart[kinds[:, None] != kinds] = np.inf
    matched: list[int] = linear_sum_assignment(apart)[1].tolist()
    return matched


def _apart(one: float, other: float) -> tuple[str, str]:
    """Write two probabilities with as many digits as tell them apart, at least four."""
    differ = abs(one - other) > 1e-9
    digits = 4
    while differ and digits < 12 and f"{one:.{digits}g}" == f"{other:.{digits}g}":
        digits += 1
    return f"{one:.{digits}g}", f"{other if differ else one:.{digits}g}"


def _named(nodes: Sequence[Hashable]) -> str:
    shown = [label_text(node) for node in nodes[:_SHOWN]]
    if len(nodes) > _SHOWN:
        shown.append(f"{len(nodes) - _SHOWN} more")
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"
