"""Making the tables of a study from the outcomes of its runs: scores, summaries, descriptions."""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import chain
from typing import Any

import moocore
import numpy as np
import pandas as pd
from scipy import stats

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import INDICATORS, TIE, Scale, area_indicator, further_indicators
from botohe_moo.library import best_known, certified_bound
from botohe_moo.mission.model import Mission
from botohe_moo.study import statistics as st
from botohe_moo.study.content import canonical, value_text
from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.model import Run, Study, StudyError
from botohe_moo.study.perform import Outcome, Record
from botohe_moo.study.pool import environment
from botohe_moo.study.tables import OBJECTIVES, SCHEMAS, as_table, write_tables

IDENTITY = ["run", "mission", "algorithm", "seed"]  # columns
_TRACED = ["evaluations", "seconds", "front_size", "ties"]  # of a record


def reference_fronts(
    runs: pd.DataFrame,
    fronts: Sequence[FloatArray],
    known: Mapping[str, FloatArray],
    columns: Sequence[str] = OBJECTIVES,
) -> pd.DataFrame:
    """Return the table ``references``: what all runs on each mission found together.

    They are the non-dominated points of the final ``fronts``, one front for each run, and of the
    best known fronts in ``known``, by label of the mission. ``columns`` are those of the
    objectives. Each point is there once, by descending reward. Where no run found any, the
    reference front is the point of zeros: a plan that brings nothing back.
    """
    none, parts = np.empty((0, len(columns))), []
    for mission in runs["mission"].unique():
        found = [front for front, of in zip(fronts, runs["mission"], strict=True) if of == mission]
        points = np.unique(np.concatenate([none, *found, known.get(mission, none)]), axis=0)[::-1]
        union = points[moocore.is_nondominated(points, maximise=True)] + 0.0  # without -0.0
        union = union if len(union) else np.zeros((1, len(columns)))
        parts.append(pd.DataFrame(union, columns=[*columns]).assign(mission=mission))
    return as_table("references", pd.concat(parts, ignore_index=True) if parts else [], columns)


def score_fronts(
    fronts: Iterable[tuple[str, FloatArray]],
    references: pd.DataFrame,
    *,
    missions: Mapping[str, Scale],
    indicators: Sequence[str],
) -> pd.DataFrame:
    """Compute indicators: a column for each of them, a row for each front.

    ``fronts`` are pairs of a mission's label and points (n, n_objectives). For speed, a front that
    equals the one before it is not measured again.
    """
    targets, rows = points_by_mission(references), []
    last: tuple[str | None, FloatArray] = None, np.empty(0)
    row: dict[str, float] = {}
    for label, points in fronts:
        if label != last[0] or not np.array_equal(points, last[1]):
            given = points, targets.get(label), missions[label]
            row = {name: INDICATORS[name](*given) for name in indicators}
        last = label, points
        rows.append(row)
    return pd.DataFrame(rows, columns=[*indicators], dtype=float)


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
    differ by at most 1e-12 are made equal by ``merge_ties``.
    """
    labelled = zip(runs["mission"], fronts, strict=True)
    scores = score_fronts(labelled, references, missions=missions, indicators=indicators)
    groups: Any = scores.groupby(runs["mission"].to_numpy())
    parts = []
    for name in indicators:
        value = groups[name].transform(st.merge_ties).to_numpy()
        parts.append(runs[IDENTITY].assign(indicator=name, value=value))
    return as_table("indicators", pd.concat(parts).sort_index(kind="stable"))


def points_by_mission(references: pd.DataFrame) -> dict[str, FloatArray]:
    """Return the points (n, n_objectives) of each mission's reference front."""
    points = references.drop(columns="mission")
    groups = points.groupby(references["mission"], sort=False)
    return {str(label): front.to_numpy(float) for label, front in groups}


SHARES = (0.9, 0.95, 0.99)  # of the area of a reference front: the targets


