"""Steps that no plan of a number of moving robots lies above: E[R] where enough survive.

They are proved by stairs, which say for each step of survival what a trail is worth at most that
survives with as much or more. Step b represents survivals of b · width or more, and less than
(b + 1) · width. Heights never rise.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.bounds.states import ROUNDING
from botohe_moo.kernels.bounds.trails import Stairs
from botohe_moo.kernels.exact.teams import FINISHED, choose_teams, new_choices, new_turn
from botohe_moo.kernels.fronts.ordered import best_reward, insert, new_front
from botohe_moo.search.bounds.lines import Lines
from botohe_moo.search.bounds.pool import Pool
from botohe_moo.search.bounds.record import Step
from botohe_moo.search.bounds.relaxation import MOST_LINES, Ahead, Relaxation

_EPSILON = float(np.finfo(float).eps)
_EDGE = 1e-12  # survivals this much below a step count as on it, relative
_LEAST_SURVIVAL = 1e-280
_HIGHER = 1e-9  # by how much what bounds a search is raised, relative


class StepSearch(NamedTuple):
    """How steps are searched for."""

    n_steps: int = 2_000  # of survival, in the stairs of trails
    n_heights: int = 40  # that thresholds have at most: few are quicker to search
    most_links: int = 1_000_000  # of a depth-first search, for each unit of effort
    most_teams: int = 20_000_000
    most_rounds: int = 3  # in which thresholds are raised
    # Prices of survival that bound what lies ahead, in shares of that of the line.
    shares: tuple[float, ...] = (0.0, 0.4, 0.7, 1.0, 1.5, 3.0, 8.0)
    least_mu: float = 0.01  # of all reward
    lines_share: float = 0.4  # of the time that is left, to find a line at the step's own place

    @property
    def bytes_a_state(self) -> float:
        """The bytes that what lies ahead of a state takes, at all of these prices twice."""
        return 16.0 * len(self.shares) * 60


class Steps:
    """All steps for a number of moving robots."""

    def __init__(
        self,
        relaxation: Relaxation,
        pool: Pool,
        lines: Lines,
        rule: StepSearch,
        most_survival: float,
    ) -> None:
        self._relaxation, self._pool, self._lines, self._rule = relaxation, pool, lines, rule
        self._n_robots, self._most_survival = lines.n_robots, most_survival
        self._width = most_survival * (1.0 + 1e-9) / rule.n_steps
        self.found: list[Step] = []

    def tighten(self, x: float, goal: float, effort: int, deadline: float) -> bool:
        """Lower the bound to a goal where the moving robots' survivals sum to ``x`` or more.

        Or to what teams collect, where that is more. False where it takes too long, or robots
        survive too rarely for stairs.
        """
        if self._most_survival < _LEAST_SURVIVAL:
            return False
        if self._n_robots == 1:
            return self._for_one(x, effort)
        if effort == 1:
            moment = time.monotonic()
            self._lines.tighten(x, 1, moment + self._rule.lines_share * (deadline - moment))
        return self._for_team(x, goal - self._lines.base_reward, effort)

    def _keep(self, least: float, most: float) -> None:
        """Keep a step, if it is below what is proved there."""
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
        """Find what one robot collects that survives with ``x`` or more, whatever it collects.

        Its prices are the rewards, which leave nothing beside.
        """
        rule, team = self._rule, self._lines.team
        prices = team.reward[:, None] * team.alive
        stairs = np.maximum(self._known(prices), 0.0)
        lines = [
            (self._ahead(own, mu), team.to_all(team.most(own)))
            for own, mu in self._lines.lowest(x, self._most_survival, MOST_LINES)
        ]
        fine = self._fine(prices)
        given = Stairs(stairs, self._width, x)
        n_most = rule.most_links * effort
        ended, trails = self._relaxation.raise_stairs(fine, lines, given, n_most)
        for arcs in trails:
            self._pool.add(arcs)
        if not ended:
            return False
        first = int(x / self._width * (1 - _EDGE))
        self._keep(x, float(stairs[first]))
        for step in (last_steps(stairs) + 1).tolist():
            if first < step < len(stairs):
                self._keep(max(x, step * self._width), float(stairs[step]))
        return True

    def _for_team(self, x: float, goal: float, effort: int) -> bool:
        """Find all trails of teams that collect more than the goal, and the best of these teams.

        Of such a team each trail is worth what is left of the goal without what nodes give beside
        prices, and without the most that the others are worth.
        """
        rule, team, n_most = self._rule, self._lines.team, self._rule.most_links * effort
        prices, mu = self._lines.lowest(x, x, 1)[0]
        mu = max(mu, rule.least_mu * self._relaxation.total)
        lines = [
            (self._ahead(prices, share * mu), team.to_all(np.zeros(len(prices))))
            for share in rule.shares
        ]
        fine, beside = self._fine(prices), float(team.most(prices).sum())
        least = max(0.0, x - (self._n_robots - 1) * self._most_survival)
        ahead = [each for each, _ in lines]
        needed = self._needed(x, goal - beside, ahead, None)
        for _ in range(rule.most_rounds):
            stairs = np.maximum(self._known(prices), needed)
            given = Stairs(stairs, self._width, least)
            ended, trails = self._relaxation.raise_stairs(fine, lines, given, n_most)
            for arcs in trails:
                self._pool.add(arcs)
            if not ended:
                return False
            before, needed = needed, self._needed(x, goal - beside, ahead, stairs)
            needed = np.maximum(before, needed)
            if (needed <= before + _HIGHER * self._relaxation.total).all():
                break
        above = Stairs(needed, self._width, least)
        found = self._relaxation.find_all(fine, lines, above, n_most)
        if found is None:
            return False
        height = self._best_team(x, goal, *found)
        if height is None:
            return False
        self._keep(x, height)
        return True

    def _fine(self, prices: FloatArray) -> FloatArray:
        return self._lines.team.spread(prices, 2 * self._lines.rule.n_levels)

    def _ahead(self, prices: FloatArray, mu: float) -> Ahead:
        return self._relaxation.look_ahead(self._fine(prices), mu)

    def _known(self, prices: FloatArray) -> FloatArray:
        """Return the stairs of known trails."""
        pool = self._pool
        worth = pool.values(prices[:, 1:], 0.0)
        worth[pool.is_relaxed] = -np.inf
        survival = np.array([visits.survival for visits in pool.visits])
        return stairs_of(worth, survival, self._width, self._rule.n_steps)

    def _needed(
        self, x: float, goal: float, ahead: list[Ahead], stairs: FloatArray | None
    ) -> FloatArray:
        """Say what a trail is worth at least, on each step, in a team that is worth a goal.

        ``stairs`` bound what any trail is worth.
        """
        n_others, n_steps = self._n_robots - 1, self._rule.n_steps
        # The others survive with what this one does not, and steps are as wide as they are.
        left = np.maximum(x - (np.arange(n_steps) + 1) * self._width, 0.0)
        each = np.minimum(left / n_others, self._most_survival)
        others = np.full(n_steps, np.inf)
        for line in ahead:
            others = np.minimum(others, n_others * (line.most - line.mu * each))
        if stairs is not None:
            most = add_stairs(np.maximum(stairs, 0.0), n_others)
            totals = np.minimum(least_total(left, self._width, n_others), len(most) - 1)
            others = np.minimum(others, most[totals])
        wide = -(-n_steps // self._rule.n_heights)
        starts = np.arange(0, n_steps, wide)
        lowest = np.repeat(np.minimum.reduceat(goal - others, starts), wide)[:n_steps]
        falling: FloatArray = np.maximum.accumulate(lowest[::-1])[::-1]
        return falling

    def _best_team(
        self, x: float, goal: float, arcs: OffsetArray, n_arcs: OffsetArray
    ) -> float | None:
        """Return what the best team of these trails collects, or the goal; None for too many.

        Only teams whose survivals sum to ``x`` or more count.
        """
        if len(n_arcs) == 0:
            return goal
        reward = self._lines.team.reward
        survival, reached = self._figures(arcs, n_arcs)
        order = np.argsort(-survival, kind="stable")
        figures = survival[order], reached[order], reward
        choices = new_choices(*figures, np.zeros(2), self._n_robots)
        # Whatever collects no more than the goal is covered, and whatever survives too rarely.
        front = new_front(4, self._n_robots)
        insert(front, np.inf, x * (1.0 - ROUNDING) - _LEAST_SURVIVAL)
        insert(front, goal, np.inf)
        given = choices, front, new_turn()
        ended = choose_teams(*given, self._rule.most_teams, most_reward=True) == FINISHED
        return best_reward(front, np.inf) if ended else None

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
            # A robot is never likelier alive than before: the first visit counts.
            reached[rows, columns] = np.maximum(reached[rows, columns], alive[rows, step])
        return alive[:, -1].copy(), reached[:, :-1].copy()


def stairs_of(values: FloatArray, survival: FloatArray, width: float, n_steps: int) -> FloatArray:
    """Return the stairs of trails (n_steps), −inf where none survives as well."""
    stairs = np.full(n_steps, -np.inf)
    np.maximum.at(stairs, step_of(survival, width, n_steps), values)
    return _falling(stairs)


def step_of(survival: FloatArray, width: float, n_steps: int) -> OffsetArray:
    """Return on which step survivals lie."""
    steps: OffsetArray = np.minimum((survival / width * (1 + _EDGE)).astype(np.int64), n_steps - 1)
    return steps


def last_steps(stairs: FloatArray) -> OffsetArray:
    """Return the last step of each height."""
    falls = np.append(stairs[1:] < stairs[:-1], True)
    return np.flatnonzero(falls & np.isfinite(stairs))


def _falling(stairs: FloatArray) -> FloatArray:
    falling: FloatArray = np.maximum.accumulate(stairs[::-1])[::-1]
    return falling


def least_total(x: FloatArray, width: float, n_trails: int) -> OffsetArray:
    """Return the least sum of steps of ``n_trails`` trails whose survivals sum to ``x`` or more."""
    totals: OffsetArray = (x / width * (1 - _EDGE)).astype(np.int64) - n_trails + 1
    return np.maximum(totals, 0)


def add_stairs(stairs: FloatArray, n_trails: int) -> FloatArray:
    """Return the most that ``n_trails`` trails are worth together, by the sum of their steps."""
    most = stairs
    for _ in range(n_trails - 1):
        after = np.full(len(most) + len(stairs) - 1, -np.inf)
        for step in last_steps(stairs).tolist():
            there = after[step : step + len(most)]
            np.maximum(there, most + stairs[step], out=there)
        most = _falling(after)
    return most
