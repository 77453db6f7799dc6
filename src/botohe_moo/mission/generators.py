"""Seeded random missions: the same arguments give the same mission.

Numbers are rounded to a few decimal places: platforms differ in the last bits only, and mission
files stay readable. Passages lead both ways. The base, node 0 unless said otherwise, has no reward.
"""

from __future__ import annotations

import json
import math
from collections.abc import Hashable
from itertools import combinations, pairwise
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo.base.messages import ParameterError, counted
from botohe_moo.base.parameters import Count, Positive, Robots, Size, checked
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.mission.formats import benchmark
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import Kind

ArcProbability: TypeAlias = Annotated[float, Field(gt=0, le=1)]
Natural: TypeAlias = Annotated[int, Field(ge=0)]
Seed: TypeAlias = Natural
Nodes: TypeAlias = Annotated[int, Field(ge=2)]  # of a mission, or along a side
Places: TypeAlias = Annotated[int, Field(ge=12)]
Streets: TypeAlias = Annotated[int, Field(ge=2, multiple_of=2)]

_DIGITS = 4  # decimal places of most numbers
_STEPS = 10**_DIGITS
_LEAST = 1 / _STEPS  # the lowest survival that is drawn
_DRAWS = 1000  # at most, until a graph is connected
_JITTER = 2.5  # metres by which places of the plant are moved at most, each way
_PLANT = Path(__file__).parent / "data" / "flooded_plant.json"
_HAZARDS = (0.7, 0.75, 0.85, 0.9)  # survivals of dangerous passages
_HALL = 5  # metres along a corridor from one door to the next


