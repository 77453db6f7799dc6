"""Readable twins of the compiled kernels: plain Python, one rule a line."""

from __future__ import annotations

from contextlib import contextmanager
from fractions import Fraction
from importlib import import_module
from itertools import combinations_with_replacement, pairwise, product
from math import log, prod
from pkgutil import iter_modules

import networkx as nx
import numpy as np
import pytest

from botohe_moo.kernels import local_search
from botohe_moo.kernels.graph.graph import NO_LIMITS


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


def credited(mission, trail):
    """Every node of a label trail whose reward is credited, with the position where it is."""
    nodes, first_visits = mission.graph.nodes, {v: trail.index(v) for v in trail}
    depots = [i for i, v in enumerate(trail) if v == mission.base or nodes[v].get("depot")]
    for node, visit in first_visits.items():
        returns = visit not in depots and nodes[node].get("pays", mission.pays) == "return"
        at = min((i for i in depots if i > visit), default=None) if returns else visit
        if at is not None:
            yield node, at


def collects(mission, kind, trail):
    """With what probability a robot of a kind collects the reward of each node."""
    nodes, alive = mission.graph.nodes, alive_along(mission, kind, trail)
    shares = {node: of_kind(nodes[node].get("share", 1.0), kind) for node in trail}
    return {node: shares[node] * alive[at] for node, at in credited(mission, trail)}


def evaluate(mission, trails, kinds=None):
    """E[R] and E[S] of label trails of robots of these kinds, straight from the formulas.

    Without kinds the trails are those of the mission's robots, in order.
    """
    robots = list(zip(kinds or mission.kind_of, trails, strict=False))
    chances = [collects(mission, kind, trail) for kind, trail in robots]
    expected_reward = sum(
        reward * (1 - prod(1 - chance.get(node, 0.0) for chance in chances))
        for node, reward in mission.graph.nodes(data="reward")
    )
    survives = (alive_along(mission, kind, trail)[-1] for kind, trail in robots if trail)
    return expected_reward, sum(survives)


def trail_lengths(mission, trails):
    """How long each of the label trails is: the sum over its hops, one long by default."""
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
        paid, carried = [], []
        for j, node in enumerate(trail[: i + 1]):  # the arcs before were survived
            if node not in trail[:j]:
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
                share = of_kind(nodes[node].get("share", 1.0), kind)
                missed[node] = missed.get(node, 1.0) * (1 - share)
        yield (
            prod(probability for probability, _, _ in joint),
            sum(nodes[node]["reward"] * (1 - chance) for node, chance in missed.items()),
            sum(survives for *_, survives in joint),
        )


