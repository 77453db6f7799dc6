"""Reference fronts and indicators of runs, against unions and distances found by hand."""

import functools
import warnings

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.indicators import INDICATORS, area_indicator, epsilon_indicator, igd_plus_indicator
from botohe_moo.mission import Mission
from botohe_moo.study.scores import reference_fronts, score_runs
from botohe_moo.study.tables import SCHEMAS, as_table

MEASURED = {"area", "igd_plus", "epsilon"}


@functools.cache
def quay(reward=10):
    """Dock (base) and reef, which alone pays; two robots: the objective space is 10 × 2."""
    graph = nx.DiGraph()
    graph.add_node("dock", reward=0)
    graph.add_node("reef", reward=reward)
    graph.add_edge("dock", "reef", survival=0.5)
    graph.add_edge("reef", "dock", survival=0.5)
    return Mission(graph, base="dock", robots=2)


def tables(found):
    """Runs and final fronts from (mission, algorithm, seed, points) or (..., points, status)."""
    runs, fronts = [], []
    for mission, algorithm, seed, points, *status in found:
        run = f"{mission}/{algorithm}/{seed}"
        identity = {"run": run, "mission": mission, "algorithm": algorithm, "seed": seed}
        runs.append(
            {
                **identity,
                "status": status[0] if status else "done" if points else "infeasible",
                "stopped_by": "evaluations",
                "evaluations": 100 * seed,
                "seconds": 0.5 * seed,
                "recording_seconds": 0.0,
                "min_survival": 0.0,
                "area": area_indicator(points, quay()),
                "front_size": len(points),
                "ties": 0,
                "environment": "here",
            }
        )
        fronts.append(np.array(points, float).reshape(-1, 2))
    return as_table("runs", runs), fronts


def scored(found, indicators=tuple(INDICATORS)):
    runs, fronts = tables(found)
    missions = dict.fromkeys(runs["mission"], quay())
    references = reference_fronts(runs, fronts, {})
    return score_runs(runs, fronts, references, missions=missions, indicators=indicators)


def points_of(references, mission):
    return references.loc[references["mission"] == mission, ["reward", "survivors"]].values.tolist()


coordinates = st.one_of(st.sampled_from([0.0, 1.0, 2.0]), st.floats(0, 2))
fronts = st.lists(st.tuples(coordinates, coordinates), max_size=3)


@st.composite
def studies(draw):
    """Runs of a study, some of which found nothing or were killed with a front."""
    missions = ["<i>", "b", "c", "d", "e", "f"][: draw(st.integers(1, 6))]
    algorithms = ["A & B", "x", "y", "z"][: draw(st.integers(1, 4))]
    seeds = range(1, draw(st.integers(1, 4)) + 1)
    fails = draw(st.sampled_from(["nobody", "somebody", "everybody"]))
    found = []
    for mission in missions:
        for algorithm in algorithms:
            for seed in seeds:
                points = draw(fronts) if fails == "somebody" else [draw(fronts.filter(len))[0]]
                if fails == "everybody":
                    points = []
                options = ["done", "timeout"] if points else ["infeasible", "timeout", "failed"]
                found.append((mission, algorithm, seed, points, draw(st.sampled_from(options))))
    return missions, algorithms, found


TWO_MISSIONS = [
    ("m", "a", 1, [(8, 0.5), (4, 1)]),
    ("m", "b", 1, [(4, 1), (2, 2), (3, 0.75)]),
    ("n", "a", 1, [(1, 1)]),
    ("n", "b", 1, []),
]


class TestReferenceFronts:
    def test_it_is_the_union_without_what_is_dominated_or_there_twice(self):
        references = reference_fronts(*tables(TWO_MISSIONS), {})
        assert points_of(references, "m") == [[8, 0.5], [4, 1], [2, 2]]
        assert points_of(references, "n") == [[1, 1]]
        assert list(references["mission"]) == ["m", "m", "m", "n"]

    def test_where_nothing_was_found_it_is_nothing_brought_back(self):
        references = reference_fronts(*tables([("m", "a", 1, []), ("m", "a", 2, [])]), {})
        assert points_of(references, "m") == [[0, 0]]

    @given(studies())
    def test_every_point_is_covered_and_no_point_covers_another(self, study):
        missions, _, found = study
        references = reference_fronts(*tables(found), {})
        as_table("references", references)
        for mission in missions:
            union = points_of(references, mission)
            for r, s in (point for run in found if run[0] == mission for point in run[3]):
                assert any(r <= right and s <= up for right, up in union)
            rewards, survivors = zip(*union, strict=True)
            assert all(np.diff(rewards) < 0)
            assert all(np.diff(survivors) > 0)


