"""Mission files: reading and writing them, whatever their format."""

import functools
import os
from pathlib import Path
from typing import Any

from botohe_moo._base.checks import ParameterError, unknown_parameter
from botohe_moo._base.files import check_suffix, replace_file
from botohe_moo._plugins.stated import Parameter, signature_parameters
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import Format, Source, format_of, formats, stem_of, within
from botohe_moo.mission.formats.tables import make_mission
from botohe_moo.mission.model import Mission, check_mission

_COMMON = {p.name: p for p in signature_parameters(make_mission) if p.name not in ("draft", "name")}


def read_mission(path: str | os.PathLike[str], **options: Any) -> Mission:
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
        - ``kinds``: kinds of robots, each a `Kind` or a mapping; default: the file's.
        - ``pays``: ``"arrival"`` or ``"return"``, as for `Mission`; default: the file's.
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
        If there is no such file, it is not in its format, its mission is not valid, or it holds
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
    source, where = Source(path), str(Path(path))
    try:
        known = format_of(source)
        own = {name: options.pop(name) for name in _own_options(known) if name in options}
        if unknown := [name for name in options if name not in _COMMON]:
            fault = unknown_parameter(unknown[0], file_parameters(known))
            raise ParameterError(f"Mission file {where}: {fault}", unknown[0])
        draft = known.read(source, **own)
        mission = make_mission(draft, name=str(draft.graph.get("name") or stem_of(path)), **options)
        mission_content(mission)  # what cannot be saved is refused at once, not after a search
    except ParameterError:
        raise
    except (ValueError, RecursionError) as error:
        raise within(where, error) from None
    return mission


def file_parameters(known: Format) -> dict[str, Parameter]:
    """Return the options that files of a format take, by name: those of all, and its own."""
    return _COMMON | _own_options(known)


def _own_options(known: Format) -> dict[str, Parameter]:
    read = functools.partial(known.read, None)  # whatever its first parameter is called
    return {parameter.name: parameter for parameter in signature_parameters(read)}


def save_mission(mission: Mission, path: str | os.PathLike[str]) -> None:
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
    writers = {known.suffixes[0]: known.write for known in formats().values() if known.write}
    suffix = max((one for one in writers if path.name.lower().endswith(one)), key=len, default="")
    if not suffix:
        check_suffix(path, writers)
    try:
        data = writers[suffix](check_mission(mission))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    replace_file(path, data)
