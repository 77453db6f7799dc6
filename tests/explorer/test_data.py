"""The data of the page: thinned fronts, rounded numbers, marks and words."""

import json
import re

import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, read_solution
from botohe_moo.decide import plan_csv, plan_geojson, plan_json
from botohe_moo.decide.choosing import taken
from botohe_moo.explorer import explore, explorer_page
from botohe_moo.explorer.data import (
    bin_codes,
    bin_edges,
    number_texts,
    page_data,
    probability_codes,
    sentence,
    thinned,
)
from botohe_moo.outcomes import Distribution
from botohe_moo.plots import plot_outcomes
from tests.decide.made import MISSION, NAMES, PLANS, star, trips
from tests.explorer.conftest import solution_of, toy_plans

FRONT = [PLANS[NAMES.index(name)] for name in ("AB", "AC", "BC", "C")]
WISHES = ["survivors >= 1.9", "survivors >= 1.5 and reward >= 3.5"]


class TestThinning:
    POINTS = np.array([[0, 8.0], [1, 8], [3, 7], [4, 6], [5, 1]])

    def test_ends_and_what_is_kept_stay(self):
        assert thinned(self.POINTS, [1], 3).tolist() == [0, 1, 4]
        assert thinned(self.POINTS, [1, 2, 3], 1).tolist() == [0, 1, 2, 3, 4]
        assert thinned(self.POINTS, [], 1).tolist() == [0, 4]

    @given(
        st.sets(st.tuples(st.integers(0, 30), st.integers(0, 30)), min_size=3, max_size=12),
        st.data(),
    )
    def test_as_by_brute_force(self, pairs, data):
        rewards, survivors = (sorted({pair[i] for pair in pairs}) for i in (0, 1))
        n = min(len(rewards), len(survivors))
        points = np.column_stack([rewards[:n], survivors[:n][::-1]]).astype(float)
        wanted = data.draw(st.integers(2, max(n, 2)))
        rows = list(range(n))
        while len(rows) > wanted:
            alone = [
                (points[b, 0] - points[a, 0]) * (points[b, 1] - points[c, 1])
                for a, b, c in zip(rows, rows[1:], rows[2:], strict=False)
            ]
            del rows[1 + int(np.argmin(alone))]
        assert thinned(points, [], wanted).tolist() == rows


class TestNumbers:
    @given(st.floats(0, 1))
    def test_codes_are_what_python_writes(self, value):
        [code] = probability_codes([value])
        shown = {1001: "0.000", 1002: "1.000"}.get(code, f"{code / 1000:.3f}")
        assert shown == f"{value:.3f}"
        assert (code == 1001) == (value > 0 and shown == "0.000")
        assert (code == 1002) == (value < 1 - 1e-12 and shown == "1.000")

    @pytest.mark.parametrize(
        ("values", "texts"),
        [
            ([81.526, 2.3456, 0.0004], ["81.5", "2.3", "0.0"]),
            ([0.333333, 0.1], ["0.333", "0.100"]),
            ([7.8, 1, 0], ["7.8", "1.0", "0.0"]),
            ([12_345.6, 1], ["12346", "1"]),
            ([0, 0], ["0", "0"]),
            ([], []),
        ],
    )
    def test_columns_have_three_digits_of_their_largest_number(self, values, texts):
        assert number_texts(values) == texts

    def test_sentences_have_three_digits_but_not_in_wishes_and_labels(self):
        said = 'survivors >= 1.23456 (1.23456); "lab 1.23456": 0.0012345 of 1234.56, 12 of 0.5.'
        assert sentence(said) == (
            'survivors >= 1.23456 (1.23); "lab 1.23456": 0.00123 of 1235, 12 of 0.5.'
        )

    @given(st.floats(1e-6, 1e9))
    def test_bins_are_few_and_hold_everything(self, largest):
        edges = bin_edges(largest)
        assert 2 <= len(edges) <= 14
        assert edges[0] == 0
        assert edges[-1] > largest >= edges[-2] * (1 - 1e-9)
        assert np.ptp(np.diff(edges)) < 1e-9 * largest


