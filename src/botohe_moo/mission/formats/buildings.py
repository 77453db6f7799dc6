"""Buildings of Open-RMF: the ``building.yaml`` files of its traffic editor."""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import combinations
from statistics import fmean
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import networkx as nx
from pydantic import Field

from botohe_moo._base.checks import as_float, quoted
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative
from botohe_moo.mission.formats.nodelink import Entry
from botohe_moo.mission.formats.roads import road_graph
from botohe_moo.mission.validation import MissionError

if TYPE_CHECKING:
    from botohe_moo._base.document import Document

_SYSTEMS = ("reference_image", "cartesian_meters", "wgs84")
_GAP = 0.05  # metres from the cabin of a lift to its shaft
_EQUATOR, _FLATTENING = 6_378_137.0, 1 / 298.257223563  # of WGS 84, in metres
_LARGEST = 1e9  # of a coordinate

_Spot = tuple[str, int]  # a vertex: its level, and its index there


class _Vertex(NamedTuple):
    place: complex
    name: str
    traits: dict[str, Any]


class _Lane(NamedTuple):
    where: str
    ends: tuple[_Spot, _Spot]
    graph: int
    is_bidirectional: bool


class _Level(NamedTuple):
    elevation: float
    scale: float | None  # metres a pixel, by its measurements
    fiducials: dict[str, complex]


class _Lift(NamedTuple):
    level: str  # whose drawing it is on
    place: complex
    size: tuple[float, float]  # width and depth in metres, NaN where there is none
    yaw: float
    levels: set[str]  # where its doors open; all of them if there are none


class _Site(NamedTuple):
    """What a file says, in the units of its drawings."""

    system: str
    reference: str  # the level whose frame counts
    levels: dict[str, _Level]
    vertices: dict[_Spot, _Vertex]
    lanes: list[_Lane]
    lifts: dict[str, _Lift]


@checked
def read_building(
    data: bytes,
    /,
    *,
    base: Any = None,
    danger: NotNegative | None = None,
    reward: NotNegative = 1.0,
    graph: Annotated[int, Field(ge=0)] | Literal["all"] | None = None,
) -> nx.DiGraph[Any]:
    """Read the lanes of a building as arcs, and the vertices at their ends as nodes.

    A label is the name of the vertex where no other has it, else its level and index: ``L1/7``.
    Nodes have ``pos`` in metres, the level as ``zone``, and the parameters of the vertex. Arcs have
    a ``length`` in metres and survive with exp(−``danger`` × length); a node without a ``reward``
    has ``reward``, but the base 0. Without ``base`` it is the first charger. A lift is an arc
    between each two of its levels, as long as one is above the other.

    The lanes of one graph are for the same robots: those of ``graph`` are read, by default of the
    first that has the base. Scales and frames of levels are as ``rmf_building_map_tools`` computes
    them. A warning names what is left out. A MissionError names the lines of what is wrong.

    References
    ----------
    ``rmf_building_map_tools`` of open-rmf/rmf_traffic_editor.
    """
    # Imported late: it takes time, and most missions are not in YAML.
    from botohe_moo._base.document import Document

    site = _read_site(Document(data.decode("utf-8-sig")))
    if danger is None:
        raise MissionError("expected danger, the rate of loss for a metre, found none: give danger")

    def is_base(spot: _Spot) -> bool:
        vertex = site.vertices[spot]
        if base is None:
            return bool(vertex.traits.get("is_charger"))
        return str(base) in (vertex.name or None, _label(spot))

    lanes, others = _lanes_of(site.lanes, graph, is_base)
    touched = {spot for lane in lanes for spot in lane.ends}
    spots = [spot for spot in site.vertices if spot in touched]
    names = Counter(site.vertices[spot].name or None for spot in spots)
    labels = {
        spot: name if names[name := site.vertices[spot].name] == 1 else _label(spot)
        for spot in spots
    }
    bases = [labels[spot] for spot in spots if is_base(spot)]
    if base is None and not bases:
        raise MissionError("expected base, found no vertex with is_charger on a lane: give base")
    start = bases[0] if base is None or len(bases) == 1 else str(base)
    places, notes = _places(site, {level for level, _ in spots})
    if base is None and len(bases) > 1:
        notes.append(f"The base is {quoted(start)}, the first of {len(bases)} chargers.")
    at = {spot: places[spot[0]](site.vertices[spot].place) for spot in spots}
    nodes: list[Entry] = []
    for spot, label in labels.items():
        _, name, traits = site.vertices[spot]
        attributes = {"reward": 0.0 if label == start else reward, **traits}
        if name not in ("", label):
            attributes["name"] = name
        attributes |= {"zone": spot[0], "pos": [at[spot].real, at[spot].imag]}
        nodes.append((_label(spot), (label,), attributes))
    stops = _stops(site, places, at)
    arcs: list[Entry] = []
    for where, tail, head, length in [*_lane_arcs(lanes, at), *_lift_arcs(site.levels, stops)]:
        survival = math.exp(min(0.0, -danger * length))
        ends = labels[tail], labels[head]
        arcs.append((where, ends, {"survival": survival, "length": length}))
    named = {spot: vertex.name for spot, vertex in site.vertices.items() if vertex.name}
    joining = [name for name, found in stops.items() if len({level for level, _ in found}) > 1]
    left_out = {
        **others,
        "named waypoints that none of the lanes touches": [
            quoted(name) for spot, name in named.items() if spot not in at
        ],
        "lifts that join no levels": [name for name in site.lifts if name not in joining],
    }
    return road_graph(
        {"base": start}, nodes, arcs, arc="lane", node="waypoint", left_out=left_out, notes=notes
    )


