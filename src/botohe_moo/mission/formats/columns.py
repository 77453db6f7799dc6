"""Columns for one kind of robots, such as ``survival:drone``, as tables and GraphML have them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from botohe_moo._base.checks import most_alike, quoted
from botohe_moo.mission.formats.nodelink import Entry
from botohe_moo.mission.rules import BY_KIND, attribute_of


def column_faults(columns: Iterable[str], kinds: Sequence[str]) -> list[str]:
    """List columns for kinds that a mission does not have, or else survivals that a kind lacks."""
    names, faults = list(columns), []
    for column in names:
        kind = column.partition(":")[2]
        if attribute_of(column) and kind not in kinds:
            near = most_alike(kind, kinds) or "; the mission lists no kinds"
            faults.append(f"column {quoted(column)}: there is no kind {quoted(kind)}{near}")
    if faults or "survival" in names or "survival" not in map(attribute_of, names):
        return faults
    missing = [column for kind in kinds if (column := f"survival:{kind}") not in names]
    return [f"expected a column {quoted(column)}, found none" for column in missing]


def join_columns(entries: Sequence[Entry], kinds: Sequence[str]) -> None:
    """Replace the columns for one kind, in all entries, by mappings from kinds to numbers.

    Where another kind's cell is not empty, an empty cell has the number in the column for all
    kinds. If that is empty, too, a kind cannot take the arc.
    """
    columns = dict.fromkeys(column for *_, row in entries for column in row)
    for name in BY_KIND:
        of_kind = {c: c.partition(":")[2] for c in columns if attribute_of(c) == name}
        for *_, row in entries:
            numbers = {of_kind[column]: row.pop(column) for column in of_kind if column in row}
            if not numbers:
                continue
            if name in row:
                numbers = {**dict.fromkeys(kinds, row[name]), **numbers}
            elif name == "survival":
                numbers = {**dict.fromkeys(of_kind.values(), 0.0), **numbers}
            row[name] = {kind: numbers[kind] for kind in kinds if kind in numbers}


def split_columns(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes with a column for each number of a mapping from kinds."""
    split = {}
    for name, value in attributes.items():
        if name in BY_KIND and isinstance(value, Mapping):
            split.update({f"{name}:{kind}": number for kind, number in value.items()})
        else:
            split[name] = value
    return split
