"""Lengths of arcs and travel budgets: in missions, in trails, in files, and taken from places."""

import json
import pickle
from fractions import Fraction
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.mission import (
    Mission,
    MissionError,
    load_mission,
    mission_from_tables,
    read_mission,
    save_mission,
)
from botohe_moo.mission.model import mission_digest, numbers_digest
from botohe_moo.trails import TrailPlan
from tests import twins
from tests.strategies import missions, missions_with_plans

ROOT = Path(__file__).parents[2]


def ring(lengths=(1, 2.5, 0), **own):
    """Three nodes in a ring, the arcs from 0, 1 and 2 of these lengths; None for no length."""
    graph = nx.DiGraph(base=0, robots=2, **own)
    graph.add_nodes_from(range(3), reward=1)
    for tail, length in enumerate(lengths):
        known = {} if length is None else {"length": length}
        graph.add_edge(tail, (tail + 1) % 3, survival=0.5, **known)
    return graph


class TestTrails:
    def test_by_hand(self):
        mission = Mission(ring())
        plan = mission.plan([[0, 1, 2, 0], [0]])
        assert mission.world.graph.length.tolist() == [1, 2.5, 0]
        assert mission.trail_lengths([plan, plan]).tolist() == [[3.5, 0]] * 2

    def test_an_arc_without_a_length_is_one_hop(self):
        mission = Mission(ring((None, 2.5, None)))
        assert mission.trail_lengths([mission.plan([[0, 1, 2, 0]] * 2)]).tolist() == [[4.5, 4.5]]
        toy = load_mission("toy")
        plan = toy.plan([[1, 2, 4, 5, 4, 2, 1], [1, 3, 1]])
        assert toy.trail_lengths([plan]).tolist() == [[6, 2]]

    @given(missions_with_plans())
    def test_they_are_their_readable_twin(self, drawn):
        mission, plan = drawn
        expected = twins.trail_lengths(mission, mission.labels(plan))
        assert mission.trail_lengths([plan]).tolist() == [pytest.approx(expected, abs=1e-12)]

    def test_numbers_of_other_types(self):
        graph = ring((Fraction(1, 2), np.float32(0.25), 3), max_length=Fraction(1, 4))
        mission = Mission(graph)
        assert mission.world.graph.length.tolist() == [0.5, 0.25, 3]
        assert mission.max_length == 0.25

    def test_up_to_the_first_fault(self):
        mission = Mission(ring())
        drafts = [TrailPlan([[0, 1, 2], [0, 2, 0]]), TrailPlan([[1, 2, 0], [0, 1, 0, 1, 2, 0]])]
        # Not back at base; a missing arc; not from base; a missing arc after the first hop.
        found = mission.trail_lengths(drafts)
        lengths = {
            trail: length
            for draft, own in zip(drafts, found.tolist(), strict=True)
            for trail, length in zip(draft.trails, own, strict=True)
        }
        expected = {(0, 1, 2): 3.5, (0, 2, 0): 0, (1, 2, 0): 0, (0, 1, 0, 1, 2, 0): 1}
        assert lengths == expected


class TestIdentity:
    def test_what_makes_missions_equal(self):
        mission = Mission(ring((1, 1, 1)))
        assert mission == Mission(ring((None, None, None), max_length=None))
        for other in (ring((1, 1, 2)), ring((1, 1, 1), max_length=3)):
            assert Mission(other) != mission
            assert mission_digest(Mission(other)) != mission_digest(mission)
            assert numbers_digest(Mission(other)) != numbers_digest(mission)

    def test_copies(self):
        mission = Mission(ring(max_length=3))
        twin = pickle.loads(pickle.dumps(mission))
        assert twin == mission
        assert mission_digest(twin) == mission_digest(mission)
        assert not twin.world.graph.length.flags.writeable
        assert mission.with_robots(5).max_length == 3

    def test_digests_of_missions_without_lengths_stay(self):
        """Stored studies know their missions by them."""
        manifest = json.loads((ROOT / "results" / "smoke" / "study.json").read_text())
        for entry in manifest["missions"].values():
            name = entry["source"]["name_or_path"]
            assert mission_digest(load_mission(name)) == entry["digest"]
        assert mission_digest(Mission(ring((None, 1, 1.0)))) == mission_digest(
            Mission(ring((None, None, None)))
        )


class TestFromPos:
    def test_by_hand(self):
        graph = ring((None, 9, None), max_length=3, title="Ring")
        for node, place in enumerate([[0, 0], [3, 4], [3, 0]]):
            graph.nodes[node]["pos"] = place
        mission = Mission(graph, name="ring")
        measured = mission.with_lengths_from_pos()
        assert measured.world.graph.length.tolist() == [5, 4, 3]
        assert (measured.name, measured.title, measured.robots) == ("ring", "Ring", 2)
        assert measured.max_length == 3
        assert mission.world.graph.length.tolist() == [1, 9, 1]
        assert measured.with_lengths_from_pos() == measured

    def test_nodes_without_a_place(self):
        with pytest.raises(MissionError) as caught:
            Mission(ring(), name="ring").with_lengths_from_pos()
        assert str(caught.value).startswith("Mission 'ring' has 3 faults:")
        assert caught.value.faults[0] == "node 0: expected pos [x, y], found none"


def lengths_of(mission):
    arcs = {arc: mission.graph.edges[arc] for arc in mission.graph.edges}
    return {arc: own["length"] for arc, own in arcs.items() if "length" in own}


class TestFiles:
    @pytest.mark.parametrize("suffix", [".json", ".graphml"])
    @given(mission=missions(), budget=st.none() | st.floats(0, 1e9) | st.integers(0, 99))
    def test_they_come_back_bit_for_bit(self, tmp_path_factory, suffix, mission, budget):
        graph = nx.relabel_nodes(mission.graph, str)
        if budget is not None:
            graph.graph["max_length"] = budget
        mission = Mission(graph, base="0", robots=mission.robots)
        path = tmp_path_factory.getbasetemp() / f"lengths{suffix}"
        save_mission(mission, path)
        read = read_mission(path)
        assert read == mission
        assert read.world.graph.length.tobytes() == mission.world.graph.length.tobytes()
        assert lengths_of(read) == lengths_of(mission)  # and no arc has been given one
        assert read.max_length == budget
        assert ("max_length" in path.read_text()) == (budget is not None)


class TestTables:
    nodes = pd.DataFrame({"label": ["a", "b"], "reward": [0, 1]})
    arcs = pd.DataFrame({"tail": ["a", "b"], "head": ["b", "a"], "survival": [0.5, 0.5]})

    def mission(self, lengths, **options):
        arcs = self.arcs.assign(length=lengths)
        return mission_from_tables(self.nodes, arcs, base="a", robots=1, **options)

    def test_lengths_and_budget(self):
        mission = self.mission(["0.1", " 12 "], max_length=20)
        assert mission.world.graph.length.tolist() == [0.1, 12]
        assert mission.max_length == 20
        assert mission.graph.graph == {"base": "a", "max_length": 20}

    def test_cells_that_are_empty(self):
        mission = self.mission([None, 3])
        assert mission.world.graph.length.tolist() == [1, 3]
        assert "length" not in mission.graph.edges["a", "b"]
