"""Numbers and labels of a study's report as text."""

import hashlib
import math
import re
from collections.abc import Mapping
from typing import Any

from botohe_moo.study.content import value_text
from botohe_moo.study.tables import StudyTables

_LONGEST_SLUG = 60


def number_text(number: float) -> str:
    """Return a number with four significant digits, or whole; a tiny one as 1.234e-09."""
    if not math.isfinite(number) or number == int(number):
        return f"{number:,.0f}"
    places = 3 - math.floor(math.log10(abs(number)))
    return f"{number:,.{max(places, 0)}f}" if places <= 8 else f"{number:.4g}"


def parameter_words(parameters: Mapping[str, Any]) -> str:
    """Return parameters as name=value."""
    return ", ".join(f"{name}={value_text(value)}" for name, value in parameters.items())


def slug(label: str) -> str:
    """Return a label as part of a file's name; different labels give different names."""
    plain = re.sub(r"[^a-z0-9._-]+", "-", label.lower()).strip(".-_")[:_LONGEST_SLUG]
    if plain == label:
        return plain
    # Two labels may differ only in characters that are left out.
    return f"{plain}-{hashlib.sha256(label.encode()).hexdigest()[:8]}".lstrip("-")


def further_of(tables: StudyTables) -> list[str]:
    """Return the indicators that the study names beside the area and the size of the front."""
    return [name for name in tables.manifest["indicators"] if name not in ("area", "front_size")]


def main_indicator(tables: StudyTables) -> str:
    """Return the indicator that algorithms are ranked by: the area, or the first one without it."""
    compared = dict.fromkeys(tables.comparisons["indicator"])
    return "area" if "area" in compared else next(iter(compared), "area")
