"""The report of a study: what is written, what it says, and which figures it has."""

import json
import math
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from botohe_moo import load_mission, plots
from botohe_moo.plots.comparisons import two_parameter_grids
from botohe_moo.study import report
from botohe_moo.study.content import parameter_words
from botohe_moo.study.perform import Outcome
from botohe_moo.study.report import (
    draw_figures,
    matrix,
    matrix_caption,
    number_text,
    render_page,
    rivals,
    slug,
    tables_latex,
    write_report,
)
from botohe_moo.study.tables import SCHEMAS, StudyTables
from tests.study.made import made_study, outcome_of, study_of

ODD = "a/b_c$ <b>&\"' 50%"
FIXED_NAMES = ["report.html", "outcome.tex", "summary.tex", "comparisons.tex", "ranks.tex"]
KINDS = ["curves", "seconds", "reached", "igd_plus", "epsilon", "areas", "fronts", "attainment"]
STEPS = 1e-7 * np.arange(8)
LOST = Outcome("failed", "error", error="it broke")
FORMATS = report.FORMATS  # before it is sketched


pytestmark = pytest.mark.usefixtures("sketched")


def content_of(missions, algorithms, *, seeds=2, control=None, **changes):
    """A study in which each mission is the toy with another team."""
    return study_of(
        missions={m: {"mission": "toy", "robots": 2 + i} for i, m in enumerate(missions)},
        algorithms={
            a: {"algorithm": "bo-aco", "parameters": {"n_ants": 5 + i}}
            for i, a in enumerate(algorithms)
        },
        seeds=seeds,
        comparison={"control": control, "significance": 0.05},
        **changes,
    )


def growing(run, *, n_records=4):
    """A run whose fronts grow; the further down the algorithm stands, the further they come."""
    strength = 0.4 + len(run.algorithm.label) % 7 / 20 + run.seed / 100
    reached = strength * np.geomspace(0.5, 1, n_records)[:, None, None]
    return outcome_of(run, *(reached * [[(1.0, 0.4), (0.7, 0.7), (0.4, 1.0)]]))


def judged(folder, areas, **changes):
    """A study whose final fronts are one point each, of the areas given by mission and label."""
    labels = list(dict.fromkeys(label for found in areas.values() for label in found))
    seeds = max(len(found) for of_one in areas.values() for found in of_one.values())

    def outcome(run):
        found = areas[run.mission.label].get(run.algorithm.label, ())
        if run.seed <= len(found):
            area = found[run.seed - 1]
            return outcome_of(run, [(area / 2, 1.0)], [(area, 1.0)])
        return None

    return made_study(folder, content_of(areas, labels, seeds=seeds, **changes), outcome)


