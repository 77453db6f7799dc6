"""Missions by name and from files: loading, reading and saving them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

from botohe_moo.base import files
from botohe_moo.base import messages as m
from botohe_moo.base import parameters as p
from botohe_moo.base.files import FilePath
from botohe_moo.base.registry import Registry, package_of
from botohe_moo.mission.formats import reading
from botohe_moo.mission.formats.graphs import mission_content, read_node_link
from botohe_moo.mission.model import Mission, check_mission, numbers_digest
from botohe_moo.mission.rules import MissionError, blamed_on
from botohe_moo.mission.scenarios import Scenario

PREFIX = "library:"  # of names of missions and selections of the library


class Entry(NamedTuple):
    """A mission of the library.

    Attributes
    ----------
    family
        The family that it belongs to.
    size
        Small up to 40 nodes, medium up to 100, large above.
    source, parameters
        The named mission or generator that makes it, and with which parameters.
    digest
        The digest of its numbers.
    """

    family: str
    size: Literal["small", "medium", "large"]
    source: str
    parameters: Mapping[str, Any]
    digest: str


_DATA = Path(__file__).parent / "data"
_LISTED = json.loads((_DATA / "library.json").read_text("utf-8"))
ENTRIES: Mapping[str, Entry] = {name: Entry(**entry) for name, entry in _LISTED.items()}
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
    m.check_choice("a mission of the library", selection, [*SELECTIONS, *ENTRIES])
    member_of = {name: ("all", name, one.family, one.size) for name, one in ENTRIES.items()}
    return tuple(name for name, selections in member_of.items() if selection in selections)


def library_name_of(digest: str) -> str | None:
    """Return the name of the mission of the library with this digest of its numbers."""
    return next((name for name, entry in ENTRIES.items() if entry.digest == digest), None)


# The options that files of all formats take.
OF_FILES = {each.name: each for each in p.signature_parameters(reading.make_mission)}
MISSIONS = Registry("botohe_moo.missions", "mission")


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


def flooded_plant() -> Mission:
    """The plant of ``power_plant``, where one of the two floors may be flooded.

    Each is flooded with probability 0.3; hazards on its arcs are then eight times as large. On
    average over these scenarios, survivals are those of ``power_plant``.
    """
    water = [Scenario(f"water on floor {n}", 0.3, 8.0, f"floor {n}") for n in (1, 2)]
    mission = power_plant().with_scenarios(water, keep_marginals=True)
    graph = mission.graph.copy()
    graph.graph["title"] = "Satsop nuclear power plant, where a floor may be flooded"
    return Mission(graph, scenarios=mission.scenarios, name="flooded_plant")


def terrain_200() -> Mission:
    """A rolling terrain: 200 waypoints, 1348 arcs between near ones, 5 robots."""
    return _packaged("terrain_200")


def toy() -> Mission:
    """A mission small enough to compute by hand: 5 nodes, 12 arcs, 2 robots."""
    return _packaged("toy")


def _packaged(name: str) -> Mission:
    return reading.make_mission(read_node_link(reading.Source(_DATA / f"{name}.json")))


@p.checked
def load_mission(
    name_or_path: FilePath,
    *,
    robots: p.Robots | None = None,
    lengths_from_pos: bool = False,
    scenarios: Any = None,
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
    scenarios
        A list, each a `Scenario`, a mapping with its parameters, or a text such as
        "storm=0.2,factor=8,zone=east"; default: the mission's own.
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
        options = parameters if scenarios is None else parameters | {"scenarios": scenarios}
        mission = read_mission(name_or_path, robots=robots, **options)
    else:
        source, accepted = MISSIONS.source(str(name_or_path)), p.accepted_parameters(function)
        if robots is not None and any(each.name == "robots" for each in accepted):
            parameters["robots"] = robots
        own = {"robots": None, "lengths_from_pos": False, "scenarios": None}
        known = (*accepted, *(p.Parameter(*each) for each in own.items()))
        try:
            mission = p.call_factory(source, function, known, parameters, wanted=Mission)
        except (m.PluginError, m.FaultsError) as error:
            raise blamed_on(source, error) from error
        mission = mission if robots in (None, mission.robots) else mission.with_robots(robots)
        mission = mission if scenarios is None else mission.with_scenarios(scenarios)
    return mission.with_lengths_from_pos() if lengths_from_pos else mission


def read_mission(path: FilePath, /, **options: Any) -> Mission:
    """Read a mission file of any format.

    The suffix tells the format, in upper or lower case, and the content where several formats have
    that suffix. What a file lacks can be given as an option, which all formats take.

    Parameters
    ----------
    path
        - ``.json``: networkx node-link JSON (``nx.node_link_data(graph, edges="edges")``) in UTF-8.
          Lists as labels become tuples. The graph attribute ``kinds`` lists kinds of robots as
          objects with the parameters of `Kind`.
        - ``.graphml``: labels are texts, and the node attributes ``x`` and ``y`` become ``pos``
          [x, y]. ``kinds`` is a text, the list as JSON.
        - ``.geojson``: a route graph of Nav2, of points with an ``id`` and lines with ``startid``
          and ``endid``. Their ``metadata`` hold attributes, the member ``mission`` those of the
          graph. A line without ``length`` is as long as its ends are apart.
        - ``.building.yaml``: a building of Open-RMF's traffic editor; ``.yaml``: a navigation graph
          that its tools make of one. Lanes are arcs, and the vertices at their ends nodes.
        - ``.txt``: a team-orienteering instance of Chao, Golden and Wasil. Trails lead from the
          first point to the last, and its tmax becomes ``max_length``.

        Packages add formats: ``docs/adding-a-format.md``. Of route graphs and buildings, what
        cannot be part of a mission is left out, and a warning names it: parallel arcs except the
        safest, arcs from a node to itself, and nodes without a way from the base or back.
    options
        - ``base``: the label of the base; default: that of the file, or the first charger of a
          building. A text is also matched with labels that are written like it.
        - ``robots``: the team size; default: the file's.
        - ``name``: the mission's name; default: the file's, or the name of the file.
        - ``kinds``: kinds of robots, each a `Kind` or a mapping; default: the file's.
        - ``pays``: ``"arrival"`` or ``"return"``, as for `Mission`; default: the file's.
        - ``scenarios``: as for `load_mission`; default: the file's, objects with the parameters of
          `Scenario`, whose ``survival`` lists [tail, head, number], and ``reward`` [node, number].
          Arcs in tables, GraphML and GeoJSON may also have an attribute such as ``survival:storm``,
          with the name of a scenario.
        - ``both_ways``: whether every arc can be passed both ways, with the same attributes, unless
          the file has an arc back; default: False.
        - ``danger`` (at least 0): the rate of loss for a unit of length. An arc without a survival
          gets exp(−danger · length). Without a length, its length is the distance of its ends, or
          1 if they have no position.
        - ``hazard``: a map of where it is dangerous, in YAML with ``mode: scale`` that names an
          image, as the map server of Nav2 reads it. Where it is black, the rate is ``danger``,
          where it is white 0.
        - ``danger_zones``: a list as for :func:`botohe_moo.survival_from_zones`, whose rates are
          added. Polygons of a route graph that have a ``rate`` are zones, too.
        - ``reward`` (at least 0, default 1): the reward of nodes that have none. The base has 0.
        - ``interest`` and ``sight``: a map of the same form of what is of interest, and how far
          robots see. A node without a reward gets that of
          :func:`botohe_moo.rewards_from_raster`, with ``reward`` for a unit of area that is black.
        - ``geographic``: whether positions are longitudes and latitudes, so that distances are
          those on the ground, in metres. It becomes an attribute of the graph.

        Some formats have options of their own. ``.txt``: ``neighbours`` (at least 1, default 8),
        the number of nearest points that each point has arcs to, or ``"all"``; ``scale`` (above 0,
        default: the file's tmax) in the survival exp(−distance / scale). Buildings: ``graph``, the
        index of the graph whose lanes are read (default: the first that has the base), or
        ``"all"``.

    Raises
    ------
    MissionError
        If no such file, it is not in its format, its mission is not valid, or it holds
        something that `save_mission` could not write again; names the file and what is wrong.
    ValueError
        If an option is unknown or out of its range.

    Examples
    --------
    >>> from botohe_moo import load_mission, save_mission
    >>> from botohe_moo.mission import read_mission
    >>> save_mission(load_mission("toy"), "site.json")
    >>> read_mission("site.json", robots=3)
    <Mission 'toy': 5 nodes, 12 arcs, 3 robots at base 1, total reward 10>
    """
    source, where = reading.Source(path), str(Path(path))
    try:
        known = reading.format_of(source)
        own = {name: options.pop(name) for name in _own_options(known) if name in options}
        if unknown := [name for name in options if name not in OF_FILES]:
            fault = m.unknown_parameter(unknown[0], file_parameters(known))
            raise m.ParameterError(f"Mission file {where}: {fault}", unknown[0])
        draft = known.read(source, **own)
        name = options.pop("name", None) or draft.graph.get("name") or reading.stem_of(path)
        mission = reading.make_mission(draft, name=str(name), **options)
        mission_content(mission)  # what cannot be saved is refused at once, not after a search
    except m.ParameterError:
        raise
    except (ValueError, RecursionError) as error:
        raise blamed_on(where, error) from None
    return mission


def file_parameters(known: reading.Format) -> dict[str, p.Parameter]:
    """Return the options that files of a format take, by name: those of all, and its own."""
    return OF_FILES | _own_options(known)


def _own_options(known: reading.Format) -> dict[str, p.Parameter]:
    read = partial(known.read, None)  # whatever its first parameter is called
    return {parameter.name: parameter for parameter in p.signature_parameters(read)}


def save_mission(mission: Mission, path: FilePath) -> None:
    """Write a mission file; `read_mission` reads an equal mission from it.

    It holds all attributes of graph, nodes and arcs; numpy's numbers become plain ones, tuples and
    arrays lists. The file appears complete or not at all.

    Parameters
    ----------
    mission
        The mission.
    path
        Ends in ``.json``, ``.graphml``, ``.geojson`` or the suffix of a format that another package
        writes. In GraphML labels are strings, attributes are numbers, booleans and strings, and
        ``pos`` becomes ``x`` and ``y``. GeoJSON is a route graph that Nav2 loads: nodes need
        ``pos``, and lines get the ``penalty`` −ln survival. If some labels are not integers from 0
        to 2³¹ − 2, ids are numbered from 1, and each point has its ``label``.

    Raises
    ------
    ValueError
        If the suffix is unknown, or the format cannot hold a label or an attribute: names it.

    Examples
    --------
    >>> from botohe_moo import load_mission, save_mission
    >>> from botohe_moo.mission import read_mission
    >>> toy = load_mission("toy")
    >>> save_mission(toy, "site.json")
    >>> read_mission("site.json") == toy
    True
    """
    path = Path(path)
    writers = {one.suffixes[0]: one.write for one in reading.formats().values() if one.write}
    suffix = max((one for one in writers if path.name.lower().endswith(one)), key=len, default="")
    if not suffix:
        files.check_suffix(path, writers)
    try:
        data = writers[suffix](check_mission(mission))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    files.replace_file(path, data)


def mission_parameters(name_or_path: FilePath) -> tuple[p.Parameter, ...]:
    """List the parameters of a named mission, or the options of files in a format."""
    if function := find_factory(name_or_path):
        return p.accepted_parameters(function)
    return tuple(file_parameters(reading.format_of(name_or_path)).values())


def relative_to(folder: Path, name: FilePath, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters of a mission, with paths in a file relative to the file's folder."""
    relative = dict(parameters)
    with suppress(ValueError):  # whoever loads the mission says why it cannot be found
        for parameter in mission_parameters(name):
            path = relative.get(parameter.name)
            if "Path" in parameter.annotation and isinstance(path, str):
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
    return tuple(MISSIONS.loaded())


def mission_origin(name_or_path: FilePath) -> dict[str, str | None]:
    """Return which ``package`` in which ``version`` registers a mission.

    Both are None for files, and for missions that are not registered. A ValueError is raised if two
    packages claim the name.
    """
    name: Any = name_or_path
    if isinstance(name, str) and name.startswith(PREFIX):
        name = ENTRIES[name.removeprefix(PREFIX)].source
    return package_of(MISSIONS.entries[name].dist if name in MISSIONS else None)


def find_factory(name: FilePath) -> Callable[..., Any] | None:
    """Find the function that makes a mission; None for what is read from a file."""
    if isinstance(name, os.PathLike):
        return None
    if not isinstance(name, str):
        expected = "the name of a mission or a path (Mission(graph, base=...) takes graphs)"
        raise ValueError(f"Expected {expected}, got {m.quoted(name)}.")
    if name.startswith(PREFIX):
        return partial(_of_library, name.removeprefix(PREFIX))
    is_known = name in MISSIONS
    if not is_known and (reading.is_file_name(name) or Path(name).is_file()):
        return None
    try:
        found: Callable[..., Any] = MISSIONS.find(name, makes=Mission)
        return found
    except m.PluginError as error:
        known = f"mission files end in one of {', '.join(reading.suffixes())}"
        hint = f"; {known}; botohe missions import reads tables"
        said = f"{error}{hint}" if not is_known and ":" not in name else str(error)
        raise MissionError(said, MISSIONS.source(name)) from error


def _of_library(name: str) -> Mission:
    """Make a mission of the library."""
    if name not in (names := library_names(name)):
        raise MissionError(f"expected one mission, but these are several: {', '.join(names)}")
    entry = ENTRIES[name]
    made = load_mission(entry.source, **entry.parameters)
    given = {"base": made.base, "pays": made.pays, "scenarios": made.scenarios}
    mission = Mission(made.graph, kinds=made.kinds, name=name, **given)
    if (found := numbers_digest(mission)) != entry.digest:
        expected = f"expected the digest {entry.digest}, got {found}"
        raise MissionError(f"{expected}: the numbers that are drawn here are not the library's")
    return mission
