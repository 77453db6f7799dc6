"""Which figures a report has: of the study as a whole, of grids, and where there is little."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from botohe_moo import load_mission
from botohe_moo.plots.comparisons import two_parameter_grids
from botohe_moo.study import report as pictures
from botohe_moo.study.report import FORMATS, draw_figures
from tests.study.made import make_study, random_record

TOY = load_mission("toy")


@pytest.fixture(autouse=True)
def _backend():
    mpl.use("Agg")
    yield
    plt.close("all")


def grid_study(folder, *, missions=("toy",), n_records=3):
    parameters = [{"n_ants": n, "evaporation": e} for n in (100, 50) for e in (0.04, 0.1)]
    algorithms = {
        f"BO-ACO (n_ants={p['n_ants']}, evaporation={p['evaporation']})": {
            "algorithm": "bo-aco",
            "parameters": p,
            "family": "BO-ACO",
        }
        for p in parameters
    }
    algorithms["random"] = {"algorithm": "random", "parameters": {}, "family": "random"}
    rng = np.random.default_rng(0)
    records = [
        random_record(rng, "toy", TOY, label, seed, strength=0.4 + i / 20, n_records=n_records)
        for i, label in enumerate(algorithms)
        for seed in (1, 2)
    ]
    return make_study(folder, dict.fromkeys(missions, TOY), algorithms, records)


def kinds(figures, label):
    return [paths[0].name.removesuffix(f"-{label}.png") for paths, _ in figures[label]]


class TestDrawFigures:
    @pytest.mark.slow
    def test_a_grid_has_a_heat_map_and_labels_are_whole(self, monkeypatch, tmp_path):
        monkeypatch.setattr(pictures, "FORMATS", FORMATS[:1])
        tables = grid_study(tmp_path, missions=("toy", "later"))
        figures = draw_figures(tables, tmp_path)
        assert figures[""] == []
        assert figures["later"] == []  # without runs
        assert kinds(figures, "toy") == [
            "curves",
            "seconds",
            "reached",
            "igd_plus",
            "epsilon",
            "areas",
            "grid-1",
            "fronts",
            "attainment",
            "difference",
        ]
        [caption] = [caption for paths, caption in figures["toy"] if "grid" in paths[0].name]
        assert "median area of BO-ACO for each combination of two parameters" in caption
        for paths, _ in figures["toy"]:
            assert [path.suffix[1:] for path in paths] == ["png"]
            assert all(path.stat().st_size for path in paths)

    @pytest.mark.slow
    @pytest.mark.filterwarnings("ignore:Glyph")  # of scripts that the font has not
    def test_labels_of_any_script_and_length_can_be_drawn(self, tmp_path):
        labels = [
            "蚁群算法",
            "ع_ربي 😀",
            "Donaudampfschifffahrtselektrizitätenhauptbetriebswerk " * 3,
        ]
        mission, rng = "a very long label of a mission 美术馆 " * 5, np.random.default_rng(0)
        records = [
            random_record(rng, mission, TOY, label, seed, strength=0.4 + i / 20, n_records=2)
            for i, label in enumerate(labels)
            for seed in (1, 2)
        ]
        algorithms = {label: {"algorithm": "nsga2", "parameters": {}} for label in labels}
        tables = make_study(tmp_path, {mission: TOY}, algorithms, records)
        figures = draw_figures(tables, tmp_path)[mission]
        assert len(figures) >= 8
        assert all(path.stat().st_size for paths, _ in figures for path in paths)

    @pytest.mark.slow
    def test_ranks_that_were_tested_have_the_critical_difference(self, tmp_path):
        tables = grid_study(tmp_path)
        ranks = dict(zip(tables.ranks["algorithm"], tables.ranks["average_rank"], strict=True))
        posthoc = pd.DataFrame(
            [
                {
                    "indicator": "area",
                    "algorithm": a,
                    "other": b,
                    "difference": ranks[a] - ranks[b],
                    "critical_difference": 2.0,
                    "p_value": 0.5,
                    "significant": abs(ranks[a] - ranks[b]) > 2.0,
                }
                for a, b in combinations(ranks, 2)
            ]
        )
        figures = draw_figures(replace(tables, posthoc=posthoc), tmp_path)
        [(paths, caption)] = figures[""]
        names = [path.name for path in paths]
        assert names == [f"critical-difference-area.{end}" for end in FORMATS]
        assert "no two differ significantly by the Nemenyi test" in caption


class TestTwoParameterGrids:
    def test_rows_and_columns_ascend(self, tmp_path):
        grids = two_parameter_grids(grid_study(tmp_path).algorithms)
        assert list(grids) == ["BO-ACO"]
        grid = grids["BO-ACO"]
        assert (grid.index.name, grid.columns.name) == ("n_ants", "evaporation")
        assert list(grid.index) == [50, 100]
        assert list(grid.columns) == [0.04, 0.1]
        assert grid.loc[50, 0.1] == "BO-ACO (n_ants=50, evaporation=0.1)"

    def test_anything_else_is_none(self):
        for rows in (
            [],
            [("A", "x", 1, 1), ("B", "x", 1, 2)],  # one parameter
            [("A", "x", 1, 1), ("B", "y", 2, 2)],  # two algorithms
            [("A", "x", 1, 1), ("B", "x", 2, 2), ("C", "x", 1, 1)],  # one cell twice
        ):
            frame = pd.DataFrame(rows, columns=["algorithm", "name", "p", "q"]).assign(family="F")
            assert two_parameter_grids(frame) == {}
