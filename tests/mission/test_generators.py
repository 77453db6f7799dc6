import math
import re
from collections import Counter

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind
from botohe_moo.mission import generators, save_mission
from tests.examples import examples

PLAIN = [
    generators.two_communities,
    generators.random,
    generators.complete,
    generators.terrain,
    generators.tunnel,
    generators.lattice,
    generators.town,
    generators.building,
    generators.orienteering,
]
ALL = [*PLAIN, generators.drones_and_rovers]
EACH_WAY_ITS_OWN = [generators.random, generators.complete, generators.terrain]
TWO_WAY = [generate for generate in ALL if generate != generators.town]
seeds = st.integers(0, 2**64)


def passages(graph):
    """What arcs hold, there and back, of every passage."""
    edges = graph.edges
    return [(edges[u, v], edges[v, u]) for u, v in edges if u < v]


def survivals(mission):
    """Survivals there and back of every passage (n_passages, 2)."""
    return np.array([[arc["survival"] for arc in both] for both in passages(mission.graph)])


def assert_fills(values, low, high, margin):
    """Assert that values are in [low, high), and come close to both bounds."""
    assert low <= min(values) < low + margin
    assert high - margin < max(values) < high


@pytest.mark.parametrize("generate", ALL)
class TestEvery:
    def test_same_seed_same_mission(self, generate, tmp_path):
        for number in "12":
            save_mission(generate(seed=7), tmp_path / f"{number}.json")
        assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()
        assert generate(seed=7) != generate(seed=8)
        assert generate() == generate(seed=0)

    @given(seed=seeds)
    def test_named_and_laid_out(self, generate, seed):
        mission = generate(seed=seed)
        assert mission.name == generate.__name__
        assert mission.title.endswith(f", seed {seed}")
        assert mission.graph.graph["base"] == mission.base
        assert mission.graph.nodes[mission.base]["reward"] == 0
        positions = [tuple(pos) for _, pos in mission.graph.nodes(data="pos")]
        assert {len(pos) for pos in positions} == {2}
        assert len({*positions}) == len(mission.nodes)


@pytest.mark.parametrize("generate", PLAIN)
@given(seed=seeds, robots=st.integers(1, 9))
def test_all_robots_are_alike(generate, seed, robots):
    mission = generate(seed=seed, robots=robots)
    assert mission.robots == robots
    assert mission.is_plain


@pytest.mark.parametrize("generate", TWO_WAY)
@given(seed=seeds)
def test_passages_lead_both_ways(generate, seed):
    mission = generate(seed=seed)
    assert mission.balanced
    alike = [there == back for there, back in passages(mission.graph)]
    assert 2 * len(alike) == len(mission.graph.edges)
    if generate in EACH_WAY_ITS_OWN:
        assert np.mean(alike) < 0.1
    else:
        assert all(alike)


# What seed 0 gives on any platform: robots, nodes, arcs, base, total reward, and the sums of the
# survivals and lengths.
@pytest.mark.parametrize(
    ("generate", "expected"),
    [
        (generators.two_communities, (2, 21, 74, 0, 46.4059, 54.8892, 74)),
        (generators.random, (3, 20, 100, 0, 11.7952, 51.6377, 100)),
        (generators.complete, (2, 25, 600, 0, 25.3035, 424.4402, 600)),
        (generators.terrain, (5, 200, 1310, 160, 102.315, 1239.9792, 1310)),
        (generators.tunnel, (3, 45, 102, 0, 18.25, 93.4446, 102)),
        (generators.lattice, (2, 65, 224, 0, 64.0, 212.8308, 224)),
        (generators.town, (2, 64, 112, 0, 34.897, 106.7921, 112)),
        (generators.building, (3, 54, 126, 9, 39.032, 120.2878, 126)),
        (generators.orienteering, (2, 32, 992, 0, 354.0, 599.5778, 53118.5604)),
        (generators.drones_and_rovers, (4, 34, 102, "gate", 100, 156.0656, 2248)),
    ],
)
def test_seed_zero(generate, expected):
    mission = generate()
    arrays, size = mission.world.graph, (len(mission.nodes), len(mission.graph.edges))
    sums = mission.total_reward, arrays.survival.sum(), arrays.length.sum()
    found = (mission.robots, *size, mission.base, *(round(float(number), 4) for number in sums))
    assert found == expected


