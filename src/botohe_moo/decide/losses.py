"""The worst case of a plan over sets of robots that never leave."""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations
from math import comb

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.core.world import AT_NEXT_DEPOT, AT_THIS_DEPOT, layer_of
from botohe_moo.mission.model import Mission
from botohe_moo.outcomes import collect_probabilities
from botohe_moo.trails import TrailPlan

_MAX_SETS = 1_000_000  # of robots that are lost
_CELLS = 2**20  # numbers that are computed at once
_LOG_OF_ZERO = -750.0  # exp of it is 0
_TIE = 1e-12  # of the reward: sets that are as bad


def worst_losses(
    mission: Mission, plan: TrailPlan, losses: int
) -> tuple[float, tuple[int, ...] | None]:
    """Compute the worst case of a valid plan, and which robots are lost; None if it is a bound.

    See :func:`botohe_moo.worst_case`.
    """
    collected = collect_probabilities(mission, plan)
    paying = np.flatnonzero(collected.any(axis=0) & (mission.rewards > 0))
    rewards, missed = mission.rewards[paying], 1 - collected[:, paying]
    missed_at_start = 1 - _collected_at_start(mission)[:, paying]
    if comb(mission.robots, losses) > _MAX_SETS:
        return _worst_bound(rewards, missed, missed_at_start, losses), None
    sets = _sets(mission.robots, losses)
    left = _rewards_without(rewards, missed, missed_at_start, sets)
    worst = int((left <= left.min() + _TIE * rewards.sum()).argmax())
    return float(left[worst]), tuple(sets[worst].tolist())


@lru_cache(maxsize=1)
def _sets(n_robots: int, losses: int) -> OffsetArray:
    """List the sets of so many robots (n_sets, losses)."""
    sets = np.array(list(combinations(range(n_robots), losses)), dtype=np.int64)
    return sets.reshape(comb(n_robots, losses), losses)


def _rewards_without(
    rewards: FloatArray, missed: FloatArray, missed_at_start: FloatArray, sets: OffsetArray
) -> FloatArray:
    """Compute E[R] without the robots of each set (n_sets, losses).

    ``missed`` are the probabilities that a robot does not collect a reward (robots, n_rewards) if
    it follows its trail, ``missed_at_start`` those if it never leaves.
    """
    with np.errstate(divide="ignore"):
        logs, logs_at_start = (
            np.maximum(np.log(of), _LOG_OF_ZERO) for of in (missed, missed_at_start)
        )
    left, n_at_once = np.empty(len(sets)), max(1, _CELLS // max(1, missed.size))
    for first in range(0, len(sets), n_at_once):
        some = sets[first : first + n_at_once]
        lost = np.zeros((len(some), len(missed)))
        np.put_along_axis(lost, some, 1.0, axis=1)
        by_nobody = np.exp((1 - lost) @ logs + lost @ logs_at_start)
        left[first : first + n_at_once] = (1 - by_nobody) @ rewards
    return left


def _worst_bound(
    rewards: FloatArray, missed: FloatArray, missed_at_start: FloatArray, losses: int
) -> float:
    """Bound the worst case from below; see :func:`botohe_moo.worst_case`."""
    given, n_robots = (rewards, missed, missed_at_start), len(missed)
    [none], [all_robots] = (_rewards_without(*given, _sets(n_robots, n)) for n in (n_robots, 0))
    alone = np.sort(_rewards_without(*given, _sets(n_robots, n_robots - 1)))
    by_sum = all_robots - (alone - none)[-losses:].sum()
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(missed > 0, missed_at_start / missed, np.inf)
    lost = np.zeros(missed.shape, dtype=bool)
    np.put_along_axis(lost, ratio.argsort(axis=0)[-losses:], True, axis=0)
    by_node = (1 - np.where(lost, missed_at_start, missed).prod(axis=0)) @ rewards
    return float(max(by_sum, alone[-losses - 1], by_node))


def _collected_at_start(mission: Mission) -> FloatArray:
    """Compute with what probability robots that never leave collect rewards (robots, n_nodes)."""
    world, collected = mission.world, np.zeros((mission.robots, len(mission.nodes)))
    team, returns = world.team, world.returns
    paid = np.ones(mission.robots, bool)
    if returns is not None:
        paid = returns.credit[team.start] != AT_NEXT_DEPOT
    where = np.arange(mission.robots), team.origin[team.start]
    collected[where] = team.share[team.start] * paid
    if returns is not None:
        for robot in np.flatnonzero(returns.credit[team.start] == AT_THIS_DEPOT):
            aboard = returns.aboard[returns.first[robot] : returns.stop[robot]]
            collected[robot, aboard] = team.share[layer_of(team, team.start[robot]) + aboard]
    return collected
