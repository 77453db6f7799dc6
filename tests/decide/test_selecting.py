"""A handful of plans that are really different."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import TrailPlan
from botohe_moo.decide import representatives
from botohe_moo.decide.fronts import arc_counts, distances, front_rows
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


# By reward AB 3.8, AC 3, BC 2.8 and C 1. Divided by 7 and 2, the ways between them are 0.125, 0.202
# and 0.258: AC, BC and C lie at 0.21, 0.56 and 1 of the whole way. Distances: AB and AC share the
# way to a, 1 - 2 / 6; AB and BC 1 - 2 / 6; AB and C 1; AC and BC 1 - 2 / 6; both to C 1 - 2 / 4.
FOUR = [PLANS[NAMES.index(name)] for name in ("C", "AC", "AB", "BC")]


def test_by_hand():
    found = {k: representatives(MISSION, FOUR, k) for k in range(1, 6)}
    assert found == {
        1: (1,),  # the sums are 2.33, 1.83, 1.83 and 2: AC and BC, of which AC is first
        2: (2, 3),  # AB AC | BC C; of two the first
        3: (2, 3, 0),  # AB AC | BC | C
        4: (2, 1, 3, 0),
        5: (2, 1, 3, 0),
    }


def test_gaps_are_filled_with_what_is_farthest():
    # Two robots to a rich node, or to poor ones, and nothing between. On the way along the front AA
    # is at 0, the others near 1; of them, BB has no arc with C or CC, which share one.
    mission = star({"a": (100, 0.9), "b": (2, 0.99), "c": (1, 0.999)})
    plans = [trips(mission, *names) for names in ("aa", "bb", "c", "cc")]
    assert mission.evaluate(plans)[:, 0].tolist() == pytest.approx([99, 1.9998, 0.999, 0.999999])
    assert representatives(mission, plans, 2) == (0, 3)
    assert representatives(mission, plans, 3) == (0, 1, 3)


def test_dominated_plans_are_selected_only_if_the_front_has_too_few():
    # AA has the reward of AC and fewer survivors; BB has less of both than BC.
    assert [NAMES[row] for row in representatives(MISSION, PLANS, 3)] == ["AB", "BC", "C"]
    assert [NAMES[row] for row in representatives(MISSION, PLANS, 4)] == ["AB", "AC", "BC", "C"]
    assert len(representatives(MISSION, PLANS, 5)) == 5
    assert len(representatives(MISSION, PLANS, 6)) == 6


@given(fronts(), st.integers(1, 4))
def test_what_holds_for_all(front, k):
    mission, plans = front
    found = representatives(mission, plans, k)
    assert len(found) == len(set(found)) == min(k, len(plans))
    rewards = mission.evaluate(plans)[list(found), 0]
    assert (np.diff(rewards) <= 0).all()
    front_size = len(front_rows(mission.evaluate(plans)))
    selected = len(front_rows(mission.evaluate([plans[row] for row in found])))
    assert selected == min(k, front_size)
    assert representatives(mission, plans, k) == found
    assert all(type(row) is int for row in found)


@given(fronts(), st.integers(1, 4))
def test_brute_force(front, k):
    mission, plans = front
    assume(not 0 < mission.total_reward < 1e-100)
    objectives = mission.evaluate(plans)
    order = front_rows(objectives).tolist()
    way = [0.0]
    for i, j in pairwise(order):
        step = (objectives[j] - objectives[i]) / [mission.total_reward or 1, mission.robots]
        way.append(way[-1] + math.hypot(*step))
    found = representatives(mission, plans, k)
    for segment in range(k):
        edges = [way[-1] * (segment + side) / k for side in (0, 1)]
        assume(all(abs(w - edge) > 1e-9 for w in way[1:-1] for edge in edges))
        inside = [
            i
            for i, w in zip(order, way, strict=True)
            if edges[0] <= w and (w < edges[1] or segment == k - 1)
        ]
        if inside and way[-1]:
            sums = [sum(plain_distance(plans[i], plans[j]) for j in inside) for i in inside]
            best = [i for i, total in zip(inside, sums, strict=True) if total < min(sums) + 1e-9]
            assert set(best) & set(found)


def test_bad_numbers():
    with pytest.raises(ValueError, match="Expected k >= 1, got 0"):
        representatives(MISSION, PLANS, 0)
