"""All that reads files, and what has to be possible with what it has read."""

import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

import numpy as np
from typer.testing import CliRunner

from botohe_moo._base.files import read_bytes
from botohe_moo.cli.app import app
from botohe_moo.cli.checks import check_places
from botohe_moo.mission import (
    Mission,
    MissionError,
    PlanError,
    memory,
    mission_from_tables,
    read_mission,
    save_mission,
)
from botohe_moo.mission.digest import mission_digest
from botohe_moo.mission.formats.tables import read_table
from botohe_moo.search.bounds import FrontBound
from botohe_moo.solution import Solution, read_solution
from botohe_moo.study import Study, load_study, read_study
from botohe_moo.study.file.model import Run, StudyError
from botohe_moo.study.run.environment import environment
from botohe_moo.study.run.task import Outcome
from botohe_moo.study.store.folder import StudyFolder
from botohe_moo.study.store.manifest import restore_study
from botohe_moo.study.store.run_files import pack_run
from botohe_moo.study.store.tables import StudyTables
from botohe_moo.trails import TrailPlan
from tests.fuzz import oracle, seeds
from tests.fuzz.changes import change_files
from tests.fuzz.oracle import FaultError, Files, Target

_MISSION_MEMORY = 64 * 2**20  # bytes that a generator may plan for here, in place of gigabytes


# Missions


def _read_json_mission(folder: Path) -> Mission:
    return read_mission(folder / "mission.json")


def _read_graphml_mission(folder: Path) -> Mission:
    return read_mission(folder / "mission.graphml")


def _read_benchmark(folder: Path) -> Mission:
    mission = read_mission(folder / "mission.txt")
    assert read_mission(folder / "mission.txt", neighbours="all").nodes == mission.nodes
    return mission


def _read_tables(folder: Path) -> Mission:
    nodes, arcs = (read_table(folder / f"{name}.csv") for name in ("nodes", "arcs"))
    return mission_from_tables(nodes, arcs, base="dock", robots=2, both_ways=True)


def use_mission(mission: Mission, folder: Path) -> None:
    """Evaluate plans of a mission, and save and read it."""
    base = mission.base
    there = [v for v in mission.graph.successors(base) if mission.graph.has_edge(v, base)][:1]
    first = [base, *there, *([base] if there else [])]
    robots = min(mission.robots, 3)
    plan = mission.with_robots(robots).plan([first, *[[base]] * (robots - 1)])
    assert np.isfinite(mission.with_robots(robots).evaluate([plan])).all()
    for suffix in (".json", ".graphml"):
        path = folder / f"saved{suffix}"
        try:
            save_mission(mission, path)
        except ValueError as error:  # GraphML cannot hold all that JSON can
            assert suffix == ".graphml"
            oracle.check_message(error, folder)
            continue
        again = read_mission(path)
        if suffix == ".json" or isinstance(base, str):
            assert again == mission
            assert (again.name, again.title) == (mission.name, mission.title)
            assert mission_digest(again) == mission_digest(mission)
    try:
        check_places(mission, path)
        mission.with_lengths_from_pos()
    except ValueError as error:
        oracle.check_message(error, None)
    repr(mission)


# Plans, solutions and bounds


def _read_plan(folder: Path) -> TrailPlan:
    try:
        trails = json.loads(read_bytes(folder / "plan.json"))["trails"]
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        raise PlanError("It is no plan that could be handed over.") from None
    return seeds.toy().plan(trails)


def _use_plan(plan: TrailPlan, _: Path) -> None:
    mission = seeds.toy()
    assert mission.plan(mission.labels(plan)) == plan


def use_solution(solution: Solution, folder: Path) -> None:
    solution.describe()
    if solution.plans:
        solution.choose("survivors >= 1")
        solution.representatives()
        solution.knees()
    assert 0 <= solution.area <= 1
    copy = folder / "copy"
    copy.mkdir()
    solution._write_tables(copy)
    again = read_solution(copy, mission=solution.mission)
    assert again.plans == solution.plans
    assert np.array_equal(again.objectives, solution.objectives)


def _read_bound(folder: Path) -> FrontBound:
    path, faults = folder / "bound.json", []
    for robots in (2, 3):
        try:
            return FrontBound.load(path, seeds.toy(robots))
        except (OSError, ValueError) as error:
            faults.append(error)
            oracle.check_message(error, folder)
    raise faults[0]


def _use_bound(bound: FrontBound, folder: Path) -> None:
    assert 0 <= bound.area <= 1
    assert np.isfinite(bound.points).all()
    assert not np.isnan(bound.bound(np.linspace(0, bound.mission.robots, 5))).any()
    try:
        assert bound.gap(bound.mission.evaluate(seeds.toy_front(bound.mission.robots)[0])) >= 0
    except ValueError as error:  # only a proof would show which number was changed
        if "It is of another mission, or does not keep the limits." not in str(error):
            raise
    bound.save(folder / "saved.json")
    assert FrontBound.load(folder / "saved.json", bound.mission) == bound


# Studies


