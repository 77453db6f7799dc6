"""The mission: a graph with rewards and survivals, a base, and a team of robots."""

from __future__ import annotations

import hashlib
import json
import math
import warnings
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain
from typing import Any, NoReturn, Self

import networkx as nx
import numpy as np

from botohe_moo.base.messages import check_choice, counted, listed, quoted
from botohe_moo.base.parameters import check
from botohe_moo.base.types import FloatArray
from botohe_moo.core import evaluate as kernels
from botohe_moo.core import world as worlds
from botohe_moo.core.world import PLANNING, Limits, World
from botohe_moo.mission import rules
from botohe_moo.mission import scenarios as s
from botohe_moo.mission.hazards import distance_of, places_of
from botohe_moo.mission.rules import Kind, MissionError, PlanError
from botohe_moo.mission.scenarios import Scenario
from botohe_moo.mission.underway import Event, under_way
from botohe_moo.trails import PlanBatch, Plans, TrailPlan


class Mission:
    """A team of robots, the base that they leave, and the graph of nodes that they visit.

    Arcs are dangerous and nodes pay rewards. Robots leave the base and come back. A node pays the
    team once, when the first robot reaches it. A mission is immutable.

    Parameters
    ----------
    graph
        A directed graph; the mission keeps a frozen copy. Node labels are anything hashable.

        - Nodes need a ``reward`` (at least 0). They may have a position ``pos`` [x, y], a
          ``share``, the probability that a robot at the node collects its reward (in [0, 1];
          default 1), their own ``pays`` (as below), and ``depot=True``.
        - Arcs need a ``survival``, a probability in (0, 1]. They may have a ``length`` (at least 0;
          default 1).
        - The graph may have a ``max_length``, the travel budget of robots whose kind has none, and
          a ``title``. It may also have ``base``, ``robots``, ``kinds``, ``pays`` and ``name``: the
          parameters below default to these.
    base
        Label of the node that robots leave from and return to. The base is a depot.
    robots
        Number of robots, at least 1, if all are alike.
    kinds
        Kinds of robots, instead of ``robots``. Then ``survival`` and ``share`` are either one
        number for all kinds or a mapping from names of kinds to numbers. A survival of 0 closes an
        arc for a kind; a share that a mapping leaves out is 1.
    pays
        When nodes without the attribute ``pays`` pay their reward: on ``"arrival"`` (the default),
        or on ``"return"``. A node that pays on return pays when a robot that has visited it reaches
        a depot.
    scenarios
        Possible worlds, one of which is true, such as one with a storm and one without, each a
        :class:`Scenario`. All robots meet the same one; given it, robots are lost on arcs
        independently. Default: those of the graph, if it has any.
    name
        Short name; default: the title.

    Attributes
    ----------
    nodes
        The labels of all nodes. Arrays list nodes in this order.
    kinds
        The kinds of robots; a mission that lists none has one, named ``robot``.
    scenarios
        The scenarios, whose probabilities sum to 1; empty without any.
    title
        The title of the graph; default: the name.
    max_length
        The travel budget of the graph, which :class:`~botohe_moo.BOTOHE` takes by default; None for
        no limit.
    rewards
        The expected reward of each node (n_nodes,).
    total_reward
        The sum of all rewards, an upper bound of E[R].
    balanced
        Whether as many arcs enter every node as leave it. Then no trail meets a dead end.
    has_returns
        Whether nodes with a reward pay on return.
    is_plain
        Whether robots are alike and start and end at the base, nodes pay on arrival, and there are
        neither shares, closed arcs nor scenarios. Some searches can plan for such missions only.
    world
        The mission as arrays, for kernels.

    Raises
    ------
    MissionError
        If an attribute is missing or out of its range, a node has an arc to itself, or a node has
        no way from the base or back to it. With several kinds, if a kind has no way from its start
        to its end, none that is safe enough, or none that is short enough. The error lists every
        fault.

    Warns
    -----
    UserWarning
        If no kind can collect the reward of some node.

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
        scenarios: Iterable[Scenario] | None = None,
        name: str | None = None,
    ) -> None:
        own = {"pays": "arrival"} | (dict(graph.graph) if isinstance(graph, nx.Graph) else {})
        given = {"base": base, "kinds": kinds, "pays": pays, "scenarios": scenarios, "name": name}
        own |= {key: value for key, value in given.items() if value is not None}
        team, faults = rules.read_kinds(own.get("kinds"))
        if kinds is not None or robots is not None:
            own["robots"] = robots
        if kinds is None and robots is not None and len(team) == 1:  # the graph's own kind
            team, own["robots"] = (replace(team[0], robots=robots),), None
        name = own.get("name") or own.get("title")
        source = f"Mission {quoted(name)}" if name else "The mission"
        if not (faults := faults or rules.graph_faults(graph, team, own)):
            own["scenarios"], faults = s.check_scenarios(own.get("scenarios"), graph, team)
        if not faults:
            team = team or (Kind(rules.ONLY_KIND, own["robots"]),)
            self._set_up(graph.copy(), team, own | {"name": str(name or "mission")})
            limits = self.limits().loosened(PLANNING)
            floors = limits._replace(budgets=np.full(self.robots, math.inf), has_budgets=False)
            budgets = limits._replace(floors=np.zeros(self.robots))
            worlds_of = map(self.world.with_limits, (floors, budgets))
            faults = [*dict.fromkeys(chain(*map(self._way_faults, worlds_of)))]
        if faults:
            raise MissionError(faults, source)
        if lost := [quoted(self.nodes[v]) for v in worlds.uncollected(self.world)]:
            text = f"{source}: no kind of robots can collect the reward of {listed(lost)}."
            warnings.warn(text, stacklevel=2)

    def _set_up(self, graph: Any, kinds: Iterable[Kind], given: Mapping[str, Any]) -> None:
        self.graph: nx.DiGraph[Any] = _freeze(graph)
        self.base, self.pays, self.name = given["base"], given["pays"], given["name"]
        self.scenarios: tuple[Scenario, ...] = given["scenarios"]
        self.title = str(graph.graph.get("title") or self.name)
        budget = graph.graph.get("max_length")
        self.max_length = None if budget is None else float(budget)
        self.kinds = tuple(kind.normalized() for kind in kinds)
        self.robots = sum(kind.robots for kind in self.kinds)
        self.nodes: tuple[Any, ...] = tuple(self.graph)
        self._index = {node: i for i, node in enumerate(self.nodes)}
        self.world = self._new_world()
        self.balanced, self.rewards = self.world.graph.balanced, self.world.team.reward
        self.total_reward = float(self.rewards.sum())
        self.has_returns = self.world.returns is not None
        self.is_plain = self.world.is_plain and {*self.kinds[0].ends(self.base)} == {self.base}

    def _new_world(self) -> World:
        """Return the valid mission for kernels, with a layer of nodes and arcs for each kind."""
        graph: Any = self.graph
        kinds, n, index_of, base = self.kinds, len(self.nodes), self._index, self.base
        arcs = sorted((index_of[u], index_of[v], arc) for u, v, arc in graph.edges(data=True))
        tail, head = (np.array([arc[i] for arc in arcs], np.int64) for i in (0, 1))
        labels = [(self.nodes[u], self.nodes[v]) for u, v, _ in arcs]
        by_kind = [rules.by_kind(arc["survival"], kinds) for *_, arc in arcs]
        survival = np.array(by_kind, np.float64).reshape(1, -1, len(kinds))
        length = np.array([arc.get("length", 1.0) for *_, arc in arcs], np.float64)
        nodes = [node for _, node in graph.nodes(data=True)]
        reward = np.array([node["reward"] for node in nodes], np.float64)
        share = np.array([rules.by_kind(node.get("share", 1.0), kinds) for node in nodes])
        ends = np.array([[index_of[label] for label in kind.ends(base)] for kind in kinds])
        probability, worth = np.ones(1), reward[None]
        if self.scenarios:
            probability = np.array([scenario.probability for scenario in self.scenarios])
            probability /= probability.sum()
            survival, worth = s.in_scenarios(self, labels)
            reward = np.where((worth == reward).all(axis=0), reward, probability @ worth)
        aboard = [[index_of[v] for v in kind.aboard if reward[index_of[v]] > 0.0] for kind in kinds]
        taken = survival.max(axis=0) > 0.0
        # Arcs that are closed in all scenarios, each with a kind.
        self._closed = {(*labels[i], kinds[k].name) for i, k in np.argwhere(~taken).tolist()}
        for k, (start, end) in enumerate(ends.tolist()):
            forth = tail[taken[:, k]], head[taken[:, k]]
            is_open = worlds.leading(*forth, [end], n) & worlds.leading(*forth[::-1], [start], n)
            taken[:, k] &= is_open[tail] & is_open[head]
            is_open[aboard[k]] = True  # what robots carry may come from nodes that are closed now
            share[~is_open, k] = 0.0
            aboard[k] = [node for node in aboard[k] if node != start]  # which the trail visits

        # Each kind has a layer of nodes, and of the arcs that it may take.
        layer, arc = np.nonzero(taken.T)
        of_arcs = tail[arc] + n * layer, head[arc] + n * layer
        survivals = np.ascontiguousarray(survival[:, arc, layer])
        ends += n * np.arange(len(kinds))[:, None]
        first = np.cumsum([0, *(kind.robots for kind in kinds)])
        kind_of = np.repeat(np.arange(len(kinds)), np.diff(first))
        padded = np.zeros((len(probability), len(kinds) * n))
        padded[:, :n] = probability[:, None] * worth
        team = worlds.Team(
            reward=reward,
            worth=padded.ravel(),
            origin=np.tile(np.arange(n), len(kinds)),
            share=share.T.ravel(),
            end=np.repeat(ends[:, 1], n),
            start=ends[kind_of, 0],
            first=first[kind_of],
            stop=first[kind_of + 1],
        )
        on_return = [node.get("pays", self.pays) == "return" for node in nodes]
        is_depot = [bool(node.get("depot")) for node in nodes]
        credit = np.where(on_return, worlds.AT_NEXT_DEPOT, worlds.ON_ARRIVAL)
        credit[is_depot] = credit[index_of[base]] = worlds.AT_THIS_DEPOT
        returns = None
        if (reward[credit == worlds.AT_NEXT_DEPOT] > 0.0).any():
            carried = np.array([node for nodes in aboard for node in nodes], np.int64)
            first, credit = np.cumsum([0, *map(len, aboard)]), np.tile(credit, len(kinds))
            returns = worlds.Returns(credit, carried, first[kind_of], first[kind_of + 1])
        expected = (reward[:, None] * share).T.ravel()
        given = *of_arcs, worlds.Chances(probability, survivals), length[arc], expected, team
        return worlds.new_world(*given, self.limits(), returns)

    def in_scenario(self, name: str) -> Mission:
        """Return the mission as it is in one scenario, without others; plans stay the same.

        An arc that is closed in it has the least survival above 0, which is as good as none.

        Parameters
        ----------
        name
            Of a scenario; a ValueError is raised for another.

        Examples
        --------
        >>> from botohe_moo import Mission, Scenario, load_mission
        >>> toy = load_mission("toy")
        >>> mission = Mission(toy.graph, scenarios=[Scenario("storm", probability=0.25, factor=3)])
        >>> mission.in_scenario("otherwise") == toy
        True
        """
        names = [scenario.name for scenario in self.scenarios]
        if not names:
            raise ValueError(f"Mission {quoted(self.name)} has no scenarios, got {quoted(name)}.")
        check_choice("scenario", name, names)
        scenario, graph = self.scenarios[names.index(name)], self.graph.copy()
        graph.graph.pop("scenarios", None)
        kinds = [kind.name for kind in self.kinds]
        for arc, of in graph.edges.items():
            by = dict(zip(kinds, s.survivals_in(scenario, graph, arc, self.kinds), strict=True))
            by |= {k: math.ulp(0) for k in kinds if by[k] == 0.0 and (*arc, k) not in self._closed}
            of["survival"] = by if len(by) > 1 or 0.0 in by.values() else min(by.values())
        nx.set_node_attributes(graph, dict(scenario.reward), "reward")
        return self._derive(graph, self.kinds)

    def _derive(
        self, graph: nx.DiGraph[Any], kinds: Iterable[Kind], scenarios: Sequence[Scenario] = ()
    ) -> Mission:
        """Return the mission on another graph with other kinds, without checking them.

        Checks would take most of the time of replanning.
        """
        derived = Mission.__new__(Mission)
        given = {"base": self.base, "pays": self.pays, "name": self.name}
        derived._set_up(graph, kinds, given | {"scenarios": tuple(scenarios)})
        return derived

    @cached_property
    def in_scenarios(self) -> tuple[tuple[float, Mission], ...]:
        """The probability of each scenario, with the mission in it; itself where there are none."""
        found = [(of.probability, self.in_scenario(of.name)) for of in self.scenarios]
        return tuple(found) or ((1.0, self),)

    def with_robots(self, robots: int) -> Mission:
        """Return the same mission for another number of robots, at least 1, of the same kind.

        A ValueError is raised for a mission of several kinds: make a new :class:`Mission`.
        """
        if len(self.kinds) > 1:
            fault = f"it has {self.team}: expected no number of robots, got {quoted(robots)}"
            raise MissionError(fault, f"Mission {quoted(self.name)}")
        kinds = (replace(self.kinds[0], robots=check("robots", robots, int, ge=1)),)
        return self._derive(self.graph, kinds, self.scenarios)

    def with_scenarios(self, scenarios: Any, *, keep_marginals: bool = False) -> Mission:
        """Return the same mission with other scenarios.

        Parameters
        ----------
        scenarios
            Each a `Scenario`, a mapping, or a text such as "storm=0.2,factor=8,zone=east". A
            MissionError lists what is wrong.
        keep_marginals
            Whether survivals of the graph stay the means over all scenarios. Then those that
            scenarios start from are computed so. A MissionError names an arc for which there is
            none. By default scenarios start from those of the graph.

        Examples
        --------
        >>> from botohe_moo import load_mission
        >>> mission = load_mission("toy").with_scenarios(["storm=0.25,factor=3"])
        >>> [(scenario.name, scenario.probability) for scenario in mission.scenarios]
        [('storm', 0.25), ('otherwise', 0.75)]
        """
        found = s.read_scenarios(scenarios, lambda label: label)
        given = {"base": self.base, "pays": self.pays, "scenarios": found}
        made = Mission(self.graph, kinds=self.kinds, name=self.name, **given)
        if not keep_marginals:
            return made
        try:
            graph = s.with_marginals(self.graph, made.scenarios, self.kinds)
        except ValueError as error:
            raise MissionError(str(error), f"Mission {quoted(self.name)}") from None
        return Mission(graph, kinds=self.kinds, name=self.name, **given)

    def with_lengths_from_pos(self) -> Mission:
        """Return the same mission with the distances between positions as lengths of arcs.

        Distances are Euclidean. If the graph has the attribute ``geographic``, positions are
        longitudes and latitudes, and distances are metres. They replace all lengths; ``max_length``
        stays. A MissionError names the nodes without ``pos``.
        """
        places = places_of(self.graph.nodes)
        if missing := [node for node in self.graph if node not in places]:
            faults = [f"node {quoted(node)}: expected pos [x, y], found none" for node in missing]
            raise MissionError(faults, f"Mission {quoted(self.name)}")
        graph, distance = self.graph.copy(), distance_of(self.graph.graph)
        for tail, head, attributes in graph.edges(data=True):
            attributes["length"] = distance(places[tail], places[head])
        given = {"base": self.base, "pays": self.pays, "scenarios": self.scenarios}
        return Mission(graph, kinds=self.kinds, name=self.name, **given)

    @property
    def team(self) -> str:
        """The number of robots, and of each kind: "3 robots (2 drone, 1 rover)"."""
        kinds = ", ".join(f"{kind.robots} {kind.name}" for kind in self.kinds)
        return counted(self.robots, "robot") + (f" ({kinds})" if len(self.kinds) > 1 else "")

    @property
    def kind_of(self) -> tuple[Kind, ...]:
        """The kind of each robot; robots of a kind are side by side, in the order of ``kinds``."""
        return tuple(kind for kind in self.kinds for _ in range(kind.robots))

    @property
    def specialities(self) -> str:
        """What keeps a mission from being plain, in words."""
        several = ["kinds of robots"] if len(self.kinds) > 1 else []
        returns = ["rewards that count on return"] if self.has_returns else []
        scenarios = ["scenarios"] if self.scenarios else []
        found = " and ".join(several + returns + scenarios)
        return found or "starts, ends, shares or forbidden arcs"

    def limits(self, min_survival: float = 0.0, max_length: float | None = None) -> Limits:
        """Return the limits of all robots, for kernels.

        Parameters
        ----------
        min_survival
            Survival floor of every robot; a kind may have a higher one.
        max_length
            Travel budget of every robot; a kind may have a lower one. Default: that of the kind,
            or of the mission.
        """
        default = self.max_length if max_length is None else max_length
        most = math.inf if max_length is None else max_length
        own = [default if kind.max_length is None else kind.max_length for kind in self.kinds]
        budgets = [most if budget is None else min(most, budget) for budget in own]
        floors = [max(min_survival, kind.min_survival) for kind in self.kinds]
        return worlds.new_limits(floors, budgets, [kind.robots for kind in self.kinds])

    def limited(
        self, min_survival: float = 0.0, max_length: float | None = None, *, by: float = PLANNING
    ) -> World:
        """Return the mission for kernels, with ``limits`` loosened by a relative amount."""
        return self.world.with_limits(self.limits(min_survival, max_length).loosened(by))

    def describe(self) -> str:
        """Describe the mission in words, a line for each of its traits.

        Examples
        --------
        >>> from botohe_moo import load_mission
        >>> print(load_mission("toy").describe())
        toy: Five nodes, each danger on an arc destroys one robot in ten
          nodes         5 (3 with a reward)
          arcs          12
          team          2 robots at base 1
          total reward  10
          survival      0.729 to 1
        """
        graph, n_arcs = self.world.graph, len(self.graph.edges)
        traits = {
            "nodes": f"{len(self.nodes)} ({(self.rewards > 0).sum()} with a reward)",
            "arcs": f"{n_arcs}{'' if self.balanced else ', dead ends possible'}",
            "team": f"{self.team} at base {self.base!r}",
            "total reward": f"{self.total_reward:g}",
            **self._kind_traits(),
        }
        if self.scenarios:
            traits["scenarios"] = listed(f"{of.name} {of.probability:g}" for of in self.scenarios)
        if graph.n_arcs:
            traits["survival"] = f"{graph.survival.min():g} to {graph.survival.max():g}"
            if any("length" in arc for *_, arc in self.graph.edges(data=True)):
                traits["length"] = f"{graph.length.min():g} to {graph.length.max():g}"
        if self.max_length is not None:
            traits["max_length"] = f"{self.max_length:g}, the travel budget of every robot"
        lines = (f"  {name:12}  {text}" for name, text in traits.items())
        return "\n".join([f"{self.name}: {self.title}", *lines])

    def _kind_traits(self) -> dict[str, str]:
        """Describe each kind of robots, which nodes pay on return, and the depots."""
        n_nodes, paying = len(self.nodes), self.rewards > 0
        kind_of_arc = (self.world.graph.tail // n_nodes).tolist()
        collects = (self.world.graph.reward > 0).reshape(-1, n_nodes).sum(axis=1)
        traits = {}
        for k, kind in enumerate(self.kinds):
            if kind == Kind(rules.ONLY_KIND, kind.robots):
                continue
            start, end = kind.ends(self.base)
            limits = f", min_survival {kind.min_survival:g}" if kind.min_survival else ""
            limits += f", max_length {kind.max_length:g}" if kind.max_length is not None else ""
            moves = f"from {start!r} to {end!r}, can take {counted(kind_of_arc.count(k), 'arc')}"
            gains = f"collects at {collects[k]} of {paying.sum()} paying nodes"
            traits[kind.name] = f"{counted(kind.robots, 'robot')} {moves}, {gains}{limits}"
        if (returns := self.world.returns) is not None:
            credit = returns.credit[:n_nodes]
            on_return = (paying & (credit == worlds.AT_NEXT_DEPOT)).sum()
            depots = np.flatnonzero(credit == worlds.AT_THIS_DEPOT).tolist()
            traits["on return"] = f"{on_return} of {paying.sum()} paying nodes"
            traits["depots"] = ", ".join(repr(self.nodes[v]) for v in depots)
        return traits

    def index(self, label: Hashable) -> int:
        """Return the index of a node in ``nodes``; a KeyError is raised for an unknown label."""
        return self._index[label]

    def plan(self, trails: Iterable[Sequence[Hashable]]) -> TrailPlan:
        """Make a validated plan from one trail of node labels per robot.

        Parameters
        ----------
        trails
            The labels of the nodes that each robot visits, from the base to the base, or from the
            start to the end of its kind. The trail of a robot that stays at the base is ``[base]``.
            Robots are in the order of ``kinds``: first all of the first kind, then all of the next.
            A label that is a tuple may be given as a list, as in mission files. A PlanError names
            what is not valid.
        """
        indices = [rules.trail_indices(self, *trail) for trail in enumerate(trails)]
        is_team = len(indices) == self.robots  # if not, that is the fault
        plan = self.pack([indices])[0] if is_team else TrailPlan(indices)
        self.evaluate([plan])
        return plan

    def stay_home(self, world: World | None = None) -> TrailPlan:
        """Return the plan in which every robot stays where it starts.

        A robot whose trail ends elsewhere takes the safest way there, or the shortest one if that
        is too long.

        Parameters
        ----------
        world
            The mission with the travel budgets that decide which ways are too long; default: those
            of the mission and its kinds.

        Examples
        --------
        >>> from botohe_moo import load_mission
        >>> toy = load_mission("toy")
        >>> toy.labels(toy.stay_home())
        ((1,), (1,))
        """
        return TrailPlan([way.nodes for way in worlds.ways_to_ends(world or self.world)])

    def after(self, plan: TrailPlan, events: Iterable[Event], **limits: Any) -> Mission:
        """Return the mission that is left after some events.

        :func:`botohe_moo.underway.under_way` describes the parameters (``limits`` are
        ``min_survival`` and ``max_length``) and what is raised; it returns the rest of the plan.

        Examples
        --------
        >>> from botohe_moo import Event, load_mission
        >>> toy = load_mission("toy")
        >>> plan = toy.plan([[1, 2, 4, 2, 1], [1]])
        >>> rest = toy.after(plan, [Event("reached", 0, 4)])
        >>> rest.team, rest.kinds[0].start
        ('2 robots (1 robot 0, 1 robot)', 4)
        """
        rest: Mission = under_way(self, plan, events, **limits).mission
        return rest

    def check_ways(self, world: World) -> None:
        """Refuse, by a ValueError, limits that neither the safest nor the shortest way keeps.

        Ways that compromise between the two are not tried. The error names the first kind of robots
        that cannot keep the limits.
        """
        for fault in self._way_faults(world):
            raise ValueError(f"Mission {quoted(self.name)}: {fault}.")

    def _way_faults(self, world: World) -> Iterator[str]:
        """List the kinds whose robots cannot keep limits on their way to their end."""
        for robot, way in worlds.failing_ways(world):
            kind, limits = self.kind_of[robot], world.limits
            least, longest = limits.floors[robot], limits.budgets[robot]
            start, end = map(quoted, kind.ends(self.base))
            who, there = f"robots of kind {quoted(kind.name)}", f"way from {start} to {end}"
            if self.nodes[way.nodes[-1] % len(self.nodes)] != kind.ends(self.base)[1]:
                yield f"{who} have no {there}"
                continue
            given = [f"min_survival {least:g}"] if least > 0 else []
            given += [f"max_length {longest:g}"] if longest < math.inf else []
            tried = f"The safest {there}, or the shortest one if that is too long,"
            found = f"is survived with {way.survival:.4g} and is {way.length:g} long"
            yield f"{who} cannot keep {' and '.join(given)}. {tried} {found}; no others are tried"

    def labels(self, plan: TrailPlan) -> tuple[tuple[Any, ...], ...]:
        """Return the trails of a plan of this mission as node labels, robot by robot."""
        return tuple(tuple(self.nodes[i] for i in trail) for trail in self.trails(plan))

    def trails(self, plan: TrailPlan) -> tuple[tuple[int, ...], ...]:
        """Return the trails of a plan as indices of ``nodes``, robot by robot.

        In ``plan.trails`` and ``world`` each kind has nodes of its own: of n nodes, node v of kind
        k, counted from 0, is ``k * n + v``.
        """
        if not isinstance(plan, TrailPlan):
            raise TypeError(f"Expected a TrailPlan, got {quoted(plan)}.")
        return tuple(tuple(i % len(self.nodes) for i in trail) for trail in plan.trails)

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

    def check_limits(self, plans: Plans, limits: Limits) -> FloatArray:
        """Compute the objectives (n_plans, 2) of plans whose robots keep their limits.

        A PlanError names a robot that does not.

        Parameters
        ----------
        plans
            As for :meth:`evaluate`, which also says what is raised.
        limits
            As of ``Mission.limits``, loosened by what rounding may take.
        """
        values = self._values(plans, strict=True)
        alive, floors, budgets = values.alive, limits.floors, limits.budgets
        for broken, found, limit, kept in (
            (alive < floors, alive, floors, "a survival of at least"),
            (values.lengths > budgets, values.lengths, budgets, "a length of at most"),
        ):
            for plan, robot in np.argwhere(broken)[:1].tolist():
                expected = f"{kept} {limit[robot]:g} in mission {quoted(self.name)}"
                got = f"{found[plan, robot]:g}"
                raise PlanError(f"Plan {plan}, robot {robot}: expected {expected}, got {got}.")
        return values.objectives

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
        fault = kernels.evaluate(self.world, *batch.arrays, strict, values)
        if fault[0] != kernels.VALID:
            raise PlanError(_fault_text(self, batch, fault))
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

    def pack(self, plans: Sequence[Sequence[Sequence[int]]]) -> PlanBatch:
        """Pack plans that are given as indices of ``nodes``, without looking at them.

        Parameters
        ----------
        plans
            A trail for each robot of each plan.
        """
        first = [len(self.nodes) * self.kinds.index(kind) for kind in self.kind_of]  # of layers
        trails = [trail for plan in plans for trail in plan]
        lengths = np.fromiter(map(len, trails), np.int64, len(trails))
        nodes = np.fromiter(chain.from_iterable(trails), np.int32, int(lengths.sum()))
        nodes += np.repeat(np.tile(np.array(first, np.int32), len(plans)), lengths)
        return PlanBatch(nodes, np.concatenate([[0], np.cumsum(lengths)]), self.robots)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mission):
            return NotImplemented
        return self is other or _identity(self) == _identity(other)

    def __hash__(self) -> int:
        return hash((self.nodes, self.base, self.robots, self.world.graph.survival.tobytes()))

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the missions of all scenarios, which can be made again."""
        return {name: value for name, value in vars(self).items() if name != "in_scenarios"}

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self  # immutable, and pymoo deep-copies algorithms together with their problem

    def __repr__(self) -> str:
        size = f"{len(self.nodes)} nodes, {len(self.graph.edges)} arcs"
        limit = "" if self.max_length is None else f", max_length {self.max_length:g}"
        team = f"{self.team} at base {self.base!r}, total reward {self.total_reward:g}"
        return f"<Mission {self.name!r}: {size}, {team}{limit}>"


