"""What is attempted next: where known plans and the bound are the furthest apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeAlias

import numpy as np

from botohe_moo.base.types import BoolArray, FloatArray, OffsetArray
from botohe_moo.bounds.certificate import Certificate, Facts
from botohe_moo.bounds.front_bound import FrontBound
from botohe_moo.bounds.ground import MOST_SUMMED, Ground, Target
from botohe_moo.bounds.lines import LineProver
from botohe_moo.bounds.stairs import StairsProver
from botohe_moo.bounds.teams import LEAST_SURVIVAL, TeamProver

# As in ``ground``, these constants were chosen by experiment, and every bound is valid whatever
# they are.

_CELLS = 24  # of the range of E[S] in the first round, and twice as many in each further one
_MOST_ROUNDS = 5
_TURN = 0.04  # of the time, in which one kind is attempted
# Where one robot is bounded at first, as shares of its largest survival: that is quick, and prices
# for one robot bound any number of them.
_FIRST = 0.5, 0.75, 0.25
# Until they are attempted, kinds but lines count as if they closed half of the gap in this share of
# the time.
_HALVED_IN = 0.15
# A turn counts as if it closed at least this share of the gap, and the speed of kinds that wait
# grows by this factor in each turn.
_LEAST_CLOSED, _AGES = 1e-3, 1.2
_NEAR = 1 / 48  # of the range of E[S]: steps as near as this are as hard
_CLOSE = 5e-4  # share of its goal by which the bound has to exceed it for a step to be tried
# The goal of a step that is too hard is raised by a share of the gap; from a largest share on, the
# step is tried with several times the effort instead.
_EASIER, _EASIEST = 0.25, 0.5
_MORE, _MOST_EFFORT = 8, 64
_SAMPLES = 3_000  # of E[S], where known plans and bounds are compared
_ROUNDING = 1e-12  # ends of steps are raised by this share: they are sums of rounded products
_AFTER = 1e-9  # share of its survivors by which a step begins above a known plan


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
        _, ends, heights = self.steps()
        # By rounding, the last plan may have less than all robots as its survivors.
        places = np.searchsorted(ends * (1 + _ROUNDING), self.survivors)
        self.reached = heights[np.minimum(places, len(ends) - 1)]

    def steps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where steps begin and end in E[S], which ascends, and their E[R]."""
        order = np.lexsort((-self._objectives[:, 0], self._objectives[:, 1]))
        reward, survivors = self._objectives[order].T
        best = np.maximum.accumulate(reward[::-1])[::-1]
        is_corner = np.append(best[1:] < best[:-1], True)
        ends = survivors[is_corner]
        return np.append(0.0, ends[:-1] * (1 + _AFTER)), ends, best[is_corner]

    def gap(self, bound: FrontBound) -> float:
        """Return the share by which a bound exceeds what is reached, on average."""
        above = float(np.maximum(0.0, bound.bound(self.survivors) - self.reached).sum())
        return 0.0 if above == 0.0 else above / float(self.reached.sum() or 1e-300)


