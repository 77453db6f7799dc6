"""All non-dominated plans that an algorithm has found."""

from __future__ import annotations

import moocore
import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray, SeedArray
from botohe_moo.core.archive import Archive, Batch, first_plans, insert, new_archive, plan_hashes
from botohe_moo.trails import PlanBatch


class PlanArchive:
    """Non-dominated plans by descending objectives.

    Plans with equal objectives but different trails stay, the first ``max_ties`` of them; repeated
    plans are dropped.
    """

    def __init__(self, n_robots: int, *, max_ties: int = 1_000, n_objectives: int = 2) -> None:
        self.n_robots = n_robots
        self.max_ties = max_ties
        self._arrays = new_archive(0, 0, n_robots, n_objectives)
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._arrays.ids)

    @property
    def objectives(self) -> FloatArray:
        """The objectives of each plan, to be maximised (n, n_objectives); read-only."""
        view = self._arrays.objectives.view()
        view.flags.writeable = False
        return view

    @property
    def arrays(self) -> Archive:
        """The arrays that kernels take; not to be changed."""
        return self._arrays

    @property
    def plans(self) -> PlanBatch:
        """A copy of the plans, in the order of ``objectives``."""
        return self._plans.take(np.arange(len(self)))

    @property
    def _plans(self) -> PlanBatch:
        return PlanBatch._wrap(self.arrays.nodes, self.arrays.offsets, self.n_robots)

    @property
    def version(self) -> int:
        """A number that grows whenever the archive changes: more than any of the plans' ids."""
        return self._next_id

    def insert(self, batch: PlanBatch, objectives: FloatArray) -> OffsetArray:
        """Insert evaluated plans, with their objectives, that the archive does not dominate.

        Returns the indices of the batch's own Pareto set.
        """
        old, new, n_robots = self._arrays, Batch(objectives, *batch.arrays), self.n_robots
        if objectives.shape[1] != 2:
            return self._insert_many(batch, new)
        order, hashes = np.lexsort(-objectives.T[::-1]), np.empty(len(batch), np.uint64)
        room = new_archive(len(self) + len(batch), len(old.nodes) + len(new.nodes), n_robots)
        n_members, n, n_new = insert(old, new, order, hashes, self.max_ties, self.version, room)
        if n_new:
            self._arrays, self._next_id = first_plans(room, n, n_robots), self.version + len(batch)
        return order[:n_members]

    def _insert_many(self, batch: PlanBatch, new: Batch) -> OffsetArray:
        """Insert plans with other than two objectives."""
        old, n_old = self._arrays, len(self)
        hashes = plan_hashes(new, self.n_robots)
        members = _pareto_rows(new.objectives, hashes)
        if not len(members):
            return members
        objectives = np.concatenate([old.objectives, new.objectives])
        hashes = np.concatenate([old.hashes, hashes])
        rows = _pareto_rows(objectives, hashes)
        # Plans with equal objectives come one after another, and stay in their order.
        rows = rows[np.lexsort(-objectives[rows].T[::-1])]
        place, is_first = np.arange(len(rows)), np.ones(len(rows), bool)
        is_first[1:] = (objectives[rows[1:]] != objectives[rows[:-1]]).any(axis=1)
        n_ties = place - np.maximum.accumulate(np.where(is_first, place, 0))
        rows = rows[n_ties < self.max_ties]
        if (rows >= n_old).any():
            ids = np.append(old.ids, self.version + np.arange(len(batch)))
            kept = PlanBatch.concatenate([self._plans, batch]).take(rows)
            self._arrays = Archive(objectives[rows], hashes[rows], ids[rows], *kept.arrays)
            self._next_id += len(batch)
        return members


def _pareto_rows(objectives: FloatArray, hashes: SeedArray) -> OffsetArray:
    """Return the rows of the Pareto set, each plan once; objectives that are NaN are left out."""
    rows = np.flatnonzero(np.isfinite(objectives).all(axis=1))
    rows = rows[moocore.is_nondominated(objectives[rows], maximise=True, keep_weakly=True)]
    _, first = np.unique(hashes[rows], return_index=True)
    pareto: OffsetArray = rows[np.sort(first)]
    return pareto
