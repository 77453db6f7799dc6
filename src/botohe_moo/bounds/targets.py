"""The choice of what to prove next: where known plans and the bound are furthest apart."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.front_bound import FrontBound

# As in ``proof``, these constants were chosen by experiment, and every bound is valid whatever they
# are.

_NEAR = 1 / 48  # of the range of E[S]: steps as near as this are as hard
_SAMPLES = 3_000  # of E[S], where known plans and bounds are compared
_ROUNDING = 1e-12  # ends of steps are raised by this share: they are sums of rounded products
_AFTER = 1e-9  # share of its survivors by which a step begins above a known plan
_CLOSE = 5e-4  # share of its goal by which the bound has to exceed it for a step to be tried
# The goal of a step that is too hard is raised by a share of the gap; from a largest share on, the
# step is tried with several times the effort instead.
_EASIER, _EASIEST = 0.25, 0.5
_MORE, _MOST_EFFORT = 8, 64


class Known:
    """The front of known plans, sampled at ``survivors`` (n); ``reached`` is their E[R] (n)."""

    def __init__(self, base_reward: float, robots: int) -> None:
        self.robots = robots
        self._objectives = np.array([[base_reward, float(robots)]])
        self.survivors: FloatArray = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * robots
        self.reached: FloatArray = np.full(_SAMPLES, base_reward)

    def add(self, objectives: FloatArray) -> None:
        """Add the E[R] and E[S] of plans (n, 2)."""
        self._objectives = np.vstack([self._objectives, objectives])
        _, ends, heights = self.stairs()
        # By rounding, the last plan may have less than all robots as its survivors.
        places = np.searchsorted(ends * (1 + _ROUNDING), self.survivors)
        self.reached = heights[np.minimum(places, len(ends) - 1)]

    def stairs(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where steps begin and end in E[S], which ascends, and their E[R]."""
        order = np.lexsort((-self._objectives[:, 0], self._objectives[:, 1]))
        reward, survivors = self._objectives[order].T
        best = np.maximum.accumulate(reward[::-1])[::-1]
        is_corner = np.append(best[1:] < best[:-1], True)
        ends = survivors[is_corner]
        return np.append(0.0, ends[:-1] * (1 + _AFTER)), ends, best[is_corner]

    def gap(self, bounds: FloatArray) -> float:
        """Return the share by which bounds at ``survivors`` exceed what is reached, on average."""
        above = float(np.maximum(0.0, bounds - self.reached).sum())
        return 0.0 if above == 0.0 else above / float(self.reached.sum() or 1e-300)


class LineTarget(NamedTuple):
    """Where a line or stairs are to be lowered: for ``moving`` robots, at an E[S] in a cell.

    ``begin`` is the E[S] at which the cell begins.
    """

    moving: int
    survivors: float
    cell: int
    begin: float


