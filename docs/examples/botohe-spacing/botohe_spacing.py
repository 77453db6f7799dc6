"""How evenly the plans of a front are spaced."""

import numpy as np

from botohe_moo.indicators import Indicator, largest_objectives


def spacing(points, mission):
    """Compute the spacing of Schott (1995): how much distances differ.

    The standard deviation of each point's distance to its nearest one, with
    objectives as shares of what the mission has at most.
    """
    if len(points) < 2:
        return 0.0
    shares = points / largest_objectives(mission)
    distances = np.abs(shares[:, None] - shares).sum(axis=2)
    np.fill_diagonal(distances, np.inf)
    return float(distances.min(axis=1).std(ddof=1))


SPACING = Indicator("spacing", spacing, higher_is_better=False)
