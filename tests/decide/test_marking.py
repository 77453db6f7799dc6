"""Knees, neighbours and exchange rates, on fronts drawn by hand."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.decide import ExchangeRate, Neighbours, Step, exchange_rate, knees, neighbours
from botohe_moo.decide.tradeoffs import front_table

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
    def test_both_marks(self):
        chord, product = knees(TOY, BENT)
        assert (chord.index, product.index) == (1, 1)
        assert (chord.reward, chord.survivors) == (7, 1)
        assert chord.name == "farthest from the chord"
        assert "chord between the end points" in chord.definition
        assert "expected reward and expected survivors" in product.definition
        assert str(product).startswith("plan 1 (reward 7, survivors 1): largest product")

    def test_they_may_be_different_plans(self):
        # Divided: (1, 0), (0.6, 0.5), (0, 0.8); 1 - x - y / 0.8: -0.225 beyond the chord. With
        # (0.9, 0.2), beyond by 0.15, and a product of 0.18 below 0.3, nothing changes. A steeper
        # front: (1, 0.5), (0.95, 0.7), (0, 1): chord x + 2 y = 2, exceeded by 0.35; products 0.5,
        # 0.665. With (0.8, 0.74), exceeded by 0.28: its product is 0.592.
        assert [m.index for m in knees(TOY, [[10, 1], [9.5, 1.4], [8, 1.48], [0, 2]])] == [1, 1]
        # (1, 0.6), (0.55, 0.95), (0, 1): chord x 0.4 + y = 1, exceeded by 0, 0.17, 0; products 0.6,
        # 0.5225, 0.
        assert [m.index for m in knees(TOY, [[10, 1.2], [5.5, 1.9], [0, 2]])] == [1, 0]

    def test_of_equal_plans_the_first(self):
        assert [m.index for m in knees(TOY, [*BENT, [7, 1]])] == [1, 1]

    def test_where_nothing_bends_only_the_product_is_marked(self):
        # One plan, one twice, two plans, and a straight front.
        for front in ([[3, 1]], [[3, 1]] * 2, [[3, 1], [1, 2]], [[8, 0.4], [4, 1.2], [0, 2]]):
            [mark] = knees(TOY, front)
            assert mark.name == "largest product"
            assert mark.index == int(np.prod(front, axis=1).argmax())

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

    @pytest.mark.parametrize(
        ("given", "fault"),
        [
            ([], "Expected at least one plan, got none"),
            ([[1, 2, 3]], r"objectives of shape \(n, 2\), got \(1, 3\)"),
            ([[1, np.nan]], r"objectives without NaN and infinity, got \[1\.0, nan\] in row 0"),
        ],
    )
    def test_bad_objectives(self, given, fault):
        for ask in (knees, lambda *g: neighbours(*g, 0), lambda *g: exchange_rate(*g, 0)):
            with pytest.raises(ValueError, match=fault):
                ask(TOY, given)


class TestNeighbours:
    def test_on_the_front(self):
        found = neighbours(TOY, BENT, 1)
        assert found == Neighbours(richer=Step(0, 1, -1), safer=Step(2, -3, pytest.approx(0.4)))
        assert str(found) == (
            "Beside it on the front, plan 0 has 1 more reward for 1 fewer survivors; "
            "plan 2 has 0.4 more survivors for 3 less reward."
        )

    def test_at_the_ends(self):
        assert neighbours(TOY, BENT, 0) == Neighbours(richer=None, safer=Step(1, -1, 1))
        assert neighbours(TOY, BENT, 3).safer is None
        assert neighbours(TOY, [[3, 1], [3, 1]], 1) == Neighbours(None, None)

    @given(points, st.data())
    def test_brute_force(self, front, data):
        i = data.draw(st.integers(0, len(front) - 1))
        found = neighbours(TOY, front, i)
        reward, survivors = front[i]
        efficient = [
            (r, s)
            for r, s in front
            if not any(a >= r and b >= s and (a, b) != (r, s) for a, b in front)
        ]
        richer = min((r for r, _ in efficient if r > reward), default=None)
        safer = min((s for _, s in efficient if s > survivors), default=None)
        assert (found.richer and front[found.richer.index][0]) == richer
        assert (found.safer and front[found.safer.index][1]) == safer

    def test_bad_rows(self):
        for index in (-1, 4):
            with pytest.raises(ValueError, match="Expected index"):
                neighbours(TOY, BENT, index)
            with pytest.raises(ValueError, match="Expected index"):
                exchange_rate(TOY, BENT, index)


FRONT = [[9, 0], [8, 0.2], [7, 0.3], [5, 0.9], [4, 1], [0, 2]]


class TestExchangeRate:
    def test_the_farthest_within_the_window(self):
        found = exchange_rate(TOY, FRONT, 1, window=0.25)
        assert (found.safer.index, found.richer.index) == (2, 0)
        found = exchange_rate(TOY, FRONT, 1, window=0.75)
        assert found.safer == Step(3, -3, pytest.approx(0.7))
        assert found.safer.rate == pytest.approx(3 / 7)
        assert found.richer.rate == pytest.approx(0.5)
        assert str(found) == (
            "At plan 1, within 0.75 survivors: "
            "0.1 survivors more cost 0.4286 reward (to plan 3, 0.7 survivors away); "
            "0.1 survivors fewer bring 0.5 reward (to plan 0, 0.2 survivors away)."
        )

    def test_the_nearest_where_the_window_holds_none(self):
        found = exchange_rate(TOY, FRONT, 3, window=0.05)
        assert (found.safer.index, found.richer.index) == (4, 2)
        assert found.window == 0.05

    def test_at_the_ends(self):
        assert exchange_rate(TOY, FRONT, 0).richer is None
        assert exchange_rate(TOY, FRONT, 5).safer is None
        found = exchange_rate(TOY, [[3, 1]], 0)
        assert found == ExchangeRate(0, 0.25, None, None)
        assert str(found) == "No plan of the front trades reward for survivors with plan 0."

    def test_a_dominated_plan_is_compared_with_those_that_trade(self):
        # (7, 1) has more of both than (6, 0.5); (4, 1.4) and (8, 0) have more of one only.
        found = exchange_rate(TOY, [*BENT, [6, 0.5]], 4, window=1)
        assert (found.safer, found.richer) == (Step(2, -2, pytest.approx(0.9)), Step(0, 2, -0.5))
        assert found.safer.rate > 0
        assert found.richer.rate > 0
        assert exchange_rate(TOY, [[7, 1], [6, 0.5]], 1) == ExchangeRate(1, 0.25, None, None)

    def test_bad_windows(self):
        with pytest.raises(ValueError, match=r"^Expected window > 0"):
            exchange_rate(TOY, FRONT, 0, window=0)

    @given(points, st.data(), st.floats(0.01, 2))
    def test_brute_force(self, front, data, window):
        i = data.draw(st.integers(0, len(front) - 1))
        efficient = [
            k
            for k, (r, s) in enumerate(front)
            if not any(a >= r and b >= s and (a, b) != (r, s) for a, b in front)
        ]
        assume(i in efficient)
        found = exchange_rate(TOY, front, i, window=window)
        for step, side in ((found.safer, 1), (found.richer, -1)):
            away = [(front[k][1] - front[i][1]) * side for k in efficient]
            away = sorted(distance for distance in away if distance > 0)
            if not away:
                assert step is None
                continue
            within = [distance for distance in away if distance <= window]
            assert abs(step.survivors) == (within[-1] if within else away[0])
            assert step.rate > 0


def test_pymoos_negatives_are_refused():
    expected = r"^Expected objectives of at least 0, got \[-7\.0, -1\.0\] in row 1; .* -result\.F"
    for function in (knees, lambda *given: neighbours(*given, 0), lambda *g: exchange_rate(*g, 0)):
        with pytest.raises(ValueError, match=expected):
            function(TOY, np.array([[0.0, 2.0], [-7.0, -1.0]]))


def test_plans_in_any_container():
    plans = [TOY.plan([trail, [1]]) for trail in ([1], [1, 2, 1], [1, 2, 4, 2, 1])]
    batch = TOY.batch(plans)
    expected = knees(TOY, TOY.evaluate(plans))
    for front in (plans, iter(plans), batch, batch.to_array(), batch.to_array()[:, 0]):
        assert knees(TOY, front) == expected


def test_what_a_survivor_costs_is_not_told_of_plans_that_are_equally_safe():
    table = front_table(TOY, np.array([[8.0, 0.0], [7.0, 1.0], [7.0, 1.0]]), (0, 1, 2))
    costs = [line.split()[3:4] for line in table.splitlines()[1:]]
    assert costs == [["1"], ["-"], []]
