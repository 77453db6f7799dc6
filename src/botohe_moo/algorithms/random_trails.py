"""Random trail plans, the least a search must beat."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

from botohe_moo._base.types import ObjectArray
from botohe_moo._plugins import SameResult
from botohe_moo.algorithms.bo_aco import BOACO
from botohe_moo.trails import TrailPlan

__all__ = ["RandomTrails"]


class RandomTrails(BOACO):
    """Ants without heuristics and pheromone: every unused arc is equally likely.

    Parameters
    ----------
    n_ants
        Plans per iteration, from 1 to 1 000 000.
    n_threads
        Threads that build plans, from 1 to 1 024; the result does not depend on it.
    sampling
        Trail plans to start from, as for :class:`BOACO`.
    **options
        pymoo's own, as for :class:`BOACO`.

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.
    """

    def __init__(
        self,
        *,
        n_ants: int = 100,
        n_threads: Annotated[int, SameResult()] = 1,
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
