"""The ant colony proper: arrays and kernels, no pymoo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.colony.concurrent import construct_concurrently
from botohe_moo.kernels.colony.construct import construct
from botohe_moo.kernels.colony.pheromone import LOG_HIGH, learn, log_weights
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
        self.walk = walk = mission.walk
        self._states = seed_states(random_state, n_ants)
        n_maps = mission.robots if rule.pheromone_per_robot else 1
        shape = (n_maps, len(walk.head))
        self.pheromone: FloatArray = np.empty((*shape, 2))
        self.pheromone[..., 0] = rule.initial_reward_pheromone if rule.pheromone else 1.0
        self.pheromone[..., 1] = rule.initial_survival_pheromone if rule.pheromone else 1.0
        self._deposits = np.zeros((2, *shape, 2))
        self._deposited_version = -1  # of the archive, when its deposit was last summed up

        value = rule.unvisited_bonus + walk.survival * mission.arrays.reward[walk.head]
        if rule.heuristic:
            with np.errstate(over="ignore"):
                self._gain = value / rule.reward_epsilon
            self._log_eta_reward = float(np.log(rule.reward_epsilon))
            self._log_eta_survival = np.log(rule.survival_epsilon + walk.survival)
        else:
            self._gain = np.zeros(shape[1])
            self._log_eta_reward = 0.0
            self._log_eta_survival = np.zeros(shape[1])
        self._gain = np.minimum(self._gain, np.exp(LOG_HIGH))
        self._log_fresh = np.log1p(self._gain)
        self._log_reward, self._log_survival = np.empty(shape), np.empty(shape)
        self._weigh()
        self._buffers: dict[int, tuple[IntArray, IntArray]] = {}

    def _weigh(self) -> None:
        log_weights(
            self.pheromone,
            self._log_eta_reward,
            self._log_eta_survival,
            self._log_reward,
            self._log_survival,
        )

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
        lengths = np.empty(n_ants * self.n_robots, np.int64)
        n_threads = min(self.threads.n_threads, n_ants)
        cuts = [n_ants * i // n_threads for i in range(n_threads + 1)]
        spans = list(pairwise(cuts))
        if n_threads == 1:
            parts = [self._construct_span(0, 0, n_ants, n_ants, lengths)]
        else:
            waiting = [
                self.threads.submit(self._construct_span, part, *span, n_ants, lengths)
                for part, span in enumerate(spans[1:], start=1)
            ]
            parts = [self._construct_span(0, *spans[0], n_ants, lengths)]
            parts += [future.result() for future in waiting]
        offsets = np.zeros(len(lengths) + 1, np.int64)
        np.cumsum(lengths, out=offsets[1:])
        if n_threads == 1:
            nodes, arcs = parts[0][0].copy(), parts[0][1].copy()
        else:
            nodes = np.concatenate([nodes for nodes, _ in parts])
            arcs = np.concatenate([arcs for _, arcs in parts])
        return PlanBatch._wrap(nodes, offsets, self.n_robots), arcs

    def _construct_span(
        self, part: int, begin: int, end: int, n_ants: int, lengths: OffsetArray
    ) -> tuple[IntArray, IntArray]:
        nodes, arcs = self._buffers.get(part) or (
            np.empty(4096, np.int32),
            np.empty(4096, np.int32),
        )
        walk, rule = self.walk, self.rule
        build = construct_concurrently if rule.allocation == "concurrent" else construct
        nodes, arcs, size = build(
            walk.first,
            walk.head,
            walk.survival,
            walk.tail,
            walk.cost,
            walk.homeward,
            walk.home,
            walk.base,
            walk.balanced,
            self._log_reward,
            self._log_survival,
            self._gain,
            self._log_fresh,
            rule.exploration,
            self.min_survival,
            self.n_robots,
            n_ants,
            begin,
            end,
            self._states,
            nodes,
            arcs,
            lengths,
        )
        self._buffers[part] = nodes, arcs
        return nodes[:size], arcs[:size]

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
        changed = archive.version != self._deposited_version
        archived = archive.plans if changed else batch
        learn(
            self.pheromone,
            self.rule.evaporation,
            self.rule.pooled_deposit,
            objectives,
            members,
            arcs,
            batch.offsets,
            archive.objectives,
            self.walk.arcs_of(archived) if changed else arcs,
            archived.offsets,
            changed,
            self.n_robots,
            self._deposits[0],
            self._deposits[1],
        )
        self._deposited_version = archive.version
        self._weigh()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_buffers": {}}


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
