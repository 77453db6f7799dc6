"""Local searches side by side that exchange plans: the island model of parallel search."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch, LocalSearchSettings
from botohe_moo.algorithms.local_search.kernels.state import Given
from botohe_moo.core.threads import mapping
from botohe_moo.core.world import World
from botohe_moo.mission.model import Mission

if TYPE_CHECKING:
    import pandas as pd

# Islands begin after this many evaluations. Until then, one search alone finds more.
FIRST_ALONE = 20_000
# About how many plans enter the fronts until the islands exchange them. With more, they find much
# twice; with fewer, migration takes longer than it brings. Nor do islands begin before the front
# has as many plans: with `max_size` 10, eight islands found worse fronts than one, in twice the
# time.
N_MIGRANTS = 50
# How many plans of an island wait for ruin and recreate: few, so that none takes much longer than
# the others.
_QUEUE = 8


class Islands:
    """A local search that goes on as ``n_islands`` searches, by ``n_threads``, once that pays.

    The first island holds the front of all after each call; the others take over its migrants when
    they go on. All share one ``Costs``. Results do not depend on ``n_threads``. Other arguments are
    those of :class:`LocalSearch`.
    """

    def __init__(
        self,
        mission: Mission,
        world: World,
        *,
        n_threads: int,
        random_state: np.random.Generator,
        settings: LocalSearchSettings,
    ) -> None:
        self.n_islands = settings.n_islands
        self.n_threads = n_threads
        self._new = partial(
            LocalSearch, mission, Costs(world), random_state=random_state, settings=settings
        )
        self._islands = [self._new()]
        self._n_evaluated = 0
        self._rate = 1.0  # of the last evaluations, the share that has entered a front
        self._migrants: list[Given | None] = [None]  # what each island has still to take over

    @property
    def n_running(self) -> int:
        """How many islands there are by now."""
        return len(self._islands)

    @property
    def first(self) -> LocalSearch:
        """The first island, whose front is that of all."""
        return self._islands[0]

    def run(self, n_evaluations: int) -> int:
        """Search from the plans of the front, which must not be empty.

        Returns how many plans were evaluated: fewer than ``n_evaluations`` where no move makes any
        other plan.
        """
        is_time = self._n_evaluated >= FIRST_ALONE and len(self.first) >= N_MIGRANTS
        if self.n_running < self.n_islands and is_time:
            self._split()
        if self.n_running == 1:
            n = self.first.run(n_evaluations)
        else:
            n = self._run_islands(n_evaluations)
        self._n_evaluated += n
        return n

    def _run_islands(self, n_evaluations: int) -> int:
        """Let all islands search, in rounds, each of which ends with a migration."""
        islands, n_islands, n = self._islands, self.n_running, 0
        with mapping(min(self.n_threads, n_islands)) as map_:
            while n < n_evaluations:
                n_round = min(n_evaluations - n, max(n_islands, int(N_MIGRANTS / self._rate)))
                shares = [(n_round + island) // n_islands for island in range(n_islands)]
                turns = list(zip(islands, self._migrants, shares, strict=True))
                # Islands that recreate plans take longest: they go first, so that no thread is left
                # with one when the others have finished.
                order = np.argsort([-island.n_waiting for island in islands], kind="stable")
                found = map_(_run_island, *zip(*(turns[i] for i in order), strict=True))
                spent, parts = zip(*(found[i] for i in np.argsort(order)), strict=True)
                migrants = _together(parts)
                self._migrants = [migrants] * n_islands
                self._rate = (1 + len(migrants.plan)) / (n_round + 1)
                n += sum(spent)
                if sum(spent) == 0:  # no move makes another plan, on no island
                    break
        _take_over(self.first, self._migrants[0])
        self._migrants[0] = None
        return n

    def _split(self) -> None:
        """Let the one search go on as several, which begin with its front."""
        others = [self._new() for _ in range(self.n_islands - 1)]
        self._islands += others
        for island in self._islands:
            island.let_wait(_QUEUE)
        self._migrants = [None, *[self.first.migrants(0)] * len(others)]

    @property
    def move_counts(self) -> dict[str, dict[str, int]]:
        """What each move brought, on all islands, as :attr:`LocalSearch.move_counts`."""
        counts = [island.move_counts for island in self._islands]
        return {
            move: {name: sum(of[move][name] for of in counts) for name in first}
            for move, first in counts[0].items()
        }

    @property
    def statistics(self) -> pd.DataFrame:
        """What each move brought, on all islands, as :attr:`LocalSearch.statistics`."""
        return sum((island.statistics for island in self._islands[1:]), self.first.statistics)


def _run_island(
    island: LocalSearch, migrants: Given | None, n_evaluations: int
) -> tuple[int, Given]:
    """Let an island take over migrants and search.

    Returns how many plans it evaluated, and its own migrants: the plans that entered meanwhile.
    """
    _take_over(island, migrants)
    known = island.version
    return island.run(n_evaluations), island.migrants(known)


def _take_over(island: LocalSearch, migrants: Given | None) -> None:
    if migrants is not None:
        island.take_over(migrants)


def _together(parts: Sequence[Given]) -> Given:
    """Return the migrants of several islands as one."""
    n_trails = np.cumsum([0, *(len(part.offsets) - 1 for part in parts)])
    plans = [part.plan + np.int32(n) for part, n in zip(parts, n_trails[:-1], strict=True)]
    lengths = np.concatenate([np.diff(part.offsets) for part in parts])
    joined = Given._make(map(np.concatenate, zip(*parts, strict=True)))
    return joined._replace(plan=np.concatenate(plans), offsets=np.append(0, np.cumsum(lengths)))
