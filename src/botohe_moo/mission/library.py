"""The missions that have a name: those of the package and those that other packages register."""

from __future__ import annotations

import os
import re
import warnings
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import as_file, files
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from botohe_moo.mission.files import (
    SUFFIXES,
    check_parameters,
    keyword_names,
    nearest_first,
    read_mission,
)
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

__all__ = ["art_museum", "load_mission", "mission_names", "power_plant", "terrain_200", "toy"]

_GROUP = "botohe_moo.missions"
_OURS = "botohe-moo"


def art_museum(*, robots: int | None = None) -> Mission:
    """Give the San Diego Museum of Art: 27 rooms, 74 arcs, 3 robots.

    Parameters
    ----------
    robots
        Team size; default: the mission's own.

    References
    ----------
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025.
    """
    return _packaged("art_museum", robots)


def power_plant(*, robots: int | None = None) -> Mission:
    """Give the Satsop nuclear power plant, a tree of 73 zones and 144 arcs, 2 robots.

    Parameters
    ----------
    robots
        Team size; default: the mission's own.

    References
    ----------
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025; the site is the urban circuit of the DARPA
    Subterranean Challenge.
    """
    return _packaged("power_plant", robots)


def terrain_200(*, robots: int | None = None) -> Mission:
    """Give a rolling terrain: 200 waypoints, 1348 arcs between near ones, 5 robots.

    Parameters
    ----------
    robots
        Team size; default: the mission's own.
    """
    return _packaged("terrain_200", robots)


def toy(*, robots: int | None = None) -> Mission:
    """Give a mission to reckon by hand: 5 nodes, 12 arcs, 2 robots.

    Parameters
    ----------
    robots
        Team size; default: the mission's own.
    """
    return _packaged("toy", robots)


def _packaged(name: str, robots: int | None) -> Mission:
    with as_file(files("botohe_moo.mission").joinpath("data", f"{name}.json")) as path:
        mission = read_mission(path)
    return mission if robots is None else mission.with_robots(robots)


def load_mission(
    name_or_path: str | os.PathLike[str], *, robots: int | None = None, **parameters: Any
) -> Mission:
    """Give the mission of that name, or the one in that file.

    Parameters
    ----------
    name_or_path
        One of `mission_names`, or the path of a file that `read_mission` reads: what ends like one,
        holds a path separator, is an ``os.PathLike``, or exists as a file and is no mission's name.
    robots
        Team size; default: the mission's own.
    parameters
        Those of the named mission, for example ``nodes`` and ``seed`` of a generator, or the
        options of `read_mission`.

    Raises
    ------
    MissionError
        If there is no such mission, it cannot be loaded, or the file holds no valid mission.
    ValueError
        If a parameter is unknown or out of its range.

    Notes
    -----
    Packages register missions in the entry-point group ``botohe_moo.missions``: callables that take
    keywords and return a `Mission`.

    Examples
    --------
    >>> load_mission("art_museum", robots=4)
    <Mission 'art_museum': 27 nodes, 74 arcs, 4 robots at base 1, total reward 13.0667>
    >>> len(load_mission("terrain", nodes=50, seed=1).nodes)
    50
    """
    if isinstance(name_or_path, os.PathLike):
        return read_mission(name_or_path, robots=robots, **parameters)
    if not isinstance(name_or_path, str):
        raise ValueError(f"Expected the name of a mission or a path, got {name_or_path!r}.")
    name = name_or_path
    separators = {os.sep, os.altsep or os.sep}
    if Path(name).suffix.lower() in SUFFIXES or not separators.isdisjoint(name):
        return read_mission(name, robots=robots, **parameters)
    claims = _claims()
    if name not in claims and Path(name).is_file():
        return read_mission(name, robots=robots, **parameters)
    source = f"Mission {name!r}"
    if name not in claims:
        raise MissionError(_unknown(name, claims), source)
    function = _load(_entry(claims[name], source), source)
    return _make(function, source, robots, parameters)


def mission_names() -> tuple[str, ...]:
    """Give the names that `load_mission` knows, sorted.

    What cannot be imported, or has the name of another package's mission, is left out with a
    warning that names it.
    """
    names = []
    for name, claimants in sorted(_claims().items()):
        source = f"Mission {name!r}"
        try:
            _load(_entry(claimants, source), source)
        except MissionError as error:
            warnings.warn(f"{error}; it is left out.", stacklevel=2)
        else:
            names.append(name)
    return tuple(names)


def _claims() -> dict[str, list[EntryPoint]]:
    """Find out, without importing anything, who registers a mission of which name."""
    claims: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=_GROUP):
        claims.setdefault(entry.name, []).append(entry)
    return claims


def _entry(claimants: list[EntryPoint], source: str) -> EntryPoint:
    """Choose who the name belongs to: this package, or else the only one that claims it."""
    ours = [entry for entry in claimants if _package(entry) == _OURS]
    others = [entry for entry in claimants if _package(entry) != _OURS]
    if ours and others:
        named = " and ".join(map(_package, others))
        warnings.warn(f"{source} of package {named} is left out: {_OURS} has it.", stacklevel=3)
    elif len({entry.value for entry in others}) > 1:
        named = " and ".join(map(_package, others))
        raise MissionError(f"the packages {named} both register this name", source)
    return (ours or others)[0]


def _package(entry: EntryPoint) -> str:
    return re.sub(r"[-_.]+", "-", entry.dist.name).lower() if entry.dist else "(unknown)"


def _load(entry: EntryPoint, source: str) -> Callable[..., Any]:
    origin = f"{entry.value} of package {_package(entry)}"
    try:
        function = entry.load()
    except Exception as error:  # whatever another package's code may raise
        found = f"{type(error).__name__}: {error}"
        raise MissionError(f"{origin} cannot be imported ({found})", source) from error
    if not callable(function):
        raise MissionError(f"expected {origin} to be a function, got {function!r}", source)
    return function  # type: ignore[no-any-return]


def _make(
    function: Callable[..., Any], source: str, robots: int | None, parameters: dict[str, Any]
) -> Mission:
    accepted = keyword_names(function)
    check_parameters(source, parameters, accepted, also=("robots",))
    if robots is not None and (accepted is None or "robots" in accepted):
        parameters = {**parameters, "robots": robots}
    if accepted is not None:
        try:
            signature(function).bind(**parameters)
        except TypeError as error:
            raise ValueError(f"{source}: {error}.") from None
    mission = function(**parameters)
    if not isinstance(mission, Mission):
        raise MissionError(f"expected its function to return a Mission, got {mission!r}", source)
    if robots is not None and robots != mission.robots:
        return mission.with_robots(robots)
    return mission


def _unknown(name: str, known: Iterable[str]) -> str:
    names = ", ".join(nearest_first(name, known))
    if not names:
        return f"no missions are registered; is the package {_OURS} installed?"
    suffixes = ", ".join(SUFFIXES)
    return f"there is no such mission; known are {names}; mission files end in one of {suffixes}"
