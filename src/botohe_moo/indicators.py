"""Quality of a front as one number."""

from __future__ import annotations

import moocore
import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.mission.model import Mission

__all__ = ["area_indicator"]

_ROUNDING = 1e-9


def area_indicator(objectives: ArrayLike, mission: Mission) -> float:
    """Give the share of the objective space that a front dominates.

    The hypervolume with the origin as reference, divided by (total reward × robots): both bounds
    belong to the mission, so that areas compare across runs and studies.

    Parameters
    ----------
    objectives
        Shape (n, 2): E[R] and E[S] of each plan, both to be maximised (``-result.F``); dominated
        plans add nothing, no plans give 0.
    mission
        The mission the plans are for.

    Returns
    -------
    float
        In [0, 1]; 0 where the mission offers no reward at all.

    Raises
    ------
    ValueError
        If ``objectives`` is not of shape (n, 2), holds NaN or infinity, or is ``result.F``, which
        holds the negatives.

    Notes
    -----
    The area indicator of Simon, Richley, Overbey and Perez-Lavin, normalised; hypervolume by
    moocore (Fonseca, Paquete and López-Ibáñez, "An improved dimension-sweep algorithm for the
    hypervolume indicator", CEC 2006).
    """
    values = np.asarray(objectives, np.float64)
    if values.shape == (0,):
        return 0.0
    if values.ndim != 2 or values.shape[1] != 2:
        raise ValueError(f"Expected objectives of shape (n, 2), got {values.shape}.")
    if not (values < np.inf).all():
        raise ValueError(f"Expected objectives without NaN and infinity, got {values}.")
    if np.isfinite(values).all() and (values <= 0).all() and (values < 0).any():
        raise ValueError(
            f"Expected E[R] and E[S], which are at least 0, got {values}; pymoo's F holds their "
            "negatives: give -result.F."
        )
    whole = mission.total_reward * mission.robots
    if whole == 0 or len(values) == 0:
        return 0.0
    area = float(moocore.hypervolume(values, ref=[0.0, 0.0], maximise=True)) / whole
    # E[R] and the total reward are sums in different orders: the whole can be 1 + 4e-16.
    return 1.0 if 1.0 < area < 1.0 + _ROUNDING else area
