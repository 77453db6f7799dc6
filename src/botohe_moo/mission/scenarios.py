"""Scenarios: several worlds of which one is the true one."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo.base.messages import most_alike, quoted
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.rules import (
    BY_KIND,
    OF_NODES,
    ONLY_KIND,
    Kind,
    Rules,
    by_kind,
    faults_of,
    is_list,
    is_mapping,
    is_name,
    no_such_node,
    whose,
    within,
)

OTHERWISE = "otherwise"  # the name of the scenario in which nothing else is so


@dataclass(frozen=True)
class Scenario:
    """One of several worlds that may be the true one, and what is different in it.

    Where it says nothing, the values of the graph hold.

    Parameters
    ----------
    name
        Its name.
    probability
        The probability that it is the true one, in (0, 1]. Where those of all scenarios sum to less
        than 1, there is another, ``otherwise``, in which the values of the graph hold.
    factor
        What hazards, −log of survivals, are multiplied by, at least 0.
    zone
        The nodes' attribute ``zone``: ``factor`` holds for arcs that begin or end in this zone.
        Default: for all arcs.
    survival
        Survivals in [0, 1] of some arcs, each by its tail and head: (tail, head) → a number, or a
        mapping from kinds to numbers. 0 closes the arc. The factor does not count there.
    reward
        Rewards of some nodes, at least 0: node → number.

    Examples
    --------
    >>> from botohe_moo import Mission, Scenario, load_mission
    >>> toy = load_mission("toy")
    >>> storm = Scenario("storm", probability=0.25, factor=3)
    >>> mission = Mission(toy.graph, scenarios=[storm])
    >>> [scenario.name for scenario in mission.scenarios]
    ['storm', 'otherwise']
    >>> plan = mission.plan([[1, 2, 4, 2, 1], [1]])
    >>> mission.evaluate([plan]).round(2).tolist()
    [[2.96, 1.56]]
    """

    name: str
    probability: float
    factor: float = 1.0
    zone: str | None = None
    survival: Mapping[tuple[Hashable, Hashable], Any] = field(default_factory=dict, hash=False)
    reward: Mapping[Hashable, float] = field(default_factory=dict, hash=False)


_SUMS = 1e-9  # by how much the probabilities of scenarios may differ from 1
_OF_SCENARIOS: Rules = {
    "probability": ("probability in (0, 1]", within(math.ulp(0), 1), None),
    "factor": ("a finite factor >= 0", within(0), 1.0),
    "zone": ("zone to be a text", lambda v: v is None or isinstance(v, str), None),
    "survival": ("survival to be a mapping from arcs to numbers", is_mapping, {}),
    "reward": ("reward to be a mapping from nodes to numbers", is_mapping, {}),
}


def read_scenarios(scenarios: Any, find: Callable[[Any], Any]) -> Any:
    """Return scenarios as a graph holds them, from mappings as files hold them, or from texts.

    Those have lists in place of mappings from nodes and arcs: [tail, head, survival] and [node,
    reward]. ``find`` returns the node of a label. A text is such as "storm=0.2,factor=8,zone=east".
    What is not of this form stays as it is.
    """
    if not isinstance(scenarios, list | tuple):
        return scenarios
    found = []
    for given in scenarios:
        own = dict(given) if isinstance(given, Mapping) else given
        if isinstance(own, str):
            first, *others = (part.partition("=")[::2] for part in own.split(","))
            own = {"name": first[0], "probability": first[1], **dict(others)}
            for name in {"probability", "factor"} & own.keys():
                with suppress(ValueError):
                    own[name] = float(own[name])
        for name, n_labels in (("survival", 2), ("reward", 1)):
            rows = own.get(name) if isinstance(own, dict) else None
            if isinstance(rows, list) and all(is_list(r) and len(r) == n_labels + 1 for r in rows):
                labels = [tuple(map(find, row[:-1])) for row in rows]
                values = [row[-1] for row in rows]
                keys = labels if n_labels > 1 else [label for (label,) in labels]
                own[name] = dict(zip(keys, values, strict=True))
        found.append(own)
    return found


def check_scenarios(
    scenarios: Any, graph: nx.DiGraph[Any], kinds: Sequence[Kind]
) -> tuple[tuple[Scenario, ...], list[str]]:
    """Return all scenarios of a mission on a graph, and what is wrong with them.

    There are none if ``scenarios`` is None or empty.
    """
    if scenarios is None:
        return (), []
    if isinstance(scenarios, str | Mapping) or not isinstance(scenarios, Iterable):
        return (), [f"expected scenarios to be a list of scenarios, got {quoted(scenarios)}"]
    found, faults, known = list[Scenario](), list[str](), [f.name for f in fields(Scenario)]
    for i, scenario in enumerate(scenarios):
        given = vars(scenario) if isinstance(scenario, Scenario) else scenario
        if not isinstance(given, Mapping):
            faults.append(f"scenarios[{i}]: expected a Scenario, or an object, got {quoted(given)}")
        elif unknown := [str(name) for name in given if name not in known]:
            near = most_alike(unknown[0], known)
            faults.append(f"scenarios[{i}]: there is no {quoted(unknown[0])} of a scenario{near}")
        else:
            found.append(Scenario(**{"name": None, "probability": None, **given}))
    if faults or not found:
        return (), faults
    for scenario in found:
        wrong = _scenario_faults(scenario, graph, kinds or [Kind(ONLY_KIND, 1)])
        faults += [f"scenario {quoted(scenario.name)}: {fault}" for fault in wrong]
    names = [scenario.name for scenario in found]
    twice = dict.fromkeys(name for i, name in enumerate(names) if name in names[:i])
    faults += [f"scenario {quoted(name)}: there are two of this name" for name in twice]
    if faults:
        return (), faults
    total = math.fsum(scenario.probability for scenario in found)
    if total > 1.0 + _SUMS:
        return (), [f"expected probabilities of scenarios that sum to at most 1, got {total:g}"]
    if total < 1.0 - _SUMS:
        if OTHERWISE in names:
            fault = f"probabilities of scenarios sum to {total:g}, and one is called {OTHERWISE}"
            return (), [f"expected 1: {fault}"]
        found.append(Scenario(OTHERWISE, 1.0 - total))
    return tuple(found), []


def _scenario_faults(
    scenario: Scenario, graph: nx.DiGraph[Any], kinds: Sequence[Kind]
) -> Iterator[str]:
    """List what is wrong with a scenario."""
    if not is_name(scenario.name):
        yield "expected a printable name without : , = and blanks around it"
    yield from faults_of(vars(scenario), _OF_SCENARIOS)
    zones = {of["zone"] for _, of in graph.nodes(data=True) if isinstance(of.get("zone"), str)}
    if scenario.zone is not None and scenario.zone not in zones:
        near = most_alike(str(scenario.zone), sorted(zones)) or "; no node has a zone"
        yield f"zone {quoted(scenario.zone)}: no node has this zone{near}"
    names = [kind.name for kind in kinds]
    rules: Rules = {"survival": BY_KIND["survival"]}
    for arc, value in scenario.survival.items() if is_mapping(scenario.survival) else ():
        if not (isinstance(arc, tuple) and len(arc) == 2 and graph.has_edge(*arc)):
            yield f"survival of {quoted(arc)}: expected the tail and the head of an arc"
        elif unknown := [str(k) for k in value if k not in names] if is_mapping(value) else []:
            yield f"{whose(*arc)}: survival of kind {quoted(unknown[0])}: no such kind"
        else:
            wrong = faults_of({"survival": value}, rules, names)
            yield from (f"{whose(*arc)}: {fault}" for fault in wrong)
    for node, value in scenario.reward.items() if is_mapping(scenario.reward) else ():
        if node not in graph:
            yield no_such_node("reward", node, graph)
        else:
            wrong = faults_of({"reward": value}, {"reward": OF_NODES["reward"]})
            yield from (f"{whose(node)}: {fault}" for fault in wrong)


def survivals_in(
    scenario: Scenario, graph: Any, arc: tuple[Any, Any], kinds: Sequence[Kind]
) -> list[tuple[float, float]]:
    """Return the survival of an arc in a scenario for each kind, with that of the graph."""
    given = by_kind(graph.edges[arc]["survival"], kinds)
    if arc in scenario.survival:
        return list(zip(by_kind(scenario.survival[arc], kinds), given, strict=True))
    is_here = scenario.zone is None or scenario.zone in [graph.nodes[v].get("zone") for v in arc]
    factor = float(scenario.factor) if is_here else 1.0
    return [(n**factor if n > 0.0 else 0.0, n) for n in given]


def in_scenarios(mission: Any, arcs: Sequence[tuple[Any, Any]]) -> tuple[FloatArray, FloatArray]:
    """Return survivals of arcs (n_scenarios, n_arcs, n_kinds) and rewards (n_scenarios, n_nodes).

    An arc that the graph closes for a kind stays closed for it.
    """
    graph, kinds = mission.graph, mission.kinds
    survival = np.zeros((len(mission.scenarios), len(arcs), len(kinds)))
    reward = np.empty((len(mission.scenarios), len(mission.nodes)))
    for s, scenario in enumerate(mission.scenarios):
        for i, arc in enumerate(arcs):
            numbers = survivals_in(scenario, graph, arc, kinds)
            survival[s, i] = [n if m > 0.0 else 0.0 for n, m in numbers]
        reward[s] = [float(scenario.reward.get(v, of["reward"])) for v, of in graph.nodes.items()]
    return survival, reward