class CellTargets:
    """Targets in equal cells of the range of E[S], each tried once.

    A cell is tried with each number of moving robots whose bound is the highest anywhere in it. A
    target lies where the cell begins for stairs, and in the middle for lines.
    """

    def __init__(self, known: Known, n_cells: int, effort: int, *, stairs: bool) -> None:
        self._known, self._n_cells, self._effort = known, n_cells, effort
        self._is_stairs, self._most_moving = stairs, MOST_SUMMED if stairs else known.robots
        self._cells: OffsetArray = (known.survivors / known.robots * n_cells).astype(np.int64)
        self._closed: set[tuple[int, int]] = set()  # cells, with numbers of moving robots

    def take(self, bound: FrontBound) -> tuple[Target, tuple[int, int]] | None:
        """Return a target in the cell with the widest gap: where it begins, or in the middle."""
        known, bounds = self._known, bound.by_robots(self._known.survivors)
        above = np.maximum(0.0, bounds.max(axis=0) - known.reached)
        highest = bounds.argmax(axis=0)
        masses = np.bincount(self._cells, above, self._n_cells)
        for cell in np.argsort(-masses, kind="stable").tolist():
            inside = np.flatnonzero((self._cells == cell) & (above > 0.0))
            for moving in np.unique(highest[inside]).tolist():
                if 0 < moving <= self._most_moving and (cell, moving) not in self._closed:
                    self._closed.add((cell, moving))
                    at = inside[highest[inside] == moving]
                    survivors = float(known.survivors[at[len(at) // 2]])
                    if self._is_stairs:
                        survivors = cell / self._n_cells * known.robots
                    x = max(survivors - (known.robots - moving), 0.0, moving * bound.min_survival)
                    return Target(moving, x, effort=self._effort), (cell, moving)
        return None

    def judge(self, place: tuple[int, int], facts: Facts, has_learned: bool) -> None:
        """Open a cell again where relaxed trails have learned something."""
        if has_learned and facts.repeating:
            self._closed.remove(place)


class StepTargets:
    """Targets just above the E[S] of known plans; the goal is the E[R] of the next plan above.

    Where one is too hard, its goal is raised, and so are those of all before it and of near ones
    after it. In the end their effort is raised instead.
    """

    def __init__(self, known: Known, ground: Ground) -> None:
        self._known, self._unit = known, ground.unit
        self._robots = robots = known.robots
        self._starts, ends, self._heights = known.steps()
        moving = np.arange(robots + 1)[:, None]
        least, most = robots - moving, robots - moving + moving * ground.most_survival
        self._is_open: BoolArray = (ends > least) & (self._starts <= most)
        # Stairs of one robot need no goal, and those of many take too long to sum.
        self._is_open[:2] = self._is_open[MOST_SUMMED + 1 :] = False
        self._share = np.zeros(self._is_open.shape)
        self._effort = np.ones(self._is_open.shape, np.int64)
        self._first = np.searchsorted(known.survivors, self._starts)

    def take(self, bound: FrontBound) -> tuple[Target, Any] | None:
        """Return the step that would lower the bound the most for its effort."""
        bounds = bound.by_robots(self._starts * (1 + _AFTER))
        goals = self._heights + self._share * np.maximum(0.0, bounds - self._heights)
        gains = self._gains(bound, self._is_open & (bounds > goals * (1 + _CLOSE)), goals)
        at = moving, corner = tuple(int(i) for i in np.unravel_index(gains.argmax(), gains.shape))
        if gains[at] <= 0.0:
            return None
        self._is_open[at] = False
        x = max(0.0, float(self._starts[corner]) - (self._robots - moving))
        effort = int(self._effort[at])
        target = Target(moving, x, float(goals[at]) / self._unit, effort)
        return target, (moving, corner, float(self._share[at]), effort)

    def _gains(self, bound: FrontBound, is_worth: BoolArray, goals: FloatArray) -> FloatArray:
        """Return by how much each step would lower the bound for its effort (as ``goals``)."""
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

    def judge(self, place: Any, facts: Facts, has_learned: bool) -> None:  # noqa: ARG002
        """Raise goals or efforts of steps that are too hard; leave a step closed if proved."""
        moving, corner, share, effort = place
        self._is_open[moving, corner] = not facts.is_proved or share > 0.0
        # Where fewer survivors are needed, there are more trails to search.
        near = self._starts - self._starts[corner] < _NEAR * self._robots
        near &= (self._share[moving] == share) & (self._effort[moving] == effort)
        if facts.is_proved:
            near &= np.arange(len(near)) == corner
        if facts.is_proved or share >= _EASIEST:
            self._share[moving, near] = 0.0
            self._effort[moving, near] *= _MORE
        else:
            self._share[moving, near] += _EASIER
        self._is_open[moving] &= self._effort[moving] <= _MOST_EFFORT


Prover: TypeAlias = LineProver | StairsProver | TeamProver
# ``take`` gives a target and its place; ``judge`` hears how the attempt at that place went.
Targets: TypeAlias = CellTargets | StepTargets


class Attempts:
    """Attempts of one kind: rounds of targets, each with more places or effort than the last."""

    def __init__(self, prover: Prover, rounds: Iterable[Targets]) -> None:
        self.prover, self._rounds = prover, iter(rounds)
        self._targets: Targets | None = next(self._rounds, None)

    def take(self, bound: FrontBound, n_most: int) -> list[tuple[Target, Any, Targets]]:
        """Return up to ``n_most`` targets with their places; none where all were tried."""
        found: list[tuple[Target, Any, Targets]] = []
        while self._targets is not None and len(found) < n_most:
            taken = self._targets.take(bound)
            if taken is not None:
                found.append((*taken, self._targets))
            elif found:
                break  # judging these may open others
            else:
                self._targets = next(self._rounds, None)
        return found


class Schedule:
    """Attempts of all kinds in turns: of the kind that closed the gap the fastest the last time."""

    def __init__(
        self,
        ground: Ground,
        certificate: Certificate,
        known: Known,
        bound: Callable[[], FrontBound],
        n_threads: int,
    ) -> None:
        self._ground, self._certificate, self._known = ground, certificate, known
        self._bound, self._n_threads = bound, n_threads
        efforts = [2**i for i in range(_MOST_ROUNDS)]
        has_stairs = ground.most_survival >= LEAST_SURVIVAL
        lines = (CellTargets(known, _CELLS * e, e, stairs=False) for e in efforts[:2])
        cells = (CellTargets(known, _CELLS * e, e, stairs=True) for e in efforts if has_stairs)
        steps = [StepTargets(known, ground)] if has_stairs else []
        self._kinds = [
            Attempts(LineProver(ground), lines),
            Attempts(StairsProver(ground), cells),
            Attempts(TeamProver(ground), steps),
        ]

    def run(self, gap: float, callback: Callable[[FrontBound], Any] | None) -> None:
        """Prove until the gap is as small as wanted, nothing is left to try, or time is over."""

        def look() -> tuple[FrontBound, float]:
            bound = self._bound()
            if callback is not None:
                callback(bound)
            return bound, self._known.gap(bound)

        deadline = self._ground.deadline
        speeds = dict.fromkeys(self._kinds, math.log(2.0) / (_HALVED_IN * deadline.seconds))
        speeds[self._kinds[0]] = math.inf
        with ThreadPoolExecutor(self._n_threads) as threads:
            try:
                for share in _FIRST:
                    first = Target(1, share * self._ground.most_survival)
                    self._attempt(self._kinds[0].prover, [first], threads)
                bound, now = look()
                while speeds and now > gap and not deadline.is_over():
                    kind, before, began = max(speeds, key=speeds.__getitem__), now, deadline.work
                    end = began + _TURN * deadline.seconds
                    while deadline.work < end and now > gap and not deadline.is_over():
                        taken = kind.take(bound, self._n_threads)
                        if not taken:
                            del speeds[kind]
                            break
                        targets = [target for target, _, _ in taken]
                        found, has_learned = self._attempt(kind.prover, targets, threads)
                        for (_, place, judging), facts in zip(taken, found, strict=True):
                            judging.judge(place, facts, has_learned)
                        bound, now = look()
                    speeds = {each: _AGES * speed for each, speed in speeds.items()}
                    if kind in speeds:  # the fall of the gap's logarithm for each second of work
                        closed = (1.0 + _LEAST_CLOSED) * min(before, 1e300) / max(now, 1e-300)
                        speeds[kind] = math.log(closed) / max(deadline.work - began, 1e-9)
            except BaseException:
                deadline.end()  # for the other threads
                raise

    def _attempt(
        self, prover: Prover, targets: list[Target], threads: ThreadPoolExecutor
    ) -> tuple[list[Facts], bool]:
        """Attempt some targets side by side, add what they prove, and learn.

        Returns what was proved for each, and whether relaxed trails have learned something.
        """
        ground, certificate = self._ground, self._certificate
        found = list(threads.map(lambda each: prover.prove(each, certificate), targets))
        repeating = [trail for facts in found for trail in facts.repeating]
        has_learned = bool(repeating) and ground.relaxation.remember(repeating)
        if has_learned:
            ground.pool.drop_forbidden(ground.relaxation.allows)
        for facts in found:
            certificate.add(facts)
        return found, has_learned
