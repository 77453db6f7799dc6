"""Deposit and evaporation of the two pheromones, and the weights that follow from them."""

import math
from typing import NamedTuple

from botohe_moo._base.types import FloatArray, IntArray, OffsetArray
from botohe_moo.core.compile import helper, kernel
from botohe_moo.core.graph import Graph, find_arc
from botohe_moo.core.kinds import loop_at
from botohe_moo.kernels.colony.weighing import Weights

# The least pheromone. On arcs that no Pareto set uses pheromone falls by the same factor for
# thousands of iterations: this is far below any amount that matters, and far above where floats
# lose their digits.
LEAST = 1e-250

# Bounds on log(τη). Whatever rewards and parameters are, products of two such factors, and sums of
# these products, are neither 0 nor infinite: where all weights are 0 ants could not draw an arc.
LOG_LOW, LOG_HIGH = -650.0, 250.0


class Depositors(NamedTuple):
    """Plans that leave pheromone."""

    objectives: FloatArray  # E[R] and E[S] of all plans (n_plans, 2)
    members: OffsetArray  # indices of those that deposit
    # All trails, ragged.
    nodes: IntArray
    offsets: OffsetArray


class Pheromone(NamedTuple):
    """Pheromone, and the last deposits; each robot has a map, or all robots share one."""

    levels: FloatArray  # reward and survival pheromone, above 0 (n_maps, n_arcs + n_kinds, 2)
    # Sums of what the plans of the iteration's and of the global Pareto set have left
    # (n_maps, n_arcs + n_kinds, 2).
    deposits: FloatArray
    archive_deposits: FloatArray
    # Logarithms of η_R for a node already visited, and of η_S (n_arcs + n_kinds).
    log_eta_reward: FloatArray
    log_eta_survival: FloatArray


@helper
def _deposit(graph: Graph, plans: Depositors, amounts: FloatArray) -> None:
    """Set ``amounts`` to the sum of what the plans leave on each arc.

    It has the shape (n_maps, n_arcs + n_kinds, 2).
    """
    n_maps, n_arcs = amounts.shape[0], graph.head.shape[0]
    n_robots = (plans.offsets.shape[0] - 1) // plans.objectives.shape[0]
    for m in range(n_maps):
        for arc in range(amounts.shape[1]):
            amounts[m, arc, 0] = amounts[m, arc, 1] = 0.0
    for m in range(plans.members.shape[0]):
        plan = plans.members[m]
        reward, survivors = plans.objectives[plan, 0], plans.objectives[plan, 1]
        for robot in range(n_robots):
            trail = plan * n_robots + robot
            which = robot if n_maps > 1 else 0
            last = plans.offsets[trail + 1] - 1
            for i in range(plans.offsets[trail], last + 1):
                arc = loop_at(graph.kinds, n_arcs, int(plans.nodes[i]))
                if i < last:
                    arc = find_arc(graph, int(plans.nodes[i]), int(plans.nodes[i + 1]))
                amounts[which, arc, 0] += reward
                amounts[which, arc, 1] += survivors


@kernel
def learn(
    graph: Graph,
    iteration: Depositors,
    archive: Depositors,
    is_new: bool,
    evaporation: float,
    pooled: bool,
    pheromone: Pheromone,
    weights: Weights,
) -> None:
    """Evaporate pheromone, and deposit that of the iteration's and of the global Pareto set.

    The share ``evaporation``, in [0, 1), evaporates. The deposits of both sets are divided by the
    number of plans in both if they are ``pooled``, otherwise each by the number in its own set.
    What the archive deposits is summed up again only if the archive ``is_new``. Then the logarithms
    of τ_R η_R and τ_S η_S are written to ``weights``, within ``LOG_LOW`` and ``LOG_HIGH``.
    """
    levels, deposits, archived = pheromone.levels, pheromone.deposits, pheromone.archive_deposits
    _deposit(graph, iteration, deposits)
    if is_new:
        _deposit(graph, archive, archived)
    n_iteration, n_archive = iteration.members.shape[0], archive.members.shape[0]
    if pooled:
        n_iteration = n_archive = n_iteration + n_archive
    kept, n_iteration, n_archive = 1.0 - evaporation, max(1, n_iteration), max(1, n_archive)
    for m in range(levels.shape[0]):
        for arc in range(levels.shape[1]):
            for species in range(2):
                level = (
                    kept * levels[m, arc, species]
                    + deposits[m, arc, species] / n_iteration
                    + archived[m, arc, species] / n_archive
                )
                levels[m, arc, species] = max(LEAST, level)
            reward = math.log(levels[m, arc, 0]) + pheromone.log_eta_reward[arc]
            alive = math.log(levels[m, arc, 1]) + pheromone.log_eta_survival[arc]
            weights.log_reward[m, arc] = min(max(reward, LOG_LOW), LOG_HIGH)
            weights.log_survival[m, arc] = min(max(alive, LOG_LOW), LOG_HIGH)
