"""The statistics of a study: comparisons on each mission, ranks over missions, a summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from scipy import stats

from botohe_moo._base.checks import check_number, nearest_first
from botohe_moo._base.types import FloatArray
from botohe_moo.study.judge.resampling import friedman, generator_for, median_interval
from botohe_moo.study.judge.scores import INDICATORS, as_table, check_indicators
from botohe_moo.study.judge.ties import merge_ties
from botohe_moo.study.judge.verdicts import Pair, compare_family, p_text

__all__ = ["MIN_ALGORITHMS", "MIN_BLOCKS", "compare_algorithms", "rank_algorithms", "summarise"]

MIN_ALGORITHMS = 3
MIN_BLOCKS = 5

_Samples: TypeAlias = dict[tuple[str, str], dict[str, FloatArray]]


def compare_algorithms(
    indicators: pd.DataFrame,
    *,
    runs: pd.DataFrame,
    algorithms: Sequence[str],
    control: str | None,
    significance: float,
) -> pd.DataFrame:
    """Compare algorithms in pairs on each mission, by each indicator that judges.

    Two-sided Mann-Whitney tests, corrected by Holm over the tests of a mission by an indicator,
    with the effect size A12, its interval, and a verdict in words. Differences up to 1e-12 count
    as ties.

    Parameters
    ----------
    indicators
        The table ``indicators``: of each run, its values.
    runs
        The table ``runs``, which tells the runs without a front; verdicts mention them.
    algorithms
        Labels of those to compare, in the order wanted.
    control
        The one that the others are compared with; None: all pairs.
    significance
        Significance level, in (0, 1); intervals cover 1 minus this.

    Returns
    -------
    pandas.DataFrame
        The table ``comparisons``. Pairs without a run on either side, as in a study that was
        interrupted, have no row. A pair of which one side has a single run is not tested, and does
        not count for Holm's correction.

    Raises
    ------
    ValueError
        If ``control`` is not among ``algorithms``, ``significance`` is out of range, an indicator
        is not known, or a value is NaN or infinite.
    """
    level = check_number("significance", significance, above=0.0, below=1.0)
    if control is not None and control not in algorithms:
        known = ", ".join(nearest_first(control, algorithms))
        raise ValueError(f"Expected control among {known}, got {control!r}.")
    if control is None:
        pairs = list(combinations(algorithms, 2))
    else:
        pairs = [(label, control) for label in algorithms if label != control]
    without_front = runs.loc[runs["front_size"] == 0, ["mission", "algorithm"]].value_counts()
    lost: dict[Any, int] = without_front.to_dict()
    rows: list[dict[str, Any]] = []
    for (mission, indicator), samples in _samples(indicators).items():
        sign = _sign(indicator)
        if not sign:
            continue
        found = [
            Pair(
                algorithm=one,
                other=other,
                values=samples[one],
                other_values=samples[other],
                sign=sign,
                level=level,
                lost=lost.get((mission, one), 0),
                other_lost=lost.get((mission, other), 0),
            )
            for one, other in pairs
            if one in samples and other in samples
        ]
        rows += [
            {"mission": mission, "indicator": indicator, **row} for row in compare_family(found)
        ]
    return as_table("comparisons", rows)


def rank_algorithms(
    indicators: pd.DataFrame,
    *,
    algorithms: Sequence[str],
    significance: float,
    digests: Mapping[str, str] | None = None,
) -> pd.DataFrame:
    """Average the ranks of the algorithms' medians over missions, and test them by Friedman.

    Missions are the blocks; seeds never are, since the runs of a mission are not several problems.
    There is a test for at least ``MIN_ALGORITHMS`` = 3 algorithms, below which the ranks of two
    are a sign test, and ``MIN_BLOCKS`` = 5 missions: of fewer, three algorithms would have to rank
    almost alike on all, and the outcome would hang on the choice of a single mission.

    Parameters
    ----------
    indicators
        The table ``indicators``: of each run, its values.
    algorithms
        Labels of those to rank, in the order wanted.
    significance
        Significance level, in (0, 1).
    digests
        Digest of each mission by its label: one mission under several labels, with other budgets
        or survival floors, is one block, and there is no test then. Default: all differ.

    Returns
    -------
    pandas.DataFrame
        The table ``ranks``; its column ``note`` says why there is no test where there is none.
        Missions on which one of the algorithms has no run, as in a study that was interrupted, are
        left out, and counted in the note.

    Raises
    ------
    ValueError
        If ``significance`` is out of range, an indicator is not known, or a value is NaN or
        infinite.
    """
    level = check_number("significance", significance, above=0.0, below=1.0)
    by_indicator: dict[str, dict[str, dict[str, FloatArray]]] = {}
    for (mission, indicator), samples in _samples(indicators).items():
        if _sign(indicator):
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
            [_best_first(indicator, [s[a] for a in algorithms]) for s in complete.values()]
        )
        n_blocks = len({(digests or {}).get(mission, mission) for mission in complete})
        averages = stats.rankdata(medians, axis=1).mean(axis=0)
        statistic, p_value, note = _tested(medians, n_blocks, level)
        if left_out := len(missions) - len(complete):
            note += f"; {_missions(left_out)} left out, where an algorithm has no run"
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
    """Give Friedman's statistic, its p-value, and the outcome in words."""
    n_missions, n_algorithms = medians.shape
    lacking = []
    if n_algorithms < MIN_ALGORITHMS:
        needed = f"at least {MIN_ALGORITHMS} are needed"
        lacking.append(f"{n_algorithms} algorithm{'s' * (n_algorithms > 1)}, {needed}")
    if n_blocks < n_missions:
        several = f"{n_missions} labels stand for {_missions(n_blocks)}"
        lacking.append(f"{several}, and a mission under several labels is one block")
    if n_blocks < MIN_BLOCKS:
        needed = f"at least {MIN_BLOCKS} are needed as blocks, and seeds are no blocks"
        lacking.append(f"{_missions(n_blocks)}, {needed}")
    if lacking:
        return None, None, f"no Friedman test: {'; '.join(lacking)}"
    statistic, p_value = friedman(medians, rng=generator_for(medians.ravel()))
    if statistic is None or p_value is None:
        return None, None, "no Friedman test: all algorithms have the same median on every mission"
    outcome = "the algorithms differ" if p_value < level else "no difference found"
    return (
        statistic,
        p_value,
        f"{outcome}: Friedman over {n_missions} missions, {p_text(p_value)}",
    )


