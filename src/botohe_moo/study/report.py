"""The report of a study: a page that embeds its figures and styles, and tables in LaTeX."""

import functools
import html
import operator
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from botohe_moo.base.files import replace_file
from botohe_moo.base.messages import counted
from botohe_moo.indicators import INDICATORS
from botohe_moo.study import words
from botohe_moo.study.pictures import ReportFigure, draw_figures
from botohe_moo.study.statistics import best_first, effect_size
from botohe_moo.study.tables import SCHEMAS, StudyTables
from botohe_moo.study.words import count, distinct, fixed, interval, p_value, percent, significant

MARKS = BETTER, EQUAL, WORSE = ("+", "=", "−")  # of a median beside another
_MOST_FAULTS = 100  # on the page
_LATEX_HEAD = (
    "% Needs booktabs. Each tabular may stand in a table of its own, wide ones in table*.\n"
)
_LATEX_PART = r"""\begin{center}\footnotesize\setlength{\tabcolsep}{3pt}
\emph{%s}\\*[0.5ex]
%s\end{center}
"""
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


@dataclass(frozen=True)
class ReportTable:
    """A table of texts, which pandas' Styler writes as HTML and as LaTeX.

    The names of its columns are their headings; the first one names the rows.
    """

    cells: pd.DataFrame
    texts: int = 1  # number of leading columns with words; the others hold numbers
    bold: Mapping[str, Sequence[bool]] = field(default_factory=dict)  # which cells of a column
    page_only: Sequence[str] = ()  # columns that LaTeX leaves out

    def html(self) -> str:
        """Return it as a table of a page."""
        escape = functools.partial(html.escape, quote=False)
        styler = self._styler(escape, "<strong>{}</strong>").format_index(escape, axis=1)
        text: str = styler.to_html(exclude_styles=True)
        return text

    def latex(self, between: str = "") -> str:
        """Return it as a ``tabular`` with booktabs, which every class can set."""
        names = {known.label: known.latex for known in INDICATORS.known() if known.latex}
        sides = {str(name): "lr"[i >= self.texts] for i, name in enumerate(self.cells)}
        headings = [names.get(name) or _heading(name, side) for name, side in sides.items()]
        # Braces are doubled, as pandas formats labels.
        labels = [heading.replace("{", "{{").replace("}", "}}") for heading in headings]
        styler = self._styler(escape_latex, r"\textbf{{{}}}").relabel_index(labels, axis=1)
        styler = styler.hide([*self.page_only], axis=1)
        shown = [side for name, side in sides.items() if name not in self.page_only]
        text: str = styler.to_latex(column_format=f"@{{}}{between.join(shown)}@{{}}", hrules=True)
        return text

    def _styler(self, escape: Callable[[Any], str], strong: str) -> Any:
        styler: Any = self.cells.style.format(escape).hide(axis="index")
        for column, bold in self.bold.items():
            rows = self.cells.index[[*bold]]
            styler.format(lambda text: strong.format(escape(text)), subset=(rows, [column]))
        return styler


def _heading(label: str, position: str) -> str:
    """Return the heading of a column, with its words below each other."""
    escaped = escape_latex(label).replace(" ", r"\\")
    return escaped if " " not in label else rf"\shortstack[{position}]{{{escaped}}}"


def summary_table(tables: StudyTables) -> ReportTable:
    """Return the summary of one mission's tables, a row for each algorithm; the best is bold."""
    rows, n_seeds = tables.summary, len(tables.manifest["seeds"])
    of_all = [count(n) if n == n_seeds else f"{count(n)} of {count(n_seeds)}" for n in rows["n"]]
    lost = [f" ({count(n)} not done)" if n else "" for n in rows["n_not_done"]]
    names = words.further_of(tables)
    further = {INDICATORS[name].label: rows[f"{name}_median"] for name in names}
    cells = {
        "algorithm": rows["algorithm"],
        "runs": list(map(operator.add, of_all, lost)),
        "median area": distinct(rows["area_median"]),
        "interval": list(map(interval, rows["area_low"], rows["area_high"])),
        "mean ± sd": [
            f"{fixed(mean)} ± {fixed(sd)}".removesuffix(" ± –")
            for mean, sd in zip(rows["area_mean"], rows["area_sd"], strict=True)
        ],
        "best": rows["area_best"].map(fixed),
        "of reference": rows["area_share"].map(percent),
        "gap at most": rows["area_gap"].map(percent),
        **{label: medians.map(significant) for label, medians in further.items()},
        "points": rows["front_size_median"].map(count),
        "evaluations": rows["evaluations_median"].map(count),
        "seconds": rows["seconds_median"].map(significant),
        "rank": rows["rank"].map(count),
    }
    if tables.manifest.get("reference") != "best-known":
        del cells["of reference"]
    if rows["area_gap"].isna().all():
        del cells["gap at most"]
    bold = {"median area": (rows["rank"] == rows["rank"].min()).tolist()}
    page_only = ["mean ± sd", "best", "rank"]
    return ReportTable(pd.DataFrame(cells), bold=bold, page_only=page_only)


