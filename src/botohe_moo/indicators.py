"""Quality of a front as one number."""

from __future__ import annotations

import moocore
import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.types import FloatArray
from botohe_moo.mission.model import Mission

__all__ = ["TIE", "area_indicator", "epsilon_indicator", "igd_plus_indicator"]

# What differs less comes from the order in which sums were rounded, not from better plans; ranks
# would make as much of it as of anything else. Indicators are shares of what a mission offers.
TIE = 1e-12
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
    values = _checked("objectives", objectives)
    whole = mission.total_reward * mission.robots
    if whole == 0 or len(values) == 0:
        return 0.0
    area = float(moocore.hypervolume(values, ref=[0.0, 0.0], maximise=True)) / whole
    # E[R] and the total reward are sums in different orders: the whole can be 1 + 4e-16.
    return 1.0 if 1.0 < area < 1.0 + _ROUNDING else area


def igd_plus_indicator(objectives: ArrayLike, reference: ArrayLike, mission: Mission) -> float:
    """Give how far a front is from a reference front on average: its IGD+.

    For each point of the reference, the distance to the nearest plan, of which only what the plan
    lacks counts. E[R] and E[S] have different units: E[R] is divided by the mission's total
    reward, E[S] by its robots, before distances are taken.

    Parameters
    ----------
    objectives
        Shape (n, 2): E[R] and E[S] of each plan, both to be maximised (``-result.F``). No plans
        are scored as the one that brings nothing back, (0, 0), and never as perfect.
    reference
        Shape (m, 2): E[R] and E[S] of the reference front, at least one point.
    mission
        The mission the plans are for. Where it offers no reward at all, E[R] does not count.

    Returns
    -------
    float
        At least 0; 0 where some plan matches or exceeds each point of the reference.

    Raises
    ------
    ValueError
        If ``objectives`` or ``reference`` is not of shape (n, 2), holds NaN or infinity, or is
        ``result.F``, which holds the negatives; if ``reference`` is empty.

    Notes
    -----
    Ishibuchi, Masuda, Tanigaki and Nojima, "Modified distance calculation in generational
    distance and inverted generational distance", EMO 2015; computed by moocore.
    """
    points, targets = _normalised(objectives, reference, mission)
    return float(moocore.igd_plus(points, ref=targets, maximise=True))


def epsilon_indicator(objectives: ArrayLike, reference: ArrayLike, mission: Mission) -> float:
    """Give by how much a front has to be moved to cover a reference front: its additive epsilon.

    E[R] and E[S] have different units: E[R] is divided by the mission's total reward, E[S] by its
    robots, so that one step is the same share of what is possible in both.

    Parameters
    ----------
    objectives
        Shape (n, 2): E[R] and E[S] of each plan, both to be maximised (``-result.F``). No plans
        are scored as the one that brings nothing back, (0, 0).
    reference
        Shape (m, 2): E[R] and E[S] of the reference front, at least one point.
    mission
        The mission the plans are for. Where it offers no reward at all, E[R] does not count.

    Returns
    -------
    float
        The smallest number that, added to both normalised objectives of all plans, lets some plan
        match each point of the reference; below 0 where the front is ahead of all of it.

    Raises
    ------
    ValueError
        If ``objectives`` or ``reference`` is not of shape (n, 2), holds NaN or infinity, or is
        ``result.F``, which holds the negatives; if ``reference`` is empty.

    Notes
    -----
    Zitzler, Thiele, Laumanns, Fonseca and Grunert da Fonseca, "Performance assessment of
    multiobjective optimizers: an analysis and review", IEEE Transactions on Evolutionary
    Computation 7(2), 2003; computed by moocore.
    """
    points, targets = _normalised(objectives, reference, mission)
    return float(moocore.epsilon_additive(points, ref=targets, maximise=True))


def _checked(name: str, given: ArrayLike) -> FloatArray:
    """Give E[R] and E[S] as an array of shape (n, 2), n may be 0; minus infinity is let through."""
    values = np.asarray(given, np.float64)
    if values.shape == (0,):
        return np.empty((0, 2))
    if values.ndim != 2 or values.shape[1] != 2:
        raise ValueError(f"Expected {name} of shape (n, 2), got {values.shape}.")
    if not (values < np.inf).all():
        raise ValueError(f"Expected {name} without NaN and infinity, got {values}.")
    if np.isfinite(values).all() and (values <= 0).all() and (values < 0).any():
        raise ValueError(
            f"Expected E[R] and E[S], which are at least 0, got {values}; pymoo's F holds their "
            "negatives: give -result.F."
        )
    return values


def _normalised(
    objectives: ArrayLike, reference: ArrayLike, mission: Mission
) -> tuple[FloatArray, FloatArray]:
    """Give both as shares of the total reward and of the robots."""
    points = _checked("objectives", objectives)
    targets = _checked("reference", reference)
    if not len(targets):
        raise ValueError("Expected at least one point in reference, got none.")
    for name, values in (("objectives", points), ("reference", targets)):
        if not np.isfinite(values).all():
            raise ValueError(f"Expected {name} without NaN and infinity, got {values}.")
    if not len(points):
        points = np.zeros((1, 2))  # moocore would call nothing perfect
    reward = mission.total_reward
    whole = np.array([reward if reward > 0 else np.inf, mission.robots])
    return points / whole, targets / whole
