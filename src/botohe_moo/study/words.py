"""Numbers and captions of a study's report as text."""

import hashlib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from botohe_moo.study.content import value_text
from botohe_moo.study.statistics import merge_ties
from botohe_moo.study.tables import StudyTables

_DASH = "–"
_LONGEST_SLUG = 60
_MOST_DIGITS = 13  # values that are not ties differ in one of these


def fixed(value: Any, decimals: int = 4) -> str:
    """Return a number with ``decimals`` decimals; a dash where it is missing."""
    return _DASH if pd.isna(value) else f"{float(value):,.{decimals}f}"


def significant(value: Any, digits: int = 3) -> str:
    """Return a number with significant digits, a large one whole, a tiny one as 1.2e-09."""
    if pd.isna(value):
        return _DASH
    number = float(value)
    if number == 0 or not math.isfinite(number):
        return f"{number:g}"
    places = digits - 1 - math.floor(math.log10(abs(number)))
    return f"{number:,.{max(places, 0)}f}" if places <= 8 else f"{number:.{digits}g}"


def percent(share: Any) -> str:
    """Return a share in percent; a dash where it is missing or infinite."""
    return _DASH if pd.isna(share) or share == math.inf else f"{100 * float(share):,.2f} %"


def count(value: Any) -> str:
    """Return a count, or a median of counts, which may end in a half."""
    if pd.isna(value):
        return _DASH
    return f"{float(value):,.1f}".removesuffix(".0")


def interval(low: Any, high: Any, decimals: int = 4) -> str:
    """Return both ends of an interval."""
    return f"{fixed(low, decimals)}–{fixed(high, decimals)}"


def p_value(value: Any) -> str:
    """Return a p-value with two significant digits, or ``< 0.0001``."""
    if pd.isna(value):
        return _DASH
    return "< 0.0001" if value < 1e-4 else significant(value, 2)


def level(tables: StudyTables) -> str:
    """Return the confidence level of the study's intervals, in percent."""
    return f"{100 * (1 - tables.significance):g} %"


def budget_words(budget: Mapping[str, Any]) -> str:
    """Return a run's budget."""
    limits = {unit: budget.get(unit) for unit in ("evaluations", "seconds")}
    given = [f"{count(limit)} {unit}" for unit, limit in limits.items() if limit is not None]
    return " or ".join(given) or "no limit"


def bound_words(mission: Mapping[Any, Any]) -> str:
    """Return the bound of a mission, a row of that table, in words; empty if it has none."""
    if pd.isna(mission["bound_area"]):
        return ""
    area, took = fixed(mission["bound_area"]), significant(mission["bound_seconds"])
    return f"No front whatsoever has an area above {area}, proved in {took} s."


def reference_words(tables: StudyTables) -> str:
    """Return what reference fronts are."""
    known = tables.manifest.get("reference") == "best-known"
    with_known = ", with the best known front of the library" if known else ""
    return f"what all runs on a mission found together{with_known}"


def parameter_words(parameters: Mapping[str, Any]) -> str:
    """Return parameters as name=value."""
    return ", ".join(f"{name}={value_text(value)}" for name, value in parameters.items())


def seed_words(seeds: Sequence[int]) -> str:
    """Return seeds; three or more consecutive ones as the first and the last."""
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"{seeds[0]}{_DASH}{seeds[-1]}"
    return ", ".join(map(str, seeds))


def distinct(
    values: Iterable[float], write: Callable[[Any, int], str] = fixed, *, digits: int = 4
) -> list[str]:
    """Return numbers with ``digits`` or as many more as make those that are not ties different."""
    merged = np.array(list(values), np.float64)
    finite = np.isfinite(merged)
    merged[finite] = merge_ties(merged[finite])
    different = set(merged[finite].tolist())
    while digits < _MOST_DIGITS and len({write(v, digits) for v in different}) < len(different):
        digits += 1
    return [write(value, digits) for value in merged.tolist()]


def slug(label: str) -> str:
    """Return a label as part of a file's name; different labels give different names."""
    plain = re.sub(r"[^a-z0-9._-]+", "-", label.lower()).strip(".-_")[:_LONGEST_SLUG]
    if plain == label:
        return plain
    # Two labels may differ only in characters that are left out.
    digest = hashlib.sha256(label.encode()).hexdigest()[:8]
    return f"{plain}-{digest}" if plain else digest


def further_of(tables: StudyTables) -> list[str]:
    """Return the indicators that the study names beside the area and the size of the front."""
    return [name for name in tables.manifest["indicators"] if name not in ("area", "front_size")]


def main_indicator(comparisons: pd.DataFrame) -> str:
    """Return the indicator of the matrix and of ranks: the area, or the first one without it."""
    indicators = list(comparisons["indicator"].unique())
    return "area" if "area" in indicators or not indicators else str(indicators[0])
