"""The missions that have a name: those of the package and those that other packages register."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal, NamedTuple

import networkx as nx

from botohe_moo._base.checks import check_choice, quoted
from botohe_moo._plugins.checks import Fault, call_factory, check_values, checked, raised_fault
from botohe_moo._plugins.entry_points import PluginError, PluginGroup, declared_factory, package_of
from botohe_moo._plugins.stated import Parameter, accepted_parameters, summary_of
from botohe_moo._plugins.types import Robots
from botohe_moo.mission.formats.files import file_parameters, read_mission
from botohe_moo.mission.formats.nodelink import read_node_link
from botohe_moo.mission.formats.reading import Source, format_of, is_file_name, suffixes
from botohe_moo.mission.formats.tables import make_mission
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.mission.rules import MissionError

PREFIX = "library:"  # before the name of a mission, and of several


class Entry(NamedTuple):
    """A mission of the library.

    Attributes
    ----------
    family
        What it has in common with others.
    size
        Small up to 40 nodes, medium up to 100, large above.
    source, parameters
        The named mission or generator that makes it, and with which parameters.
    digest
        That of its numbers.
    """

    family: str
    size: Literal["small", "medium", "large"]
    source: str
    parameters: Mapping[str, Any]
    digest: str


_DATA = files("botohe_moo.mission").joinpath("data", "library.json")
ENTRIES: Mapping[str, Entry] = {
    name: Entry(**said) for name, said in json.loads(_DATA.read_text("utf-8")).items()
}
FAMILIES = tuple(dict.fromkeys(entry.family for entry in ENTRIES.values()))
SELECTIONS = ("small", "medium", "large", "all", *FAMILIES)  # names of several missions


def library_names(selection: str = "all") -> tuple[str, ...]:
    """Return the names of missions of the library.

    Parameters
    ----------
    selection
        A name; ``small``, ``medium``, ``large`` or ``all``; or a family. A ValueError lists what is
        known.

    Examples
    --------
    >>> from botohe_moo.library import library_names
    >>> library_names("tunnel")
    ('tunnel-20', 'tunnel-75', 'tunnel-1000')
    """
    check_choice("a mission of the library", selection, [*SELECTIONS, *ENTRIES])
    return tuple(
        name
        for name, entry in ENTRIES.items()
        if selection in ("all", name, entry.family, entry.size)
    )


def library_name_of(digest: str) -> str | None:
    """Return the name of the mission of the library with this digest of its numbers."""
    return next((name for name, entry in ENTRIES.items() if entry.digest == digest), None)


COMMON = ("robots", "lengths_from_pos")  # parameters that every mission takes
_PLUGINS = PluginGroup("botohe_moo.missions", "mission")
_ITSELF = ("The mission", "Mission '")  # what errors of a mission begin with, not those of a file


@checked
def art_museum(*, robots: Robots | None = None) -> Mission:
    """The San Diego Museum of Art: 27 rooms, 74 arcs, 3 robots.

    References
    ----------
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025.
    """
    return _packaged("art_museum", robots)


@checked
def art_museum_return(*, robots: Robots | None = None) -> Mission:
    """The museum of ``art_museum``, whose rewards count when robots come back to the base."""
    museum = _packaged("art_museum", robots)
    graph = museum.graph.copy()
    graph.graph["title"] = f"{museum.title}, rewards on return"
    return Mission(graph, robots=museum.robots, pays="return", name="art_museum_return")


@checked
def power_plant(*, robots: Robots | None = None) -> Mission:
    """The Satsop nuclear power plant: a tree of 73 zones, 144 arcs, 2 robots.

    References
    ----------
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025; the site is the urban circuit of the DARPA
    Subterranean Challenge.
    """
    return _packaged("power_plant", robots)


@checked
def terrain_200(*, robots: Robots | None = None) -> Mission:
    """A rolling terrain: 200 waypoints, 1348 arcs between near ones, 5 robots."""
    return _packaged("terrain_200", robots)


@checked
def toy(*, robots: Robots | None = None) -> Mission:
    """A mission small enough to compute by hand: 5 nodes, 12 arcs, 2 robots."""
    return _packaged("toy", robots)


def _packaged(name: str, robots: int | None) -> Mission:
    with as_file(files("botohe_moo.mission").joinpath("data", f"{name}.json")) as path:
        return make_mission(read_node_link(Source(path)), robots=robots)


@checked
def load_mission(
    name_or_path: str | os.PathLike[str],
    *,
    robots: int | None = None,
    lengths_from_pos: bool = False,
    **parameters: Any,
) -> Mission:
    """Return the mission of a name, or the one in a file.

    Parameters
    ----------
    name_or_path
        A name among `mission_names`, ``library:NAME`` with one of
        :func:`~botohe_moo.library.library_names`, or the path of a file that `read_mission` reads.
        A text is a path if it has a suffix of such files or a path separator, or if it names a file
        and no mission. ``module:function`` names a mission that is not registered: a function whose
        annotation says that it returns a `Mission`, or a class derived from it. Nothing else is
        called, but importing the module runs it.
    robots
        Team size; default: the mission's own.
    lengths_from_pos
        Whether every arc is as long as its nodes are apart: :meth:`Mission.with_lengths_from_pos`.
    parameters
        Those of the named mission, such as ``nodes`` of a generator, or options of `read_mission`.

    Raises
    ------
    MissionError
        If there is no such mission, it cannot be loaded, or the file holds no valid mission.
    ValueError
        If a parameter is unknown or out of its range.

    Notes
    -----
    Packages register missions in the entry-point group ``botohe_moo.missions``: callables that take
    keywords and return a `Mission`. They state their parameters as algorithms do
    (:func:`~botohe_moo.make_algorithm`), and only those can be given.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> load_mission("art_museum", robots=4)
    <Mission 'art_museum': 27 nodes, 74 arcs, 4 robots at base 1, total reward 13.0667>
    >>> len(load_mission("terrain", nodes=50, seed=1).nodes)
    50
    """
    function = find_factory(name_or_path)
    if function is None:
        mission = read_mission(name_or_path, robots=robots, **parameters)
    else:
        mission = _make(function, str(name_or_path), robots, parameters)
    return mission.with_lengths_from_pos() if lengths_from_pos else mission


def mission_faults(
    name_or_path: str | os.PathLike[str],
    parameters: Mapping[str, Any] | None = None,
    *,
    plain: bool = False,
) -> list[Fault]:
    """Return everything that keeps `load_mission` from making a mission.

    As :func:`~botohe_moo.algorithms.registry.algorithm_faults` does; ``robots`` and
    ``lengths_from_pos`` are parameters, too.

    Examples
    --------
    >>> mission_faults("terrain", {"nodes": "50", "robots": 3})
    [('nodes', "Expected nodes to be an integer >= 2, got '50'.")]
    """
    given = parameters or {}
    try:
        accepted = _accepted(name_or_path)
        if faults := check_values(accepted, given, plain=plain, also=COMMON):
            return faults
        load_mission(name_or_path, **given)
    except MissionError as error:
        return [(None, fault) for fault in error.faults]
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        return [raised_fault(error, given, source=_PLUGINS.source(name_or_path))]
    return []


def _accepted(name_or_path: str | os.PathLike[str]) -> tuple[Parameter, ...]:
    """Return the parameters of a named mission, or the options of a file's format."""
    function = find_factory(name_or_path)
    return accepted_parameters(function) if function else file_parameters(format_of(name_or_path))


