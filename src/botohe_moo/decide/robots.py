"""A plan robot by robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.outcomes import collect_probabilities
from botohe_moo.trails import TrailPlan

if TYPE_CHECKING:
    import pandas as pd


def robot_table(mission: Mission, plan: TrailPlan) -> pd.DataFrame:
    """Return what each robot of a plan risks, and what it brings.

    Parameters
    ----------
    mission, plan
        A mission, and a plan of it; a PlanError is raised if it is not valid.

    Returns
    -------
    pandas.DataFrame
        A row for each robot: ``robot``, its number from 0; ``kind``, the name of its kind;
        ``survival``, the probability that it survives; ``length`` of its trail; and ``reward``, the
        E[R] of this robot alone. Robots that collect the same rewards bring less together.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.decide import robot_table
    >>> toy = load_mission("toy")
    >>> robot_table(toy, toy.plan([[1, 2, 4, 2, 1], [1]])).round(3)
       robot   kind  survival  length  reward
    0      0  robot     0.656     4.0    3.24
    1      1  robot     1.000     0.0    0.00
    """
    import pandas as pd

    return pd.DataFrame(robot_rows(mission, plan))


def robot_rows(mission: Mission, plan: TrailPlan) -> list[dict[str, Any]]:
    """Return the rows of :func:`robot_table` as plain values."""
    columns = {
        "robot": range(check_mission(mission).robots),
        "kind": [kind.name for kind in mission.kind_of],
        "survival": mission.robot_survival([plan])[0].tolist(),
        "length": mission.trail_lengths([plan])[0].tolist(),
        "reward": (collect_probabilities(mission, plan) @ mission.rewards).tolist(),
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
