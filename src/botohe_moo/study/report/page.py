"""The page of a report: one HTML file with figures and styles in it."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from botohe_moo._base.words import counted
from botohe_moo.indicators import INDICATORS
from botohe_moo.study.report import text_tables, words
from botohe_moo.study.report.standing import matrix, matrix_caption
from botohe_moo.study.store.tables import StudyTables


@dataclass(frozen=True)
class ReportFigure:
    """A figure of a report."""

    path: Path  # the PNG file
    paths: tuple[Path, ...]  # the same as PNG, PDF and SVG
    caption: str  # what it shows, what its lines and bands mean, and what is not in it
    alternative: str  # text for readers who cannot see it

    @property
    def data(self) -> str:
        """The PNG file as text, as a page holds it."""
        return base64.b64encode(self.path.read_bytes()).decode()


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
        matrix=matrix(tables),
        caption=matrix_caption(tables),
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
