"""The mission: a graph with rewards and survivals, a base, and a team of robots."""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import replace
from operator import index
from typing import Any, Self

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo._base.words import counted
from botohe_moo.kernels.graph.graph import Graph, Limits
from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.mission.arrays import (
    distance_of,
    freeze,
    given_places,
    graph_of_kinds,
    uncollected,
    ways_to_ends,
)
from botohe_moo.mission.rules import (
    ONLY_KIND,
    Kind,
    MissionError,
    PlanError,
    fault_text,
    graph_faults,
    read_kinds,
    team_size_fault,
    trail_indices,
)
from botohe_moo.mission.underway import Event, under_way
from botohe_moo.trails import PlanBatch, Plans, TrailPlan

_MOST_NAMED = 20  # nodes in a warning


class Mission:
    """Robots that leave a base on a directed graph of dangerous arcs and rewarding nodes.

    Parameters
    ----------
    graph
        Directed graph with the node attribute ``reward`` (finite, at least 0) and the arc attribute
        ``survival`` (probability in (0, 1]). Nodes may have a position ``pos`` [x, y], arcs a
        ``length`` (finite, at least 0; default 1), and the graph a ``max_length``, the travel
        budget. Node labels are anything hashable. The mission keeps a frozen copy. Nodes may also
        have a ``share`` (in [0, 1]; default 1), the probability that a robot that gets there
        collects the reward; ``pays``, as below; and ``depot=True``.
    base
        Label of the node that robots leave from and return to; it is a depot.
    robots
        Team size, at least 1, if all robots are alike.
    kinds
        Kinds of robots, instead of ``robots``. The ``survival`` of an arc and the ``share`` of a
        node are one number then, or a mapping from the names of kinds to numbers; a survival of 0
        forbids the arc, and kinds without a share have 1.
    pays
        When nodes pay that have no attribute ``pays``: on ``"arrival"`` (the default), or on
        ``"return"``, when a robot that has been there gets to a depot.
    name
        Short name. All these are by default attributes of the graph; the name may be its ``title``.

    Raises
    ------
    MissionError
        If something is out of its range, a node has an arc to itself, or no way from or to the
        base; with kinds, if a kind has no way from its start to its end, or none that is safe or
        short enough. Every fault is listed.

    Warns
    -----
    UserWarning
        If there are nodes with a reward that no kind can collect.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import Mission
    >>> graph = nx.DiGraph()
    >>> graph.add_node("dock", reward=0)
    >>> graph.add_node("reef", reward=5)
    >>> graph.add_edge("dock", "reef", survival=0.9)
    >>> graph.add_edge("reef", "dock", survival=0.8)
    >>> mission = Mission(graph, base="dock", robots=2)
    >>> plan = mission.plan([["dock", "reef", "dock"], ["dock"]])
    >>> mission.evaluate([plan]).round(3).tolist()
    [[4.5, 1.72]]
    """

    def __init__(
        self,
        graph: nx.DiGraph[Any],
        *,
        base: Hashable | None = None,
        robots: int | None = None,
        kinds: Iterable[Kind] | None = None,
        pays: str | None = None,
        name: str | None = None,
    ) -> None:
        attributes = graph.graph if isinstance(graph, nx.Graph) else {}
        base = attributes.get("base") if base is None else base
        listed, faults = read_kinds(attributes.get("kinds") if kinds is None else kinds)
        if robots is not None and kinds is None and len(listed) == 1:  # of a file
            listed, robots = (replace(listed[0], robots=robots),), None
        elif robots is None and kinds is None:
            robots = attributes.get("robots")
        pays = attributes.get("pays", "arrival") if pays is None else pays
        name = attributes.get("name") or attributes.get("title") if name is None else name
        source = f"Mission {quoted(name)}" if name else "The mission"
        if faults := faults or graph_faults(graph, base, robots, listed, pays):
            raise MissionError(faults, source)

        of_one = (Kind(ONLY_KIND, robots),)  # type: ignore[arg-type]
        self._set_up(graph.copy(), base, listed or of_one, pays, str(name) if name else "mission")
        if lost := [self.nodes[v] for v in uncollected(self.arrays)]:
            named = ", ".join(map(quoted, lost[:_MOST_NAMED])) + ", …" * (len(lost) > _MOST_NAMED)
            text = f"{source}: no kind of robots can collect the reward of {named}."
            warnings.warn(text, stacklevel=2)

    def _set_up(
        self, graph: nx.DiGraph[Any], base: Hashable, kinds: Iterable[Kind], pays: str, name: str
    ) -> None:
        self.graph: nx.DiGraph[Any] = freeze(graph)
        self.base = base
        self.kinds = tuple(kind.normalized() for kind in kinds)
        self.robots = sum(kind.robots for kind in self.kinds)
        self.pays = pays
        self.name = name
        self.nodes: tuple[Any, ...] = tuple(self.graph)
        self._index = {node: i for i, node in enumerate(self.nodes)}
        self.arrays = graph_of_kinds(self.graph, base, self.kinds, pays, self._index)

    def _derive(self, graph: nx.DiGraph[Any], kinds: Iterable[Kind]) -> Mission:
        """Return the mission on another graph with other kinds, which are known to be valid.

        Checks would take most of the time of a replan.
        """
        derived = Mission.__new__(Mission)
        derived._set_up(graph, self.base, kinds, self.pays, self.name)
        return derived

    @property
    def title(self) -> str:
        """The graph's attribute ``title``; default: the name."""
        return str(self.graph.graph.get("title") or self.name)

    @property
    def rewards(self) -> FloatArray:
        """The reward of each node, in the order of ``nodes`` (n_nodes,)."""
        return self.arrays.reward if self.arrays.kinds is None else self.arrays.kinds.reward

    @property
    def total_reward(self) -> float:
        """Sum of the rewards of all nodes, the upper bound of the team reward."""
        return float(self.rewards.sum())

    @property
    def max_length(self) -> float | None:
        """The default travel budget of :class:`~botohe_moo.BOTOHE`; None for no limit."""
        budget = self.graph.graph.get("max_length")
        return None if budget is None else float(budget)

    @property
    def is_plain(self) -> bool:
        """Whether robots are alike, stay at the base or return there, and nodes pay on arrival.

        Some searches can plan for such missions only.
        """
        return self.arrays.kinds is None

    @property
    def specialities(self) -> str:
        """What a mission has that a plain one has not, in words."""
        several = ["kinds of robots"] if len(self.kinds) > 1 else []
        if self.has_returns:
            return " and ".join([*several, "rewards that count on return"])
        return several[0] if several else "starts, ends, shares or forbidden arcs"

    @property
    def has_returns(self) -> bool:
        """Whether rewards of some nodes count on return."""
        kinds = self.arrays.kinds
        return kinds is not None and kinds.has_returns

    @property
    def balanced(self) -> bool:
        """Whether as many arcs enter every node as leave it, so that no trail meets a dead end."""
        return self.arrays.balanced

    def with_robots(self, robots: int) -> Mission:
        """Return the same mission for a team of another size, at least 1, of the same kind.

        A MissionError is raised for a mission of several kinds: :class:`Mission` takes these.
        """
        fault = team_size_fault(robots)
        if len(self.kinds) > 1:
            fault = f"it has {self.team}: expected no number of robots, got {quoted(robots)}"
        if fault:
            raise MissionError(fault, f"Mission {quoted(self.name)}")
        kinds = (replace(self.kinds[0], robots=index(robots)),)
        if self.arrays.kinds is not None:  # which have the robots
            return Mission(self.graph, base=self.base, kinds=kinds, pays=self.pays, name=self.name)
        other = object.__new__(Mission)
        other.__dict__.update(self.__dict__, robots=index(robots), kinds=kinds)
        return other

    def with_lengths_from_pos(self) -> Mission:
        """Return the same mission with Euclidean distances between positions as lengths of arcs.

        Where the graph has the attribute ``geographic``, they are metres between longitudes and
        latitudes.

        Replaces the lengths that arcs have; ``max_length``, in the same unit, stays. A MissionError
        names the nodes without ``pos``.
        """
        places = given_places(self.graph)
        if missing := [node for node, place in places.items() if place is None]:
            faults = [f"node {quoted(node)}: expected pos [x, y], found none" for node in missing]
            raise MissionError(faults, f"Mission {quoted(self.name)}")
        graph, distance = self.graph.copy(), distance_of(self.graph.graph)
        for tail, head, attributes in graph.edges(data=True):
            attributes["length"] = distance(places[tail], places[head])
        return Mission(graph, base=self.base, kinds=self.kinds, pays=self.pays, name=self.name)

    @property
    def team(self) -> str:
        """How many robots there are, and of which kinds: "3 robots (2 drone, 1 rover)"."""
        number = counted(self.robots, "robot")
        if len(self.kinds) == 1:
            return number
        listed = ", ".join(f"{kind.robots} {kind.name}" for kind in self.kinds)
        return f"{number} ({listed})"

    @property
    def kind_of(self) -> tuple[Kind, ...]:
        """The kind of each robot; robots of a kind are side by side, in the order of ``kinds``."""
        return tuple(kind for kind in self.kinds for _ in range(kind.robots))

    def limits(self, min_survival: float = 0.0, max_length: float | None = None) -> Limits:
        """Return what every robot has to keep, as kernels take it.

        Parameters
        ----------
        min_survival
            Survival floor of every robot; a kind may have a higher one.
        max_length
            Travel budget of every robot; a kind may have a lower one. Default: that of the kind,
            or of the mission.
        """
        longest = math.inf if self.max_length is None else self.max_length
        floors = [max(min_survival, kind.min_survival) for kind in self.kinds]
        budgets = [longest if kind.max_length is None else kind.max_length for kind in self.kinds]
        if max_length is not None:
            own = (math.inf if k.max_length is None else k.max_length for k in self.kinds)
            budgets = [min(max_length, longest) for longest in own]
        if self.is_plain:
            return Limits(floors[0], budgets[0])
        by_node = (np.repeat(np.array(of, np.float64), len(self.nodes)) for of in (floors, budgets))
        return Limits(max(floors), min(budgets), *by_node)

    def index(self, label: Hashable) -> int:
        """Return the index of a node in ``nodes``; a KeyError is raised for an unknown label."""
        return self._index[label]

    def plan(self, trails: Iterable[Sequence[Hashable]]) -> TrailPlan:
        """Make a validated plan from one trail of node labels per robot.

        Parameters
        ----------
        trails
            The nodes that each robot visits, from the base to the base, or from the start to the
            end of its kind; ``[base]`` if it stays there. With kinds, in the order of ``kinds``:
            all robots of the first one, then those of the next. Lists as labels become tuples, as
            in mission files. A PlanError names a label that is unknown, and what is not valid.
        """
        listed = [trail_indices(self.name, self._index, *trail) for trail in enumerate(trails)]
        if len(listed) == self.robots:
            kind_of = np.repeat(np.arange(len(self.kinds)), [kind.robots for kind in self.kinds])
            first = (kind_of * len(self.nodes)).tolist()
            listed = [[node + n for node in trail] for n, trail in zip(first, listed, strict=True)]
        plan = TrailPlan(listed)
        self.evaluate([plan])
        return plan

    def stay_home(self, limits: Limits | None = None) -> TrailPlan:
        """Return the plan in which every robot stays where it starts.

        A robot whose trail ends elsewhere takes the safest way there, or the shortest one if that
        is too long.

        Parameters
        ----------
        limits
            What decides which ways are too long; by default the travel budgets of the mission and
            its kinds.

        Examples
        --------
        >>> from botohe_moo import load_mission
        >>> toy = load_mission("toy")
        >>> toy.labels(toy.stay_home())
        ((1,), (1,))
        """
        if self.is_plain:
            return TrailPlan([[self.arrays.base]] * self.robots)
        return TrailPlan(ways_to_ends(self.arrays, self.limits() if limits is None else limits))

    def after(
        self,
        plan: TrailPlan,
        events: Iterable[Event],
        *,
        min_survival: float = 0.0,
        max_length: float | None = None,
    ) -> Mission:
        """Return the mission that is left after some events.

        Parameters are those of :func:`botohe_moo.underway.under_way`, which says what is raised,
        and returns what is left of the plan, too.

        Examples
        --------
        >>> from botohe_moo import Event, load_mission
        >>> toy = load_mission("toy")
        >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
        >>> rest = toy.after(plan, [Event("reached", 0, 4)])
        >>> rest.team, rest.kinds[0].start
        ('2 robots (1 robot 0, 1 robot)', 4)
        """
        left = under_way(self, plan, events, min_survival=min_survival, max_length=max_length)
        rest: Mission = left.mission
        return rest

    def check_ways(self, limits: Limits) -> None:
        """Refuse, by a ValueError, limits that neither the safest nor the shortest way keeps.

        Ways that compromise between the two are not looked for. The error names the first kind for
        which this is so.
        """
        if self.is_plain:
            return
        home = self.stay_home(limits)
        survival, length = self.robot_survival([home])[0], self.trail_lengths([home])[0]
        for robot, trail in enumerate(home.trails):
            least = 0.0 if limits.floors is None else limits.floors[trail[0]]
            longest = math.inf if limits.budgets is None else limits.budgets[trail[0]]
            if survival[robot] < least or length[robot] > longest:
                kind = self.kind_of[robot]
                ends = " to ".join(map(quoted, kind.ends(self.base)))
                given = [f"min_survival {least:g}"] if least > 0 else []
                given += [f"max_length {longest:g}"] if longest < math.inf else []
                raise ValueError(
                    f"Mission {quoted(self.name)}: robots of kind {quoted(kind.name)} cannot keep "
                    f"{' and '.join(given)}. The safest way from {ends}, or the shortest one if "
                    f"that is too long, is survived with {survival[robot]:.4g} and is "
                    f"{length[robot]:g} long; no others are tried."
                )

    def labels(self, plan: TrailPlan) -> tuple[tuple[Any, ...], ...]:
        """Return the trails of a plan of this mission as node labels, robot by robot."""
        return tuple(tuple(self.nodes[i] for i in trail) for trail in self.trails(plan))

    def trails(self, plan: TrailPlan) -> tuple[tuple[int, ...], ...]:
        """Return the trails of a plan as indices of ``nodes``, robot by robot.

        In ``plan.trails`` and ``arrays`` each kind has nodes of its own: of n nodes, node v of kind
        k, counted from 0, is ``k * n + v``.
        """
        if not isinstance(plan, TrailPlan):
            raise TypeError(f"Expected a TrailPlan, got {quoted(plan)}.")
        n = len(self.nodes)
        return tuple(tuple(i % n for i in trail) for trail in plan.trails)

    def evaluate(self, plans: Plans) -> FloatArray:
        """Compute the objectives of plans: E[R] and E[S] (n_plans, 2).

        Plans with the same trails get the same bits, whatever the order of their robots.

        Parameters
        ----------
        plans
            Trail plans, as for ``batch``. A PlanError is raised if a trail does not begin and end
            at base, uses a missing arc, or uses an arc twice. Counts from 0.

        Notes
        -----
        With π the product of the survivals up to a node's first visit on a trail, E[R] = Σ_v r(v) ·
        (1 − Π_k (1 − π_k(v))) and E[S] = Σ_k (product of the survivals along trail k). With kinds,
        survivals are those of each robot's kind, and π_k(v) becomes the share of the node times
        π_k(v), or, if it pays on return, times the product of the survivals up to the first depot
        at or after that visit, 0 if there is none. Simon, Richley, Overbey and Perez-Lavin, "Bi-
        objective trail-planning for a robot team orienteering in a hazardous environment", 2025.
        """
        return self._values(plans, strict=True).objectives

    def robot_survival(self, plans: Plans) -> FloatArray:
        """Compute the probability that each robot survives (n_plans, robots).

        On a trail that is not valid no robot survives.
        """
        return self._values(plans, strict=False).alive

    def trail_lengths(self, plans: Plans) -> FloatArray:
        """Compute the length of each robot's trail, the sum of its arcs' (n_plans, robots).

        A trail that is not valid counts up to its first fault.
        """
        return self._values(plans, strict=False).lengths

    def evaluate_drafts(self, plans: Plans) -> tuple[FloatArray, FloatArray]:
        """Compute the objectives (n_plans, 2) of plans that need not be valid, and their faults.

        A robot walks its trail up to the first fault, where it is lost. Faults (n_plans,) are
        trails that do not begin or do not end at base, missing arcs, and arcs used again.
        """
        values = self._values(plans, strict=False)
        return values.objectives, values.faults

    def _values(self, plans: Plans, *, strict: bool) -> kernels.Values:
        batch = self.batch(plans)
        values = kernels.new_values(len(batch), batch.n_robots)
        fault = kernels.evaluate(self.arrays, *batch.arrays, batch.n_robots, strict, values)
        if fault[0] != kernels.VALID:
            raise PlanError(fault_text(self, batch, fault))
        return values

    def batch(self, plans: Plans) -> PlanBatch:
        """Pack plans for this mission's team.

        Parameters
        ----------
        plans
            Trail plans: any iterable of them, or an array such as ``result.X``; a batch is returned
            as it is. A TypeError names what is not a plan, a PlanError a plan for another number of
            robots.
        """
        if isinstance(plans, PlanBatch) and plans.n_robots == self.robots:
            return plans
        try:
            return PlanBatch.from_plans(plans, self.robots)
        except ValueError as error:
            team = f"Mission {quoted(self.name)} has {self.robots} robots."
            raise PlanError(f"{error} {team}") from None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mission):
            return NotImplemented
        return self is other or (
            (self.nodes, self.base, self.kinds, self.max_length)
            == (other.nodes, other.base, other.kinds, other.max_length)
            and self.is_plain == other.is_plain
            and all(map(np.array_equal, _numbers(self.arrays), _numbers(other.arrays)))
        )

    def __hash__(self) -> int:
        return hash((self.nodes, self.base, self.robots, self.arrays.survival.tobytes()))

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self  # immutable, and pymoo deep-copies algorithms together with their problem

    def __repr__(self) -> str:
        limit = "" if self.max_length is None else f", max_length {self.max_length:g}"
        return (
            f"<Mission {self.name!r}: {len(self.nodes)} nodes, {len(self.graph.edges)} arcs, "
            f"{self.team} at base {self.base!r}, total reward {self.total_reward:g}"
            f"{limit}>"
        )


