"""All non-dominated plans an algorithm has found, held in arrays."""

from __future__ import annotations

from botohe_moo._base.types import FloatArray, OffsetArray
from botohe_moo.kernels.fronts.archive import Archive, Batch, merge, new_archive, screen
from botohe_moo.trails import PlanBatch


class PlanArchive:
    """Non-dominated plans by descending expected reward.

    Plans with equal objectives but different trails stay, the first ``max_ties`` of them; repeated
    plans are dropped.
    """

    def __init__(self, n_robots: int, *, max_ties: int = 1_000) -> None:
        self.n_robots = n_robots
        self.max_ties = max_ties
        self._held = new_archive()
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._held.ids)

    @property
    def objectives(self) -> FloatArray:
        """E[R] and E[S] of each plan, to be maximised (n, 2); read-only."""
        view = self._held.objectives.view()
        view.flags.writeable = False
        return view

    @property
    def held(self) -> Archive:
        """What kernels see of it; not to be changed."""
        return self._held

    @property
    def plans(self) -> PlanBatch:
        """A copy of the plans, in the order of ``objectives``."""
        return PlanBatch._wrap(self._held.nodes.copy(), self._held.offsets.copy(), self.n_robots)

    @property
    def version(self) -> int:
        """Changes whenever the archive does: the number of plans that ever entered."""
        return self._next_id

    def absorb(self, batch: PlanBatch, objectives: FloatArray) -> OffsetArray:
        """Take in evaluated plans, with E[R] and E[S] (n, 2), that the archive does not dominate.

        Returns the indices of the batch's own Pareto set.
        """
        return self._absorb(batch, objectives)[0]

    def _absorb(self, batch: PlanBatch, objectives: FloatArray) -> tuple[OffsetArray, OffsetArray]:
        """Return the indices of the batch's own Pareto set, and of the plans that have entered."""
        new = Batch(objectives, *batch.arrays)
        members, newcomers = screen(new, self.n_robots, self._held, self.max_ties)
        if len(newcomers.plans):
            self._held = merge(new, newcomers, self.n_robots, self._held, self._next_id)
            self._next_id += len(newcomers.plans)
        return members, newcomers.plans
