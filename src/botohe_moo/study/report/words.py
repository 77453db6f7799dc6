"""Numbers and outcomes of a study in words, for its report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from botohe_moo.study.file.grid import value_text
from botohe_moo.study.judge import scores
from botohe_moo.study.judge.ties import merge_ties

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from botohe_moo.study.store.tables import StudyTables

__all__ = [
    "INDICATORS",
    "budget_words",
    "count",
    "distinct",
    "fixed",
    "level",
    "listed",
    "main_indicator",
    "p_value",
    "parameter_words",
    "seed_words",
    "significant",
    "spent_and_found",
    "verdict_words",
]

INDICATORS = {name: indicator.label for name, indicator in scores.INDICATORS.items()}
_DASH = "–"
_MOST_DIGITS = 13  # those of values that are no ties differ


def fixed(value: Any, decimals: int = 4) -> str:
    """Write a number with so many decimals; a dash where it is missing."""
    return _DASH if pd.isna(value) else f"{float(value):,.{decimals}f}"


def significant(value: Any, digits: int = 3) -> str:
    """Write a number with so many significant digits, a large one whole, a tiny one as 1.2e-09."""
    if pd.isna(value):
        return _DASH
    number = float(value)
    if number == 0 or not math.isfinite(number):
        return f"{number:g}"
    places = digits - 1 - math.floor(math.log10(abs(number)))
    return f"{number:,.{max(places, 0)}f}" if places <= 8 else f"{number:.{digits}g}"


def count(value: Any) -> str:
    """Write a number of things; medians of counts may end in a half."""
    if pd.isna(value):
        return _DASH
    return f"{float(value):,.1f}".removesuffix(".0")


def spent_and_found(row: Mapping[Any, Any]) -> list[str]:
    """Write IGD+, epsilon, points, evaluations, seconds and rank of a row of the summary."""
    return [
        significant(row["igd_plus_median"]),
        significant(row["epsilon_median"]),
        count(row["front_size_median"]),
        count(row["evaluations_median"]),
        significant(row["seconds_median"]),
        count(row["rank"]),
    ]


def p_value(value: Any) -> str:
    """Write a p-value with two digits; below 0.0001 only that it is."""
    if pd.isna(value):
        return _DASH
    return "< 0.0001" if value < 1e-4 else significant(value, 2)


def level(tables: StudyTables) -> str:
    """Write how much intervals cover, in percent."""
    return f"{100 * (1 - tables.significance):g} %"


def budget_words(budget: Mapping[str, Any]) -> str:
    """Say what a run may spend."""
    limits = [
        f"{count(budget[unit])} {unit}"
        for unit in ("evaluations", "seconds")
        if budget.get(unit) is not None
    ]
    return " or ".join(limits) or "no limit"


def parameter_words(parameters: Mapping[str, Any]) -> str:
    """Write parameters as name=value."""
    return ", ".join(f"{name}={value_text(value)}" for name, value in parameters.items())


def seed_words(seeds: Sequence[int]) -> str:
    """Write seeds, consecutive ones as first and last."""
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"{seeds[0]}{_DASH}{seeds[-1]}"
    return ", ".join(map(str, seeds))


def distinct(
    values: Iterable[float], write: Callable[[Any, int], str] = fixed, *, digits: int = 4
) -> list[str]:
    """Write numbers with so many digits that those that are no ties look different.

    Parameters
    ----------
    values
        The numbers, of which those within 1e-12 are ties; NaN where one is missing.
    write
        Writes one of them with so many digits: :func:`fixed` or :func:`significant`.
    digits
        The least number of digits.
    """
    shown = np.array(list(values), np.float64)
    known = np.isfinite(shown)
    shown[known] = merge_ties(shown[known])
    different = set(shown[known].tolist())
    while digits < _MOST_DIGITS and len({write(v, digits) for v in different}) < len(different):
        digits += 1
    return [write(value, digits) for value in shown.tolist()]


def listed(names: Sequence[str]) -> str:
    """Write names with commas and a last and."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def main_indicator(comparisons: pd.DataFrame) -> str:
    """Give the indicator that a report speaks of first."""
    found = list(comparisons["indicator"].unique())
    return "area" if "area" in found or not found else str(found[0])


def verdict_words(row: Mapping[str, Any]) -> str:
    """Give a comparison's verdict, with both names where the verdict itself has none."""
    verdict = str(row["verdict"])
    if verdict.startswith(str(row["algorithm"])):
        return verdict
    return f"{row['algorithm']} against {row['other']}: {verdict}"
