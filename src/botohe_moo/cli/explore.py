"""The command ``botohe explore``: a front as a page to look with."""

from __future__ import annotations

from botohe_moo.cli.interrupt import ending_on_interrupt

with ending_on_interrupt:
    from pathlib import Path
    from typing import TYPE_CHECKING, Annotated

    import typer

    from botohe_moo.cli.choose import FolderArgument
    from botohe_moo.cli.shell import FAILED, failing, say, tell

if TYPE_CHECKING:
    from collections.abc import Sequence

    from botohe_moo.solution import Solution


def explore_front(
    folder: FolderArgument,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", metavar="FILE.html", help="File to write; by default DIR/explorer.html."
        ),
    ] = None,
    wish: Annotated[
        list[str] | None,
        typer.Option(
            "--choose",
            metavar="WISH",
            help="Mark the plan that `botohe choose` chooses for this wish. Repeatable; "
            "wishes joined by ` and ` are to be met together.",
        ),
    ] = None,
    open_page: Annotated[
        bool, typer.Option("--open", help="Open the page in the browser.")
    ] = False,
) -> None:
    """Write a page on which to walk along a front, look at its plans and compare them.

    One HTML file that needs no network: the front beside the map of the site, distributions of
    reward and survivors, up to four plans side by side, filters, and export of plans.
    """
    with failing():
        from botohe_moo.decide import parse_wishes
        from botohe_moo.explorer.page import check_page_file
        from botohe_moo.solution import read_solution
        from botohe_moo.solution.model import PAGE

        solution = read_solution(folder)
        path = check_page_file(folder / PAGE if out is None else out)
        for text in wish or []:
            parse_wishes(solution.mission, [text])
    write_page(solution, path, wish or [])
    if open_page:
        import webbrowser

        if not webbrowser.open(path.resolve().as_uri()):
            say(f"there is no browser here that could be started; open {path} in one.")


def write_page(solution: Solution, path: Path, wishes: Sequence[str]) -> None:
    """Write the page of a solution, and say so."""
    with failing(FAILED):
        solution.explore(path, wishes=wishes)
    tell(f"wrote {path}")
