"""The difference between two plans, in numbers and in words."""

from itertools import pairwise, permutations

import networkx as nx
import pytest
from hypothesis import given

from botohe_moo import Mission
from botohe_moo.decide import compare
from tests.decide.made import ATTIC, BOTH, HOUSE, MISSION, star, trips
from tests.decide.test_choosing import fronts


def test_equal_trails_are_matched_though_others_have_the_same_arcs():
    to_and_fro = ["dock", "a", "dock", "b", "dock"], ["dock", "b", "dock", "a", "dock"]
    found = compare(MISSION, MISSION.plan(to_and_fro), MISSION.plan(to_and_fro[::-1]))
    assert (str(found), found.reward, found.survivors) == ("The plans are the same.", 0, 0)
    assert found.table["other_robot"].tolist() == [1, 0]
    assert found.table["same"].all()


def test_nodes_gained_and_lost():
    found = compare(MISSION, trips(MISSION, "a", "b"), trips(MISSION, "c", "a"))
    assert (found.reward, found.survivors) == (pytest.approx(-0.8), pytest.approx(0.1))
    assert found.sentences == (
        "The second plan has 0.8 less reward and 0.1 more survivors.",
        "Robot 1 (robot 0 in the second plan): survival 0.9 -> 1; also visits c; no longer visits "
        "b.",
    )


def test_the_table_has_a_row_for_each_robot():
    found = compare(MISSION, trips(MISSION, "b"), trips(MISSION, "b", "b"))
    assert found.sentences[0] == "The second plan has 0.18 more reward and 0.1 fewer survivors."
    assert found.table.to_dict("list") == {
        "robot": [0, 1],
        "other_robot": [0, 1],
        "kind": ["robot", "robot"],
        "survival": [0.9, 1],
        "other_survival": [0.9, 0.9],
        "gained": [(), ("b",)],
        "lost": [(), ()],
        "same": [True, False],
    }


def test_a_safer_way_to_the_same_nodes():
    # By the cliff, 0.5 a hop, or through the tunnel, 0.9 a hop.
    graph = nx.DiGraph(base="dock", robots=1)
    for ends, survival in (("dock far", 0.5), ("dock near", 0.9), ("near far", 0.9)):
        nx.add_path(graph, [*ends.split(), ends.split()[0]], survival=survival)
    nx.set_node_attributes(graph, 1, "reward")
    mission = Mission(graph)
    cliff = mission.plan([["dock", "far", "near", "dock"]])  # 0.5 x 0.9 x 0.9
    tunnel = mission.plan([["dock", "near", "far", "near", "dock"]])  # 0.9 ^ 4
    around = mission.plan([["dock", "near", "far", "dock"]])
    found = compare(mission, cliff, tunnel)
    robot = "Robot 0 (robot 0 in the second plan)"
    assert found.sentences[1] == (
        f"{robot}: survival 0.405 -> 0.6561; another trail to the same nodes."
    )
    assert "survival 0.6561 -> 0.405" in compare(mission, tunnel, cliff).sentences[1]
    assert compare(mission, cliff, around).sentences[1] == (
        f"{robot}: survival 0.405; another trail to the same nodes."
    )


def test_labels_and_long_lists():
    labels = ["north hall", 7, *"bcdefghij"]
    mission = star(dict.fromkeys(labels, (1, 0.5)), robots=11)
    there_and_on = ["dock", *(stop for label in labels for stop in (label, "dock"))]
    alone = mission.plan([there_and_on, *[["dock"]] * 10])
    [_, said] = compare(mission, trips(mission), alone).sentences
    assert said.endswith('also visits "north hall", 7, b, c, d, e, f, g, h, i, j.')


def arcs_apart(first, second):
    ours, others = (set(pairwise(trail)) for trail in (first, second))
    return 1 - len(ours & others) / len(ours | others) if ours | others else 0.0


@given(fronts(max_plans=2))
def test_what_holds_for_all(front):
    mission, plans = front
    first, second = plans[0], plans[-1]
    found = compare(mission, first, second)
    (r, s), (other_r, other_s) = mission.evaluate([first, second]).tolist()
    assert (found.reward, found.survivors) == (other_r - r, other_s - s)
    assert (str(found) == "The plans are the same.") == (first == second)
    robots = range(mission.robots)
    robots, matched = range(mission.robots), found.table["other_robot"].tolist()
    assert found.table["robot"].tolist() == sorted(matched) == list(robots)
    trails = first.trails, second.trails

    def total(matching):
        pairs = zip(robots, matching, strict=True)
        return sum(arcs_apart(trails[0][i], trails[1][j]) for i, j in pairs)

    kinds = mission.kind_of
    possible = [[*m] for m in permutations(robots) if [kinds[j] for j in m] == [*kinds]]
    assert matched in possible
    assert total(matched) == pytest.approx(min(map(total, possible)))


def test_robots_are_compared_within_their_kind():
    # The trail of the first drone has most in common with that of the second one.
    swapped = HOUSE.plan([["roof"], ["roof", "attic", "roof"], ["dock"]])
    assert compare(HOUSE, ATTIC, swapped).sentences == (
        "The second plan has 4.5 less reward and 0.25 more survivors.",
        "Robot 2 (robot 2 in the second plan): survival 0.75 -> 1; no longer visits cellar.",
    )
    table = compare(HOUSE, BOTH, ATTIC).table
    assert table["other_robot"].tolist() == [1, 0, 2]
    assert table["kind"].tolist() == ["drone", "drone", "rover"]
