"""Events of a mission under way, read from a table."""

from __future__ import annotations

import os
import re

from botohe_moo.base.files import FAULTS, filled_cells, read_table
from botohe_moo.base.messages import quoted
from botohe_moo.decide.grammar import node_of
from botohe_moo.mission.model import Mission, check_mission
from botohe_moo.mission.underway import Event, EventError

COLUMNS = ("time", "robot", "event", "node")


def read_events(mission: Mission, path: str | os.PathLike[str]) -> list[Event]:
    r"""Read what has happened from a CSV file with the columns ``robot``, ``event`` and ``node``.

    Rows are in the order in which it happened, as in the log of a mission, which may also have the
    column ``time``; that is not read. Robots are rows of the plan, from 0, or names of
    kinds of one robot. Events are ``reached``,
    ``lost`` and ``home``, as of :class:`Event`; the node may be empty where it may be None. Labels
    are written as in wishes.

    Parameters
    ----------
    mission
        The mission, which knows the nodes.
    path
        The file.

    Raises
    ------
    EventError
        If a column is missing or unknown, or a row has too few or too many cells or an unknown
        node. All such rows are listed.
    ValueError
        If the file is not a table.

    Examples
    --------
    >>> from pathlib import Path
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.underway import read_events
    >>> written = Path("events.csv").write_text("robot,event,node\n0,lost,4\n")
    >>> print(*read_events(load_mission("toy"), "events.csv"))
    robot 0 lost on the way to 4
    """
    check_mission(mission)
    frame = read_table(path)
    columns = [str(column).strip().lower() for column in frame.columns]
    if not {"robot", "event"} <= set(columns) <= set(COLUMNS) or len(columns) > len(set(columns)):
        expected = "the columns robot, event and node, and perhaps time"
        raise EventError(f"{path}: expected {expected}, found {quoted(', '.join(columns))}.")
    events, faults = [], list(frame.attrs[FAULTS])
    for where, given in filled_cells(frame, columns, str(path)):
        name = given.get("robot", "")
        robot = int(name) if re.fullmatch(r"-?[0-9]+", name) else name
        try:
            node = node_of(mission, given["node"]) if "node" in given else None
            events.append(Event(given.get("event", "").lower(), robot, node, where))
        except ValueError as error:
            faults.append(f"{where}: {error}")
    if faults:
        raise EventError("\n".join(faults))
    return events
