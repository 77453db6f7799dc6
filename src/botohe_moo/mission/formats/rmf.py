"""Both formats of Open-RMF: buildings of its traffic editor, and navigation graphs made of them."""

from __future__ import annotations

import cmath
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, permutations
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, BeforeValidator, Field, model_validator

from botohe_moo.base.files import read_flag
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import checked, validated
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.rules import MissionError

_GAP = 0.05  # metres from the cabin of a lift to its shaft
_STOREY = 4.0  # metres from a level to the next one where elevations are not known
# Of the ellipsoid of WGS 84: its radius at the equator in metres, and its squared eccentricity.
_EQUATOR, _ECCENTRICITY = 6_378_137.0, (2.0 - 1 / 298.257223563) / 298.257223563
_EMPTY: tuple[Any, ...] = (None, [])  # how no parameters, no lanes and the like may be written

_Frame: TypeAlias = Callable[[float, float], complex]  # makes metres, x + iy, of a place on a level


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


def _padded(row: Any, length: int = 3) -> Any:
    """Return a row, such as a lane [tail, head, {…}], with None for what is left out at its end."""
    return row + [None] * (length - len(row)) if isinstance(row, list) else row


def _as_vertex(row: Any) -> Any:
    """Return a vertex as [x, y, z, name, {…}]; a waypoint has its name among its parameters."""
    is_waypoint = _is_waypoint(row)
    return [*row[:2], None, (row[2] or {}).get("name"), row[2]] if is_waypoint else _padded(row, 5)


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
    lanes: list[Annotated[tuple[_Index, _Index, _LaneTraits], BeforeValidator(_padded)]] = []
    measurements: list[tuple[_Index, _Index, _MeasurementTraits]] = []
    fiducials: list[tuple[_Number, _Number, _Text]] = []


class _Lift(_Part):
    x: _Number
    y: _Number
    width: _Number
    depth: _Number
    yaw: _Number = 0.0
    reference_floor_name: _Text = ""
    level_doors: dict[str, Any] = {}

    def has(self, way: complex) -> bool:
        """Return whether a place is within the cabin, given the way to it from the centre."""
        way *= cmath.rect(1.0, -self.yaw)
        return abs(way.real) <= self.width / 2 + _GAP and abs(way.imag) <= self.depth / 2 + _GAP


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
    return _draft(source, validated(source.yaml.content, _Site, source.yaml.line), base, graph)


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
    site = validated(source.yaml.content, _Graph, source.yaml.line)
    is_stacked = any(level.elevation is None for level in site.levels.values())
    for i, level in enumerate(site.levels.values() if is_stacked else ()):
        level.elevation = _STOREY * i
    draft = _draft(source, site, base, "all")
    if is_stacked and any(row.where.startswith("lift ") for row in draft.arcs):
        order = ", ".join(site.levels)
        draft.notes.append(f"Without elevations, levels count as {_STOREY:g} m apart: {order}.")
    draft.graph |= {"title": site.building_name} if site.building_name else {}
    return draft


def _entries(source: Source, site: _Site, kind: str) -> Iterator[tuple[str, str, int, Any]]:
    """Yield the line, the level, the index and the content of all lanes, vertices or the like."""
    for name, level in site.levels.items():
        for i, entry in enumerate(getattr(level, kind)):
            yield f"line {source.yaml.line(['levels', name, kind, i])}", name, i, entry


