"""Crossovers: children that share the trails of two plans."""

from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from pymoo.core.crossover import Crossover

from botohe_moo._base.types import ObjectArray, OffsetArray, Rng
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Probability
from botohe_moo.core.kinds import kind_ranges
from botohe_moo.core.rng import draw_state
from botohe_moo.core.trails import read_trails
from botohe_moo.operators.base import check_part
from botohe_moo.operators.kernels.vary import EXCHANGE, N_PIECES, SPLICE, cross, join_pieces
from botohe_moo.operators.repair import PlanRepair, SafestPathRepair
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch


class PlanCrossover(Crossover):
    """A pymoo crossover of two trail plans.

    Parameters
    ----------
    prob
        Probability of crossing a pair of parents; otherwise the children are copies of
        their parents.
    n_offsprings
        Children of each pair.
    repair
        Makes valid plans of the children; default: :class:`SafestPathRepair`.

    Examples
    --------
    >>> from botohe_moo.operators import PlanCrossover, TrailSplice
    >>> isinstance(TrailSplice(prob=0.5, n_offsprings=1), PlanCrossover)
    True
    """

    _kind: ClassVar[int]

    @checked
    def __init__(
        self,
        *,
        prob: Probability = 0.9,
        n_offsprings: Annotated[int, Field(ge=1, le=2)] = 2,
        repair: PlanRepair | None = None,
    ) -> None:
        super().__init__(2, n_offsprings, prob=prob)
        self.plan_repair = check_part("repair", repair, PlanRepair, SafestPathRepair)

    def _kinds(self, n_pairs: int, rng: Rng) -> OffsetArray:  # noqa: ARG002
        """Return how each pair is crossed (n_pairs): ``EXCHANGE`` or ``SPLICE``."""
        return np.full(n_pairs, self._kind, np.int64)

    def _do(
        self, problem: BOTOHE, X: ObjectArray, *_: Any, random_state: Rng, **__: Any
    ) -> ObjectArray:
        mission = problem.mission
        parents, n_pairs, n_robots = mission.batch(X), X.shape[1], mission.robots
        kinds = self._kinds(n_pairs, random_state)
        if n_robots == 1:
            kinds[:] = SPLICE  # a plan has one trail, and none to share out
        pieces = np.zeros((2 * n_pairs * n_robots, N_PIECES, 2), np.int64)
        cross(
            read_trails(*parents.arrays),
            kinds,
            np.tile(np.arange(n_robots), (2, 1)),
            *kind_ranges(mission.arrays.kinds, n_robots),
            np.zeros(mission.arrays.n_nodes, np.int64),
            draw_state(random_state),
            pieces,
        )
        drafts = PlanBatch._wrap(*join_pieces(parents.arrays[0], pieces), n_robots)
        if self.n_offsprings == 1:
            drafts = drafts[::2]
        children = self.plan_repair.repair_batch(mission, drafts).to_array()
        return children.reshape(n_pairs, self.n_offsprings, 1).swapaxes(0, 1)


class TrailExchange(PlanCrossover):
    """Children that share out whole trails.

    The first child gets a random part of the first parent's trails, and the rest at random from the
    second parent; the second child gets what is left. The trails of a single robot are spliced, as
    in :class:`TrailSplice`.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.operators import TrailExchange
    >>> crossover = TrailExchange()
    >>> solve("toy", "nsga2", crossover=crossover, pop_size=20, evaluations=200).evaluations
    200
    """

    _kind = EXCHANGE


class TrailSplice(PlanCrossover):
    """Children in which a trail of one parent continues as a trail of the other.

    Of each parent a trail is drawn among those that leave the base, and a node that both visit. The
    children swap what comes after it. Trails that share no node but the base are swapped whole.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.operators import TrailSplice
    >>> crossover = TrailSplice(prob=0.8)
    >>> solve("toy", "nsga2", crossover=crossover, pop_size=20, evaluations=200).evaluations
    200
    """

    _kind = SPLICE


class MixedCrossover(PlanCrossover):
    """Exchange of whole trails or splice, drawn for each pair.

    Parameters
    ----------
    prob_splice
        Probability of a splice rather than an exchange.
    **options
        As for :class:`PlanCrossover`: ``prob``, ``n_offsprings`` and ``repair``.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.operators import MixedCrossover
    >>> crossover = MixedCrossover(prob_splice=0.7)
    >>> solve("toy", "nsga2", crossover=crossover, pop_size=20, evaluations=200).evaluations
    200
    """

    @checked
    def __init__(self, *, prob_splice: Probability = 0.5, **options: Any) -> None:
        super().__init__(**options)
        self.prob_splice = prob_splice

    def _kinds(self, n_pairs: int, rng: Rng) -> OffsetArray:
        return np.where(rng.random(n_pairs) < self.prob_splice, SPLICE, EXCHANGE).astype(np.int64)
