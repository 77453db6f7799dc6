"""From two tables to a mission: the one way for files of all formats, and for tables themselves."""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import lt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import networkx as nx

from botohe_moo._base.checks import ParameterError, as_float, check_frame, most_alike, quoted
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative, Positive
from botohe_moo.mission.arrays import distance_of, plain_numbers
from botohe_moo.mission.formats.reading import Draft, Row, Source
from botohe_moo.mission.hazards import Raster, mean_rate, read_zones, seen_from, survived
from botohe_moo.mission.model import Mission
from botohe_moo.mission.rules import (
    BY_KIND,
    Kind,
    MissionError,
    attribute_faults,
    attribute_of,
    kind_name_faults,
    read_kinds,
    read_label,
)

if TYPE_CHECKING:
    import pandas as pd

_Path = str | os.PathLike[str]

FLAGS = dict.fromkeys(("true", "yes", "1", "1.0"), True)
FLAGS |= dict.fromkeys(("false", "no", "0", "0.0"), False)
_MOST_NAMED = 5
_SEPARATORS = ",;\t"
_FILE, FAULTS = "botohe_moo file", "botohe_moo faults"  # attributes of tables read from files


@checked
def make_mission(
    draft: Draft,
    *,
    name: str | None = None,
    base: Any = None,
    robots: Any = None,
    kinds: Any = None,
    pays: Any = None,
    both_ways: bool = False,
    danger: NotNegative | None = None,
    hazard: _Path | None = None,
    danger_zones: Any = (),
    reward: NotNegative | None = None,
    interest: _Path | None = None,
    sight: Positive | None = None,
    geographic: bool | None = None,
) -> Mission:
    """Make a mission of what a reader has found; :func:`read_mission` describes the options.

    A MissionError lists what breaks a rule, in the rows and in the options. A warning names what is
    left out, and which defaults were used.
    """
    if not draft.directed and not both_ways:
        raise MissionError("expected directed arcs, found undirected edges: give both_ways")
    for option, path in {"hazard": hazard, "interest": interest}.items():
        if path is not None and (not path or not isinstance(path, str | os.PathLike)):
            raise ParameterError(f"Expected {option} to be a path, got {quoted(path)}.", option)
    given = {"base": base, "kinds": kinds, "pays": pays, "geographic": geographic}
    site = _Site(draft, {key: value for key, value in given.items() if value is not None})
    if kinds is not None:
        site.graph.pop("robots", None)
    if both_ways:
        site.open_both_ways()
    site.add_lengths()
    site.add_rewards(reward, interest, sight)
    site.add_survivals(danger, hazard, danger_zones)
    graph = site.as_graph()
    if len(graph) == 1 < len(draft.nodes):
        node, arc = draft.words
        hint = "" if both_ways else f"; both_ways makes every {arc} passable both ways"
        at = quoted(graph.graph["base"])
        expected = f"a {node} that can be reached from base {at} and left again"
        raise MissionError(f"expected {expected}, found none{hint}")
    try:
        mission = Mission(graph, robots=robots, name=name)
    except MissionError as error:
        faults = list(error.faults)
        is_one_way = not any(graph.has_edge(head, tail) for tail, head in graph.edges)
        if graph.edges and is_one_way and not nx.is_strongly_connected(graph):
            faults.append("no arc leads back; both_ways makes every arc passable both ways")
        raise MissionError(faults) from None
    if site.notes:
        warnings.warn(" ".join(site.notes), stacklevel=2)
    return mission


