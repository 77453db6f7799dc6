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
        reward = np.array([mission.graph.nodes[label]["reward"] for label in mission.nodes], float)
        share = reward / reward.sum() if reward.any() else None  # None: all alike
        drafts = []
        for plan in plans:
            trails = [list(trail) for trail in plan.trails]
            trail = trails[rng.integers(len(trails))]
            place = rng.integers(1, max(len(trail), 2))  # behind the base, before the last node
            trail.insert(place, rng.choice(len(reward), p=share))
            drafts.append(TrailPlan(trails))
        return PlanBatch.from_plans(drafts, mission.robots)  # a repair joins what is apart
