"""Bounding a front: which line to find next, until the time is over."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.checks import check_integer, check_number
from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.indicators import check_objectives
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.kernels.local_search.workspace import SearchRule
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.search.bounds.front_bound import FrontBound, Step
from botohe_moo.search.bounds.lines import Lines, LineSearch
from botohe_moo.search.bounds.memory import Remembered
from botohe_moo.search.bounds.net import new_net
from botohe_moo.search.bounds.pool import Pool
from botohe_moo.search.bounds.prices import most_levels
from botohe_moo.search.bounds.relaxation import Relaxation
from botohe_moo.search.exact import TooLargeError, exact_front
from botohe_moo.search.limits import check_limits
from botohe_moo.search.local_search import DEFAULT_MOVES, LocalSearch
from botohe_moo.trails import PlanBatch, TrailPlan

TIME_LIMIT = 60.0
MEMORY_LIMIT = 1024.0

# Shares of the time: for the true front, and to find trails.
_EXACT_SHARE, _SEARCH_SHARE = 0.2, 0.05
_EVALUATIONS, _FIRST_EVALUATIONS = 100_000, 100  # of the search for trails
_CELLS = 24  # of the range of E[S], for the widest gap
_SAMPLES = 3_000
_MOST_CONFIGURATIONS = 6_000  # of levels of a team, which are looked at for each node
# Levels of prices, and how many prices a linear programme has at most if there are enough levels.
_LEAST_LEVELS, _MOST_LEVELS, _MOST_PRICES = 4, 12, 400
# What each node remembers at first: rewards near by, and bridges; and at most.
_NEAREST, _FIRST_BITS, _MOST_BITS, _MOST_STATES = 8, 10, 14, 40_000
_MOST_COMPARED = 3_000  # nodes, of which all pairs are compared
_MIB = 2**20
_BYTES_A_LINK = 40.0
_ROUNDING = 1e-12


def bound_front(
    mission: Mission,
    *,
    front: ArrayLike | None = None,
    time_limit: float = TIME_LIMIT,
    memory_limit: float = MEMORY_LIMIT,
    gap: float = 0.0,
    min_survival: float = 0.0,
    max_length: float | None = None,
    seed: int = 1,
    callback: Callable[[FrontBound], Any] | None = None,
) -> FrontBound:
    """Bound the front of a mission from above: for each E[S], an E[R] that no plan exceeds.

    Small missions get their true front, which is its own bound. On others, prices are set on visits
    and on survival, and a relaxation bounds what any trail is worth under them; see
    ``docs/bounds.md``.

    Parameters
    ----------
    mission
        What is planned for.
    front
        E[R] and E[S] of known plans (n, 2): ``-result.F``. Work goes first to where the gap between
        them and the bound is the widest; without, plans that a short search finds are taken.
    time_limit
        Seconds until it ends, above 0; compiling for the first time and what is under way may take
        some more. More time only lowers the bound.
    memory_limit
        MiB that its tables may take, above 0: with less, relaxed trails remember less.
    gap
        It ends when the bound's area exceeds that of the known plans by no more than this share, at
        least 0.
    min_survival
        Survival floor of every robot, in [0, 1].
    max_length
        Travel budget of every robot, at least 0; None is the mission's own, if it has one, and inf
        none.
    seed
        Of the search for trails, at least 0. Given the time that it takes, the same seed gives the
        same bound; where time runs out earlier, the bound is another one, valid as well.
    callback
        Called with each bound on the way, which is valid, too.

    Returns
    -------
    FrontBound
        What has been proved. Ctrl-C ends the work early, and keeps that.

    Raises
    ------
    TypeError
        If ``mission`` is not a Mission.
    ValueError
        If a parameter is out of its range, or ``front`` is not of shape (n, 2).

    Notes
    -----
    Lagrangian bounds with convex prices on the probability to be alive at a node, column generation
    (Desaulniers, Desrosiers and Solomon, eds., "Column Generation", Springer, 2005) with smoothed
    prices, and ng-routes that learn what to remember (Roberti and Mingozzi, "Dynamic ng-path
    relaxation for the delivery man problem", Transportation Science 48(3), 2014).

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> toy = load_mission("toy", robots=1)
    >>> bound_front(toy).bound([0.3, 0.6, 0.9]).round(2).tolist()
    [7.09, 4.14, 0.0]
    """
    check_mission(mission)
    search = _Search(
        mission,
        check_limits(min_survival, mission.max_length if max_length is None else max_length),
        seed=check_integer("seed", seed, at_least=0),
        seconds=check_number("time_limit", time_limit, above=0),
        memory=check_number("memory_limit", memory_limit, above=0),
    )
    wanted = check_number("gap", gap, at_least=0)
    if front is not None:
        search.know(check_objectives("front", front))
    try:
        if not search.find_front():
            search.find_lines(wanted, callback)
    except KeyboardInterrupt:
        pass
    return search.bound()


class _Search:
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
        base_reward = float(graph.reward[graph.base])
        self._base_reward = base_reward / self._unit
        self._known = np.array([[base_reward, float(mission.robots)]])
        self._steps: list[Step] = []
        self._notes: list[str] = []
        # Without a memory, and with one level: where there is time, they are made anew.
        self._lines: list[Lines] = []
        self._prepare(0, 0, 1, 1)

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

    def _levels(self) -> int:
        """Choose how many levels prices have, by what programmes and the memory have room for."""
        n_nodes, robots = max(1, len(self._pool.nodes)), self._mission.robots
        n_levels = min(max(_MOST_PRICES // n_nodes, _LEAST_LEVELS), _MOST_LEVELS)
        # Half of the memory for two tables of each number of robots.
        fits = int(self._memory * _MIB / 2 / (16 * n_nodes * robots))
        return most_levels(robots, n_levels, min(_MOST_CONFIGURATIONS, fits))

    def know(self, objectives: FloatArray) -> None:
        """Take note of the E[R] and E[S] of plans."""
        self._known = np.vstack([self._known, objectives])

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
                self._steps.append(Step(moving, height, max(start - stay, 0.0), "front"))
        return True

    def find_lines(self, gap: float, callback: Callable[[FrontBound], Any] | None) -> None:
        """Find lines where the gap is the widest, until it is no more than ``gap``."""
        self._prepare(_NEAREST, _FIRST_BITS, self._levels(), 1 << 18)
        if self._relaxation.remembers_less:
            self._notes.append("Relaxed trails remember less than they would with more memory.")
        if self._limits.max_length < math.inf:
            self._notes.append("Relaxed trails keep the travel budget one arc at a time only.")
        if self._limits.min_survival > 0.0:
            self._notes.append("Relaxed trails keep the survival floor one arc at a time only.")
        self._find_trails()
        robots = self._mission.robots
        survivors = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * robots
        cells = (survivors / robots * _CELLS).astype(int)
        order = np.argsort(self._known[:, 1])
        best = np.maximum.accumulate(self._known[order[::-1], 0])[::-1]
        reached = best[np.searchsorted(self._known[order, 1] * (1 + _ROUNDING), survivors)]
        done: set[tuple[int, int]] = set()
        while time.monotonic() < self._deadline:
            bound = self.bound()
            if callback is not None:
                callback(bound)
            by_robots = bound.by_robots(survivors)
            above = np.maximum(0.0, by_robots.max(axis=0) - reached)
            if above.sum() <= gap * reached.sum():
                break
            widest = _widest(cells, above, by_robots.argmax(axis=0), done)
            if widest is None:
                break
            cell, moving, at = widest
            x = max(survivors[at] - (robots - moving), moving * self._limits.min_survival)
            if self._lines[moving - 1].tighten(x, self._deadline):
                self._forget()
            else:
                done.add((cell, moving))

    def bound(self) -> FrontBound:
        """Give what has been proved, without lines that are nowhere the lowest."""
        lines = []
        for each in self._lines:
            each.prune()
            lines += [
                line._replace(most=line.most * self._unit, mu=line.mu * self._unit)
                for line in each.found
            ]
        graph = self._net.graph
        leaving = slice(graph.first[graph.base], graph.first[graph.base + 1])
        survival = graph.survival[leaving] * graph.home[graph.head[leaving]]
        return FrontBound(
            mission=self._mission,
            lines=tuple(lines),
            steps=tuple(self._steps),
            most_survival=min(1.0, float(survival.max(initial=0.0)) * (1.0 + _ROUNDING)),
            min_survival=self._limits.min_survival,
            max_length=self._limits.max_length,
            seconds=time.monotonic() - self._began,
            notes=tuple(self._notes),
        )

    def _find_trails(self) -> None:
        """Search for plans, to begin with their trails."""
        mission, graph = self._mission, self._net.graph
        search = LocalSearch(
            mission,
            SearchRule(**self._limits._asdict()),
            moves=DEFAULT_MOVES,
            random_state=self._random_state,
        )
        at_base = TrailPlan([[graph.base]] * mission.robots)
        search.admit(PlanBatch.from_plans([at_base], mission.robots))
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

    def _forget(self) -> None:
        """Drop relaxed trails that remember now what they did twice."""
        for number, how in enumerate(self._pool.relaxed):
            if how is None or self._pool.dropped[number] or self._relaxation.allows(*how):
                continue
            self._pool.dropped[number] = True
            for lines in self._lines:
                lines.drop(number)


def _widest(
    cells: OffsetArray, above: FloatArray, moving: OffsetArray, done: set[tuple[int, int]]
) -> tuple[int, int, int] | None:
    """Give the cell with the widest gap, how many robots move there, and a sample of it."""
    for cell in np.argsort(-np.bincount(cells, above, _CELLS), kind="stable").tolist():
        inside = np.flatnonzero((cells == cell) & (above > 0.0))
        for robots in np.unique(moving[inside]).tolist():
            if robots > 0 and (cell, robots) not in done:
                at = inside[moving[inside] == robots]
                return cell, robots, int(at[len(at) // 2])
    return None
