"""Which algorithms differ in their average ranks, where Friedman's test has found that some do."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from botohe_moo._base.checks import check_number
from botohe_moo._base.types import FloatArray
from botohe_moo.study.judge.scores import as_table

__all__ = ["compare_ranks", "nemenyi"]


def nemenyi(average_ranks: FloatArray, n_blocks: int, *, significance: float) -> Any:
    """Test all pairs of average ranks.

    Parameters
    ----------
    average_ranks
        Shape (k,), of at least 2 treatments.
    n_blocks
        Blocks that the ranks are averaged over.
    significance
        Significance level, in (0, 1).

    Returns
    -------
    tuple
        The critical difference, and the p-values of all pairs, shape (k, k).

    Notes
    -----
    Demšar, "Statistical comparisons of classifiers over multiple data sets", Journal of Machine
    Learning Research 7, 2006, section 3.2.2: the difference of two average ranks, in units of
    sqrt(k (k + 1) / (6 n)), against the Studentized range with infinitely many degrees of freedom,
    divided by sqrt(2).
    """
    level = check_number("significance", significance, above=0.0, below=1.0)
    k = len(average_ranks)
    unit = math.sqrt(k * (k + 1) / (12 * n_blocks))  # sqrt(2) is in it
    critical = float(stats.studentized_range.ppf(1 - level, k, np.inf)) * unit
    sizes = np.abs(average_ranks[:, None] - average_ranks[None, :])
    different, where = np.unique(sizes.round(9), return_inverse=True)
    p_values = stats.studentized_range.sf(different / unit, k, np.inf)
    return critical, np.clip(p_values, 0.0, 1.0)[where].reshape(k, k)


def compare_ranks(ranks: pd.DataFrame, *, significance: float) -> pd.DataFrame:
    """Compare average ranks in pairs by Nemenyi's test, where there is one by Friedman.

    Parameters
    ----------
    ranks
        The table ``ranks``.
    significance
        Significance level, in (0, 1).

    Returns
    -------
    pandas.DataFrame
        The table ``posthoc``: all pairs, by each indicator that has a Friedman test. Where that
        test finds no difference, no pair is significant.
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