class _Drawing:
    """A mission that is being drawn: its graph, and the random numbers of its seed."""

    def __init__(self, name: str, title: str, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.graph: nx.DiGraph[Any] = nx.DiGraph(name=name, title=f"{title}, seed {seed}")

    def uniform(self, low: float, high: float, *size: int) -> Any:
        """Draw a number in [low, high) with four decimal places, or an array of ``size``."""
        drawn = self.rng.integers(round(low * _STEPS), round(high * _STEPS), size) / _STEPS
        return drawn if size else float(drawn)

    def normal(
        self, mean: float, deviation: float, size: int, low: float = 0, high: float = math.inf
    ) -> FloatArray:
        """Draw normal numbers (size,); those outside [low, high] are drawn again."""
        values = np.empty(0)
        while len(values) < size:
            drawn = np.round(self.rng.normal(mean, deviation, size - len(values)), _DIGITS)
            values = np.concatenate([values, drawn[(low <= drawn) & (drawn <= high)]])
        return values

    def connected_pairs(self, probability: FloatArray) -> OffsetArray:
        """Draw pairs of nodes, each with its probability (n, n), until they connect all n nodes.

        Return them (n_pairs, 2), the lower node first, or no pairs if no draw was connected.
        """
        tails, heads = np.triu_indices(len(probability), 1)
        for _ in range(_DRAWS):
            drawn = self.rng.random(len(tails)) < probability[tails, heads]
            pairs = np.column_stack([tails[drawn], heads[drawn]])
            graph: nx.Graph[int] = nx.Graph(pairs.tolist())
            if len(graph) == len(probability) and nx.is_connected(graph):
                return pairs
        return np.empty((0, 2), np.int64)

    def nodes(self, **columns: Any) -> None:
        """Add nodes 0, 1, …; each column is an array that holds one attribute of all nodes."""
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        self.graph.add_nodes_from(enumerate(dict(zip(columns, row, strict=True)) for row in rows))

    def passage(self, one: Hashable, other: Hashable, *survival: Any, **more: Any) -> None:
        """Add an arc each way, with one survival for both, or one there and one back.

        Both arcs get ``more`` attributes.
        """
        self.graph.add_edge(one, other, survival=survival[0], **more)
        self.graph.add_edge(other, one, survival=survival[-1], **more)

    def passages(self, pairs: OffsetArray, survivals: FloatArray) -> None:
        """Add a passage for each of the pairs (n, 2), with survivals (n,) or (n, 2)."""
        survivals = survivals.reshape(len(pairs), -1)
        for pair, survival in zip(pairs.tolist(), survivals.tolist(), strict=True):
            self.passage(*pair, *survival)

    def mission(self, *, kinds: Any = None, pays: str | None = None, **attributes: Any) -> Mission:
        """Make the mission, whose files list the attributes of its graph in the order given."""
        self.graph.graph.update(attributes)
        self.graph.nodes[attributes["base"]]["reward"] = 0.0
        return Mission(self.graph, kinds=kinds, pays=pays)


@checked
def two_communities(*, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """A poor community of 12 nodes and a rich one of 8, hardly connected, beside the base.

    Passages have probability 0.4 and 0.3 within the communities, and 0.025 between them. Rewards
    are normal(1, 0.5) and normal(5, 2), truncated to at least 0. Survivals are normal(0.9, 0.3),
    truncated to (0, 1], and the same both ways. A number out of its range is drawn again, not moved
    to the bound. The first node of each community is tied to the base by a passage of survival 1.
    Passages are drawn again until they connect all nodes: there are about 82 arcs. The node
    attribute ``zone`` tells the communities.

    Parameters
    ----------
    robots
        Team size.
    seed
        Seed of the random numbers.

    References
    ----------
    The third case of Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a
    robot team orienteering in a hazardous environment", 2025: a stochastic block model.
    """
    drawing = _Drawing("two_communities", "Two communities", seed)
    poor, rich = 12, 8
    block = np.repeat([0, 1, 2], [1, poor, rich])
    probability = np.array([[0, 0, 0], [0, 0.4, 0.025], [0, 0.025, 0.3]])[block[:, None], block]
    probability[0, [1, 1 + poor]] = 1
    pairs = drawing.connected_pairs(probability)
    drawing.nodes(
        zone=np.array(["base", "community 1", "community 2"])[block],
        reward=np.concatenate([[0], drawing.normal(1, 0.5, poor), drawing.normal(5, 2, rich)]),
        pos=np.concatenate([[[0.5, 0]], _circle(poor, 0.2, 0.2), _circle(rich, 0.8, 0.2)]),
    )
    survivals = drawing.normal(0.9, 0.3, len(pairs), _LEAST, 1)
    survivals[pairs[:, 0] == 0] = 1
    drawing.passages(pairs, survivals)
    return drawing.mission(base=0, robots=robots)


@checked
def random(
    *, nodes: Nodes = 20, arc_probability: ArcProbability = 0.3, robots: Robots = 3, seed: Seed = 0
) -> Mission:
    """An Erdős–Rényi graph, drawn again until it is connected.

    Survivals are uniform in (0, 1), each way its own, and rewards 0.1 + uniform in [0, 1). Where
    none of 1000 graphs is connected, ``arc_probability`` is refused.

    Parameters
    ----------
    nodes
        Number of nodes.
    arc_probability
        Probability that there is a passage between two nodes.
    robots
        Team size.
    seed
        Seed of the random numbers.
    """
    title = f"Random graph of {nodes} nodes, arc probability {arc_probability:g}"
    drawing = _Drawing("random", title, seed)
    pairs = drawing.connected_pairs(np.full((nodes, nodes), arc_probability))
    if not len(pairs):
        expected = f"arc_probability > {1.5 * math.log(nodes) / nodes:.2g} for {nodes} nodes"
        raise ParameterError(f"Expected {expected}, got {arc_probability}.", "arc_probability")
    drawing.nodes(reward=drawing.uniform(0.1, 1.1, nodes), pos=_circle(nodes, 0.5, 0.5))
    drawing.passages(pairs, drawing.uniform(_LEAST, 1, len(pairs), 2))
    return drawing.mission(base=0, robots=robots)


@checked
def complete(*, nodes: Nodes = 25, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """A graph with all arcs, its rewards and survivals drawn at random.

    Rewards are normal(1, 1), truncated to at least 0. Survivals, each way its own, are
    normal(0.75, 0.2), truncated to (0, 1]. A number out of its range is drawn again.

    Parameters
    ----------
    nodes
        Number of nodes.
    robots
        Team size.
    seed
        Seed of the random numbers.
    """
    drawing = _Drawing("complete", f"Complete graph of {nodes} nodes", seed)
    pairs = np.column_stack(np.triu_indices(nodes, 1))
    drawing.nodes(reward=drawing.normal(1, 1, nodes), pos=_circle(nodes, 0.5, 0.5))
    drawing.passages(pairs, drawing.normal(0.75, 0.2, 2 * len(pairs), _LEAST, 1).reshape(-1, 2))
    return drawing.mission(base=0, robots=robots)


@checked
def terrain(
    *, nodes: Nodes = 200, robots: Robots = 5, depots: Natural = 0, seed: Seed = 0
) -> Mission:
    """Waypoints in the unit square, with passages between near ones, like ``terrain_200``.

    A random geometric graph: waypoints have about 6.7 neighbours, however many they are. Where it
    falls apart, passages between the nearest waypoints of its parts join them. Survivals are
    uniform in [0.9, 0.995], each way its own, and rewards uniform in [0, 1). The base is the
    waypoint nearest to the centre. Depots are drawn among the others. If there are any, rewards
    count when a robot returns to one of them or to the base.

    Parameters
    ----------
    nodes
        Number of nodes.
    robots
        Team size.
    depots
        Number of depots beside the base.
    seed
        Seed of the random numbers.
    """
    from scipy.spatial import KDTree

    if depots >= nodes:
        raise ParameterError(f"Expected depots < {nodes} nodes, got {depots}.", "depots")
    size = f"{nodes} waypoints" + (f", {counted(depots, 'depot')}" if depots else "")
    drawing = _Drawing("terrain", f"Rolling terrain: {size}, random geometric graph", seed)
    rng = drawing.rng
    positions = np.round(rng.random((nodes, 2)), 6)
    # Within 1.51 / √n, waypoints have as many neighbours on average as those of terrain_200. The
    # long edges of the spanning tree join the parts.
    near = KDTree(positions).query_pairs(1.51 / math.sqrt(nodes))
    pairs = np.array(sorted(near.union(benchmark.spanning_pairs(positions))))
    drawing.nodes(reward=np.round(rng.random(nodes), 3), pos=positions)
    drawing.passages(pairs, np.round(0.9 + 0.095 * rng.random((len(pairs), 2)), _DIGITS))
    base = int(((positions - 0.5) ** 2).sum(axis=1).argmin())
    drawn = rng.permutation(nodes)
    drawing.graph.add_nodes_from(drawn[drawn != base][:depots].tolist(), depot=True)
    return drawing.mission(base=base, robots=robots, pays="return" if depots else None)


@checked
def tunnel(*, nodes: Nodes = 45, robots: Robots = 3, seed: Seed = 0) -> Mission:
    """Tunnels of an old mine: few junctions, long loops, and rewards nearly everywhere.

    The shortest passages that join all places in a square of 400 m, and one more for every six
    places, drawn from passages to one of the four nearest places. Survival falls by a factor of e
    every 500 m, alike both ways. Rewards are 0, 0.15, 0.3, 0.5 or 1.

    Parameters
    ----------
    nodes
        Number of nodes.
    robots
        Team size.
    seed
        Seed of the random numbers.
    """
    drawing = _Drawing("tunnel", f"Tunnels with {nodes} places", seed)
    rng = drawing.rng
    positions = np.round(400 * rng.random((nodes, 2)), 1)
    tree = benchmark.spanning_pairs(positions)
    near = sorted({*benchmark.nearest_pairs(positions, min(4, nodes - 1))} - {*tree})
    further = [near[i] for i in rng.permutation(len(near))[: nodes // 6].tolist()]
    pairs = np.array(sorted({*tree, *further}))
    lengths = np.hypot(*(positions[pairs[:, 0]] - positions[pairs[:, 1]]).T)
    drawing.nodes(reward=rng.choice([0.0, 0.15, 0.3, 0.5, 1.0], nodes), pos=positions)
    drawing.passages(pairs, np.round(np.exp(-lengths / 500), _DIGITS))
    return drawing.mission(base=0, robots=robots)


@checked
def rooms(
    *,
    nodes: Places = 80,
    robots: Robots = 3,
    dead_ends: Annotated[float, Field(ge=0, le=0.8)] = 0.5,
    loops: Natural = 4,
    seed: Seed = 0,
) -> Mission:
    """A building with one entrance: corridors with few loops, and rooms that are dead ends.

    Passages have a median of 10 m, and most are safe: survival falls by a factor of e every 500 m.
    Six of a hundred are dangerous, with a factor of 0.7 to 0.9. Rewards are 0, 0.15, 0.3, 0.5 or 1.

    Parameters
    ----------
    nodes
        Number of nodes.
    robots
        Team size.
    dead_ends
        Share of the nodes that are rooms, in [0, 0.8]. They crowd at junctions.
    loops
        Passages that close loops; fewer if there is no room for them.
    seed
        Seed of the random numbers.
    """
    drawing = _Drawing("rooms", f"Corridors and rooms with {nodes} places", seed)
    return _grown(drawing, nodes, robots, 1, dead_ends, loops, 0.5, (10, 0.8), 0.06)


@checked
def mine(*, nodes: Places = 50, robots: Robots = 3, loops: Natural = 7, seed: Seed = 0) -> Mission:
    """A mine behind one long entrance: the loops begin after six passages.

    Passages have a median of 28 m. Survival falls by a factor of e every 500 m. Rewards are 0,
    0.15, 0.3, 0.5 or 1.

    Parameters
    ----------
    nodes
        Number of nodes.
    robots
        Team size.
    loops
        Passages that close loops; fewer if there is no room for them.
    seed
        Seed of the random numbers.
    """
    drawing = _Drawing("mine", f"A mine with {nodes} places", seed)
    return _grown(drawing, nodes, robots, 6, 0.2, loops, 0.0, (28, 0.6), 0.0)


def _grown(
    drawing: _Drawing,
    nodes: int,
    robots: int,
    entrance: int,
    dead_ends: float,
    loops: int,
    crowding: float,
    length: tuple[float, float],
    dangerous: float,
) -> Mission:
    """Grow corridors from the base: ``entrance`` passages in a row, branches, dead ends, loops.

    ``length`` is the median of a passage, and the deviation of its logarithm.
    """
    rng, end = drawing.rng, nodes - round(dead_ends * (nodes - entrance))
    before = [0]
    for node in range(1, nodes):
        if node < end:
            goes_on = node <= entrance or rng.random() < 0.6
            before.append(node - 1 if goes_on else int(rng.integers(max(entrance, node - 6), node)))
            continue
        # To a corridor, or rather to its junctions.
        degree = np.bincount(before, minlength=nodes)[entrance:end] - 0.5
        weight = np.maximum(degree, 0.0) / max(np.maximum(degree, 0.0).sum(), 1e-9)
        weight = crowding * weight + (1 - crowding) / (end - entrance)
        before.append(entrance + int(rng.choice(end - entrance, p=weight / weight.sum())))
    pairs = {(tail, head): None for head, tail in enumerate(before) if head > 0}
    for _ in range(_DRAWS):
        if len(pairs) >= nodes - 1 + loops:
            break
        tail = int(rng.integers(entrance, end - 2))
        pairs.setdefault((tail, min(end - 1, tail + int(rng.integers(2, 7)))))
    lengths = np.round(length[0] * np.exp(rng.normal(0, length[1], len(pairs))), 1)
    angles, pos = 2 * np.pi * rng.random(nodes), np.zeros((nodes, 2))
    for node, metres in zip(range(1, nodes), lengths.tolist(), strict=False):
        step = metres * np.array([np.cos(angles[node]), np.sin(angles[node])])
        pos[node] = np.round(pos[before[node]] + step, 1)
    hazards = np.where(rng.random(len(pairs)) < dangerous, rng.choice(_HAZARDS, len(pairs)), 1.0)
    drawing.nodes(reward=rng.choice([0.0, 0.15, 0.3, 0.5, 1.0], nodes), pos=pos)
    drawing.passages(np.array([*pairs]), np.round(np.exp(-lengths / 500) * hazards, _DIGITS))
    return drawing.mission(base=0, robots=robots)


@checked
def lattice(*, rows: Nodes = 5, columns: Nodes = 13, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """A square lattice on which every node pays 1, so that E[R] is the expected number of visits.

    That is the objective of the team surviving orienteers. Survivals are uniform in [0.9, 1),
    alike both ways. The base, a corner, has no reward.

    Parameters
    ----------
    rows, columns
        Number of nodes along a side.
    robots
        Team size.
    seed
        Seed of the random numbers.

    References
    ----------
    Jorgensen, Chen, Milam and Pavone, "The team surviving orienteers problem: routing teams of
    robots in uncertain environments with survival constraints", Autonomous Robots 42, 2018.
    """
    drawing = _Drawing("lattice", f"Lattice of {rows} x {columns} nodes", seed)
    grid = nx.grid_2d_graph(rows, columns)
    cells, neighbours = grid.nodes, nx.convert_node_labels_to_integers(grid).edges
    drawing.nodes(reward=np.ones(len(cells)), pos=np.array(cells)[:, ::-1])
    drawing.passages(np.array(neighbours), drawing.uniform(0.9, 1, len(neighbours)))
    return drawing.mission(robots=robots, base=0)


@checked
def town(*, streets: Streets = 8, robots: Robots = 2, seed: Seed = 0) -> Mission:
    """The crossings of one-way streets, each of which leads the other way than the last.

    Rewards are uniform in [0.1, 1), survivals in [0.9, 1). The base is a corner.

    Parameters
    ----------
    streets
        Number of streets each way, an even number.
    robots
        Team size.
    seed
        Seed of the random numbers.
    """
    drawing = _Drawing("town", f"Town of {streets} x {streets} one-way streets", seed)
    cells = np.array([*np.ndindex(streets, streets)])
    drawing.nodes(reward=drawing.uniform(0.1, 1, len(cells)), pos=100 * cells)
    crossings = np.arange(len(cells)).reshape(streets, streets)
    for street in range(streets):
        way = 1 if street % 2 else -1
        for line in (crossings[street, ::way], crossings[::-way, street]):
            for tail, head in pairwise(line.tolist()):
                drawing.graph.add_edge(tail, head, survival=drawing.uniform(0.9, 1))
    return drawing.mission(robots=robots, base=0)


@checked
def building(
    *, floors: Size = 3, doors: Size = 6, robots: Robots = 3, wheeled: Natural = 0, seed: Seed = 0
) -> Mission:
    """Floors with a corridor between two rows of rooms, and stairs at both of its ends.

    There are ``3 * doors`` nodes a floor: a place in the corridor for each pair of doors, and the
    rooms. A third of the neighbouring rooms are connected, too. Rewards of rooms are uniform in
    [0.2, 1), and half as much more on each higher floor. Corridors have none. Survivals are uniform
    in [0.97, 1) along corridors, [0.9, 0.99) through doors, and [0.92, 0.97) on stairs, alike both
    ways. The base is the middle of the corridor on the ground floor. If some robots are wheeled,
    there are two kinds, ``walking`` and ``wheeled``. They survive alike, but wheeled robots cannot
    take stairs.

    Parameters
    ----------
    floors
        Number of floors.
    doors
        Number of rooms each side a corridor.
    robots
        Team size.
    wheeled
        How many of the robots cannot take stairs.
    seed
        Seed of the random numbers.
    """
    if wheeled >= robots:
        raise ParameterError(f"Expected wheeled < {robots} robots, got {wheeled}.", "wheeled")
    title = f"Building of {counted(floors, 'floor')} with {2 * doors} rooms each"
    drawing = _Drawing("building", title, seed)
    graph, uniform, passage = drawing.graph, drawing.uniform, drawing.passage
    for floor in range(floors):
        zone, up = f"floor {floor}", 4 * _HALL * floor
        # A place in the corridor is followed by the rooms at its left and right.
        halls = range(3 * doors * floor, 3 * doors * (floor + 1), 3)
        for i, hall in enumerate(halls):
            graph.add_node(hall, reward=0.0, pos=[_HALL * i, up], zone=zone)
            for room, y in ((hall + 1, up - _HALL), (hall + 2, up + _HALL)):
                reward = round(uniform(0.2, 1) * (1 + floor / 2), _DIGITS)
                graph.add_node(room, reward=reward, pos=[_HALL * i, y], zone=zone)
                passage(hall, room, uniform(0.9, 0.99))
        for hall in halls[:-1]:
            passage(hall, hall + 3, uniform(0.97, 1))
            for room in (hall + 1, hall + 2):
                if drawing.rng.random() < 1 / 3:
                    passage(room, room + 3, uniform(0.9, 0.99))
        for hall in sorted({halls[0], halls[-1]}) if floor else ():
            survival = uniform(0.92, 0.97)
            by_kind = {"walking": survival, "wheeled": 0.0}
            passage(hall - 3 * doors, hall, by_kind if wheeled else survival)
    kinds = [Kind("walking", robots - wheeled), Kind("wheeled", wheeled)] if wheeled else None
    return drawing.mission(robots=robots, base=3 * (doors // 2), kinds=kinds)


@checked
def orienteering(
    *, nodes: Nodes = 32, robots: Robots = 2, tour: Positive = 0.5, seed: Seed = 0
) -> Mission:
    """Team orienteering: points in a square, an arc from each to every other, a travel budget.

    Points are uniform in a square of side 100, and scores integers from 1 to 20. All robots
    together may travel ``tour`` times the usual length of a shortest tour of n points in an area
    A, 0.7124 √(n A) (Beardwood, Halton and Hammersley, 1959). Arcs are as long as their points are
    apart; survival falls by a factor of e with each 100.

    Parameters
    ----------
    nodes
        Number of nodes.
    robots
        Team size.
    tour
        Travel budget of the team, as a share of a tour of all nodes.
    seed
        Seed of the random numbers.

    References
    ----------
    Chao, Golden and Wasil, "The team orienteering problem", European Journal of Operational
    Research 88(3), 1996.
    """
    budget = round(tour * 0.7124 * 100 * math.sqrt(nodes) / robots, 1)
    title = f"Orienteering with {nodes} points, budget {budget:g}"
    drawing = _Drawing("orienteering", title, seed)
    points = np.round(100 * drawing.rng.random((nodes, 2)), 1)
    drawing.nodes(reward=drawing.rng.integers(1, 21, nodes).astype(float), pos=points)
    for one, other in combinations(range(nodes), 2):
        length = math.dist(points[one], points[other])
        survival = round(math.exp(-length / 100), _DIGITS)
        drawing.passage(one, other, survival, length=round(length, _DIGITS))
    return drawing.mission(base=0, robots=robots, max_length=budget)


@checked
def drones_and_rovers(*, drones: Count = 2, rovers: Count = 2, seed: Seed = 0) -> Mission:
    """A flooded plant: drones fly over stairs and water, rovers open doors and carry samples.

    34 places and 102 arcs: a yard, a basin, a lab on the ground floor, an office above it, and the
    roof. Drones start and land on the roof, which is a depot, and fly 250 metres at most; rovers
    start at the gate, the base. Drones are lost more easily than rovers, which take neither stairs
    nor water. Each place is worth a photo, which pays on arrival, or a sample, which pays on
    return. A drone gets half of the photos in the lab, behind doors, and half of the samples in the
    office and the basin, but cannot lift those in the yard and the lab. Positions, rewards, where
    samples are, and survivals are drawn at random.

    Parameters
    ----------
    drones
        Number of drones.
    rovers
        Number of rovers.
    seed
        Seed of the random numbers.
    """
    drawing = _Drawing("drones_and_rovers", "Drones and rovers at a flooded plant", seed)
    plant, rng = json.loads(_PLANT.read_text("utf-8")), drawing.rng
    for zone in plant["zones"]:
        places = np.array([*zone["places"].values()])
        samples = rng.choice(len(places), zone["n_samples"], replace=False)
        moved = np.round(places + rng.uniform(-_JITTER, _JITTER, places.shape), 1)
        for i, (label, pos) in enumerate(zip(zone["places"], moved.tolist(), strict=True)):
            found = zone["sample" if i in samples else "photo"]
            reward = round(rng.uniform(*found["reward"]), 1)
            drawing.graph.add_node(label, reward=reward, pos=pos, **found["attributes"])
    passages, at = plant["passages"], dict(drawing.graph.nodes(data="pos"))
    ranges = np.array([plant["ways"][way] for *_, way in passages])  # (n_passages, kind, bound)
    survivals = np.round(rng.uniform(ranges[..., 0], ranges[..., 1]), _DIGITS)
    for (one, other, way), (drone, rover) in zip(passages, survivals.tolist(), strict=True):
        length = round(math.dist(at[one], at[other]), 1)
        drawing.passage(one, other, {"drone": drone, "rover": rover}, length=length, way=way)
    flying = Kind("drone", drones, start="roof", end="roof", max_length=250)
    return drawing.mission(base="gate", kinds=[flying, Kind("rover", rovers)])


def _circle(nodes: int, x: float, radius: float) -> FloatArray:
    """Return positions (nodes, 2), evenly spread on a circle around (x, 0.5)."""
    angles = 2 * np.pi * np.arange(nodes) / nodes
    circle = np.column_stack([x + radius * np.cos(angles), 0.5 + radius * np.sin(angles)])
    return np.round(circle, _DIGITS)
