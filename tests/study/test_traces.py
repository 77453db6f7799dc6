"""Quality on the way, and what it took to get there, by hand."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from botohe_moo.indicators import INDICATORS, area_indicator, epsilon_indicator, igd_plus_indicator
from botohe_moo.study.scores import SHARES, reach_targets, score_fronts
from botohe_moo.study.tables import as_table
from tests.study.test_scores import quay

AREA = 0.5  # of the reference front
REFERENCE = as_table("references", [{"mission": "m", "reward": 10.0, "survivors": 1.0}])


def targets(found, area=AREA):
    """The table from {algorithm: runs}, each run a list of (evaluations, area)."""
    runs, trace = [], []
    for algorithm, records_of in found.items():
        for seed, records in enumerate(records_of, 1):
            key = {"run": f"{algorithm}{seed}", "mission": "m", "algorithm": algorithm}
            runs.append(key)
            trace += [
                {**key, "evaluations": evaluations, "seconds": evaluations / 100, "area": area}
                for evaluations, area in records
            ]
    columns = ["run", "mission", "algorithm", "evaluations", "seconds", "area"]
    table = reach_targets(
        pd.DataFrame(runs, columns=columns[:3]),
        pd.DataFrame(trace, columns=columns),
        {"m": area},
    )
    as_table("targets", table)
    return table


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

    def test_where_nothing_was_found_there_is_nothing_to_reach(self):
        assert targets({"A": [[(10, 0.0)]]}, 0.0).empty

    def test_what_has_no_run_has_no_row(self):
        assert targets({"A": [], "B": [[(10, 0.5)]]})["algorithm"].unique().tolist() == ["B"]
        assert targets({"A": []}).empty


class TestScores:
    FRONTS = tuple(np.array(front, float) for front in ([(5, 1)], [(5, 1)], [(10, 0.5), (5, 1)]))

    def test_they_are_those_of_the_indicators(self):
        scores = score_fronts(
            [("m", front) for front in self.FRONTS],
            REFERENCE,
            missions={"m": quay()},
            indicators=["area", "igd_plus", "epsilon"],
        )
        reference = [(10, 1)]
        for i, front in enumerate(self.FRONTS):
            assert scores["area"][i] == area_indicator(front, quay())
            assert scores["igd_plus"][i] == igd_plus_indicator(front, reference, quay())
            assert scores["epsilon"][i] == epsilon_indicator(front, reference, quay())

    def test_a_front_that_stays_is_measured_once(self, monkeypatch):
        measured = []

        def measure(points, mission):
            measured.append(points)
            return area_indicator(points, mission)

        counted = dataclasses.replace(INDICATORS["area"], function=measure)
        monkeypatch.setitem(INDICATORS.own, "area", counted)
        one, _, other = self.FRONTS
        fronts = [("m", front) for front in [one] * 5 + [other] * 5]
        score_fronts(fronts, REFERENCE, missions={"m": quay()}, indicators=["area"])
        assert len(measured) == 2
