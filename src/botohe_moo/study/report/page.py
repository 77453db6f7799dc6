"""The page of a report: one HTML file with figures and styles in it."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from botohe_moo.indicators import INDICATORS
from botohe_moo.study.report.page_tables import (
    TextTable,
    comparison_table,
    missing_table,
    posthoc_table,
    posthoc_words,
    rank_table,
    summary_table,
    target_table,
)
from botohe_moo.study.report.standing import leader, matrix, standing
from botohe_moo.study.report.words import (
    bound_words,
    budget_words,
    count,
    fixed,
    level,
    listed,
    main_indicator,
    parameter_words,
    seed_words,
    significant,
    slug,
    verdict_words,
)
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
    """Write the report as one HTML page.

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
    manifest = tables.manifest
    page = environment.get_template("report.html.j2").render(
        title=tables.title,
        name=tables.name,
        description=str(manifest.get("description") or ""),
        size=_size(tables),
        matrix=matrix(tables),
        missing=missing_table(tables),
        n_missing=tables.n_missing,
        outcome=[_outcome(tables, label) for label in tables.mission_labels],
        notes=_notes(tables),
        missions=_missions(tables),
        algorithms=_algorithms(tables),
        own=manifest.get("problem"),
        settings=_settings(tables),
        sections=[_section(tables, label, figures) for label in tables.mission_labels],
        ranks=_ranks(tables),
        figures=_figures(figures.get("", ())),
        faults=_faults(tables),
        n_faults=int((tables.runs["status"] != "done").sum()),
        max_faults=_MANY_FAULTS,
        level=level(tables),
        unbounded=listed(tables.missing_bounds) if tables.missing_bounds else "",
        environments=_environments(tables),
    )
    return f"{page.strip()}\n"


def _size(tables: StudyTables) -> str:
    def number(n: int, thing: str) -> str:
        return f"{count(n)} {thing}{'' if n == 1 else 's'}"

    n_done = int((tables.runs["status"] == "done").sum())
    n_runs = len(tables.runs)
    n_missing = tables.n_missing
    parts = (
        (len(tables.mission_labels), "mission"),
        (len(tables.algorithm_labels), "algorithm"),
        (len(tables.manifest["seeds"]), "seed"),
    )
    listed = ", ".join(number(n, thing) for n, thing in parts)
    done = "all done" if n_done == n_runs else f"{count(n_done)} done"
    missing = f"; {count(n_missing)} missing" if n_missing else ""
    return f"{listed}; {number(n_runs, 'run')}, {done}{missing}."


def _outcome(tables: StudyTables, mission: str) -> dict[str, Any]:
    """Give the leading algorithm on a mission, and the verdicts about it."""
    rows = tables.comparisons[tables.comparisons["mission"] == mission]
    rows = rows[rows["indicator"] == main_indicator(tables.comparisons)]
    if tables.control is None and len(rows) > 1:
        # All pairs would be too many: only those with a leader.
        best = set(standing(tables, mission).best)
        rows = rows[rows["algorithm"].isin(best) | rows["other"].isin(best)]
    verdicts = [verdict_words(row) for row in rows.to_dict("records")]  # type: ignore[arg-type]
    return {"mission": mission, "leader": leader(tables, mission), "verdicts": verdicts}


def _notes(tables: StudyTables) -> list[str]:
    main = main_indicator(tables.comparisons)
    notes = tables.ranks.loc[tables.ranks["indicator"] == main, "note"].unique()
    said = posthoc_words(tables.posthoc[tables.posthoc["indicator"] == main])
    return [*notes, said] if said else list(notes)


def _missions(tables: StudyTables) -> TextTable:
    rows = []
    entries = tables.manifest["missions"]
    limited = any(entry.get("max_length") is not None for entry in entries.values())
    for label, entry in entries.items():
        mission = tables.mission(label)
        source = dict(entry["source"])
        name, parameters = source.pop("name_or_path"), parameter_words(source)
        origin = f"{name} ({parameters})" if parameters else str(name)
        budget, floor = budget_words(entry["budget"]), significant(entry["min_survival"])
        sizes = (mission.arrays.n_nodes, mission.arrays.n_arcs, mission.robots)
        limit = entry.get("max_length")
        limits = ["none" if limit is None else f"{limit:g}"] if limited else []
        row = [label, mission.title, origin, budget, floor, *limits, *map(count, sizes)]
        rows.append([*row, significant(mission.total_reward, 4)])
    header = ["mission", "title", "from", "budget of a run", "survival floor"]
    header += ["travel budget"] if limited else []
    return TextTable([*header, "nodes", "arcs", "robots", "total reward"], rows, texts=4)


def _algorithms(tables: StudyTables) -> TextTable:
    rows = [
        [label, entry["algorithm"], parameter_words(entry["parameters"]) or "defaults"]
        for label, entry in tables.manifest["algorithms"].items()
    ]
    return TextTable(["label", "algorithm", "parameters"], rows, texts=3)


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
    pairs = tables.posthoc
    return [
        {
            "indicator": INDICATORS[str(indicator)].label,
            "table": rank_table(rows),
            "note": str(rows["note"].iloc[0]),
            "posthoc": posthoc_words(pairs[pairs["indicator"] == indicator]),
            "pairs": posthoc_table(pairs[pairs["indicator"] == indicator]),
        }
        for indicator, rows in tables.ranks.groupby("indicator", sort=False)
    ]


def _faults(tables: StudyTables) -> TextTable:
    rows = tables.runs[tables.runs["status"] != "done"].head(_MANY_FAULTS)
    shown = rows[["mission", "algorithm", "status", "stopped_by", "error", "seed", "area"]]
    cells = [
        [*texts, "–" if pd.isna(error) else str(error), str(seed), fixed(area)]
        for *texts, error, seed, area in shown.itertuples(index=False)
    ]
    return TextTable([str(name).replace("_", " ") for name in shown], cells, texts=5)


def _environments(tables: StudyTables) -> TextTable:
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
    return TextTable(header, rows, texts=4)
