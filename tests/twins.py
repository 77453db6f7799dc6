"""Readable twins of the compiled kernels: plain Python, one rule a line."""

from __future__ import annotations

from contextlib import contextmanager
from fractions import Fraction
from functools import lru_cache
from importlib import import_module
from itertools import combinations_with_replacement, pairwise, product
from math import inf, log, prod
from pkgutil import iter_modules
from types import SimpleNamespace

import networkx as nx
import numpy as np
import pytest

from botohe_moo.algorithms.local_search import kernels as local_search
from botohe_moo.core.ordered import read_front
from botohe_moo.core.world import new_limits


def of_kind(value, kind):
    """What an attribute is to a kind: one number for all kinds, or a number by name, or 1."""
    return value.get(kind.name, 1.0) if isinstance(value, dict) else value


def survivals(mission, kind):
    """The survival of each arc that a kind can take on a way from its start to its end."""
    arcs = {(u, v): of_kind(s, kind) for u, v, s in mission.graph.edges(data="survival")}
    start, end = kind.ends(mission.base)
    ways = nx.DiGraph(arc for arc, survival in arcs.items() if survival > 0)
    ways.add_nodes_from([start, end])
    useful = (nx.descendants(ways, start) | {start}) & (nx.ancestors(ways, end) | {end})
    return {arc: arcs[arc] for arc in ways.edges if useful.issuperset(arc)}


def alive_along(mission, kind, trail):
    """The probability that a robot of a kind is alive at each position of a label trail."""
    hops = [mission.graph.edges[arc]["survival"] for arc in pairwise(trail)]
    return [prod(of_kind(s, kind) for s in hops[:i]) for i in range(len(trail))]


def credited(mission, trail, aboard=()):
    """Every node of a label trail whose reward is credited, with the position where it is."""
    nodes, first_visits = mission.graph.nodes, {v: trail.index(v) for v in trail}
    first_visits |= dict.fromkeys(aboard, 0)
    depots = [i for i, v in enumerate(trail) if v == mission.base or nodes[v].get("depot")]
    for node, visit in first_visits.items():
        returns = visit not in depots and nodes[node].get("pays", mission.pays) == "return"
        at = min((i for i in depots if i > visit), default=None) if returns else visit
        if at is not None:
            yield node, at


def share_of(mission, kind, node):
    """With what probability a robot of a kind that gets to a node collects its reward."""
    return of_kind(mission.graph.nodes[node].get("share", 1.0), kind)


def collects(mission, kind, trail, aboard=None):
    """With what probability a robot of a kind collects the reward of each node."""
    alive = alive_along(mission, kind, trail)
    aboard = kind.aboard if aboard is None else aboard
    return {
        node: share_of(mission, kind, node) * alive[at]
        for node, at in credited(mission, trail, aboard)
    }


def evaluate(mission, trails, kinds=None):
    """E[R] and E[S] of label trails of robots of these kinds, straight from the formulas.

    Without kinds the trails are those of the mission's robots, in order.
    """
    if mission.scenarios:
        chances = np.array([scenario.probability for scenario in mission.scenarios])
        return tuple(chances @ [evaluate(case, trails, kinds) for case in cases(mission)])
    robots = list(zip(kinds or mission.kind_of, trails, strict=False))
    chances = [collects(mission, kind, trail) for kind, trail in robots]
    expected_reward = sum(
        reward * (1 - prod(1 - chance.get(node, 0.0) for chance in chances))
        for node, reward in mission.graph.nodes(data="reward")
    )
    survives = (alive_along(mission, kind, trail)[-1] for kind, trail in robots if trail)
    return expected_reward, sum(survives)


def cases(mission):
    """The mission in each scenario, with what twins ask of a mission; arcs may be closed there."""
    found = []
    for scenario in mission.scenarios:
        graph = mission.graph.copy()
        for tail, head, arc in graph.edges(data=True):
            zones = {graph.nodes[tail].get("zone"), graph.nodes[head].get("zone")}
            factor = scenario.factor if scenario.zone in {None, *zones} else 1.0
            for kind in mission.kinds:
                usual = of_kind(mission.graph.edges[tail, head]["survival"], kind)
                value = usual**factor if usual > 0 else 0.0
                if (tail, head) in scenario.survival and usual > 0:
                    value = of_kind(scenario.survival[tail, head], kind)
                arc[kind.name] = value
            arc["survival"] = {kind.name: arc[kind.name] for kind in mission.kinds}
        for node, reward in scenario.reward.items():
            graph.nodes[node]["reward"] = reward
        same = {name: getattr(mission, name) for name in ("base", "pays", "kinds", "kind_of")}
        found.append(SimpleNamespace(graph=graph, nodes=mission.nodes, scenarios=(), **same))
    return found


