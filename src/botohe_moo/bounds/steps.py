"""Steps that no plan of a number of moving robots lies above: E[R] where enough survive.

Stairs prove them. For each step of survival, stairs say what a trail is worth at most that survives
with as much or more. Step b represents survivals from b · width to (b + 1) · width. Heights never
rise.
"""

from __future__ import annotations

import numpy as np

from botohe_moo.algorithms.exact.kernels import choose_teams, new_choices
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.front_bound import EDGE, Step, add_stairs, falling, last_steps, least_total
from botohe_moo.bounds.kernels.states import ROUNDING
from botohe_moo.bounds.kernels.trails import Stairs, follow_trails
from botohe_moo.bounds.lines import LEAST_MU, N_STEPS, Lines
from botohe_moo.bounds.master import Prices
from botohe_moo.bounds.relaxation import LEVELS, MOST_LINES, Ahead
from botohe_moo.core.ordered import best_reward, insert, new_front

# As in ``proof``, these constants were chosen by experiment, and every step is valid whatever they
# are.

_MOST_LINKS = 1_000_000  # of a depth-first search, for each unit of effort
_MOST_TEAMS = 20_000_000  # choices that are tried for the best team
_SECONDS_A_CHOICE = 2e-8  # that is tried
_MOST_ROUNDS = 3  # in which thresholds are raised
_N_HEIGHTS = 40  # of thresholds: few are quicker to search
_LINES_SHARE = 0.4  # of the time that is left, to find a line at the place of the step
LEAST_SURVIVAL = 1e-280  # as good as 0: where no robot survives with more, there are no stairs
_HIGHER = 1e-9  # by how much thresholds have to rise for another round, in shares of all reward


