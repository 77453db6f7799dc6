"""The matrix that opens a report says what the comparisons say."""

import re
from dataclasses import dataclass

import numpy as np
import pytest

from botohe_moo.study import read_study
from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.loading import load_study
from botohe_moo.study.report import matrix, matrix_caption, render_page
from botohe_moo.study.scores import collect_tables
from tests.study.test_collect import outcome_of
from tests.study.test_report import checked

STEPS = 1e-7 * np.arange(8)


def page_text(tables):
    return checked(render_page(tables, {})).text


def judged(folder, areas, *, control=None, **changes):
    """A study whose final fronts are one point each, of the areas given by mission and label."""
    missions = list(areas)
    labels = list(dict.fromkeys(label for found in areas.values() for label in found))
    seeds = max(len(found) for of_one in areas.values() for found in of_one.values())
    content = {
        "name": "judged",
        "missions": {
            m: {"mission": "terrain", "parameters": {"nodes": 10 + i, "seed": 1}}
            for i, m in enumerate(missions)
        },
        "algorithms": {
            x: {"algorithm": "bo-aco", "parameters": {"n_ants": 5 + i}}
            for i, x in enumerate(labels)
        },
        "budget": {"evaluations": 100},
        "seeds": seeds,
        "comparison": {"control": control, "significance": 0.05},
        **changes,
    }
    study, store = load_study(content), StudyFolder(folder / "study")
    with store.locked(study):
        store.write_study(study)
        for run in study.runs():
            found = areas[run.mission.label].get(run.algorithm.label, ())
            if run.seed <= len(found):
                area = found[run.seed - 1]
                store.save(run, outcome_of(run, [(area / 2, 1.0)], [(area, 1.0)]))
        collect_tables(study, store)
    return read_study(store.path)


AREAS = {
    "m": {"A": 0.3 + STEPS, "B": 0.4 + STEPS, "C": 0.2 + STEPS},
    "n": {"A": 0.3 + STEPS, "B": 0.3 + STEPS, "C": [0.1]},
}


@dataclass
class Cell:
    """A cell of the matrix, taken apart."""

    text: str
    mark: str
    rank: str
    best: bool


def rows_of(tables):
    """The rows of the matrix, by the text of their first cell."""
    table = matrix(tables)
    first, *columns = table.cells
    rows = {}
    for i, row in enumerate(table.cells.to_dict("records")):
        rows[row[first]] = [
            Cell(
                *re.fullmatch(r"(\S+) ?([+=–]?) ?\(?([\d.]*)\)?", row[c]).groups(), table.bold[c][i]
            )
            for c in columns
        ]
    return rows


class TestMatrix:
    def test_marks_are_against_the_control(self, tmp_path):
        tables = judged(tmp_path, AREAS, control="A")
        found = rows_of(tables)
        assert list(matrix(tables).cells)[:3] == [" algorithm", "m", "n"]
        marks = {label: [cell.mark for cell in row[:2]] for label, row in found.items()}
        assert marks == {"A": ["", ""], "B": ["+", "="], "C": ["–", ""]}
        texts = {label: [cell.text for cell in row] for label, row in found.items()}
        assert texts["B"] == ["0.4000", "0.3000", "1.250"]
        assert texts["C"] == ["0.2000", "0.1000", "3"]
        assert [cell.rank for cell in found["A"][:2]] == ["2", "1.5"]
        assert [cell.best for cell in found["B"][:2]] == [True, True]
        assert "+ is better than A, – worse" in matrix_caption(tables)

    def test_without_control_they_are_against_the_best(self, tmp_path):
        found = rows_of(judged(tmp_path, AREAS))
        marks = {label: [cell.mark for cell in row[:2]] for label, row in found.items()}
        assert marks == {"A": ["–", ""], "B": ["", "="], "C": ["–", ""]}

    def test_a_larger_median_can_lose(self, tmp_path):
        """Most of B's runs beat most of A's, but the middle of A's is a little higher."""
        areas = {"m": {"A": [0.1] * 7 + [0.502] * 8, "B": [0.5] * 8 + [0.6] * 7}}
        [[a], [b]] = rows_of(judged(tmp_path, areas)).values()
        assert (a.best, b.best, b.mark) == (True, False, "+")

    def test_one_ulp_is_a_tie(self, tmp_path):
        ulps = [np.nextafter(0.5, 1)] * 8
        tables = judged(tmp_path, {"m": {"A": [0.5] * 8, "B": ulps, "C": [0.4] * 8}})
        cells = {label: row[0] for label, row in rows_of(tables).items()}
        assert [cells[x].rank for x in "ABC"] == ["1.5", "1.5", "3"]
        assert [cells[x].mark for x in "ABC"] == ["", "=", "–"]
        assert cells["A"].best
        assert cells["B"].best
        summary = tables.summary.set_index("algorithm")["rank"]
        assert summary.to_dict() == {"A": 1.5, "B": 1.5, "C": 3.0}

    def test_without_areas_it_is_of_what_is_compared(self, tmp_path):
        areas = {"m": {"A": 0.4 + STEPS, "B": 0.5 + STEPS}}
        tables = judged(tmp_path, areas, indicators=["igd_plus"])
        [[a], [b]] = rows_of(tables).values()
        assert (a.mark, b.best) == ("–", True)
        assert matrix_caption(tables).startswith("Median IGD+ over runs")

    def test_the_longer_list_goes_down_the_page(self, tmp_path):
        areas = {m: {"A": [0.3], "B": [0.4]} for m in "mno"}
        found = matrix(judged(tmp_path, areas))
        assert list(found.cells) == [" mission", "A", "B"]
        assert found.cells[" mission"].tolist() == ["m", "n", "o", " average rank"]

    def test_marks_are_those_of_the_comparisons(self, tmp_path):
        rng = np.random.default_rng(3)
        areas = {m: {x: rng.random(8) / 2 for x in "ABCDE"} for m in "mn"}
        tables = judged(tmp_path, areas, control="A")
        cells = rows_of(tables)
        areas = tables.comparisons[tables.comparisons["indicator"] == "area"]
        for i, mission in enumerate("mn"):
            rows = areas[areas["mission"] == mission]
            for row in rows.to_dict("records"):
                words = {"+": "better, ", "–": "worse, ", "=": "no difference"}
                assert words[cells[row["algorithm"]][i].mark] in row["verdict"]


