"""What breaks the rules of missions, kinds, nodes and arcs, and the words that name it."""

import math
import pickle
from dataclasses import replace
from fractions import Fraction
from types import MappingProxyType

import networkx as nx
import numpy as np
import pytest

from botohe_moo.mission import Kind, Mission, MissionError
from botohe_moo.mission.rules import read_kinds
from tests.mission.made import BOTH, DRONE, ROVER, faults_of, harbour, team_site

NODE, ARC = "node 'reef': ", "arc 'dock' -> 'reef': "
LAB = "arc 'dock' -> 'lab'"
ROBOTS = "expected robots to be an integer in [1, 1000000]"
NOT_ABOARD, ON_RETURN = (["lab", "lab"], ["roof"], ["dock"]), "expected a node that pays on"
UNLISTED = "no such kind; the mission lists no kinds"
NO_WAY = "robots of kind 'rover' cannot keep "
FOUND = ". The safest way from 'lab' to 'dock', or the shortest one if that is too long, is survi"


def plain(**changes):
    """A mission of one kind, with changes."""
    return harbour(**changes), {}


def team(kinds=BOTH, robots=None, **changes):
    """A mission of two kinds, with changes."""
    return team_site(**changes), {"kinds": kinds, "robots": robots}


def rover(graph=None, **changes):
    """A mission of two kinds, whose rover is changed."""
    lab = {"pays": "return"} if "aboard" in changes else {}
    dock = lab | {"depot": True} if lab else {}
    return team([DRONE, replace(ROVER, **changes)], graph=graph or {}, lab=lab, dock=dock)


def wild():
    """A harbour with much that is wrong."""
    graph = harbour(reef={"reward": -1})
    graph.add_node("wreck")
    graph.add_node("isle", reward=0)
    graph.add_edge("dock", "wreck")
    graph.add_edge("reef", "reef", survival=1)
    graph.add_edge("isle", "dock", survival=2)
    return graph, {"robots": 0, "name": "wild"}


def unjoined(*kinds):
    graph = nx.DiGraph([("dock", "wreck"), ("isle", "dock")])
    nx.set_node_attributes(graph, {"dock": 1, "wreck": 0, "isle": 0}, "reward")
    nx.set_edge_attributes(graph, 1, "survival")
    return graph, {"base": "dock"} | ({"kinds": kinds} if kinds else {"robots": 1})


class TestNumbersAndFlags:
    @pytest.mark.parametrize(
        ("whose", "name", "expected", "values"),
        [
            ("reef", "reward", "a finite reward >= 0", [-0.1, math.nan, math.inf, True, "1", None]),
            ("reef", "pos", "pos [x, y], two finite numbers", [[math.nan, 0], [1, 2, 3], "ab", 7]),
            ("reef", "share", "share in [0, 1]", [-0.1, 1.1, math.nan, "1", True, None]),
            ("reef", "pays", "pays to be 'arrival' or 'return'", ["later", 1, np.zeros(2)]),
            ("reef", "depot", "depot to be true or false", ["yes", 1]),
            ("dock_reef", "survival", "survival in (0, 1]", [0, math.nextafter(1, 2), "0.5"]),
            ("dock_reef", "length", "a finite length >= 0", [-0.1, math.inf, "1", None]),
            ("graph", "max_length", "a finite max_length >= 0", [-0.1, math.inf, math.nan, "1"]),
            ("graph", "pays", "pays to be 'arrival' or 'return'", ["home", np.zeros(2)]),
            ("graph", "robots", "robots to be an integer >= 1", [0, 1.0, True, "2"]),
        ],
    )
    def test_what_is_none_is_named_with_its_owner(self, whose, name, expected, values):
        owner = {"reef": NODE, "dock_reef": ARC, "graph": ""}[whose]
        for value in values:
            said = "found none" if value is None else f"got {value!r}"
            found = faults_of(harbour(**{whose: {name: value}}))
            assert [fault.removesuffix("; write a number, such as 0.95") for fault in found] == [
                f"{owner}expected {expected}, {said}"
            ]

    def test_numbers_of_other_types_and_at_the_bounds(self):
        numbers = (0.5, 1), (np.int8(1), math.ulp(0)), (Fraction(1), np.float32(1))
        for share, survival in numbers:
            reef = {"reward": Fraction(1, 2), "share": share, "pos": None, "depot": np.bool_(0)}
            dock = {"reward": np.int8(0), "pos": np.zeros(2), "share": 0}
            arc = {"survival": survival, "length": 0}
            mission = Mission(harbour(reef=reef, dock=dock, dock_reef=arc))
            assert (mission.rewards[1], mission.world.graph.length.min()) == (0.5, 0)
            assert mission.world.graph.mean_survival[0] == survival

    def test_another_number_of_robots(self):
        for robots in (0, 1.0, True, None):
            with pytest.raises(ValueError, match=rf"^Expected robots .*>= 1, got {robots!r}\.$"):
                Mission(harbour()).with_robots(robots)


