"""The command ``botohe explore``: a front as a page to look with."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from botohe_moo.cli.choose import ChooseOption, FolderArgument
from botohe_moo.cli.describe import paragraph
from botohe_moo.cli.options import out_option
from botohe_moo.cli.shell import failing, say, tell

if TYPE_CHECKING:
    from botohe_moo.decide import Choice
    from botohe_moo.solution import Solution


def explore_front(
    folder: FolderArgument,
    out: Annotated[
        Path | None,
        out_option("FILE.html", "File to write; by default DIR/explorer.html."),
    ] = None,
    wish: ChooseOption = None,
    open_page: Annotated[
        bool, typer.Option("--open", help="Open the page in the browser.")
    ] = False,
) -> None:
    """Write a page to walk along a front and compare its plans.

    One HTML file that needs no network: the front beside the map of the site, distributions of
    reward and survivors, up to four plans side by side, filters, and export of plans.

    The plan that --choose chooses is marked on it. If no plan meets all wishes, it is the nearest
    one, and the exit status is still 0. It is 2 for bad input, and if the page cannot be written.
    """
    with failing():
        from botohe_moo.explorer.page import check_page_file
        from botohe_moo.solution import read_solution
        from botohe_moo.solution.model import PAGE

        solution = read_solution(folder)
        path = check_page_file(folder / PAGE if out is None else out)
        choice = solution.choose(*wish) if wish else None
    if choice is not None:
        tell(paragraph(choice.why))
    write_page(solution, path, choice)
    if open_page:
        import webbrowser

        if not webbrowser.open(path.resolve().as_uri()):
            say(f"there is no browser here that could be started; open {path} in one.")


def write_page(solution: Solution, path: Path, choice: Choice | None) -> None:
    """Write the page of a solution, with a choice marked, and say so."""
    with failing():
        solution.explore(path, wishes=() if choice is None else [choice])
    tell(f"wrote {path}")
