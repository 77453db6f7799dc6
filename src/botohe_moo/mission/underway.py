"""Missions under way: apply events to robots, settle the rewards, and return the mission left."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, NamedTuple

import networkx as nx

from botohe_moo.base.messages import quoted
from botohe_moo.core.world import CHECKING, Limits
from botohe_moo.mission.rules import Kind, MissionError, by_kind
from botohe_moo.mission.scenarios import Scenario, survivals_in
from botohe_moo.trails import TrailPlan

_STATES = {"reached": "out", "lost": "lost", "home": "home"}  # of a robot after each event
_PLACES = {"reached": "", "lost": " on the way to", "home": " at"}  # before the node of an event


class EventError(ValueError):
    """Something is wrong with the events of a mission; the message names each event and why.

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
        ``"reached"``: the robot has reached a node of its trail, and all nodes before it.
        ``"lost"``: it is lost. ``"home"``: it has followed its trail to the end, and does not leave
        again.
    robot
        Its row in the plan, from 0; or the name of its kind, if that kind has only one robot.
    node
        The node that it has reached, where its trail visits it next. For a lost robot, the node to
        which it was on its way: it has reached all nodes before. None if nobody knows where it was
        lost: then only what it had collected by its last event counts.
    where
        How errors name the event, such as the row of a file. Default: its number in the list.

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
        place = "" if self.node is None else f"{_PLACES.get(self.what, '')} {quoted(self.node)}"
        return f"robot {self.robot} {self.what}{place}"


@dataclass(frozen=True)
class RobotState:
    """A robot under way: where it is on its trail, and whether it is out, lost or home.

    A lost robot stays at the last node that it reached, and it may be known that it was lost on the
    next arc. The kind has the limits that the robot had to keep at the start.
    """

    number: int
    kind: Kind
    trail: tuple[Hashable, ...]
    at: int = 0
    state: str = "out"
    is_place_known: bool = True


def robots_at_start(mission: Any, plan: TrailPlan, limits: Limits) -> list[RobotState]:
    """Return the robots of a plan before anything has happened.

    A PlanError says if the plan is not valid, or does not keep the limits.
    """
    mission.check_limits([plan], limits.loosened(CHECKING))
    robots = []
    for robot, trail in enumerate(mission.labels(plan)):
        least, longest = float(limits.floors[robot]), float(limits.budgets[robot])
        budget = None if longest == math.inf else longest
        kind = replace(mission.kind_of[robot], min_survival=least, max_length=budget)
        robots.append(RobotState(robot, kind, trail))
    return robots


def apply_events(robots: Sequence[RobotState], events: Iterable[Event]) -> list[RobotState]:
    """Return the robots after some events, in the order of ``robots``.

    Raises
    ------
    EventError
        If events cannot happen; it names all of them. Later events are checked without these.
    """
    after, faults = list(robots), []
    for number, event in enumerate(events):
        try:
            robot = apply_event(after, event)
            after[robot.number] = robot
        except EventError as error:
            faults.append(f"{event.where or f'Event {number}'}: {error}")
    if faults:
        raise EventError("\n".join(faults))
    return after


def apply_event(robots: Sequence[RobotState], event: Event) -> RobotState:
    """Return the robot of an event after it; the EventError says why it cannot happen."""
    if not isinstance(event, Event):
        raise TypeError(f"Expected events to be of type Event, got {quoted(event)}.")
    if event.what not in _STATES:
        raise EventError(f"expected one of {[*_STATES]}, got {quoted(event.what)}.")
    found = [robot for robot in robots if event.robot in (robot.number, robot.kind.name)]
    if len(found) != 1:
        raise EventError(f"{event}: expected a row of the plan, 0 to {len(robots) - 1}.")
    robot = found[0]
    if robot.state != "out":
        raise EventError(f"{event}: it is {robot.state} already.")
    expected, first = "a node of the rest of its trail", robot.at + 1
    if event.what == "home":
        expected, first = "the end of its trail", len(robot.trail) - 1
    places = robot.trail[first:]
    if event.node not in places and (event.what == "reached" or event.node is not None):
        listed = ", ".join(map(quoted, places)) or "which has ended"
        raise EventError(f"{event}: expected {expected}, {listed}.")
    at = first if event.node is None else first + places.index(event.node)
    is_lost, is_known = event.what == "lost", event.what != "lost" or event.node is not None
    return replace(robot, at=at - is_lost, state=_STATES[event.what], is_place_known=is_known)


