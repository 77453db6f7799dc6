import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.mission import generators, save_mission

ALL = [
    generators.two_communities,
    generators.random,
    generators.complete,
    generators.terrain,
    generators.tunnel,
]
seeds = st.integers(0, 2**64)


def survivals(mission):
    """Survivals there and back of every passage (n_passages, 2)."""
    edges = mission.graph.edges
    return np.array([(edges[u, v]["survival"], edges[v, u]["survival"]) for u, v in edges if u < v])


@pytest.mark.parametrize("generate", ALL)
class TestEvery:
    def test_same_seed_same_mission(self, generate, tmp_path):
        for number in "12":
            save_mission(generate(seed=7), tmp_path / f"{number}.json")
        assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()
        assert generate(seed=7) != generate(seed=8)
        assert generate() == generate(seed=0)

    @given(seed=seeds, robots=st.integers(1, 9))
    def test_valid_named_and_laid_out(self, generate, seed, robots):
        mission = generate(seed=seed, robots=robots)
        assert mission.robots == robots
        assert mission.name == generate.__name__
        assert str(seed) in mission.title
        assert mission.balanced
        assert all(mission.graph.has_edge(v, u) for u, v in mission.graph.edges)
        assert mission.graph.nodes[mission.base]["reward"] == 0
        assert len({tuple(pos) for _, pos in mission.graph.nodes(data="pos")}) == len(mission.nodes)


def test_parameters_out_of_range():
    for parameters in ({"seed": -1}, {"robots": 0}, {"nodes": 1}):
        [name] = parameters
        with pytest.raises(ValueError, match=f"Expected {name} >= "):
            generators.terrain(**parameters)


# What seed 0 gives on any platform: robots, nodes, arcs, base, total reward, sum of the survivals.
@pytest.mark.parametrize(
    ("generate", "expected"),
    [
        (generators.two_communities, (2, 21, 74, 0, 46.4059, 54.8892)),
        (generators.random, (3, 20, 100, 0, 11.7952, 51.6377)),
        (generators.complete, (2, 25, 600, 0, 25.3035, 424.4402)),
        (generators.terrain, (5, 200, 1310, 160, 102.315, 1239.9792)),
        (generators.tunnel, (3, 45, 102, 0, 18.25, 93.4446)),
        (generators.lattice, (2, 65, 224, 0, 64.0, 212.8308)),
        (generators.town, (2, 64, 112, 0, 34.897, 106.7921)),
        (generators.building, (3, 54, 126, 9, 39.032, 120.2878)),
        (generators.orienteering, (2, 32, 992, 0, 354.0, 599.5778)),
    ],
)
def test_seed_zero(generate, expected):
    mission = generate()
    total, survival = mission.total_reward, float(mission.arrays.survival.sum())
    found = (mission.robots, len(mission.nodes), mission.arrays.n_arcs, mission.base)
    assert (*found, round(total, 4), round(survival, 4)) == expected


def test_sizes():
    for generate in ALL[1:]:
        for nodes in (2, 40):
            mission = generate(nodes=nodes, seed=1)
            assert mission.nodes == tuple(range(nodes))
            assert generate(nodes=np.int64(nodes), seed=1) == mission


