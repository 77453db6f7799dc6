"""Tables in LaTeX fit a page, whatever labels are; typeset where pdflatex is installed."""

import re
import shutil
import subprocess

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.study.report import folder as report_folder
from botohe_moo.study.report.folder import write_report
from botohe_moo.study.report.latex import breakable, escape_latex
from tests.study.test_report import lost, random_records, study

PDFLATEX = shutil.which("pdflatex")
MOST_OVER = 2.0  # pt
LABELS = [
    "BO-ACO",
    "NSGA-II (repair=safest-path, pop_size=1000, crossover_probability=0.95)",
    "蚁群算法 (n_ants=50, evaporation=0.04)",
    "Донаудампфшиффартсгезельшафт",
    "Donaudampfschifffahrtselektrizitätenhauptbetriebswerkbauunterbeamtengesellschaft",
    'SMS-EMOA → ε ≤ 0,5 · 😀 \\ {x}_1^2 #5 & 100 % ~ `a´ --- "[b]" <c|d> €',
]
MISSIONS = ["美术馆", "a very long label of a mission " * 5, "plain", "ع_ربي"]
DOCUMENT = r"""\documentclass{article}
\usepackage[T1]{fontenc}
\usepackage{array,booktabs,longtable}
\begin{document}
\input{summary}
\input{comparisons}
\input{ranks}
\end{document}
"""


class TestText:
    def test_what_fonts_do_not_hold_is_written_as_code_points(self):
        assert escape_latex("美术 a") == "{[}U+7F8E 672F{]} a"
        assert escape_latex("é\x00") == "é{[}U+0000{]}"
        assert escape_latex("e\u0301") == "é"

    def test_greek_and_signs_are_mathematics(self):
        assert escape_latex("εΩλ≤") == "".join(
            rf"\ensuremath{{\{name}}}" for name in ("epsilon", "Omega", "lambda", "leq")
        )

    @given(st.text(), st.text())
    def test_labels_that_differ_stay_different(self, one, other):
        plain = [re.sub(r"\s", " ", text) for text in (one, other)]
        if len(set(plain)) == 2 and not any("[U+" in text for text in plain):
            written = {escape_latex(text) for text in plain}
            normal = {pd.Series(plain).str.normalize("NFC")[i] for i in (0, 1)}
            assert len(written) == len(normal)

    @given(st.text())
    def test_all_of_it_is_of_the_encoding(self, text):
        for character in escape_latex(text):
            assert ord(character) < 0x180 or character in "‘’“”‚„"

    @given(st.text())
    def test_breaks_change_nothing_else(self, text):
        assert breakable(text).replace(r"\allowbreak{}", "").replace("{]}{[}U+", " ") == (
            escape_latex(text).replace("{]}{[}U+", " ")
        )

    @given(st.text("an_=.,-e ", max_size=9), st.floats(allow_nan=False, allow_infinity=False))
    def test_none_is_within_a_number(self, name, number):
        pieces = breakable(f"{name}={number}, {number}").split(r"\allowbreak{}")
        whole = escape_latex(str(number))
        assert sum(piece.count(whole) for piece in pieces) >= 2


@pytest.fixture(scope="module", autouse=True)
def _without_pictures():
    """What is tested here is text; pictures take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report_folder, "draw_figures", lambda *_: {})
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Long and foreign labels, as many rows as take several pages."""
    records = random_records(MISSIONS, LABELS, (1, 2), n_records=2)
    labels = [*LABELS, "lost"]
    records += lost("plain", "lost", (1, 2))
    tables = study(tmp_path_factory.mktemp("latex"), MISSIONS, records, labels=labels)
    write_report(tables)
    return tables.folder / "report"


def typeset(folder, document):
    """Give what pdflatex says the third time, when the widths of columns are settled."""
    (folder / "document.tex").write_text(document)
    command = [PDFLATEX, "-draftmode", "-interaction=nonstopmode", "-halt-on-error", "document"]
    for _ in range(3):
        done = subprocess.run(command, cwd=folder, capture_output=True, timeout=120, check=False)
    said = done.stdout.decode("utf-8", "replace")
    assert done.returncode == 0, said[-2_000:]
    return said


@pytest.mark.skipif(PDFLATEX is None, reason="pdflatex is not installed")
class TestTypeset:
    def test_tables_are_no_wider_and_no_longer_than_the_page(self, made):
        said = typeset(made, DOCUMENT)
        assert "Missing character" not in said
        over = [float(size) for size in re.findall(r"Overfull \\[hv]box \(([\d.]+)pt", said)]
        assert max(over, default=0) <= MOST_OVER

    def test_a_study_without_runs(self, tmp_path):
        tables = study(tmp_path, ["toy"], [], labels=["A"])
        write_report(tables)
        typeset(tmp_path / "report", DOCUMENT)