def comparison_table(rows: pd.DataFrame) -> ReportTable:
    """Return comparisons, a row for each pair; significant p-values are bold."""
    medians = [distinct(pair, significant) for pair in rows[["median", "median_other"]].to_numpy()]
    effects = rows[["a12", "a12_low", "a12_high"]].to_numpy()
    cells = {
        "indicator": [INDICATORS[name].label for name in rows["indicator"]],
        "algorithm": rows["algorithm"],
        "other": rows["other"],
        "verdict": list(map(_verdict, rows["significant"], rows["a12"], rows["verdict"])),
        "median": [median for median, _ in medians],
        "of other": [other for _, other in medians],
        "A12": [f"{fixed(a12, 2)} ({interval(low, high, 2)})" for a12, low, high in effects],
        "p (Holm)": rows["p_holm"].map(p_value),
    }
    bold, page_only = {"p (Holm)": rows["significant"].tolist()}, ["indicator", "verdict"]
    return ReportTable(pd.DataFrame(cells), texts=4, bold=bold, page_only=page_only)


def _verdict(is_significant: bool, a12: float, verdict: str) -> str:
    """Return the verdict of a comparison without the numbers, which have cells of their own."""
    if is_significant:
        return f"{'better' if a12 > 0.5 else 'worse'}, {effect_size(a12)}"
    return verdict.partition(":")[0]


def rank_table(rows: pd.DataFrame) -> ReportTable:
    """Return the average ranks by an indicator, the best first, ties as in the study file."""
    rows = rows.sort_values("average_rank", kind="stable")
    cells = {
        "algorithm": rows["algorithm"],
        "average rank": [fixed(rank, 2) for rank in rows["average_rank"]],
        "missions": rows["n_missions"].map(count),
    }
    return ReportTable(pd.DataFrame(cells))


def posthoc_table(rows: pd.DataFrame) -> ReportTable:
    """Return the pairs of average ranks by an indicator; significant p-values are bold."""
    cells = {
        "algorithm": rows["algorithm"],
        "other": rows["other"],
        "difference of average ranks": [fixed(difference, 2) for difference in rows["difference"]],
        "p (Nemenyi)": rows["p_value"].map(p_value),
    }
    bold = {"p (Nemenyi)": rows["significant"].tolist()}
    return ReportTable(pd.DataFrame(cells), texts=2, bold=bold)


def target_table(rows: pd.DataFrame) -> ReportTable:
    """Return what it took to reach shares of the reference area, a row for each algorithm."""
    cells: dict[str, dict[str, str]] = {}
    for row in rows.to_dict("records"):
        of_algorithm = cells.setdefault(row["algorithm"], {"algorithm": row["algorithm"]})
        share = f"{100 * row['share']:g} %"
        of_algorithm[f"{share}: runs"] = f"{count(row['n_reached'])} of {count(row['n'])}"
        of_algorithm[f"{share}: evaluations"] = count(row["evaluations_median"])
        of_algorithm[f"{share}: seconds"] = significant(row["seconds_median"])
    return ReportTable(pd.DataFrame(list(cells.values())).fillna("–"))


def mission_table(tables: StudyTables) -> ReportTable:
    """Return the missions of a study, a row for each."""
    rows = []
    for label, entry in tables.manifest["missions"].items():
        mission, limit, source = tables.mission(label), entry.get("max_length"), entry["source"]
        parameters = words.parameter_words({k: source[k] for k in source if k != "name_or_path"})
        rows.append(
            {
                "mission": label,
                "title": mission.title,
                "from": f"{source['name_or_path']} ({parameters})".removesuffix(" ()"),
                "budget of a run": words.budget_words(entry["budget"]),
                "survival floor": significant(entry["min_survival"]),
                "travel budget": "none" if limit is None else f"{limit:g}",
                "nodes": count(len(mission.nodes)),
                "arcs": count(mission.graph.number_of_edges()),
                "robots": count(mission.robots),
                "total reward": significant(mission.total_reward, 4),
            }
        )
    cells = pd.DataFrame(rows)
    if (cells["travel budget"] == "none").all():
        del cells["travel budget"]
    return ReportTable(cells, texts=4)


