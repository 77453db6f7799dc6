"""Fronts drawn by hand: knees, neighbours, the price of a survivor, and representatives."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import TrailPlan, load_mission
from botohe_moo.decide import TradeOff, knees, neighbours, representatives, survivor_price
from botohe_moo.decide.fronts import arc_counts, distances, front_rows, front_table
from botohe_moo.trails import PlanBatch
from tests.decide.made import MISSION, NAMES, PLANS
from tests.decide.test_choosing import fronts

TOY = load_mission("toy")  # a total reward of 10, and 2 robots

# Divided by 10 and 2: (0.8, 0), (0.7, 0.5), (0.4, 0.7), (0, 1). The chord from (0.8, 0) to (0, 1)
# is x / 0.8 + y = 1, which the four exceed by 0, 0.375, 0.2 and 0; products are 0, .35, .28, 0.
BENT = [[8, 0], [7, 1], [4, 1.4], [0, 2]]

points = st.lists(
    st.tuples(st.integers(0, 10), st.integers(0, 8)).map(lambda p: (p[0], p[1] / 4)),
    min_size=1,
    max_size=9,
)


class TestKnees:
    def test_by_hand(self):
        chord, product = knees(TOY, BENT)
        assert (chord.index, chord.reward, chord.survivors, product.index) == (1, 7, 1, 1)
        assert chord.name == "farthest from the chord"
        assert "chord between the end points" in chord.definition
        assert str(product).startswith("plan 1 (reward 7, survivors 1): largest product")
        # (1, 0.6), (0.55, 0.95), (0, 1): chord x 0.4 + y = 1, exceeded by 0, 0.17, 0; products 0.6,
        # 0.5225, 0.
        assert [m.index for m in knees(TOY, [[10, 1.2], [5.5, 1.9], [0, 2]])] == [1, 0]
        assert [m.index for m in knees(TOY, [*BENT, [7, 1]])] == [1, 1]  # of equal ones the first
        # One plan, one twice, two plans, and a straight front: nothing bends.
        for front in ([[3, 1]], [[3, 1]] * 2, [[3, 1], [1, 2]], [[8, 0.4], [4, 1.2], [0, 2]]):
            assert [mark.name for mark in knees(TOY, front)] == ["largest product"]

    @given(points)
    def test_brute_force(self, front):
        marks = {mark.name: mark.index for mark in knees(TOY, front)}
        x, y = (np.array(front) / [10, 2]).T
        right = max(range(len(x)), key=lambda i: (x[i], y[i]))
        left = max(range(len(x)), key=lambda i: (y[i], x[i]))
        width, height = x[right] - x[left], y[left] - y[right]
        above = width * (y - y[right]) + height * (x - x[right])
        assert x[marks["largest product"]] * y[marks["largest product"]] == (x * y).max()
        if "farthest from the chord" in marks:
            assert above[marks["farthest from the chord"]] == pytest.approx(above.max())
        else:
            assert above.max() <= 1e-12


class TestNeighbours:
    def test_by_hand(self):
        found = neighbours(TOY, BENT, 1)
        assert found == (TradeOff(0, 1, -1), TradeOff(2, -3, pytest.approx(0.4)))
        assert [*map(str, found)] == [
            "plan 0 has 1 more reward for 1 fewer survivors",
            "plan 2 has 0.4 more survivors for 3 less reward",
        ]
        assert neighbours(TOY, BENT, 0) == (TradeOff(1, -1, 1),)
        assert neighbours(TOY, [[3, 1], [3, 1]], 1) == ()

    @given(points, st.data())
    def test_brute_force(self, front, data):
        i = data.draw(st.integers(0, len(front) - 1))
        found = neighbours(TOY, front, i)
        reward, survivors = front[i]
        at_least = [{(a, b) for a, b in front if a >= r and b >= s} for r, s in front]
        efficient = [
            point for point, others in zip(front, at_least, strict=True) if len(others) == 1
        ]
        richer = min((r for r, _ in efficient if r > reward), default=None)
        safer = min((s for _, s in efficient if s > survivors), default=None)
        expected = {r for r, s in efficient if r == richer or s == safer}
        assert {front[beside.index][0] for beside in found} == expected


class TestPrice:
    def test_by_hand(self):
        # The hull has the edges 1 reward for 1 survivor and 7 for 1; the third plan is below it.
        assert [survivor_price(TOY, BENT, i) for i in range(4)] == pytest.approx([1, 4, 7, 7])
        # No plan trades:
        assert survivor_price(TOY, [[3, 1]], 0) == 0
        assert survivor_price(TOY, [[3, 1], [2, 1], [3, 0.5]], 1) == 0

    @given(points, st.data())
    def test_brute_force(self, front, data):
        """The plan is no worse than any other at its price, if it is on the hull."""
        i = data.draw(st.integers(0, len(front) - 1))
        price = survivor_price(TOY, front, i)
        assert price >= 0
        (reward, survivors), others = front[i], np.array(front)
        on_hull = not any(
            a < survivors < b and r + (s - r) * (survivors - a) / (b - a) > reward + 1e-9
            for r, a in front
            for s, b in front
        )
        is_dominated = any(r >= reward and s >= survivors and (r, s) != front[i] for r, s in front)
        if on_hull and not is_dominated and survivors < others[:, 1].max():
            worths = others @ [1, price]
            assert reward + price * survivors >= worths.max() - 1e-9


def test_what_is_refused():
    for front, fault in (
        ([], "Expected at least one plan, got none"),
        ([[1, 2, 3]], r"objectives of shape \(n, 2\), got \(1, 3\)"),
        ([[1, np.nan]], r"objectives without NaN and infinity, got \[1\.0, nan\] in row 0"),
        ([[0, 2], [-7, -1]], r"least 0, got \[-7\.0, -1\.0\] in row 1; .* -result\.F"),
    ):
        given = np.array(front, float) if front else front
        for ask in (knees, neighbours, survivor_price):
            with pytest.raises(ValueError, match=fault):
                ask(TOY, given, *([] if ask is knees else [0]))
    for ask in (neighbours, survivor_price):
        for index in (-1, 4):
            with pytest.raises(ValueError, match="Expected index"):
                ask(TOY, BENT, index)
    with pytest.raises(ValueError, match="Expected k >= 1, got 0"):
        representatives(MISSION, PLANS, 0)


def test_plans_in_any_container():
    plans = [TOY.plan([trail, [1]]) for trail in ([1], [1, 2, 1], [1, 2, 4, 2, 1])]
    batch = TOY.batch(plans)
    expected = knees(TOY, TOY.evaluate(plans))
    for front in (plans, iter(plans), batch, batch.to_array(), batch.to_array()[:, 0]):
        assert knees(TOY, front) == expected


def test_the_table_tells_the_price():
    """Each row has the number that `survivor_price` gives, so that users see one number."""
    table, n_rows = front_table(TOY, [], np.array([*BENT, [4, 1.4]], float))
    rows = [line.split() for line in table.splitlines()[1:]]
    assert n_rows == 5
    assert [row[3] for row in rows] == ["1", "4", "7", "7", "7"]
    assert [row[4:] for row in rows] == [[], ["knee"], [], [], []]


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


def test_representatives_by_hand():
    assert {k: representatives(MISSION, FOUR, k) for k in range(1, 6)} == {
        1: (1,),  # the sums are 2.33, 1.83, 1.83 and 2: AC and BC, of which AC is first
        2: (2, 3),  # AB AC | BC C; of two the first
        3: (2, 3, 0),  # AB AC | BC | C
        4: (2, 3, 0),  # AB AC | - | BC | C: a part without a plan has none
        5: (2, 1, 3, 0),
    }
    # Dominated plans represent nothing: AA has the reward of AC and fewer survivors, and BB has
    # less of both than BC.
    for k, names in ((3, "AB BC C"), (9, "AB AC BC C")):
        assert [NAMES[row] for row in representatives(MISSION, PLANS, k)] == names.split()


@given(fronts(), st.integers(1, 4))
def test_representatives_by_brute_force(front, k):
    mission, plans = front
    assume(not 0 < mission.total_reward < 1e-100)
    objectives = mission.evaluate(plans)
    order = front_rows(objectives).tolist()
    way = [0.0]
    for i, j in pairwise(order):
        step = (objectives[j] - objectives[i]) / [mission.total_reward or 1, mission.robots]
        way.append(way[-1] + math.hypot(*step))
    found = representatives(mission, plans, k)
    assert (np.diff(objectives[list(found), 0]) < 0).all()
    assert 1 <= len(found) <= k
    assert set(found) <= set(order)
    for segment in range(k):
        edges = [way[-1] * (segment + side) / k for side in (0, 1)]
        assume(all(abs(w - edge) > 1e-9 for w in way[1:-1] for edge in edges))
        on_way = [i for i, w in zip(order, way, strict=True) if edges[0] <= w < edges[1]]
        inside = on_way + order[-1:] * (segment == k - 1)
        if inside and way[-1]:
            sums = [sum(plain_distance(plans[i], plans[j]) for j in inside) for i in inside]
            best = [i for i, total in zip(inside, sums, strict=True) if total < min(sums) + 1e-9]
            assert set(best) & set(found)
