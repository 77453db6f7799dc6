"""Local searches side by side, which give each other what they find."""

from __future__ import annotations

from typing import Any

import numpy as np

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.algorithms.local_search.engine import LocalSearch
from botohe_moo.algorithms.local_search.kernels.exchange import News, join_news
from botohe_moo.core.graph import Limits
from botohe_moo.core.threads import mapping
from botohe_moo.mission.model import Mission
from botohe_moo.trails import PlanBatch

# Lanes begin after this many evaluations. Until then, one search alone finds more.
FIRST_ALONE = 20_000
# About how many plans enter the fronts until the lanes tell each other. With more, they find much
# twice; with fewer, telling takes longer than it brings. Nor do lanes begin before the front has as
# many plans: with `max_size` 10, eight lanes found worse fronts than one, in twice the time.
N_NEWS = 50


class Lanes:
    """A local search that goes on as ``n_lanes`` searches, by ``n_threads``, once that pays.

    The first lane holds the front of all after each call; the others are told when they go on.
    Results do not depend on ``n_threads``. Other arguments are those of :class:`LocalSearch`.
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
        self._untold: list[News | None] = [None]  # what each lane has still to be told

    @property
    def n_running(self) -> int:
        """How many lanes there are by now."""
        return len(self._lanes)

    def insert(self, batch: PlanBatch) -> None:
        """Insert valid plans for the mission's team into the front, unless it dominates them."""
        for lane in self._lanes:
            lane.insert(batch)

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, of which there must be one.

        Returns how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        is_time = self._n_evaluated >= FIRST_ALONE and len(self) >= N_NEWS
        if self.n_running < self.n_lanes and is_time:
            self._split()
        if self.n_running == 1:
            n = self._lanes[0].run(n_evaluations)
        else:
            n = self._run_lanes(n_evaluations)
        self._n_evaluated += n
        return n

    def _run_lanes(self, n_evaluations: int) -> int:
        """Let all lanes search, in rounds, after each of which they tell each other."""
        lanes, n_lanes, n = self._lanes, self.n_running, 0
        with mapping(min(self.n_threads, n_lanes)) as map_:
            while n < n_evaluations:
                n_round = min(n_evaluations - n, max(n_lanes, int(N_NEWS / self._rate)))
                shares = [(n_round + lane) // n_lanes for lane in range(n_lanes)]
                turns = list(zip(lanes, self._untold, shares, strict=True))
                # Lanes that refill plans take longest: they go first, so that no thread is left
                # with one when the others have finished.
                order = np.argsort([-lane.n_waiting for lane in lanes], kind="stable")
                found = map_(_run_lane, *zip(*(turns[i] for i in order), strict=True))
                spent, parts = zip(*(found[i] for i in np.argsort(order)), strict=True)
                news = join_news(parts)
                self._untold = [news] * n_lanes
                self._rate = (1 + len(news.reward)) / (n_round + 1)
                n += sum(spent)
                if sum(spent) == 0:  # no move makes another plan, in no lane
                    break
        _take_over(lanes[0], self._untold[0])
        self._untold[0] = None
        return n

    def _split(self) -> None:
        """Let the one search go on as several, which begin with its front."""
        [first] = self._lanes
        self._lanes += [LocalSearch(**self._how) for _ in range(self.n_lanes - 1)]
        for lane in self._lanes:
            lane.refill_sooner()
        news = join_news([first.news(0)])
        first.share_routes(self._lanes[1:])
        first.take_over(news)
        self._untold = [None, *[news] * (self.n_lanes - 1)]

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


def _run_lane(lane: LocalSearch, news: News | None, n_evaluations: int) -> tuple[int, News]:
    """Tell a lane the news, and let it search; return how many plans it evaluated, and its news."""
    _take_over(lane, news)
    known = lane.version
    return lane.run(n_evaluations), lane.news(known)


def _take_over(lane: LocalSearch, news: News | None) -> None:
    if news is not None:
        lane.take_over(news)