def algorithm_table(tables: StudyTables) -> ReportTable:
    """Return the algorithms of a study, with the parameters that differ among them."""
    parameters = tables.algorithms.drop(columns=[*SCHEMAS["algorithms"]]).astype(object)
    cells = tables.algorithms[["algorithm", "name"]].set_axis(["label", "algorithm"], axis=1)
    shown = [words.parameter_words(dict(row.dropna())) for _, row in parameters.iterrows()]
    return ReportTable(cells.assign(parameters=[text or "defaults" for text in shown]), texts=3)


def fault_table(runs: pd.DataFrame) -> ReportTable:
    """Return the runs that are not done, with the reasons."""
    shown = runs[["mission", "algorithm", "status", "stopped_by", "error", "seed"]]
    cells = shown.fillna({"error": "–"}).assign(area=runs["area"].map(fixed))
    return ReportTable(cells.rename(columns={"stopped_by": "stopped by"}).astype(str), texts=5)


def environment_table(tables: StudyTables) -> ReportTable:
    """Return the environments in which runs ran, a row for each."""
    rows = tables.environments
    n_runs = rows["environment"].map(tables.runs["environment"].value_counts()).fillna(0)
    cells = {
        "version": "botohe_moo " + rows["botohe_moo"] + (" (" + rows["commit"] + ")").fillna(""),
        "packages": "Python " + rows["python"] + ", " + rows["packages"],
        "machine": rows["system"] + ", " + rows["machine"] + ", " + rows["processor"],
        "threads": rows["threads"],
        "processors": rows["n_cpus"].map(count),
        "runs": n_runs.map(count),
    }
    return ReportTable(pd.DataFrame(cells), texts=4)


def missing_table(tables: StudyTables) -> ReportTable:
    """Return the runs of the study that are not in its tables, by mission and algorithm."""
    cells = tables.missing.rename(columns={"missing": "missing runs"})
    return ReportTable(cells.astype(str), texts=2)


def matrix(tables: StudyTables) -> ReportTable:
    """Return medians of all algorithms on all missions, with marks and ranks; best ones are bold.

    The rows are the more numerous of both.
    """
    missions, algorithms = tables.mission_labels, tables.algorithm_labels
    found = {label: _on_mission(tables, label).reindex(algorithms) for label in missions}
    cells = pd.DataFrame({label: of["text"].fillna("–") for label, of in found.items()})
    best = pd.DataFrame({label: of["best"].eq(True) for label, of in found.items()})
    if len(missions) > 1 and tables.control is not None:
        marks = pd.DataFrame({label: of["mark"] for label, of in found.items()})
        counts = pd.DataFrame({mark: (marks == mark).sum(axis=1).astype(str) for mark in MARKS})
        cells["/".join(MARKS)] = counts.agg("/".join, axis=1)
        cells.loc[tables.control, "/".join(MARKS)] = "–"
    ranks = tables.ranks[tables.ranks["indicator"] == words.main_indicator(tables.comparisons)]
    if len(missions) > 1 and len(ranks):
        averages = ranks.set_index("algorithm")["average_rank"].reindex(algorithms)
        cells["average rank"] = averages.map(lambda rank: fixed(rank, 2))
        best["average rank"] = averages == averages.min()
    best = best.reindex(columns=cells.columns, fill_value=False)
    name = "algorithm"
    if len(algorithms) < len(missions):
        name, cells, best = "mission", cells.T, best.T
    labelled = cells.rename_axis(name).reset_index()
    return ReportTable(labelled, bold={str(column): best[column].tolist() for column in best})


def _on_mission(tables: StudyTables, mission: str) -> pd.DataFrame:
    """Return ``text``, ``mark``, and whether it is the ``best``, of each algorithm's median."""
    indicator = words.main_indicator(tables.comparisons)
    rows = tables.summary[tables.summary["mission"] == mission]
    medians = rows.set_index("algorithm")[f"{indicator}_median"].dropna()
    more_is_better = INDICATORS[indicator].higher_is_better
    texts = distinct(medians) if more_is_better else distinct(medians, significant, digits=3)
    ranks = pd.Series(best_first(indicator, medians), medians.index).rank()
    best = ranks == ranks.min()
    tested = tables.comparisons
    tested = tested[(tested["mission"] == mission) & (tested["indicator"] == indicator)]
    rival = tables.control or next(iter(ranks.index[best]), None)
    marks = dict.fromkeys(medians.index, "")
    for row in tested[tested[["n", "n_other"]].min(axis=1) >= 2].to_dict("records"):
        first, other = row["algorithm"], row["other"]
        if rival in (first, other):
            label = other if first == rival else first
            is_better = (row["a12"] > 0.5) == (label == first)  # A12 is that of the first
            marks[label] = (BETTER if is_better else WORSE) if row["significant"] else EQUAL
    shown = [
        " ".join(filter(None, [text, marks[label], f"({count(rank)})"]))
        for text, (label, rank) in zip(texts, ranks.items(), strict=True)
    ]
    text, mark = pd.Series(shown, medians.index, dtype="str"), pd.Series(marks, dtype="str")
    return pd.DataFrame({"text": text, "mark": mark, "best": best})


