"""The exact distribution of the team reward, by joining the robots one after another."""

from itertools import pairwise
from typing import NamedTuple

import networkx as nx
import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.kernels.plans import simulate as kernels
from botohe_moo.kernels.plans.ragged import Trails, read_trails
from botohe_moo.mission import Mission
from botohe_moo.outcomes.distribution import ROUNDING
from botohe_moo.trails import TrailPlan


class Followed(NamedTuple):
    """The trails of a valid plan, and for each position what the kernel ``follow`` computes.

    ``alive`` is the probability to reach it; ``pays`` its node's reward, 0 after the first visit.
    """

    trails: Trails
    alive: FloatArray
    pays: FloatArray


def follow(mission: Mission, plan: TrailPlan) -> Followed:
    """Follow the trails of a valid plan."""
    alive, pays = np.empty((2, len(plan.nodes)))
    followed = Followed(read_trails(plan.nodes, plan.offsets), alive, pays)
    kernels.follow(mission.arrays, *followed)
    return followed


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
    (nodes, offsets), alive, pays = followed
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
    table = np.unique(followed.trails.nodes[np.concatenate(chains)])
    masks = np.zeros((len(chains) + 1, (len(table) + 63) // 64), np.uint64)
    bits = [np.searchsorted(table, followed.trails.nodes[chain]) for chain in chains]
    for mask, bit in zip(masks, bits, strict=False):
        np.bitwise_or.at(mask, bit // 64, np.uint64(1) << (bit % 64).astype(np.uint64))
    later = np.bitwise_or.accumulate(masks[::-1])[::-1]

    states = States(np.zeros(1), np.ones(1), np.zeros((1, masks.shape[1]), np.uint64))
    for robot, chain in enumerate(chains):
        chances = -np.diff(np.concatenate([[1.0], followed.alive[chain], [0.0]]))
        max_outcomes = _spend(max_outcomes, len(states.values) * int((chances > 0).sum()))
        gains = reward[followed.trails.nodes[chain]]
        values, probabilities, reached = kernels.join(*states, bits[robot], gains, chances)
        states = merged(values, probabilities, reached & later[robot + 1])
    return states, max_outcomes


def _spend(max_outcomes: int, n_joint: int) -> int:
    if n_joint > max_outcomes:
        raise TooManyOutcomesError
    return max_outcomes - n_joint