class Page(HTMLParser):
    """Parses a page; fails if it loads anything else or a tag is not closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.attributes, self.texts = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []
        assert not {"script", "link", "iframe", "object"} & {*self.tags}
        assert not [name for name, _ in self.attributes if name.startswith("on")]
        assert not re.search(r"url\(|@import", text[: text.index("</style>")])
        ids = self.values("id")
        assert len({*ids}) == len(ids)
        for address in self.values("href", "src"):
            assert address.startswith("data:image/png;base64,") or address[1:] in ids
        assert self.tags.count("img") == len([value for value in self.values("alt") if value])
        self.text = " ".join(" ".join(self.texts).split())

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in {"meta", "img", "br", "hr", "link", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.texts.append(data)

    def values(self, *names):
        return [value for name, value in self.attributes if name in names]


def page_text(tables):
    return Page(render_page(tables, {})).text


@pytest.fixture(scope="module")
def odd(tmp_path_factory, sketched):
    """Odd labels, a grid, runs that are lost or missing; the tables, its files and its page."""
    content = content_of(["toy", ODD, "later"], ["BO-ACO", ODD, "single", "lost"], seeds=3)
    content["missions"][ODD]["max_length"] = 30
    grid = {"n_ants": [100, 50], "evaporation": [0.1, 0.2]}
    content["algorithms"]["ants"] = {"algorithm": "bo-aco", "grid": grid}
    content["comparison"]["control"] = "BO-ACO"
    content["title"] = "Title <i>& more"
    content["description"] = "About <script>alert(1)</script> it."

    def outcome(run):
        mission, algorithm = run.mission.label, run.algorithm.label
        if mission == "later" or (algorithm == "single" and run.seed > 1):
            return None
        if algorithm == "lost" and mission == "toy":
            return Outcome("failed", "error", error="ValueError: <boom> & bust")
        if algorithm == "lost" and run.seed == 3:
            return Outcome("timeout", "limit", error="stopped after 60 seconds")
        return growing(run)

    tables = made_study(tmp_path_factory.mktemp("odd"), content, outcome)
    paths = write_report(tables)
    return tables, paths, Page(paths[0].read_text("utf-8"))


class TestReport:
    def test_all_files_are_written_and_named(self, odd):
        tables, paths, page = odd
        folder = tables.folder / "report"
        kinds = [*KINDS, "difference", "grid-1"]
        names = [f"{kind}-{slug(label)}.png" for label in ("toy", ODD) for kind in kinds]
        expected = [folder / name for name in FIXED_NAMES]
        expected += [folder / "figures" / name for name in ("shortfalls.png", *names)]
        assert sorted(paths) == sorted(expected) == sorted(folder.rglob("*.*"))
        assert page.tags.count("img") == page.tags.count("figcaption") == len(names) + 1
        assert "median area of ants for each combination of two parameters" in page.text

    def test_labels_are_text_whatever_they_are(self, odd):
        *_, page = odd
        assert not {"b", "i"} & set(page.tags)
        assert ODD in page.texts
        assert "ValueError: <boom> & bust" in page.texts
        assert any(ODD in alternative for alternative in page.values("alt"))

    def test_what_the_page_says(self, odd):
        outcome = odd[2].text.partition(" Outcome ")[2].partition("What was run")[0]
        assert outcome.startswith(f"algorithm toy {ODD} later average rank BO-ACO 0.")
        assert "4 runs are not done , and scored all the same" in outcome
        assert "28 runs are missing : not performed yet, or the study was stopped." in outcome
        for said in (
            "Title <i>& more",
            "About <script>alert(1)</script> it.",
            "3 missions, 8 algorithms, 3 seeds; 44 runs, 40 done; 28 missing.",
            "Seeds 1, 2, 3",
            "others with BO-ACO, at a significance level of 0.05",
            "min survival max length nodes",
            "toy toy robots=2 300 0 – 5 12 2 10",
            f"{ODD} toy robots=3 300 0 30 5 12 3 10",
            "ants (n_ants=50, evaporation=0.1) bo-aco n_ants=50, evaporation=0.1",
            "scored as the plan that brings nothing back: area 0",
            "toy lost 1 failed error ValueError: <boom> & bust 0",
            f"{ODD} lost 3 timeout limit stopped after 60 seconds 0",
            "runs n not done area area low area high",
            "lost 3 3 0 0 0 0",
            f"later {load_mission('toy').title} No runs yet.",
            f"mission algorithm missing toy single 2 {ODD} single 2 later BO-ACO 3",
            "Runs without any recorded front are not in it.",
            "Runs without a front reach nothing.",
            "from the reference front, what all runs on a mission found together; 0 is best.",
        ):
            assert said in odd[2].text

    def test_each_verdict_is_said_once(self, odd):
        """In a word, beside its numbers."""
        tables, _, page = odd
        pattern = r"(better|worse), \w+|no difference found|too few runs"
        said = [text for text in page.texts if re.fullmatch(pattern, text)]
        assert len(said) == len(tables.comparisons) > 0

    def test_best_known_fronts_are_named_as_references(self, odd):
        tables = replace(odd[0], manifest={**odd[0].manifest, "reference": "best-known"})
        said = "what all runs on a mission found together, with the best known front of the library"
        assert said in page_text(tables)

    @pytest.mark.parametrize(
        ("labels", "outcome", "kinds", "said"),
        [
            ("A", growing, KINDS, "1 mission, 1 algorithm, 1 seed; 1 run, all done."),
            (
                "AB",
                lambda _: LOST,
                ["areas"],
                "A 0 (1.5) B 0 (1.5)",
            ),  # one run cannot tell: no mark
            ("A", lambda _: None, [], "0 runs"),
        ],
        ids=["one run", "no front", "no run"],
    )
    def test_of_little(self, tmp_path, labels, outcome, kinds, said):
        tables = made_study(tmp_path, content_of(["m"], labels, seeds=1), outcome)
        names = {path.name for path in write_report(tables)}
        assert names == {*FIXED_NAMES, *(f"{kind}-m.png" for kind in kinds)}
        text = page_text(tables)
        assert said in text
        assert "max length" not in text

    def test_if_it_is_interrupted_all_files_stay(self, tmp_path, monkeypatch):
        tables = made_study(tmp_path, content_of(["m"], ["A"], seeds=1), growing)
        before = {path: path.read_bytes() for path in write_report(tables)}
        monkeypatch.setattr(report, "render_page", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            write_report(replace(tables, runs=tables.runs.assign(area=0.5)))
        files = [path for path in (tables.folder / "report").rglob("*") if path.is_file()]
        assert {path: path.read_bytes() for path in files} == before

    @pytest.mark.slow
    @pytest.mark.filterwarnings("ignore:Glyph")  # of scripts that the font has not
    def test_labels_of_any_script_and_length_can_be_drawn(self, tmp_path, monkeypatch):
        labels = ["蚁群算法", "ع_ربي 😀", "Donaudampfschifffahrtselektrizitätenwerk " * 4 + "x"]
        mission = "a very long label of a mission 美术馆 " * 4 + "y"
        tables = made_study(tmp_path, content_of([mission], labels), growing)
        monkeypatch.setattr(report, "save_plot", plots.save_plot)
        figures = draw_figures(tables, tmp_path)[mission]
        assert len(figures) == len(KINDS) + 1
        assert all(path.stat().st_size > 10_000 for paths, _ in figures for path in paths)

    @pytest.mark.slow
    def test_processes_draw_missions_in_all_formats(self, tmp_path):
        tables = made_study(tmp_path, content_of("mn", "A"), lambda _: LOST)
        figures = draw_figures(tables, tmp_path, workers=2)
        for label in "mn":
            [(paths, _)] = figures[label]
            assert [path.name for path in paths] == [f"areas-{label}.{e}" for e in FORMATS]
            assert all(path.stat().st_size > 1_000 for path in paths)


class TestWords:
    @given(st.text(min_size=1), st.text(min_size=1))
    @example("art_museum", "Art museum")
    @example("../..", "")
    def test_slugs_are_safe_and_tell_labels_apart(self, one, other):
        assert slug("art_museum") == "art_museum"
        assert re.fullmatch(r"[a-z0-9][a-z0-9._-]*", slug(one))
        assert len(slug(one)) < 80
        assert (slug(one) == slug(other)) == (one == other)

    def test_numbers_and_settings(self):
        numbers = {0.12345: "0.1235", 0.00123456: "0.001235", 123456.7: "123,457", 0: "0"}
        numbers |= {1.234e-9: "1.234e-09", 12.345: "12.35", 10_000.0: "10,000", 3.5: "3.500"}
        numbers |= {math.inf: "inf"}  # the gap of runs without a front
        assert {number: number_text(number) for number in numbers} == numbers
        words = parameter_words({"a": 1, "b": None, "c": "x", "d": [0.5]})
        assert words == "a=1, b=null, c=x, d=[0.5]"


def cells_of(tables):
    """The rows of the matrix, by their labels; cells that are bold begin with *."""
    table = matrix(tables)
    first, *columns = table.cells
    return {
        row[first]: [("*" if table.bold[c][i] else "") + row[c] for c in columns]
        for i, row in enumerate(table.cells.to_dict("records"))
    }


AREAS = {
    "m": {"A": 0.3 + STEPS, "B": 0.4 + STEPS, "C": 0.2 + STEPS},
    "n": {"A": 0.3 + STEPS, "B": 0.3 + STEPS, "C": [0.1]},
}


class TestMatrix:
    def test_marks_are_against_the_control(self, tmp_path):
        tables = judged(tmp_path, AREAS, control="A")
        assert list(matrix(tables).cells) == [" algorithm", "m", "n", " average rank"]
        assert cells_of(tables) == {
            "A": ["0.3000 (2)", "*0.3000 (1.5)", "1.750"],
            "B": ["*0.4000 + (1)", "*0.3000 = (1.5)", "*1.250"],
            "C": ["0.2000 – (3)", "0.1000 (3)", "3"],
        }
        assert "+ is better than A, – worse" in matrix_caption(tables)
        for control, pair in {"A": "AB", "B": "BA", "C": "CB", None: "BA"}.items():
            comparison = {"control": control, "significance": 0.05}
            changed = replace(tables, manifest={**tables.manifest, "comparison": comparison})
            assert rivals(changed.of_mission("m")) == tuple(pair)

    def test_without_control_they_are_against_the_best(self, tmp_path):
        assert cells_of(judged(tmp_path, AREAS)) == {
            "A": ["0.3000 – (2)", "*0.3000 (1.5)", "1.750"],
            "B": ["*0.4000 (1)", "*0.3000 = (1.5)", "*1.250"],
            "C": ["0.2000 – (3)", "0.1000 (3)", "3"],
        }

    @pytest.mark.parametrize(
        ("areas", "cells"),
        [
            # Most of B's runs beat most of A's, but the middle of A's is a little higher.
            (
                {"A": [0.1] * 7 + [0.502] * 8, "B": [0.5] * 8 + [0.6] * 7},
                ["*0.5020 (1)", "0.5000 + (2)"],
            ),
            # One ulp is a tie.
            (
                {"A": [0.5] * 8, "B": [np.nextafter(0.5, 1)] * 8, "C": [0.4] * 8},
                ["*0.5000 (1.5)", "*0.5000 = (1.5)", "0.4000 – (3)"],
            ),
        ],
    )
    def test_one_mission(self, tmp_path, areas, cells):
        tables = judged(tmp_path, {"m": areas})
        assert [cell for [cell] in cells_of(tables).values()] == cells
        ranks = [float(re.search(r"\((.*)\)", cell)[1]) for cell in cells]
        assert tables.summary["rank"].tolist() == ranks

    def test_without_areas_it_is_of_what_is_compared(self, tmp_path):
        areas = {"m": {"A": 0.4 + STEPS, "B": 0.5 + STEPS}}
        tables = judged(tmp_path, areas, indicators=["igd_plus"])
        [[a], [b]] = cells_of(tables).values()
        assert " – (2)" in a
        assert b[0] == "*"
        assert matrix_caption(tables).startswith("Median IGD+ over runs")

    def test_the_longer_list_goes_down_the_page(self, tmp_path):
        found = matrix(judged(tmp_path, {m: {"A": [0.3], "B": [0.4]} for m in "mno"}))
        assert list(found.cells) == [" mission", "A", "B"]
        assert found.cells[" mission"].tolist() == ["m", "n", "o", " average rank"]


def test_ranks_that_were_tested_are_compared_in_pairs(tmp_path):
    """Six missions, on each of which the four rank alike."""
    areas = {m: {x: [0.1 * (i + 1)] for i, x in enumerate("ABCD")} for m in "mnopqr"}
    tables = judged(tmp_path, areas)
    rows = tables.posthoc[tables.posthoc["indicator"] == "area"]
    assert len(rows) == 6
    # 2.569 sqrt(4 · 5 / (6 · 6)), by Demšar's table 5.
    assert rows["critical_difference"].unique() == pytest.approx([2.569 * 0.745356], rel=2e-4)
    apart = rows["difference"].abs() > rows["critical_difference"]
    assert list(rows["significant"]) == list(apart)
    assert apart.sum() == 3
    one = {**tables.manifest, "missions": {"m": tables.manifest["missions"]["m"]}}
    figures = draw_figures(replace(tables, manifest=one), tmp_path)[""]
    assert [paths[0].stem for paths, _ in figures] == ["shortfalls", "critical-difference-area"]
    page = render_page(tables, {"": figures})
    assert "difference p (Nemenyi) A B 1 " in Page(page).text
    assert "Post hoc by Nemenyi, whose critical difference is 1.91." in page
    assert re.search(r'<section id="ranks">.*difference is 1.91.*</section>', page, re.DOTALL)
    assert page.count("<figure>") == 2


def test_targets_are_those_of_the_reference_front(tmp_path):
    areas = {"m": {"A": [0.4, 0.4, 0.4], "B": [0.4, 0.2, 0.37]}}
    text = page_text(judged(tmp_path, areas))
    assert "0.9000 A 3 3 20 1 0.9000 B 2 3 20 1 0.9500 A 3 3 20 1 0.9500 B 1 3 – –" in text


@pytest.mark.parametrize(
    ("rows", "found"),
    [
        (
            [("A", "x", 100, 0.2), ("B", "x", 50, 0.2), ("C", "x", 50, 0.1)],
            [["C", "B"], [None, "A"]],
        ),
        ([], None),
        ([("A", "x", 1, 1), ("B", "x", 1, 2)], None),  # one parameter
        ([("A", "x", 1, 1), ("B", "y", 2, 2)], None),  # two algorithms
        ([("A", "x", 1, 1), ("B", "x", 2, 2), ("C", "x", 1, 1)], None),  # one cell twice
    ],
)
def test_grids_of_two_parameters(rows, found):
    frame = pd.DataFrame(rows, columns=["algorithm", "name", "p", "q"]).assign(family="F")
    lone = {"algorithm": "random", "name": "y", "family": "random"}
    grids = two_parameter_grids(pd.concat([frame, pd.DataFrame([lone])]))
    assert [*grids] == (["F"] if found else [])
    for grid in grids.values():
        assert (grid.index.name, grid.columns.name) == ("p", "q")
        assert (list(grid.index), list(grid.columns)) == ([50, 100], [0.1, 0.2])
        assert grid.astype(object).where(grid.notna(), None).values.tolist() == found


RESULTS = Path(__file__).parents[2] / "results"
SPECIAL = "MOEA {x}_1^2 #5 & 100 % ~ \\ [b] <c|d>"
LABELS = ["BO-ACO, journal", "NSGA-II (repair=safest-path, pop_size=1000)", SPECIAL]
GREEK = "[αβγδεζηθικλμνξοπρςστυφχψω] − ± × ≤ ≥"
HEADINGS = ["seconds", "algorithm", "mission", "average rank", "area", GREEK]


def committed(name):
    """The study of which the repository holds the small tables."""
    folder, tables = RESULTS / name, {}
    for table, schema in SCHEMAS.items():
        path = folder / f"{table}.csv"
        read = pd.read_csv(path) if path.exists() else pd.DataFrame()
        tables[table] = read.reindex(columns=[*schema])
    return StudyTables(folder, json.loads((folder / "study.json").read_text("utf-8")), **tables)


@pytest.fixture(scope="module")
def special(tmp_path_factory):
    """Long labels with special characters; an algorithm without a front on one of two missions."""

    def outcome(run):
        if (run.mission.label, run.algorithm.label) == ("toy", "lost"):
            return LOST
        return None if run.algorithm.label == "lost" else growing(run, n_records=1)

    content = content_of(["toy", SPECIAL], [*LABELS, "lost"])
    content["indicators"] = ["area", "igd_plus", "epsilon", "front_size"]
    return made_study(tmp_path_factory.mktemp("special"), content, outcome)


@pytest.fixture(scope="module")
def headings(tmp_path_factory):
    """Labels that are headings of the report, too, or begin as an option of LaTeX."""
    content = content_of(HEADINGS, HEADINGS[1:])
    folder = tmp_path_factory.mktemp("headings")
    return made_study(folder, content, lambda run: growing(run, n_records=1))


def rows_of(latex):
    """Cells of all rows."""
    lines = [line.removesuffix(r" \\") for line in latex.splitlines() if line.endswith(r" \\")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)&", line)] for line in lines]


class TestLatex:
    def test_rows_have_all_columns_and_special_characters_are_escaped(self, special):
        latex = tables_latex(special)
        escaped = (
            r"MOEA \{x\}\_1\textasciicircum 2 \#5 \& 100 \% \textasciitilde \space "
            r"\textbackslash \space {[}b] \textless{}c\textbar{}d\textgreater{}"
        )
        assert escaped in latex["summary.tex"]
        sizes = {"outcome": (4, 4), "summary": (13, 7), "comparisons": (10, 27), "ranks": (3, 12)}
        for name, (n_columns, n_rows) in sizes.items():
            header, *rows = rows_of(latex[f"{name}.tex"])
            assert len(header) == n_columns
            assert [len(row) for row in rows if row[1:] != header[1:]] == [n_columns] * n_rows

    def test_what_is_best_or_significant_is_bold(self, tmp_path):
        tables = judged(tmp_path, AREAS)
        latex = tables_latex(tables)
        assert "% Median area over runs, the best on a mission bold" in latex["outcome.tex"]
        assert latex["outcome.tex"].count(r"\bfseries") == 4  # two on n, and one over both
        rows = rows_of(latex["comparisons.tex"])
        bold = [row for row in rows if row[5].startswith(r"\bfseries")]
        assert len(bold) == tables.comparisons["significant"].sum() > 0
        assert "no Friedman test" in latex["ranks.tex"]

    def test_labels_may_be_headings(self, headings):
        header, *rows = rows_of(tables_latex(headings)["outcome.tex"])
        assert header[:-1] == ["", *HEADINGS[1:-1]]
        assert [row[0] for row in rows] == [*HEADINGS[:-1], header[-1], "average rank"]
        assert matrix(headings).html(1).count("average rank") == 3  # a mission, an algorithm, ours


PDFLATEX = shutil.which("pdflatex")
DOCUMENT = r"""\documentclass[conference]{IEEEtran}
\usepackage{booktabs,graphicx}
\begin{document}
\title{T}\author{A}\maketitle
\begin{table}\caption{C}\input{small}\end{table}
\begin{table*}\caption{C}\input{baselines}\end{table*}
\begin{table*}\caption{C}\input{outcome}\end{table*}
\begin{table*}\input{summary}\end{table*}
\begin{table*}\input{comparisons}\end{table*}
\begin{table}\input{ranks}\end{table}
\end{document}
"""


@pytest.mark.skipif(PDFLATEX is None, reason="pdflatex is not installed")
@pytest.mark.parametrize("labels", ["special", "headings"])
def test_tables_are_no_wider_than_a_two_column_page(labels, tmp_path, request):
    texts = tables_latex(request.getfixturevalue(labels))
    for name, known in (("small", "smoke"), ("baselines", "baselines")):
        texts[f"{name}.tex"] = tables_latex(committed(known))["outcome.tex"]
    for name, text in {**texts, "document.tex": DOCUMENT}.items():
        (tmp_path / name).write_text(text, "utf-8")
    command = [PDFLATEX, "-draftmode", "-interaction=nonstopmode", "-halt-on-error", "document"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120, check=False)
    said = done.stdout.decode("utf-8", "replace")
    assert done.returncode == 0, said[-2_000:]
    over = [float(size) for size in re.findall(r"Overfull \\[hv]box \(([\d.]+)pt", said)]
    assert max(over, default=0) <= 2.0
