"""The rules of missions, kinds, nodes and arcs, and what errors say if they are broken."""

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


class TestNumbersAndFlags:
    @pytest.mark.parametrize(
        ("whose", "name", "expected", "values"),
        [
            ("reef", "reward", "a finite reward >= 0", [-0.1, math.nan, math.inf, True, "1", None]),
            ("reef", "pos", "pos [x, y], two finite numbers", [[math.nan, 0], [1, 2, 3], "ab", 7]),
            ("reef", "pos", "pos [x, y], two finite numbers", [[0, "x"], np.zeros(()), [[1], 2]]),
            ("reef", "share", "share in [0, 1]", [-0.1, 1.1, math.nan, "1", True, None]),
            ("reef", "pays", "pays to be 'arrival' or 'return'", ["later", 1, np.zeros(2)]),
            ("reef", "depot", "depot to be true or false", ["yes", 1]),
            ("dock_reef", "survival", "survival in (0, 1]", [0, math.nextafter(1, 2), "0.5"]),
            ("dock_reef", "survival", "survival in (0, 1]", [np.array([0.5]), math.nan, None]),
            ("dock_reef", "length", "a finite length >= 0", [-0.1, math.inf, "1", None]),
            ("graph", "max_length", "a finite max_length >= 0", [-0.1, math.inf, math.nan, "1"]),
            ("graph", "pays", "pays to be 'arrival' or 'return'", ["home", np.zeros(2)]),
            ("graph", "robots", "robots to be an integer >= 1", [0, 1.0, True, "2"]),
        ],
    )
    def test_what_is_none_is_named_with_its_owner(self, whose, name, expected, values):
        owner = {"reef": NODE, "dock_reef": ARC, "graph": ""}[whose]
        for value in values:
            found = faults_of(harbour(**{whose: {name: value}}))
            said = "found none" if value is None else f"got {value!r}"
            assert found == [f"{owner}expected {expected}, {said}"]

    def test_numbers_of_other_types_and_at_the_bounds(self):
        numbers = (0, 1), (np.int8(1), math.ulp(0)), (Fraction(1), np.float32(1))
        for share, survival in numbers:
            reef = {"reward": Fraction(1, 2), "share": share, "pos": None, "depot": np.bool_(0)}
            dock = {"reward": np.int8(0), "pos": np.zeros(2)}
            arc = {"survival": survival, "length": 0}
            mission = Mission(harbour(reef=reef, dock=dock, dock_reef=arc))
            assert (mission.rewards[1], mission.world.graph.length.min()) == (0.5, 0)
            assert mission.world.graph.survival[0] == survival

    @pytest.mark.parametrize("robots", [0, 1.0, True, None])
    def test_another_number_of_robots(self, robots):
        with pytest.raises(ValueError, match=rf"^Expected robots .*>= 1, got {robots!r}\.$"):
            Mission(harbour()).with_robots(robots)


