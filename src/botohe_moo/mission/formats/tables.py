"""Missions from two tables, of nodes and of arcs, as planners draw them up."""

from __future__ import annotations

import contextlib
import csv
import io
import os
from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from botohe_moo._base.checks import check_frame, quoted
from botohe_moo.mission.formats.columns import column_faults, join_columns
from botohe_moo.mission.formats.nodelink import Entry, graph_of
from botohe_moo.mission.formats.reading import file_content
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import (
    BY_KIND,
    Kind,
    MissionError,
    attribute_of,
    kind_name_faults,
    read_kinds,
)

if TYPE_CHECKING:
    import pandas as pd

_SEPARATORS = ",;\t"
# Columns whose texts are read as numbers, and texts that are read as true and false.
_NUMBERS = ("reward", "x", "y", "share", "survival", "length")
_FLAGS = dict.fromkeys(("true", "yes", "1", "1.0"), True)
_FLAGS |= dict.fromkeys(("false", "no", "0", "0.0"), False)
_FILE, FAULTS = "botohe_moo file", "botohe_moo faults"  # attributes of tables read from files


def mission_from_tables(
    nodes: pd.DataFrame,
    arcs: pd.DataFrame,
    *,
    base: Hashable,
    robots: int | None = None,
    kinds: Iterable[Kind] | None = None,
    pays: str | None = None,
    both_ways: bool = False,
    max_length: float | None = None,
    name: str | None = None,
    title: str | None = None,
) -> Mission:
    """Make a mission from a table of nodes and a table of arcs.

    Parameters
    ----------
    nodes
        Columns ``label`` and ``reward`` (at least 0), optionally both ``x`` and ``y``, the
        position, where a node may have neither. ``share``, ``pays`` and ``depot`` (true or false,
        yes or no, 1 or 0) are as for `Mission`. Further columns become attributes of the nodes.
    arcs
        Columns ``tail`` and ``head``, labels of nodes, and ``survival`` (in (0, 1]), optionally
        ``length`` (at least 0; an arc without one is 1 long). Further columns become attributes of
        the arcs.
    base
        Label of the base.
    robots
        Team size, at least 1, if all robots are alike.
    kinds
        Kinds of robots, instead of ``robots``. A column such as ``survival:drone`` or
        ``share:drone`` is for the kind of this name only. In a row in which one of these columns of
        survivals is filled, a kind whose cell is empty has the survival in the column ``survival``;
        if that is empty, too, it cannot take the arc. Likewise for shares, which are 1 then.
    pays
        When nodes pay whose cell in the column ``pays`` is empty: on ``"arrival"`` (the default) or
        on ``"return"``.
    both_ways
        Whether every row is an arc in both directions.
    max_length
        Travel budget of every robot, at least 0, in the unit of ``length``; default: none.
    name, title
        Of the mission.

    Returns
    -------
    Mission
        Names of columns may be in upper or lower case and in any order, numbers may be text, and
        text loses the blanks around it.

    Raises
    ------
    MissionError
        If a column is missing, there twice or for an unknown kind, a row has no label, a node or an
        arc is there twice, or the mission is not valid. Lists all faults; rows are named by the
        table and their index.
    TypeError
        If ``nodes`` or ``arcs`` is not a DataFrame.

    Examples
    --------
    >>> import pandas as pd
    >>> from botohe_moo import mission_from_tables
    >>> nodes = pd.DataFrame({"label": ["dock", "reef"], "reward": [0, 5]})
    >>> arcs = pd.DataFrame({"tail": ["dock"], "head": ["reef"], "survival": [0.9]})
    >>> mission_from_tables(nodes, arcs, base="dock", robots=2, both_ways=True)
    <Mission 'mission': 2 nodes, 2 arcs, 2 robots at base 'dock', total reward 5>
    """
    listed, wrong = read_kinds(kinds)
    if faults := [*wrong, *kind_name_faults(listed)]:
        raise MissionError(faults)
    names = [kind.name for kind in listed]
    node_rows, faults = _rows("nodes", nodes, ("label",), "reward", names)
    arc_rows, others = _rows("arcs", arcs, ("tail", "head"), "survival", names)
    if not (node_rows and arc_rows) and (faults := faults + others):
        raise MissionError(faults)
    base = base.strip() if isinstance(base, str) else base
    given: dict[str, Any] = {"base": base, "robots": robots, "kinds": listed or None, "pays": pays}
    given |= {"title": title or None, "max_length": max_length}
    graph_attributes = {key: value for key, value in given.items() if value is not None}
    if both_ways:
        arc_rows = [
            (where, way, row) for where, ends, row in arc_rows for way in (ends, ends[::-1])
        ]
    graph = graph_of(graph_attributes, node_rows, arc_rows, faults + others)
    try:
        return Mission(graph, name=name)
    except MissionError as error:
        faults = list(error.faults)
        if not both_ways and not any(graph.has_edge(head, tail) for tail, head in graph.edges):
            faults.append("no arc leads back; both_ways (--both-ways) makes every row two arcs")
        raise MissionError(faults) from None


