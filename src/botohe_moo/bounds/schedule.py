"""What is proved next: where the gap is the widest, by what closes it the fastest."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

from botohe_moo.bounds.front_bound import FrontBound
from botohe_moo.bounds.proof import Proof
from botohe_moo.bounds.stairs import MOST_MOVING
from botohe_moo.bounds.steps import LEAST_SURVIVAL
from botohe_moo.bounds.targets import LineTargets, StepTargets

# As in ``proof``, these constants were chosen by experiment, and every bound is valid whatever they
# are.

# Shares of the time limit.
_FIRST_SHARE = 0.1  # for one robot: without a limit it took all of the time on 200 nodes
_SLICE = 0.04  # in which one thing is done
# What is done first is left where it does not halve the gap in this share of the time.
_HALVED_IN = 0.15
# A slice counts as if it closed at least this share of the gap, and the speed of what waits grows
# by this factor in each slice.
_LEAST_CLOSED, _AGES = 1e-3, 1.2
_CELLS = 24  # of the range of E[S], for lines and first for stairs
# Once stairs were tried in all cells, there are twice as many, and searches get this many times the
# effort, unless the gap is small, or all the last ones left more than a share of it.
_MORE_EFFORT, _MOST_CELLS, _SMALL, _STILL_HELPS = 2, 384, 1e-4, 0.99
_EFFORT_OF_LINES = 16  # times the usual search, once all lines were tried
# Where the first lines of one robot are found, in shares of its best survival: three suffice for
# its steps.
_FIRST_LINES = (0.5, 0.75, 0.25)
_SECONDS_A_BOUND = 2e-3  # to look for the widest gap
_SECONDS_OF_EFFORT = 0.2  # that a search for a step takes, for each unit of effort

# One piece of work, given the bound and the moment when it has to end; False if none is left.
Work: TypeAlias = Callable[[FrontBound, float], bool]


class Schedule:
    """Finds lines, stairs and steps, until the gap is as small as wanted or the time is over."""

    def __init__(
        self, proof: Proof, *, gap: float, callback: Callable[[FrontBound], Any] | None
    ) -> None:
        self._proof, self._clock = proof, proof.clock
        self._gap, self._callback = gap, callback

    def run(self) -> None:
        """Find lines and steps of one robot, then lines, stairs and steps of all.

        One robot comes first: its steps take little time, and make its lines unnecessary.
        """
        first = self._moment_after(_FIRST_SHARE)
        self._spend(self._first_lines(), first)
        self._spend(self._steps_work(most_moving=1), first)
        self._share_out()

    def _share_out(self) -> None:
        """Do in each slice of the time what closed the gap the fastest when it was last done.

        The speed of work that waits grows, so that it is tried again.
        """
        clock, robots = self._clock, self._proof.robots
        works = [self._lines_work(), self._stairs_work(), self._steps_work(robots)]
        hoped = math.log(2.0) / (_HALVED_IN * clock.seconds)
        speeds, gap = [math.inf, hoped, hoped], self._gap_of(self._proof.bound())
        while works and gap > self._gap and not clock.is_over():
            i, began, before = speeds.index(max(speeds)), clock.now, gap
            is_left = self._spend(works[i], self._moment_after(_SLICE))
            gap, took = self._gap_of(self._proof.bound()), clock.now - began
            speeds = [_AGES * speed for speed in speeds]
            closed = math.inf  # where known plans reach nothing
            if math.isfinite(before):
                closed = math.log((1.0 + _LEAST_CLOSED) * before / max(gap, 1e-300))
            speeds[i] = closed / max(took, 1e-9)
            if not is_left:
                del works[i], speeds[i]

    def _spend(self, work: Work, until: float) -> bool:
        """Repeat work until the time is over, or the gap is small; return whether some is left."""
        is_left = True

        def work_once() -> bool:
            nonlocal is_left
            bound = self._next_bound(until)
            if bound is None:
                return False
            is_left = work(bound, until)
            return is_left

        self._proof.turns.repeat(work_once)
        return is_left

    def _moment_after(self, share: float) -> float:
        """Return the moment when a share of all time has gone by from now on."""
        return self._clock.now + share * self._clock.seconds

    def _next_bound(self, until: float) -> FrontBound | None:
        """Return the bound to improve on; None if the time is over or the gap small enough."""
        if self._clock.is_over(until):
            return None
        bound = self._proof.bound()
        self._clock.count(_SECONDS_A_BOUND)
        if self._callback is not None:
            self._callback(bound)
        return bound if self._gap_of(bound) > self._gap else None

    def _gap_of(self, bound: FrontBound) -> float:
        """Return the share by which a bound exceeds the known plans, on average."""
        known = self._proof.known
        return known.gap(bound.bound(known.survivors))

    def _first_lines(self) -> Work:
        """Find some lines of one robot."""
        shares, proof = list(_FIRST_LINES), self._proof

        def find_next(_: FrontBound, until: float) -> bool:
            if shares:
                proof.lines[0].tighten(shares.pop(0) * proof.most_survival, 1, until)
            return len(shares) > 0

        return find_next

    def _lines_work(self) -> Work:
        """Find lines where the gap is the widest, until none can be lowered any more."""
        proof = self._proof
        effort, targets = 1, LineTargets(proof.known, _CELLS)

        def find_next(bound: FrontBound, until: float) -> bool:
            nonlocal effort, targets
            own = targets  # which another thread may replace meanwhile
            target = own.take(bound)
            if target is None:
                if effort == _EFFORT_OF_LINES:
                    return False
                effort, targets = _EFFORT_OF_LINES, LineTargets(proof.known, _CELLS)
                return True
            moving, lines = target.moving, proof.lines[target.moving - 1]
            x = target.survivors - (proof.robots - moving)
            x = max(x, moving * proof.min_survival)
            if lines.tighten(x, effort, until):
                own.reopen(target)
            return True

        return find_next

    def _stairs_work(self) -> Work:
        """Find stairs where the gap is the widest, at more places as long as that helps."""
        proof = self._proof
        n_cells, effort, targets = _CELLS, 1, LineTargets(proof.known, _CELLS)
        before = math.inf

        def find_next(bound: FrontBound, until: float) -> bool:
            nonlocal n_cells, effort, targets, before
            if proof.most_survival < LEAST_SURVIVAL:
                return False
            target = targets.take(bound)
            if target is None:
                gap = self._gap_of(bound)
                if n_cells == _MOST_CELLS or gap < _SMALL or gap > _STILL_HELPS * before:
                    return False
                before, n_cells, effort = gap, 2 * n_cells, _MORE_EFFORT * effort
                targets = LineTargets(proof.known, n_cells)
            elif target.moving <= MOST_MOVING:
                x = max(0.0, target.begin - (proof.robots - target.moving))
                proof.stairs.improve(target.moving, x, effort, until)
            return True

        return find_next

    def _steps_work(self, most_moving: int) -> Work:
        """Find steps for up to ``most_moving`` robots, until all are tried."""
        proof = self._proof
        targets = StepTargets(proof.known, proof.robots, proof.most_survival)

        def find_next(bound: FrontBound, until: float) -> bool:
            left = self._clock.seconds - self._clock.now  # below 0 on fast machines
            target = targets.take(bound, most_moving, max(1.0, left / _SECONDS_OF_EFFORT))
            if target is None:
                return False
            x = max(0.0, target.survivors - (proof.robots - target.moving))
            steps, goal = proof.steps[target.moving - 1], target.goal / proof.unit
            is_proved = steps.tighten(x, goal, target.effort, until)
            targets.give_back(target, is_proved=is_proved)
            return True

        return find_next
