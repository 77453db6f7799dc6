"""Simulated annealing of weighted sums, one weight after another."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field

from botohe_moo.algorithms import base
from botohe_moo.algorithms.annealing import kernels
from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies, PlanArchive
from botohe_moo.base.parameters import Count, Positive, Probability, Size, check_weights
from botohe_moo.base.types import FloatArray, ObjectArray, Rng
from botohe_moo.core.rng import seed_states
from botohe_moo.core.world import World, find_arc
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
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
        self, mission: Mission, world: World, settings: AnnealingSettings, *, random_state: Rng
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
        one_way = self.world.graph.reverse < 0
        weights[kernels.DETOUR] *= one_way.mean() if len(one_way) else 0
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
            records = kernels.Records(np.empty((n, 2)), nodes, offsets)
            n_recorded = kernels.anneal(self.world, self._rule, self.state, records, n)
            offsets = offsets[: n_recorded * n_robots + 1]
            batches.append(PlanBatch._wrap(nodes[: offsets[-1]], offsets, n_robots))
            objectives.append(records.objectives[:n_recorded])
            n_steps -= n
        if self.settings.best_of_weights and self.steps_left == 0:
            return self.best()
        return PlanBatch.concatenate(batches), np.concatenate(objectives)


class SimulatedAnnealing(ArchiveAlgorithm):
    """Simulated annealing of a weighted sum of the objectives, for one weight after another.

    Every step changes a trail by a move and scores the plan with
    weight · E[R] / (total reward) + (1 − weight) · E[S] / (robots). The temperature falls
    geometrically during the steps of a weight. :meth:`journal` gives the published settings.

    Parameters
    ----------
    n_weights
        Number of weights; default: ``N ** weights_exponent`` for a sweep of N evaluations.
    weights_exponent
        How that number grows with the evaluations.
    n_passes
        How often a sweep goes through the weights, up and down in turns.
    initial_temperature
        The temperature at which each weight begins, in the unit of scores; default: 0.2 times the
        share of the total reward that a node pays (the mean share, weighted by reward).
    cooling
        The factor by which the temperature falls at each step; default: so that it falls to a
        hundredth within the steps of a weight.
    return_probability
        Probability that a rejected step ends at the weight's best plan.
    every_robot
        Whether a step changes every robot's trail, rather than that of one drawn at random.
    best_of_weights
        Whether the result has only the best plan evaluated for each weight, from which the next
        weight starts, rather than all non-dominated plans evaluated.
    moves
        How likely each move is drawn, relative to the others: a mapping from names. A move that is
        not named is not drawn. The weight of ``detour`` is multiplied by the share of arcs without
        a reverse. Default: ``insert``, ``delete``, ``substitute`` or ``swap`` nodes, ``grab`` a
        neighbour and come straight back, ``delete-segment`` and ``detour`` 1; ``reverse`` and
        ``delete-loop`` 0.1.
    sweep_evaluations
        Evaluations of a sweep where the termination limits neither evaluations nor
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
    The first seven moves and :meth:`journal` are those of Simon, Richley, Overbey and Perez-Lavin,
    PeerJ Computer Science, 2025. The text has a rejected step return to the best plan with
    probability 0.05, but runs which never do meet the published curve of the art museum: with 0 the
    mean areas at 1 024, 10 000, 99 856 and 1 000 000 evaluations (12 runs or more) are 0.2, 0.1,
    0.0 and 0.6 published standard deviations off, with 0.05 they are 0.0, 1.1, 2.1 and 3.6. The
    start of a weight is not among the plans whose best is the weight's: if it were, areas would be
    1.0, 6.7 and 19 published deviations too low from 10 000 evaluations on.

    The defaults were found by experiment from 1 000 to 1 000 000 evaluations. It pays most to
    change one trail a step, and to start weights from plans found before. Temperatures follow the
    share of the reward that a node pays: those that suit 27 nodes keep a plan for 200 from growing.
    Four short passes beat one long one where plans take many steps to grow.

    A move after which a robot would not keep the problem's limits is drawn again before anything is
    evaluated. The first weight starts with everybody at base, or from the best of the plans to
    start from. Where a sweep has ended and pymoo asks for more, another one begins.

    The published moves need arcs there and back. A detour leaves the trail for a node and returns
    to the same place or a later one, along safest paths over arcs that the trail has not taken. On
    the journal's missions none is drawn, unless a hundred other draws could not be made.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, SimulatedAnnealing, area_indicator, load_mission
    >>> toy = load_mission("toy")
    >>> algorithm = SimulatedAnnealing(n_weights=5)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> result.algorithm.evaluator.n_eval
    200
    """

    evaluates_in_kernels = True

    @base.tuned_by(AnnealingSettings)
    def __init__(
        self,
        *,
        max_ties: MaxTies = 1_000,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(max_ties=max_ties, sampling=sampling, **options)

    @classmethod
    def journal(cls, **parameters: Any) -> Self:
        """Return the annealing that made the curves published in PeerJ Computer Science, 2025.

        For a budget of N evaluations it goes once through √N weights of √N steps. A step changes
        every robot's trail, loops are not deleted, and the temperature falls from 0.2 by the factor
        0.95 a step. The result has the best plans of the weights.

        Parameters
        ----------
        **parameters
            Parameters of the class, in place of that version's.

        Examples
        --------
        >>> from botohe_moo import SimulatedAnnealing
        >>> SimulatedAnnealing.journal().cooling
        0.95
        """
        return cls(**{**asdict(JOURNAL), **parameters})

    def _setup(self, problem: BOTOHE, **_: Any) -> None:
        super()._setup(problem)
        settings = AnnealingSettings(**base.settings_of(self, AnnealingSettings))
        mission, rng = problem.mission, self.random_state
        self._search = Annealing(mission, problem.world, settings, random_state=rng)

    def _advance(self, **_: Any) -> None:
        search, best_only = self._search, self.best_of_weights
        if not best_only and len(self.archive) == 0:
            self.evaluate_plans(search.best()[0][: self.n_left])
        n_left = self.n_left
        if n_left == 0:
            return
        if search.steps_left == 0:
            search.begin_turn(
                self.archive if not best_only or self.sampling else None,
                n_left if n_left < sys.maxsize else None,
                base.generation_limit(self.termination),
            )
        n_steps = min(n_left, search.steps_left, self.steps_per_generation)
        self.archive.insert(*search.run(n_steps))
        self.evaluator.n_eval += n_steps

    def _finalize(self) -> None:
        if self.best_of_weights and self._search.steps_left > 0:  # ended by something else
            self.archive.insert(*self._search.best())
