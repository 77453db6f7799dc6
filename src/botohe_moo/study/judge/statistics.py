"""Statistics of samples: tests, effect sizes and intervals."""

import hashlib
import math

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, stats

N_RESAMPLES = 9_999
_SEED = 20_250
_BATCH = 1_000  # resamples at a time, on which memory depends, but not the result


def a12(x: ArrayLike, y: ArrayLike) -> float:
    """Return the probability that a value of ``x`` is larger than one of ``y``, ties counted half.

    The effect size of Vargha and Delaney, "A critique and improvement of the CL common language
    effect size statistics of McGraw and Wong", Journal of Educational and Behavioral Statistics
    25(2), 2000.

    >>> a12([3, 4, 5], [1, 2, 3])
    0.9444444444444444
    """
    return float(np.heaviside(np.subtract.outer(x, y), 0.5).mean())


def a12_interval(x: ArrayLike, y: ArrayLike, *, confidence: float) -> tuple[float, float]:
    """Return the ends of the score interval of A12, which is informative even where A12 is 0 or 1.

    Method 5 of Newcombe, "Confidence intervals for an effect size measure based on the
    Mann-Whitney statistic. Part 2: asymptotic methods and evaluation", Statistics in Medicine
    25(4), 2006. The ends are the t with (A12 - t)² = z² V(t), where V is the variance of Hanley
    and McNeil with both sample sizes in its numerator replaced by their mean:
    V(t) = t (1 - t) (1 + s (1 - t) / (2 - t) + s t / (1 + t)) / (n m), s = (n + m) / 2 - 1.
    """
    estimate = a12(x, y)
    n, m = np.size(x), np.size(y)
    z = float(stats.norm.ppf((1.0 + confidence) / 2.0))
    # V(t) = V(1 - t), so the upper end is the lower one of the other sample.
    return _lower_end(estimate, n, m, z), 1.0 - _lower_end(1.0 - estimate, n, m, z)


def _lower_end(estimate: float, n: int, m: int, z: float) -> float:
    mean = (n + m) / 2 - 1

    def excess(t: float) -> float:
        if estimate == 1.0:
            # Both sides divided by 1 - t, which removes the trivial root.
            distance, share = 1.0 - t, t
        else:
            distance, share = (estimate - t) ** 2, t * (1.0 - t)
        spread = 1.0 + mean * (1.0 - t) / (2.0 - t) + mean * t / (1.0 + t)
        return distance - z**2 * share * spread / (n * m)

    return float(optimize.brentq(excess, 0.0, estimate, xtol=1e-12)) if estimate > 0 else 0.0


def mann_whitney(x: ArrayLike, y: ArrayLike) -> float:
    """Return the p-value of the two-sided Mann-Whitney test.

    Exact where one sample has at most 8 values and none are tied, by the normal approximation
    otherwise, as scipy decides; 1 where all values are equal.

    Mann and Whitney, "On a test of whether one of two random variables is stochastically larger
    than the other", Annals of Mathematical Statistics 18(1), 1947; by
    ``scipy.stats.mannwhitneyu``.
    """
    first, second = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if np.ptp(np.concatenate([first, second])) == 0:
        return 1.0
    p_value = stats.mannwhitneyu(first, second, alternative="two-sided", method="auto").pvalue
    # For few values with ties, the approximation falls below the p-value of any arrangement:
    # 3 ones against 3 zeros would be significant at 0.05, although 1 in 10 arrangements are as far
    # apart.
    return float(max(p_value, smallest_p(len(first), len(second))))


def smallest_p(n: int, m: int) -> float:
    """Return the smallest p-value of a two-sided Mann-Whitney test of n and m values.

    It is 2 / binomial(n + m, n): all values of one sample are above all of the other.
    """
    return 2 / math.comb(n + m, n)


def generator_for(values: ArrayLike) -> np.random.Generator:
    """Return a generator seeded by the values, in their order, to resample them.

    A sample then has the same interval in every study.
    """
    content = np.ascontiguousarray(values, "<f8").tobytes()
    digest = np.frombuffer(hashlib.sha256(content).digest(), "<u4")
    return np.random.default_rng([_SEED, *digest.tolist()])


def median_interval(
    values: ArrayLike, *, confidence: float, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Return the median of values (n,), and both ends of its bootstrap percentile interval.

    All three are the same for a single value and for equal values.

    Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, chapter 13; by
    ``scipy.stats.bootstrap``. For very few runs the interval is too narrow: that of two runs
    contains the median of their distribution half of the time.
    """
    sample = np.sort(np.asarray(values, np.float64))
    median = float(np.median(sample))
    if sample[0] == sample[-1]:
        return median, median, median
    interval = stats.bootstrap(
        (sample,),
        np.median,
        n_resamples=N_RESAMPLES,
        batch=_BATCH,
        vectorized=True,
        confidence_level=confidence,
        method="percentile",
        rng=rng,
    ).confidence_interval
    # Interpolated percentiles may lie beyond the values, or the median, by rounding.
    low = min(max(float(interval.low), float(sample[0])), median)
    high = max(min(float(interval.high), float(sample[-1])), median)
    return median, low, high


def friedman(
    blocks: ArrayLike, *, rng: np.random.Generator
) -> tuple[float, float] | tuple[None, None]:
    """Test whether treatments rank differently over blocks (n_blocks, n_treatments >= 3).

    Returns Friedman's statistic and its p-value. Both are None if all treatments are tied in every
    block, so that there is nothing to test.

    Friedman, "The use of ranks to avoid the assumption of normality implicit in the analysis of
    variance", Journal of the American Statistical Association 32, 1937; the statistic is that of
    ``scipy.stats.friedmanchisquare``. Its chi-squared approximation is poor for few blocks: the
    p-value is that of a permutation test within blocks, by ``scipy.stats.permutation_test``, over
    all permutations where there are at most 9 999, and over as many random ones otherwise.
    """
    table = np.asarray(blocks, np.float64)
    ranks = stats.rankdata(table, axis=1)
    if (ranks == ranks[:, :1]).all():
        return None, None
    statistic = stats.friedmanchisquare(*table.T).statistic
    tested = stats.permutation_test(
        tuple(ranks.T),
        # The part of Friedman's statistic that permutations change.
        lambda *of_each, axis: sum(ranked.sum(axis=axis) ** 2 for ranked in of_each),
        permutation_type="samples",
        alternative="greater",
        vectorized=True,
        n_resamples=N_RESAMPLES,
        batch=_BATCH,
        rng=rng,
    )
    return float(statistic), float(tested.pvalue)
