"""The exact distribution of the team reward, by joining the robots one after another."""

from itertools import pairwise
from typing import NamedTuple

import networkx as nx
import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.mission import Mission
from botohe_moo.outcomes.distribution import ROUNDING
from botohe_moo.trails import TrailPlan


class Followed(NamedTuple):
    """The trails of a valid plan, and what is known of each position on them."""

    nodes: OffsetArray
    offsets: OffsetArray
    alive: FloatArray  # the probability to reach the position
    pays: FloatArray  # the reward of the node where its trail first visits it, else 0


def follow(mission: Mission, plan: TrailPlan) -> Followed:
    """Follow the trails of a valid plan."""
    graph, nodes = mission.arrays, plan.nodes.astype(np.int64)
    arcs, alive = graph.tail * graph.n_nodes + graph.head, np.ones(len(nodes))
    for start, stop in pairwise(plan.offsets.tolist()):
        hops = nodes[start : stop - 1] * graph.n_nodes + nodes[start + 1 : stop]
        alive[start + 1 : stop] = np.cumprod(graph.survival[np.searchsorted(arcs, hops)])
    robots = np.repeat(np.arange(plan.n_robots), np.diff(plan.offsets))
    first = np.unique(robots * graph.n_nodes + nodes, return_index=True)[1]
    pays = np.zeros(len(nodes))
    pays[first] = graph.reward[nodes[first]]
    return Followed(nodes, plan.offsets, alive, pays)


class TooManyOutcomesError(Exception):
    """The exact computation needs more outcomes than allowed."""


class States(NamedTuple):
    """Outcomes of some robots: reward, probability, and the nodes reached, as bits (n, n_words)."""

    values: FloatArray
    probabilities: FloatArray
    reached: SeedArray


def merged(
    values: FloatArray, probabilities: FloatArray, reached: SeedArray | None = None
) -> States:
    """Merge outcomes that agree in reward, up to rounding, and in the nodes reached.

    Their mean stays, to the last digits.
    """
    if reached is None:
        reached = np.empty((len(values), 0), np.uint64)
    order = np.lexsort((values, *reached.T))
    values, reached = values[order], reached[order]
    differs = np.diff(values) > ROUNDING * values[1:]
    differs |= (reached[1:] != reached[:-1]).any(axis=1)
    starts = np.append(0, 1 + np.flatnonzero(differs))
    probabilities = probabilities[order]
    beyond = values - np.repeat(values[starts], np.diff(starts, append=len(values)))
    beyond = np.add.reduceat(probabilities * beyond, starts)
    probabilities = np.add.reduceat(probabilities, starts)
    kept = probabilities > 0  # a product of many small ones may underflow
    starts, probabilities = starts[kept], probabilities[kept]
    return States(values[starts] + beyond[kept] / probabilities, probabilities, reached[starts])


def join_robots(reward: FloatArray, followed: Followed, max_outcomes: int) -> States:
    """Compute the outcomes of all robots exactly; see ``reward_distribution``."""
    nodes, offsets, alive, pays = followed
    certain = np.unique(nodes[(alive == 1) & (pays > 0)])
    uncertain = (pays > 0) & (alive > 0) & ~np.isin(nodes, certain)
    chains = [i + np.flatnonzero(uncertain[i:j]) for i, j in pairwise(offsets.tolist())]
    reaching = np.zeros((len(chains), len(reward)), bool)
    for row, chain in zip(reaching, chains, strict=True):
        row[nodes[chain]] = True
    sharing: nx.Graph[int] = nx.Graph()
    sharing.add_edges_from(zip(*np.nonzero(reaching @ reaching.T), strict=True))

    parts = []
    for component in nx.connected_components(sharing):
        group = [chains[robot] for robot in sorted(component)]
        part, max_outcomes = _join_group(reward, followed, group, max_outcomes)
        parts.append(part)
    total = parts[0] if parts else merged(np.zeros(1), np.ones(1))
    for part in parts[1:]:
        max_outcomes = _spend(max_outcomes, len(total.values) * len(part.values))
        values = np.add.outer(total.values, part.values).ravel()
        total = merged(values, np.outer(total.probabilities, part.probabilities).ravel())
    values, probabilities, _ = total
    return merged(values + reward[certain].sum(), probabilities)


def _join_group(
    reward: FloatArray, followed: Followed, chains: list[OffsetArray], max_outcomes: int
) -> tuple[States, int]:
    """Join robots that share nodes; ``chains`` are the positions on each trail that count.

    Also returns what is left of ``max_outcomes``.
    """
    table = np.unique(followed.nodes[np.concatenate(chains)])
    masks = np.zeros((len(chains) + 1, (len(table) + 63) // 64), np.uint64)
    bits = [np.searchsorted(table, followed.nodes[chain]) for chain in chains]
    for mask, bit in zip(masks, bits, strict=False):
        np.bitwise_or.at(mask, bit // 64, np.uint64(1) << (bit % 64).astype(np.uint64))
    later = np.bitwise_or.accumulate(masks[::-1])[::-1]

    states = States(np.zeros(1), np.ones(1), np.zeros((1, masks.shape[1]), np.uint64))
    for robot, chain in enumerate(chains):
        chances = -np.diff(np.concatenate([[1.0], followed.alive[chain], [0.0]]))
        max_outcomes = _spend(max_outcomes, len(states.values) * int((chances > 0).sum()))
        joint = _join(states, bits[robot], reward[followed.nodes[chain]], chances)
        states = merged(*joint._replace(reached=joint.reached & later[robot + 1]))
    return states, max_outcomes


def _join(states: States, bits: OffsetArray, gains: FloatArray, chances: FloatArray) -> States:
    """Join every state of the robots so far with every fate of one more robot.

    ``bits`` and ``gains`` are the bit and the reward of each node that the robot may reach, in the
    order of its trail (n_reachable). ``chances`` are the probabilities that it reaches the first
    0, 1, ..., n_reachable of them and no more; a fate with the probability 0 is left out.
    """
    word, bit = bits // 64, np.uint64(1) << (bits % 64).astype(np.uint64)
    adds = np.where(states.reached[:, word] & bit, 0.0, gains)
    values = np.cumsum(np.column_stack([states.values, adds]), axis=1)
    masks = np.zeros((len(chances), states.reached.shape[1]), np.uint64)
    masks[np.arange(1, len(chances)), word] = bit
    fates = chances > 0
    masks = np.bitwise_or.accumulate(masks)[fates]
    return States(
        values[:, fates].ravel(),
        np.outer(states.probabilities, chances[fates]).ravel(),
        (states.reached[:, np.newaxis] | masks).reshape(-1, masks.shape[1]),
    )


def _spend(max_outcomes: int, n_joint: int) -> int:
    """Return what is left of the outcomes that are allowed, or raise a TooManyOutcomesError."""
    if n_joint > max_outcomes:
        raise TooManyOutcomesError
    return max_outcomes - n_joint
