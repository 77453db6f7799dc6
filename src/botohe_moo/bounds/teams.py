"""Steps that no plan lies above: E[R] where enough survive, by looking at all teams of trails.

If a team of j collects more than a goal, each of its trails k is worth more than

    goal − r_base − Σ_v c_v − max Σ_{i ≠ k} F(s_i),

where the survivals of all sum to x or more, and F(s) bounds what a trail that survives with s is
worth. All such trails are found, and of these the best team.
"""

from __future__ import annotations

import numpy as np

from botohe_moo.algorithms.exact.kernels import choose_teams, new_choices
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.certificate import Certificate, Facts
from botohe_moo.bounds.front_bound import Step, add_stairs, falling, least_total
from botohe_moo.bounds.ground import N_STEPS, Ground, Target
from botohe_moo.bounds.kernels.states import ROUNDING
from botohe_moo.bounds.kernels.trails import Stairs, follow_trails
from botohe_moo.bounds.relaxation import Ahead
from botohe_moo.core.ordered import best_reward, insert, new_front

_MOST_MOVES = 1_000_000  # of a search, for each unit of effort
_MOST_TEAMS = 20_000_000  # choices that are tried for the best team
_SECONDS_A_CHOICE = 2e-8  # on a usual processor
_MOST_ROUNDS = 3  # in which thresholds are raised
_N_HEIGHTS = 40  # of thresholds: few are quicker to search
LEAST_SURVIVAL = 1e-280  # as good as 0: where no robot survives with more, there are no stairs
_HIGHER = 1e-9  # by how much thresholds have to rise for another round, in shares of all reward


class TeamProver:
    """Proves that no team collects more than a goal, or what the best one collects."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground

    def prove(self, target: Target, certificate: Certificate) -> Facts:
        """Prove a step for a target, at its goal or at what teams collect that reach it."""
        ground, moving, x = self._ground, target.moving, target.x
        team, goal = ground.team(moving), target.goal - ground.base_reward
        prices = ground.lowest(certificate, moving, x)
        lines = ground.look_ahead_around(prices)
        goal_beside = goal - float(team.most(prices.visits).sum())
        least = max(0.0, x - (moving - 1) * ground.most_survival)
        needed = self._needed(moving, x, goal_beside, lines, None)
        n_most = _MOST_MOVES * target.effort
        for _ in range(_MOST_ROUNDS):
            stairs = np.maximum(ground.known_stairs(prices.visits), needed)
            raised = Stairs(stairs, ground.width, least)
            if not ground.raise_stairs(prices.visits, lines, raised, n_most)[0]:
                return Facts(is_proved=False)
            before = needed
            needed = np.maximum(before, self._needed(moving, x, goal_beside, lines, stairs))
            if (needed <= before + _HIGHER * ground.relaxation.total).all():
                break
        above = Stairs(needed, ground.width, least)
        spread = ground.spread(prices.visits)
        found = ground.relaxation.find_all(spread, lines, above, n_most)
        height = None if found is None else self._best_team(moving, x, goal, *found)
        if height is None:
            return Facts(is_proved=False)
        most = height + ground.base_reward
        most += ground.rounding(moving) * (ground.relaxation.total + ground.base_reward)
        return Facts(steps=(Step(moving, most, x, "exact"),))

    def _needed(
        self, moving: int, x: float, goal: float, ahead: list[Ahead], stairs: FloatArray | None
    ) -> FloatArray:
        """Return what a trail on each step is worth at least, in a team worth more than ``goal``.

        That is the goal, without what nodes give beside prices, less the most that the others are
        worth. ``stairs`` bound what any trail is worth, if they are given.
        """
        n_others, ground = moving - 1, self._ground
        # The others have to survive with the rest of x, at the upper end of the step.
        left = np.maximum(x - (np.arange(N_STEPS) + 1) * ground.width, 0.0)
        each = np.minimum(left / max(1, n_others), ground.most_survival)
        by_line = [n_others * (line.most - line.worth.mu * each) for line in ahead]
        others = np.min(by_line, axis=0)
        if stairs is not None:
            most = add_stairs(np.maximum(stairs, 0.0), n_others)
            totals = np.minimum(least_total(left, ground.width, n_others), len(most) - 1)
            others = np.minimum(others, most[totals])
        wide = -(-N_STEPS // _N_HEIGHTS)
        starts = np.arange(0, N_STEPS, wide)
        return falling(np.repeat(np.minimum.reduceat(goal - others, starts), wide)[:N_STEPS])

    def _best_team(
        self, moving: int, x: float, goal: float, arcs: OffsetArray, n_arcs: OffsetArray
    ) -> float | None:
        """Return what the best team of these trails collects, or the goal if that is more.

        Only teams whose survivals sum to ``x`` or more count. None is returned where there are too
        many teams.
        """
        if len(n_arcs) == 0:
            return goal
        team = self._ground.team(moving)
        survival, reached = follow_trails(self._ground.net.world, arcs, n_arcs)
        order, reached = np.argsort(-survival, kind="stable"), reached[:, team.nodes]
        no_slack = np.zeros(2)
        choices = new_choices(survival[order], reached[order], team.reward, no_slack, moving)
        # The search leaves out what the front covers: too little reward, or too few survivors.
        front = new_front(4, moving)
        insert(front, np.inf, x * (1.0 - ROUNDING) - LEAST_SURVIVAL)
        insert(front, goal, np.inf)
        deadline = self._ground.deadline
        n_most = int(min(_MOST_TEAMS, deadline.left / _SECONDS_A_CHOICE))
        ended = choose_teams(choices, front, n_most, most_reward=True)
        deadline.work += _SECONDS_A_CHOICE * int(choices.turn[0].n_looks)
        return best_reward(front, np.inf) if ended else None
