"""Simulated annealing of weighted sums, one weight after another."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from botohe_moo._base.checks import ParameterError
from botohe_moo._base.types import FloatArray, IntArray, ObjectArray, OffsetArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.ranges import Count, Positive, Probability
from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies, generation_limit
from botohe_moo.kernels.anneal import schedule as kernels
from botohe_moo.kernels.rng import seed_states
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, TrailPlan

__all__ = ["SimulatedAnnealing"]

# How likely each kind of move is to be drawn: the published ones, and our deletion of loops;
# ``_kinds_of_moves`` adds detours.
_PUBLISHED_KINDS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.0)
_COOLED_KINDS = (*_PUBLISHED_KINDS[:-1], 0.1)
_MAX_TRIES = 100  # draws, before a few detours are tried
_WEIGHTS_A_PASS = 10  # at least, where generations are few
_PUBLISHED_TEMPERATURE = 0.2
_PUBLISHED_COOLING = 0.95
# Where a kernel's figures hold E[R] and E[S] of the plan the search is at, and of the best one.
HERE = slice(kernels.REWARD, kernels.SURVIVORS + 1)
BEST = slice(kernels.BEST_REWARD, kernels.BEST_SURVIVORS + 1)


class SimulatedAnnealing(ArchiveAlgorithm):
    """Simulated annealing of a weighted sum of the objectives, for one weight after another.

    Every step changes trails by moves (insert, delete, substitute or swap nodes, grab a neighbour,
    delete a segment or a loop, reverse; a detour where arcs are one-way) and scores the plan with
    weight · E[R] / (total reward) + (1 − weight) · E[S] / (robots).

    Parameters
    ----------
    schedule
        ``"cooled"``: the temperature falls geometrically, by as much whatever the budget. A step
        changes one robot's trail; the result are all non-dominated plans evaluated.
        ``"journal"``: as published. √N weights of √N steps for a budget of N evaluations; a step
        changes every robot's trail; the temperature starts at 0.2 and falls by the factor 0.95 a
        step; the result are the non-dominated ones among the best plans of the weights.
    initial_temperature, final_temperature
        Of the cooled schedule, for each weight, in shares of the total reward that a node pays (the
        mean share, weighted by reward). The final one is at most the initial one.
    n_weights
        Number of weights; default: the cube root of the sweep's evaluations, the square root for
        the journal's schedule.
    n_passes
        How often the cooled schedule goes through the weights, up and down in turns.
    return_probability
        Probability that a rejected step ends at the weight's best plan; default: 0.003, for the
        journal's schedule 0.
    sweep_evaluations
        Evaluations the schedule is made for where the termination limits neither evaluations nor
        generations.
    steps_per_generation
        Steps in one pymoo generation; a generation ends with its weight.
    max_ties
        Plans with equal objectives but different trails that the archive keeps.
    sampling
        Trail plans to start from: an iterable of plans, or ``X`` of another result.
    **options
        pymoo's own: ``termination``, ``callback``, ``output``, ``save_history``, ``seed``, ...

    Raises
    ------
    TypeError
        If an option is unknown, ``sampling`` holds anything but plans, or the problem is not a
        :class:`BOTOHE` or overrides ``evaluate_batch`` or ``constrain_batch``, which a search that
        evaluates inside a kernel cannot see.

    Attributes
    ----------
    archive : PlanArchive
        The result so far (``plans``, ``objectives``).

    Notes
    -----
    The journal's schedule and the moves are those of Simon, Richley, Overbey and Perez-Lavin, PeerJ
    Computer Science, 2025. The text has a rejected step return to the best plan with probability
    0.05, but the published curve of the art museum is met by runs which never do: with 0 the mean
    areas at 1 024, 10 000, 99 856 and 1 000 000 evaluations (12 runs or more) are 0.2, 0.1, 0.0 and
    0.6 published standard deviations off, with 0.05 they are 0.0, 1.1, 2.1 and 3.6. Hence 0 is the
    default. The best plan of a weight is the best one evaluated for it, its start not among them.

    The cooled schedule's settings were found by experiment on the art museum, the power plant,
    terrain and generated missions, from 1 000 to 1 000 000 evaluations. It pays most to change one
    trail a step, and to start weights from plans found before, not from the base. Temperatures have
    to follow the share of the reward that a node pays: those that suit 27 nodes keep a plan for 200
    from growing. Four short passes beat one long one where plans take many steps to grow, and
    weights that grow in number as the cube root leave each of them time enough to cool.

    A move that would take a robot below the survival floor is drawn again before anything is
    evaluated, so that every plan evaluated is feasible. The first weight starts with everybody at
    base, or from the best of the plans to start from. Where the schedule has run out and pymoo asks
    for more, another sweep begins.

    The published moves join what they leave by arcs there and back. A ninth move, a detour, works
    wherever there is a trail: it leaves the trail for a node and returns to the same place or a
    later one, along safest paths over arcs that the trail has not taken. It is drawn as often as
    another move times the share of arcs without a reverse, with both schedules: where every arc has
    a reverse, as in the journal's missions, never, unless a hundred draws could not be made.
    """

    evaluates_in_kernels = True

    @checked
    def __init__(
        self,
        *,
        schedule: Literal["cooled", "journal"] = "cooled",
        initial_temperature: Positive = 0.2,
        final_temperature: Positive = 0.002,
        n_weights: Count | None = None,
        n_passes: Count = 4,
        return_probability: Probability | None = None,
        sweep_evaluations: Annotated[int, Field(ge=1)] = 100_000,
        steps_per_generation: Count = 1_000,
        max_ties: MaxTies = 1_000,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=max_ties, sampling=sampling, **options)
        if final_temperature > initial_temperature:
            expected = f"final_temperature <= initial_temperature = {initial_temperature}"
            message = f"Expected {expected}, got {final_temperature}."
            raise ParameterError(message, "final_temperature")
        self.schedule = schedule
        self.initial_temperature = initial_temperature
        self.final_temperature = final_temperature
        self.n_weights = n_weights
        self.n_passes = n_passes
        self.return_probability = return_probability
        self.sweep_evaluations = sweep_evaluations
        self.steps_per_generation = steps_per_generation

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        mission, arrays = problem.mission, problem.mission.arrays
        shape = (mission.robots, arrays.n_arcs + 1)
        # The plan the search is at, and the best one: trails in rows, and their lengths.
        self._current: tuple[IntArray, OffsetArray] = (
            np.full(shape, arrays.base, np.int32),
            np.ones(mission.robots, np.int64),
        )
        self._best = (self._current[0].copy(), self._current[1].copy())
        self._figures: FloatArray = np.zeros(kernels.N_FIGURES)
        self._figures[BEST] = self._figures[HERE] = arrays.reward[arrays.base], mission.robots
        self._states = seed_states(self.random_state, 1)
        self._sweep = (0, 1, 0)  # its steps, weights, and passes through them
        self._leg = self._steps_left = 0  # how often a weight has begun, and what is left of this
        self._weight, self._cooling = 0.0, 1.0
        shares = arrays.reward / (mission.total_reward or 1.0)
        self._share = float(shares @ shares) or 1.0
        self._kinds = self._kinds_of_moves()

    def _kinds_of_moves(self) -> FloatArray:
        """Detours are as likely as there are one-way arcs, which the other moves can hardly use."""
        kinds = _PUBLISHED_KINDS if self.schedule == "journal" else _COOLED_KINDS
        graph = self.problem.mission.graph
        n_one_way = sum(not graph.has_edge(head, tail) for tail, head in graph.edges)
        return np.array([*kinds, n_one_way / len(graph.edges)] if n_one_way else kinds)

    def _advance(self, **_: Any) -> None:
        journal = self.schedule == "journal"
        if not journal and len(self.archive) == 0:
            self._take_in(_batch(*self._best)[: self._n_left()])
        n_left = self._n_left()
        if n_left == 0:
            return
        if self._steps_left == 0:
            self._begin_weight(n_left)
        n_steps = min(n_left, self._steps_left, self.steps_per_generation)
        batch, objectives = self._anneal(n_steps)
        self.evaluator.n_eval += n_steps
        self._steps_left -= n_steps
        if not journal:
            self.archive.absorb(batch, objectives)
        elif self._steps_left == 0:
            self._archive_best()

    def _finalize(self) -> None:
        if self.schedule == "journal" and self._steps_left > 0:  # ended by something else
            self._archive_best()

    def _archive_best(self) -> None:
        self.archive.absorb(_batch(*self._best), self._figures[np.newaxis, BEST].copy())

    def _begin_weight(self, n_left: int) -> None:
        journal = self.schedule == "journal"
        if self._leg == self._sweep[1] * self._sweep[2]:
            self._plan_sweep(n_left)
        self._weight, self._steps_left = self._plan_leg()
        self._leg += 1
        figures = self._figures
        if not journal or self.sampling:
            self._best_from_archive()
        _copy(self._best, self._current)
        figures[HERE] = figures[BEST]
        if journal:
            figures[kernels.BEST_SCORE] = -np.inf
            figures[kernels.TEMPERATURE] = _PUBLISHED_TEMPERATURE
            self._cooling = _PUBLISHED_COOLING
            return
        figures[kernels.BEST_SCORE] = self._scores(figures[np.newaxis, BEST])[0]
        figures[kernels.TEMPERATURE] = self.initial_temperature * self._share
        fall = self.final_temperature / self.initial_temperature
        self._cooling = fall ** (1.0 / self._steps_left)

    def _plan_sweep(self, n_left: int) -> None:
        journal = self.schedule == "journal"
        n_passes = 1 if journal else self.n_passes
        generations = generation_limit(self.termination)
        if n_left == sys.maxsize and generations < math.inf:
            # A generation for each turn of a weight, as many as there will be.
            n_generations = max(1, int(generations))
            n_steps = n_generations * self.steps_per_generation
            n_passes = min(n_passes, max(1, n_generations // _WEIGHTS_A_PASS))
            usual = max(1, n_generations // n_passes)
        else:
            n_steps = n_left if n_left < sys.maxsize else self.sweep_evaluations
            usual = math.isqrt(n_steps) if journal else max(1, round(n_steps ** (1 / 3)))
        n_weights = min(self.n_weights or usual, n_steps)
        n_passes = min(n_passes, n_steps // n_weights)
        self._sweep = (n_steps, n_weights, n_passes)
        self._leg = 0

    def _plan_leg(self) -> tuple[float, int]:
        """Give the weight whose turn it is, and its steps: they differ by one at most."""
        n_steps, n_weights, n_passes = self._sweep
        n_legs = n_weights * n_passes
        downward, place = divmod(self._leg, n_weights)
        if downward % 2:
            place = n_weights - 1 - place
        steps = n_steps * (self._leg + 1) // n_legs - n_steps * self._leg // n_legs
        return place / (n_weights - 1) if n_weights > 1 else 0.5, steps

    def _scores(self, objectives: FloatArray) -> FloatArray:
        mission = self.problem.mission
        rewards = objectives[:, 0] / (mission.total_reward or 1.0)
        survivors = objectives[:, 1] / mission.robots
        scores: FloatArray = self._weight * rewards + (1.0 - self._weight) * survivors
        return scores

    def _best_from_archive(self) -> None:
        """Put the archive's best plan for the weight in the best one's place, if it is better."""
        objectives = self.archive.objectives
        scores = self._scores(np.vstack([self._figures[np.newaxis, BEST], objectives]))
        row = int(np.argmax(scores)) - 1
        if row < 0:
            return
        trails, lengths = self._best
        plan = self.archive.plans[row]
        for robot, (start, stop) in enumerate(pairwise(plan.offsets.tolist())):
            lengths[robot] = stop - start
            trails[robot, : stop - start] = plan.nodes[start:stop]
        self._figures[BEST] = objectives[row]

    def _anneal(self, n_steps: int) -> tuple[PlanBatch, FloatArray]:
        mission, arrays = self.problem.mission, self.problem.mission.arrays
        journal = self.schedule == "journal"
        returning = 0.0 if journal else 0.003
        if self.return_probability is not None:
            returning = self.return_probability
        nodes, offsets, objectives = kernels.anneal(
            arrays.first,
            arrays.head,
            arrays.survival,
            arrays.reward,
            arrays.base,
            self.problem.planning_floor,
            self._kinds,
            _MAX_TRIES,
            journal,
            mission.total_reward or 1.0,
            self._weight,
            self._cooling,
            returning,
            n_steps,
            not journal,
            *self._current,
            *self._best,
            self._figures,
            self._states,
        )
        return PlanBatch._wrap(nodes, offsets, mission.robots), objectives


def _batch(trails: IntArray, lengths: OffsetArray) -> PlanBatch:
    nodes = np.concatenate([trail[:n] for trail, n in zip(trails, lengths, strict=True)])
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    return PlanBatch._wrap(nodes, offsets, len(lengths))


def _copy(source: tuple[IntArray, OffsetArray], target: tuple[IntArray, OffsetArray]) -> None:
    target[0][...], target[1][...] = source
