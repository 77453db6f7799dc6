"""Arguments and options that several commands take."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer


def out_option(metavar: str, help: str) -> Any:  # noqa: A002
    """Make an option for what is written."""
    return typer.Option("--out", "-o", metavar=metavar, help=help, parser=_path)


def _path(text: str) -> Path:
    """Return a path; an empty text, which a variable that is not set leaves, is refused."""
    if not text:
        raise typer.BadParameter("expected a path, got an empty text")
    return Path(text)


MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission's name, or a mission file.")
]
RobotsOption = Annotated[
    int | None,
    typer.Option("--robots", metavar="K", min=1, help="Another number of robots."),
]
MinSurvivalOption = Annotated[
    float,
    typer.Option(
        "--min-survival",
        metavar="P",
        min=0,
        max=1,
        help="Survival floor: every robot survives with at least this probability.",
    ),
]
MaxLengthOption = Annotated[
    float | None,
    typer.Option(
        "--max-length",
        metavar="L",
        min=0,
        help="Travel budget: every robot's trail is at most this long, in the unit of the arcs' "
        "length; by default the mission's own, if it has one; inf for none.",
    ),
]
MissionParameterOption = Annotated[
    list[str] | None,
    typer.Option(
        "--mission-parameter",
        "-m",
        metavar="NAME=VALUE",
        help="A parameter of the mission, such as nodes=500 or seed=3. Repeatable.",
    ),
]
ParameterOption = Annotated[
    list[str] | None,
    typer.Option(
        "--parameter",
        "-p",
        metavar="NAME=VALUE",
        help="A parameter of the algorithm, such as n_ants=50. Repeatable.",
    ),
]
SeedOption = Annotated[
    int, typer.Option("--seed", "-s", metavar="S", min=0, help="Seed of the random numbers.")
]


def read_parameters(pairs: Iterable[str] | None) -> dict[str, Any]:
    """Read NAME=VALUE pairs, each name once; numbers as in Python, everything else as in YAML."""
    found: dict[str, Any] = {}
    for pair in pairs or ():
        name, equals, value = pair.partition("=")
        if not equals or not name.isidentifier():
            raise ValueError(f"Expected a parameter as NAME=VALUE, got {pair!r}.")
        if name in found:
            raise ValueError(f"Expected each parameter once, got {name!r} twice.")
        found[name] = _value(name, value)
    return found


def _value(name: str, text: str) -> Any:
    for number in (int, float):
        with suppress(ValueError):
            return number(text)
    from botohe_moo.study.file.document import Document, DocumentError

    try:
        return Document(text).content
    except DocumentError:
        raise ValueError(
            f"Expected a number, true, false or text for {name!r}, got {text!r}."
        ) from None


def mission_source(mission: str, robots: int | None, pairs: list[str] | None) -> dict[str, Any]:
    """Collect the arguments of `load_mission`."""
    given = [*(pairs or []), *([] if robots is None else [f"robots={robots}"])]
    parameters = read_parameters(given)
    if "name_or_path" in parameters:
        raise ValueError(f"Mission {mission!r}: there is no parameter 'name_or_path'.")
    return {"name_or_path": mission, **parameters}
