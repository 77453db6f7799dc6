"""From two tables to a mission: the one way for files of all formats, and for tables themselves."""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from operator import lt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import as_float, check_frame, most_alike, quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._plugins.checks import checked
from botohe_moo._plugins.types import NotNegative, Positive
from botohe_moo.mission.arrays import distance_of, plain_numbers
from botohe_moo.mission.formats.reading import Draft, Row, file_content
from botohe_moo.mission.hazards import (
    Zone,
    in_cells,
    mean_along,
    read_zones,
    rewards_from_raster,
    survived,
)
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

    from botohe_moo.mission.formats.maps import Raster

_Path = str | os.PathLike[str]
_Nodes = Mapping[Any, dict[str, Any]]  # attributes of nodes, by their labels
_Places = Mapping[Any, tuple[float, float]]

# Texts of these attributes are read as numbers, and texts that are read as true and false.
_NUMBERS = {"reward", "share", "survival", "length", "max_length", "min_survival", "robots"}
_FLAGS = dict.fromkeys(("true", "yes", "1", "1.0"), True)
_FLAGS |= dict.fromkeys(("false", "no", "0", "0.0"), False)
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
    left out.
    """
    if not draft.directed and not both_ways:
        raise MissionError("expected directed arcs, found undirected edges: give both_ways")
    nodes, arcs = ([_plain(row) for row in rows] for rows in (draft.nodes, draft.arcs))
    labels = {label: attributes for _, (label,), attributes in nodes}
    given = {"base": base, "kinds": kinds, "pays": pays, "geographic": geographic}
    graph = _numbers(draft.graph) | {
        key: value for key, value in given.items() if value is not None
    }
    listed = _read_team(graph, labels, replaces=kinds is not None)
    faults = [*draft.faults, *_join_columns(nodes, listed), *_join_columns(arcs, listed)]
    if both_ways:
        one_way = {ends for _, ends, _ in arcs}
        back = [Row(where, ends[::-1], {**attributes}) for where, ends, attributes in arcs]
        arcs += [arc for arc in back if arc.labels not in one_way]
    places = _add_lengths(draft, labels, arcs, graph)
    notes = [*draft.notes]
    notes += _add_rewards(labels, places, graph.get("base"), reward, interest, sight)
    zones = [*draft.zones, *_listed_zones(danger_zones)]
    notes += _add_survivals(arcs, places, faults, danger=danger, hazard=hazard, zones=zones)
    if draft.trim:
        nodes, arcs, left_out = _trimmed(draft, graph.get("base"), nodes, arcs)
        notes = [*left_out, *notes]
    made = _graph(graph, nodes, arcs, listed, faults)
    if len(made) == 1 < len(labels):
        node, arc = draft.words
        hint = "" if both_ways else f"; both_ways makes every {arc} passable both ways"
        base = quoted(made.graph["base"])
        expected = f"a {node} that can be reached from base {base} and left again"
        raise MissionError(f"expected {expected}, found none{hint}")
    if notes:
        warnings.warn(" ".join(notes), stacklevel=2)
    try:
        return Mission(made, robots=robots, name=name)
    except MissionError as error:
        faults = list(error.faults)
        is_one_way = not any(made.has_edge(head, tail) for tail, head in made.edges)
        if made.edges and is_one_way and not nx.is_strongly_connected(made):
            faults.append("no arc leads back; both_ways makes every arc passable both ways")
        raise MissionError(faults) from None


def _plain(row: Row) -> Row:
    return Row(row.where, row.labels, _numbers(row.attributes))


def _numbers(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes with numbers, flags and names that are written as texts."""
    plain: dict[str, Any] = {}
    for name, value in attributes.items():
        if name in _NUMBERS or attribute_of(name):
            plain[name] = _number(value)
        elif name == "pos" and isinstance(value, list | tuple):
            plain[name] = [_number(part) for part in value]
        elif name == "depot":
            plain[name] = _FLAGS.get(str(value).lower(), value)
        elif name == "pays" and isinstance(value, str):
            plain[name] = value.lower()
        else:
            plain[name] = value
    return plain


def _number(value: Any) -> Any:
    """Return the number that a text is, alone or for each kind; anything else as it is."""
    if isinstance(value, Mapping):
        return {kind: _number(number) for kind, number in value.items()}
    for number in (int, float) if isinstance(value, str) else ():
        with suppress(ValueError):  # text that stays text breaks a rule
            return number(value)
    return value


