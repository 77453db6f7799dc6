"""The spacing of fronts that can be computed by hand."""

import numpy as np
import pytest
from botohe_spacing import SPACING

from botohe_moo import load_mission

TOY = load_mission("toy")  # a total reward of 10, and 2 robots


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        (
            [[10, 0], [5, 1], [0, 2]],
            0.0,
        ),  # neighbours are 1 apart
        ([[10, 0], [8, 0.4], [0, 2]], np.std([0.4, 0.4, 1.6], ddof=1)),
        ([[10, 0]], 0.0),
    ],
)
def test_by_hand(points, expected):
    assert SPACING(np.array(points, float), None, TOY) == pytest.approx(
        expected
    )


def test_of_no_plans():
    assert SPACING(np.empty((0, 2)), None, TOY) == 0.0
