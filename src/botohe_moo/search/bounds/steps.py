"""Steps that no plan of a number of moving robots lies above: E[R] where enough survive.

Stairs prove them. For each step of survival, stairs say what a trail is worth at most that survives
with as much or more. Step b represents survivals from b · width to (b + 1) · width. Heights never
rise.
"""

from __future__ import annotations

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import ROUNDING
from botohe_moo.kernels.bounds.trails import Stairs
from botohe_moo.kernels.exact.teams import FINISHED, choose_teams, new_choices
from botohe_moo.kernels.fronts.ordered import best_reward, insert, new_front
from botohe_moo.search.bounds.lines import LEVELS, Lines
from botohe_moo.search.bounds.prices import Prices
from botohe_moo.search.bounds.record import Step
from botohe_moo.search.bounds.relaxation import MOST_LINES, Ahead, BoundLines

# As in ``proof``, these constants were chosen by experiment, and every step is valid whatever they
# are.

_MOST_LINKS = 1_000_000  # of a depth-first search, for each unit of effort
_MOST_TEAMS = 20_000_000  # choices that are tried for the best team
_SECONDS_A_CHOICE = 2e-8  # that is tried
_MOST_ROUNDS = 3  # in which thresholds are raised
# Prices of survival that bound what lies ahead, in shares of that of the line; and what that is at
# least, in shares of all reward.
MU_SHARES = (0.3, 1.0)
LEAST_MU = 0.01
_LINES_SHARE = 0.4  # of the time that is left, to find a line at the place of the step
_EPSILON = float(np.finfo(float).eps)
_EDGE = 1e-12  # survivals this much below a step count as on it, relative
LEAST_SURVIVAL = 1e-280  # as good as 0: where no robot survives with more, there are no stairs
_HIGHER = 1e-9  # by how much thresholds have to rise for another round, in shares of all reward


