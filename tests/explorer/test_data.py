"""The data of the pages: thinned fronts, rounded numbers, marks and words."""

import json
import re

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, load_mission
from botohe_moo.decide import plan_csv, plan_geojson, plan_json
from botohe_moo.decide.choosing import taken
from botohe_moo.decide.wishes import Candidates
from botohe_moo.explorer import explore, explorer_page, replay_page
from botohe_moo.explorer.data import (
    LITTLE,
    bin_codes,
    bin_edges,
    number_texts,
    page_data,
    probability_codes,
    sentence,
    thinned,
)
from botohe_moo.explorer.page import replay_data
from botohe_moo.outcomes import plan_outcomes
from botohe_moo.underway import POLICIES, play_mission
from tests.decide.made import MISSION, NAMES, PLANS, solution_of, star, trips
from tests.explorer.conftest import kinds_solution
from tests.plots.made import write_map
from tests.underway.corner import MISSION as CORNER
from tests.underway.corner import NUMBER, PLAN, PLAYED

FRONT = [PLANS[NAMES.index(name)] for name in ("AB", "AC", "BC", "C")]


class TestThinning:
    @pytest.mark.parametrize(
        ("kept", "n", "rows"),
        [([1], 3, [0, 1, 4]), ([1, 2, 3], 1, [0, 1, 2, 3, 4]), ([], 1, [0, 4])],
    )
    def test_ends_and_what_is_kept_stay(self, kept, n, rows):
        points = np.array([[0, 8.0], [1, 8], [3, 7], [4, 6], [5, 1]])
        assert thinned(points, kept, n).tolist() == rows

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

    def test_the_plans_that_sentences_name_are_kept(self, museum):
        wishes = ["survivors >= 1.234", "reward >= 99", "survivors >= 2.5"]
        data = page_data(museum, wishes, max_plans=20)
        texts = [text for mark in data["marks"] for text in mark["text"]]
        named = {int(number) for text in texts for number in re.findall(r"plan (\d+)", text)}
        assert len(named) > 2 * len(wishes)  # each is compared with up to two others
        assert named | {0, len(museum.plans) - 1, *museum.representatives()} <= set(data["ids"])
        assert 20 <= len(data["ids"]) < len(museum.plans)
        assert f"{len(data['ids'])} of the {len(museum.plans)} plans" in data["thinned"]
        assert np.array_equal(data["objectives"], museum.objectives[data["ids"]])


class TestNumbers:
    @given(st.floats(0, 1))
    def test_codes_are_what_python_writes(self, value):
        [code] = probability_codes([value])
        shown = {1001: "0.000", 1002: "1.000"}.get(code, f"{code / 1000:.3f}")
        assert shown == f"{value:.3f}"
        assert (code == 1001) == (value > 0 and shown == "0.000")
        assert (code == 1002) == (value < 1 - 1e-12 and shown == "1.000")

    def test_columns_have_three_digits_of_their_largest_number(self):
        for values, texts in (
            ([81.526, 2.3456, 0.0004], ["81.5", "2.3", "0.0"]),
            ([0.333333, 0.1], ["0.333", "0.100"]),
            ([7.8, 1, 0], ["7.8", "1.0", "0.0"]),
            ([12_345.6, 1], ["12346", "1"]),
            ([0, 0], ["0", "0"]),
            ([], []),
        ):
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


