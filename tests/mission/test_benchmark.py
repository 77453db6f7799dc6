"""Team-orienteering instances of Chao, Golden and Wasil, and arcs between points in the plane."""

import itertools
import math
from pathlib import Path

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, load_mission, save_mission, solve
from botohe_moo.mission import MissionError, read_mission
from botohe_moo.mission.formats.benchmark import nearest_pairs, spanning_pairs

DATA = Path(__file__).parents[1] / "data"
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


def faults_of(path, text):
    """The faults of an instance, which must name its file."""
    path.write_text(text)
    with pytest.raises(MissionError) as caught:
        read_mission(path)
    assert str(caught.value).startswith(str(path))
    return list(caught.value.faults)


def test_by_hand():
    mission = read_mission(DATA / "points.txt", neighbours=1)
    assert mission.nodes == (0, 1, 2, 3, 4)
    assert (mission.base, mission.robots, mission.name) == (0, 2, "points")
    assert mission.rewards.tolist() == [0, 7, 5, 24, 1.5]
    assert mission.graph.nodes[4]["pos"] == [3, -4]
    # The nearest: 0-1, 1-2 (at the same place), 2-1, 3-1, 4-0; they span already.
    near, far = math.exp(-5 / 10), math.exp(-45 / 10)
    survivals = {(0, 1): near, (1, 2): 1.0, (1, 3): far, (0, 4): near}
    both = survivals | {(v, u): s for (u, v), s in survivals.items()}
    assert {(u, v): s for u, v, s in mission.graph.edges(data="survival")} == both


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\t", ";").replace(" ", ";"),
        lambda text: text.replace("\n", "\n\n").replace("\t", "   "),
        lambda text: text.upper(),
        lambda text: text.replace("m 2", "m 2  # robots").replace("n 5", "# five points\nn 5"),
        lambda text: "\ufeff" + text.replace("\n", "\r\n"),
    ],
    ids=["semicolons", "blanks", "upper", "comments", "windows"],
)
def test_other_spellings(tmp_path, change):
    path = tmp_path / "other.txt"
    path.write_text(change((DATA / "points.txt").read_text()))
    assert read_mission(path) == read_mission(DATA / "points.txt")


def test_a_file_with_semicolons():
    assert read_mission(DATA / "points_semicolons.TXT") == read_mission(DATA / "points.txt")


def test_trails_lead_from_the_first_point_to_the_last():
    mission = read_mission(DATA / "points.txt")
    assert mission.kinds == (Kind("robot", 2, end=4),)
    assert mission.max_length == 10
    assert mission.limits().budgets.tolist() == [10] * 2
    assert mission.labels(mission.stay_home()) == ((0, 4), (0, 4))
    with pytest.raises(ValueError, match="expected the trail to end at node 4, got 0"):
        mission.plan([[0, 1, 0], [0, 4]])
    # Options change the number of robots, the start, or all of it.
    assert read_mission(DATA / "points.txt", robots=7).kinds == (Kind("robot", 7, end=4),)
    assert read_mission(DATA / "points.txt", base="2").kinds[0].ends(2) == (2, 4)
    own = Kind("rover", 1, max_length=99)
    assert read_mission(DATA / "points.txt", kinds=[own]).kinds == (own,)


def test_it_is_saved_with_its_end(tmp_path):
    mission = read_mission(DATA / "points.txt", robots=3)
    for name in ("again.json", "again.geojson"):
        save_mission(mission, tmp_path / name)
        assert read_mission(tmp_path / name) == mission


@pytest.mark.parametrize(
    "points", [[(1, 2, 0)], [(1, 2, 0), (3, 2, 5), (1, 2, 0)]], ids=["one point", "the same place"]
)
def test_a_loop_where_both_ends_are_one_place(instance, points):
    mission = read_mission(instance(points, robots=3))
    assert mission.is_plain
    assert mission.kinds == (Kind("robot", 3),)
    assert len(mission.nodes) == len(points)
    assert mission.labels(mission.stay_home()) == ((0,),) * 3


