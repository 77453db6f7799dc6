"""Buildings of Open-RMF: the ``building.yaml`` files of its traffic editor."""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import combinations
from statistics import fmean
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, BeforeValidator, Field, model_validator

from botohe_moo._base.checks import quoted
from botohe_moo._plugins.checks import checked
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source, validated
from botohe_moo.mission.rules import MissionError

if TYPE_CHECKING:
    from botohe_moo._base.document import Document

_GAP = 0.05  # metres from the cabin of a lift to its shaft
_CLOSE = 1e-6  # places nearer to each other are the same
_EQUATOR, _FLATTENING = 6_378_137.0, 1 / 298.257223563  # of WGS 84, in metres

_Spot = tuple[str, int]  # a vertex: its level, and its index there
_Frame = Callable[[complex], complex]  # makes metres of a place on a drawing


def _value(pair: Any) -> Any:
    """Return the value of a parameter, which is a pair of its type and its value."""
    return pair[1] if isinstance(pair, list) and len(pair) == 2 else pair


_Number = Annotated[float, Field(strict=True, gt=-1e9, lt=1e9)]
_Index = Annotated[int, Field(strict=True, ge=0)]
_Text = Annotated[str, BeforeValidator(lambda text: "" if text is None else str(text).strip())]
_Value = BeforeValidator(_value)


class _Part(BaseModel):
    @model_validator(mode="before")
    @classmethod
    def _without_null(cls, content: Any) -> Any:
        """Leave out what the editor writes as nothing, such as a level without lanes."""
        if not isinstance(content, dict):
            return content
        return {key: value for key, value in content.items() if value is not None}


class _Vertex(NamedTuple):
    x: _Number
    y: _Number
    z: Any = 0.0
    name: _Text = ""
    traits: dict[str, Annotated[Any, _Value]] = {}  # noqa: RUF012

    @property
    def place(self) -> complex:
        return complex(self.x, self.y)


class _LaneTraits(_Part):
    graph_idx: Annotated[_Index, _Value] = 0
    bidirectional: Annotated[Any, _Value] = False


class _Lane(NamedTuple):
    tail: _Index
    head: _Index
    traits: _LaneTraits = _LaneTraits()


class _MeasurementTraits(_Part):
    distance: Annotated[float, _Value, Field(strict=True, gt=0, lt=1e9)]


class _Measurement(NamedTuple):
    tail: _Index
    head: _Index
    traits: _MeasurementTraits


class _Fiducial(NamedTuple):
    x: _Number
    y: _Number
    name: _Text = ""


class _Level(_Part):
    elevation: _Number = 0.0
    vertices: list[_Vertex] = []
    lanes: list[_Lane] = []
    measurements: list[_Measurement] = []
    fiducials: list[_Fiducial] = []

    def length(self, tail: int, head: int) -> float:
        return abs(self.vertices[tail].place - self.vertices[head].place)

    def scale(self) -> float | None:
        """Return how many metres a pixel is by measurements, None if there are none."""
        scales = [traits.distance / self.length(*ends) for *ends, traits in self.measurements]
        return fmean(scales) if scales else None


class _Lift(_Part):
    x: _Number
    y: _Number
    width: _Number
    depth: _Number
    yaw: _Number = 0.0
    reference_floor_name: _Text = ""
    level_doors: dict[str, Any] = {}

    def stops_at(self, level: str) -> bool:
        """Return whether it has doors on a level, or nowhere."""
        return not any(self.level_doors.values()) or bool(self.level_doors.get(level))

    def has(self, place: complex, centre: complex) -> bool:
        """Return whether a place is within the cabin."""
        away = (place - centre) * cmath.rect(1.0, -self.yaw)
        return abs(away.real) <= self.width / 2 + _GAP and abs(away.imag) <= self.depth / 2 + _GAP


class _Site(_Part):
    """What a file says, in the units of its drawings."""

    coordinate_system: Literal["reference_image", "cartesian_meters", "wgs84"] = "reference_image"
    reference_level_name: _Text = ""  # whose frame counts; by default the first one
    levels: Annotated[dict[str, _Level], Field(min_length=1)]
    lifts: dict[str, _Lift] = {}

    @property
    def reference(self) -> str:
        return self.reference_level_name or next(iter(self.levels))


