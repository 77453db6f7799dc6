"""Statistics of samples; tests of algorithms in pairs, and by ranks over missions."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import optimize, stats

from botohe_moo.base.messages import counted
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


def sign_of(indicator: str) -> int:
    """Return 1 if more is better, -1 if less is, 0 if the indicator does not judge."""
    return {True: 1, False: -1, None: 0}[INDICATORS[indicator].higher_is_better]


def best_first(indicator: str, medians: ArrayLike) -> FloatArray:
    """Return medians (n,), ties merged, with a sign that makes the smallest the best."""
    return -sign_of(indicator) * merge_ties(medians)


def compare_algorithms(
    indicators: pd.DataFrame,
    *,
    runs: pd.DataFrame,
    algorithms: Sequence[str],
    control: str | None,
    significance: float,
) -> pd.DataFrame:
    """Return the table ``comparisons``: algorithms in pairs on each mission, by each indicator.

    Two-sided Mann-Whitney tests, corrected by Holm over the tests of a mission by an indicator,
    with the effect size A12, its interval, and a verdict in words. Differences up to 1e-12 count
    as ties. With a ``control``, all others are compared with it; without one, all pairs are
    compared. If one side has no runs, as in a study that was interrupted, there is no row. If it
    has a single one, there is no test, and the pair does not count for Holm's correction.
    """
    if control is None:
        pairs = list(combinations(algorithms, 2))
    else:
        pairs = [(label, control) for label in algorithms if label != control]
    without_front = runs.loc[runs["front_size"] == 0, ["mission", "algorithm"]].value_counts()
    n_lost: dict[Any, int] = without_front.to_dict()
    rows: list[dict[str, Any]] = []
    groups: Any = indicators.groupby(["mission", "indicator"], sort=False)
    for (mission, indicator), scores in groups:
        sign, values = sign_of(indicator), scores.groupby("algorithm")["value"]
        samples = {label: of_label.to_numpy(float) for label, of_label in values}
        sides = {
            (one, other): _sides(samples[one], samples[other], sign)
            for one, other in pairs
            if sign and one in samples and other in samples
        }
        for (one, other), outcome in _compared(sides, significance).items():
            lost = [
                f"{n} of {len(samples[label])} runs of {label}"
                for label in (one, other)
                if (n := n_lost.get((mission, label)))
            ]
            if lost:  # a low median would not tell why
                scored = "without a front, and scored as bringing nothing back"
                outcome["verdict"] += f"; {scored}: {', '.join(lost)}"
            rows.append(
                {
                    "mission": mission,
                    "indicator": indicator,
                    "algorithm": one,
                    "other": other,
                    "n": len(samples[one]),
                    "n_other": len(samples[other]),
                    "median": float(np.median(samples[one])),
                    "median_other": float(np.median(samples[other])),
                    **outcome,
                }
            )
    return as_table("comparisons", rows)


def _sides(values: FloatArray, others: FloatArray, sign: int) -> tuple[FloatArray, FloatArray]:
    """Return both samples, transformed so that more is better and ties are equal."""
    merged = sign * merge_ties(np.concatenate([values, others]))
    return merged[: len(values)], merged[len(values) :]


def _compared(
    sides: Mapping[tuple[str, str], tuple[FloatArray, FloatArray]], level: float
) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the test, effect size and verdict of each pair; p-values are corrected together."""
    tested = [pair for pair, both in sides.items() if min(map(len, both)) >= 2]
    p_values = {pair: mann_whitney(*sides[pair]) for pair in tested}
    corrected = _holm(p_values)
    # The smallest that any corrected p-value can be: a corrected one never falls when another
    # p-value grows, so all are at their smallest.
    smallest = _holm({pair: smallest_p(*map(len, sides[pair])) for pair in tested})
    rows = {}
    for pair, (x, y) in sides.items():
        effect, p_holm = a12(x, y), corrected.get(pair, 1.0)
        low, high = a12_interval(x, y, confidence=1.0 - level)
        shown = f"A12 {effect:.2f} [{low:.2f}, {high:.2f}], {effect_size(effect)}"
        sizes = f"{len(x)} and {len(y)} runs"
        if p_holm < level:
            word = "better" if effect > 0.5 else "worse"
            verdict = f"{pair[0]} is {word} than {pair[1]}: {shown}, {p_text(p_holm)}"
        elif pair not in p_values:
            verdict = f"too few runs to test: {sizes}; {shown}"
        elif np.ptp(np.concatenate([x, y])) == 0:
            verdict = "equal: all runs have the same value"
        elif smallest[pair] >= level:
            verdict = (
                f"{sizes} cannot reach {level:g} in {counted(len(tested), 'comparison')}: even if "
                "every run of one were better than all of the other, p would be "
                f"{smallest[pair]:.2g}; {shown}"
            )
        else:
            verdict = f"no difference found: {shown}, {p_text(p_holm)}"
        rows[pair] = {
            "p_value": p_values.get(pair, 1.0),
            "p_holm": p_holm,
            "a12": effect,
            "a12_low": low,
            "a12_high": high,
            "significant": p_holm < level,
            "verdict": verdict,
        }
    return rows


