"""Policies against a readable twin that tries all plans for what is left."""

from itertools import pairwise, product
from math import prod

import networkx as nx
import numpy as np
import pytest

from botohe_moo import Kind, Mission, Scenario, simulate_policy
from botohe_moo.underway import POLICIES

PRICE, SEED = 3.0, 5


def yard(scenarios=()):
    """Four places and two robots that survive differently, so that no two plans are as good."""
    graph = nx.DiGraph(base="base")
    rewards = {"base": 0.0, "lab": 7.0, "hall": 3.0, "roof": 4.0}
    for node, reward in rewards.items():
        graph.add_node(node, reward=reward, zone="up" if node in ("lab", "roof") else "down")
    ways = {("base", "lab"): 0.81, ("base", "hall"): 0.93, ("base", "roof"): 0.77}
    for (tail, head), survival in {**ways, ("hall", "roof"): 0.87}.items():
        graph.add_edge(tail, head, survival={"drone": survival, "rover": survival - 0.06})
        graph.add_edge(head, tail, survival={"drone": survival - 0.03, "rover": survival + 0.02})
    return Mission(graph, kinds=[Kind("drone", 1), Kind("rover", 1)], scenarios=scenarios)


PLAIN = yard()
STORMY = yard(
    [
        Scenario("storm", 0.4, factor=4.0, zone="up"),
        Scenario("guard", 0.25, survival={("base", "hall"): 0.2}, reward={"lab": 15.0}),
    ]
)
TRAILS = [["base", "lab", "base", "hall", "base"], ["base", "hall", "roof", "base"]]


def cases(mission):
    """The probability of each scenario and its mission."""
    return mission.in_scenarios if mission.scenarios else [(1.0, mission)]


def survival(mission, robot, arc):
    return mission.graph.edges[arc]["survival"][mission.kinds[robot].name]


def ways_home(mission, node, used):
    """All trails from a node to the base over arcs that were not used."""
    found = [[node]] if node == "base" else []
    for arc in set(mission.graph.out_edges(node)) - used:
        found += [[node, *trail] for trail in ways_home(mission, arc[1], used | {arc})]
    return found


def best_rest(mission, weights, walked, done):
    """The rests of trails that are worth most together at the price, of all there are.

    ``walked`` is what each robot that is not lost has walked of its trail.
    """
    nodes = [node for node in mission.graph if node not in done]
    options = [ways_home(mission, trail[-1], {*pairwise(trail)}) for trail in walked.values()]
    reached, alive = [], []
    for robot, trails in zip(walked, options, strict=True):
        chances = np.zeros((len(trails), len(weights), len(nodes)))
        survivors = np.zeros((len(trails), len(weights)))
        for i, trail in enumerate(trails):
            for s, (_, case) in enumerate(cases(mission)):
                hops = [survival(case, robot, arc) for arc in pairwise(trail)]
                survivors[i, s] = prod(hops)
                for v, node in enumerate(nodes):
                    if node in trail:
                        chances[i, s, v] = prod(hops[: trail.index(node)])
        reached.append(chances)
        alive.append(survivors)
    rewards = np.array([[one.graph.nodes[v]["reward"] for v in nodes] for _, one in cases(mission)])
    worth = weights[:, None] * rewards
    values = [
        np.einsum("isv,sv->i", q, worth) + PRICE * (s @ weights)
        for q, s in zip(reached, alive, strict=True)
    ]
    if len(options) == 1:
        return [options[0][int(values[0].argmax())]]
    total = values[0][:, None] + values[1] - np.einsum("isv,jsv,sv->ij", *reached, worth)
    first, second = np.unravel_index(total.argmax(), total.shape)
    return [options[0][first], options[1][second]]


def collected(trails, at):
    """The nodes to which robots have got."""
    return {node for trail, i in zip(trails, at, strict=True) for node in trail[: i + 1]}


def play(mission, policy, number):
    """A mission that is played under a policy: its reward, survivors, and replans."""
    generator = np.random.default_rng([SEED, number])
    chances, true = np.array([p for p, _ in cases(mission)]), mission
    if mission.scenarios:
        true = cases(mission)[generator.choice(len(chances), p=chances)][1]
    dangers = generator.random((2, len(mission.graph.edges)))
    trails, at, lost, weights, replans = [*TRAILS], [0, 0], set(), chances, 0

    def hops_left(robot):
        return 0 if robot in lost else len(trails[robot]) - at[robot] - 1

    next_robot = None
    while movers := [robot for robot in (0, 1) if hops_left(robot)]:
        if "first" in policy or policy == "one by one":
            if next_robot not in movers:
                next_robot = (min if "first" in policy else max)(movers, key=hops_left)
            movers = [next_robot]
        for robot in movers:
            arc = tuple(trails[robot][at[robot] : at[robot] + 2])
            each = np.array([survival(one, robot, arc) for _, one in cases(mission)])
            if dangers[robot, at[robot]] < survival(true, robot, arc):
                at[robot] += 1
                weights = weights * each
            else:
                lost.add(robot)
                weights = weights * (1 - each)
        is_over = policy in ("one by one", "shortest first") and not hops_left(movers[0])
        is_time = policy == "arrivals" or (policy != "static" and (lost & {*movers} or is_over))
        if is_time and len(lost) < 2:
            walked = {r: trails[r][: at[r] + 1] for r in (0, 1) if r not in lost}
            rest = best_rest(mission, weights / weights.sum(), walked, collected(trails, at))
            for robot, trail in zip(walked, rest, strict=True):
                trails[robot] = [*trails[robot][: at[robot]], *trail]
            replans += 1
    reward = sum(true.graph.nodes[v]["reward"] for v in collected(trails, at))
    return reward, 2 - len(lost), replans


@pytest.mark.parametrize("mission", [PLAIN, STORMY], ids=["plain", "scenarios"])
def test_policies_play_what_is_best_of_all_plans(mission):
    """Mission by mission: every replan finds the best of all rests, by all scenarios."""
    plan, n_missions = mission.plan(TRAILS), 60
    found = simulate_policy(
        mission, plan, tuple(POLICIES), price=PRICE, missions=n_missions, seed=SEED
    ).played
    for policy in POLICIES:
        of_policy = found[found["policy"] == policy]
        played = of_policy[["reward", "survivors", "replans"]].to_numpy()
        expected = [play(mission, policy, number) for number in range(n_missions)]
        assert played == pytest.approx(np.array(expected)), policy


def test_the_twin_knows_the_scenarios():
    """Replans differ with and without scenarios, so that the test above can fail."""
    missions = product(("losses", "arrivals"), range(60))
    assert any(play(PLAIN, *of)[:2] != play(STORMY, *of)[:2] for of in missions)