class TestMissing:
    def test_missing_runs_are_counted(self, tmp_path):
        tables = judged(
            tmp_path, {"m": {"A": [0.3] * 3, "B": [0.4]}, "n": {"A": [0.2] * 2}}, control="A"
        )
        assert tables.missing.to_numpy().tolist() == [["m", "B", 2], ["n", "A", 1], ["n", "B", 3]]
        text = page_text(tables)
        assert "2 missions, 2 algorithms, 3 seeds; 6 runs, all done; 6 missing." in text
        assert "6 runs are missing : not performed yet, or the study was stopped." in text
        assert "mission algorithm missing m B 2 n A 1 n B 3" in text
        assert "B 1 0 0.4000" in text
        assert "B 0.4000 (1) –" in text


class TestPosthoc:
    def test_pairs_are_compared_where_friedman_applies(self, tmp_path):
        """Six missions, on each of which the four rank alike."""
        areas = {m: {x: [0.1 * (i + 1)] for i, x in enumerate("ABCD")} for m in "mnopqr"}
        ranked = judged(tmp_path, areas)
        rows = ranked.posthoc[ranked.posthoc["indicator"] == "area"]
        assert len(rows) == 6
        # 2.569 sqrt(4 · 5 / (6 · 6)), by Demšar's table 5.
        assert rows["critical_difference"].unique() == pytest.approx([2.569 * 0.745356], rel=2e-4)
        apart = rows["difference"].abs() > rows["critical_difference"]
        assert list(rows["significant"]) == list(apart)
        assert apart.sum() == 3
        text = page_text(ranked)
        assert "difference p (Nemenyi) A B 1 " in text
        assert "Post hoc by Nemenyi, whose critical difference is 1.91." in text


class TestTargets:
    def test_they_are_in_every_section(self, tmp_path):
        areas = {"m": {"A": [0.4, 0.4, 0.4], "B": [0.4, 0.2, 0.37]}}
        tables = judged(tmp_path, areas)
        rows = tables.targets.set_index(["algorithm", "share"])
        assert list(rows.loc["A", "n_reached"]) == [3, 3, 3]
        assert list(rows.loc["B", "n_reached"]) == [2, 1, 1]
        assert list(rows.loc["A", "evaluations_median"]) == [20, 20, 20]
        assert rows["evaluations_median"].isna().tolist() == [False] * 4 + [True] * 2
        text = page_text(tables)
        assert "0.9000 A 3 3 20 1 0.9000 B 2 3 20 1 0.9500 A 3 3 20 1 0.9500 B 1 3 – –" in text


def test_figures_of_the_study_as_a_whole_have_a_place(tmp_path):
    tables = judged(tmp_path, {"m": {"A": [0.3], "B": [0.4]}})
    picture = tmp_path / "ranks.png"
    picture.write_bytes(b"\x89PNG")
    text = render_page(tables, {"": [([picture], "Everything at a glance. All of it.")]})
    assert text.count("<figure>") == 1
    assert re.search(r'<section id="ranks">.*Everything at a glance.*</section>', text, re.DOTALL)
