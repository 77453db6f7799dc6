"""Team-orienteering instances of Chao, Golden and Wasil, and arcs between points in the plane."""

import itertools
import math
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, MissionError, load_mission, mission_from_tables, save_mission, solve
from botohe_moo.mission import read_mission
from botohe_moo.mission.formats.benchmark import nearest_pairs, spanning_pairs

DATA = Path(__file__).parents[1] / "data"
POINTS = DATA / "points.txt"
grids = st.lists(st.tuples(*[st.integers(0, 5)] * 2), min_size=1, max_size=12)


@pytest.fixture
def instance(tmp_path):
    """Writes an instance; returns its path."""

    def write(points, robots=1, tmax=9.0):
        path = tmp_path / "instance.txt"
        rows = ["\t".join(map(str, point)) for point in points]
        path.write_text("\n".join([f"n {len(points)}", f"m {robots}", f"tmax {tmax}", *rows]))
        return path

    return write


def test_by_hand(tmp_path):
    mission = read_mission(POINTS, neighbours=1)
    assert mission.nodes == (0, 1, 2, 3, 4)
    assert (mission.base, mission.name, mission.max_length) == (0, "points", 10)
    assert mission.rewards.tolist() == [0, 7, 5, 24, 1.5]
    assert mission.graph.nodes[4]["pos"] == [3, -4]
    # The nearest: 0-1, 1-2 (at the same place), 2-1, 3-1, 4-0; they span already.
    lengths = {(0, 1): 5, (1, 2): 0, (1, 3): 45, (0, 4): 5}
    arcs = {ends: {"length": d, "survival": math.exp(-d / 10)} for ends, d in lengths.items()}
    assert dict(mission.graph.edges) == arcs | {(v, u): arc for (u, v), arc in arcs.items()}
    save_mission(mission, tmp_path / "again.json")
    assert read_mission(tmp_path / "again.json") == mission


def test_other_spellings(tmp_path):
    text, path = POINTS.read_text(), tmp_path / "other.TXT"
    for other in (
        text.replace("\t", ";").replace(" ", ";"),
        text.replace("\n", "\n\n").replace("\t", "   ").upper(),
        text.replace("m 2", "m 2  # robots").replace("n 5", "# five points\nn 5"),
        "\ufeff" + text.replace("\n", "\r\n"),
        (DATA / "points_semicolons.TXT").read_text(),  # as published
    ):
        path.write_text(other)
        assert read_mission(path) == read_mission(POINTS)


def test_trails_lead_from_the_first_point_to_the_last(instance):
    mission = read_mission(POINTS)
    assert mission.kinds == (Kind("robot", 2, end=4),)
    assert mission.labels(mission.stay_home()) == ((0, 4), (0, 4))
    with pytest.raises(ValueError, match="expected the trail to end at node 4, got 0"):
        mission.plan([[0, 1, 0], [0, 4]])
    # Options change the number of robots, the start, or all of it.
    assert read_mission(POINTS, robots=7).kinds == (Kind("robot", 7, end=4),)
    assert read_mission(POINTS, base="2").kinds[0].ends(2) == (2, 4)
    own = Kind("rover", 1, max_length=99)
    assert read_mission(POINTS, kinds=[own]).kinds == (own,)
    path = instance([(0, -7, 0), (1, 0, 9), (0, 7, 0)], tmax=7.5)
    with pytest.raises(MissionError, match=r"max_length 7\.5\. .* from 0 to 2, .* 14 long"):
        read_mission(path)


def test_a_loop_where_both_ends_are_one_place(instance):
    for points in ([(1, 2, 0)], [(1, 2, 0), (3, 2, 5), (1, 2, 0)]):
        mission = read_mission(instance(points, robots=3))
        assert (mission.is_plain, len(mission.nodes)) == (True, len(points))


def test_options_of_all_formats(instance):
    """All points have a score, and both ways are there already."""
    points = [(1, 1, 0), (5, 1, 3), (5, 4, 2), (1, 1, 0)]
    nodes = pd.DataFrame(points, columns=["x", "y", "reward"]).assign(label=range(4))
    arcs = pd.DataFrame(itertools.permutations(range(4), 2), columns=["tail", "head"])
    kinds = [Kind("drone", 2, start=1), Kind("rover", 1)]
    for own in ({"base": 2}, {"robots": 5, "reward": 2}, {"both_ways": True}, {"kinds": kinds}):
        given = {"base": 0} | ({} if "kinds" in own else {"robots": 2}) | own | {"pays": "return"}
        expected = mission_from_tables(nodes, arcs, max_length=40, danger=1 / 40, **given)
        path = instance(points, robots=2, tmax=40)
        assert load_mission(path, pays="return", **own) == expected