class TestPage:
    """By hand: see the table in tests/decide/made.py."""

    DATA = page_data(
        solution_of(MISSION, FRONT), ["survivors >= 1.9", "survivors >= 1.5 and reward >= 3.5"]
    )

    def test_plans_ascend_in_reward_and_each_trail_is_there_once(self):
        assert self.DATA["ids"] == [3, 2, 1, 0]  # C, BC, AC, AB
        texts = [["1.0", "2.8", "3.0", "3.8"], ["2.0", "1.9", "1.5", "1.4"]]
        assert self.DATA["objective_texts"] == texts
        trails = self.DATA["trails"]
        assert [trails[trail] for trail in self.DATA["plans"][3]] == [(0, 1, 0), (0, 2, 0)]
        known = zip(self.DATA["trail_codes"], self.DATA["trail_length_texts"], strict=True)
        expected = [((0, 1, 0), (500, "2")), ((0, 2, 0), (900, "2")), ((0, 3, 0), (1000, "2"))]
        assert sorted(zip(trails, known, strict=True)) == [((0,), (1000, "0")), *expected]

    def test_distributions_and_nodes_reached(self):
        assert self.DATA["survivors"][3] == [50, 500, 450]
        # The rewards of AB are 6, 4, 2 and 0; bins are 0.5 wide.
        edges = [text.split(" ")[0] for text in self.DATA["bins"]]
        found = dict(zip(edges, self.DATA["rewards_in"][3], strict=True))
        some = {edge: code for edge, code in found.items() if code}
        assert some == {"0": 50, "2": 450, "4": 50, "6": 450}
        assert not any(self.DATA["simulated"])
        assert self.DATA["facts"] == {
            "Reward reached in 9 of 10 missions": ["1.0", "3.0", "1.0", "2.0"],
            "Median reward": ["1.0", "3.0", "1.0", "2.0"],
            "Mean of the lowest tenth of rewards": ["1.0", "1.0", "1.0", "1.0"],
        }
        reached = [[1000, 1000], [1000, 900, 1000], [1000, 500, 1000], [1000, 500, 900]]
        assert self.DATA["reached"] == reached

    def test_a_reward_that_is_reached_in_just_nine_of_ten_missions(self):
        mission = star({"b": (2, 0.9)}, robots=1)
        facts = page_data(solution_of(mission, [trips(mission, "b")]))["facts"]
        assert facts["Reward reached in 9 of 10 missions"] == ["2.0"]

    def test_files_are_those_of_the_library(self):
        plans = [FRONT[row] for row in self.DATA["ids"]]
        for kind, write in (("json", plan_json), ("csv", plan_csv)):
            assert self.DATA["files"][kind] == [(write(MISSION, plan), "") for plan in plans]
        # The star has no positions.
        geojson = self.DATA["files"]["geojson"]
        assert all(not text and "expected pos" in fault for text, fault in geojson)

    def test_large_pages_have_all_files_of_marked_plans_only(self, museum, monkeypatch):
        monkeypatch.setattr("botohe_moo.explorer.data._MOST_STOPS", 100)
        data = page_data(museum)
        marked = {mark["plan"] for mark in data["marks"]}
        assert all(text for text, _ in data["files"]["json"])
        for place, (text, fault) in enumerate(data["files"]["geojson"]):
            row = data["ids"][place]
            written = plan_geojson(museum.mission, museum.plans[row]) if place in marked else ""
            assert text == written
            assert (f"botohe choose DIR --plan {row} --out plan.geojson" in fault) != bool(text)

    def test_marks(self):
        marks = {(mark["kind"], mark["plan"]) for mark in self.DATA["marks"]}
        # AB meets 3.5 and lacks 0.1 of 2 robots; AC meets 1.5 and lacks 0.5 of 7: nearer is AB.
        assert {("choice", 1), ("miss", 3), ("end", 0), ("end", 3)} <= marks
        first = self.DATA["marks"][0]
        assert first["name"] == "meets survivors >= 1.9"
        assert first["text"][0].startswith("The best among these plans (4): plan 2 has the most")

    def test_wishes_may_be_one_text_and_choices(self):
        solution = solution_of(MISSION, FRONT)
        one, many = (page_data(solution, given) for given in ("reward >= 2", ["reward >= 2"]))
        assert one["marks"] == many["marks"]
        chosen = solution.choose("reward >= 1.5", "every robot >= 0.5")
        aim = solution.toward(reward=0, survivors=2)
        marks = page_data(solution, [chosen, aim, taken(MISSION, FRONT, 1)])["marks"]
        assert [mark["name"] for mark in marks[:3]] == [
            "meets reward >= 1.5 and every robot >= 0.5",
            "meets reward >= 0 and survivors >= 2",
            "chosen",
        ]
        assert marks[0]["text"] == [chosen.why, *chosen.costs]
        with pytest.raises(ValueError, match="among these plans, got plan 3 of others"):
            page_data(solution_of(MISSION, FRONT[:2]), [taken(MISSION, FRONT, 3)])

    def test_simulated_rewards_are_marked_and_those_by_which_plans_are_chosen(
        self, museum, monkeypatch
    ):
        monkeypatch.setattr("botohe_moo.decide.wishes.MAX_OUTCOMES", 1)
        data = page_data(museum, max_plans=12)
        assert data["simulated"] == [False] + [True] * (len(data["ids"]) - 1)
        edges = np.array([0, *(float(name.split(" to ")[1]) for name in data["bins"])])
        candidates = Candidates(museum.mission, museum.plans)
        for row, codes in zip(data["ids"], data["rewards_in"], strict=True):
            assert bin_codes(candidates.distribution("reward", row), edges) == codes

    def test_numbers_of_many_plans_are_those_of_the_library(self, museum):
        mission, data = museum.mission, page_data(museum)
        for place in range(0, len(data["ids"]), 9):
            plan = museum.plans[data["ids"][place]]
            outcomes = plan_outcomes(mission, plan)
            texts = [float(column[place]) for column in data["objective_texts"]]
            assert texts == pytest.approx(mission.evaluate([plan])[0], abs=0.0051)
            codes = [data["trail_codes"][trail] for trail in data["plans"][place]]
            assert codes == probability_codes(mission.robot_survival([plan])[0])
            alive = [
                np.sum(outcomes.survivors.probabilities[outcomes.survivors.values == n])
                for n in range(4)
            ]
            assert data["survivors"][place] == probability_codes(alive)
            median = data["facts"]["Median reward"][place]
            assert float(median) == pytest.approx(outcomes.reward.quantile(0.5), abs=0.0051)


