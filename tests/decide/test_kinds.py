"""Choosing where there are several kinds of robots, and rewards on return.

Two drones start and end on the roof, where they deposit, too; a rover leaves the dock. The drones
collect what is in the cellar with a share of 1/2. All ways back are safe:

    node     reward   survival out: drone   rover
    attic    4        0.5                   -
    cellar   6        0.25, by the dock     0.75
"""

import json

import networkx as nx
import numpy as np
import pytest

from botohe_moo import Kind, Mission, read_solution
from botohe_moo import decide as d
from botohe_moo.cli.plans import trails_text
from botohe_moo.decide import choose, compare, parse_wishes, robustness
from tests.decide.made import MISSION, Chance, Expected, Reach, TailMean, solution_of


def house(rover="rover"):
    graph = nx.DiGraph(pays="return", base="dock")
    for i, (node, reward) in enumerate({"dock": 0, "roof": 0, "attic": 4, "cellar": 6}.items()):
        graph.add_node(node, reward=reward, depot=node == "roof", pos=[i, 0])
    graph.nodes["cellar"]["share"] = {"drone": 0.5}
    for tail, head, drone, by_rover in (
        ("roof", "attic", 0.5, 0),
        ("roof", "dock", 1, 0),
        ("dock", "cellar", 0.25, 0.75),
    ):
        graph.add_edge(tail, head, survival={"drone": drone, rover: by_rover})
        graph.add_edge(head, tail, survival={"drone": 1, rover: float(by_rover > 0)})
    kinds = [Kind("drone", 2, start="roof", end="roof"), Kind(rover, 1)]
    return Mission(graph, kinds=kinds, name="house")


HOUSE = house()
ROVER = ["dock", "cellar", "dock"]
DEEP = ["roof", "dock", "cellar", "dock", "roof"]
# E[R] and E[S]: 4 x 0.5 + 6 x 0.75 = 6.5 and 2.25; 4.5 and 2.75; 2 + 6 (1 - 0.25 x 0.875) and 1.5.
ATTIC = HOUSE.plan([["roof", "attic", "roof"], ["roof"], ROVER])
GROUND = HOUSE.plan([["roof"], ["roof"], ROVER])
BOTH = HOUSE.plan([DEEP, ["roof", "attic", "roof"], ROVER])
PLANS = [ATTIC, GROUND, BOTH]


def test_survivors_of_a_kind():
    answers = {
        "drone survivors >= 0.75": BOTH,
        "drone survivors >= 1.5": ATTIC,
        "P(drone survivors >= 2) >= 0.5": ATTIC,
        "P( drone survivors >= 1 ) >= 0.6": BOTH,  # 1 - 0.75 x 0.5
        "CVaR(drone survivors, 0.5) >= 1": ATTIC,
        '"drone" survivors >= 2 and rover survivors >= 0.75': GROUND,
    }
    assert {wish: choose(HOUSE, PLANS, wish).plan for wish in answers} == answers
    choice = choose(HOUSE, PLANS, "drone survivors >= 2.5")
    assert choice.plan == GROUND
    assert not choice.met


def test_wishes_of_a_kind_are_written_and_read():
    made = {
        "drone survivors >= 1": Expected(quantity="survivors", at_least=1, kind="drone"),
        'P("lake boat" survivors >= 1) >= 0.5': Chance(
            quantity="survivors", value=1, at_least=0.5, kind="lake boat"
        ),
        'CVaR("lake boat" survivors, 0.5) >= 1': TailMean(
            quantity="survivors", alpha=0.5, at_least=1, kind="lake boat"
        ),
    }
    assert [*map(str, made.values())] == list(made)
    assert parse_wishes(house(rover="lake boat"), [" and ".join(made)]) == tuple(made.values())


def test_a_node_named_survivors():
    mission = Mission(nx.relabel_nodes(HOUSE.graph, {"attic": "survivors"}), kinds=HOUSE.kinds)
    [wish] = parse_wishes(mission, ["reach survivors >= 0.5"])
    assert wish == Reach(node="survivors", at_least=0.5)


def test_kinds_that_there_are_not():
    reward = Expected(quantity="reward", at_least=1, kind="drone")
    for mission, wish, fault in (
        (HOUSE, "dron survivors >= 1", "no survivors of kind 'dron'; most alike are drone, rover."),
        (HOUSE, "P(boat survivors >= 1) >= 0", "no survivors of kind 'boat'; most alike are"),
        (MISSION, "drone survivors >= 1", "no survivors of kind 'drone'; most alike are robot."),
        (HOUSE, "drone reward >= 1", "survivors, or survivors of a kind, in place of reward"),
        (HOUSE, reward, "has no reward of kind 'drone'"),
    ):
        with pytest.raises(ValueError, match=fault):
            parse_wishes(mission, [wish])


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


def test_an_arc_is_as_wrong_for_all_kinds():
    kinds = [Kind("drone", 1), Kind("rover", 1)]
    mission = Mission(MISSION.graph, base="dock", kinds=kinds)
    out = ["dock", "b", "dock"]
    plans = [mission.plan([out, ["dock"]]), mission.plan([["dock"], out])]
    table = robustness(mission, plans, factors=(), spread=0.5, n_scenarios=3)
    assert table["survivors_low"].nunique() == 1
    assert table["survivors_low"][0] < 1.9


def test_plans_as_files():
    assert d.robot_table(HOUSE, BOTH).to_dict("list") == {
        "robot": [0, 1, 2],
        "kind": ["drone", "drone", "rover"],
        "survival": [0.25, 0.5, 0.75],
        "length": [4, 2, 2],
        "reward": [0.75, 2, 4.5],
    }
    shapes = [shape["properties"] for shape in json.loads(d.plan_geojson(HOUSE, BOTH))["features"]]
    own = {"robot": 1, "survival": 0.5, "kind": "drone", "length": 2, "reward": 2}
    assert shapes[1] == {**own, "nodes": ["roof", "attic", "roof"]}
    assert shapes[-1] == {"node": "cellar", "reward": 6, "reached": 0.8125, "collected": 0.78125}


def test_a_solution_is_read_back(tmp_path):
    written = solution_of(HOUSE, PLANS)
    (tmp_path / "plans.json").write_text(written.to_json())
    again = read_solution(tmp_path, mission=HOUSE)
    assert again.plans == written.plans
    assert np.array_equal(again.objectives, written.objectives)


def test_the_text_of_a_choice_names_kinds():
    assert trails_text(HOUSE, ATTIC).splitlines() == [
        "robot 0 (drone, survival 0.500):  roof -> attic -> roof",
        "robot 1 (drone, survival 1.000):  stays at roof",
        "robot 2 (rover, survival 0.750):  dock -> cellar -> dock",
    ]