@checked
def read_building(
    source: Source,
    *,
    base: Any = None,
    graph: Annotated[int, Field(ge=0)] | Literal["all"] | None = None,
) -> Draft:
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
    document = source.yaml
    site = _read_site(document)
    vertices = {
        (name, i): vertex
        for name, level in site.levels.items()
        for i, vertex in enumerate(level.vertices)
    }

    def is_base(spot: _Spot) -> bool:
        if base is None:
            return bool(vertices[spot].traits.get("is_charger"))
        return str(base) in (vertices[spot].name or None, _label(spot))

    lanes, others = _lanes(site, document, graph, is_base)
    touched = {spot for _, ends, _ in lanes for spot in ends}
    spots = [spot for spot in vertices if spot in touched]
    names = Counter(vertices[spot].name or None for spot in spots)
    labels = {
        spot: name if names[name := vertices[spot].name] == 1 else _label(spot) for spot in spots
    }
    bases = [labels[spot] for spot in spots if is_base(spot)]
    if base is not None and len(bases) > 1:
        found = ", ".join(bases)
        raise MissionError(f"expected the label of one waypoint as base, found {found}")
    if base is None and not bases:
        raise MissionError("expected base, found no vertex with is_charger on a lane: give base")
    start = bases[0] if bases else str(base)
    frames, notes = _frames(site, {level for level, _ in spots})
    if base is None and len(bases) > 1:
        notes.append(f"The base is {quoted(start)}, the first of {len(bases)} chargers.")
    at = {spot: frames[spot[0]](vertices[spot].place) for spot in spots}
    nodes: list[Row] = []
    for spot, label in labels.items():
        *_, name, traits = vertices[spot]
        attributes = {**traits}
        if name not in ("", label):
            attributes["name"] = name
        attributes |= {"zone": spot[0], "pos": [at[spot].real, at[spot].imag]}
        nodes.append(Row(_label(spot), (label,), attributes))
    ways = [
        (where, ends, abs(at[ends[0]] - at[ends[1]]))
        for where, (tail, head), is_both in lanes
        for ends in [(tail, head), (head, tail)][: 1 + is_both]
    ]
    rides = list(_rides(site, frames, at, vertices))
    arcs: list[Row] = [
        Row(where, (labels[tail], labels[head]), {"length": length})
        for where, (tail, head), length in [*ways, *rides]
    ]
    joining = {where for where, _, _ in rides}
    left_out = {
        **others,
        "named waypoints that none of the lanes touches": [
            quoted(vertex.name)
            for spot, vertex in vertices.items()
            if vertex.name and spot not in at
        ],
        "lifts that join no levels": [n for n in site.lifts if f"lift {n}" not in joining],
    }
    return Draft(
        nodes,
        arcs,
        {"base": start},
        trim=True,
        words=("waypoint", "lane"),
        left_out=left_out,
        notes=notes,
    )


def _label(spot: _Spot) -> str:
    return f"{spot[0]}/{spot[1]}"


_Way = tuple[str, tuple[_Spot, _Spot], bool]


def _lanes(
    site: _Site,
    document: Document,
    graph: int | str | None,
    is_base: Callable[[_Spot], bool],
) -> tuple[list[_Way], dict[str, list[str]]]:
    """Return the lanes of a graph, by default the first one at a base, and where others are."""
    by_graph: dict[int, list[_Way]] = {}
    for name, level in site.levels.items():
        for i, (tail, head, traits) in enumerate(level.lanes):
            where = f"line {document.line(['levels', name, 'lanes', i])}"
            lane = where, ((name, tail), (name, head)), bool(traits.bidirectional)
            by_graph.setdefault(traits.graph_idx, []).append(lane)
    if graph is None:
        with_base = (
            n for n, lanes in by_graph.items() for _, ends, _ in lanes if any(map(is_base, ends))
        )
        graph = min(with_base, default=min(by_graph, default=0))
    if graph == "all":
        return [lane for lanes in by_graph.values() for lane in lanes], {}
    if graph not in by_graph:
        found = ", ".join(map(str, sorted(by_graph))) or "no lanes at all"
        raise MissionError(f"expected lanes of graph {graph}, found {found}")
    lanes = by_graph.pop(graph)
    return lanes, {
        f"lanes of graph {n}": [where for where, _, _ in others] for n, others in by_graph.items()
    }


def _rides(
    site: _Site,
    frames: dict[str, _Frame],
    at: dict[_Spot, complex],
    vertices: dict[_Spot, _Vertex],
) -> Iterator[tuple[str, tuple[_Spot, _Spot], float]]:
    """Return an arc between each two levels of a lift, as long as one is above the other.

    It stops at vertices that name it, and at those within its cabin.
    """
    stops: dict[str, list[_Spot]] = {}
    centres = {
        name: frames[lift.reference_floor_name or site.reference](complex(lift.x, lift.y))
        for name, lift in site.lifts.items()
    }
    for spot, place in at.items():
        within = (n for n, lift in site.lifts.items() if lift.has(place, centres[n]))
        cabin = str(vertices[spot].traits.get("lift_cabin") or next(within, ""))
        if cabin and (cabin not in site.lifts or site.lifts[cabin].stops_at(spot[0])):
            stops.setdefault(cabin, []).append(spot)
    for name, spots in stops.items():
        for one, other in combinations(spots, 2):
            if one[0] != other[0]:
                height = abs(site.levels[one[0]].elevation - site.levels[other[0]].elevation)
                yield f"lift {name}", (one, other), height
                yield f"lift {name}", (other, one), height


