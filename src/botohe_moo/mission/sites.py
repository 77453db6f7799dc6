"""A generated site with kinds of robots, each of which can do what the other cannot."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, TypeAlias

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo._base.types import Rng
from botohe_moo._plugins.checks import checked
from botohe_moo.mission.generators import Seed
from botohe_moo.mission.kinds import Kind
from botohe_moo.mission.model import Mission

Drones: TypeAlias = Annotated[int, Field(ge=1, description="Number of drones.")]
Rovers: TypeAlias = Annotated[int, Field(ge=1, description="Number of rovers.")]

_Range: TypeAlias = tuple[float, float]


class _Zone(NamedTuple):
    """Places on a grid, each of which is worth a photo or a sample."""

    columns: int
    rows: int
    corner: tuple[int, int]  # position of the first place, in metres
    way: str  # what passages between its places are like
    photo: _Range = (0, 0)  # least and greatest reward
    sample: _Range = (0, 0)
    n_samples: int = 0
    # The probability that a drone takes them.
    photo_share: float = 1
    sample_share: float = 0


_SPACING, _JITTER = 12, 2.5  # metres between places, and how far each is moved from its grid
_ZONES = {
    "gate": _Zone(1, 1, (-14, 12), "ground"),
    "yard": _Zone(4, 3, (0, 0), "ground", (0.5, 2), (3, 6), 3),
    "lab": _Zone(4, 2, (52, 0), "indoors", (1, 3), (4, 8), 4, photo_share=0.5),
    "office": _Zone(3, 2, (58, 30), "indoors", (2, 5), (3, 6), 2, sample_share=0.5),
    "roof": _Zone(1, 1, (70, 62), "air"),
    "basin": _Zone(3, 2, (6, 42), "water", (1, 3), (3, 6), 3, sample_share=0.5),
}
_LINKS = [
    ("gate", "yard 2", "ground"),
    ("yard 10", "lab 1", "ground"),
    ("yard 12", "lab 2", "ground"),
    ("lab 4", "office 1", "stairs"),
    ("lab 8", "office 5", "stairs"),
    ("office 4", "roof", "stairs"),
    ("yard 3", "basin 1", "water"),
    ("yard 9", "basin 5", "water"),
    ("basin 6", "roof", "air"),
    ("yard 12", "roof", "air"),
]
# What a drone and a rover survive of a passage, at least and at most; rovers take some not at all.
_SURVIVALS: dict[str, tuple[_Range, _Range | None]] = {
    "ground": ((0.95, 0.98), (0.98, 0.998)),
    "indoors": ((0.90, 0.95), (0.96, 0.99)),
    "stairs": ((0.90, 0.95), None),
    "water": ((0.95, 0.98), None),
    "air": ((0.96, 0.99), None),
}


@checked
def drones_and_rovers(*, drones: Drones = 2, rovers: Rovers = 2, seed: Seed = 0) -> Mission:
    """A flooded plant: drones fly over stairs and water, rovers open doors and carry samples.

    34 places and 102 arcs: a yard, a basin, a lab on the ground floor, an office above it, and the
    roof. Drones start and land on the roof, which is a depot, and fly 250 metres at most; rovers
    start at the gate, the base. Drones are lost more easily than rovers, which take neither stairs
    nor water. Each place is worth a photo, which pays on arrival, or a sample, which pays on
    return. A drone gets half of the photos in the lab, behind doors, and half of the samples in the
    office and the basin, but cannot lift those in the yard and the lab. Positions, rewards, where
    samples are, and survivals are drawn at random.
    """
    rng = np.random.default_rng(seed)
    title = f"Drones and rovers at a flooded plant, seed {seed}"
    graph: nx.DiGraph[Any] = nx.DiGraph(name="drones_and_rovers", title=title, base="gate")
    passages = [link for name, zone in _ZONES.items() for link in _add_zone(graph, rng, name, zone)]
    for tail, head, way in passages + _LINKS:
        drone, rover = _SURVIVALS[way]
        survival = {"drone": _drawn(rng, drone, 4), "rover": _drawn(rng, rover or (0, 0), 4)}
        length = round(math.dist(graph.nodes[tail]["pos"], graph.nodes[head]["pos"]), 1)
        for arc in ((tail, head), (head, tail)):
            graph.add_edge(*arc, survival=survival, length=length, way=way)
    graph.nodes["roof"]["depot"] = True
    flying = Kind("drone", drones, start="roof", end="roof", max_length=250)
    return Mission(graph, kinds=[flying, Kind("rover", rovers)])


def _add_zone(
    graph: nx.DiGraph[Any], rng: Rng, name: str, zone: _Zone
) -> list[tuple[str, str, str]]:
    """Add the places of a zone, and return the passages between them."""
    cells = [(x, y) for x in range(zone.columns) for y in range(zone.rows)]
    labels = [f"{name} {i}" for i in range(1, len(cells) + 1)] if len(cells) > 1 else [name]
    samples = set(rng.choice(len(cells), zone.n_samples, replace=False).tolist())
    moved = rng.uniform(-_JITTER, _JITTER, (len(cells), 2))
    for i, (label, cell) in enumerate(zip(labels, cells, strict=True)):
        place = np.round(np.add(zone.corner, np.multiply(cell, _SPACING)) + moved[i], 1)
        is_sample = i in samples
        reward = _drawn(rng, zone.sample if is_sample else zone.photo, 1)
        graph.add_node(label, reward=reward, pos=place.tolist())
        if len(cells) > 1:
            graph.nodes[label]["zone"] = name
        share = zone.sample_share if is_sample else zone.photo_share
        if share < 1:
            graph.nodes[label]["share"] = {"drone": share}
        if is_sample:
            graph.nodes[label]["pays"] = "return"
    near = nx.grid_2d_graph(zone.columns, zone.rows).edges
    label_of = dict(zip(cells, labels, strict=True))
    return [(label_of[one], label_of[other], zone.way) for one, other in near]


def _drawn(rng: Rng, bounds: _Range, digits: int) -> float:
    """Draw a number between bounds, with a few decimal places."""
    return round(float(rng.uniform(*bounds)), digits)
