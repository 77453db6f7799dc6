"""Scenarios: several possible worlds, one of which is true."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import networkx as nx
import numpy as np

from botohe_moo.base.files import read_number
from botohe_moo.base.messages import most_alike, quoted
from botohe_moo.base.parameters import NotNegative, Positive, Probability, check
from botohe_moo.base.types import FloatArray
from botohe_moo.mission import rules
from botohe_moo.mission.rules import Kind, Rules, by_kind, faults_of, is_list, is_mapping, whose

OTHERWISE = "otherwise"  # the name of the scenario in which nothing else is so


@dataclass(frozen=True)
class Scenario:
    """One of several possible worlds, and what is different in it.

    Anything that it leaves out is as in the graph.

    Parameters
    ----------
    name
        Its name.
    probability
        The probability that it is true, in (0, 1]. Where those of all scenarios sum to less
        than 1, there is another, ``otherwise``, in which the values of the graph hold.
    factor
        What hazards, −log of survivals, are multiplied by, at least 0.
    zone
        A zone, or several: ``factor`` holds for arcs that begin or end in one of them. A node's
        attribute ``zone`` says in which it is. Default: for all arcs.
    survival
        Survivals in [0, 1] of some arcs, each by its tail and head: (tail, head) → a number, or a
        mapping from kinds to numbers. 0 closes the arc; one that the graph closes stays closed. The
        factor does not count there.
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
    zone: str | Collection[str] | None = field(default=None, hash=False)
    survival: Mapping[tuple[Hashable, Hashable], Any] = field(default_factory=dict, hash=False)
    reward: Mapping[Hashable, float] = field(default_factory=dict, hash=False)


_ROUNDING = 1e-14  # of the sum of probabilities
_SUMS = 1e-9  # by how much the probabilities of scenarios may differ from 1
_OF_SCENARIOS: Rules = {
    "probability": ("probability in (0, 1]", rules.within(math.ulp(0), 1), None),
    "factor": ("a finite factor >= 0", rules.within(0), 1.0),
    "zone": ("zone to be a text, or several", lambda v: _are_texts(_zones(v)), None),
    "survival": ("survival to be a mapping from arcs to numbers", is_mapping, {}),
    "reward": ("reward to be a mapping from nodes to numbers", is_mapping, {}),
}


def read_scenarios(scenarios: Any, find: Callable[[Any], Any]) -> Any:
    """Return scenarios as a graph holds them, from mappings as files hold them, or from texts.

    Files have lists in place of mappings from nodes and arcs: [tail, head, survival] and [node,
    reward]. ``find`` returns the node of a label. A text is such as "storm=0.2,factor=8,zone=east";
    ``+`` joins several zones. What is not of this form stays as it is.
    """
    if not isinstance(scenarios, list | tuple):
        return scenarios
    found = []
    for given in scenarios:
        own = vars(given) if isinstance(given, Scenario) else given
        own = dict(own) if isinstance(own, Mapping) else own
        if isinstance(own, str):
            parts = (part.partition("=")[::2] for part in own.split(","))
            first, *others = ((name.strip(), value.strip()) for name, value in parts)
            own = {"name": first[0], "probability": first[1], **dict(others)}
            if "+" in own.get("zone", ""):
                own["zone"] = [zone.strip() for zone in own["zone"].split("+")]
            own |= {name: read_number(own[name]) for name in {"probability", "factor"} & own.keys()}
        for name, n_labels in (("survival", 2), ("reward", 1)):
            rows = own.get(name) if isinstance(own, dict) else None
            if isinstance(rows, list) and all(is_list(r) and len(r) == n_labels + 1 for r in rows):
                labels = [tuple(map(find, row[:-1])) for row in rows]
                values = [row[-1] for row in rows]
                keys = labels if n_labels > 1 else [label for (label,) in labels]
                own[name] = dict(zip(keys, values, strict=True))
        found.append(own)
    return found


def names_of(scenarios: Any) -> list[str]:
    """Return the names of scenarios, as far as they have the form of any."""
    given = scenarios if isinstance(scenarios, list) else []
    names = [one.get("name") for one in given if isinstance(one, dict)]
    return [name for name in names if isinstance(name, str)]


def add_survivals(
    scenarios: Any, survivals: Mapping[Any, Mapping[Any, Any]], graph: nx.DiGraph[Any]
) -> None:
    """Add to each scenario the survivals that a table has under its name; its own hold."""
    for scenario in scenarios if isinstance(scenarios, list) else ():
        [name] = names_of([scenario]) or [""]
        of_table = {arc: n for arc, n in survivals.get(name, {}).items() if graph.has_edge(*arc)}
        if of_table and is_mapping(scenario.get("survival", {})):
            scenario["survival"] = of_table | scenario.get("survival", {})


