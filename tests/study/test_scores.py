"""From what runs have found to tables: against unions, distances and medians found by hand."""

import dataclasses
import warnings
from typing import NamedTuple
from unittest import mock

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

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
from botohe_moo.study.tables import as_table
from tests.examples import examples
from tests.study.made import made_study, outcome_of

MEASURED = ("area", "igd_plus", "epsilon")


def quay():
    """Dock (base) and reef, which alone pays; two robots: the objective space is 10 × 2."""
    graph = nx.DiGraph([("dock", "reef"), ("reef", "dock")])
    nx.set_node_attributes(graph, {"dock": 0, "reef": 10}, "reward")
    nx.set_edge_attributes(graph, 0.5, "survival")
    return Mission(graph, base="dock", robots=2)


QUAY = quay()


def runs_of(found):
    """Runs and final fronts from (mission, algorithm, seed, points) or (..., points, status)."""
    rows, fronts = [], []
    for mission, algorithm, seed, points, *status in found:
        row = {"run": f"{mission}/{algorithm}/{seed}", "mission": mission, "algorithm": algorithm}
        row |= {"seed": seed, "status": status[0] if status else "done", "environment": "here"}
        row |= {"evaluations": 100 * seed, "seconds": 0.5 * seed, "recording_seconds": 0.0}
        row |= {"front_size": len(points), "ties": 0, "min_survival": 0, "stopped_by": "itself"}
        rows.append(row | {"area": area_indicator(points, QUAY)})
        fronts.append(np.array(points, float).reshape(-1, 2))
    return as_table("runs", rows), fronts


def scored(found, indicators=tuple(INDICATORS)):
    """The tables runs, references and indicators."""
    runs, fronts = runs_of(found)
    missions = dict.fromkeys(runs["mission"], QUAY)
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


@given(studies())
@example([("<i>", "a", 1, [(2, 0.5), (1, 1)], "done"), ("b", "a", 1, [], "failed")])
def test_reference_fronts_cover_every_point_and_no_point_covers_another(found):
    references = points_by_mission(scored(found, ["area"])[1])
    for mission in ("<i>", "b"):
        points = [point for run in found if run[0] == mission for point in run[3]]
        union = references[mission].tolist()
        assert union == [[0, 0]] or {tuple(point) for point in union} <= {*points}
        assert all(any(r <= right and s <= up for right, up in union) for r, s in points)
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

    @given(studies())
    def test_no_front_is_worse_than_none(self, found):
        _, _, table = scored([*found, ("b", "nothing", 1, [])])
        of_mission = table[table["mission"] == "b"]
        for name in MEASURED:
            signed = of_mission[of_mission["indicator"] == name].set_index("algorithm")["value"]
            signed = signed if INDICATORS[name].higher_is_better else -signed
            assert signed["nothing"] <= signed.min() + 1e-15

    def test_a_front_that_stays_is_measured_once(self, monkeypatch):
        measure = mock.Mock(side_effect=area_indicator)
        counted = dataclasses.replace(INDICATORS["area"], function=measure)
        monkeypatch.setitem(INDICATORS.own, "area", counted)
        one, other = np.array([(5.0, 1.0)]), np.array([(10, 0.5), (5, 1)])
        fronts = [("m", front) for front in [one] * 5 + [other] * 5]
        references = as_table("references", [{"mission": "m", "reward": 10.0, "survivors": 1.0}])
        scores = score_fronts(fronts, references, missions={"m": QUAY}, indicators=["area"])
        assert scores["area"].tolist() == [0.25] * 5 + [0.375] * 5
        assert measure.call_count == 2


class Most(NamedTuple):
    """A bound of a given area."""

    area: float
    gap_of_area = FrontBound.gap_of_area


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
    areas = {label: area_indicator(of, QUAY) for label, of in points_by_mission(references).items()}
    most = {mission: Most(area) for mission, area in (bounds or {}).items()}
    return summarise(runs, scores, areas, significance=0.05, bounds=most)