class Ant:
    """An ant of the colony, one rule a line.

    ``rule`` is a ColonyRule, ``pheromone`` holds one dict a robot from arcs (the base's self-loop
    among them) to (τ_R, τ_S), ``weight`` is the ant's λ, and ``limits`` are what trails keep.
    """

    def __init__(self, mission, rule, pheromone, weight, limits=NO_LIMITS):
        self.mission, self.rule, self.pheromone, self.weight = mission, rule, pheromone, weight
        self.limits = limits
        self.survival = {(u, v): s for u, v, s in mission.graph.edges(data="survival")}
        self.length = {(u, v): d for u, v, d in mission.graph.edges(data="length", default=1.0)}
        self.reward = dict(mission.graph.nodes(data="reward"))
        self.loop = (mission.base, mission.base)

    def leads_back(self, used, node):
        """Whether the safest or the shortest way over unused arcs leads home within the limits."""
        left = nx.DiGraph(arc for arc in self.mission.graph.edges if arc not in used)
        left.add_nodes_from(self.mission.graph)
        if not nx.has_path(left, node, self.mission.base):
            return False
        for arc in left.edges:
            left.edges[arc].update(cost=-log(self.survival[arc]), length=self.length[arc])
        for weight in ("cost", "length"):
            way = nx.dijkstra_path(left, node, self.mission.base, weight=weight)
            trail = [*used, *pairwise(way)]
            alive = prod(self.survival[arc] for arc in trail)
            length = sum(self.length[arc] for arc in trail)
            if alive >= self.limits.min_survival and length <= self.limits.max_length:
                return True
        return False

    def attraction(self, arc, trail, unreached, robot):
        survival = self.survival.get(arc, 1.0)
        eta_reward, eta_survival = self.rule.reward_epsilon, self.rule.survival_epsilon + survival
        if arc[1] not in trail:
            gained = self.rule.unvisited_bonus + survival * self.reward[arc[1]]
            eta_reward += gained * unreached[arc[1]]
        if not self.rule.heuristic:
            eta_reward = eta_survival = 1.0
        tau_reward, tau_survival = self.pheromone[robot][arc]
        reward, survivors = tau_reward * eta_reward, tau_survival * eta_survival
        return reward ** (1 - self.weight) * survivors**self.weight

    def hops(self, trail, unreached, robot):
        """Every hop that may extend the trail, with its probability."""
        here, used = trail[-1], set(pairwise(trail))
        free = [(here, head) for head in self.mission.graph[here] if (here, head) not in used]
        loop = [self.loop] if here == self.mission.base else []
        attractions = [self.attraction(arc, trail, unreached, robot) for arc in free + loop]
        floor = self.rule.exploration * sum(attractions) / len(attractions) ** 2
        weights = dict(zip(free + loop, [a + floor for a in attractions], strict=True))
        if self.limits.bind or not self.mission.balanced:
            home = [arc for arc in free if self.leads_back(used | {arc}, arc[1])]
            weights = {arc: weights[arc] for arc in home + loop}
        total = sum(weights.values())
        return {arc: weight / total for arc, weight in weights.items()}

    def after(self, trail, unreached):
        """For each node the probability that no robot so far reaches it, this trail included."""
        after, alive = dict(unreached), 1.0
        for position, node in enumerate(trail):
            if position:
                alive *= self.survival[trail[position - 1], node]
            if node not in trail[:position]:
                after[node] *= 1 - alive
        return after

    def build(self, rng):
        """Build one plan; ``rng`` is a random.Random."""
        trails, unreached = [], dict.fromkeys(self.mission.graph, 1.0)
        for robot in range(self.mission.robots):
            trail = [self.mission.base]
            while True:
                hops = self.hops(trail, unreached, robot)
                (arc,) = rng.choices(list(hops), list(hops.values()))
                if arc == self.loop:
                    break
                trail.append(arc[1])
            trails.append(trail)
            unreached = self.after(trail, unreached)
        return trails

    def plan_probabilities(self):
        """Every plan the ant may build, with its probability."""

        def complete(trail, unreached, robot):
            for arc, probability in self.hops(trail, unreached, robot).items():
                if arc == self.loop:
                    yield probability, trail
                else:
                    for rest, done in complete([*trail, arc[1]], unreached, robot):
                        yield probability * rest, done

        def robots(robot, unreached):
            if robot == self.mission.robots:
                yield 1.0, ()
                return
            for probability, trail in complete([self.mission.base], unreached, robot):
                for rest, others in robots(robot + 1, self.after(trail, unreached)):
                    yield probability * rest, (tuple(trail), *others)

        found = {}
        for probability, plan in robots(0, dict.fromkeys(self.mission.graph, 1.0)):
            found[plan] = found.get(plan, 0.0) + probability
        return found


