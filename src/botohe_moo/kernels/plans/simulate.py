"""What happens to the robots of one plan: simulated, or all outcomes of all robots joined."""

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.kernels.compile import kernel
from botohe_moo.kernels.graph.arcs import find_arc
from botohe_moo.kernels.graph.graph import Graph
from botohe_moo.kernels.plans.ragged import Trails

_AT_ONCE = 64  # missions


@kernel
def follow(graph: Graph, trails: Trails, alive: FloatArray, pays: FloatArray) -> None:
    """Write how likely each position of a valid plan's trails is reached, and what it may pay.

    At each position ``alive`` is the product of the survivals along the trail up to there, and
    ``pays`` the reward of the node where its trail visits it first, else 0 (n_positions).
    """
    nodes, offsets = trails.nodes, trails.offsets
    visited_by = np.full(graph.reward.shape[0], -1, np.int64)
    for trail in range(offsets.shape[0] - 1):
        start = offsets[trail]
        for i in range(start, offsets[trail + 1]):
            node = nodes[i]
            alive[i] = 1.0
            if i > start:
                arc = find_arc(graph, nodes[i - 1], node)
                alive[i] = alive[i - 1] * graph.survival[arc]
            pays[i] = 0.0
            if visited_by[node] != trail:
                visited_by[node] = trail
                pays[i] = graph.reward[node]


@kernel
def play_hops(
    offsets: OffsetArray, alive: FloatArray, draws: FloatArray, hops: OffsetArray
) -> None:
    """Play missions: one draw settles how far a robot gets, by inverse transform.

    ``draws`` are uniform in [0, 1), and ``hops``, the arcs that each robot survived, are written
    (n_missions, n_robots). ``alive`` is what ``follow`` wrote.
    """
    for mission in range(draws.shape[0]):
        for robot in range(draws.shape[1]):
            start = offsets[robot]
            low, high = start, offsets[robot + 1]
            while high - low > 1:
                middle = (low + high) // 2
                if draws[mission, robot] < alive[middle]:
                    low = middle
                else:
                    high = middle
            hops[mission, robot] = low - start


@kernel
def play_rewards(
    reward: FloatArray, trails: Trails, alive: FloatArray, draws: FloatArray, rewards: FloatArray
) -> None:
    """Write the team rewards (n_missions) of the missions that ``play_hops`` plays.

    Each is summed in the order of the nodes, so that the same nodes always bring the same
    floating-point number. Missions are played ``_AT_ONCE`` at a time, which vectorises.
    """
    nodes, offsets = trails.nodes, trails.offsets
    reached = np.empty((reward.shape[0], _AT_ONCE), np.bool_)
    drawn, totals = np.zeros(_AT_ONCE), np.empty(_AT_ONCE)
    for first in range(0, draws.shape[0], _AT_ONCE):
        n = min(_AT_ONCE, draws.shape[0] - first)
        reached[:] = False
        for robot in range(draws.shape[1]):
            drawn[:n] = draws[first : first + n, robot]
            least = drawn.min()
            for i in range(offsets[robot], offsets[robot + 1]):
                survival = alive[i]
                if survival <= least:  # none of these missions gets so far
                    break
                at_node = reached[nodes[i]]
                for k in range(_AT_ONCE):
                    at_node[k] |= drawn[k] < survival
        totals[:] = 0.0
        for node in range(reward.shape[0]):
            at_node, gain = reached[node], reward[node]
            for k in range(_AT_ONCE):
                totals[k] += gain if at_node[k] else 0.0
        rewards[first : first + n] = totals[:n]


@kernel
def join(
    values: FloatArray,
    probabilities: FloatArray,
    reached: SeedArray,
    bits: OffsetArray,
    gains: FloatArray,
    chances: FloatArray,
) -> tuple[FloatArray, FloatArray, SeedArray]:
    """Join every state of the robots so far with every fate of one more robot.

    States are the reward and the probability of each (n_states), and the nodes reached, as bits
    (n_states, n_words); so are the joint states that are given back. ``bits`` and ``gains`` are the
    bit and the reward of each node that the robot may reach, in the order of its trail
    (n_reachable); ``chances`` the probability that it reaches the first 0, 1, ..., n_reachable of
    them and no more (n_reachable + 1), where a fate with the probability 0 is left out.
    """
    n_joint = values.shape[0] * np.count_nonzero(chances)
    joint_values, joint_probabilities = np.empty(n_joint), np.empty(n_joint)
    joint_reached = np.empty((n_joint, reached.shape[1]), np.uint64)
    word, bit = bits // 64, np.uint64(1) << (bits % 64).astype(np.uint64)
    n_written = 0
    for state in range(values.shape[0]):
        value, now = values[state], reached[state].copy()
        for fate in range(chances.shape[0]):
            if fate > 0:
                node = fate - 1
                if now[word[node]] & bit[node] == 0:
                    now[word[node]] |= bit[node]
                    value += gains[node]
            if chances[fate] > 0.0:
                joint_values[n_written] = value
                joint_probabilities[n_written] = probabilities[state] * chances[fate]
                joint_reached[n_written] = now
                n_written += 1
    return joint_values, joint_probabilities, joint_reached
