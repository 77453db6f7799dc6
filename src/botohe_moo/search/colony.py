"""The ant colony proper: arrays and kernels, no pymoo."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.core.graph import NO_LIMITS, Graph, Limits
from botohe_moo.core.kinds import AT_NEXT_DEPOT
from botohe_moo.core.paths import Paths, new_budget, new_paths
from botohe_moo.core.rng import seed_states
from botohe_moo.kernels.colony.construct import Plans, construct, new_plans
from botohe_moo.kernels.colony.pheromone import (
    LEAST,
    LOG_HIGH,
    LOG_LOW,
    Depositors,
    Pheromone,
    learn,
)
from botohe_moo.kernels.colony.weighing import AntScratch, BuildRule, Weights, new_scratch
from botohe_moo.mission.model import Mission
from botohe_moo.search.archive import PlanArchive
from botohe_moo.search.threads import mapping
from botohe_moo.trails import PlanBatch

if TYPE_CHECKING:
    import pandas as pd

Allocation = Literal["sequential", "concurrent"]

_log = np.frompyfunc(math.log, 1, 1)  # has the bits of the kernels' logarithm; numpy's may differ


# Trails of an iteration times arcs: with fewer, one thread builds them in the time that it takes to
# start others.
_MUCH = 50_000


@dataclass(frozen=True)
class ColonyRule:
    """The rule by which ants weigh arcs and pheromone changes.

    :class:`BOACO` documents the parameters. Defaults are those of :meth:`BOACO.journal`.
    """

    evaporation: float = 0.1
    heuristic: bool = True
    pheromone: bool = True
    pheromone_per_robot: bool = False
    initial_reward_pheromone: float = 1.0
    initial_survival_pheromone: float = 1.0
    reward_epsilon: float = 0.05
    survival_epsilon: float = 0.01
    unvisited_bonus: float = 0.05
    exploration: float = 0.01
    pooled_deposit: bool = False
    allocation: Allocation = "sequential"


class Colony:
    """Ants that build plans, and the pheromone they leave.

    Plans are built by ``n_threads``, on which results do not depend: each ant has its own
    generator, whose seed is drawn from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        rule: ColonyRule,
        *,
        n_ants: int,
        n_threads: int = 1,
        limits: Limits = NO_LIMITS,
        random_state: np.random.Generator,
    ) -> None:
        self.rule = rule
        self.n_robots = mission.robots
        self.n_threads = n_threads
        self.limits = limits
        self._graph = mission.arrays
        self._budget = new_budget(mission.arrays, limits)
        self._is_careful = not mission.arrays.balanced or limits.bind
        self._states = seed_states(random_state, n_ants)
        self._pheromone = _new_pheromone(mission, rule)
        self._weights = _new_weights(mission.arrays, rule, self._pheromone)
        self._rooms: dict[int, tuple[Plans, Paths | None, AntScratch]] = {}  # of each thread
        self._deposited_version = -1  # of the archive, when its deposit was last summed up
        self._archived: Depositors  # the plans of that version
        # Arguments of ``learn`` that the last iteration has left for the next one.
        self._to_learn: tuple[Depositors, Depositors, bool] | None = None

    @property
    def pheromone(self) -> FloatArray:
        """Reward and survival pheromone of the arcs (n_maps, n_arcs + n_kinds, 2).

        Each robot has a map, or all share one; behind the arcs come the self-loops with which
        trails end, one for each kind of robots.
        """
        self._catch_up()
        return self._pheromone.levels

    def construct(self, n_ants: int) -> PlanBatch:
        """Build a plan for each of ``n_ants`` ants; robots are in the order of planning.

        The ants' weights on the objectives are spread evenly.
        """
        self._catch_up()
        is_much = n_ants * self.n_robots * self._graph.n_arcs > _MUCH
        n_threads = min(self.n_threads, n_ants) if is_much else 1
        if n_threads == 1:
            return self._construct_span(0, n_ants, 0, n_ants)
        cuts = [n_ants * i // n_threads for i in range(n_threads + 1)]
        spans = range(n_threads), [n_ants] * n_threads, cuts[:-1], cuts[1:]
        with mapping(n_threads) as map_:
            found = map_(self._construct_span, *spans)
        return PlanBatch.concatenate(found)

    def _construct_span(self, part: int, n_ants: int, begin: int, end: int) -> PlanBatch:
        """Build the plans of the ants ``begin`` to ``end``, in the thread with number ``part``."""
        n_robots, rule, graph = self.n_robots, self.rule, self._graph
        concurrent = rule.allocation == "concurrent"
        build = BuildRule(n_robots, n_ants, concurrent, rule.exploration, self.limits, self._budget)
        if part not in self._rooms:
            plans = new_plans(4096, len(self._states) * n_robots)
            scratch = new_scratch(graph, build, len(self._weights.log_reward), self._states)
            self._rooms[part] = plans, new_paths(graph) if self._is_careful else None, scratch
        plans, paths, scratch = self._rooms[part]
        for last in (scratch.tabulated, scratch.used, scratch.visited):
            last.fill(-1)
        found = []
        while True:
            done = construct(graph, self._weights, build, paths, scratch, plans, begin, end)
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
        """Evaporate and deposit pheromone, if the colony has any.

        ``objectives`` are E[R] and E[S] of the iteration's plans, and ``members`` the indices of
        its Pareto set. ``archive`` holds the global Pareto set, or what the colony knows of it.
        """
        if not self.rule.pheromone or len(archive) == 0:
            return
        self._catch_up()
        is_new = archive.version != self._deposited_version
        if is_new:
            everyone, archived = np.arange(len(archive)), archive.arrays
            self._archived = Depositors(
                archived.objectives, everyone, archived.nodes, archived.offsets
            )
            self._deposited_version = archive.version
        iteration = Depositors(objectives, members, *batch.arrays)
        self._to_learn = iteration, self._archived, is_new

    def _catch_up(self) -> None:
        """Learn what the last iteration has found, if it has not been learned yet.

        ``learn`` is called only when ants build again, so that a first front need not compile it.
        """
        if self._to_learn is not None:
            rule = self.rule.evaporation, self.rule.pooled_deposit
            changed = self._pheromone, self._weights
            learn(self._graph, *self._to_learn, *rule, *changed)
            self._to_learn = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_rooms": {}}


def _new_pheromone(mission: Mission, rule: ColonyRule) -> Pheromone:
    survival = np.append(mission.arrays.survival, np.ones(len(mission.kinds)))
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


def _new_weights(graph: Graph, rule: ColonyRule, pheromone: Pheromone) -> Weights:
    """Weigh arcs by the pheromone at the start, with the bits of ``learn``.

    In Python, so that a first front need not compile that.
    """
    gain = np.zeros(pheromone.levels.shape[1])
    if rule.heuristic:
        reward, ends = graph.reward, [graph.base]
        if (kinds := graph.kinds) is not None:  # what is paid on return depends on coming home
            reward = np.where(kinds.credit == AT_NEXT_DEPOT, reward * graph.home, reward)
            ends = list(dict.fromkeys(kinds.end.tolist()))
        reward = reward[[*graph.head, *ends]]
        survival = np.append(graph.survival, np.ones(len(ends)))
        with np.errstate(over="ignore"):
            gain = (rule.unvisited_bonus + survival * reward) / rule.reward_epsilon
    gain = np.minimum(gain, np.exp(LOG_HIGH))
    logs = np.asarray(_log(np.maximum(pheromone.levels, LEAST)), np.float64)
    log_reward = np.clip(logs[..., 0] + pheromone.log_eta_reward, LOG_LOW, LOG_HIGH)
    log_survival = np.clip(logs[..., 1] + pheromone.log_eta_survival, LOG_LOW, LOG_HIGH)
    return Weights(log_reward, log_survival, gain, np.log1p(gain))


def tabulate_pheromone(mission: Mission, colony: Colony) -> pd.DataFrame:
    """Return the pheromone of a colony, a row for each arc, as :attr:`BOACO.pheromone_maps`."""
    import pandas as pd  # here, since importing it takes as long as importing all else

    graph, nodes, kinds = mission.arrays, mission.nodes, mission.kinds
    loops = [mission.index(kind.ends(mission.base)[1]) for kind in kinds]
    loops = [k * len(nodes) + end for k, end in enumerate(loops)]
    tails, heads = (np.array([*ends, *loops]) for ends in (graph.tail, graph.head))
    labels = [
        pd.Series([nodes[i] for i in ends % len(nodes)], dtype=object) for ends in (tails, heads)
    ]
    names = [kinds[k].name for k in tails // len(nodes)]
    columns = ["robot", "kind", "tail", "head", "reward", "survival"]
    maps = [
        pd.DataFrame(dict(zip(columns, [robot, names, *labels, *levels.T], strict=True)))
        for robot, levels in enumerate(colony.pheromone)
    ]
    table = pd.concat(maps, ignore_index=True)
    if len(kinds) == 1:
        table = table.drop(columns="kind")
    return table if colony.rule.pheromone_per_robot else table.drop(columns="robot")