def _lanes_of(
    lanes: list[_Lane], graph: int | str | None, is_base: Callable[[_Spot], bool]
) -> tuple[list[_Lane], dict[str, list[str]]]:
    """Return the lanes of a graph, by default the first one at a base, and where others are."""
    graphs = sorted({lane.graph for lane in lanes})
    if graph is None:
        at_base = (lane.graph for lane in lanes if any(map(is_base, lane.ends)))
        graph = min(at_base, default=min(graphs, default=0))
    chosen = [lane for lane in lanes if graph in ("all", lane.graph)]
    if not chosen:
        found = ", ".join(map(str, graphs)) or "no lanes at all"
        raise MissionError(f"expected lanes of graph {graph}, found {found}")
    others: dict[str, list[str]] = {}
    for lane in lanes:
        if graph not in ("all", lane.graph):
            others.setdefault(f"lanes of graph {lane.graph}", []).append(lane.where)
    return chosen, others


def _label(spot: _Spot) -> str:
    return f"{spot[0]}/{spot[1]}"


def _lane_arcs(
    lanes: list[_Lane], at: dict[_Spot, complex]
) -> Iterator[tuple[str, _Spot, _Spot, float]]:
    for lane in lanes:
        tail, head = lane.ends
        length = _size(at[tail] - at[head])
        yield lane.where, tail, head, length
        if lane.is_bidirectional:
            yield lane.where, head, tail, length


def _lift_arcs(
    levels: dict[str, _Level], stops: dict[str, list[_Spot]]
) -> Iterator[tuple[str, _Spot, _Spot, float]]:
    for name, spots in stops.items():
        for one, other in combinations(spots, 2):
            if one[0] != other[0]:
                height = abs(levels[one[0]].elevation - levels[other[0]].elevation)
                yield f"lift {name}", one, other, height
                yield f"lift {name}", other, one, height


def _stops(
    site: _Site, places: dict[str, Callable[[complex], complex]], at: dict[_Spot, complex]
) -> dict[str, list[_Spot]]:
    """Return the vertices in each lift: those that say so, and those within its cabin."""
    centres = {name: places[lift.level](lift.place) for name, lift in site.lifts.items()}
    stops: dict[str, list[_Spot]] = {}
    for spot, place in at.items():
        within = []
        for name, lift in site.lifts.items():
            away = (place - centres[name]) * cmath.rect(1.0, -lift.yaw)
            half = [side / 2 + _GAP for side in lift.size]
            if abs(away.real) <= half[0] and abs(away.imag) <= half[1]:
                within.append(name)
        cabin = site.vertices[spot].traits.get("lift_cabin") or next(iter(within), None)
        served = site.lifts[str(cabin)].levels if str(cabin) in site.lifts else ()
        if cabin and (not served or spot[0] in served):
            stops.setdefault(str(cabin), []).append(spot)
    return stops


def _size(place: complex) -> float:
    """Return the absolute value; unlike that of Python's own, it may be infinite."""
    return math.hypot(place.real, place.imag)


