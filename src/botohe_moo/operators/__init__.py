"""Crossover, mutation, repair and duplicate elimination for trail plans.

For any pymoo algorithm that solves a :class:`~botohe_moo.BOTOHE`. Samplings, which need whole
searches, are in :mod:`botohe_moo.algorithms`.
"""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.operators.variation import MixedCrossover as MixedCrossover
    from botohe_moo.operators.variation import MixedMutation as MixedMutation
    from botohe_moo.operators.variation import PenaltyOnly as PenaltyOnly
    from botohe_moo.operators.variation import PlanCrossover as PlanCrossover
    from botohe_moo.operators.variation import PlanDuplicates as PlanDuplicates
    from botohe_moo.operators.variation import PlanMutation as PlanMutation
    from botohe_moo.operators.variation import PlanRepair as PlanRepair
    from botohe_moo.operators.variation import RepairCounts as RepairCounts
    from botohe_moo.operators.variation import RuinRecreate as RuinRecreate
    from botohe_moo.operators.variation import SafestPathRepair as SafestPathRepair
    from botohe_moo.operators.variation import ShareTrails as ShareTrails
    from botohe_moo.operators.variation import TrailSplice as TrailSplice
    from botohe_moo.operators.variation import TruncateRepair as TruncateRepair

__getattr__, __dir__, __all__ = lazy_names(__name__)
