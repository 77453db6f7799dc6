"""BOTOHE as a pymoo problem, and what pymoo prints while solving it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymoo.core.problem import Problem
from pymoo.util.display.column import Column
from pymoo.util.display.output import Output

from botohe_moo._types import FloatArray, ObjectArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

__all__ = ["BOTOHE", "FrontOutput"]


class BOTOHE(Problem):
    """Bi-objective team orienteering in hazardous environments.

    A solution is one :class:`TrailPlan`: ``X`` is an object array of shape (n, 1). pymoo
    minimises, so ``F`` holds (−E[R], −E[S]), shape (n, 2).

    Parameters
    ----------
    mission
        What to plan for.

    Raises
    ------
    TypeError
        If ``mission`` is no Mission.

    Notes
    -----
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025.
    """

    def __init__(self, mission: Mission) -> None:
        if not isinstance(mission, Mission):
            raise TypeError(
                f"Expected a Mission, got {mission!r}; load_mission(name_or_path) gives one."
            )
        super().__init__(n_var=1, n_obj=2, vtype=object)
        self.mission = mission

    def evaluate_batch(self, batch: PlanBatch) -> FloatArray:
        """Compute the objectives of many plans; every evaluation of every algorithm passes here.

        Parameters
        ----------
        batch
            Valid plans for the mission's team.

        Returns
        -------
        numpy.ndarray
            F of shape (n, 2): −E[R] and −E[S], both to be minimised.

        Raises
        ------
        PlanError
            If a plan is not valid; names the plan, robot, position and arc.
        """
        return -self.mission.evaluate(batch)

    def _evaluate(self, x: ObjectArray, out: dict[str, Any], *_: Any, **__: Any) -> None:
        out["F"] = self.evaluate_batch(self.mission.batch(x))

    def name(self) -> str:
        """Give the problem's name, as pymoo shows it."""
        return f"BOTOHE({self.mission.name})"


class FrontOutput(Output):
    """What pymoo prints under ``verbose=True``: area, largest expected reward, front size."""

    def __init__(self) -> None:
        super().__init__()
        self.area = Column("area", width=8)
        self.reward = Column("max E[R]", width=10)
        self.size = Column("n_front", width=7)
        self.columns += [self.area, self.reward, self.size]

    def update(self, algorithm: Any) -> None:
        """Read the algorithm's current optimum.

        Parameters
        ----------
        algorithm
            A pymoo algorithm that solves a :class:`BOTOHE`.
        """
        super().update(algorithm)
        opt = algorithm.opt
        objectives = np.empty((0, 2))
        if opt is not None and opt.get("feas").any():
            objectives = -opt[opt.get("feas")].get("F")
        self.area.set(area_indicator(objectives, algorithm.problem.mission))
        self.reward.set(float(objectives[:, 0].max()) if len(objectives) else None)
        self.size.set(len(objectives))
