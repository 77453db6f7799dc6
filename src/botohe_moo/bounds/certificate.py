"""What has been proved of a front so far."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds.front_bound import Line, Step, least_total, lower_envelope
from botohe_moo.bounds.net import RelaxedTrail
from botohe_moo.bounds.prices import Prices

_SAMPLES = 200  # of survival, where lines are compared
_FALL = 2e-5  # of all reward: heights are raised to multiples of it, so that there are few steps


class PricedLine(NamedTuple):
    """A line, and the prices that gave it, if any did."""

    line: Line
    prices: Prices | None

    def at(self, x: float) -> float:
        """Return the E[R] of the line where survivals sum to ``x``."""
        return self.line.most - self.line.mu * x


class Sums(NamedTuple):
    """What stairs prove of teams of ``moving`` robots.

    A trail with survival s is on step ⌊s / width⌋. Where the numbers of a team's steps sum to
    ``first`` + i or more, E[R] is at most ``most[i]``.
    """

    moving: int
    first: int
    most: FloatArray


class Facts(NamedTuple):
    """What one attempt has proved, and the relaxed trails that have kept it from proving more."""

    lines: tuple[PricedLine, ...] = ()
    sums: tuple[Sums, ...] = ()
    steps: tuple[Step, ...] = ()
    repeating: tuple[RelaxedTrail, ...] = ()
    is_proved: bool = True  # whether the attempt has reached its goal


class Certificate:
    """All facts about a front: what teams collect at most, for each number of moving robots.

    ``first`` has a line for 1, 2, … moving robots. Sums are kept for up to ``n_sums`` robots, on
    ``n_steps`` steps of ``width``. ``total`` is all reward.

    Attributes
    ----------
    lines
        For each number of moving robots, those that may be the lowest somewhere.
    """

    def __init__(
        self, first: list[Line], n_sums: int, n_steps: int, width: float, total: float
    ) -> None:
        self.lines = [[PricedLine(line, None)] for line in first]
        # Entry t of row j − 1: no team of j whose steps sum to t or more gets above it.
        self._sums = [np.full(j * (n_steps - 1) + 1, np.inf) for j in range(1, n_sums + 1)]
        self._steps: list[list[Step]] = [[] for _ in first]
        self._width, self._total = width, total

    def add(self, facts: Facts) -> None:
        """Add what was proved."""
        for each in facts.lines:
            if math.isfinite(each.line.most):  # any prices come from a programme without a solution
                self.lines[each.line.n_robots - 1].append(each)
        for moving in {each.line.n_robots for each in facts.lines}:
            own = self.lines[moving - 1]
            lowest = lower_envelope(*zip(*((line.most, line.mu) for line, _ in own), strict=True))
            self.lines[moving - 1] = [own[i] for i in lowest.tolist()]
        for sums in facts.sums:
            row = self._sums[sums.moving - 1][sums.first :]
            np.minimum(row, sums.most[: len(row)], out=row)
        for step in facts.steps:
            if step.most < self.bound(step.n_robots, step.least):
                steps = self._steps[step.n_robots - 1]
                kept = [old for old in steps if old.least < step.least or old.most < step.most]
                self._steps[step.n_robots - 1] = [*kept, step]

    def line_at(self, moving: int, x: float) -> float:
        """Bound E[R] as :meth:`bound` does, by lines alone."""
        return min(priced.at(x) for priced in self.lines[moving - 1])

    def bound(self, moving: int, x: float) -> float:
        """Bound E[R] where the survivals of ``moving`` robots sum to ``x`` or more."""
        heights = [self.line_at(moving, x)]
        heights += [step.most for step in self._steps[moving - 1] if step.least <= x]
        if moving <= len(self._sums):
            row = self._sums[moving - 1]
            total = int(least_total(x, self._width, moving))
            heights.append(row[: total + 1].min())
        return float(min(heights))

    def steps(self) -> list[Step]:
        """Return all steps, with those of sums.

        Numbers of steps sum to t or more where survivals sum to (t + moving − 1) · width.
        """
        found, fall = [], _FALL * self._total or 1.0
        for moving, row in enumerate(self._sums, 1):
            most = np.minimum.accumulate(np.maximum(row, np.ceil(row / fall) * fall))
            for total in np.flatnonzero(most < np.append(np.inf, most[:-1])).tolist():
                least = (total + moving - 1) * self._width if total else 0.0
                found.append(Step(moving, float(most[total]), least * (1 + 1e-12), "exact"))
        return [*(step for own in self._steps for step in own), *found]

    def lowest(self, moving: int, x: float, end: float, n_most: int) -> list[Prices]:
        """Return the prices of up to ``n_most`` lines that are the lowest from ``x`` to ``end``.

        Each lowers the bound more than any other would beside those before it.
        """
        lines = [(line, prices) for line, prices in self.lines[moving - 1] if prices is not None]
        at = np.linspace(x, end, _SAMPLES)
        heights = np.array([line.most - line.mu * at for line, _ in lines]).reshape(-1, _SAMPLES)
        lowest, chosen = np.full(_SAMPLES, np.inf), list[int]()
        while lines and len(chosen) < n_most:
            best = int(np.minimum(heights, lowest).sum(axis=1).argmin())
            if best in chosen:
                break
            chosen.append(best)
            lowest = np.minimum(lowest, heights[best])
        return [lines[i][1] for i in chosen]
