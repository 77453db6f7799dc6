"""The ant colony proper: arrays and kernels, no pymoo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.colony.construct import (
    BuildRule,
    Plans,
    Weights,
    construct,
    new_plans,
)
from botohe_moo.kernels.colony.pheromone import (
    LOG_HIGH,
    Depositors,
    Pheromone,
    learn,
    trail_arcs,
    weigh,
)
from botohe_moo.kernels.rng import seed_states
from botohe_moo.mission.model import Mission
from botohe_moo.search.archive import PlanArchive
from botohe_moo.trails import PlanBatch

__all__ = ["Allocation", "AntThreads", "Colony", "ColonyRule", "exchange_archives"]

Allocation = Literal["sequential", "concurrent"]


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

    Parameters
    ----------
    n_threads
        How many, the calling one among them.
    """

    def __init__(self, n_threads: int) -> None:
        self.n_threads = n_threads
        self._pool: ThreadPoolExecutor | None = None

    def submit(self, job: Callable[..., Any], *args: Any) -> Future[Any]:
        """Let another thread than the calling one do a job."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.n_threads - 1, "botohe-ants")
        return self._pool.submit(job, *args)

    def close(self) -> None:
        """End the threads; the next job starts new ones."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pool": None}


class Colony:
    """Ants that build plans, and the pheromone they leave.

    Parameters
    ----------
    mission
        What to plan for.
    rule
        How ants choose and deposit.
    n_ants
        Size of the colony.
    threads
        Which build plans, by default the calling one alone; results do not depend on them.
    min_survival
        Probability with which every robot has to survive.
    random_state
        Where each ant's own generator takes its seed from.
    """

    def __init__(
        self,
        mission: Mission,
        rule: ColonyRule,
        *,
        n_ants: int,
        threads: AntThreads | None = None,
        min_survival: float = 0.0,
        random_state: np.random.Generator,
    ) -> None:
        self.rule = rule
        self.n_robots = mission.robots
        self.threads = threads or AntThreads(1)
        self.min_survival = min_survival
        self._graph = mission.arrays
        self._states = seed_states(random_state, n_ants)
        self._pheromone = _new_pheromone(mission, rule)
        self._weights = _new_weights(mission, rule, self._pheromone)
        weigh(self._pheromone, self._weights)
        self._deposited_version = -1  # of the archive, when its deposit was last summed up
        self._rooms: dict[int, Plans] = {}  # of each thread

    @property
    def pheromone(self) -> FloatArray:
        """Reward and survival pheromone of the arcs (n_maps, n_arcs + 1, 2).

        With one map the robots share it; behind the mission's arcs comes the base's self-loop.
        """
        return self._pheromone.levels

    def construct(self, n_ants: int) -> tuple[PlanBatch, IntArray]:
        """Let ants build one plan each.

        Parameters
        ----------
        n_ants
            How many, at most the colony's size; their weights on the objectives are spread evenly.

        Returns
        -------
        tuple
            The plans, robots in the order in which they were planned, and the arc that leaves
            each of their nodes, every trail ending with the base's self-loop.
        """
        n_threads = min(self.threads.n_threads, n_ants)
        cuts = [n_ants * i // n_threads for i in range(n_threads + 1)]
        waiting = [
            self.threads.submit(self._construct_span, part, n_ants, cuts[part], cuts[part + 1])
            for part in range(1, n_threads)
        ]
        nodes, arcs, lengths = self._construct_span(0, n_ants, 0, cuts[1])
        if waiting:
            parts = [(nodes, arcs, lengths), *(future.result() for future in waiting)]
            nodes, arcs, lengths = _joined(parts)
        offsets = np.zeros(len(lengths) + 1, np.int64)
        np.cumsum(lengths, out=offsets[1:])
        return PlanBatch._wrap(nodes, offsets, self.n_robots), arcs

    def _construct_span(
        self, part: int, n_ants: int, begin: int, end: int
    ) -> tuple[IntArray, IntArray, OffsetArray]:
        """Let the ants ``begin`` to ``end`` build: nodes, arcs, and the lengths of their trails."""
        n_robots, rule = self.n_robots, self.rule
        concurrent = rule.allocation == "concurrent"
        build = BuildRule(n_robots, n_ants, concurrent, rule.exploration, self.min_survival)
        plans = self._rooms.get(part) or new_plans(4096, len(self._states) * n_robots)
        found = []
        while True:
            done = construct(self._graph, self._weights, build, self._states, plans, begin, end)
            size, lengths = plans.size[0], plans.lengths[begin * n_robots : done * n_robots]
            found.append((plans.nodes[:size].copy(), plans.arcs[:size].copy(), lengths))
            if done == end:
                break
            begin, longest = done, 2 * n_robots * (self._graph.n_arcs + 1)
            plans = new_plans(longest + 2 * len(plans.nodes), len(plans.lengths))
        self._rooms[part] = plans
        return found[0] if len(found) == 1 else _joined(found)

    def arcs_of(self, batch: PlanBatch) -> IntArray:
        """Give the arc that leaves each node of valid plans, trails ending with the self-loop.

        Parameters
        ----------
        batch
            Valid plans of the mission.
        """
        return trail_arcs(self._graph, batch.nodes, batch.offsets)

    def learn(
        self,
        batch: PlanBatch,
        arcs: IntArray,
        objectives: FloatArray,
        members: OffsetArray,
        archive: PlanArchive,
    ) -> None:
        """Evaporate and deposit pheromone, unless the colony does without.

        Parameters
        ----------
        batch, arcs, objectives
            The iteration's plans, their arcs, and their E[R] and E[S].
        members
            Indices of the iteration's Pareto set.
        archive
            The global Pareto set, of all plans or of those that the colony knows of.
        """
        if not self.rule.pheromone or len(archive) == 0:
            return
        iteration = archived = Depositors(objectives, members, arcs, batch.offsets)
        everybody = np.arange(len(archive))
        changed = archive.version != self._deposited_version
        if changed:
            plans = archive.plans
            archived = Depositors(archive.objectives, everybody, self.arcs_of(plans), plans.offsets)
        else:  # its deposit is known, only their number counts
            archived = iteration._replace(members=everybody)
        learn(
            self._pheromone,
            self._weights,
            self.rule.evaporation,
            self.rule.pooled_deposit,
            self.n_robots,
            iteration,
            archived,
            changed,
        )
        self._deposited_version = archive.version

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_rooms": {}}


def _joined(
    parts: Sequence[tuple[IntArray, IntArray, OffsetArray]],
) -> tuple[IntArray, IntArray, OffsetArray]:
    nodes, arcs, lengths = (np.concatenate(pieces) for pieces in zip(*parts, strict=True))
    return nodes, arcs, lengths


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
    """Let every colony's archive take in what the one before it holds, the first one the last's.

    All of them at once: a plan goes no further than to the next archive of the ring.

    Notes
    -----
    Circular exchange of the locally best plans, as in Middendorf, Reischle and Schmeck, "Multi
    colony ant algorithms", Journal of Heuristics 8(3), 2002, with a front for their best one.
    """
    held = [(archive.plans, archive.objectives.copy()) for archive in archives]
    for giver, archive in enumerate(archives, start=-1):
        archive.absorb(*held[giver])
