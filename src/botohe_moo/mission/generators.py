"""Seeded random missions: the same arguments give the same mission.

Numbers have a few decimal places only, so that the last bits in which platforms differ never show,
and mission files stay readable. Passages lead both ways. The base, node 0 unless said otherwise,
has no reward.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, NamedTuple, TypeAlias

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo._base.checks import ParameterError
from botohe_moo._base.types import FloatArray, OffsetArray, Rng
from botohe_moo._base.words import counted
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Positive, Robots
from botohe_moo.mission.formats.benchmark import (
    benchmark_graph,
    near_pairs,
    nearest_pairs,
    spanning_pairs,
)
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import Kind

Nodes: TypeAlias = Annotated[int, Field(ge=2, description="Number of nodes.")]
Seed: TypeAlias = Annotated[int, Field(ge=0, description="Seed of the random numbers.")]
ArcProbability: TypeAlias = Annotated[
    float,
    Field(gt=0, le=1, description="Probability that there is a passage between two nodes."),
]

Depots: TypeAlias = Annotated[int, Field(ge=0, description="Number of depots beside the base.")]

_DIGITS = 4
_SURVIVALS = (10**-_DIGITS, 1)  # the least and the greatest that is drawn
_DRAWS = 1000  # of a graph, until it is connected

# The longest passage between two waypoints, in units of 1 / √n. With it, waypoints have as many
# arcs on average as those of terrain_200.
_REACH = 1.51


@checked
def two_communities(*, seed: Seed = 0, robots: Robots = 2) -> Mission:
    """A poor community of 12 nodes and a rich one of 8, hardly connected, beside the base.

    Passages have probability 0.4 and 0.3 within the communities, and 0.025 between them. Rewards
    are normal(1, 0.5) and normal(5, 2), truncated to at least 0; survivals, the same both ways, are
    normal(0.9, 0.3), truncated to (0, 1]. What is out of range is drawn again, not moved to the
    bound. The first node of each community is tied to the base by a passage of survival 1. Passages
    are drawn again until they connect all nodes: there are about 82 arcs. The node attribute
    ``zone`` tells the communities.

    References
    ----------
    The third case of Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a
    robot team orienteering in a hazardous environment", 2025: a stochastic block model.
    """
    rng = np.random.default_rng(seed)
    poor, rich = 12, 8
    block = np.repeat([0, 1, 2], [1, poor, rich])
    probability = np.array([[0, 0, 0], [0, 0.4, 0.025], [0, 0.025, 0.3]])[block[:, None], block]
    probability[0, [1, 1 + poor]] = 1
    pairs = _connected_pairs(rng, probability)
    rewards = [_truncated(rng, 1, 0.5, poor), _truncated(rng, 5, 2, rich)]
    survivals = _truncated(rng, 0.9, 0.3, len(pairs), *_SURVIVALS)
    survivals[pairs[:, 0] == 0] = 1
    title = f"Two communities, seed {seed}"
    graph: nx.DiGraph[Any] = nx.DiGraph(name="two_communities", title=title, base=0, robots=robots)
    zones = np.array(["base", "community 1", "community 2"])[block].tolist()
    graph.add_nodes_from((node, {"zone": zone}) for node, zone in enumerate(zones))
    return _mission(
        graph,
        np.concatenate([[0], *rewards]),
        np.concatenate([[[0.5, 0]], _circle(poor, 0.2, 0.2), _circle(rich, 0.8, 0.2)]),
        pairs,
        np.column_stack([survivals, survivals]),
    )


@checked
def random(
    *,
    nodes: Nodes = 20,
    arc_probability: ArcProbability = 0.3,
    robots: Robots = 3,
    seed: Seed = 0,
) -> Mission:
    """An Erdős–Rényi graph, drawn again until it is connected.

    Survivals are uniform in (0, 1), each way its own, and rewards 0.1 + uniform in [0, 1). Where
    none of 1000 graphs is connected, ``arc_probability`` is refused.
    """
    rng = np.random.default_rng(seed)
    pairs = _connected_pairs(rng, np.full((nodes, nodes), arc_probability))
    if not len(pairs):
        usual = 1.5 * math.log(nodes) / nodes
        message = (
            f"Expected an arc_probability that connects {nodes} nodes, got {arc_probability}: "
            f"none of {_DRAWS} graphs was connected; most are above {usual:.2g}."
        )
        raise ParameterError(message, "arc_probability")
    steps = 10**_DIGITS
    title = f"Random graph of {nodes} nodes, arc probability {arc_probability:g}, seed {seed}"
    return _mission(
        nx.DiGraph(name="random", title=title, base=0, robots=robots),
        np.round(0.1 + rng.integers(0, steps, nodes) / steps, _DIGITS),
        _circle(nodes, 0.5, 0.5),
        pairs,
        rng.integers(1, steps, (len(pairs), 2)) / steps,
    )


@checked
def complete(*, nodes: Nodes = 25, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """A graph with all arcs, its rewards and survivals drawn at random.

    Rewards are normal(1, 1), truncated to at least 0, and survivals, each way its own,
    normal(0.75, 0.2), truncated to (0, 1]; what is out of range is drawn again.
    """
    rng = np.random.default_rng(seed)
    pairs = np.column_stack(np.triu_indices(nodes, 1))
    title = f"Complete graph of {nodes} nodes, seed {seed}"
    return _mission(
        nx.DiGraph(name="complete", title=title, base=0, robots=robots),
        _truncated(rng, 1, 1, nodes),
        _circle(nodes, 0.5, 0.5),
        pairs,
        _truncated(rng, 0.75, 0.2, 2 * len(pairs), *_SURVIVALS).reshape(-1, 2),
    )


@checked
def terrain(
    *, nodes: Nodes = 200, robots: Robots = 5, depots: Depots = 0, seed: Seed = 0
) -> Mission:
    """Waypoints in the unit square, with passages between near ones, like ``terrain_200``.

    A random geometric graph whose waypoints have about 6.7 neighbours, whatever their number; where
    it falls apart, passages between the nearest waypoints of its parts join them. Survivals are
    uniform in [0.9, 0.995], each way its own, and rewards uniform in [0, 1). The base is the
    waypoint nearest to the centre. If there are depots, which are drawn, rewards count on return
    to one of these or the base.
    """
    if depots >= nodes:
        message = f"Expected depots <= {nodes - 1}, the nodes beside the base, got {depots}."
        raise ParameterError(message, "depots")
    rng = np.random.default_rng(seed)
    positions = np.round(rng.random((nodes, 2)), 6)
    # The spanning tree's long edges are the ones that join the parts, shortest first.
    near = near_pairs(positions, _REACH / math.sqrt(nodes))
    pairs = np.array(sorted({*near, *spanning_pairs(positions)}))
    size = f"{nodes} waypoints" + (f", {counted(depots, 'depot')}" if depots else "")
    title = f"Rolling terrain: {size}, random geometric graph, seed {seed}"
    base = int(((positions - 0.5) ** 2).sum(axis=1).argmin())
    mission = _mission(
        nx.DiGraph(name="terrain", title=title, base=base, robots=robots),
        np.round(rng.random(nodes), 3),
        positions,
        pairs,
        np.round(0.9 + 0.095 * rng.random((len(pairs), 2)), _DIGITS),
    )
    if not depots:
        return mission
    graph = mission.graph.copy()
    drawn = rng.permutation(nodes)
    for node in drawn[drawn != base][:depots].tolist():
        graph.nodes[node]["depot"] = True
    return Mission(graph, pays="return")


@checked
def tunnel(*, nodes: Nodes = 45, robots: Robots = 3, seed: Seed = 0) -> Mission:
    """Tunnels of an old mine: few junctions, long loops, and rewards nearly everywhere.

    The shortest passages that join all places in a square of 400 m, and a sixth as many more as
    there are places, drawn from those that lead to one of the four nearest. Survival falls by a
    factor of e every 500 m, alike both ways, and rewards are 0, 0.15, 0.3, 0.5 or 1.
    """
    rng = np.random.default_rng(seed)
    positions = np.round(400 * rng.random((nodes, 2)), 1)
    tree = spanning_pairs(positions)
    near = sorted({*nearest_pairs(positions, min(4, nodes - 1))} - {*tree})
    further = [near[i] for i in rng.permutation(len(near))[: nodes // 6].tolist()]
    pairs = np.array(sorted({*tree, *further}))
    lengths = np.hypot(*(positions[pairs[:, 0]] - positions[pairs[:, 1]]).T)
    survivals = np.round(np.exp(-lengths / 500), _DIGITS)
    title = f"Tunnels with {nodes} places, seed {seed}"
    return _mission(
        nx.DiGraph(name="tunnel", title=title, base=0, robots=robots),
        rng.choice([0.0, 0.15, 0.3, 0.5, 1.0], nodes),
        positions,
        pairs,
        np.column_stack([survivals, survivals]),
    )


def _connected_pairs(rng: Rng, probability: FloatArray) -> OffsetArray:
    """Draw pairs of nodes, each with its probability (n, n), until they connect all nodes.

    Returns them in shape (n_pairs, 2), the lower node first; none if no draw was connected.
    """
    tails, heads = np.triu_indices(len(probability), 1)
    for _ in range(_DRAWS):
        drawn = rng.random(len(tails)) < probability[tails, heads]
        pairs = np.column_stack([tails[drawn], heads[drawn]])
        if len(np.unique(pairs)) == len(probability) and nx.is_connected(nx.Graph(pairs.tolist())):
            return pairs
    return np.empty((0, 2), np.int64)


def _truncated(
    rng: Rng, mean: float, deviation: float, size: int, low: float = 0, high: float = math.inf
) -> FloatArray:
    """Draw ``size`` normal numbers, and those outside [low, high] again."""
    values = np.empty(0)
    while len(values) < size:
        drawn = np.round(mean + deviation * rng.standard_normal(size - len(values)), _DIGITS)
        values = np.concatenate([values, drawn[(low <= drawn) & (drawn <= high)]])
    return values


def _circle(nodes: int, x: float, radius: float) -> FloatArray:
    """Spread nodes evenly on a circle around (x, 0.5): their positions (nodes, 2)."""
    angles = 2 * np.pi * np.arange(nodes) / nodes
    circle = np.column_stack([x + radius * np.cos(angles), 0.5 + radius * np.sin(angles)])
    return np.round(circle, _DIGITS)


def _mission(
    graph: nx.DiGraph[Any],
    rewards: FloatArray,
    positions: FloatArray,
    pairs: OffsetArray,
    survivals: FloatArray,
) -> Mission:
    """Make a mission of a graph without arcs.

    Its nodes get rewards (n) and positions (n, 2), and each of the pairs of nodes (m, 2) an arc
    each way with its survival (m, 2).
    """
    base = graph.graph["base"]
    for node, (reward, position) in enumerate(
        zip(rewards.tolist(), positions.tolist(), strict=True)
    ):
        graph.add_node(node, reward=0.0 if node == base else reward, pos=position)
    for (tail, head), (there, back) in zip(pairs.tolist(), survivals.tolist(), strict=True):
        graph.add_edge(tail, head, survival=there)
        graph.add_edge(head, tail, survival=back)
    return Mission(graph)


Streets: TypeAlias = Annotated[
    int, Field(ge=2, multiple_of=2, description="Number of streets each way, an even number.")
]
Side: TypeAlias = Annotated[int, Field(ge=2, description="Number of nodes along a side.")]
Floors: TypeAlias = Annotated[int, Field(ge=1, description="Number of floors.")]
Doors: TypeAlias = Annotated[int, Field(ge=1, description="Number of rooms each side a corridor.")]
Wheeled: TypeAlias = Annotated[
    int, Field(ge=0, description="How many of the robots cannot take stairs.")
]
Tour: TypeAlias = Annotated[
    Positive, Field(description="Travel budget of the team, as a share of a tour of all nodes.")
]

_DIGITS = 4
_BLOCK = 100  # metres from one street to the next
_HALL = 5  # metres along a corridor from one door to the next
_TOUR = 0.7124  # see `orienteering`


@checked
def lattice(*, rows: Side = 5, columns: Side = 13, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """A square lattice on which every node pays 1, so that E[R] is the expected number of visits.

    That is the objective of the team surviving orienteers. Survivals are uniform in [0.9, 1),
    alike both ways. The base, a corner, has no reward.

    References
    ----------
    Jorgensen, Chen, Milam and Pavone, "The team surviving orienteers problem: routing teams of
    robots in uncertain environments with survival constraints", Autonomous Robots 42, 2018.
    """
    drawn = _Drawn("lattice", f"Lattice of {rows} x {columns} nodes, seed {seed}", robots, seed)
    for row in range(rows):
        for column in range(columns):
            drawn.node((row, column), 1.0, (column, row))
    for one, other in nx.grid_2d_graph(rows, columns).edges:
        drawn.both(one, other, 0.9, 1)
    return drawn.mission((0, 0))


@checked
def town(*, streets: Streets = 8, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """The crossings of one-way streets, each of which leads the other way than the last.

    Rewards are uniform in [0.1, 1), survivals in [0.9, 1). The base is a corner.
    """
    title = f"Town of {streets} x {streets} one-way streets, seed {seed}"
    drawn = _Drawn("town", title, robots, seed)
    for x in range(streets):
        for y in range(streets):
            drawn.node((x, y), drawn.uniform(0.1, 1), (_BLOCK * x, _BLOCK * y))
    for street in range(streets):
        along = [(street, i) for i in range(streets)][:: 1 if street % 2 else -1]
        across = [(i, street) for i in range(streets)][:: -1 if street % 2 else 1]
        for way in (along, across):
            for tail, head in pairwise(way):
                drawn.arc(tail, head, drawn.uniform(0.9, 1))
    return drawn.mission((0, 0))


@checked
def building(
    *,
    floors: Floors = 3,
    doors: Doors = 6,
    robots: Robots = 3,
    wheeled: Wheeled = 0,
    seed: Seed = 0,
) -> Mission:
    """Floors with a corridor between two rows of rooms, and stairs at both of its ends.

    There are ``3 * doors`` nodes a floor: a place in the corridor for each pair of doors, and the
    rooms. A third of the neighbouring rooms are connected, too. Rooms have rewards uniform in
    [0.2, 1), more the higher they are, corridors none. Survivals are uniform in [0.97, 1) along
    corridors, [0.9, 0.99) through doors, and [0.92, 0.97) on stairs, alike both ways. The base is
    the middle of the corridor on the ground floor. If some robots are wheeled, there are two kinds,
    ``walking`` and ``wheeled``, which survive alike; the second cannot take the stairs.
    """
    if wheeled and wheeled >= robots:
        raise ParameterError(
            f"Expected wheeled to be fewer than all {counted(robots, 'robot')}, got {wheeled}.",
            "wheeled",
        )
    title = f"Building of {counted(floors, 'floor')} with {2 * doors} rooms each, seed {seed}"
    drawn = _Drawn("building", title, robots, seed)
    ends = sorted({0, doors - 1})
    for floor in range(floors):
        up = 4 * _HALL * floor
        for i in range(doors):
            drawn.node((floor, "hall", i), 0.0, (_HALL * i, up), zone=f"floor {floor}")
            for side, y in (("left", up - _HALL), ("right", up + _HALL)):
                reward = drawn.uniform(0.2, 1) * (1 + floor / 2)
                drawn.node((floor, side, i), reward, (_HALL * i, y), zone=f"floor {floor}")
                drawn.both((floor, "hall", i), (floor, side, i), 0.9, 0.99)
        for i in range(doors - 1):
            drawn.both((floor, "hall", i), (floor, "hall", i + 1), 0.97, 1)
            for side in ("left", "right"):
                if drawn.rng.random() < 1 / 3:
                    drawn.both((floor, side, i), (floor, side, i + 1), 0.9, 0.99)
        for i in ends if floor else ():
            survival: Any = drawn.uniform(0.92, 0.97)
            if wheeled:
                survival = {"walking": survival, "wheeled": 0.0}
            drawn.arc((floor - 1, "hall", i), (floor, "hall", i), survival)
            drawn.arc((floor, "hall", i), (floor - 1, "hall", i), survival)
    kinds = [Kind("walking", robots - wheeled), Kind("wheeled", wheeled)] if wheeled else None
    return drawn.mission((0, "hall", doors // 2), kinds)


@checked
def orienteering(
    *, nodes: Nodes = 32, robots: Robots = 2, tour: Tour = 0.5, seed: Seed = 0
) -> Mission:
    """Team orienteering: points in a square, an arc from each to every other, a travel budget.

    Points are uniform in a square of side 100, and scores integers from 1 to 20. All robots
    together may travel ``tour`` of the usual length of a shortest tour of all points, 0.7124
    times the root of their number times the area (Beardwood, Halton and Hammersley, 1959). Arcs
    are as long as their points are apart; survival falls by a factor of e with each 100.

    References
    ----------
    Chao, Golden and Wasil, "The team orienteering problem", European Journal of Operational
    Research 88(3), 1996.
    """
    rng = np.random.default_rng(seed)
    table = np.column_stack([np.round(100 * rng.random((nodes, 2)), 1), rng.integers(1, 21, nodes)])
    table[0, 2] = 0
    budget = round(tour * _TOUR * 100 * math.sqrt(nodes) / robots, 1)
    graph = benchmark_graph(robots, budget, table, neighbours="all", scale=100)
    for _, _, arc in graph.edges(data=True):  # the last bits of exp differ between platforms
        arc.update({name: round(arc[name], _DIGITS) for name in ("survival", "length")})
    title = f"Orienteering with {nodes} points, budget {budget:g}, seed {seed}"
    graph.graph.update(name="orienteering", title=title)
    return Mission(graph)


class _Drawn:
    """A mission that is being drawn, whose nodes are known by places and numbered from 0."""

    def __init__(self, name: str, title: str, robots: int, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self._graph: nx.DiGraph[Any] = nx.DiGraph(name=name, title=title, robots=robots)
        self._numbers: dict[Any, int] = {}

    def uniform(self, low: float, high: float) -> float:
        """Draw a number in [low, high) with four decimal places."""
        steps = 10**_DIGITS
        return float(self.rng.integers(round(low * steps), round(high * steps)) / steps)

    def node(self, place: Any, reward: float, pos: tuple[float, float], **said: Any) -> None:
        """Add a node."""
        number = self._numbers[place] = len(self._numbers)
        self._graph.add_node(number, reward=round(reward, _DIGITS), pos=list(pos), **said)

    def arc(self, tail: Any, head: Any, survival: Any) -> None:
        """Add an arc."""
        self._graph.add_edge(self._numbers[tail], self._numbers[head], survival=survival)

    def both(self, one: Any, other: Any, low: float, high: float) -> None:
        """Add an arc each way, of the same survival, which is drawn."""
        survival = self.uniform(low, high)
        self.arc(one, other, survival)
        self.arc(other, one, survival)

    def mission(self, base: Any, kinds: Sequence[Kind] | None = None) -> Mission:
        """Return the mission, whose base has no reward."""
        self._graph.graph["base"] = number = self._numbers[base]
        self._graph.nodes[number]["reward"] = 0.0
        return Mission(self._graph, kinds=kinds)


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
_PASSAGES: dict[str, tuple[_Range, _Range | None]] = {
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
        drone, rover = _PASSAGES[way]
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
