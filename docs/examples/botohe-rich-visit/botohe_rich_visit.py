"""A mutation that is drawn to reward."""

import numpy as np

from botohe_moo import TrailPlan
from botohe_moo.operators import PlanMutation
from botohe_moo.trails import PlanBatch


class RichVisit(PlanMutation):
    """Send one robot by way of a node that is drawn by its reward.

    Parameters
    ----------
    **options
        ``prob``, the probability of changing a plan, and ``repair``.
    """

    def _draft(self, mission, plans, rng):
        rewards = dict(mission.graph.nodes(data="reward"))
        reward = np.array([rewards[label] for label in mission.nodes], float)
        # None: all nodes alike.
        share = reward / reward.sum() if reward.any() else None
        drafts = []
        for plan in plans:
            trails = [list(trail) for trail in plan.trails]
            trail = trails[rng.integers(len(trails))]
            # Behind the base, before the last node.
            place = rng.integers(1, max(len(trail), 2))
            trail.insert(place, rng.choice(len(reward), p=share))
            drafts.append(TrailPlan(trails))
        # A repair joins what is apart.
        return PlanBatch.from_plans(drafts, mission.robots)
