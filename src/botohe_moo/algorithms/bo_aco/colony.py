"""The ant colony proper: ants and their pheromone, without pymoo."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field

from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.algorithms.bo_aco import kernels
from botohe_moo.base.parameters import Count, NotNegative, Positive
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.core.paths import new_paths
from botohe_moo.core.rng import seed_states
from botohe_moo.core.threads import in_spans
from botohe_moo.core.world import World, brought_home
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

if TYPE_CHECKING:
    import pandas as pd

# Trails of an iteration times arcs: with fewer, one thread builds them in the time that it takes to
# start others.
_MUCH = 50_000


Evaporation: TypeAlias = Annotated[float, Field(gt=0, lt=1)]
InitialPheromone: TypeAlias = Positive | Literal["bounds"]


@dataclass(frozen=True, kw_only=True)
class ColonySettings:
    """How ants weigh arcs and pheromone changes; :class:`BOACO` documents the parameters.

    Defaults are the first settings of the paper.
    """

    n_ants: Count = 100
    evaporation: Evaporation = 0.04
    heuristic: bool = True
    pheromone: bool = True
    allocation: Literal["sequential", "concurrent"] = "sequential"
    pheromone_per_robot: bool = False
    initial_pheromone: InitialPheromone = 1.0
    reward_epsilon: Positive = 0.05
    survival_epsilon: Positive = 0.01
    unvisited_bonus: NotNegative = 0.0
    exploration: NotNegative = 0.0
    pooled_deposit: bool = True


# Those with which the curves were made that PeerJ Computer Science published in 2025.
JOURNAL_BONUS, JOURNAL_EXPLORATION = 0.05, 0.01


class Colony:
    """Ants that build plans, and the pheromone they leave.

    Ants plan with the limits of ``world``. Plans are built by ``n_threads``, on which results do
    not depend: each ant has its own generator, whose seed is drawn from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        world: World,
        settings: ColonySettings,
        *,
        n_threads: int = 1,
        random_state: np.random.Generator,
    ) -> None:
        self.settings = settings
        self.n_threads = n_threads
        self._world = world
        self._states = seed_states(random_state, settings.n_ants)
        self._heuristic = _new_heuristic(world, settings)
        self._pheromone = _new_pheromone(mission, settings)
        self._builds: dict[int, kernels.Build] = {}  # of each thread
        self._deposited_version = -1  # of the archive, when its deposit was last summed up
        # Arguments of ``learn`` that the last iteration has left for the next one.
        self._to_learn: tuple[kernels.Depositors, kernels.Depositors, bool] | None = None

    @property
    def pheromone(self) -> FloatArray:
        """Reward and survival pheromone of the arcs (n_maps, n_arcs + n_kinds, 2).

        Each robot has a map, or all share one; behind the arcs come the self-loops with which
        trails end, one for each kind of robots.
        """
        self._catch_up()
        return self._pheromone.levels

    def construct(self, n_ants: int) -> PlanBatch:
        """Build a plan for each of ``n_ants`` ants, at most those of the settings.

        The ants' weights on the objectives are spread evenly. Robots are in the order of planning.
        """
        self._catch_up()
        is_much = n_ants * self._world.n_robots * self._world.graph.n_arcs > _MUCH
        build = partial(self._construct_span, n_ants)
        spans = in_spans(n_ants, self.n_threads if is_much else 1, build)
        return spans[0] if len(spans) == 1 else PlanBatch.concatenate(spans)

    def _construct_span(self, n_ants: int, part: int, begin: int, end: int) -> PlanBatch:
        """Build the plans of the ants ``begin`` to ``end``, in the thread with number ``part``."""
        if part not in self._builds:
            self._builds[part] = self._new_build()
        build = self._builds[part]
        if build.n_ants != n_ants:
            build = build._replace(n_ants=n_ants)
        for last in (build.scratch.tabulated, build.scratch.used, build.scratch.visited):
            last.fill(-1)
        nodes, offsets = kernels.construct(self._world, build, begin, end)
        return PlanBatch._wrap(nodes, offsets, self._world.n_robots)

    def _new_build(self) -> kernels.Build:
        world, levels = self._world, self._pheromone.levels
        concurrent = self.settings.allocation == "concurrent"
        is_careful = not world.graph.balanced or world.limits.bind
        return kernels.Build(
            self.settings.n_ants,
            self.settings.exploration,
            concurrent,
            self._heuristic,
            levels,
            new_paths(world) if is_careful else None,
            kernels.new_scratch(world, len(levels), concurrent, self._states),
        )

    def learn(
        self, batch: PlanBatch, objectives: FloatArray, members: OffsetArray, archive: PlanArchive
    ) -> None:
        """Evaporate and deposit pheromone, if the colony has any.

        ``objectives`` are E[R] and E[S] of the iteration's plans, and ``members`` the indices of
        its Pareto set. ``archive`` holds the global Pareto set, or what the colony knows of it.
        """
        if not self.settings.pheromone or len(archive) == 0:
            return
        self._catch_up()
        everyone, kept = np.arange(len(archive)), archive.arrays
        self._to_learn = (
            kernels.Depositors(objectives, members, *batch.arrays),
            kernels.Depositors(kept.objectives, everyone, kept.nodes, kept.offsets),
            archive.version != self._deposited_version,
        )
        self._deposited_version = archive.version

    def _catch_up(self) -> None:
        """Learn what the last iteration has found, if it has not been learned yet.

        ``learn`` is called only when ants build again, so that a first front need not compile it.
        """
        if self._to_learn is not None:
            rule = kernels.LearnRule(self.settings.evaporation, self.settings.pooled_deposit)
            graph, n_nodes = self._world.graph, len(self._world.team.reward)
            kernels.learn(graph, n_nodes, rule, *self._to_learn, self._pheromone)
            self._to_learn = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_builds": {}}


