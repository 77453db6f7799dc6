"""What all attempts to prove something about a mission share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from botohe_moo.base.types import FloatArray
from botohe_moo.bounds.certificate import Certificate, PricedLine
from botohe_moo.bounds.front_bound import Line, LineProof, stairs_of
from botohe_moo.bounds.kernels.states import EPSILON, Net
from botohe_moo.bounds.kernels.trails import Stairs
from botohe_moo.bounds.prices import Pool, PricedTeam, Prices, refine
from botohe_moo.bounds.relaxation import LEVELS, Ahead, Relaxation
from botohe_moo.core.world import CHECKING

# These constants share out time and memory; every bound is valid whatever they are. Where no other
# source is given, they were chosen by experiment, for small gaps on the missions of 20 to 200 nodes
# in `python -m benchmarks bounds`.

N_STEPS = 2_000  # of a trail's survival
MOST_SUMMED = 20  # robots: sums of stairs take time that grows with the square of their number
# Searches that raise stairs bound what lies ahead at these shares of a line's price of survival,
# which counts as at least ``_LEAST_MU`` of all reward.
_MU_SHARES = (0.3, 1.0)
_LEAST_MU = 0.01


class Target(NamedTuple):
    """Where to prove something: about ``moving`` robots whose survivals sum to ``x`` or more.

    ``goal`` is the E[R] to prove, where one is needed; ``effort`` multiplies how many moves a
    search may try.
    """

    moving: int
    x: float
    goal: float = 0.0
    effort: int = 1


class Ground:
    """What all provers share: the mission's arrays, its relaxed trails, known trails, the deadline.

    Rewards are counted in units. E[R] has the base's reward, what trails are worth has not.
    """

    def __init__(
        self, relaxation: Relaxation, pool: Pool, n_robots: int, base_reward: float, unit: float
    ) -> None:
        self.net, self.relaxation, self.pool = relaxation.net, relaxation, pool
        self.n_robots, self.base_reward, self.deadline = n_robots, base_reward, relaxation.deadline
        self.unit = unit  # of rewards here, in those of the mission
        self.most_survival = most_survival(self.net)
        self.width = self.most_survival * (1.0 + 1e-9) / N_STEPS  # of steps
        # The robots that move, as prices see them, by their number.
        self.team = cache(lambda moving: PricedTeam(self.net, moving, pool.n_levels))

    def certificate(self) -> Certificate:
        """Return what holds from the start, as if every robot came by the safest ways.

        E[R] ≤ r_base + Σ_v r_v (1 − (1 − reach_v)^j).
        """
        graph, lines = self.net.graph, []
        for moving in range(1, self.n_robots + 1):
            missed = (1.0 - np.minimum(self.net.reach * (1.0 + 1e-12), 1.0)) ** moving
            everything = float((graph.reward * (1.0 - missed)).sum())
            lines.append(self._line(moving, everything, 0.0, "everything"))
        n_sums = min(self.n_robots, MOST_SUMMED)
        return Certificate(lines, n_sums, N_STEPS, self.width, self.relaxation.total)

    def _line(self, moving: int, most: float, mu: float, proof: LineProof) -> Line:
        """Return a line that is raised by what rounding may have taken from sums over nodes."""
        n_terms = self.net.graph.n_nodes + 8
        scale = self.relaxation.total + self.base_reward + abs(most) + mu
        spare = n_terms * EPSILON * scale
        return Line(moving, self.base_reward + most + spare, mu, proof)

    def lines(
        self, moving: int, prices: Prices, theta: float, proof: LineProof
    ) -> list[PricedLine]:
        """Return the lines of prices at which no trail is worth more than ``theta``.

        The one for ``moving`` robots comes first, then others while there is time.
        """
        found = list[PricedLine]()
        for n_robots in [moving, *(n for n in range(1, self.n_robots + 1) if n != moving)]:
            if found and self.deadline.is_over():
                break
            beside = float(self.team(n_robots).most(prices.visits).sum())
            line = self._line(n_robots, beside + n_robots * theta, prices.mu, proof)
            found.append(PricedLine(line, prices))
        return found

    def lowest(self, certificate: Certificate, moving: int, x: float) -> Prices:
        """Return the prices of the line that is the lowest at ``x``; 0 where there is none."""
        for prices in certificate.lowest(moving, x, x, 1):
            return prices
        return Prices(np.zeros_like(self.team(moving).alive), 0.0)

    def rounding(self, moving: int) -> float:
        """Return the share by which what a team collects is raised.

        Products of its survivals are rounded at each factor, and so is the sum over nodes.
        """
        graph = self.net.graph
        return (2 * moving * (graph.n_arcs + 2) + graph.n_nodes + 8) * EPSILON

    def spread(self, visits: FloatArray) -> FloatArray:
        """Return prices for all nodes, on a grid of ``LEVELS`` or a few more."""
        return self.team(1).to_all(refine(visits, -(-LEVELS // self.pool.n_levels)))

    def look_ahead(self, prices: Prices) -> Ahead:
        """Bound all trails under prices."""
        return self.relaxation.look_ahead(self.spread(prices.visits), [prices.mu])[0]

    def look_ahead_around(self, prices: Prices) -> list[Ahead]:
        """Bound all trails under prices of visits, and several prices of survival up to ``mu``."""
        mu = max(prices.mu, _LEAST_MU * self.relaxation.total)
        return self.look_ahead_with(prices.visits, [share * mu for share in _MU_SHARES])

    def look_ahead_with(self, visits: FloatArray, mus: Sequence[float]) -> list[Ahead]:
        """Bound all trails under prices of visits, and several prices of survival."""
        return self.relaxation.look_ahead(self.spread(visits), mus)

    def known_stairs(self, visits: FloatArray) -> FloatArray:
        """Return the stairs of known trails (N_STEPS), without anything for their survival."""
        trails = self.pool.trails()
        worth = trails.worth(Prices(visits, 0.0), relaxed=False)
        return np.maximum(stairs_of(worth, trails.survival, self.width, N_STEPS), 0.0)

    def raise_stairs(
        self, visits: FloatArray, ahead: Sequence[Ahead], stairs: Stairs, n_most: int
    ) -> tuple[bool, int]:
        """Raise stairs above all trails; return whether that ended, and how many were found."""
        ended, trails = self.relaxation.raise_stairs(self.spread(visits), ahead, stairs, n_most)
        for arcs in trails:
            self.pool.add(arcs)
        return ended, len(trails)


def most_survival(net: Net) -> float:
    """Return the largest probability to survive of a robot that moves."""
    graph = net.graph
    leaving = slice(graph.first[net.base], graph.first[net.base + 1])
    survival = graph.mean_survival[leaving] * net.world.ways.home[graph.head[leaving]]
    return min(1.0, float(survival.max(initial=0.0)) * (1.0 + CHECKING))  # products are rounded
