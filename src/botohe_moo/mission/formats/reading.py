"""From files and tables to missions: what readers return, and the one way from there to a mission.

A file of any format, and two tables themselves, become a `Draft`; `make_mission` makes a mission of
it. So all of them take the same options, and the same rules find what is wrong.
"""

from __future__ import annotations

import functools
import json
import os
import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import networkx as nx

from botohe_moo.base.files import FILE, FilePath, check_suffix, filled_cells, read_flag, read_number
from botohe_moo.base.files import Source as Source  # what readers are given
from botohe_moo.base.messages import ParameterError, as_float, check_frame, listed, quoted
from botohe_moo.base.parameters import NotNegative, Positive, checked
from botohe_moo.base.registry import Registry
from botohe_moo.mission import hazards, rules
from botohe_moo.mission.hazards import Raster, Zone
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import Kind, MissionError
from botohe_moo.mission.scenarios import add_survivals, names_of, read_scenarios

if TYPE_CHECKING:
    import pandas as pd


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


_RESERVED = "attributes id, source and target, which are labels in mission files"


@checked
def make_mission(
    draft: Draft,
    /,
    *,
    name: str | None = None,
    base: Any = None,
    robots: Any = None,
    kinds: Any = None,
    pays: Any = None,
    scenarios: Any = None,
    both_ways: bool = False,
    danger: NotNegative | None = None,
    hazard: FilePath | None = None,
    danger_zones: Any = (),
    reward: NotNegative | None = None,
    interest: FilePath | None = None,
    sight: Positive | None = None,
    geographic: bool | None = None,
) -> Mission:
    """Make a mission of what a reader has found; :func:`read_mission` describes the options.

    A MissionError lists what breaks a rule, in the rows and in the options. A warning names what is
    left out, and which defaults were used.
    """
    if not draft.directed and not both_ways:
        raise MissionError("expected directed arcs, found undirected edges: give both_ways")
    maps = _raster("interest", interest), _raster("hazard", hazard)
    given = {"base": base, "kinds": kinds, "pays": pays, "geographic": geographic}
    given |= {"scenarios": scenarios}
    site = _Site(draft, {key: value for key, value in given.items() if value is not None})
    if both_ways:
        site.open_both_ways()
    site.add_lengths()
    site.add_rewards(reward, maps[0], sight)
    site.add_survivals(danger, maps[1], danger_zones)
    graph = site.as_graph()
    if len(graph) == 1 < len(draft.nodes):
        hint = "" if both_ways else "; both_ways makes every arc passable both ways"
        expected = f"a node that can be reached from base {quoted(site.base)} and left again"
        raise MissionError(f"expected {expected}, found none{hint}")
    try:
        mission = Mission(graph, robots=robots, kinds=kinds and site.kinds, name=name)
    except MissionError as error:
        faults = list(error.faults)
        is_one_way = not any(graph.has_edge(head, tail) for tail, head in graph.edges)
        if graph.edges and is_one_way and not nx.is_strongly_connected(graph):
            faults.append("no arc leads back; both_ways makes every arc passable both ways")
        raise MissionError(faults) from None
    if site.notes:
        warnings.warn(" ".join(site.notes), stacklevel=2)
    return mission