@pytest.mark.parametrize("nodes", [2, 40])
@pytest.mark.parametrize(
    "generate", [*EACH_WAY_ITS_OWN, generators.tunnel, generators.orienteering]
)
def test_sizes(generate, nodes):
    mission = generate(nodes=nodes, seed=1)
    assert mission.nodes == tuple(range(nodes))
    assert generate(nodes=np.int64(nodes), seed=1) == mission


@pytest.mark.parametrize(
    ("generate", "parameters", "message"),
    [
        (generators.terrain, {"seed": -1}, "Expected seed >= 0, got -1."),
        (generators.terrain, {"robots": 0}, "Expected robots >= 1, got 0."),
        (generators.terrain, {"nodes": 1}, "Expected nodes >= 2, got 1."),
        (generators.terrain, {"nodes": 9, "depots": 9}, "Expected depots < 9 nodes, got 9."),
        (
            generators.random,
            {"nodes": 30, "arc_probability": 0.01},
            "Expected arc_probability > 0.17 for 30 nodes, got 0.01.",
        ),
        (generators.town, {"streets": 3}, "Expected streets to be a multiple of 2, got 3."),
        (generators.building, {"robots": 3, "wheeled": 3}, "Expected wheeled < 3 robots, got 3."),
        (
            generators.orienteering,
            {"tour": math.inf},
            "Expected tour to be a finite number > 0, got inf.",
        ),
    ],
)
def test_parameters_that_are_refused(generate, parameters, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        generate(**parameters)


class TestTwoCommunities:
    @given(seeds)
    def test_shape(self, seed):
        graph = generators.two_communities(seed=seed).graph
        zones = [zone for _, zone in graph.nodes(data="zone")]
        assert zones == ["base"] + ["community 1"] * 12 + ["community 2"] * 8
        assert sorted(graph[0]) == [1, 13]
        tied = [graph.edges[arc]["survival"] for arc in [(0, 1), (1, 0), (0, 13), (13, 0)]]
        assert tied == [1, 1, 1, 1]

    def test_numbers_over_many_seeds(self):
        missions = [generators.two_communities(seed=seed) for seed in range(200)]
        rewards = np.array([mission.rewards for mission in missions])
        assert rewards[:, 1:13].mean() == pytest.approx(1.03, abs=0.05)  # truncated: above 1
        assert rewards[:, 13:21].mean() == pytest.approx(5.04, abs=0.2)
        assert (rewards[:, 1:] == 0).mean() < 0.002  # clipped would be 0.014
        assert np.mean([m.world.graph.n_arcs for m in missions]) == pytest.approx(82, abs=2)
        between = [sum((u < 13) != (v < 13) for u, v in m.graph.edges if u * v) for m in missions]
        assert np.mean(between) == pytest.approx(2 * 0.025 * 96, abs=0.7)
        drawn = np.concatenate([survivals(m)[2:, 0] for m in missions])
        assert (drawn == 1).mean() < 0.005  # clipped would be 0.37
        assert drawn.mean() == pytest.approx(0.727, abs=0.01)


class TestRandom:
    def test_numbers(self):
        mission = generators.random(nodes=150, arc_probability=0.3)
        assert mission.world.graph.n_arcs == pytest.approx(0.3 * 150 * 149, rel=0.05)
        found = survivals(mission)
        assert 0 < found.min() < 0.01
        assert 0.99 < found.max() < 1
        assert found.mean() == pytest.approx(0.5, abs=0.02)
        assert (found[:, 0] != found[:, 1]).mean() > 0.99
        assert_fills(mission.rewards[1:], 0.1, 1.1, 0.05)

    @given(seeds, st.integers(2, 9), st.floats(0.4, 1))
    def test_always_connected(self, seed, nodes, probability):
        mission = generators.random(nodes=nodes, arc_probability=probability, seed=seed)
        assert nx.is_strongly_connected(mission.graph)


def test_complete():
    missions = [generators.complete(seed=seed) for seed in range(20)]
    assert {mission.world.graph.n_arcs for mission in missions} == {25 * 24}
    found = np.concatenate([survivals(mission) for mission in missions])
    assert (found[:, 0] != found[:, 1]).mean() > 0.99
    assert found.mean() == pytest.approx(0.707, abs=0.01)  # truncated: below 0.75
    assert (found == 1).mean() < 0.005  # clipped would be 0.11
    assert found.min() > 0
    rewards = np.concatenate([mission.rewards[1:] for mission in missions])
    assert rewards.mean() == pytest.approx(1.288, abs=0.1)
    assert (rewards == 0).mean() < 0.01  # clipped would be 0.16


class TestTerrain:
    def test_like_terrain_200(self):
        arcs = [generators.terrain(seed=seed).world.graph.n_arcs for seed in range(30)]
        assert min(arcs) < 1348 < max(arcs)
        assert np.mean(arcs) == pytest.approx(1300, abs=50)

    def test_as_many_arcs_a_node_at_every_size(self):
        nodes = 500
        mission = generators.terrain(nodes=nodes)
        assert 6.5 < mission.world.graph.n_arcs / nodes < 7.3
        found = survivals(mission)
        assert 0.9 <= found.min() < 0.901
        assert 0.994 < found.max() <= 0.995
        assert (found[:, 0] != found[:, 1]).mean() > 0.99
        assert mission.rewards.min() >= 0
        assert mission.rewards.max() <= 1
        assert mission.rewards.mean() == pytest.approx(0.5, abs=0.05)

    @given(seeds, st.integers(2, 60))
    def test_near_waypoints_have_passages_and_the_nearest_parts_are_joined(self, seed, nodes):
        mission = generators.terrain(nodes=nodes, seed=seed)
        pos = dict(mission.graph.nodes(data="pos"))
        reach = 1.51 / math.sqrt(nodes)
        near = nx.Graph()
        near.add_nodes_from(pos)
        for u in pos:
            near.add_edges_from((u, v) for v in range(u) if math.dist(pos[u], pos[v]) <= reach)
        joined = mission.graph.to_undirected()
        parts = list(nx.connected_components(near))
        joints = [arc for arc in joined.edges if not near.has_edge(*arc)]
        assert all(joined.has_edge(*arc) for arc in near.edges)
        assert len(joints) == len(parts) - 1
        for u, v in joints:  # no shorter passage from one side of the joint to the other
            rest = joined.copy()
            rest.remove_edge(u, v)
            side = nx.node_connected_component(rest, u)
            across = [math.dist(pos[a], pos[b]) for a in side for b in pos.keys() - side]
            assert math.dist(pos[u], pos[v]) == pytest.approx(min(across))

    def test_base_is_in_the_centre(self):
        mission = generators.terrain()
        pos = dict(mission.graph.nodes(data="pos"))
        assert mission.base == min(pos, key=lambda node: math.dist(pos[node], (0.5, 0.5)))

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
        graph.graph["title"] = plain.title
        assert nx.utils.graphs_equal(graph, nx.DiGraph(plain.graph))

    def test_title_counts_depots(self):
        title = generators.terrain(nodes=9, depots=1).title
        assert title == "Rolling terrain: 9 waypoints, 1 depot, random geometric graph, seed 0"


@given(seeds, st.integers(2, 60))
def test_tunnel_has_few_loops_and_joins_what_is_near(seed, nodes):
    mission = generators.tunnel(nodes=nodes, seed=seed)
    pos = dict(mission.graph.nodes(data="pos"))
    tunnels = mission.graph.to_undirected()
    assert nx.is_connected(tunnels)
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


class TestLattice:
    def test_shape(self):
        graph = generators.lattice(rows=3, columns=4).graph
        places = {tuple(pos): node for node, pos in graph.nodes(data="pos")}
        grid = nx.grid_2d_graph(4, 3).to_directed()
        assert {(places[tail], places[head]) for tail, head in grid.edges} == {*graph.edges}
        assert places[0, 0] == graph.graph["base"]
        assert [reward for _, reward in graph.nodes(data="reward")] == [0] + [1] * 11

    def test_numbers(self):
        found = survivals(generators.lattice(rows=30, columns=30))
        assert_fills(found[:, 0], 0.9, 1, 0.001)
        assert found.mean() == pytest.approx(0.95, abs=0.003)


class TestTown:
    @examples(40)
    @given(seeds, st.integers(1, 5).map(lambda half: 2 * half))
    def test_one_way_streets_that_alternate(self, seed, streets):
        graph = generators.town(streets=streets, seed=seed).graph
        assert len(graph) == streets**2
        assert nx.is_strongly_connected(graph)
        ways = {}  # of each street: the steps of its arcs
        for tail, head in graph.edges:
            (x, y), (x2, y2) = (graph.nodes[node]["pos"] for node in (tail, head))
            street = ("along", x // 100) if x == x2 else ("across", y // 100)
            ways.setdefault(street, []).append((x2 - x) + (y2 - y))
        for number in range(streets):
            there, back = [100] * (streets - 1), [-100] * (streets - 1)
            assert ways["along", number] == (there if number % 2 else back)
            assert ways["across", number] == (back if number % 2 else there)
        assert graph.nodes[graph.graph["base"]]["pos"] == [0, 0]

    def test_numbers(self):
        arrays = generators.town(streets=30).world.graph
        for found, low, high in ((arrays.survival, 0.9, 1), (arrays.reward[1:], 0.1, 1)):
            near = (high - low) / 100
            assert_fills(found, low, high, near)
            assert found.mean() == pytest.approx((low + high) / 2, abs=3 * near)


class TestBuilding:
    @examples(60)
    @given(seeds, st.integers(1, 4), st.integers(1, 5))
    def test_shape(self, seed, floors, doors):
        mission = generators.building(floors=floors, doors=doors, seed=seed)
        graph = mission.graph
        zones, pos = dict(graph.nodes(data="zone")), dict(graph.nodes(data="pos"))
        assert len(graph) == 3 * doors * floors
        assert nx.is_strongly_connected(graph)
        assert all(there == back for there, back in passages(graph))
        assert len({tuple(place) for place in pos.values()}) == len(graph)
        assert (zones[mission.base], pos[mission.base]) == ("floor 0", [5 * (doors // 2), 0])
        stairs = [(u, v) for u, v in graph.edges if zones[u] != zones[v]]
        assert len(stairs) == 2 * len({0, doors - 1}) * (floors - 1)
        for tail, head in stairs:
            assert pos[tail][0] == pos[head][0] in (0, 5 * (doors - 1))
            assert abs(pos[tail][1] - pos[head][1]) == 20
            assert graph.nodes[tail]["reward"] == graph.nodes[head]["reward"] == 0

    def test_numbers(self):
        floors, doors = 40, 8
        graph = generators.building(floors=floors, doors=doors).graph
        floor = {node: int(zone.split()[1]) for node, zone in graph.nodes(data="zone")}
        place = {node: "room" if pos[1] % 20 else "hall" for node, pos in graph.nodes(data="pos")}
        rewards = dict(graph.nodes(data="reward"))
        assert {node for node in graph if rewards[node]} == {v for v in graph if place[v] == "room"}
        on_ground = [rewards[v] / (1 + floor[v] / 2) for v in graph if place[v] == "room"]
        assert_fills(on_ground, 0.2, 1, 0.01)
        assert np.mean(on_ground) == pytest.approx(0.6, abs=0.03)
        found = {}
        for u, v, survival in graph.edges(data="survival"):
            way = " ".join(sorted([place[u], place[v]])) if floor[u] == floor[v] else "stairs"
            found.setdefault(way, []).append(survival)
        assert_fills(found["stairs"], 0.92, 0.97, 0.01)
        assert_fills(found["hall hall"], 0.97, 1, 0.003)
        assert_fills(found["hall room"], 0.9, 0.99, 0.003)
        assert_fills(found["room room"], 0.9, 0.99, 0.003)
        pairs = 2 * floors * (doors - 1)
        assert len(found["room room"]) == pytest.approx(2 * pairs / 3, rel=0.15)

    @examples(40)
    @given(seeds, st.integers(1, 3), st.integers(1, 3))
    def test_wheeled_robots_cannot_take_stairs(self, seed, floors, wheeled):
        how = {"floors": floors, "robots": 4, "seed": seed}
        mission = generators.building(wheeled=wheeled, **how)
        kinds = [(kind.name, kind.robots) for kind in mission.kinds]
        assert kinds == [("walking", 4 - wheeled), ("wheeled", wheeled)]
        plain, graph = generators.building(**how).graph, mission.graph
        assert dict(graph.nodes(data=True)) == dict(plain.nodes(data=True))
        for tail, head, survival in plain.edges(data="survival"):
            is_stair = plain.nodes[tail]["zone"] != plain.nodes[head]["zone"]
            by_kind = {"walking": survival, "wheeled": 0.0}
            assert graph.edges[tail, head]["survival"] == (by_kind if is_stair else survival)


class TestOrienteering:
    @examples(40)
    @given(seeds, st.integers(2, 20))
    def test_all_arcs_are_as_long_as_points_are_apart(self, seed, nodes):
        mission = generators.orienteering(nodes=nodes, seed=seed)
        pos = dict(mission.graph.nodes(data="pos"))
        assert mission.graph.number_of_edges() == nodes * (nodes - 1)
        for tail, head, arc in mission.graph.edges(data=True):
            distance = math.dist(pos[tail], pos[head])
            assert arc["length"] == pytest.approx(distance, abs=1e-4)
            assert arc["survival"] == pytest.approx(math.exp(-distance / 100), abs=1e-4)

    def test_budget(self):
        """A tour of 100 points in a square of side 100 is some 712.4 long; 40 % for 4 robots."""
        mission = generators.orienteering(nodes=100, robots=4, tour=0.4)
        assert mission.max_length == 71.2
        assert mission.title == "Orienteering with 100 points, budget 71.2, seed 0"

    def test_numbers(self):
        mission = generators.orienteering(nodes=150)
        scores = mission.rewards[1:]
        assert {*scores.tolist()} == {*range(1, 21)}
        assert scores.mean() == pytest.approx(10.5, abs=1)
        pos = np.array([pos for _, pos in mission.graph.nodes(data="pos")])
        assert 0 <= pos.min() < 1
        assert 99 < pos.max() <= 100
        assert pos.mean(axis=0) == pytest.approx(50, abs=5)


class TestDronesAndRovers:
    @given(seeds, st.integers(1, 9), st.integers(1, 9))
    def test_where_each_can_go(self, seed, drones, rovers):
        mission = generators.drones_and_rovers(seed=seed, drones=drones, rovers=rovers)
        flying = Kind("drone", drones, start="roof", end="roof", max_length=250)
        assert mission.kinds == (flying, Kind("rover", rovers))
        graph, n = mission.graph, len(mission.nodes)
        zones = dict(graph.nodes(data="zone"))
        rewards = dict(zip(mission.nodes, mission.world.graph.reward[n:].tolist(), strict=True))
        reached = {node for node, reward in rewards.items() if reward > 0}
        assert reached == {node for node, zone in zones.items() if zone in ("yard", "lab")}
        for arc in graph.edges.values():
            drone, rover = arc["survival"]["drone"], arc["survival"]["rover"]
            assert rover > drone if arc["way"] in ("ground", "indoors") else rover == 0

    @given(seeds)
    def test_what_drones_collect(self, seed):
        nodes = generators.drones_and_rovers(seed=seed).graph.nodes
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