def _holm(p_values: Mapping[tuple[str, str], float]) -> dict[tuple[str, str], float]:
    """Correct p-values for the number of tests, by Holm.

    The smallest of n is multiplied by n, the next by n - 1 and so on; none becomes smaller than one
    before it. (statsmodels' function collects garbage at each call, which takes as long as all else
    that comparisons do.)

    Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of
    Statistics 6(2), 1979.
    """
    ascending = sorted(p_values, key=lambda pair: p_values[pair])
    corrected, largest = {}, 0.0
    for i, pair in enumerate(ascending):
        largest = max(largest, min(1.0, p_values[pair] * (len(ascending) - i)))
        corrected[pair] = largest
    return corrected


def effect_size(effect: float) -> str:
    """Return Vargha and Delaney's word for the size of an A12, whichever side is better.

    >>> effect_size(0.5), effect_size(0.44), effect_size(0.64), effect_size(0.0)
    ('negligible', 'small', 'medium', 'large')
    """
    distance = round(max(effect, 1.0 - effect), _DECIMALS)
    return next(word for least, word in _EFFECTS if distance >= least)


def p_text(value: float) -> str:
    """Return a p-value as text."""
    return "p < 0.0001" if value < 0.0001 else f"p {value:.2g}"


def rank_algorithms(
    indicators: pd.DataFrame,
    *,
    algorithms: Sequence[str],
    significance: float,
    digests: Mapping[str, str] | None = None,
) -> pd.DataFrame:
    """Return the table ``ranks``: average ranks of medians over missions, tested by Friedman.

    Missions are the blocks. Seeds never are: the runs of a mission are not several problems.
    The test needs ``MIN_ALGORITHMS`` = 3 algorithms, since for two it would be a sign test. It
    needs ``MIN_BLOCKS`` = 5 missions: with fewer, three algorithms would have to rank almost alike
    on all, and the outcome would depend on a single mission. ``digests``, by label, are equal for
    missions that differ in budgets or limits only. These are one block, and then there is no test.
    The column ``note`` says why there is no test. Missions where an algorithm has no runs, as in a
    study that was interrupted, are left out, and the note counts them.
    """
    rows: list[dict[str, Any]] = []
    for indicator, values in indicators.groupby("indicator", sort=False):
        if not sign_of(str(indicator)):
            continue
        medians = values.pivot_table("value", "mission", "algorithm", aggfunc="median", sort=False)
        complete = medians.reindex(columns=list(algorithms)).dropna()
        if complete.empty:
            continue
        signed = np.array([best_first(str(indicator), row) for row in complete.to_numpy()])
        n_blocks = len({(digests or {}).get(mission, mission) for mission in complete.index})
        averages = stats.rankdata(signed, axis=1).mean(axis=0)
        statistic, p_value, note = _tested(signed, n_blocks, significance)
        if left_out := len(medians) - len(complete):
            note += f"; {counted(left_out, 'mission')} left out, where an algorithm has no run"
        rows += [
            {
                "indicator": indicator,
                "algorithm": label,
                "average_rank": float(average),
                "n_missions": len(complete),
                "statistic": statistic,
                "p_value": p_value,
                "note": note,
            }
            for label, average in zip(algorithms, averages, strict=True)
        ]
    return as_table("ranks", rows)


