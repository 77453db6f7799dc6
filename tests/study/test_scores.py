"""From what runs have found to tables: against unions, distances and medians found by hand."""

import dataclasses
import functools
import math
import warnings

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import INDICATORS, area_indicator
from botohe_moo.mission import Mission
from botohe_moo.study.perform import Outcome
from botohe_moo.study.scores import (
    SHARES,
    algorithm_table,
    mission_table,
    points_by_mission,
    reach_targets,
    reference_fronts,
    score_fronts,
    score_runs,
    summarise,
)
from botohe_moo.study.tables import SCHEMAS, as_table
from tests.examples import examples
from tests.study.made import made_study, outcome_of

MEASURED = ("area", "igd_plus", "epsilon")
TOY = load_mission("toy")


@functools.cache
def quay():
    """Dock (base) and reef, which alone pays; two robots: the objective space is 10 × 2."""
    graph = nx.DiGraph([("dock", "reef"), ("reef", "dock")])
    nx.set_node_attributes(graph, {"dock": 0, "reef": 10}, "reward")
    nx.set_edge_attributes(graph, 0.5, "survival")
    return Mission(graph, base="dock", robots=2)


def runs_of(found):
    """Runs and final fronts from (mission, algorithm, seed, points) or (..., points, status)."""
    rows, fronts = [], []
    for mission, algorithm, seed, points, *status in found:
        row = {"run": f"{mission}/{algorithm}/{seed}", "mission": mission, "algorithm": algorithm}
        row |= {"seed": seed, "status": status[0] if status else "done", "environment": "here"}
        row |= {"evaluations": 100 * seed, "seconds": 0.5 * seed, "recording_seconds": 0.0}
        row |= {"front_size": len(points), "ties": 0, "min_survival": 0, "stopped_by": "itself"}
        rows.append({**row, "area": area_indicator(points, quay())})
        fronts.append(np.array(points, float).reshape(-1, 2))
    return as_table("runs", rows), fronts


def scored(found, indicators=tuple(INDICATORS)):
    """The tables runs, references and indicators."""
    runs, fronts = runs_of(found)
    missions = dict.fromkeys(runs["mission"], quay())
    references = reference_fronts(runs, fronts, {})
    scores = score_runs(runs, fronts, references, missions=missions, indicators=indicators)
    return runs, references, scores


def points_of(references, mission):
    return points_by_mission(references)[mission].tolist()


coordinates = st.one_of(st.sampled_from([0.0, 1.0, 2.0]), st.floats(0, 2))
fronts = st.lists(st.tuples(coordinates, coordinates), max_size=3)


@st.composite
def studies(draw):
    """Runs on two missions, some of which found nothing or were killed with a front."""
    seeds = range(1, draw(st.integers(1, 3)) + 1)
    found = []
    for mission in ("<i>", "b"):
        for algorithm in ["A & B", "x", "y"][: draw(st.integers(1, 3))]:
            for seed in seeds:
                points = draw(fronts)
                options = ["done", "timeout"] if points else ["infeasible", "timeout", "failed"]
                found.append((mission, algorithm, seed, points, draw(st.sampled_from(options))))
    return found


class TestReferenceFronts:
    def test_by_hand(self):
        found = [
            ("m", "a", 1, [(8, 0.5), (4, 1)]),
            ("m", "b", 1, [(4, 1), (2, 2), (3, 0.75)]),
            ("n", "b", 1, []),
        ]
        _, references, _ = scored(found)
        assert points_of(references, "m") == [[8, 0.5], [4, 1], [2, 2]]
        assert points_of(references, "n") == [[0, 0]]  # nothing was brought back

    @given(studies())
    def test_every_point_is_covered_and_no_point_covers_another(self, found):
        _, references, _ = scored(found, ["area"])
        for mission in ("<i>", "b"):
            union = points_of(references, mission)
            for r, s in (point for run in found if run[0] == mission for point in run[3]):
                assert any(r <= right and s <= up for right, up in union)
            rewards, survivors = zip(*union, strict=True)
            assert all(np.diff(rewards) < 0)
            assert all(np.diff(survivors) > 0)