def find_label(given: Any, labels: _Nodes) -> Hashable:
    """Return the node that is meant: a label, a text that is written like one, or a node's name.

    ``labels`` has the attributes of each node. What names no node is returned as a label, or a
    ValueError says why it cannot be one.
    """
    label = read_label(given)
    if label in labels:
        return label
    text = _text(label)
    values: list[Any] = []
    with suppress(ValueError):
        values.append(float(text))
    with suppress(ValueError):  # a list as JSON, as it stands in a file
        values.append(read_label(json.loads(text)) if text.startswith("[") else text)
    for known in labels:
        if _text(known) == text or (not isinstance(known, bool) and known in values):
            return known  # type: ignore[no-any-return]
    named = [k for k, of in labels.items() if text in (of.get("name"), of.get("label"))]
    return named[0] if len(named) == 1 else label


def _text(label: Hashable) -> str:
    return json.dumps(label) if isinstance(label, bool) else str(label)


def _read_team(graph: dict[str, Any], labels: _Nodes, *, replaces: bool) -> tuple[Kind, ...]:
    """Read the base and the kinds of robots among the attributes of a graph."""
    if replaces:
        graph.pop("robots", None)
    if graph.get("base") is not None:
        graph["base"] = find_label(graph["base"], labels)
    kinds = graph.get("kinds")
    if isinstance(kinds, list | tuple):
        kinds = [_numbers(kind) if isinstance(kind, Mapping) else kind for kind in kinds]
    listed, wrong = read_kinds(kinds)
    if faults := [*wrong, *kind_name_faults(listed)]:
        raise MissionError(faults)
    found = []
    for kind in listed:
        ends = {end: getattr(kind, end) for end in ("start", "end")}
        ends = {end: find_label(at, labels) for end, at in ends.items() if at is not None}
        aboard = kind.aboard
        if isinstance(aboard, list | tuple):
            aboard = tuple(find_label(label, labels) for label in aboard)
        found.append(replace(kind, aboard=aboard, **ends))
    if found:
        graph["kinds"] = found
    return tuple(found)


def _join_columns(rows: Sequence[Row], kinds: Sequence[Kind]) -> Iterator[str]:
    """Replace columns for one kind by mappings from kinds to numbers; list what is wrong.

    Where another kind's cell is filled, an empty cell has the number in the column for all kinds.
    If that is empty, too, a kind cannot take the arc.
    """
    names = [kind.name for kind in kinds]
    columns = {
        key: row.where for row in reversed(rows) for key in row.attributes if attribute_of(key)
    }
    for column, where in columns.items():
        if (kind := column.partition(":")[2]) not in names:
            near = most_alike(kind, names) or "; the mission lists no kinds"
            yield f"{where}: column {quoted(column)}: there is no kind {quoted(kind)}{near}"
    of_survival = [column for column in columns if attribute_of(column) == "survival"]
    if of_survival and not any("survival" in row.attributes for row in rows):
        for kind in names:
            if (column := f"survival:{kind}") not in columns:
                yield f"{columns[of_survival[0]]}: expected a column {quoted(column)}, found none"
    for _, _, attributes in rows if columns else ():
        for name in BY_KIND:
            own = [column for column in columns if attribute_of(column) == name]
            numbers = {c.partition(":")[2]: attributes.pop(c) for c in own if c in attributes}
            if numbers:
                default = {"survival": 0.0} | attributes
                numbers = dict.fromkeys(names, default.get(name)) | numbers
                attributes[name] = {k: numbers[k] for k in names if numbers[k] is not None}


def _add_lengths(
    draft: Draft,
    labels: _Nodes,
    arcs: Iterable[Row],
    graph: Mapping[str, Any],
) -> _Places:
    """Give arcs a length that are straight or get a survival by it; return where nodes are."""
    places = {
        label: (float(place[0]), float(place[1]))
        for label, attributes in labels.items()
        if (place := plain_numbers(attributes.get("pos"))).shape == (2,)
    }
    distance = distance_of(graph)
    for _, (tail, head), attributes in arcs:
        is_placed = tail in places and head in places
        if is_placed and (draft.straight or "survival" not in attributes):
            attributes.setdefault("length", distance(places[tail], places[head]))
    return places


def _add_rewards(
    labels: _Nodes,
    places: _Places,
    base: Any,
    reward: float | None,
    interest: _Path | None,
    sight: float | None,
) -> Iterator[str]:
    """Give nodes without one a reward, 0 to the base; yield what there is to say about it.

    Cells of a map that are nearest to the base count for no node.
    """
    default, seen = 1.0 if reward is None else reward, {}
    if (interest is None) != (sight is None):
        raise MissionError("expected interest, a map, and sight, how far robots see on it, or none")
    if interest is not None and sight is not None:
        values, resolution, origin, *_ = _raster(interest)
        site: nx.DiGraph[Any] = nx.DiGraph()
        site.add_nodes_from((label, {"pos": place}) for label, place in places.items())
        seen = rewards_from_raster(
            site, values, resolution=resolution, origin=origin, radius=sight, scale=default
        )
    lacking = [at for at, row in labels.items() if "reward" not in row and at != base]
    for label in lacking:
        labels[label]["reward"] = seen.get(label, default)
    if base in labels:
        labels[base].setdefault("reward", 0.0)
    if reward is None and not seen and 0 < len(lacking) < len(labels) - 1:
        yield f"{_named('Nodes without a reward, which count as 1', map(quoted, lacking))}."


