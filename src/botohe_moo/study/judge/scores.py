"""What the final fronts of a study are worth: reference fronts, and indicators of every run."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import moocore
import numpy as np
import pandas as pd
import pyarrow as pa

from botohe_moo._base.checks import nearest_first
from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import area_indicator, epsilon_indicator, igd_plus_indicator
from botohe_moo.mission.model import Mission
from botohe_moo.study.judge.ties import merge_ties
from botohe_moo.study.store.tables import SCHEMAS

__all__ = ["INDICATORS", "Indicator", "as_table", "check_indicators", "reference_fronts"]
__all__ += ["score_runs"]

_DIGITS = 16
_NO_FRONT = np.empty((0, 2))


@dataclass(frozen=True)
class Indicator:
    """How an indicator of a front is shown and read.

    Attributes
    ----------
    label
        What reports call it.
    higher_is_better
        Whether a larger value is better; None for one that describes and does not judge.
    needs_reference
        Whether it is measured against the union front of the study.
    """

    label: str
    higher_is_better: bool | None
    needs_reference: bool


INDICATORS: Mapping[str, Indicator] = MappingProxyType(
    {
        "area": Indicator("area", higher_is_better=True, needs_reference=False),
        "igd_plus": Indicator("IGD+", higher_is_better=False, needs_reference=True),
        "epsilon": Indicator("epsilon", higher_is_better=False, needs_reference=True),
        "front_size": Indicator("front size", higher_is_better=None, needs_reference=False),
    }
)


def reference_fronts(runs: pd.DataFrame, final_fronts: pd.DataFrame) -> pd.DataFrame:
    """Find for each mission what all runs on it found together.

    Parameters
    ----------
    runs
        One row a run: columns ``run`` and ``mission``.
    final_fronts
        The points of the final fronts: columns ``run``, ``reward`` and ``survivors``, in any
        order. Runs that found nothing have none.

    Returns
    -------
    pandas.DataFrame
        The table ``references``: the non-dominated points of each mission, each once, by
        descending reward. Where no run found anything, the single point (0, 0): the plan that
        brings nothing back.
    """
    fronts = _by_run(final_fronts)
    rows: list[dict[str, Any]] = []
    for mission in runs["mission"].unique():
        names = runs.loc[runs["mission"] == mission, "run"].unique()
        union = _union([fronts[run] for run in names if run in fronts])
        digest = hashlib.sha256(union.astype("<f8").tobytes()).hexdigest()[:_DIGITS]
        rows += [
            {"reference": digest, "mission": mission, "reward": reward, "survivors": survivors}
            for reward, survivors in union.tolist()
        ]
    return as_table("references", rows)


def score_runs(
    runs: pd.DataFrame,
    final_fronts: pd.DataFrame,
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Mission],
    indicators: Sequence[str],
) -> pd.DataFrame:
    """Compute the indicators of every run, also of those without a front.

    A run without a front, because it failed or found nothing feasible, is scored as the single
    plan that brings nothing back, (0, 0): its area is 0, its IGD+ and epsilon are those of that
    point, and its front has 0 points.

    Parameters
    ----------
    runs
        One row a run: columns ``run``, ``mission``, ``algorithm``, ``seed`` and ``front_size``.
    final_fronts
        The points of the final fronts: columns ``run``, ``reward`` and ``survivors``.
    references
        The reference fronts, of :func:`reference_fronts`.
    missions
        The missions by label.
    indicators
        Names of indicators, keys of ``INDICATORS``.

    Returns
    -------
    pandas.DataFrame
        The table ``indicators``: for each run, in the order of ``runs``, one row per indicator.
        Values of a mission that differ by at most 1e-12 are equal in it: see :func:`merge_ties`.

    Raises
    ------
    ValueError
        If an indicator is not known, a mission has no reference front where one is needed, or the
        size of a run's front is not the number of its points.
    """
    check_indicators(indicators)
    fronts = _by_run(final_fronts)
    targets = {
        mission: (str(front["reference"].iloc[0]), _points(front))
        for mission, front in references.groupby("mission", sort=False)
    }
    rows: list[dict[str, Any]] = []
    identities: Any = runs[["run", "mission", "algorithm", "seed"]].to_dict("records")
    for run, size in zip(identities, runs["front_size"].tolist(), strict=True):
        points, label = fronts.get(run["run"], _NO_FRONT), run["run"]
        if size != len(points):
            raise ValueError(f"Run {label}: expected a front of {size} points, got {len(points)}.")
        mission = missions[run["mission"]]
        for name in indicators:
            row = {**run, "indicator": name, "reference": None}
            if INDICATORS[name].needs_reference:
                if run["mission"] not in targets:
                    raise ValueError(f"Expected a reference front of mission {run['mission']!r}.")
                row["reference"], target = targets[run["mission"]]
                measure = igd_plus_indicator if name == "igd_plus" else epsilon_indicator
                row["value"] = measure(points, target, mission)
            else:
                row["value"] = area_indicator(points, mission) if name == "area" else float(size)
            rows.append(row)
    table = as_table("indicators", rows)
    if rows:
        groups: Any = table.groupby(["mission", "indicator"], sort=False)["value"]
        table["value"] = groups.transform(merge_ties)
    return table


def check_indicators(names: Iterable[str]) -> None:
    """Refuse names that are no indicators.

    Raises
    ------
    ValueError
        Names the first unknown one, and the known ones, nearest first.
    """
    for name in names:
        if name not in INDICATORS:
            known = ", ".join(nearest_first(str(name), INDICATORS))
            raise ValueError(f"There is no indicator {name!r}; known are {known}.")


def as_table(name: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Give rows as a table of a study; columns have their types also where there are no rows.

    Parameters
    ----------
    name
        Name of the table, a key of ``SCHEMAS``.
    rows
        Values by column; None, or no value, where one is missing.
    """
    table: pd.DataFrame = pa.Table.from_pylist(rows, schema=SCHEMAS[name]).to_pandas()
    return table


def _by_run(final_fronts: pd.DataFrame) -> dict[str, FloatArray]:
    points, rows = _points(final_fronts), final_fronts.groupby("run", sort=False).indices
    return {str(run): points[of_run] for run, of_run in rows.items()}


def _points(front: pd.DataFrame) -> FloatArray:
    return front[["reward", "survivors"]].to_numpy(np.float64)


def _union(fronts: list[FloatArray]) -> FloatArray:
    """Give the non-dominated points, each once, by descending reward."""
    if not fronts:
        return np.zeros((1, 2))
    # -0.0 equals 0.0 and has other bytes.
    points = np.unique(np.concatenate(fronts), axis=0)[::-1] + 0.0
    kept: FloatArray = points[moocore.is_nondominated(points, maximise=True)]
    return kept
