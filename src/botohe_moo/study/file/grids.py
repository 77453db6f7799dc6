"""Expanding grids: every combination of their values, with a label of its own."""

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from botohe_moo.study.file.config import AlgorithmEntry, MissionEntry, Seeds
from botohe_moo.study.file.digest import canonical, value_text
from botohe_moo.study.file.shape import Faults, Place

_MAX_MEMBERS = 1_000  # missions or algorithms of a study, and of one grid
_MAX_LABEL = 500


class Member(NamedTuple):
    """One combination of a grid, or the whole of an entry without a grid."""

    family: str  # label of the entry
    label: str  # names the combination, too
    path: Place  # of the entry in the file
    entry: Any
    parameters: dict[str, Any]  # all of them
    grid: dict[str, Any]  # those of the combination


def members(
    kind: str, entries: Mapping[str, MissionEntry | AlgorithmEntry], faults: Faults
) -> Iterator[Member]:
    """Expand the grids of all missions or algorithms, but wrong ones, which are added to faults."""
    sizes = {family: math.prod(map(len, entry.grid.values())) for family, entry in entries.items()}
    n_members = sum(size for size in sizes.values() if size <= _MAX_MEMBERS)
    if n_members > _MAX_MEMBERS:
        said = f"expected at most {_MAX_MEMBERS:,} {kind}, found {n_members:,}."
        faults.add((kind,), said)
        return
    for family, entry in entries.items():
        path: Place = (kind, family)
        for name, values in entry.grid.items():
            if name in entry.parameters:
                faults.add((*path, "grid", name), f"{name} stands in parameters, too.")
            if len({canonical(value) for value in values}) < len(values):
                faults.add((*path, "grid", name), "expected different values.")
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


def seeds_of(seeds: Seeds) -> tuple[int, ...]:
    """Give the seeds of the repetitions; a seed does not depend on the number of repetitions."""
    if seeds.values is not None:
        return tuple(seeds.values)
    numbers = range(1, (seeds.count or 0) + 1)
    if seeds.seed is None:
        return tuple(numbers)
    return tuple(
        int(np.random.SeedSequence([seeds.seed, number]).generate_state(1)[0]) for number in numbers
    )
