"""The page of a report: one HTML file with figures and styles in it."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from botohe_moo._base.words import counted
from botohe_moo.indicators import INDICATORS
from botohe_moo.study.report.standing import matrix, matrix_caption
from botohe_moo.study.report.text_tables import (
    algorithm_table,
    comparison_table,
    environment_table,
    fault_table,
    missing_table,
    mission_table,
    posthoc_table,
    rank_table,
    summary_table,
    target_table,
)
from botohe_moo.study.report.words import bound_words, count, fixed, level, seed_words, slug
from botohe_moo.study.store.tables import StudyTables

_MANY_FAULTS = 100


@dataclass(frozen=True)
class ReportFigure:
    """A figure of a report."""

    path: Path  # the PNG file
    paths: tuple[Path, ...]  # the same as PNG, PDF and SVG
    caption: str  # what it shows, what its lines and bands mean, and what is not in it
    alternative: str  # text for readers who cannot see it


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
    faults = tables.runs[tables.runs["status"] != "done"]
    page = environment.get_template("report.html.j2").render(
        study=tables,
        description=str(tables.manifest.get("description") or ""),
        size=_size(tables),
        matrix=matrix(tables),
        caption=matrix_caption(tables),
        missing=missing_table(tables),
        missions=mission_table(tables),
        algorithms=algorithm_table(tables),
        own=tables.manifest.get("problem"),
        settings=_settings(tables),
        sections=[_section(tables, label, figures) for label in tables.mission_labels],
        ranks=_ranks(tables),
        figures=_figures(figures.get("", ())),
        faults=fault_table(faults.head(_MANY_FAULTS)),
        n_faults=len(faults),
        level=level(tables),
        environments=environment_table(tables),
    )
    return f"{page.strip()}\n"


def _size(tables: StudyTables) -> str:
    n_done, n_runs = int((tables.runs["status"] == "done").sum()), len(tables.runs)
    parts = [
        counted(len(tables.mission_labels), "mission"),
        counted(len(tables.algorithm_labels), "algorithm"),
        counted(len(tables.manifest["seeds"]), "seed"),
    ]
    done = "all done" if n_done == n_runs else f"{count(n_done)} done"
    missing = f"; {count(tables.n_missing)} missing" if tables.n_missing else ""
    return f"{', '.join(parts)}; {counted(n_runs, 'run')}, {done}{missing}."


def _settings(tables: StudyTables) -> list[tuple[str, str]]:
    indicators = tables.manifest["indicators"]
    compared = f"others with {tables.control}" if tables.control is not None else "all pairs"
    bounds = tables.manifest.get("bounds")
    own = tables.manifest.get("problem")
    said = (
        "reward and survivors are its two objectives, not E[R] and E[S]; areas, IGD+ and epsilon "
        "are shares of its objective_bounds; pictures of fronts are left out"
    )
    problem = [("Problem", f"{own['problem']}: {said}")] if own else []
    bounded = [("Bounds", f"{bounds['seconds']:,g} seconds each")] if bounds else []
    return [
        *problem,
        ("Seeds", seed_words(tables.manifest["seeds"])),
        ("Indicators", ", ".join(INDICATORS[name].label for name in indicators)),
        ("Compared", f"{compared}, at a significance level of {tables.significance:g}"),
        *bounded,
    ]


def _section(
    tables: StudyTables, mission: str, figures: Mapping[str, Sequence[ReportFigure]]
) -> dict[str, Any]:
    comparisons = tables.comparisons[tables.comparisons["mission"] == mission]
    [row] = tables.missions[tables.missions["mission"] == mission].to_dict("records")
    return {
        "bound": bound_words(row),
        "label": mission,
        "anchor": f"mission-{slug(mission)}",
        "title": tables.mission(mission).title,
        "summary": summary_table(tables, mission),
        "figures": _figures(figures.get(mission, ())),
        "targets": target_table(tables.targets[tables.targets["mission"] == mission]),
        "comparisons": comparison_table(comparisons),
    }


def _figures(figures: Sequence[ReportFigure]) -> list[dict[str, str]]:
    return [
        {
            "data": base64.b64encode(figure.path.read_bytes()).decode(),
            "caption": figure.caption,
            "alternative": figure.alternative,
        }
        for figure in figures
    ]


def _ranks(tables: StudyTables) -> list[dict[str, Any]]:
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
