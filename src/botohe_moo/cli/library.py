"""The commands ``botohe library ...``: missions that others measure against."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from botohe_moo.base.messages import counted
from botohe_moo.cli.common import FAILED, command, failing, frame_table, say, tell

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
    """Missions with best known fronts and certified bounds."""


@command(library_app, "list")
def list_library(selection: Selection = "all", *, library: Path | None = None) -> None:
    """List missions, best known areas and certified gaps."""
    with failing():
        from botohe_moo.library import FOLDER, library_table

        listed = library_table(selection, folder=library or FOLDER)
    tell(frame_table(listed, _TABLE, n_texts=3))
    tell("\n`botohe solve library:NAME` searches. `botohe library add DIR` adds what it found.")


@command(library_app)
def check(selection: Selection = "all", *, library: Path | None = None) -> None:
    """Evaluate all plans of the best known fronts again.

    Names each file that does not match its plans.

    The exit status is 1 if something is wrong, and 2 for bad input.
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


@command(library_app)
def add(
    found: Annotated[Path, typer.Argument(exists=True, file_okay=False)],
    *,
    by: str,
    library: Path | None = None,
) -> None:
    """Merge plans into the best known fronts.

    The plans come from a solution or a study. Dominated plans are dropped. The order of additions
    does not change the files.

    Parameters
    ----------
    found : DIR
        Folder that `solve` or `study run` wrote, on missions of the library.
    by : NAME
        Who found the plans.
    """
    with failing():
        from botohe_moo.library import FOLDER, add_plans
        from botohe_moo.study.runner import found_plans

        changed = add_plans(found_plans(found, by=by), folder=library or FOLDER)
    for name, (before, after, path) in changed.items():
        was, now = ({*map(tuple, front.objectives.tolist())} for front in (before, after))
        n_new = len(now - was)
        grown = f" ({100 * (after.area / before.area - 1):+.4f} %)" if before.area and n_new else ""
        wrote = "" if path is None else f"; wrote {path}"
        tell(f"{name}: {counted(n_new, 'new plan')}, area {after.area:.6f}{grown}{wrote}")