class Settled(NamedTuple):
    """The rewards of a mission under way.

    Attributes
    ----------
    left
        What each node still pays, where no scenario says anything else.
    share
        The share of each node's reward that is left, in all scenarios.
    paid
        For each robot, the nodes where it collects nothing any more.
    aboard
        For each robot, the nodes whose rewards it carries.
    """

    left: dict[Hashable, float]
    share: dict[Hashable, float]
    paid: tuple[list[Hashable], ...]
    aboard: tuple[tuple[Hashable, ...], ...]

    def banked(self, mission: Any) -> float:
        """Return the reward of a mission without scenarios that counts already."""
        rewards = ((node, float(pays)) for node, pays in mission.graph.nodes(data="reward"))
        return math.fsum(pays - pays * self.share[node] for node, pays in rewards)


def settle_rewards(mission: Any, robots: Sequence[RobotState]) -> Settled:
    """Return what robots have collected, and what nodes still pay.

    Each robot that is paid for node v leaves r(v) · (1 − share) of its expected reward r(v).
    """
    nodes = mission.graph.nodes
    left = dict.fromkeys(nodes, 1.0)
    paid, aboard = zip(*(_collected(mission, robot) for robot in robots), strict=True)
    for robot, collected in zip(robots, paid, strict=True):
        for node in collected:
            [share] = by_kind(nodes[node].get("share", 1.0), [robot.kind])
            left[node] *= 1.0 - share
    rewards = {node: float(of["reward"]) * left[node] for node, of in nodes(data=True)}
    return Settled(rewards, left, paid, aboard)


def _collected(mission: Any, robot: RobotState) -> tuple[list[Hashable], tuple[Hashable, ...]]:
    """Return the nodes for which a robot is paid, and those whose rewards it carries."""
    paid, carried = list[Hashable](), list(robot.kind.aboard)
    for node in robot.trail[: robot.at + 1]:
        attributes = mission.graph.nodes[node]
        if node not in paid and node not in carried:
            returns = attributes.get("pays", mission.pays) == "return"
            (carried if returns else paid).append(node)
        if node == mission.base or attributes.get("depot"):
            paid, carried = paid + carried, []
    return paid, tuple(node for node in carried if node != robot.trail[robot.at])


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

    Lost robots leave the team. Each robot that has left its start becomes a kind. Its name is that
    of its old kind with its row, such as ``robot 2``; a kind of one robot keeps its name. The robot
    starts where it is, cannot use the arcs again that it has used, has the rest of its travel
    budget, and carries what it has collected since its last depot. The survival floor of a kind
    holds for the rest of a trail; with scenarios, it is lower where what has happened makes the
    rest of the plan more dangerous than that. Nodes whose rewards count already pay nothing. If
    ``share`` < 1, a visited node keeps its expected remaining reward.

    Parameters
    ----------
    mission, plan
        A mission, and the plan that it follows.
    events
        What has happened. The events of each robot are in the order in which they happened; those
        of different robots may be in any order.
    min_survival, max_length
        The limits that the plan was made for, as for :class:`BOTOHE`; the plan has to keep them.

    Raises
    ------
    PlanError
        If the plan is not valid, or does not keep the limits.
    EventError
        If events name no robot of the plan, or do not follow its trail.
    MissionError
        If all robots are lost. Any other robot can follow its trail to the end.
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
    robots = robots_at_start(mission, plan, mission.limits(min_survival, max_length))
    events = list(events)
    if not events and not min_survival and max_length is None:
        return UnderWay(mission, plan, tuple(range(mission.robots)), 0.0)
    return remaining_mission(mission, apply_events(robots, events))


def remaining_mission(mission: Any, robots: Sequence[RobotState]) -> UnderWay:
    """Return what is left of a mission whose robots are where they are; see `under_way`."""
    settled = settle_rewards(mission, robots)
    cases = _posterior(mission, robots)
    groups: dict[Kind, list[RobotState]] = {}  # in the order of their first rows
    for robot, aboard in zip(robots, settled.aboard, strict=True):
        if robot.state != "lost":
            groups.setdefault(_kind_left(mission, robot, aboard), []).append(robot)
    if not groups:
        raise MissionError("all robots are lost", f"Mission {quoted(mission.name)}")
    first = {kind.name: group[0] for kind, group in groups.items()}
    kinds = [replace(kind, robots=len(group)) for kind, group in groups.items()]
    scenarios = [_scenario_left(of, first, settled) for of in cases]
    rest = mission._derive(_graph_left(mission, first, settled), kinds, scenarios)
    left = [robot for group in groups.values() for robot in group]
    plan = rest.plan([robot.trail[robot.at :] for robot in left])
    if cases:  # by what has happened, the rest of a trail may be more dangerous than all of it was
        alive = zip(rest.kind_of, rest.robot_survival([plan])[0].tolist(), strict=True)
        least = {kind.name: survival for kind, survival in sorted(alive, key=lambda of: -of[1])}
        kinds = [replace(k, min_survival=min(k.min_survival, least[k.name])) for k in kinds]
        rest = mission._derive(rest.graph, kinds, scenarios)
    found = [of.probability * settled.banked(mission.in_scenario(of.name)) for of in cases]
    banked = math.fsum(found) if cases else settled.banked(mission)
    return UnderWay(rest, plan, tuple(robot.number for robot in left), banked)


