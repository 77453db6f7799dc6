"""Numbers and flags, as texts hold them and otherwise."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from botohe_moo.base.types import FloatArray

FLAGS = dict.fromkeys(("true", "yes", "1", "1.0"), True)
FLAGS |= dict.fromkeys(("false", "no", "0", "0.0"), False)


def read_number(value: Any) -> Any:
    """Convert text to a number, also in lists and mappings; return anything else unchanged."""
    if isinstance(value, Mapping):
        return {kind: read_number(number) for kind, number in value.items()}
    if isinstance(value, list | tuple):
        return [read_number(number) for number in value]
    for number in (int, float) if isinstance(value, str) else ():
        with suppress(ValueError):  # text that stays text breaks a rule
            return number(value)
    return value


def read_flag(value: Any) -> Any:
    """Convert text, or 0 or 1, to a flag; return anything else unchanged."""
    return FLAGS.get(str(value).lower(), value)


def plain_numbers(value: Any) -> FloatArray:
    """Return an array of finite numbers; it is empty if ``value`` holds anything else."""
    try:
        numbers = np.array(value, float)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


def probability_text(probability: float, decimals: int) -> str:
    """Write a probability; only 0 and 1 themselves are written as such.

    >>> [probability_text(p, 2) for p in (0.25, 0.9996, 1e-9, 1)]
    ['0.25', '>0.99', '<0.01', '1.00']
    """
    text = f"{probability:.{decimals}f}"
    if float(text) == 0 < probability:
        return f"<{10**-decimals:.{decimals}f}"
    if float(text) == 1 and probability < 1 - 1e-12:
        return f">{1 - 10**-decimals:.{decimals}f}"
    return text


def short_text(value: float) -> str:
    """Write a number with four significant digits."""
    return f"{value:.4g}"


def difference_text(value: float, what: str) -> str:
    """Write how much more or less reward, or how many more or fewer survivors, a plan has.

    >>> difference_text(0.5, "reward"), difference_text(-1, "survivors"), difference_text(0, "x")
    ('0.5 more reward', '1 fewer survivors', 'the same x')
    """
    if abs(value) < 1e-9:
        return f"the same {what}"
    less = "fewer" if what == "survivors" else "less"
    return f"{short_text(abs(value))} {'more' if value > 0 else less} {what}"


def price_text(price: float) -> str:
    """Write the price of a survivor, as reward.

    >>> price_text(3.2)
    'one more survivor costs 3.2 reward'
    """
    return f"one more survivor costs {short_text(price)} reward"