def _add_survivals(
    arcs: Sequence[Row],
    places: _Places,
    faults: list[str],
    *,
    danger: float | None,
    hazard: _Path | None,
    zones: Sequence[Zone],
) -> Iterator[str]:
    """Give arcs without one a survival; yield what there is to say about it.

    It is exp(−length · rate). The rate is the mean along the straight line between the ends:
    ``danger``, times the share of the map ``hazard`` if there is one, and the rates of ``zones``.
    """
    for _, (tail, head), attributes in arcs:
        if tail == head:
            attributes.setdefault("survival", 1.0)  # the loop is the fault, or is left out
    lacking = [arc for arc in arcs if "survival" not in arc.attributes]
    if not lacking and (danger is not None or hazard is not None or zones):
        yield "All survivals are given: danger, hazard and danger zones change none."
    if lacking and danger is None and (hazard is not None or not zones):
        faults.append(
            f"{lacking[0].where}: expected a survival, found none ({len(lacking)} without one): "
            "give danger, the rate of loss for a unit of length"
        )
    share = None if hazard is None or not lacking else _share_of(hazard)
    for where, ends, attributes in lacking:
        rate = danger or 0.0
        if all(end in places for end in ends):
            start, end = (np.array(places[end]) for end in ends)
            rate *= 1.0 if share is None else share(start, end)
            rate += sum(zone.rate * zone.share(start, end - start) for zone in zones)
        elif share is not None or zones:
            missing = [end for end in ends if end not in places]
            faults.append(f"{where}: expected pos [x, y] of {quoted(missing[0])}, found none")
        length = max(0.0, as_float(attributes.get("length", 1.0)))
        try:
            attributes["survival"] = survived(rate, length)
        except ValueError as error:
            attributes["survival"] = 1.0  # so that the fault is listed once
            faults.append(f"{where}: {error}")


def _listed_zones(zones: Any) -> list[Zone]:
    if not isinstance(zones, list | tuple):
        raise MissionError(f"expected danger_zones to be a list, got {quoted(zones)}")
    return read_zones(zones, "danger_zones")


def _share_of(hazard: _Path) -> Callable[[FloatArray, FloatArray], float]:
    """Return what gives the mean share of a map along a straight line."""
    raster = _raster(hazard)
    cells = raster.values[::-1]

    def share(*ends: FloatArray) -> float:
        at = [in_cells(place, cells, raster.resolution, raster.origin) for place in ends]
        for place, where in zip(ends, at, strict=True):
            if np.isnan(where).any():
                x, y = place.tolist()
                raise MissionError(
                    f"{hazard}: expected a map of all arcs, found none of it at [{x:g}, {y:g}]"
                )
        return mean_along(cells, *at)

    return share


def _raster(path: _Path) -> Raster:
    """Read a map; its faults are part of those of the file that is read with it."""
    # Imported late: it takes time, and most missions need no images.
    from botohe_moo.mission.formats.maps import read_raster

    try:
        return read_raster(path)
    except MissionError as error:
        raise MissionError([f"{error.source}: {fault}" for fault in error.faults]) from None


def _trimmed(
    draft: Draft, base: Any, nodes: list[Row], arcs: list[Row]
) -> tuple[list[Row], list[Row], list[str]]:
    """Leave out what cannot be part of a mission; return what stays, and a sentence on the rest."""
    node, arc = draft.words
    of_labels = [
        row.where
        for rows, names in ((nodes, ("id",)), (arcs, ("source", "target")))
        for row in rows
        if [row.attributes.pop(name) for name in names if name in row.attributes]
    ]
    loops = [where for where, (tail, head), _ in arcs if tail == head]
    safest: dict[tuple[Any, ...], Row] = {}
    parallel = []
    for row in arcs:
        rival = safest.setdefault(row.labels, row)
        if rival is not row:
            survivals = (as_float(one.attributes["survival"]) for one in (rival, row))
            safest[row.labels], worse = (row, rival) if lt(*survivals) else (rival, row)
            parallel.append(worse.where)
    kept = [row for row in arcs if safest[row.labels] is row and row.where not in loops]
    known = {label for _, (label,), _ in nodes}
    ways: nx.DiGraph[Any] = nx.DiGraph(row.labels for row in kept)
    joined = {base}
    if base not in known:  # which breaks a rule
        joined = known
    elif base in ways:
        joined |= nx.descendants(ways, base) & nx.ancestors(ways, base)
    lost = known - joined
    left_out = {
        **draft.left_out,
        "attributes id, source and target, which are labels in mission files": of_labels,
        f"{arc}s from a {node} to itself": loops,
        f"{arc}s parallel to one that is at least as safe": parallel,
        f"{node}s that the base does not reach, or that have no way back": [
            quoted(label) for _, (label,), _ in nodes if label in lost
        ],
    }
    said = [text for what, names in left_out.items() if (text := _named(what, names))]
    nodes = [row for row in nodes if row.labels[0] in joined]
    kept = [row for row in kept if not lost.intersection(row.labels)]
    return nodes, kept, [f"Left out {'; '.join(said)}."] if said else []