def _new_pheromone(mission: Mission, settings: ColonySettings) -> kernels.Pheromone:
    n_maps = mission.robots if settings.pheromone_per_robot else 1
    shape = n_maps, mission.world.graph.n_arcs + len(mission.kinds), 2
    levels = np.ones(shape)
    if settings.pheromone and settings.initial_pheromone == "bounds":
        levels[:] = mission.total_reward or 1.0, mission.robots
    elif settings.pheromone:
        levels[:] = settings.initial_pheromone
    return kernels.Pheromone(np.maximum(levels, kernels.LEAST), np.zeros(shape), np.zeros(shape))


def _new_heuristic(world: World, settings: ColonySettings) -> kernels.Heuristic:
    survival = np.append(world.graph.survival, np.ones(world.team.n_kinds))
    if not settings.heuristic:
        nothing = np.zeros(len(survival))
        return kernels.Heuristic(0.0, nothing, nothing, nothing)
    heads = np.append(world.graph.head, np.unique(world.team.end))
    reward = brought_home(world, world.graph.reward)[heads]
    with np.errstate(over="ignore"):
        gain = (settings.unvisited_bonus + survival * reward) / settings.reward_epsilon
    gain = np.minimum(gain, np.exp(kernels.LOG_HIGH))
    return kernels.Heuristic(
        float(np.log(settings.reward_epsilon)),
        np.log(settings.survival_epsilon + survival),
        gain,
        np.log1p(gain),
    )


def tabulate_pheromone(mission: Mission, colony: Colony) -> pd.DataFrame:
    """Return the pheromone of a colony, a row for each arc, as :attr:`BOACO.pheromone_maps`."""
    import pandas as pd  # here, since importing it takes as long as importing all else

    graph, nodes, kinds = mission.world.graph, mission.nodes, mission.kinds
    loops = np.unique(mission.world.team.end)
    tails, heads = np.append(graph.tail, loops), np.append(graph.head, loops)
    labels = np.fromiter(nodes, object, len(nodes))
    arcs = {
        "kind": [kinds[k].name for k in tails // len(nodes)],
        "tail": labels[tails % len(nodes)],
        "head": labels[heads % len(nodes)],
    }
    maps = [
        pd.DataFrame({"robot": robot, **arcs, "reward": levels[:, 0], "survival": levels[:, 1]})
        for robot, levels in enumerate(colony.pheromone)
    ]
    table = pd.concat(maps, ignore_index=True)
    if len(kinds) == 1:
        table = table.drop(columns="kind")
    return table if colony.settings.pheromone_per_robot else table.drop(columns="robot")
