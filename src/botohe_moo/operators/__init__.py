"""Sampling, crossover, mutation, repair and duplicate elimination for trail plans.

For any pymoo algorithm that solves a :class:`~botohe_moo.BOTOHE`.
"""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo.operators.crossover import MixedCrossover as MixedCrossover
    from botohe_moo.operators.crossover import PlanCrossover as PlanCrossover
    from botohe_moo.operators.crossover import TrailExchange as TrailExchange
    from botohe_moo.operators.crossover import TrailSplice as TrailSplice
    from botohe_moo.operators.mutation import MixedMutation as MixedMutation
    from botohe_moo.operators.mutation import PlanMutation as PlanMutation
    from botohe_moo.operators.mutation import RuinRecreate as RuinRecreate
    from botohe_moo.operators.mutation import ShareTrails as ShareTrails
    from botohe_moo.operators.mutation import TrailMoves as TrailMoves
    from botohe_moo.operators.repair import PenaltyOnly as PenaltyOnly
    from botohe_moo.operators.repair import PlanDuplicates as PlanDuplicates
    from botohe_moo.operators.repair import PlanRepair as PlanRepair
    from botohe_moo.operators.repair import RepairCounts as RepairCounts
    from botohe_moo.operators.repair import SafestPathRepair as SafestPathRepair
    from botohe_moo.operators.repair import TruncateRepair as TruncateRepair
    from botohe_moo.operators.sampling import CornerSampling as CornerSampling
    from botohe_moo.operators.sampling import GivenSampling as GivenSampling
    from botohe_moo.operators.sampling import GuidedTrailSampling as GuidedTrailSampling
    from botohe_moo.operators.sampling import MixedSampling as MixedSampling
    from botohe_moo.operators.sampling import PlanSampling as PlanSampling
    from botohe_moo.operators.sampling import RandomTrailSampling as RandomTrailSampling

__getattr__, __dir__, __all__ = lazy_names(__name__)