def test_an_end_that_is_too_far_away(instance):
    path = instance([(0, -7, 0), (1, 0, 9), (0, 7, 0)], tmax=7.5)
    with pytest.raises(
        MissionError, match=r"cannot keep max_length 7\.5\. .* from 0 to 2, .* is 14 long"
    ):
        read_mission(path)


# Chao, Golden and Wasil list these values for the first of their problems, and no better ones are
# known. The points are those of Tsiligirides, "Heuristic methods applied to orienteering", Journal
# of the Operational Research Society 35 (1984) 797-809.
@pytest.mark.parametrize(
    ("robots", "tmax", "best"),
    [(2, 2.5, 0), (2, 7.5, 20), (2, 12.5, 45), (2, 15, 80), (2, 25, 155), (3, 10, 40), (4, 5, 15)],
)
def test_published_values(tmp_path, robots, tmax, best):
    path = tmp_path / "p1.txt"
    text = (DATA / "p1.2.a.txt").read_text()
    path.write_text(text.replace("m 2", f"m {robots}").replace("tmax 2.5", f"tmax {tmax}"))
    mission = load_mission(path, neighbours="all", scale=1e12)
    front = solve(mission, evaluations=20_000, seed=1)
    reward, survivors = front.objectives[front.objectives[:, 0].argmax()]
    assert reward == pytest.approx(best, abs=1e-6)
    assert survivors == pytest.approx(robots)
    lengths = mission.trail_lengths(front.plans)
    assert lengths.max() <= tmax
    assert {trail[-1] for plan in front.plans for trail in mission.labels(plan)} == {31}


def best_by_trying(points, robots, tmax):
    """The highest score of so many paths from the first point to the last, each within tmax."""
    last = len(points) - 1
    sets = {frozenset()}
    for size in range(1, last):
        for inner in itertools.permutations(range(1, last), size):
            path = [points[i][:2] for i in (0, *inner, last)]
            if sum(itertools.starmap(math.dist, itertools.pairwise(path))) <= tmax:
                sets.add(frozenset(inner))
    teams = itertools.combinations_with_replacement(sets, robots)
    return max(sum(points[i][2] for i in frozenset().union(*team)) for team in teams)


@pytest.mark.parametrize("algorithm", ["pareto-local-search", "bo-aco", "nsga2"])
def test_searches_find_what_trying_finds(instance, algorithm):
    points = [(0, 0, 0), (1, 3, 4), (2, -2, 7), (4, 1, 2), (5, -3, 9), (3, 4, 6), (6, 0, 0)]
    best = best_by_trying(points, 2, 9.0)
    assert 0 < best < sum(score for *_, score in points)
    mission = read_mission(instance(points, robots=2), neighbours="all", scale=1e12)
    front = solve(mission, algorithm=algorithm, evaluations=4_000, seed=1)
    assert front.objectives[:, 0].max() == pytest.approx(best)


def test_distances_and_tmax():
    mission = read_mission(DATA / "points.txt", neighbours=1)
    assert mission.max_length == 10
    lengths = {(u, v): d for u, v, d in mission.graph.edges(data="length") if u < v}
    assert lengths == {(0, 1): 5, (1, 2): 0, (1, 3): 45, (0, 4): 5}
    assert mission.with_lengths_from_pos() == mission


def test_arcs_between_all_points():
    path = DATA / "p1.2.a.txt"
    every = read_mission(path, neighbours="all")
    assert len(every.graph.edges) == 32 * 31
    assert len(read_mission(path).graph.edges) < 32 * 31
    assert read_mission(path, neighbours=99) == every


def test_spanning_tree_joins_what_neighbours_leave_apart(instance):
    path = instance([(0, 0, 0), (1, 0, 1), (50, 0, 1), (51, 0, 1)], tmax=99)
    arcs = read_mission(path, neighbours=1).graph.edges
    assert set(arcs) == {(0, 1), (1, 0), (1, 2), (2, 1), (2, 3), (3, 2)}