class TestScores:
    def test_by_hand(self):
        """The reference is what a found; b lacks half of one objective each time, c all."""
        found = [("m", "a", 1, [(10, 1), (5, 2)]), ("m", "b", 1, [(5, 1)]), ("m", "c", 7, [])]
        found.append(("m", "killed", 1, [(5, 1)], "timeout"))
        _, _, table = scored(found, ["area", "igd_plus", "epsilon", "front_size"])
        values = table.pivot_table("value", "indicator", "algorithm")
        # 10 × 1 + 5 × 1 of 20, and distances from (0, 0) to (1, 0.5) and (0.5, 1).
        assert values["a"].to_dict() == {"area": 0.75, "igd_plus": 0, "epsilon": 0, "front_size": 2}
        expected = {"area": 0.25, "igd_plus": 0.5, "epsilon": 0.5, "front_size": 1}
        assert values["b"].to_dict() == values["killed"].to_dict() == expected
        igd_plus = pytest.approx(1.25**0.5, rel=1e-15)
        nothing = {"area": 0.0, "igd_plus": igd_plus, "epsilon": 1.0, "front_size": 0.0}
        assert values["c"].to_dict() == nothing
        assert table["algorithm"].tolist()[::4] == ["a", "b", "c", "killed"]

    def test_missions_do_not_change_each_other(self):
        above = np.nextafter(1, 2)
        _, _, found = scored([("m", "a", 1, [(10, 1)]), ("n", "a", 1, [(10, above)])], ["area"])
        assert list(found["value"]) == [0.5, above / 2]

    @given(studies())
    def test_no_front_is_worse_than_none(self, found):
        _, _, table = scored([*found, ("b", "nothing", 1, [])])
        of_mission = table[table["mission"] == "b"]
        for name in MEASURED:
            signed = of_mission[of_mission["indicator"] == name].set_index("algorithm")["value"]
            signed = signed if INDICATORS[name].higher_is_better else -signed
            assert signed["nothing"] <= signed.min() + 1e-15

    def test_a_front_that_stays_is_measured_once(self, monkeypatch):
        measured = []

        def measure(points, mission):
            measured.append(points)
            return area_indicator(points, mission)

        counted = dataclasses.replace(INDICATORS["area"], function=measure)
        monkeypatch.setitem(INDICATORS.own, "area", counted)
        one, other = np.array([(5.0, 1.0)]), np.array([(10, 0.5), (5, 1)])
        fronts = [("m", front) for front in [one] * 5 + [other] * 5]
        references = as_table("references", [{"mission": "m", "reward": 10.0, "survivors": 1.0}])
        scores = score_fronts(fronts, references, missions={"m": quay()}, indicators=["area"])
        assert scores["area"].tolist() == [0.25] * 5 + [0.375] * 5
        assert len(measured) == 2


class Most:
    """A bound of a given area."""

    gap_of_area = FrontBound.gap_of_area

    def __init__(self, area):
        self.area = area


# Areas 0.5, 0.25, 0 and 0.1 of A; of B 0.2 twice.
FOUND = [
    ("m", "A", 1, [(10, 1)]),
    ("m", "A", 2, [(5, 1)]),
    ("m", "A", 3, [], "failed"),
    ("m", "A", 4, [(1, 2)], "timeout"),
    ("m", "B", 1, [(4, 1)]),
    ("m", "B", 2, [(4, 1)]),
]
LOST = [("m", "A", 1, []), ("m", "B", 1, [])]


def summary_of(found, bounds=None, indicators=tuple(INDICATORS)):
    runs, references, scores = scored(found, indicators)
    areas = {
        label: area_indicator(of, quay()) for label, of in points_by_mission(references).items()
    }
    most = {mission: Most(area) for mission, area in (bounds or {}).items()}
    return summarise(runs, scores, areas, significance=0.05, bounds=most)


