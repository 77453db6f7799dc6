"""The missions that have a name: those of the package and those that other packages register."""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, NamedTuple

from botohe_moo._base.checks import check_choice, quoted
from botohe_moo._plugins.checks import Fault, call_factory, checked, factory_faults
from botohe_moo._plugins.entry_points import PluginError, PluginGroup, declared_factory, package_of
from botohe_moo._plugins.stated import Parameter, accepted_parameters, summary_of
from botohe_moo._plugins.types import Robots
from botohe_moo.mission.formats.files import file_parameters, read_mission
from botohe_moo.mission.formats.nodelink import read_node_link
from botohe_moo.mission.formats.reading import Source, format_of, is_file_name, suffixes, within
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


_DATA = Path(__file__).parent / "data"
ENTRIES: Mapping[str, Entry] = {
    name: Entry(**entry)
    for name, entry in json.loads((_DATA / "library.json").read_text("utf-8")).items()
}
# Names of several missions: sizes and families.
SELECTIONS = ("small", "medium", "large", "all", *dict.fromkeys(e.family for e in ENTRIES.values()))


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
    member_of = {name: ("all", name, one.family, one.size) for name, one in ENTRIES.items()}
    return tuple(name for name, selections in member_of.items() if selection in selections)


def library_name_of(digest: str) -> str | None:
    """Return the name of the mission of the library with this digest of its numbers."""
    return next((name for name, entry in ENTRIES.items() if entry.digest == digest), None)


COMMON = ("robots", "lengths_from_pos")  # parameters that every mission takes
_PLUGINS = PluginGroup("botohe_moo.missions", "mission")


def art_museum() -> Mission:
    """The San Diego Museum of Art: 27 rooms, 74 arcs, 3 robots.

    References
    ----------
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025.
    """
    return _packaged("art_museum")


def art_museum_return() -> Mission:
    """The museum of ``art_museum``, whose rewards count when robots come back to the base."""
    graph = art_museum().graph.copy()
    graph.graph["title"] += ", rewards on return"
    return Mission(graph, pays="return", name="art_museum_return")


def power_plant() -> Mission:
    """The Satsop nuclear power plant: a tree of 73 zones, 144 arcs, 2 robots.

    References
    ----------
    Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a robot team
    orienteering in a hazardous environment", 2025; the site is the urban circuit of the DARPA
    Subterranean Challenge.
    """
    return _packaged("power_plant")


def terrain_200() -> Mission:
    """A rolling terrain: 200 waypoints, 1348 arcs between near ones, 5 robots."""
    return _packaged("terrain_200")


def toy() -> Mission:
    """A mission small enough to compute by hand: 5 nodes, 12 arcs, 2 robots."""
    return _packaged("toy")


def _packaged(name: str) -> Mission:
    return make_mission(read_node_link(Source(_DATA / f"{name}.json")))


@checked
def load_mission(
    name_or_path: str | os.PathLike[str],
    *,
    robots: Robots | None = None,
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
    return factory_faults(
        _PLUGINS.source(name_or_path),
        functools.partial(_accepted, name_or_path),
        functools.partial(load_mission, name_or_path),
        parameters or {},
        plain=plain,
        also=COMMON,
    )


def _accepted(name_or_path: str | os.PathLike[str]) -> tuple[Parameter, ...]:
    """Return the parameters of a named mission, or the options of a file's format."""
    if function := find_factory(name_or_path):
        return accepted_parameters(function)
    return tuple(file_parameters(format_of(name_or_path)).values())


def relative_to(
    folder: Path, name_or_path: str | os.PathLike[str], parameters: Mapping[str, Any]
) -> dict[str, Any]:
    """Return parameters of a mission, with paths in a file relative to the file's folder."""
    relative = dict(parameters)
    with suppress(ValueError):  # whoever loads the mission says why it cannot be found
        for parameter in _accepted(name_or_path):
            if parameter.is_path and isinstance(path := relative.get(parameter.name), str):
                relative[parameter.name] = str(folder / path)
    return relative


def mission_names() -> tuple[str, ...]:
    """Return the names that `load_mission` knows, sorted; warns of what cannot be loaded.

    Examples
    --------
    >>> from botohe_moo import mission_names
    >>> "art_museum" in mission_names()
    True
    """
    return tuple(_PLUGINS.loaded())


def mission_origin(name_or_path: str | os.PathLike[str]) -> dict[str, str | None]:
    """Return which ``package`` in which ``version`` registers a mission.

    Both are None for files, and for missions that are not registered. A ValueError is raised if two
    packages claim the name.
    """
    name = name_or_path
    if isinstance(name, str) and name.startswith(PREFIX):
        name = ENTRIES[name.removeprefix(PREFIX)].source
    return package_of(_PLUGINS.entry(str(name)).dist if name in _PLUGINS.claims() else None)


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
        expected = "the name of a mission or a path (Mission(graph, base=...) takes graphs)"
        raise ValueError(f"Expected {expected}, got {quoted(name)}.")
    if name.startswith(PREFIX):
        return functools.partial(_of_library, name.removeprefix(PREFIX))
    is_known = name in _PLUGINS.claims()
    is_module = ":" in name and not is_known
    if not is_known and (is_file_name(name) or Path(name).is_file()):
        return None
    try:
        return declared_factory(name, _PLUGINS, Mission) if is_module else _PLUGINS.load(name)
    except PluginError as error:
        fault = str(error)
        if not is_known and not is_module:
            known = ", ".join(suffixes())
            fault += f"; mission files end in one of {known}; botohe missions import reads tables"
        raise MissionError(fault, _PLUGINS.source(name)) from error


def _of_library(name: str) -> Mission:
    """Make a mission of the library."""
    if name not in (names := library_names(name)):
        raise MissionError(f"expected one mission, but these are several: {', '.join(names)}")
    entry = ENTRIES[name]
    made = load_mission(entry.source, **entry.parameters)
    mission = Mission(made.graph, base=made.base, kinds=made.kinds, pays=made.pays, name=name)
    if (found := numbers_digest(mission)) != entry.digest:
        expected = f"expected the digest {entry.digest}, got {found}"
        raise MissionError(f"{expected}: the numbers that are drawn here are not the library's")
    return mission


def _make(
    function: Callable[..., Any], name: str, robots: int | None, parameters: dict[str, Any]
) -> Mission:
    source, origin = _PLUGINS.source(name), _PLUGINS.origin(name)
    accepted = accepted_parameters(function)
    if robots is not None and any(parameter.name == "robots" for parameter in accepted):
        parameters = {**parameters, "robots": robots}
    wanted: dict[str, Any] = {"wanted": Mission, "passing": (MissionError, MemoryError)}
    try:
        mission: Mission = call_factory(
            source, function, accepted, parameters, origin=origin, also=COMMON, **wanted
        )
    except (PluginError, MissionError) as error:
        raise within(source, error) from error
    return mission if robots in (None, mission.robots) else mission.with_robots(robots)
