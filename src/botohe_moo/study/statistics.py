"""Statistics of samples; tests of algorithms in pairs, and by ranks over missions."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from itertools import combinations, count
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import optimize, stats

from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import INDICATORS, TIE
from botohe_moo.study.tables import as_table

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
    p_value = stats.mannwhitneyu(x, y).pvalue
    # For few values with ties, the approximation falls below the p-value of any arrangement:
    # 3 ones against 3 zeros would be significant at 0.05, although 1 in 10 arrangements are as far
    # apart.
    return float(max(p_value, smallest_p(np.size(x), np.size(y))))


def smallest_p(n: int, m: int) -> float:
    """Return the smallest p-value of a two-sided Mann-Whitney test of n and m values.

    It is 2 / binomial(n + m, n): all values of one sample are above all of the other.
    """
    return 2 / math.comb(n + m, n)


def seeds_needed(n_algorithms: int, *, has_control: bool, significance: float) -> int:
    """Return the fewest runs of each algorithm with which a difference can be significant.

    Holm's correction multiplies the smallest p-value by the number of tests on a mission.

    >>> seeds_needed(3, has_control=True, significance=0.05)
    5
    """
    n_tests = n_algorithms - 1 if has_control else math.comb(n_algorithms, 2)
    return next(n for n in count(1) if n_tests * smallest_p(n, n) < significance)


def generator_for(values: ArrayLike) -> np.random.Generator:
    """Return a generator seeded by the values, in their order, to resample them.

    A sample then has the same interval in every study.
    """
    content = np.ascontiguousarray(values, "<f8").tobytes()
    digest = np.frombuffer(hashlib.sha256(content).digest(), "<u4")
    return np.random.default_rng([_SEED, *digest.tolist()])


def median_interval(values: ArrayLike, *, confidence: float) -> tuple[float, float]:
    """Return both ends of the bootstrap percentile interval of the median of values (n,).

    Both are the median for a single value and for equal values. Resamples are drawn by
    ``generator_for`` the sorted values.

    Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, chapter 13; by
    ``scipy.stats.bootstrap``. For very few runs the interval is too narrow: that of two runs
    contains the median of their distribution half of the time.
    """
    sample = np.sort(np.asarray(values, np.float64))
    median = float(np.median(sample))
    if sample[0] == sample[-1]:
        return median, median
    interval = stats.bootstrap(
        (sample,),
        np.median,
        n_resamples=N_RESAMPLES,
        batch=_BATCH,
        vectorized=True,
        confidence_level=confidence,
        method="percentile",
        rng=generator_for(sample),
    ).confidence_interval
    # Interpolated percentiles may lie beyond the values, or the median, by rounding.
    low, high = np.clip(interval, sample[0], sample[-1])
    return min(float(low), median), max(float(high), median)


def friedman(blocks: ArrayLike) -> tuple[float, float] | tuple[None, None]:
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
    tested = stats.permutation_test(
        tuple(ranks.T),
        # The part of Friedman's statistic that permutations change.
        lambda *of_each, axis: sum(ranked.sum(axis=axis) ** 2 for ranked in of_each),
        permutation_type="samples",
        alternative="greater",
        vectorized=True,
        n_resamples=N_RESAMPLES,
        batch=_BATCH,
        rng=generator_for(table),
    )
    return float(stats.friedmanchisquare(*table.T).statistic), float(tested.pvalue)


MIN_ALGORITHMS, MIN_BLOCKS = 3, 5  # for Friedman's test
_EFFECTS = ((0.71, "large"), (0.64, "medium"), (0.56, "small"), (0.0, "negligible"))
_DECIMALS = 12  # before an effect is compared with these: a computed 0.56 may be 0.5599999


def merge_ties(values: ArrayLike) -> FloatArray:
    """Return values (n,) of which those that differ by at most 1e-12 are made equal.

    Each value is replaced by the largest that can be reached from it by such steps from value to
    value. Rounding would not do, since it may put two neighbouring numbers apart. Merging again
    changes nothing.

    >>> merge_ties([0.3, 0.1 + 0.2, 0.2]).tolist()
    [0.30000000000000004, 0.30000000000000004, 0.2]
    """
    values = np.asarray(values, np.float64)
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    is_last = np.append(np.diff(ordered) > TIE, True)[: len(values)]  # of a group of ties
    ends = np.flatnonzero(is_last)
    merged = np.empty_like(values)
    merged[order] = ordered[ends[np.searchsorted(ends, np.arange(len(values)))]]
    return merged


TOO_FEW = "too few runs"  # for any difference to be significant


def sign_of(indicator: str) -> int:
    """Return 1 if more is better, -1 if less is, 0 if the indicator does not judge."""
    return {True: 1, False: -1, None: 0}[INDICATORS[indicator].higher_is_better]


def best_first(indicator: str, medians: ArrayLike) -> FloatArray:
    """Return medians (n,), ties merged, with a sign that makes the smallest the best."""
    return -sign_of(indicator) * merge_ties(medians)


def compare_algorithms(
    indicators: pd.DataFrame, *, algorithms: Sequence[str], control: str | None, significance: float
) -> pd.DataFrame:
    """Return the table ``comparisons``: algorithms in pairs on each mission, by each indicator.

    Two-sided Mann-Whitney tests, corrected by Holm over the tests of a mission by an indicator,
    with the effect size A12, its interval, and a verdict in words. Differences up to 1e-12 count
    as ties. With a ``control``, all others are compared with it; without one, all pairs are
    compared. If one side has no runs, as in a study that was interrupted, there is no row. If it
    has a single one, there is no test, and the pair does not count for Holm's correction.
    """
    pairs = list(combinations(algorithms, 2))
    if control is not None:
        pairs = [(label, control) for label in algorithms if label != control]
    rows: list[dict[str, Any]] = []
    groups: Any = indicators.groupby(["mission", "indicator"], sort=False)
    for (mission, indicator), scores in groups:
        sign, values = sign_of(indicator), scores.groupby("algorithm")["value"]
        samples = {label: of_label.to_numpy(float) for label, of_label in values}
        family = [
            {
                "mission": mission,
                "indicator": indicator,
                "algorithm": one,
                "other": other,
                **_compared(samples[one], samples[other], sign, significance),
            }
            for one, other in pairs
            if sign and one in samples and other in samples
        ]
        _correct([row for row in family if min(row["n"], row["n_other"]) >= 2], significance)
        rows += family
    return as_table("comparisons", rows)


def _compared(
    values: FloatArray, others: FloatArray, sign: int, significance: float
) -> dict[str, Any]:
    """Return the effect size and the p-value of a pair, which is not corrected yet."""
    merged = sign * merge_ties(np.concatenate([values, others]))  # more is better
    x, y = merged[: len(values)], merged[len(values) :]
    low, high = a12_interval(x, y, confidence=1.0 - significance)
    return {
        "n": len(x),
        "n_other": len(y),
        "median": float(np.median(values)),
        "median_other": float(np.median(others)),
        "p_value": mann_whitney(x, y) if min(len(x), len(y)) >= 2 else 1.0,
        "p_holm": 1.0,
        "a12": a12(x, y),
        "a12_low": low,
        "a12_high": high,
        "significant": False,
        "verdict": TOO_FEW,
    }


def _correct(tests: list[dict[str, Any]], significance: float) -> None:
    """Correct the p-values of tests for their number, and fill in the verdicts."""
    corrected = holm([test["p_value"] for test in tests])
    # A corrected p-value never falls when another p-value grows: these are the smallest possible.
    smallest = holm([smallest_p(test["n"], test["n_other"]) for test in tests])
    for test, p_value, least in zip(tests, corrected, smallest, strict=True):
        verdict = TOO_FEW if least >= significance else "no difference found"
        if p_value < significance:
            word = "better" if test["a12"] > 0.5 else "worse"
            verdict = f"{word}, {effect_size(test['a12'])}"
        test |= {"p_holm": p_value, "significant": p_value < significance, "verdict": verdict}


def holm(p_values: Sequence[float]) -> list[float]:
    """Correct p-values (n,) for the number of tests, by Holm.

    The smallest is multiplied by n, the next by n - 1 and so on; none becomes smaller than one
    before it. (statsmodels' function collects garbage at each call, which takes as long as all else
    that comparisons do.)

    Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of
    Statistics 6(2), 1979.

    >>> holm([0.04, 0.01, 0.5])
    [0.08, 0.03, 0.5]
    """
    values = np.asarray(p_values, np.float64)
    order = np.argsort(values, kind="stable")
    corrected = np.empty_like(values)
    multiplied = values[order] * np.arange(len(values), 0, -1)
    corrected[order] = np.maximum.accumulate(np.minimum(multiplied, 1.0))
    return [float(value) for value in corrected]


def effect_size(effect: float) -> str:
    """Return Vargha and Delaney's word for the size of an A12, whichever side is better.

    >>> effect_size(0.5), effect_size(0.44), effect_size(0.64), effect_size(0.0)
    ('negligible', 'small', 'medium', 'large')
    """
    distance = round(max(effect, 1.0 - effect), _DECIMALS)
    return next(word for least, word in _EFFECTS if distance >= least)


def rank_algorithms(
    indicators: pd.DataFrame,
    *,
    algorithms: Sequence[str],
    significance: float,
    digests: Mapping[str, str],
) -> pd.DataFrame:
    """Return the table ``ranks``: average ranks of medians over missions, tested by Friedman.

    Missions are the blocks. Seeds never are: the runs of a mission are not several problems.
    The test needs ``MIN_ALGORITHMS`` = 3 algorithms, since for two it would be a sign test. It
    needs ``MIN_BLOCKS`` = 5 missions: with fewer, three algorithms would have to rank almost alike
    on all, and the outcome would depend on a single mission. ``digests``, by label, are equal for
    missions that differ in budgets or limits only. These are one block, and then there is no test.
    The column ``note`` says why there is no test. Missions where an algorithm has no runs, as in a
    study that was interrupted, are left out.
    """
    parts = []
    for indicator, values in indicators.groupby("indicator", sort=False):
        medians = values.pivot_table("value", "mission", "algorithm", aggfunc="median", sort=False)
        complete = medians.reindex(columns=list(algorithms)).dropna()
        if complete.empty or not sign_of(str(indicator)):
            continue
        signed = np.array([best_first(str(indicator), row) for row in complete.to_numpy()])
        n_blocks = len({digests[mission] for mission in complete.index})
        statistic, p_value, note = _tested(signed, n_blocks, significance)
        tested = {"statistic": statistic, "p_value": p_value, "note": note}
        averages = stats.rankdata(signed, axis=1).mean(axis=0)
        part = pd.DataFrame({"algorithm": list(algorithms), "average_rank": averages})
        parts.append(part.assign(indicator=indicator, n_missions=len(complete), **tested))
    return as_table("ranks", pd.concat(parts, ignore_index=True) if parts else [])


def _tested(
    medians: FloatArray, n_blocks: int, level: float
) -> tuple[float | None, float | None, str]:
    """Return Friedman's statistic, its p-value, and the outcome in words."""
    n_missions, n_algorithms = medians.shape
    if n_algorithms < MIN_ALGORITHMS or n_blocks < max(MIN_BLOCKS, n_missions):
        needed = f"{MIN_ALGORITHMS} algorithms and {MIN_BLOCKS} missions, each under one label"
        found = f"{n_algorithms} and {n_blocks}"
        return None, None, f"no Friedman test: it needs at least {needed}; here are {found}"
    statistic, p_value = friedman(medians)
    if statistic is None or p_value is None:
        return None, None, "no Friedman test: all algorithms have the same median on every mission"
    outcome = "the algorithms differ" if p_value < level else "no difference found"
    note = f"{outcome}: Friedman over {n_missions} missions, p {p_value:.2g}"
    return statistic, p_value, note


