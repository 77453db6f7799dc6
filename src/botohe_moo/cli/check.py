"""The command ``botohe check``."""

from __future__ import annotations

import contextlib
import sys
from collections import Counter
from typing import TYPE_CHECKING, Annotated

import typer

from botohe_moo.cli.options import pairs_option, read_parameters
from botohe_moo.cli.shell import FAILED, failing, paragraph, tell

if TYPE_CHECKING:
    from botohe_moo.testing import CheckResult


def check_conformance(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="module:Class, module:function, or a registered name."),
    ],
    mission: Annotated[
        bool,
        typer.Option("--mission", help="Check a mission, where an algorithm has the name, too."),
    ] = False,
    parameter: Annotated[
        list[str] | None, pairs_option("--parameter", "-p", "A parameter to check it with.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the results as JSON.")] = False,
) -> None:
    """Check that an algorithm, or a mission, fits into studies.

    Names each rule, whether it is kept, what happened where it is not, and what to do.

    The exit status is 1 if a rule is broken, 2 for bad input.
    """
    with failing():
        parameters = read_parameters(parameter)
        from botohe_moo import testing
        from botohe_moo.testing.checking import kind_of

        mission = mission or kind_of(name) == "mission"
        check = testing.check_mission if mission else testing.check_algorithm
        with contextlib.redirect_stdout(sys.stderr):  # what an algorithm prints is not a result
            results = check(name, parameters)
    if as_json:
        import json
        from dataclasses import asdict

        tell(json.dumps([asdict(result) for result in results], indent=2))
    else:
        _tell_results(results)
    if any(result.status != "passed" for result in results):
        raise typer.Exit(FAILED)


def _tell_results(results: list[CheckResult]) -> None:
    width = max(len(result.rule) for result in results)
    for result in results:
        tell(f"{result.rule:{width}}  {result.status:8} {result.seconds:6.1f} s")
    for result in results:
        if result.status == "failed":
            tell("")
            tell(paragraph(f"{result.rule}: {result.message}."))
            tell(paragraph(f"To keep it: {result.remedy}"))
    counts: Counter[str] = Counter(result.status for result in results)
    shown = (status for status in ("passed", "failed", "not run") if counts[status])
    tell("\n" + ", ".join(f"{counts[status]} {status}" for status in shown))
