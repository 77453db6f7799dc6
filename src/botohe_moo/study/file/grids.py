"""Expanding grids: every combination of their values, with a label of its own."""

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from botohe_moo.study.file.config import AlgorithmEntry, MissionEntry, Seeds
from botohe_moo.study.file.digest import value_text


class Member(NamedTuple):
    """One combination of a grid, or the whole of an entry without a grid."""

    family: str  # label of the entry
    label: str  # names the combination, too
    entry: Any
    parameters: dict[str, Any]  # all of them
    grid: dict[str, Any]  # those of the combination


def n_members(entries: Mapping[str, MissionEntry | AlgorithmEntry]) -> int:
    """Return how many missions or algorithms the entries are, with their grids expanded."""
    return sum(math.prod(map(len, entry.grid.values())) for entry in entries.values())


def members(entries: Mapping[str, MissionEntry | AlgorithmEntry]) -> Iterator[Member]:
    """Expand the grids of all missions or algorithms."""
    for family, entry in entries.items():
        for combination in itertools.product(*entry.grid.values()):
            grid = dict(zip(entry.grid, combination, strict=True))
            named = ", ".join(f"{name}={value_text(value)}" for name, value in grid.items())
            label = f"{family} ({named})" if named else family
            yield Member(family, label, entry, {**entry.parameters, **grid}, grid)


def seeds_of(seeds: Seeds) -> tuple[int, ...]:
    """Return the seeds of the repetitions; a seed does not depend on their number."""
    if seeds.values is not None:
        return tuple(seeds.values)
    numbers = range(1, (seeds.count or 0) + 1)
    if seeds.seed is None:
        return tuple(numbers)
    return tuple(
        int(np.random.SeedSequence([seeds.seed, number]).generate_state(1)[0]) for number in numbers
    )
