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


def short_text(value: float) -> str:
    """Write a number with four significant digits."""
    return f"{value:.4g}"


def exact_text(value: float) -> str:
    """Write a number with all the digits that it takes to read the same number again.

    >>> exact_text(0.5), exact_text(2.0), exact_text(1 / 3)
    ('0.5', '2', '0.3333333333333333')
    """
    text = f"{value:g}"
    return text if float(text) == value else repr(value)


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
