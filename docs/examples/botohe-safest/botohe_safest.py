"""E[R] against how probably the robot in the greatest danger survives."""

from botohe_moo import BOTOHE


class Safest(BOTOHE):
    """Expected reward, and the least survival of a robot."""

    @property
    def objective_bounds(self):
        """At most all reward, and certainty."""
        return self.mission.total_reward, 1.0

    def evaluate_batch(self, batch):
        """Return F: what is to be large has a minus."""
        F = super().evaluate_batch(batch)  # −E[R] and −E[S]
        F[:, 1] = -self.mission.robot_survival(batch).min(axis=1)
        return F