class TestNumbersByKind:
    @pytest.mark.parametrize(
        ("changes", "faults"),
        [
            (
                {"lab": {"share": {"drone": 2, "rovr": 1}}},
                [
                    "node 'lab': share of kind 'rovr': there is no such kind; most alike are "
                    "rover, drone",
                    "node 'lab': expected share in [0, 1] of kind 'drone', got 2",
                ],
            ),
            (
                {
                    "dock_lab": {"survival": {"drone": 0.5, "rovr": 0.9}},
                    "lab_dock": {"survival": {"drone": math.nan}},
                    "lab_roof": {"survival": {"drone": "0,8", "rover": -1}},
                    "roof_lab": {"survival": 0},
                },
                [
                    "arc 'dock' -> 'lab': survival of kind 'rovr': there is no such kind; most "
                    "alike are rover, drone",
                    "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'drone', got nan",
                    "arc 'lab' -> 'dock': expected survival in [0, 1] of kind 'rover', found none",
                    "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'drone', got '0,8'; "
                    "write numbers with a point",
                    "arc 'lab' -> 'roof': expected survival in [0, 1] of kind 'rover', got -1",
                    "arc 'roof' -> 'lab': expected survival in (0, 1], got 0",
                ],
            ),
            (
                {"dock_lab": {"survival": {}}, "lab": {"reward": {"drone": 1}, "share": {}}},
                [
                    "node 'lab': expected a finite reward >= 0, got {'drone': 1}",
                    "arc 'dock' -> 'lab': expected survival in [0, 1] of kind 'drone', found none",
                    "arc 'dock' -> 'lab': expected survival in [0, 1] of kind 'rover', found none",
                ],
            ),
            (
                {"lab": {"share:rover": 0.5}, "dock_lab": {"survival:drone": 0.5}},
                [
                    "node 'lab': expected share to be a mapping from kinds to numbers, found "
                    "'share:rover', which stands in tables and GraphML only",
                    "arc 'dock' -> 'lab': expected survival to be a mapping from kinds to numbers, "
                    "found 'survival:drone', which stands in tables and GraphML only",
                ],
            ),
        ],
    )
    def test_what_is_wrong(self, changes, faults):
        assert faults_of(team_site(**changes), kinds=BOTH) == faults

    def test_an_unknown_kind_is_one_fault(self):
        graph = team_site()
        for *_, arc in graph.edges(data=True):
            arc["survival"] = {"drone": 0.5, "rovr": 0.5}
        assert faults_of(graph, kinds=BOTH) == [
            "arc 'dock' -> 'lab' and 3 more: survival of kind 'rovr': there is no such kind; most "
            "alike are rover, drone"
        ]

    def test_a_mission_that_lists_no_kinds(self):
        unlisted = "there is no such kind; the mission lists no kinds"
        assert sorted(faults_of(team_site(), robots=2))[::2] == [
            f"arc 'dock' -> 'lab' and 3 more: survival of kind 'drone': {unlisted}",
            f"node 'lab': share of kind 'drone': {unlisted}",
        ]
        (fault,) = faults_of(harbour(dock_reef={"survival": {}}))
        assert fault == f"{ARC}expected survival in [0, 1] of kind 'robot', found none"

    def test_its_only_kind_has_a_name_all_the_same(self):
        by_kind = harbour(dock_reef={"survival": {"robot": 0.9}}, reef={"share": {}})
        assert Mission(by_kind) == Mission(harbour())


