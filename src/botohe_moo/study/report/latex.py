"""The tables of a report in LaTeX, as wide as the text, and broken across pages."""

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.study.report.words import (
    comparison_cells,
    count,
    fixed,
    percent,
    summary_cells,
)
from botohe_moo.study.store.tables import StudyTables

_SPECIAL = {
    **{character: f"\\{character}" for character in "{}$&#%_"},
    **dict.fromkeys("\n\t\xa0", " "),
    # After the end of a row [ would begin an option; two - would become a dash.
    **{character: f"{{{character}}}" for character in "[]-"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "`": r"\textasciigrave{}",
    "'": r"\textquotesingle{}",
    "–": "--",
    "—": "---",
    "°": r"\textdegree{}",
    "²": r"\texttwosuperior{}",
    "³": r"\textthreesuperior{}",
}
_MATHEMATICS = {
    "−": "-",
    "×": r"\times",
    "·": r"\cdot",
    "±": r"\pm",
    "÷": r"\div",
    "≤": r"\leq",
    "≥": r"\geq",
    "≠": r"\neq",
    "≈": r"\approx",
    "∞": r"\infty",
    "→": r"\rightarrow",
    "←": r"\leftarrow",
    "∈": r"\in",
    "µ": r"\mu",
    "ς": r"\varsigma",
}
# Greek letters are named after their commands, but capitals that look Latin have none.
_GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)")
_CAPITALS = {"gamma", "delta", "theta", "lamda", "xi", "pi", "sigma", "upsilon", "phi", "psi"}
_CAPITALS |= {"omega"}
# The part of Latin-1 and Latin Extended-A that fonts in T1 encoding have.
_LATIN = {chr(code) for code in (0xA1, 0xA3, 0xAB, 0xBB, 0xBF, *range(0xC0, 0x17F))}
_LATIN -= {chr(code) for code in (0x126, 0x127, 0x138, 0x13F, 0x140, 0x149)}
_LATIN |= set("‘’“”‚„")

_BREAK = r"\allowbreak{}"
# After punctuation and in long words, never within a number.
_BREAKS = re.compile(
    r"(?<=[;:/_])(?=\S)|(?<=[-,.])(?=[^\W\d])|(?<==)(?=\S{9})"
    r"|(?<=[^\W\d_]{8})(?=[^\W\d_])|(?<=[^\W_]{7}[^\W\d_])(?=\d)"
)
_NARROW, _WIDE = frozenset(" .,:;'|!()[]/-ijlt"), frozenset("mwMW%@&")


def escape_latex(text: str) -> str:
    """Write a text so that pdflatex prints it unchanged.

    Characters that its fonts lack, such as Chinese ones, are written as code points,
    {[}U+7F8E 672F{]}, so that labels still differ.
    """
    written: list[str] = []
    foreign: list[str] = []
    for character in [*unicodedata.normalize("NFC", text), ""]:
        known = _escaped(character)
        if known is None:
            foreign.append(f"{ord(character):04X}")
            continue
        if foreign:
            written.append(f"{{[}}U+{' '.join(foreign)}{{]}}")
            foreign.clear()
        written.append(known)
    return "".join(written)


def _escaped(character: str) -> str | None:
    """Write a character; None if the fonts lack it."""
    if character in _SPECIAL:
        return _SPECIAL[character]
    if character in _LATIN or (character.isascii() and character.isprintable()) or not character:
        return character
    command = _MATHEMATICS.get(character) or _greek(character)
    return f"\\ensuremath{{{command}}}" if command else None


def _greek(character: str) -> str | None:
    match = _GREEK.fullmatch(unicodedata.name(character, ""))
    if match is None:
        return None
    name = match[2].lower()
    if (match[1] == "CAPITAL" and name not in _CAPITALS) or name == "omicron":
        return None
    name = {"lamda": "lambda"}.get(name, name)
    return "\\" + (name.capitalize() if match[1] == "CAPITAL" else name)


def breakable(text: str) -> str:
    """Write a text that may break after punctuation and within long words."""
    pieces = _BREAKS.split(unicodedata.normalize("NFC", text))
    return _BREAK.join(map(escape_latex, pieces))


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
    header = ["algorithm", "runs", r"\shortstack[r]{median\\area}", "interval"]
    further = [INDICATORS[name] for name in further_indicators()]
    header += [indicator.latex or escape_latex(indicator.label) for indicator in further]
    header += ["points", r"\shortstack[r]{evalu-\\ations}", r"\shortstack[r]{time\\(s)}", "rank"]
    bounded = bool(tables.summary["area_gap"].notna().any())
    if bounded:
        header.insert(4, r"\shortstack[r]{gap\\at most}")
    groups = []
    for mission in tables.mission_labels:
        rows = tables.summary[tables.summary["mission"] == mission]
        least = rows["rank"].min()
        cells = []
        for row, found in zip(rows.to_dict("records"), summary_cells(rows), strict=True):
            numbers = [count(row["n"]), *found]
            if bounded:
                numbers.insert(3, percent(row["area_gap"]))
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
            groups.append(
                _Group(breakable(f"{mission}: {INDICATORS[str(indicator)].label}"), cells)
            )
    return _table(header, groups, n_labels=2)


def ranks_latex(tables: StudyTables) -> str:
    """Write the average ranks over missions as LaTeX: a block for each indicator, with its note."""
    groups = []
    for indicator, rows in tables.ranks.groupby("indicator", sort=False):
        cells = [
            [breakable(row["algorithm"]), fixed(row["average_rank"], 2), count(row["n_missions"])]
            for row in rows.to_dict("records")
        ]
        name, note = INDICATORS[str(indicator)].label, str(rows["note"].iloc[0])
        groups.append(_Group(breakable(name), cells, escape_latex(note)))
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
    """Estimate the width of a cell in em, half of one a digit: that of its widest line."""
    bold = 1.15 if "textbf" in cell else 1.0
    lines = re.sub(r"\\shortstack\[r\]", "", cell).split(r"\\")
    return bold * max(
        sum(0.29 if c in _NARROW else 0.83 if c in _WIDE else 0.5 for c in _COMMAND.sub("", line))
        for line in lines
    )