def check_scenarios(
    scenarios: Any, graph: nx.DiGraph[Any], kinds: Sequence[Kind]
) -> tuple[tuple[Scenario, ...], list[str]]:
    """Return all scenarios of a mission on a graph, and what is wrong with them.

    There are none if ``scenarios`` is None or empty.
    """
    if scenarios is None:
        return (), []
    found, faults = rules.read_listed("scenarios", Scenario, scenarios)
    if faults or not found:
        return (), faults
    names = [scenario.name for scenario in found]
    of_kinds = [kind.name for kind in kinds if kind.name in names]
    faults += [f"scenario {quoted(name)}: a kind of robots has this name" for name in of_kinds]
    for scenario in found:
        wrong = _scenario_faults(scenario, graph, kinds or [Kind(rules.ONLY_KIND, 1)])
        faults += [f"scenario {quoted(scenario.name)}: {fault}" for fault in wrong]
    if faults:
        return (), faults
    if twice := dict.fromkeys(name for i, name in enumerate(names) if name in names[:i]):
        return (), [f"scenario {quoted(name)}: there are two of this name" for name in twice]
    total = math.fsum(scenario.probability for scenario in found)
    if total > 1.0 + _SUMS:
        return (), [f"expected probabilities of scenarios that sum to at most 1, got {total:g}"]
    if total < 1.0 - _SUMS:
        if OTHERWISE in names:
            expected = f"expected probabilities that sum to 1, got {total:g}"
            return (), [f"{expected}: what is left is called {OTHERWISE}, as one scenario is"]
        found.append(Scenario(OTHERWISE, 1.0 - total))
        total = 1.0
    return tuple(_normalized(scenario, total) for scenario in found), []


def _normalized(scenario: Scenario, total: float) -> Scenario:
    """Return a valid scenario with plain numbers, and mappings of its own.

    ``total`` is the sum of all probabilities, by which they are divided where it is not 1.
    """
    probability = float(scenario.probability)
    return replace(
        scenario,
        probability=probability if abs(total - 1.0) < _ROUNDING else probability / total,
        factor=float(scenario.factor),
        zone=scenario.zone if scenario.zone is None else _plain(_zones(scenario.zone)),
        survival={a: dict(n) if is_mapping(n) else n for a, n in scenario.survival.items()},
        reward=dict(scenario.reward),
    )


def _plain(zones: tuple[str, ...]) -> str | tuple[str, ...]:
    """Return one zone as it is, and several in order."""
    return zones[0] if len(zones) == 1 else tuple(sorted(zones))


def _zones(zone: Any) -> tuple[Any, ...]:
    """Return zones as a scenario has them; all of them are none."""
    return (zone,) if isinstance(zone, str) or not isinstance(zone, Collection) else tuple(zone)


def _are_texts(zones: tuple[Any, ...]) -> bool:
    return zones == (None,) or (len(zones) > 0 and all(isinstance(zone, str) for zone in zones))


def _scenario_faults(
    scenario: Scenario, graph: nx.DiGraph[Any], kinds: Sequence[Kind]
) -> Iterator[str]:
    """List what is wrong with a scenario."""
    if not rules.is_name(scenario.name):
        yield "expected a printable name without : , = and blanks around it"
    yield from faults_of(vars(scenario), _OF_SCENARIOS)
    known = {of["zone"] for _, of in graph.nodes(data=True) if isinstance(of.get("zone"), str)}
    for zone in _zones(scenario.zone):
        if isinstance(zone, str) and zone not in known:
            near = most_alike(zone, sorted(known)) or "; no node has a zone"
            yield f"zone {quoted(zone)}: no node has this zone{near}"
    names = [kind.name for kind in kinds]
    of_survival: Rules = {"survival": rules.BY_KIND["survival"]}
    for arc, value in scenario.survival.items() if is_mapping(scenario.survival) else ():
        if not (isinstance(arc, tuple) and len(arc) == 2 and graph.has_edge(*arc)):
            yield f"survival of {quoted(arc)}: expected the tail and the head of an arc"
        elif unknown := [str(k) for k in value if k not in names] if is_mapping(value) else []:
            yield f"{whose(*arc)}: survival of kind {quoted(unknown[0])}: no such kind"
        else:
            wrong = faults_of({"survival": value}, of_survival, names)
            yield from (f"{whose(*arc)}: {fault}" for fault in wrong)
    for node, value in scenario.reward.items() if is_mapping(scenario.reward) else ():
        if node not in graph:
            yield rules.no_such_node("reward", node, graph)
        else:
            wrong = faults_of({"reward": value}, {"reward": rules.OF_NODES["reward"]})
            yield from (f"{whose(node)}: {fault}" for fault in wrong)