class _Site:
    """The two tables of a file, while a mission is made of them."""

    def __init__(self, draft: Draft, given: Mapping[str, Any]) -> None:
        self.draft = draft
        self.faults, self.notes, self.left_out = [*draft.faults], [*draft.notes], {**draft.left_out}
        self.nodes, self.arcs = (
            [Row(where, tuple(map(read_label, ends)), _plain(own)) for where, ends, own in rows]
            for rows in (draft.nodes, draft.arcs)
        )
        self.at = {label: attributes for _, (label,), attributes in self.nodes}
        self.graph = _plain({**draft.graph, **given})
        self.base = self.graph.get("base")
        if self.base is not None:
            self.base = self.graph["base"] = find_label(self.base, self.at)
        self.kinds = self._read_kinds()
        for rows in (self.nodes, self.arcs):
            if faults := _join_columns(rows, [kind.name for kind in self.kinds]):
                raise MissionError(faults)
        self.places = {
            label: place
            for label, attributes in self.at.items()
            if (place := plain_numbers(attributes.get("pos"))).shape == (2,)
        }

    def _read_kinds(self) -> list[Kind]:
        kinds = self.graph.get("kinds")
        if isinstance(kinds, list | tuple):
            kinds = [_plain(kind) if isinstance(kind, Mapping) else kind for kind in kinds]
        listed, wrong = read_kinds(kinds)
        if faults := [*wrong, *kind_name_faults(listed)]:
            raise MissionError(faults)
        found = []
        for kind in listed:
            ends: dict[str, Any] = {
                end: find_label(label, self.at)
                for end in ("start", "end")
                if (label := getattr(kind, end)) is not None
            }
            if isinstance(kind.aboard, list | tuple):
                ends["aboard"] = tuple(find_label(label, self.at) for label in kind.aboard)
            found.append(replace(kind, **ends))
        if found:
            self.graph["kinds"] = found
        return found

    def open_both_ways(self) -> None:
        """Add an arc back for each arc that has none, with the same attributes."""
        known = {ends for _, ends, _ in self.arcs}
        back = [Row(where, ends[::-1], {**attributes}) for where, ends, attributes in self.arcs]
        self.arcs += [arc for arc in back if arc.labels not in known]

    def add_lengths(self) -> None:
        """Give arcs a length that are straight, or that will get a survival by it."""
        distance = distance_of(self.graph)
        for _, (tail, head), attributes in self.arcs:
            is_placed = tail in self.places and head in self.places
            if is_placed and (self.draft.straight or "survival" not in attributes):
                length = distance(self.places[tail], self.places[head])
                attributes.setdefault("length", length)

    def add_rewards(
        self, reward: float | None, interest: _Path | None, sight: float | None
    ) -> None:
        """Give nodes without one a reward; cells that are nearest to the base count for none."""
        default, seen = 1.0 if reward is None else reward, {}
        if (interest is None) != (sight is None):
            expected = "interest, a map, and sight, how far robots see on it, or none"
            raise MissionError(f"expected {expected}")
        if interest is not None and sight is not None:
            seen = seen_from(self.places, _raster(interest), sight, default)
        if self.base in self.at:
            self.at[self.base].setdefault("reward", 0.0)
        lacking = [label for label, attributes in self.at.items() if "reward" not in attributes]
        for label in lacking:
            self.at[label]["reward"] = seen.get(label, default)
        if reward is None and interest is None and len(lacking) < len(self.at) - 1:
            self.notes += [
                f"{named}; set reward to change it."
                for named in _named("These nodes have no reward and get 1", map(quoted, lacking))
            ]

    def add_survivals(
        self, danger: float | None, hazard: _Path | None, danger_zones: object
    ) -> None:
        """Give arcs without one the survival exp(−length · mean rate between their ends)."""
        if not isinstance(danger_zones, list | tuple):
            raise MissionError(f"expected danger_zones to be a list, got {quoted(danger_zones)}")
        zones = [*self.draft.zones, *read_zones(danger_zones, "danger_zones")]
        for _, (tail, head), attributes in self.arcs:
            if tail == head:
                attributes.setdefault("survival", 1.0)  # the loop is the fault, or is left out
        lacking = [arc for arc in self.arcs if "survival" not in arc.attributes]
        if not lacking and (danger is not None or hazard is not None or zones):
            self.notes.append("All arcs have a survival: danger, hazard and zones change none.")
        if lacking and danger is None and (hazard is not None or not zones):
            found = f"expected a survival, found none ({len(lacking)} without one)"
            remedy = "give danger, the rate of loss for a unit of length"
            self.faults.append(f"{_named_arc(lacking[0])}: {found}: {remedy}")
        raster = None if hazard is None else _raster(hazard)
        rate = mean_rate(danger or 0.0, raster, zones)
        for arc in lacking:
            named, ends, length = _named_arc(arc), arc.labels, arc.attributes.get("length", 1.0)
            arc.attributes["survival"] = 1.0  # so that a fault is listed once
            missing = [quoted(end) for end in ends if end not in self.places]
            if missing and (raster or zones):
                self.faults.append(f"{named}: expected pos [x, y] of {missing[0]}, found none")
                continue
            mean = danger or 0.0 if missing else rate(*(self.places[end] for end in ends))
            try:
                length = as_float(length)
                arc.attributes["survival"] = survived(mean * length, named, length=length)
            except ValueError as error:
                self.faults.append(str(error).rstrip("."))

    def as_graph(self) -> nx.DiGraph[Any]:
        """Return the graph; a MissionError lists all faults if there are any."""
        if self.draft.trim:
            self._drop_reserved()
        graph: nx.DiGraph[Any] = nx.DiGraph()
        graph.graph.update(self.graph)
        for where, (label,), attributes in self.nodes:
            if label in graph:
                self.faults.append(f"{where}: node {quoted(label)} is listed more than once")
            graph.add_nodes_from([(label, attributes)])
        loops, parallel = [], []
        kept: dict[tuple[Any, ...], Row] = {}
        for arc in self.arcs:
            named = _named_arc(arc)
            unknown = [label for label in dict.fromkeys(arc.labels) if label not in graph]
            self.faults += [f"{named}: there is no node {quoted(label)}" for label in unknown]
            rival = kept.setdefault(arc.labels, arc)
            if self.draft.trim and arc.labels[0] == arc.labels[1]:
                loops.append(arc.where)
            elif self.draft.trim and rival is not arc:
                survivals = (as_float(one.attributes["survival"]) for one in (rival, arc))
                kept[arc.labels], worse = (arc, rival) if lt(*survivals) else (rival, arc)
                parallel.append(worse.where)
            elif rival is not arc:
                self.faults.append(f"{named}: is listed more than once")
        arcs = [arc for arc in kept.values() if all(label in graph for label in arc.labels)]
        graph.add_edges_from((*arc.labels, arc.attributes) for arc in arcs)
        if self.faults:
            if self.base is None:
                self.faults.append("expected base, the label of a node, found none: give base")
            raise MissionError([*self.faults, *attribute_faults(graph, self.kinds)])
        if self.draft.trim:
            self._trim(graph, loops, parallel)
        return graph

    def _drop_reserved(self) -> None:
        """Leave out attributes with the names that labels have in mission files."""
        self.left_out["attributes id, source and target, which are labels in mission files"] = [
            row.where
            for rows, names in ((self.nodes, ("id",)), (self.arcs, ("source", "target")))
            for row in rows
            if [row.attributes.pop(name) for name in names if name in row.attributes]
        ]

    def _trim(self, graph: nx.DiGraph[Any], loops: list[str], parallel: list[str]) -> None:
        """Leave out what cannot be part of a mission, and note it."""
        node, arc = self.draft.words
        graph.remove_edges_from(list(nx.selfloop_edges(graph)))
        lost = []
        ends = [kind.ends(self.base) for kind in self.kinds] or [(self.base, self.base)]
        if all(label in graph for label in {self.base}.union(*ends)):  # if not, that is the fault
            joined = {self.base}
            for start, end in ends:
                reached = {start} | nx.descendants(graph, start)
                joined |= reached & ({end} | nx.ancestors(graph, end))
            lost = [label for label in graph if label not in joined]
        graph.remove_nodes_from(lost)
        left_out = {
            **self.left_out,
            f"{arc}s from a {node} to itself": loops,
            f"{arc}s parallel to one that is at least as safe": parallel,
            f"{node}s that the base does not reach, or that have no way back": map(quoted, lost),
        }
        if said := [text for what, names in left_out.items() for text in _named(what, names)]:
            self.notes.insert(0, f"Left out {'; '.join(said)}.")


