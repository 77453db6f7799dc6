"""Missions from two tables, of nodes and of arcs, as planners draw them up."""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Callable, Hashable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, check_frame, quoted
from botohe_moo.mission.formats.files import file_content
from botohe_moo.mission.formats.nodelink import decode
from botohe_moo.mission.model import Mission
from botohe_moo.mission.validation import MissionError, mission_faults

if TYPE_CHECKING:
    import pandas as pd

_NODES, _ARCS = ("label", "reward"), ("tail", "head", "survival")
_SEPARATORS = ",;\t"
_SHOWN = 12  # columns of a message
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
        is there twice, or the mission is not valid. Names the table, the row by its index and the
        column; every fault is listed.
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
    faults: list[str] = []
    node_rows = list(_rows("nodes", nodes, _NODES, faults))
    arc_rows = list(_rows("arcs", arcs, _ARCS, faults))
    if faults:
        raise MissionError(faults)
    graph: nx.DiGraph[Any] = nx.DiGraph(base=_stripped(base), robots=robots)
    own = {"title": title or None, "max_length": max_length}
    graph.graph.update((key, value) for key, value in own.items() if value is not None)
    known: dict[Hashable, str] = {}
    for where, row in node_rows:
        _add_node(graph, known, where, row, faults)
    drawn: dict[tuple[Hashable, Hashable], str] = {}
    for where, row in arc_rows:
        _add_arc(graph, drawn, where, row, both_ways, faults)
    if faults:
        faults += mission_faults(graph, graph.graph["base"], robots, ways=False)
        raise MissionError(list(dict.fromkeys(faults)))
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
        widths = {len(cells) for cells in rows.values()}
        if len(faults) == len(rows) > 1 == len(widths):
            found = f"found {widths.pop()} in all others"
            faults = [f"expected {len(header)} cells, as the first row has, {found}"]
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


_Row = dict[str, Any]


def _rows(
    table: str, frame: pd.DataFrame, needed: tuple[str, ...], faults: list[str]
) -> Iterator[tuple[str, _Row]]:
    """Give each row with the words for where it is; none if a column is missing or there twice."""
    check_frame(table, frame)
    table = frame.attrs.get(_FILE, table)
    names = [str(column).strip().lower() for column in frame.columns]
    found = ", ".join(quoted(str(column))[1:-1] for column in frame.columns[:_SHOWN]) or "none"
    found += f" and {more} more" if (more := len(names) - _SHOWN) > 0 else ""
    wrong = [f"a column {quoted(name)}, found {found}" for name in needed if name not in names]
    wrong += [
        f"one column {quoted(name)}, found {names.count(name)}"
        for name in dict.fromkeys(names)
        if names.count(name) > 1 and name
    ]
    wrong += [
        f"both columns 'x' and 'y' or neither, found only {quoted(name)}"
        for name, other in ("xy", "yx")
        if name in names and other not in names
    ]
    if wrong:
        faults += [f"{table}: expected {fault}" for fault in wrong]
        return
    columns = [[_plain(value) for value in frame.iloc[:, i]] for i in range(len(names))]
    for index, *values in zip(frame.index, *columns, strict=True):
        row = {name: value for name, value in zip(names, values, strict=True) if name}
        yield f"{table}, row {index}", row


def _plain(value: Any) -> Any:
    """Give text without the blanks around it, Python's own numbers, and None for nothing."""
    import pandas as pd

    if isinstance(value, str):
        return value.strip() or None
    if pd.api.types.is_scalar(value) and pd.isna(value):
        return None
    return value.item() if isinstance(value, np.generic) else value


def _stripped(label: Hashable) -> Hashable:
    return label.strip() if isinstance(label, str) else label


def _hashable(value: object) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True


def _add_node(
    graph: nx.DiGraph[Any], known: dict[Hashable, str], where: str, row: _Row, faults: list[str]
) -> None:
    label = row.pop("label")
    if label is None:
        faults.append(f"{where}, column 'label': expected the label of a node, found nothing")
        return
    if not _hashable(label):
        faults.append(
            f"{where}, column 'label': expected the label of a node, found {quoted(label)}"
        )
        return
    if label in known:
        found = f"node {quoted(label)} is listed more than once, first in {known[label]}"
        faults.append(f"{where}: {found}")
        return
    known[label] = _row_of(where)
    reward = _number(row, "reward", where, _at_least_0, "a number >= 0", faults)
    place = [row.pop(axis, None) for axis in ("x", "y")]
    attributes: _Row = {key: value for key, value in row.items() if value is not None}
    if place != [None, None]:
        cells = dict(zip("xy", place, strict=True))
        pos = [_number(cells, axis, where, math.isfinite, "a number", faults) for axis in "xy"]
        attributes["pos"] = pos
    graph.add_node(label, **{**attributes, "reward": reward})


def _add_arc(
    graph: nx.DiGraph[Any],
    drawn: dict[tuple[Hashable, Hashable], str],
    where: str,
    row: _Row,
    both_ways: bool,
    faults: list[str],
) -> None:
    ends = row.pop("tail"), row.pop("head")
    known = True
    for column, label in zip(("tail", "head"), ends, strict=True):
        if label not in graph:
            found = "nothing" if label is None else f"{quoted(label)}, which no row of nodes has"
            faults.append(
                f"{where}, column {column!r}: expected the label of a node, found {found}"
            )
            known = False
    survival = _number(row, "survival", where, _in_0_1, "a number in (0, 1]", faults)
    if row.get("length") is not None:
        row["length"] = _number(row, "length", where, _at_least_0, "a number >= 0", faults)
    if known and ends[0] == ends[1]:
        found = f"found both ends at {quoted(ends[0])}"
        faults.append(f"{where}: expected an arc between two nodes, {found}")
        known = False
    if not known:
        return
    attributes = {key: value for key, value in row.items() if value is not None}
    for tail, head in dict.fromkeys((ends, ends[::-1]) if both_ways else (ends,)):
        if (tail, head) in drawn:
            before = drawn[tail, head]
            arc = f"arc {quoted(tail)} -> {quoted(head)}"
            faults.append(f"{where}: {arc} is there already, in {before}")
            continue
        drawn[tail, head] = _row_of(where)
        graph.add_edge(tail, head, **{**attributes, "survival": survival})


def _row_of(where: str) -> str:
    return f"row {where.rpartition(', row ')[2]}"


def _in_0_1(number: float) -> bool:
    return 0 < number <= 1


def _at_least_0(number: float) -> bool:
    return 0 <= number < math.inf


def _number(
    row: _Row,
    column: str,
    where: str,
    valid: Callable[[float], bool],
    expected: str,
    faults: list[str],
) -> float:
    """Take a number out of a row; what is not one is a fault, and gives a harmless number."""
    value = row.pop(column)
    try:
        number = float(value) if isinstance(value, str) else as_float(value)
    except ValueError:
        number = math.nan
    if valid(number):
        return number
    found = "nothing" if value is None else quoted(value)
    hint = "; write numbers with a point" if isinstance(value, str) and "," in value else ""
    faults.append(f"{where}, column {column!r}: expected {expected}, found {found}{hint}")
    return 1.0