def _places(
    site: _Site, used: set[str]
) -> tuple[dict[str, Callable[[complex], complex]], list[str]]:
    """Return what makes metres of places on the drawing of each level, and notes on those used."""
    if site.system == "wgs84":
        local = _local(next(iter(site.vertices.values())).place)
        return dict.fromkeys(site.levels, local), []
    if site.system == "cartesian_meters":
        return dict.fromkeys(site.levels, complex), []
    reference, notes, adrift = site.levels[site.reference], [], []
    scale = reference.scale
    if scale is None:
        notes.append(f"Level {site.reference} has no measurements: its pixels count as metres.")
        scale = 1.0
    places: dict[str, Callable[[complex], complex]] = {}
    for name, level in site.levels.items():
        factor, shift = complex(level.scale or scale), 0j
        shared = [fiducial for fiducial in reference.fiducials if fiducial in level.fiducials]
        there = [reference.fiducials[fiducial].conjugate() for fiducial in shared]
        here = [level.fiducials[fiducial].conjugate() for fiducial in shared]
        turns = [
            (here[i] - here[j]) / (there[i] - there[j])
            for i, j in combinations(range(len(shared)), 2)
            if there[i] != there[j]
        ]
        turns = [turn for turn in turns if 0.0 < _size(turn) < math.inf]
        if name != site.reference and turns:
            turned = cmath.phase(sum(turn / _size(turn) for turn in turns))
            factor = cmath.rect(scale / fmean(map(_size, turns)), -turned)
            shift = scale * sum(there) / len(there) - factor * sum(here) / len(here)
        elif name != site.reference and name in used:
            adrift.append(name)
        places[name] = _flipped(factor, shift)
    if adrift:
        levels = ", ".join(adrift)
        notes.append(f"Levels without two fiducials of {site.reference} lie as drawn: {levels}.")
    return places, notes


def _flipped(factor: complex, shift: complex) -> Callable[[complex], complex]:
    """Make metres of pixels, whose y points down."""
    return lambda place: factor * place.conjugate() + shift


def _local(origin: complex) -> Callable[[complex], complex]:
    """Make metres east and north of an origin, of longitude and latitude in degrees."""
    eccentricity = _FLATTENING * (2.0 - _FLATTENING)
    latitude = math.radians(origin.imag)
    root = math.sqrt(1.0 - eccentricity * math.sin(latitude) ** 2)
    east = math.radians(1.0) * _EQUATOR / root * math.cos(latitude)
    north = math.radians(1.0) * _EQUATOR * (1.0 - eccentricity) / root**3

    def place(at: complex) -> complex:
        return complex(east * (at - origin).real, north * (at - origin).imag)

    return place