class TestData:
    """By hand: see the table in tests/decide/made.py."""

    DATA = page_data(
        solution_of(MISSION, FRONT), ["survivors >= 1.9", "survivors >= 1.5 and reward >= 3.5"]
    )

    def test_plans_ascend_in_reward_under_their_own_numbers(self):
        assert self.DATA["ids"] == [3, 2, 1, 0]  # C, BC, AC, AB
        assert self.DATA["objective_texts"] == [
            ["1.0", "2.8", "3.0", "3.8"],
            ["2.0", "1.9", "1.5", "1.4"],
        ]

    def test_each_trail_is_there_once(self):
        assert len(self.DATA["trails"]) == 4  # to a, b, c, and none
        plan = [self.DATA["trails"][trail] for trail in self.DATA["plans"][3]]
        assert plan == [(0, 1, 0), (0, 2, 0)]
        survival = dict(zip(self.DATA["trails"], self.DATA["trail_codes"], strict=True))
        assert survival == {(0, 1, 0): 500, (0, 2, 0): 900, (0, 3, 0): 1000, (0,): 1000}
        lengths = dict(zip(self.DATA["trails"], self.DATA["trail_length_texts"], strict=True))
        assert lengths == {(0, 1, 0): "2", (0, 2, 0): "2", (0, 3, 0): "2", (0,): "0"}

    def test_distributions(self):
        assert self.DATA["survivors"][3] == [50, 500, 450]
        # The rewards of AB are 6, 4, 2 and 0; bins are 0.5 wide.
        edges = [text.split(" ")[0] for text in self.DATA["bins"]]
        found = dict(zip(edges, self.DATA["rewards_in"][3], strict=True))
        assert {edge: code for edge, code in found.items() if code} == {
            "0": 50,
            "2": 450,
            "4": 50,
            "6": 450,
        }
        assert not any(self.DATA["simulated"])
        assert self.DATA["facts"]["Median reward"] == ["1.0", "3.0", "1.0", "2.0"]

    def test_files_are_those_of_the_library(self):
        for kind, write in (("json", plan_json), ("csv", plan_csv), ("geojson", plan_geojson)):
            plans = [FRONT[row] for row in self.DATA["ids"]]
            files = self.DATA["files"][kind]
            if kind == "geojson":  # the star has no positions
                assert all(not text and "expected pos" in fault for text, fault in files)
            else:
                assert files == [(write(MISSION, plan), "") for plan in plans]

    def test_large_pages_have_all_files_of_marked_plans_only(self, museum, monkeypatch):
        monkeypatch.setattr("botohe_moo.explorer.data._MOST_STOPS", 100)
        data = page_data(museum)
        marked = {mark["plan"] for mark in data["marks"]}
        assert all(text for text, _ in data["files"]["json"])
        for place, (text, fault) in enumerate(data["files"]["geojson"]):
            assert bool(text) == (place in marked)
            row = data["ids"][place]
            assert (f"botohe choose DIR --plan {row} --out plan.geojson" in fault) != bool(text)

    def test_nodes_reached(self):
        assert self.DATA["reached"] == [
            [1000, 1000],
            [1000, 900, 1000],
            [1000, 500, 1000],
            [1000, 500, 900],
        ]

    def test_marks(self):
        marks = {(mark["kind"], mark["plan"]) for mark in self.DATA["marks"]}
        # AB meets 3.5 and lacks 0.1 of 2 robots; AC meets 1.5 and lacks 0.5 of 7: nearer is AB.
        assert {("choice", 1), ("miss", 3), ("end", 0), ("end", 3)} <= marks
        first = self.DATA["marks"][0]
        assert first["name"] == "meets survivors >= 1.9"
        assert first["text"][0].startswith("The best among these plans (4): plan 2 has the most")

    def test_choices_that_are_made_already_are_marked(self):
        solution = solution_of(MISSION, FRONT)
        chosen = solution.choose("reward >= 1.5", "every robot >= 0.5")
        aim = solution.toward(reward=0, survivors=2)
        marks = page_data(solution, [chosen, aim, taken(MISSION, FRONT, 1)])["marks"]
        names = [
            "meets reward >= 1.5 and every robot >= 0.5",
            "meets reward >= 0 and survivors >= 2",
        ]
        assert [mark["name"] for mark in marks[:3]] == [*names, "chosen"]
        assert marks[0]["text"] == [chosen.why, *chosen.costs]
        with pytest.raises(ValueError, match="among these plans, got plan 3 of others"):
            page_data(solution_of(MISSION, FRONT[:2]), [taken(MISSION, FRONT, 3)])

    def test_thinned_fronts_keep_the_plans_that_sentences_name(self, museum):
        wishes = ["survivors >= 1.234", "reward >= 99", "survivors >= 2.5"]
        data = page_data(museum, wishes, max_plans=20)
        texts = [text for mark in data["marks"] for text in mark["text"]]
        named = {int(number) for text in texts for number in re.findall(r"plan (\d+)", text)}
        assert len(named) > 2 * len(wishes)  # each is compared with up to two others
        assert named <= set(data["ids"])
        assert 20 <= len(data["ids"]) < len(museum.plans)
        assert {0, len(museum.plans) - 1, *museum.representatives()} <= set(data["ids"])
        assert f"{len(data['ids'])} of the {len(museum.plans)} plans" in data["thinned"]
        assert np.array_equal(data["objectives"], museum.objectives[data["ids"]])

    def test_pictures_show_the_same_simulation(self, museum, monkeypatch):
        monkeypatch.setattr("botohe_moo.decide.wishes.MAX_OUTCOMES", 1)
        data = page_data(museum, max_plans=12)
        plans = [museum.plans[row] for row in data["ids"]]
        pen = plt.figure()
        left, _ = plot_outcomes(museum.mission, *plans, axes=pen.subplots(1, 2))
        edges = np.array([0, *(float(name.split(" to ")[1]) for name in data["bins"])])
        curves = [line.get_data() for line in left.lines if line.get_marker() == "None"]
        plt.close(pen)
        assert len(curves) == len(plans) == 12
        for (values, beyond), codes in zip(curves, data["rewards_in"], strict=True):
            # The curve falls at each reward by its probability.
            drawn = Distribution(values[1:], -np.diff(beyond))
            # Sums of the curve are rounded.
            assert bin_codes(drawn, edges) == pytest.approx(codes, abs=1)

    def test_rewards_that_are_simulated_are_marked(self, museum, monkeypatch):
        monkeypatch.setattr("botohe_moo.decide.wishes.MAX_OUTCOMES", 1)
        data = page_data(museum, max_plans=12)
        assert data["simulated"] == [False] + [True] * (len(data["ids"]) - 1)

    def test_no_plan_cannot_be_explored(self):
        empty = solution_of(MISSION, FRONT[:1])
        object.__setattr__(empty, "plans", ())
        with pytest.raises(ValueError, match="Expected at least one plan to explore"):
            explorer_page(empty)
        assert empty._repr_html_() is None