def _frames(site: _Site, used: set[str]) -> tuple[dict[str, _Frame], list[str]]:
    """Return what makes metres of places on the drawing of each level, and notes on those used."""
    if site.coordinate_system == "wgs84":
        vertices = (vertex for level in site.levels.values() for vertex in level.vertices)
        return dict.fromkeys(site.levels, _local(next(vertices).place)), []
    if site.coordinate_system == "cartesian_meters":
        return dict.fromkeys(site.levels, complex), []
    reference, notes, unaligned = site.levels[site.reference], [], []
    scale = reference.scale()
    if scale is None:
        notes.append(f"Level {site.reference} has no measurements: its pixels count as metres.")
        scale = 1.0
    frames: dict[str, _Frame] = {}
    there = {name: complex(x, -y) for x, y, name in reference.fiducials}
    for name, level in site.levels.items():
        here = {name: complex(x, -y) for x, y, name in level.fiducials if name in there}
        turns = [
            (here[one] - here[other]) / (there[one] - there[other])
            for one, other in combinations(here, 2)
            if min(abs(here[one] - here[other]), abs(there[one] - there[other])) > _CLOSE
        ]
        factor, shift = complex(level.scale() or scale), 0j
        if name != site.reference and turns:
            turned = cmath.phase(sum(turn / abs(turn) for turn in turns))
            factor = cmath.rect(scale / fmean(map(abs, turns)), -turned)
            shift = sum(scale * there[one] - factor * here[one] for one in here) / len(here)
        elif name != site.reference and name in used:
            unaligned.append(name)
        frames[name] = _flipped(factor, shift)
    if unaligned:
        levels = f"{', '.join(unaligned)} without two fiducials of {site.reference}"
        notes.append(f"These levels keep the frame of their drawing: {levels}.")
    return frames, notes


def _flipped(factor: complex, shift: complex) -> _Frame:
    """Return the conversion to metres of pixels, whose y points down."""
    return lambda place: factor * place.conjugate() + shift


def _local(origin: complex) -> _Frame:
    """Return the conversion of longitude and latitude to metres east and north of an origin."""
    eccentricity = _FLATTENING * (2.0 - _FLATTENING)
    latitude = math.radians(origin.imag)
    root = math.sqrt(1.0 - eccentricity * math.sin(latitude) ** 2)
    east = math.radians(1.0) * _EQUATOR / root * math.cos(latitude)
    north = math.radians(1.0) * _EQUATOR * (1.0 - eccentricity) / root**3
    return lambda at: complex(east * (at - origin).real, north * (at - origin).imag)


def _read_site(document: Document) -> _Site:
    content = document.content
    if not isinstance(content, dict) or not content.get("levels"):
        is_map = isinstance(content, dict) and "image" in content
        hint = "; botohe missions from-map makes a mission of a map" if is_map else ""
        expected = 'a building of Open-RMF, with "levels"'
        raise MissionError(f"expected {expected}, got {quoted(content)}{hint}")
    site = validated(document, _Site)
    if faults := [f"line {document.line(way)}: {fault}" for way, fault in _lost(site)]:
        raise MissionError(faults)
    return site


def _lost(site: _Site) -> Iterator[tuple[list[int | str], str]]:
    """Return where there are vertices and levels that do not exist, and what is wrong."""
    for name, level in site.levels.items():
        for kind, edges in (("lanes", level.lanes), ("measurements", level.measurements)):
            for i, (tail, head, _) in enumerate(edges):
                if max(tail, head) >= len(level.vertices):
                    fault = f"there is no vertex {max(tail, head)} on level {name}"
                    yield ["levels", name, kind, i], fault
                elif kind == "measurements" and level.length(tail, head) < _CLOSE:
                    fault = f"expected a measurement between two places, got {tail} and {head}"
                    yield ["levels", name, kind, i], fault
    named: list[tuple[list[int | str], str]] = [
        (["lifts", name, "reference_floor_name"], lift.reference_floor_name)
        for name, lift in site.lifts.items()
    ]
    named.append((["reference_level_name"], site.reference_level_name))
    for way, level_name in named:
        if level_name and level_name not in site.levels:
            expected = f"one of {', '.join(site.levels)}"
            yield way, f"expected {way[-1]} to be {expected}, got {quoted(level_name)}"


def is_building(source: Source) -> bool:
    """Return whether a file has levels."""
    content = source.yaml.content
    return isinstance(content, dict) and "levels" in content


BUILDING = Format((".building.yaml", ".yaml", ".yml"), is_building, read_building)