def read_table(path: str | os.PathLike[str]) -> pd.DataFrame:
    """Read a CSV file of texts, whose index is the number of each row in a spreadsheet.

    Cells are separated by commas, semicolons or tabs, whichever the first line has most of. Rows
    that are empty are left out. A MissionError names the file and what is wrong with it.
    """
    import pandas as pd

    path = Path(path)
    try:
        text = file_content(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        reason = f"{error}; save it as 'CSV UTF-8', as spreadsheets call it"
        raise MissionError(reason, str(path)) from None
    separator = max(_SEPARATORS, key=text.partition("\n")[0].count)
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    rows = {i: cells for i, cells in enumerate(lines, 1) if any(cell.strip() for cell in cells)}
    if not rows:
        reason = "expected a first row of column names, found an empty file"
        raise MissionError(reason, str(path))
    header = rows.pop(next(iter(rows)))
    whole = {i: cells for i, cells in rows.items() if len(cells) == len(header)}
    index = pd.Index(list(whole), dtype=int)
    table = pd.DataFrame(list(whole.values()), index=index, columns=header, dtype=object)
    table.attrs[_FILE] = str(path)
    table.attrs[FAULTS] = [
        f"{path}, row {i}: expected {len(header)} cells, as the first row has, found {len(cells)}"
        for i, cells in rows.items()
        if i not in whole
    ]
    return table


def _rows(
    table: str, frame: pd.DataFrame, labels: tuple[str, ...], needed: str, kinds: Sequence[str]
) -> tuple[list[Entry], list[str]]:
    """Return the rows that have their labels, and the faults of the table."""
    check_frame(table, frame)
    table = frame.attrs.get(_FILE, table)
    names = [_column_name(str(column)) for column in frame.columns]
    known = {*names, *map(attribute_of, names)}
    wrong = [name for name in (*labels, needed) if name not in known]
    wrong += [name for name in dict.fromkeys(names) if name and names.count(name) > 1]
    found = quoted(", ".join(map(str, frame.columns)))
    by_kind = {name: f", or columns such as '{name}:{kinds[0]}'" for name in BY_KIND if kinds}
    faults = [
        f"{table}: expected one column {quoted(name)}{by_kind.get(name, '')}, found {found}"
        for name in wrong
    ]
    if faults := [*faults, *(f"{table}: {fault}" for fault in column_faults(names, kinds))]:
        return [], faults
    rows: list[Entry] = []
    faults = list(frame.attrs.get(FAULTS, ()))
    cells = frame.astype(object).where(frame.notna(), None)
    for index, *values in cells.itertuples(name=None):
        stripped = [value.strip() if isinstance(value, str) else value for value in values]
        filled = zip(names, stripped, strict=True)
        row = {key: value for key, value in filled if key and value is not None and value != ""}
        where = f"{table}, row {index}"
        if missing := [key for key in labels if key not in row]:
            faults.append(f"{where}: expected {missing[0]}, found nothing")
            continue
        ends = tuple(row.pop(key) for key in labels)
        for key, value in row.items():
            if isinstance(value, str) and (key in _NUMBERS or attribute_of(key)):
                with contextlib.suppress(ValueError):  # what stays text is a fault of the mission
                    row[key] = float(value)
        if "depot" in row:
            row["depot"] = _FLAGS.get(str(row["depot"]).lower(), row["depot"])
        if isinstance(row.get("pays"), str):
            row["pays"] = row["pays"].lower()
        if "x" in row or "y" in row:
            row["pos"] = [row.pop("x", None), row.pop("y", None)]
        rows.append((where, ends, row))
    join_columns(rows, kinds)
    return rows, faults


def _column_name(column: str) -> str:
    """Return a column's name in lower case, apart from the name of a kind."""
    name, colon, kind = column.partition(":")
    name = name.strip().lower()
    return f"{name}:{kind.strip()}" if attribute_of(f"{name}{colon}") else column.strip().lower()
