"""Readable twins of the compiled kernels: plain Python, one rule a line."""

from __future__ import annotations

from itertools import pairwise, product
from math import prod


def evaluate(mission, trails):
    """E[R] and E[S] of one plan, given as label trails, straight from the formulas."""
    survival = {(u, v): s for u, v, s in mission.graph.edges(data="survival")}
    reward = dict(mission.graph.nodes(data="reward"))

    def reaches(trail, node):
        """Probability that the robot reaches the node: survivals up to its first visit."""
        if node not in trail:
            return 0.0
        until = trail.index(node)
        return prod(survival[arc] for arc in pairwise(trail[: until + 1]))

    expected_reward = sum(
        reward[node] * (1 - prod(1 - reaches(trail, node) for trail in trails)) for node in reward
    )
    expected_survivors = sum(prod(survival[arc] for arc in pairwise(trail)) for trail in trails)
    return expected_reward, expected_survivors


def fates(mission, trail):
    """Every fate of one robot: (probability, set of nodes reached, whether it survives)."""
    alive = 1.0
    for hop, arc in enumerate(pairwise(trail), start=1):
        survival = mission.graph.edges[arc]["survival"]
        yield alive * (1 - survival), set(trail[:hop]), False
        alive *= survival
    yield alive, set(trail), True


def enumerate_outcomes(mission, trails):
    """Every joint outcome of a plan: (probability, team reward, number of survivors)."""
    reward = dict(mission.graph.nodes(data="reward"))
    for joint in product(*(list(fates(mission, trail)) for trail in trails)):
        reached = set().union(*(nodes for _, nodes, _ in joint))
        yield (
            prod(probability for probability, _, _ in joint),
            sum(reward[node] for node in reached),
            sum(survives for _, _, survives in joint),
        )
