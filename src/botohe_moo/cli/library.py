"""The commands ``botohe library ...``: missions that others measure against."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from botohe_moo._base.words import counted
from botohe_moo.cli.options import path_option
from botohe_moo.cli.shell import FAILED, failing, say, tell

if TYPE_CHECKING:
    from botohe_moo.library.fronts import Finder
    from botohe_moo.mission.model import Mission
    from botohe_moo.trails import TrailPlan

    Found = dict[str, list[tuple[list[TrailPlan], Finder]]]

library_app = typer.Typer(no_args_is_help=True)

SelectionArgument = Annotated[
    str,
    typer.Argument(
        metavar="SELECTION",
        help="A mission's name, a family, or one of small, medium, large, all.",
    ),
]
FolderOption = Annotated[
    Path | None,
    path_option(
        "--library", metavar="DIR", help="Folder of the library; by default that of the package."
    ),
]


@library_app.callback()
def library() -> None:
    """Missions with best known fronts and certified bounds: list, check, improve them."""


@library_app.command("list")
def list_library(selection: SelectionArgument = "all", library: FolderOption = None) -> None:
    """List missions: nodes, arcs, robots, plans and area of the best known front, certified gap."""
    with failing():
        from botohe_moo.library import library_names, library_table

        table = library_table(library_names(selection), **_in(library))
    shown = table.drop(columns=["bound_area"])
    formats: Any = {"area": "{:.6f}".format, "gap": lambda gap: f"{100 * gap:.2f} %"}
    tell(shown.to_string(index=False, formatters=formats))
    tell("\n`botohe solve library:NAME` searches, `botohe library add DIR` hands in what it found.")


@library_app.command("check")
def check(selection: SelectionArgument = "all", library: FolderOption = None) -> None:
    """Evaluate all plans of the best known fronts again, and compare with what is said of them.

    The exit status is 1 if something is wrong, 2 for bad input.
    """
    with failing():
        from botohe_moo.library import check_library, library_names

        names = library_names(selection)
        wrong = 0
        for name in names:
            faults = check_library([name], **_in(library))
            wrong += len(faults)
            if faults:
                say(faults[name])
            else:
                tell(f"{name}: right")
    if wrong:
        raise typer.Exit(FAILED)
    tell(f"\n{counted(len(names), 'mission')}: each plan was evaluated again, none is dominated")


@library_app.command("add")
def add(
    found: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
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
        from botohe_moo.library.collection import add_plans

        date = dt.date.today().isoformat() if on is None else on
        changed = add_plans(_found_in(found, by, date), **_in(library))
    for name, (before, after) in changed.items():
        n_new = len({*map(tuple, after.objectives)} - {*map(tuple, before.objectives)})
        grown = f" ({100 * (after.area / before.area - 1):+.4f} %)" if before.area else ""
        tell(f"{name}: {counted(n_new, 'new plan')}, area {after.area:.6f}{grown}")


def _in(folder: Path | None) -> dict[str, Any]:
    return {} if folder is None else {"folder": folder}


def _found_in(folder: Path, by: str, on: str) -> Found:
    """Read the plans of a solution or a study, by the library's name of their mission."""
    from botohe_moo.library.fronts import Finder
    from botohe_moo.mission.collection import mission_of
    from botohe_moo.mission.digest import numbers_digest
    from botohe_moo.solution import read_solution

    if (folder / "plans.json").exists():
        read = read_solution(folder)
        how = (read.algorithm, read.evaluations, read.seed)
        lists = [(read.mission, list(read.plans), how)]
    else:
        lists = list(_of_study(folder))
    found: Found = {}
    for mission, plans, how in lists:
        if name := mission_of(numbers_digest(mission)):
            method = "{}, {:,} evaluations, seed {}".format(*how)
            found.setdefault(name, []).append((plans, Finder(on, by, method)))
    if not found:
        others = ", ".join(dict.fromkeys(mission.name for mission, *_ in lists))
        raise ValueError(
            f"{folder}: expected plans of a mission of the library, found those of {others}: no "
            "mission of the library has the same numbers, base and robots."
        )
    return found


def _of_study(folder: Path) -> Iterator[tuple[Mission, list[TrailPlan], tuple[str, int, int]]]:
    """Give the mission, the plans and the method of each run of a study."""
    from botohe_moo.study import read_study

    tables = read_study(folder)
    names = dict(zip(tables.algorithms["algorithm"], tables.algorithms["name"], strict=True))
    trails = dict(iter(tables.plans.groupby("run")["trails"]))
    columns = ["run", "mission", "algorithm", "evaluations", "seed"]
    for run, label, algorithm, evaluations, seed in tables.runs[columns].itertuples(index=False):
        mission = tables.mission(label)
        plans = [mission.plan(json.loads(text)) for text in trails.get(run, ())]
        yield mission, plans, (names[algorithm], evaluations, seed)
