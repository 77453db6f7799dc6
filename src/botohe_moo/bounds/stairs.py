"""Bounds for teams whose robots' survivals are kept whole, under prices that are made for them.

Under any prices, stairs bound what a trail is worth that survives with s or more. A team of j
robots whose survivals sum to x or more is worth at most the best sum of j steps that may do so.
"""

from __future__ import annotations

import math

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.bounds.front_bound import Step, add_stairs, add_two, least_total
from botohe_moo.bounds.kernels.trails import Stairs
from botohe_moo.bounds.lines import LEAST_MU, N_STEPS, Lines
from botohe_moo.bounds.master import Pool, PricedTeam, Prices, Programme
from botohe_moo.bounds.relaxation import Relaxation

# As in ``proof``, these constants were chosen by experiment, and every bound is valid whatever they
# are.

_BINS = 100  # of survival, in the linear programme
_MOST_MASTERS = 512  # linear programmes that are kept, of about a MiB each
_MOST_SOLVED = 60  # times that the programme is solved for one pool
_CUT = 1e-6  # by how much a row has to be violated to be added
_TRAILS_AT_ONCE, _TEAMS_AT_ONCE = 30, 12  # rows that are added before it is solved again
_MOST_LINKS = 2_000_000  # of a search, for each unit of effort
_MOST_PRICES = 12  # that are tried at one place
_CLOSE = 1e-3  # how near to the programme's value a bound has to come, as a share of it
_MARGIN = 6  # steps by which a search begins below what it needs, at least
# The target of a search lies this share of the gap above the programme's value: at first and at
# least. Where the search ends without a new trail it is halved, and where it gives up it grows to
# ``_WIDER`` times as much and ``_FURTHER``, at most to ``_FURTHEST``.
_FIRST_SHARE, _LEAST_SHARE = 0.5, 0.05
_WIDER, _FURTHER, _FURTHEST = 1.5, 0.1, 0.95
# Where known trails alone are above the target, it lies this share of the gap beyond them.
_BEYOND = 0.1
_STAY = 0.5  # how much of the best prices is kept in the next ones
MOST_MOVING = 20  # robots: sums of stairs take time that grows with the square of their number
_FALL = 2e-5  # of all reward: heights are raised to multiples of it, so that there are few steps


class StairsMaster(Programme):
    """The linear programme for prices of ``n_robots`` that survive with ``x`` together.

    It minimises Σ c + z: c is the most that a node gives beside prices, and z the most that a team
    is worth, which is at least the sum of F_b over any bins b whose survivals sum to x. F_b is at
    least what any known trail in bin b is worth, and never rises.
    """

    def __init__(
        self, team: PricedTeam, most_survival: float, x: float, relaxation: Relaxation
    ) -> None:
        cost = np.append(np.zeros(_BINS), 1.0)
        super().__init__(team, cost, np.full(_BINS + 1, np.inf), relaxation)
        self._stairs = slice(self._first_other, self._first_other + _BINS)
        self._worth = self._first_other + _BINS
        for b in range(self._stairs.start, self._stairs.stop - 1):
            self._add(0.0, [b, b + 1], [1.0, -1.0])
        self._width = most_survival * (1 + 1e-9) / _BINS
        # Trails lie half a bin above their bin's beginning, on average.
        self._needed = max(0, round(x / self._width - (team.n_robots - 1) / 2))
        self._trails: set[int] = set()
        self.centre: FloatArray | None = None  # the best prices so far

    def solve(self, pool: Pool, until: float) -> tuple[float, FloatArray]:
        """Return the least bound over known trails, and its prices (n_nodes that pay, ·)."""
        least_bin = self._needed - (self.team.n_robots - 1) * (_BINS - 1)
        for _ in range(_MOST_SOLVED):
            solution, visits = self._run()
            stairs = solution[self._stairs]
            bins = np.minimum((pool.survival / self._width + 1e-9).astype(np.int64), _BINS - 1)
            n = self._cut_configurations(visits, solution)
            over = pool.values(Prices(visits, 0.0), relaxed=False) - stairs[bins]
            over[bins < least_bin] = -np.inf
            n += self._cut_trails(pool, over, bins)
            n += self._cut_teams(stairs, float(solution[self._worth]))
            if n == 0 or self._clock.is_over(until):
                break
        return self._value, visits

    def _cut_trails(self, pool: Pool, over: FloatArray, bins: OffsetArray) -> int:
        """Add trails that are the most above the steps of their bins; return how many are new."""
        n = 0
        for i in np.argsort(-over)[:_TRAILS_AT_ONCE].tolist():
            if over[i] <= _CUT:
                break
            if i not in self._trails:
                self._trails.add(i)
                visits = pool.visits[i]
                columns = [self._stairs.start + int(bins[i]), *visits.columns.tolist()]
                self._add(0.0, columns, [1.0, *(-visits.weights).tolist()])
                n += 1
        return n

    def _cut_teams(self, stairs: FloatArray, worth: float) -> int:
        """Add those teams of bins that are worth the most; return how many are worth too little."""
        n = 0
        for bins in self._best_teams(stairs):
            if stairs[bins].sum() > worth + _CUT:
                used, counts = np.unique(bins, return_counts=True)
                columns = [self._worth, *(self._stairs.start + used).tolist()]
                self._add(0.0, columns, [1.0, *(-counts.astype(float)).tolist()])
                n += 1
        return n

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


