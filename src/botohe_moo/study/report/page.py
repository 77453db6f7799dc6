"""The report of a study: a page that embeds its figures and styles, and tables in LaTeX."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

from botohe_moo.base.files import replace_file
from botohe_moo.base.messages import counted
from botohe_moo.indicators import INDICATORS
from botohe_moo.study.report import latex, text_tables, words
from botohe_moo.study.report.pictures import ReportFigure, draw_figures
from botohe_moo.study.store.tables import StudyTables


def write_report(tables: StudyTables) -> list[Path]:
    """Write the report into the folder ``report`` of a study's folder; return its files.

    They are ``report.html``, ``outcome.tex``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex``,
    and the figures in the folder ``figures``. Files of other names stay.
    """
    folder = tables.folder / "report"
    drawings = folder / "figures"
    drawings.mkdir(parents=True, exist_ok=True)
    figures_of = draw_figures(tables, drawings)
    texts = {
        "report.html": render_page(tables, figures_of),
        "outcome.tex": latex.outcome_latex(tables),
        "summary.tex": latex.summary_latex(tables),
        "comparisons.tex": latex.comparisons_latex(tables),
        "ranks.tex": latex.ranks_latex(tables),
    }
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    drawn = [path for figures in figures_of.values() for figure in figures for path in figure.paths]
    return [*(folder / name for name in texts), *drawn]


def render_page(tables: StudyTables, figures: Mapping[str, Sequence[ReportFigure]]) -> str:
    """Return the report as one HTML page.

    ``figures`` are those of each mission, and under ``""`` those of the study as a whole.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("botohe_moo.study.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    page = environment.get_template("report.html.j2").render(
        study=tables,
        matrix=text_tables.matrix(tables),
        caption=words.matrix_caption(tables),
        sections=[_section(tables, label, figures) for label in tables.mission_labels],
        ranks=_ranks(tables),
        figures=figures.get("", ()),
        faults=tables.runs[tables.runs["status"] != "done"],
        indicators=[INDICATORS[name].label for name in tables.manifest["indicators"]],
        counted=counted,
        tables=text_tables,
        words=words,
    )
    return f"{page.strip()}\n"


def _section(
    tables: StudyTables, mission: str, figures: Mapping[str, Sequence[ReportFigure]]
) -> dict[str, Any]:
    comparisons = tables.comparisons[tables.comparisons["mission"] == mission]
    [row] = tables.missions[tables.missions["mission"] == mission].to_dict("records")
    return {
        "bound": words.bound_words(row),
        "label": mission,
        "anchor": f"mission-{words.slug(mission)}",
        "title": tables.mission(mission).title,
        "summary": text_tables.summary_table(tables, mission),
        "figures": figures.get(mission, ()),
        "targets": text_tables.target_table(tables.targets[tables.targets["mission"] == mission]),
        "comparisons": text_tables.comparison_table(comparisons),
    }


def _ranks(tables: StudyTables) -> list[dict[str, Any]]:
    blocks = []
    for indicator, rows in tables.ranks.groupby("indicator", sort=False):
        pairs = tables.posthoc[tables.posthoc["indicator"] == indicator]
        blocks.append(
            {
                "indicator": INDICATORS[str(indicator)].label,
                "table": text_tables.rank_table(rows),
                "note": str(rows["note"].iloc[0]),
                "pairs": text_tables.posthoc_table(pairs),
                "critical": words.fixed(pairs["critical_difference"].max(), 2),
            }
        )
    return blocks
