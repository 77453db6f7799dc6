"""The tables that describe: ``missions``, ``algorithms``, ``summary`` and ``targets``."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import TIE, Scale, area_indicator, further_indicators
from botohe_moo.mission.model import Mission
from botohe_moo.study.file.values import canonical, value_text
from botohe_moo.study.judge.scores import as_table, best_first, merge_ties, points_by_mission
from botohe_moo.study.judge.statistics import generator_for, median_interval

SHARES = (0.9, 0.95, 0.99)  # of the area of a reference front: the targets


def mission_table(
    manifest: Mapping[str, Any],
    missions: Mapping[str, Mission],
    bounds: Mapping[str, FrontBound],
) -> pd.DataFrame:
    """Return the table ``missions``, with a further column for each parameter in a grid.

    ``missions`` and ``bounds`` are by label; not every mission has a bound.
    """
    rows = []
    for label, entry in manifest["missions"].items():
        mission, bound = missions[label], bounds.get(label)
        rows.append(
            {
                **entry,
                "mission": label,
                "name": str(entry["source"]["name_or_path"]),
                "nodes": mission.graph.number_of_nodes(),
                "arcs": mission.graph.number_of_edges(),
                "robots": mission.robots,
                "total_reward": mission.total_reward,
                "bound_area": None if bound is None else bound.area,
                "bound_seconds": None if bound is None else bound.seconds,
            }
        )
    grids = [entry["grid"] for entry in manifest["missions"].values()]
    return _widened("missions", rows, grids, prefix="grid_")


def bound_table(bounds: Mapping[str, FrontBound]) -> pd.DataFrame:
    """Return the table ``bounds``; the bounds are by label of the mission."""
    rows = [
        {"mission": label, "reward": reward, "survivors": survivors}
        for label, bound in bounds.items()
        for reward, survivors in bound.points.tolist()
    ]
    return as_table("bounds", rows)


def algorithm_table(manifest: Mapping[str, Any]) -> pd.DataFrame:
    """Return the table ``algorithms``, with further columns for parameters.

    There is a column for each parameter that the study file gives to any algorithm, and for each
    whose values differ between algorithms that have it, such as one that a class sets for its base.
    """
    # Of an entry, the table has the columns that its schema names.
    rows = [{**entry, "algorithm": label} for label, entry in manifest["algorithms"].items()]
    entries = manifest["algorithms"].values()
    used = [{**entry["effective"], **entry["parameters"]} for entry in entries]
    different: dict[str, set[str]] = {}  # values of each parameter
    for name, value in (pair for values in used for pair in values.items()):
        different.setdefault(name, set()).update([] if value is None else [canonical(value)])
    columns = dict.fromkeys(name for entry in entries for name in entry["parameters"])
    columns |= dict.fromkeys(name for name, values in different.items() if len(values) > 1)
    shown = [{name: values[name] for name in columns if name in values} for values in used]
    return _widened("algorithms", rows, shown, prefix="parameter_")


def _widened(
    name: str, rows: list[dict[str, Any]], parameters: Sequence[Mapping[str, Any]], *, prefix: str
) -> pd.DataFrame:
    """Return a table with a further column for each parameter, in the order of appearance."""
    table = as_table(name, rows)
    for parameter in dict.fromkeys(key for given in parameters for key in given):
        column = parameter
        while column in table:
            column = prefix + column
        table[column] = _typed([given.get(parameter) for given in parameters])
    return table


def _typed(values: list[Any]) -> "pd.Series[Any]":
    """Return a column of the common type of its values; texts where there is none."""
    kinds = {type(value) for value in values if value is not None}
    with suppress(OverflowError):  # an integer of more than 64 bits
        for dtype, numbers in (("boolean", {bool}), ("Int64", {int}), ("float64", {int, float})):
            if kinds and kinds <= numbers:
                return pd.Series(values, dtype=dtype)
    texts = [value if value is None else value_text(value) for value in values]
    return pd.Series(texts, dtype="str")


def summarise(
    runs: pd.DataFrame,
    indicators: pd.DataFrame,
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Scale],
    algorithms: Sequence[str],
    significance: float,
    bounds: Mapping[str, FrontBound],
) -> pd.DataFrame:
    """Return the table ``summary``: the runs of each algorithm on each mission.

    The intervals of median areas are bootstrapped with a generator seeded by the areas, so they do
    not depend on the rest of the study. An algorithm without runs on a mission, as in a study that
    was interrupted, has no row.
    """
    if len(runs):  # ties are merged, as for comparisons
        areas: Any = runs.groupby("mission", sort=False)["area"]
        runs = runs.assign(raw_area=runs["area"], area=areas.transform(merge_ties))
    groups: Any = runs.groupby(["mission", "algorithm"], sort=False)
    runs_of: dict[Any, pd.DataFrame] = dict(iter(groups))
    values: Any = indicators.groupby(["mission", "algorithm", "indicator"])["value"]
    medians = values.median().to_dict()
    whole = _reference_areas(references, missions)
    rows: list[dict[str, Any]] = []
    for mission in missions:
        labels = [label for label in algorithms if (mission, label) in runs_of]
        ranks = stats.rankdata(
            best_first("area", [runs_of[mission, label]["area"].median() for label in labels])
        )
        for label, rank in zip(labels, ranks, strict=True):
            row: dict[str, Any] = {"mission": mission, "algorithm": label, "rank": float(rank)}
            for name in further_indicators():
                row[f"{name}_median"] = medians.get((mission, label, name))
            row |= _described(runs_of[mission, label], significance)
            if whole.get(mission):
                row["area_share"] = row["area_mean"] / whole[mission]
            if mission in bounds:
                row["area_gap"] = bounds[mission].gap_of_area(row["area_mean"])
            rows.append(row)
    return as_table("summary", rows)


def _described(runs: pd.DataFrame, significance: float) -> dict[str, Any]:
    areas = np.sort(runs["area"].to_numpy(float))
    median = float(np.median(areas))
    # The interval is not that of merged values, which depend on the other runs of the study.
    raw = np.sort(runs["raw_area"].to_numpy(float))
    _, low, high = median_interval(raw, confidence=1.0 - significance, rng=generator_for(raw))
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


def reach_targets(
    runs: pd.DataFrame,
    trace: pd.DataFrame,
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Scale],
    algorithms: Sequence[str],
) -> pd.DataFrame:
    """Return the table ``targets``: what reaching 90, 95 and 99 % of the reference area takes.

    A target that is reached between two records counts as reached at the second. Medians are over
    all runs; a run that never reaches a target takes for ever. An algorithm without runs on a
    mission, as in a study that was interrupted, has no rows, nor has a mission whose reference
    front has no area.
    """
    areas = _reference_areas(references, missions)
    runs = runs[runs["mission"].map(areas).astype(float) > 0].reset_index(drop=True)
    reference_areas = trace["mission"].map(areas).to_numpy(float)
    keys, columns = ["mission", "algorithm"], ["evaluations", "seconds"]
    parts = []
    for share in SHARES:
        reached = trace[trace["area"].to_numpy(float) >= share * reference_areas - TIE]
        first = reached.drop_duplicates("run").set_index("run")[columns].astype(float)
        spent = runs[keys].assign(**first.reindex(runs["run"]).reset_index(drop=True))
        medians = spent.fillna({"evaluations": np.inf, "seconds": np.inf}).groupby(keys)[columns]
        part = medians.median().replace(np.inf, np.nan).add_suffix("_median")
        counts = spent.groupby(keys)["seconds"].agg(n="size", n_reached="count")
        parts.append(part.join(counts).assign(share=share))
    table = pd.concat(parts).reset_index()
    table["target"] = table["share"] * table["mission"].map(areas).astype(float)
    order: Any = {"mission": list(missions), "algorithm": list(algorithms), "share": list(SHARES)}
    table = table.sort_values(list(order), key=lambda column: column.map(order[column.name].index))
    rows: Any = table.to_dict("records")
    return as_table("targets", rows)


def _reference_areas(references: pd.DataFrame, missions: Mapping[str, Scale]) -> dict[str, float]:
    """Return the area of the reference front of each mission that has runs."""
    fronts = points_by_mission(references)
    return {label: area_indicator(fronts[label], missions[label]) for label in fronts}