class _Items:
    """The items of lists and mappings in a document; what is wrong is noted with its line."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.faults: list[str] = []

    def read(
        self, convert: Callable[[Any, str], Any], *place: int | str, kind: type = list
    ) -> dict[Any, Any]:
        """Return, by index or key, what is made of each item, None of what is wrong."""
        value: Any = self.document.content
        for step in place:
            value = value.get(step)
        found: dict[Any, Any] = {}
        if value and not isinstance(value, kind):
            expected = "a list" if kind is list else "a mapping"
            self.note(f"expected {place[-1]} to be {expected}, got {quoted(value)}", *place)
        elif value:
            for key, item in enumerate(value) if kind is list else value.items():
                where = f"line {self.document.line([*place, key])}"
                try:
                    found[key] = convert(item, where)
                except ValueError as error:
                    found[key] = None
                    self.faults.append(f"{where}: {error}")
        return found

    def note(self, fault: str, *place: int | str) -> None:
        self.faults.append(f"line {self.document.line(place)}: {fault}")


def _read_site(document: Document) -> _Site:
    content = document.content
    if not isinstance(content, dict) or not content.get("levels"):
        is_map = isinstance(content, dict) and "image" in content
        hint = "; botohe missions from-map makes a mission of a map" if is_map else ""
        expected = 'a building of Open-RMF, with "levels"'
        raise MissionError(f"expected {expected}, got {quoted(content)}{hint}")
    items = _Items(document)
    levels: dict[str, _Level] = {}
    vertices: dict[_Spot, _Vertex] = {}
    lanes: list[_Lane] = []
    for name, level in items.read(_mapping, "levels", kind=dict).items():
        if level is not None:
            own, levels[name], lanes_here = _read_level(items, name, level)
            vertices |= {(name, i): vertex for i, vertex in own.items()}
            lanes += lanes_here
    reference = str(content.get("reference_level_name") or next(iter(levels), None))
    if levels and reference not in levels:
        expected = f"one of {', '.join(levels)}"
        items.note(
            f"expected reference_level_name to be {expected}, got {quoted(reference)}",
            "reference_level_name",
        )

    def lift(item: Any, _: str) -> _Lift:
        given = _mapping(item)
        x, y, width, depth, yaw = (
            as_float(given.get(key)) for key in ("x", "y", "width", "depth", "yaw")
        )
        floor = str(given.get("reference_floor_name") or reference)
        if floor not in (*levels, reference):
            expected = f"one of {', '.join(levels)}"
            raise ValueError(f"expected reference_floor_name to be {expected}, got {quoted(floor)}")
        doors = _mapping(given.get("level_doors") or {})
        opens = {level for level, names in doors.items() if names}
        turn = yaw if math.isfinite(yaw) else 0.0
        return _Lift(floor, complex(x, y), (width, depth), turn, opens)

    lifts = items.read(lift, "lifts", kind=dict)
    system = content.get("coordinate_system") or _SYSTEMS[0]
    if system not in _SYSTEMS:
        expected = f"one of {', '.join(_SYSTEMS)}"
        items.note(
            f"expected coordinate_system to be {expected}, got {quoted(system)}",
            "coordinate_system",
        )
    if items.faults:
        raise MissionError(items.faults)
    return _Site(system, reference, levels, vertices, lanes, lifts)


def _read_level(
    items: _Items, name: str, level: dict[str, Any]
) -> tuple[dict[int, _Vertex], _Level, list[_Lane]]:
    def edge(item: Any) -> tuple[int, int, dict[str, Any]]:
        if not isinstance(item, list) or [type(end) for end in item[:2]] != [int, int]:
            raise ValueError(f"expected [vertex, vertex, parameters], got {quoted(item)}")
        for end in item[:2]:
            if end not in own:
                raise ValueError(f"there is no vertex {end} on level {name}")
        return item[0], item[1], _traits(item[2:])

    def scale(item: Any, _: str) -> float:
        *ends, traits = edge(item)
        one, other = (own[end].place if own[end] else math.nan for end in ends)
        pixels, distance = _size(one - other), as_float(traits.get("distance"))
        if pixels == 0.0 or not 0.0 < distance < _LARGEST:
            expected = "a distance > 0 between two places"
            raise ValueError(f"expected {expected}, got {quoted(item)}")
        return distance / pixels

    def lane(item: Any, where: str) -> _Lane:
        one, other, traits = edge(item)
        graph = traits.get("graph_idx", 0)
        if type(graph) is not int or graph < 0:
            raise ValueError(f"expected graph_idx to be an integer >= 0, got {quoted(graph)}")
        is_bidirectional = bool(traits.get("bidirectional"))
        return _Lane(where, ((name, one), (name, other)), graph, is_bidirectional)

    own = items.read(_vertex, "levels", name, "vertices")
    scales = items.read(scale, "levels", name, "measurements")
    lanes = items.read(lane, "levels", name, "lanes")
    fiducials = items.read(_fiducial, "levels", name, "fiducials")
    elevation = as_float(level.get("elevation") or 0)
    if not abs(elevation) < _LARGEST:
        fault = f"expected elevation to be a number, got {quoted(level['elevation'])}"
        items.note(fault, "levels", name, "elevation")
    if items.faults:
        return {}, _Level(0.0, None, {}), []
    measured = fmean(scales.values()) if scales else None
    return own, _Level(elevation, measured, dict(fiducials.values())), list(lanes.values())


def _mapping(value: Any, _: str = "") -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"expected a mapping, got {quoted(value)}")
    return value


def _vertex(item: Any, _: str) -> _Vertex:
    place = _place(item, "[x, y, z, name, parameters]")
    name = "" if len(item) < 4 or item[3] is None else str(item[3]).strip()
    return _Vertex(place, name, _traits(item[4:]))


def _fiducial(item: Any, _: str) -> tuple[str, complex]:
    place = _place(item, "[x, y, name]")
    return str(item[2]) if len(item) > 2 else "", place


def _place(item: Any, expected: str) -> complex:
    numbers = [as_float(part) for part in item[:2]] if isinstance(item, list) else []
    if len(numbers) < 2 or not all(abs(number) < _LARGEST for number in numbers):
        raise ValueError(f"expected {expected}, got {quoted(item)}")
    return complex(*numbers)


def _traits(rest: list[Any]) -> dict[str, Any]:
    """Return the values of parameters, which are pairs of a type and a value."""
    given = _mapping(rest[0] or {}) if rest else {}
    return {
        key: value[1] if isinstance(value, list) and len(value) == 2 else value
        for key, value in given.items()
    }