class TestTwoCommunities:
    @given(seeds)
    def test_shape(self, seed):
        mission = generators.two_communities(seed=seed)
        zones = [zone for _, zone in mission.graph.nodes(data="zone")]
        assert zones == ["base"] + ["community 1"] * 12 + ["community 2"] * 8
        assert sorted(mission.graph[0]) == [1, 13]
        found = survivals(mission)
        assert (found[:, 0] == found[:, 1]).all()
        tied = [mission.graph.edges[arc]["survival"] for arc in [(0, 1), (1, 0), (0, 13), (13, 0)]]
        assert tied == [1, 1, 1, 1]

    def test_numbers_over_many_seeds(self):
        missions = [generators.two_communities(seed=seed) for seed in range(200)]
        zone = missions[0].arrays.reward, slice(1, 13), slice(13, 21)
        rewards = np.array([mission.arrays.reward for mission in missions])
        assert rewards[:, zone[1]].mean() == pytest.approx(1.03, abs=0.05)  # truncated: above 1
        assert rewards[:, zone[2]].mean() == pytest.approx(5.04, abs=0.2)
        assert (rewards[:, 1:] == 0).mean() < 0.002  # clipped would be 0.014
        assert np.mean([m.arrays.n_arcs for m in missions]) == pytest.approx(82, abs=2)
        between = [sum((u < 13) != (v < 13) for u, v in m.graph.edges if u * v) for m in missions]
        assert np.mean(between) == pytest.approx(2 * 0.025 * 96, abs=0.7)
        drawn = np.concatenate([survivals(m)[2:, 0] for m in missions])
        assert (drawn == 1).mean() < 0.005  # clipped would be 0.37
        assert drawn.mean() == pytest.approx(0.727, abs=0.01)


class TestRandom:
    def test_numbers(self):
        mission = generators.random(nodes=150, arc_probability=0.3)
        assert mission.arrays.n_arcs == pytest.approx(0.3 * 150 * 149, rel=0.05)
        found = survivals(mission)
        assert 0 < found.min() < 0.01
        assert 0.99 < found.max() < 1
        assert found.mean() == pytest.approx(0.5, abs=0.02)
        assert (found[:, 0] != found[:, 1]).mean() > 0.99
        rewards = mission.arrays.reward[1:]
        assert 0.1 <= rewards.min() < 0.15
        assert 1.05 < rewards.max() < 1.1

    @given(seeds, st.integers(2, 9), st.floats(0.4, 1))
    def test_always_connected(self, seed, nodes, probability):
        mission = generators.random(nodes=nodes, arc_probability=probability, seed=seed)
        assert nx.is_strongly_connected(mission.graph)

    def test_too_few_arcs_to_connect(self):
        message = "that connects 30 nodes, got 0.01: none of 1000 graphs was connected; most are"
        with pytest.raises(ValueError, match=f"{message} above 0.17"):  # 1.5 log(30) / 30
            generators.random(nodes=30, arc_probability=0.01)


def test_complete():
    missions = [generators.complete(seed=seed) for seed in range(20)]
    assert {mission.arrays.n_arcs for mission in missions} == {25 * 24}
    found = np.concatenate([survivals(mission) for mission in missions])
    assert (found[:, 0] != found[:, 1]).mean() > 0.99
    assert found.mean() == pytest.approx(0.707, abs=0.01)  # truncated: below 0.75
    assert (found == 1).mean() < 0.005  # clipped would be 0.11
    assert found.min() > 0
    rewards = np.concatenate([mission.arrays.reward[1:] for mission in missions])
    assert rewards.mean() == pytest.approx(1.288, abs=0.1)
    assert (rewards == 0).mean() < 0.01  # clipped would be 0.16


