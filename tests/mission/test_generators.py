"""One contract of all generators, and what is special about each."""

import math
import re
from collections import Counter

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind
from botohe_moo.mission import generators

# What seed 0 gives on any platform: robots, nodes, arcs, base, total reward, and the sums of the
# survivals and lengths. Other distributions would have other sums.
SEED_ZERO = {
    "two_communities": (2, 21, 74, 0, 46.4059, 54.8892, 74),
    "random": (3, 20, 100, 0, 11.7952, 51.6377, 100),
    "complete": (2, 25, 600, 0, 25.3035, 424.4402, 600),
    "terrain": (5, 200, 1310, 160, 102.315, 1239.9792, 1310),
    "tunnel": (3, 45, 102, 0, 18.25, 93.4446, 102),
    "rooms": (3, 80, 166, 0, 38.7, 160.4564, 166),
    "mine": (3, 50, 112, 0, 18.35, 104.7576, 112),
    "lattice": (2, 65, 224, 0, 64.0, 212.8308, 224),
    "town": (2, 64, 112, 0, 34.897, 106.7921, 112),
    "building": (3, 54, 126, 9, 39.032, 120.2878, 126),
    "orienteering": (2, 32, 992, 0, 354.0, 599.5778, 53118.5604),
    "drones_and_rovers": (4, 34, 102, "gate", 100, 156.0656, 2248),
}
EACH_WAY_ITS_OWN = {"random", "complete", "terrain"}
SIZED = ["random", "complete", "terrain", "tunnel", "rooms", "mine", "orienteering"]
SMALL = {"terrain": {"nodes": 30}, "lattice": {"rows": 4}, "orienteering": {"nodes": 9}}
seeds = st.integers(0, 2**64)


def passages(graph):
    """What arcs hold, there and back, of every passage."""
    edges = graph.edges
    return [(edges[u, v], edges[v, u]) for u, v in edges if u < v]


class TestEvery:
    @pytest.mark.parametrize("name", SEED_ZERO)
    def test_numbers_of_seed_zero(self, name):
        mission = getattr(generators, name)()
        arrays, size = mission.world.graph, (len(mission.nodes), len(mission.graph.edges))
        sums = mission.total_reward, arrays.survival.sum(), arrays.length.sum()
        found = (mission.robots, *size, mission.base, *(round(float(x), 4) for x in sums))
        assert found == SEED_ZERO[name]

    @pytest.mark.parametrize("name", SEED_ZERO)
    @given(seed=seeds, robots=st.integers(1, 9))
    def test_is_seeded_connected_and_laid_out(self, name, seed, robots):
        generate, team = getattr(generators, name), {"robots": robots}
        if name == "drones_and_rovers":
            team = {"drones": robots, "rovers": 1}
        given = {**SMALL.get(name, {}), **team, "seed": seed}
        mission, graph = generate(**given), generate(**given).graph
        assert nx.utils.graphs_equal(graph, mission.graph)
        assert generate(**given | {"seed": seed + 1}) != mission
        assert mission.robots == sum(team.values())
        assert mission.is_plain == (name != "drones_and_rovers")
        assert mission.name == graph.graph["name"] == name
        assert mission.title.endswith(f", seed {seed}")
        assert graph.graph["base"] == mission.base
        assert graph.nodes[mission.base]["reward"] == 0
        assert nx.is_strongly_connected(graph)
        assert len({tuple(pos) for _, pos in graph.nodes(data="pos")}) == len(mission.nodes)
        if name == "town":
            return
        alike = [there == back for there, back in passages(graph)]
        assert (mission.balanced, 2 * len(alike)) == (True, len(graph.edges))
        assert np.mean(alike) < 0.1 if name in EACH_WAY_ITS_OWN else all(alike)

    @pytest.mark.parametrize("name", SIZED)
    def test_size(self, name):
        for nodes in (12 if name in ("rooms", "mine") else 2, 40):
            mission = getattr(generators, name)(nodes=nodes, seed=1)
            assert mission.nodes == tuple(range(nodes))

    @pytest.mark.parametrize(
        ("name", "parameters", "message"),
        [
            ("terrain", {"nodes": 9, "depots": 9}, "Expected depots < 9 nodes, got 9."),
            ("random", {"nodes": 30, "arc_probability": 0.01}, "> 0.17 for 30 nodes, got 0.01."),
            ("town", {"streets": 3}, "Expected streets to be a multiple of 2, got 3."),
            ("building", {"robots": 3, "wheeled": 3}, "Expected wheeled < 3 robots, got 3."),
            ("orienteering", {"tour": math.inf}, "tour to be a finite number > 0, got inf."),
        ],
    )
    def test_refuses_parameters_that_do_not_fit(self, name, parameters, message):
        with pytest.raises(ValueError, match=re.escape(message)):
            getattr(generators, name)(**parameters)