def relative_to(
    folder: Path, name_or_path: str | os.PathLike[str], parameters: Mapping[str, Any]
) -> dict[str, Any]:
    """Return parameters of a mission, with paths in a file relative to the file's folder."""
    try:
        paths = {parameter.name for parameter in _accepted(name_or_path) if parameter.is_path}
    except ValueError:  # whoever loads the mission says why it cannot be found
        paths = set()
    return {
        name: str(folder / value) if name in paths and isinstance(value, str) else value
        for name, value in parameters.items()
    }


def mission_names() -> tuple[str, ...]:
    """Return the names that `load_mission` knows, sorted; warns of what cannot be loaded.

    Examples
    --------
    >>> from botohe_moo import mission_names
    >>> "art_museum" in mission_names()
    True
    """
    return _PLUGINS.names()


def mission_origin(name_or_path: str | os.PathLike[str]) -> dict[str, str | None]:
    """Return which ``package`` in which ``version`` registers a mission.

    Both are None for files, and for missions that are not registered. A MissionError is raised if
    two packages claim the name.
    """
    owner = None
    if isinstance(name_or_path, str) and name_or_path.startswith(PREFIX):
        name_or_path = ENTRIES[name_or_path.removeprefix(PREFIX)].source
    if isinstance(name_or_path, str) and name_or_path in _PLUGINS.claims():
        try:
            owner = _PLUGINS.entry(name_or_path).dist
        except PluginError as error:
            raise MissionError(str(error), _PLUGINS.source(name_or_path)) from error
    return package_of(owner)


