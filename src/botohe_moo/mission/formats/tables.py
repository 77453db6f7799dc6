"""Missions from two tables, of nodes and of arcs, as planners draw them up."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from botohe_moo._base.checks import as_float, check_frame, quoted
from botohe_moo.mission.formats.files import file_content
from botohe_moo.mission.formats.nodelink import decode, graph_of
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError

if TYPE_CHECKING:
    import pandas as pd

_SEPARATORS = ",;\t"
_Numbers = dict[str, tuple[str, Callable[[float], bool]]]
_OF_NODES: _Numbers = {
    "reward": (">= 0", lambda number: 0 <= number < math.inf),
    "x": ("to be a number", math.isfinite),
    "y": ("to be a number", math.isfinite),
}
_OF_ARCS: _Numbers = {
    "survival": ("in (0, 1]", lambda number: 0 < number <= 1),
    "length": (">= 0", lambda number: 0 <= number < math.inf),
}
_FILE = "botohe_moo file"  # a table's attribute, by which messages name it


def mission_from_tables(
    nodes: pd.DataFrame,
    arcs: pd.DataFrame,
    *,
    base: Hashable,
    robots: int,
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
        position, where a node may have neither. Further columns become attributes of the nodes.
    arcs
        Columns ``tail`` and ``head``, labels of nodes, and ``survival`` (in (0, 1]), optionally
        ``length`` (at least 0; an arc without one is 1 long). Further columns become attributes of
        the arcs.
    base
        Label of the base.
    robots
        Team size, at least 1.
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
        If a column is missing or there twice, a cell does not hold what it should, a node or an arc
        is there twice, or the mission is not valid. Names the table and the row, by its index.
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
    node_rows, faults = _rows("nodes", nodes, ("label", "reward"), _OF_NODES)
    arc_rows, others = _rows("arcs", arcs, ("tail", "head", "survival"), _OF_ARCS)
    if faults := faults + others:
        raise MissionError(faults)
    own = {"base": base.strip() if isinstance(base, str) else base, "robots": robots}
    own |= {"title": title} if title else {}
    own |= {} if max_length is None else {"max_length": max_length}
    of_nodes = [(where, (row.pop("label"),), _with_pos(row)) for where, row in node_rows]
    of_arcs = [(where, (row.pop("tail"), row.pop("head")), row) for where, row in arc_rows]
    if both_ways:
        back = [(where, ends[::-1], row) for where, ends, row in of_arcs]
        of_arcs = [arc for both in zip(of_arcs, back, strict=True) for arc in both]
    graph = graph_of(own, of_nodes, of_arcs)
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
        text = decode(file_content(path), "; save it as 'CSV UTF-8', as spreadsheets call it")
        separator = max(_SEPARATORS, key=text.partition("\n")[0].count)
        lines = enumerate(csv.reader(io.StringIO(text, newline=""), delimiter=separator), 1)
        rows = {i: cells for i, cells in lines if any(cell.strip() for cell in cells)}
        if not rows:
            raise MissionError("expected a first row of column names, found an empty file")
        header = rows.pop(next(iter(rows)))
        faults = [
            f"row {i}: expected {len(header)} cells, as the first row has, found {len(cells)}"
            for i, cells in rows.items()
            if len(cells) != len(header)
        ]
        if faults:
            raise MissionError(faults)
    except csv.Error as error:
        raise MissionError(f"expected a table (CSV), found: {error}", str(path)) from None
    except MissionError as error:
        raise MissionError(list(error.faults), str(path)) from None
    index = pd.Index(list(rows), dtype=int)
    table = pd.DataFrame(list(rows.values()), index=index, columns=header, dtype=object)
    table.attrs[_FILE] = str(path)
    return table


def _rows(
    table: str, frame: pd.DataFrame, needed: tuple[str, ...], numbers: _Numbers
) -> tuple[list[tuple[str, dict[str, Any]]], list[str]]:
    """Return the filled cells of each row, with the words for where it is, and the faults."""
    check_frame(table, frame)
    table = frame.attrs.get(_FILE, table)
    names = [str(column).strip().lower() for column in frame.columns]
    wrong = [name for name in needed if name not in names]
    wrong += [name for name in dict.fromkeys(names) if name and names.count(name) > 1]
    if wrong:
        found = quoted(", ".join(map(str, frame.columns)))
        return [], [f"{table}: expected one column {quoted(name)}, found {found}" for name in wrong]
    rows, faults = [], []
    columns = [[_plain(value) for value in frame.iloc[:, i]] for i in range(len(names))]
    for index, *cells in zip(frame.index, *columns, strict=True):
        filled = zip(names, cells, strict=True)
        row = {key: cell for key, cell in filled if key and cell is not None}
        where = f"{table}, row {index}"
        faults += [f"{where}: expected {key}, found nothing" for key in needed if key not in row]
        for key, (expected, is_valid) in numbers.items():
            if key in row and not is_valid(number := _number(row[key])):
                hint = "; write numbers with a point" if "," in str(row[key]) else ""
                faults.append(f"{where}: expected {key} {expected}, found {quoted(row[key])}{hint}")
            elif key in row:
                row[key] = number
        if ("x" in row) != ("y" in row):
            faults.append(f"{where}: expected both x and y or neither, found one")
        rows.append((where, row))
    return rows, faults


def _plain(value: Any) -> Any:
    """Return text without the blanks around it, Python's own numbers, and None for nothing."""
    import pandas as pd

    if isinstance(value, str):
        return value.strip() or None
    if pd.api.types.is_scalar(value) and pd.isna(value):
        return None
    return value.item() if isinstance(value, np.generic) else value


def _number(value: Any) -> float:
    """Convert a number or its text; NaN for anything else."""
    try:
        return float(value) if isinstance(value, str) else as_float(value)
    except ValueError:
        return math.nan


def _with_pos(row: dict[str, Any]) -> dict[str, Any]:
    if "x" in row:
        row["pos"] = [row.pop("x"), row.pop("y")]
    return row