def test_two_communities_are_tied_to_the_base():
    graph = generators.two_communities().graph
    zones = [zone for _, zone in graph.nodes(data="zone")]
    assert zones == ["base"] + ["community 1"] * 12 + ["community 2"] * 8
    assert dict(graph[0]) == {1: {"survival": 1}, 13: {"survival": 1}}
    away = [math.dist(graph.nodes[v]["pos"], (0.2 if v < 13 else 0.8, 0.5)) for v in range(1, 21)]
    assert away == pytest.approx([0.2] * 20, abs=1e-3)


class TestTerrain:
    @given(seeds, st.integers(2, 60))
    def test_near_waypoints_have_passages_and_the_nearest_parts_are_joined(self, seed, nodes):
        mission = generators.terrain(nodes=nodes, seed=seed)
        pos = dict(mission.graph.nodes(data="pos"))
        reach = 1.51 / math.sqrt(nodes)
        near = nx.empty_graph(nodes)
        for u in pos:
            near.add_edges_from((u, v) for v in range(u) if math.dist(pos[u], pos[v]) <= reach)
        joined = mission.graph.to_undirected()
        joints = [arc for arc in joined.edges if not near.has_edge(*arc)]
        assert all(joined.has_edge(*arc) for arc in near.edges)
        assert len(joints) == nx.number_connected_components(near) - 1
        for u, v in joints:  # no shorter passage from one side of the joint to the other
            rest = joined.copy()
            rest.remove_edge(u, v)
            side = nx.node_connected_component(rest, u)
            across = [math.dist(pos[a], pos[b]) for a in side for b in pos.keys() - side]
            assert math.dist(pos[u], pos[v]) == pytest.approx(min(across))

    @given(seeds, st.integers(2, 60), st.data())
    def test_depots_change_nothing_else(self, seed, nodes, data):
        depots = data.draw(st.integers(1, nodes - 1))
        plain = generators.terrain(nodes=nodes, seed=seed)
        mission = generators.terrain(nodes=nodes, seed=seed, depots=depots)
        assert (mission.base, mission.robots, mission.pays) == (plain.base, plain.robots, "return")
        graph = mission.graph.copy()
        drawn = [node for node, said in graph.nodes(data=True) if said.pop("depot", False)]
        assert len(drawn) == depots
        assert mission.base not in drawn
        said = f"{nodes} waypoints, {depots} depot{'s' if depots > 1 else ''},"
        assert mission.title == plain.title.replace(f"{nodes} waypoints,", said)
        graph.graph["title"] = plain.title
        assert nx.utils.graphs_equal(graph, nx.DiGraph(plain.graph))


@given(seeds, st.integers(2, 60))
def test_tunnel_has_few_loops_and_joins_what_is_near(seed, nodes):
    mission = generators.tunnel(nodes=nodes, seed=seed)
    pos = dict(mission.graph.nodes(data="pos"))
    tunnels = mission.graph.to_undirected()
    assert len(tunnels.edges) <= nodes - 1 + nodes // 6
    every = nx.Graph()
    every.add_weighted_edges_from((u, v, math.dist(pos[u], pos[v])) for u in pos for v in pos)
    shortest, found = (
        nx.minimum_spanning_tree(each).size(weight="weight")
        for each in (every, every.edge_subgraph(tunnels.edges))
    )
    assert found == pytest.approx(shortest)
    for tail, head, survival in mission.graph.edges(data="survival"):
        distance = math.dist(pos[tail], pos[head])
        assert survival == pytest.approx(math.exp(-distance / 500), abs=1e-4)
    assert {*mission.rewards.tolist()} <= {0.0, 0.15, 0.3, 0.5, 1.0}


@given(seeds, st.integers(12, 90), st.integers(0, 5))
def test_rooms_are_dead_ends_and_mines_begin_with_a_long_way(seed, nodes, loops):
    graph = generators.rooms(nodes=nodes, loops=loops, seed=seed).graph.to_undirected()
    assert nodes - 1 <= len(graph.edges) <= nodes - 1 + loops
    assert graph.degree(0) == 1
    ends = range(nodes - round((nodes - 1) / 2), nodes)
    assert all(graph.degree(node) == 1 for node in ends)
    survivals = [survival for *_, survival in graph.edges(data="survival")]
    assert np.mean([survival < 0.9 for survival in survivals]) < 0.4
    mined = generators.mine(nodes=nodes, loops=loops, seed=seed).graph.to_undirected()
    assert all(mined.has_edge(node, node + 1) for node in range(6))
    assert all(mined.degree(node) == 2 for node in range(1, 6))


