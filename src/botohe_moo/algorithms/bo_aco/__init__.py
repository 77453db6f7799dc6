"""Bi-objective ant colony optimisation: kernels, the colony and the pymoo classes."""

from typing import TYPE_CHECKING

from botohe_moo._base.lazy import lazy_names

if TYPE_CHECKING:
    from botohe_moo.algorithms.bo_aco.algorithm import BOACO as BOACO
    from botohe_moo.algorithms.bo_aco.algorithm import RandomTrails as RandomTrails
    from botohe_moo.algorithms.bo_aco.colony import JOURNAL as JOURNAL
    from botohe_moo.algorithms.bo_aco.colony import Colony as Colony
    from botohe_moo.algorithms.bo_aco.colony import ColonySettings as ColonySettings

__getattr__, __dir__, __all__ = lazy_names(__name__)
