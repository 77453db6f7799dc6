"""A search that drifts along the front."""

from typing import Annotated

from pydantic import Field

from botohe_moo.algorithms import ArchiveAlgorithm, RandomTrailSampling
from botohe_moo.operators import RuinRecreate


class Drift(ArchiveAlgorithm):
    """Drift along the front: change its plans a little, keep what is good.

    Parameters
    ----------
    n_children
        Plans that an iteration makes.
    max_via
        Nodes that a change puts into a trail at most.
    **options
        ``sampling`` and ``max_ties``, and pymoo's own.
    """

    def __init__(
        self,
        *,
        n_children: Annotated[int, Field(ge=1, le=10_000)] = 50,
        max_via: Annotated[int, Field(ge=0, le=10)] = 2,
        **options,
    ):
        super().__init__(**options)
        self.n_children = n_children
        self.sampler = RandomTrailSampling()
        self.mutation = RuinRecreate(max_via=max_via)

    def _advance(self, **_):
        size = min(self.n_children, self.n_left)  # never beyond the budget
        if size == 0:
            return
        rng = self.random_state
        if len(self.archive) == 0:
            plans = self.sampler.sample_batch(self.problem, size, rng)
        else:
            chosen = rng.integers(len(self.archive), size=size)
            parents = self.archive.plans.take(chosen)
            mission = self.problem.mission
            plans = self.mutation.mutate_batch(mission, parents, rng)
        self.evaluate_plans(plans)  # evaluates, counts, archives
