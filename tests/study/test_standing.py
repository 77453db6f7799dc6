"""Headline, matrix, marks and verdicts say the same, since they come of the same comparisons."""

import re

import numpy as np
import pytest

from botohe_moo.study import read_study
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.judge.collect import collect_tables
from botohe_moo.study.report import folder as report_folder
from botohe_moo.study.report.folder import write_report
from botohe_moo.study.report.page import ReportFigure, render_page
from botohe_moo.study.report.page_tables import posthoc_words
from botohe_moo.study.report.standing import leader, matrix, standing
from botohe_moo.study.report.words import distinct, listed, significant
from botohe_moo.study.store.folder import StudyFolder
from tests.study.test_collect import outcome_of
from tests.study.test_report import page_of

STEPS = 1e-7 * np.arange(8)


@pytest.fixture(autouse=True)
def _without_pictures(monkeypatch):
    """What is tested here is text; pictures take most of the time."""
    monkeypatch.setattr(report_folder, "draw_figures", lambda *_: {})


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


class TestHeadline:
    """Medians that differ in the fifth decimal, and runs of one that are all better."""

    @pytest.fixture
    def close(self, tmp_path):
        return judged(tmp_path, {"m": {"A": 0.52201 + STEPS, "B": 0.52204 + STEPS}})

    def test_it_does_not_contradict_the_verdict_below(self, close):
        [verdict] = close.comparisons.query("indicator == 'area'")["verdict"]
        assert verdict.startswith("A is worse than B: A12 0.00")
        said = leader(close, "m")
        assert "share" not in said
        assert said.startswith("B has the largest median area, 0.52204 ")
        assert said.endswith("By the tests it is better than A.")

    def test_medians_look_different_where_they_are(self, close):
        write_report(close)
        page = page_of(close)
        cells = [text.strip() for text in page.texts]
        assert "0.52201" in cells
        assert "0.52204" in cells
        latex = (close.folder / "report" / "summary.tex").read_text()
        assert r"\textbf{0.52204}" in latex
        assert r"\textbf{0.52201}" not in latex

    def test_one_ulp_is_a_tie_everywhere(self, tmp_path):
        ulps = [np.nextafter(0.5, 1)] * 8
        tables = judged(tmp_path, {"m": {"A": [0.5] * 8, "B": ulps, "C": [0.4] * 8}})
        assert leader(tables, "m").startswith("A and B share the largest median area, 0.5000.")
        stands = standing(tables, "m")
        assert stands.found["A", "B"] == "="
        assert stands.found["C", "A"] == stands.found["C", "B"] == "−"
        summary = tables.summary.set_index("algorithm")["rank"]
        assert summary.to_dict() == {"A": 1.5, "B": 1.5, "C": 3.0}
        values = tables.indicators.query("indicator == 'area'").groupby("algorithm")["value"]
        assert set(values.unique()["A"]) == set(values.unique()["B"])

    def test_what_no_test_tells_apart_is_said(self, tmp_path):
        rng = np.random.default_rng(1)
        one, other = rng.random(8) / 2, rng.random(8) / 2
        tables = judged(tmp_path, {"m": {"A": one, "B": other, "C": STEPS}})
        best = "A" if np.median(one) > np.median(other) else "B"
        rest = "B" if best == "A" else "A"
        said = leader(tables, "m")
        assert said.endswith(f"By the tests it is better than C; not told apart from {rest}.")

    def test_a_larger_median_can_lose(self, tmp_path):
        """Most of B's runs beat most of A's, but the middle of A's is a little higher."""
        a = [0.1] * 7 + [0.502] * 8
        b = [0.5] * 8 + [0.6] * 7
        tables = judged(tmp_path, {"m": {"A": a, "B": b}})
        [verdict] = tables.comparisons.query("indicator == 'area'")["verdict"]
        assert verdict.startswith("A is worse than B")
        said = leader(tables, "m")
        assert said.startswith("A has the largest median area, 0.5020 ")
        assert said.endswith("By the tests it is worse, though not by its median, than B.")

    def test_equal_medians_of_different_runs(self, tmp_path):
        a = [0.5] * 8 + [0.6] * 7
        b = [0.1] * 7 + [0.5] * 8
        tables = judged(tmp_path, {"m": {"A": a, "B": b}})
        said = leader(tables, "m")
        assert said.startswith("All 2 algorithms have the same median area, 0.5000.")
        assert said.endswith("By the tests, which compare all runs, A is better than B.")

    def test_without_areas_it_speaks_of_what_is_compared(self, tmp_path):
        areas = {"m": {"A": 0.4 + STEPS, "B": 0.5 + STEPS}}
        tables = judged(tmp_path, areas, indicators=["igd_plus"])
        said = leader(tables, "m")
        assert said.startswith("B has the smallest median IGD+, ")
        assert said.endswith("By the tests it is better than A.")


