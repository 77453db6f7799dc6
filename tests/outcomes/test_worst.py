"""The worst case of a plan, against brute force."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.operators import RandomTrailSampling
from botohe_moo.outcomes import worst_case
from botohe_moo.problem import BOTOHE
from tests import twins
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans


@examples(100)
@given(missions_with_plans(max_robots=4) | team_missions_with_plans(), st.data())
def test_it_is_that_of_brute_force_and_bounded_from_below(case, data):
    mission, plan = case
    losses = data.draw(st.integers(0, mission.robots))
    robots = list(zip(mission.kind_of, mission.labels(plan), strict=True))
    expected = min(
        twins.evaluate(mission, *zip(*[(t, k) for k, t in kept], strict=True))[0] if kept else 0.0
        for kept in combinations(robots, mission.robots - losses)
    )
    [found] = worst_case(mission, [plan], losses)
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
    [bound] = worst_case(mission, [plan], losses, max_sets=1)
    assert 0 <= bound <= found * (1 + 1e-12) + 1e-12


def test_large_teams_are_bounded():
    mission = load_mission("art_museum").with_robots(30)
    batch = RandomTrailSampling().sample_batch(BOTOHE(mission), 3, np.random.default_rng(1))
    one, fifteen = worst_case(mission, batch, 1), worst_case(mission, batch, 15)
    whole = mission.evaluate(batch)[:, 0]
    assert (fifteen <= one).all()
    assert (one <= whole).all()
    assert worst_case(mission, batch, 0) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("losses", [-1, 3, 1.5])
def test_a_number_of_robots_that_there_are_not(losses):
    toy = load_mission("toy")
    with pytest.raises(ValueError, match="Expected losses"):
        worst_case(toy, [toy.stay_home()], losses)