def mission_table(
    manifest: Mapping[str, Any], missions: Mapping[str, Mission], bounds: Mapping[str, FrontBound]
) -> pd.DataFrame:
    """Return the table ``missions``, with a further column for each parameter in a grid.

    ``missions`` and ``bounds`` are by label; not every mission has a bound.
    """
    rows = []
    for label, entry in manifest["missions"].items():
        mission, bound = missions[label], bounds.get(label)
        described = {
            "mission": label,
            "name": str(entry["source"]["name_or_path"]),
            "nodes": mission.graph.number_of_nodes(),
            "arcs": mission.graph.number_of_edges(),
            "robots": mission.robots,
            "total_reward": mission.total_reward,
            "bound_area": getattr(bound, "area", None),
            "bound_seconds": getattr(bound, "seconds", None),
        }
        rows.append({**entry, **described})
    return _widened("missions", rows, [row["grid"] for row in rows], prefix="grid_")


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
    rows = [{**entry, "algorithm": label} for label, entry in manifest["algorithms"].items()]
    used = [row["effective"] | row["parameters"] for row in rows]
    known = [{k: canonical(value) for k, value in of.items() if value is not None} for of in used]
    n_different = pd.DataFrame(known).nunique()
    columns = {*n_different.index[n_different > 1], *chain(*(row["parameters"] for row in rows))}
    shown = [{name: value for name, value in of.items() if name in columns} for of in used]
    return _widened("algorithms", rows, shown, prefix="parameter_")


def _widened(
    name: str, rows: list[dict[str, Any]], parameters: Sequence[Mapping[str, Any]], *, prefix: str
) -> pd.DataFrame:
    """Return a table with a further column for each parameter.

    Of the rows, it has the items that its schema names.
    """
    table = as_table(name, rows)
    for parameter in dict.fromkeys(key for given in parameters for key in given):
        column = prefix + parameter if parameter in table else parameter
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
    areas: Mapping[str, float],
    *,
    significance: float,
    bounds: Mapping[str, FrontBound],
) -> pd.DataFrame:
    """Return the table ``summary``: the runs of each algorithm on each mission, in their order.

    ``areas`` are those of the reference fronts, by mission. The intervals of median areas are
    bootstrapped with a generator seeded by the areas, so they do not depend on the rest of the
    study. An algorithm without runs on a mission, as in a study that was interrupted, has no row.
    """
    runs = runs.assign(merged=runs.groupby("mission")["area"].transform(st.merge_ties))
    keys = ["mission", "algorithm"]
    groups: Any = runs.groupby(keys, sort=False)
    table = pd.DataFrame([_described(own, significance) for _, own in groups])
    if table.empty:
        return as_table("summary", [])
    medians = indicators.pivot_table("value", keys, "indicator", aggfunc="median")
    further = medians[[name for name in further_indicators(map(str, medians)) if name in medians]]
    table = table.join(further.add_suffix("_median"), on=keys)
    by_mission = table.groupby("mission")["area_median"]
    table["rank"] = by_mission.transform(lambda m: stats.rankdata(st.best_first("area", m)))
    table["area_share"] = table["area_mean"] / table["mission"].map(areas).replace(0.0, np.nan)
    table["area_gap"] = [
        bounds[mission].gap_of_area(area) if mission in bounds else np.nan
        for mission, area in zip(table["mission"], table["area_mean"], strict=True)
    ]
    return as_table("summary", table)


def _described(runs: pd.DataFrame, significance: float) -> dict[str, Any]:
    areas = np.sort(runs["merged"].to_numpy(float))
    median = float(np.median(areas))
    # The interval is not that of merged values, which depend on the other runs of the study.
    low, high = st.median_interval(runs["area"], confidence=1.0 - significance)
    return {
        **runs[["mission", "algorithm"]].iloc[0],
        "n": len(runs),
        "n_not_done": int((runs["status"] != "done").sum()),
        "area_median": median,
        "area_low": low,
        "area_high": max(high, median),
        "area_mean": float(areas.mean()),
        "area_sd": float(areas.std(ddof=1)) if len(areas) > 1 else None,
        "area_best": float(areas[-1]),
        **runs[["front_size", "evaluations", "seconds"]].median().add_suffix("_median"),
    }


