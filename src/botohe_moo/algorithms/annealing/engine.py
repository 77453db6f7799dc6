"""Simulated annealing of weighted sums, one weight after another: no pymoo."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from botohe_moo._base.types import FloatArray
from botohe_moo.algorithms.annealing.kernels import (
    AnnealRule,
    AnnealState,
    anneal,
    new_records,
    new_state,
    score,
)
from botohe_moo.algorithms.archive import PlanArchive
from botohe_moo.core.graph import Limits
from botohe_moo.core.rng import seed_states
from botohe_moo.core.trails import read_trails
from botohe_moo.mission.model import Mission
from botohe_moo.operators.kernels.change import MoveRule
from botohe_moo.trails import PlanBatch, TrailPlan

# How likely each kind of move is to be drawn: the published kinds, then our deletion of loops. Of
# detours ``kinds_of_moves`` says it.
_PUBLISHED_KINDS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.0)
_COOLED_KINDS = (*_PUBLISHED_KINDS[:-1], 0.1)
_MAX_TRIES = 100  # draws, before a few detours are tried
_WEIGHTS_A_PASS = 10  # at least: where generations are few, there are fewer passes
_PUBLISHED_TEMPERATURE = 0.2
_PUBLISHED_COOLING = 0.95
_RECORDS, _NODES_EACH = 1_000, 16  # plans that a call of the kernel may record, nodes of each


@dataclass(frozen=True)
class AnnealingSchedule:
    """How weights follow one another; :class:`SimulatedAnnealing` documents the parameters."""

    schedule: Literal["cooled", "journal"]
    initial_temperature: float
    final_temperature: float
    n_weights: int | None
    n_passes: int
    return_probability: float | None
    sweep_evaluations: int
    steps_per_generation: int

    @property
    def journal(self) -> bool:
        """Whether it is the published schedule."""
        return self.schedule == "journal"


class Annealing:
    """A search that anneals one plan, for one weight after another.

    ``weight``, in [0, 1], is the weight on reward whose turn it is, and ``steps_left`` the steps
    that are left of its turn. The search's own generator takes its seed from ``random_state``.
    """

    def __init__(
        self,
        mission: Mission,
        schedule: AnnealingSchedule,
        *,
        limits: Limits,
        random_state: np.random.Generator,
    ) -> None:
        self.mission, self.schedule = mission, schedule
        graph, random = mission.arrays, seed_states(random_state, 1)
        first = mission.batch([mission.stay_home(limits)])
        objectives = mission.evaluate_drafts(first)[0][0]  # no evaluation of the budget
        self.state: AnnealState = new_state(graph, read_trails(*first.arrays), objectives, random)
        longest = mission.robots * (graph.n_arcs + 1)
        self._records = new_records(mission.robots, _RECORDS, _RECORDS * _NODES_EACH + longest)
        # A sweep is the turns of all weights, in each pass once; ``_turn`` of them have begun.
        self._n_steps, self._n_weights, self._n_turns, self._turn = 0, 1, 0, 0
        self.steps_left = 0
        self.weight = 0.0
        rewards = mission.rewards / (mission.total_reward or 1.0)
        self._share = float(rewards @ rewards) or 1.0
        returning = schedule.return_probability
        if returning is None:
            returning = 0.0 if schedule.journal else 0.003
        self._rule = AnnealRule(
            moves=MoveRule(self.kinds_of_moves(), _MAX_TRIES, schedule.journal, limits),
            record=not schedule.journal,
            total_reward=mission.total_reward or 1.0,
            weight=0.0,
            cooling=1.0,
            return_probability=returning,
        )

    def kinds_of_moves(self) -> FloatArray:
        """Return how likely each kind of move is to be drawn, relative.

        For detours this is the share of one-way arcs, which the other moves can hardly use.
        """
        kinds = _PUBLISHED_KINDS if self.schedule.journal else _COOLED_KINDS
        one_way = self.mission.arrays.reverse < 0
        return np.array([*kinds, one_way.mean()] if one_way.any() else kinds)

    def best(self) -> tuple[PlanBatch, FloatArray]:
        """Return the best plan evaluated for the weight, and its E[R] and E[S] (1, 2).

        Before the first step it is the plan in which all robots stay at base.
        """
        state = self.state
        ends = zip(state.starts[state.best], state.stops[state.best], strict=True)
        plan = TrailPlan([state.nodes[start:stop].tolist() for start, stop in ends])
        batch = PlanBatch.from_plans([plan], self.mission.robots)
        return batch, state.best_objectives[np.newaxis].copy()

    def begin_turn(
        self, archive: PlanArchive | None, n_left: int | None, n_generations: float
    ) -> None:
        """Begin the turn of the next weight, from the last one's best plan, or the archive's.

        The better one of these is taken; None instead of an archive leaves it out. ``n_left`` is
        how many evaluations are left, None without a limit, and ``n_generations`` how many
        generations there will be in all.
        """
        schedule, state = self.schedule, self.state
        if self._turn == self._n_turns:
            self._plan_sweep(n_left, n_generations)
        self.weight, self.steps_left = self._plan_turn()
        self._turn += 1
        self._rule = self._rule._replace(weight=self.weight)
        if archive is not None:
            self.start_from(archive)
        state.to_best[0] = 1
        if schedule.journal:
            state.best_score[0] = -np.inf
            state.temperature[0] = _PUBLISHED_TEMPERATURE
            cooling = _PUBLISHED_COOLING
        else:
            state.best_score[:] = self._scores(state.best_objectives[np.newaxis])
            state.temperature[0] = schedule.initial_temperature * self._share
            fall = schedule.final_temperature / schedule.initial_temperature
            cooling = fall ** (1.0 / self.steps_left)
        self._rule = self._rule._replace(cooling=cooling)

    def _plan_sweep(self, n_left: int | None, n_generations: float) -> None:
        """Divide the steps that are left, or those of a usual sweep, into turns of weights."""
        schedule = self.schedule
        n_passes = 1 if schedule.journal else schedule.n_passes
        if n_left is None and n_generations < math.inf:
            # As many turns as there will be generations, each of them one generation long.
            n_turns = max(1, int(n_generations))
            n_steps = n_turns * schedule.steps_per_generation
            n_passes = min(n_passes, max(1, n_turns // _WEIGHTS_A_PASS))
            usual_weights = max(1, n_turns // n_passes)
        else:
            n_steps = schedule.sweep_evaluations if n_left is None else n_left
            root = math.isqrt(n_steps) if schedule.journal else round(n_steps ** (1 / 3))
            usual_weights = max(1, root)
        self._n_steps = n_steps
        self._n_weights = min(schedule.n_weights or usual_weights, n_steps)
        self._n_turns = self._n_weights * min(n_passes, n_steps // self._n_weights)
        self._turn = 0

    def _plan_turn(self) -> tuple[float, int]:
        """Return the weight whose turn it is, and its steps.

        Weights ascend in one pass and descend in the next. Turns differ by one step at most.
        """
        n_steps, n_weights, n_turns = self._n_steps, self._n_weights, self._n_turns
        which_pass, place = divmod(self._turn, n_weights)
        if which_pass % 2:
            place = n_weights - 1 - place
        steps = n_steps * (self._turn + 1) // n_turns - n_steps * self._turn // n_turns
        return place / (n_weights - 1) if n_weights > 1 else 0.5, steps

    def _scores(self, objectives: FloatArray) -> FloatArray:
        """Return the scores of plans for the weight, from their E[R] and E[S] (n, 2)."""
        return score(self._rule, self.mission.robots, objectives[:, 0], objectives[:, 1])

    def start_from(self, archive: PlanArchive) -> None:
        """Make the archive's best plan for the weight the best one, if it is better."""
        state, objectives = self.state, archive.objectives
        if len(archive) == 0:
            return
        scores = self._scores(objectives)
        row = int(np.argmax(scores))
        if scores[row] <= self._scores(state.best_objectives[np.newaxis])[0]:
            return
        for slot, trail in zip(state.best, archive.plans[row].trails, strict=True):
            start = state.starts[slot]
            state.stops[slot] = start + len(trail)
            state.nodes[start : start + len(trail)] = trail
        state.best_objectives[:] = objectives[row]

    def run(self, n_steps: int) -> tuple[PlanBatch, FloatArray]:
        """Make some of the ``steps_left`` of the weight's turn, each of which evaluates a plan.

        Returns plans that may enter the front, and their E[R] and E[S] (n, 2). These are the plans
        evaluated that neither the current nor the best plan dominated; with the journal's schedule,
        the best plan when the turn ends.
        """
        graph, records = self.mission.arrays, self._records
        self.steps_left -= n_steps
        batches, objectives = [], []
        while n_steps > 0:
            records.n_plans[0] = 0
            n_steps -= anneal(graph, self._rule, self.state, records, n_steps)
            n_plans = records.n_plans[0]
            offsets = records.offsets[: n_plans * self.mission.robots + 1].copy()
            nodes = records.nodes[: offsets[-1]].copy()
            batches.append(PlanBatch._wrap(nodes, offsets, self.mission.robots))
            objectives.append(records.objectives[:n_plans].copy())
        if self.schedule.journal and self.steps_left == 0:
            return self.best()
        return PlanBatch.concatenate(batches), np.concatenate(objectives)