def check_mission(value: object) -> Mission:
    """Return ``value`` if it is a mission; the TypeError of anything else says how to get one."""
    if isinstance(value, Mission):
        return value
    raise TypeError(
        f"Expected a Mission, got {quoted(value)}; load_mission(name_or_path) gives one."
    )


def _numbers(arrays: Graph) -> list[Any]:
    """Return the arrays on which objectives depend."""
    numbers = [arrays.tail, arrays.head, arrays.survival, arrays.length, arrays.reward]
    if arrays.kinds is not None:
        numbers += arrays.kinds[1:-1]  # without ``origin`` and ``has_returns``
    return numbers


def check_plain(mission: object, who: str) -> Mission:
    """Return ``mission`` if it is a plain one; the ValueError names ``who`` needs that.

    Anything but a mission is refused as by `check_mission`.
    """
    checked = check_mission(mission)
    if checked.is_plain:
        return checked
    raise ValueError(
        f"{who} does not support mission {quoted(checked.name)}, which has {checked.specialities}."
    )


def mission_digest(mission: Mission) -> str:
    """Return the digest of all that results depend on: not of names and positions."""
    return _digest(mission, [[repr(node) for node in mission.nodes], repr(mission.base)])


def numbers_digest(mission: Mission) -> str:
    """Return the digest without labels, whose types may change when they are read from a file."""
    return _digest(mission, [mission.arrays.base])


def _digest(mission: Mission, first: list[object]) -> str:
    limits: list[object] = [] if mission.max_length is None else [mission.max_length]
    of_kinds = [[kind.min_survival, kind.max_length] for kind in mission.kinds]
    if of_kinds != [[0.0, None]]:
        limits += [of_kinds]
    text = json.dumps([*first, mission.robots, *limits], separators=(",", ":"))
    hashed = hashlib.sha256(text.encode())
    arrays = mission.arrays
    numbers = [arrays.tail, arrays.head, arrays.survival, arrays.reward]
    if (arrays.length != 1.0).any():  # without lengths every hop is one long
        numbers.append(arrays.length)
    if arrays.kinds is not None:
        numbers += arrays.kinds[:-1]
    for values in numbers:
        hashed.update(np.ascontiguousarray(values, f"<{values.dtype.kind}8").tobytes())
    return hashed.hexdigest()[:16]