class _Attributes(dict[str, Any]):
    """Attributes that cannot be changed, and neither can mappings among their values."""

    __slots__ = ()

    @classmethod
    def of(cls, attributes: Mapping[str, Any]) -> _Attributes:
        return cls((k, cls(v) if isinstance(v, Mapping) else v) for k, v in attributes.items())

    def copy(self) -> dict[str, Any]:
        """Return plain dictionaries, as ``graph.copy()`` needs them."""
        return {name: dict(v) if isinstance(v, _Attributes) else v for name, v in self.items()}

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        remedy = "change mission.graph.copy(), and make a Mission of that"
        raise TypeError(f"The graph of a mission cannot be changed: {remedy}.")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)  # by default it would be filled item by item


def _freeze(graph: nx.DiGraph[Any]) -> nx.DiGraph[Any]:
    """Make a graph immutable, also its attributes, which :func:`networkx.freeze` leaves open."""
    graph.graph = _Attributes.of(graph.graph)
    inside: Any = graph  # networkx has no public way to replace its dictionaries
    for node, attributes in inside._node.items():
        inside._node[node] = _Attributes.of(attributes)
    for tail, heads in inside._succ.items():
        for head, attributes in heads.items():
            heads[head] = inside._pred[head][tail] = _Attributes.of(attributes)
    return nx.freeze(graph)  # type: ignore[no-any-return]