HALVES = [("m", "a", 1, [(10, 1), (5, 2)]), ("m", "b", 1, [(5, 1)]), ("m", "c", 7, [])]


class TestScores:
    def test_by_hand(self):
        """The reference is what a found; b lacks half of one objective each time, c all."""
        table = scored([*HALVES, ("m", "killed", 1, [(5, 1)], "timeout")])
        values = table.pivot(index="indicator", columns="algorithm", values="value")
        # 10 × 1 + 5 × 1 of 20, and distances from (0, 0) to (1, 0.5) and (0.5, 1).
        assert values["a"].to_dict() == {"area": 0.75, "igd_plus": 0, "epsilon": 0, "front_size": 2}
        expected = {"area": 0.25, "igd_plus": 0.5, "epsilon": 0.5, "front_size": 1}
        assert values["b"].to_dict() == values["killed"].to_dict() == expected
        assert values["c"].to_dict() == {
            "area": 0.0,
            "igd_plus": pytest.approx(1.25**0.5, rel=1e-15),
            "epsilon": 1.0,
            "front_size": 0.0,
        }

    def test_there_is_a_row_for_each_run_and_indicator_in_order(self):
        table = scored(HALVES, ["epsilon", "area"])
        assert table[["algorithm", "seed", "indicator"]].values.tolist() == [
            [algorithm, seed, indicator]
            for algorithm, seed in (("a", 1), ("b", 1), ("c", 7))
            for indicator in ("epsilon", "area")
        ]
        assert list(table["run"].unique()) == ["m/a/1", "m/b/1", "m/c/7"]

    def test_missions_do_not_change_each_other(self):
        found = scored([("m", "a", 1, [(10, 1)]), ("n", "a", 1, [(10, np.nextafter(1, 2))])])
        areas = found.loc[found["indicator"] == "area", "value"]
        assert list(areas) == [0.5, np.nextafter(1, 2) / 2]

    @given(studies())
    def test_scores_are_those_of_the_indicators_and_fit_the_table(self, study):
        _, _, found = study
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            table = scored(found)
        as_table("indicators", table)
        assert len(table) == 4 * len(found)
        references = reference_fronts(*tables(found), {})
        values = table.set_index(["run", "indicator"])["value"]
        for mission, algorithm, seed, points, _ in found:
            union = points_of(references, mission)
            run = values[f"{mission}/{algorithm}/{seed}"]
            # Equal but for ties, of which a study of so few runs has no long chains.
            tied = {"rel": 0, "abs": 1e-11}
            shown = points or [(0, 0)]
            assert run["area"] == pytest.approx(area_indicator(points, quay()), **tied)
            igd_plus = igd_plus_indicator(shown, union, quay())
            assert run["igd_plus"] == pytest.approx(igd_plus, **tied)
            epsilon = epsilon_indicator(shown, union, quay())
            assert run["epsilon"] == pytest.approx(epsilon, **tied)
            assert run["front_size"] == len(points)

    @given(studies())
    def test_no_front_is_worse_than_none(self, study):
        table = scored([*study[2], (study[0][0], "nothing", 1, [])])
        of_mission = table[table["mission"] == study[0][0]]
        for name in MEASURED:
            signed = of_mission[of_mission["indicator"] == name].set_index("algorithm")["value"]
            signed = signed if INDICATORS[name].higher_is_better else -signed
            assert signed["nothing"] <= signed.min() + 1e-15


def test_tables_without_rows_fit():
    assert {len(as_table(name, [])) for name in SCHEMAS} == {0}
