"""Algorithms for BOTOHE problems, and the registry that makes them by name."""

from botohe_moo.algorithms.bo_aco import BOACO
from botohe_moo.algorithms.random_trails import RandomTrails
from botohe_moo.algorithms.registry import algorithm_names, make_algorithm

__all__ = ["BOACO", "RandomTrails", "algorithm_names", "make_algorithm"]