def _named(what: str, names: Iterable[str]) -> str:
    """Return the text that names some things once each; empty if there are none."""
    listed = list(dict.fromkeys(names))
    shown = ", ".join(listed[:_MOST_NAMED]) + ", …" * (len(listed) > _MOST_NAMED)
    return f"{what}: {shown} ({len(listed)} in all)" if listed else ""


def _graph(
    attributes: Mapping[str, Any],
    nodes: Iterable[Row],
    arcs: Iterable[Row],
    kinds: Sequence[Kind],
    faults: list[str],
) -> nx.DiGraph[Any]:
    """Make a graph of rows; a MissionError lists all faults if there are any."""
    graph: nx.DiGraph[Any] = nx.DiGraph()
    graph.graph.update(attributes)
    for where, (label,), of_node in nodes:
        if label in graph:
            faults.append(f"{where}: node {quoted(label)} is listed more than once")
        graph.add_nodes_from([(label, of_node)])
    for where, (tail, head), of_arc in arcs:
        unknown = [label for label in dict.fromkeys((tail, head)) if label not in graph]
        wrong = [f"there is no node {quoted(label)}" for label in unknown]
        if graph.has_edge(tail, head):
            wrong.append("is listed more than once")
        faults += [f"{where}: arc {quoted(tail)} -> {quoted(head)}: {fault}" for fault in wrong]
        if not unknown:
            graph.add_edges_from([(tail, head, of_arc)])
    if faults:
        raise MissionError([*faults, *attribute_faults(graph, kinds)])
    return graph


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
    pays
        When nodes pay whose cell in the column ``pays`` is empty: on ``"arrival"`` (the default) or
        on ``"return"``.
    both_ways
        Whether every arc can be passed in both directions.
    max_length
        Travel budget of every robot, at least 0, in the unit of ``length``; default: none.
    name, title
        Of the mission.
    options
        ``danger``, ``reward`` and the others that files of all formats take: `read_mission`.

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
    graph = {"title": title or None, "max_length": max_length}
    given = {key: value for key, value in graph.items() if value is not None}
    draft = Draft(node_rows, arc_rows, given, faults)
    base = base.strip() if isinstance(base, str) else base
    options |= {"base": base, "robots": robots, "kinds": kinds, "pays": pays}
    return make_mission(draft, name=name, both_ways=both_ways, **options)


def read_table(path: _Path) -> pd.DataFrame:
    """Read a CSV file of texts, whose index is the number of each row in a spreadsheet.

    Cells are separated by commas, semicolons or tabs: by what a first line such as ``sep=;`` says,
    or by what the header has most of. Empty rows are left out. A MissionError names the file and
    what is wrong with it.
    """
    import pandas as pd

    path = Path(path)
    try:
        text = file_content(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        reason = f"{error}; save it as 'CSV UTF-8', as spreadsheets call it"
        raise MissionError(reason, str(path)) from None
    first, _, rest = text.partition("\n")
    separator = max(_SEPARATORS, key=first.count)
    if first.rstrip("\r").lower() in (f"sep={mark}" for mark in _SEPARATORS):  # as Excel writes it
        text, separator = f"\n{rest}", first[4]
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
        row = {key: value for key, value in filled if key and value is not None and value != ""}
        where = f"{table}, row {index}"
        if missing := [key for key in labels if key not in row]:
            faults.append(f"{where}: expected {missing[0]}, found nothing")
            continue
        ends = tuple(row.pop(key) for key in labels)
        if "x" in row or "y" in row:
            row["pos"] = [row.pop("x", None), row.pop("y", None)]
        rows.append(Row(where, ends, row))
    return rows, faults


def _column_name(column: str) -> str:
    """Return a column's name in lower case, apart from the name of a kind."""
    name, colon, kind = column.partition(":")
    name = name.strip().lower()
    return f"{name}:{kind.strip()}" if attribute_of(f"{name}{colon}") else column.strip().lower()
