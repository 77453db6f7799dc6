"""The missions of the library: how each is made, and the digest by which it is known.

`botohe_moo.library` has their best known fronts and bounds.
"""

from __future__ import annotations

from collections.abc import Mapping
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


ENTRIES: Mapping[str, Entry] = {
    "museum-27": Entry("paper", "small", "art_museum", {}, "d4a6a8575c86fefa"),
    "plant-73": Entry("paper", "medium", "power_plant", {}, "a2467065d9f81611"),
    "communities-21": Entry("paper", "small", "two_communities", {"seed": 0}, "8b4643fea56c0e6e"),
    "building-24": Entry(
        "building",
        "small",
        "building",
        {"floors": 2, "doors": 4, "robots": 2, "seed": 1},
        "eed8d0e974229e57",
    ),
    "building-54": Entry(
        "building",
        "medium",
        "building",
        {"floors": 3, "doors": 6, "robots": 3, "seed": 1},
        "37b6d4e5ad4b7fd3",
    ),
    "building-180": Entry(
        "building",
        "large",
        "building",
        {"floors": 5, "doors": 12, "robots": 4, "seed": 1},
        "3ae5bf223b29f66c",
    ),
    "tunnel-20": Entry(
        "tunnel", "small", "tunnel", {"nodes": 20, "robots": 2, "seed": 1}, "5fb90476e6759aa9"
    ),
    "tunnel-75": Entry(
        "tunnel", "medium", "tunnel", {"nodes": 75, "robots": 3, "seed": 1}, "8c29210534fb4564"
    ),
    "tunnel-1000": Entry(
        "tunnel", "large", "tunnel", {"nodes": 1000, "robots": 2, "seed": 1}, "c723ea12baa75acd"
    ),
    "terrain-10": Entry(
        "terrain", "small", "terrain", {"nodes": 10, "robots": 2, "seed": 1}, "a2b36016a2e778a6"
    ),
    "terrain-60": Entry(
        "terrain", "medium", "terrain", {"nodes": 60, "robots": 3, "seed": 12}, "285d30380f04deec"
    ),
    "terrain-200": Entry("terrain", "large", "terrain_200", {}, "92538b3a4db30d78"),
    "town-16": Entry(
        "town", "small", "town", {"streets": 4, "robots": 2, "seed": 1}, "3c8c634e9a02e488"
    ),
    "town-64": Entry(
        "town", "medium", "town", {"streets": 8, "robots": 2, "seed": 1}, "461580fedfc97e6d"
    ),
    "town-196": Entry(
        "town", "large", "town", {"streets": 14, "robots": 3, "seed": 1}, "a6bfb0c63ef5440e"
    ),
    "lattice-12": Entry(
        "lattice",
        "small",
        "lattice",
        {"rows": 3, "columns": 4, "robots": 2, "seed": 1},
        "deac77d63367283c",
    ),
    "lattice-65": Entry(
        "lattice",
        "medium",
        "lattice",
        {"rows": 5, "columns": 13, "robots": 2, "seed": 1},
        "83f53bdd4daaf0bf",
    ),
    "lattice-225": Entry(
        "lattice",
        "large",
        "lattice",
        {"rows": 15, "columns": 15, "robots": 3, "seed": 1},
        "603d43cf3bed441b",
    ),
    "orienteering-21": Entry(
        "orienteering",
        "small",
        "orienteering",
        {"nodes": 21, "robots": 2, "tour": 0.4, "seed": 1},
        "992998bb9bf246b3",
    ),
    "orienteering-64": Entry(
        "orienteering",
        "medium",
        "orienteering",
        {"nodes": 64, "robots": 3, "seed": 1},
        "95dc15cc6585ad2c",
    ),
    "orienteering-102": Entry(
        "orienteering",
        "large",
        "orienteering",
        {"nodes": 102, "robots": 4, "seed": 1},
        "43bba5b6d0133c43",
    ),
    "building-24-kinds": Entry(
        "kinds",
        "small",
        "building",
        {"floors": 2, "doors": 4, "robots": 2, "wheeled": 1, "seed": 1},
        "6d32288b09fdc820",
    ),
    "building-54-kinds": Entry(
        "kinds",
        "medium",
        "building",
        {"floors": 3, "doors": 6, "robots": 4, "wheeled": 2, "seed": 1},
        "9f670306b5c7baae",
    ),
    "terrain-24-depots": Entry(
        "return",
        "small",
        "terrain",
        {"nodes": 24, "robots": 2, "depots": 6, "seed": 2},
        "9a01e89684faf13f",
    ),
    "terrain-60-depots": Entry(
        "return",
        "medium",
        "terrain",
        {"nodes": 60, "robots": 3, "depots": 15, "seed": 12},
        "ca1417980e6e799e",
    ),
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


def mission_of(digest: str) -> str | None:
    """Return the name of the mission of the library with this digest of its numbers."""
    return next((name for name, entry in ENTRIES.items() if entry.digest == digest), None)
