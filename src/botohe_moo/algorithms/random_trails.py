"""Random trail plans, the least a search must beat."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from botohe_moo._base.types import ObjectArray
from botohe_moo._plugins.types import Count
from botohe_moo.algorithms.bo_aco import BOACO, Threads
from botohe_moo.trails import TrailPlan


class RandomTrails(BOACO):
    """Ants without heuristics and pheromone: every unused arc is equally likely.

    Parameters
    ----------
    n_ants
        Plans per iteration.
    n_threads
        Threads that build plans; the result does not depend on it.
    sampling
        Trail plans to start from, as for :class:`BOACO`.
    **options
        pymoo's own, as for :class:`BOACO`.

    Examples
    --------
    >>> from pymoo.optimize import minimize
    >>> from botohe_moo import BOTOHE, RandomTrails, area_indicator, load_mission
    >>> toy = load_mission("toy")
    >>> algorithm = RandomTrails(n_ants=50)
    >>> result = minimize(BOTOHE(toy), algorithm, ("n_eval", 200), seed=1)
    >>> result.algorithm.evaluator.n_eval
    200
    """

    def __init__(
        self,
        *,
        n_ants: Count = 100,
        n_threads: Threads = 1,
        sampling: Iterable[TrailPlan] | ObjectArray | None = None,
        **options: Any,
    ) -> None:
        super().__init__(
            n_ants=n_ants,
            heuristic=False,
            pheromone=False,
            n_threads=n_threads,
            sampling=sampling,
            **options,
        )
