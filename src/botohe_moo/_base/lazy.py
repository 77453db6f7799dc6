"""Packages whose names are imported when they are first used."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def lazy_names(
    package: str,
    homes: Mapping[str, Sequence[str]],
    moved: Mapping[str, Sequence[str]] | None = None,
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make the ``__getattr__`` and ``__dir__`` (PEP 562) of a package of that ``__name__``.

    ``homes`` has its public names by the module that defines them. Those in ``moved`` can be
    imported, too, but are not listed.

    Examples
    --------
    >>> get, names = lazy_names("botohe_moo", {".trails": ("TrailPlan",)})
    >>> get("TrailPlan").__module__, names()
    ('botohe_moo.trails', ['TrailPlan'])
    """
    listed = sorted(name for names in homes.values() for name in names)
    known = [*homes.items(), *(moved or {}).items()]
    home_of = {name: home for home, names in known for name in names}

    def get(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(home_of[name], package), name)

    return get, lambda: list(listed)