def survivals_in(
    scenario: Scenario, graph: Any, arc: tuple[Any, Any], kinds: Sequence[Kind]
) -> list[float]:
    """Return the survival of an arc in a scenario for each kind; 0 where the graph closes it."""
    given = by_kind(graph.edges[arc]["survival"], kinds)
    if arc in scenario.survival:
        found = by_kind(scenario.survival[arc], kinds)
    else:
        factor = _factor_on(scenario, graph, arc)
        found = [n**factor for n in given]
    return [n if m > 0.0 else 0.0 for n, m in zip(found, given, strict=True)]


def _factor_on(scenario: Scenario, graph: Any, arc: tuple[Any, Any]) -> float:
    """Return what the hazard of an arc is multiplied by in a scenario."""
    zones = _zones(scenario.zone)
    is_here = scenario.zone is None or any(graph.nodes[v].get("zone") in zones for v in arc)
    return float(scenario.factor) if is_here else 1.0


def in_scenarios(mission: Any, arcs: Sequence[tuple[Any, Any]]) -> tuple[FloatArray, FloatArray]:
    """Return survivals (n_scenarios, n_arcs, n_kinds) and rewards (n_scenarios, n_nodes)."""
    graph, kinds, cases = mission.graph, mission.kinds, mission.scenarios
    survival = [[survivals_in(of, graph, arc, kinds) for arc in arcs] for of in cases]
    reward = [[of.reward.get(v, usual) for v, usual in graph.nodes(data="reward")] for of in cases]
    shape = len(cases), len(arcs), len(kinds)
    return np.array(survival, np.float64).reshape(shape), np.array(reward, np.float64)


def independent_zones(
    probabilities: Mapping[str, float], factor: float, *, calm: float = 1.0
) -> list[Scenario]:
    """Return the scenarios of zones of which each is struck or not, independently of the others.

    There is one for each set of zones, so that ten zones give 1024. Time and memory of most
    searches grow with their number.

    Parameters
    ----------
    probabilities
        How probable it is that a zone is struck, in [0, 1].
    factor
        What hazards on arcs that begin or end in a zone that is struck are multiplied by.
    calm
        What all hazards are multiplied by where no zone is struck.

    Returns
    -------
    list of Scenario
        Named by the zones that are struck, such as ``east and west``, or ``calm``. Those of
        probability 0 are left out.

    Examples
    --------
    >>> from botohe_moo import independent_zones
    >>> found = independent_zones({"east": 0.5, "west": 0.25}, factor=8)
    >>> [(scenario.name, scenario.probability) for scenario in found]
    [('calm', 0.375), ('west', 0.125), ('east', 0.375), ('east and west', 0.125)]
    """
    chances = dict(probabilities)
    factor, calm = check("factor", factor, NotNegative), check("calm", calm, NotNegative)
    for zone, probability in chances.items():
        check(f"the probability of {quoted(zone)}", probability, Probability)
    found = []
    for struck in product((False, True), repeat=len(chances)):
        zones = tuple(zone for zone, is_struck in zip(chances, struck, strict=True) if is_struck)
        each = zip(chances.values(), struck, strict=True)
        probability = math.prod(p if is_struck else 1.0 - p for p, is_struck in each)
        if probability > 0.0 and zones:
            found.append(Scenario(" and ".join(zones), probability, factor, zones))
        elif probability > 0.0:
            found.append(Scenario("calm", probability, calm))
    return found


