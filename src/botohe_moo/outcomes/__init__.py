"""Outcomes of a plan: distributions of reward and survivors, risk, simulation."""

from botohe_moo.outcomes.distribution import Distribution
from botohe_moo.outcomes.outcomes import (
    Outcomes,
    plan_outcomes,
    reward_distribution,
    simulate,
    survivors_distribution,
)

__all__ = [
    "Distribution",
    "Outcomes",
    "plan_outcomes",
    "reward_distribution",
    "simulate",
    "survivors_distribution",
]