class _Site:
    """The two tables of a file, while a mission is made of them."""

    def __init__(self, draft: Draft, given: Mapping[str, Any]) -> None:
        self.draft = draft
        self.faults, self.notes = [*draft.faults], [*draft.notes]
        self.left_out = {what: [*names] for what, names in draft.left_out.items()}
        self.nodes = self._plain_rows(draft.nodes, "id")
        self.arcs = self._plain_rows(draft.arcs, "source", "target")
        self.at = {label: attributes for _, (label,), attributes in self.nodes}
        find = functools.partial(find_label, labels=self.at)
        self.graph = _plain({**draft.graph, **given}, _READ | {"base": find})
        self.base = self.graph.get("base")
        readers: _Readers = dict.fromkeys(("start", "end"), find)
        readers["aboard"] = lambda of: [*map(find, of)] if isinstance(of, list | tuple) else of
        read = functools.partial(_plain, readers=_READ | readers)
        self.kinds, faults = rules.read_kinds(self.graph.get("kinds"), read)
        names = [kind.name for kind in self.kinds]
        self.scenarios = read_scenarios(self.graph.get("scenarios"), find)
        known = names_of(self.scenarios)
        faults = faults or _join_columns(self.nodes, names)
        if faults := faults or _join_columns(self.arcs, names, known):
            raise MissionError([*self.faults, *faults])
        self.graph |= {"kinds": self.kinds} if self.kinds else {}
        self.columns = {f"survival:{name}": name for name in known}
        self.places = hazards.places_of(self.at)

    def _plain_rows(self, rows: Iterable[Row], *reserved: str) -> list[Row]:
        """Return rows with plain attributes; those of foreign files lose reserved ones."""
        plain = []
        for where, given, attributes in rows:
            try:
                labels = tuple(map(rules.read_label, given))
            except ValueError as error:
                raise MissionError(f"{where}: {error}") from None
            own = _plain(attributes)
            if taken := own.keys() & {*reserved} if self.draft.foreign else ():
                self.left_out.setdefault(_RESERVED, []).append(where)
            plain.append(Row(where, labels, {k: own[k] for k in own if k not in taken}))
        return plain

    def open_both_ways(self) -> None:
        """Add an arc back for each arc that has none, with the same attributes."""
        known = {ends for _, ends, _ in self.arcs}
        back = [Row(at, to[::-1], {**of}) for at, to, of in self.arcs if {*to} <= self.at.keys()]
        self.arcs += [arc for arc in back if arc.labels not in known]

    def add_lengths(self) -> None:
        """Give arcs of foreign files, and arcs without a survival, the distance of their ends."""
        distance = hazards.distance_of(self.graph)
        for _, (tail, head), attributes in self.arcs:
            is_placed = tail in self.places and head in self.places
            if is_placed and (self.draft.foreign or "survival" not in attributes):
                attributes.setdefault("length", distance(self.places[tail], self.places[head]))

    def add_rewards(self, reward: float | None, interest: Raster | None, sight: Any) -> None:
        """Give nodes without one a reward; cells that are nearest to the base count for none."""
        default, seen = 1.0 if reward is None else reward, {}
        if (interest is None) != (sight is None):
            expected = "interest, a map, and sight, how far robots see on it, or none"
            raise MissionError(f"expected {expected}")
        if interest is not None:
            seen = hazards.seen_from(self.places, interest, sight, default)
        if self.base in self.at:
            self.at[self.base].setdefault("reward", 0.0)
        lacking = [label for label, attributes in self.at.items() if "reward" not in attributes]
        for label in lacking:
            self.at[label]["reward"] = seen.get(label, default)
            if interest is not None and label not in self.places:
                self.faults.append(f"node {quoted(label)}: expected pos [x, y], found none")
        if reward is None and interest is None and 0 < len(lacking) < len(self.at) - 1:
            named = f"These nodes have no reward and get 1: {listed(map(quoted, lacking))}"
            self.notes.append(f"{named}; set reward to change it.")

    def add_survivals(self, danger: float | None, hazard: Raster | None, zones: Any) -> None:
        """Give arcs without one the survival exp(−length · mean rate between their ends)."""
        zones = [*self.draft.zones, *hazards.read_zones(zones, "danger_zones")]
        for _, (tail, head), attributes in self.arcs:
            if tail == head:
                attributes.setdefault("survival", 1.0)  # the loop is the fault, or is left out
        lacking = [arc for arc in self.arcs if "survival" not in arc.attributes]
        if not lacking and (danger is not None or hazard or zones):
            self.notes.append("All arcs have survivals; danger, hazard and zones change nothing.")
        if lacking and danger is None and (hazard or not zones):
            found = f"expected a survival, found none ({len(lacking)} without one)"
            remedy = "give danger, the rate of loss for a unit of length"
            self.faults.append(f"{_named_arc(lacking[0])}: {found}: {remedy}")
        for arc in lacking:
            named, ends, length = _named_arc(arc), arc.labels, arc.attributes.get("length", 1.0)
            arc.attributes["survival"] = 1.0  # so that a fault is listed once
            missing = [quoted(end) for end in ends if end not in self.places]
            if missing and (hazard or zones):
                self.faults.append(f"{named}: expected pos [x, y] of {missing[0]}, found none")
                continue
            mean = danger or 0.0
            if not missing:
                mean = hazards.mean_rate([self.places[end] for end in ends], mean, hazard, zones)
            try:
                length = as_float(length)
                arc.attributes["survival"] = hazards.survived(mean * length, named, length=length)
            except ValueError as error:
                self.faults.append(str(error).rstrip("."))

    def as_graph(self) -> nx.DiGraph[Any]:
        """Return the graph; a MissionError lists all faults if there are any."""
        graph: nx.DiGraph[Any] = nx.DiGraph()
        graph.graph.update(self.graph)
        for where, (label,), attributes in self.nodes:
            if label in graph:
                self.faults.append(f"{where}: node {quoted(label)} is listed more than once")
            graph.add_nodes_from([(label, attributes)])
        loops, parallel = [], []
        kept: dict[tuple[Any, ...], Row] = {}
        for arc in self.arcs:
            named = _named_arc(arc)
            unknown = [label for label in dict.fromkeys(arc.labels) if label not in graph]
            self.faults += [f"{named}: there is no node {quoted(label)}" for label in unknown]
            rival = kept.setdefault(arc.labels, arc)
            if self.draft.foreign and arc.labels[0] == arc.labels[1]:
                loops.append(arc.where)
            elif self.draft.foreign and rival is not arc:
                safest = max(rival, arc, key=_mean_survival)
                kept[arc.labels] = safest
                parallel += [one.where for one in (rival, arc) if one is not safest]
            elif rival is not arc:
                self.faults.append(f"{named}: is listed more than once")
        arcs = [arc for arc in kept.values() if all(label in graph for label in arc.labels)]
        in_scenarios: dict[str, dict[Any, Any]] = {name: {} for name in self.columns.values()}
        for arc in arcs:
            for column in self.columns.keys() & arc.attributes.keys():
                in_scenarios[self.columns[column]][arc.labels] = arc.attributes.pop(column)
        graph.add_edges_from((*arc.labels, arc.attributes) for arc in arcs)
        if self.faults:
            if self.base is None:
                self.faults.append("expected base, the label of a node, found none: give base")
            raise MissionError([*self.faults, *rules.attribute_faults(graph, self.kinds)])
        if self.draft.foreign:
            self._leave_out(graph, loops, parallel)
        if self.scenarios:
            add_survivals(self.scenarios, in_scenarios, graph)
            graph.graph["scenarios"] = self.scenarios
        if said := [f"{what}: {listed(names)}" for what, names in self.left_out.items() if names]:
            self.notes.insert(0, f"Left out {'; '.join(said)}.")
        return graph

    def _leave_out(self, graph: nx.DiGraph[Any], loops: list[str], parallel: list[str]) -> None:
        """Leave out what cannot be part of a mission, and note it."""
        graph.remove_edges_from(list(nx.selfloop_edges(graph)))
        ends = [kind.ends(self.base) for kind in self.kinds] or [(self.base, self.base)]
        lost = []
        if all(label in graph for label in {self.base}.union(*ends)):  # if not, that is the fault
            joined = {self.base}
            for start, end in ends:
                joined |= {start, *nx.descendants(graph, start)} & {end, *nx.ancestors(graph, end)}
            lost = [label for label in graph if label not in joined]
        graph.remove_nodes_from(lost)
        self.left_out["arcs from a node to itself"] = loops
        self.left_out["arcs parallel to one that is at least as safe"] = parallel
        unjoined = "nodes that the base does not reach, or that have no way back"
        self.left_out[unjoined] = [*map(quoted, lost)]


