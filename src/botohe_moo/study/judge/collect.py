"""Making the tables of a study from the outcomes of its runs."""

import json
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
import pyarrow as pa

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import TIE
from botohe_moo.library import best_known, certified_bound
from botohe_moo.study.file.model import Run, Study, StudyError
from botohe_moo.study.judge.comparisons import compare_algorithms, compare_ranks, rank_algorithms
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
from botohe_moo.study.store.tables import from_arrow, to_arrow, write_tables

_Outcomes: TypeAlias = Sequence[tuple[Run, Outcome]]


def collect_tables(study: Study, folder: StudyFolder, made_from: str = "") -> None:
    """Make all tables of a study from the runs and bounds that are in its folder, and write them.

    ``made_from`` is the digest of what they are made from. A StudyError names the files that are
    damaged, or a bound that a run refutes, or says that the folder cannot be written to.
    """
    outcomes = list(folder.outcomes(study.runs()))
    missions = {mission.label: mission.mission for mission in study.missions}
    manifest = study.manifest()
    bounds = {
        mission.label: bound_and_seconds[0]
        for mission in (study.missions if study.file.bounds else ())
        if (bound_and_seconds := folder.bound(mission))
    }
    known = {}
    for label, name in study.best_known.items():
        front = best_known(name)
        # Evaluated again, since files have 12 digits, and runs that find the same plans have more.
        known[label] = front.mission.evaluate(front.plans)
        certified = certified_bound(name)
        bounds[label] = min(bounds.get(label, certified), certified, key=lambda bound: bound.area)
    tables = _judged(study, outcomes, bounds, known)
    _check_bounds(bounds, tables["runs"])
    tables["missions"] = mission_table(manifest, missions, bounds)
    tables["bounds"] = bound_table(bounds)
    tables["algorithms"] = algorithm_table(manifest)
    with writing(folder.path):
        write_tables(folder.path, tables, {**manifest, "made_from": made_from})


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


def _run_row(run: Run, outcome: Outcome, environment: str) -> dict[str, Any]:
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
        "environment": environment,
    }


def _judged(
    study: Study,
    outcomes: _Outcomes,
    bounds: Mapping[str, FrontBound],
    known: Mapping[str, FloatArray],
) -> dict[str, pd.DataFrame]:
    """Return all tables but ``missions``, ``bounds`` and ``algorithms``."""
    missions = {mission.label: mission.scale for mission in study.missions}
    algorithms = [algorithm.label for algorithm in study.algorithms]
    indicators, control = study.file.indicators, study.file.comparison.control
    significance = study.file.comparison.significance
    tables = _recorded(outcomes)
    fronts = [[record.objectives for record in outcome.records] for _, outcome in outcomes]
    finals = [of_run[-1] if of_run else np.empty((0, 2)) for of_run in fronts]
    references = reference_fronts(tables["runs"], finals, known)
    scores_of_records = score_records(
        zip(tables["trace"]["mission"], chain.from_iterable(fronts), strict=True),
        references,
        missions=missions,
        indicators=indicators,
    )
    trace = tables["trace"].assign(**scores_of_records)
    areas = tables["runs"]["run"].map(trace.groupby("run")["area"].last()).fillna(0.0)
    tables |= {"runs": tables["runs"].assign(area=areas), "trace": trace}
    tables = {name: _typed(name, frame) for name, frame in tables.items()}
    runs = tables["runs"]
    scores = score_runs(runs, finals, references, missions=missions, indicators=indicators)
    ranks = rank_algorithms(
        scores,
        algorithms=algorithms,
        significance=significance,
        digests={mission.label: mission.digest for mission in study.missions},
    )
    return tables | {
        "references": references,
        "indicators": scores,
        "comparisons": compare_algorithms(
            scores,
            runs=runs,
            algorithms=algorithms,
            control=control,
            significance=significance,
        ),
        "ranks": ranks,
        "posthoc": compare_ranks(ranks, significance=significance),
        "summary": summarise(
            runs,
            scores,
            references,
            missions=missions,
            algorithms=algorithms,
            significance=significance,
            bounds=bounds,
        ),
        "targets": reach_targets(
            runs, tables["trace"], references, missions=missions, algorithms=algorithms
        ),
    }


def _recorded(outcomes: _Outcomes) -> dict[str, pd.DataFrame]:
    """Return ``runs``, ``trace``, ``fronts``, ``plans`` and ``environments``, without scores."""
    environments = [outcome.environment or environment() for _, outcome in outcomes]
    runs = pd.DataFrame(
        [
            _run_row(run, outcome, columns["environment"])
            for (run, outcome), columns in zip(outcomes, environments, strict=True)
        ],
        columns=SCHEMAS["runs"].names,
    )
    records = [record for _, outcome in outcomes for record in outcome.records]
    trace = _repeated(runs, [len(outcome.records) for _, outcome in outcomes]).assign(
        evaluations=[record.evaluations for record in records],
        seconds=[record.seconds for record in records],
        front_size=[len(record.objectives) for record in records],
        ties=[record.ties for record in records],
    )
    finals = [
        (outcome.records[-1].plans if outcome.records else None) or ((), np.empty((0, 2)))
        for _, outcome in outcomes
    ]
    plans = _with_points(runs, [objectives for _, objectives in finals])
    trails = [
        json.dumps(run.mission.mission.labels(plan), ensure_ascii=False)
        for (run, _), (batch, _) in zip(outcomes, finals, strict=True)
        for plan in batch
    ]
    distinct = {columns["environment"]: columns for columns in environments}
    return {
        "runs": runs,
        "trace": trace,
        "fronts": _with_points(trace, [record.objectives for record in records], "evaluations"),
        "plans": plans.assign(trails=trails, plan_id=plans.groupby("run").cumcount()),
        "environments": pd.DataFrame(
            [distinct[digest] for digest in sorted(distinct)], columns=SCHEMAS["environments"].names
        ),
    }


def _repeated(frame: pd.DataFrame, counts: Sequence[int], *further: str) -> pd.DataFrame:
    """Return the identity of each run (each row of ``frame``), repeated ``counts`` times.

    ``further`` columns are repeated with it.
    """
    rows = np.repeat(np.arange(len(frame)), np.array(counts, int))
    identity = ["run", "mission", "algorithm", "seed"]
    return frame.loc[:, [*identity, *further]].take(rows).reset_index(drop=True)


def _with_points(frame: pd.DataFrame, fronts: Sequence[FloatArray], *further: str) -> pd.DataFrame:
    """Return a row for each point of the fronts; each row of ``frame`` has one front."""
    points = np.concatenate([np.empty((0, 2)), *fronts])
    repeated = _repeated(frame, list(map(len, fronts)), *further)
    return repeated.assign(reward=points[:, 0], survivors=points[:, 1])


def _typed(name: str, frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table with the columns of its schema, in its order and of its types."""
    counts = [field.name for field in SCHEMAS[name] if field.nullable and field.type == pa.int64()]
    table = from_arrow(to_arrow(name, frame), integer_object_nulls=True)
    return table.astype(dict.fromkeys(counts, "Int64"))
