"""What is not in a file of a graph: survivals and rewards by maps of the site."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, quoted
from botohe_moo._base.types import FloatArray
from botohe_moo.mission.formats.nodelink import Entry
from botohe_moo.mission.hazards import Zone, in_cells, mean_along, read_zones, rewards_from_raster
from botohe_moo.mission.rules import MissionError

if TYPE_CHECKING:
    from botohe_moo.mission.formats.maps import Raster

_Path = str | os.PathLike[str]
_Places = Mapping[Any, Sequence[float]]


def add_survivals(
    places: _Places,
    arcs: Iterable[Entry],
    distance: Callable[[Any, Any], float] = math.dist,
    *,
    danger: float | None,
    hazard: _Path | None = None,
    danger_zones: object = (),
    zones: Sequence[Zone] = (),
) -> str:
    """Give arcs that have none a survival; return what there is to say of that, if anything.

    It is exp(−length · rate), with the mean rate of loss along the straight line between the nodes:
    ``danger``, or where there is a map ``hazard`` its shares times ``danger``, and the rates of
    zones, of ``danger_zones``, as a caller gives them, and ``zones``.
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
    share = (lambda *_: 1.0) if hazard is None else _share_of(hazard)
    for _, ends, arc in lacking:
        if all(end in places for end in ends):
            start, end = (np.array(places[end], float) for end in ends)
            rate = sum(zone.rate * zone.share(start, end - start) for zone in listed)
            if danger:
                rate += danger * share(start, end)
            length = as_float(arc.get("length", distance(start, end)))
            arc["survival"] = math.exp(min(0.0, -rate * length))
    if lacking or (danger is None and hazard is None and not listed):
        return ""
    return "All survivals are given: danger, hazard and danger zones change none."


def _share_of(hazard: _Path) -> Callable[[FloatArray, FloatArray], float]:
    """Return what gives the mean share of a map along a straight line."""
    values, resolution, origin, _ = _read(hazard)
    cells = values[::-1]

    def share(*ends: FloatArray) -> float:
        at = [in_cells(place, cells, resolution, origin) for place in ends]
        for place, where in zip(ends, at, strict=True):
            if np.isnan(where).any():
                x, y = place.tolist()
                raise MissionError(
                    f"{hazard}: expected a map of all arcs, found none of it at [{x:g}, {y:g}]"
                )
        return mean_along(cells, *at)

    return share


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
        graph: nx.DiGraph[Any] = nx.DiGraph()
        graph.add_nodes_from((node, {"pos": place}) for node, place in places.items())
        by_map = rewards_from_raster(
            graph, values, resolution=resolution, origin=origin, radius=sight, scale=reward
        )
    for _, (label,), node in nodes:
        node.setdefault("reward", 0.0 if label == base else by_map.get(label, reward))


def _read(path: _Path) -> Raster:
    """Read a map; its faults are part of those of the file that is read with it."""
    # Imported late: it takes time, and most missions need no images.
    from botohe_moo.mission.formats.maps import read_raster

    try:
        return read_raster(path)
    except MissionError as error:
        raise MissionError([f"{error.source}: {fault}" for fault in error.faults]) from None