class TestSummary:
    def test_by_hand(self):
        a, b = summary_of(FOUND).to_dict("records")
        assert (a["mission"], a["algorithm"], b["algorithm"]) == ("m", "A", "B")
        assert (a["n"], a["n_not_done"], b["n"], b["n_not_done"]) == (4, 2, 2, 0)
        assert a["area_median"] == pytest.approx((0.25 + 0.1) / 2)
        assert a["area_mean"] == pytest.approx(0.85 / 4)
        # Deviations from 0.2125: 0.2875, 0.0375, -0.2125, -0.1125.
        squares = 0.2875**2 + 0.0375**2 + 0.2125**2 + 0.1125**2
        assert a["area_sd"] == pytest.approx(math.sqrt(squares / 3))
        assert (a["area_low"], a["area_high"], a["area_best"]) == (0.0, 0.5, 0.5)
        assert (b["area_median"], b["area_low"], b["area_high"]) == (0.2, 0.2, 0.2)
        assert b["area_sd"] == 0.0
        assert (a["rank"], b["rank"]) == (2, 1)
        assert (a["front_size_median"], b["front_size_median"]) == (1, 1)
        assert (a["evaluations_median"], a["seconds_median"]) == (250, 1.25)
        # The union is (1, 0.5) and (0.1, 1) as shares; B's (0.4, 0.5) lacks 0.6 and 0.5 of them.
        assert b["igd_plus_median"] == pytest.approx((0.6 + 0.5) / 2)
        assert b["epsilon_median"] == pytest.approx(0.6)
        # The area of the union is 0.5 + 0.05.
        assert a["area_share"] == pytest.approx(0.85 / 4 / 0.55)

    def test_gaps_by_hand(self):
        a, b = summary_of(FOUND, bounds={"m": 0.6})["area_gap"]
        assert (a, b) == (pytest.approx(0.6 / (0.85 / 4) - 1), pytest.approx(2))
        assert summary_of([*LOST[:1], FOUND[4]], {"m": 0.2})["area_gap"].tolist() == [np.inf, 0]
        assert summary_of(LOST[:1], bounds={"m": 0.0})["area_gap"].tolist() == [0]
        assert summary_of(FOUND, bounds={"other": 0.6})["area_gap"].isna().all()

    def test_what_is_not_known_is_missing(self):
        table = summary_of(FOUND, indicators=["epsilon"])
        assert table["igd_plus_median"].isna().all()
        assert table["epsilon_median"].notna().all()
        assert table["area_median"].tolist() == pytest.approx([0.175, 0.2])
        assert summary_of(LOST)["area_share"].isna().all()
        assert summary_of(FOUND[:4])["algorithm"].tolist() == ["A"]

    def test_another_algorithm_does_not_move_the_intervals(self):
        areas = np.random.default_rng(8).random(40)
        found = [("m", "AB"[i % 2], i, [(10 * area, 2)]) for i, area in enumerate(areas)]
        alone, both = summary_of(found[::2], {"m": 1.0}), summary_of(found[::-1], {"m": 1.0})
        columns = [name for name in alone if name.startswith("area") and name != "area_share"]
        both = both.set_index("algorithm")
        assert both.loc["A", columns].tolist() == alone.loc[0, columns].tolist()
        assert alone["area_low"][0] < alone["area_median"][0] < alone["area_high"][0]

    @given(studies())
    @examples(40)
    def test_rows_are_sound(self, found):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            table = summary_of(found)
        assert (table["area_low"] <= table["area_median"]).all()
        assert (table["area_median"] <= table["area_high"]).all()
        assert (table["area_high"] <= table["area_best"]).all()
        assert table["n_not_done"].sum() == sum(status != "done" for *_, status in found)


def targets(found, area=0.5):
    """The table from {algorithm: runs}, each run a list of (evaluations, area)."""
    columns = ["run", "mission", "algorithm", "evaluations", "seconds", "area"]
    runs = [(f"{a}{i}", "m", a) for a, of in found.items() for i, _ in enumerate(of)]
    trace = [
        (f"{a}{i}", "m", a, evaluations, evaluations / 100, reached)
        for a, of in found.items()
        for i, records in enumerate(of)
        for evaluations, reached in records
    ]
    frames = pd.DataFrame(runs, columns=columns[:3]), pd.DataFrame(trace, columns=columns)
    return reach_targets(*frames, {"m": area})