class TeamStairs:
    """What stairs prove for each number of moving robots, by the sum of their steps."""

    def __init__(self, lines: list[Lines], most_survival: float) -> None:
        self._lines, self._most_survival = lines, most_survival
        self._relaxation, self._pool = lines[0].relaxation, lines[0].pool
        self._width = most_survival * (1.0 + 1e-9) / N_STEPS
        # Entry t of row j − 1: no team of j whose steps sum to t or more gets above it.
        self._most = [np.full(j * (N_STEPS - 1) + 1, np.inf) for j in range(1, len(lines) + 1)]
        self._masters: dict[tuple[int, float], StairsMaster] = {}

    def bound(self, moving: int, x: float) -> float:
        """Bound E[R] where the survivals of ``moving`` robots sum to ``x`` or more."""
        most = self._most[moving - 1]
        total = int(least_total(x, self._width, moving))
        proved = float(most[: total + 1].min()) if total < len(most) else np.inf
        return min(proved, self._lines[moving - 1].bound(x))

    @property
    def found(self) -> list[Step]:
        """Steps, raised a little."""
        steps, fall = [], _FALL * self._relaxation.total or 1.0
        for moving, row in enumerate(self._most, 1):
            most = np.minimum.accumulate(np.maximum(row, np.ceil(row / fall) * fall))
            for total in np.flatnonzero(most < np.append(np.inf, most[:-1])).tolist():
                least = (total + moving - 1) * self._width if total else 0.0
                steps.append(Step(moving, float(most[total]), least * (1 + 1e-12), "exact"))
        return steps

    def improve(self, moving: int, x: float, effort: int, until: float) -> None:
        """Lower the bound where the survivals of ``moving`` robots sum to ``x`` or more.

        Prices lie between the best ones known and those of the programme. Each search for trails is
        given a target between the programme's value and the bound.
        """
        lines, at = self._lines[moving - 1], (moving, x)
        master = self._masters.pop(at, None)
        master = master or StairsMaster(lines.team, self._most_survival, x, self._relaxation)
        self._improve(master, moving, x, effort, until)
        self._masters[at] = master
        if len(self._masters) > _MOST_MASTERS:
            del self._masters[next(iter(self._masters))]  # that was used the longest ago

    def _improve(
        self, master: StairsMaster, moving: int, x: float, effort: int, until: float
    ) -> None:
        lines = self._lines[moving - 1]
        team, base_reward = lines.team, lines.base_reward
        start = lines.lowest(x, x, 1)[0]
        mu = max(start.mu, LEAST_MU * self._relaxation.total)
        best, share, stay = np.inf, _FIRST_SHARE, 1.0
        centre = start.visits if master.centre is None else master.centre
        for i in range(_MOST_PRICES):
            least, wanted = master.solve(self._pool, until)
            if self._relaxation.clock.is_over(until):
                return
            least += base_reward
            bound = self.bound(moving, x)
            if bound <= least * (1 + _CLOSE):
                return
            visits = centre if stay == 1.0 else team.tidy(stay * centre + (1 - stay) * wanted)
            beside = float(team.most(visits).sum()) + base_reward
            known = self._known(visits, moving, x)
            teams = self._teams(known, moving, x)
            low = beside + float(teams.max())  # no search can show less
            if low >= bound and i > 0:
                if stay == 0.0:
                    return
                centre, stay = wanted, 0.0
                continue
            target = least + share * (bound - least)
            if low > target:
                target = low + _BEYOND * abs(bound - low)
            floor = self._lifted(known, teams, moving, target - beside)
            ended, stairs, n_found = self._search(Prices(visits, mu), moving, x, floor, effort)
            if not ended:
                share, stay = _WIDER * share + _FURTHER, _STAY
                if share > _FURTHEST:
                    return
                continue
            reached = beside + float(self._teams(stairs, moving, x).max())
            if reached < best:
                best, centre, master.centre = reached, visits, visits
            if n_found:
                stay = _STAY
            elif share <= _LEAST_SHARE and stay == 0.0:
                return
            else:
                stay, share = 0.0, max(_LEAST_SHARE, share / 2)

    def _first_step(self, moving: int, x: float) -> float:
        """Return the survival from which on trails are searched."""
        n_below = max(_MARGIN, moving + 1)  # or sums of their steps would not reach x
        return max(0.0, x - n_below * self._width - (moving - 1) * self._most_survival)

    def _known(self, visits: FloatArray, moving: int, x: float) -> FloatArray:
        """Return the stairs of known trails that survive as a team needs it (n_steps)."""
        known = self._lines[moving - 1].known_stairs(visits, self._width)
        first = int(self._first_step(moving, x) / self._width)
        known[:first] = known[min(first, N_STEPS - 1)]
        return known

    def _teams(self, stairs: FloatArray, moving: int, x: float) -> FloatArray:
        """Return the most that a team with a robot on each step is worth (n_steps).

        Its ``moving`` robots survive with ``x`` together; −inf where they cannot.
        """
        others = add_stairs(stairs, moving - 1)
        left = np.maximum(least_total(x, self._width, moving) - np.arange(N_STEPS), 0)
        best = stairs + others[np.minimum(left, len(others) - 1)]
        return np.where(left < len(others), best, -np.inf)

    def _lifted(
        self, stairs: FloatArray, best: FloatArray, moving: int, worth: float
    ) -> FloatArray:
        """Raise stairs as far as no team is worth more than ``worth``.

        Each of a team's robots takes an equal part of what is left to the ``best`` team with its
        step.
        """
        room = np.minimum(np.maximum(0.0, worth - best) / moving, self._relaxation.total)
        lifted: FloatArray = np.minimum.accumulate(stairs + room)
        return lifted

    def _search(
        self, prices: Prices, moving: int, x: float, floor: FloatArray, effort: int
    ) -> tuple[bool, FloatArray, int]:
        """Raise a floor above all trails; return whether that ended, the stairs, and trails found.

        Stairs are kept for all numbers of robots.
        """
        lines = self._lines[moving - 1]
        stairs = Stairs(floor, self._width, self._first_step(moving, x))
        ahead = lines.look_ahead_around(prices.visits, prices.mu)
        ended, n_found = lines.raise_stairs(prices.visits, ahead, stairs, _MOST_LINKS * effort)
        if ended:
            self._keep(prices.visits, stairs.heights, stairs.least)
        return ended, stairs.heights, n_found

    def _keep(self, visits: FloatArray, stairs: FloatArray, least: float) -> None:
        """Keep what stairs prove that hold for survivals of ``least`` or more.

        Sums are raised as those of :class:`Steps` are: products at each factor, and over nodes.
        """
        most = np.zeros(1)
        for moving, lines in enumerate(self._lines, 1):
            most, row = add_two(stairs, most), self._most[moving - 1]
            # Where teams survive with so much, each of their robots survives with ``least``.
            x = least + (moving - 1) * self._most_survival
            first = 0 if least == 0.0 else int(x / self._width * (1 + 1e-9)) + 1
            worth = lines.base_reward + float(lines.team.most(visits).sum()) + most[first:]
            scale = self._relaxation.total + lines.base_reward + worth
            row[first:] = np.minimum(row[first:], worth + lines.rounding * scale)
