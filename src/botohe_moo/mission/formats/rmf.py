"""Both formats of Open-RMF: buildings of its traffic editor, and navigation graphs made of them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, BeforeValidator, Field, model_validator

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source, validated
from botohe_moo.mission.rules import MissionError

_GAP = 0.05  # metres from the cabin of a lift to its shaft
_STOREY = 4.0  # metres from a level to the next one where elevations are not known
_CLOSE = 1e-6  # places nearer to each other are the same
# Of the ellipsoid of WGS 84: its radius at the equator in metres, and its squared eccentricity.
_EQUATOR, _ECCENTRICITY = 6_378_137.0, (2.0 - 1 / 298.257223563) / 298.257223563
_UP = np.diag([1.0, -1.0])  # y points down on drawings
_EMPTY: tuple[Any, ...] = (None, [])  # how no parameters, no lanes and the like may be written

_Spot: TypeAlias = tuple[str, int]  # a vertex: its level, and its index there
_Vertices: TypeAlias = dict[_Spot, tuple[list[float], str, dict[str, Any]]]  # place, name, traits
_Frame: TypeAlias = Callable[[Any], FloatArray]  # makes metres of a place on a level


# Building is deferred until a file is read: all formats are imported to know their suffixes.
class _Part(BaseModel, defer_build=True, extra="allow"):
    """A mapping. What is empty counts as missing; ``model_extra`` has what is not declared."""

    @model_validator(mode="before")
    @classmethod
    def _plain(cls, content: Any) -> Any:
        """Take the values of parameters, which in buildings are pairs of a type and a value."""
        if not isinstance(content, dict):
            return {} if content in _EMPTY else content
        pairs = {k: v for k, v in content.items() if isinstance(v, list) and len(v) == 2}
        values = {key: value for key, (kind, value) in pairs.items() if isinstance(kind, int)}
        return {key: value for key, value in {**content, **values}.items() if value not in _EMPTY}


def _is_waypoint(v: Any) -> bool:
    """Return whether a vertex is [x, y, {…}], as in navigation graphs; in buildings it has a z."""
    return isinstance(v, list) and len(v) == 3 and (v[2] in _EMPTY or isinstance(v[2], dict))


def _as_vertex(row: Any) -> Any:
    """Return a vertex as [x, y, z, name, {…}]; a waypoint has its name among its parameters."""
    if not _is_waypoint(row):
        return row + [None] * (5 - len(row)) if isinstance(row, list) else row
    traits = {**(row[2] or {})}
    return [*row[:2], None, traits.pop("name", None), traits]


def _as_lane(row: Any) -> Any:
    return row + [None] * (3 - len(row)) if isinstance(row, list) else row


_Wanted: TypeAlias = Annotated[int, Field(ge=0)] | Literal["all"] | None
_Number = Annotated[float, Field(strict=True, gt=-1e9, lt=1e9)]
_Index = Annotated[int, Field(strict=True, ge=0)]
_Text = Annotated[str, BeforeValidator(lambda text: "" if text is None else str(text).strip())]
_Vertex = Annotated[tuple[_Number, _Number, Any, _Text, _Part], BeforeValidator(_as_vertex)]


class _LaneTraits(_Part):
    graph_idx: _Index = 0
    bidirectional: Any = False


class _MeasurementTraits(_Part):
    distance: Annotated[float, Field(strict=True, gt=0, lt=1e9)]


class _Level(_Part):
    elevation: _Number | None = None
    vertices: list[_Vertex] = []
    lanes: list[Annotated[tuple[_Index, _Index, _LaneTraits], BeforeValidator(_as_lane)]] = []
    measurements: list[tuple[_Index, _Index, _MeasurementTraits]] = []
    fiducials: list[tuple[_Number, _Number, _Text]] = []

    def length(self, tail: int, head: int) -> float:
        return math.dist(self.vertices[tail][:2], self.vertices[head][:2])

    def scale(self) -> float | None:
        """Return how many metres a pixel is by measurements, None if there are none."""
        scales = [traits.distance / self.length(*ends) for *ends, traits in self.measurements]
        return math.fsum(scales) / len(scales) if scales else None


class _Lift(_Part):
    x: _Number
    y: _Number
    width: _Number
    depth: _Number
    yaw: _Number = 0.0
    reference_floor_name: _Text = ""
    level_doors: dict[str, Any] = {}

    def has(self, place: FloatArray, frames: Mapping[str, _Frame]) -> bool:
        """Return whether a place, in metres, is within the cabin."""
        x, y = place - frames[self.reference_floor_name]([self.x, self.y])
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        across, along = abs(x * cos + y * sin), abs(y * cos - x * sin)
        return bool(across <= self.width / 2 + _GAP and along <= self.depth / 2 + _GAP)


class _Site(_Part):
    """What a building is, in the units of its drawings."""

    coordinate_system: Literal["reference_image", "cartesian_meters", "wgs84"] = "reference_image"
    reference_level_name: _Text = ""  # whose frame counts; by default the first one
    levels: Annotated[dict[str, _Level], Field(min_length=1)]
    lifts: dict[str, _Lift] = {}


class _Graph(_Site):
    """What a navigation graph is, in metres; its waypoints name the lifts that they are in."""

    coordinate_system: Literal["cartesian_meters"] = "cartesian_meters"
    lifts: Annotated[dict[str, _Lift], BeforeValidator(lambda _: {})] = {}
    building_name: _Text = ""


@checked
def read_building(source: Source, *, base: Any = None, graph: _Wanted = None) -> Draft:
    """Read the lanes of a building as arcs, and the vertices at their ends as nodes.

    A label is the name of the vertex where no other has it, else its level and index: ``L1/7``.
    Nodes have ``pos`` in metres, the level as ``zone``, and the parameters of the vertex. Without
    ``base`` it is the first charger. A lift is an arc between each two of its levels, as long as
    one is above the other.

    The lanes of one graph are for the same robots: those of ``graph`` are read, by default of the
    first that has the base. A MissionError names the lines of what is wrong.
    """
    return _draft(source, validated(source.yaml, _Site), base, graph)


@checked
def read_navigation_graph(source: Source, *, base: Any = None) -> Draft:
    """Read the lanes of a navigation graph as arcs, one way, and its vertices as nodes.

    Labels, attributes and the base are as for `read_building`, and parameters of lanes become
    attributes of arcs. Unless all levels have an ``elevation``, each is 4 m above the one before.

    References
    ----------
    ``generate_nav_graph`` in ``rmf_building_map_tools`` of open-rmf/rmf_traffic_editor, and
    ``parse_graph`` in ``rmf_fleet_adapter`` of open-rmf/rmf_ros2, which joins levels by lifts.
    """
    site = validated(source.yaml, _Graph)
    is_stacked = any(level.elevation is None for level in site.levels.values())
    for i, level in enumerate(site.levels.values() if is_stacked else ()):
        level.elevation = _STOREY * i
    draft = _draft(source, site, base, "all")
    if is_stacked and any(row.where.startswith("lift ") for row in draft.arcs):
        order = ", ".join(site.levels)
        draft.notes.append(f"Without elevations, levels count as {_STOREY:g} m apart: {order}.")
    draft.graph |= {"title": site.building_name} if site.building_name else {}
    return draft


def _draft(source: Source, site: _Site, base: Any, graph: int | str | None) -> Draft:
    """Return the nodes and arcs of a site: those of one of its graphs, or of all of them."""
    if faults := [f"line {source.yaml.line(way)}: {fault}" for way, fault in _lost(site)]:
        raise MissionError(faults)
    vertices: _Vertices = {
        (level, i): ([x, y], name, traits.model_extra or {})
        for level, of_level in site.levels.items()
        for i, (x, y, _, name, traits) in enumerate(of_level.vertices)
    }
    numbers = {f"{level}/{i}": (level, i) for level, i in vertices}
    meant = {spot for spot, (*_, traits) in vertices.items() if traits.get("is_charger")}
    if base is not None:
        meant = {spot for spot, (_, name, _) in vertices.items() if name == str(base)}
    if str(base) in numbers:
        meant = {numbers[str(base)]}
    lanes, left_out = _lanes(source, site, graph, meant)
    touched = {spot for row in lanes for spot in row.labels}
    left_out["named waypoints that none of the lanes touches"] = [
        quoted(name) for spot, (_, name, _) in vertices.items() if name and spot not in touched
    ]
    vertices = {spot: vertex for spot, vertex in vertices.items() if spot in touched}
    counts = Counter([name for _, name, _ in vertices.values()] + 2 * ["", *numbers])
    labels = {
        spot: name if counts[name] == 1 else f"{spot[0]}/{spot[1]}"
        for spot, (_, name, _) in vertices.items()
    }
    bases = [label for spot, label in labels.items() if spot in meant]
    if base is None and not bases:
        raise MissionError("expected base, found no vertex with is_charger on a lane: give base")
    if base is not None and len(bases) > 1:
        raise MissionError(f"expected the label of one waypoint as base, found {', '.join(bases)}")
    frames, notes = _frames(site, {level for level, _ in vertices})
    if len(bases) > 1:
        notes.append(f"The base is {quoted(bases[0])}, the first of {len(bases)} chargers.")
    rides = list(_rides(site, frames, vertices))
    joining = {row.where for row in rides}
    left_out["lifts that join no levels"] = [n for n in site.lifts if f"lift {n}" not in joining]
    nodes = []
    for spot, (place, name, traits) in vertices.items():
        where = f"line {source.yaml.line(['levels', spot[0], 'vertices', spot[1]])}"
        named = {"name": name} if name not in ("", labels[spot]) else {}
        own = {"zone": spot[0], "pos": frames[spot[0]](place).tolist()}
        nodes.append(Row(where, (labels[spot],), {**traits, **named, **own}))
    arcs = [Row(at, (labels[tail], labels[head]), more) for at, (tail, head), more in lanes + rides]
    draft = Draft(nodes, arcs, {"base": bases[0] if bases else base}, trim=True, straight=True)
    draft.words, draft.left_out, draft.notes = ("waypoint", "lane"), left_out, notes
    return draft


def _lanes(
    source: Source, site: _Site, graph: int | str | None, meant: set[_Spot]
) -> tuple[list[Row], dict[str, list[str]]]:
    """Return the lanes of a graph, by default the first one at a base, and where others are."""
    by_graph: dict[int, list[Row]] = {}
    for name, level in site.levels.items():
        for i, (tail, head, traits) in enumerate(level.lanes):
            where = f"line {source.yaml.line(['levels', name, 'lanes', i])}"
            attributes = (traits.model_extra or {}) if isinstance(site, _Graph) else {}
            ends = (name, tail), (name, head)
            for way in [ends, ends[::-1]][: 1 + bool(traits.bidirectional)]:
                by_graph.setdefault(traits.graph_idx, []).append(Row(where, way, {**attributes}))
    if graph is None:
        at_base = (n for n, rows in by_graph.items() if any(meant & {*r.labels} for r in rows))
        graph = min(at_base, default=min(by_graph, default=0))
    if graph not in ("all", *by_graph):
        found = ", ".join(map(str, sorted(by_graph))) or "no lanes at all"
        raise MissionError(f"expected lanes of graph {graph}, found {found}")
    others = {n: by_graph.pop(n) for n in [*by_graph] if graph not in ("all", n)}
    left_out = {f"lanes of graph {n}": [row.where for row in rows] for n, rows in others.items()}
    return [row for rows in by_graph.values() for row in rows], left_out


def _rides(site: _Site, frames: Mapping[str, _Frame], vertices: _Vertices) -> Iterator[Row]:
    """Yield an arc between each two levels of a lift, as long as one is above the other.

    It stops where it has doors, or everywhere if it has none: at vertices that name it, and at
    those within its cabin.
    """
    stops: dict[str, list[_Spot]] = {}
    for spot, (place, _, traits) in vertices.items():
        at = frames[spot[0]](place)
        within = (name for name, lift in site.lifts.items() if lift.has(at, frames))
        cabin = str(traits.get("lift_cabin") or traits.get("lift") or next(within, ""))
        doors = site.lifts[cabin].level_doors if cabin in site.lifts else {}
        if cabin and (doors.get(spot[0]) or not any(doors.values())):
            stops.setdefault(cabin, []).append(spot)
    for name, spots in stops.items():
        for ends in [(one, other) for one in spots for other in spots if one[0] != other[0]]:
            low, high = sorted(site.levels[level].elevation or 0.0 for level, _ in ends)
            yield Row(f"lift {name}", ends, {"length": high - low})


def _frames(site: _Site, used: Collection[str]) -> tuple[dict[str, _Frame], list[str]]:
    """Return what makes metres of places on each level, and notes on the levels that are used.

    ``""`` stands for the reference level. On a drawing y points down, so p = (x, −y) is a place
    there, in pixels. In metres, it is scaled by s and turned counterclockwise by R(θ)::

        drawing of a level, in pixels                 all levels, in metres

          +-------> x                                   y
          |   A                                         ^      B
          |      .          s R(θ) (p − c) + s₀ c₀       |    .
          |         B       --------------------->      |  A
          v y                                           +----------> x

    The reference level has θ = 0, c = c₀ = 0, and the scale s = s₀ of its measurements. Another
    level has fiducials, such as A and B, at pᵢ that the reference level has at rᵢ. Then

        c = mean(pᵢ), c₀ = mean(rᵢ)
        s = s₀ / mean(|pᵢ − pⱼ| / |rᵢ − rⱼ|)
        θ = −arg Σ exp(√−1 (arg(pᵢ − pⱼ) − arg(rᵢ − rⱼ)))

    over all fiducials, and over all pairs of them.

    References
    ----------
    ``Transform.set_from_fiducials`` in ``rmf_building_map_tools`` of open-rmf/rmf_traffic_editor.
    """
    if site.coordinate_system == "cartesian_meters":
        return dict.fromkeys(("", *site.levels), np.asarray), []
    if site.coordinate_system == "wgs84":
        first = next(vertex for level in site.levels.values() for vertex in level.vertices)
        return dict.fromkeys(("", *site.levels), _around(*first[:2])), []
    reference = site.reference_level_name or next(iter(site.levels))
    scale, unaligned = site.levels[reference].scale(), []
    notes = [] if scale else [f"Level {reference} has no measurements: its pixels count as metres."]
    scale = scale or 1.0
    there = {name: place for *place, name in site.levels[reference].fiducials}
    frames = {n: _drawn((level.scale() or scale) * _UP) for n, level in site.levels.items()}
    for name in [name for name in site.levels if name != reference]:
        shared = [(place, there[of]) for *place, of in site.levels[name].fiducials if of in there]
        if aligned := _aligned(np.array(shared).reshape(-1, 2, 2) @ _UP, scale):
            frames[name] = aligned
        elif name in used:
            unaligned.append(name)
    if unaligned:
        levels = f"{', '.join(unaligned)} without two fiducials of {reference}"
        notes.append(f"These levels keep the frame of their drawing: {levels}.")
    return {"": frames[reference], **frames}, notes


def _drawn(turn: FloatArray, origin: Any = 0.0, shift: Any = 0.0) -> _Frame:
    return lambda place: turn @ np.subtract(place, origin) + shift


def _aligned(shared: FloatArray, scale: float) -> _Frame | None:
    """Return the frame in which fiducials at shared[:, 0] lie on those at shared[:, 1]."""
    one, other = np.triu_indices(len(shared), 1)
    x, y = np.moveaxis(shared[one] - shared[other], -1, 0)
    lengths, angles = np.hypot(x, y), np.arctan2(y, x)
    is_apart = lengths.min(axis=1) > _CLOSE
    if not is_apart.any():
        return None
    ratio = np.divide(*lengths[is_apart].T).mean()
    turns = np.subtract(*angles[is_apart].T)
    angle = -math.atan2(np.sin(turns).sum(), np.cos(turns).sum())
    cos, sin = math.cos(angle), math.sin(angle)
    here, there = shared.mean(axis=0)
    turn = scale / ratio * np.array([[cos, -sin], [sin, cos]])
    return _drawn(turn @ _UP, _UP @ here, scale * there)


def _around(longitude: float, latitude: float) -> _Frame:
    """Return what makes metres east and north of a place of longitudes and latitudes."""
    root = math.sqrt(1.0 - _ECCENTRICITY * math.sin(math.radians(latitude)) ** 2)
    east = math.radians(1.0) * _EQUATOR / root * math.cos(math.radians(latitude))
    north = math.radians(1.0) * _EQUATOR * (1.0 - _ECCENTRICITY) / root**3
    return _drawn(np.diag([east, north]), (longitude, latitude))


def _lost(site: _Site) -> Iterator[tuple[tuple[int | str, ...], str]]:
    """Yield where there are vertices and levels that do not exist, and what is wrong."""
    for name, level in site.levels.items():
        for kind in ("lanes", "measurements"):
            for i, (tail, head, _) in enumerate(getattr(level, kind)):
                way: tuple[int | str, ...] = ("levels", name, kind, i)
                if max(tail, head) >= len(level.vertices):
                    yield way, f"there is no vertex {max(tail, head)} on level {name}"
                elif kind == "measurements" and level.length(tail, head) < _CLOSE:
                    yield way, f"expected a measurement between two places, got {tail} and {head}"
    floors = {
        ("lifts", n, "reference_floor_name"): lift.reference_floor_name
        for n, lift in site.lifts.items()
    }
    for way, floor in [*floors.items(), (("reference_level_name",), site.reference_level_name)]:
        if floor not in ("", *site.levels):
            expected = f"one of {', '.join(site.levels)}"
            yield way, f"expected {way[-1]} to be {expected}, got {quoted(floor)}"


def is_navigation_graph(source: Source) -> bool:
    """Return whether most vertices of a file are waypoints."""
    levels = source.yaml.content["levels"].values()
    rows = [row for level in levels if level for row in level.get("vertices") or ()]
    return sum(map(_is_waypoint, rows)) > len(rows) / 2


def is_building(source: Source) -> bool:
    """Return whether a file has levels, and is no site of Open-RMF's newer editor."""
    is_known = {"levels", "format_version"}.intersection(source.yaml.content) == {"levels"}
    return is_known and not is_navigation_graph(source)


BUILDING = Format((".building.yaml", ".yaml", ".yml"), is_building, read_building)
NAVIGATION_GRAPH = Format((".yaml", ".yml"), is_navigation_graph, read_navigation_graph)
