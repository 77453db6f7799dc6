"""A handful of plans that are really different."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import TrailPlan
from botohe_moo.decide import representatives, selecting
from botohe_moo.decide.selecting import arc_counts, distances
from botohe_moo.mission import PlanError
from botohe_moo.trails import PlanBatch
from tests.decide.made import MISSION, NAMES, PLANS, star, trips
from tests.decide.test_choosing import fronts


def plain_distance(first, second):
    """1 - |A & B| / |A | B| of the multisets of arcs, arc by arc."""
    ours, others = (
        [arc for trail in plan.trails for arc in pairwise(trail)] for plan in (first, second)
    )
    common = sum(min(ours.count(arc), others.count(arc)) for arc in set(ours))
    union = len(ours) + len(others) - common
    return 1 - common / union if union else 0.0


@given(fronts())
def test_distances(front):
    mission, plans = front
    counts = arc_counts(PlanBatch.from_plans(plans, mission.robots), per_robot=False)
    expected = [[plain_distance(first, second) for second in plans] for first in plans]
    assert distances(counts, counts) == pytest.approx(np.array(expected))


def test_arcs_of_each_robot():
    batch = PlanBatch.from_plans([TrailPlan([[0, 1, 2, 0], [0]]), TrailPlan([[0, 1, 0]] * 2)], 2)
    counts = arc_counts(batch, per_robot=True)  # arcs 0-1, 1-0, 1-2, 2-0
    assert counts.tolist() == [[1, 0, 1, 1], [0, 0, 0, 0], [1, 1, 0, 0], [1, 1, 0, 0]]
    assert arc_counts(batch, per_robot=False).tolist() == [[1, 0, 1, 1], [2, 2, 0, 0]]


def test_two_groups_of_plans():
    # By reward AB 3.8, AC 3, BC 2.8 and C 1. AB and AC share the way to a: 1 - 2 / 6; AB and BC as
    # well; BC and C: 1 - 2 / 4; AC and C the same; AC and BC 1 - 2 / 6; AB and C 1.
    plans = [PLANS[NAMES.index(name)] for name in ("C", "AC", "AB", "BC")]
    # Ways to the plans beside them, in objectives divided by 7 and 2:
    # AB-AC 0.125, AC-BC 0.202, BC-C 0.258; the shares are 0.062, 0.163, 0.230, 0.129.
    # Two segments: AB | rest with medoid BC: 0.163 (2/3) + 0.129 / 2 = 0.173;
    # AB AC | BC C: 0.062 (2/3) + 0.129 / 2 = 0.106; AB AC BC | C: the best medoid is BC or AC,
    # with 0.062 (2/3) + 0.163 (2/3) = 0.150.
    assert representatives(MISSION, plans, 2) == (1, 3)


def cost_of(apart, cuts):
    """The cheapest medoids of segments, and what they cost."""
    medoids, total = [], 0.0
    for start, stop in pairwise(cuts):
        costs = [apart[m, start:stop].sum() for m in range(start, stop)]
        medoids.append(start + int(np.argmin(costs)))
        total += min(costs)
    return total, medoids


@given(st.integers(2, 8), st.integers(1, 4), st.integers(0, 10_000))
def test_no_other_cuts_are_cheaper(n, k, seed):
    k = min(k, n)
    apart = np.random.default_rng(seed).random((n, n))
    np.fill_diagonal(apart, 0)
    found = selecting._segment_medoids(apart, k)
    best = min(cost_of(apart, [0, *cuts, n])[0] for cuts in combinations(range(1, n), k - 1))
    assert found == sorted(found)
    segments = (
        cost
        for cuts in combinations(range(1, n), k - 1)
        for cost, medoids in [cost_of(apart, [0, *cuts, n])]
        if medoids == found
    )
    assert min(segments) == pytest.approx(best)


@given(fronts(), st.integers(1, 4))
def test_what_holds_for_all(front, k):
    mission, plans = front
    found = representatives(mission, plans, k)
    assert len(found) == len(set(found)) == min(k, len(plans))
    rewards = mission.evaluate(plans)[list(found), 0]
    assert (np.diff(rewards) <= 0).all()
    assert representatives(mission, plans, k) == found
    assert all(type(row) is int for row in found)


def test_small_fronts():
    assert representatives(MISSION, [PLANS[0]]) == (0,)
    assert representatives(MISSION, [PLANS[5], PLANS[0]]) == (1, 0)
    assert len(representatives(MISSION, [PLANS[0]] * 7, 3)) == 3


def test_long_fronts_are_thinned(monkeypatch):
    monkeypatch.setattr(selecting, "_MAX_PLANS", 4)
    mission = star({str(i): (i, 1 - i / 20) for i in range(9)}, robots=1)
    found = representatives(mission, [trips(mission, str(i)) for i in range(9)], 3)
    assert set(found) <= {0, 3, 5, 8}


@pytest.mark.parametrize("k", [0, -1, 1.5, "5", True])
def test_bad_numbers(k):
    with pytest.raises(ValueError, match="Expected k"):
        representatives(MISSION, PLANS, k)


def test_bad_plans():
    with pytest.raises(ValueError, match="Expected at least one plan"):
        representatives(MISSION, [])
    with pytest.raises(PlanError, match="expected 3 trails"):
        representatives(MISSION.with_robots(3), PLANS)
