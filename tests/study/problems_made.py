"""Problems of your own for studies: named as ``module:Class``."""

from dataclasses import replace

import numpy as np

from botohe_moo import BOTOHE
from botohe_moo.objectives import Objectives


class Weakest(BOTOHE):
    """E[R], and how probably the robot in the greatest danger survives."""

    @property
    def objectives(self):
        names, columns = ("E[R]", "least survival"), ("reward", "least")
        return Objectives(names, (self.mission.total_reward, 1.0), columns)

    def evaluate_batch(self, batch):
        F = super().evaluate_batch(batch)
        F[:, 1] = -self.mission.robot_survival(batch).min(axis=1)
        return F

    def advice(self):
        return "for algorithms that know this problem"


class Unbounded(BOTOHE):
    """Does not say what its objectives are at most."""

    def evaluate_batch(self, batch):
        return 2 * super().evaluate_batch(batch)


class Misjudged(Weakest):
    """Says that its objectives are at most less than they are."""

    @property
    def objectives(self):
        return replace(super().objectives, bounds=(0.01, 0.5))


class Endless(Weakest):
    """States a bound that is not finite."""

    @property
    def objectives(self):
        return replace(super().objectives, bounds=(np.inf, 1.0))


class Changing(Weakest):
    """Has other objectives with each team."""

    @property
    def objectives(self):
        columns = "reward", f"least_of_{self.mission.robots}"
        return replace(super().objectives, columns=columns)


class Unheard(BOTOHE):
    """Overrides what studies do not call."""

    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out, *args, **kwargs)


class Unmakeable(BOTOHE):
    """Does not take the limits of a study."""

    def __init__(self, mission):
        super().__init__(mission)


class Raising(Weakest):
    """Raises another error than a ValueError."""

    def evaluate_batch(self, batch):
        raise ZeroDivisionError("out of luck")


class Negative(Weakest):
    """Returns less than 0."""

    def evaluate_batch(self, batch):
        F = super().evaluate_batch(batch)
        F[:, 1] = 1.0
        return F


class Strict(Weakest):
    """All trails have to be of one length."""

    def __init__(self, mission, **limits):
        super().__init__(mission, **limits)
        self.n_ieq_constr += 1

    def constrain_batch(self, batch):
        lengths = self.mission.trail_lengths(batch)
        return np.column_stack([super().constrain_batch(batch), np.ptp(lengths, axis=1)])


class Same(BOTOHE):
    """E[R] and E[S], by another name."""
