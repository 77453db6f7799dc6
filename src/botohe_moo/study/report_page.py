"""The page of a report: one file that reads without the network."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import jinja2
import pandas as pd

from botohe_moo.study.report_words import (
    INDICATORS,
    best_label,
    budget_words,
    count,
    fixed,
    leader,
    level,
    main_indicator,
    p_value,
    parameter_words,
    seed_words,
    significant,
    verdict_words,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from botohe_moo.study.report_figures import ReportFigure
    from botohe_moo.study.tables import StudyTables

__all__ = ["Grid", "render_page"]

_MANY_ROWS = 30
_MANY_FAULTS = 100


@dataclass(frozen=True)
class Grid:
    """A table of the page, its cells already in words.

    Attributes
    ----------
    header
        Names of the columns.
    rows
        Cells of each row.
    texts
        Number of leading columns with text; the others hold numbers.
    strong
        Rows to set off, counted from 0.
    folded
        Whether the table is so long that the page shows it on demand.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    texts: int = 1
    strong: frozenset[int] = frozenset()
    folded: bool = False


def render_page(
    tables: StudyTables, slugs: Mapping[str, str], figures: Mapping[str, Sequence[ReportFigure]]
) -> str:
    """Write the report as one HTML page, figures and styles in it.

    Parameters
    ----------
    tables
        The study.
    slugs
        What stands for each mission in addresses within the page.
    figures
        Figures of each mission; their files are read.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("botohe_moo.study", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    manifest = tables.manifest
    page = environment.get_template("report.html.j2").render(
        title=tables.title,
        name=tables.name,
        description=str(manifest.get("description") or ""),
        size=_size(tables),
        outcome=[_outcome(tables, label) for label in tables.mission_labels],
        notes=_notes(tables),
        missions=_missions(tables),
        algorithms=_algorithms(tables),
        settings=_settings(tables),
        sections=[_section(tables, label, slugs, figures) for label in tables.mission_labels],
        ranks=_ranks(tables),
        faults=_faults(tables),
        n_faults=int((tables.runs["status"] != "done").sum()),
        max_faults=_MANY_FAULTS,
        level=level(tables),
        environments=_environments(tables),
    )
    return f"{page.strip()}\n"


def _size(tables: StudyTables) -> str:
    def number(n: int, thing: str) -> str:
        return f"{count(n)} {thing}{'' if n == 1 else 's'}"

    n_done = int((tables.runs["status"] == "done").sum())
    n_runs = len(tables.runs)
    parts = (
        (len(tables.mission_labels), "mission"),
        (len(tables.algorithm_labels), "algorithm"),
        (len(tables.manifest["seeds"]), "seed"),
    )
    listed = ", ".join(number(n, thing) for n, thing in parts)
    done = "all done" if n_done == n_runs else f"{count(n_done)} done"
    return f"{listed}; {number(n_runs, 'run')}, {done}."


def _outcome(tables: StudyTables, mission: str) -> dict[str, Any]:
    """Give what the page says first of a mission: who leads, and the verdicts about it."""
    rows = tables.comparisons[tables.comparisons["mission"] == mission]
    rows = rows[rows["indicator"] == main_indicator(rows)]
    if tables.control is None and len(rows) > 1:
        # All pairs would be too many: those with the leader answer who is better than whom.
        best = set(best_label(tables.summary[tables.summary["mission"] == mission]))
        rows = rows[rows["algorithm"].isin(best) | rows["other"].isin(best)]
    verdicts = [verdict_words(row) for row in rows.to_dict("records")]  # type: ignore[arg-type]
    return {"mission": mission, "leader": leader(tables, mission), "verdicts": verdicts}


def _notes(tables: StudyTables) -> list[str]:
    main = main_indicator(tables.ranks)
    return list(tables.ranks.loc[tables.ranks["indicator"] == main, "note"].unique())


def _missions(tables: StudyTables) -> Grid:
    rows = []
    for label, entry in tables.manifest["missions"].items():
        mission = tables.mission(label)
        rows.append(
            [
                label,
                mission.title,
                _origin(entry["source"]),
                budget_words(entry["budget"]),
                significant(entry["min_survival"]),
                count(mission.graph.number_of_nodes()),
                count(mission.graph.number_of_edges()),
                count(mission.robots),
                significant(mission.total_reward, 4),
            ]
        )
    header = ["mission", "title", "from", "budget of a run", "survival floor"]
    return Grid([*header, "nodes", "arcs", "robots", "total reward"], rows, texts=4)


def _origin(source: Mapping[str, Any]) -> str:
    """Say what a mission was made from."""
    parameters = {key: value for key, value in source.items() if key != "name_or_path"}
    named = f" ({parameter_words(parameters)})" if parameters else ""
    return f"{source['name_or_path']}{named}"


def _algorithms(tables: StudyTables) -> Grid:
    rows = [
        [
            label,
            str(entry.get("algorithm", label)),
            parameter_words(entry.get("parameters") or {}) or "defaults",
        ]
        for label, entry in tables.manifest["algorithms"].items()
    ]
    return Grid(["label", "algorithm", "parameters"], rows, texts=3)


def _settings(tables: StudyTables) -> list[tuple[str, str]]:
    indicators = tables.manifest["indicators"]
    compared = f"others with {tables.control}" if tables.control is not None else "all pairs"
    return [
        ("Seeds", seed_words(tables.manifest["seeds"])),
        ("Indicators", ", ".join(INDICATORS.get(name, name) for name in indicators)),
        ("Compared", f"{compared}, at a significance level of {tables.significance:g}"),
    ]


def _section(
    tables: StudyTables,
    mission: str,
    slugs: Mapping[str, str],
    figures: Mapping[str, Sequence[ReportFigure]],
) -> dict[str, Any]:
    return {
        "label": mission,
        "anchor": f"mission-{slugs[mission]}",
        "title": tables.mission(mission).title,
        "summary": _summary(tables.summary[tables.summary["mission"] == mission]),
        "figures": [
            {
                "data": base64.b64encode(figure.path.read_bytes()).decode(),
                "caption": figure.caption,
                "alternative": figure.alternative,
            }
            for figure in figures[mission]
        ],
        "comparisons": _comparisons(tables.comparisons[tables.comparisons["mission"] == mission]),
    }


def _summary(rows: pd.DataFrame) -> Grid:
    header = ["algorithm", "runs", "median area", "interval", "mean ± sd", "best"]
    header += ["IGD+", "epsilon", "plans", "evaluations", "seconds", "rank"]
    cells = []
    for row in rows.to_dict("records"):
        lost = f" ({count(row['n_not_done'])} not done)" if row["n_not_done"] else ""
        spread = "" if pd.isna(row["area_sd"]) else f" ± {fixed(row['area_sd'])}"
        cells.append(
            [
                row["algorithm"],
                f"{count(row['n'])}{lost}",
                fixed(row["area_median"]),
                f"{fixed(row['area_low'])}–{fixed(row['area_high'])}",
                f"{fixed(row['area_mean'])}{spread}",
                fixed(row["area_best"]),
                significant(row["igd_plus_median"]),
                significant(row["epsilon_median"]),
                count(row["front_size_median"]),
                count(row["evaluations_median"]),
                significant(row["seconds_median"]),
                count(row["rank"]),
            ]
        )
    best = best_label(rows)
    strong = frozenset(i for i, row in enumerate(cells) if row[0] in best)
    return Grid(header, cells, strong=strong)


def _comparisons(rows: pd.DataFrame) -> Grid:
    header = ["indicator", "algorithm", "other", "verdict", "median", "of other", "p (Holm)", "A12"]
    cells = [
        [
            INDICATORS.get(row["indicator"], row["indicator"]),
            row["algorithm"],
            row["other"],
            row["verdict"],
            significant(row["median"], 4),
            significant(row["median_other"], 4),
            p_value(row["p_holm"]),
            f"{fixed(row['a12'], 2)} ({fixed(row['a12_low'], 2)}–{fixed(row['a12_high'], 2)})",
        ]
        for row in rows.to_dict("records")
    ]
    strong = frozenset(i for i, found in enumerate(rows["significant"]) if found)
    return Grid(header, cells, texts=4, strong=strong, folded=len(cells) > _MANY_ROWS)


def _ranks(tables: StudyTables) -> list[dict[str, Any]]:
    blocks = []
    for indicator, rows in tables.ranks.groupby("indicator", sort=False):
        # The best first; those alike as in the file.
        ranked = rows.sort_values("average_rank", kind="stable")
        cells = [
            [row["algorithm"], fixed(row["average_rank"], 2), count(row["n_missions"])]
            for row in ranked.to_dict("records")
        ]
        blocks.append(
            {
                "indicator": INDICATORS.get(str(indicator), str(indicator)),
                "grid": Grid(["algorithm", "average rank", "missions"], cells),
                "note": str(rows["note"].iloc[0]),
            }
        )
    return blocks


def _faults(tables: StudyTables) -> Grid:
    rows = tables.runs[tables.runs["status"] != "done"].head(_MANY_FAULTS)
    cells = [
        [
            row["mission"],
            row["algorithm"],
            row["status"],
            row["stopped_by"],
            "–" if pd.isna(row["error"]) else str(row["error"]),
            str(row["seed"]),
            fixed(row["area"]),
        ]
        for row in rows.to_dict("records")
    ]
    header = ["mission", "algorithm", "status", "stopped by", "error", "seed", "area"]
    return Grid(header, cells, texts=5)


def _environments(tables: StudyTables) -> Grid:
    n_runs = tables.runs["environment"].value_counts()
    rows = [
        [
            f"botohe_moo {row['botohe_moo']}"
            + ("" if pd.isna(row["commit"]) else f" ({row['commit']})"),
            f"Python {row['python']}, {row['packages']}",
            f"{row['system']}, {row['machine']}, {row['processor']}",
            str(row["threads"]),
            count(row["n_cpus"]),
            count(n_runs.get(row["environment"], 0)),
        ]
        for row in tables.environments.to_dict("records")
    ]
    header = ["version", "packages", "machine", "threads", "processors", "runs"]
    return Grid(header, rows, texts=4)