def trail_lengths(mission, trails):
    """Return the length of each trail of labels; an arc has length 1 by default."""
    arcs = mission.graph.edges
    return [sum(arcs[hop].get("length", 1.0) for hop in pairwise(trail)) for trail in trails]


def exact_figures(mission, trails):
    """E[R] and E[S] of label trails, in fractions."""
    survival = {(u, v): Fraction(s) for u, v, s in mission.graph.edges(data="survival")}
    reward = survivors = Fraction(0)
    reaches = []
    for trail in trails:
        alive, chances = Fraction(1), {trail[0]: Fraction(1)}
        for arc in pairwise(trail):
            alive *= survival[arc]
            chances.setdefault(arc[1], alive)
        survivors += alive
        reaches.append(chances)
    for node, pays in mission.graph.nodes(data="reward"):
        missed = prod(1 - chances.get(node, 0) for chances in reaches)
        reward += Fraction(pays) * (1 - missed)
    return reward, survivors


def fates(mission, kind, trail):
    """Every fate of a robot of a kind: (probability, nodes that it is credited with, survives).

    It is lost on one of its arcs, or on none.
    """
    nodes, alive = mission.graph.nodes, 1.0
    for i, hop in enumerate([*pairwise(trail), None]):
        survival = of_kind(mission.graph.edges[hop]["survival"], kind) if hop else 0.0
        paid, carried = [], list(kind.aboard)
        for j, node in enumerate(trail[: i + 1]):  # the arcs before were survived
            if node not in (*trail[:j], *kind.aboard):
                carried.append(node)
                if nodes[node].get("pays", mission.pays) == "arrival":
                    paid.append(carried.pop())
            if node == mission.base or nodes[node].get("depot"):
                paid, carried = paid + carried, []
        yield alive * (1 - survival), set(paid), hop is None
        alive *= survival


def enumerate_outcomes(mission, trails):
    """Every joint fate of a plan: (probability, expected team reward, number of survivors)."""
    nodes, robots = mission.graph.nodes, list(zip(mission.kind_of, trails, strict=True))
    for joint in product(*(list(fates(mission, kind, trail)) for kind, trail in robots)):
        missed = {}
        for (kind, _), (_, paid, _) in zip(robots, joint, strict=True):
            for node in paid:
                missed[node] = missed.get(node, 1.0) * (1 - share_of(mission, kind, node))
        yield (
            prod(probability for probability, _, _ in joint),
            sum(nodes[node]["reward"] * (1 - chance) for node, chance in missed.items()),
            sum(survives for *_, survives in joint),
        )