class ConcurrentAnt(Ant):
    """An ant whose robots are all out at once and take one hop each in turn.

    ``out`` lists the robots that have not ended their trails, whose turn it is first.
    """

    def reaches(self, trail, node):
        """Probability that a robot reaches the node by its trail so far."""
        if node not in trail:
            return 0.0
        until = trail.index(node)
        return prod(self.survival[arc] for arc in pairwise(trail[: until + 1]))

    def unreached_by_others(self, trails, robot):
        others = [trail for other, trail in enumerate(trails) if other != robot]
        return {
            node: prod(1 - self.reaches(trail, node) for trail in others)
            for node in self.mission.graph
        }

    def next_hops(self, trails, out):
        """Every hop of the robot whose turn it is: (probability, trails and robots out then)."""
        robot, *later = out
        trail = trails[robot]
        for arc, probability in self.hops(
            trail, self.unreached_by_others(trails, robot), robot
        ).items():
            if arc == self.loop:
                yield probability, trails, later
            else:
                longer = [*trails[:robot], (*trail, arc[1]), *trails[robot + 1 :]]
                yield probability, longer, [*later, robot]

    def start(self):
        robots = range(self.mission.robots)
        return [(self.mission.base,) for _ in robots], list(robots)

    def plan_probabilities(self):
        """Every plan the ant may build, with its probability."""
        found, unfinished = {}, [(1.0, *self.start())]
        while unfinished:
            probability, trails, out = unfinished.pop()
            if out:
                unfinished += [(probability * p, *then) for p, *then in self.next_hops(trails, out)]
            else:
                found[tuple(trails)] = found.get(tuple(trails), 0.0) + probability
        return found


class Repairer:
    """Both repairs, one rule a line; missions whose safest paths are unique give the same plans."""

    def __init__(self, mission):
        self.mission = mission
        self.arcs = set(mission.graph.edges)

    def free(self, trail):
        """The mission without the arcs that a trail has used."""
        left = nx.DiGraph()
        left.add_nodes_from(self.mission.graph)
        for arc in self.arcs - set(pairwise(trail)):
            left.add_edge(*arc, cost=-log(self.mission.graph.edges[arc]["survival"]))
        return left

    def leads_home(self, trail):
        return nx.has_path(self.free(trail), trail[-1], self.mission.base)

    def home(self, trail):
        return trail + self.path(trail, self.mission.base)

    def path(self, trail, target):
        """The safest way on to a node over unused arcs, without the trail's last node."""
        return nx.dijkstra_path(self.free(trail), trail[-1], target, weight="cost")[1:]

    def safest(self, draft):
        trail = [self.mission.base]
        for node in draft:
            if node == trail[-1] or node not in self.mission.graph:
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
        prefixes = [[self.mission.base]]
        for position in range(1, len(draft) + 1):
            prefix = list(draft[:position])
            hops = list(pairwise(prefix))
            if prefix[0] != self.mission.base or not set(hops) <= self.arcs:
                break
            if len(set(hops)) < len(hops):
                break
            if self.leads_home(prefix):
                prefixes.append(prefix)
        return self.home(prefixes[-1])


class _Arcs:
    """What arcs are like, of the mission that was asked for last: twins ask again and again."""

    mission = survival = length = None

    def of(self, mission):
        if mission is not self.mission:
            arrays = mission.arrays
            arcs = list(zip(arrays.tail.tolist(), arrays.head.tolist(), strict=True))
            self.survival = dict(zip(arcs, arrays.survival.tolist(), strict=True))
            self.length = dict(zip(arcs, arrays.length.tolist(), strict=True))
            self.mission = mission
        return self


_ARCS = _Arcs()


def arc_survivals(mission):
    return _ARCS.of(mission).survival


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
    survival = arc_survivals(mission)
    return prod(survival[arc] for arc in pairwise(trail))


def reach_of(mission, trail):
    """The probability to be alive at each node of a trail, at the first visit."""
    survival, alive, reached = arc_survivals(mission), 1.0, {}
    for arc in pairwise(trail):
        alive *= survival[arc]
        reached.setdefault(arc[1], alive)
    return reached


def length_of(mission, trail):
    length = _ARCS.of(mission).length
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


@contextmanager
def plain_local_search():
    """Let the Pareto local search run as plain Python, so that tests may look into any part of it.

    Its compiled functions give way to their sources, also those that compiled code alone can call.
    """
    names = [
        f"{local_search.__name__}.{module.name}" for module in iter_modules(local_search.__path__)
    ]
    with pytest.MonkeyPatch.context() as patch, np.errstate(all="ignore"):
        for name in [*names, "botohe_moo.search.local_search"]:
            module = import_module(name)
            for key, function in list(vars(module).items()):
                if hasattr(function, "py_func"):
                    patch.setattr(module, key, function.py_func)
        yield patch
