"""Stairs: what a trail is worth at most that survives with s or more, under given prices.

Step b is for trails with survivals from b · width to (b + 1) · width. Heights never rise, so that
height b bounds all trails that survive with b · width or more. A team of j
robots whose survivals sum to x or more collects at most what nodes give beside prices, and the best
sum of j heights whose steps may survive so:

    E[R] ≤ r_base + Σ_v c_v + max {Σ_k heights[b_k] : Σ_k b_k ≥ ⌊x / width⌋ − j + 1}.

A line needs a price of survival; stairs need none, since the team's sum is a constraint.
"""

from __future__ import annotations

import math

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds.certificate import Certificate, Facts, Sums
from botohe_moo.bounds.front_bound import add_stairs, add_two, least_total
from botohe_moo.bounds.ground import MOST_SUMMED, N_STEPS, Ground, Target
from botohe_moo.bounds.kernels.trails import Stairs
from botohe_moo.bounds.prices import Pool, Prices
from botohe_moo.bounds.programme import Programme
from botohe_moo.bounds.relaxation import MOST_LINES, Ahead

_BINS = 100  # of survival, in the linear programme
_MOST_SOLVED = 60  # times that the programme is solved for one pool
_CUT = 1e-6  # by how much a row has to be violated to be added
_TRAILS_AT_ONCE, _TEAMS_AT_ONCE = 30, 12  # rows that are added before it is solved again
_MOST_MOVES = 2_000_000  # of a search, for each unit of effort
_MOST_PRICES = 12  # that are tried at one place
# With labels, prices are tried until so many, one after another, have closed less than this share
# of the gap.
_LEAST_GAIN, _MOST_IDLE = 0.05, 2
_CLOSE = 1e-3  # how near to the programme's value a bound has to come, as a share of it
_MARGIN = 6  # steps by which a search begins below what it needs
# The target of a search lies this share of the gap above the programme's value: at first and at
# least. Where the search ends without a new trail it is halved, and where it gives up it grows to
# ``_WIDER`` times as much and ``_FURTHER``, at most to ``_FURTHEST``.
_FIRST_SHARE, _LEAST_SHARE = 0.5, 0.05
_WIDER, _FURTHER, _FURTHEST = 1.5, 0.1, 0.95
# Where known trails alone are above the target, it lies this share of the gap beyond them.
_BEYOND = 0.1
_STAY = 0.5  # how much of the best prices is kept in the next ones


class StairsProgramme(Programme):
    """The linear programme for prices of a team that survives with ``x`` together.

    It minimises Σ c + z: c is the most that a node gives beside prices, and z the most that a team
    is worth, which is at least the sum of F_b over any bins b whose survivals sum to x. F_b is at
    least what any known trail in bin b is worth, and never rises.
    """

    def __init__(self, ground: Ground, target: Target) -> None:
        team, cost = ground.team(target.moving), np.append(np.zeros(_BINS), 1.0)
        super().__init__(team, cost, np.full(_BINS + 1, np.inf), ground.deadline)
        self._stairs = slice(self.first_other, self.first_other + _BINS)
        self._worth = self.first_other + _BINS
        for b in range(self._stairs.start, self._stairs.stop - 1):
            self.add(None, 0.0, [b, b + 1], [1.0, -1.0])
        self._width = ground.most_survival * (1 + 1e-9) / _BINS
        # Trails lie half a bin above their bin's beginning, on average.
        self._needed = max(0, round(target.x / self._width - (team.n_robots - 1) / 2))

    def solve(self, pool: Pool) -> tuple[float, FloatArray]:
        """Return the least bound over known trails, and its prices (n_nodes that pay, ·)."""
        least_bin = self._needed - (self.team.n_robots - 1) * (_BINS - 1)
        trails = pool.trails()
        bins = np.minimum((trails.survival / self._width + 1e-9).astype(np.int64), _BINS - 1)
        for _ in range(_MOST_SOLVED):
            solution, visits, value = self.run()
            stairs = solution[self._stairs]
            n = self.cut_configurations(visits, solution)
            over = trails.worth(Prices(visits, 0.0), relaxed=False) - stairs[bins]
            over[bins < least_bin] = -np.inf
            known = {*self.rows}
            for i in np.argsort(-over)[:_TRAILS_AT_ONCE].tolist():
                if over[i] > _CUT and ("trail", i) not in known:
                    first = self._stairs.start + int(bins[i])
                    self.add_trail(("trail", i), trails.visits[i], {first: 1.0})
                    n += 1
            for team in self._best_teams(stairs):
                if stairs[team].sum() > float(solution[self._worth]) + _CUT:
                    used, counts = np.unique(team, return_counts=True)
                    columns = [self._worth, *(self._stairs.start + used).tolist()]
                    self.add(None, 0.0, columns, [1.0, *(-counts.astype(float)).tolist()])
                    n += 1
            if n == 0 or self._deadline.is_over():
                break
        return value, visits

    def _best_teams(self, stairs: FloatArray) -> list[list[int]]:
        """Return the bins of teams that survive as needed, with the best ones for each last bin."""
        totals = np.arange(self._needed + 1)
        # What is left to the others once a robot is in a bin (n_bins, n_totals).
        left = np.maximum(totals - np.arange(_BINS)[:, None], 0)
        most, chosen = np.where(totals == 0, 0.0, -np.inf), []
        for _ in range(self.team.n_robots):
            sums = stairs[:, None] + most[left]
            chosen.append(sums.argmax(axis=0))
            most = sums.max(axis=0)
        found = []
        last = sums[:, self._needed]
        for b in np.argsort(-last)[:_TEAMS_AT_ONCE].tolist():
            if not math.isfinite(last[b]):
                break
            bins, total = [b], int(left[b, self._needed])
            for best in chosen[-2::-1]:
                bins.append(int(best[total]))
                total = int(left[bins[-1], total])
            found.append(bins)
        return found


