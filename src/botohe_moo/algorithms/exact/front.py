"""The true Pareto front of small missions."""

from __future__ import annotations

import math
import time
from functools import cache, reduce
from typing import Annotated, TypeAlias

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo._base.checks import quoted
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Positive, Probability, TravelBudget
from botohe_moo.algorithms.exact.kernels import tables, teams
from botohe_moo.algorithms.exact.trails import TrailSearch
from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.core.evaluate import either
from botohe_moo.core.graph import NO_LIMITS, Limits
from botohe_moo.core.ordered import best_reward, copy_front, insert, new_front, read_front
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import PlanBatch, TrailPlan

TIME_LIMIT = 60.0
MEMORY_LIMIT = 2048.0
MemoryLimit: TypeAlias = Annotated[float, Field(gt=0, le=1e9)]  # MiB

_MIB = 2**20
_FRONT_ROWS = 1024  # rows of the front at first
# Portions of work, after which limits are checked: labels extended, nodes and arcs visited for
# them, and choices of trails tried.
_LABELS_A_PORTION, _LOOKS_A_PORTION, _CHOICES_A_PORTION = 1_000, 3_000_000, 500_000
# With more labels than this, the size of the search is estimated before it goes on.
_ESTIMATED_FROM = 10_000
# The search is refused where the estimate exceeds the limits by this factor: it compares few
# labels, and has been up to 4 500 times too large.
_MOST_EXCESS = 10_000
_LABELS_A_SECOND = 50_000  # searches have made 20 000 to 100 000
# Of the plans that the search begins with: weights, plans for each of them, and beams.
_N_GUIDES, _MOST_GUIDES, _GUIDE_WIDTH, _GUIDE_LABELS = 11, 20, 20, 5_000
# In shares of all reward and of all robots: a plan has to be better by more than the first to
# count, and points of the front that differ by less than the second are one.
_SLACK, _SAME = 1e-13, 1e-12
_REMEDY = "Raise the limits, take fewer robots, or another algorithm such as BOACO."


class TooLargeError(ValueError):
    """A mission is too large for its exact front to be found within the limits.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.algorithms import TooLargeError, exact_front
    >>> exact_front(load_mission("art_museum"), memory_limit=1)
    Traceback (most recent call last):
    botohe_moo.algorithms.exact.front.TooLargeError: Mission 'art_museum' (27 nodes, 74 arcs...
    """


@checked
def exact_front(
    mission: Mission,
    *,
    min_survival: Probability = 0.0,
    max_length: TravelBudget | None = None,
    time_limit: Positive = TIME_LIMIT,
    memory_limit: MemoryLimit = MEMORY_LIMIT,
) -> PlanBatch:
    """Find the true Pareto front of a small mission.

    Parameters
    ----------
    mission
        What to plan for.
    min_survival
        Survival floor of every robot, in [0, 1]; 0 sets none.
    max_length
        Travel budget: the largest length of a robot's trail, at least 0; None sets none.
    time_limit
        Seconds that the search may take, above 0; compiling it for the first time does not count.
    memory_limit
        MiB that its tables may take, in (0, 10⁹].

    Returns
    -------
    PlanBatch
        One plan for each point of the front, by descending E[R].

    Raises
    ------
    TooLargeError
        If the search reaches a limit, or an estimate says that it would by far.
    TypeError
        If ``mission`` is not a Mission.
    ValueError
        If a parameter is out of its range.

    Notes
    -----
    The search finds all trails that a best team may need, then all teams of them; the kernels
    ``labels``, ``trails`` and ``teams`` explain why nothing is missed. Label-setting with dominance
    for resource-constrained paths: Irnich and Desaulniers, "Shortest path problems with resource
    constraints", in: Column Generation, Springer, 2005.

    The front is true within rounding. For every plan of the mission, the front has one that falls
    short of it by at most 10⁻¹² of all reward (without that of the base) and of all robots. Points
    of the front differ by more than that in both.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.algorithms import exact_front
    >>> toy = load_mission("toy", robots=1)
    >>> toy.evaluate(exact_front(toy)).round(2).tolist()
    [[7.09, 0.35], [4.14, 0.66], [0.9, 0.81], [0.0, 1.0]]
    """
    longest = math.inf if max_length is None else max_length
    if not check_mission(mission).is_plain:
        found = f"mission {quoted(mission.name)}, which has {mission.specialities}"
        raise ValueError(f"exact_front does not support {found}.")
    limits = mission.limits(min_survival, longest)
    search = FrontSearch(mission, limits, time_limit=time_limit, memory_limit=memory_limit)
    while search.plans is None:
        search.advance()
    return search.plans


