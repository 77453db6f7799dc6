"""The missions of the library: how each is made, and the digest by which it is known.

`botohe_moo.library` has their best known fronts and bounds.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, Literal, NamedTuple

from botohe_moo._base.checks import check_choice

PREFIX = "library:"  # before the name of a mission, and of several


class Entry(NamedTuple):
    """A mission of the library.

    Attributes
    ----------
    family
        What it has in common with others.
    size
        Small up to 40 nodes, medium up to 100, large above.
    source, parameters
        The named mission or generator that makes it, and with which parameters.
    digest
        That of its numbers.
    """

    family: str
    size: Literal["small", "medium", "large"]
    source: str
    parameters: Mapping[str, Any]
    digest: str


_DATA = files("botohe_moo.mission").joinpath("data", "library.json")
ENTRIES: Mapping[str, Entry] = {
    name: Entry(**said) for name, said in json.loads(_DATA.read_text("utf-8")).items()
}
FAMILIES = tuple(dict.fromkeys(entry.family for entry in ENTRIES.values()))
SELECTIONS = ("small", "medium", "large", "all", *FAMILIES)  # names of several missions


def library_names(selection: str = "all") -> tuple[str, ...]:
    """Return the names of missions of the library.

    Parameters
    ----------
    selection
        A name; ``small``, ``medium``, ``large`` or ``all``; or a family. A ValueError lists what is
        known.

    Examples
    --------
    >>> from botohe_moo.library import library_names
    >>> library_names("tunnel")
    ('tunnel-20', 'tunnel-75', 'tunnel-1000')
    """
    check_choice("a mission of the library", selection, [*SELECTIONS, *ENTRIES])
    return tuple(
        name
        for name, entry in ENTRIES.items()
        if selection in ("all", name, entry.family, entry.size)
    )


def library_name_of(digest: str) -> str | None:
    """Return the name of the mission of the library with this digest of its numbers."""
    return next((name for name, entry in ENTRIES.items() if entry.digest == digest), None)
