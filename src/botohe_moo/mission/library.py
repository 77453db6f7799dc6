"""The missions that have a name: those of the package and those that other packages register."""

from __future__ import annotations

import inspect
import os
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from botohe_moo._checks import check_parameters, keyword_names
from botohe_moo._plugins import PluginError, PluginGroup
from botohe_moo.mission.files import SUFFIXES, read_mission
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "art_museum",
    "describe_mission",
    "load_mission",
    "mission_names",
    "power_plant",
    "terrain_200",
    "toy",
]

_PLUGINS = PluginGroup("botohe_moo.missions", "mission")


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
    known = name in _PLUGINS.claims()
    if not known and Path(name).is_file():
        return read_mission(name, robots=robots, **parameters)
    source = _PLUGINS.source(name)
    try:
        function = _PLUGINS.load(name)
    except PluginError as error:
        hint = "" if known else f"; mission files end in one of {', '.join(SUFFIXES)}"
        raise MissionError(f"{error}{hint}", source) from error
    return _make(function, source, robots, parameters)


def mission_names() -> tuple[str, ...]:
    """Give the names that `load_mission` knows, sorted.

    What cannot be imported, or has the name of another package's mission, is left out with a
    warning that names it.
    """
    return _PLUGINS.names()


def describe_mission(name: str) -> str:
    """Give the first line of what a named mission says of itself."""
    return (inspect.getdoc(_PLUGINS.load(name)) or "").partition("\n")[0]


def _make(
    function: Callable[..., Any], source: str, robots: int | None, parameters: dict[str, Any]
) -> Mission:
    accepted = keyword_names(function)
    check_parameters(source, parameters, accepted, also=("robots",))
    if robots is not None and (accepted is None or "robots" in accepted):
        parameters = {**parameters, "robots": robots}
    if accepted is not None:
        try:
            inspect.signature(function).bind(**parameters)
        except TypeError as error:
            raise ValueError(f"{source}: {error}.") from None
    mission = function(**parameters)
    if not isinstance(mission, Mission):
        raise MissionError(f"expected its function to return a Mission, got {mission!r}", source)
    if robots is not None and robots != mission.robots:
        return mission.with_robots(robots)
    return mission