# A mission, and how its faults begin.
REFUSED = [
    (
        plain(reef={"reward": "2,5"}, dock_reef={"survival": {}}),
        f"{NODE}expected a finite reward >= 0, got '2,5'; write a number, such as 0.95",
        f"{ARC}expected survival in [0, 1] of kind 'robot', found none",
    ),
    (
        team(
            lab={"share": {"drone": 2, "rovr": 1}, "reward": {"drone": 1}},
            dock_lab={"survival": {"drone": 0.5, "rovr": 0.9}},
            lab_dock={"survival": {"drone": math.nan}},
            lab_roof={"survival": {"drone": "0,8", "rover": -1}},
            roof_lab={"survival": 0},
        ),
        "node 'lab': share of kind 'rovr': no such kind; most alike are rover, drone",
        "node 'lab': expected share in [0, 1] of kind 'drone', got 2",
        "node 'lab': expected a finite reward >= 0, got {'drone': 1}",
        f"{LAB}: survival of kind 'rovr': no such kind; most alike are rover, drone",
        "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'drone', got nan",
        "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'rover', found none",
        "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'drone', got '0,8'; write a nu",
        "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'rover', got -1",
        "arc 'roof' -> 'lab': expected survival in (0, 1], got 0",
    ),
    (
        team(lab={"share:rover": 0.5}, dock_lab={"survival:drone": 0.5}),
        "node 'lab': expected share to be a mapping from kinds to numbers, found 'share:rover', w",
        f"{LAB}: expected survival to be a mapping from kinds to numbers, found 'survival:drone'",
    ),
    (
        team(None, 2),
        f"{LAB} and 3 more: survival of kind 'drone': {UNLISTED}",
        f"{LAB} and 3 more: survival of kind 'rover': {UNLISTED}",
        f"node 'lab': share of kind 'drone': {UNLISTED}",
        f"node 'roof': share of kind 'rover': {UNLISTED}",
    ),
    (team([]), "expected at least one kind, got none"),
    (team({"name": "drone"}), "expected kinds to be a list of kinds, got {'name': 'drone'}"),
    (
        team([DRONE, 7, {"name": "rover", "robot": 1}]),
        "kinds[1]: expected a Kind, or an object, got 7",
        "kinds[2]: there is no 'robot' of a kind; most alike are robots, start, aboard, max_length",
    ),
    (team([DRONE, {"robots": 1}]), "kind None: expected a printable name"),
    (team([DRONE, Kind("rover", 0), ROVER]), "kind 'rover': there are two kinds of this name"),
    *((rover(robots=n), f"kind 'rover': {ROBOTS}, got {n!r}") for n in (0, math.nan, 1_000_001)),
    (
        rover(start="dok", end=["dock"], min_survival=1.5, max_length=-1),
        "kind 'rover': expected min_survival in [0, 1], got 1.5",
        "kind 'rover': expected a finite max_length >= 0, got -1",
        "kind 'rover': start 'dok': no such node; most alike are dock, roof, lab",
        "kind 'rover': end ['dock']: no such node; most alike are dock, roof, lab",
    ),
    (rover(aboard="lab"), "kind 'rover': expected aboard to be a list of nodes, got 'lab'"),
    *((rover(aboard=n), f"kind 'rover': aboard {n[-1]!r}: {ON_RETURN}") for n in NOT_ABOARD),
    (rover(aboard=["labs"]), "kind 'rover': aboard 'labs': no such node; most alike are lab"),
    (unjoined(), "node 'wreck': has no way back to base", "node 'isle': cannot be reached from b"),
    (rover(start="roof"), "robots of kind 'rover' have no way from 'roof' to 'dock'"),
    (
        rover(start="lab", min_survival=0.91, max_length=0.5),
        f"{NO_WAY}min_survival 0.91{FOUND}ved with 0.9 and is 1 long; no others are tried",
        f"{NO_WAY}max_length 0.5{FOUND}ved with 0.9 and is 1 long; no others are tried",
    ),
    (rover({"max_length": Fraction(1, 2)}, start="lab"), f"{NO_WAY}max_length 0.5{FOUND}"),
    (
        plain(graph={"base": None, "robots": None}),
        "expected robots, an integer >= 1, found none: give robots",
        "expected base, the label of a node, found none: give base",
    ),
    (team(graph={"base": None}), "expected base, the label of a node, found none: give base"),
    (plain(graph={"base": ["dock"]}), "base ['dock']: no such node; most alike are dock, "),
    (
        wild(),
        "expected robots to be an integer >= 1, got 0",
        "node 'reef': expected a finite reward >= 0, got -1",
        "node 'wreck': expected a finite reward >= 0, found none",
        "arc 'dock' -> 'wreck': expected survival in (0, 1], found none",
        "arc 'isle' -> 'dock': expected survival in (0, 1], got 2",
        "arc 'reef' -> 'reef': a node must not have an arc to itself",
        "node 'wreck': has no way back to base 'dock'",
        "node 'isle': cannot be reached from base 'dock'",
    ),
    ((nx.Graph(), {}), "expected an nx.DiGraph, got an nx.Graph; graph.to_directed() makes"),
    (({0: [1]}, {"base": 0, "robots": 1}), "expected an nx.DiGraph, got {0: [1]}"),
]


