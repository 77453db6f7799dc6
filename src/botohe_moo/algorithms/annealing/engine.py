"""Simulated annealing of weighted sums, one weight after another: no pymoo."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from botohe_moo.algorithms.annealing import kernels
from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.base.messages import check_weights
from botohe_moo.base.parameters import Count, Positive, Probability, Size
from botohe_moo.base.types import FloatArray
from botohe_moo.core.archive import Batch
from botohe_moo.core.rng import seed_states
from botohe_moo.core.world import World, find_arc
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch, TrailPlan

_WEIGHTS_A_PASS = 10  # at least: where generations are few, there are fewer passes
# If the user does not say otherwise, the temperature begins at this many times the share of the
# total reward that a node pays, and ends at a hundredth of that.
_INITIAL_TEMPERATURE, _FALL = 0.2, 0.002 / 0.2
_MOST_NODES = 4_000_000  # that a call of the kernel may record; untouched memory costs nothing


@dataclass(frozen=True, kw_only=True)
class AnnealingSettings:
    """How weights follow one another; :class:`SimulatedAnnealing` documents the parameters."""

    n_weights: Count | None = None
    weights_exponent: Probability = 1 / 3
    n_passes: Count = 4
    initial_temperature: Positive | None = None
    cooling: Annotated[float, Field(gt=0, le=1)] | None = None
    return_probability: Probability = 0.003
    every_robot: bool = False
    best_of_weights: bool = False
    moves: Mapping[str, float] | None = None
    sweep_evaluations: Size = 100_000
    steps_per_generation: Count = 1_000

    def __post_init__(self) -> None:
        if self.moves is not None:
            check_weights("moves", self.moves, kernels.MOVES, needed="move")


# What made the curves published in PeerJ Computer Science, 2025.
JOURNAL = AnnealingSettings(
    weights_exponent=1 / 2,
    n_passes=1,
    initial_temperature=0.2,
    cooling=0.95,
    return_probability=0.0,
    every_robot=True,
    best_of_weights=True,
    moves={move: weight for move, weight in kernels.MOVES.items() if move != "delete-loop"},
)


class Annealing:
    """A search that anneals one plan, for one weight after another.

    ``weight``, in [0, 1], is the weight on reward whose turn it is, and ``steps_left`` the steps
    that are left of its turn. The search's own generator takes its seed from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        world: World,
        settings: AnnealingSettings,
        *,
        random_state: np.random.Generator,
    ) -> None:
        self.mission, self.world, self.settings = mission, world, settings
        self.state = kernels.new_state(world, seed_states(random_state, 1))
        home = mission.stay_home(world)
        self._set_best(home, mission.evaluate_drafts([home])[0][0])  # no evaluation of the budget
        # A sweep is the turns of all weights, in each pass once; ``_turn`` of them have begun.
        self._n_steps, self._n_weights, self._n_turns, self._turn = 0, 1, 0, 0
        self.steps_left, self.weight = 0, 0.0

    def weights_of_moves(self) -> FloatArray:
        """Return how likely each move is to be drawn, relative to the others.

        That of detours is for one-way arcs, which the other moves can hardly use: it is multiplied
        by their share.
        """
        given = kernels.MOVES if self.settings.moves is None else self.settings.moves
        weights = np.array([given.get(move, 0.0) for move in kernels.MOVES])
        weights[kernels.DETOUR] *= (
            (self.world.graph.reverse < 0).mean() if self.world.graph.n_arcs else 0
        )
        return weights

    def best(self) -> tuple[PlanBatch, FloatArray]:
        """Return the best plan evaluated for the weight, and its E[R] and E[S] (1, 2).

        Before the first step it is the plan in which all robots stay where they start.
        """
        best, head = self.state.best, self.world.graph.head
        ends = zip(best.starts, best.stops, strict=True)
        trails = [[best.items[i], *head[best.items[i + 1 : j]]] for i, j in ends]
        batch = PlanBatch.from_plans([TrailPlan(trails)], self.mission.robots)
        return batch, best.objectives[np.newaxis].copy()

    def _set_best(self, plan: TrailPlan, objectives: FloatArray) -> None:
        best, graph = self.state.best, self.world.graph
        for robot, trail in enumerate(plan.trails):
            items = [trail[0], *(find_arc(graph, *hop) for hop in pairwise(trail))]
            start, best.stops[robot] = best.starts[robot], best.starts[robot] + len(items)
            best.items[start : best.stops[robot]] = items
        best.objectives[:] = objectives

    def begin_turn(
        self, archive: PlanArchive | None, n_left: int | None, n_generations: float
    ) -> None:
        """Begin the turn of the next weight, from the last one's best plan, or the archive's.

        The better one of these is taken; None instead of an archive leaves it out. ``n_left`` is
        how many evaluations are left, None without a limit, and ``n_generations`` how many
        generations there will be in all.
        """
        settings, state = self.settings, self.state
        if self._turn == self._n_turns:
            self._plan_sweep(n_left, n_generations)
        # Weights ascend in one pass and descend in the next. Turns differ by one step at most.
        place = self._turn % (2 * self._n_weights)
        place = min(place, 2 * self._n_weights - 1 - place)
        self.weight = place / (self._n_weights - 1) if self._n_weights > 1 else 0.5
        done, self._turn = self._n_steps * self._turn // self._n_turns, self._turn + 1
        self.steps_left = self._n_steps * self._turn // self._n_turns - done
        self._rule = kernels.AnnealRule(
            moves=np.cumsum(self.weights_of_moves()),
            every_robot=settings.every_robot,
            records=not settings.best_of_weights,
            total_reward=self.mission.total_reward or 1.0,
            weight=self.weight,
            cooling=settings.cooling or _FALL ** (1.0 / self.steps_left),
            return_probability=settings.return_probability,
        )
        if archive is not None:
            self.start_from(archive)
        for values, best in zip(state.current, state.best, strict=True):
            values[:] = best
        known = self._scores(state.best.objectives)
        state.best_score[:] = -np.inf if settings.best_of_weights else known
        shares = self.mission.rewards / self._rule.total_reward
        usual = _INITIAL_TEMPERATURE * (float(shares @ shares) or 1.0)
        state.temperature[:] = settings.initial_temperature or usual

    def _plan_sweep(self, n_left: int | None, n_generations: float) -> None:
        """Divide the steps that are left, or those of a usual sweep, into turns of weights."""
        settings, n_passes = self.settings, self.settings.n_passes
        if n_left is None and n_generations < math.inf:
            # As many turns as there will be generations, each of them one generation long.
            n_turns = max(1, int(n_generations))
            n_steps = n_turns * settings.steps_per_generation
            n_passes = min(n_passes, max(1, n_turns // _WEIGHTS_A_PASS))
            usual_weights = max(1, n_turns // n_passes)
        else:
            n_steps = settings.sweep_evaluations if n_left is None else n_left
            usual_weights = max(1, round(n_steps**settings.weights_exponent))
        self._n_steps, self._turn = n_steps, 0
        self._n_weights = min(settings.n_weights or usual_weights, n_steps)
        self._n_turns = self._n_weights * min(n_passes, n_steps // self._n_weights)

    def _scores(self, objectives: FloatArray) -> FloatArray:
        """Return the scores of plans for the weight, from their E[R] and E[S] (..., 2)."""
        return kernels.score(self._rule, self.mission.robots, *objectives.T)

    def start_from(self, archive: PlanArchive) -> None:
        """Make the archive's best plan for the weight the best one, if it is better."""
        if len(archive) == 0:
            return
        scores = self._scores(archive.objectives)
        row = int(np.argmax(scores))
        if scores[row] > self._scores(self.state.best.objectives):
            self._set_best(archive.plans[row], archive.objectives[row])

    def run(self, n_steps: int) -> tuple[PlanBatch, FloatArray]:
        """Make some of the ``steps_left`` of the weight's turn, each of which evaluates a plan.

        Returns plans that may enter the front, and their E[R] and E[S] (n, 2). These are the plans
        evaluated that neither the current nor the best plan dominated; with ``best_of_weights``,
        the best plan when the turn ends.
        """
        self.steps_left -= n_steps
        n_robots, n_nodes = self.mission.robots, len(self.state.tried.items)
        batches, objectives = [], []
        while n_steps > 0:
            n = min(n_steps, max(1, _MOST_NODES // n_nodes))
            nodes, offsets = np.empty(n * n_nodes, np.int32), np.zeros(n * n_robots + 1, np.int64)
            records = Batch(np.empty((n, 2)), nodes, offsets)
            n_recorded = kernels.anneal(self.world, self._rule, self.state, records, n)
            offsets = offsets[: n_recorded * n_robots + 1]
            batches.append(PlanBatch._wrap(nodes[: offsets[-1]], offsets, n_robots))
            objectives.append(records.objectives[:n_recorded])
            n_steps -= n
        if self.settings.best_of_weights and self.steps_left == 0:
            return self.best()
        return PlanBatch.concatenate(batches), np.concatenate(objectives)
