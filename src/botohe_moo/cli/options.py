"""Arguments and options that several commands take."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer


def integer_option(*names: str, metavar: str, help: str, at_least: int = 1) -> Any:  # noqa: A002
    """Make an option for integers whose message says what was found, unlike typer's own."""

    def parse(text: str) -> int:
        with suppress(ValueError):
            if (number := int(text)) >= at_least:
                return number
        raise typer.BadParameter(f"expected an integer >= {at_least}, got {text}.")

    return typer.Option(*names, metavar=metavar, parser=parse, help=help)


def probability(text: str) -> float:
    """Parse an option that is a probability."""
    with suppress(ValueError):
        if 0 <= (number := float(text)) <= 1:
            return number
    raise typer.BadParameter(f"expected a probability in [0, 1], got {text}.")


def length(text: str) -> float:
    """Parse an option that is a length; ``inf`` for no limit."""
    with suppress(ValueError):
        if (number := float(text)) >= 0:
            return number
    raise typer.BadParameter(f"expected a number >= 0, or inf for no limit, got {text}.")


def seconds(text: str) -> float:
    """Parse an option that is a time."""
    with suppress(ValueError):
        if 0 < (number := float(text)) < float("inf"):
            return number
    raise typer.BadParameter(f"expected a number of seconds > 0, got {text}.")


def given_path(text: str) -> Path:
    """Parse an option that is a path; an empty one, as of an unset variable, is refused."""
    if not text:
        raise typer.BadParameter("expected a path, got an empty text.")
    return Path(text)


def out_option(metavar: str, help: str) -> Any:  # noqa: A002
    """Make an option for what is written."""
    return typer.Option("--out", "-o", metavar=metavar, parser=given_path, help=help)


def pairs_option(*names: str, help: str) -> Any:  # noqa: A002
    """Make an option for parameters, given as NAME=VALUE."""
    return typer.Option(*names, metavar="NAME=VALUE", help=f"{help} Repeatable.")


MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission's name, or a mission file.")
]
RobotsOption = Annotated[
    int | None, integer_option("--robots", metavar="K", help="Another number of robots.")
]
MinSurvivalOption = Annotated[
    float,
    typer.Option(
        "--min-survival",
        metavar="P",
        parser=probability,
        help="Survival floor: every robot survives with at least this probability.",
    ),
]
MaxLengthOption = Annotated[
    float | None,
    typer.Option(
        "--max-length",
        metavar="L",
        parser=length,
        help="Travel budget: every robot's trail is at most this long, in the unit of the arcs' "
        "length; by default the mission's own, if it has one; inf for none.",
    ),
]
MissionParameterOption = Annotated[
    list[str] | None,
    pairs_option(
        "--mission-parameter", "-m", help="A parameter of the mission, such as nodes=500 or seed=3."
    ),
]
ParameterOption = Annotated[
    list[str] | None,
    pairs_option("--parameter", "-p", help="A parameter of the algorithm, such as n_ants=50."),
]
EvaluationsOption = Annotated[
    int, integer_option("--evaluations", "-n", metavar="N", help="Trail plans to evaluate.")
]
SeedOption = Annotated[
    int,
    integer_option("--seed", "-s", metavar="S", at_least=0, help="Seed of the random numbers."),
]


def read_parameters(pairs: Iterable[str]) -> dict[str, Any]:
    """Read NAME=VALUE pairs, each name once; numbers as in Python, everything else as in YAML."""
    found: dict[str, Any] = {}
    for pair in pairs:
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
    parameters = read_parameters(pairs or [])
    if "name_or_path" in parameters:
        raise ValueError(f"Mission {mission!r}: there is no parameter 'name_or_path'.")
    if robots is not None:
        if "robots" in parameters:
            raise ValueError("Expected each parameter once, got 'robots' twice.")
        parameters["robots"] = robots
    return {"name_or_path": mission, **parameters}
