"""The search for a bound: what is proved, and what to prove next."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from botohe_moo.kernels.bounds.states import Net
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.mission.model import Mission
from botohe_moo.search.bounds.front_bound import FrontBound
from botohe_moo.search.bounds.lines import LEVELS, Lines
from botohe_moo.search.bounds.memory import Remembered
from botohe_moo.search.bounds.net import arcs_by_ends, new_net
from botohe_moo.search.bounds.pool import Pool
from botohe_moo.search.bounds.prices import most_levels
from botohe_moo.search.bounds.record import Step
from botohe_moo.search.bounds.relaxation import Relaxation
from botohe_moo.search.bounds.stairs import MOST_MOVING, TeamStairs
from botohe_moo.search.bounds.steps import LEAST_SURVIVAL, Steps
from botohe_moo.search.bounds.targets import Known, LineTargets, StepTargets
from botohe_moo.search.bounds.turns import Turns
from botohe_moo.search.exact import TooLargeError, exact_front
from botohe_moo.search.local_search import LocalSearch

# These constants share out time and memory; every bound is valid whatever they are. Where no other
# source is given, they were chosen by experiment, for small gaps on the missions of 20 to 200 nodes
# in `python -m benchmarks bounds`.

# Shares of the time limit.
_EXACT_SHARE = 0.05  # for the true front
_SEARCH_SHARE = 0.05  # to find trails
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
# Relaxed trails get a memory where this many times the preparation without one still fits.
_PREPARING = 4
_LEAST_GAIN = 1e-3  # a line that is lowered by a larger share is worth another try
_SECONDS_OF_EFFORT = 0.3  # that a search for a step took, for each unit of effort
# Where the first lines of one robot are found, in shares of its best survival: three suffice for
# its steps.
_FIRST_LINES = (0.5, 0.75, 0.25)
_EVALUATIONS = 100_000  # plans that the search for trails evaluates at most
_FIRST_EVALUATIONS = 100  # before it looks at the clock
_LEAST_LEVELS, _MOST_LEVELS = 4, 12  # of prices
_MOST_PRICES = 400  # of the linear programme
_MOST_CONFIGURATIONS = 6_000  # of a team's levels, all of which are looked at for each node
_NEAREST = 8  # rewards near by that a node remembers
_FIRST_BITS = 10  # that a node remembers at first: rewards and bridges
_MOST_BITS = 14  # that a node remembers at most
_MOST_STATES = 40_000  # of relaxed trails
_N_SEEN = 1 << 18  # sets of arcs that a depth-first search recognises when it meets them again
_MOST_COMPARED = 3_000  # nodes of which all pairs are compared: a second, and 0.1 GiB
_BYTES_A_LINK = 40.0  # two integers of 8 bytes, a flag and a figure, and some while they are found
_MIB = 2**20
_ROUNDING = 1e-12  # the largest survival is raised by this share: products are rounded


# One piece of work, given the bound and the moment when it has to end; False if none is left.
Work: TypeAlias = Callable[[FrontBound, float], bool]


class Proof:
    """The search for a bound: what is known of a front, from below and from above."""

    def __init__(
        self,
        mission: Mission,
        limits: Limits,
        *,
        seed: int,
        seconds: float,
        memory: float,
        n_threads: int = 1,
        gap: float = 0.0,
        callback: Callable[[FrontBound], Any] | None = None,
    ) -> None:
        self._began = time.monotonic()
        self._gap, self._callback = gap, callback
        self._mission, self._limits, self._memory = mission, limits, memory
        self._seconds, self._deadline = seconds, self._began + seconds
        self._random_state = np.random.default_rng(seed)
        self._turns = Turns(n_threads)
        graph = mission.arrays
        # In units in which all reward is about 100: a power of 2, so that nothing is rounded.
        self._unit = 2.0 ** round(math.log2(mission.total_reward / 100 or 1.0))
        self._net = new_net(graph._replace(reward=graph.reward / self._unit), limits)
        self._most_survival = _most_survival(self._net)
        base_reward = float(graph.reward[graph.base])
        self._base_reward = base_reward / self._unit
        self.known = Known(base_reward, mission.robots)
        self._front: list[Step] = []
        self._notes: list[str] = []
        # Without a memory and with one level; they are made again where there is time.
        self._lines: list[Lines] = []
        self._steps: list[Steps] = []
        self._prepare(0, 0, 1, 1)
        self._prepared = time.monotonic() - self._began

    def _prepare(self, nearest: int, n_bits: int, n_levels: int, n_seen: int) -> None:
        """Make relaxed trails, and begin all lines and steps anew.

        Nodes remember ``n_bits``, first of all the ``nearest`` rewards; prices have ``n_levels``.
        """
        net, mission = self._net, self._mission
        n_bytes = self._memory * _MIB
        # For each thread five tables of what lies ahead, under two prices, with their copies for
        # searches; and the links.
        per_state = 16.0 * (2 * LEVELS + n_levels + 1)
        per_state += _BYTES_A_LINK * max(1.0, net.graph.n_arcs / net.graph.n_nodes)
        fits = int(n_bytes / per_state / self._turns.n_threads)
        self._relaxation = Relaxation(
            net,
            # Four tables of all pairs of nodes, in a quarter of the memory.
            Remembered(net, nearest, n_bits, min(_MOST_COMPARED, math.isqrt(int(n_bytes / 128)))),
            self._random_state,
            self._turns,
            most_bits=_MOST_BITS,
            most_states=max(net.graph.n_nodes + 1, min(_MOST_STATES, fits)),
            n_seen=n_seen,
        )
        self._pool = Pool(net, n_levels)
        self._lines = [
            Lines(self._relaxation, self._pool, moving, self._base_reward)
            for moving in range(1, mission.robots + 1)
        ]
        for lines in self._lines:
            lines.others = [other for other in self._lines if other is not lines]
        self._steps = [Steps(lines, self._most_survival) for lines in self._lines]
        self._stairs = TeamStairs(self._lines[:MOST_MOVING], self._most_survival)

    def _levels(self) -> int:
        """Return how many levels prices have; 0 where the memory has no room for one."""
        n_nodes, robots = max(1, len(self._pool.nodes)), self._mission.robots
        n_levels = min(max(_MOST_PRICES // n_nodes, _LEAST_LEVELS), _MOST_LEVELS)
        # Half of the memory for two tables of each number of robots.
        fits = int(self._memory * _MIB / 2 / (16 * n_nodes * robots))
        return most_levels(robots, n_levels, min(_MOST_CONFIGURATIONS, fits))

    def find_front(self) -> bool:
        """Take the true front as the bound; return whether a share of the time sufficed for it."""
        mission = self._mission
        try:
            front = exact_front(
                mission,
                min_survival=self._limits.min_survival,
                max_length=self._limits.max_length,
                time_limit=_EXACT_SHARE * self._seconds,
                memory_limit=self._memory,
            )
        except TooLargeError:
            return False
        objectives = mission.evaluate(front)  # by ascending E[S]
        # Twice what exact_front regards as equal.
        reward, robots = 2e-12 * mission.total_reward, 2e-12 * mission.robots
        most = [float(objectives[0, 0]) + reward, *(objectives[1:, 0] + reward).tolist()]
        least = [-math.inf, *(objectives[:-1, 1] + robots).tolist()]
        for moving in range(1, mission.robots + 1):
            stay = mission.robots - moving
            for height, start in zip(most, least, strict=True):
                self._front.append(Step(moving, height, max(start - stay, 0.0), "front"))
        return True

    def find_lines_and_steps(self) -> None:
        """Find lines and steps where the gap is the widest, until it is as small as wanted.

        One robot comes first: its steps take little time, and make its lines unnecessary. Then
        lines, stairs and steps share the time.
        """
        n_levels = self._levels()
        if n_levels == 0:
            self._notes.append(
                "Prices for this number of robots and nodes do not fit into the memory."
            )
            return
        if time.monotonic() + _PREPARING * self._prepared < self._deadline:
            self._prepare(_NEAREST, _FIRST_BITS, n_levels, _N_SEEN)
        else:
            self._notes.append("Relaxed trails remember nothing: there is too little time.")
        if self._relaxation.remembers_less:
            self._notes.append("Relaxed trails remember less than they would with more memory.")
        if self._limits.max_length < math.inf:
            self._notes.append("Relaxed trails keep the travel budget one arc at a time only.")
        if self._limits.min_survival > 0.0:
            self._notes.append("Relaxed trails keep the survival floor one arc at a time only.")
        self._find_trails()
        first = self._deadline_of(_FIRST_SHARE)
        self._spend(self._first_lines(), first)
        self._spend(self._steps_work(most_moving=1), first)
        self._share_out()

    def _share_out(self) -> None:
        """Do in each slice of the time what closed the gap the fastest when it was last done.

        The speed of work that waits grows, so that it is tried again.
        """
        works = [self._lines_work(), self._stairs_work(), self._steps_work(self._mission.robots)]
        hoped = math.log(2.0) / (_HALVED_IN * self._seconds)
        speeds, gap = [math.inf, hoped, hoped], self._gap_of(self.bound())
        while works and gap > self._gap and time.monotonic() < self._deadline:
            i, began, before = speeds.index(max(speeds)), time.monotonic(), gap
            is_left = self._spend(works[i], self._deadline_of(_SLICE))
            gap, took = self._gap_of(self.bound()), time.monotonic() - began
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

        self._turns.repeat(work_once)
        return is_left

    def _deadline_of(self, share: float) -> float:
        """Return the moment when a share of all time has gone by from now on."""
        return min(self._deadline, time.monotonic() + share * self._seconds)

    def _next_bound(self, until: float) -> FrontBound | None:
        """Return the bound to improve on; None if the time is over or the gap small enough."""
        if time.monotonic() > until:
            return None
        bound = self.bound()
        if self._callback is not None:
            self._callback(bound)
        return bound if self._gap_of(bound) > self._gap else None

    def _gap_of(self, bound: FrontBound) -> float:
        """Return the share by which a bound exceeds the known plans, on average."""
        return self.known.gap(bound.bound(self.known.survivors))

    def _first_lines(self) -> Work:
        """Find some lines of one robot."""
        shares = list(_FIRST_LINES)

        def find_next(_: FrontBound, until: float) -> bool:
            if shares:
                self._lines[0].tighten(shares.pop(0) * self._most_survival, 1, until)
            return len(shares) > 0

        return find_next

    def _lines_work(self) -> Work:
        """Find lines where the gap is the widest, until none can be lowered any more."""
        effort, targets = 1, LineTargets(self.known, _CELLS)

        def find_next(bound: FrontBound, until: float) -> bool:
            nonlocal effort, targets
            own = targets  # which another thread may replace meanwhile
            target = own.take(bound)
            if target is None:
                if effort == _EFFORT_OF_LINES:
                    return False
                effort, targets = _EFFORT_OF_LINES, LineTargets(self.known, _CELLS)
                return True
            moving, lines = target.moving, self._lines[target.moving - 1]
            x = target.survivors - (self._mission.robots - moving)
            x = max(x, moving * self._limits.min_survival)
            before = lines.bound(x)
            remembers_more = lines.tighten(x, effort, until)
            if remembers_more and lines.bound(x) <= before * (1 - _LEAST_GAIN):
                own.reopen(target)
            return True

        return find_next

    def _stairs_work(self) -> Work:
        """Find stairs where the gap is the widest, at more places as long as that helps."""
        n_cells, effort, targets = _CELLS, 1, LineTargets(self.known, _CELLS)
        before = math.inf

        def find_next(bound: FrontBound, until: float) -> bool:
            nonlocal n_cells, effort, targets, before
            if self._most_survival < LEAST_SURVIVAL:
                return False
            target = targets.take(bound)
            if target is None:
                gap = self._gap_of(bound)
                if n_cells == _MOST_CELLS or gap < _SMALL or gap > _STILL_HELPS * before:
                    return False
                before, n_cells, effort = gap, 2 * n_cells, _MORE_EFFORT * effort
                targets = LineTargets(self.known, n_cells)
            elif target.moving <= MOST_MOVING:
                x = max(0.0, target.begin - (self._mission.robots - target.moving))
                self._stairs.improve(target.moving, x, effort, until)
            return True

        return find_next

    def _steps_work(self, most_moving: int) -> Work:
        """Find steps for up to ``most_moving`` robots, until all are tried."""
        targets = StepTargets(self.known, self._mission.robots, self._most_survival)

        def find_next(bound: FrontBound, until: float) -> bool:
            left = self._deadline - time.monotonic()
            target = targets.take(bound, most_moving, left / _SECONDS_OF_EFFORT)
            if target is None:
                return False
            x = max(0.0, target.survivors - (self._mission.robots - target.moving))
            steps, goal = self._steps[target.moving - 1], target.goal / self._unit
            is_proved = steps.tighten(x, goal, target.effort, until)
            targets.give_back(target, is_proved=is_proved)
            return True

        return find_next

    def bound(self) -> FrontBound:
        """Return what has been proved, without lines that are nowhere the lowest."""
        for each in self._lines:
            each.prune()
        unit = self._unit
        lines = (
            line._replace(most=line.most * unit, mu=line.mu * unit)
            for each in self._lines
            for line in each.found
        )
        found = [*(step for each in self._steps for step in each.found), *self._stairs.found]
        steps = (step._replace(most=step.most * unit) for step in found)
        return FrontBound(
            mission=self._mission,
            lines=tuple(lines),
            steps=(*self._front, *steps),
            most_survival=self._most_survival,
            min_survival=self._limits.min_survival,
            max_length=self._limits.max_length,
            seconds=time.monotonic() - self._began,
            notes=tuple(self._notes),
        )

    def _find_trails(self) -> None:
        """Search for plans, and put their trails into the pool."""
        mission, graph = self._mission, self._net.graph
        search = LocalSearch(mission, self._limits, random_state=self._random_state)
        search.insert(mission.batch([mission.stay_home()]))
        until = time.monotonic() + _SEARCH_SHARE * self._seconds
        wanted = n = _FIRST_EVALUATIONS
        while n < _EVALUATIONS and search.run(wanted) == wanted and time.monotonic() < until:
            wanted, n = n, 2 * n
        batch, objectives, _ = search.plans()
        self.known.add(objectives)
        arcs = arcs_by_ends(graph)
        for trail in {tuple(trail) for plan in batch for trail in plan.trails}:
            way = [arcs.get(pair, -1) for pair in pairwise(trail)]
            if way and min(way) >= 0:
                self._pool.add(way)


def _most_survival(net: Net) -> float:
    """Return the largest probability to survive of a robot that moves."""
    graph = net.graph
    leaving = slice(graph.first[graph.base], graph.first[graph.base + 1])
    survival = graph.survival[leaving] * graph.home[graph.head[leaving]]
    return min(1.0, float(survival.max(initial=0.0)) * (1.0 + _ROUNDING))