# How attributes are read that are written as texts.
_Readers = dict[str, Callable[[Any], Any]]
_READ: _Readers = {
    **dict.fromkeys(("reward", "share", "survival", "length", "pos"), read_number),
    **dict.fromkeys(("robots", "min_survival", "max_length"), read_number),
    **dict.fromkeys(("depot", "geographic"), read_flag),
    "pays": lambda value: value.lower() if isinstance(value, str) else value,
}


def _plain(attributes: Mapping[str, Any], readers: _Readers = _READ) -> dict[str, Any]:
    """Return attributes, read by ``readers``; names that have a reader become lower case."""
    plain = {}
    for name, value in attributes.items():
        lower = _column_name(str(name))
        is_known = lower in readers or rules.attribute_of(lower) is not None
        key = lower if is_known and lower not in attributes else name
        read = readers.get(rules.attribute_of(str(key)) or key)
        if read is None:
            plain[name] = value
        elif value is not None:  # null is an empty cell
            plain[key] = read(value)
    return plain


def find_label(given: Any, labels: Mapping[Any, Mapping[str, Any]]) -> Hashable:
    """Return the node that is meant: a label, a text that is written like one, or a node's name.

    ``labels`` has the attributes of each node. What names no node is returned as a label; a
    ValueError says why it cannot be one.
    """
    label = rules.read_label(given)
    if label in labels:
        return label
    text, meant, named = _text(label), None, []
    with suppress(ValueError):
        meant = rules.read_label(json.loads(text)) if text.startswith("[") else float(text)
    for known, attributes in labels.items():
        if _text(known) == text or (known == meant and not isinstance(known, bool)):
            return known  # type: ignore[no-any-return]
        if text in (attributes.get("name"), attributes.get("label")):
            named.append(known)
    return named[0] if len(named) == 1 else label


