"""Mission files: which format a file is in, reading it and writing it."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from botohe_moo._base.checks import ParameterError, unknown_parameter
from botohe_moo._base.files import check_suffix, replace_file, suffix_fault
from botohe_moo._plugins.stated import signature_parameters
from botohe_moo.mission.formats.benchmark import read_benchmark
from botohe_moo.mission.formats.graphml import read_graphml, write_graphml
from botohe_moo.mission.formats.nodelink import mission_content, read_node_link, write_node_link
from botohe_moo.mission.formats.reading import file_content
from botohe_moo.mission.formats.routes import read_route_graph, write_route_graph
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.rules import MissionError

# A reader takes a file's bytes and keyword-only options.
_READERS: dict[str, Callable[..., Any]] = {
    ".json": read_node_link,
    ".graphml": read_graphml,
    ".txt": read_benchmark,
    ".geojson": read_route_graph,
}
_BUILDINGS = (".yaml", ".yml")
_WRITERS = {
    ".json": write_node_link,
    ".graphml": write_graphml,
    ".geojson": write_route_graph,
}

SUFFIXES = (*_READERS, *_BUILDINGS)


def read_mission(
    path: str | os.PathLike[str], *, robots: int | None = None, **options: Any
) -> Mission:
    """Read a mission file, in the format of its suffix (in upper or lower case).

    Parameters
    ----------
    path
        - ``.json``: networkx node-link JSON (``nx.node_link_data(graph, edges="edges")``) in UTF-8,
          with the graph attributes ``base`` and ``robots``, optionally ``name`` and ``title``, the
          node attribute ``reward`` and the arc attribute ``survival``, optionally the arc attribute
          ``length`` and the graph attribute ``max_length``. Lists as labels become tuples. The
          graph attribute ``kinds``, in the place of ``robots``, lists kinds of robots as objects
          with the parameters of `Kind`; other attributes of `Mission` are as there.
        - ``.graphml``: the same attributes; node labels are strings, and the node attributes ``x``
          and ``y`` become ``pos`` [x, y]. Numbers for one kind are in attributes such as
          ``survival:drone``, and ``kinds`` is a text, the list as JSON.
        - ``.txt``: the team-orienteering benchmark of Chao, Golden and Wasil, made into a
          nearest-neighbours mission whose arcs are as long as points are apart, and whose
          ``max_length`` is tmax; see ``options``.
        - ``.geojson``: a route graph as Nav2 loads it, of points with the property ``id`` and lines
          with ``startid`` and ``endid``. What their ``metadata`` hold are attributes, such as
          ``reward`` and ``survival``; the member ``mission`` holds those of the graph. An arc
          without ``length`` is as long as its ends are apart. What cannot be part of a mission is
          left out, and a warning names it: all but the safest of parallel lines, lines from a point
          to itself, and points without a way from the base or back.
        - ``.yaml``: a building of Open-RMF. Lanes are arcs, the vertices at their ends nodes.
    robots
        Team size; default: the file's.
    options
        For ``.txt``: ``neighbours`` (at least 1, default 8), the number of nearest points that each
        point has arcs to, or ``"all"`` for arcs between all points, and ``scale`` (above 0,
        default: the file's tmax) in the survival exp(−distance / scale).

        For ``.geojson``:

        - ``base``, the base's label.
        - ``danger`` (at least 0), the rate of loss for a unit of length where lines have no
          survival, which is exp(−danger · length) then.
        - ``hazard``, a map of where it is dangerous: YAML that names an image, as the map server of
          Nav2 reads it, with ``mode: scale``. Where it is black the rate of loss is ``danger``,
          where it is white 0.
        - ``danger_zones``, a list as for :func:`botohe_moo.survival_from_zones`. Polygons of the
          file that have a ``rate`` are zones, too.
        - ``reward`` (at least 0, default 1) of points without one, except the base.
        - ``interest``, a map of the same form of what is of interest, and ``sight``, how far robots
          see on it: then a point's reward is that of :func:`botohe_moo.rewards_from_raster`, with
          ``reward`` for a unit of area where the map is black.
        - ``geographic``, whether positions are longitudes and latitudes: then a line is as long as
          its ends are apart on the ground, in metres. It becomes an attribute of the graph.

        For ``.yaml``: ``base`` (default: the first charger), ``danger``, which is needed,
        ``reward``, and ``graph``, the index of the graph whose lanes are read (default: the first
        that has the base), or ``"all"``.

    Raises
    ------
    MissionError
        If there is no such file, it is not in its format, its mission is not valid, or it holds
        something that `save_mission` could not write again; names the file and what is wrong.

    Examples
    --------
    >>> from botohe_moo import load_mission, save_mission
    >>> from botohe_moo.mission import read_mission
    >>> save_mission(load_mission("toy"), "site.json")
    >>> read_mission("site.json", robots=3)
    <Mission 'toy': 5 nodes, 12 arcs, 3 robots at base 1, total reward 10>
    """
    path = Path(path)
    if fault := suffix_fault(path, SUFFIXES):
        raise MissionError(fault, str(path))
    reader = _reader(path.suffix.lower())
    known = {"robots", *(parameter.name for parameter in signature_parameters(reader))}
    for name in options:
        if name not in known:
            raise ParameterError(f"Mission file {path}: {unknown_parameter(name, known)}", name)
    try:
        graph = reader(file_content(path), **options)
        mission = Mission(
            graph,
            robots=robots,
            name=graph.graph.get("name") or path.stem.removesuffix(".building"),
        )
        mission_content(mission)  # what cannot be saved is refused at once, not after a search
    except MissionError as error:
        raise MissionError(list(error.faults), str(path)) from None
    except ParameterError:
        raise
    except (ValueError, RecursionError) as error:
        raise MissionError(str(error).rstrip("."), str(path)) from None
    return mission


def _reader(suffix: str) -> Callable[..., Any]:
    if suffix in _BUILDINGS:
        # Imported late: its models take time to make, and most missions are in other files.
        from botohe_moo.mission.formats.rmf import read_building

        return read_building
    return _READERS[suffix]


def save_mission(mission: Mission, path: str | os.PathLike[str]) -> None:
    """Write a mission file; `read_mission` reads an equal mission from it.

    It holds all attributes of graph, nodes and arcs; numpy's numbers become plain ones, tuples and
    arrays lists. The file appears complete or not at all.

    Parameters
    ----------
    mission
        The mission.
    path
        Ends in ``.json``, ``.graphml`` or ``.geojson``. In GraphML labels are strings, attributes
        are numbers, booleans and strings, and ``pos`` becomes ``x`` and ``y``; kinds are as for
        `read_mission`. GeoJSON is a route graph that Nav2 loads: nodes need ``pos``, and lines get
        the ``penalty`` −ln survival. If some labels are not integers from 0 to 2³² − 1, ids are
        numbered from 1, and each point has its ``label``.

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
    check_suffix(path, _WRITERS)
    try:
        data = _WRITERS[path.suffix.lower()](mission_content(check_mission(mission)))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    replace_file(path, data)