@pytest.mark.parametrize(("case", "starts"), [(case, starts) for case, *starts in REFUSED])
def test_what_is_wrong_is_named(case, starts):
    graph, given = case
    found, starts = sorted(faults_of(graph, **given)), sorted(starts)
    assert [fault[: len(start)] for fault, start in zip(found, starts, strict=True)] == starts


class TestKinds:
    def test_names_that_columns_and_options_cannot_hold(self):
        expected = "expected a printable name without : , = and blanks around it"
        where = "for columns survival:NAME and --kind NAME=ROBOTS"
        for name in ("a:b", "a,b", "a=b", " a", "a\n", "a\nb", "", 3, np.zeros(2)):
            found = faults_of(nx.DiGraph(nx.trivial_graph(), base=0), kinds=[Kind(name, 1)])
            assert found[0] == f"kind {name!r}: {expected}, {where}"

    def test_are_read_from_any_mappings(self):
        mapping = MappingProxyType({"name": "rover", "robots": 1})
        assert read_kinds(iter([DRONE, mapping])) == (BOTH, [])
        assert read_kinds(None) == ((), [])

    def test_the_only_one_has_a_name_all_the_same(self):
        by_kind = harbour(dock_reef={"survival": {"robot": 0.9}}, reef={"share": {}})
        assert Mission(by_kind) == Mission(harbour())

    def test_go_with_a_number_of_robots_that_is_theirs(self):
        assert Mission(team_site(graph={"robots": 4}), kinds=BOTH).robots == 3
        assert Mission(team_site(), kinds=BOTH, robots=3).kinds == BOTH
        graph = harbour(graph={"kinds": [{"name": "drone", "robots": 2}], "robots": 3})
        assert Mission(graph, robots=5).kinds == (Kind("drone", 5),)
        assert faults_of(graph)[0].startswith("expected robots to be 2, the robots of all kinds t")

    def test_may_leave_nodes_unjoined_or_take_ways_within_limits(self):
        graph, given = unjoined(Kind("drone", 1), Kind("rover", 1))
        assert Mission(graph, **given).robots == 2
        for limits, own in (({}, {"min_survival": 0.9}), ({"max_length": 0.5}, {"max_length": 1})):
            graph, given = rover(limits, start="lab", **own)
            assert Mission(graph, **given).robots == 3

    def test_labels_that_are_unequal_in_strange_ways(self):
        base, other = np.int64(1), (np.int8(3), "x")  # numpy compares these element by element
        graph = nx.DiGraph([(base, other), (other, base)])
        nx.set_node_attributes(graph, 1, "reward")
        nx.set_edge_attributes(graph, 1, "survival")
        assert Mission(graph, base=base, kinds=[Kind("drone", 1, start=other)]).robots == 1

    @pytest.mark.filterwarnings("error")
    def test_may_be_unable_to_collect_a_reward_which_is_told(self):
        # Drones, the only ones that get to the roof, pass no depot.
        alone = {"lab_dock": {"survival": {"drone": 0, "rover": 0.9}}}
        for changes, pays, lost in (
            ({"lab": {"share": {"drone": 0, "rover": 0}}}, "arrival", "lab"),
            (alone, "return", "roof"),
        ):
            said = rf"no kind of robots can collect .* of '{lost}'\.$"
            with pytest.warns(UserWarning, match=said):
                Mission(team_site(**changes), kinds=BOTH, pays=pays)
        Mission(team_site(**alone, roof={"depot": True}), kinds=BOTH, pays="return")


def test_errors_list_all_faults_and_can_be_pickled():
    graph, given = wild()
    with pytest.raises(MissionError) as caught:
        Mission(graph, **given)
    error = caught.value
    assert str(error) == "\n  - ".join(["Mission 'wild' has 8 faults:", *error.faults])
    twin = pickle.loads(pickle.dumps(error))
    assert (type(twin), twin.faults, str(twin)) == (MissionError, error.faults, str(error))
