"""Scores of recorded fronts, and the table ``targets``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import TIE, area_indicator, epsilon_indicator, igd_plus_indicator
from botohe_moo.mission.model import Mission
from botohe_moo.study.judge.scores import as_table

SHARES = (0.9, 0.95, 0.99)


def score_records(
    fronts: Iterable[tuple[str, FloatArray]],
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Mission],
    indicators: Sequence[str],
) -> dict[str, list[float]]:
    """Compute lists ``area``, ``igd_plus`` and ``epsilon``, with a value for each recorded front.

    ``fronts`` are pairs of a mission's label and points (n, 2); a front equal to the one before it
    is not measured again. An indicator that is not wanted is NaN.
    """
    targets = _points_by_mission(references)
    measures = {"igd_plus": igd_plus_indicator, "epsilon": epsilon_indicator}
    wanted = {name: measure for name, measure in measures.items() if name in indicators}
    scores: dict[str, list[float]] = {"area": [], **{name: [] for name in measures}}
    last: tuple[str, FloatArray] | None = None
    found: dict[str, float] = {}
    for label, points in fronts:
        if last is None or last[0] != label or not np.array_equal(last[1], points):
            last, mission = (label, points), missions[label]
            found = {"area": area_indicator(points, mission)}
            for name, measure in wanted.items():
                found[name] = measure(points, targets[label], mission)
        for name, column in scores.items():
            column.append(found.get(name, np.nan))
    return scores


def reach_targets(
    runs: pd.DataFrame,
    trace: pd.DataFrame,
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Mission],
    algorithms: Sequence[str],
) -> pd.DataFrame:
    """Make the table ``targets``: what reaching 90, 95 and 99 % of the reference area takes.

    What is reached between two records counts from the second. Medians are over all runs; one that
    never reaches a target takes for ever. An algorithm without runs on a mission, as in a study
    that was interrupted, has no rows, nor has a mission whose reference front has no area.
    """
    fronts = _points_by_mission(references)
    counts: Any = runs.groupby(["mission", "algorithm"], sort=False).size()
    rows: list[dict[str, Any]] = []
    areas = {label: area_indicator(fronts[label], missions[label]) for label in fronts}
    whole = trace["mission"].map(areas).to_numpy(float)
    reached: dict[float, Any] = {}
    for share in SHARES:
        there = trace[trace["area"].to_numpy(float) >= share * whole - TIE]
        first = there.drop_duplicates(["run", "mission", "algorithm"])
        reached[share] = dict(iter(first.groupby(["mission", "algorithm"], sort=False)))
    for mission in missions:
        for algorithm in algorithms:
            n = int(counts.get((mission, algorithm), 0))
            for share in SHARES if n and areas[mission] > 0 else ():
                first = reached[share].get((mission, algorithm), trace.iloc[:0])
                rows.append(
                    {
                        "mission": mission,
                        "algorithm": algorithm,
                        "share": share,
                        "target": share * areas[mission],
                        "n": n,
                        "n_reached": len(first),
                        "evaluations_median": _median(first["evaluations"], n),
                        "seconds_median": _median(first["seconds"], n),
                    }
                )
    return as_table("targets", rows)


def _points_by_mission(references: pd.DataFrame) -> dict[str, FloatArray]:
    groups = references.groupby("mission", sort=False)
    return {
        str(label): front[["reward", "survivors"]].to_numpy(np.float64) for label, front in groups
    }


def _median(spent: pd.Series[Any], n: int) -> float | None:
    """Give the median of n runs; all but ``spent`` take for ever. None if it is endless."""
    values = np.full(n, np.inf)
    values[: len(spent)] = spent
    median = float(np.median(values))
    return median if np.isfinite(median) else None
