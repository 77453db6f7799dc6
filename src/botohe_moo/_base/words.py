"""Numbers in messages and pictures."""


def counted(number: int, thing: str) -> str:
    """Write a number of things, with the plural in s.

    >>> counted(1, "plan"), counted(1200, "plan")
    ('1 plan', '1,200 plans')
    """
    return f"1 {thing}" if number == 1 else f"{number:,} {thing}s"


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
