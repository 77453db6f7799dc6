"""Seeded missions on streets, corridors and lattices, and orienteering with a travel budget.

As in `botohe_moo.mission.generators`, the same arguments give the same mission, and numbers have a
few decimal places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, TypeAlias

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo._base.checks import ParameterError
from botohe_moo._base.words import counted
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Positive, Robots
from botohe_moo.mission.formats.benchmark import benchmark_graph
from botohe_moo.mission.generators import Nodes, Seed
from botohe_moo.mission.kinds import Kind
from botohe_moo.mission.model import Mission

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
