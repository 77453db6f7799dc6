"""What a plan costs: its neighbours on the front, and the reward that survivors cost."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from botohe_moo.base.messages import check_number
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.decide.fronts import (
    SLACK,
    PlansOrObjectives,
    check_row,
    difference_text,
    front_rows,
    knees,
    objectives_of,
    representing,
    scales,
    short_text,
)
from botohe_moo.mission.model import Mission
from botohe_moo.trails import TrailPlan

_ROWS = 10  # of a table that does not show all plans
_HEADING = ("plan_id", "reward", "survivors", "reward per survivor more, to next row")


@dataclass(frozen=True)
class Step:
    """From a plan to another one.

    Attributes
    ----------
    index
        Row of the other plan.
    reward, survivors
        E[R] and E[S] of the other plan minus those of this one.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Step, neighbours
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> step = neighbours(toy, front, 1).safer
    >>> step.index, step.reward, round(step.survivors, 6), round(step.rate, 6)
    (2, -3.0, 0.4, 0.75)
    """

    index: int
    reward: float
    survivors: float

    @property
    def rate(self) -> float:
        """Reward for 0.1 survivors; nan where one plan has no less of both."""
        if self.reward * self.survivors >= 0:
            return math.nan
        return -0.1 * self.reward / self.survivors


@dataclass(frozen=True)
class Neighbours:
    """What a plan costs beside its neighbours on the front; ``str`` says it.

    Attributes
    ----------
    richer, safer
        To the plans of the front that have a little more reward, and a little more survivors; None
        if there is none.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import Neighbours, neighbours
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> print(neighbours(toy, front, 0))
    Beside it on the front, plan 1 has 1 more survivors for 1 less reward.
    """

    richer: Step | None
    safer: Step | None

    def __str__(self) -> str:
        parts = []
        for step in dict.fromkeys((self.richer, self.safer)):
            if step is not None:
                reward = difference_text(step.reward, "reward")
                survivors = difference_text(step.survivors, "survivors")
                both = (reward, survivors) if step is self.richer else (survivors, reward)
                word = "for" if step.reward * step.survivors < 0 else "and"
                parts.append(f"plan {step.index} has {both[0]} {word} {both[1]}")
        if not parts:
            return "No plan of the front has more reward or more survivors."
        return f"Beside it on the front, {'; '.join(parts)}."


def neighbours(mission: Mission, plans: PlansOrObjectives, index: int) -> Neighbours:
    """Find the plans beside a plan on the front, and the differences to them.

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
    >>> from botohe_moo.decide import neighbours
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> neighbours(toy, front, 0).richer is None  # nothing has more reward
    True
    """
    objectives = objectives_of(mission, plans)
    index = check_row("index", index, len(objectives))
    rows = front_rows(objectives)
    gain = (objectives[rows] - objectives[index]) / scales(mission)
    richer, safer = rows[gain[:, 0] > SLACK], rows[gain[:, 1] > SLACK]  # by descending reward
    return Neighbours(
        _step(objectives, index, richer[-1:]),
        _step(objectives, index, safer[:1]),
    )


def _step(objectives: FloatArray, index: int, to: OffsetArray) -> Step | None:
    if not len(to):
        return None
    return Step(int(to[0]), *(objectives[to[0]] - objectives[index]).tolist())


@dataclass(frozen=True)
class ExchangeRate:
    """What 0.1 survivors cost in reward at a plan, over a window; ``str`` says it.

    Attributes
    ----------
    index
        Row of the plan.
    window
        Survivors up to which other plans were looked at, on both sides.
    safer
        To the plan that was compared on the side of more survivors; its ``rate`` is the reward that
        0.1 survivors more cost. None if no plan of the front has more survivors for less reward.
    richer
        The same on the other side; its ``rate`` is the reward that 0.1 survivors fewer bring.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import ExchangeRate, exchange_rate
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> rate = exchange_rate(toy, front, 1, window=0.5)
    >>> rate.window, rate.safer.index, rate.richer.index
    (0.5, 2, 0)
    """

    index: int
    window: float
    safer: Step | None
    richer: Step | None

    def __str__(self) -> str:
        parts = []
        for step, does in ((self.safer, "more cost"), (self.richer, "fewer bring")):
            if step is not None:
                distance = abs(step.survivors)
                which = ", the nearest" if distance > self.window else ""
                away = f"plan {step.index}{which}, {short_text(distance)} survivors away"
                parts.append(f"0.1 survivors {does} {short_text(step.rate)} reward (to {away})")
        if not parts:
            return f"No plan of the front trades reward for survivors with plan {self.index}."
        within = f"within {short_text(self.window)} survivors"
        return f"At plan {self.index}, {within}: {'; '.join(parts)}."


def exchange_rate(
    mission: Mission, plans: PlansOrObjectives, index: int, *, window: float = 0.25
) -> ExchangeRate:
    """Compute what 0.1 survivors cost in reward at a plan, in both directions.

    On each side the plan is compared with the farthest plan of the front within the window, or with
    the nearest one if the window holds none. Only plans that have more of one objective for less of
    the other count, and whose survivors differ by more than 1e-9 of the robots.

    Parameters
    ----------
    mission, plans, index
        As for :func:`neighbours`.
    window
        How many survivors more and fewer the other plan may have, above 0. A wider window averages
        over more of the front.

    Raises
    ------
    ValueError
        As for :func:`neighbours`, or if ``window`` is not a number above 0.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import exchange_rate
    >>> toy = load_mission("toy")
    >>> front = [[8, 0], [7, 1], [4, 1.4], [0, 2]]  # E[R] and E[S] of four plans
    >>> round(exchange_rate(toy, front, 1).safer.rate, 6)  # reward for 0.1 survivors
    0.75
    """
    objectives = objectives_of(mission, plans)
    index = check_row("index", index, len(objectives))
    window = check_number("window", window, above=0)
    rows = front_rows(objectives)
    reward, survivors = (objectives[rows] - objectives[index]).T  # survivors ascend
    slack = SLACK * mission.robots
    safer = rows[(survivors > slack) & (reward < 0)]
    richer = rows[(survivors < -slack) & (reward > 0)][::-1]
    steps = []
    for side in (safer, richer):
        distance = np.abs(objectives[side, 1] - objectives[index, 1])
        within = int((distance <= window).sum())
        steps.append(_step(objectives, index, side[max(within, 1) - 1 :][:1]))
    return ExchangeRate(index, window, *steps)


def shown_rows(
    mission: Mission, plans: tuple[TrailPlan, ...], objectives: FloatArray
) -> tuple[int, ...]:
    """Select some ten rows along a front: its ends, its knee, and plans that represent it."""
    if len(plans) <= _ROWS:
        return tuple(range(len(plans)))
    marked = {0, len(plans) - 1, knees(mission, objectives)[0].index}
    others = representing(mission, mission.batch(plans), objectives, _ROWS - len(marked))
    return tuple(sorted(marked.union(others)))


def front_table(mission: Mission, objectives: FloatArray, rows: tuple[int, ...]) -> str:
    """Lay out rows of a front, with what a survivor more costs, and mark the knee."""
    knee = knees(mission, objectives)[0].index if len(objectives) > 2 else None
    costs = [_cost(mission, *objectives[[row, safer]]) for row, safer in pairwise(rows)]
    table = [_HEADING]
    for row, cost in zip(rows, [*costs, ""], strict=True):
        reward, survivors = objectives[row].tolist()
        table.append((str(row), f"{reward:.4f}", f"{survivors:.4f}", cost))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = [
        "  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True))
        for line in table
    ]
    marks = ["", *("  knee" if row == knee else "" for row in rows)]
    return "\n".join(f"{line}{mark}".rstrip() for line, mark in zip(lines, marks, strict=True))


def _cost(mission: Mission, plan: FloatArray, safer: FloatArray) -> str:
    """Write the reward that is given up for each further expected survivor, from plan to plan."""
    reward, survivors = (plan - safer).tolist()
    is_more = survivors < -SLACK * mission.robots
    return short_text(reward / -survivors) if is_more else "-"