class TestSites:
    def graph(self, **places):
        graph = nx.DiGraph(
            [("x", "y"), ("y", "x"), ("x", 1), (1, "x"), ("x", "1"), ("1", "x")], base="x", robots=1
        )
        nx.set_node_attributes(graph, 1, "reward")
        nx.set_edge_attributes(graph, 0.9, "survival")
        nx.set_node_attributes(graph, places, "pos")
        return graph

    def data(self, graph):
        mission = Mission(graph)
        return page_data(solution_of(mission, [mission.stay_home()]))

    def test_without_positions_there_is_a_layout(self):
        data = self.data(self.graph(x=(1, 2)))
        assert data["placing"].endswith("are made up: 3 of 4 nodes have no position.")
        assert np.isfinite(data["places"]).all()

    def test_labels_that_json_cannot_hold(self):
        graph = nx.relabel_nodes(self.graph(), {"y": frozenset("q")})
        mission = Mission(graph)
        data = page_data(solution_of(mission, [mission.plan([["x", frozenset("q"), "x"]])]))
        for kind, named in (("json", "frozenset"), ("csv", "frozenset"), ("geojson", "pos")):
            [(text, fault)] = data["files"][kind]
            assert text == ""
            assert named in fault
        json.dumps(data)


class TestBadInput:
    """One message that names the file and the remedy."""

    @pytest.fixture
    def folder(self, tmp_path):
        mission, plans = toy_plans([1], [1, 2, 1])
        solution_of(mission, plans).write(tmp_path / "toy")
        return tmp_path / "toy"

    def test_a_written_solution_is_explored(self, folder):
        path = explore(read_solution(folder), folder / "explorer.html")
        assert path.read_text("utf-8").startswith("<!DOCTYPE html>")

    def test_the_file_has_to_be_a_page(self, folder):
        solution = read_solution(folder)
        with pytest.raises(
            ValueError, match=r"page.pdf: expected a file name that ends in one of .html, .htm"
        ):
            explore(solution, folder / "page.pdf")
        with pytest.raises(FileNotFoundError, match="nowhere"):
            explore(solution, folder / "nowhere" / "page.html")


def test_a_reward_that_is_reached_in_just_nine_of_ten_missions():
    mission = star({"b": (2, 0.9)}, robots=1)
    facts = page_data(solution_of(mission, [trips(mission, "b")]))["facts"]
    assert facts["Reward reached in 9 of 10 missions"] == ["2.0"]


def test_what_is_not_a_solution_is_named():
    for wrong in (MISSION, FRONT):
        with pytest.raises(TypeError, match=r"^Expected a Solution, got "):
            page_data(wrong)