def _number(value: Any) -> Any:
    """Return the number that a text is, alone or for each kind; anything else as it is."""
    if isinstance(value, Mapping):
        return {kind: _number(number) for kind, number in value.items()}
    if isinstance(value, list | tuple):
        return [_number(number) for number in value]
    for number in (int, float) if isinstance(value, str) else ():
        with suppress(ValueError):  # text that stays text breaks a rule
            return number(value)
    return value


# How attributes are read that are written as texts.
_READ: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("reward", "share", "survival", "length", "pos"), _number),
    **dict.fromkeys(("robots", "min_survival", "max_length"), _number),
    "depot": lambda value: FLAGS.get(str(value).lower(), value),
    "pays": lambda value: value.lower() if isinstance(value, str) else value,
}


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes with numbers and flags for texts, and their names in lower case."""
    plain = {}
    for name, value in attributes.items():
        lower = str(name).lower()
        key = lower if lower in _READ and lower not in attributes else name
        read = _READ.get(attribute_of(str(name)) or key)
        if read is None:
            plain[name] = value
        elif value is not None:  # null is an empty cell
            plain[key] = read(value)
    return plain


def find_label(given: Any, labels: Mapping[Any, Mapping[str, Any]]) -> Hashable:
    """Return the node that is meant: a label, a text that is written like one, or a node's name.

    ``labels`` has the attributes of each node. What names no node is returned as a label; a
    ValueError says why it cannot be one.
    """
    label = read_label(given)
    if label in labels:
        return label
    text = _text(label)
    numbers: list[Any] = []
    with suppress(ValueError):
        numbers.append(float(text))
    with suppress(ValueError):
        numbers += [read_label(json.loads(text))] if text.startswith("[") else []
    named: dict[Any, Hashable] = {}
    for known, attributes in labels.items():
        if _text(known) == text or (known in numbers and not isinstance(known, bool)):
            return known  # type: ignore[no-any-return]
        if text in (attributes.get("name"), attributes.get("label")):
            named[known] = known
    return next(iter(named)) if len(named) == 1 else label


def _text(label: Hashable) -> str:
    return json.dumps(label) if isinstance(label, bool) else str(label)


def _join_columns(rows: Sequence[Row], kinds: Sequence[str]) -> list[str]:
    """Replace columns for one kind by mappings from kinds to numbers; return what is wrong.

    Where another kind's cell is filled, an empty cell has the number in the column for all kinds.
    If that is empty, too, a kind cannot take the arc.
    """
    columns = {
        key: row.where for row in reversed(rows) for key in row.attributes if attribute_of(key)
    }
    for name in BY_KIND:
        of_kind = {c: c.partition(":")[2] for c in columns if attribute_of(c) == name}
        faults = [
            f"{columns[column]}: column {quoted(column)}: there is no kind {quoted(kind)}"
            f"{most_alike(kind, kinds) or '; the mission lists no kinds'}"
            for column, kind in of_kind.items()
            if kind not in kinds
        ]
        if of_kind and name == "survival" and not any(name in row.attributes for row in rows):
            missing = [f"{name}:{kind}" for kind in kinds if f"{name}:{kind}" not in columns]
            where = next(iter(columns.values()))
            faults = faults or [
                f"{where}: expected a column {quoted(one)}, found none" for one in missing
            ]
        if faults:
            return faults
        for _, _, attributes in rows:
            numbers = {of_kind[c]: attributes.pop(c) for c in of_kind if c in attributes}
            if numbers and (name in attributes or name == "survival"):
                numbers = dict.fromkeys(kinds, attributes.get(name, 0.0)) | numbers
            if numbers:
                attributes[name] = {kind: numbers[kind] for kind in kinds if kind in numbers}
    return []


def _named_arc(arc: Row) -> str:
    return f"{arc.where}: arc {quoted(arc.labels[0])} -> {quoted(arc.labels[1])}"


def _raster(path: _Path) -> Raster:
    # Imported late: it takes time, and most missions need no images.
    from botohe_moo.mission.formats.maps import read_raster

    return read_raster(path)


def _named(what: str, names: Iterable[str]) -> list[str]:
    """Return a text that names some things once each, if there are any."""
    listed = list(dict.fromkeys(names))
    shown = ", ".join(listed[:_MOST_NAMED]) + ", …" * (len(listed) > _MOST_NAMED)
    return [f"{what}: {shown} ({len(listed)} in all)"] if listed else []


def mission_from_tables(
    nodes: pd.DataFrame,
    arcs: pd.DataFrame,
    *,
    base: Hashable,
    robots: int | None = None,
    kinds: Iterable[Kind] | None = None,
    max_length: float | None = None,
    title: str | None = None,
    **options: Any,
) -> Mission:
    """Make a mission from a table of nodes and a table of arcs.

    Parameters
    ----------
    nodes
        The column ``label``, optionally ``reward`` (at least 0), both ``x`` and ``y``, the
        position, where a node may have neither, and ``share``, ``pays`` and ``depot`` (true or
        false, yes or no, 1 or 0) as for `Mission`. Further columns become attributes of the nodes.
    arcs
        Columns ``tail`` and ``head``, labels of nodes, optionally ``survival`` (in (0, 1]) and
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
    max_length
        Travel budget of every robot, at least 0, in the unit of ``length``; default: none.
    title
        Title of the mission, for pictures.
    options
        ``name``, and what files of all formats take, such as ``both_ways``, ``pays``, ``danger``
        and ``reward``: :func:`botohe_moo.mission.read_mission`.

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
    node_rows, faults = _rows("nodes", nodes, ("label",))
    arc_rows, others = _rows("arcs", arcs, ("tail", "head"))
    if (faults := faults + others) and not (node_rows and arc_rows):
        raise MissionError(faults)
    given = {"title": title or None, "max_length": max_length, "robots": robots}
    graph = {key: value for key, value in given.items() if value is not None}
    base = base.strip() if isinstance(base, str) else base
    draft = Draft(node_rows, arc_rows, graph, faults)
    return make_mission(draft, base=base, kinds=kinds, **options)


