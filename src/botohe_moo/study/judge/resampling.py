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

N_RESAMPLES = 9_999
_SEED = 20_250
_BATCH = 1_000  # resamples at a time: memory, not the result


def generator_for(values: ArrayLike) -> np.random.Generator:
    """Give a generator seeded by the values (in their order), to resample them.

    So a sample has the same interval in every study.
    """
    content = np.ascontiguousarray(check_sample("values", values), "<f8").tobytes()
    digest = np.frombuffer(hashlib.sha256(content).digest(), "<u4")
    return np.random.default_rng([_SEED, *digest.tolist()])


def median_interval(
    values: ArrayLike, *, confidence: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Give the median of values (n,), and both ends of its bootstrap percentile interval.

    All three are the same for a single value and for equal values.

    Raises a ValueError if there are no values, or one of them is NaN or infinite, or ``confidence``
    is out of range.

    Notes
    -----
    Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, chapter 13; by
    ``scipy.stats.bootstrap``. For very few runs the interval is too narrow: that of two runs
    contains the median of their distribution half of the time.
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
    # Interpolated percentiles may lie beyond the values, or the median, by rounding.
    low = min(max(float(found.low), float(sample[0])), median)
    high = max(min(float(found.high), float(sample[-1])), median)
    return median, low, high


def friedman(
    blocks: ArrayLike, *, rng: np.random.Generator
) -> tuple[float, float] | tuple[None, None]:
    """Test whether treatments rank differently over blocks (n_blocks, n_treatments >= 3).

    Gives Friedman's statistic and its p-value; both are None if all treatments are tied in every
    block, and there is nothing to test.

    Raises a ValueError if the shape is another.

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
    """Give the part of Friedman's statistic that permutations change."""
    return sum(of_one.sum(axis=axis) ** 2 for of_one in ranks)