def _draft(source: Source, site: _Site, base: Any, graph: int | str | None) -> Draft:
    """Return the nodes and arcs of a site: those of one of its graphs, or of all of them."""
    frames, notes = _frames(source, site)
    vertices: dict[str, Row] = {}  # by level and index
    for where, level, i, (x, y, _, name, traits) in _entries(source, site, "vertices"):
        at = frames[level](x, y)
        own = {"name": name, "zone": level, "pos": [at.real, at.imag]}
        vertices[f"{level}/{i}"] = Row(where, (), {**traits.model_extra, **own})
    key, value = ("is_charger", True) if base is None else ("name", str(base))
    meant = {spot for spot, row in vertices.items() if value in (spot, row.attributes.get(key))}
    by_graph = _lanes(source, site)
    if graph is None:
        at_base = (n for n, rows in by_graph.items() for row in rows if meant & {*row.labels})
        graph = min(at_base, default=min(by_graph, default=0))
    lanes = [row for n in [*by_graph] if graph in ("all", n) for row in by_graph.pop(n)]
    if not lanes:
        raise MissionError(f"expected lanes of graph {graph}, found graphs {sorted(by_graph)}")
    left_out = {f"lanes of graph {n}": [r.where for r in rows] for n, rows in by_graph.items()}
    names = {spot: row.attributes["name"] for spot, row in vertices.items()}
    touched = {spot for row in lanes for spot in row.labels}
    unused = [quoted(name) for spot, name in names.items() if name and spot not in touched]
    left_out["named waypoints without a lane"] = unused
    vertices = {spot: row for spot, row in vertices.items() if spot in touched}
    counts = Counter([names[spot] for spot in vertices] + 2 * ["", *names])
    labels = {spot: names[spot] if counts[names[spot]] == 1 else spot for spot in vertices}
    bases = [spot for spot in vertices if spot in meant] if base is None else [str(base)]
    if not bases:
        raise MissionError("expected base, found no vertex with is_charger on a lane: give base")
    base = labels.get(bases[0], base)
    if len(bases) > 1:
        notes.append(f"The base is {quoted(base)}, the first of {len(bases)} chargers.")
    rides = list(_rides(site, frames, vertices))
    joining = {row.where for row in rides}
    left_out["lifts that join no levels"] = [n for n in site.lifts if f"lift {n}" not in joining]
    for spot, label in labels.items():
        if names[spot] in ("", label):
            del vertices[spot].attributes["name"]
    nodes = [Row(where, (labels[spot],), of) for spot, (where, _, of) in vertices.items()]
    arcs = [Row(where, tuple(map(labels.get, ends, ends)), of) for where, ends, of in lanes + rides]
    return Draft(nodes, arcs, {"base": base}, foreign=True, left_out=left_out, notes=notes)


def _lanes(source: Source, site: _Site) -> dict[int, list[Row]]:
    """Return the lanes of each graph, between vertices by level and index."""
    by_graph: dict[int, list[Row]] = {}
    for where, level, _, (tail, head, traits) in _entries(source, site, "lanes"):
        attributes = traits.model_extra if isinstance(site, _Graph) else {}
        ends = (f"{level}/{tail}", f"{level}/{head}")
        for way in [ends, ends[::-1]][: 1 + bool(read_flag(traits.bidirectional))]:
            by_graph.setdefault(traits.graph_idx, []).append(Row(where, way, attributes))
    return by_graph


def _rides(site: _Site, frames: Mapping[str, _Frame], vertices: Mapping[str, Row]) -> Iterator[Row]:
    """Yield an arc between each two levels of a lift, as long as one is above the other.

    It stops where it has doors, or everywhere if it has none: at vertices that name it, and at
    those within its cabin.
    """
    centres = {n: frames[of.reference_floor_name](of.x, of.y) for n, of in site.lifts.items()}
    stops: dict[str, list[str]] = {}
    for spot, (_, _, traits) in vertices.items():
        at = complex(*traits["pos"])
        within = (name for name, lift in site.lifts.items() if lift.has(at - centres[name]))
        cabin = str(traits.get("lift_cabin") or traits.get("lift") or next(within, ""))
        doors = site.lifts[cabin].level_doors if cabin in site.lifts else {}
        if cabin and (doors.get(traits["zone"]) or not any(doors.values())):
            stops.setdefault(cabin, []).append(spot)
    for name, spots in stops.items():
        for ends in permutations(spots, 2):
            levels = {vertices[spot].attributes["zone"] for spot in ends}
            if len(levels) == 2:
                low, high = sorted(site.levels[level].elevation or 0.0 for level in levels)
                yield Row(f"lift {name}", ends, {"length": high - low})