def _text(label: Hashable) -> str:
    return json.dumps(label) if isinstance(label, bool) else str(label)


def _join_columns(
    rows: Sequence[Row], kinds: Sequence[str], scenarios: Sequence[str] = ()
) -> list[str]:
    """Replace columns for one kind by mappings from kinds to numbers; return what is wrong.

    Columns for a scenario stay as they are.
    Where another kind's cell is filled, an empty cell has the number in the column for all kinds.
    If that is empty, too, a kind cannot take the arc.
    """
    for name in rules.BY_KIND:
        where = {key: row.where for row in reversed(rows) for key in row.attributes}
        columns = {key: key.partition(":")[2] for key in where if rules.attribute_of(key) == name}
        columns = {key: of for key, of in columns.items() if of in kinds or of not in scenarios}
        unknown = [key for key, kind in columns.items() if kind not in kinds]
        known = f"the kinds are {', '.join(kinds)}" if kinds else "the mission lists no kinds"
        cases = f"; the scenarios are {', '.join(scenarios)}" if scenarios else ", and no scenarios"
        what = "no such kind or scenario" if scenarios else "no such kind"
        faults = [f"{where[key]}: column {quoted(key)}: {what}; {known}{cases}" for key in unknown]
        if columns and not faults and name == "survival" and name not in where:
            missing = [f"{name}:{kind}" for kind in kinds if f"{name}:{kind}" not in columns]
            first = where[min(columns)]
            faults = [f"{first}: expected a column {c!r}, found none" for c in missing]
        if faults:
            return faults
        for _, _, attributes in rows:
            numbers = {columns[c]: attributes.pop(c) for c in columns if c in attributes}
            if numbers and (name in attributes or name == "survival"):
                numbers = dict.fromkeys(kinds, attributes.get(name, 0.0)) | numbers
            attributes |= {name: numbers} if numbers else {}
    return []


def _mean_survival(arc: Row) -> float:
    """Return the mean over kinds; NaN if a survival is not a number."""
    given = arc.attributes["survival"]
    numbers = [*given.values()] if isinstance(given, Mapping) else [given]
    return sum(map(as_float, numbers)) / len(numbers)


def _named_arc(arc: Row) -> str:
    return f"{arc.where}: {rules.whose(*arc.labels)}"


def _raster(option: str, path: Any) -> Raster | None:
    if path is None:
        return None
    if not path or not isinstance(path, str | os.PathLike):
        raise ParameterError(f"Expected {option} to be a path, got {quoted(path)}.", option)
    # Imported late: it takes time, and most missions need no images.
    from botohe_moo.mission.formats.maps import read_raster

    return read_raster(path)


