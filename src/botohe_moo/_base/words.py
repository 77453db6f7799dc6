"""Numbers and lists of names in messages and pictures."""

from collections.abc import Iterable


def counted(number: int, thing: str) -> str:
    """Write a number of things, with the plural in s.

    >>> counted(1, "plan"), counted(1200, "plan")
    ('1 plan', '1,200 plans')
    """
    return f"1 {thing}" if number == 1 else f"{number:,} {thing}s"


def listed(names: Iterable[str], most: int = 5) -> str:
    """Write names once each; of more than ``most``, the first ones and how many more there are.

    >>> listed("abca"), listed("abcd", most=2)
    ('a, b, c', 'a, b and 2 more')
    """
    once = list(dict.fromkeys(names))
    return ", ".join(once[:most]) + (f" and {n:,} more" if (n := len(once) - most) > 0 else "")


def probability_text(probability: float, decimals: int) -> str:
    """Write a probability; only 0 and 1 themselves are written as such.

    >>> [probability_text(p, 2) for p in (0.25, 0.9996, 1e-9, 1)]
    ['0.25', '>0.99', '<0.01', '1.00']
    """
    unit = 10.0**-decimals
    text = f"{probability:.{decimals}f}"
    if float(text) == 0 < probability:
        return f"<{unit:.{decimals}f}"
    if float(text) == 1 and probability < 1 - 1e-12:
        return f">{1 - unit:.{decimals}f}"
    return text
