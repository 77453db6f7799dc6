"""Grids as what they stand for: every combination of their values, under a label of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from botohe_moo.study.file.config import AlgorithmEntry, MissionEntry, Seeds
from botohe_moo.study.file.grid import canonical, value_text
from botohe_moo.study.file.shape import Faults, Place

__all__ = ["Member", "members", "seeds_of"]

_MAX_MEMBERS = 1_000  # missions of a study, and algorithms; a grid alone has no more either
_MAX_LABEL = 500


class Member(NamedTuple):
    """One combination of a grid, or all that an entry without one stands for.

    Attributes
    ----------
    family, label
        Label of the entry, and its own, which names the combination.
    path
        Where the entry stands in the file.
    entry
        What the file says.
    parameters, grid
        All parameters, and those of the combination.
    """

    family: str
    label: str
    path: Place
    entry: Any
    parameters: dict[str, Any]
    grid: dict[str, Any]


def members(
    kind: str, entries: Mapping[str, MissionEntry | AlgorithmEntry], faults: Faults
) -> Iterator[Member]:
    """Expand the grids of all missions or algorithms, those of wrong grids left out.

    Parameters
    ----------
    kind
        ``missions`` or ``algorithms``.
    entries
        What the file says of them, by label.
    faults
        Where to say what is wrong with the grids.

    Yields
    ------
    Member
        One combination after the other, until there are too many faults.
    """
    sizes = {family: math.prod(map(len, entry.grid.values())) for family, entry in entries.items()}
    n_members = sum(size for size in sizes.values() if size <= _MAX_MEMBERS)
    if n_members > _MAX_MEMBERS:
        said = f"expected at most {_MAX_MEMBERS:,} {kind}, found {n_members:,}."
        faults.add((kind,), said)
        return
    for family, entry in entries.items():
        path: Place = (kind, family)
        _check_grid(entry, path, faults)
        if sizes[family] > _MAX_MEMBERS:
            found = f"{sizes[family]:,}" if sizes[family] < 10**12 else "far more"
            said = f"expected at most {_MAX_MEMBERS:,} combinations, got {found}."
            faults.add((*path, "grid"), said)
            continue
        for combination in itertools.product(*entry.grid.values()):
            if faults.full:
                return
            grid = dict(zip(entry.grid, combination, strict=True))
            named = ", ".join(f"{name}={value_text(value)}" for name, value in grid.items())
            label = f"{family} ({named})" if named else family
            if len(label) > _MAX_LABEL:
                said = f"expected values of which labels of at most {_MAX_LABEL} characters come."
                faults.add((*path, "grid"), said)
                break
            yield Member(family, label, path, entry, {**entry.parameters, **grid}, grid)


def _check_grid(entry: MissionEntry | AlgorithmEntry, path: Place, faults: Faults) -> None:
    for name, values in entry.grid.items():
        if name in entry.parameters:
            faults.add((*path, "grid", name), f"{name} stands in parameters, too.")
        if len({canonical(value) for value in values}) < len(values):
            faults.add((*path, "grid", name), "expected different values.")


def seeds_of(seeds: Seeds) -> tuple[int, ...]:
    """Give the seeds of the repetitions; a repetition's never depends on how many there are.

    Parameters
    ----------
    seeds
        What the file says.
    """
    if seeds.values is not None:
        return tuple(seeds.values)
    numbers = range(1, (seeds.count or 0) + 1)
    if seeds.seed is None:
        return tuple(numbers)
    return tuple(
        int(np.random.SeedSequence([seeds.seed, number]).generate_state(1)[0]) for number in numbers
    )
