"""Local searches side by side, which give each other what they find."""

from __future__ import annotations

from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.kernels.local_search.exchange import News, join_news
from botohe_moo.mission.model import Mission
from botohe_moo.search.local_search import LocalSearch
from botohe_moo.search.threads import mapping
from botohe_moo.trails import PlanBatch

# Lanes begin after as many evaluations; before, one search alone finds more with as many.
FIRST_ALONE = 20_000
# How many plans enter all fronts, as a share of one front, until the lanes tell each other: later,
# they have found much twice; sooner, telling takes longer than it brings.
EXCHANGED = 0.1


class Lanes:
    """A local search that goes on as ``n_lanes`` searches, by ``n_threads``, once that pays.

    All lanes hold the same front after each call, but for plans that are equal to 1e-12. Results
    do not depend on ``n_threads``. Other arguments are those of :class:`LocalSearch`.
    """

    def __init__(
        self,
        mission: Mission,
        limits: Limits,
        *,
        n_lanes: int,
        n_threads: int,
        random_state: np.random.Generator,
        **options: Any,
    ) -> None:
        self.n_lanes = n_lanes
        self.n_threads = n_threads
        self._how = {"mission": mission, "limits": limits, "random_state": random_state, **options}
        self._lanes = [LocalSearch(**self._how)]
        self._n_evaluated = 0
        self._rate = 1.0  # of the last evaluations, the share that has entered a front

    @property
    def n_running(self) -> int:
        """How many lanes there are by now."""
        return len(self._lanes)

    def most_at_once(self, n_evaluated: int) -> int:
        """Return how many evaluations the next call may have, after as many as there were."""
        most = n_evaluated // 10
        if self.n_running == 1:
            return most
        return min(most, int(EXCHANGED * len(self) / self._rate))

    def insert(self, batch: PlanBatch) -> None:
        """Insert valid plans for the mission's team into the front, unless it dominates them."""
        for lane in self._lanes:
            lane.insert(batch)

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, of which there must be one.

        Returns how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        if self.n_running < self.n_lanes and self._n_evaluated >= FIRST_ALONE:
            self._split()
        lanes, n_lanes = self._lanes, self.n_running
        if n_lanes == 1:
            n = lanes[0].run(n_evaluations)
        else:
            shares = [(n_evaluations + lane) // n_lanes for lane in range(n_lanes)]
            with mapping(min(self.n_threads, n_lanes)) as map_:
                spent, parts = zip(*map_(_run, lanes, shares), strict=True)
                news = join_news(parts)
                map_(lambda lane: lane.take_over(news), lanes)
            n = sum(spent)
            self._rate = (1 + len(news.reward)) / (n + 1)
        self._n_evaluated += n
        return n

    def _split(self) -> None:
        """Let the one search go on as several, which begin with its front."""
        [first] = self._lanes
        self._lanes += [LocalSearch(**self._how) for _ in range(self.n_lanes - 1)]
        news = join_news([first.news(0)])
        first.share_routes(self._lanes[1:])
        for lane in self._lanes:
            lane.take_over(news)

    def __len__(self) -> int:
        return len(self._lanes[0])

    @property
    def version(self) -> int:
        """How many plans ever entered the front: changes whenever the front does."""
        return self._lanes[0].version

    def objectives(self) -> FloatArray:
        """Return E[R] and E[S] of the front, by descending E[R] (n_plans, 2), without its plans."""
        return self._lanes[0].objectives()

    def plans(self) -> tuple[PlanBatch, FloatArray, OffsetArray]:
        """Return the front by descending E[R], as :meth:`LocalSearch.plans` does."""
        return self._lanes[0].plans()

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if self.n_running > 1:
            self._lanes[0].share_routes(self._lanes[1:])


def _run(lane: LocalSearch, n_evaluations: int) -> tuple[int, News]:
    """Let a lane search; return how many plans it evaluated, and what entered its front."""
    known = lane.version
    return lane.run(n_evaluations), lane.news(known)