def nemenyi(
    differences: FloatArray, k: int, n_blocks: int, *, significance: float
) -> tuple[float, FloatArray]:
    """Return the critical difference of k average ranks over blocks, and p-values of differences.

    Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine
    Learning Research 7, 2006, section 3.2.2: the difference of two average ranks, in units of
    sqrt(k (k + 1) / (6 n)), against the Studentized range with infinitely many degrees of freedom,
    divided by sqrt(2).
    """
    unit = math.sqrt(k * (k + 1) / (12 * n_blocks))  # divided by sqrt(2)
    critical = float(stats.studentized_range.ppf(1 - significance, k, np.inf)) * unit
    sizes = np.abs(differences).round(9)
    return critical, np.clip(stats.studentized_range.sf(sizes / unit, k, np.inf), 0.0, 1.0)


def compare_ranks(ranks: pd.DataFrame, *, significance: float) -> pd.DataFrame:
    """Return the table ``posthoc``: Nemenyi's test of all pairs, if there is Friedman's.

    Where Friedman's test finds no difference, no pair is significant.
    """
    parts = []
    for indicator, tested in ranks.dropna(subset="statistic").groupby("indicator", sort=False):
        one, other = np.triu_indices(len(tested), 1)
        labels, averages = tested["algorithm"].to_numpy(), tested["average_rank"].to_numpy(float)
        n_missions, overall = tested[["n_missions", "p_value"]].iloc[0]
        part = pd.DataFrame({"algorithm": labels[one], "other": labels[other]})
        part["difference"] = averages[one] - averages[other]
        part["critical_difference"], part["p_value"] = nemenyi(
            part["difference"].to_numpy(), len(tested), int(n_missions), significance=significance
        )
        part["significant"] = part["p_value"].clip(lower=overall) < significance
        parts.append(part.assign(indicator=indicator))
    return as_table("posthoc", pd.concat(parts, ignore_index=True) if parts else [])