def read_table(path: _Path) -> pd.DataFrame:
    """Read a CSV file of texts, whose index is the number of each row in a spreadsheet.

    Cells are separated by commas, semicolons or tabs: by what a first line such as ``sep=;`` says,
    or by what the header has most of. Empty rows are left out. A MissionError names the file and
    what is wrong with it.
    """
    import pandas as pd

    path = Path(path)
    try:
        text = Source(path).text
    except UnicodeDecodeError as error:
        reason = f"{error}; save it as 'CSV UTF-8', as spreadsheets call it"
        raise MissionError(reason, str(path)) from None
    first, _, rest = text.lstrip().partition("\n")
    separator = max(_SEPARATORS, key=first.count)
    if (said := first.strip('"\r').lower()) in (f"sep={mark}" for mark in _SEPARATORS):  # of Excel
        text, separator = f"\n{rest}", said[4]
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        rows = {i: cells for i, cells in enumerate(lines, 1) if any(map(str.strip, cells))}
    except csv.Error as error:  # such as a quote that does not end
        raise MissionError(f"line {lines.line_num}: {error}", str(path)) from None
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


def _rows(table: str, frame: pd.DataFrame, labels: tuple[str, ...]) -> tuple[list[Row], list[str]]:
    """Return the rows that have their labels, and the faults of the table."""
    check_frame(table, frame)
    table = frame.attrs.get(_FILE, table)
    names = [_column_name(str(column)) for column in frame.columns]
    wrong = [name for name in labels if name not in names]
    wrong += [name for name in dict.fromkeys(names) if name and names.count(name) > 1]
    if wrong:
        found = quoted(", ".join(map(str, frame.columns)))
        return [], [f"{table}: expected one column {quoted(name)}, found {found}" for name in wrong]
    rows: list[Row] = []
    faults = list(frame.attrs.get(FAULTS, ()))
    cells = frame.astype(object).where(frame.notna(), None)
    for index, *values in cells.itertuples(name=None):
        stripped = (value.strip() if isinstance(value, str) else value for value in values)
        filled = zip(names, stripped, strict=True)
        row = {key: value for key, value in filled if key and not _is_empty(value)}
        where = f"{table}, row {index}"
        if missing := [key for key in labels if key not in row]:
            faults.append(f"{where}: expected {missing[0]}, found nothing")
            continue
        ends = tuple(row.pop(key) for key in labels)
        if "x" in row or "y" in row:
            row["pos"] = [row.pop("x", None), row.pop("y", None)]
        rows.append(Row(where, ends, row))
    return rows, faults


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str) and not value)


def _column_name(column: str) -> str:
    """Return a column's name in lower case, apart from the name of a kind."""
    name, colon, kind = column.partition(":")
    name = name.strip().lower()
    return f"{name}:{kind.strip()}" if attribute_of(f"{name}{colon}") else column.strip().lower()
