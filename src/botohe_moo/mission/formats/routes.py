"""Route graphs: GeoJSON of points and directed lines, as the route server of Nav2 loads them."""

from __future__ import annotations

import math
from collections import Counter
from itertools import count
from typing import Any, TypeAlias

from botohe_moo.base.messages import as_float, quoted
from botohe_moo.base.parameters import checked
from botohe_moo.mission.formats.graphs import as_json, mission_content
from botohe_moo.mission.formats.reading import Draft, Format, Row, Source
from botohe_moo.mission.hazards import read_zone
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import MissionError, read_label

_Object: TypeAlias = dict[str, Any]  # of JSON

# The generator of files that are complete: no lengths are added when they are read. Features have a
# member of this name for attributes that Nav2 cannot read; it would refuse the whole file.
_OURS = "botohe_moo"
_IDS = ("id", "startid", "endid")
# Types of the properties that Nav2 reads, apart from ids and ``metadata``.
_TYPES: Any = {"frame": str, "cost": int | float, "overridable": bool, "operations": list | dict}
_DEGREES = ("CRS84", "EPSG::4326", "EPSG:4326")


@checked
def read_route_graph(source: Source, *, geographic: bool | None = None) -> Draft:
    """Read GeoJSON whose points are nodes, and whose lines are arcs from one node to another.

    Points have the property ``id``, and lines ``startid`` and ``endid``; all other properties, and
    what ``metadata`` holds, become attributes. A point's label is its id, but for files that
    `write_route_graph` has numbered. An arc is as long as its ends are apart, unless it has a
    ``length``. Polygons with a ``rate`` are danger zones. The member ``mission`` of the file may
    hold attributes of the graph: ``base``, ``robots`` and others.

    All other features are left out. A MissionError names features that are wrong.

    References
    ----------
    ``nav2_route`` of ros-navigation/navigation2.
    """
    content = source.json
    features = content.get("features") if isinstance(content, dict) else None
    if not isinstance(features, list):
        raise MissionError(f"expected GeoJSON with a list of features, got {quoted(content)}")
    is_ours = content.get("generator") == _OURS
    graph = {**_object(content.get("mission"), "mission")}
    draft = Draft([], [], graph, foreign=not is_ours)
    if geographic is not None:
        graph["geographic"] = geographic
    if "geographic" not in graph and any(name in str(content.get("crs")) for name in _DEGREES):
        draft.notes.append("Positions count as metres: give geographic=True if the crs is right.")
    labels: dict[Any, Any] = {}  # of points, by their ids
    others = []
    for i, feature in enumerate(features):
        where = f"features[{i}]"
        try:
            shape, at, ids, attributes = _parts(feature, (*_IDS, "label") if is_ours else _IDS)
            if shape == "Point":
                label = labels[ids["id"]] = ids.get("label", ids["id"])
                attributes["pos"] = at[:2] if isinstance(at, list) else str(at)
                draft.nodes.append(Row(where, (label,), attributes))
            elif shape in ("LineString", "MultiLineString"):
                if "id" in ids and not is_ours:
                    attributes["id"] = ids["id"]
                draft.arcs.append(Row(where, (ids["startid"], ids["endid"]), attributes))
            elif shape in ("Polygon", "MultiPolygon") and "rate" in attributes:
                polygons = at if shape == "MultiPolygon" and isinstance(at, list) else [at]
                zones = [read_zone({**attributes, "polygon": one}) for one in polygons]
                draft.zones = [*draft.zones, *zones]
            else:
                others.append(where)
        except KeyError as name:
            draft.faults.append(f"{where}: expected a property {name}, found none")
        except ValueError as error:
            draft.faults.append(f"{where}: {error}")
    draft.left_out = {"features that are neither points, lines nor polygons with a rate": others}
    draft.arcs = [Row(at, tuple(map(labels.get, ends, ends)), of) for at, ends, of in draft.arcs]
    return draft


def _parts(feature: Any, names: tuple[str, ...]) -> tuple[Any, Any, _Object, _Object]:
    """Return shape, coordinates, ids and attributes of a feature; ``names`` are those of ids."""
    feature = _object(feature, "a feature")
    geometry = _object(feature.get("geometry"), "geometry")
    given = {**_object(feature.get("properties"), "properties")}
    metadata = {**_object(given.pop("metadata", None), "metadata")}
    if metadata.get("penalty") == _penalty(given | metadata).get("penalty"):
        metadata.pop("penalty", None)  # what is written for Nav2
    ids = {name: _label(given.pop(name)) for name in names if given.get(name) is not None}
    attributes = given | metadata | _object(feature.get(_OURS), _OURS)
    return geometry.get("type"), geometry.get("coordinates"), ids, attributes


