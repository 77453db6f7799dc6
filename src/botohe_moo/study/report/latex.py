"""The tables of a report in LaTeX, as wide as the text, and broken across pages."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from botohe_moo.study.report.latex_text import breakable, escape_latex, width
from botohe_moo.study.report.words import INDICATORS, comparison_cells, count, fixed, summary_cells
from botohe_moo.study.store.tables import StudyTables

_NEEDS = r"% Needs \usepackage{array,booktabs,longtable} and \usepackage[T1]{fontenc}."
# How many em the columns of numbers may take so that labels have room in 345 pt, article's text.
_SIZES = ((28.0, r"\footnotesize"), (34.0, r"\scriptsize"))
_COMMAND = re.compile(r"\\[a-z]+|[{}$\\]")


@dataclass(frozen=True)
class _Group:
    """Rows in LaTeX under a title: labels first, then numbers."""

    title: str
    rows: Sequence[Sequence[str]]
    note: str = ""


def summary_latex(tables: StudyTables) -> str:
    """Write the summary as LaTeX: a block of rows for each mission, best medians bold."""
    header = [
        "algorithm",
        "runs",
        r"\shortstack[r]{median\\area}",
        "interval",
        r"IGD\textsuperscript{+}",
        r"$\varepsilon$",
        "points",
        r"\shortstack[r]{evalu-\\ations}",
        r"\shortstack[r]{time\\(s)}",
        "rank",
    ]
    groups = []
    for mission in tables.mission_labels:
        rows = tables.summary[tables.summary["mission"] == mission]
        least = rows["rank"].min()
        cells = []
        for row, found in zip(rows.to_dict("records"), summary_cells(rows), strict=True):
            numbers = [count(row["n"]), *found]
            line = [breakable(row["algorithm"]), *map(escape_latex, numbers)]
            if row["rank"] == least:
                line[2] = rf"\textbf{{{line[2]}}}"
            cells.append(line)
        groups.append(_Group(breakable(mission), cells))
    return _table(header, groups, n_labels=1)


def comparisons_latex(tables: StudyTables) -> str:
    """Write the comparisons as LaTeX: a block for each mission and indicator."""
    header = ["algorithm", "other", "median", "of other", "$p$ (Holm)", "$A_{12}$", "interval"]
    groups = []
    for mission in tables.mission_labels:
        rows = tables.comparisons[tables.comparisons["mission"] == mission]
        for indicator, pairs in rows.groupby("indicator", sort=False):
            cells = []
            for row in pairs.to_dict("records"):
                labels = [breakable(row["algorithm"]), breakable(row["other"])]
                line = [*labels, *map(escape_latex, comparison_cells(row))]
                if row["significant"]:
                    line[4] = rf"\textbf{{{line[4]}}}"
                cells.append(line)
            name = INDICATORS.get(str(indicator), str(indicator))
            groups.append(_Group(breakable(f"{mission}: {name}"), cells))
    return _table(header, groups, n_labels=2)


def ranks_latex(tables: StudyTables) -> str:
    """Write the average ranks over missions as LaTeX: a block for each indicator, with its note."""
    groups = []
    for indicator, rows in tables.ranks.groupby("indicator", sort=False):
        cells = [
            [breakable(row["algorithm"]), fixed(row["average_rank"], 2), count(row["n_missions"])]
            for row in rows.to_dict("records")
        ]
        name = INDICATORS.get(str(indicator), str(indicator))
        groups.append(_Group(breakable(name), cells, escape_latex(str(rows["note"].iloc[0]))))
    return _table(["algorithm", "average rank", "missions"], groups, n_labels=1)


def _table(header: Sequence[str], groups: Sequence[_Group], *, n_labels: int) -> str:
    """Write a table; columns of labels share the width that the numbers leave."""
    n_columns = len(header)
    lines = [header, *(row for group in groups for row in group.rows)]
    numbers = sum(max(_width(line[i]) for line in lines) for i in range(n_labels, n_columns))
    size = next((size for limit, size in _SIZES if numbers <= limit), r"\tiny")
    left = rf"\linewidth-{numbers:.1f}em-{2 * n_columns - 2}\tabcolsep"
    label = rf">{{\raggedright\arraybackslash\hspace{{0pt}}}}p{{\dimexpr({left})/{n_labels}\relax}}"
    columns = label * n_labels + "r" * (n_columns - n_labels)
    text = [
        _NEEDS,
        rf"\begingroup{size}\setlength{{\tabcolsep}}{{2.5pt}}\setlength{{\LTleft}}{{0pt}}%",
        rf"\begin{{longtable}}{{@{{}}{columns}@{{}}}}",
        r"\toprule",
        " & ".join(header) + r" \\",
        r"\midrule",
        r"\endhead",
        r"\bottomrule",
        r"\endfoot",
    ]
    for i, group in enumerate(groups):
        text += [r"\midrule"] * (i > 0)
        text.append(_across(n_columns, rf"\emph{{{group.title}}}") + "*")
        text += [" & ".join(row) + r" \\" for row in group.rows]
        text += [_across(n_columns, group.note)] * bool(group.note)
    return "\n".join([*text, r"\end{longtable}", r"\endgroup", ""])


def _across(n_columns: int, text: str) -> str:
    """Write a row of a single cell."""
    cell = r"@{}>{\raggedright\arraybackslash}p{0.9\linewidth}@{}"
    return rf"\multicolumn{{{n_columns}}}{{{cell}}}{{{text}}} \\"


def _width(cell: str) -> float:
    """Estimate the width of a cell in em: that of its widest line."""
    bold = 1.15 if "textbf" in cell else 1.0
    lines = re.sub(r"\\shortstack\[r\]", "", cell).split(r"\\")
    return bold * max(width(_COMMAND.sub("", line)) for line in lines)
