"""The mission: a graph with rewards and survivals, a base, and a team of robots."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Hashable, Iterable, Sequence
from operator import index
from typing import Any, Self

import networkx as nx
import numpy as np

from botohe_moo._base.checks import quoted
from botohe_moo._base.types import FloatArray
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans import evaluate as kernels
from botohe_moo.mission.graphs import frozen_copy, given_places
from botohe_moo.mission.kinds import Kind, graph_of_kinds, read_kinds
from botohe_moo.mission.validation import (
    MissionError,
    PlanError,
    fault_text,
    graph_faults,
    team_size_fault,
    trail_indices,
)
from botohe_moo.trails import PlanBatch, Plans, TrailPlan


class Mission:
    """Robots that leave a base on a directed graph of dangerous arcs and rewarding nodes.

    Parameters
    ----------
    graph
        Directed graph with the node attribute ``reward`` (finite, at least 0) and the arc attribute
        ``survival`` (probability in (0, 1]). Nodes may have a position ``pos`` [x, y], arcs a
        ``length`` (finite, at least 0; default 1), and the graph a ``max_length``, the travel
        budget. Node labels are anything hashable. The mission keeps a frozen copy.
    base
        Label of the node that all robots leave from and return to.
    robots
        Team size, at least 1.
    name
        Short name. All three are by default attributes of the graph; the name may be its ``title``.

    Raises
    ------
    MissionError
        If something is out of its range, or a node has an arc to itself or no way from or to the
        base. Every fault is listed.

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
        listed = read_kinds(attributes.get("kinds", ()) if kinds is None else kinds)
        if robots is None and kinds is None:
            robots = attributes.get("robots")
        pays = attributes.get("pays", "arrival") if pays is None else pays
        name = attributes.get("name") or attributes.get("title") if name is None else name
        source = f"Mission {quoted(name)}" if name else "The mission"
        if faults := graph_faults(graph, base, robots, listed, pays):
            raise MissionError(faults, source)

        self.graph: nx.DiGraph[Any] = frozen_copy(graph)
        self.base = base
        self.kinds = listed or (Kind("robot", index(robots)),)  # type: ignore[arg-type]
        self.robots = sum(index(kind.robots) for kind in self.kinds)
        self.pays = pays
        self.name = str(name) if name else "mission"
        self.nodes: tuple[Any, ...] = tuple(self.graph)
        self._index = {node: i for i, node in enumerate(self.nodes)}
        self.arrays = graph_of_kinds(self.graph, base, self.kinds, pays, self._index)

    @property
    def title(self) -> str:
        """The graph's attribute ``title``; default: the name."""
        return str(self.graph.graph.get("title") or self.name)

    @property
    def total_reward(self) -> float:
        """Sum of the rewards of all nodes, the upper bound of the team reward."""
        return float(self.arrays.reward.sum())

    @property
    def max_length(self) -> float | None:
        """The default travel budget of :class:`~botohe_moo.BOTOHE`; None for no limit."""
        budget = self.graph.graph.get("max_length")
        return None if budget is None else float(budget)

    @property
    def balanced(self) -> bool:
        """Whether as many arcs enter every node as leave it, so that no trail meets a dead end."""
        return self.arrays.balanced

    def with_robots(self, robots: int) -> Mission:
        """Return the same mission for a team of another size, at least 1."""
        if fault := team_size_fault(robots):
            raise MissionError(fault, f"Mission {quoted(self.name)}")
        other = object.__new__(Mission)
        other.__dict__.update(self.__dict__, robots=index(robots))
        return other

    def with_lengths_from_pos(self) -> Mission:
        """Return the same mission with Euclidean distances between positions as lengths of arcs.

        Replaces the lengths that arcs have; ``max_length``, in the same unit, stays. A MissionError
        names the nodes without ``pos``.
        """
        places = given_places(self.graph)
        if missing := [node for node, place in places.items() if place is None]:
            faults = [f"node {quoted(node)}: expected pos [x, y], found none" for node in missing]
            raise MissionError(faults, f"Mission {quoted(self.name)}")
        graph = self.graph.copy()
        for tail, head, attributes in graph.edges(data=True):
            attributes["length"] = math.dist(places[tail], places[head])  # type: ignore[arg-type]
        return Mission(graph, base=self.base, robots=self.robots, name=self.name)

    @property
    def kind_of(self) -> tuple[Kind, ...]:
        """The kind of each robot; robots of a kind are side by side, in the order of ``kinds``."""
        return tuple(kind for kind in self.kinds for _ in range(kind.robots))

    @property
    def _first_node(self) -> list[int]:
        """The first node of each robot's layer of the graph."""
        n = len(self.nodes)
        return [k * n for k, kind in enumerate(self.kinds) for _ in range(kind.robots)]

    def index(self, label: Hashable) -> int:
        """Return the index of a node, by which kernels know it; a KeyError for an unknown label."""
        return self._index[label]

    def plan(self, trails: Iterable[Sequence[Hashable]]) -> TrailPlan:
        """Make a validated plan from one trail of node labels per robot.

        Parameters
        ----------
        trails
            The nodes that each robot visits, from the base to the base; ``[base]`` if it stays
            there. Lists as labels become tuples, as in mission files. A PlanError names a label
            that is unknown, and what is not valid.
        """
        listed = [trail_indices(self.name, self._index, *trail) for trail in enumerate(trails)]
        first, n_layers = self._first_node, len(self.kinds)
        plan = TrailPlan(
            [node + first[min(robot, self.robots - 1)] for node in trail] if n_layers > 1 else trail
            for robot, trail in enumerate(listed)
        )
        self.evaluate([plan])
        return plan

    def stay_home(self) -> TrailPlan:
        """Return the plan in which every robot stays where it starts.

        A robot whose trail ends elsewhere takes the safest way there.

        Examples
        --------
        >>> from botohe_moo import load_mission
        >>> toy = load_mission("toy")
        >>> toy.labels(toy.stay_home())
        ((1,), (1,))
        """
        graph, kinds = self.arrays, self.arrays.kinds
        if kinds is None:
            return TrailPlan([[graph.base]] * self.robots)
        return TrailPlan([_way_home(graph, int(start)) for start in kinds.start])

    def labels(self, plan: TrailPlan) -> tuple[tuple[Any, ...], ...]:
        """Return the trails of a plan of this mission as node labels, robot by robot."""
        if not isinstance(plan, TrailPlan):
            raise TypeError(f"Expected a TrailPlan, got {quoted(plan)}.")
        n = len(self.nodes)
        return tuple(tuple(self.nodes[i % n] for i in trail) for trail in plan.trails)

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
        With π the product of the survivals up to a node's first visit on a trail,
        E[R] = Σ_v r(v) · (1 − Π_k (1 − π_k(v))) and E[S] = Σ_k (product of the survivals along
        trail k): Simon, Richley, Overbey and Perez-Lavin, "Bi-objective trail-planning for a
        robot team orienteering in a hazardous environment", 2025.
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
            raise PlanError(fault_text(self.name, self.nodes, self.base, batch, fault))
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
            (self.nodes, self.base, self.robots, self.max_length)
            == (other.nodes, other.base, other.robots, other.max_length)
            and all(
                np.array_equal(getattr(self.arrays, key), getattr(other.arrays, key))
                for key in ("first", "head", "survival", "length", "reward")
            )
        )

    def __hash__(self) -> int:
        return hash((self.nodes, self.base, self.robots, self.arrays.survival.tobytes()))

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self  # immutable, and pymoo deep-copies algorithms together with their problem

    def __repr__(self) -> str:
        limit = "" if self.max_length is None else f", max_length {self.max_length:g}"
        return (
            f"<Mission {self.name!r}: {len(self.nodes)} nodes, {self.arrays.n_arcs} arcs, "
            f"{self.robots} robots at base {self.base!r}, total reward {self.total_reward:g}"
            f"{limit}>"
        )