def summarise(
    runs: pd.DataFrame,
    indicators: pd.DataFrame,
    *,
    missions: Sequence[str],
    algorithms: Sequence[str],
    significance: float,
) -> pd.DataFrame:
    """Sum up the runs of each algorithm on each mission.

    Parameters
    ----------
    runs
        The table ``runs``.
    indicators
        The table ``indicators``, for IGD+ and epsilon.
    missions, algorithms
        Labels, in the order wanted.
    significance
        Intervals cover 1 minus this, in (0, 1).

    Returns
    -------
    pandas.DataFrame
        The table ``summary``. The intervals of the median areas are bootstrapped with a fixed seed
        and the areas themselves: they do not depend on what else is in the study. What has no
        runs, as in a study that was interrupted, has no row.

    Raises
    ------
    ValueError
        If ``significance`` is out of range, an indicator is not known, or a value is NaN or
        infinite.
    """
    level = check_number("significance", significance, above=0.0, below=1.0)
    if len(runs):  # the values that are compared
        areas: Any = runs.groupby("mission", sort=False)["area"]
        runs = runs.assign(raw_area=runs["area"], area=areas.transform(merge_ties))
    groups: Any = runs.groupby(["mission", "algorithm"], sort=False)
    found: dict[Any, pd.DataFrame] = dict(iter(groups))
    samples = _samples(indicators)
    rows: list[dict[str, Any]] = []
    for mission in missions:
        labels = [label for label in algorithms if (mission, label) in found]
        samples_of = [found[mission, label]["area"].to_numpy(float) for label in labels]
        ranks = stats.rankdata(_best_first("area", samples_of))
        for label, rank in zip(labels, ranks, strict=True):
            row = {"mission": mission, "algorithm": label, "rank": float(rank)}
            for name in ("igd_plus", "epsilon"):
                values = samples.get((mission, name), {}).get(label)
                row[f"{name}_median"] = None if values is None else float(np.median(values))
            rows.append(row | _described(found[mission, label], level))
    return as_table("summary", rows)


def _described(runs: pd.DataFrame, level: float) -> dict[str, Any]:
    areas = np.sort(runs["area"].to_numpy(float))
    median = float(np.median(areas))
    # Which of two values a hair's breadth apart counts depends on the others of the study.
    raw = np.sort(runs["raw_area"].to_numpy(float))
    _, low, high = median_interval(raw, confidence=1.0 - level, rng=generator_for(raw))
    return {
        "n": len(runs),
        "n_not_done": int((runs["status"] != "done").sum()),
        "area_median": median,
        "area_low": min(low, median),
        "area_high": max(high, median),
        "area_mean": float(areas.mean()),
        "area_sd": float(areas.std(ddof=1)) if len(areas) > 1 else None,
        "area_best": float(areas[-1]),
        "front_size_median": float(runs["front_size"].median()),
        "evaluations_median": float(runs["evaluations"].median()),
        "seconds_median": float(runs["seconds"].median()),
    }


def _samples(indicators: pd.DataFrame) -> _Samples:
    """Give the values of every algorithm by mission and indicator, as they come."""
    check_indicators(indicators["indicator"].unique())
    values = indicators["value"].to_numpy(float)
    if not np.isfinite(values).all():
        row = indicators.iloc[int(np.argmin(np.isfinite(values)))].to_dict()
        raise ValueError(f"Expected finite values of indicators, got {row}.")
    samples: _Samples = {}
    groups: Any = indicators.groupby(["mission", "indicator", "algorithm"], sort=False)["value"]
    for (mission, indicator, algorithm), found in groups:
        of_mission = samples.setdefault((mission, indicator), {})
        of_mission[algorithm] = found.to_numpy(float)
    return samples


def _sign(indicator: str) -> int:
    """1 where more is better, -1 where less is, 0 where neither is."""
    return {True: 1, False: -1, None: 0}[INDICATORS[indicator].higher_is_better]


def _best_first(indicator: str, samples: Sequence[FloatArray]) -> FloatArray:
    """Give the medians so that the smallest is the best, those that are ties equal."""
    return -_sign(indicator) * merge_ties([np.median(values) for values in samples])


def _missions(count: int) -> str:
    return "1 mission" if count == 1 else f"{count} missions"