class TestTargets:
    def test_by_hand(self):
        table = targets({"A": [[(10, 0.3), (20, 0.46), (30, 0.5)], [(10, 0.4), (40, 0.48)]]})
        assert list(table["share"]) == list(SHARES) == [0.9, 0.95, 0.99]
        assert list(table["target"]) == pytest.approx([0.45, 0.475, 0.495])
        assert list(table["n_reached"]) == [2, 2, 1]
        # 20 and 40; 30 and 40; 30 and never.
        assert table["evaluations_median"].tolist()[:2] == [30, 35]
        assert table["seconds_median"].tolist()[:2] == pytest.approx([0.3, 0.35])
        assert table["evaluations_median"].isna().tolist() == [False, False, True]

    def test_runs_that_never_get_there_take_for_ever(self):
        reached, never = [(10, 0.5)], [(10, 0.1)]
        table = targets({"A": [reached, never, reached], "B": [never, reached, never], "C": [[]]})
        assert table["n"].tolist() == [3] * 6 + [1] * 3
        assert table["n_reached"].tolist() == [2] * 3 + [1] * 3 + [0] * 3
        assert table["evaluations_median"].isna().tolist() == [False] * 3 + [True] * 6

    def test_rounding_errors_do_not_keep_anybody_from_it(self):
        area = 0.99 * 0.5
        table = targets({"A": [[(10, np.nextafter(area, 0))], [(10, area - 1e-9)]]})
        assert table["n_reached"].tolist() == [2, 2, 1]

    def test_where_there_is_nothing_to_reach_there_is_no_row(self):
        assert targets({"A": [[(10, 0.0)]]}, 0.0).empty
        assert targets({"A": [], "B": [[(10, 0.5)]]})["algorithm"].unique().tolist() == ["B"]
        assert targets({"A": []}).empty


