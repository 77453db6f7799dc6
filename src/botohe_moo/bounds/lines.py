"""Lines that no plan lies above, found by column generation.

Prices f_v of visits and mu of survival bound every team of j robots whose survivals sum to x or
more (Lagrangian duality):

    E[R] ≤ r_base + Σ_v c_v + j · θ − mu · x,
    c_v = max over p of r_v (1 − Π_k (1 − p_k)) − Σ_k f_v(p_k).

No trail is worth more than θ. One that survives with s is worth Σ_v f_v(p_v) + mu · s. A linear
programme over known trails sets the prices. Relaxed trails bound θ, and join the programme.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from botohe_moo.bounds.certificate import Certificate, Facts, PricedLine
from botohe_moo.bounds.ground import Ground, Target
from botohe_moo.bounds.prices import Pool, Prices, Visits
from botohe_moo.bounds.programme import CUT, Programme

# How near to the programme's value a line has to come, as a share of the bound: by relaxed trails,
# and by searches.
_TOLERANCE, _EXACT_TOLERANCE = 1e-3, 2e-4
_MOST_PRICES = 60  # that are tried at one place
_SMOOTHING = 0.5  # how far prices go from the best known ones to those of the linear programme
# Where a search does not end, prices go less far by this factor, but at least so far.
_NEARER, _LEAST_STEP = 3.0, 0.02
_NEW = 1e-6  # by how much a new trail has to be worth more than the known ones
_MOST_MOVES = 1_000_000  # of a search
_MOST_ROWS = 3  # times as many rows as columns
_CUTS_AT_ONCE = 8  # trails that are added before the programme is solved again
_MOST_MU = 20.0  # the highest price of survival, in total rewards: it keeps the programme bounded


class LinesProgramme(Programme):
    """The linear programme for the prices with the least bound at some x.

    It minimises Σ c + j · θ − x · mu, where c is the most that a node gives beside prices, θ the
    most that a known trail is worth, and mu the price of survival.
    """

    def __init__(self, ground: Ground, moving: int, *, relaxed: bool) -> None:
        upper = np.array([np.inf, _MOST_MU * ground.relaxation.total])
        super().__init__(ground.team(moving), np.array([moving, 0.0]), upper, ground.deadline)
        self._relaxed = relaxed  # whether relaxed trails count
        self._theta, self._mu = self.first_other, self.first_other + 1

    def renewed(self, ground: Ground) -> LinesProgramme:
        """Return the programme, or one with the tight rows alone if it has too many or wrong ones.

        Rows of relaxed trails are wrong that are forbidden by now.
        """
        is_dropped = ground.pool.trails().is_dropped
        names = cast("list[tuple[str, int, int]]", [name for name in self.rows if name])
        is_wrong = any(kind == "trail" and is_dropped[number] for kind, number, _ in names)
        if not is_wrong and len(self.rows) < _MOST_ROWS * len(self._upper):
            return self
        new = LinesProgramme(ground, self.team.n_robots, relaxed=self._relaxed)
        for kind, *name in cast("list[tuple[str, int, int]]", self.tight()):
            if kind == "gains":
                new.add_configuration(*name)
            elif not is_dropped[name[0]]:
                new._add(name[0], ground.pool)
        return new

    def aim(self, x: float) -> None:
        """Look for the least bound at ``x``."""
        self._lp.changeColCost(self._mu, -x)

    def solve(self, pool: Pool) -> tuple[float, Prices, float]:
        """Return the least bound over known trails, its prices, and θ."""
        while True:
            solution, visits, value = self.run()
            prices, theta = Prices(visits, float(solution[self._mu])), float(solution[self._theta])
            n = self.cut_configurations(visits, solution)
            worth, known = pool.trails().worth(prices, relaxed=self._relaxed), {*self.rows}
            for i in np.argsort(-worth)[:_CUTS_AT_ONCE].tolist():
                if worth[i] > theta + CUT and ("trail", i, 0) not in known:
                    self._add(i, pool)
                    n += 1
            if n == 0 or self._deadline.is_over():
                return value, prices, theta

    def _add(self, number: int, pool: Pool) -> None:
        visits = pool.trails().visits[number]
        self.add_trail(("trail", number, 0), visits, {self._theta: 1.0, self._mu: -visits.survival})


class LineProver:
    """Proves lines: by relaxed trails, and then by searches for trails, as long as these end."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        # For each number of robots the last programmes, which are nearly solved for the next place.
        self._programmes: dict[tuple[int, bool], LinesProgramme] = {}

    def prove(self, target: Target, certificate: Certificate) -> Facts:
        """Prove lines for a target; tell which relaxed trails kept the first ones from being lower.

        They are told also where searches end, and prove lines without relaxed trails.
        """
        pool, x, moving = self._ground.pool, target.x, target.moving
        best = self._ground.lowest(certificate, moving, x)
        bound = certificate.line_at(moving, x)
        by_relaxed, best, used = self._descend(target, best, bound, relaxed=True)
        bound = min([bound, *(line.at(x) for line in by_relaxed if line.line.n_robots == moving)])
        by_search, _, _ = self._descend(target, best, bound, relaxed=False)
        repeating = [trail for i in used if (trail := pool.relaxed(i)) is not None]
        return Facts((*by_relaxed, *by_search), repeating=tuple(repeating))

    def _descend(
        self, target: Target, best: Prices, bound: float, *, relaxed: bool
    ) -> tuple[list[PricedLine], Prices, list[int]]:
        """Step from the best prices to those of the programme.

        Returns the lines found, the best prices, and the numbers of the trails that keep the
        programme from less.
        """
        ground, moving, x = self._ground, target.moving, target.x
        pool, tidy = ground.pool, ground.team(moving).tidy
        last = self._programmes.pop((moving, relaxed), None)  # None if another thread has it
        programme = (last or LinesProgramme(ground, moving, relaxed=relaxed)).renewed(ground)
        programme.aim(x)
        # A search is the likeliest to end at the best prices so far.
        value, found = np.inf, list[PricedLine]()
        step, tolerance = (1.0, _TOLERANCE) if relaxed else (0.0, _EXACT_TOLERANCE)
        for _ in range(_MOST_PRICES):
            least, wanted, theta = programme.solve(pool)
            least += ground.base_reward
            if bound - least < tolerance * bound or ground.deadline.is_over():
                break
            visits = (1 - step) * best.visits + step * wanted.visits
            prices = Prices(tidy(visits), (1 - step) * best.mu + step * wanted.mu)
            priced = self._price(prices, relaxed, target.effort)
            if priced is None:
                step /= _NEARER
                if step < _LEAST_STEP:
                    break
                continue
            most, new = priced
            lines = ground.lines(moving, prices, most, "relaxed" if relaxed else "exact")
            found += lines
            reached = lines[0].at(x)
            bound = min(bound, reached)
            if reached < value:
                best, value = prices, reached
            is_new = new is not None and new.worth(wanted) > theta + _NEW
            if not is_new and step == 1.0:
                break
            step = _SMOOTHING if is_new or step == 0.0 else 1.0
        used = cast("list[tuple[str, int]]", programme.used())
        self._programmes[moving, relaxed] = programme  # from now on another thread may take it
        return found, best, [number for kind, number, *_ in used if kind == "trail"]

    def _price(
        self, prices: Prices, relaxed: bool, effort: int
    ) -> tuple[float, Visits | None] | None:
        """Return what no trail is worth more than, and the best trail if it is new.

        None is returned where a search takes too long.
        """
        ground = self._ground
        ahead = ground.look_ahead(prices)
        if relaxed:
            added = [ground.pool.add(*trail) for trail in ground.relaxation.best_trails(ahead)]
            return ahead.most, added[0][0] if added and added[0][1] else None
        worth = ground.pool.trails().worth(prices, relaxed=False)
        least = max(0.0, float(worth.max(initial=0.0))) + 1e-9
        ended, most, arcs = ground.relaxation.search(ahead, least, _MOST_MOVES * effort)
        visits, is_new = ground.pool.add(arcs) if arcs else (None, False)
        return (min(most, ahead.most), visits if is_new else None) if ended else None