def check_mission(value: object) -> Mission:
    """Return ``value`` if it is a mission; the TypeError for anything else says how to get one."""
    if isinstance(value, Mission):
        return value
    remedy = "load_mission(name_or_path) gives one"
    raise TypeError(f"Expected a Mission, got {quoted(value)}; {remedy}.")


def mission_digest(mission: Mission) -> str:
    """Return the digest of all that results depend on; names and positions are left out."""
    return numbers_digest(mission, [repr(node) for node in mission.nodes], repr(mission.base))


def numbers_digest(mission: Mission, *labels: object) -> str:
    """Return the digest of a mission's numbers, and of ``labels``.

    Labels are left out by default, since their types may change when they are read from a file.
    """
    of_kinds = [[kind.min_survival, kind.max_length] for kind in mission.kinds]
    limits = [x for x in (mission.max_length, of_kinds) if x not in (None, [[0.0, None]])]
    first = labels or [int(mission.world.team.end[0])]
    text = json.dumps([*first, mission.robots, *limits], separators=(",", ":"))
    hashed = hashlib.sha256(text.encode())
    for values in mission.world.numbers(mission.is_plain):
        hashed.update(np.ascontiguousarray(values, f"<{values.dtype.kind}8").tobytes())
    return hashed.hexdigest()[:16]


