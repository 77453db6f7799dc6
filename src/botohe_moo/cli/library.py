"""The commands ``botohe library ...``: missions that others measure against."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from botohe_moo.base.messages import counted
from botohe_moo.cli.common import FAILED, command, failing, frame_table, say, tell

if TYPE_CHECKING:
    from botohe_moo.library.fronts import Finder
    from botohe_moo.mission.model import Mission
    from botohe_moo.study import StudyTables
    from botohe_moo.trails import PlanBatch, Plans

    Found = dict[str, list[tuple[Plans, Finder]]]

library_app = typer.Typer(no_args_is_help=True)

_TABLE = {  # columns of `botohe library list`: title and format
    **{name: (name, "") for name in ("mission", "family", "size")},
    **{name: (name, "") for name in ("nodes", "arcs", "robots", "plans")},
    "area": ("area", ".6f"),
    "gap": ("gap", ".2%"),
}

Selection = Annotated[str, typer.Argument(parser=lambda text: text.removeprefix("library:"))]


@library_app.callback()
def library() -> None:
    """Missions with best known fronts and certified bounds: list, check and improve them."""


@command(library_app, "list")
def list_library(selection: Selection = "all", *, library: Path | None = None) -> None:
    """List missions: their size, the area of the best known front, and its certified gap."""
    with failing():
        from botohe_moo.library.files import FOLDER, library_table

        listed = library_table(selection, folder=library or FOLDER)
    tell(frame_table(listed, _TABLE, n_texts=3))
    tell("\n`botohe solve library:NAME` searches. `botohe library add DIR` adds what it found.")


@command(library_app)
def check(selection: Selection = "all", *, library: Path | None = None) -> None:
    """Evaluate all plans of the best known fronts again, and compare with their files.

    The exit status is 1 if something is wrong, and 2 for bad input.
    """
    with failing():
        from botohe_moo.library import check_library, library_names
        from botohe_moo.library.files import FOLDER

        names = library_names(selection)
        faults = check_library(names, folder=library or FOLDER)
    for name in names:
        (say if name in faults else tell)(faults.get(name, f"{name}: right"))
    if faults:
        raise typer.Exit(FAILED)
    tell(f"\n{counted(len(names), 'mission')}: each plan was evaluated again, none is dominated")


@command(library_app)
def add(
    found: Annotated[Path, typer.Argument(exists=True, file_okay=False)],
    *,
    by: str,
    library: Path | None = None,
) -> None:
    """Merge the plans of a solution or a study into the best known fronts.

    Plans that are dominated leave. Additions in any order give the same files.

    Parameters
    ----------
    found : DIR
        Folder that `solve` or `study run` wrote, on missions of the library.
    by : NAME
        Who found the plans.
    """
    with failing():
        from botohe_moo.library.files import FOLDER, add_plans

        plans = _found_in(found, by, dt.date.today().isoformat())
        changed = add_plans(plans, folder=library or FOLDER)
    for name, (before, after, path) in changed.items():
        was, now = ({*map(tuple, front.objectives.tolist())} for front in (before, after))
        n_new = len(now - was)
        grown = f" ({100 * (after.area / before.area - 1):+.4f} %)" if before.area and n_new else ""
        wrote = "" if path is None else f"; wrote {path}"
        tell(f"{name}: {counted(n_new, 'new plan')}, area {after.area:.6f}{grown}{wrote}")


def _found_in(folder: Path, by: str, on: str) -> Found:
    """Read the plans of a solution or a study, by the library's name of their mission."""
    from botohe_moo.library.fronts import Finder
    from botohe_moo.mission.loading import library_name_of
    from botohe_moo.mission.model import numbers_digest
    from botohe_moo.solution import read_solution
    from botohe_moo.study import read_study

    read: list[tuple[Mission, Iterator[tuple[Plans, str]]]]
    if (folder / "plans.json").exists():
        solution = read_solution(folder)
        how = solution.algorithm, solution.parameters, solution.evaluations, solution.seed
        read = [(solution.mission, iter([(solution.plans, _method(*how))]))]
    else:
        tables = read_study(folder)
        missions = {label: tables.mission(label) for label in tables.mission_labels}
        read = [(of, _of_runs(tables, label, of)) for label, of in missions.items()]
    found: Found = {}
    for mission, lists in read:
        if name := library_name_of(numbers_digest(mission)):
            known = found.setdefault(name, [])
            known += ((plans, Finder(on, by, method)) for plans, method in lists)
    if not found:
        others = ", ".join(f"{mission.name!r} of {mission.team}" for mission, _ in read)
        raise ValueError(
            f"{folder}: expected plans of a mission of the library, found those of {others}: no "
            "mission of the library has the same nodes, arcs and team."
        )
    return found


def _of_runs(tables: StudyTables, label: str, mission: Mission) -> Iterator[tuple[PlanBatch, str]]:
    """Give the plans of each run on a mission of a study, and how they were found."""
    from pydantic import Field, TypeAdapter

    from botohe_moo.library.fronts import batch_of

    n_robots = Field(min_length=mission.robots, max_length=mission.robots)
    plan_type = Annotated[list[list[int | str]], n_robots]
    as_plans: TypeAdapter[Any] = TypeAdapter(list[plan_type])
    index_of = {node: i for i, node in enumerate(mission.nodes)}
    rows = tables.plans[tables.plans["mission"] == label]
    trails = dict(iter(rows.groupby("run")["trails"]))
    columns = ["run", "algorithm", "evaluations", "seed"]
    runs = tables.runs.loc[tables.runs["mission"] == label, columns]
    for run, algorithm, evaluations, seed in runs.itertuples(index=False):
        try:
            read = as_plans.validate_json(f"[{','.join(trails.get(run, ()))}]")
            plans = [[[index_of[node] for node in trail] for trail in plan] for plan in read]
        except (LookupError, TypeError, ValueError):
            raise ValueError(
                f"{tables.folder / 'plans.parquet'}, run {run}: expected {mission.robots} trails "
                f"of nodes of {label!r} in each plan."
            ) from None
        said = tables.manifest["algorithms"][algorithm]
        method = _method(said["algorithm"], said["parameters"], evaluations, seed)
        yield batch_of(mission, plans), method


def _method(algorithm: str, parameters: Mapping[str, Any], evaluations: int, seed: int) -> str:
    from botohe_moo.study.report.words import parameter_words

    given = f" ({parameter_words(parameters)})" if parameters else ""
    return f"{algorithm}{given}, {evaluations:,} evaluations, seed {seed}"
