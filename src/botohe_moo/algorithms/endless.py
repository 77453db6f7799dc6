"""Classes of pymoo's that may never end; apart from ``wired``, which loads all operators."""

# Classes that loop inside of one generation, where no budget ends them.
_ENDLESS = {
    "pymoo.algorithms.moo.ctaea:CTAEA": (
        "pymoo's CTAEA never ends where there are fewer plans than directions, which is what "
        "leaving out duplicates does: its diversity archive looks for plans in as many directions "
        "as there are plans, until it has all of them"
    ),
}


def never_ends(kind: type) -> str | None:
    """Return why algorithms of a class, or of one derived from it, never end; None if they do."""
    names = (f"{base.__module__}:{base.__qualname__}" for base in kind.__mro__)
    return next((_ENDLESS[name] for name in names if name in _ENDLESS), None)