def _way_home(graph: Graph, node: int) -> list[int]:
    way = [node]
    while (arc := int(graph.homeward[way[-1]])) >= 0:
        way.append(int(graph.head[arc]))
    return way


def check_mission(value: object) -> Mission:
    """Return ``value`` if it is a mission; the TypeError of anything else says how to get one."""
    if isinstance(value, Mission):
        return value
    raise TypeError(
        f"Expected a Mission, got {quoted(value)}; load_mission(name_or_path) gives one."
    )


def mission_digest(mission: Mission) -> str:
    """Return the digest of all that results depend on: not of names and positions."""
    return _digest(mission, [[repr(node) for node in mission.nodes], repr(mission.base)])


def numbers_digest(mission: Mission) -> str:
    """Return the digest without labels, whose types may change when they are read from a file."""
    return _digest(mission, [mission.arrays.base])


def _digest(mission: Mission, first: list[object]) -> str:
    limits = [] if mission.max_length is None else [mission.max_length]
    text = json.dumps([*first, mission.robots, *limits], separators=(",", ":"))
    hashed = hashlib.sha256(text.encode())
    arrays = mission.arrays
    numbers = [arrays.tail, arrays.head, arrays.survival, arrays.reward]
    if (arrays.length != 1.0).any():  # without lengths every hop is one long
        numbers.append(arrays.length)
    for values in numbers:
        hashed.update(np.ascontiguousarray(values, f"<{values.dtype.kind}8").tobytes())
    return hashed.hexdigest()[:16]
