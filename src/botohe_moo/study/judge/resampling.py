"""Statistics by resampling: an interval of a median, and a test of ranks over blocks."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from botohe_moo._base.checks import check_number
from botohe_moo._base.types import FloatArray
from botohe_moo.study.judge.pairs import check_sample

__all__ = ["friedman", "generator_for", "median_interval"]

N_RESAMPLES = 9_999
_SEED = 20_250
_BATCH = 1_000  # resamples at a time: memory, not the result


def generator_for(values: ArrayLike) -> np.random.Generator:
    """Give a generator that depends on nothing but the values, for resampling them.

    The same sample has the same interval in every study, whatever else is in it.

    Parameters
    ----------
    values
        The sample; its order counts.
    """
    content = np.ascontiguousarray(check_sample("values", values), "<f8").tobytes()
    digest = np.frombuffer(hashlib.sha256(content).digest(), "<u4")
    return np.random.default_rng([_SEED, *digest.tolist()])


def median_interval(
    values: ArrayLike, *, confidence: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Give the median and its bootstrap percentile interval.

    Parameters
    ----------
    values
        Shape (n,), n >= 1, in any order.
    confidence
        How often the interval is to hold the median, in (0, 1).
    rng
        Draws the 9 999 resamples.

    Returns
    -------
    tuple of float
        The median, the lower and the upper end of the interval. They are all the same for a single
        value and for equal values.

    Raises
    ------
    ValueError
        If there are no values, or one of them is NaN or infinite, or ``confidence`` is out of
        range.

    Notes
    -----
    Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, chapter 13; by
    ``scipy.stats.bootstrap``. For very few runs the interval is too narrow: that of two runs holds
    the median of their distribution half of the time.
    """
    sample = np.sort(check_sample("values", values))
    level = check_number("confidence", confidence, above=0.0, below=1.0)
    median = float(np.median(sample))
    if sample[0] == sample[-1]:
        return median, median, median
    found = stats.bootstrap(
        (sample,),
        np.median,
        n_resamples=N_RESAMPLES,
        batch=_BATCH,
        vectorized=True,
        confidence_level=level,
        method="percentile",
        rng=rng,
    ).confidence_interval
    # Where a percentile is interpolated, rounding can take it past the values, and the median.
    low = min(max(float(found.low), float(sample[0])), median)
    high = max(min(float(found.high), float(sample[-1])), median)
    return median, low, high


def friedman(
    blocks: ArrayLike, *, rng: np.random.Generator
) -> tuple[float, float] | tuple[None, None]:
    """Test whether treatments rank differently over blocks.

    Parameters
    ----------
    blocks
        Shape (n_blocks, n_treatments), at least 3 treatments.
    rng
        Draws permutations, where there are too many of them to go through.

    Returns
    -------
    tuple of float
        Friedman's statistic and its p-value; both None where all treatments are tied in every
        block, and there is nothing to test.

    Raises
    ------
    ValueError
        If the shape is another.

    Notes
    -----
    Friedman, "The use of ranks to avoid the assumption of normality implicit in the analysis of
    variance", Journal of the American Statistical Association 32, 1937; the statistic is that of
    ``scipy.stats.friedmanchisquare``. Its chi-squared approximation is poor for few blocks: the
    p-value is that of a permutation test within blocks, by ``scipy.stats.permutation_test``, over
    all permutations where there are at most 9 999, and over as many random ones otherwise.
    """
    table = np.asarray(blocks, np.float64)
    if table.ndim != 2 or table.shape[1] < 3 or not len(table):
        raise ValueError(f"Expected blocks of shape (n, 3 or more), got {table.shape}.")
    ranks = stats.rankdata(table, axis=1)
    if (ranks == ranks[:, :1]).all():
        return None, None
    statistic = stats.friedmanchisquare(*table.T).statistic
    tested = stats.permutation_test(
        tuple(ranks.T),
        _sum_of_squares,
        permutation_type="samples",
        alternative="greater",
        vectorized=True,
        n_resamples=N_RESAMPLES,
        batch=_BATCH,
        rng=rng,
    )
    return float(statistic), float(tested.pvalue)


def _sum_of_squares(*ranks: FloatArray, axis: int) -> Any:
    """Give what Friedman's statistic grows with; the rest of it does not change by permuting."""
    return sum(of_one.sum(axis=axis) ** 2 for of_one in ranks)
