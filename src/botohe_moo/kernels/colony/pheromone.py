"""Deposit and evaporation of the two pheromones."""

import math

import numpy as np

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.kernels.compile import kernel

# Far below any amount that matters, far above where floats lose their digits: on arcs that no
# Pareto set uses pheromone falls by the same factor every iteration, for thousands of iterations.
LEAST = 1e-250

# Bounds on log(τη): a product of two such factors is neither 0 nor infinite, nor are sums of them,
# whatever rewards and parameters are. Ants rely on it: of weights that are all 0 none can be drawn.
LOG_LOW, LOG_HIGH = -650.0, 250.0


@kernel
def deposit(
    objectives: FloatArray,
    members: OffsetArray,
    arcs: IntArray,
    offsets: OffsetArray,
    n_robots: int,
    amounts: FloatArray,
) -> None:
    """Set ``amounts`` to what the plans ``members`` leave on each arc, in sum.

    Parameters
    ----------
    objectives
        E[R] and E[S] of each plan (n_plans, 2).
    members
        Indices of the plans that deposit.
    arcs, offsets
        Arcs of the trails, ragged, each trail ending with the base's self-loop.
    n_robots
        Trails per plan.
    amounts
        Output (n_maps, n_arcs, 2): reward and survival pheromone; with one map the robots share
        it, otherwise there is one a robot.
    """
    amounts[:] = 0.0
    n_maps = amounts.shape[0]
    for plan in members:
        reward, survivors = objectives[plan, 0], objectives[plan, 1]
        for robot in range(n_robots):
            trail = plan * n_robots + robot
            amount = amounts[robot if n_maps > 1 else 0]
            for i in range(offsets[trail], offsets[trail + 1]):
                amount[arcs[i], 0] += reward
                amount[arcs[i], 1] += survivors


@kernel
def learn(
    pheromone: FloatArray,
    evaporation: float,
    pooled: bool,
    objectives: FloatArray,
    members: OffsetArray,
    arcs: IntArray,
    offsets: OffsetArray,
    archived: FloatArray,
    archived_arcs: IntArray,
    archived_offsets: OffsetArray,
    archive_changed: bool,
    n_robots: int,
    amounts: FloatArray,
    archived_amounts: FloatArray,
) -> None:
    """Evaporate pheromone and let the iteration's and the global Pareto set deposit theirs.

    Parameters
    ----------
    pheromone
        Reward and survival pheromone (n_maps, n_arcs, 2), changed in place.
    evaporation
        Share that evaporates, in (0, 1).
    pooled
        Whether each deposit is divided by the number of plans in both sets together, or by the
        size of its own set.
    objectives, members, arcs, offsets
        The iteration's plans and its Pareto set, as in ``deposit``.
    archived, archived_arcs, archived_offsets
        The same of the global Pareto set, all of it.
    archive_changed
        Whether ``archived_amounts`` is out of date; as long as no plan enters it stays the same.
    n_robots
        Trails per plan.
    amounts, archived_amounts
        Both sets' deposits in sum (n_maps, n_arcs, 2); the first is scratch.
    """
    deposit(objectives, members, arcs, offsets, n_robots, amounts)
    if archive_changed:
        everyone = np.arange(len(archived))
        deposit(archived, everyone, archived_arcs, archived_offsets, n_robots, archived_amounts)
    iteration_size, archive_size = len(members), len(archived)
    if pooled:
        iteration_size = archive_size = iteration_size + archive_size
    kept = 1.0 - evaporation
    for m in range(pheromone.shape[0]):
        for arc in range(pheromone.shape[1]):
            for species in range(2):
                pheromone[m, arc, species] = max(
                    LEAST,
                    kept * pheromone[m, arc, species]
                    + amounts[m, arc, species] / max(1, iteration_size)
                    + archived_amounts[m, arc, species] / archive_size,
                )


@kernel
def log_weights(
    pheromone: FloatArray,
    log_eta_reward: float,
    log_eta_survival: FloatArray,
    log_reward: FloatArray,
    log_survival: FloatArray,
) -> None:
    """Write log(τ_R · η_R) and log(τ_S · η_S), with η_R that of a node already visited.

    Parameters
    ----------
    pheromone
        Reward and survival pheromone, above 0 (n_maps, n_arcs, 2).
    log_eta_reward, log_eta_survival
        Logarithms of the heuristics; the second per arc (n_arcs).
    log_reward, log_survival
        Output (n_maps, n_arcs), within ``LOG_LOW`` and ``LOG_HIGH``.
    """
    for m in range(pheromone.shape[0]):
        for arc in range(pheromone.shape[1]):
            reward = math.log(max(LEAST, pheromone[m, arc, 0])) + log_eta_reward
            survivors = math.log(max(LEAST, pheromone[m, arc, 1])) + log_eta_survival[arc]
            log_reward[m, arc] = min(max(reward, LOG_LOW), LOG_HIGH)
            log_survival[m, arc] = min(max(survivors, LOG_LOW), LOG_HIGH)