class StairsProver:
    """Proves sums of stairs: above all trails, or above all relaxed ones where that takes long."""

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._centres: dict[tuple[int, float], FloatArray] = {}  # the best prices at each place
        # The highest place where searches gave up, by number of robots and effort: where fewer
        # survivors are needed, there are more trails to search.
        self._gave_up: dict[tuple[int, int], float] = {}

    def prove(self, target: Target, certificate: Certificate) -> Facts:
        """Prove sums for a target."""
        descend = self._prove_one if target.moving == 1 else self._descend
        kind = target.moving, target.effort
        if target.x > self._gave_up.get(kind, -math.inf):
            facts = descend(target, certificate, relaxed=False)
            if facts.is_proved or self._ground.deadline.is_over():
                return facts
            self._gave_up[kind] = target.x
        return descend(target, certificate, relaxed=True)

    def _descend(self, target: Target, certificate: Certificate, *, relaxed: bool) -> Facts:
        """Step from the best prices known to those of the programme, or some way.

        Each time stairs are given a goal between the programme's value and the bound.
        """
        ground, moving, x = self._ground, target.moving, target.x
        team, total = ground.team(moving), int(least_total(x, ground.width, moving))
        programme = StairsProgramme(ground, target)
        start = ground.lowest(certificate, moving, x)
        found, n_idle = list[Sums](), 0
        # ``share``: how far goals are from the programme's value; ``stay``: how much of ``centre``
        # stays.
        best, share, stay = np.inf, _FIRST_SHARE, 1.0
        centre = self._centres.get((moving, x), start.visits)
        bound = certificate.bound(moving, x)
        for i in range(_MOST_PRICES):
            least, wanted = programme.solve(ground.pool)
            least += ground.base_reward
            own = [float(sums.most[total - sums.first]) for sums in found if sums.moving == moving]
            bound = min([bound, *own])
            if bound <= least * (1 + _CLOSE) or ground.deadline.is_over():
                break
            visits = centre if stay == 1.0 else team.tidy(stay * centre + (1 - stay) * wanted)
            beside = float(team.most(visits).sum()) + ground.base_reward
            known = self._known(visits, moving, x)
            teams = self._teams(known, moving, x)
            low = beside + float(teams.max())  # nothing less can be shown
            if low >= bound and i > 0:
                if stay == 0.0:
                    break
                centre, stay = wanted, 0.0
                continue
            goal = least + share * (bound - least)
            if low > goal:
                goal = low + _BEYOND * abs(bound - low)
            floor = self._lifted(known, teams, moving, goal - beside)
            ahead = ground.look_ahead_around(Prices(visits, start.mu))
            stairs = Stairs(floor, ground.width, self._first_survival(moving, x))
            ended, n_found = self._raise(visits, ahead, stairs, target.effort, relaxed=relaxed)
            if not ended:
                share, stay = _WIDER * share + _FURTHER, _STAY
                if share > _FURTHEST:
                    return Facts(sums=tuple(found), is_proved=bool(found))
                continue
            found += self._sums(visits, stairs)
            reached = beside + float(self._teams(floor, moving, x).max())
            n_idle = 0 if bound - reached >= _LEAST_GAIN * (bound - least) else n_idle + 1
            if relaxed and n_idle == _MOST_IDLE:
                break
            if reached < best:
                best, centre = reached, visits
                self._centres[moving, x] = visits
            if n_found:
                stay = _STAY
            elif share <= _LEAST_SHARE and stay == 0.0:
                break
            else:
                stay, share = 0.0, max(_LEAST_SHARE, share / 2)
        return Facts(sums=tuple(found))

    def _prove_one(self, target: Target, certificate: Certificate, *, relaxed: bool) -> Facts:
        """Find what one robot collects at most.

        Its prices are the rewards, so that nodes give nothing beside them. What lies ahead of
        trails is bounded by several lines, and what rewards exceed their prices by at nodes not
        yet visited. Labels do not know these, and are bounded under the rewards themselves.
        """
        ground, x = self._ground, target.x
        team = ground.team(1)
        visits = team.reward[:, None] * team.alive
        others = certificate.lowest(1, x, ground.most_survival, MOST_LINES)
        others = others or [ground.lowest(certificate, 1, x)]
        if relaxed:
            lines = ground.look_ahead_with(visits, sorted({other.mu for other in others}))
        else:
            beside = [team.to_all(team.most(other.visits)) for other in others]
            pairs = zip(map(ground.look_ahead, others), beside, strict=True)
            lines = [each._replace(beside=own) for each, own in pairs]
        stairs = Stairs(ground.known_stairs(visits), ground.width, x)
        ended, _ = self._raise(visits, lines, stairs, target.effort, relaxed=relaxed)
        return Facts(sums=tuple(self._sums(visits, stairs)) if ended else (), is_proved=ended)

    def _raise(
        self, visits: FloatArray, lines: list[Ahead], stairs: Stairs, effort: int, *, relaxed: bool
    ) -> tuple[bool, int]:
        """Raise stairs above all trails; return whether that ended, and how many were found."""
        ground = self._ground
        if not relaxed:
            return ground.raise_stairs(visits, lines, stairs, _MOST_MOVES * effort)
        prices = ground.spread(visits)
        return ground.relaxation.raise_by_labels(prices, lines, stairs, effort), 0

    def _first_survival(self, moving: int, x: float) -> float:
        """Return the survival from which on trails are searched."""
        ground = self._ground
        n_below = max(_MARGIN, moving + 1)
        return max(0.0, x - n_below * ground.width - (moving - 1) * ground.most_survival)

    def _known(self, visits: FloatArray, moving: int, x: float) -> FloatArray:
        """Return the stairs of known trails that survive as a team needs it (N_STEPS)."""
        known = self._ground.known_stairs(visits)
        first = int(self._first_survival(moving, x) / self._ground.width)
        known[:first] = known[min(first, N_STEPS - 1)]
        return known

    def _teams(self, stairs: FloatArray, moving: int, x: float) -> FloatArray:
        """Return for each step the most that a team is worth with one robot there (N_STEPS).

        Its ``moving`` robots survive with ``x`` together; −inf where they cannot.
        """
        others = add_stairs(stairs, moving - 1)
        left = np.maximum(least_total(x, self._ground.width, moving) - np.arange(N_STEPS), 0)
        best = stairs + others[np.minimum(left, len(others) - 1)]
        return np.where(left < len(others), best, -np.inf)

    def _lifted(
        self, stairs: FloatArray, best: FloatArray, moving: int, worth: float
    ) -> FloatArray:
        """Raise stairs of known trails to heights that a search is to confirm.

        The higher they are, the sooner it ends. No team on them is worth more than ``worth``,
        unless known trails are: each robot takes an equal part of what is left to the ``best`` team
        with its step. For any team, ``best`` is at least its worth at each of its steps, so that
        the parts add up to no more than is left.
        """
        room = np.maximum(0.0, worth - best) / moving
        room = np.minimum(room, self._ground.relaxation.total)
        lifted: FloatArray = np.minimum.accumulate(stairs + room)
        return lifted

    def _sums(self, visits: FloatArray, stairs: Stairs) -> list[Sums]:
        """Return what stairs above all trails prove for each number of robots.

        They are above those trails that survive with ``stairs.least`` or more. Sums are raised for
        rounding as steps are.
        """
        ground, found, most = self._ground, list[Sums](), np.zeros(1)
        for moving in range(1, min(ground.n_robots, MOST_SUMMED) + 1):
            most = add_two(stairs.heights, most)
            # Where teams survive with so much, each of their robots survives with ``least``.
            x = stairs.least + (moving - 1) * ground.most_survival
            first = 0 if stairs.least == 0.0 else int(x / ground.width * (1 + 1e-9)) + 1
            beside = ground.base_reward + float(ground.team(moving).most(visits).sum())
            worth = beside + most[first:]
            scale = ground.relaxation.total + ground.base_reward + worth
            found.append(Sums(moving, first, worth + ground.rounding(moving) * scale))
        return found
