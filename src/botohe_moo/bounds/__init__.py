"""Certified upper bounds on the front of a mission."""

from botohe_moo.bounds.bound import bound_front
from botohe_moo.bounds.front_bound import FrontBound

__all__ = ["FrontBound", "bound_front"]