def scenarios_from_samples(
    graph: Any,
    counts: Mapping[Any, tuple[float, float]],
    *,
    by: str = "class",
    prior: tuple[float, float] = (0.5, 0.5),
    n_scenarios: int = 16,
    seed: int = 1,
) -> list[Scenario]:
    """Return scenarios of survivals that are known from few crossings only.

    Survivals of arcs of one class are the same in a scenario, and unknown: they are drawn from the
    Beta distribution that follows from the counts. A plan is then good on average over what the
    survivals may be.

    Parameters
    ----------
    graph
        An ``nx.DiGraph``, that of the mission. Arcs without a class, or of one without counts, keep
        their survivals.
    counts
        Class → (how many robots have crossed an arc of it, how many of these were lost).
    by
        The arcs' attribute that names their class.
    prior
        The two parameters of the Beta distribution before any crossing, for survivals and losses.
        The default is that of Jeffreys. An expert's 0.93 that is worth ten crossings is (9.3, 0.7).
    n_scenarios
        How many scenarios, all equally probable.
    seed
        Of the draws.

    Returns
    -------
    list of Scenario
        Named ``sample 1`` and so on. The draws are stratified: each of ``n_scenarios`` equally
        probable ranges of each survival has one (Latin hypercube; McKay, Beckman and Conover,
        1979).

    Raises
    ------
    ValueError
        If there are more losses than crossings, a number is out of its range, or no arc has one of
        the classes.

    Examples
    --------
    >>> import networkx as nx
    >>> from botohe_moo import load_mission, scenarios_from_samples
    >>> graph = load_mission("toy").graph.copy()
    >>> nx.set_edge_attributes(graph, "stairs", "class")
    >>> found = scenarios_from_samples(graph, {"stairs": (20, 1)}, n_scenarios=4)
    >>> [round(scenario.survival[1, 2], 2) for scenario in found]
    [0.84, 0.94, 0.98, 0.96]
    """
    from scipy.stats import beta, qmc  # imported late: it takes time

    n_scenarios = check("n_scenarios", n_scenarios, int, ge=1)
    before = [check("prior", number, Positive) for number in prior]
    if not counts:
        raise ValueError("Expected counts of at least one class of arcs, got none.")
    parameters = []
    for name, of_class in counts.items():
        if not (is_list(of_class) and len(of_class) == 2):
            expected = f"crossings and losses of {quoted(name)}, two numbers"
            raise ValueError(f"Expected {expected}, got {quoted(of_class)}.")
        crossings, lost = of_class
        check(f"crossings of {quoted(name)}", crossings, NotNegative)
        check(f"losses of {quoted(name)}", lost, float, ge=0, le=crossings)
        parameters.append((before[0] + crossings - lost, before[1] + lost))
    arcs = {name: [arc for arc, of in graph.edges.items() if of.get(by) == name] for name in counts}
    if missing := [str(name) for name, of_class in arcs.items() if not of_class]:
        raise ValueError(f"Expected arcs with {by} {quoted(missing[0])}, found none.")
    shares = qmc.LatinHypercube(len(counts), rng=seed).random(n_scenarios)
    drawn = beta.ppf(shares, *np.transpose(parameters))
    found = []
    for i, row in enumerate(drawn.tolist(), 1):
        pairs = zip(row, arcs.values(), strict=True)
        survival = {arc: number for number, of_class in pairs for arc in of_class}
        found.append(Scenario(f"sample {i}", 1.0 / n_scenarios, survival=survival))
    return found


def with_marginals(
    graph: nx.DiGraph[Any], scenarios: Sequence[Scenario], kinds: Sequence[Kind]
) -> nx.DiGraph[Any]:
    """Return the graph with survivals from which scenarios make those of before, on average.

    A ValueError names an arc for which there are none.
    """
    scaled, total = graph.copy(), math.fsum(scenario.probability for scenario in scenarios)
    for arc, of in scaled.edges.items():
        found: dict[str, float] = {}
        for kind, wanted in zip(kinds, by_kind(of["survival"], kinds), strict=True):
            # What scenarios say themselves, and of the others their probabilities by factors.
            fixed, factors = 0.0, defaultdict[float, float](float)
            for scenario in scenarios:
                probability = scenario.probability / total
                if arc in scenario.survival:
                    fixed += probability * by_kind(scenario.survival[arc], [kind])[0]
                else:
                    factors[_factor_on(scenario, graph, arc)] += probability
            found[kind.name] = _base_survival(wanted, fixed, factors) if wanted > 0.0 else 0.0
            if math.isnan(found[kind.name]):
                raise ValueError(f"{whose(*arc)}: no hazard gives a mean survival of {wanted:g}")
        of["survival"] = found if len(kinds) > 1 or 0.0 in found.values() else min(found.values())
    return scaled


def _base_survival(wanted: float, fixed: float, factors: Mapping[float, float]) -> float:
    """Return ω so that ``fixed`` and the mean of ω^factor are as wanted together; NaN for none.

    ``factors`` have their probabilities.
    """
    from scipy.optimize import brentq  # imported late: it takes time

    def excess(hazard: float) -> float:
        return fixed + sum(p * math.exp(-hazard * f) for f, p in factors.items()) - wanted

    if not factors:
        return wanted
    if abs(excess(0.0)) < _ROUNDING:
        return 1.0
    most = 700.0 / min((factor for factor in factors if factor > 0.0), default=math.inf)
    if excess(0.0) < 0.0 or excess(most) > 0.0:
        return math.nan
    return max(math.exp(-float(brentq(excess, 0.0, most, xtol=1e-14))), math.ulp(0.0))