AREAS = {
    "m": {"A": 0.3 + STEPS, "B": 0.4 + STEPS, "C": 0.2 + STEPS},
    "n": {"A": 0.3 + STEPS, "B": 0.3 + STEPS, "C": [0.1]},
}


class TestMatrix:
    def test_marks_are_against_the_control(self, tmp_path):
        found = matrix(judged(tmp_path, AREAS, control="A"))
        assert found.header[:3] == ["algorithm", "m", "n"]
        marks = {label: [cell.mark for cell in row[:2]] for label, row in found.rows}
        assert marks == {"A": ["", ""], "B": ["+", "="], "C": ["−", ""]}
        texts = {label: [cell.text for cell in row] for label, row in found.rows}
        assert texts["B"] == ["0.4000", "0.3000", "1 / 1 / 0", "1.25"]
        assert texts["C"] == ["0.2000", "0.1000", "0 / 0 / 1", "3.00"]
        assert [cell.rank for cell in dict(found.rows)["A"][:2]] == ["2", "1.5"]
        assert [cell.best for cell in dict(found.rows)["B"][:2]] == [True, True]
        assert "+ is better than A, − worse" in found.caption

    def test_without_control_they_are_against_the_best(self, tmp_path):
        found = matrix(judged(tmp_path, AREAS))
        marks = {label: [cell.mark for cell in row[:2]] for label, row in found.rows}
        assert marks == {"A": ["−", ""], "B": ["", "="], "C": ["−", ""]}

    def test_the_longer_list_goes_down_the_page(self, tmp_path):
        areas = {m: {"A": [0.3], "B": [0.4]} for m in "mno"}
        found = matrix(judged(tmp_path, areas))
        assert found.header == ["mission", "A", "B"]
        assert [label for label, _ in found.rows] == ["m", "n", "o", "average rank"]

    def test_marks_are_those_of_the_comparisons(self, tmp_path):
        rng = np.random.default_rng(3)
        areas = {m: {x: rng.random(8) / 2 for x in "ABCDE"} for m in "mn"}
        tables = judged(tmp_path, areas, control="A")
        cells = dict(matrix(tables).rows)
        areas = tables.comparisons[tables.comparisons["indicator"] == "area"]
        for i, mission in enumerate("mn"):
            rows = areas[areas["mission"] == mission]
            for row in rows.to_dict("records"):
                words = {"+": " is better than ", "−": " is worse than ", "=": "no difference"}
                assert words[cells[row["algorithm"]][i].mark] in row["verdict"]

    def test_the_report_opens_with_it(self, tmp_path):
        tables = judged(tmp_path, AREAS, control="A")
        write_report(tables)
        text = page_of(tables).text
        opening = text[text.index("Outcome") :]
        assert opening.startswith("Outcome algorithm m n + / = / − average rank A 0.3000 ")
        assert "B 0.4000 + (1) 0.3000 = (1.5) 1 / 1 / 0 1.25" in opening


class TestMissing:
    def test_missing_runs_are_counted(self, tmp_path):
        tables = judged(
            tmp_path, {"m": {"A": [0.3] * 3, "B": [0.4]}, "n": {"A": [0.2] * 2}}, control="A"
        )
        assert tables.missing.to_numpy().tolist() == [["m", "B", 2], ["n", "A", 1], ["n", "B", 3]]
        write_report(tables)
        text = page_of(tables).text
        assert "2 missions, 2 algorithms, 3 seeds; 6 runs, all done; 6 missing." in text
        assert "6 runs are missing : not performed yet, or the study was stopped." in text
        assert "mission algorithm missing runs m B 2 n A 1 n B 3" in text
        assert "B 1 of 3 0.4000" in text
        assert "n 0.2000 (1) – " in text

    def test_a_whole_study_lacks_none(self, tmp_path):
        tables = judged(tmp_path, {"m": {"A": [0.3], "B": [0.4]}})
        assert tables.missing.empty
        write_report(tables)
        assert "missing" not in page_of(tables).text


