"""The tables of a report's page, with their cells as text."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from botohe_moo.indicators import INDICATORS, further_indicators
from botohe_moo.plots.study.ranks import overruled
from botohe_moo.study.report.words import (
    comparison_cells,
    count,
    fixed,
    listed,
    p_value,
    percent,
    significant,
    summary_cells,
)
from botohe_moo.study.store.tables import StudyTables

_MANY_ROWS = 30


@dataclass(frozen=True)
class TextTable:
    """A table of the page, with its cells as text."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    texts: int = 1  # number of leading columns with words; the others hold numbers
    strong: frozenset[int] = frozenset()  # rows to set off, counted from 0
    folded: bool = False  # whether it is so long that the page shows it on demand


def summary_table(tables: StudyTables, mission: str) -> TextTable:
    """Give the summary of a mission, a row for each algorithm; the best medians are strong."""
    rows = tables.summary[tables.summary["mission"] == mission]
    header = ["algorithm", "runs", "median area", "interval", "mean ± sd", "best"]
    header += [INDICATORS[name].label for name in further_indicators()]
    header += ["points", "evaluations", "seconds", "rank"]
    bounded = bool(rows["area_gap"].notna().any())
    if bounded:
        header.insert(6, "gap at most")
    n_seeds = len(tables.manifest["seeds"])
    cells = []
    for row, found in zip(rows.to_dict("records"), summary_cells(rows), strict=True):
        of_all = "" if row["n"] == n_seeds else f" of {count(n_seeds)}"
        lost = f" ({count(row['n_not_done'])} not done)" if row["n_not_done"] else ""
        spread = "" if pd.isna(row["area_sd"]) else f" ± {fixed(row['area_sd'])}"
        cells.append(
            [
                row["algorithm"],
                f"{count(row['n'])}{of_all}{lost}",
                *found[:2],
                f"{fixed(row['area_mean'])}{spread}",
                fixed(row["area_best"]),
                *([percent(row["area_gap"])] if bounded else []),
                *found[2:],
            ]
        )
    best = rows["rank"].to_numpy() == rows["rank"].min()
    return TextTable(header, cells, strong=frozenset(best.nonzero()[0].tolist()))


def comparison_table(rows: pd.DataFrame) -> TextTable:
    """Give comparisons, a row for each pair; significant ones are strong."""
    header = ["indicator", "algorithm", "other", "verdict", "median", "of other", "p (Holm)", "A12"]
    cells = []
    for row in rows.to_dict("records"):
        *numbers, effect, ends = comparison_cells(row)
        name = INDICATORS[row["indicator"]].label
        labels = [name, row["algorithm"], row["other"], row["verdict"]]
        cells.append([*labels, *numbers, f"{effect} ({ends})"])
    strong = frozenset(i for i, found in enumerate(rows["significant"]) if found)
    return TextTable(header, cells, texts=4, strong=strong, folded=len(cells) > _MANY_ROWS)


def target_table(rows: pd.DataFrame) -> TextTable:
    """Give what reaching shares of the reference area took, a row for each algorithm."""
    header = ["algorithm"]
    for share in sorted(rows["share"].unique()):
        name = f"{100 * share:g} %"
        header += [f"{name}: runs", f"{name}: evaluations", f"{name}: seconds"]
    cells = []
    for algorithm, found in rows.groupby("algorithm", sort=False):
        line = [str(algorithm)]
        for row in found.sort_values("share").to_dict("records"):
            line += [
                f"{count(row['n_reached'])} of {count(row['n'])}",
                count(row["evaluations_median"]),
                significant(row["seconds_median"]),
            ]
        cells.append(line)
    return TextTable(header, cells)


def rank_table(rows: pd.DataFrame) -> TextTable:
    """Give average ranks by an indicator, the best first, ties in the order of the study file."""
    cells = [
        [row["algorithm"], fixed(row["average_rank"], 2), count(row["n_missions"])]
        for row in rows.sort_values("average_rank", kind="stable").to_dict("records")
    ]
    return TextTable(["algorithm", "average rank", "missions"], cells)


def posthoc_table(rows: pd.DataFrame) -> TextTable:
    """Give the pairs of average ranks by an indicator; significant ones are strong."""
    cells = [
        [row["algorithm"], row["other"], fixed(row["difference"], 2), p_value(row["p_value"])]
        for row in rows.to_dict("records")
    ]
    strong = frozenset(i for i, found in enumerate(rows["significant"]) if found)
    header = ["algorithm", "other", "difference of average ranks", "p (Nemenyi)"]
    return TextTable(header, cells, texts=2, strong=strong, folded=len(cells) > _MANY_ROWS)


def posthoc_words(rows: pd.DataFrame) -> str:
    """Say which average ranks differ by an indicator; empty where no test was made."""
    if rows.empty:
        return ""
    critical = fixed(rows["critical_difference"].iloc[0], 2)
    better: dict[str, list[str]] = {}
    for row in rows[rows["significant"]].to_dict("records"):
        pair = [row["algorithm"], row["other"]]
        first, second = pair if row["difference"] < 0 else pair[::-1]
        better.setdefault(first, []).append(second)
    said = "; ".join(f"{label} ranks better than {listed(them)}" for label, them in better.items())
    if overruled(rows):
        said = "no pair counts, since Friedman's test finds no difference"
    return f"Post hoc (Nemenyi, critical difference {critical}): {said or 'no pair differs'}."


def missing_table(tables: StudyTables) -> TextTable:
    """Give the runs of the study that are not in its tables, by mission and algorithm."""
    cells = [
        [row["mission"], row["algorithm"], count(row["missing"])]
        for row in tables.missing.to_dict("records")
    ]
    return TextTable(
        ["mission", "algorithm", "missing runs"], cells, texts=2, folded=len(cells) > 10
    )