class TestKinds:
    @pytest.mark.parametrize(
        ("kinds", "faults"),
        [
            ([], ["expected at least one kind, got none"]),
            ("drone", ["expected kinds to be a list of kinds, got 'drone'"]),
            ({"name": "drone"}, ["expected kinds to be a list of kinds, got {'name': 'drone'}"]),
            (3, ["expected kinds to be a list of kinds, got 3"]),
            (DRONE, [f"expected kinds to be a list of kinds, got {DRONE!r}"[:70]]),
            (
                [DRONE, 7, {"name": "rover", "robot": 1}],
                [
                    "kinds[1]: expected a Kind, or an object, got 7",
                    "kinds[2]: there is no 'robot' of a kind; most alike are robots, start, "
                    "aboard, max_length, min_survival",
                ],
            ),
            ([DRONE, {"name": "rover"}], ["kind 'rover': expected robots to be an integer in"]),
            ([DRONE, {"robots": 1}], ["kind None: expected a printable name"]),
            (
                [DRONE, Kind("rover", 0), Kind("rover", 1)],
                ["kind 'rover': there are two kinds of this name"],
            ),
            *(
                (
                    [DRONE, replace(ROVER, robots=n)],
                    [f"kind 'rover': expected robots to be an integer in [1, 1000000], got {n!r}"],
                )
                for n in (0, "3", math.nan, 1_000_001)
            ),
            (
                [
                    Kind("drone", 1, min_survival="0.5", max_length=math.nan),
                    Kind("rover", 1, start="dok", end=["dock"], min_survival=1.5, max_length=-1),
                ],
                [
                    "kind 'drone': expected min_survival in [0, 1], got '0.5'",
                    "kind 'drone': expected a finite max_length >= 0, got nan",
                    "kind 'rover': expected min_survival in [0, 1], got 1.5",
                    "kind 'rover': expected a finite max_length >= 0, got -1",
                    "kind 'rover': start 'dok': there is no such node; most alike are dock, roof, "
                    "lab",
                    "kind 'rover': end ['dock']: there is no such node; most alike are dock, roof, "
                    "lab",
                ],
            ),
        ],
    )
    def test_what_is_wrong(self, kinds, faults):
        found = faults_of(team_site(), kinds=kinds)
        assert [fault[: len(start)] for fault, start in zip(found, faults, strict=True)] == faults

    @pytest.mark.parametrize(
        ("aboard", "fault"),
        [
            ("lab", "expected aboard to be a list of nodes, got 'lab'"),
            (["lab", "lab"], "aboard 'lab': expected a node that pays on return, listed once"),
            (["labs"], "aboard 'labs': there is no such node; most alike are lab, dock, roof"),
            (["roof"], "aboard 'roof': expected a node that pays on return, listed once"),
            (["dock"], "aboard 'dock': expected a node that pays on return, listed once"),
        ],
    )
    def test_what_is_aboard(self, aboard, fault):
        graph = team_site(lab={"pays": "return"}, dock={"pays": "return", "depot": True})
        found = faults_of(graph, kinds=[DRONE, replace(ROVER, aboard=aboard)])
        assert found == [f"kind 'rover': {fault}"]

    @pytest.mark.parametrize("name", ["a:b", "a,b", "a=b", " a", "a\n", "a\nb", "", 3, np.zeros(2)])
    def test_names_that_columns_and_options_cannot_hold(self, name):
        expected = "a printable name without : , = and blanks around it"
        where = "for columns survival:NAME and --kind NAME=ROBOTS"
        found = faults_of(nx.DiGraph(nx.trivial_graph(), base=0), kinds=[Kind(name, 1)])
        assert found[0] == f"kind {name!r}: expected {expected}, {where}"

    def test_mappings_of_any_type(self):
        rover = MappingProxyType({"name": "rover", "robots": 1})
        assert read_kinds(iter([DRONE, rover])) == (BOTH, [])
        assert read_kinds(None) == ((), [])

    def test_robots_beside_kinds(self):
        fault = ["expected robots to be 3, the robots of all kinds together, or none, got 4"]
        assert faults_of(team_site(), kinds=BOTH, robots=4) == fault
        assert faults_of(team_site(graph={"kinds": BOTH, "robots": 4})) == fault
        assert Mission(team_site(graph={"robots": 4}), kinds=BOTH).robots == 3
        assert Mission(team_site(), kinds=BOTH, robots=3).kinds == BOTH
        graph = harbour(graph={"kinds": [{"name": "drone", "robots": 2}]})
        assert Mission(graph, robots=5).kinds == (Kind("drone", 5),)
        graph.graph["robots"] = 3
        fault = ["expected robots to be 2, the robots of all kinds together, or none, got 3"]
        assert faults_of(graph) == fault

    def test_labels_that_are_unequal_in_strange_ways(self):
        base, other = np.int64(1), (np.int8(3), "x")  # numpy compares these element by element
        graph = nx.DiGraph(base=base)
        graph.add_nodes_from([base, other], reward=1)
        nx.add_cycle(graph, [base, other], survival=0.5)
        assert Mission(graph, kinds=[Kind("drone", 1, start=other)]).robots == 1


class TestWays:
    def test_nodes_without_a_way(self):
        graph = harbour()
        graph.add_node("wreck", reward=0)
        graph.add_edge("reef", "wreck", survival=1)
        graph.add_node("isle", reward=0)
        graph.add_edge("isle", "reef", survival=1)
        faults = [
            "node 'wreck': has no way back to base 'dock'",
            "node 'isle': cannot be reached from base 'dock'",
        ]
        assert faults_of(graph) == faults
        assert faults_of(graph, kinds=[Kind("drone", 1)]) == faults
        assert Mission(graph, kinds=[Kind("drone", 1), Kind("rover", 1)]).robots == 2

    @pytest.mark.parametrize(
        ("rover", "graph", "faults"),
        [
            ({"start": "roof"}, {}, ["robots of kind 'rover' have no way from 'roof' to 'dock'"]),
            (
                {"start": "lab", "min_survival": 0.91, "max_length": 0.5},
                {},
                [
                    "robots of kind 'rover' cannot keep min_survival 0.91. The safest way from "
                    "'lab' to 'dock', or the shortest one if that is too long, is survived with "
                    "0.9 and is 1 long; no others are tried",
                    "robots of kind 'rover' cannot keep max_length 0.5. The safest way from 'lab' "
                    "to 'dock', or the shortest one if that is too long, is survived with 0.9 and "
                    "is 1 long; no others are tried",
                ],
            ),
            (
                {"start": "lab"},
                {"max_length": Fraction(1, 2)},
                ["robots of kind 'rover' cannot keep max_length 0.5. The safest way from 'lab'"],
            ),
            ({"start": "lab", "min_survival": 0.9, "max_length": 1}, {}, []),
            ({"start": "lab", "max_length": 1}, {"max_length": 0.5}, []),
        ],
    )
    def test_a_kind_that_cannot_get_home(self, rover, graph, faults):
        graph, kinds = team_site(graph=graph), [DRONE, replace(ROVER, **rover)]
        found = faults_of(graph, kinds=kinds) if faults else []
        assert [fault[: len(start)] for fault, start in zip(found, faults, strict=True)] == faults
        if not faults:
            assert Mission(graph, kinds=kinds).robots == 3

    def test_lengths_that_are_fractions(self):
        graph = team_site(lab_dock={"length": Fraction(3, 2)})
        (fault,) = faults_of(graph, kinds=[DRONE, replace(ROVER, start="lab", max_length=1)])
        assert "is survived with 0.9 and is 1.5 long" in fault

    @pytest.mark.parametrize(
        ("changes", "pays", "lost"),
        [
            ({"lab": {"share": {"drone": 0, "rover": 0}}}, "arrival", "lab"),
            # Drones, the only ones that get to the roof, pass no depot.
            ({"lab_dock": {"survival": {"drone": 0, "rover": 0.9}}}, "return", "roof"),
        ],
    )
    def test_what_no_kind_can_collect(self, changes, pays, lost):
        graph = team_site(**changes)
        with pytest.warns(UserWarning, match=rf"no kind of robots can collect .* of '{lost}'\.$"):
            Mission(graph, kinds=BOTH, pays=pays)

    @pytest.mark.filterwarnings("error")
    def test_a_depot_is_enough_to_collect(self):
        changes = {"lab_dock": {"survival": {"drone": 0, "rover": 0.9}}, "roof": {"depot": True}}
        Mission(team_site(**changes), kinds=BOTH, pays="return")


