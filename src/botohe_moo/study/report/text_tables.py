"""The tables of a report with their cells as text, for its page and for LaTeX.

The matrix of all missions and algorithms opens a report.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from scipy import stats

from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.study.judge.comparisons import effect_size
from botohe_moo.study.judge.scores import best_first
from botohe_moo.study.report.words import (
    BETTER,
    EQUAL,
    MARKS,
    WORSE,
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
from botohe_moo.study.store.schemas import SCHEMAS
from botohe_moo.study.store.tables import StudyTables


@dataclass(frozen=True)
class TextTable:
    """A table of texts; the names of its columns are their headings."""

    cells: pd.DataFrame
    texts: int = 1  # number of leading columns with words; the others hold numbers
    strong: Sequence[bool] = ()  # whether a row is set in bold, for each row
    bold: str = ""  # the only column that LaTeX sets in bold in these rows


def summary_table(tables: StudyTables, mission: str) -> TextTable:
    """Return the summary of a mission, a row for each algorithm; the best medians are strong."""
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
    return TextTable(pd.DataFrame(cells), strong=best.tolist(), bold="median area")


def _runs(row: Mapping[Any, Any], n_seeds: int) -> str:
    of_all = "" if row["n"] == n_seeds else f" of {count(n_seeds)}"
    lost = f" ({count(row['n_not_done'])} not done)" if row["n_not_done"] else ""
    return f"{count(row['n'])}{of_all}{lost}"


def comparison_table(rows: pd.DataFrame) -> TextTable:
    """Return comparisons, a row for each pair; significant ones are strong."""
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
    strong = rows["significant"].tolist()
    return TextTable(pd.DataFrame(cells), texts=4, strong=strong, bold="p (Holm)")


def _verdict(row: Mapping[Any, Any]) -> str:
    """Return the verdict of a comparison without the numbers, which have cells of their own."""
    if row["significant"]:
        return f"{'better' if row['a12'] > 0.5 else 'worse'}, {effect_size(row['a12'])}"
    return str(row["verdict"]).partition(":")[0]


def rank_table(rows: pd.DataFrame) -> TextTable:
    """Return the average ranks by an indicator, the best first, ties as in the study file."""
    rows = rows.sort_values("average_rank", kind="stable")
    cells = {
        "algorithm": rows["algorithm"],
        "average rank": [fixed(rank, 2) for rank in rows["average_rank"]],
        "missions": rows["n_missions"].map(count),
    }
    return TextTable(pd.DataFrame(cells))


def posthoc_table(rows: pd.DataFrame) -> TextTable:
    """Return the pairs of average ranks by an indicator; significant ones are strong."""
    cells = {
        "algorithm": rows["algorithm"],
        "other": rows["other"],
        "difference of average ranks": [fixed(difference, 2) for difference in rows["difference"]],
        "p (Nemenyi)": rows["p_value"].map(p_value),
    }
    return TextTable(pd.DataFrame(cells), texts=2, strong=rows["significant"].tolist())


def target_table(rows: pd.DataFrame) -> TextTable:
    """Return what it took to reach shares of the reference area, a row for each algorithm."""
    cells: dict[str, dict[str, str]] = {}
    for row in rows.to_dict("records"):
        of_algorithm = cells.setdefault(row["algorithm"], {"algorithm": row["algorithm"]})
        share = f"{100 * row['share']:g} %"
        of_algorithm[f"{share}: runs"] = f"{count(row['n_reached'])} of {count(row['n'])}"
        of_algorithm[f"{share}: evaluations"] = count(row["evaluations_median"])
        of_algorithm[f"{share}: seconds"] = significant(row["seconds_median"])
    return TextTable(pd.DataFrame(list(cells.values())).fillna("–"))


def mission_table(tables: StudyTables) -> TextTable:
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
    return TextTable(cells, texts=4)


def algorithm_table(tables: StudyTables) -> TextTable:
    """Return the algorithms of a study, with the parameters that differ among them."""
    parameters = tables.algorithms.drop(columns=SCHEMAS["algorithms"].names).astype(object)
    cells = tables.algorithms[["algorithm", "name"]].set_axis(["label", "algorithm"], axis=1)
    words = [
        parameter_words({str(name): value for name, value in row.dropna().items()}) or "defaults"
        for _, row in parameters.iterrows()
    ]
    return TextTable(cells.assign(parameters=words), texts=3)


def fault_table(runs: pd.DataFrame) -> TextTable:
    """Return the runs that are not done, with the reasons."""
    shown = runs[["mission", "algorithm", "status", "stopped_by", "error", "seed"]]
    cells = shown.fillna({"error": "–"}).assign(area=runs["area"].map(fixed))
    return TextTable(cells.rename(columns={"stopped_by": "stopped by"}).astype(str), texts=5)


def environment_table(tables: StudyTables) -> TextTable:
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
    return TextTable(pd.DataFrame(cells), texts=4)


def missing_table(tables: StudyTables) -> TextTable:
    """Return the runs of the study that are not in its tables, by mission and algorithm."""
    cells = tables.missing.rename(columns={"missing": "missing runs"})
    return TextTable(cells.astype(str), texts=2)


@dataclass(frozen=True)
class Cell:
    """A cell of the matrix: an algorithm on a mission."""

    text: str = "–"  # the median; a dash where there are no runs
    mark: str = ""  # +, − or =: better than the rival, worse, or neither
    rank: str = ""  # of the median on the mission
    best: bool = False


@dataclass(frozen=True)
class Matrix:
    """Medians of all algorithms on all missions; the rows are the more numerous of both."""

    header: Sequence[str]  # "algorithm" or "mission", and the headings of the columns
    rows: Sequence[tuple[str, Sequence[Cell]]]


def matrix(tables: StudyTables) -> Matrix:
    """Return the matrix of missions and algorithms."""
    missions, algorithms = tables.mission_labels, tables.algorithm_labels
    columns = {mission: _cells(tables, mission) for mission in missions}
    if len(missions) > 1:
        columns |= _over_missions(tables, columns)
    if len(algorithms) >= len(missions):
        rows = [(a, [column[a] for column in columns.values()]) for a in algorithms]
        return Matrix(["algorithm", *columns], rows)
    rows = [(name, [column[a] for a in algorithms]) for name, column in columns.items()]
    return Matrix(["mission", *algorithms], rows)


def _cells(tables: StudyTables, mission: str) -> dict[str, Cell]:
    """Return the cell of each algorithm on a mission, by the report's main indicator."""
    cells = dict.fromkeys(tables.algorithm_labels, Cell())
    indicator = main_indicator(tables.comparisons)
    rows = tables.summary[tables.summary["mission"] == mission]
    medians = rows.set_index("algorithm")[f"{indicator}_median"].dropna()
    if medians.empty:
        return cells
    if INDICATORS[indicator].higher_is_better:
        texts = distinct(medians, fixed)
    else:
        texts = distinct(medians, significant, digits=3)
    ranks = stats.rankdata(best_first(indicator, medians.to_list()))
    best = ranks == ranks.min()
    marks = _marks(tables, mission, rival=tables.control or medians.index[best][0])
    for i, label in enumerate(medians.index):
        cells[label] = Cell(texts[i], marks.get(label, ""), count(ranks[i]), bool(best[i]))
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


def _over_missions(
    tables: StudyTables, columns: Mapping[str, Mapping[str, Cell]]
) -> dict[str, dict[str, Cell]]:
    """Return columns over all missions: the count of each mark, and average ranks."""
    labels = tables.algorithm_labels
    further: dict[str, dict[str, Cell]] = {}
    if tables.control is not None:
        marks = {a: Counter(column[a].mark for column in columns.values()) for a in labels}
        counts = {a: Cell("/".join(str(marks[a][mark]) for mark in MARKS)) for a in labels}
        further["/".join(MARKS)] = {**counts, tables.control: Cell()}
    ranks = tables.ranks[tables.ranks["indicator"] == main_indicator(tables.comparisons)]
    if len(ranks):
        averages = dict(zip(ranks["algorithm"], ranks["average_rank"], strict=True))
        further["average rank"] = {
            a: Cell(fixed(averages.get(a), 2), best=averages.get(a) == min(averages.values()))
            for a in labels
        }
    return further