# Chao, Golden and Wasil list these values for the first of their problems, and no better ones are
# known. The points are those of Tsiligirides, "Heuristic methods applied to orienteering", Journal
# of the Operational Research Society 35 (1984) 797-809.
@pytest.mark.parametrize(
    ("robots", "tmax", "best"), [(2, 2.5, 0), (2, 7.5, 20), (2, 25, 155), (3, 10, 40), (4, 5, 15)]
)
def test_published_values(tmp_path, robots, tmax, best):
    path = tmp_path / "p1.txt"
    text = (DATA / "p1.2.a.txt").read_text()
    path.write_text(text.replace("m 2", f"m {robots}").replace("tmax 2.5", f"tmax {tmax}"))
    mission = load_mission(path, neighbours="all", scale=1e12)
    front = solve(mission, evaluations=20_000, seed=1)
    reward, survivors = front.objectives[front.objectives[:, 0].argmax()]
    assert (reward, survivors) == (pytest.approx(best, abs=1e-6), pytest.approx(robots))
    assert mission.trail_lengths(front.plans).max() <= tmax
    assert {trail[-1] for plan in front.plans for trail in mission.labels(plan)} == {31}


def test_neighbours(instance):
    path = DATA / "p1.2.a.txt"
    every = read_mission(path, neighbours="all")
    assert len(every.graph.edges) == 32 * 31 > len(read_mission(path).graph.edges)
    assert read_mission(path, neighbours=99) == every
    # The spanning tree joins what neighbours leave apart.
    apart = instance([(0, 0, 0), (1, 0, 1), (50, 0, 1), (51, 0, 1)], tmax=99)
    arcs = read_mission(apart, neighbours=1).graph.edges
    assert {*arcs} == {(0, 1), (1, 0), (1, 2), (2, 1), (2, 3), (3, 2)}


def test_scale(instance):
    mission = read_mission(POINTS, scale=2.5)
    assert mission.graph.edges[0, 1]["survival"] == math.exp(-5 / 2.5)
    assert read_mission(instance([(0, 0, 4)], tmax=0), scale=1).total_reward == 4
    with pytest.raises(MissionError, match="expected a finite max_length >= 0, got -3"):
        read_mission(instance([(0, 0, 0)], tmax=-3), scale=1)
    path = instance([(0, 0, 0), (3, 4, 1), (0, 0, 0)])
    with pytest.raises(MissionError, match=r"Points 0 and 1: expected survival >= 5e-324, .* 5"):
        read_mission(path, scale=0.001)
    for option, fault in (
        ({"neighbours": 0}, r"Expected neighbours in \[1, 1000000\] or 'all', got 0\."),
        ({"scale": 0}, r"Expected scale > 0, got 0\."),
    ):
        with pytest.raises(ValueError, match=fault):
            read_mission(POINTS, **option)


@given(grids)
def test_spanning_tree_is_as_short_as_networkx_finds(grid):
    ours, every = spanning_pairs(np.array(grid, float)), nx.empty_graph(len(grid))
    for u, v in itertools.combinations(range(len(grid)), 2):
        every.add_edge(u, v, weight=math.dist(grid[u], grid[v]))
    theirs = nx.minimum_spanning_tree(every)
    assert nx.is_connected(nx.Graph([*ours, *[(v, v) for v in every]]))
    assert len(ours) == len(grid) - 1
    length = sum(math.dist(grid[u], grid[v]) for u, v in ours)
    assert length == pytest.approx(theirs.size(weight="weight"))


@given(grids, st.integers(0, 12))
def test_nearest_pairs_are_the_first_of_all_by_distance(grid, degree):
    degree = min(degree, len(grid) - 1)
    expected = []
    for u, (x, y) in enumerate(grid):
        squares = [((a - x) ** 2 + (b - y) ** 2, v) for v, (a, b) in enumerate(grid) if v != u]
        expected += [(min(u, v), max(u, v)) for _, v in sorted(squares)[:degree]]
    assert list(nearest_pairs(np.array(grid, float), degree)) == expected