def _posterior(mission: Any, robots: Sequence[RobotState]) -> list[Scenario]:
    """Return the scenarios that are left, with their probabilities after what has happened.

    These follow from Bayes' rule: a scenario is the more probable, the more probable it makes what
    has happened to the robots, which are lost independently in each scenario. They stay as they
    were where no scenario allows it.
    """
    weights = [
        scenario.probability * math.prod(_likelihood(mission, scenario, robot) for robot in robots)
        for scenario in mission.scenarios
    ]
    total = math.fsum(weights)
    if total == 0.0:
        return list(mission.scenarios)
    left = zip(mission.scenarios, weights, strict=True)
    return [replace(of, probability=weight / total) for of, weight in left if weight / total > 0.0]


def _likelihood(mission: Any, scenario: Scenario, robot: RobotState) -> float:
    """Return how probable it is, in a scenario, that this has happened to a robot."""
    arcs, kind = pairwise(robot.trail), [robot.kind]
    hops = [survivals_in(scenario, mission.graph, arc, kind)[0] for arc in arcs]
    chance = math.prod(hops[: robot.at])
    if robot.state != "lost":
        return chance
    end = robot.at + 1 if robot.is_place_known else len(hops)
    return chance * (1.0 - math.prod(hops[robot.at : end]))


def _scenario_left(
    scenario: Scenario, first: Mapping[str, RobotState], settled: Settled
) -> Scenario:
    """Return a scenario for the kinds that are left, given the first robot of each by its name."""
    kinds = [robot.kind for robot in first.values()]
    survival = {
        arc: dict(zip(first, by_kind(value, kinds), strict=True))
        for arc, value in scenario.survival.items()
    }
    reward = {node: value * settled.share[node] for node, value in scenario.reward.items()}
    return replace(scenario, survival=survival, reward=reward)


def _kind_left(mission: Any, robot: RobotState, aboard: tuple[Hashable, ...]) -> Kind:
    """Return the kind that a robot is from now on, as if it had no other robots.

    Robots of a kind that still wait at their start get equal kinds.
    """
    old, kind = robot.kind, replace(robot.kind, robots=1, aboard=aboard)
    if robot.at == 0 and robot.state == "out":
        return kind
    name = f"{old.name} {robot.number}" if old.robots > 1 else old.name
    while name in {other.name for other in mission.kinds} - {old.name}:
        name += "'"
    if kind.max_length is not None:
        lengths = [mission.graph.edges[arc].get("length", 1.0) for arc in pairwise(robot.trail)]
        walked, ahead = sum(lengths[: robot.at]), sum(lengths[robot.at :])
        # The rest of the trail may be longer than the rest of the budget by rounding.
        kind = replace(kind, max_length=max(kind.max_length - walked, ahead))
    return replace(kind, name=name, start=robot.trail[robot.at], end=robot.trail[-1])


def _graph_left(mission: Any, first: dict[str, RobotState], settled: Settled) -> nx.DiGraph[Any]:
    """Return the graph for the kinds that are left, given the first robot of each by its name.

    A kind collects nothing where its robot is paid already, and survives no arc that it has used.
    """
    graph: nx.DiGraph[Any] = mission.graph.copy()
    for name in ("robots", "kinds", "max_length", "scenarios"):  # the new kinds have their own
        graph.graph.pop(name, None)
    nx.set_node_attributes(graph, settled.left, "reward")
    old_kinds, paid, used = [], {}, {}
    for name, robot in first.items():
        old_kinds.append(robot.kind)
        paid[name] = {*settled.paid[robot.number]}
        arcs = graph.edges if robot.state == "home" else pairwise(robot.trail[: robot.at + 1])
        used[name] = {*arcs}
    for view, key, ended in ((graph.nodes, "share", paid), (graph.edges, "survival", used)):
        for item, attributes in view.items():
            value = attributes.get(key, 1.0)
            over = {name for name, items in ended.items() if item in items}
            if over or isinstance(value, Mapping):
                numbers = zip(first, by_kind(value, old_kinds), strict=True)
                attributes[key] = {name: 0.0 if name in over else n for name, n in numbers}
    return graph