def mission_from_tables(
    nodes: pd.DataFrame,
    arcs: pd.DataFrame,
    *,
    base: Hashable,
    robots: int | None = None,
    kinds: Iterable[Kind] | None = None,
    max_length: float | None = None,
    title: str | None = None,
    **options: Any,
) -> Mission:
    """Make a mission from a table of nodes and a table of arcs.

    Parameters
    ----------
    nodes
        The column ``label``, optionally ``reward`` (at least 0), both ``x`` and ``y``, the
        position, where a node may have neither, and ``share``, ``pays`` and ``depot`` (true or
        false, yes or no, 1 or 0) as for `Mission`. Further columns become attributes of the nodes.
    arcs
        Columns ``tail`` and ``head``, labels of nodes, optionally ``survival`` (in (0, 1]) and
        ``length`` (at least 0; an arc without one is 1 long). Further columns become attributes of
        the arcs.
    base
        Label of the base.
    robots
        Team size, at least 1, if all robots are alike.
    kinds
        Kinds of robots, instead of ``robots``. A column such as ``survival:drone`` or
        ``share:drone`` is for the kind of this name only. In a row in which one of these columns of
        survivals is filled, a kind whose cell is empty has the survival in the column ``survival``;
        if that is empty, too, it cannot take the arc. Likewise for shares, which are 1 then.
    max_length
        Travel budget of every robot, at least 0, in the unit of ``length``; default: none.
    title
        Title of the mission, for pictures.
    options
        ``name``, and what files of all formats take, such as ``both_ways``, ``pays``, ``danger``
        and ``reward``: :func:`botohe_moo.mission.read_mission`.

    Returns
    -------
    Mission
        Names of columns may be in upper or lower case and in any order, numbers may be text, and
        text loses the blanks around it.

    Raises
    ------
    MissionError
        If a column is missing, there twice or for an unknown kind, a row has no label, a node or an
        arc is there twice, or the mission is not valid. Lists all faults; rows are named by the
        table and their index.
    TypeError
        If ``nodes`` or ``arcs`` is not a DataFrame.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo import mission_from_tables
    >>> nodes = pd.DataFrame({"label": ["dock", "reef"], "reward": [0, 5]})
    >>> arcs = pd.DataFrame({"tail": ["dock"], "head": ["reef"], "survival": [0.9]})
    >>> mission_from_tables(nodes, arcs, base="dock", robots=2, both_ways=True)
    <Mission 'mission': 2 nodes, 2 arcs, 2 robots at base 'dock', total reward 5>
    """
    node_rows, faults = _rows("nodes", nodes, ("label",))
    arc_rows, others = _rows("arcs", arcs, ("tail", "head"))
    if (faults := faults + others) and not (node_rows and arc_rows):
        raise MissionError(faults)
    base = base.strip() if isinstance(base, str) else base
    graph = {"max_length": max_length} | ({"title": title} if title else {})
    draft = Draft(node_rows, arc_rows, graph, faults)
    try:
        return make_mission(draft, base=base, robots=robots, kinds=kinds, **options)
    except MissionError as error:
        where = _with_rows(error.faults, [*node_rows, *arc_rows])
        raise MissionError(where, error.source) from None


def _with_rows(faults: Iterable[str], rows: Sequence[Row]) -> Iterable[str]:
    """Begin faults with the rows of their nodes and arcs; an arc back has those of its arc."""
    named = {rules.whose(*row.labels[::way]): row for way in (-1, 1) for row in rows}
    told = []
    for name, colon, said in (fault.partition(": ") for fault in faults):
        where, labels, _ = named.get(name, ("", (), {}))
        told.append(f"{where}: {rules.whose(*labels)}: {said}" if labels else name + colon + said)
    return dict.fromkeys(told)


def _rows(table: str, frame: pd.DataFrame, labels: tuple[str, ...]) -> tuple[list[Row], list[str]]:
    """Return the rows that have their labels, and the faults of the table."""
    check_frame(table, frame)
    table = frame.attrs.get(FILE, table)
    names = [_column_name(str(column)) for column in frame.columns]
    wrong = [name for name in labels if name not in names]
    wrong += [name for name in dict.fromkeys(names) if name and names.count(name) > 1]
    if wrong:
        found = quoted(", ".join(map(str, frame.columns)))
        return [], [f"{table}: expected one column {quoted(name)}, found {found}" for name in wrong]
    rows, faults = [], []
    for where, row in filled_cells(frame, names, table):
        if missing := [key for key in labels if key not in row]:
            faults.append(f"{where}: expected {missing[0]}, found nothing")
            continue
        ends = tuple(row.pop(key) for key in labels)
        if "x" in row or "y" in row:
            row["pos"] = [row.pop("x", None), row.pop("y", None)]
        rows.append(Row(where, ends, row))
    return rows, faults


def _column_name(column: str) -> str:
    """Return a column's name in lower case, apart from the name of a kind."""
    name, colon, kind = column.partition(":")
    name = name.strip().lower()
    is_by_kind = rules.attribute_of(f"{name}{colon}") is not None
    return f"{name}:{kind.strip()}" if is_by_kind else column.strip().lower()
