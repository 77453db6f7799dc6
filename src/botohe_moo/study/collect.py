"""From the files of finished runs to the study's tables."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from botohe_moo.indicators import area_indicator
from botohe_moo.study.environment import environment
from botohe_moo.study.grid import Run, Study
from botohe_moo.study.scores import reference_fronts, score_runs
from botohe_moo.study.statistics import compare_algorithms, rank_algorithms, summarise
from botohe_moo.study.store import DamagedError, Store, writing
from botohe_moo.study.tables import SCHEMAS, write_tables
from botohe_moo.study.task import Outcome

__all__ = ["collect_tables"]


def collect_tables(study: Study, store: Store) -> dict[str, pd.DataFrame]:
    """Make all tables of a study and write them to its folder.

    Parameters
    ----------
    study
        The study.
    store
        Its folder; runs that are not there, or whose files are damaged, are not in the tables.

    Returns
    -------
    dict
        The tables by name.

    Raises
    ------
    StudyError
        If the folder cannot be written to.
    """
    pieces: dict[str, list[pd.DataFrame]] = {name: [] for name in ("trace", "fronts", "plans")}
    rows: list[dict[str, Any]] = []
    environments: dict[str, dict[str, Any]] = {}
    finals: list[pd.DataFrame] = []
    for run, outcome in _outcomes(study, store):
        where = outcome.environment or environment()
        environments[where["environment"]] = where
        rows.append(_run_row(run, outcome, where["environment"]))
        if outcome.records:
            pieces["trace"].append(_trace(run, outcome))
            pieces["fronts"].append(_fronts(run, outcome))
            pieces["plans"].append(_plans(run, outcome))
            last = outcome.records[-1].objectives
            finals.append(_frame(run, {"reward": last[:, 0], "survivors": last[:, 1]}))
    tables = {name: _joined(name, found) for name, found in pieces.items()}
    tables["runs"] = _typed("runs", pd.DataFrame(rows, columns=SCHEMAS["runs"].names))
    tables["environments"] = _typed(
        "environments",
        pd.DataFrame(
            [environments[key] for key in sorted(environments)],
            columns=SCHEMAS["environments"].names,
        ),
    )
    points = pd.concat(finals) if finals else pd.DataFrame(columns=["run", "reward", "survivors"])
    tables |= _judged(study, tables["runs"], points)
    ordered = {name: tables[name] for name in SCHEMAS}
    with writing(store.folder):
        write_tables(store.folder, ordered, study.manifest())
    return ordered


def _outcomes(study: Study, store: Store) -> Iterator[tuple[Run, Outcome]]:
    for run in study.runs():
        outcome = None
        if store.finished(run.digest):
            # Where it is damaged, how it failed the last time counts, if it did.
            with contextlib.suppress(DamagedError):
                outcome = store.load(run)
        outcome = outcome or store.failure(run.digest)
        if outcome is not None:
            yield run, outcome


def _run_row(run: Run, outcome: Outcome, where: str) -> dict[str, Any]:
    budget = run.mission.budget
    last = outcome.records[-1] if outcome.records else None
    return {
        **_identity(run),
        "status": outcome.status,
        "stopped_by": outcome.stopped_by,
        "evaluations": outcome.evaluations,
        "seconds": outcome.seconds,
        "recording_seconds": outcome.recording_seconds,
        "budget_evaluations": budget.evaluations,
        "budget_seconds": budget.seconds,
        "min_survival": run.mission.min_survival,
        "area": area_indicator(last.objectives, run.mission.mission) if last else 0.0,
        "front_size": last.front_size if last else 0,
        "environment": where,
        "error": outcome.error,
        "traceback": outcome.traceback,
    }


def _identity(run: Run) -> dict[str, Any]:
    return {
        "run": run.digest,
        "mission": run.mission.label,
        "algorithm": run.algorithm.label,
        "seed": run.seed,
    }


def _frame(run: Run, columns: dict[str, Any]) -> pd.DataFrame:
    frame = pd.DataFrame(columns)
    for position, (name, value) in enumerate(_identity(run).items()):
        frame.insert(position, name, value)
    return frame


def _trace(run: Run, outcome: Outcome) -> pd.DataFrame:
    records = outcome.records
    return _frame(
        run,
        {
            "evaluations": [record.evaluations for record in records],
            "seconds": [record.seconds for record in records],
            "area": [area_indicator(r.objectives, run.mission.mission) for r in records],
            "front_size": [record.front_size for record in records],
        },
    )


def _fronts(run: Run, outcome: Outcome) -> pd.DataFrame:
    points = np.concatenate([record.objectives for record in outcome.records])
    sizes = [len(record.objectives) for record in outcome.records]
    evaluations = np.repeat([record.evaluations for record in outcome.records], sizes)
    return _frame(
        run, {"evaluations": evaluations, "reward": points[:, 0], "survivors": points[:, 1]}
    )


def _plans(run: Run, outcome: Outcome) -> pd.DataFrame:
    plans = outcome.records[-1].plans
    if plans is None:
        return _frame(run, {name: [] for name in ("plan_id", "reward", "survivors", "trails")})
    batch, objectives = plans
    labels = run.mission.mission.labels
    return _frame(
        run,
        {
            "plan_id": np.arange(len(batch)),
            "reward": objectives[:, 0],
            "survivors": objectives[:, 1],
            "trails": [json.dumps(labels(plan), ensure_ascii=False) for plan in batch],
        },
    )


def _joined(name: str, found: list[pd.DataFrame]) -> pd.DataFrame:
    empty = pd.DataFrame(columns=SCHEMAS[name].names)
    return _typed(name, pd.concat(found, ignore_index=True) if found else empty)


def _typed(name: str, frame: pd.DataFrame) -> pd.DataFrame:
    """Give columns their types also where there are no rows, or no values, to tell them."""
    dtypes = {"int64": "int64", "double": "float64", "string": "str", "bool": "bool"}
    return frame.astype(
        {
            field.name: "Int64"
            if field.nullable and str(field.type) == "int64"
            else dtypes[str(field.type)]
            for field in SCHEMAS[name]
        }
    )


def _judged(study: Study, runs: pd.DataFrame, points: pd.DataFrame) -> dict[str, pd.DataFrame]:
    missions = {mission.label: mission.mission for mission in study.missions}
    comparison = study.file.comparison
    algorithms = [algorithm.label for algorithm in study.algorithms]
    references = reference_fronts(runs, points)
    indicators = score_runs(
        runs, points, references, missions=missions, indicators=study.file.indicators
    )
    return {
        "references": references,
        "indicators": indicators,
        "comparisons": compare_algorithms(
            indicators,
            runs=runs,
            algorithms=algorithms,
            control=comparison.control,
            significance=comparison.significance,
        ),
        "ranks": rank_algorithms(
            indicators,
            algorithms=algorithms,
            significance=comparison.significance,
            digests={mission.label: mission.digest for mission in study.missions},
        ),
        "summary": summarise(
            runs,
            indicators,
            missions=list(missions),
            algorithms=algorithms,
            significance=comparison.significance,
        ),
    }
