"""The table ``summary``: the runs of each algorithm on each mission."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from botohe_moo._base.checks import check_number
from botohe_moo.study.judge.resampling import generator_for, median_interval
from botohe_moo.study.judge.scores import as_table, best_first, merge_ties, samples_of


def summarise(
    runs: pd.DataFrame,
    indicators: pd.DataFrame,
    *,
    missions: Sequence[str],
    algorithms: Sequence[str],
    significance: float,
) -> pd.DataFrame:
    """Make the table ``summary``: the runs of each algorithm on each mission.

    The intervals of median areas are bootstrapped with a generator seeded by the areas, so they do
    not depend on the rest of the study. An algorithm without runs on a mission, as in a study that
    was interrupted, has no row.

    Raises a ValueError if ``significance`` is out of range, an indicator is not known, or a value
    is NaN or infinite.
    """
    level = check_number("significance", significance, above=0.0, below=1.0)
    if len(runs):  # the values that are compared
        areas: Any = runs.groupby("mission", sort=False)["area"]
        runs = runs.assign(raw_area=runs["area"], area=areas.transform(merge_ties))
    groups: Any = runs.groupby(["mission", "algorithm"], sort=False)
    found: dict[Any, pd.DataFrame] = dict(iter(groups))
    samples = samples_of(indicators)
    rows: list[dict[str, Any]] = []
    for mission in missions:
        labels = [label for label in algorithms if (mission, label) in found]
        areas_of = [found[mission, label]["area"].to_numpy(float) for label in labels]
        ranks = stats.rankdata(best_first("area", areas_of))
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
    # Not the merged values, which depend on the other runs of the study.
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
