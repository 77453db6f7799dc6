"""The tables of a report in LaTeX, with rules by booktabs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from botohe_moo.study.report_words import (
    INDICATORS,
    best_label,
    count,
    fixed,
    p_value,
    significant,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from botohe_moo.study.tables import StudyTables

__all__ = ["comparisons_latex", "escape_latex", "ranks_latex", "summary_latex"]

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "[": "{[}",  # which after the end of a row would begin an option
    "]": "{]}",
    "–": "--",
    "\n": " ",
}

Group = tuple[str, "Iterable[Sequence[str]]"]


def escape_latex(text: str) -> str:
    """Write a text so that LaTeX prints it as it is."""
    return "".join(_SPECIAL.get(character, character) for character in text)


def summary_latex(tables: StudyTables) -> str:
    """Write the summary as LaTeX: a block of rows for each mission, best medians bold."""
    header = [
        "algorithm",
        "runs",
        "median area",
        "interval",
        r"IGD\textsuperscript{+}",
        "epsilon",
        "plans",
        "evaluations",
        "seconds",
        "rank",
    ]
    groups: list[Group] = []
    for mission in tables.mission_labels:
        rows = tables.summary[tables.summary["mission"] == mission]
        best = best_label(rows)
        cells = []
        for row in rows.to_dict("records"):
            median = fixed(row["area_median"])
            interval = f"{fixed(row['area_low'])}–{fixed(row['area_high'])}"
            cells.append(
                [
                    escape_latex(row["algorithm"]),
                    count(row["n"]),
                    rf"\textbf{{{median}}}" if row["algorithm"] in best else median,
                    escape_latex(interval),
                    escape_latex(significant(row["igd_plus_median"])),
                    escape_latex(significant(row["epsilon_median"])),
                    escape_latex(count(row["front_size_median"])),
                    escape_latex(count(row["evaluations_median"])),
                    escape_latex(significant(row["seconds_median"])),
                    count(row["rank"]),
                ]
            )
        groups.append((escape_latex(mission), cells))
    return _tabular("l" + "r" * (len(header) - 1), header, groups)


def comparisons_latex(tables: StudyTables) -> str:
    """Write the comparisons as LaTeX: a block for each mission and indicator."""
    header = ["algorithm", "other", "median", "of other", "$p$ (Holm)", "$A_{12}$", "interval"]
    groups: list[Group] = []
    for mission in tables.mission_labels:
        rows = tables.comparisons[tables.comparisons["mission"] == mission]
        for indicator, pairs in rows.groupby("indicator", sort=False):
            cells = []
            for row in pairs.to_dict("records"):
                p = escape_latex(p_value(row["p_holm"]))
                interval = f"{fixed(row['a12_low'], 2)}–{fixed(row['a12_high'], 2)}"
                cells.append(
                    [
                        escape_latex(row["algorithm"]),
                        escape_latex(row["other"]),
                        significant(row["median"], 4),
                        significant(row["median_other"], 4),
                        rf"\textbf{{{p}}}" if row["significant"] else p,
                        fixed(row["a12"], 2),
                        escape_latex(interval),
                    ]
                )
            name = INDICATORS.get(str(indicator), str(indicator))
            groups.append((escape_latex(f"{mission}: {name}"), cells))
    return _tabular("llrrrrr", header, groups)


def ranks_latex(tables: StudyTables) -> str:
    """Write the average ranks over missions as LaTeX: a block for each indicator, with its note."""
    groups: list[Group] = []
    for indicator, rows in tables.ranks.groupby("indicator", sort=False):
        cells = [
            [
                escape_latex(row["algorithm"]),
                fixed(row["average_rank"], 2),
                count(row["n_missions"]),
            ]
            for row in rows.to_dict("records")
        ]
        note = escape_latex(str(rows["note"].iloc[0]))
        cells.append([rf"\multicolumn{{3}}{{p{{0.6\linewidth}}}}{{\footnotesize {note}}}"])
        name = INDICATORS.get(str(indicator), str(indicator))
        groups.append((escape_latex(name), cells))
    return _tabular("lrr", ["algorithm", "average rank", "missions"], groups)


def _tabular(columns: str, header: Sequence[str], groups: Iterable[Group]) -> str:
    lines = [
        r"% Needs \usepackage{booktabs} and \usepackage[T1]{fontenc}.",
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        " & ".join(header) + r" \\",
    ]
    for title, rows in groups:
        lines += [r"\midrule", rf"\multicolumn{{{len(header)}}}{{l}}{{\emph{{{title}}}}} \\"]
        lines += [" & ".join(row) + r" \\" for row in rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])
