"""Making the tables of a study from the files of its runs."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import TIE
from botohe_moo.search.bounds import FrontBound
from botohe_moo.study.file.model import Run, Study, StudyError
from botohe_moo.study.judge.comparisons import compare_algorithms
from botohe_moo.study.judge.ranks import compare_ranks, rank_algorithms
from botohe_moo.study.judge.scores import reference_fronts, score_records, score_runs
from botohe_moo.study.judge.summary import (
    algorithm_table,
    bound_table,
    mission_table,
    reach_targets,
    summarise,
)
from botohe_moo.study.run.environment import environment
from botohe_moo.study.run.task import Outcome
from botohe_moo.study.store.folder import OUTCOME_FIELDS, StudyFolder, writing
from botohe_moo.study.store.schemas import SCHEMAS
from botohe_moo.study.store.tables import write_tables


def collect_tables(study: Study, folder: StudyFolder, made_from: str = "") -> None:
    """Make all tables of a study, of the runs and bounds that are there, and write them.

    ``made_from`` is the digest of what they are made from. A StudyError names the files that
    are damaged, or a bound that a run refutes, or says that the folder cannot be written to.
    """
    found = _Found()
    for run, outcome in folder.outcomes(study.runs()):
        found.add(run, outcome)
    missions = {mission.label: mission.mission for mission in study.missions}
    manifest = study.manifest()
    bounds = {
        mission.label: kept[0]
        for mission in (study.missions if study.file.bounds else ())
        if (kept := folder.bound(mission))
    }
    tables = _judged(study, found, bounds)
    _check_bounds(bounds, tables["runs"])
    tables["missions"] = mission_table(manifest, missions, bounds)
    tables["bounds"] = bound_table(bounds)
    tables["algorithms"] = algorithm_table(manifest)
    with writing(folder.path):
        write_tables(folder.path, tables, {**manifest, "made_from": made_from})


def _check_bounds(bounds: Mapping[str, FrontBound], runs: pd.DataFrame) -> None:
    """Refuse a bound below the area that a run has found: one of them has a fault."""
    for label, bound in bounds.items():
        area = runs.loc[runs["mission"] == label, "area"].max()
        if area > bound.area + TIE:
            raise StudyError(
                f"The bound of {label} says that no front has an area above {bound.area:.6f}, but "
                f"a run has found {area:.6f}. Remove its file from the folder bounds, and run the "
                "study again; please report it, if it happens again."
            )


@dataclass
class _Found:
    """The contents of all run files, as the columns of tables."""

    runs: list[dict[str, Any]] = field(default_factory=list)  # rows, without areas
    fronts: list[list[FloatArray]] = field(default_factory=list)  # of each run, the last one final
    spent: list[tuple[int, float, int]] = field(default_factory=list)  # of each record, with ties
    plans: list[FloatArray] = field(default_factory=list)  # objectives of each run's final plans
    trails: list[str] = field(default_factory=list)  # of all final plans, as JSON
    environments: dict[str, dict[str, Any]] = field(default_factory=dict)  # by digest

    def add(self, run: Run, outcome: Outcome) -> None:
        """Add the outcome of a run."""
        where = outcome.environment or environment()
        self.environments[where["environment"]] = where
        records = outcome.records
        self.runs.append(_run_row(run, outcome, where["environment"]))
        self.fronts.append([record.objectives for record in records])
        self.spent += [(record.evaluations, record.seconds, record.ties) for record in records]
        batch, objectives = (records[-1].plans if records else None) or ((), np.empty((0, 2)))
        labels = run.mission.mission.labels
        self.plans.append(objectives)
        self.trails += [json.dumps(labels(plan), ensure_ascii=False) for plan in batch]


def _run_row(run: Run, outcome: Outcome, where: str) -> dict[str, Any]:
    budget = run.mission.budget
    last = outcome.records[-1] if outcome.records else None
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
        "environment": where,
    }


def _judged(
    study: Study,
    found: _Found,
    bounds: dict[str, FrontBound],
) -> dict[str, pd.DataFrame]:
    """Return all tables but ``missions``, ``bounds`` and ``algorithms``."""
    missions = {mission.label: mission.scale for mission in study.missions}
    comparison, indicators = study.file.comparison, study.file.indicators
    level = comparison.significance
    labels = [algorithm.label for algorithm in study.algorithms]
    runs = pd.DataFrame(found.runs, columns=SCHEMAS["runs"].names)
    # The last front of each run, without points where there is none.
    finals = [fronts[-1] if fronts else np.empty((0, 2)) for fronts in found.fronts]
    references = reference_fronts(runs, finals)
    records = [
        (label, front)
        for label, fronts in zip(runs["mission"], found.fronts, strict=True)
        for front in fronts
    ]
    scores_of_records = score_records(records, references, missions=missions, indicators=indicators)
    tables = _recorded(found, runs, scores_of_records)
    runs = tables["runs"]
    scores = score_runs(runs, finals, references, missions=missions, indicators=indicators)
    ranks = rank_algorithms(
        scores,
        algorithms=labels,
        significance=level,
        digests={mission.label: mission.digest for mission in study.missions},
    )
    return tables | {
        "references": references,
        "indicators": scores,
        "comparisons": compare_algorithms(
            scores, runs=runs, algorithms=labels, control=comparison.control, significance=level
        ),
        "ranks": ranks,
        "posthoc": compare_ranks(ranks, significance=level),
        "summary": summarise(
            runs,
            scores,
            missions=list(missions),
            algorithms=labels,
            significance=level,
            bounds=bounds,
        ),
        "targets": reach_targets(
            runs, tables["trace"], references, missions=missions, algorithms=labels
        ),
    }


def _recorded(
    found: _Found, runs: pd.DataFrame, scores: Mapping[str, Sequence[float]]
) -> dict[str, pd.DataFrame]:
    """Return the tables of runs and records; ``scores`` has a value for each recorded front."""
    records = [front for fronts in found.fronts for front in fronts]
    sizes = list(map(len, records))
    spent = pd.DataFrame(found.spent, columns=["evaluations", "seconds", "ties"])
    trace = _repeated(runs, map(len, found.fronts)).join(spent)
    trace = trace.assign(front_size=sizes, **scores)
    final = trace.groupby("run")["area"].last()
    plans = _repeated(runs, map(len, found.plans)).assign(trails=found.trails)
    numbers = [np.arange(len(objectives)) for objectives in found.plans]
    plans["plan_id"] = np.concatenate([np.empty(0, int), *numbers])
    where = found.environments
    frames = {
        "runs": runs.assign(area=runs["run"].map(final).fillna(0.0)),
        "trace": trace,
        "fronts": _with_points(_repeated(trace, sizes, "evaluations"), records),
        "plans": _with_points(plans, found.plans),
        "environments": pd.DataFrame(
            [where[key] for key in sorted(where)], columns=SCHEMAS["environments"].names
        ),
    }
    return {name: _typed(name, frame) for name, frame in frames.items()}


def _repeated(frame: pd.DataFrame, counts: Iterable[int], *further: str) -> pd.DataFrame:
    """Repeat the identity of each run, once for each of its rows in another table."""
    rows = np.repeat(np.arange(len(frame)), np.array(list(counts), int))
    identity = ["run", "mission", "algorithm", "seed"]
    return frame.loc[:, [*identity, *further]].take(rows).reset_index(drop=True)


def _with_points(frame: pd.DataFrame, fronts: Sequence[FloatArray]) -> pd.DataFrame:
    points = np.concatenate([np.empty((0, 2)), *fronts])
    return frame.assign(reward=points[:, 0], survivors=points[:, 1])


def _typed(name: str, frame: pd.DataFrame) -> pd.DataFrame:
    """Put columns in order, and give them the types of the schema."""
    text = pd.Series(["text"]).dtype  # str, or object before pandas 3, whose str is never missing
    dtypes = {"int64": "int64", "double": "float64", "string": text, "bool": "bool"}
    ordered: pd.DataFrame = frame[SCHEMAS[name].names]
    return ordered.astype(
        {
            field.name: "Int64"
            if field.nullable and str(field.type) == "int64"
            else dtypes[str(field.type)]
            for field in SCHEMAS[name]
        }
    )