def mission_parameters(name_or_path: str | os.PathLike[str]) -> tuple[Parameter, ...]:
    """List the parameters of a named mission, or of files in a format, besides ``robots``."""
    return tuple(one for one in _accepted(name_or_path) if one.name != "robots")


def describe_mission(name: str) -> str:
    """Return the summary of a named mission's docstring, which may be empty."""
    return summary_of(_PLUGINS.load(name))


def find_factory(name: str | os.PathLike[str]) -> Callable[..., Any] | None:
    """Find the function that makes a mission; None for what is read from a file."""
    if isinstance(name, os.PathLike):
        return None
    if not isinstance(name, str):
        made = "; Mission(graph, base=..., robots=...) makes one of a graph"
        hint = made if isinstance(name, nx.Graph) else ""
        raise ValueError(f"Expected the name of a mission or a path, got {quoted(name)}{hint}.")
    if name.startswith(PREFIX):
        return _of_library(name.removeprefix(PREFIX))
    separators = {os.sep, os.altsep or os.sep}
    known = name in _PLUGINS.claims()
    if not known and (is_file_name(name) or not separators.isdisjoint(name)):
        return None
    if not known and Path(name).is_file():
        return None
    try:
        if known or ":" not in name:
            return _PLUGINS.load(name)
        return declared_factory(name, _PLUGINS, Mission)
    except PluginError as error:
        hint = f"; mission files end in one of {', '.join(suffixes())}"
        if Path(name).suffix.lower() == ".csv":
            hint = "; mission_from_tables, and botohe missions import, read tables"
        message = f"{error}{'' if known or ':' in name else hint}"
        raise MissionError(message, _PLUGINS.source(name)) from error


def _of_library(name: str) -> Callable[[], Mission]:
    """Return the function that makes a mission of the library."""
    if name not in library_names(name):
        several = ", ".join(library_names(name))
        raise MissionError(f"expected one mission, but these are several: {several}", PREFIX + name)
    entry = ENTRIES[name]

    def make() -> Mission:
        made = load_mission(entry.source, **entry.parameters)
        how: dict[str, Any] = {"base": made.base, "kinds": made.kinds, "pays": made.pays}
        mission = Mission(made.graph, **how, name=name)
        if (found := numbers_digest(mission)) != entry.digest:
            raise MissionError(
                f"expected the digest {entry.digest}, got {found}: the numbers that are drawn here "
                "are others than those of the library",
                f"Mission {quoted(name)} of the library",
            )
        return mission

    return make


def _make(
    function: Callable[..., Any], name: str, robots: int | None, parameters: dict[str, Any]
) -> Mission:
    source, origin = _PLUGINS.source(name), _PLUGINS.origin(name)
    accepted = accepted_parameters(function)
    if robots is not None and any(parameter.name == "robots" for parameter in accepted):
        parameters = {**parameters, "robots": robots}
    passing = (MissionError, MemoryError)
    try:
        mission = call_factory(
            source, function, accepted, parameters, origin=origin, also=COMMON, passing=passing
        )
    except PluginError as error:
        raise MissionError(str(error).removeprefix(f"{source}: "), source) from error
    except MissionError as error:
        where = "" if error.source.startswith(_ITSELF) else f": {error.source}"
        raise MissionError(list(error.faults), f"{source}{where}") from error
    if not isinstance(mission, Mission):
        raise MissionError(f"expected {origin} to give a Mission, got {quoted(mission)}", source)
    if robots is not None and robots != mission.robots:
        return mission.with_robots(robots)
    return mission