@cache
def _compile_kernels() -> None:
    """Search a mission of three nodes: the time limit is not for compiling, which takes long."""
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(range(3), reward=1.0)
    graph.add_edges_from([(0, 1), (1, 0), (0, 2), (2, 0)], survival=0.9)
    mission = Mission(graph, base=0, robots=2)
    search = FrontSearch(mission, time_limit=1e9, memory_limit=1e9)
    while search.plans is None:
        search._advance()


class FrontSearch:
    """The search for the true front, a portion at a time; ``plans`` is the front at the end."""

    def __init__(
        self,
        mission: Mission,
        limits: Limits = NO_LIMITS,
        *,
        time_limit: float = TIME_LIMIT,
        memory_limit: float = MEMORY_LIMIT,
    ) -> None:
        self.mission = mission
        self.limits = limits
        self.time_limit = time_limit
        self.memory_limit = memory_limit
        self.plans: PlanBatch | None = None
        self._trails: TrailSearch | None = None
        self._choices: teams.Choices | None = None
        self._spent = 0.0
        self._estimated = False

    def advance(self) -> None:
        """Do a portion of the work; raise a TooLargeError as :func:`exact_front` does."""
        _compile_kernels()
        self._advance()

    def _advance(self) -> None:
        begun = time.perf_counter()
        if self._trails is None:
            self._guides = self._guiding_plans()
            known = sorted({trail for plan in self._guides for trail in plan.trails})
            self._trails = TrailSearch(self.mission, self.limits, known)
        if self._choices is None:
            self._advance_trails(self._trails)
        else:
            self._advance_teams(self._trails, self._choices)
        self._spent += time.perf_counter() - begun
        if self.plans is None and self._spent > self.time_limit:
            raise self._limit_error(f"time_limit = {self.time_limit:g} seconds")

    def _guiding_plans(self) -> list[TrailPlan]:
        """Return good plans, within the limits; the search leaves out what they dominate."""
        planner = SequentialPlanner(
            self.mission, self.limits, beam_width=_GUIDE_WIDTH, max_labels=_GUIDE_LABELS
        )
        # On large missions they take long.
        until = time.perf_counter() + self.time_limit / _N_GUIDES
        found: list[TrailPlan] = []
        for weight in (1.0, *np.linspace(0.0, 1.0, _N_GUIDES)[:-1].tolist()):
            if time.perf_counter() < until:
                found += planner.plans(weight, n_most=_MOST_GUIDES, until=until)
        plans = list(dict.fromkeys(found))
        safe = self.mission.robot_survival(plans).min(axis=1) >= self.limits.min_survival
        short = self.mission.trail_lengths(plans).max(axis=1) <= self.limits.max_length
        return [plan for plan, keeps in zip(plans, safe & short, strict=True) if keeps]

    def _advance_trails(self, trails: TrailSearch) -> None:
        self._require(0)
        if not self._estimated and trails.progress.n_labels > _ESTIMATED_FROM:
            self._estimated = True
            self._refuse_by_estimate(trails)
        n_looks = _LOOKS_A_PORTION // (trails.graph.n_nodes + trails.graph.n_arcs)
        if trails.advance(min(max(1, n_looks), _LABELS_A_PORTION), self._require):
            self._begin_teams(trails)

    def _refuse_by_estimate(self, trails: TrailSearch) -> None:
        """Raise a TooLargeError where the search would exceed its limits by far."""
        n_bytes = self.memory_limit * _MIB
        room = min(n_bytes / (1.5 * trails.n_label_bytes), self.time_limit * _LABELS_A_SECOND)
        if (estimate := trails.estimate(int(n_bytes / 4))) > _MOST_EXCESS * room:
            raise TooLargeError(
                f"{self._mission_text()} is too large: the exact front would take up to about "
                f"{estimate:.0e} partial trails, and time_limit = {self.time_limit:g} seconds and "
                f"memory_limit = {self.memory_limit:g} MiB allow about {room:.0e}. {_REMEDY}"
            )

    def _begin_teams(self, trails: TrailSearch) -> None:
        n_robots, goal_reward = self.mission.robots, trails.rule.reward
        self._require(trails.progress.n_trails * n_robots * 32)
        self._choices = teams.new_choices(
            *trails.found(),
            np.array([goal_reward.sum()]) if trails.rule.single else goal_reward,
            _SLACK * np.array([goal_reward.sum(), n_robots]),
            n_robots,
        )
        self._front = new_front(max(_FRONT_ROWS, len(self._guides)), n_robots)
        for i, (reward, survivors) in enumerate(self._figures(trails)):
            if best_reward(self._front, survivors) < reward:
                self._front.plan[insert(self._front, reward, survivors)] = -1 - i

    def _figures(self, trails: TrailSearch) -> list[tuple[float, float]]:
        """Return E[R], without that of the base, and E[S] of each guiding plan."""
        followed = [[trails.follow(trail) for trail in plan.trails] for plan in self._guides]
        reached = [reduce(either, [chances for _, chances in team]) for team in followed]
        rewards = [float(trails.rule.reward @ chances) for chances in reached]
        return [(r, sum(s for s, _ in t)) for r, t in zip(rewards, followed, strict=True)]

    def _advance_teams(self, trails: TrailSearch, choices: teams.Choices) -> None:
        state = teams.choose_teams(choices, self._front, _CHOICES_A_PORTION, most_reward=False)
        if state == teams.FULL:
            self._require(2 * tables.n_bytes(self._front))
            slots, _ = read_front(self._front)
            self._front = copy_front(self._front, slots, 2 * len(slots))
        elif state == teams.FINISHED:
            self.plans = self._plans(trails)

    def _plans(self, trails: TrailSearch) -> PlanBatch:
        """Return the plans of the front; of points that differ by rounding only, one."""
        slots, _ = read_front(self._front)
        rows = self._front.plan[slots].tolist()
        found = [
            self._guides[-1 - row[0]] if row[0] < 0 else TrailPlan([trails.trail(t) for t in row])
            for row in rows
        ]
        objectives = self.mission.evaluate(found)
        # E[R] is rounded in shares of a sum that has the base's reward in it.
        same_reward = _SAME * trails.rule.reward.sum() + 1e-15 * self.mission.total_reward
        same_survivors = _SAME * self.mission.robots
        kept: list[int] = []
        for i in np.lexsort((-objectives[:, 1], -objectives[:, 0])).tolist():
            reward, survivors = objectives[i]
            if kept and survivors <= objectives[kept[-1], 1] + same_survivors:
                continue
            while kept and objectives[kept[-1], 0] <= reward + same_reward:
                kept.pop()
            kept.append(i)
        return self.mission.batch([found[i] for i in kept])

    def _require(self, n_bytes: int) -> None:
        """Raise a TooLargeError where there is no room for ``n_bytes`` more."""
        taken = 0 if self._trails is None else self._trails.n_bytes
        if self._choices is not None:
            taken += tables.n_bytes(self._choices) + tables.n_bytes(self._front)
        if taken + n_bytes > self.memory_limit * _MIB:
            raise self._limit_error(f"memory_limit = {self.memory_limit:g} MiB")

    def _limit_error(self, limit: str) -> TooLargeError:
        n_done, n, what = 0, 0, "partial trails found so far"
        if self._choices is not None:
            n_done, n = int(self._choices.at[0]), int(self._choices.n_listed[0])
            what = "trails for the first robot of a team"
        elif self._trails is not None:
            n_done, n = self._trails.progress.next, self._trails.progress.n_labels
        return TooLargeError(
            f"{self._mission_text()}: the exact front was not found within {limit}. The search had "
            f"tried {n_done} of {n} {what}. {_REMEDY}"
        )

    def _mission_text(self) -> str:
        mission, graph = self.mission, self.mission.arrays
        robots = "1 robot" if mission.robots == 1 else f"{mission.robots} robots"
        return f"Mission {mission.name!r} ({graph.n_nodes} nodes, {graph.n_arcs} arcs, {robots})"
