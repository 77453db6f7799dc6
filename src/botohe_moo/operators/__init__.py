"""Sampling, crossover, mutation, repair and duplicate elimination for trail plans.

For any pymoo algorithm that solves a :class:`~botohe_moo.BOTOHE`.
"""

from botohe_moo.operators.crossover import MixedCrossover, PlanCrossover, TrailExchange, TrailSplice
from botohe_moo.operators.duplicates import PlanDuplicates
from botohe_moo.operators.mutation import (
    MixedMutation,
    PlanMutation,
    RuinRecreate,
    SendHome,
    ShareTrails,
    TrailMoves,
)
from botohe_moo.operators.repair import (
    PenaltyOnly,
    PlanRepair,
    RepairCounts,
    SafestPathRepair,
    TruncateRepair,
)
from botohe_moo.operators.sampling import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
    RandomTrailSampling,
)

__all__ = [
    "CornerSampling",
    "GivenSampling",
    "GuidedTrailSampling",
    "MixedCrossover",
    "MixedMutation",
    "MixedSampling",
    "PenaltyOnly",
    "PlanCrossover",
    "PlanDuplicates",
    "PlanMutation",
    "PlanRepair",
    "PlanSampling",
    "RandomTrailSampling",
    "RepairCounts",
    "RuinRecreate",
    "SafestPathRepair",
    "SendHome",
    "ShareTrails",
    "TrailExchange",
    "TrailMoves",
    "TrailSplice",
    "TruncateRepair",
]
