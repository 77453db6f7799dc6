"""What happens to the robots of a mission under way."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.words import counted
from botohe_moo.mission.kinds import Kind
from botohe_moo.trails import TrailPlan

HAPPENINGS = ("reached", "lost", "home")


class EventError(ValueError):
    """Something is wrong with the events of a mission; names each event and why.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission
    >>> from botohe_moo.underway import EventError
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> try:
    ...     toy.after(plan, [Event("reached", 0, 5)])
    ... except EventError as error:
    ...     print(error)
    Event 0: robot 0 reached 5: expected a node of the rest of its trail, 2, 4, 2, 1.
    """


@dataclass(frozen=True)
class Event:
    """What has happened to a robot of a mission under way.

    Parameters
    ----------
    what
        ``"reached"`` a node of its trail, and all nodes of the trail before it; ``"lost"``;
        ``"home"``, which has followed its trail to the end, and does not leave again.
    robot
        Its row in the plan, from 0; or the name of its kind, if it is the only one of that.
    node
        The node that it has reached, where its trail visits it next. Of a lost robot, the node to
        which it was on its way, so that it has reached all before; None if it is not known where it
        was lost: then only what it had collected by its last event counts.
    where
        What errors call the event, such as the row of a file; by default its number in the list.

    Examples
    --------
    >>> from botohe_moo import Event
    >>> print(Event("lost", 2, "lab"))
    robot 2 lost on the way to 'lab'
    """

    what: str
    robot: int | str
    node: Hashable | None = None
    where: str | None = field(default=None, compare=False)

    def __str__(self) -> str:
        if self.what == "reached":
            return f"robot {self.robot} reached {quoted(self.node)}"
        if self.what == "lost":
            where = "" if self.node is None else f" on the way to {quoted(self.node)}"
            return f"robot {self.robot} lost{where}"
        return f"robot {self.robot} {self.what}"


@dataclass
class RobotState:
    """A robot under way."""

    number: int
    kind: Kind
    trail: tuple[Hashable, ...]
    at: int = 0  # its position on the trail
    state: str = "out"
    aboard: list[Hashable] = field(default_factory=list)
    paid: list[Hashable] = field(default_factory=list)  # where nothing is collected any more

    @property
    def place(self) -> Hashable:
        """The node where it is, or was when it was lost."""
        return self.trail[self.at]

    @property
    def has_left(self) -> bool:
        """Whether it is not one of the robots of its kind that may still go anywhere."""
        return self.at > 0 or self.state == "home"


def robots_at_start(mission: Any, plan: TrailPlan) -> list[RobotState]:
    """Return the robots of a plan before anything has happened."""
    trails = zip(mission.kind_of, mission.labels(plan), strict=True)
    return [RobotState(number, kind, trail) for number, (kind, trail) in enumerate(trails)]


def happen(robots: Sequence[RobotState], event: Event, number: int) -> str | None:
    """Let an event happen; return what is wrong with it, if anything is."""
    named = event.where or f"Event {number}"
    where = f"{named}: {event}"
    if event.what not in HAPPENINGS:
        return f"{named}: expected 'reached', 'lost' or 'home', got {quoted(event.what)}."
    robot = _find(robots, event.robot)
    if robot is None:
        team = counted(len(robots), "robot")
        return f"{where}: expected a row of the plan, which has {team}, from 0."
    if robot.state != "out":
        return f"{where}: it is {robot.state} already."
    ahead = robot.trail[robot.at + 1 :]
    if event.what == "home":
        if event.node not in (None, robot.trail[-1]):
            end = quoted(robot.trail[-1])
            return f"{where} at {quoted(event.node)}: expected the end of its trail, {end}."
        robot.at, robot.state = len(robot.trail) - 1, "home"
        return None
    if event.what == "lost" and event.node is None:
        robot.state = "lost"
        return None
    if event.node not in ahead:
        rest = ", ".join(map(quoted, ahead)) or "which has ended"
        return f"{where}: expected a node of the rest of its trail, {rest}."
    robot.at += 1 + ahead.index(event.node)
    if event.what == "lost":
        robot.at, robot.state = robot.at - 1, "lost"
    return None


def _find(robots: Sequence[RobotState], given: object) -> RobotState | None:
    """Find a robot by its row, or by the kind of which it is the only one."""
    if isinstance(given, str):
        found = [robot for robot in robots if robot.kind.name == given]
        return found[0] if len(found) == 1 else None
    is_row = isinstance(given, int | np.integer) and 0 <= given < len(robots)
    return robots[int(given)] if is_row else None  # type: ignore[call-overload]
