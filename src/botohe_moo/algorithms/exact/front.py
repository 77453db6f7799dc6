"""The true Pareto front of small missions, from the Pareto sets of their trails."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Annotated, TypeAlias

import numpy as np
from pydantic import Field

from botohe_moo.algorithms.exact import kernels
from botohe_moo.algorithms.exact.kernels import TrailTable, n_bytes
from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.base.messages import counted, quoted
from botohe_moo.base.parameters import Positive, Probability, TravelBudget, checked
from botohe_moo.base.types import FloatArray, Record
from botohe_moo.core import compile as compiling
from botohe_moo.core.evaluate import evaluate, new_values
from botohe_moo.core.ordered import best_reward, grow_front, insert, new_front, read_front
from botohe_moo.core.world import CHECKING, World, read_only
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.trails import PlanBatch, TrailPlan

_LABEL_ROWS = 1024  # that tables have room for at first


def without_base_reward(world: World) -> World:
    """Return a plain mission's world without the reward of its base, which all plans collect."""
    reward = world.graph.reward.copy()
    reward[world.team.start[0]] = 0.0
    graph, team = world.graph._replace(reward=reward), world.team._replace(reward=reward)
    return read_only(*world._replace(graph=graph, team=team))


class TrailSearch:
    """The search for all trails of a plain mission that a best team may need.

    Every trail keeps the limits of ``world``, whose base has no reward.
    """

    def __init__(self, world: World) -> None:
        self._search = kernels.new_search(world, _LABEL_ROWS)

    @property
    def progress(self) -> Record:
        """How many partial trails (``n_labels``) and trails that teams may need it has found.

        It goes on from label ``next``.
        """
        return self._search.progress[0]

    @property
    def reward(self) -> FloatArray:
        """The reward of each goal, or for one robot, whose trails have shares of it, all reward."""
        reward = self._search.reward
        return reward if self._search.world.n_robots > 1 else np.array([reward.sum()])

    @property
    def n_bytes(self) -> int:
        """The size of the tables in bytes."""
        return kernels.n_bytes(self._search.labels, self._search.trails)

    def found(self) -> tuple[FloatArray, FloatArray]:
        """Return the survivals of trails, and the probabilities that they reach each goal.

        Survivals descend once the search has ended. For one robot, shares of reward take the place
        of the probabilities.
        """
        trails, n = self._search.trails, self.progress.n_trails
        return trails.rows["survives"][:n].copy(), trails.reached[:n].copy()

    def advance(self, n_looks: int, require: Callable[[int], None]) -> bool:
        """Go on from ``n_looks`` labels at most; return whether all trails are known.

        Before memory is taken, ``require`` is called with the number of bytes. In the end trails
        are sorted by descending survival, without those that another is as good as.
        """
        search, progress = self._search, self.progress
        if kernels.grow(search, n_looks):
            require(self.n_bytes)
            larger = kernels.doubled(search.labels)
            self._search = search._replace(labels=larger, trails=kernels.doubled(search.trails))
        if progress.next < progress.n_labels:
            return False
        n, others = progress.n_trails, TrailTable(*[column.copy() for column in search.trails])
        total = sum(others.reached[:n].T, np.zeros(n))
        progress.n_trails = 0
        # Of trails that survive alike, one that another is as good as comes after it.
        kernels.add_trails(search, others, np.lexsort((-total, -others.rows["survives"][:n])))
        return True

    def trail(self, row: int) -> list[int]:
        """Return a trail of the table as nodes."""
        search, table = self._search, self._search.labels
        graph, paths = search.world.graph, search.paths
        label, arc, _ = search.trails.rows[row].tolist()
        home = [int(search.world.team.start[0])]
        if label < 0:
            return home
        search.used[:] = [kernels.has(table.used[label], i) for i in range(graph.n_arcs)]
        search.used[arc] = 1
        last = table.rows[self.progress.n_labels]
        last.length, last.node = table.rows.length[label] + graph.length[arc], graph.head[arc]
        kernels.look_around(search)
        while (entry := paths.entry[home[-1]]) >= 0:
            home.append(int(graph.tail[entry]))
        out: list[int] = []
        while label >= 0:
            label, node, *_ = table.rows[label].tolist()
            out.append(node)
        return out[::-1] + home[::-1]


TIME_LIMIT = 60.0
MEMORY_LIMIT = 2048.0
MemoryLimit: TypeAlias = Annotated[float, Field(gt=0, le=1e9)]  # MiB

_MIB = 2**20
_FRONT_ROWS = 1024  # rows of the front at first
# Portions of work, after which limits are checked: labels extended, nodes and arcs visited for
# them, and choices of trails tried.
_LABELS_A_PORTION, _LOOKS_A_PORTION, _CHOICES_A_PORTION = 1_000, 3_000_000, 500_000
# Of the plans that the search for teams begins with: how many weights, and how wide beams are.
_N_GUIDES, _GUIDE_WIDTH = 11, 20
# In shares of all reward and of all robots: a team has to be better by more than this to count.
# Points of the front that differ by less than ``CHECKING`` are one.
_SLACK = 0.1 * CHECKING
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
        If the search reaches a limit.
    TypeError
        If ``mission`` is not a Mission.
    ValueError
        If a parameter is out of its range.

    Notes
    -----
    The search finds all trails that a best team may need, then all teams of them; the module
    ``exact.kernels`` explains why nothing is missed. Label-setting with dominance
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
    world = mission.limited(min_survival, longest, by=0.0)
    search = FrontSearch(mission, world, time_limit=time_limit, memory_limit=memory_limit)
    while search.plans is None:
        search.advance()
    return search.plans