def matrix_caption(tables: StudyTables) -> str:
    """Return the caption of the matrix: what it shows, and how to read it."""
    name = INDICATORS[words.main_indicator(tables.comparisons)].label
    rival = tables.control or "the best on the mission"
    n_lost = int((tables.runs["status"] != "done").sum())
    lost = f" Of all runs {n_lost} are not done; without a front their area is 0." if n_lost else ""
    return (
        f"Median {name} over runs, the best on a mission bold, its rank there in brackets. "
        f"{BETTER} is better than {rival}, {WORSE} worse, {EQUAL} not told apart from it "
        f"(Mann-Whitney, Holm, {tables.significance:g}); without a mark it is not tested. "
        f"Medians that look different are not ties.{lost}"
    )


def outcome_latex(tables: StudyTables) -> str:
    """Return the matrix of medians, marks and ranks that opens the report."""
    caption = rf"% \caption{{{escape_latex(matrix_caption(tables))}}}"
    comment = [
        "% All algorithms on all missions. Needs booktabs.",
        r"% \begin{table} % table* where it is wider than a column",
        *textwrap.wrap(caption, 98, subsequent_indent="%   "),
        r"% \centering\footnotesize",
        r"% \input{outcome}",
        r"% \end{table}",
    ]
    return "\n".join([*comment, matrix(tables).latex(r"@{\hspace{1em}}")])


def tables_latex(tables: StudyTables) -> dict[str, str]:
    """Return the files of the report in LaTeX, by their names."""
    compared: Any = tables.comparisons.groupby(["mission", "indicator"], sort=False)
    ranked: Any = tables.ranks.groupby("indicator", sort=False)
    titled = {
        "summary.tex": [
            (mission, summary_table(tables.of_mission(mission)))
            for mission in tables.mission_labels
        ],
        "comparisons.tex": [
            (f"{mission}: {INDICATORS[indicator].label}", comparison_table(rows))
            for (mission, indicator), rows in compared
        ],
        "ranks.tex": [
            (f"{INDICATORS[indicator].label}: {rows['note'].iloc[0]}", rank_table(rows))
            for indicator, rows in ranked
        ],
    }
    files = {"outcome.tex": outcome_latex(tables)}
    for file, parts in titled.items():
        files[file] = _LATEX_HEAD
        for title, table in parts:
            files[file] += _LATEX_PART % (escape_latex(title), table.latex())
    return files


def write_report(tables: StudyTables, *, workers: int = 1) -> list[Path]:
    """Write the report into the folder ``report`` of a study's folder; return its files.

    They are ``report.html``, ``outcome.tex``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex``,
    and the figures in the folder ``figures``, which ``workers`` processes draw. Files of other
    names stay.
    """
    folder = tables.folder / "report"
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    figures_of = draw_figures(tables, folder / "figures", workers=workers)
    texts = {"report.html": render_page(tables, figures_of), **tables_latex(tables)}
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    drawn = [path for figures in figures_of.values() for figure in figures for path in figure.paths]
    return [*(folder / name for name in texts), *drawn]


def render_page(tables: StudyTables, figures: Mapping[str, Sequence[ReportFigure]]) -> str:
    """Return the report as one HTML page.

    ``figures`` are those of each mission, and under ``""`` those of the study as a whole.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("botohe_moo.study", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    makers = comparison_table, posthoc_table, rank_table, summary_table, target_table
    faults = tables.runs[tables.runs["status"] != "done"]
    page = environment.get_template("report.html.j2").render(
        study=tables,
        figures=figures,
        matrix=matrix(tables),
        caption=matrix_caption(tables),
        missions=mission_table(tables),
        algorithms=algorithm_table(tables),
        environments=environment_table(tables),
        faults=fault_table(faults.head(_MOST_FAULTS)),
        n_faults=len(faults),
        missing=missing_table(tables),
        known=INDICATORS,
        **{make.__name__: make for make in makers},
        counted=counted,
        words=words,
    )
    return f"{page.strip()}\n"