class TestSummary:
    def test_by_hand(self):
        a, b = summary_of(FOUND).to_dict("records")
        # Deviations from 0.2125: 0.2875, 0.0375, -0.2125, -0.1125.
        squares = 0.2875**2 + 0.0375**2 + 0.2125**2 + 0.1125**2
        # The area of the union is 0.5 + 0.05.
        expected = {
            "mission": "m", "algorithm": "A", "n": 4, "n_not_done": 2, "rank": 2,
            "area_median": (0.25 + 0.1) / 2, "area_mean": 0.85 / 4, "area_sd": (squares / 3) ** 0.5,
            "area_low": 0.0, "area_high": 0.5, "area_best": 0.5, "area_share": 0.85 / 4 / 0.55,
            "front_size_median": 1, "evaluations_median": 250, "seconds_median": 1.25,
        }  # fmt: skip
        assert {name: a[name] for name in expected} == pytest.approx(expected)
        # The union is (1, 0.5) and (0.1, 1) as shares; B's (0.4, 0.5) lacks 0.6 and 0.5.
        expected = {
            "mission": "m", "algorithm": "B", "n": 2, "n_not_done": 0, "rank": 1, "area_sd": 0.0,
            "area_median": 0.2, "area_low": 0.2, "area_high": 0.2, "area_share": 0.2 / 0.55,
            "igd_plus_median": (0.6 + 0.5) / 2, "epsilon_median": 0.6,
        }  # fmt: skip
        assert {name: b[name] for name in expected} == pytest.approx(expected)

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
        (*run, spent, spent / 100, reached)
        for run in runs
        for spent, reached in found[run[2]][int(run[0][1:])]
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
        columns = ["front_size", "ties", "area", "evaluations"]
        assert last[columns].equals(runs.loc[last.index, columns])
        found = runs[runs["status"] == "done"]
        assert set(found["ties"]) == {3}
        assert dict(found.groupby("seed")["front_size"].unique().map(list)) == {1: [2], 2: [1]}
        n_plans = kept.plans.groupby("run").size()
        assert (n_plans == (found["front_size"] + found["ties"])[n_plans.index]).all()
        # Runs without a front have no rows.
        nothing = runs[runs["status"] == "infeasible"]
        assert nothing["area"].tolist() == [0, 0]
        assert not set(nothing.index) & {*kept.trace["run"], *kept.plans["run"]}
        assert nothing["began"].isna().all()

    def test_fronts_get_better_by_what_is_measured(self, kept):
        values = kept.indicators.set_index(["run", "indicator"])["value"]
        last = kept.trace.groupby("run").last()
        for name in MEASURED:  # the last record is worth what the run is
            found = last[name].to_numpy(float)
            assert np.allclose(found, values[[(run, name) for run in last.index]], atol=1e-11)
        rows = kept.trace[(kept.trace["mission"] == "toy") & (kept.trace["seed"] == 1)].head(3)
        area = 0.6 * 0.5 + 0.5 * 0.1
        # Of two points: how far (0.6, 0.5) and (0.5, 0.6) are ahead of (0.4, 0.4).
        expected = [(0.16, np.hypot(0.2, 0.1), 0.2), (area, 0, 0), (area, 0, 0)]
        assert np.allclose(rows[[*MEASURED]], expected)
        areas = kept.trace.set_index(["run", "evaluations"])["area"]
        for key, points in kept.fronts.groupby(["run", "evaluations"]):
            mission = kept.mission(points["mission"].iloc[0])
            assert area_indicator(points[["reward", "survivors"]], mission) == areas[key]

    def test_what_the_study_does_not_compute_is_missing(self, tmp_path):
        content = {**STUDY, "missions": ["toy"], "indicators": ["area", "epsilon"]}
        trace = made_study(tmp_path, content, lambda run: outcome_of(run, [(0.4, 0.4)])).trace
        assert trace["igd_plus"].isna().all()
        assert set(trace["epsilon"]) == {0.0}

    def test_missions_and_algorithms_are_described(self, kept):
        table = kept.algorithms.set_index("algorithm")
        assert list(table) == ["name", "family", "package", "version", "n_ants", "evaporation"]
        assert table["name"].tolist() == ["random", *["bo-aco"] * 4]
        # Random search states its default of the one and does not know the other.
        assert table["n_ants"].tolist() == [100, 5, 5, 10, 10]
        assert pd.isna(table.loc["random", "evaporation"])
        table = kept.missions.set_index("mission")
        for label in kept.mission_labels:
            mission = kept.mission(label)
            size = [len(mission.nodes), mission.world.graph.n_arcs, mission.robots]
            columns = ["nodes", "arcs", "robots", "total_reward"]
            assert table.loc[label, columns].tolist() == [*size, mission.total_reward]
        assert list(table["name"]) == ["toy", "two_communities", "two_communities"]
        assert list(table["family"]) == ["toy", "towns", "towns"]
        assert list(table["seed"].dropna()) == [1, 2]


ENTRY = {"name": "nsga2", "family": "A", "package": None, "version": None}


def described(*parameters):
    given = {f"A{i}": {**ENTRY, "parameters": p, "effective": {}} for i, p in enumerate(parameters)}
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
    usual = {"n": 100, "rate": 0.5}
    given = {
        "few": {**ENTRY, "parameters": {"n": 5}, "effective": {**usual, "n": 5}},
        "usual": {**ENTRY, "parameters": {}, "effective": usual},
        "other": {**ENTRY, "parameters": {}, "effective": {}},
    }
    table = algorithm_table({"algorithms": given})
    assert list(table)[5:] == ["n"]
    assert table["n"].fillna(0).tolist() == [5, 100, 0]


def test_parameters_named_like_a_column_stay_apart():
    table = described({"name": "x", "parameter_name": "y", "version": 2})
    assert list(table)[5:] == ["parameter_name", "parameter_parameter_name", "parameter_version"]
    entry = {"source": {"name_or_path": "terrain"}, "family": "hills", "min_survival": 0.0}
    given = {f"M{n}": {**entry, "grid": {"nodes": n}} for n in (20, 40)}
    table = mission_table({"missions": given}, dict.fromkeys(given, QUAY), {})
    assert (list(table["nodes"]), list(table["grid_nodes"])) == ([2, 2], [20, 40])
