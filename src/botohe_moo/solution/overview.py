"""A front as a table for people: a handful of its plans, or all."""

from itertools import pairwise

from botohe_moo._base.types import FloatArray
from botohe_moo.decide.fronts import knees, representatives, short
from botohe_moo.mission.model import Mission
from botohe_moo.trails import TrailPlan

_ROWS = 10
_HEADING = ("plan_id", "reward", "survivors", "reward per survivor more, to next row")
_SLACK = 1e-9  # of the total reward and of the robots: below, objectives differ by rounding


def shown_rows(
    mission: Mission, plans: tuple[TrailPlan, ...], objectives: FloatArray
) -> tuple[int, ...]:
    """Select some ten rows along a front: its ends, its knee, and plans that represent it."""
    if len(plans) <= _ROWS:
        return tuple(range(len(plans)))
    marked = {0, len(plans) - 1, knees(mission, objectives)[0].index}
    return tuple(sorted(marked.union(representatives(mission, plans, _ROWS - len(marked)))))


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
    is_more = survivors < -_SLACK * mission.robots
    return short(reward / -survivors) if is_more else "-"
