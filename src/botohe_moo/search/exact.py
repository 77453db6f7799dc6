"""The true Pareto front of small missions."""

from __future__ import annotations

import time
from functools import cache, reduce
from itertools import pairwise
from typing import TypeVar

import networkx as nx
import numpy as np

from botohe_moo._base.checks import check_number
from botohe_moo._base.types import FloatArray
from botohe_moo.kernels.exact import tables, teams
from botohe_moo.kernels.exact import trails as kernels
from botohe_moo.kernels.exact.labels import chain_again
from botohe_moo.kernels.plans.evaluate import either
from botohe_moo.kernels.rng import seed_states
from botohe_moo.mission.model import Mission
from botohe_moo.search.sequential import SequentialPlanner
from botohe_moo.trails import PlanBatch, TrailPlan

__all__ = ["MEMORY_LIMIT", "TIME_LIMIT", "FrontSearch", "TooLargeError", "exact_front"]

TIME_LIMIT = 60.0
MEMORY_LIMIT = 2048.0

_MIB = 2**20
_ROWS = 1024  # that tables have room for at first
# How much is done before limits are looked at: labels gone on from, and choices looked at.
_LABELS_A_PORTION, _CHOICES_A_PORTION = 1_000, 500_000
# A search that comes to more labels than this is estimated before it goes on, by descents that
# meet no more labels than that.
_UNESTIMATED, _MAX_DIVES, _MAX_MET = 10_000, 1_000, 30_000
# On missions that could be solved the estimate has been up to 4 500 times what was needed, since
# it compares few labels: what it has to exceed the limits by. Searches make 20 000 to 100 000
# labels a second.
_DOUBT, _LABELS_A_SECOND = 10_000, 50_000
# Weights, and width of the beam, for plans that the search begins with.
_N_GUIDES, _GUIDE_WIDTH = 11, 20
# In shares of all reward and of all robots: by how much less than this a plan is better does not
# count in the search, and points of the front that differ by no more are one.
_SLACK, _SAME = 1e-13, 1e-12

AnyTable = TypeVar("AnyTable", tables.Labels, tables.Trails, teams.Front)


class TooLargeError(ValueError):
    """A mission is too large for its exact front to be found within the limits."""


def exact_front(
    mission: Mission,
    *,
    min_survival: float = 0.0,
    time_limit: float = TIME_LIMIT,
    memory_limit: float = MEMORY_LIMIT,
) -> PlanBatch:
    """Find the true Pareto front of a small mission.

    Parameters
    ----------
    mission
        What to plan for.
    min_survival
        Survival floor: every robot survives with at least this probability, in [0, 1]; 0 sets
        none.
    time_limit
        Seconds that the search may take, above 0; compiling it for the first time does not count.
    memory_limit
        MiB that its tables may take, above 0.

    Returns
    -------
    PlanBatch
        One plan for each point of the front, by descending E[R].

    Raises
    ------
    TooLargeError
        If the search reaches a limit, or an estimate says that it would by far.
    TypeError
        If ``mission`` is no Mission.
    ValueError
        If a parameter is out of its range.

    Notes
    -----
    First all trails that some best team may need, then all teams of them; see the kernels
    ``exact_labels``, ``exact_trails`` and ``exact_teams`` for why nothing is missed. Label-setting
    with dominance for resource-constrained paths: Irnich and Desaulniers, "Shortest path problems
    with resource constraints", in: Column Generation, Springer, 2005.

    Equal products of survivals differ in their last bits when multiplied in another order, so that
    a front is true within rounding only: every plan of the mission is covered by one of the front
    that falls short of it by no more than 10⁻¹² of all reward and 10⁻¹² of all robots, and points
    of the front differ by more than that in both. All reward is that of the nodes other than the
    base. Of plans with equal objectives one is given.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> toy = load_mission("toy", robots=1)
    >>> toy.evaluate(exact_front(toy)).round(2).tolist()
    [[7.09, 0.35], [4.14, 0.66], [0.9, 0.81], [0.0, 1.0]]
    """
    search = FrontSearch(
        mission, min_survival=min_survival, time_limit=time_limit, memory_limit=memory_limit
    )
    while search.plans is None:
        search.advance()
    return search.plans


_NO_LIMIT = 1e9