class TestKinds:
    """By hand: see the site in tests/plots/made.py."""

    DATA = page_data(kinds_solution())

    def test_arcs_are_there_once_with_what_each_kind_survives(self):
        tails, heads, codes = self.DATA["arcs"]
        arcs = list(zip(tails, heads, strict=True))
        assert len(arcs) == len(set(arcs)) == 11
        of = dict(zip(arcs, zip(codes, *self.DATA["arc_codes"], strict=True), strict=True))
        assert of[0, 1] == (900, 900, 800)
        assert of[1, 3] == (950, 900, 950)
        assert of[3, 2] == (700, 700, 0)

    def test_kinds_starts_and_what_only_some_can_do(self):
        data = self.DATA
        assert (data["kinds"], data["kind_of"]) == (["drone", "rover"], [0, 0, 1])
        assert data["ends"] == [(4, 0), (0, 0)]
        assert (data["depots"], data["rings"]) == ([3], [2])
        (drone, ways, spots), (rover, no_ways, hall) = data["only"]
        assert (drone, len(ways), spots) == ((0,), 7, [2])
        assert (rover, no_ways, hall) == ((1,), [], [1])
        notes = ["drone cannot collect it", "pays on return, rover cannot collect it", "depot"]
        assert data["node_notes"] == ["", *notes, ""]

    def test_trails_and_what_they_bring_alone(self):
        data = self.DATA
        (plan,) = [one for one in data["plans"] if len({*one}) == 3]
        assert [data["trails"][i] for i in plan] == [(4, 2, 1, 0), (4, 1, 0), (0,)]
        # The pond's 5 are paid at the dock: 0.5 · 0.5 · 0.9; drones get nothing in the hall.
        assert [data["trail_reward_texts"][i] for i in plan] == ["1.12", "0.00", "0.00"]
        assert data["collected"][data["plans"].index(plan)][2] == 225

    def test_plain_missions_have_none_of_it(self):
        mission = load_mission("toy")
        data = page_data(solution_of(mission, [mission.stay_home()]))
        for name in ("kinds", "ends", "only", "rings", "arc_codes", "node_notes", "collected"):
            assert data[name] == []
        assert data["background"] is None


