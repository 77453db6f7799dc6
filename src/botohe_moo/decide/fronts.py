"""Fronts: objectives and their scales, the plans that are not dominated, numbers in words."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from botohe_moo._base.checks import check_integer, quoted
from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import PlanBatch, Plans

# Plans, or their objectives E[R] and E[S] (n_plans, 2).
PlansOrObjectives = Plans | FloatArray


def objectives_of(mission: Mission, given: PlansOrObjectives) -> FloatArray:
    """Return the objectives (n_plans, 2) of plans; objectives themselves are checked."""
    check_mission(mission)
    if not isinstance(given, PlanBatch | np.ndarray) and isinstance(given, Iterable):
        given = list(given)
    try:
        points = np.asarray([] if isinstance(given, PlanBatch) else given)
    except ValueError:  # of several lengths, hence not objectives
        points = np.empty(0, object)
    if points.dtype.kind not in "iuf" or points.size == 0:
        points = mission.evaluate(given)
    checked = check_objectives(points, "plans or objectives")
    if not len(checked):
        raise ValueError("Expected at least one plan, got none.")
    return checked


def check_objectives(points: NDArray[Any], expected: str = "objectives") -> FloatArray:
    """Check that objectives are of shape (n_plans, 2), finite and at least 0."""
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"Expected {expected} of shape (n, 2), got {points.shape}.")
    if not np.isfinite(points).all():
        row = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise ValueError(f"Expected finite objectives, got {points[row].tolist()} in row {row}.")
    if (points < 0).any():
        row = int(np.argmax((points < 0).any(axis=1)))
        raise ValueError(
            f"Expected objectives of at least 0, got {points[row].tolist()} in row {row}; pymoo's "
            "result.F holds E[R] and E[S] with the sign turned: give -result.F."
        )
    return np.asarray(points, float)


def scales(mission: Mission) -> FloatArray:
    """Return the scales of both objectives: the total reward, or 1 if that is 0, and the team."""
    return np.array([mission.total_reward or 1.0, mission.robots])


def front_rows(objectives: FloatArray) -> OffsetArray:
    """Return the rows of the non-dominated plans, by descending reward; the first of equal ones."""
    order = np.lexsort((-objectives[:, 1], -objectives[:, 0]))
    survivors = objectives[order, 1]
    before = np.maximum.accumulate(np.append(-np.inf, survivors))[:-1]
    rows: OffsetArray = order[survivors > before]
    return rows


def check_row(name: str, row: object, n_plans: int) -> int:
    """Check the index of a plan, counted from 0."""
    number = check_integer(name, row, at_least=0)
    if number >= n_plans:
        raise ValueError(f"Expected {name} among the {n_plans} plans from 0, got {quoted(row)}.")
    return number


def short(value: float) -> str:
    """Write a number with four significant digits."""
    return f"{value:.4g}"


def more(value: float, what: str) -> str:
    """Write how much more or less reward, or how many more or fewer survivors, a plan has."""
    survivors = what == "survivors"
    if abs(value) < 1e-9:
        return f"as {'many' if survivors else 'much'} {what}"
    less = "fewer" if survivors else "less"
    return f"{short(abs(value))} {'more' if value > 0 else less} {what}"
