"""Certified upper bounds on the front of a mission."""

from botohe_moo.search.bounds.bound import bound_front
from botohe_moo.search.bounds.front_bound import FrontBound

__all__ = ["FrontBound", "bound_front"]