class TestPosthoc:
    @pytest.fixture
    def ranked(self, tmp_path):
        """Six missions, on each of which the four rank alike."""
        areas = {m: {x: [0.1 * (i + 1)] for i, x in enumerate("ABCD")} for m in "mnopqr"}
        return judged(tmp_path, areas)

    def test_pairs_are_compared_where_friedman_applies(self, ranked):
        rows = ranked.posthoc[ranked.posthoc["indicator"] == "area"]
        assert len(rows) == 6
        # 2.569 sqrt(4 · 5 / (6 · 6)), by Demšar's table 5.
        assert rows["critical_difference"].unique() == pytest.approx([2.569 * 0.745356], rel=2e-4)
        apart = rows["difference"].abs() > rows["critical_difference"]
        assert list(rows["significant"]) == list(apart)
        assert apart.sum() == 3

    def test_the_page_says_it(self, ranked):
        write_report(ranked)
        text = page_of(ranked).text
        said = (
            "Post hoc (Nemenyi, critical difference 1.91): C ranks better than A; "
            "D ranks better than A and B."
        )
        assert text.index(said) < text.index("What was run Missions")
        assert "difference of average ranks p (Nemenyi) A B 1.00" in text

    def test_what_friedman_overrules_is_said_to_be(self, ranked):
        rows = ranked.posthoc[ranked.posthoc["indicator"] == "area"].assign(significant=False)
        assert posthoc_words(rows) == (
            "Post hoc (Nemenyi, critical difference 1.91): no pair counts, since Friedman's test "
            "finds no difference."
        )

    def test_nothing_is_said_without_a_test(self, tmp_path):
        tables = judged(tmp_path, {"m": {"A": [0.3], "B": [0.4]}})
        assert tables.posthoc.empty
        assert posthoc_words(tables.posthoc) == ""
        write_report(tables)
        assert "Post hoc" not in page_of(tables).text


class TestTargets:
    def test_they_are_in_every_section(self, tmp_path):
        areas = {"m": {"A": [0.4, 0.4, 0.4], "B": [0.4, 0.2, 0.37]}}
        tables = judged(tmp_path, areas)
        rows = tables.targets.set_index(["algorithm", "share"])
        assert list(rows.loc["A", "n_reached"]) == [3, 3, 3]
        assert list(rows.loc["B", "n_reached"]) == [2, 1, 1]
        assert list(rows.loc["A", "evaluations_median"]) == [20, 20, 20]
        assert rows["evaluations_median"].isna().tolist() == [False] * 4 + [True] * 2
        write_report(tables)
        text = page_of(tables).text
        assert "A 3 of 3 20 1.00 3 of 3 20 1.00 3 of 3 20 1.00" in text
        assert "B 2 of 3 20 1.00 1 of 3 – – 1 of 3 – –" in text


def test_figures_of_the_study_as_a_whole_have_a_place(tmp_path):
    tables = judged(tmp_path, {"m": {"A": [0.3], "B": [0.4]}})
    picture = tmp_path / "ranks.png"
    picture.write_bytes(b"\x89PNG")
    figure = ReportFigure(picture, (picture,), "All of it.", "Everything at a glance.")
    text = render_page(tables, {"": [figure]})
    assert text.count("<figure>") == 1
    assert re.search(r'<section id="ranks">.*Everything at a glance.*</section>', text, re.DOTALL)


class TestDistinct:
    def test_digits_grow_until_values_look_different(self):
        assert distinct([0.12341, 0.12342, 0.5]) == ["0.12341", "0.12342", "0.50000"]
        assert distinct([0.1, 0.1 + 1e-11]) == ["0.10000000000", "0.10000000001"]
        assert distinct([0.1234561, 0.1234562, float("nan")]) == ["0.1234561", "0.1234562", "–"]
        assert distinct([0.00012341, 0.00012342], significant) == ["0.00012341", "0.00012342"]

    def test_ties_look_alike(self):
        tie = np.nextafter(0.12345, 0)
        assert distinct([0.12345, tie]) == distinct([0.12345] * 2)
        assert distinct([]) == []

    def test_names_are_listed(self):
        assert (listed("A"), listed("AB"), listed("ABC")) == ("A", "A and B", "A, B and C")
