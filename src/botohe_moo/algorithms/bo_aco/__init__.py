"""Bi-objective ant colony optimisation: kernels, the colony and the pymoo classes.

Studies name the class by this package.
"""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.algorithms.bo_aco.algorithm import BOACO as BOACO

__getattr__, __dir__, _names = lazy_names(__name__)
