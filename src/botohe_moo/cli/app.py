"""The ``botohe`` command: a thin layer over the library.

Only typer is imported here. A command imports what it needs when it runs, so that ``--help``
answers at once.
"""

from __future__ import annotations

import contextlib
import sys
from collections import Counter
from dataclasses import asdict
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from botohe_moo.cli import common, plans, solve
from botohe_moo.cli.common import command, failing, paragraph, tell
from botohe_moo.cli.missions import library_app, missions_app
from botohe_moo.cli.study import study_app

if TYPE_CHECKING:
    from botohe_moo.testing import CheckResult

_PLAIN_ONLY = " Not for kinds of robots, nor for rewards that count on return."

app = typer.Typer(
    name="botohe",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # its help breaks lines within sentences, and gives flags a value
)
for each in (*solve.COMMANDS, *plans.COMMANDS):
    command(app)(each)
app.add_typer(study_app, name="study")
app.add_typer(missions_app, name="missions")
app.add_typer(library_app, name="library")


def main() -> None:
    """Run the command line and end the process."""
    # module:Class may be in the current folder; last, so that it shadows nothing.
    sys.path.append(str(Path.cwd()))
    common.run(app)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        tell(f"botohe-moo {version('botohe-moo')}")
        raise typer.Exit


@app.callback()
def botohe(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Plan trails for robot teams in hazardous environments: reward against survival."""


@command(app)
def algorithms(name: str | None = None) -> None:
    """List the algorithms, or the parameters of one.

    Parameters
    ----------
    name : NAME
        Show the parameters of this algorithm.
    """
    from botohe_moo.algorithms.registry import algorithm_names, algorithm_parameters

    if name is None:
        tell(common.table(((each, _summary(each)) for each in algorithm_names()), wrap=True))
        tell(f"\n{paragraph('`botohe algorithms NAME` shows the parameters of one.')}")
        return
    with failing():
        parameters = algorithm_parameters(name)
    tell(paragraph(f"{name}: {_summary(name)}".removesuffix(": ")))
    for parameter in parameters:
        tell(f"\n{common.parameter_text(parameter)}")
    if given := next((each for each in parameters if each.plain), None):
        example = f"botohe solve MISSION -a {name} -p {common.parameter_example(given)}"
        tell(f"\nGive one as in `{example}`.")


def _summary(name: str) -> str:
    """Describe an algorithm, and say what it does not support."""
    from botohe_moo.algorithms.registry import describe_algorithm, plans_for_kinds

    return common.plain(describe_algorithm(name)) + ("" if plans_for_kinds(name) else _PLAIN_ONLY)


@command(app)
def check(name: str, *, parameter: list[str] | None = None, json: bool = False) -> None:
    """Check that an algorithm or a mission works in studies.

    Lists the rules, and which of them are kept. For each broken rule it says what happened and what
    to do.

    The exit status is 1 if a rule is broken, and 2 for bad input.

    Parameters
    ----------
    name : NAME
        module:Class, module:function, or a registered name.
    parameter : -p NAME=VALUE
        A parameter to check it with. Repeatable.
    json
        Print the results as JSON.
    """
    with failing():
        parameters = common.read_parameters(parameter)
        from botohe_moo import testing

        with contextlib.redirect_stdout(sys.stderr):  # what an algorithm prints is not a result
            results = testing.check_plugin(name, parameters)
    if json:
        tell(dumps([asdict(result) for result in results], indent=2))
    else:
        _tell_results(results)
    if any(result.status != "passed" for result in results):
        raise typer.Exit(common.FAILED)


def _tell_results(results: list[CheckResult]) -> None:
    rows = ((each.rule, each.status) for each in results)
    tell(common.table(rows, n_texts=2))
    for result in results:
        if result.status == "failed":
            said = result.message.removesuffix(".")
            tell(f"\n{paragraph(f'{result.rule}: {said}.')}")
            tell(paragraph(f"To keep it: {result.remedy}"))
    counts = Counter(str(result.status) for result in results)
    tell("\n" + ", ".join(f"{number} {status}" for status, number in counts.items()))
