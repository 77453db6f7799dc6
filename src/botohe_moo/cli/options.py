"""Arguments and options that several commands take."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

PICTURES = (".png", ".svg", ".pdf")
_TEXTS = ("base",)


def path_option(*names: str, metavar: str, help: str) -> Any:  # noqa: A002
    """Make an option that takes a path, but not an empty one."""
    return typer.Option(*names, metavar=metavar, help=help, parser=_path)


def _path(text: str) -> Path:
    """Refuse an empty text, which the shell makes of an unset variable: it names this folder."""
    if not text:
        raise typer.BadParameter("expected a path, got an empty text.")
    return Path(text)


def out_option(metavar: str, help: str) -> Any:  # noqa: A002
    """Make an option for what is written."""
    return path_option("--out", "-o", metavar=metavar, help=help)


def pairs_option(name: str, letter: str, help: str) -> Any:  # noqa: A002
    """Make an option for NAME=VALUE pairs, which `read_parameters` reads."""
    return typer.Option(name, letter, metavar="NAME=VALUE", help=f"{help} Repeatable.")


MissionArgument = Annotated[
    str, typer.Argument(metavar="MISSION", help="A mission's name, or a mission file.")
]
RobotsOption = Annotated[
    int | None,
    typer.Option("--robots", metavar="K", help="Another number of robots."),
]
BaseOption = Annotated[
    str | None,
    typer.Option(
        "--base",
        metavar="NODE",
        help="The base of a mission file; default: the file's own, or a building's first charger.",
    ),
]
DangerOption = Annotated[
    float | None,
    typer.Option(
        "--danger",
        metavar="D",
        help="Rate of loss for a unit of length, in mission files whose arcs do not all have a "
        "survival: exp(−D · length).",
    ),
]
HazardOption = Annotated[
    Path | None,
    path_option(
        "--hazard",
        metavar="FILE",
        help="Map of where a mission file is dangerous: YAML as the map server of Nav2 reads it, "
        "with mode: scale. --danger is the rate where it is black.",
    ),
]
MinSurvivalOption = Annotated[
    float,
    typer.Option(
        "--min-survival",
        metavar="P",
        help="Survival floor: every robot survives with at least this probability.",
    ),
]
MaxLengthOption = Annotated[
    float | None,
    typer.Option(
        "--max-length",
        metavar="L",
        help="Travel budget: every robot's trail is at most this long, in the unit of the arcs' "
        "length; by default the mission's own, if it has one; inf for none.",
    ),
]
MissionParameterOption = Annotated[
    list[str] | None,
    pairs_option(
        "--mission-parameter",
        "-m",
        "A parameter of the mission, such as nodes=500, or of any mission file: reward=2, "
        "both_ways=true.",
    ),
]
ParameterOption = Annotated[
    list[str] | None,
    pairs_option("--parameter", "-p", "A parameter of the algorithm, such as n_ants=50."),
]
SeedOption = Annotated[
    int, typer.Option("--seed", "-s", metavar="S", help="Seed of the random numbers.")
]


def read_parameters(pairs: Iterable[str] | None) -> dict[str, Any]:
    """Read NAME=VALUE pairs: numbers as in Python, everything else as in YAML.

    A label stays the text that was typed, as the mission knows what its labels are.
    """
    found: dict[str, Any] = {}
    for pair in pairs or ():
        name, equals, value = pair.partition("=")
        if not equals or not name.isidentifier():
            raise ValueError(f"Expected a parameter as NAME=VALUE, got {pair!r}.")
        found[name] = value if name in _TEXTS else _value(name, value)
    return found


def read_kind(text: str) -> Any:
    """Read a kind of robots, written as NAME=ROBOTS or NAME=ROBOTS,start=LABEL,...

    Labels may have commas in them. What should be a number and is none stays text.
    """
    name, equals, rest = text.partition("=")
    if not equals:
        raise ValueError(f"Expected a kind as NAME=ROBOTS or NAME=ROBOTS,start=..., got {text!r}.")
    robots, *pairs = re.split(r",(?=\s*\w+\s*=)", rest)
    kind: dict[str, Any] = {"name": name.strip(), "robots": robots.strip()}
    for pair in pairs:
        key, _, value = pair.partition("=")
        if key.strip() in kind:
            raise ValueError(f"Expected {key.strip()!r} of a kind once, got {text!r}.")
        kind[key.strip()] = value.strip()
    for key, number in (("robots", int), ("min_survival", float), ("max_length", float)):
        with suppress(KeyError, ValueError):
            kind[key] = number(kind[key])
    return kind


def _value(name: str, text: str) -> Any:
    for number in (int, float):
        with suppress(ValueError):
            return number(text)
    from botohe_moo.base.documents import Document, DocumentError

    try:
        return Document(text).content
    except DocumentError:
        raise ValueError(
            f"Expected a number, true, false or text for {name!r}, got {text!r}."
        ) from None


def mission_options(pairs: list[str] | None, **options: object) -> dict[str, Any]:
    """Collect parameters of a mission, some of which are options of their own."""
    own = {name: value for name, value in options.items() if value is not None}
    own = {name: str(of) if isinstance(of, Path) else of for name, of in own.items()}
    parameters = read_parameters(pairs)
    for name in own.keys() & parameters.keys():
        raise ValueError(f"Expected --{name.replace('_', '-')} or -m {name}=VALUE, got both.")
    return parameters | own


def mission_source(mission: str, pairs: list[str] | None, **options: object) -> dict[str, Any]:
    """Collect the arguments of `load_mission`."""
    return {**mission_options(pairs, **options), "name_or_path": mission}
