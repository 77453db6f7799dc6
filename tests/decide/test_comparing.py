"""The difference between two plans, in numbers and in words."""

from itertools import pairwise, permutations

import networkx as nx
import pytest
from hypothesis import given

from botohe_moo import Mission, TrailPlan
from botohe_moo.decide import compare
from tests.decide.made import MISSION, star, trips
from tests.decide.test_choosing import fronts


def both_ways(arcs, robots=2):
    graph = nx.DiGraph()
    for tail, head, survival in arcs:
        graph.add_edge(tail, head, survival=survival)
        graph.add_edge(head, tail, survival=survival)
    nx.set_node_attributes(graph, 1, "reward")
    return Mission(graph, base="dock", robots=robots)


# Two ways to the far end: by the cliff, 0.5 a hop, or through the tunnel, 0.9 a hop.
ARCS = [("dock", "far", 0.5), ("dock", "near", 0.9), ("near", "far", 0.9)]


def test_the_same():
    plan = trips(MISSION, "a", "b")
    found = compare(MISSION, plan, TrailPlan(plan.trails[::-1]))
    assert str(found) == "The plans are the same."
    assert (found.reward, found.survivors) == (0, 0)
    assert [(change.robot, change.other_robot) for change in found.table.itertuples()] == [
        (0, 1),
        (1, 0),
    ]
    assert all(change.same for change in found.table.itertuples())


def test_equal_trails_are_matched_though_others_have_the_same_arcs():
    to_and_fro = ["dock", "a", "dock", "b", "dock"], ["dock", "b", "dock", "a", "dock"]
    first, second = MISSION.plan(to_and_fro), MISSION.plan(to_and_fro[::-1])
    assert str(compare(MISSION, first, second)) == "The plans are the same."


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
    mission = both_ways(ARCS, robots=1)
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
    found = compare(mission, trips(mission), trips(mission, *labels))
    [*_, last] = found.sentences
    assert last.endswith("also visits j.")
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
    assert [change.robot for change in found.table.itertuples()] == list(robots)
    assert sorted(change.other_robot for change in found.table.itertuples()) == list(robots)
    trails = first.trails, second.trails

    def total(matching):
        return sum(
            arcs_apart(trails[0][i], trails[1][j]) for i, j in zip(robots, matching, strict=1)
        )

    matched = [change.other_robot for change in found.table.itertuples()]
    assert total(matched) == pytest.approx(min(map(total, permutations(robots))))
