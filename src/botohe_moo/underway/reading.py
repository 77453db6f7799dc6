"""Events of a mission under way, read from a table."""

from __future__ import annotations

import os
from collections.abc import Hashable
from pathlib import Path

from botohe_moo._base.checks import quoted
from botohe_moo.decide.grammar import node_of
from botohe_moo.mission.events import Event, EventError
from botohe_moo.mission.formats.tables import read_table
from botohe_moo.mission.model import Mission, check_mission

COLUMNS = ("time", "robot", "event", "node")


def read_events(mission: Mission, path: str | os.PathLike[str]) -> list[Event]:
    r"""Read what has happened from a CSV file with the columns ``robot``, ``event`` and ``node``.

    Rows are in the order in which it happened, as in the log of a mission, which may also have the
    column ``time``; that is not read. Robots are rows of the plan, from 0. Events are ``reached``,
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
        If a column is missing or unknown, or a row has no robot or an unknown node. All faults are
        listed, by row.
    MissionError
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
    frame, name = read_table(path), Path(path).name
    columns = [str(column).strip().lower() for column in frame.columns]
    if not {"robot", "event"} <= set(columns) <= set(COLUMNS) or len(columns) > len(set(columns)):
        expected = "the columns robot, event and node"
        raise EventError(f"{name}: expected {expected}, found {quoted(', '.join(columns))}.")
    events, faults = [], []
    cells = frame.astype(object).where(frame.notna(), None)
    for row, *values in cells.itertuples(name=None):
        given = dict(zip(columns, (str(value or "").strip() for value in values), strict=True))
        where = f"{name}, row {row}"
        try:
            robot, node = int(given["robot"]), _node(mission, given.get("node", ""))
        except ValueError as error:
            bad = not given["robot"].lstrip("-").isdigit()
            what = f"expected a robot, a whole number, got {quoted(given['robot'])}."
            faults.append(f"{where}: {what if bad else error}")
            continue
        events.append(Event(given["event"].lower(), robot, node, where))
    if faults:
        raise EventError("\n".join(faults))
    return events


def _node(mission: Mission, text: str) -> Hashable | None:
    return node_of(mission, text) if text else None
