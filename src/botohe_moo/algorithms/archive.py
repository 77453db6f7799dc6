"""All non-dominated plans that an algorithm has found."""

from __future__ import annotations

import numpy as np

from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.core.archive import Archive, Batch, first_plans, insert, new_archive
from botohe_moo.trails import PlanBatch


class PlanArchive:
    """Non-dominated plans by descending expected reward.

    Plans with equal objectives but different trails stay, the first ``max_ties`` of them; repeated
    plans are dropped.
    """

    def __init__(self, n_robots: int, *, max_ties: int = 1_000) -> None:
        self.n_robots = n_robots
        self.max_ties = max_ties
        self._arrays = new_archive(0, 0, n_robots)
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._arrays.ids)

    @property
    def objectives(self) -> FloatArray:
        """E[R] and E[S] of each plan, to be maximised (n, 2); read-only."""
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
        """Insert evaluated plans, with E[R] and E[S] (n, 2), that the archive does not dominate.

        Returns the indices of the batch's own Pareto set.
        """
        old, new, n_robots = self._arrays, Batch(objectives, *batch.arrays), self.n_robots
        order, hashes = np.lexsort(-objectives.T[::-1]), np.empty(len(batch), np.uint64)
        room = new_archive(len(self) + len(batch), len(old.nodes) + len(new.nodes), n_robots)
        n_members, n, n_new = insert(old, new, order, hashes, self.max_ties, self.version, room)
        if n_new:
            self._arrays, self._next_id = first_plans(room, n, n_robots), self.version + len(batch)
        return order[:n_members]
