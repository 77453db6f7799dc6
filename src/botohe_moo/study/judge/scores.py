"""Scores of fronts: the reference fronts, and the indicators of all runs and records."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import moocore
import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import ArrayLike

from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import INDICATORS, TIE, Scale, further_indicators
from botohe_moo.study.store.schemas import SCHEMAS
from botohe_moo.study.store.tables import from_arrow

# Values of each algorithm, by mission and indicator.
Samples: TypeAlias = dict[tuple[str, str], dict[str, FloatArray]]

_DIGITS = 16  # of a reference front's digest


def reference_fronts(
    runs: pd.DataFrame,
    fronts: Sequence[FloatArray],
    known: Mapping[str, FloatArray] | None = None,
) -> pd.DataFrame:
    """Return the table ``references``: what all runs on each mission found together.

    They are the non-dominated points of the final ``fronts``, one front for each run, and of the
    best known fronts (n, 2) in ``known``, by label of the mission. Each point is there once, by
    descending reward. Where no run found any, the reference front is the point (0, 0): a plan that
    brings nothing back.
    """
    rows: list[dict[str, Any]] = []
    for mission in runs["mission"].unique():
        of_mission = runs["mission"] == mission
        found = [front for front, its in zip(fronts, of_mission, strict=True) if its]
        union = _union([*found, (known or {}).get(mission, np.empty((0, 2)))])
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
    found nothing feasible, is scored as a plan that brings nothing back: its area is 0, its IGD+
    and epsilon are those of the point (0, 0), and its front has 0 points. Values of a mission that
    differ by at most 1e-12 are made equal by :func:`merge_ties`.
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
    """Compute the columns ``area``, ``igd_plus``, ..., with a value for each recorded front.

    ``fronts`` are pairs of a mission's label and points (n, 2). For speed, a front that equals the
    one before it is not measured again. An indicator that is not wanted is NaN.
    """
    targets = points_by_mission(references)
    scores: dict[str, list[float]] = {"area": [], **{name: [] for name in further_indicators()}}
    wanted = [name for name in scores if name == "area" or name in indicators]
    last: tuple[str, FloatArray] | None = None
    measured: dict[str, float] = {}
    for label, points in fronts:
        if last is None or last[0] != label or not np.array_equal(last[1], points):
            last, mission = (label, points), missions[label]
            target = targets.get(label)
            measured = {name: INDICATORS[name].measure(points, target, mission) for name in wanted}
        for name, column in scores.items():
            column.append(measured.get(name, np.nan))
    return scores


def as_table(name: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return rows as the table of a schema, with typed columns even where there are no rows."""
    return from_arrow(pa.Table.from_pylist(rows, schema=SCHEMAS[name]))


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


def samples_of(indicators: pd.DataFrame) -> Samples:
    """Return the values of every algorithm by mission and indicator, in the order of the table."""
    samples: Samples = {}
    groups: Any = indicators.groupby(["mission", "indicator", "algorithm"], sort=False)["value"]
    for (mission, indicator, algorithm), values in groups:
        samples.setdefault((mission, indicator), {})[algorithm] = values.to_numpy(float)
    return samples


def sign_of(indicator: str) -> int:
    """Return 1 if more is better, -1 if less is, 0 if the indicator does not judge."""
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
    # Adding 0.0 makes -0.0 to 0.0, which would have other bytes in the digest.
    points = np.unique(np.concatenate(fronts), axis=0)[::-1] + 0.0
    union: FloatArray = points[moocore.is_nondominated(points, maximise=True)]
    return union if len(union) else np.zeros((1, 2))