class Steps:
    """All steps for a number of moving robots."""

    def __init__(self, lines: Lines, most_survival: float) -> None:
        self._lines, self._relaxation, self._pool = lines, lines.relaxation, lines.pool
        self._n_robots, self._most_survival = lines.n_robots, most_survival
        self._width = most_survival * (1.0 + 1e-9) / N_STEPS
        self.found: list[Step] = []

    def tighten(self, x: float, goal: float, effort: int, until: float) -> bool:
        """Lower the bound to a goal where the moving robots' survivals sum to ``x`` or more.

        Where teams collect more than the goal, lower it to what they collect. Returns False where
        this takes too long, or robots survive too rarely for stairs.
        """
        if self._most_survival < LEAST_SURVIVAL:
            return False
        if self._n_robots == 1:
            return self._for_one(x, effort)
        if effort == 1:
            now = self._relaxation.clock.now
            self._lines.tighten(x, 1, now + _LINES_SHARE * (until - now))
        return self._for_team(x, goal - self._lines.base_reward, effort)

    def _keep(self, least: float, most: float) -> None:
        """Keep a step if it is below the lines and the other steps."""
        base_reward = self._lines.base_reward
        most += base_reward + self._lines.rounding * (self._relaxation.total + base_reward)
        below = [step.most for step in self.found if step.least <= least]
        if most >= min([self._lines.bound(least), *below]):
            return
        step = Step(self._n_robots, most, least, "exact")
        self.found = [old for old in self.found if old.least < least or old.most < most]
        self.found.append(step)

    def _for_one(self, x: float, effort: int) -> bool:
        """Find what one robot collects at most that survives with ``x`` or more.

        Its prices are the rewards, so that nodes give nothing beside them.
        """
        team = self._lines.team
        prices = Prices(team.reward[:, None] * team.alive, 0.0)
        stairs = self._lines.known_stairs(prices.visits, self._width)
        others = self._lines.lowest(x, self._most_survival, MOST_LINES)
        beside = [team.to_all(team.most(other.visits)) for other in others]
        lines = [
            (self._lines.look_ahead(other), own) for other, own in zip(others, beside, strict=True)
        ]
        raised, n_most = Stairs(stairs, self._width, x), _MOST_LINKS * effort
        if not self._lines.raise_stairs(prices.visits, lines, raised, n_most)[0]:
            return False
        first = int(x / self._width * (1 - EDGE))
        self._keep(x, float(stairs[first]))
        for step in (last_steps(stairs) + 1).tolist():
            if first < step < len(stairs):
                self._keep(max(x, step * self._width), float(stairs[step]))
        return True

    def _for_team(self, x: float, goal: float, effort: int) -> bool:
        """Find all trails of teams that collect more than the goal, and the best of these teams.

        Each trail of such a team is worth at least the goal, less what nodes give beside prices,
        and less the most that the others are worth.
        """
        team = self._lines.team
        prices = self._lines.lowest(x, x, 1)[0]
        mu = max(prices.mu, LEAST_MU * self._relaxation.total)
        lines = self._lines.look_ahead_around(prices.visits, mu)
        ahead = [each for each, _ in lines]
        goal_beside = goal - float(team.most(prices.visits).sum())
        least = max(0.0, x - (self._n_robots - 1) * self._most_survival)
        needed, n_most = self._needed(x, goal_beside, ahead, None), _MOST_LINKS * effort
        for _ in range(_MOST_ROUNDS):
            stairs = np.maximum(self._lines.known_stairs(prices.visits, self._width), needed)
            raised = Stairs(stairs, self._width, least)
            if not self._lines.raise_stairs(prices.visits, lines, raised, n_most)[0]:
                return False
            before = needed
            needed = np.maximum(before, self._needed(x, goal_beside, ahead, stairs))
            if (needed <= before + _HIGHER * self._relaxation.total).all():
                break
        above = Stairs(needed, self._width, least)
        spread = team.spread(prices.visits, LEVELS)
        found = self._relaxation.find_all(spread, lines, above, n_most)
        height = None if found is None else self._best_team(x, goal, *found)
        if height is None:
            return False
        self._keep(x, height)
        return True

    def _needed(
        self, x: float, goal: float, ahead: list[Ahead], stairs: FloatArray | None
    ) -> FloatArray:
        """Return what a trail on each step is worth at least, in a team that is worth a goal.

        ``stairs`` bound what any trail is worth, if they are given.
        """
        n_others = self._n_robots - 1
        # The others have to survive with the rest of x, at the upper end of the step.
        left = np.maximum(x - (np.arange(N_STEPS) + 1) * self._width, 0.0)
        each = np.minimum(left / n_others, self._most_survival)
        others = np.full(N_STEPS, np.inf)
        for line in ahead:
            others = np.minimum(others, n_others * (line.most - line.worth.mu * each))
        if stairs is not None:
            most = add_stairs(np.maximum(stairs, 0.0), n_others)
            totals = np.minimum(least_total(left, self._width, n_others), len(most) - 1)
            others = np.minimum(others, most[totals])
        wide = -(-N_STEPS // _N_HEIGHTS)
        starts = np.arange(0, N_STEPS, wide)
        return falling(np.repeat(np.minimum.reduceat(goal - others, starts), wide)[:N_STEPS])

    def _best_team(
        self, x: float, goal: float, arcs: OffsetArray, n_arcs: OffsetArray
    ) -> float | None:
        """Return what the best team of these trails collects, or the goal if that is more.

        Only teams whose survivals sum to ``x`` or more count. None is returned where there are too
        many teams.
        """
        if len(n_arcs) == 0:
            return goal
        reward = self._lines.team.reward
        survival, reached = follow_trails(self._relaxation.net.world, arcs, n_arcs)
        reached = reached[:, self._lines.team.nodes]
        order = np.argsort(-survival, kind="stable")
        no_slack = np.zeros(2)
        choices = new_choices(survival[order], reached[order], reward, no_slack, self._n_robots)
        # The search leaves out what the front covers: too little reward, or too few survivors.
        front = new_front(4, self._n_robots)
        insert(front, np.inf, x * (1.0 - ROUNDING) - LEAST_SURVIVAL)
        insert(front, goal, np.inf)
        clock = self._relaxation.clock
        n_most = clock.most(_MOST_TEAMS, _SECONDS_A_CHOICE)
        with self._relaxation.turns.aside():
            ended = choose_teams(choices, front, n_most, most_reward=True)
        clock.count(_SECONDS_A_CHOICE * int(choices.turn[0].n_looks))
        if not ended and n_most < _MOST_TEAMS:
            clock.end()
        return best_reward(front, np.inf) if ended else None
