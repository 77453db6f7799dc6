"""Plans that a search or a study has found, for the library."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from botohe_moo.library import Finder
from botohe_moo.mission.loading import library_name_of
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.solution import read_solution
from botohe_moo.study.tables import StudyTables, read_study
from botohe_moo.study.words import parameter_words
from botohe_moo.trails import PlanBatch, Plans


def found_plans(folder: Path, *, by: str) -> dict[str, list[tuple[Plans, Finder]]]:
    """Read the plans of a solution or a study, as :func:`botohe_moo.library.add_plans` takes them.

    Parameters
    ----------
    folder
        Folder of a solution, or of a study.
    by
        Who found the plans; the date is today's.

    Raises
    ------
    ValueError
        If no mission in it is one of the library, or a plan cannot be read.
    """
    today = dt.date.today().isoformat()
    read: list[tuple[Mission, Iterator[tuple[Plans, str]]]]
    if (folder / "plans.json").exists():
        solution = read_solution(folder)
        how = solution.algorithm, solution.parameters, solution.evaluations, solution.seed
        read = [(solution.mission, iter([(solution.plans, _method(*how))]))]
    else:
        tables = read_study(folder)
        missions = {label: tables.mission(label) for label in tables.mission_labels}
        read = [(of, _of_runs(tables, label, of)) for label, of in missions.items()]
    found: dict[str, list[tuple[Plans, Finder]]] = {}
    for mission, lists in read:
        if name := library_name_of(numbers_digest(mission)):
            known = found.setdefault(name, [])
            known += ((plans, Finder(today, by, method)) for plans, method in lists)
    if not found:
        others = ", ".join(f"{mission.name!r} of {mission.team}" for mission, _ in read)
        raise ValueError(
            f"{folder}: expected plans of a mission of the library, found those of {others}: no "
            "mission of the library has the same nodes, arcs and team."
        )
    return found


def _of_runs(tables: StudyTables, label: str, mission: Mission) -> Iterator[tuple[PlanBatch, str]]:
    """Give the plans of each run on a mission of a study, and how they were found."""
    index_of = {node: i for i, node in enumerate(mission.nodes)}
    rows = tables.plans[tables.plans["mission"] == label]
    trails = dict(iter(rows.groupby("run")["trails"]))
    columns = ["run", "algorithm", "evaluations", "seed"]
    runs = tables.runs.loc[tables.runs["mission"] == label, columns]
    for run, algorithm, *spent in runs.itertuples(index=False):
        plans = map(json.loads, trails.get(run, ()))
        packed = [[[index_of[node] for node in trail] for trail in plan] for plan in plans]
        said = tables.manifest["algorithms"][algorithm]
        yield mission.pack(packed), _method(said["algorithm"], said["parameters"], *spent)


def _method(algorithm: str, parameters: Mapping[str, Any], evaluations: int, seed: int) -> str:
    given = f" ({parameter_words(parameters)})" if parameters else ""
    return f"{algorithm}{given}, {evaluations:,} evaluations, seed {seed}"
