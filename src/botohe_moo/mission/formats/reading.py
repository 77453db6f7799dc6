"""Formats of mission files: what a reader is given, what it returns, and which one a file is in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from botohe_moo.base.files import FilePath, check_suffix
from botohe_moo.base.files import Source as Source  # what readers are given
from botohe_moo.base.registry import Registry
from botohe_moo.mission.hazards import Zone
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import MissionError


class Row(NamedTuple):
    """A node or an arc of a file.

    Attributes
    ----------
    where
        Where it stands in the file, such as ``line 7``: messages begin with it.
    labels
        The label of a node, ``(label,)``, or those of the ends of an arc, ``(tail, head)``.
    attributes
        Its attributes, such as ``reward`` or ``survival``. Numbers may be texts, and a number for
        one kind of robots may stand in a column of its own, such as ``survival:drone``.

    Examples
    --------
    >>> from botohe_moo.mission import Row
    >>> Row("line 7", ("dock", "reef"), {"survival": "0.9"}).labels
    ('dock', 'reef')
    """

    where: str
    labels: tuple[Any, ...]
    attributes: dict[str, Any]


@dataclass
class Draft:
    """What a reader finds in a file: a table of nodes, a table of arcs, attributes of the graph.

    Parameters
    ----------
    nodes, arcs
        The rows of both tables.
    graph
        Attributes of the graph, such as ``base``, ``robots``, ``kinds`` and ``title``.
    faults
        Faults that only the reader can see.
    directed
        Whether an arc leads one way. If not, the file is read with ``both_ways`` only.
    foreign
        Whether it is a file of another tool. Then what cannot be part of a mission is left out, and
        a warning names it: parallel arcs, arcs from a node to itself, and nodes without a way from
        the base or back. If not, these are faults. Also, every arc without a length is as long as
        its ends are apart. Otherwise this holds only for arcs whose survival is computed from it.
    left_out
        What the reader itself has left out: names by what they are.
    notes
        Further sentences of the warning.
    zones
        Danger zones that the file holds.

    Examples
    --------
    >>> from botohe_moo.mission import Draft, Row
    >>> nodes = [Row("line 2", ("dock",), {}), Row("line 3", ("reef",), {"reward": 5})]
    >>> arcs = [Row("line 5", ("dock", "reef"), {"survival": 0.9})]
    >>> Draft(nodes, arcs, {"base": "dock"}, directed=False).foreign
    False
    """

    nodes: list[Row]
    arcs: list[Row]
    graph: dict[str, Any] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    directed: bool = True
    foreign: bool = False
    left_out: Mapping[str, Sequence[str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    zones: Sequence[Zone] = ()


def within(source: str, error: Exception) -> MissionError:
    """Return an error as one of the mission or file that is called ``source``.

    Where it is about another file, such as a map, its faults begin with the name of that file.
    """
    faults = getattr(error, "faults", [str(error).removeprefix(f"{source}: ").rstrip(".")])
    inner = getattr(error, "source", source)
    where = "" if inner in (source, "The mission", "The file") else f"{inner}: "
    return MissionError([f"{where}{fault}" for fault in faults], source)


@dataclass(frozen=True)
class Format:
    """A format of mission files.

    Packages register instances in the entry-point group ``botohe_moo.formats``.

    Parameters
    ----------
    suffixes
        Ends of file names, in lower case, such as ``.json``. What :func:`save_mission` writes has
        the first one.
    sniff
        Tells by the content whether a file with such a name is in this format. An error that the
        content causes means no.
    read
        Reads a `Source`. Its keyword-only parameters are options that this format has beside those
        that all have.
    write
        Returns the bytes of a file that holds a mission; a ValueError names what the format cannot
        hold. Default: the format is only read.

    Examples
    --------
    >>> from botohe_moo.mission import Draft, Format, Row
    >>> def read(source):
    ...     return Draft([Row("line 1", (source.text.strip(),), {})], [])
    >>> Format((".point",), lambda source: bool(source.text), read).suffixes
    ('.point',)
    """

    suffixes: tuple[str, ...]
    sniff: Callable[[Source], bool]
    read: Callable[..., Draft]
    write: Callable[[Mission], bytes] | None = None


FORMATS = Registry("botohe_moo.formats", "format", Format)

# Keys by which files are known that are no missions, and what can be done about them.
_UNSUPPORTED = {
    ("image", "resolution"): "a map: `botohe missions from-map` makes a mission from it",
    ("missions", "algorithms"): "a study, which `botohe study run` runs",
    ("nodes", "adjacency"): "adjacency data of networkx: write it by node_link_data",
    ("graph.nodes", "graph.edges"): "a graph in JSON Graph Format",
    ("pointset",): "a topological map of LCAS: docs/mission-robots.md has a recipe",
    ("meta.pointset",): "a topological map of LCAS: docs/mission-robots.md has a recipe",
    ("rmf_fleet",): "a fleet configuration of Open-RMF: read its navigation graph",
    ("format_version", "properties"): "a site of Open-RMF's site editor: export navigation graphs",
    ("layouts", "metaInformation"): "a layout of VDA 5050 (LIF)",
    ("fileType", "mission"): "a plan of QGroundControl",
    ("arcs", "objects"): "a TopoJSON topology: convert it to GeoJSON",
    ("features", "geometryType"): "features of ArcGIS: convert them to GeoJSON",
    ("elements", "generator"): "OpenStreetMap data: docs/mission-maps.md has a recipe for streets",
    ("elements",): "a graph of Cytoscape: export GraphML",
}


def formats() -> dict[str, Format]:
    """Return the formats that are registered, by name; warns of what cannot be loaded.

    Those of this package come last: of formats with one suffix the others are asked first whether
    they know a file, and the last one writes it.
    """
    ours, found = "botohe_moo.", FORMATS.loaded()
    return dict(sorted(found.items(), key=lambda pair: pair[1].read.__module__.startswith(ours)))


def suffixes() -> tuple[str, ...]:
    """Return the suffixes of all formats, each once."""
    return tuple(dict.fromkeys(s for known in formats().values() for s in known.suffixes))


def _fitting(path: FilePath) -> list[tuple[str, Format]]:
    """Return the suffixes that a file has, longest first, each with a format that has it, too."""
    name, known = Path(path).name.lower(), formats().values()
    found = [(suffix, one) for one in known for suffix in one.suffixes if name.endswith(suffix)]
    return sorted(found, key=lambda pair: -len(pair[0]))


def is_file_name(name: FilePath) -> bool:
    """Return whether a name has a suffix of mission files, or is that of a file in a folder."""
    return bool(_fitting(name)) or Path(name).name != str(name)


def stem_of(path: FilePath) -> str:
    """Return the name of a file without its suffix.

    Examples
    --------
    >>> from botohe_moo.mission import stem_of
    >>> stem_of("sites/hotel.building.yaml")
    'hotel'
    """
    path = Path(path)
    longest = max((len(suffix) for suffix, _ in _fitting(path)), default=0)
    return path.name[:-longest] or path.stem  # which is also right if no format has the suffix


def format_of(file: FilePath | Source) -> Format:
    """Return the format of a mission file, by its suffix and its content.

    Raises
    ------
    MissionError
        If the file is of a known kind that is no mission: names it.
    ValueError
        If no format has the suffix, or the file cannot be read.

    Examples
    --------
    >>> from botohe_moo import load_mission, save_mission
    >>> from botohe_moo.mission import format_of
    >>> save_mission(load_mission("toy"), "site.json")
    >>> format_of("site.json").suffixes
    ('.json',)
    """
    source = file if isinstance(file, Source) else Source(file)
    found = _fitting(source.path)
    if found:
        source.data  # noqa: B018 - a file that cannot be read is in no format
    for _, known in found:
        if _seen(known.sniff, source):
            return known
    if kind := _seen(_unsupported_kind, source):
        raise MissionError(f"expected a mission, found {kind}", str(source.path))
    if not found:
        check_suffix(source.path, suffixes())
    return min(found, key=lambda pair: pair[1].suffixes.index(pair[0]))[1]  # says what it misses


def _seen(look: Callable[[Source], Any], source: Source) -> Any:
    """Return what a look at a file finds; None if its content is of another form altogether."""
    with suppress(Exception):  # whatever another package's sniff may raise
        return look(source)
    return None


def _unsupported_kind(source: Source) -> str | None:
    """Return what a file is that is in no format of missions; None if that is not known."""
    is_yaml = source.path.suffix.lower() in (".yaml", ".yml", ".tmap2")
    content = source.yaml.content if is_yaml else source.json
    content = content[0] if isinstance(content, list) else content
    keys = {f"{key}.{inner}" for key, of in content.items() if isinstance(of, dict) for inner in of}
    keys |= {*content}
    return next((kind for needed, kind in _UNSUPPORTED.items() if keys.issuperset(needed)), None)
