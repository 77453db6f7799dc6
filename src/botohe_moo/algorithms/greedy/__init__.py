"""Greedy sequential planning: kernels, the planner and the pymoo class."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.algorithms.greedy.planner import plan_sequentially as plan_sequentially

__getattr__, __dir__, __all__ = lazy_names(__name__)
