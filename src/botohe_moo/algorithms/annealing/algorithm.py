"""Simulated annealing of weighted sums, one weight after another."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import asdict
from typing import Any, Self

from botohe_moo.algorithms import base
from botohe_moo.algorithms.annealing.engine import JOURNAL, Annealing, AnnealingSettings
from botohe_moo.algorithms.base import ArchiveAlgorithm, MaxTies
from botohe_moo.base.types import ObjectArray
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import TrailPlan


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
        self._search = Annealing(
            problem.mission, problem.world, settings, random_state=self.random_state
        )

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
