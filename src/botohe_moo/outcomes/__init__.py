"""Outcomes of a plan: distributions of reward and survivors, risk, simulation."""

from typing import TYPE_CHECKING

from botohe_moo.base.runtime import lazy_names

if TYPE_CHECKING:
    from botohe_moo.outcomes.distribution import Distribution as Distribution
    from botohe_moo.outcomes.outcomes import Outcomes as Outcomes
    from botohe_moo.outcomes.outcomes import plan_outcomes as plan_outcomes
    from botohe_moo.outcomes.outcomes import reward_distribution as reward_distribution
    from botohe_moo.outcomes.outcomes import simulate as simulate
    from botohe_moo.outcomes.outcomes import survivors_distribution as survivors_distribution
    from botohe_moo.outcomes.reaching import collect_probabilities as collect_probabilities
    from botohe_moo.outcomes.reaching import reach_probabilities as reach_probabilities
    from botohe_moo.outcomes.reaching import team_reach as team_reach

__getattr__, __dir__, __all__ = lazy_names(__name__)