def _frames(source: Source, site: _Site) -> tuple[dict[str, _Frame], list[str]]:
    """Return what makes metres of places on each level, and notes on what is missing.

    ``""`` stands for the reference level. On a drawing y points down, so the complex number
    p = x − iy is a place there, in pixels. In metres, it is scaled by s and turned counterclockwise
    by θ::

        drawing of a level, in pixels                 all levels, in metres

          +-------> x                                   y
          |   A                                         ^      B
          |      .        s exp(iθ) (p − c) + s₀ c₀     |    .
          |         B       --------------------->      |  A
          v y                                           +----------> x

    The reference level has θ = 0, c = c₀ = 0, and the scale s = s₀ of its measurements. Another
    level has fiducials, such as A and B, at pⱼ that the reference level has at rⱼ. Then

        c = mean(pⱼ), c₀ = mean(rⱼ)
        s = s₀ / mean(|pⱼ − pₖ| / |rⱼ − rₖ|)
        θ = −arg Σ exp(i (arg(pⱼ − pₖ) − arg(rⱼ − rₖ)))

    over all fiducials, and over all pairs of them. A level without two of them lies as it is drawn.

    References
    ----------
    ``Transform.set_from_fiducials`` in ``rmf_building_map_tools`` of open-rmf/rmf_traffic_editor.
    """
    floors = {site.reference_level_name, *(n.reference_floor_name for n in site.lifts.values())}
    if unknown := floors - {"", *site.levels}:
        found = sorted(unknown)
        raise MissionError(f"expected reference levels among {[*site.levels]}, got {found}")
    if site.coordinate_system != "reference_image":
        places = (vertex[:2] for level in site.levels.values() for vertex in level.vertices)
        frame = _around(*next(places, (0.0, 0.0))) if site.coordinate_system == "wgs84" else complex
        return dict.fromkeys(("", *site.levels), frame), []
    reference = site.reference_level_name or next(iter(site.levels))
    there = {name: complex(x, -y) for x, y, name in site.levels[reference].fiducials}
    scales, notes = _scales(source, site), []
    if reference not in scales:
        notes.append(f"Level {reference} has no measurements: its pixels count as metres.")
    scale = scales.get(reference, 1.0)
    frames = {"": _drawn(scale), reference: _drawn(scale)}
    for name in [name for name in site.levels if name not in frames]:
        level = site.levels[name]
        shared = [(complex(x, -y), there[of]) for x, y, of in level.fiducials if of in there]
        frames[name] = _aligned(shared, scale) or _drawn(scales.get(name, scale))
        if level.lanes and len(shared) < 2:
            notes.append(f"Level {name} lies as drawn: it has no two fiducials of {reference}.")
    return frames, notes


def _scales(source: Source, site: _Site) -> dict[str, float]:
    """Return how many metres a pixel is on each level that has measurements, by their mean."""
    scales: dict[str, list[float]] = {}
    for where, level, _, (*ends, traits) in _entries(source, site, "measurements"):
        try:
            places = [site.levels[level].vertices[end][:2] for end in ends]
            scales.setdefault(level, []).append(traits.distance / math.dist(*places))
        except (IndexError, ZeroDivisionError):
            expected = f"a measurement between two places of level {level}"
            raise MissionError(f"{where}: expected {expected}, got vertices {ends}") from None
    return {level: math.fsum(found) / len(found) for level, found in scales.items()}


def _drawn(turn: complex, origin: complex = 0j, shift: complex = 0j) -> _Frame:
    return lambda x, y: turn * (complex(x, -y) - origin) + shift


def _aligned(shared: Sequence[tuple[complex, complex]], scale: float) -> _Frame | None:
    """Return the frame of fiducials, given with their places on the reference level."""
    ways = [(p - q, r - s) for (p, r), (q, s) in combinations(shared, 2) if p != q and r != s]
    if not ways:
        return None
    ratio = sum(abs(p) / abs(r) for p, r in ways) / len(ways)
    turns = sum(cmath.rect(1.0, cmath.phase(p) - cmath.phase(r)) for p, r in ways)
    here, there = (sum(places) / len(shared) for places in zip(*shared, strict=True))
    return _drawn(cmath.rect(scale / ratio, -cmath.phase(turns)), here, scale * there)


def _around(longitude: float, latitude: float) -> _Frame:
    """Return what makes metres east and north of a place of longitudes and latitudes."""
    root = math.sqrt(1.0 - _ECCENTRICITY * math.sin(math.radians(latitude)) ** 2)
    east = math.radians(1.0) * _EQUATOR / root * math.cos(math.radians(latitude))
    north = math.radians(1.0) * _EQUATOR * (1.0 - _ECCENTRICITY) / root**3
    return lambda x, y: complex(east * (x - longitude), north * (y - latitude))


def is_navigation_graph(source: Source) -> bool:
    """Return whether most vertices of a file are waypoints."""
    levels = source.yaml.content["levels"].values()
    rows = [row for level in levels if level for row in level.get("vertices") or ()]
    return sum(map(_is_waypoint, rows)) > len(rows) / 2


def is_building(source: Source) -> bool:
    """Return whether a file has levels, and is no site of Open-RMF's newer editor."""
    return "format_version" not in source.yaml.content and not is_navigation_graph(source)


BUILDING = Format((".building.yaml", ".yaml", ".yml"), is_building, read_building)
NAVIGATION_GRAPH = Format((".yaml", ".yml"), is_navigation_graph, read_navigation_graph)
