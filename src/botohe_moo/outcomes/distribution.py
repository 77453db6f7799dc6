"""Discrete distributions of outcomes, with quantiles and conditional value at risk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, overload

import numpy as np

from botohe_moo.base.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

ROUNDING = 1e-12  # relative; values and probabilities that differ by less are equal


@dataclass(frozen=True, eq=False, repr=False)
class Distribution:
    """A discrete distribution of the team reward or of the number of survivors.

    Attributes
    ----------
    values
        Possible outcomes (n_values, read-only): rewards or numbers of robots, which ascend.
    probabilities
        Probability of each value (n_values, read-only), above 0; they sum to 1.
    n_samples
        Number of simulated missions whose shares the probabilities are; None if they are exact.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo.outcomes import Distribution
    >>> reward = Distribution(np.array([0.0, 4.0, 9.0]), np.array([0.125, 0.375, 0.5]))
    >>> reward
    <Distribution: 3 values from 0 to 9, mean 6, exact>
    >>> reward.at_least(4), reward.quantile(0.5), reward.cvar(0.25)
    (0.875, 4.0, 2.0)
    """

    values: FloatArray
    probabilities: FloatArray
    n_samples: int | None = None

    def __post_init__(self) -> None:
        values, probabilities = np.array(self.values, float), np.array(self.probabilities, float)
        if values.ndim != 1 or values.size == 0 or values.shape != probabilities.shape:
            raise ValueError(
                f"Expected as many probabilities as values, at least one, got the shapes "
                f"{probabilities.shape} and {values.shape}."
            )
        if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
            raise ValueError(f"Expected finite values that ascend, got {values}.")
        if not ((probabilities > 0).all() and abs(probabilities.sum() - 1) < 1e-9):
            raise ValueError(f"Expected probabilities above 0 that sum to 1, got {probabilities}.")
        for name, array in (("values", values), ("probabilities", probabilities)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def exact(self) -> bool:
        """Whether the probabilities are computed rather than simulated."""
        return self.n_samples is None

    @property
    def mean(self) -> float:
        """Expected value."""
        return float(self.probabilities @ self.values)

    @property
    def variance(self) -> float:
        """Variance of these values with these probabilities (simulated: the divisor is n)."""
        return float(self.probabilities @ (self.values - self.mean) ** 2)

    @property
    def std(self) -> float:
        """Standard deviation."""
        return float(np.sqrt(self.variance))

    @property
    def standard_error(self) -> float:
        """Standard error of the mean: 0 when exact, nan for a single simulated mission."""
        if self.n_samples is None:
            return 0.0
        return self.std / float(np.sqrt(self.n_samples - 1)) if self.n_samples > 1 else float("nan")

    @overload
    def quantile(self, q: float) -> float: ...
    @overload
    def quantile(self, q: Sequence[float] | FloatArray) -> FloatArray: ...
    def quantile(self, q: float | Sequence[float] | FloatArray) -> float | FloatArray:
        """Return the smallest value that is not exceeded with a probability of at least ``q``.

        Parameters
        ----------
        q
            Probability in [0, 1], or any number of them; 0 gives the smallest value. A ValueError
            is raised for others.
        """
        wanted = np.asarray(q, float)
        if not np.all((wanted >= 0) & (wanted <= 1)):
            raise ValueError(f"Expected q in [0, 1], got {q}.")
        cumulative = np.cumsum(self.probabilities)
        cumulative[-1] = 1.0
        # No slack at 1: the largest value is possible, however small its probability.
        slack = np.where(wanted < 1, 1 - ROUNDING, 1)
        found = self.values[np.searchsorted(cumulative, wanted * slack)]
        return float(found) if wanted.ndim == 0 else found

    @overload
    def at_least(self, x: float) -> float: ...
    @overload
    def at_least(self, x: Sequence[float] | FloatArray) -> FloatArray: ...
    def at_least(self, x: float | Sequence[float] | FloatArray) -> float | FloatArray:
        """Return the probability that the outcome is ``x`` or more.

        Parameters
        ----------
        x
            Reward or number of robots, or any number of them; a ValueError is raised for nan. A
            value reaches ``x`` if it falls short by less than 1e-12 of it, because sums of rewards
            are rounded.
        """
        wanted = np.asarray(x, float)
        if np.isnan(wanted).any():
            raise ValueError(f"Expected x to be a number, got {x}.")
        tail = np.append(np.cumsum(self.probabilities[::-1])[::-1], 0.0)
        tail[0] = 1.0
        lowered = np.minimum(wanted * (1 - ROUNDING), wanted * (1 + ROUNDING))
        found = np.minimum(tail[np.searchsorted(self.values, lowered)], 1.0)
        return float(found) if wanted.ndim == 0 else found

    def cvar(self, alpha: float) -> float:
        """Return the conditional value at risk: the mean of the lowest share ``alpha`` of outcomes.

        If the share ends within the probability of a value, only the part within counts:
        Rockafellar and Uryasev, "Conditional value-at-risk for general loss distributions",
        Journal of Banking & Finance 26, 2002; Acerbi and Tasche, "On the coherence of expected
        shortfall", same volume.

        Parameters
        ----------
        alpha
            Share in (0, 1]; 1 gives the mean. A ValueError is raised for others.
        """
        if not 0 < alpha <= 1:
            raise ValueError(f"Expected alpha in (0, 1], got {alpha}.")
        before = np.append(0.0, np.cumsum(self.probabilities)[:-1])
        inside = np.clip(alpha - before, 0.0, self.probabilities)
        return float(inside @ self.values / inside.sum())

    def to_frame(self) -> pd.DataFrame:
        """Return the distribution as a table with the columns ``value`` and ``probability``."""
        import pandas as pd

        return pd.DataFrame({"value": self.values, "probability": self.probabilities})

    def __repr__(self) -> str:
        source = "exact" if self.n_samples is None else f"from {self.n_samples} samples"
        low, high = self.values[0], self.values[-1]
        return (
            f"<Distribution: {len(self.values)} values from {low:g} to {high:g}, "
            f"mean {self.mean:g}, {source}>"
        )