class TestTerrain:
    def test_like_terrain_200(self):
        arcs = [generators.terrain(seed=seed).arrays.n_arcs for seed in range(30)]
        assert min(arcs) < 1348 < max(arcs)
        assert np.mean(arcs) == pytest.approx(1300, abs=50)

    def test_as_many_arcs_a_node_at_every_size(self):
        nodes = 500
        mission = generators.terrain(nodes=nodes)
        assert 6.5 < mission.arrays.n_arcs / nodes < 7.3
        assert 0.9 <= mission.arrays.survival.min() < 0.901
        assert 0.994 < mission.arrays.survival.max() <= 0.995
        found = survivals(mission)
        assert (found[:, 0] != found[:, 1]).mean() > 0.99
        rewards = mission.arrays.reward
        assert rewards.min() >= 0
        assert rewards.max() <= 1
        assert rewards.mean() == pytest.approx(0.5, abs=0.05)

    @given(seeds, st.integers(2, 60))
    def test_near_waypoints_have_passages_and_the_nearest_parts_are_joined(self, seed, nodes):
        mission = generators.terrain(nodes=nodes, seed=seed)
        pos = dict(mission.graph.nodes(data="pos"))
        reach = 1.51 / math.sqrt(nodes)
        near = nx.Graph()
        near.add_nodes_from(pos)
        for u in pos:
            near.add_edges_from((u, v) for v in range(u) if math.dist(pos[u], pos[v]) <= reach)
        passages = mission.graph.to_undirected()
        parts = list(nx.connected_components(near))
        joints = [arc for arc in passages.edges if not near.has_edge(*arc)]
        assert all(passages.has_edge(*arc) for arc in near.edges)
        assert len(joints) == len(parts) - 1
        for u, v in joints:  # no shorter passage from one side of the joint to the other
            rest = passages.copy()
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

    def test_titles_and_numbers_of_depots(self):
        title = generators.terrain(nodes=9, depots=1).title
        assert title == "Rolling terrain: 9 waypoints, 1 depot, random geometric graph, seed 0"
        with pytest.raises(ValueError, match="Expected depots <= 8, the nodes beside the base, go"):
            generators.terrain(nodes=9, depots=9)


class TestTunnel:
    @given(seeds, st.integers(2, 60))
    def test_loops_are_few_and_what_is_near_is_joined(self, seed, nodes):
        mission = generators.tunnel(nodes=nodes, seed=seed)
        pos = dict(mission.graph.nodes(data="pos"))
        passages = mission.graph.to_undirected()
        assert nx.is_connected(passages)
        assert len(passages.edges) <= nodes - 1 + nodes // 6
        every = nx.Graph()
        every.add_weighted_edges_from((u, v, math.dist(pos[u], pos[v])) for u in pos for v in pos)
        joined = nx.Graph(passages)
        nx.set_edge_attributes(
            joined, {e: every.edges[e]["weight"] for e in joined.edges}, "weight"
        )
        shortest, found = (
            nx.minimum_spanning_tree(each).size(weight="weight") for each in (every, joined)
        )
        assert found == pytest.approx(shortest)
        for (u, v), survival in nx.get_edge_attributes(mission.graph, "survival").items():
            assert survival == pytest.approx(math.exp(-math.dist(pos[u], pos[v]) / 500), abs=1e-4)
        assert {*mission.arrays.reward.tolist()} <= {0.0, 0.15, 0.3, 0.5, 1.0}


class TestDronesAndRovers:
    @given(seeds, st.integers(1, 9), st.integers(1, 9))
    def test_what_each_can_do(self, seed, drones, rovers):
        mission = generators.drones_and_rovers(seed=seed, drones=drones, rovers=rovers)
        assert [(kind.name, kind.robots) for kind in mission.kinds] == [
            ("drone", drones),
            ("rover", rovers),
        ]
        assert mission.balanced
        graph, n = mission.graph, len(mission.nodes)
        zones = dict(graph.nodes(data="zone"))
        rewards = dict(zip(mission.nodes, mission.arrays.reward[n:].tolist(), strict=True))
        reached = {node for node, reward in rewards.items() if reward > 0}
        assert reached == {node for node, zone in zones.items() if zone in ("yard", "lab")}
        for arc in graph.edges.values():
            drone, rover = arc["survival"]["drone"], arc["survival"]["rover"]
            assert rover > drone if arc["way"] in ("ground", "indoors") else rover == 0

    def test_same_seed_same_mission(self, tmp_path):
        for number in "12":
            save_mission(generators.drones_and_rovers(seed=7), tmp_path / f"{number}.json")
        assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()
        assert generators.drones_and_rovers(seed=7) != generators.drones_and_rovers(seed=8)

    def test_seed_zero(self):
        mission = generators.drones_and_rovers()
        sums = mission.total_reward, mission.arrays.survival.sum(), mission.arrays.length.sum()
        assert (len(mission.nodes), len(mission.graph.edges), mission.robots) == (34, 102, 4)
        assert [round(float(number), 4) for number in sums] == [100, 156.0656, 2248]