class TestMissions:
    def test_base_and_robots_not_given(self):
        assert faults_of(harbour(graph={"base": None, "robots": None})) == [
            "expected robots, an integer >= 1, found none: give robots",
            "expected base, the label of a node, found none: give base",
        ]
        (fault,) = faults_of(team_site(graph={"base": None}), kinds=BOTH)
        assert fault == "expected base, the label of a node, found none: give base"

        for base in ("deck", ["dock"]):
            (fault,) = faults_of(harbour(), base=base)
            assert fault.startswith(f"base {base!r}: there is no such node; most alike are dock, ")

    def test_all_at_once(self):
        graph = harbour()
        graph.add_node("wreck")
        graph.nodes["reef"]["reward"] = -1
        graph.add_edge("dock", "wreck")
        graph.add_edge("reef", "reef", survival=1)
        graph.add_edge("isle", "dock", survival=2)
        graph.nodes["isle"]["reward"] = 0
        with pytest.raises(MissionError) as caught:
            Mission(graph, robots=0, name="wild")
        error = caught.value
        assert error.faults == (
            "expected robots to be an integer >= 1, got 0",
            "node 'reef': expected a finite reward >= 0, got -1",
            "node 'wreck': expected a finite reward >= 0, found none",
            "arc 'dock' -> 'wreck': expected survival in (0, 1], found none",
            "arc 'isle' -> 'dock': expected survival in (0, 1], got 2",
            "arc 'reef' -> 'reef': a node must not have an arc to itself",
            "node 'wreck': has no way back to base 'dock'",
            "node 'isle': cannot be reached from base 'dock'",
        )
        assert str(error) == "\n  - ".join(["Mission 'wild' has 8 faults:", *error.faults])
        twin = pickle.loads(pickle.dumps(error))
        assert (twin.faults, str(twin)) == (error.faults, str(error))

    def test_a_hundred_faults_are_shown(self):
        error = MissionError([f"fault {i}" for i in range(102)], "x.json")
        assert len(error.faults) == 102
        assert str(error).splitlines()[-2:] == ["  - fault 99", "  - and 2 more"]
        assert str(MissionError("alone", "x.json")) == "x.json: alone"

    @pytest.mark.parametrize(
        ("graph", "fault"),
        [
            (
                nx.Graph([(0, 1)]),
                "expected an nx.DiGraph, got an nx.Graph; graph.to_directed() makes",
            ),
            (nx.MultiDiGraph([(0, 1)]), "expected an nx.DiGraph, got an nx.MultiDiGraph"),
            ({0: [1]}, "expected an nx.DiGraph, got {0: [1]}"),
        ],
    )
    def test_type_of_graph(self, graph, fault):
        (found,) = faults_of(graph, base=0, robots=1)
        assert found.startswith(fault)
