"""What is proved of a front, and what is proved next, until the time is over."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import Net
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.mission.model import Mission
from botohe_moo.search.bounds.front_bound import FrontBound
from botohe_moo.search.bounds.lines import Lines, LineSearch
from botohe_moo.search.bounds.memory import Remembered
from botohe_moo.search.bounds.net import new_net
from botohe_moo.search.bounds.pool import Pool
from botohe_moo.search.bounds.prices import most_levels
from botohe_moo.search.bounds.record import Step
from botohe_moo.search.bounds.relaxation import Relaxation
from botohe_moo.search.bounds.steps import Steps, StepSearch
from botohe_moo.search.bounds.targets import Known, LineTargets, StepTargets
from botohe_moo.search.exact import TooLargeError, exact_front
from botohe_moo.search.local_search import LocalSearch
from botohe_moo.trails import PlanBatch

# No constant here decides whether a bound is valid: they share out time and memory. They were
# chosen for small gaps in `benchmarks/bounds.py`, on missions of 20 to 200 nodes.

# Shares of the time: for the true front, and to find trails.
_EXACT_SHARE, _SEARCH_SHARE = 0.2, 0.05
# Shares of what is left of it: for lines and steps of one robot (on 200 nodes they took all of it),
# for lines before steps, and for steps.
_FIRST_SHARE, _LINES_SHARE, _STEPS_SHARE = 0.1, 0.4, 0.5
# Relaxed trails get a memory where there is this many times the time that it takes without one.
_PREPARING = 4
_LEAST_GAIN = 1e-3  # relative; a line that is lowered by more is worth another try
_EFFORT_OF_LINES = 16  # times the usual search, once all steps that are easy are known
_SECONDS_OF_EFFORT = 0.3  # that a search for a step takes, for each unit of effort
# Where the first lines of one robot are found, in shares of its best survival.
_FIRST_LINES = (0.5, 0.75, 0.25)
# Plans that are evaluated in the search for trails: at most, and before it looks at the clock.
_EVALUATIONS, _FIRST_EVALUATIONS = 100_000, 100
# Levels of prices, at least and at most. In between a linear programme has no more prices than
# _MOST_PRICES, and a team no more configurations of levels, which are looked at for each node.
_LEAST_LEVELS, _MOST_LEVELS, _MOST_PRICES, _MOST_CONFIGURATIONS = 4, 12, 400, 6_000
# Bits that each node remembers: near rewards, these and bridges at first, all at most, and for
# steps; and states of relaxed trails at most, usually and for steps.
_NEAREST, _FIRST_BITS, _MOST_BITS, _STEP_BITS = 8, 10, 14, 12
_MOST_STATES, _MOST_STEP_STATES = 40_000, 120_000
_MOST_COMPARED = 3_000  # nodes, of which all pairs are compared: a second, and a tenth of a GiB
_BYTES_A_LINK = 40.0  # three integers of 8 bytes and a flag, and two figures of a level
_MIB = 2**20
_ROUNDING = 1e-12

Callback = Callable[[FrontBound], Any] | None


class Proof:
    """What is known of a front, from below and from above."""

    def __init__(
        self, mission: Mission, limits: Limits, *, seed: int, seconds: float, memory: float
    ) -> None:
        self._began = time.monotonic()
        self._mission, self._limits, self._memory = mission, limits, memory
        self._seconds, self._deadline = seconds, self._began + seconds
        self._random_state = np.random.default_rng(seed)
        graph = mission.arrays
        # In units in which all reward is about 100: a power of 2, so that nothing is rounded.
        self._unit = 2.0 ** round(math.log2(mission.total_reward / 100 or 1.0))
        self._net = new_net(graph._replace(reward=graph.reward / self._unit), limits)
        self._most_survival = _most_survival(self._net)
        base_reward = float(graph.reward[graph.base])
        self._base_reward = base_reward / self._unit
        self._known = Known(base_reward, mission.robots)
        self._front: list[Step] = []
        self._notes: list[str] = []
        # Without a memory, and with one level: where there is time, they are made anew.
        self._lines: list[Lines] = []
        self._steps: list[Steps] = []
        self._prepare(0, 0, 1, 1)
        self._prepared = time.monotonic() - self._began

    def _prepare(self, nearest: int, n_bits: int, n_levels: int, n_searched: int) -> None:
        net, mission = self._net, self._mission
        rule, n_bytes = LineSearch(), self._memory * _MIB
        # Two tables of what lies ahead, at the most levels that are looked at, and the links.
        per_state = 16.0 * (2 * rule.n_levels + n_levels + 1)
        per_state += _BYTES_A_LINK * max(1.0, net.graph.n_arcs / net.graph.n_nodes)
        fits = int(n_bytes / per_state)
        self._relaxation = Relaxation(
            net,
            # Four tables of all pairs of nodes, in a quarter of the memory.
            Remembered(net, nearest, n_bits, min(_MOST_COMPARED, math.isqrt(int(n_bytes / 128)))),
            self._random_state,
            most_bits=_MOST_BITS,
            most_states=max(net.graph.n_nodes + 1, min(_MOST_STATES, fits)),
            n_searched=n_searched,
        )
        nodes: OffsetArray = np.flatnonzero(net.graph.reward > 0.0)
        self._pool = Pool(net, nodes, n_levels)
        made = self._relaxation, self._pool
        self._lines = [
            Lines(*made, moving, self._base_reward, rule) for moving in range(1, mission.robots + 1)
        ]
        for lines in self._lines:
            lines.others = [other for other in self._lines if other is not lines]
        self._steps = [
            Steps(*made, lines, StepSearch(), self._most_survival) for lines in self._lines
        ]

    def _levels(self) -> int:
        """Choose how many levels prices have, by what programmes and the memory have room for.

        0 where not even one fits.
        """
        n_nodes, robots = max(1, len(self._pool.nodes)), self._mission.robots
        n_levels = min(max(_MOST_PRICES // n_nodes, _LEAST_LEVELS), _MOST_LEVELS)
        # Half of the memory for two tables of each number of robots.
        fits = int(self._memory * _MIB / 2 / (16 * n_nodes * robots))
        return most_levels(robots, n_levels, min(_MOST_CONFIGURATIONS, fits))

    def know(self, objectives: FloatArray) -> None:
        """Take note of the E[R] and E[S] of plans."""
        self._known.add(objectives)

    def find_front(self) -> bool:
        """Take the true front for the bound, if it is found in a share of the time."""
        mission, limits = self._mission, self._limits
        try:
            front = exact_front(
                mission,
                min_survival=limits.min_survival,
                max_length=None if limits.max_length == math.inf else limits.max_length,
                time_limit=_EXACT_SHARE * self._seconds,
                memory_limit=self._memory,
            )
        except TooLargeError:
            return False
        objectives = mission.evaluate(front)  # by ascending E[S]
        # What exact_front takes for equal.
        reward, robots = 2e-12 * mission.total_reward, 2e-12 * mission.robots
        most = [float(objectives[0, 0]) + reward, *(objectives[1:, 0] + reward).tolist()]
        least = [-math.inf, *(objectives[:-1, 1] + robots).tolist()]
        for moving in range(1, mission.robots + 1):
            stay = mission.robots - moving
            for height, start in zip(most, least, strict=True):
                self._front.append(Step(moving, height, max(start - stay, 0.0), "front"))
        return True

    def find(self, gap: float, callback: Callback) -> None:
        """Find lines and steps where the gap is the widest, until it is no more than ``gap``.

        Steps of one robot take little, and spare its lines; other steps take most where lines are
        as low as they get.
        """
        n_levels = self._levels()
        if n_levels == 0:
            self._notes.append(
                "Prices for this number of robots and nodes do not fit into the memory."
            )
            return
        if time.monotonic() + _PREPARING * self._prepared < self._deadline:
            self._prepare(_NEAREST, _FIRST_BITS, n_levels, 1 << 18)
        else:
            self._notes.append("Relaxed trails remember nothing: there is too little time.")
        if self._relaxation.remembers_less:
            self._notes.append("Relaxed trails remember less than they would with more memory.")
        if self._limits.max_length < math.inf:
            self._notes.append("Relaxed trails keep the travel budget one arc at a time only.")
        if self._limits.min_survival > 0.0:
            self._notes.append("Relaxed trails keep the survival floor one arc at a time only.")
        self._find_trails()
        steps = StepTargets(self._known, self._mission.robots, self._most_survival)
        if self._wanted(gap, callback) is not None:
            until = self._until(_FIRST_SHARE)
            for share in _FIRST_LINES:
                self._lines[0].tighten(share * self._most_survival, 1, until)
            self._find_steps(steps, 1, until, gap, callback)
        self._find_lines(1, self._until(_LINES_SHARE), gap, callback)
        self._find_steps(steps, self._mission.robots, self._until(_STEPS_SHARE), gap, callback)
        self._find_lines(_EFFORT_OF_LINES, self._deadline, gap, callback)
        self._find_steps(steps, self._mission.robots, self._deadline, gap, callback)

    def _until(self, share: float) -> float:
        """Return the moment at which a share of the time that is left is over."""
        moment = time.monotonic()
        return moment + share * (self._deadline - moment)

    def _wanted(self, gap: float, callback: Callback) -> FrontBound | None:
        """Return the bound if there is time, and if its gap is larger than wanted."""
        if time.monotonic() > self._deadline:
            return None
        bound = self.bound()
        if callback is not None:
            callback(bound)
        bounds = bound.by_robots(self._known.survivors).max(axis=0)
        return bound if self._known.gap(bounds) > gap else None

    def _find_lines(self, effort: int, until: float, gap: float, callback: Callback) -> None:
        """Find lines until the time is over, or none can be lowered any more."""
        targets = LineTargets(self._known)
        while time.monotonic() < until and (bound := self._wanted(gap, callback)) is not None:
            target = targets.next(bound)
            if target is None:
                return
            moving, survivors, place = target
            x = survivors - (self._mission.robots - moving)
            x, own = max(x, moving * self._limits.min_survival), self._lines[moving - 1]
            before = own.bound(x)
            has_grown = own.tighten(x, effort, until)
            if not has_grown or own.bound(x) > before * (1 - _LEAST_GAIN):
                targets.close(place)

    def _find_steps(
        self, targets: StepTargets, most_moving: int, until: float, gap: float, callback: Callback
    ) -> None:
        """Find steps for up to ``most_moving`` robots, until the time is over or all are tried."""
        if most_moving > 1 and time.monotonic() < until:
            fits = int(self._memory * _MIB / 2 / StepSearch().bytes_a_state)
            self._relaxation.widen(_STEP_BITS, min(_MOST_STEP_STATES, fits))
            self._lines[0].drop_forgotten()
        while time.monotonic() < until and (bound := self._wanted(gap, callback)) is not None:
            left = until - time.monotonic()
            target = targets.next(bound, most_moving, left / _SECONDS_OF_EFFORT)
            if target is None:
                return
            x = max(0.0, target.survivors - (self._mission.robots - target.moving))
            steps = self._steps[target.moving - 1]
            goal = target.goal / self._unit
            is_proved = steps.tighten(x, goal, target.effort, until)
            targets.tell(target, is_proved=is_proved)

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
        steps = (
            step._replace(most=step.most * unit) for each in self._steps for step in each.found
        )
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
        """Search for plans, to begin with their trails."""
        mission, graph = self._mission, self._net.graph
        search = LocalSearch(mission, self._limits, random_state=self._random_state)
        at_base = mission.stay_home()
        search.insert(PlanBatch.from_plans([at_base], mission.robots))
        until = time.monotonic() + _SEARCH_SHARE * self._seconds
        wanted = n = _FIRST_EVALUATIONS
        while n < _EVALUATIONS and search.run(wanted) == wanted and time.monotonic() < until:
            wanted, n = n, 2 * n
        batch, objectives, _ = search.plans()
        self.know(objectives)
        ends = zip(graph.tail.tolist(), graph.head.tolist(), strict=True)
        arcs = {pair: arc for arc, pair in enumerate(ends)}
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