def reach_targets(
    runs: pd.DataFrame, trace: pd.DataFrame, areas: Mapping[str, float]
) -> pd.DataFrame:
    """Return the table ``targets``: what reaching 90, 95 and 99 % of the reference area takes.

    ``areas`` are those of the reference fronts, by mission. A target that is reached between two
    records counts as reached at the second. Medians are over all runs; a run that never reaches a
    target counts as infinite. An algorithm without runs on a mission, as in a study that was
    interrupted, has no rows, nor has a mission whose reference front has no area.
    """
    runs = runs[runs["mission"].map(areas).astype(float) > 0].reset_index(drop=True)
    reference_areas = trace["mission"].map(areas).to_numpy(float)
    keys, columns = ["mission", "algorithm"], ["evaluations", "seconds"]
    parts = []
    for share in SHARES:
        reached = trace[trace["area"].to_numpy(float) >= share * reference_areas - TIE]
        first = reached.drop_duplicates("run").set_index("run")[columns].astype(float)
        spent = runs[keys].assign(**first.reindex(runs["run"]).reset_index(drop=True))
        endless = spent.fillna(dict.fromkeys(columns, np.inf)).groupby(keys, sort=False)[columns]
        part = endless.median().replace(np.inf, np.nan).add_suffix("_median")
        counts = spent.groupby(keys)["seconds"].agg(n="size", n_reached="count")
        parts.append(part.join(counts).assign(share=share).reset_index())
    table = pd.concat(parts).sort_index(kind="stable")
    table["target"] = table["share"] * table["mission"].map(areas).astype(float)
    return as_table("targets", table)


def collect_tables(study: Study, folder: StudyFolder) -> None:
    """Make all tables of a study from the runs and bounds that are in its folder, and write them.

    A StudyError names a file that is damaged, or a bound that a run refutes.
    """
    kept = {mission.label: folder.bound(mission) for mission in study.bounded}
    bounds = {label: found[0] for label, found in kept.items() if found}
    known = {}
    for label, name in study.best_known.items():
        front, certified = best_known(name), certified_bound(name)
        # Evaluated again, since files have 12 digits, and runs that find the same plans have more.
        known[label] = front.mission.evaluate(front.plans)
        bounds[label] = min(bounds.get(label, certified), certified, key=lambda bound: bound.area)
    manifest = study.manifest()
    missions = {mission.label: mission.mission for mission in study.missions}
    tables = {
        **_judged(study, folder.outcomes(study.runs()), bounds, known),
        "missions": mission_table(manifest, missions, bounds),
        "bounds": bound_table(bounds),
        "algorithms": algorithm_table(manifest),
    }
    areas: dict[Any, float] = tables["runs"].groupby("mission")["area"].max().to_dict()
    for label, bound in bounds.items():
        if (area := areas.get(label, 0.0)) > bound.area + TIE:
            raise StudyError(
                f"A run on {label} has found an area of {area:.6f}, so its bound is wrong: "
                f"{bound.area:.6f}. Remove its file from the folder bounds, run the study "
                "again, and report it if it happens again."
            )
    write_tables(folder.path, tables, manifest)