def test_scale(instance):
    mission = read_mission(DATA / "points.txt", scale=2.5)
    assert mission.graph.edges[0, 1]["survival"] == math.exp(-5 / 2.5)
    path = instance([(0, 0, 4)], tmax=0)
    assert read_mission(path, scale=1).total_reward == 4
    with pytest.raises(MissionError, match="expected tmax > 0 to be the scale, got 0; give a"):
        read_mission(path)
    with pytest.raises(MissionError, match="expected a finite max_length >= 0, got -3"):
        read_mission(instance([(0, 0, 0)], tmax=-3), scale=1)


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        (
            "n five\n\nk 3\n",
            [
                "line 1: expected 'n' and a number, got 'n five'",
                "line 3: expected 'm' and a number, got 'k 3'",
                "the end: expected 'tmax' and a number, got ''",
            ],
        ),
        (
            "n 4\nm 3\ntmax 9\n\n0 0\n1 2 three\n1 2 3\n1 2 3 0 4\n1 inf 3",
            [
                "line 5: expected three numbers, x, y and a score, got '0 0'",
                "line 6: expected three numbers, x, y and a score, got '1 2 three'",
                "line 8: expected three numbers, x, y and a score, got '1 2 3 0 4'",
                "line 9: expected three numbers, x, y and a score, got '1 inf 3'",
            ],
        ),
        (
            "n 2\nm 1\ntmax 9\n0 0 0",
            ["line 1: expected n 1, the number of lines after tmax, got 2"],
        ),
        (
            "n 1\nm 0\ntmax 9\n0 0 -1",
            [
                "expected robots to be an integer >= 1, got 0",
                "node 0: expected a finite reward >= 0, got -1.0",
            ],
        ),
        (
            "n 2\nm 1.5\ntmax 9\n0 0 0\n1 1 0",
            ["kind 'robot': expected robots to be an integer in [1, 1000000], got 1.5"],
        ),
        ("85 1\n10.5 14.4 0\n18 15.9 10", ["line 1: expected 'n' and a number, got '85 1'"]),
        ("", ["the end: expected 'n' and a number, got ''"]),
        ("n 0\nm 1\ntmax 9", ["base 0: there is no such node"]),
        ("n 1\nm 1\ntmax -3\n0 0 0", ["expected tmax > 0 to be the scale, got -3; give a scale"]),
    ],
)
def test_bad_lines(tmp_path, text, faults):
    assert faults_of(tmp_path / "bad.txt", text)[: len(faults)] == faults


@pytest.mark.parametrize(
    ("option", "fault"),
    [
        ({"neighbours": 0}, r"Expected neighbours in \[1, 1000000\] or 'all', got 0\."),
        (
            {"neighbours": "none"},
            r"Expected neighbours to be an integer in .* or 'all', got 'none'",
        ),
        ({"scale": 0}, r"Expected scale > 0, got 0\."),
    ],
)
def test_options_out_of_range(option, fault):
    with pytest.raises(ValueError, match=fault):
        read_mission(DATA / "points.txt", **option)


@given(grids)
def test_spanning_tree_is_as_short_as_networkx_finds(grid):
    points = np.array(grid, float)
    ours = spanning_pairs(points)
    every = nx.Graph()
    every.add_nodes_from(range(len(grid)))
    for u, v in itertools.combinations(range(len(grid)), 2):
        every.add_edge(u, v, weight=math.dist(grid[u], grid[v]))
    theirs = nx.minimum_spanning_tree(every)
    assert nx.number_connected_components(nx.Graph([*ours, *[(v, v) for v in every]])) == 1
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


def test_a_scale_that_leaves_no_survival(instance):
    path = instance([(0, 0, 0), (3, 4, 1), (0, 0, 0)])
    with pytest.raises(MissionError, match=r"Points 0 and 1: expected survival >= 5e-324, .* 5"):
        read_mission(path, scale=0.001)
