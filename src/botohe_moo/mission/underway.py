"""Missions under way: what has happened, and the mission that is left."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.words import counted
from botohe_moo.kernels.graph.graph import Limits, limit_at
from botohe_moo.mission.rules import Kind, MissionError, PlanError, by_kind
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


_ROUNDING = 1e-12  # relative, of lengths


@dataclass(frozen=True)
class UnderWay:
    """A mission after some events.

    Attributes
    ----------
    mission
        The mission that is left, as `Mission.after` returns it.
    plan
        What is left of the plan.
    robots
        The row in the old plan of each robot of the new one.
    banked
        The expected reward that counts already.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission
    >>> from botohe_moo.underway import UnderWay, under_way
    >>> toy = load_mission("toy")
    >>> left = under_way(toy, toy.stay_home(), [Event("lost", 1)])
    >>> isinstance(left, UnderWay), left.mission.robots, left.robots
    (True, 1, (0,))
    """

    mission: Any  # a `Mission`, whose module imports this one
    plan: TrailPlan
    robots: tuple[int, ...]
    banked: float


def under_way(
    mission: Any,
    plan: TrailPlan,
    events: Iterable[Event],
    *,
    min_survival: float = 0.0,
    max_length: float | None = None,
) -> UnderWay:
    """Return what is left of a mission, and of its plan, after some events.

    Robots that are lost leave the team. Each robot that has left its start is a kind of its own,
    named after its kind and its row, such as ``robot 2``, or as before if it was one already: it
    starts where it is, cannot use the arcs again that it has used, has what is left of its travel
    budget, and carries what it has collected since its last depot. The survival floor of a kind
    holds for what is left of a trail. Nodes whose rewards count already pay nothing; where a robot
    has been that fails to collect a reward, of which its ``share`` is not 1, what is to be expected
    stays.

    Parameters
    ----------
    mission, plan
        A mission, and the plan that it follows.
    events
        What has happened, in the order in which it did. Of two robots it may be in any order.
    min_survival, max_length
        The limits that the plan was made for, as for :class:`BOTOHE`; it has to keep them.

    Raises
    ------
    PlanError
        If the plan is not valid, or does not keep the limits.
    EventError
        If events are not of the robots of the plan, or not in the order of their trails.
    MissionError
        If all robots are lost. The others have a way to their ends: what is left of their trails.
    TypeError
        If one of the events is not an Event.

    Examples
    --------
    >>> from botohe_moo import Event, load_mission
    >>> from botohe_moo.underway import under_way
    >>> toy = load_mission("toy")
    >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
    >>> left = under_way(toy, plan, [Event("reached", 0, 4)])
    >>> left.mission.labels(left.plan), left.robots, left.banked
    (((4, 2, 1), (1,)), (0, 1), 4.0)
    """
    limits = mission.limits(min_survival, max_length)
    check_limits(mission, plan, limits)
    robots, events = robots_at_start(mission, plan), list(events)
    for event in events:
        if not isinstance(event, Event):
            raise TypeError(f"Expected events to be of type Event, got {quoted(event)}.")
    if not events and not min_survival and max_length is None:
        return UnderWay(mission, plan, tuple(range(mission.robots)), 0.0)
    faults = [fault for i, event in enumerate(events) if (fault := happen(robots, event, i))]
    if faults:
        raise EventError("\n".join(faults))
    return left_of(mission, robots, limits)


def check_limits(mission: Any, plan: TrailPlan, limits: Limits) -> None:
    """Refuse, by a PlanError, a plan that is not valid or does not keep limits."""
    [survivals], [lengths] = mission.robot_survival([plan]), mission.trail_lengths([plan])
    kinds = [kind for kind, of in enumerate(mission.kinds) for _ in range(of.robots)]
    for robot, kind in enumerate(kinds):
        least, longest = _limits_of(mission, limits, kind)
        survival, length = float(survivals[robot]), float(lengths[robot])
        if survival < least * (1.0 - _ROUNDING):
            raise PlanError(
                f"Robot {robot}: expected a trail that is survived with at least {least:g}, got "
                f"{survival:.4g}."
            )
        if length > longest * (1.0 + _ROUNDING):
            raise PlanError(
                f"Robot {robot}: expected a trail of length {longest:g} or less, got {length:g}."
            )


def _limits_of(mission: Any, limits: Limits, kind: int) -> tuple[float, float]:
    """Return the survival floor and the travel budget of a kind, by its number."""
    first = kind * len(mission.nodes)
    least = limit_at(limits.min_survival, limits.floors, first)
    return float(least), float(limit_at(limits.max_length, limits.budgets, first))


def left_of(mission: Any, robots: Sequence[RobotState], limits: Limits) -> UnderWay:
    """Return what is left of a mission whose robots are where they are; see `under_way`."""
    left, banked = pay(mission, robots)
    kept = [robot for robot in robots if robot.state != "lost"]
    if not kept:
        raise MissionError("all robots are lost", f"Mission {quoted(mission.name)}")
    kinds, members = zip(*_kinds_left(mission, kept, limits), strict=True)
    graph = _graph_left(mission, kinds, members, left)
    rest = mission._derive(graph, kinds)
    order = [robot for group in members for robot in group]
    tails = [robot.trail[robot.at :] for robot in order]
    return UnderWay(rest, rest.plan(tails), tuple(robot.number for robot in order), banked)


def pay(mission: Any, robots: Sequence[RobotState]) -> tuple[dict[Hashable, float], float]:
    """Credit what robots have collected, note what they carry, and return what nodes still pay."""
    nodes = mission.graph.nodes
    left = {node: float(attributes["reward"]) for node, attributes in nodes.items()}
    shares = {
        node: dict(zip((kind.name for kind in mission.kinds), numbers, strict=True))
        for node, attributes in nodes.items()
        if (numbers := by_kind(attributes.get("share", 1.0), mission.kinds))
    }
    for robot in robots:
        carried = list(robot.kind.aboard)
        paid: list[Hashable] = []
        for node in robot.trail[: robot.at + 1]:
            if node not in paid and node not in carried:
                returns = nodes[node].get("pays", mission.pays) == "return"
                (carried if returns else paid).append(node)
            if node == mission.base or nodes[node].get("depot"):
                paid, carried = paid + carried, []
        for node in paid:
            left[node] *= 1.0 - shares[node][robot.kind.name]
        robot.paid, robot.aboard = paid, [node for node in carried if node != robot.place]
    paid_by_node = (float(nodes[node]["reward"]) - pays for node, pays in left.items())
    return left, math.fsum(paid_by_node)


def _kinds_left(
    mission: Any, robots: Sequence[RobotState], limits: Limits
) -> list[tuple[Kind, list[RobotState]]]:
    """Return the kinds of robots that are left with the robots of each, by their first rows."""
    taken = {kind.name for kind in mission.kinds}
    found = []
    for number, kind in enumerate(mission.kinds):
        least, longest = _limits_of(mission, limits, number)
        own = [robot for robot in robots if robot.kind == kind]
        if waiting := [robot for robot in own if not robot.has_left]:
            kept = {
                "robots": len(waiting),
                "min_survival": least,
                "max_length": None if longest == math.inf else longest,
                "aboard": tuple(waiting[0].aboard),
            }
            found.append((replace(kind, **kept), waiting))
        for robot in own:
            if not robot.has_left:
                continue
            name = kind.name
            if kind.robots > 1:
                name = f"{kind.name} {robot.number}"
                while name in taken:
                    name += "'"
                taken.add(name)
            hops = list(pairwise(robot.trail))
            lengths = [mission.graph.edges[hop].get("length", 1.0) for hop in hops]
            walked, ahead = sum(lengths[: robot.at]), sum(lengths[robot.at :])
            left = max(longest - walked, ahead)  # which may be less by rounding
            alone = Kind(
                name,
                1,
                start=robot.place,
                end=kind.ends(mission.base)[1],
                min_survival=least,
                max_length=None if left == math.inf else left,
                aboard=tuple(robot.aboard),
            )
            found.append((alone, [robot]))
    return sorted(found, key=lambda pair: pair[1][0].number)


def _graph_left(
    mission: Any,
    kinds: Sequence[Kind],
    members: Sequence[Sequence[RobotState]],
    left: dict[Hashable, float],
) -> nx.DiGraph[Any]:
    """Return the graph with what each robot can still do and collect."""
    graph: nx.DiGraph[Any] = mission.graph.copy()
    for of_before in ("robots", "kinds", "max_length"):  # kinds have their own budgets
        graph.graph.pop(of_before, None)
    of = [group[0].kind.name for group in members]
    for node, attributes in graph.nodes(data=True):
        attributes["reward"] = left[node]
        share = attributes.get("share", 1.0)
        shares = [share.get(name, 1.0) if isinstance(share, dict) else share for name in of]
        shares = [
            0.0 if node in group[0].paid else share
            for share, group in zip(shares, members, strict=True)
        ]
        if len(set(shares)) > 1 or isinstance(share, dict):
            names = (kind.name for kind in kinds)
            attributes["share"] = dict(zip(names, shares, strict=True))
        elif shares[0] != 1.0:
            attributes["share"] = shares[0]
    for *_, attributes in graph.edges(data=True):
        survival = attributes["survival"]
        if isinstance(survival, dict):
            attributes["survival"] = {
                kind.name: survival[name] for kind, name in zip(kinds, of, strict=True)
            }
    for kind, group in zip(kinds, members, strict=True):
        robot = group[0]
        is_home = robot.state == "home"
        used = list(graph.edges) if is_home else list(pairwise(robot.trail[: robot.at + 1]))
        for arc in used:
            survival = graph.edges[arc]["survival"]
            if not isinstance(survival, dict):
                survival = {other.name: survival for other in kinds}
            graph.edges[arc]["survival"] = survival | {kind.name: 0.0}
    return graph