def _identity(mission: Mission) -> list[object]:
    """Return what equal missions share: not names of missions, nor positions."""
    own: list[object] = [mission.nodes, mission.base, mission.kinds, mission.max_length]
    return own + [values.tolist() for values in mission.world.numbers(mission.is_plain)]


def _fault_text(mission: Mission, batch: PlanBatch, fault: Sequence[int]) -> str:
    """Describe a fault that the kernel ``evaluate`` found: its kind, plan, robot and position."""
    what, plan, robot, position = fault
    where = f"Robot {robot}" if len(batch) == 1 else f"Plan {plan}, robot {robot}"
    if what == kernels.EMPTY_TRAIL:
        return f"{where}: expected a trail of at least one node, the base, got an empty one."
    where, name = f"{where}, position {position}", f"mission {quoted(mission.name)}"
    at = int(batch.offsets[plan * batch.n_robots + robot]) + position
    before, node = batch.nodes[[at - 1, at]].tolist()
    if what == kernels.UNKNOWN_NODE:
        n_nodes = mission.world.graph.n_nodes
        return f"{where}: node index {node} is unknown, {name} has {n_nodes} nodes."
    kind, n = mission.kind_of[robot], len(mission.nodes)
    tail, head = mission.nodes[before % n], mission.nodes[node % n]
    if what in (kernels.NOT_FROM_BASE, kernels.NOT_BACK_AT_BASE):
        does, end = ("begin", 0) if what == kernels.NOT_FROM_BASE else ("end", 1)
        expected, other = kind.ends(mission.base)[end], mission.kinds[node // n]
        there = f"{'base' if expected == mission.base else 'node'} {quoted(expected)}"
        got = quoted(head) + ("" if other == kind else f" of kind {quoted(other.name)}")
        return f"{where}: expected the trail to {does} at {there}, got {got}."
    problem = "is used twice in this trail; a trail uses an arc at most once,"
    if what == kernels.MISSING_ARC:
        is_closed = mission.graph.has_edge(tail, head)
        problem = f"cannot be taken by kind {quoted(kind.name)}" if is_closed else "is missing"
    return f"{where}: {rules.whose(tail, head)} {problem} in {name}."
