"""The report of a study: a page that embeds its figures and styles, and tables in LaTeX."""

import html
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd
from scipy import stats

from botohe_moo.base.files import replace_file
from botohe_moo.base.messages import counted
from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.study import words
from botohe_moo.study.pictures import ReportFigure, draw_figures
from botohe_moo.study.statistics import best_first, effect_size
from botohe_moo.study.tables import SCHEMAS, StudyTables
from botohe_moo.study.words import (
    budget_words,
    count,
    distinct,
    fixed,
    interval,
    main_indicator,
    p_value,
    parameter_words,
    percent,
    significant,
)

MARKS = BETTER, EQUAL, WORSE = ("+", "=", "−")  # of a median beside another
_MOST_FAULTS = 100  # on the page
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


def escape_html(text: str) -> str:
    """Return a text that a page shows as it is."""
    return html.escape(text, quote=False)


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
        styler = self._styler(escape_html, "<strong>{}</strong>").format_index(escape_html, axis=1)
        text: str = styler.to_html(exclude_styles=True)
        return text

    def latex(self, between: str = "") -> str:
        """Return it as a ``tabular`` with booktabs, which every class can set."""
        names = {known.label: known.latex for known in INDICATORS.values() if known.latex}
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


def summary_table(tables: StudyTables, mission: str) -> ReportTable:
    """Return the summary of a mission, a row for each algorithm; the best median is bold."""
    rows = tables.summary[tables.summary["mission"] == mission]
    n_seeds = len(tables.manifest["seeds"])
    cells: dict[str, Any] = {
        "algorithm": rows["algorithm"],
        "runs": [_runs(row, n_seeds) for row in rows.to_dict("records")],
        "median area": distinct(rows["area_median"]),
        "interval": list(map(interval, rows["area_low"], rows["area_high"])),
        "mean ± sd": [
            fixed(mean) if pd.isna(sd) else f"{fixed(mean)} ± {fixed(sd)}"
            for mean, sd in zip(rows["area_mean"], rows["area_sd"], strict=True)
        ],
        "best": rows["area_best"].map(fixed),
        "of reference": rows["area_share"].map(percent),
        "gap at most": rows["area_gap"].map(percent),
    }
    if tables.manifest.get("reference") != "best-known":
        del cells["of reference"]
    if rows["area_gap"].isna().all():
        del cells["gap at most"]
    for name in further_indicators():
        cells[INDICATORS[name].label] = rows[f"{name}_median"].map(significant)
    cells |= {
        "points": rows["front_size_median"].map(count),
        "evaluations": rows["evaluations_median"].map(count),
        "seconds": rows["seconds_median"].map(significant),
        "rank": rows["rank"].map(count),
    }
    best = rows["rank"] == rows["rank"].min()
    page_only = ["mean ± sd", "best", "rank"]
    return ReportTable(
        pd.DataFrame(cells), bold={"median area": best.tolist()}, page_only=page_only
    )


def _runs(row: Mapping[Any, Any], n_seeds: int) -> str:
    of_all = "" if row["n"] == n_seeds else f" of {count(n_seeds)}"
    lost = f" ({count(row['n_not_done'])} not done)" if row["n_not_done"] else ""
    return f"{count(row['n'])}{of_all}{lost}"


def comparison_table(rows: pd.DataFrame) -> ReportTable:
    """Return comparisons, a row for each pair; significant p-values are bold."""
    medians = [
        distinct(pair, significant)
        for pair in zip(rows["median"], rows["median_other"], strict=True)
    ]
    effects = zip(rows["a12"], rows["a12_low"], rows["a12_high"], strict=True)
    cells = {
        "indicator": [INDICATORS[name].label for name in rows["indicator"]],
        "algorithm": rows["algorithm"],
        "other": rows["other"],
        "verdict": [_verdict(row) for row in rows.to_dict("records")],
        "median": [median for median, _ in medians],
        "of other": [other for _, other in medians],
        "A12": [f"{fixed(a12, 2)} ({interval(low, high, 2)})" for a12, low, high in effects],
        "p (Holm)": rows["p_holm"].map(p_value),
    }
    bold, page_only = {"p (Holm)": rows["significant"].tolist()}, ["indicator", "verdict"]
    return ReportTable(pd.DataFrame(cells), texts=4, bold=bold, page_only=page_only)