class FrontSearch:
    """The search for the true front, a portion at a time; ``plans`` is the front at the end.

    Plans keep the limits of ``world``. What all plans collect at the base counts at the end only.
    """

    def __init__(
        self, mission: Mission, world: World, *, time_limit: float, memory_limit: float
    ) -> None:
        self.mission, self.world = mission, world
        self.time_limit, self.memory_limit = time_limit, memory_limit
        self.plans: PlanBatch | None = None
        self._without_base = without_base_reward(world)
        self._trails = TrailSearch(self._without_base)
        self._choices: kernels.Choices | None = None
        self._spent = 0.0

    @compiling.kernels("compiled")
    def advance(self) -> None:
        """Do a portion of the work; raise a TooLargeError as :func:`exact_front` does."""
        begun = compiling.own_time()
        if self._choices is None:
            self._advance_trails()
        else:
            self._advance_teams(self._choices)
        self._spent += compiling.own_time() - begun
        if self.plans is None and self._spent > self.time_limit:
            raise self._limit_error(f"time_limit = {self.time_limit:g} seconds")

    @cached_property
    def _guides(self) -> tuple[list[TrailPlan], FloatArray]:
        """Good plans within the limits, and their E[R] and E[S] (n_plans, 2).

        The search leaves out what they dominate.
        """
        mission, limits = self.mission, self.world.limits
        planner = SequentialPlanner(mission, self.world, beam_width=_GUIDE_WIDTH)
        weights = np.linspace(0.0, 1.0, _N_GUIDES).tolist()
        plans = list(dict.fromkeys(plan for weight in weights for plan in planner.plans(weight)))
        values = new_values(len(plans), mission.robots)
        evaluate(self._without_base, *mission.batch(plans).arrays, True, values)
        keeps = (values.alive >= limits.floors) & (values.lengths <= limits.budgets)
        kept = np.flatnonzero(keeps.all(axis=1))
        return [plans[i] for i in kept.tolist()], values.objectives[kept]

    def _advance_trails(self) -> None:
        graph, trails = self.world.graph, self._trails
        self._require(0)
        n_looks = _LOOKS_A_PORTION // (graph.n_nodes + graph.n_arcs)
        if trails.advance(min(max(1, n_looks), _LABELS_A_PORTION), self._require):
            self._choices = self._new_choices()

    def _new_choices(self) -> kernels.Choices:
        """Begin the search for teams, with the guides as the front."""
        (guides, figures), n_robots = self._guides, self.mission.robots
        self._require(self._trails.progress.n_trails * n_robots * 32)
        self._front = new_front(max(_FRONT_ROWS, len(guides)), n_robots)
        for i, (expected, survivors) in enumerate(figures.tolist()):
            if best_reward(self._front, survivors) < expected:
                self._front.plan[insert(self._front, expected, survivors)] = -1 - i
        reward = self._trails.reward
        slack = _SLACK * np.array([reward.sum(), n_robots])
        return kernels.new_choices(*self._trails.found(), reward, slack, n_robots)

    def _advance_teams(self, choices: kernels.Choices) -> None:
        if self._front.n.spare == 0:
            self._require(2 * n_bytes(self._front))
            self._front = grow_front(self._front, 2 * len(self._front.slots))
        if kernels.choose_teams(choices, self._front, _CHOICES_A_PORTION, most_reward=False):
            self.plans = self._plans()

    def _plans(self) -> PlanBatch:
        """Return the plans of the front; of points that differ by rounding only, one."""
        mission, trails = self.mission, self._trails
        found = [
            self._guides[0][-1 - row[0]] if row[0] < 0 else TrailPlan(map(trails.trail, row))
            for row in self._front.plan[read_front(self._front)[0]].tolist()
        ]
        objectives = mission.evaluate(found)
        # E[R] is rounded in shares of a sum that has the base's reward in it.
        same_reward = CHECKING * trails.reward.sum() + 1e-15 * mission.total_reward
        same_survivors = CHECKING * mission.robots
        kept: list[int] = []
        for i in np.lexsort((-objectives[:, 1], -objectives[:, 0])).tolist():
            reward, survivors = objectives[i]
            if kept and survivors <= objectives[kept[-1], 1] + same_survivors:
                continue
            while kept and objectives[kept[-1], 0] <= reward + same_reward:
                kept.pop()
            kept.append(i)
        return mission.batch([found[i] for i in kept])

    def _require(self, more: int) -> None:
        """Raise a TooLargeError where there is no room for so many bytes more."""
        taken = self._trails.n_bytes
        if self._choices is not None:
            taken += n_bytes(self._choices, self._front)
        if taken + more > self.memory_limit * _MIB:
            raise self._limit_error(f"memory_limit = {self.memory_limit:g} MiB")

    def _limit_error(self, limit: str) -> TooLargeError:
        mission, graph, progress = self.mission, self.world.graph, self._trails.progress
        tried = f"{progress.next} of {progress.n_labels} partial trails found so far"
        if self._choices is not None:
            robot = self._choices.robots[0]
            tried = f"{robot.at} of {robot.n_listed} trails for the first robot of a team"
        size = f"{graph.n_nodes} nodes, {graph.n_arcs} arcs, {counted(mission.robots, 'robot')}"
        return TooLargeError(
            f"Mission {mission.name!r} ({size}): the exact front was not found within {limit}. The "
            f"search had tried {tried}. {_REMEDY}"
        )
