"""The tables of a report's page, their cells in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from botohe_moo.plots.study.ranks import overruled
from botohe_moo.study.report.words import (
    INDICATORS,
    count,
    distinct,
    fixed,
    listed,
    p_value,
    significant,
    spent_and_found,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from botohe_moo.study.store.tables import StudyTables

__all__ = ["Grid", "comparison_grid", "missing_grid", "posthoc_grid", "posthoc_words"]
__all__ += ["rank_grid", "summary_grid", "target_grid"]

_MANY_ROWS = 30


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


def summary_grid(tables: StudyTables, mission: str) -> Grid:
    """Sum up the runs on a mission, an algorithm a row; those with the best median are strong."""
    rows = tables.summary[tables.summary["mission"] == mission]
    header = ["algorithm", "runs", "median area", "interval", "mean ± sd", "best"]
    header += ["IGD+", "epsilon", "points", "evaluations", "seconds", "rank"]
    n_seeds = len(tables.manifest["seeds"])
    cells = []
    for row, median in zip(rows.to_dict("records"), distinct(rows["area_median"]), strict=True):
        of_all = "" if row["n"] == n_seeds else f" of {count(n_seeds)}"
        lost = f" ({count(row['n_not_done'])} not done)" if row["n_not_done"] else ""
        spread = "" if pd.isna(row["area_sd"]) else f" ± {fixed(row['area_sd'])}"
        cells.append(
            [
                row["algorithm"],
                f"{count(row['n'])}{of_all}{lost}",
                median,
                f"{fixed(row['area_low'])}–{fixed(row['area_high'])}",
                f"{fixed(row['area_mean'])}{spread}",
                fixed(row["area_best"]),
                *spent_and_found(row),
            ]
        )
    best = rows["rank"].to_numpy() == rows["rank"].min()
    return Grid(header, cells, strong=frozenset(best.nonzero()[0].tolist()))


def comparison_grid(rows: pd.DataFrame) -> Grid:
    """Give comparisons, a pair a row; significant ones are strong."""
    header = ["indicator", "algorithm", "other", "verdict", "median", "of other", "p (Holm)", "A12"]
    cells = [
        [
            INDICATORS.get(row["indicator"], row["indicator"]),
            row["algorithm"],
            row["other"],
            row["verdict"],
            *distinct([row["median"], row["median_other"]], significant),
            p_value(row["p_holm"]),
            f"{fixed(row['a12'], 2)} ({fixed(row['a12_low'], 2)}–{fixed(row['a12_high'], 2)})",
        ]
        for row in rows.to_dict("records")
    ]
    strong = frozenset(i for i, found in enumerate(rows["significant"]) if found)
    return Grid(header, cells, texts=4, strong=strong, folded=len(cells) > _MANY_ROWS)


def target_grid(rows: pd.DataFrame) -> Grid:
    """Give what it took to reach shares of the reference area, an algorithm a row."""
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
    return Grid(header, cells)


def rank_grid(rows: pd.DataFrame) -> Grid:
    """Give average ranks by an indicator, the best first, those alike as in the study file."""
    cells = [
        [row["algorithm"], fixed(row["average_rank"], 2), count(row["n_missions"])]
        for row in rows.sort_values("average_rank", kind="stable").to_dict("records")
    ]
    return Grid(["algorithm", "average rank", "missions"], cells)


def posthoc_grid(rows: pd.DataFrame) -> Grid:
    """Give the pairs of average ranks by an indicator; significant ones are strong."""
    cells = [
        [row["algorithm"], row["other"], fixed(row["difference"], 2), p_value(row["p_value"])]
        for row in rows.to_dict("records")
    ]
    strong = frozenset(i for i, found in enumerate(rows["significant"]) if found)
    header = ["algorithm", "other", "difference of average ranks", "p (Nemenyi)"]
    return Grid(header, cells, texts=2, strong=strong, folded=len(cells) > _MANY_ROWS)


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


def missing_grid(tables: StudyTables) -> Grid:
    """Give the runs of the study that are not in its tables, by mission and algorithm."""
    cells = [
        [row["mission"], row["algorithm"], count(row["missing"])]
        for row in tables.missing.to_dict("records")
    ]
    return Grid(["mission", "algorithm", "missing runs"], cells, texts=2, folded=len(cells) > 10)
