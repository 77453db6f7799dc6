"""The tables ``ranks`` and ``posthoc``: ranks over missions, tested by Friedman and Nemenyi."""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from botohe_moo._base.types import FloatArray
from botohe_moo._base.words import counted
from botohe_moo.study.judge.comparisons import p_text
from botohe_moo.study.judge.scores import as_table, best_first, samples_of, sign_of
from botohe_moo.study.judge.statistics import friedman, generator_for

MIN_ALGORITHMS = 3
MIN_BLOCKS = 5


def rank_algorithms(
    indicators: pd.DataFrame,
    *,
    algorithms: Sequence[str],
    significance: float,
    digests: Mapping[str, str] | None = None,
) -> pd.DataFrame:
    """Return the table ``ranks``: average ranks of medians over missions, tested by Friedman.

    Missions are the blocks, and seeds never are: the runs of a mission are not several problems.
    The test needs ``MIN_ALGORITHMS`` = 3 algorithms, since for two it would be a sign test, and
    ``MIN_BLOCKS`` = 5 missions: with fewer, three algorithms would have to rank almost alike on
    all, and the outcome would depend on a single mission. ``digests`` tells, by label, missions
    that are the same under several labels, with other budgets or survival floors: they are one
    block, and there is no test then. The column ``note`` says why there is no test. Missions where
    an algorithm has no run, as in a study that was interrupted, are left out and counted there.
    """
    by_indicator: dict[str, dict[str, dict[str, FloatArray]]] = {}
    for (mission, indicator), samples in samples_of(indicators).items():
        if sign_of(indicator):
            by_indicator.setdefault(indicator, {})[mission] = samples
    rows: list[dict[str, Any]] = []
    for indicator, missions in by_indicator.items():
        complete = {
            mission: samples
            for mission, samples in missions.items()
            if all(a in samples for a in algorithms)
        }
        if not complete or not algorithms:
            continue
        medians = np.array(
            [best_first(indicator, [s[a] for a in algorithms]) for s in complete.values()]
        )
        n_blocks = len({(digests or {}).get(mission, mission) for mission in complete})
        averages = stats.rankdata(medians, axis=1).mean(axis=0)
        statistic, p_value, note = _tested(medians, n_blocks, significance)
        if left_out := len(missions) - len(complete):
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
    lacking = []
    if n_algorithms < MIN_ALGORITHMS:
        found = counted(n_algorithms, "algorithm")
        lacking.append(f"{found}, at least {MIN_ALGORITHMS} are needed")
    if n_blocks < n_missions:
        several = f"{n_missions} labels represent {counted(n_blocks, 'mission')}"
        lacking.append(f"{several}, and a mission under several labels is one block")
    if n_blocks < MIN_BLOCKS:
        needed = f"at least {MIN_BLOCKS} are needed as blocks, and seeds are no blocks"
        lacking.append(f"{counted(n_blocks, 'mission')}, {needed}")
    if lacking:
        return None, None, f"no Friedman test: {'; '.join(lacking)}"
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
    unit = math.sqrt(k * (k + 1) / (12 * n_blocks))  # sqrt(2) is in it
    critical = float(stats.studentized_range.ppf(1 - significance, k, np.inf)) * unit
    sizes = np.abs(average_ranks[:, None] - average_ranks[None, :])
    different, where = np.unique(sizes.round(9), return_inverse=True)
    p_values = stats.studentized_range.sf(different / unit, k, np.inf)
    return critical, np.clip(p_values, 0.0, 1.0)[where].reshape(k, k)


def compare_ranks(ranks: pd.DataFrame, *, significance: float) -> pd.DataFrame:
    """Return the table ``posthoc``: Nemenyi's test of all pairs, by indicators tested by Friedman.

    Where Friedman's test finds no difference, no pair is significant.
    """
    rows: list[dict[str, Any]] = []
    for indicator, found in ranks.dropna(subset="statistic").groupby("indicator", sort=False):
        averages = found["average_rank"].to_numpy(float)
        labels = found["algorithm"].tolist()
        n_blocks, overall = int(found["n_missions"].iloc[0]), float(found["p_value"].iloc[0])
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
