"""E[R] against how probably the robot in the greatest danger survives."""

from botohe_moo import BOTOHE
from botohe_moo.objectives import Objectives


class Safest(BOTOHE):
    """Expected reward, and the least survival of a robot."""

    @property
    def objectives(self):
        """At most all reward, and certainty."""
        bounds = self.mission.total_reward, 1.0
        return Objectives(
            ("E[R]", "least survival"), bounds, ("reward", "least_survival")
        )

    def evaluate_batch(self, batch):
        """Return F: what is to be large has a minus."""
        F = super().evaluate_batch(batch)  # −E[R] and −E[S]
        F[:, 1] = -self.mission.robot_survival(batch).min(axis=1)
        return F
