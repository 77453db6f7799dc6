"""Route graphs: GeoJSON of points and directed lines, as the route server of Nav2 loads them."""

from __future__ import annotations

import json
import math
from collections import Counter
from itertools import count
from typing import Any

from botohe_moo._base.checks import as_float, quoted
from botohe_moo._plugins.checks import checked
from botohe_moo.mission.formats.nodelink import mission_content
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.hazards import Zone, read_zone
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import MissionError, read_label

_LINES = ("LineString", "MultiLineString")
_POLYGONS = ("Polygon", "MultiPolygon")
# How the ends of a line are named, and how they were by earlier versions of Nav2.
_ENDS = (("startid", "endid"), ("start_node", "end_node"))
# What Nav2 reads outside of ``metadata``, and its ids: integers from 0 to below this number.
_PROPERTIES = ("frame", "cost", "overridable", "operations")
_END_OF_IDS = 2**32
# Names of what has longitudes and latitudes; Nav2 reads all coordinates as they are.
_DEGREES = ("CRS84", "EPSG::4326", "EPSG:4326")
# What is written says so: then nothing is added when it is read.
_GENERATOR = {"generator": "botohe_moo"}


@checked
def read_route_graph(source: Source, *, geographic: bool | None = None) -> Draft:
    """Read GeoJSON whose points are nodes, and whose lines are arcs from one node to another.

    Points have the property ``id``, and lines ``startid`` and ``endid``; all other properties, and
    what ``metadata`` holds, become attributes. A point's label is its id, but for files that
    `write_route_graph` has numbered. An arc is as long as its ends are apart, unless it has a
    ``length``. What lacks a survival or a reward gets it as by `add_survivals` and `add_rewards`;
    polygons with a ``rate`` are zones. The member ``mission`` of the file may hold attributes of
    the graph: ``base``, ``robots`` and others.

    Of parallel arcs the safest one stays. The others, arcs from a node to itself, nodes that the
    base does not reach or that have no way back, and all other features are left out, and a warning
    names them. A MissionError names features that are wrong.

    References
    ----------
    ``nav2_route`` of ros-navigation/navigation2.
    """
    content = source.json
    features = content.get("features") if isinstance(content, dict) else None
    if not isinstance(features, list):
        found = quoted(content if features is None else features)
        raise MissionError(f'expected GeoJSON, an object with a list "features", got {found}')
    of_mission = content.get("mission", {})
    if not isinstance(of_mission, dict):
        raise MissionError(f'expected "mission" to be an object, got {quoted(of_mission)}')
    if geographic is not None:
        of_mission["geographic"] = geographic
    is_complete = content.items() >= _GENERATOR.items()
    nodes, arcs, zones, others = _entries(features, is_complete=is_complete)
    notes = []
    if "geographic" not in of_mission and any(name in str(content.get("crs")) for name in _DEGREES):
        notes.append(
            "The crs of the file is of degrees, but positions count as metres: give "
            "geographic=True if they are longitudes and latitudes."
        )
    left_out = {"features that are neither points, lines nor polygons with a rate": others}
    return Draft(
        nodes,
        arcs,
        of_mission,
        trim=True,
        words=("point", "line"),
        left_out=left_out,
        notes=notes,
        zones=zones,
        straight=not is_complete,
    )


def _entries(
    features: list[Any], *, is_complete: bool
) -> tuple[list[Row], list[Row], list[Zone], list[str]]:
    """Return nodes, arcs, zones, and what is none of them; a MissionError names what is wrong.

    In what is complete, ids of lines merely number them, and so may ids of points: then these have
    their label as a property.
    """
    nodes: list[Row] = []
    arcs: list[Row] = []
    zones, others, faults = [], [], []
    labels: dict[Any, Any] = {}  # of points with another label than their id
    for i, feature in enumerate(features):
        where = f"features[{i}]"
        try:
            shape = _object(_object(feature, "a feature").get("geometry") or {}, "geometry")
            given = _object(feature.get("properties") or {}, "properties")
            metadata = _object(given.pop("metadata", None) or {}, "metadata")
            kind, at = shape.get("type"), shape.get("coordinates")
            if kind == "Point":
                label = number = _label(given, "id")
                if is_complete and "label" in given:
                    label = labels[number] = _label(given, "label")
                place = {"pos": _position(at)}
                nodes.append(Row(where, (label,), {**given, **metadata, **place}))
            elif kind in _LINES:
                names = next((names for names in _ENDS if names[0] in given), _ENDS[0])
                ends = tuple(_label(given, name) for name in names)
                attributes = {**given, **metadata}
                if not is_complete and "id" in given:
                    attributes["id"] = as_whole(given["id"])
                elif is_complete and "id" not in metadata:
                    attributes.pop("id", None)
                if attributes.get("penalty") == _penalty(attributes.get("survival")):
                    attributes.pop("penalty", None)
                arcs.append(Row(where, ends, attributes))
            elif kind in _POLYGONS and "rate" in (known := {**given, **metadata}):
                polygons = at if kind == "MultiPolygon" and isinstance(at, list) else [at]
                zones += [read_zone({"polygon": one, "rate": known["rate"]}) for one in polygons]
            else:
                others.append(where)
        except ValueError as error:
            faults.append(f"{where}: {error}")
    if faults:
        raise MissionError(faults)
    for i, (where, ends, attributes) in enumerate(arcs):
        arcs[i] = Row(where, tuple(labels.get(end, end) for end in ends), attributes)
    return nodes, arcs, zones, others


