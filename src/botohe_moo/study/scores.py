"""Making the tables of a study from the outcomes of its runs: scores, summaries, descriptions."""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence, Sized
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
from botohe_moo.study.folder import OUTCOME_FIELDS, StudyFolder
from botohe_moo.study.model import Run, Study, StudyError
from botohe_moo.study.perform import Outcome
from botohe_moo.study.pool import environment
from botohe_moo.study.tables import OBJECTIVES, SCHEMAS, as_table, write_tables

_DIGITS = 16  # of a reference front's digest


def reference_fronts(
    runs: pd.DataFrame,
    fronts: Sequence[FloatArray],
    known: Mapping[str, FloatArray] | None = None,
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
        union = _union([none, *found, (known or {}).get(mission, none)])
        digest = hashlib.sha256(union.astype("<f8").tobytes()).hexdigest()[:_DIGITS]
        part = pd.DataFrame(union, columns=[*columns])
        parts.append(part.assign(reference=digest, mission=mission))
    return as_table("references", pd.concat(parts, ignore_index=True) if parts else [], columns)


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
    targets = points_by_mission(references)
    names = references.groupby("mission")["reference"].first()
    rows: list[dict[str, Any]] = []
    identities: Any = runs[["run", "mission", "algorithm", "seed"]].to_dict("records")
    for run, points in zip(identities, fronts, strict=True):
        mission = run["mission"]
        for name in indicators:
            indicator = INDICATORS[name]
            value = indicator(points, targets[mission], missions[mission])
            reference = names[mission] if indicator.needs_reference else None
            rows.append({**run, "indicator": name, "reference": reference, "value": value})
    table = as_table("indicators", rows)
    if rows:
        groups: Any = table.groupby(["mission", "indicator"], sort=False)["value"]
        table["value"] = groups.transform(st.merge_ties)
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
    targets, names = points_by_mission(references), ["area", *further_indicators(indicators)]
    scores: dict[str, list[float]] = {name: [] for name in names}
    last: tuple[str | None, FloatArray] = None, np.empty(0)
    for label, points in fronts:
        is_new = label != last[0] or not np.array_equal(points, last[1])
        last = label, points
        for name, column in scores.items():
            if not is_new:
                column.append(column[-1])
            elif name == "area" or name in indicators:
                of_mission = targets.get(label), missions[label]
                column.append(INDICATORS[name](points, *of_mission))
            else:
                column.append(np.nan)
    return scores


def points_by_mission(references: pd.DataFrame) -> dict[str, FloatArray]:
    """Return the points (n, n_objectives) of each mission's reference front."""
    points = references.drop(columns=["reference", "mission"])
    groups = points.groupby(references["mission"], sort=False)
    return {str(label): front.to_numpy(float) for label, front in groups}


def _union(fronts: list[FloatArray]) -> FloatArray:
    """Return the non-dominated points, each once, by descending reward."""
    # Adding 0.0 makes -0.0 to 0.0, which would have other bytes in the digest.
    points = np.unique(np.concatenate(fronts), axis=0)[::-1] + 0.0
    union: FloatArray = points[moocore.is_nondominated(points, maximise=True)]
    return union if len(union) else np.zeros((1, points.shape[1]))


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
    areas: Any = runs.groupby("mission", sort=False)["area"]
    merged = runs.assign(raw_area=runs["area"], area=areas.transform(st.merge_ties))
    groups: Any = merged.groupby(["mission", "algorithm"], sort=False)
    runs_of: dict[Any, pd.DataFrame] = dict(iter(groups))
    values: Any = indicators.groupby(["mission", "algorithm", "indicator"])["value"]
    medians = values.median().to_dict()
    whole = _reference_areas(references, missions)
    rows: list[dict[str, Any]] = []
    for mission in missions:
        labels = [label for label in algorithms if (mission, label) in runs_of]
        of_labels = [runs_of[mission, label]["area"].median() for label in labels]
        ranks = stats.rankdata(st.best_first("area", of_labels))
        for label, rank in zip(labels, ranks, strict=True):
            row = _described(runs_of[mission, label], significance)
            row |= {"mission": mission, "algorithm": label, "rank": float(rank)}
            for name in further_indicators(indicators["indicator"].unique()):
                row[f"{name}_median"] = medians.get((mission, label, name))
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
    _, low, high = st.median_interval(raw, confidence=1.0 - significance, rng=st.generator_for(raw))
    return {
        "n": len(runs),
        "n_not_done": int((runs["status"] != "done").sum()),
        "area_median": median,
        "area_low": min(low, median),
        "area_high": max(high, median),
        "area_mean": float(areas.mean()),
        "area_sd": float(areas.std(ddof=1)) if len(areas) > 1 else None,
        "area_best": float(areas[-1]),
        **runs[["front_size", "evaluations", "seconds"]].median().add_suffix("_median"),
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
    all runs; a run that never reaches a target counts as infinite. An algorithm without runs on a
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


def collect_tables(study: Study, folder: StudyFolder) -> None:
    """Make all tables of a study from the runs and bounds that are in its folder, and write them.

    A StudyError names a file that is damaged, or a bound that a run refutes.
    """
    outcomes = list(folder.outcomes(study.runs()))
    missions = {mission.label: mission.mission for mission in study.missions}
    manifest = study.manifest()
    kept = {mission.label: folder.bound(mission) for mission in study.bounded}
    bounds = {label: found[0] for label, found in kept.items() if found}
    known = {}
    for label, name in study.best_known.items():
        front, certified = best_known(name), certified_bound(name)
        # Evaluated again, since files have 12 digits, and runs that find the same plans have more.
        known[label] = front.mission.evaluate(front.plans)
        bounds[label] = min(bounds.get(label, certified), certified, key=lambda bound: bound.area)
    tables = {
        **_judged(study, outcomes, bounds, known),
        "missions": mission_table(manifest, missions, bounds),
        "bounds": bound_table(bounds),
        "algorithms": algorithm_table(manifest),
    }
    _check_bounds(bounds, tables["runs"])
    write_tables(folder.path, tables, manifest)


def _check_bounds(bounds: Mapping[str, FrontBound], runs: pd.DataFrame) -> None:
    """Raise a StudyError if a run's area is above the bound: then one of them is wrong."""
    for label, bound in bounds.items():
        area = runs.loc[runs["mission"] == label, "area"].max()
        if area > bound.area + TIE:
            raise StudyError(
                f"The bound of {label} says that no front has an area above {bound.area:.6f}, but "
                f"a run has found {area:.6f}. If the study has computed it, remove its file from "
                "the folder bounds, and run the study again; please report it, if it happens again."
            )


def _judged(
    study: Study,
    outcomes: Sequence[tuple[Run, Outcome]],
    bounds: Mapping[str, FrontBound],
    known: Mapping[str, FloatArray],
) -> dict[str, pd.DataFrame]:
    """Return all tables but ``missions``, ``bounds`` and ``algorithms``."""
    scales = {
        mission.label: mission.own_objectives or mission.mission for mission in study.missions
    }
    columns, indicators = study.missions[0].objectives.columns, study.file.indicators
    comparison: Any = {
        "algorithms": [algorithm.label for algorithm in study.algorithms],
        "significance": study.file.comparison.significance,
    }
    tables = _recorded(outcomes, columns)
    none = np.empty((0, len(columns)))
    fronts = [[record.objectives for record in outcome.records] for _, outcome in outcomes]
    finals = [of_run[-1] if of_run else none for of_run in fronts]
    references = reference_fronts(tables["runs"], finals, known, columns)
    labelled = zip(tables["trace"]["mission"], chain.from_iterable(fronts), strict=True)
    measured = score_records(labelled, references, missions=scales, indicators=indicators)
    trace = tables["trace"].assign(**measured)
    areas = tables["runs"]["run"].map(trace.groupby("run")["area"].last()).fillna(0.0)
    tables |= {"runs": tables["runs"].assign(area=areas), "trace": trace}
    tables = {name: as_table(name, frame, columns) for name, frame in tables.items()}
    runs, trace = tables["runs"], tables["trace"]
    scores = score_runs(runs, finals, references, missions=scales, indicators=indicators)
    digests = {mission.label: mission.digest for mission in study.missions}
    ranks = st.rank_algorithms(scores, digests=digests, **comparison)
    control, algorithms = study.file.comparison.control, comparison["algorithms"]
    return tables | {
        "references": references,
        "indicators": scores,
        "comparisons": st.compare_algorithms(scores, runs=runs, control=control, **comparison),
        "ranks": ranks,
        "posthoc": st.compare_ranks(ranks, significance=comparison["significance"]),
        "summary": summarise(
            runs, scores, references, missions=scales, bounds=bounds, **comparison
        ),
        "targets": reach_targets(runs, trace, references, missions=scales, algorithms=algorithms),
    }


def _recorded(
    outcomes: Sequence[tuple[Run, Outcome]], columns: Sequence[str]
) -> dict[str, pd.DataFrame]:
    """Return ``runs``, ``trace``, ``fronts``, ``plans`` and ``environments``, without scores."""
    environments = [outcome.environment or environment() for _, outcome in outcomes]
    distinct = {columns["environment"]: columns for columns in environments}
    runs = pd.DataFrame(
        [
            _run_row(run, outcome, columns["environment"])
            for (run, outcome), columns in zip(outcomes, environments, strict=True)
        ],
        columns=[*SCHEMAS["runs"]],
    )
    identities = runs[["run", "mission", "algorithm", "seed"]]
    records = [record for _, outcome in outcomes for record in outcome.records]
    names = ("evaluations", "seconds", "front_size", "ties")
    trace = _repeated(identities, [outcome.records for _, outcome in outcomes]).assign(
        **{name: [getattr(record, name) for record in records] for name in names}
    )
    none: tuple[Any, FloatArray] = (), np.empty((0, len(columns)))
    finals = [
        (outcome.records[-1].plans if outcome.records else None) or none for _, outcome in outcomes
    ]
    plans = _with_points(identities, [objectives for _, objectives in finals], columns)
    trails = [
        json.dumps(run.mission.mission.labels(plan), ensure_ascii=False)
        for (run, _), (batch, _) in zip(outcomes, finals, strict=True)
        for plan in batch
    ]
    return {
        "runs": runs,
        "trace": trace,
        "fronts": _with_points(trace, [record.objectives for record in records], columns),
        "plans": plans.assign(trails=trails, plan_id=plans.groupby("run").cumcount()),
        "environments": pd.DataFrame(
            [distinct[digest] for digest in sorted(distinct)], columns=[*SCHEMAS["environments"]]
        ),
    }


def _run_row(run: Run, outcome: Outcome, environment: str) -> dict[str, Any]:
    budget, last = run.mission.budget, outcome.records[-1] if outcome.records else None
    return {
        **{name: getattr(outcome, name) for name in OUTCOME_FIELDS},
        "run": run.digest,
        "mission": run.mission.label,
        "algorithm": run.algorithm.label,
        "seed": run.seed,
        "budget_evaluations": budget.evaluations,
        "budget_seconds": budget.seconds,
        "min_survival": run.mission.min_survival,
        "max_length": run.mission.max_length,
        "front_size": last.front_size if last else 0,
        "ties": last.ties if last else 0,
        "environment": environment,
    }


def _repeated(frame: pd.DataFrame, parts: Sequence[Sized]) -> pd.DataFrame:
    """Return each row of ``frame`` as often as its part has items."""
    rows = np.repeat(np.arange(len(frame)), np.array(list(map(len, parts)), int))
    return frame.take(rows).reset_index(drop=True)


def _with_points(
    frame: pd.DataFrame, fronts: Sequence[FloatArray], columns: Sequence[str]
) -> pd.DataFrame:
    """Return a row for each point of the fronts; each row of ``frame`` has one front."""
    points = np.concatenate([np.empty((0, len(columns))), *fronts])
    return _repeated(frame, fronts).assign(**dict(zip(columns, points.T, strict=True)))