class LineTargets:
    """The choice of the next line or stairs, in one of several cells of the range of E[S]."""

    def __init__(self, known: Known, n_cells: int) -> None:
        self._known, self._n_cells = known, n_cells
        self._cells: OffsetArray = (known.survivors / known.robots * n_cells).astype(np.int64)
        self._closed: set[tuple[int, int]] = set()  # cells, with numbers of moving robots

    def take(self, bound: FrontBound) -> LineTarget | None:
        """Return the next target, and close its cell; None where no open cell has a gap."""
        known, bounds = self._known, bound.by_robots(self._known.survivors)
        above = np.maximum(0.0, bounds.max(axis=0) - known.reached)
        highest = bounds.argmax(axis=0)
        masses = np.bincount(self._cells, above, self._n_cells)
        for cell in np.argsort(-masses, kind="stable").tolist():
            inside = np.flatnonzero((self._cells == cell) & (above > 0.0))
            for moving in np.unique(highest[inside]).tolist():
                if moving > 0 and (cell, moving) not in self._closed:
                    self._closed.add((cell, moving))
                    at = inside[highest[inside] == moving]
                    middle = float(known.survivors[at[len(at) // 2]])
                    return LineTarget(moving, middle, cell, cell / self._n_cells * known.robots)
        return None

    def reopen(self, target: LineTarget) -> None:
        """Open a cell again for a number of robots, where more can be lowered."""
        self._closed.remove((target.cell, target.moving))


class StepTarget(NamedTuple):
    """A step to be proved: E[R] ≤ ``goal`` for E[S] ≥ ``survivors`` if ``moving`` robots move."""

    moving: int
    corner: int
    survivors: float
    goal: float
    share: float  # by which the goal was raised, of the gap
    effort: int


class StepTargets:
    """The choice of the next step: the one that lowers the bound the most for its effort.

    Each step begins behind a known plan, and its goal is the next one. Where a step is too hard,
    the goals of those just above and of all before it are raised as well.
    """

    def __init__(self, known: Known, robots: int, most_survival: float) -> None:
        self._known, self._robots = known, robots
        self._starts, ends, self._heights = known.stairs()
        moving = np.arange(robots + 1)[:, None]
        stay = robots - moving
        self._is_open: BoolArray = (ends > stay) & (self._starts <= stay + moving * most_survival)
        self._is_open[0] = False
        self._share = np.zeros(self._is_open.shape)
        self._effort = np.ones(self._is_open.shape, np.int64)
        self._first = np.searchsorted(known.survivors, self._starts)

    def take(self, bound: FrontBound, most_moving: int, most_effort: float) -> StepTarget | None:
        """Return the next step for up to ``most_moving`` robots, and close it meanwhile.

        Returns None where none is left.
        """
        bounds = bound.by_robots(self._starts * (1 + _AFTER))
        goals = self._heights + self._share * np.maximum(0.0, bounds - self._heights)
        gains = self._gains(bound, self._is_open & (bounds > goals * (1 + _CLOSE)), goals)
        gains[most_moving + 1 :] = 0.0
        gains[self._effort > most_effort] = 0.0
        moving, corner = (int(i) for i in np.unravel_index(gains.argmax(), gains.shape))
        if gains[moving, corner] <= 0.0:
            return None
        self._is_open[moving, corner] = False
        start, goal = float(self._starts[corner]), float(goals[moving, corner])
        share, effort = float(self._share[moving, corner]), int(self._effort[moving, corner])
        return StepTarget(moving, corner, start, goal, share, effort)

    def _gains(self, bound: FrontBound, is_worth: BoolArray, goals: FloatArray) -> FloatArray:
        """Return by how much each step would lower the bound, for its effort (as ``goals``)."""
        bounds = bound.by_robots(self._known.survivors)
        second, highest = np.partition(bounds, -2, axis=0)[-2:]
        gains = np.zeros(goals.shape)
        for moving in np.flatnonzero(is_worth.any(axis=1)).tolist():
            own = bounds[moving]
            others = np.where(own == highest, second, highest)
            for corner in np.flatnonzero(is_worth[moving]).tolist():
                tail = slice(int(self._first[corner]), None)
                left = np.maximum(goals[moving, corner], others[tail])
                gains[moving, corner] = np.maximum(0.0, own[tail] - left).sum()
        scaled: FloatArray = gains / self._effort
        return scaled

    def give_back(self, target: StepTarget, *, is_proved: bool) -> None:
        """Raise the goal or the effort of a step that is too hard; leave one closed if proved."""
        moving, corner = target.moving, target.corner
        share, effort = self._share[moving], self._effort[moving]  # views, which are changed
        self._is_open[moving, corner] = not is_proved or target.share > 0.0
        if is_proved:
            near: BoolArray = np.arange(len(share)) == corner
        else:
            # Where fewer survivors are needed, there are more trails to search.
            near = self._starts - self._starts[corner] < _NEAR * self._robots
            near &= (share == target.share) & (effort == target.effort)
        # The front of one robot is found without a goal.
        if is_proved or target.share >= _EASIEST or moving == 1:
            share[near] = 0.0
            effort[near] *= _MORE
        else:
            share[near] += _EASIER
        self._is_open[moving] &= effort <= _MOST_EFFORT
