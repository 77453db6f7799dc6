"""Scores of fronts: reference fronts, and the indicators of every run and record."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import moocore
import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import ArrayLike

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import INDICATORS, TIE, Scale, further_indicators
from botohe_moo.study.store.schemas import SCHEMAS

# Values of each algorithm, by mission and indicator.
Samples: TypeAlias = dict[tuple[str, str], dict[str, FloatArray]]

_DIGITS = 16


def reference_fronts(runs: pd.DataFrame, fronts: Sequence[FloatArray]) -> pd.DataFrame:
    """Return the table ``references``: what all runs on each mission found together.

    The non-dominated points of the final ``fronts``, one for each run, each once, by descending
    reward. Where no run found anything, the single point (0, 0): the plan that brings nothing back.
    """
    rows: list[dict[str, Any]] = []
    for mission in runs["mission"].unique():
        of_mission = runs["mission"] == mission
        union = _union([front for front, own in zip(fronts, of_mission, strict=True) if own])
        digest = hashlib.sha256(union.astype("<f8").tobytes()).hexdigest()[:_DIGITS]
        rows += [
            {"reference": digest, "mission": mission, "reward": reward, "survivors": survivors}
            for reward, survivors in union.tolist()
        ]
    return as_table("references", rows)


def score_runs(
    runs: pd.DataFrame,
    fronts: Sequence[FloatArray],
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Scale],
    indicators: Sequence[str],
) -> pd.DataFrame:
    """Return the table ``indicators``: a row for each run, in the order of ``runs``, and indicator.

    ``fronts`` are the final ones, one for each run. A run without a front, because it failed or
    found nothing feasible, is scored as the single plan that brings nothing back, (0, 0): its area
    is 0, its IGD+ and epsilon are those of that point, and its front has 0 points. Values of a
    mission that differ by at most 1e-12 are made equal by :func:`merge_ties`.
    """
    targets = points_by_mission(references)
    names = references.groupby("mission")["reference"].first()
    rows: list[dict[str, Any]] = []
    identities: Any = runs[["run", "mission", "algorithm", "seed"]].to_dict("records")
    for run, points in zip(identities, fronts, strict=True):
        mission = run["mission"]
        for name in indicators:
            indicator = INDICATORS[name]
            value = indicator.measure(points, targets[mission], missions[mission])
            reference = names[mission] if indicator.needs_reference else None
            rows.append({**run, "indicator": name, "reference": reference, "value": value})
    table = as_table("indicators", rows)
    if rows:
        groups: Any = table.groupby(["mission", "indicator"], sort=False)["value"]
        table["value"] = groups.transform(merge_ties)
    return table


def score_records(
    fronts: Iterable[tuple[str, FloatArray]],
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Scale],
    indicators: Sequence[str],
) -> dict[str, list[float]]:
    """Compute lists ``area``, ``igd_plus``, ..., with a value for each recorded front.

    ``fronts`` are pairs of a mission's label and points (n, 2); a front equal to the one before it
    is not measured again. An indicator that is not wanted is NaN.
    """
    targets = points_by_mission(references)
    scores: dict[str, list[float]] = {"area": [], **{name: [] for name in further_indicators()}}
    wanted = [name for name in scores if name == "area" or name in indicators]
    last: tuple[str, FloatArray] | None = None
    found: dict[str, float] = {}
    for label, points in fronts:
        if last is None or last[0] != label or not np.array_equal(last[1], points):
            last, mission = (label, points), missions[label]
            target = targets.get(label)
            found = {name: INDICATORS[name].measure(points, target, mission) for name in wanted}
        for name, column in scores.items():
            column.append(found.get(name, np.nan))
    return scores


def as_table(name: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return rows as the table of a schema, with typed columns even where there are no rows."""
    table: pd.DataFrame = pa.Table.from_pylist(rows, schema=SCHEMAS[name]).to_pandas()
    return table


def merge_ties(values: ArrayLike) -> FloatArray:
    """Make values (n,) that differ by at most 1e-12 equal.

    Each value is replaced by the largest that a chain of such steps leads to. Rounding would not
    do, as two neighbouring numbers may be rounded apart. Merging again changes nothing.

    >>> merge_ties([0.3, 0.1 + 0.2, 0.2]).tolist()
    [0.30000000000000004, 0.30000000000000004, 0.2]
    """
    given = np.asarray(values, np.float64)
    order = np.argsort(given, kind="stable")
    ordered = given[order]
    last = np.append(np.diff(ordered) > TIE, True)[: len(given)]
    ends = np.flatnonzero(last)
    merged = np.empty_like(given)
    merged[order] = ordered[ends[np.searchsorted(ends, np.arange(len(given)))]]
    return merged


def samples_of(indicators: pd.DataFrame) -> Samples:
    """Return the values of every algorithm by mission and indicator, in the order of the table."""
    samples: Samples = {}
    groups: Any = indicators.groupby(["mission", "indicator", "algorithm"], sort=False)["value"]
    for (mission, indicator, algorithm), found in groups:
        of_mission = samples.setdefault((mission, indicator), {})
        of_mission[algorithm] = found.to_numpy(float)
    return samples


def sign_of(indicator: str) -> int:
    """Return 1 where more is better, -1 where less is, 0 for an indicator that does not judge."""
    return {True: 1, False: -1, None: 0}[INDICATORS[indicator].higher_is_better]


def best_first(indicator: str, medians: ArrayLike) -> FloatArray:
    """Return medians (n,), ties merged, with a sign that makes the smallest the best."""
    return -sign_of(indicator) * merge_ties(medians)


def points_by_mission(references: pd.DataFrame) -> dict[str, FloatArray]:
    """Return the points (n, 2) of each mission's reference front."""
    groups = references.groupby("mission", sort=False)
    return {str(label): front[["reward", "survivors"]].to_numpy(float) for label, front in groups}


def _union(fronts: list[FloatArray]) -> FloatArray:
    """Return the non-dominated points, each once, by descending reward."""
    # -0.0 equals 0.0 and has other bytes.
    points = np.unique(np.concatenate(fronts), axis=0)[::-1] + 0.0
    kept: FloatArray = points[moocore.is_nondominated(points, maximise=True)]
    return kept if len(kept) else np.zeros((1, 2))