def _read_study_file(folder: Path) -> Study:
    with mock.patch.object(memory, "_LIMIT", _MISSION_MEMORY):
        return load_study(folder / "study.yaml", out=folder / "out")


def _use_study_file(study: Study, _: Path) -> None:
    json.dumps(study.manifest())
    if len(study.missions) * len(study.algorithms) * len(study.seeds) < 2_000:
        assert len({run.digest for run in study.runs()}) <= len(study.runs())


_STUDY: list[Study] = []


def _toy_study() -> Study:
    if not _STUDY:
        _STUDY.append(seeds.toy_study())
    return _STUDY[0]


def _read_run(folder: Path) -> tuple[Run, Outcome | None]:
    there = {path.stem for path in folder.glob("*/*.npz")}
    runs = _toy_study().runs()
    run = next((run for run in runs if run.digest in there), runs[0])
    return run, StudyFolder(folder).load(run)


def _use_run(read: tuple[Run, Outcome | None], _: Path) -> None:
    run, outcome = read
    if outcome is not None:
        pack_run(run, outcome)


def _use_restored(study: Study, folder: Path) -> None:
    _use_study_file(study, folder)
    folder_of = StudyFolder(folder)
    assert folder_of.digests() == {path.stem for path in folder.glob("runs/*.npz")}


def use_tables(tables: StudyTables, _: Path) -> None:
    """Look at tables that were read."""
    assert tables.n_missing >= 0
    assert tables.missing_bounds is not None


# Commands


def _commands(folder: Path) -> list[list[str]]:
    """List the commands that read what is in a folder."""
    there = {path.name for path in folder.iterdir()}
    if "nodes.csv" in there or "arcs.csv" in there:
        files = ["--nodes", folder / "nodes.csv", "--arcs", folder / "arcs.csv"]
        out = ["--base", "dock", "--robots", "2", "--both-ways", "--out", folder / "made.json"]
        return [["missions", "import", *map(str, [*files, *out])]]
    if "plans.json" in there or "front.csv" in there:
        path = str(folder)
        wishes = ["survivors >= 1", "P(reward >= 0.5) >= 0.1"]
        plan = ["choose", path, "--plan", "0", "--out", str(folder / "plan.csv")]
        return [["choose", path], ["choose", path, *wishes], plan, ["explore", path]]
    path = str(next(folder.iterdir(), folder / "mission.json"))
    return [["missions", "check", path], ["missions", "show", path]]


def _run_commands(folder: Path) -> int:
    """Run commands; a StudyError says what the last one has said that has failed."""
    failed = None
    for arguments in _commands(folder):
        done = CliRunner().invoke(app, arguments)
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        if done.exit_code not in (0, 1, 2) or "Traceback" in done.output:
            raise FaultError(f"{arguments}: exit status {done.exit_code}: {done.output[:500]}")
        if done.exit_code == 2:
            failed = StudyError(done.stderr)
    if failed is not None:
        raise failed
    return 0


def _of_commands() -> list[Files]:
    return [
        *(*seeds.node_links(), *seeds.graphmls(), *seeds.benchmarks(), *seeds.tables()),
        *seeds.solutions() * 4,
    ]


# Which files are changed


def _change(among: Callable[[str], bool] | None = None) -> Any:
    def change(rng: Random, files: Files) -> Files:
        return change_files(rng, files, among)

    return change


def _is_of_manifest(name: str) -> bool:
    return name == "study.json" or name.startswith("missions/")


def _is_table(name: str) -> bool:
    return name.endswith(".parquet")


_OURS = (MissionError, OSError)
_LIST = (
    Target("node-link", 22_000, seeds.node_links, _change(), _read_json_mission, use_mission),
    Target("graphml", 18_000, seeds.graphmls, _change(), _read_graphml_mission, use_mission),
    Target("benchmark", 14_000, seeds.benchmarks, _change(), _read_benchmark, use_mission),
    Target(  # the mission as a whole is of two files, which the command names
        *("tables", 12_000, seeds.tables, _change(), _read_tables, use_mission),
        names_file=False,
    ),
    Target(
        *("study-file", 8_000, seeds.study_files, _change(), _read_study_file, _use_study_file),
        warns=(UserWarning,),
    ),
    Target("solution", 12_000, seeds.solutions, _change(), read_solution, use_solution),
    Target("bound", 8_000, seeds.bounds, _change(), _read_bound, _use_bound),
    Target(
        *("plan", 6_000, seeds.plans, _change(), _read_plan, _use_plan),
        names_file=False,
    ),
    Target(
        *("run", 10_000, seeds.stored_runs, _change(), _read_run, _use_run),
        declared=(StudyError,),
    ),
    Target(
        *("manifest", 6_000, seeds.studies, _change(_is_of_manifest), restore_study, _use_restored),
        declared=(StudyError,),
    ),
    Target(
        *("study-tables", 4_000, seeds.studies, _change(_is_table), read_study, use_tables),
        declared=(StudyError,),
    ),
    Target("commands", 2_000, _of_commands, _change(), _run_commands, declared=(StudyError,)),
)
environment()  # asks git, once
TARGETS = {target.name: target for target in _LIST}