def test_lattice():
    graph = generators.lattice(rows=3, columns=4).graph
    places = {tuple(pos): node for node, pos in graph.nodes(data="pos")}
    grid = nx.grid_2d_graph(4, 3).to_directed()
    assert {(places[tail], places[head]) for tail, head in grid.edges} == {*graph.edges}
    assert places[0, 0] == graph.graph["base"]
    assert [reward for _, reward in graph.nodes(data="reward")] == [0] + [1] * 11


@pytest.mark.parametrize("streets", [2, 6])
def test_a_town_has_one_way_streets_that_alternate(streets):
    mission = generators.town(streets=streets)
    graph, ways = mission.graph, {}  # of each street: the steps of its arcs
    assert len(graph) == streets**2
    for tail, head in graph.edges:
        (x, y), (x2, y2) = (graph.nodes[node]["pos"] for node in (tail, head))
        street = ("along", x // 100) if x == x2 else ("across", y // 100)
        ways.setdefault(street, []).append((x2 - x) + (y2 - y))
    for number in range(streets):
        there, back = [100] * (streets - 1), [-100] * (streets - 1)
        assert ways["along", number] == (there if number % 2 else back)
        assert ways["across", number] == (back if number % 2 else there)
    assert graph.nodes[mission.base]["pos"] == [0, 0]


class TestBuilding:
    @pytest.mark.parametrize(("floors", "doors"), [(1, 1), (2, 1), (4, 5)])
    def test_shape(self, floors, doors):
        mission = generators.building(floors=floors, doors=doors)
        graph = mission.graph
        zones, pos = dict(graph.nodes(data="zone")), dict(graph.nodes(data="pos"))
        assert len(graph) == 3 * doors * floors
        assert (zones[mission.base], pos[mission.base]) == ("floor 0", [5 * (doors // 2), 0])
        stairs = [(u, v) for u, v in graph.edges if zones[u] != zones[v]]
        assert len(stairs) == 2 * len({0, doors - 1}) * (floors - 1)
        for tail, head in stairs:
            assert pos[tail][0] == pos[head][0] in (0, 5 * (doors - 1))
            assert abs(pos[tail][1] - pos[head][1]) == 20
            assert graph.nodes[tail]["reward"] == graph.nodes[head]["reward"] == 0

    def test_wheeled_robots_cannot_take_stairs(self):
        plain, mission = generators.building(robots=4), generators.building(robots=4, wheeled=1)
        assert mission.kinds == (Kind("walking", 3), Kind("wheeled", 1))
        assert dict(mission.graph.nodes) == dict(plain.graph.nodes)
        zones = dict(plain.graph.nodes(data="zone"))
        for tail, head, survival in plain.graph.edges(data="survival"):
            by_kind = {"walking": survival, "wheeled": 0.0}
            found = mission.graph.edges[tail, head]["survival"]
            assert found == (by_kind if zones[tail] != zones[head] else survival)


def test_the_budget_of_orienteering():
    """A tour of 100 points in a square of side 100 is some 712.4 long; 40 % for 4 robots."""
    mission = generators.orienteering(nodes=100, robots=4, tour=0.4)
    assert mission.max_length == 71.2
    assert mission.title == "Orienteering with 100 points, budget 71.2, seed 0"


@given(seeds)
def test_drones_and_rovers(seed):
    mission = generators.drones_and_rovers(seed=seed)
    flying = Kind("drone", 2, start="roof", end="roof", max_length=250)
    assert mission.kinds == (flying, Kind("rover", 2))
    graph, n = mission.graph, len(mission.nodes)
    zones = dict(graph.nodes(data="zone"))
    rewards = dict(zip(mission.nodes, mission.world.graph.reward[n:].tolist(), strict=True))
    reached = {node for node, reward in rewards.items() if reward > 0}
    assert reached == {node for node, zone in zones.items() if zone in ("yard", "lab")}
    for arc in graph.edges.values():
        drone, rover = arc["survival"]["drone"], arc["survival"]["rover"]
        assert rover > drone if arc["way"] in ("ground", "indoors") else rover == 0
    nodes = graph.nodes
    n_samples = Counter(node["zone"] for node in nodes.values() if "pays" in node)
    assert n_samples == {"yard": 3, "lab": 4, "office": 2, "basin": 3}
    share_of_photos, share_of_samples = {"lab": 0.5}, {"office": 0.5, "basin": 0.5}
    for node in nodes.values():
        if node.get("pays") == "return":
            expected = share_of_samples.get(node["zone"], 0)
        else:
            expected = share_of_photos.get(node.get("zone"), 1)
        assert node.get("share", {"drone": 1}) == {"drone": expected}
    assert [label for label, node in nodes.items() if "depot" in node] == ["roof"]