class TestReplay:
    """By hand: see tests.underway.corner.py."""

    DATA = replay_data(PLAYED)

    def test_trails_by_step(self):
        names = self.DATA["names"]
        trails = [
            [" ".join(names[node] for node in self.DATA["trails"][i]) for i in plan]
            for plan in self.DATA["plans"]
        ]
        anew = ["base lab", "base hall base lab base"]
        assert trails == [["base lab base", "base hall base"], *[anew] * 4]
        assert self.DATA["at"] == [(0, 0), (0, 1), (0, 2), (0, 3), (0, 3)]
        assert self.DATA["lost"] == [(), (0,), (0,), (0,), (0, 1)]
        assert self.DATA["told"] == [1, 4]

    def test_nodes_are_filled_when_their_rewards_count(self):
        codes = [dict(zip(self.DATA["names"], of, strict=True)) for of in self.DATA["reached"]]
        found = {node: [of[node] for of in codes] for node in self.DATA["names"]}
        halls, labs = [0, *[1000] * 4], [0, 0, 0, 1000, 1000]
        assert found == {"base": [LITTLE] * 5, "lab": labs, "hall": halls}
        assert self.DATA["banked"] == ["0", "1", "1", "11", "11"]

    def test_the_same_mission_gives_the_same_page(self):
        again = play_mission(CORNER, PLAN, price=2, number=NUMBER)
        assert replay_page(again) == replay_page(PLAYED)

    def test_policies_are_said_and_losses_told(self):
        for policy, words in POLICIES.items():
            data = replay_data(play_mission(CORNER, PLAN, policy, price=2, number=NUMBER))
            assert words in data["about"]
            assert data["told"][0] == data["lost"].index((0,))


class TestWhatCannotBeShown:
    def graph(self, **places):
        arcs = [("x", "y"), ("y", "x"), ("x", 1), (1, "x"), ("x", "1"), ("1", "x")]
        graph = nx.DiGraph(arcs, base="x", robots=1)
        nx.set_node_attributes(graph, 1, "reward")
        nx.set_edge_attributes(graph, 0.9, "survival")
        nx.set_node_attributes(graph, places, "pos")
        return graph

    def test_without_positions_there_is_a_layout_and_no_background(self, tmp_path):
        mission = Mission(self.graph(x=(1, 2)))
        solution = solution_of(mission, [mission.stay_home()])
        data = page_data(solution)
        assert data["placing"].endswith("are made up: 3 of 4 nodes have no position.")
        assert np.isfinite(data["places"]).all()
        with pytest.raises(ValueError, match=r"positions for the background .*map.yaml"):
            page_data(solution, background=write_map(tmp_path, [[0]]))

    def test_labels_that_json_cannot_hold(self):
        mission = Mission(nx.relabel_nodes(self.graph(), {"y": frozenset("q")}))
        data = page_data(solution_of(mission, [mission.plan([["x", frozenset("q"), "x"]])]))
        for kind, named in (("json", "frozenset"), ("csv", "frozenset"), ("geojson", "pos")):
            [(text, fault)] = data["files"][kind]
            assert text == ""
            assert named in fault
        json.dumps(data)

    def test_no_plan_and_what_is_not_a_solution(self):
        empty = solution_of(MISSION, FRONT[:1])
        object.__setattr__(empty, "plans", ())
        with pytest.raises(ValueError, match="Expected at least one plan to explore"):
            explorer_page(empty)
        assert empty._repr_html_() is None
        with pytest.raises(TypeError, match=r"^Expected a Solution, got "):
            page_data(FRONT)

    def test_other_files(self, tmp_path):
        solution = solution_of(MISSION, FRONT)
        with pytest.raises(ValueError, match=r"page.pdf: expected a file .* one of .html, .htm"):
            explore(solution, tmp_path / "page.pdf")
        with pytest.raises(FileNotFoundError, match="nowhere"):
            explore(solution, tmp_path / "nowhere" / "page.html")
