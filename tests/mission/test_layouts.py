import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.mission import generators, save_mission
from tests.examples import examples

ALL = [generators.lattice, generators.town, generators.building, generators.orienteering]
seeds = st.integers(0, 2**64)


def is_alike_both_ways(graph):
    return all(said == graph.edges[head, tail] for tail, head, said in graph.edges(data=True))


def survivals(graph):
    """Survivals of arcs, by what is written at both of their ends."""
    found = {}
    for tail, head, survival in graph.edges(data="survival"):
        ends = frozenset(graph.nodes[node]["place"] for node in (tail, head))
        found.setdefault(ends, []).append(survival)
    return {ends: np.array(numbers) for ends, numbers in found.items()}


@pytest.mark.parametrize("generate", ALL)
class TestEvery:
    def test_same_seed_same_mission(self, generate, tmp_path):
        for number in "12":
            save_mission(generate(seed=7), tmp_path / f"{number}.json")
        assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()
        assert generate(seed=7) != generate(seed=8)
        assert generate() == generate(seed=0)

    @examples(40)
    @given(seed=seeds, robots=st.integers(1, 9))
    def test_valid_named_and_laid_out(self, generate, seed, robots):
        mission = generate(seed=seed, robots=robots)
        assert mission.robots == robots
        assert mission.is_plain
        assert mission.name == generate.__name__
        assert str(seed) in mission.title
        assert mission.graph.nodes[mission.base]["reward"] == 0
        assert all(len(pos) == 2 for _, pos in mission.graph.nodes(data="pos"))


class TestLattice:
    def test_shape(self):
        graph = generators.lattice(rows=3, columns=4).graph
        places = {tuple(pos): node for node, pos in graph.nodes(data="pos")}
        grid = nx.grid_2d_graph(4, 3).to_directed()
        assert {(places[tail], places[head]) for tail, head in grid.edges} == {*graph.edges}
        assert places[0, 0] == graph.graph["base"]
        assert [reward for _, reward in graph.nodes(data="reward")] == [0] + [1] * 11

    def test_numbers(self):
        mission = generators.lattice(rows=30, columns=30)
        assert is_alike_both_ways(mission.graph)
        found = mission.arrays.survival
        assert 0.9 <= found.min() < 0.901
        assert 0.999 < found.max() < 1
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
        arrays = generators.town(streets=30).arrays
        for found, low, high in ((arrays.survival, 0.9, 1), (arrays.reward[1:], 0.1, 1)):
            near = (high - low) / 100
            assert low <= found.min() < low + near
            assert high - near < found.max() < high
            assert found.mean() == pytest.approx((low + high) / 2, abs=3 * near)

    def test_odd_numbers_of_streets(self):
        with pytest.raises(ValueError, match="Expected streets to be a multiple of 2, got 3"):
            generators.town(streets=3)


class TestBuilding:
    @examples(60)
    @given(seeds, st.integers(1, 4), st.integers(1, 5))
    def test_shape(self, seed, floors, doors):
        mission = generators.building(floors=floors, doors=doors, seed=seed)
        graph = mission.graph
        zones, pos = dict(graph.nodes(data="zone")), dict(graph.nodes(data="pos"))
        assert len(graph) == 3 * doors * floors
        assert nx.is_strongly_connected(graph)
        assert is_alike_both_ways(graph)
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
        graph = generators.building(floors=floors, doors=doors).graph.copy()
        rewards = []
        for _, node in graph.nodes(data=True):
            floor = int(node["zone"].removeprefix("floor "))
            node["place"] = "room" if (is_room := node["pos"][1] % 20) else "hall"
            assert (node["reward"] > 0) == bool(is_room)
            rewards += [node["reward"] / (1 + floor / 2)] if is_room else []
        assert 0.2 <= min(rewards) < 0.21
        assert 0.98 < max(rewards) < 1
        assert np.mean(rewards) == pytest.approx(0.6, abs=0.03)
        up = [(u, v) for u, v in graph.edges if graph.nodes[u]["zone"] != graph.nodes[v]["zone"]]
        stairs = [graph.edges[arc]["survival"] for arc in up]
        assert 0.92 <= min(stairs) < 0.93
        assert 0.96 < max(stairs) < 0.97
        graph.remove_edges_from(up)
        found = survivals(graph)
        for ends, low, high in (
            (["hall"], 0.97, 1),
            (["hall", "room"], 0.9, 0.99),
            (["room"], 0.9, 0.99),
        ):
            numbers = found[frozenset(ends)]
            assert low <= numbers.min() < low + 0.003
            assert high - 0.003 < numbers.max() < high
        pairs = 2 * floors * (doors - 1)
        assert len(found[frozenset(["room"])]) == pytest.approx(2 * pairs / 3, rel=0.15)

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

    def test_as_many_wheeled_robots_as_there_are(self):
        with pytest.raises(ValueError, match="Expected wheeled to be fewer than all 3 robots, got"):
            generators.building(robots=3, wheeled=3)


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

    def test_budgets_that_are_not_finite(self):
        with pytest.raises(ValueError, match="Expected tour to be a finite number > 0, got inf"):
            generators.orienteering(tour=math.inf)
