"""SPEA2 with operators for trail plans."""

from __future__ import annotations

from typing import Any

from pymoo.algorithms.moo.spea2 import SPEA2, SPEA2Survival

from botohe_moo.algorithms.population import PopulationAlgorithm, genetic_sizes

__all__ = ["PlanSPEA2"]


class PlanSPEA2(PopulationAlgorithm, SPEA2):
    """SPEA2 with operators for trail plans.

    Parameters
    ----------
    pop_size
        Plans in the population, at least 2.
    n_offsprings
        Plans that a generation adds, at least 1; default: as many as the population holds.
    **options
        Operators, as for :class:`PopulationAlgorithm`, and pymoo's own options.

    Raises
    ------
    ValueError
        If a parameter is out of its range, or a name unknown.
    TypeError
        If an option is unknown, or the problem is not a :class:`BOTOHE`.

    Notes
    -----
    Zitzler, Laumanns and Thiele, "SPEA2: improving the strength Pareto evolutionary algorithm",
    TIK report 103, ETH Zurich, 2001.
    """

    def __init__(
        self, *, pop_size: int = 100, n_offsprings: int | None = None, **options: Any
    ) -> None:
        # Of their own: those that pymoo's signature holds remember the fronts of other runs.
        arguments = genetic_sizes(pop_size, n_offsprings)
        super().__init__({**arguments, "survival": SPEA2Survival(normalize=True)}, **options)
