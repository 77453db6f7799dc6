"""All non-dominated plans that an algorithm has found."""

from __future__ import annotations

from typing import NamedTuple

import moocore
import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.core.walk import are_new, keep_front, plan_hashes
from botohe_moo.trails import PlanBatch


class Archive(NamedTuple):
    """Non-dominated plans by descending objectives."""

    objectives: FloatArray  # (n_plans, n_objectives)
    hashes: SeedArray  # of each plan's multiset of trails (n_plans)
    ids: OffsetArray  # a number that no other plan ever gets (n_plans)
    plans: PlanBatch


class PlanArchive:
    """Non-dominated plans by descending objectives.

    Plans with equal objectives but different trails stay, the first ``max_ties`` of them; repeated
    plans are dropped.
    """

    def __init__(self, n_robots: int, *, max_ties: int = 1_000, n_objectives: int = 2) -> None:
        self.max_ties = max_ties
        nothing = np.empty(0, np.uint64), np.empty(0, np.int64), PlanBatch.from_plans([], n_robots)
        self._front = Archive(np.empty((0, n_objectives)), *nothing)
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._front.ids)

    @property
    def objectives(self) -> FloatArray:
        """The objectives of each plan, to be maximised (n, n_objectives); read-only."""
        view = self._front.objectives.view()
        view.flags.writeable = False
        return view

    @property
    def front(self) -> Archive:
        """The arrays themselves; not to be changed."""
        return self._front

    @property
    def plans(self) -> PlanBatch:
        """The plans, in the order of ``objectives``."""
        return self.front.plans

    @property
    def version(self) -> int:
        """A number that grows whenever the archive changes: more than any of the plans' ids."""
        return self._next_id

    def insert(self, batch: PlanBatch, objectives: FloatArray) -> OffsetArray:
        """Insert evaluated plans, with their objectives, that the archive does not dominate.

        Returns the indices of the batch's own Pareto set, by descending objectives.
        """
        old, n_old = self._front, len(self)
        hashes = plan_hashes(*batch.arrays, batch.n_robots)
        members = _pareto_rows(objectives, hashes, len(batch))
        new = members[are_new(objectives, hashes, members, old.objectives, old.hashes)]
        if not len(new):
            return members
        objectives = np.concatenate([old.objectives, objectives[new]])
        hashes = np.concatenate([old.hashes, hashes[new]])
        rows = _pareto_rows(objectives, hashes, self.max_ties)
        if (rows >= n_old).any():
            ids = np.append(old.ids, self._next_id + new)
            plans = PlanBatch.concatenate([old.plans, batch.take(new)]).take(rows)
            self._front = Archive(objectives[rows], hashes[rows], ids[rows], plans)
            self._next_id += len(batch)
        return members


def _pareto_rows(objectives: FloatArray, hashes: SeedArray, max_ties: int) -> OffsetArray:
    """Return the rows of the Pareto set by descending objectives, each plan once.

    Plans with equal objectives stay in their order; objectives that are NaN are left out.
    """
    order = np.lexsort(-objectives.T[::-1])
    if objectives.shape[1] > 2:
        order = order[np.isfinite(objectives[order]).all(axis=1)]
        nondominated = moocore.is_nondominated(objectives[order], maximise=True, keep_weakly=True)
        order = order[nondominated]
    return order[: keep_front(objectives, hashes, order, max_ties)]