def _object(value: Any, what: str) -> _Object:
    """Return a JSON object, an empty one for null; a ValueError says that ``what`` is none."""
    if not isinstance(value or {}, dict):
        raise ValueError(f"expected {what} to be an object, got {quoted(value)}")
    return value or {}


def _label(value: Any) -> Any:
    """Return a label, which is an integer if it is a float without a fraction."""
    label = read_label(value)
    return int(label) if isinstance(label, float) and label.is_integer() else label


def _penalty(attributes: _Object) -> _Object:
    """Return the attribute −ln survival, none if each kind of robots has its own.

    Nav2 adds it to the cost of a line, so that cheap routes are safe.
    """
    chance = as_float(attributes.get("survival"))
    return {"penalty": abs(math.log(chance))} if 0.0 < chance <= 1.0 else {}


def write_route_graph(mission: Mission) -> bytes:
    """Write a mission as GeoJSON for Nav2: nodes as points, then arcs as lines, in their order.

    Ids are labels if all of these are integers that Nav2 can read; else points are numbered. Lines
    keep an ``id`` that Nav2 can read and no other feature has. They have a ``penalty``, with which
    its router prefers safe ways. A ValueError names a node without a position.
    """
    content = mission_content(mission)
    nodes, arcs = content["nodes"], content["edges"]
    labels = [node.pop("id") for node in nodes]
    ids = labels if all(map(_is_id, labels)) else range(1, len(labels) + 1)
    ends, features = {}, []
    for key, label, number, node in zip(mission.nodes, labels, ids, nodes, strict=True):
        place = node.pop("pos", None)
        if place is None:
            raise ValueError(f"node {quoted(label)}: expected pos [x, y] for GeoJSON, found none")
        ends[key] = number, place
        properties = {"id": number} if ids is labels else {"id": number, "label": label}
        features.append(_feature("Point", place, properties, node))
    used = Counter(filter(_is_id, [*ids, *(arc.get("id") for arc in arcs)]))
    free = count(max(used) + 1)
    for (tail, head), arc in zip(mission.graph.edges, arcs, strict=True):
        del arc["source"], arc["target"]
        (start, one), (end, other), number = ends[tail], ends[head], arc.get("id")
        number = number if _is_id(number) and used[number] == 1 else next(free)
        properties = {"id": number, "startid": start, "endid": end}
        features.append(_feature("LineString", [one, other], properties, arc))
    members = {"type": "FeatureCollection", "generator": _OURS, "mission": content["graph"]}
    start, lines = as_json(members).removesuffix("}"), ",\n ".join(map(as_json, features))
    return f'{start}, "features": [\n {lines}\n]}}\n'.encode()


def _is_id(value: object) -> bool:
    """Return whether Nav2 reads an id; with 2³¹ − 1 it marks deleted nodes."""
    return type(value) is int and 0 <= value < 2**31 - 1


def _feature(shape: str, at: Any, ids: _Object, rest: _Object) -> _Object:
    """Return a feature; Nav2 reads all attributes in ``rest`` that have types it knows."""
    added = _penalty(rest) if shape == "LineString" else {}
    known = {k: rest.pop(k) for k in [*rest] if isinstance(rest[k], _TYPES.get(k, ()))}
    hidden = {k: rest.pop(k) for k in [*rest] if k in added or not _is_readable(rest[k])}
    properties = {**ids, **known, "metadata": rest | added}
    geometry = {"type": shape, "coordinates": at}
    feature = {"type": "Feature", "properties": properties, "geometry": geometry}
    return feature | {_OURS: hidden} if hidden else feature


def _is_readable(value: Any) -> bool:
    """Return whether Nav2 reads a value of metadata: not null, nor a list of lists or objects."""
    if isinstance(value, dict):
        return all(map(_is_readable, value.values()))
    listed = value if isinstance(value, list) else [value]
    return all(isinstance(one, str | int | float) for one in listed)


def is_route_graph(source: Source) -> bool:
    """Return whether a file holds features of GeoJSON, not of ArcGIS."""
    return isinstance(source.json.get("features"), list) and "geometryType" not in source.json


ROUTE_GRAPH = Format((".geojson", ".json"), is_route_graph, read_route_graph, write_route_graph)