@cache
def _compile_kernels() -> None:
    """Search a mission of three nodes: compiling takes long, and no limit is meant for it."""
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_node(0, reward=0.0)
    for node in (1, 2):
        graph.add_node(node, reward=1.0)
        graph.add_edge(0, node, survival=0.9)
        graph.add_edge(node, 0, survival=0.9)
    mission = Mission(graph, base=0, robots=2)
    search = FrontSearch(mission, time_limit=_NO_LIMIT, memory_limit=_NO_LIMIT)
    search._begin()
    search._estimate()
    while search.plans is None:
        search._advance()


class FrontSearch:
    """The search for the true Pareto front, a portion at a time; see :func:`exact_front`.

    Parameters
    ----------
    mission, min_survival, time_limit, memory_limit
        As for :func:`exact_front`.

    Raises
    ------
    TypeError
        If ``mission`` is no Mission.
    ValueError
        If a parameter is out of its range.

    Attributes
    ----------
    plans : PlanBatch or None
        The front by descending E[R]; None as long as the search has not ended.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        min_survival: float = 0.0,
        time_limit: float = TIME_LIMIT,
        memory_limit: float = MEMORY_LIMIT,
    ) -> None:
        if not isinstance(mission, Mission):
            raise TypeError(
                f"Expected a Mission, got {mission!r}; load_mission(name_or_path) gives one."
            )
        self.mission = mission
        self.min_survival = check_number("min_survival", min_survival, at_least=0, at_most=1)
        self.time_limit = check_number("time_limit", time_limit, above=0)
        self.memory_limit = check_number("memory_limit", memory_limit, above=0)
        self.plans: PlanBatch | None = None
        self._site = _site_of(mission, self.min_survival)
        self._spent = 0.0
        self._estimated = False
        self._choices: teams.Choices | None = None
        self._counts = np.zeros(tables.N_COUNTS, np.int64)

    @property
    def n_labels(self) -> int:
        """How many partial trails have been kept so far."""
        return int(self._counts[tables.LABELS])

    @property
    def n_trails(self) -> int:
        """How many trails are known so far that teams may need; once all are, what is left."""
        return int(self._counts[tables.TRAILS])

    def advance(self) -> None:
        """Do a portion of the work.

        Raises
        ------
        TooLargeError
            If the search reaches a limit, or an estimate says that it would by far.
        """
        _compile_kernels()
        self._advance()

    def _advance(self) -> None:
        begun = time.perf_counter()
        if self.n_trails == 0:
            self._begin()
        if self._choices is None:
            self._advance_trails()
        else:
            self._advance_teams(self._choices)
        self._spent += time.perf_counter() - begun
        if self.plans is None and self._spent > self.time_limit:
            raise TooLargeError(
                f"{self._name()}: the exact front was not found within time_limit = "
                f"{self.time_limit:g} seconds. {self._progress()} {_REMEDY}"
            )

    def _begin(self) -> None:
        self._guides = self._guiding_plans()
        base, site = self.mission.arrays.base, self._site
        known = sorted({trail for plan in self._guides for trail in plan.trails} - {(base,)})
        self._known = [(base,), *known]
        n_goals, n_words = len(site.reward), len(site.head) // 64 + 1
        n_columns = 1 if site.single else n_goals
        self._here = tables.new_here(len(site.goal), n_goals, n_words, n_columns)
        self._labels = tables.new_labels(_ROWS, n_goals, n_words)
        self._trails = tables.new_trails(_ROWS, n_columns)
        for i, trail in enumerate(self._known[:_ROWS]):
            survives, reached = _follow(site, trail)
            kernels.as_column(site, self._here, reached)
            column = self._here.column.copy()
            kernels.add_trail(self._trails, self._counts, -1 - i, -1, column, survives)
        self._n_tidy = self.n_trails
        kernels.begin(site, self._labels, self._counts, self._here)
        self._require(0)

    def _guiding_plans(self) -> list[TrailPlan]:
        """Good plans that the search begins with: what they are as good as need not be found."""
        planner = SequentialPlanner(
            self.mission, beam_width=_GUIDE_WIDTH, min_survival=self.min_survival
        )
        begun, found = time.perf_counter(), [*planner.plans(1.0)]
        for weight in np.linspace(0.0, 1.0, _N_GUIDES)[:-1]:
            if time.perf_counter() - begun > self.time_limit / _N_GUIDES:
                break  # they save work, and on large missions take long
            found += planner.plans(weight)
        plans = list(dict.fromkeys(found))
        least = self.mission.robot_survival(plans).min(axis=1)
        return [plan for plan, alive in zip(plans, least, strict=True) if alive >= self._site.least]

    def _advance_trails(self) -> None:
        if not self._estimated and self.n_labels > _UNESTIMATED:
            self._estimated = True
            self._refuse_by_estimate()
        full = kernels.grow(
            self._site, self._labels, self._trails, self._counts, self._here, _LABELS_A_PORTION
        )
        if self.n_trails > 1.5 * self._n_tidy + 64:
            kernels.tidy(self._trails, self._counts)
            self._n_tidy = self.n_trails
        if full:
            self._labels = self._doubled(self._labels)
            chain_again(self._labels, self.n_labels)
            self._trails = self._doubled(self._trails)
        elif self._counts[tables.NEXT] == self.n_labels:
            self._begin_teams()

    def _refuse_by_estimate(self) -> None:
        row = tables.n_bytes(self._labels) / len(self._labels.node)
        room = min(self.memory_limit * _MIB / (1.5 * row), self.time_limit * _LABELS_A_SECOND)
        if (estimate := self._estimate()) > _DOUBT * room:
            raise TooLargeError(
                f"{self._name()} is too large: the exact front would take up to about "
                f"{estimate:.0e} partial trails, and time_limit = {self.time_limit:g} seconds and "
                f"memory_limit = {self.memory_limit:g} MiB allow about {room:.0e}. {_REMEDY}"
            )

    def _estimate(self) -> float:
        """Estimate from above how many labels there will be, always in the same way."""
        site, counts = self._site, self._counts.copy()
        row = tables.n_bytes(self._labels) // len(self._labels.node)
        room = int(self.memory_limit * _MIB / 4) // row
        n_rows = min(1 + len(site.head) * int(np.diff(site.first).max()), _MAX_MET, room)
        n_rows = 1 << max(4, n_rows.bit_length())
        n_goals, n_words = self._labels.reached.shape[1], self._labels.used.shape[1]
        labels = tables.new_labels(n_rows, n_goals, n_words)
        counts[tables.LABELS] = 0
        self._here.used[:], self._here.reached[:] = 0, 0.0
        kernels.begin(site, labels, counts, self._here)
        trails = tables.doubled(self._trails)
        states = seed_states(np.random.default_rng(0), 1)
        found: list[float] = []
        n_met = 0
        while len(found) < _MAX_DIVES and n_met < _MAX_MET:
            estimate = kernels.dive(site, labels, trails, counts, self._here, states)
            if estimate < 0.0:
                break
            found.append(estimate)
            n_met += int(counts[tables.LABELS])
        return float(np.mean(found)) if found else 0.0

    def _begin_teams(self) -> None:
        kernels.tidy(self._trails, self._counts)
        n_robots, n = self.mission.robots, self.n_trails
        reward, all_reward = self._site.reward, self._site.reward.sum()
        self._require(n * n_robots * 32)
        self._choices = teams.new_choices(
            self._trails.survives[:n].copy(),
            self._trails.reached[:n].copy(),
            np.array([all_reward]) if self._site.single else reward,
            _SLACK * np.array([all_reward, n_robots]),
            n_robots,
        )
        self._turns = np.zeros(teams.N_COUNTS, np.int64)
        self._front = teams.new_front(max(_ROWS, len(self._guides)), n_robots)
        for i, figures in enumerate(self._figures(self._guides)):
            if not teams.is_covered(self._front, self._turns[teams.FRONT], *figures):
                teams.insert(self._front, self._turns, *figures, np.full(n_robots, -1 - i))
        teams.list_choices(self._choices, self._front, self._turns[teams.FRONT], 0)

    def _advance_teams(self, choices: teams.Choices) -> None:
        state = teams.choose_teams(choices, self._front, self._turns, _CHOICES_A_PORTION)
        if state == teams.FULL:
            self._front = self._doubled(self._front)
        elif state == teams.FINISHED:
            self.plans = self._plans()

    def _plans(self) -> PlanBatch:
        """Read the front, where points that differ by rounding only are one."""
        rows = self._front.team[: self._turns[teams.FRONT]].tolist()
        found = [
            self._guides[-1 - row[0]] if row[0] < 0 else TrailPlan([self._trail(t) for t in row])
            for row in rows
        ]
        objectives = self.mission.evaluate(found)
        # E[R] is rounded in shares of a sum that has the base's reward in it.
        same_reward = _SAME * self._site.reward.sum() + 1e-15 * self.mission.total_reward
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

    def _trail(self, row: int) -> list[int]:
        """Give a trail of the table as nodes."""
        label, arc = int(self._trails.parent[row]), int(self._trails.arc[row])
        if label < 0:
            return list(self._known[-1 - label])
        home = kernels.way_home(self._site, self._labels, self._here, label, arc)
        nodes: list[int] = home.tolist()
        while label >= 0:
            nodes.insert(0, int(self._labels.node[label]))
            label = int(self._labels.parent[label])
        return nodes

    def _figures(self, plans: list[TrailPlan]) -> list[tuple[float, float]]:
        """E[R] of plans, without that of the base, and E[S]."""
        followed = [[_follow(self._site, trail) for trail in plan.trails] for plan in plans]
        reached = [reduce(either, [chances for _, chances in team]) for team in followed]
        rewards = [float(self._site.reward @ chances) for chances in reached]
        return [(r, sum(s for s, _ in t)) for r, t in zip(rewards, followed, strict=True)]

    def _doubled(self, table: AnyTable) -> AnyTable:
        self._require(2 * tables.n_bytes(table))
        return tables.doubled(table)

    def _require(self, n_bytes: int) -> None:
        """Raise the error that says so where there is no room for so many more bytes."""
        held = tables.n_bytes(self._labels) + tables.n_bytes(self._trails)
        if self._choices is not None:
            held += tables.n_bytes(self._choices) + tables.n_bytes(self._front)
        if held + n_bytes > self.memory_limit * _MIB:
            raise TooLargeError(
                f"{self._name()}: the exact front was not found within memory_limit = "
                f"{self.memory_limit:g} MiB. {self._progress()} {_REMEDY}"
            )

    def _name(self) -> str:
        mission = self.mission
        robots = "1 robot" if self._site.single else f"{mission.robots} robots"
        n_nodes, n_arcs = len(mission.nodes), mission.arrays.n_arcs
        return f"Mission {mission.name!r} ({n_nodes} nodes, {n_arcs} arcs, {robots})"

    def _progress(self) -> str:
        if self._choices is None:
            n_done = int(self._counts[tables.NEXT])
            return (
                f"The search had gone on from {n_done} of the {self.n_labels} partial trails "
                "found so far."
            )
        n_done, n = int(self._choices.at[0]), int(self._choices.n_listed[0])
        return (
            f"The search had found all {self.n_trails} trails that matter, and tried {n_done} of "
            f"{n} for the first robot of a team."
        )


_REMEDY = (
    "Raise the limits, take fewer robots or a smaller mission, or another algorithm such as BOACO."
)


def _site_of(mission: Mission, least: float) -> tables.Site:
    """Arrays of its own: a kernel that gets read-only ones is compiled once more."""
    arrays, walk = mission.arrays, mission.walk
    is_goal = (arrays.reward > 0) & (np.arange(arrays.n_nodes) != arrays.base)
    return tables.Site(
        first=arrays.first.copy(),
        tail=arrays.tail.copy(),
        head=arrays.head.copy(),
        survival=arrays.survival.copy(),
        goal=np.where(is_goal, np.cumsum(is_goal) - 1, -1).astype(np.int32),
        reward=arrays.reward[is_goal],
        home=walk.home.copy(),
        base=arrays.base,
        balanced=walk.balanced,
        single=mission.robots == 1,
        least=least,
    )


def _follow(site: tables.Site, trail: tuple[int, ...]) -> tuple[float, FloatArray]:
    """Give the probabilities to survive a trail, and to reach each goal on it."""
    reached, alive = np.zeros(len(site.reward)), 1.0
    for tail, head in pairwise(trail):
        low, high = site.first[tail], site.first[tail + 1]
        alive *= float(site.survival[low:high][site.head[low:high] == head][0])
        goal = site.goal[head]
        if goal >= 0 and reached[goal] == 0.0:
            reached[goal] = alive
    return alive, reached
