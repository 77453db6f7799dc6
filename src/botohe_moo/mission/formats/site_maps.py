"""What is not in a file of a graph: survivals and rewards by maps of the site."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import networkx as nx

from botohe_moo._base.checks import as_float, quoted
from botohe_moo.mission.formats.nodelink import Entry
from botohe_moo.mission.hazards import rewards_from_raster, survival_from_raster
from botohe_moo.mission.validation import MissionError
from botohe_moo.mission.zones import Zone, read_zones, zone_survivals

if TYPE_CHECKING:
    from botohe_moo.mission.formats.rasters import Raster

_Path = str | os.PathLike[str]
_Places = Mapping[Any, Sequence[float]]


def add_survivals(
    places: _Places,
    arcs: Iterable[Entry],
    *,
    danger: float | None,
    hazard: _Path | None = None,
    danger_zones: object = (),
    zones: Sequence[Zone] = (),
) -> None:
    """Give arcs that have none a survival: exp(−the integral of the rate of loss).

    The rate is ``danger`` along the length of the arc, or where there is a map ``hazard`` its
    shares times ``danger``, and that of zones: ``danger_zones``, as a caller gives them, and
    ``zones``. Maps and zones count along the straight line between the nodes.
    """
    lacking = [arc for arc in arcs if "survival" not in arc[2] and arc[1][0] != arc[1][1]]
    if not isinstance(danger_zones, list | tuple):
        raise MissionError(f"expected danger_zones to be a list, got {quoted(danger_zones)}")
    listed = [*zones, *read_zones(danger_zones, "danger_zones")]
    if lacking and danger is None and (hazard is not None or not listed):
        raise MissionError(
            f"{lacking[0][0]}: expected a survival, found none ({len(lacking)} without one): give "
            "danger, the rate of loss for a unit of length"
        )
    rate = danger or 0.0
    known = [(ends, arc) for _, ends, arc in lacking if all(end in places for end in ends)]
    graph = _graph(places, (end for ends, _ in known for end in ends))
    graph.add_edges_from(ends for ends, _ in known)
    by_zones = zone_survivals(graph, listed) if listed else {}
    by_map = {}
    if hazard is not None:
        values, resolution, origin, _ = _read(hazard)
        by_map = survival_from_raster(
            graph, values, resolution=resolution, origin=origin, scale=rate
        )
    for ends, arc in known:
        length = as_float(arc.get("length", math.dist(*(places[end] for end in ends))))
        survival = by_map.get(ends, math.exp(min(0.0, -rate * length)))
        arc["survival"] = survival * by_zones.get(ends, 1.0)


def add_rewards(
    places: _Places,
    nodes: Iterable[Entry],
    *,
    base: Any,
    reward: float,
    interest: _Path | None = None,
    sight: float | None = None,
) -> None:
    """Give nodes that have none a ``reward``, or what is seen from them; that of the base is 0.

    On the map ``interest`` they see as far as ``sight``; a unit of area is worth ``reward`` times
    its share. Cells that are nearest to the base count for no node.
    """
    by_map = {}
    if (interest is None) != (sight is None):
        raise MissionError("expected interest, a map, and sight, how far robots see on it, or none")
    if interest is not None and sight is not None:
        values, resolution, origin, _ = _read(interest)
        graph = _graph(places, places)
        by_map = rewards_from_raster(
            graph, values, resolution=resolution, origin=origin, radius=sight, scale=reward
        )
    for _, (label,), node in nodes:
        node.setdefault("reward", 0.0 if label == base else by_map.get(label, reward))


def _graph(places: _Places, nodes: Iterable[Any]) -> nx.DiGraph[Any]:
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.add_nodes_from((node, {"pos": places[node]}) for node in nodes)
    return graph


def _read(path: _Path) -> Raster:
    """Read a map; its faults are part of those of the file that is read with it."""
    # Imported late: it takes time, and most missions need no images.
    from botohe_moo.mission.formats.rasters import read_raster

    try:
        return read_raster(path)
    except MissionError as error:
        raise MissionError([f"{error.source}: {fault}" for fault in error.faults]) from None