def _object(value: object, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"expected {what} to be an object, got {quoted(value)}")
    return value


def _label(attributes: dict[str, Any], name: str) -> Any:
    if name not in attributes:
        raise ValueError(f'found no property "{name}"')
    label: Any = read_label(attributes.pop(name))
    return label if name == "label" else as_whole(label)


def as_whole(value: Any) -> Any:
    """Return a float without a fraction as an integer, anything else as it is."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _position(value: object) -> list[float]:
    place = [as_float(part) for part in value[:2]] if isinstance(value, list) else []
    if len(place) < 2 or not all(map(math.isfinite, place)):
        raise ValueError(f"expected coordinates [x, y], two finite numbers, got {quoted(value)}")
    return place


def _penalty(survival: object) -> float | None:
    """Return what Nav2 adds to the cost of a line, None where kinds have survivals of their own.

    A route that costs little is safe then: penalties add up to −ln of its survival.
    """
    chance = as_float(survival)
    return abs(math.log(chance)) if 0.0 < chance <= 1.0 else None


def write_route_graph(mission: Mission) -> bytes:
    """Write a mission as GeoJSON for Nav2; a ValueError names a node without a position."""
    return encoded(route_graph(mission_content(mission)))


def encoded(graph: dict[str, Any]) -> bytes:
    """Write a route graph as JSON, with a line for each feature."""
    written = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
    members = {key: value for key, value in graph.items() if key != "features"}
    head = written(members).removesuffix("}")
    listed = ",\n ".join(map(written, graph["features"]))
    return f'{head}, "features": [\n {listed}\n]}}\n'.encode()


def route_graph(content: dict[str, Any]) -> dict[str, Any]:
    """Return node-link data as GeoJSON: its nodes as points, then its arcs as lines.

    Ids are labels if all of these are integers that Nav2 can read; else points are numbered. Lines
    keep an ``id`` of their own that Nav2 can read and no other line has. They have a ``penalty``,
    with which its router prefers safe ways.
    """
    labels = [node["id"] for node in content["nodes"]]
    numbers = [label for label in labels if type(label) is int and 0 <= label < _END_OF_IDS]
    is_numbered = len(numbers) < len(labels)
    ids = range(1, len(labels) + 1) if is_numbered else labels
    id_of = {json.dumps(label): number for label, number in zip(labels, ids, strict=True)}
    features = []
    for node, number in zip(content["nodes"], ids, strict=True):
        label, place = node.pop("id"), node.pop("pos", None)
        if place is None:
            raise ValueError(f"node {quoted(label)}: expected pos [x, y] for GeoJSON, found none")
        properties = {"id": number, "label": label} if is_numbered else {"id": number}
        features.append(_feature("Point", place, properties, node, {}))
    places = {
        number: feature["geometry"]["coordinates"]
        for number, feature in zip(ids, features, strict=True)
    }
    own = [arc.get("id") for arc in content["edges"]]
    counts = Counter(each for each in own if type(each) is int and 0 <= each < _END_OF_IDS)
    others = count(max([*ids, *counts], default=0) + 1)
    for arc in content["edges"]:
        start, end = (id_of[json.dumps(arc.pop(key))] for key in ("source", "target"))
        penalty = _penalty(arc.get("survival"))
        number = arc.get("id")
        is_own = type(number) is int and counts[number] == 1
        properties = {"id": number if is_own else next(others), "startid": start, "endid": end}
        metadata = {} if penalty is None else {"penalty": penalty}
        line = [places[start], places[end]]
        features.append(_feature("LineString", line, properties, arc, metadata))
    members = {"type": "FeatureCollection", **_GENERATOR, "mission": content["graph"]}
    return {**members, "features": features}


def _feature(
    shape: str,
    coordinates: Any,
    properties: dict[str, Any],
    attributes: dict[str, Any],
    metadata: dict[str, Any],
) -> dict[str, Any]:
    """Return a feature; attributes that Nav2 does not know are in its metadata."""
    known = {key: attributes.pop(key) for key in _PROPERTIES if key in attributes}
    return {
        "type": "Feature",
        "properties": {**properties, **known, "metadata": {**attributes, **metadata}},
        "geometry": {"type": shape, "coordinates": coordinates},
    }


def is_route_graph(source: Source) -> bool:
    """Return whether a file holds features of GeoJSON."""
    content = source.json
    is_esri = isinstance(content, dict) and "geometryType" in content
    return not is_esri and isinstance(content.get("features"), list)


ROUTE_GRAPH = Format((".geojson", ".json"), is_route_graph, read_route_graph, write_route_graph)
