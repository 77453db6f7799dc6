"""Tables in LaTeX fit a two-column class; typeset where pdflatex is installed."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from botohe_moo.study.report import matrix, tables_latex
from botohe_moo.study.tables import SCHEMAS, StudyTables
from tests.study.test_report import lost, random_records, study

RESULTS = Path(__file__).parents[2] / "results"
ODD = "MOEA {x}_1^2 #5 & 100 % ~ \\ [b] <c|d>"
LABELS = ["BO-ACO, journal", "NSGA-II (repair=safest-path, pop_size=1000)", ODD]
GREEK = "[αβγδεζηθικλμνξοπρςστυφχψω] − ± × ≤ ≥"
HEADINGS = ["seconds", "algorithm", "mission", "average rank", "area", GREEK]


def committed(name):
    """The study of which the repository holds the small tables."""
    folder = RESULTS / name
    tables = {
        name: pd.read_csv(path) if (path := folder / f"{name}.csv").exists() else pd.DataFrame()
        for name in SCHEMAS
    }
    tables = {n: t.reindex(columns=[*SCHEMAS[n]]) for n, t in tables.items()}
    return StudyTables(folder, json.loads((folder / "study.json").read_text("utf-8")), **tables)


@pytest.fixture(scope="module")
def odd(tmp_path_factory):
    """Long and odd labels, and an algorithm without a front on one of two missions."""
    records = random_records(["toy", ODD], LABELS, (1, 2), n_records=2)
    records += lost("toy", "lost", (1, 2))
    labels = [*LABELS, "lost"]
    return study(tmp_path_factory.mktemp("latex"), ["toy", ODD], records, labels=labels)


def rows_of(latex):
    """Cells of all rows."""
    lines = [line.removesuffix(r" \\") for line in latex.splitlines() if line.endswith(r" \\")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)&", line)] for line in lines]


class TestTables:
    def test_special_characters_are_escaped(self, odd):
        escaped = (
            r"MOEA \{x\}\_1\textasciicircum 2 \#5 \& 100 \% \textasciitilde \space "
            r"\textbackslash \space {[}b] \textless{}c\textbar{}d\textgreater{}"
        )
        assert escaped in tables_latex(odd)["summary.tex"]

    def test_rows_have_all_columns(self, odd):
        sizes = {"outcome": (4, 4), "summary": (13, 7), "comparisons": (10, 9), "ranks": (3, 4)}
        for name, (n_columns, n_rows) in sizes.items():
            header, *rows = rows_of(tables_latex(odd)[f"{name}.tex"])
            assert len(header) == n_columns
            assert [len(row) for row in rows if row[1:] != header[1:]] == [n_columns] * n_rows

    def test_the_outcome_says_what_its_marks_mean(self, odd):
        latex = tables_latex(odd)["outcome.tex"]
        assert "% Median area over runs, the best on a mission bold" in latex
        assert latex.count(r"\bfseries") == 3  # on both missions, and over them

    def test_significant_p_values_are_bold(self, odd):
        rows = rows_of(tables_latex(odd)["comparisons.tex"])
        bold = [row for row in rows if row[5].startswith(r"\bfseries")]
        assert len(bold) == odd.comparisons["significant"].sum() > 0

    def test_notes_stand_with_ranks(self, odd):
        assert "no Friedman test" in tables_latex(odd)["ranks.tex"]


@pytest.fixture(scope="module")
def headings(tmp_path_factory):
    """Labels that are headings of the report, too, or begin as an option of LaTeX."""
    records = random_records(HEADINGS, HEADINGS[1:], (1, 2), n_records=2)
    folder = tmp_path_factory.mktemp("headings")
    return study(folder, HEADINGS, records, labels=HEADINGS[1:])


def test_labels_may_be_headings(headings):
    header, *rows = rows_of(tables_latex(headings)["outcome.tex"])
    assert header[:-1] == ["", *HEADINGS[1:-1]]
    assert [row[0] for row in rows] == [*HEADINGS[:-1], header[-1], "average rank"]
    assert matrix(headings).html(1).count("average rank") == 3  # a mission, an algorithm, and ours


PDFLATEX = shutil.which("pdflatex")
MOST_OVER = 2.0  # pt
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
@pytest.mark.parametrize("labels", ["odd", "headings"])
def test_tables_are_no_wider_than_a_two_column_page(labels, tmp_path, request):
    for name, text in tables_latex(request.getfixturevalue(labels)).items():
        (tmp_path / name).write_text(text, "utf-8")
    for name, known in (("small", "smoke"), ("baselines", "baselines")):
        (tmp_path / f"{name}.tex").write_text(
            tables_latex(committed(known))["outcome.tex"], "utf-8"
        )
    (tmp_path / "document.tex").write_text(DOCUMENT)
    command = [PDFLATEX, "-draftmode", "-interaction=nonstopmode", "-halt-on-error", "document"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=120, check=False)
    said = done.stdout.decode("utf-8", "replace")
    assert done.returncode == 0, said[-2_000:]
    over = [float(size) for size in re.findall(r"Overfull \\[hv]box \(([\d.]+)pt", said)]
    assert max(over, default=0) <= MOST_OVER
