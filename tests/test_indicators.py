"""Areas against staircases summed by hand, distances against moocore, and what is refused."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.indicators import area_indicator, epsilon_indicator, igd_plus_indicator
from botohe_moo.mission import Mission
from botohe_moo.objectives import _TAKEN, Objectives
from botohe_moo.study import SCHEMAS


def quay(*, reward=10):
    """Dock (base) and reef, which alone pays."""
    graph = nx.DiGraph([("dock", "reef"), ("reef", "dock")])
    nx.set_node_attributes(graph, {"dock": 0, "reef": reward}, "reward")
    nx.set_edge_attributes(graph, 0.5, "survival")
    return Mission(graph, base="dock", robots=2)


def staircase(points, mission):
    """The area below the points, step by step from the largest reward to the smallest."""
    below, height = 0.0, 0.0
    for reward, survivors in sorted(points, reverse=True):
        if survivors > height:
            below += reward * (survivors - height)
            height = survivors
    return below / (mission.total_reward * mission.robots)


fronts = st.lists(st.tuples(st.floats(0, 10), st.floats(0, 2)), max_size=12)


class TestByHand:
    """The objective space of the quay is 10 × 2 = 20."""

    def test_area(self):
        for points, below in (
            ([], 0),
            ([(10, 2)], 20),
            ([(0, 2)], 0),
            ([(8, 0.5), (4, 1), (2, 2)], 8 * 0.5 + 4 * 0.5 + 2 * 1),
            ([(8, 0.5), (0, 2)], 4),
        ):
            assert area_indicator(points, quay()) == pytest.approx(below / 20, abs=1e-15)

    def test_of_three_objectives(self):
        stated = Objectives(("E[R]", "E[S]", "least"), (10, 2, 1), ("reward", "survivors", "least"))
        corner, other = (10, 1, 0.5), (5, 2, 0.5)  # which have 5 · 1 · 0.5 in common
        assert area_indicator([corner, other], stated) == pytest.approx((5 + 5 - 2.5) / 20)
        # It lacks half of the reward, none of the robots, and half of the probability.
        assert igd_plus_indicator([other], [(10, 2, 1)], stated) == pytest.approx(math.sqrt(0.5))
        assert epsilon_indicator([other], [(10, 2, 1)], stated) == 0.5
        with pytest.raises(ValueError, match=r"objectives of shape \(n, 3\), got \(1, 2\)"):
            area_indicator([(1, 1)], stated)
        with pytest.raises(ValueError, match=r"E\[S\] <= 2 and least <= 1, got .* in row 0: "):
            area_indicator([(1, 1, 1.1)], stated)

    def test_objectives_that_are_not(self):
        taken = [("ab", (1, 1), ("reward", c)) for c in ("reward", "seed", "least survival", 3)]
        for parts, message in (
            (("a", (1,), "a"), "two objectives or more"),
            (("ab", (1, 2, 3), "ab"), "two objectives or more"),
            (("aa", (1, 1), "ab"), "different names of objectives"),
            (("ab", (1, math.inf), "ab"), "to be a finite number >= 0, got inf"),
            (("ab", (-1, 1), "ab"), "got -1"),
            *((each, rf"columns of objectives .* got {each[2][1]!r}") for each in taken),
        ):
            with pytest.raises(ValueError, match=message):
                Objectives(*map(tuple, parts))

    def test_columns_that_are_taken_are_those_of_tables(self):
        tables = ("fronts", "plans", "references", "bounds")
        others = {column for table in tables for column in SCHEMAS[table]}
        assert {*_TAKEN} == others - {"reward", "survivors"}

    def test_just_above_what_the_mission_has_is_rounding(self):
        assert area_indicator([(10 * (1 + 1e-12), 2 * (1 + 1e-12))], quay()) == 1.0

    def test_a_mission_without_reward_has_none_to_cover(self):
        mission = quay(reward=0)
        for points in ([], mission.evaluate([mission.stay_home()])):
            assert area_indicator(points, mission) == 0.0


class TestProperties:
    @given(fronts, st.tuples(st.floats(0, 10), st.floats(0, 2)))
    def test_it_is_a_staircase_and_another_plan_never_takes_area_away(self, front, point):
        mission = quay()
        before, after = (area_indicator(points, mission) for points in (front, [*front, point]))
        assert before == pytest.approx(staircase(front, mission), rel=0, abs=1e-12)
        assert after >= max(before, point[0] * point[1] / 20) - 1e-15

    def test_safe_missions_give_everything_and_not_a_bit_more(self):
        # Rewards that are summed in another order than the expected reward.
        rng = np.random.default_rng(1)
        graph = nx.cycle_graph(25, create_using=nx.DiGraph)
        nx.set_edge_attributes(graph, 1.0, "survival")
        nx.set_node_attributes(graph, dict(enumerate(10 * rng.random(25))), "reward")
        mission = Mission(graph, base=0, robots=3)
        plan = mission.plan([[*range(25), 0]] * 3)
        area = area_indicator(mission.evaluate([plan]), mission)
        assert 1 - 1e-12 < area <= 1.0


class TestDistancesByHand:
    """At the quay one unit of E[R] is 0.1, one of E[S] 0.5."""

    def test_values(self):
        for points, reference, igd_plus, epsilon in (
            ([(5, 1)], [(8, 1.8)], 0.5, 0.4),
            # What a plan has more than the reference does not make up for what it lacks.
            ([(10, 1)], [(5, 2)], 0.5, 0.5),
            # Means of 0 and 0.5.
            ([(10, 1)], [(10, 1), (5, 2)], 0.25, 0.5),
            # Ahead of all the reference: nothing lacks, and something may be taken away.
            ([(9, 2)], [(5, 1)], 0.0, -0.4),
        ):
            found = [f(points, reference, quay()) for f in (igd_plus_indicator, epsilon_indicator)]
            assert found == pytest.approx([igd_plus, epsilon], abs=1e-15)

    def test_no_plans_are_scored_as_the_one_that_brings_nothing_back(self):
        reference = [(6, 1.6), (2, 2)]
        expected = (1.0 + math.hypot(0.2, 1)) / 2
        assert igd_plus_indicator([], reference, quay()) == pytest.approx(expected)
        assert epsilon_indicator([], reference, quay()) == 1.0
        assert epsilon_indicator([], [(0, 0)], quay()) == 0.0

        for indicator in (igd_plus_indicator, epsilon_indicator):  # survivors alone count
            assert indicator([(0, 1)], [(0, 2)], quay(reward=0)) == 0.5
            assert indicator([], [(0, 2)], quay(reward=0)) == 1.0


BAD_POINTS = [
    ([4, 1], r"Expected {} of shape \(n, 2\), got \(2,\)\."),
    ([(4.0, 1.0), (2.0, np.nan)], "Expected {} without NaN and infinity"),
    ([(-4, -1), (-0.0, -2)], r"give -result\.F\.$"),
    ([(4, 1), (1.0, 2.1)], r"E\[R\] <= 10 and E\[S\] <= 2, .*, 2\.1\] in row 1: .*another mission"),
]


@pytest.mark.parametrize(("points", "message"), BAD_POINTS)
def test_points_that_are_refused(points, message):
    with pytest.raises(ValueError, match=message.format("objectives")):
        area_indicator(points, quay())
    for indicator in (igd_plus_indicator, epsilon_indicator):
        with pytest.raises(ValueError, match=message.format("objectives")):
            indicator(points, [(4, 1)], quay())
        with pytest.raises(ValueError, match=message.format("reference")):
            indicator([(4, 1)], points, quay())
        with pytest.raises(ValueError, match="Expected at least one point in reference"):
            indicator([(4, 1)], [], quay())


some = st.lists(st.tuples(st.floats(0, 10), st.floats(0, 2)), min_size=1, max_size=8)


@given(some, some)
def test_distances_are_their_definitions(points, reference):
    lacks = np.array(reference)[:, None] / [10, 2] - np.array(points) / [10, 2]
    distances = np.hypot(*np.moveaxis(np.maximum(lacks, 0), -1, 0))
    expected = distances.min(axis=1).mean(), lacks.max(axis=2).min(axis=1).max()
    found = [f(points, reference, quay()) for f in (igd_plus_indicator, epsilon_indicator)]
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-15)