class Ant:
    """An ant of the colony, one rule a line.

    ``rule`` are ColonySettings, ``pheromone`` holds one dict a robot from arcs (self-loops at the
    ends of trails among them) to (τ_R, τ_S), ``weight`` is the ant's λ, and trails keep the limits
    of ``world``, by default none. Nodes are indices of kernels. Robots go out one after the other,
    or all at once, and take one hop each in turn.
    """

    def __init__(self, mission, rule, pheromone, weight, world=None):
        self.mission, self.rule, self.pheromone, self.weight = mission, rule, pheromone, weight
        self.limits, self.n_nodes = (world or alike(mission)).limits, len(mission.nodes)
        self.concurrent = rule.allocation == "concurrent"
        self.ends = [ends_of(mission, robot) for robot in range(mission.robots)]
        self.aboard = [  # as indices of kernels
            {start - start % self.n_nodes + mission.index(label) for label in kind.aboard} - {start}
            for kind, (start, _) in zip(mission.kind_of, self.ends, strict=True)
        ]
        self.survival, self.length = _arcs(mission)
        self.expected = {node: self.expect(node) for node in range(mission.world.graph.n_nodes)}
        self.leaving = {node: [] for node in self.expected}
        for arc in self.survival:
            self.leaving[arc[0]].append(arc)

    def expect(self, node):
        """With what probability a robot that gets to a node and then goes home is paid there."""
        mission, label = self.mission, self.mission.nodes[node % self.n_nodes]
        share = share_of(mission, mission.kinds[node // self.n_nodes], label)
        attributes = mission.graph.nodes[label]
        at_depot = label == mission.base or attributes.get("depot")
        on_return = attributes.get("pays", mission.pays) == "return" and not at_depot
        return share * mission.world.ways.home[node] if on_return else share

    def worth(self, node):
        return self.mission.rewards[node % self.n_nodes] * self.expected[node]

    def leads_back(self, used, node, robot):
        """Whether the safest or the shortest way over unused arcs leads home within the limits."""
        left, end = nx.DiGraph(arc for arc in self.survival if arc not in used), self.ends[robot][1]
        left.add_nodes_from([node, end])
        if not nx.has_path(left, node, end):
            return False
        for arc in left.edges:
            left.edges[arc].update(cost=-log(self.survival[arc]), length=self.length[arc])
        least, longest = self.limits.floors[robot], self.limits.budgets[robot]
        for weight in ("cost", "length"):
            way = nx.dijkstra_path(left, node, end, weight=weight)
            trail = [*used, *pairwise(way)]
            alive = prod(self.survival[arc] for arc in trail)
            length = sum(self.length[arc] for arc in trail)
            if alive >= least and length <= longest:
                return True
        return False

    def attraction(self, arc, trail, unreached, robot):
        survival = self.survival.get(arc, 1.0)
        eta_reward, eta_survival = self.rule.reward_epsilon, self.rule.survival_epsilon + survival
        if arc[1] not in trail and arc[1] not in self.aboard[robot]:
            gained = self.rule.unvisited_bonus + survival * self.worth(arc[1])
            eta_reward += gained * unreached[arc[1] % self.n_nodes]
        if not self.rule.heuristic:
            eta_reward = eta_survival = 1.0
        tau_reward, tau_survival = self.pheromone[robot][arc]
        reward, survivors = tau_reward * eta_reward, tau_survival * eta_survival
        return reward ** (1 - self.weight) * survivors**self.weight

    def hops(self, trail, unreached, robot):
        """Every hop that may extend the trail, with its probability; the loop ends it."""
        here, used, end = trail[-1], set(pairwise(trail)), self.ends[robot][1]
        free = [arc for arc in self.leaving[here] if arc not in used]
        loop = [(end, end)] if here == end else []
        attractions = {arc: self.attraction(arc, trail, unreached, robot) for arc in free + loop}
        rejected = set()
        if self.limits.has_floors or self.limits.has_budgets or not self.mission.balanced:
            rejected = {a for a in free if not self.leads_back(used | {a}, a[1], robot)}
        return self.drawn(attractions, rejected)

    def drawn(self, attractions, rejected):
        """Return the probability of each arc; a rejected arc is left out, and another is drawn."""
        total, n = sum(attractions.values()), len(attractions)
        chances = dict.fromkeys(attractions, 0.0)
        for arc, attraction in attractions.items():
            chance = attraction / total + self.rule.exploration / n**2
            chance /= 1 + self.rule.exploration / n
            again = {arc: 1.0}
            if arc in rejected:
                others = {other: a for other, a in attractions.items() if other != arc}
                again = self.drawn(others, rejected)
            for other, p in again.items():
                chances[other] += chance * p
        return {arc: chance for arc, chance in chances.items() if arc not in rejected}

    def chances(self, trail, robot):
        """For each node of the mission the probability that the robot is paid there.

        What it carries from the start it brings home from there.
        """
        chances, alive = dict.fromkeys(range(self.n_nodes), 0.0), 1.0
        home, aboard = self.mission.world.ways.home, self.aboard[robot]
        for node in aboard:
            chances[node % self.n_nodes] = self.expected[node] / home[node] * home[trail[0]]
        for position, node in enumerate(trail):
            if position:
                alive *= self.survival[trail[position - 1], node]
            if node not in trail[:position] and node not in aboard:
                chances[node % self.n_nodes] = alive * self.expected[node]
        return chances

    def unreached(self, trails, robot):
        """Return for each node the probability that no other robot is paid there.

        Where all are out at once, some have not begun before the robot's second turn.
        """
        begun = trails if self.concurrent and len(trails[robot]) > 1 else trails[:robot]
        others = [self.chances(t, other) for other, t in enumerate(begun) if other != robot]
        return {node: prod(1 - p[node] for p in others) for node in range(self.n_nodes)}

    def next_hops(self, trails, out):
        """Every hop of the robot whose turn it is: (probability, trails and robots out then)."""
        robot, *later = out
        hops = self.hops(trails[robot], self.unreached(trails, robot), robot)
        for (tail, head), probability in hops.items():
            if tail == head:
                yield probability, trails, later
            else:
                longer = [*trails[:robot], (*trails[robot], head), *trails[robot + 1 :]]
                yield probability, longer, [*later, robot] if self.concurrent else out

    def plan_probabilities(self):
        """Every plan the ant may build, with its probability."""
        starts = [(start,) for start, _ in self.ends]
        found, unfinished = {}, [(1.0, starts, [*range(len(starts))])]
        while unfinished:
            probability, trails, out = unfinished.pop()
            if out:
                unfinished += [(probability * p, *then) for p, *then in self.next_hops(trails, out)]
            else:
                found[tuple(trails)] = found.get(tuple(trails), 0.0) + probability
        return found


class Repairer:
    """Both repairs, one rule a line; missions whose safest paths are unique give the same plans.

    Trails are those of a robot, and nodes are indices of kernels.
    """

    def __init__(self, mission, robot=0):
        self.start, self.end = ends_of(mission, robot)
        self.n_nodes, self.layer = len(mission.nodes), self.start - self.start % len(mission.nodes)
        self.nodes = range(self.layer, self.layer + self.n_nodes)
        self.n_known = self.n_nodes * len(mission.kinds)
        survival = arc_survivals(mission).items()
        self.arcs = {arc: s for arc, s in survival if arc[0] in self.nodes}

    def free(self, trail):
        """The mission without the arcs that a trail has used."""
        left = nx.DiGraph()
        left.add_nodes_from(self.nodes)
        for arc in self.arcs.keys() - set(pairwise(trail)):
            left.add_edge(*arc, cost=-log(self.arcs[arc]))
        return left

    def leads_home(self, trail):
        return nx.has_path(self.free(trail), trail[-1], self.end)

    def home(self, trail):
        return trail + self.path(trail, self.end)

    def path(self, trail, target):
        """The safest way on to a node over unused arcs, without the trail's last node."""
        return nx.dijkstra_path(self.free(trail), trail[-1], target, weight="cost")[1:]

    def safest(self, draft):
        trail = [self.start]
        for drafted in draft:
            node = self.layer + drafted % self.n_nodes  # whichever kind it was meant for
            if node == trail[-1] or not 0 <= drafted < self.n_known:
                continue
            hop = (trail[-1], node)
            if hop in set(pairwise(trail)):
                trail = trail[: list(pairwise(trail)).index(hop) + 2]
            elif hop in self.arcs:
                trail = self.unless_lost([*trail, node], trail)
            elif nx.has_path(self.free(trail), trail[-1], node):
                trail = self.unless_lost(trail + self.path(trail, node), trail)
        return self.home(trail)

    def unless_lost(self, longer, trail):
        return longer if self.leads_home(longer) else trail

    def truncate(self, draft):
        prefixes = [[self.start]]
        for position in range(1, len(draft) + 1):
            known = all(0 <= node < self.n_known for node in draft[:position])
            if not known:
                break
            prefix = [self.layer + node % self.n_nodes for node in draft[:position]]
            hops = list(pairwise(prefix))
            if prefix[0] != self.start or not set(hops) <= self.arcs.keys():
                break
            if len(set(hops)) < len(hops):
                break
            if self.leads_home(prefix):
                prefixes.append(prefix)
        return self.home(prefixes[-1])


@lru_cache(maxsize=1)
def _arcs(mission):
    """Return the survival and the length of each arc, cached because twins ask often."""
    graph = mission.world.graph
    arcs = list(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    return [dict(zip(arcs, of.tolist(), strict=True)) for of in (graph.mean_survival, graph.length)]


def arc_survivals(mission):
    return _arcs(mission)[0]


def alike(mission, least=0.0, longest=inf):
    """The mission as kernels know it, with limits that are the same for each robot."""
    n_robots = mission.robots
    return mission.world.with_limits(new_limits([least], [longest], [n_robots]))


def ends_of(mission, robot=0):
    """Where a robot's trails begin and end, as indices of kernels; without kinds, of nodes."""
    kind = mission.kind_of[robot]
    layer = len(mission.nodes) * mission.kinds.index(kind)
    start, end = map(mission.index, kind.ends(mission.base))
    return layer + start, layer + end


def end_at(mission, node):
    """Where trails end that visit a node, as indices of kernels."""
    kind, n_nodes = mission.kinds[node // len(mission.nodes)], len(mission.nodes)
    return node - node % n_nodes + mission.index(kind.ends(mission.base)[1])


def all_trails(mission, max_steps=20_000, robot=0):
    """Every trail of a robot as indices of kernels; None where there are too many to look at."""
    survival, (start, end) = arc_survivals(mission), ends_of(mission, robot)
    found, open_trails, steps = [], [(start,)], 0
    while open_trails:
        trail = open_trails.pop()
        steps += 1
        if steps > max_steps:
            return None
        if trail[-1] == end:
            found.append(trail)
        used = set(pairwise(trail))
        open_trails += [(*trail, v) for u, v in survival if u == trail[-1] and (u, v) not in used]
    return found


def survival_of(mission, trail):
    graph = mission.world.graph
    arcs = {ends: arc for arc, ends in enumerate(zip(graph.tail, graph.head, strict=True))}
    alive = (prod(of[arcs[hop]] for hop in pairwise(trail)) for of in graph.survival)
    return sum(p * s for p, s in zip(graph.probability, alive, strict=True))


def reach_of(mission, trail):
    """The probability to be alive at each node of a trail, at the first visit."""
    survival, alive, reached = arc_survivals(mission), 1.0, {}
    for arc in pairwise(trail):
        alive *= survival[arc]
        reached.setdefault(arc[1], alive)
    return reached


def length_of(mission, trail):
    length = _arcs(mission)[1]
    return sum(length[arc] for arc in pairwise(trail))


def within(mission, trails, least, longest):
    """The trails that keep a survival floor and a travel budget."""
    return [
        trail
        for trail in trails
        if survival_of(mission, trail) >= least and length_of(mission, trail) <= longest
    ]


def worth(mission, objectives, weight):
    """What plans are worth for a weight on reward."""
    reward, survivors = np.transpose(objectives)
    share = reward / (mission.total_reward or 1.0)
    return weight * share + (1 - weight) * survivors / mission.robots


def all_objectives(mission, *trails):
    """E[R] and E[S] of every team, from the trails of each kind of robots."""
    missed, survivors = np.ones((1, len(mission.nodes))), np.zeros(1)
    for kind, of_kind in zip(mission.kinds, trails, strict=True):
        misses = np.ones((len(of_kind), len(mission.nodes)))
        labels = [[mission.nodes[i % len(mission.nodes)] for i in trail] for trail in of_kind]
        for row, trail in zip(misses, labels, strict=True):
            for node, chance in collects(mission, kind, trail).items():
                row[mission.index(node)] = 1 - chance
        alive = np.array([alive_along(mission, kind, trail)[-1] for trail in labels])
        teams = np.array(list(combinations_with_replacement(range(len(labels)), kind.robots)))
        missed = (missed[:, None] * np.prod(misses[teams], axis=1)).reshape(-1, missed.shape[1])
        survivors = np.add.outer(survivors, alive[teams].sum(axis=1)).ravel()
    return np.column_stack([(1 - missed) @ mission.rewards, survivors])


def assert_frequencies(counted, expected):
    """Compare counts with probabilities, within five standard deviations and three."""
    n = sum(counted.values())
    assert sum(expected.values()) == pytest.approx(1)
    assert set(counted) <= set(expected)
    for outcome, chance in expected.items():
        spread = abs(n * chance * (1 - chance)) ** 0.5
        assert abs(counted[outcome] - n * chance) <= 5 * spread + 3, outcome


@contextmanager
def plain_local_search():
    """Let the Pareto local search run as plain Python, so that tests may look into any part of it.

    Its compiled functions give way to their sources, also those that compiled code alone can call.
    """
    names = [
        f"{local_search.__name__}.{module.name}" for module in iter_modules(local_search.__path__)
    ]
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        for name in [*names, "botohe_moo.algorithms.local_search.engine"]:
            module = import_module(name)
            for key, function in list(vars(module).items()):
                if hasattr(function, "py_func"):
                    patch.setattr(module, key, function.py_func)
        yield patch


def slots(search):
    """The slots of a search's front, in order."""
    return read_front(search._front)[0]