def _tested(
    medians: FloatArray, n_blocks: int, level: float
) -> tuple[float | None, float | None, str]:
    """Return Friedman's statistic, its p-value, and the outcome in words."""
    n_missions, n_algorithms = medians.shape
    obstacles = []
    if n_algorithms < MIN_ALGORITHMS:
        algorithms = counted(n_algorithms, "algorithm")
        obstacles.append(f"{algorithms}, at least {MIN_ALGORITHMS} are needed")
    missions = counted(n_blocks, "mission")
    if n_blocks < n_missions:
        obstacles.append(
            f"{n_missions} labels represent {missions}, and a mission under several labels is "
            "one block"
        )
    if n_blocks < MIN_BLOCKS:
        needed = f"at least {MIN_BLOCKS} are needed as blocks, and seeds are no blocks"
        obstacles.append(f"{missions}, {needed}")
    if obstacles:
        return None, None, f"no Friedman test: {'; '.join(obstacles)}"
    statistic, p_value = friedman(medians, rng=generator_for(medians.ravel()))
    if statistic is None or p_value is None:
        return None, None, "no Friedman test: all algorithms have the same median on every mission"
    outcome = "the algorithms differ" if p_value < level else "no difference found"
    note = f"{outcome}: Friedman over {n_missions} missions, {p_text(p_value)}"
    return statistic, p_value, note


def nemenyi(average_ranks: FloatArray, n_blocks: int, *, significance: float) -> Any:
    """Return the critical difference of k average ranks over blocks, and p-values, shape (k, k).

    Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine
    Learning Research 7, 2006, section 3.2.2: the difference of two average ranks, in units of
    sqrt(k (k + 1) / (6 n)), against the Studentized range with infinitely many degrees of freedom,
    divided by sqrt(2).
    """
    k = len(average_ranks)
    unit = math.sqrt(k * (k + 1) / (12 * n_blocks))  # divided by sqrt(2)
    critical = float(stats.studentized_range.ppf(1 - significance, k, np.inf)) * unit
    sizes = np.abs(average_ranks[:, None] - average_ranks[None, :])
    different, where = np.unique(sizes.round(9), return_inverse=True)
    p_values = stats.studentized_range.sf(different / unit, k, np.inf)
    return critical, np.clip(p_values, 0.0, 1.0)[where].reshape(k, k)


def compare_ranks(ranks: pd.DataFrame, *, significance: float) -> pd.DataFrame:
    """Return the table ``posthoc``: Nemenyi's test of all pairs, if there is Friedman's.

    Where Friedman's test finds no difference, no pair is significant.
    """
    rows: list[dict[str, Any]] = []
    for indicator, tested in ranks.dropna(subset="statistic").groupby("indicator", sort=False):
        averages = tested["average_rank"].to_numpy(float)
        labels = tested["algorithm"].tolist()
        n_blocks, overall = int(tested["n_missions"].iloc[0]), float(tested["p_value"].iloc[0])
        critical, p_values = nemenyi(averages, n_blocks, significance=significance)
        rows += [
            {
                "indicator": indicator,
                "algorithm": labels[i],
                "other": labels[j],
                "difference": float(averages[i] - averages[j]),
                "critical_difference": critical,
                "p_value": float(p_values[i, j]),
                "significant": bool(max(p_values[i, j], overall) < significance),
            }
            for i, j in combinations(range(len(labels)), 2)
        ]
    return as_table("posthoc", rows)