class Steps:
    """All steps for a number of moving robots.

    Stairs have ``n_steps`` steps of survival, and thresholds ``n_heights`` heights: few are quicker
    to search.
    """

    def __init__(
        self, lines: Lines, most_survival: float, *, n_steps: int = 2_000, n_heights: int = 40
    ) -> None:
        self._lines, self._relaxation, self._pool = lines, lines.relaxation, lines.pool
        self._n_robots, self._most_survival = lines.n_robots, most_survival
        self._n_steps, self._n_heights = n_steps, n_heights
        self._width = most_survival * (1.0 + 1e-9) / n_steps
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
        graph = self._relaxation.net.graph
        # Products of a team's survivals are rounded at each factor, and so is the sum over nodes.
        n_terms = 2 * self._n_robots * (graph.n_arcs + 2) + graph.n_nodes + 8
        most += base_reward + n_terms * _EPSILON * (self._relaxation.total + base_reward)
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
        stairs = np.maximum(self._known(prices), 0.0)
        others = self._lines.lowest(x, self._most_survival, MOST_LINES)
        beside = [team.to_all(team.most(other.visits)) for other in others]
        lines = list(zip(self._lines.look_ahead(*others), beside, strict=True))
        if not self._raise(prices, lines, Stairs(stairs, self._width, x), effort):
            return False
        first = int(x / self._width * (1 - _EDGE))
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
        ahead = self._lines.look_ahead(*(Prices(prices.visits, share * mu) for share in MU_SHARES))
        lines = [(each, team.to_all(np.zeros(len(team.nodes)))) for each in ahead]
        goal_beside = goal - float(team.most(prices.visits).sum())
        least = max(0.0, x - (self._n_robots - 1) * self._most_survival)
        needed = self._needed(x, goal_beside, ahead, None)
        for _ in range(_MOST_ROUNDS):
            stairs = np.maximum(self._known(prices), needed)
            if not self._raise(prices, lines, Stairs(stairs, self._width, least), effort):
                return False
            before = needed
            needed = np.maximum(before, self._needed(x, goal_beside, ahead, stairs))
            if (needed <= before + _HIGHER * self._relaxation.total).all():
                break
        above, n_most = Stairs(needed, self._width, least), _MOST_LINKS * effort
        spread = team.spread(prices.visits, LEVELS)
        found = self._relaxation.find_all(spread, lines, above, n_most)
        height = None if found is None else self._best_team(x, goal, *found)
        if height is None:
            return False
        self._keep(x, height)
        return True

    def _raise(self, prices: Prices, lines: BoundLines, stairs: Stairs, effort: int) -> bool:
        """Raise stairs above all trails; return whether the search ended."""
        spread = self._lines.team.spread(prices.visits, LEVELS)
        ended, trails = self._relaxation.raise_stairs(spread, lines, stairs, _MOST_LINKS * effort)
        for arcs in trails:
            self._pool.add(arcs)
        return ended

    def _known(self, prices: Prices) -> FloatArray:
        """Return the stairs of known trails, without anything for their survival."""
        worth = self._pool.values(prices._replace(mu=0.0), relaxed=False)
        return stairs_of(worth, self._pool.survival, self._width, self._n_steps)

    def _needed(
        self, x: float, goal: float, ahead: list[Ahead], stairs: FloatArray | None
    ) -> FloatArray:
        """Return what a trail on each step is worth at least, in a team that is worth a goal.

        ``stairs`` bound what any trail is worth, if they are given.
        """
        n_others, n_steps = self._n_robots - 1, self._n_steps
        # The others have to survive with the rest of x, at the upper end of the step.
        left = np.maximum(x - (np.arange(n_steps) + 1) * self._width, 0.0)
        each = np.minimum(left / n_others, self._most_survival)
        others = np.full(n_steps, np.inf)
        for line in ahead:
            others = np.minimum(others, n_others * (line.most - line.worth.mu * each))
        if stairs is not None:
            most = add_stairs(np.maximum(stairs, 0.0), n_others)
            totals = np.minimum(least_total(left, self._width, n_others), len(most) - 1)
            others = np.minimum(others, most[totals])
        wide = -(-n_steps // self._n_heights)
        starts = np.arange(0, n_steps, wide)
        return falling(np.repeat(np.minimum.reduceat(goal - others, starts), wide)[:n_steps])

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
        survival, reached = self._figures(arcs, n_arcs)
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
        if ended != FINISHED and n_most < _MOST_TEAMS:
            clock.end()
        return best_reward(front, np.inf) if ended == FINISHED else None

    def _figures(self, arcs: OffsetArray, n_arcs: OffsetArray) -> tuple[FloatArray, FloatArray]:
        """Return survivals of trails, and the probabilities to reach each node that pays."""
        net, nodes = self._relaxation.net, self._lines.team.nodes
        column = np.full(net.graph.n_nodes, len(nodes))  # the last column is for other nodes
        column[nodes] = np.arange(len(nodes))
        alive: FloatArray = net.graph.survival[arcs]
        alive[np.arange(arcs.shape[1]) >= n_arcs[:, None]] = 1.0
        np.cumprod(alive, axis=1, out=alive)
        reached = np.zeros((len(arcs), len(nodes) + 1))
        for step in range(int(n_arcs.max())):
            (rows,) = np.nonzero(n_arcs > step)
            columns = column[net.graph.head[arcs[rows, step]]]
            # The first visit counts, since no later one is as likely.
            reached[rows, columns] = np.maximum(reached[rows, columns], alive[rows, step])
        return alive[:, -1].copy(), reached[:, :-1].copy()


def stairs_of(values: FloatArray, survival: FloatArray, width: float, n_steps: int) -> FloatArray:
    """Return the stairs of trails (n_steps), −inf where none survives as well."""
    stairs = np.full(n_steps, -np.inf)
    steps = np.minimum((survival / width * (1 + _EDGE)).astype(np.int64), n_steps - 1)
    np.maximum.at(stairs, steps, values)
    return falling(stairs)


def last_steps(stairs: FloatArray) -> OffsetArray:
    """Return the last step of each height."""
    falls = np.append(stairs[1:] < stairs[:-1], True)
    return np.flatnonzero(falls & np.isfinite(stairs))


def falling(stairs: FloatArray) -> FloatArray:
    """Raise each step to the highest of those after it, so that stairs never rise."""
    raised: FloatArray = np.maximum.accumulate(stairs[::-1])[::-1]
    return raised


def least_total(x: FloatArray, width: float, n_trails: int) -> OffsetArray:
    """Return the least sum of steps of ``n_trails`` trails whose survivals sum to ``x`` or more."""
    totals: OffsetArray = (x / width * (1 - _EDGE)).astype(np.int64) - n_trails + 1
    return np.maximum(totals, 0)


def add_stairs(stairs: FloatArray, n_trails: int) -> FloatArray:
    """Return the most that ``n_trails`` trails are worth together, by the sum of their steps."""
    most = stairs
    for _ in range(n_trails - 1):
        most = add_two(stairs, most)
    return most


def add_two(stairs: FloatArray, others: FloatArray) -> FloatArray:
    """Return the most that a trail and others are worth together, by the sum of their steps."""
    after = np.full(len(others) + len(stairs) - 1, -np.inf)
    for step in last_steps(stairs).tolist():
        reached = after[step : step + len(others)]
        np.maximum(reached, others + stairs[step], out=reached)
    return falling(after)
