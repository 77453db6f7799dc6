"""The commands ``botohe library ...``: missions that others measure against."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from botohe_moo.base.messages import counted
from botohe_moo.cli.options import path_option
from botohe_moo.cli.shell import FAILED, failing, say, tell

if TYPE_CHECKING:
    from botohe_moo.library import Finder
    from botohe_moo.mission.model import Mission
    from botohe_moo.study import StudyTables
    from botohe_moo.trails import PlanBatch, Plans

    Found = dict[str, list[tuple[Plans, Finder]]]

library_app = typer.Typer(no_args_is_help=True)

SelectionArgument = Annotated[
    str,
    typer.Argument(
        metavar="SELECTION",
        parser=lambda text: text.removeprefix("library:"),
        help="A mission's name, a family, or one of small, medium, large, all.",
    ),
]
FolderOption = Annotated[
    Path | None,
    path_option(
        "--library",
        metavar="DIR",
        help="Folder of the library; by default that of the package: in a clone, results/library.",
    ),
]


@library_app.callback()
def library() -> None:
    """Missions with best known fronts and certified bounds: list, check, improve them."""


@library_app.command("list")
def list_library(selection: SelectionArgument = "all", library: FolderOption = None) -> None:
    """List missions: nodes, arcs, robots, plans and area of the best known front, certified gap."""
    with failing():
        from botohe_moo.library import FOLDER, library_table

        table = library_table(selection, folder=library or FOLDER)
    shown = table.drop(columns=["bound_area"])
    formats: Any = {"area": "{:.6f}".format, "gap": lambda gap: f"{100 * gap:.2f} %"}
    tell(shown.to_string(index=False, formatters=formats, na_rep="-"))
    tell("\n`botohe solve library:NAME` searches, `botohe library add DIR` hands in what it found.")


@library_app.command("check")
def check(selection: SelectionArgument = "all", library: FolderOption = None) -> None:
    """Evaluate all plans of the best known fronts again, and compare with what is said of them.

    The exit status is 1 if something is wrong, 2 for bad input.
    """
    with failing():
        from botohe_moo.library import FOLDER, check_library, library_names

        names = library_names(selection)
        faults = check_library(names, folder=library or FOLDER)
    for name in names:
        (say if name in faults else tell)(faults.get(name, f"{name}: right"))
    if faults:
        raise typer.Exit(FAILED)
    tell(f"\n{counted(len(names), 'mission')}: each plan was evaluated again, none is dominated")


@library_app.command("add")
def add(
    found: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            exists=True,
            file_okay=False,
            help="Folder that `solve` or `study run` wrote, on missions of the library.",
        ),
    ],
    by: Annotated[str, typer.Option("--by", metavar="NAME", help="Who found the plans.")],
    on: Annotated[
        str | None,
        typer.Option("--on", metavar="DATE", help="When, as 2026-11-27; by default today."),
    ] = None,
    library: FolderOption = None,
) -> None:
    """Merge the plans of a solution or a study into the best known fronts.

    Plans that are dominated leave. Additions in any order give the same files.
    """
    with failing():
        from botohe_moo.library import FOLDER, add_plans

        date = dt.date.today().isoformat() if on is None else on
        changed = add_plans(_found_in(found, by, date), folder=library or FOLDER)
    for name, (before, after, path) in changed.items():
        was, now = ({*map(tuple, front.objectives.tolist())} for front in (before, after))
        n_new = len(now - was)
        grown = f" ({100 * (after.area / before.area - 1):+.4f} %)" if before.area and n_new else ""
        wrote = "" if path is None else f"; wrote {path}"
        tell(f"{name}: {counted(n_new, 'new plan')}, area {after.area:.6f}{grown}{wrote}")


def _found_in(folder: Path, by: str, on: str) -> Found:
    """Read the plans of a solution or a study, by the library's name of their mission."""
    from botohe_moo.library import Finder
    from botohe_moo.mission.loading import library_name_of
    from botohe_moo.mission.model import numbers_digest
    from botohe_moo.solution import read_solution
    from botohe_moo.study import read_study

    found: Found = {}
    if (folder / "plans.json").exists():
        read = read_solution(folder)
        missions = [read.mission]
        if name := library_name_of(numbers_digest(read.mission)):
            method = _method(read.algorithm, read.parameters, read.evaluations, read.seed)
            found[name] = [(read.plans, Finder(on, by, method))]
    else:
        tables = read_study(folder)
        missions = [tables.mission(label) for label in tables.mission_labels]
        for label, mission in zip(tables.mission_labels, missions, strict=True):
            if name := library_name_of(numbers_digest(mission)):
                lists = found.setdefault(name, [])
                for plans, method in _of_runs(tables, label, mission):
                    lists.append((plans, Finder(on, by, method)))
    if not found:
        others = ", ".join(f"{mission.name!r} of {mission.team}" for mission in missions)
        raise ValueError(
            f"{folder}: expected plans of a mission of the library, found those of {others}: no "
            "mission of the library has the same nodes, arcs and team."
        )
    return found


def _of_runs(tables: StudyTables, label: str, mission: Mission) -> Iterator[tuple[PlanBatch, str]]:
    """Give the plans of each run on a mission of a study, and how they were found."""
    from pydantic import Field, TypeAdapter

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
                f"{tables.folder / 'plans.csv.gz'}, run {run}: expected {mission.robots} trails "
                f"of nodes of {label!r} in each plan."
            ) from None
        said = tables.manifest["algorithms"][algorithm]
        method = _method(said["algorithm"], said["parameters"], evaluations, seed)
        yield mission.pack(plans), method


def _method(algorithm: str, parameters: Mapping[str, Any], evaluations: int, seed: int) -> str:
    from botohe_moo.study.words import parameter_words

    given = f" ({parameter_words(parameters)})" if parameters else ""
    return f"{algorithm}{given}, {evaluations:,} evaluations, seed {seed}"
