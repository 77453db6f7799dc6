"""The ant colony proper: arrays and kernels, no pymoo."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.colony.construct import Plans, construct, new_plans
from botohe_moo.kernels.colony.pheromone import (
    LEAST,
    LOG_HIGH,
    LOG_LOW,
    Depositors,
    LearningRule,
    Pheromone,
    learn,
)
from botohe_moo.kernels.colony.weighing import AntScratch, BuildRule, Weights, new_scratch
from botohe_moo.kernels.graph.graph import NO_LIMITS, Limits, roads_of
from botohe_moo.kernels.graph.paths import Paths, new_budget, new_paths
from botohe_moo.kernels.rng import seed_states
from botohe_moo.mission.model import Mission
from botohe_moo.search.archive import PlanArchive
from botohe_moo.trails import PlanBatch

Allocation = Literal["sequential", "concurrent"]

_log = np.frompyfunc(math.log, 1, 1)  # with the bits of the kernels' logarithm; numpy's may differ


@dataclass(frozen=True)
class ColonyRule:
    """How ants weigh arcs and how pheromone changes; :class:`BOACO` documents the parameters."""

    evaporation: float
    heuristic: bool
    pheromone: bool
    pheromone_per_robot: bool
    initial_reward_pheromone: float
    initial_survival_pheromone: float
    reward_epsilon: float
    survival_epsilon: float
    unvisited_bonus: float
    exploration: float
    pooled_deposit: bool
    allocation: Allocation = "sequential"


class AntThreads:
    """Threads that build plans, which several colonies may share; they start when needed.

    The calling one is among the ``n_threads``. A forked process starts threads of its own, since
    those of its parent are not forked.
    """

    def __init__(self, n_threads: int) -> None:
        self.n_threads = n_threads
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0  # whose threads these are

    def submit(self, job: Callable[..., Any], *args: Any) -> Future[Any]:
        """Run a job in another thread than the calling one."""
        if self._pool is None or self._process != os.getpid():
            self._pool = ThreadPoolExecutor(self.n_threads - 1, "botohe-ants")
            self._process = os.getpid()
        return self._pool.submit(job, *args)

    def close(self) -> None:
        """End the threads; the next job starts new ones."""
        if self._pool is not None and self._process == os.getpid():
            self._pool.shutdown()
        self._pool = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pool": None}


class Colony:
    """Ants that build plans, and the pheromone they leave.

    Plans are built by ``threads``, by default by the calling one alone; results do not depend on
    them: each ant's own generator takes its seed from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        rule: ColonyRule,
        *,
        n_ants: int,
        threads: AntThreads | None = None,
        limits: Limits = NO_LIMITS,
        random_state: np.random.Generator,
    ) -> None:
        self.rule = rule
        self.n_robots = mission.robots
        self.threads = threads or AntThreads(1)
        self.limits = limits
        self._graph = mission.arrays
        self._budget = new_budget(mission.arrays, limits)
        self._is_careful = not mission.arrays.balanced or limits.bind
        # What is handed over in microseconds where ants need not look for ways home.
        self._roads: Any = mission.arrays if self._is_careful else roads_of(mission.arrays)
        self._states = seed_states(random_state, n_ants)
        self._pheromone = _new_pheromone(mission, rule)
        self._weights = _new_weights(mission, rule, self._pheromone)
        self._rooms: dict[int, tuple[Plans, Paths | None, AntScratch]] = {}  # of each thread
        self._deposited_version = -1  # of the archive, when its deposit was last summed up
        self._archived: Depositors  # the archive of that version
        # The depositors of the last iteration, as ``learn`` takes them, until they are learned.
        self._to_learn: tuple[Depositors, Depositors, bool] | None = None
        self.weigh()

    @property
    def pheromone(self) -> FloatArray:
        """Reward and survival pheromone of the arcs (n_maps, n_arcs + 1, 2).

        With one map the robots share it; behind the mission's arcs comes the base's self-loop.
        """
        self._catch_up()
        return self._pheromone.levels

    def construct(self, n_ants: int) -> PlanBatch:
        """Build one plan for each of ``n_ants`` ants; robots are in the order of planning.

        The ants' weights on the objectives are spread evenly.
        """
        self._catch_up()
        n_threads = min(self.threads.n_threads, n_ants)
        if n_threads == 1:
            return self._construct_span(0, n_ants, 0, n_ants)
        cuts = [n_ants * i // n_threads for i in range(n_threads + 1)]
        waiting = [
            self.threads.submit(self._construct_span, part, n_ants, cuts[part], cuts[part + 1])
            for part in range(1, n_threads)
        ]
        mine = self._construct_span(0, n_ants, 0, cuts[1])
        return PlanBatch.concatenate([mine, *(future.result() for future in waiting)])

    def _construct_span(self, part: int, n_ants: int, begin: int, end: int) -> PlanBatch:
        """Build the plans of the ants ``begin`` to ``end``."""
        n_robots, rule, graph = self.n_robots, self.rule, self._graph
        concurrent = rule.allocation == "concurrent"
        limits, budget = self.limits, self._budget
        build = BuildRule(
            n_robots, n_ants, concurrent, rule.exploration, limits.min_survival, budget
        )
        if part not in self._rooms:
            plans = new_plans(4096, len(self._states) * n_robots)
            scratch = new_scratch(graph, build, len(self._weights.log_reward), self._states)
            self._rooms[part] = plans, new_paths(graph) if self._is_careful else None, scratch
        plans, paths, scratch = self._rooms[part]
        for last in (scratch.tabulated, scratch.used, scratch.visited):
            last.fill(-1)
        found = []
        while True:
            done = construct(self._roads, self._weights, build, paths, scratch, plans, begin, end)
            offsets = plans.offsets[begin * n_robots : done * n_robots + 1].copy()
            nodes = plans.nodes[: plans.size[0]].copy()
            found.append(PlanBatch._wrap(nodes, offsets, n_robots))
            if done == end:
                return found[0] if len(found) == 1 else PlanBatch.concatenate(found)
            begin, longest = done, 2 * n_robots * (graph.n_arcs + 1)
            plans = new_plans(longest + 2 * len(plans.nodes), len(self._states) * n_robots)
            self._rooms[part] = plans, paths, scratch

    def learn(
        self, batch: PlanBatch, objectives: FloatArray, members: OffsetArray, archive: PlanArchive
    ) -> None:
        """Evaporate and deposit pheromone, unless the colony does without.

        ``objectives`` are E[R] and E[S] of the iteration's plans, and ``members`` the indices of
        its Pareto set; ``archive`` is the global one, of all plans or of those the colony knows of.
        """
        if not self.rule.pheromone or len(archive) == 0:
            return
        self._catch_up()
        is_new = archive.version != self._deposited_version
        if is_new:
            everyone, archived = np.arange(len(archive)), archive.held
            self._archived = Depositors(
                archived.objectives, everyone, archived.nodes, archived.offsets
            )
            self._deposited_version = archive.version
        iteration = Depositors(objectives, members, *batch.arrays)
        self._to_learn = iteration, self._archived, is_new

    def _catch_up(self) -> None:
        """Learn what the last iteration has found.

        This waits until ants build again: a first front needs none of it, nor any compiling for it.
        """
        if self._to_learn is not None:
            rule = LearningRule(self.rule.evaporation, self.rule.pooled_deposit)
            changed = self._pheromone, self._weights
            learn(roads_of(self._graph), *self._to_learn, self.n_robots, rule, *changed)
            self._to_learn = None

    def weigh(self) -> None:
        """Weigh arcs by the pheromone as it is, before anything has been deposited."""
        pheromone, weights = self._pheromone, self._weights
        logs = np.asarray(_log(np.maximum(pheromone.levels, LEAST)), np.float64)
        weights.log_reward[:] = logs[..., 0] + pheromone.log_eta_reward
        weights.log_survival[:] = logs[..., 1] + pheromone.log_eta_survival
        for log in (weights.log_reward, weights.log_survival):
            np.clip(log, LOG_LOW, LOG_HIGH, out=log)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_rooms": {}}


def _new_pheromone(mission: Mission, rule: ColonyRule) -> Pheromone:
    survival = np.append(mission.arrays.survival, 1.0)
    shape = (mission.robots if rule.pheromone_per_robot else 1, len(survival), 2)
    levels = np.ones(shape)
    if rule.pheromone:
        levels[..., 0] = rule.initial_reward_pheromone
        levels[..., 1] = rule.initial_survival_pheromone
    eta_reward, eta_survival = 1.0, np.ones(len(survival))
    if rule.heuristic:
        eta_reward, eta_survival = rule.reward_epsilon, rule.survival_epsilon + survival
    return Pheromone(
        levels,
        np.zeros(shape),
        np.zeros(shape),
        np.full(len(survival), np.log(eta_reward)),
        np.log(eta_survival),
    )


def _new_weights(mission: Mission, rule: ColonyRule, pheromone: Pheromone) -> Weights:
    graph, shape = mission.arrays, pheromone.levels.shape[:2]
    gain = np.zeros(shape[1])
    if rule.heuristic:
        reward = graph.reward[np.append(graph.head, graph.base)]
        survival = np.append(graph.survival, 1.0)
        with np.errstate(over="ignore"):
            gain = (rule.unvisited_bonus + survival * reward) / rule.reward_epsilon
    gain = np.minimum(gain, np.exp(LOG_HIGH))
    return Weights(np.empty(shape), np.empty(shape), gain, np.log1p(gain))


def exchange_archives(archives: Sequence[PlanArchive]) -> None:
    """Insert the plans of each archive into the next one, those of the last into the first.

    All of them at once: a plan goes no further than to the next archive of the ring.

    Notes
    -----
    Circular exchange of the locally best plans, as in Middendorf, Reischle and Schmeck, "Multi
    colony ant algorithms", Journal of Heuristics 8(3), 2002, with a front for their best one.
    """
    plans = [(archive.plans, archive.objectives.copy()) for archive in archives]
    for giver, archive in enumerate(archives, start=-1):
        archive.insert(*plans[giver])
