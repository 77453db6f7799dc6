"""Numbers in messages."""


def counted(number: int, thing: str) -> str:
    """Write a number of things, with the plural in s.

    >>> counted(1, "plan"), counted(1200, "plan")
    ('1 plan', '1,200 plans')
    """
    return f"1 {thing}" if number == 1 else f"{number:,} {thing}s"