STUDY = {
    "name": "counted",
    "missions": {"toy": "toy", "towns": {"mission": "two_communities", "grid": {"seed": [1, 2]}}},
    "algorithms": {
        "random": "random",
        "ants": {"algorithm": "bo-aco", "grid": {"n_ants": [5, 10], "evaporation": [0.1, 0.2]}},
    },
    "budget": {"evaluations": 100},
    "seeds": 2,
}


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Runs of seed 1 improve twice, those of seed 2 not at all; random nothing on toy."""

    def outcome(run):
        if (run.mission.label, run.algorithm.label) == ("toy", "random"):
            return Outcome("infeasible", "evaluations", 100)
        first, second = [(0.4, 0.4)], [(0.6, 0.5), (0.5, 0.6)]
        last = second if run.seed == 1 else first
        return outcome_of(run, first, last, last, ties=3)

    return made_study(tmp_path_factory.mktemp("counted"), STUDY, outcome)


class TestCollected:
    def test_points_are_counted_and_ties_apart(self, kept):
        last, runs = kept.trace.groupby("run").last(), kept.runs.set_index("run")
        for column in ("front_size", "ties"):
            assert (last[column] == runs.loc[last.index, column]).all()
        found = runs[runs["status"] == "done"]
        assert set(found["ties"]) == {3}
        assert dict(found.groupby("seed")["front_size"].unique().map(list)) == {1: [2], 2: [1]}
        n_plans = kept.plans.groupby("run").size()
        assert (n_plans == (found["front_size"] + found["ties"])[n_plans.index]).all()

    def test_the_last_record_is_worth_what_the_run_is(self, kept):
        values = kept.indicators.set_index(["run", "indicator"])["value"]
        last = kept.trace.groupby("run").last()
        for name in MEASURED:
            found = last[name].to_numpy(float)
            assert np.allclose(found, values[[(run, name) for run in last.index]], atol=1e-11)

    def test_fronts_get_better_by_what_is_measured(self, kept):
        rows = kept.trace[(kept.trace["mission"] == "toy") & (kept.trace["seed"] == 1)].head(3)
        area = 0.6 * 0.5 + 0.5 * 0.1
        assert np.allclose(rows["area"], [0.16, area, area])
        # Of two points: how far (0.6, 0.5) and (0.5, 0.6) are ahead of (0.4, 0.4).
        assert np.allclose(rows["igd_plus"], [np.hypot(0.2, 0.1), 0, 0])
        assert np.allclose(rows["epsilon"], [0.2, 0, 0])

    def test_runs_without_a_front_have_no_rows(self, kept):
        nothing = kept.runs[kept.runs["status"] == "infeasible"]
        assert len(nothing) == 2
        assert (nothing["area"] == 0).all()
        assert not set(nothing["run"]) & {*kept.trace["run"], *kept.plans["run"]}
        assert nothing["began"].isna().all()

    def test_what_the_study_does_not_compute_is_missing(self, tmp_path):
        content = {**STUDY, "missions": ["toy"], "indicators": ["area", "epsilon"]}
        trace = made_study(tmp_path, content, lambda run: outcome_of(run, [(0.4, 0.4)])).trace
        assert trace["igd_plus"].isna().all()
        assert set(trace["epsilon"]) == {0.0}

    def test_missions_and_algorithms_are_described(self, kept):
        table = kept.algorithms.set_index("algorithm")
        assert list(table) == ["name", "family", "package", "version", "n_ants", "evaporation"]
        ants = table[table["family"] == "ants"]
        assert list(ants["n_ants"]) == [5, 5, 10, 10]
        # Random search states its default of the one and does not know the other.
        assert table.loc["random", "n_ants"] == 100
        assert pd.isna(table.loc["random", "evaporation"])
        assert table["name"].tolist() == ["random", *["bo-aco"] * 4]
        table = kept.missions.set_index("mission")
        for label in kept.mission_labels:
            mission, row = kept.mission(label), table.loc[label]
            assert (row["nodes"], row["arcs"]) == (len(mission.nodes), mission.world.graph.n_arcs)
            assert (row["robots"], row["total_reward"]) == (mission.robots, mission.total_reward)
        assert list(table["name"]) == ["toy", "two_communities", "two_communities"]
        assert list(table["family"]) == ["toy", "towns", "towns"]
        assert list(table["seed"].dropna()) == [1, 2]


def described(*parameters):
    entry = {"name": "nsga2", "family": "A", "package": None, "version": None, "effective": {}}
    given = {f"A{i}": {**entry, "parameters": p} for i, p in enumerate(parameters)}
    return algorithm_table({"algorithms": given})


@pytest.mark.parametrize(
    ("values", "dtype", "kept"),
    [
        ([1, 2], "Int64", [1, 2]),
        ([1, 0.5], "float64", [1.0, 0.5]),
        ([True, False], "boolean", [True, False]),
        ([1, "a"], "str", ["1", "a"]),
        ([True, 1], "str", ["true", "1"]),
        ([[1, 2], {"a": None}], "str", ["[1, 2]", '{"a": null}']),
        ([2**70, 1], "str", [str(2**70), "1"]),
    ],
)
def test_columns_of_parameters_have_the_type_of_their_values(values, dtype, kept):
    table = described(*({"x": value} for value in values), {}, {"x": None})
    assert str(table["x"].dtype) == dtype
    assert list(table["x"].dropna()) == kept
    assert table["x"].isna().sum() == 2


def test_columns_are_those_of_parameters_that_tell_entries_apart():
    entry = {"name": "a", "family": "A", "package": None, "version": None}
    usual = {"n": 100, "rate": 0.5}
    given = {
        "few": {**entry, "parameters": {"n": 5}, "effective": {**usual, "n": 5}},
        "usual": {**entry, "parameters": {}, "effective": usual},
        "other": {**entry, "parameters": {}, "effective": {}},
    }
    table = algorithm_table({"algorithms": given})
    assert list(table)[5:] == ["n"]
    assert table["n"].tolist()[:2] == [5, 100]
    assert table["n"].isna().tolist() == [False, False, True]


def test_parameters_named_like_a_column_stay_apart():
    table = described({"name": "x", "parameter_name": "y", "version": 2})
    assert list(table)[5:] == ["parameter_name", "parameter_parameter_name", "parameter_version"]
    entry = {"source": {"name_or_path": "terrain"}, "family": "hills", "min_survival": 0.0}
    given = {f"M{n}": {**entry, "grid": {"nodes": n}} for n in (20, 40)}
    table = mission_table({"missions": given}, dict.fromkeys(given, TOY), {})
    assert list(table["nodes"]) == [len(TOY.nodes)] * 2
    assert list(table["grid_nodes"]) == [20, 40]


def test_tables_without_rows_fit():
    assert {len(as_table(name, [])) for name in SCHEMAS} == {0}
