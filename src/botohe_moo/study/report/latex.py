"""The tables of a report in LaTeX: ``tabular`` with booktabs, which every class can set."""

import textwrap
from collections.abc import Iterable
from typing import Any

import pandas as pd

from botohe_moo.indicators import INDICATORS
from botohe_moo.study.report.text_tables import (
    Cell,
    TextTable,
    comparison_table,
    matrix,
    rank_table,
    summary_table,
)
from botohe_moo.study.report.words import matrix_caption
from botohe_moo.study.store.tables import StudyTables

_NAMED = ["backslash", "asciitilde", "asciicircum", "less", "greater", "bar"]
_SIGNS = {"−": "-", "±": r"\pm", "×": r"\times", "≤": r"\leq", "≥": r"\geq"}
_GREEK = {"α": "alpha", "β": "beta", "ε": "epsilon", "λ": "lambda", "μ": "mu", "ρ": "rho"}
_ESCAPED = str.maketrans(
    {
        **{character: f"\\{character}" for character in "{}$&#%_"},
        **{a: rf"\text{name}{{}}" for a, name in zip("\\~^<>|", _NAMED, strict=True)},
        **{a: f"${sign}$" for a, sign in _SIGNS.items()},
        **{a: f"$\\{name}$" for a, name in _GREEK.items()},
        "–": "--",
        "[": "{[}",  # after the end of a row it would begin an option
    }
)


def escape_latex(text: str) -> str:
    r"""Return a text in LaTeX; letters of other scripts are left to XeLaTeX and LuaLaTeX.

    >>> print(escape_latex("a_b & 5 %, ε ≤ 1"))
    a\_b \& 5 \%, $\epsilon$ $\leq$ 1
    """
    return text.translate(_ESCAPED)


def outcome_latex(tables: StudyTables) -> str:
    """Return the matrix of medians, marks and ranks that opens the report."""
    shown = matrix(tables)
    caption = escape_latex(matrix_caption(tables))
    comment = [
        "% All algorithms on all missions. Needs booktabs.",
        r"% \begin{table} % table* where it is wider than a column",
        *textwrap.wrap(rf"% \caption{{{caption}}}", 98, subsequent_indent="%   "),
        r"% \centering\footnotesize",
        r"% \input{outcome}",
        r"% \end{table}",
    ]
    cells = pd.DataFrame(
        [[escape_latex(label), *map(_cell, row)] for label, row in shown.rows],
        columns=[_heading(name, "l") for name in shown.header],
    )
    columns = "l" + r"@{\hspace{1em}}l" * (len(shown.header) - 1)
    return "\n".join([*comment, _tabular(cells, columns)])


def _heading(label: str, position: str) -> str:
    """Return the heading of a column, with its words below each other."""
    words = list(map(escape_latex, label.split(" ")))
    if len(words) == 1:
        return words[0]
    lines = r"\\".join(words)
    return rf"\begin{{tabular}}[b]{{@{{}}{position}@{{}}}}{lines}\end{{tabular}}"


def _cell(cell: Cell) -> str:
    text = rf"\textbf{{{cell.text}}}" if cell.best else escape_latex(cell.text)
    mark = rf"\makebox[1.3em]{{{escape_latex(cell.mark)}}}"
    return f"{text}{mark}({cell.rank})" if cell.rank else text


def _tabular(cells: pd.DataFrame, columns: str) -> str:
    text: str = cells.to_latex(index=False, escape=False, column_format=f"@{{}}{columns}@{{}}")
    return text


def summary_latex(tables: StudyTables) -> str:
    """Return the summary: a table for each mission, best medians bold."""
    return _tables(
        (mission, summary_table(tables, mission), ["mean ± sd", "best", "rank"])
        for mission in tables.mission_labels
    )


def comparisons_latex(tables: StudyTables) -> str:
    """Return the comparisons: a table for each mission and indicator, significant p bold."""
    groups: Any = tables.comparisons.groupby(["mission", "indicator"], sort=False)
    left_out = ["indicator", "verdict"]
    return _tables(
        (f"{mission}: {INDICATORS[indicator].label}", comparison_table(rows), left_out)
        for (mission, indicator), rows in groups
    )


def ranks_latex(tables: StudyTables) -> str:
    """Return the average ranks over missions: a table for each indicator, with its note."""
    groups: Any = tables.ranks.groupby("indicator", sort=False)
    return _tables(
        (f"{INDICATORS[indicator].label}: {rows['note'].iloc[0]}", rank_table(rows), [])
        for indicator, rows in groups
    )


def _tables(titled: Iterable[tuple[str, TextTable, list[str]]]) -> str:
    """Return tables below each other, each with its title and without the columns listed."""
    text = ["% Needs booktabs. Each tabular may stand in a table of its own, wide ones in table*."]
    names = {known.label: known.latex for known in INDICATORS.values() if known.latex}
    for title, table, left_out in titled:
        cells: Any = table.cells.map(escape_latex)
        if table.strong:
            cells.loc[table.strong, table.bold] = r"\textbf{" + cells[table.bold] + "}"
        sides = {name: "l" if i < table.texts else "r" for i, name in enumerate(cells)}
        shown = {name: side for name, side in sides.items() if name not in left_out}
        headings = [names.get(name) or _heading(name, side) for name, side in shown.items()]
        text += [
            r"\begin{center}\footnotesize\setlength{\tabcolsep}{3pt}",
            rf"\emph{{{escape_latex(title)}}}\\*[0.5ex]",
            _tabular(cells[list(shown)].set_axis(headings, axis=1), "".join(shown.values()))
            + r"\end{center}",
        ]
    return "\n".join([*text, ""])