def _verdict(row: Mapping[Any, Any]) -> str:
    """Return the verdict of a comparison without the numbers, which have cells of their own."""
    if row["significant"]:
        return f"{'better' if row['a12'] > 0.5 else 'worse'}, {effect_size(row['a12'])}"
    return str(row["verdict"]).partition(":")[0]


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
        mission = tables.mission(label)
        source = dict(entry["source"])
        name, parameters = source.pop("name_or_path"), parameter_words(source)
        limit = entry.get("max_length")
        rows.append(
            {
                "mission": label,
                "title": mission.title,
                "from": f"{name} ({parameters})" if parameters else str(name),
                "budget of a run": budget_words(entry["budget"]),
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
        cells = cells.drop(columns="travel budget")
    return ReportTable(cells, texts=4)


def algorithm_table(tables: StudyTables) -> ReportTable:
    """Return the algorithms of a study, with the parameters that differ among them."""
    parameters = tables.algorithms.drop(columns=[*SCHEMAS["algorithms"]]).astype(object)
    cells = tables.algorithms[["algorithm", "name"]].set_axis(["label", "algorithm"], axis=1)
    shown = [
        parameter_words({str(name): value for name, value in row.dropna().items()}) or "defaults"
        for _, row in parameters.iterrows()
    ]
    return ReportTable(cells.assign(parameters=shown), texts=3)


def fault_table(runs: pd.DataFrame) -> ReportTable:
    """Return the runs that are not done, with the reasons."""
    shown = runs[["mission", "algorithm", "status", "stopped_by", "error", "seed"]]
    cells = shown.fillna({"error": "–"}).assign(area=runs["area"].map(fixed))
    return ReportTable(cells.rename(columns={"stopped_by": "stopped by"}).astype(str), texts=5)


def environment_table(tables: StudyTables) -> ReportTable:
    """Return the environments in which runs ran, a row for each."""
    rows = tables.environments
    commit = (" (" + rows["commit"].astype(str) + ")").where(rows["commit"].notna(), "")
    n_runs = rows["environment"].map(tables.runs["environment"].value_counts()).fillna(0)
    cells = {
        "version": "botohe_moo " + rows["botohe_moo"] + commit,
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
    cells = pd.DataFrame("–", algorithms, missions, dtype=object)
    marks, best = cells.copy(), pd.DataFrame(False, algorithms, missions)
    for mission in missions:
        for label, (text, mark, is_best) in _on_mission(tables, mission).items():
            cells.loc[label, mission], marks.loc[label, mission] = text, mark
            best.loc[label, mission] = is_best
    if len(missions) > 1 and tables.control is not None:
        counts = ["/".join(str(row.count(m)) for m in MARKS) for row in marks.to_numpy().tolist()]
        cells["/".join(MARKS)] = counts
        cells.loc[tables.control, "/".join(MARKS)] = "–"
    ranks = tables.ranks[tables.ranks["indicator"] == main_indicator(tables.comparisons)]
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


def _on_mission(tables: StudyTables, mission: str) -> dict[str, tuple[str, str, bool]]:
    """Return text, mark, and whether it is the best, of each algorithm's median on a mission."""
    indicator = main_indicator(tables.comparisons)
    rows = tables.summary[tables.summary["mission"] == mission]
    medians = rows.set_index("algorithm")[f"{indicator}_median"].dropna()
    if medians.empty:
        return {}
    if INDICATORS[indicator].higher_is_better:
        texts = distinct(medians, fixed)
    else:
        texts = distinct(medians, significant, digits=3)
    ranks = stats.rankdata(best_first(indicator, medians.to_list()))
    best = ranks == ranks.min()
    marks = _marks(tables, mission, rival=tables.control or medians.index[best][0])
    cells = {}
    for label, text, rank, is_best in zip(medians.index, texts, ranks, best, strict=True):
        mark = marks.get(label, "")
        cells[label] = " ".join(filter(None, [text, mark, f"({count(rank)})"])), mark, bool(is_best)
    return cells


def _marks(tables: StudyTables, mission: str, *, rival: str) -> dict[str, str]:
    """Return the marks of the algorithms that were tested against a rival on a mission."""
    rows = tables.comparisons
    rows = rows[(rows["mission"] == mission) & (rows["indicator"] == main_indicator(rows))]
    marks = {}
    for row in rows.to_dict("records"):
        first, other = row["algorithm"], row["other"]
        if rival in (first, other) and min(row["n"], row["n_other"]) >= 2:
            label = other if first == rival else first
            is_better = (row["a12"] > 0.5) == (label == first)  # A12 is that of the first
            mark = BETTER if is_better else WORSE
            marks[label] = mark if row["significant"] else EQUAL
    return marks


def matrix_caption(tables: StudyTables) -> str:
    """Return the caption of the matrix: what it shows, and how to read it."""
    name = INDICATORS[main_indicator(tables.comparisons)].label
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
    comment = [
        "% All algorithms on all missions. Needs booktabs.",
        r"% \begin{table} % table* where it is wider than a column",
        *textwrap.wrap(
            rf"% \caption{{{escape_latex(matrix_caption(tables))}}}", 98, subsequent_indent="%   "
        ),
        r"% \centering\footnotesize",
        r"% \input{outcome}",
        r"% \end{table}",
    ]
    return "\n".join([*comment, matrix(tables).latex(r"@{\hspace{1em}}")])


def tables_latex(tables: StudyTables) -> dict[str, str]:
    """Return the files of the report in LaTeX, by their names."""
    compared: Any = tables.comparisons.groupby(["mission", "indicator"], sort=False)
    ranked: Any = tables.ranks.groupby("indicator", sort=False)
    return {
        "outcome.tex": outcome_latex(tables),
        "summary.tex": _below_each_other(
            (mission, summary_table(tables, mission)) for mission in tables.mission_labels
        ),
        "comparisons.tex": _below_each_other(
            (f"{mission}: {INDICATORS[indicator].label}", comparison_table(rows))
            for (mission, indicator), rows in compared
        ),
        "ranks.tex": _below_each_other(
            (f"{INDICATORS[indicator].label}: {rows['note'].iloc[0]}", rank_table(rows))
            for indicator, rows in ranked
        ),
    }


def _below_each_other(titled: Iterable[tuple[str, ReportTable]]) -> str:
    text = ["% Needs booktabs. Each tabular may stand in a table of its own, wide ones in table*."]
    for title, table in titled:
        text += [
            r"\begin{center}\footnotesize\setlength{\tabcolsep}{3pt}",
            rf"\emph{{{escape_latex(title)}}}\\*[0.5ex]",
            table.latex() + r"\end{center}",
        ]
    return "\n".join([*text, ""])


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
    faults = tables.runs[tables.runs["status"] != "done"]
    page = environment.get_template("report.html.j2").render(
        study=tables,
        matrix=matrix(tables),
        caption=matrix_caption(tables),
        missions=mission_table(tables),
        algorithms=algorithm_table(tables),
        sections=[_section(tables, label, figures) for label in tables.mission_labels],
        ranks=_rank_blocks(tables),
        figures=figures.get("", ()),
        faults=fault_table(faults.head(_MOST_FAULTS)),
        n_faults=len(faults),
        missing=missing_table(tables),
        environments=environment_table(tables),
        indicators=[INDICATORS[name].label for name in tables.manifest["indicators"]],
        objectives=tables.objectives(tables.mission_labels[0]).names,
        counted=counted,
        words=words,
    )
    return f"{page.strip()}\n"


def _section(
    tables: StudyTables, mission: str, figures: Mapping[str, Sequence[ReportFigure]]
) -> dict[str, Any]:
    def own(table: pd.DataFrame) -> pd.DataFrame:
        return table[table["mission"] == mission]

    [row] = own(tables.missions).to_dict("records")
    return {
        "bound": words.bound_words(row),
        "label": mission,
        "anchor": f"mission-{words.slug(mission)}",
        "title": tables.mission(mission).title,
        "summary": summary_table(tables, mission),
        "figures": figures.get(mission, ()),
        "targets": target_table(own(tables.targets)),
        "comparisons": comparison_table(own(tables.comparisons)),
    }


def _rank_blocks(tables: StudyTables) -> list[dict[str, Any]]:
    blocks = []
    for indicator, rows in tables.ranks.groupby("indicator", sort=False):
        pairs = tables.posthoc[tables.posthoc["indicator"] == indicator]
        blocks.append(
            {
                "indicator": INDICATORS[str(indicator)].label,
                "table": rank_table(rows),
                "note": str(rows["note"].iloc[0]),
                "pairs": posthoc_table(pairs),
                "critical": fixed(pairs["critical_difference"].max(), 2),
            }
        )
    return blocks