def _judged(
    study: Study,
    outcomes: Iterable[tuple[Run, Outcome]],
    bounds: Mapping[str, FrontBound],
    known: Mapping[str, FloatArray],
) -> dict[str, pd.DataFrame]:
    """Return all tables but ``missions``, ``bounds`` and ``algorithms``."""
    columns, indicators = study.missions[0].objectives.columns, study.file.indicators
    control, significance = study.file.comparison.control, study.file.comparison.significance
    algorithms = [algorithm.label for algorithm in study.algorithms]
    scales = {of.label: of.own_objectives or of.mission for of in study.missions}
    frames, fronts, finals = _recorded(outcomes, columns)
    runs, trace = frames["runs"], frames["trace"]
    references = reference_fronts(runs, finals, known, columns)
    scored = ["area", *(name for name in further_indicators(indicators) if name in indicators)]
    labelled = zip(trace["mission"], fronts, strict=True)
    measured = score_fronts(labelled, references, missions=scales, indicators=scored)
    frames["trace"] = trace = trace.join(measured)
    runs["area"] = runs["run"].map(trace.groupby("run")["area"].last()).fillna(0.0)
    tables = {name: as_table(name, frame, columns) for name, frame in frames.items()}
    scores = score_runs(runs, finals, references, missions=scales, indicators=indicators)
    digests = {mission.label: mission.digest for mission in study.missions}
    tests: Any = {"algorithms": algorithms, "significance": significance}
    ranks = st.rank_algorithms(scores, digests=digests, **tests)
    targets = points_by_mission(references)
    areas = {label: area_indicator(targets[label], scales[label]) for label in targets}
    return tables | {
        "references": references,
        "indicators": scores,
        "comparisons": st.compare_algorithms(scores, control=control, **tests),
        "ranks": ranks,
        "posthoc": st.compare_ranks(ranks, significance=significance),
        "summary": summarise(runs, scores, areas, significance=significance, bounds=bounds),
        "targets": reach_targets(runs, trace, areas),
    }


def _recorded(
    outcomes: Iterable[tuple[Run, Outcome]], columns: Sequence[str]
) -> tuple[dict[str, pd.DataFrame], list[FloatArray], list[FloatArray]]:
    """Return what runs have recorded, without scores: tables, all fronts, and the final ones.

    The tables are ``runs``, ``trace``, ``fronts``, ``plans`` and ``environments``.
    """
    runs, trace, environments = [], [], {}
    fronts, finals, trails, points = [], [], [], []
    none = np.empty((0, len(columns)))
    for run, outcome in outcomes:
        of_run = outcome.environment or environment()
        environments[of_run["environment"]] = of_run
        last = outcome.records[-1] if outcome.records else Record(0, 0.0, none, 0)
        identity = (run.digest, run.mission.label, run.algorithm.label, run.seed)
        described = {
            **dict(zip(IDENTITY, identity, strict=True)),
            "budget_evaluations": run.mission.budget.evaluations,
            "budget_seconds": run.mission.budget.seconds,
            "min_survival": run.mission.min_survival,
            "max_length": run.mission.max_length,
            "front_size": last.front_size,
            "ties": last.ties,
            "environment": of_run["environment"],
        }
        runs.append({**vars(outcome), **described})
        for record in outcome.records:
            fronts.append(record.objectives)
            trace.append([*identity, *(getattr(record, name) for name in _TRACED)])
        found, objectives = last.plans or ((), none)
        finals.append(last.objectives)
        points.append(objectives)
        labelled = map(run.mission.mission.labels, found)
        trails += [json.dumps(plan, ensure_ascii=False) for plan in labelled]
    tables = {
        "runs": pd.DataFrame(runs, columns=[*SCHEMAS["runs"]]),
        "trace": pd.DataFrame(trace, columns=[*IDENTITY, *_TRACED]),
        "environments": pd.DataFrame([environments[digest] for digest in sorted(environments)]),
    }
    plans = _with_points(tables["runs"], points, columns)
    tables["plans"] = plans.assign(trails=trails, plan_id=plans.groupby("run").cumcount())
    tables["fronts"] = _with_points(tables["trace"], fronts, columns)
    return tables, fronts, finals


def _with_points(
    frame: pd.DataFrame, fronts: Sequence[FloatArray], columns: Sequence[str]
) -> pd.DataFrame:
    """Return a row for each point of the fronts; each row of ``frame`` has one front."""
    rows = np.repeat(np.arange(len(frame)), np.array(list(map(len, fronts)), int))
    points = np.concatenate([np.empty((0, len(columns))), *fronts])
    repeated = frame.take(rows).reset_index(drop=True)
    return repeated.assign(**dict(zip(columns, points.T, strict=True)))
