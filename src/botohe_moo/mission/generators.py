"""Seeded random missions: the same arguments give the same mission.

Numbers have a few decimal places only, so that the last bits in which platforms differ never show,
and mission files stay readable. Passages lead both ways. The base, node 0 unless said otherwise,
has no reward.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

import networkx as nx
import numpy as np
from pydantic import Field

from botohe_moo._base.checks import ParameterError
from botohe_moo._base.types import FloatArray, OffsetArray, Rng
from botohe_moo._base.words import counted
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import Robots
from botohe_moo.mission.formats.benchmark import near_pairs, nearest_pairs, spanning_pairs
from botohe_moo.mission.model import Mission

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
