"""The exact distribution of the team reward, by joining the robots one after another."""

from itertools import pairwise
from typing import NamedTuple

import networkx as nx
import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT, Returns, Team
from botohe_moo.mission import Mission
from botohe_moo.outcomes.distribution import ROUNDING
from botohe_moo.trails import TrailPlan


class Followed(NamedTuple):
    """The trails of a valid plan, and what is known of each position on them."""

    nodes: OffsetArray  # indices of the mission's nodes
    offsets: OffsetArray
    alive: FloatArray  # the probability to reach the position
    pays: FloatArray  # the reward of the node where its trail first visits it, else 0
    # For first visits: the probability to get to where the reward is credited, 0 if it never is;
    # and the probability that a robot which gets there has collected it.
    credited: FloatArray
    share: FloatArray


def follow(mission: Mission, plan: TrailPlan) -> Followed:
    """Follow the trails of a valid plan."""
    graph, team, returns = mission.world.graph, mission.world.team, mission.world.returns
    nodes = plan.nodes.astype(np.int64)
    arcs, alive = graph.tail * graph.n_nodes + graph.head, np.ones(len(nodes))
    for start, stop in pairwise(plan.offsets.tolist()):
        hops = nodes[start : stop - 1] * graph.n_nodes + nodes[start + 1 : stop]
        alive[start + 1 : stop] = np.cumprod(graph.survival[np.searchsorted(arcs, hops)])
    offsets, credited = plan.offsets, alive
    if returns is not None:  # what robots carry comes first
        nodes, alive, offsets = _with_aboard(team, returns, nodes, alive, offsets)
        credited = _credited(alive, returns.credit[nodes], offsets)
    robots = np.repeat(np.arange(plan.n_robots), np.diff(offsets))
    first = np.unique(robots * graph.n_nodes + nodes, return_index=True)[1]
    pays, share, nodes = np.zeros(len(nodes)), team.share[nodes], team.origin[nodes]
    pays[first] = mission.rewards[nodes[first]]
    return Followed(nodes, offsets, alive, pays, credited, share)


def _with_aboard(
    team: Team, returns: Returns, nodes: OffsetArray, alive: FloatArray, offsets: OffsetArray
) -> tuple[OffsetArray, FloatArray, OffsetArray]:
    """Put the nodes whose rewards a robot carries before the trail of each.

    Trails may be of any number of robots; all robots of a kind carry the same.
    """
    n, sources = len(team.reward), nodes[offsets[:-1]]
    robots = np.searchsorted(team.start // n, sources // n)  # the first of the kind
    first, stop = returns.first[robots], returns.stop[robots]
    n_aboard = stop - first
    if not n_aboard.any():
        return nodes, alive, offsets
    starts = np.repeat(offsets[:-1], n_aboard)
    places = [returns.aboard[i:j] for i, j in zip(first, stop, strict=True)]
    layers = nodes[starts] - team.origin[nodes[starts]]
    added = np.concatenate(places) + layers
    offsets = offsets + np.cumsum([0, *n_aboard])
    return np.insert(nodes, starts, added), np.insert(alive, starts, 1.0), offsets


def _credited(alive: FloatArray, credit: OffsetArray, offsets: OffsetArray) -> FloatArray:
    """Compute the probability to get to where what is paid at each position is credited."""
    credited = alive.copy()
    for start, stop in pairwise(offsets.tolist()):
        at_depot = 0.0  # behind the last depot of the trail
        for i in reversed(range(start, stop)):
            if credit[i] == AT_THIS_DEPOT:
                at_depot = alive[i]
            elif credit[i] == AT_NEXT_DEPOT:
                credited[i] = at_depot
    return credited


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
    nodes, offsets, _, pays, credited, share = followed
    certain = np.unique(nodes[(credited == 1) & (share == 1) & (pays > 0)])
    uncertain = (pays > 0) & (credited > 0) & (share > 0) & ~np.isin(nodes, certain)
    chains = [i + np.flatnonzero(uncertain[i:j]) for i, j in pairwise(offsets.tolist())]
    # In the order in which they are credited: what is credited at a depot has one probability.
    chains = [chain[np.argsort(-credited[chain], kind="stable")] for chain in chains]
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

    They are in the order in which they are credited. Also returns what is left of ``max_outcomes``.
    """
    table = np.unique(followed.nodes[np.concatenate(chains)])
    masks = np.zeros((len(chains) + 1, (len(table) + 63) // 64), np.uint64)
    bits = [np.searchsorted(table, followed.nodes[chain]) for chain in chains]
    for mask, bit in zip(masks, bits, strict=False):
        np.bitwise_or.at(mask, bit // 64, np.uint64(1) << (bit % 64).astype(np.uint64))
    later = np.bitwise_or.accumulate(masks[::-1])[::-1]

    states = States(np.zeros(1), np.ones(1), np.zeros((1, masks.shape[1]), np.uint64))
    for robot, chain in enumerate(chains):
        gains, credited = reward[followed.nodes[chain]], followed.credited[chain]
        share = followed.share[chain]
        if (share == 1).all():
            chances = -np.diff(np.concatenate([[1.0], credited, [0.0]]))
            max_outcomes = _spend(max_outcomes, len(states.values) * int((chances > 0).sum()))
            joint = _join(states, bits[robot], gains, chances)
        else:
            steps = zip(bits[robot], gains, credited, share, strict=True)
            joint, max_outcomes = _join_unsure(states, list(steps), later[robot + 1], max_outcomes)
        states = merged(*joint._replace(reached=joint.reached & later[robot + 1]))
    return states, max_outcomes


def _join_unsure(
    states: States,
    steps: list[tuple[int, float, float, float]],
    later: SeedArray,
    max_outcomes: int,
) -> tuple[States, int]:
    """Join every state with every fate of a robot that may fail to collect a reward it gets to.

    ``steps`` are bit, reward, probability to get there, and share, of each node that it may
    collect; ``later`` are the nodes that other robots may collect. Node by node, so that fates that
    make no difference ahead are merged. Also returns what is left of ``max_outcomes``.
    """
    bits = np.array([step[0] for step in steps])
    ahead = np.zeros((len(steps) + 1, len(later)), np.uint64)
    ahead[np.arange(len(steps)), bits // 64] = np.uint64(1) << (bits % 64).astype(np.uint64)
    ahead = later | np.bitwise_or.accumulate(ahead[::-1])[::-1]
    lost, alive = [], 1.0
    for (bit, gain, credited, share), kept in zip(steps, ahead[1:], strict=True):
        max_outcomes = _spend(max_outcomes, 3 * len(states.values))
        on = credited / alive
        lost.append(states._replace(probabilities=states.probabilities * (1 - on)))
        chances = np.array([on * (1 - share), on * share])
        joint = _join(states, np.array([bit]), np.array([gain]), chances)
        states = merged(*joint._replace(reached=joint.reached & kept))
        alive = credited
    return States(*map(np.concatenate, zip(*lost, states, strict=True))), max_outcomes


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
