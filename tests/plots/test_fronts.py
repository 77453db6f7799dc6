"""Pictures of fronts, of what plans bring, and of policies."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Event, plots, replan, simulate_policy
from botohe_moo.bounds import bound_front
from botohe_moo.decide import wishes
from botohe_moo.outcomes import reward_distribution, survivors_distribution
from botohe_moo.plots.front import staircase
from tests.plots import made, read
from tests.plots.made import MUSEUM, MUSEUM_PLAN, TOY, TOY_PLANS


def fronts_drawn(ax):
    return [line for line in ax.lines if line.get_zorder() == 3]


def enclosed(corners):
    x, y = np.asarray(corners).T
    return abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


class TestFront:
    @given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=8))
    def test_the_staircase_bounds_the_cells_that_some_plan_reaches(self, points):
        corners = staircase(np.array(points, dtype=float).reshape(-1, 2))
        cells = {(i, j) for a, b in points for i in range(a) for j in range(b)}
        assert enclosed(corners) == len(cells)

    def test_with_a_mission_the_area_is_normalised_and_limits_are_fixed(self):
        # 4 · 1.5 + 4 · 1 = 10 of 10 rewards x 2 robots.
        ax = plots.plot_front([[8, 1], [4, 1.5], [4, 1]], TOY)
        assert read.words(ax) == "area 0.5000, 3 plans"
        assert (ax.get_xlim(), ax.get_ylim()) == ((0, 10), (0, 2))
        assert fronts_drawn(ax)[0].get_xydata().tolist() == [[8, 1], [4, 1.5]]
        assert read.only(ax, "dominated").get_xydata().tolist() == [[4, 1]]
        assert ax.get_legend() is None

    def test_without_a_mission_it_is_plain(self):
        ax = plots.plot_front([[8, 1], [4, 1.5]])
        assert read.words(ax) == "area 10, 2 plans"
        assert ax.get_xlim() == (0, 8.4)
        assert ax.get_ylim() == pytest.approx((0, 1.575))

    def test_fronts_overlay(self):
        ax = plots.plot_front([[8, 1], [4, 1.5]], TOY, label="bo-aco")
        assert plots.plot_front([[5, 1]], TOY, label="random", ax=ax) is ax
        expected = ["bo-aco: area 0.5000, 2 plans", "random: area 0.2500, 1 plan"]
        assert read.legend_texts(ax) == expected
        assert " ".join(read.title(ax).split()) == TOY.title
        assert not read.drawn(ax, "words")
        first, second = fronts_drawn(ax)
        assert first.get_color() != second.get_color()
        assert first.get_marker() != second.get_marker()

    def test_empty_ones(self):
        ax = plots.plot_front(np.empty((0, 2)), TOY)
        assert (read.words(ax), ax.get_xlim()) == ("area 0.0000, 0 plans", (0, 10))
        bare = plots.plot_front([], label="none")
        assert (read.legend_texts(bare), bare.get_xlim()) == (["none: area 0, 0 plans"], (0, 1))

    def test_highlighted_plans_are_ringed_and_named(self):
        ax = plots.plot_front([[8, 1], [4, 1.5], [2, 1.7]], highlight=[2, 0])
        rings = [ring.get_xydata().tolist() for ring in read.drawn(ax, "highlight")]
        assert rings == [[[2, 1.7]], [[8, 1]]]
        assert read.plan_names(ax) == ["plan 2", "plan 0"]
        assert read.plan_names(plots.plot_front([[8, 1]], highlight=0)) == ["plan 0"]
        named = plots.plot_front([[8, 1], [4, 2]], highlight={1: "knee $<>$"})
        assert read.plan_names(named) == ["plan 1: knee $<>$"]

    def test_what_a_bound_leaves_open_is_shaded_and_told(self):
        bound = bound_front(TOY)
        front = [[7, 1], [4, 1.5], [3, 1]]  # an area of 9 of 10 rewards x 2 robots
        ax = plots.plot_front(front, TOY, bound=bound)
        more = 100 * (bound.area / 0.45 - 1)
        assert read.legend_texts(ax) == [f"open: at most {more:.2f} % more area"]
        assert read.words(ax) == "area 0.4500, 3 plans"
        assert enclosed(read.only(ax, "area").get_xy()) == pytest.approx(9)
        (opened,) = [patch for patch in ax.patches if "open" in patch.get_label()]
        assert enclosed(opened.get_xy()) == pytest.approx(20 * bound.area - 9)
        assert read.only(ax, "bound").get_xydata().tolist() == staircase(bound.points)[:-1].tolist()
        with pytest.raises(ValueError, match="a bound of the mission"):
            plots.plot_front(front, TOY.with_robots(3), bound=bound)

    def test_what_is_refused(self):
        with pytest.raises(ValueError, match=r"NaN and infinity, got \[nan, 1.0\] in row 1"):
            plots.plot_front([[1, 1], [np.nan, 1]])
        with pytest.raises(ValueError, match=r"Expected highlight in \[0, 0\], got 1"):
            plots.plot_front([[1, 1]], highlight=1)


def test_choices_are_numbered_and_have_maps():
    ax = plots.plot_choices(TOY, TOY_PLANS, k=2)
    assert read.plan_names(ax) == ["plan 3: largest product", "plan 0"]
    expected = TOY.evaluate(TOY_PLANS)
    names = [int(name.split()[1].rstrip(":")) for name in read.plan_names(ax)]
    for row, own in zip(names, read.maps_of(ax)[1:], strict=True):
        assert read.arcs_drawn(TOY, own) == read.arcs_of(*TOY_PLANS[row].trails)
        reward, survivors = expected[row]
        name = f"plan {row}: E[R] = {reward:.2f}, E[S] = {survivors:.2f}; staying at 1: "
        assert read.map_name(own).startswith(name)
    assert read.words(ax).endswith("numbered: the knee, and 2 representatives")


def test_the_old_plan_and_the_new():
    found = replan(TOY, TOY_PLANS[2], [Event("reached", 0, 4)], price=2)
    old, new, *_ = plots.plot_replan(found).figure.axes
    names = [read.map_name(ax).partition(":")[0] for ax in (old, new)]
    assert names == ["what is left of the plan", "the new plan"]
    assert "staying at 1: R1" in read.map_name(old)
    assert old.get_xlim() == new.get_xlim()


def test_a_plan_in_each_scenario():
    plan, scenarios = TOY_PLANS[2], made.STORMY.scenarios
    ax = plots.plot_scenarios(made.STORMY, plan)
    drawn = dict(zip(scenarios, read.maps_of(ax), strict=True))
    for scenario, own in drawn.items():
        one = made.STORMY.in_scenario(scenario.name)
        reward, survivors = one.evaluate([plan])[0]
        said = f"E[R] = {reward:.2f}, E[S] = {survivors:.2f}"
        name = f"{scenario.name}, {scenario.probability:g}: {said}"
        assert read.map_name(own).startswith(name)
        assert read.arcs_drawn(TOY, own) == read.arcs_of(*plan.trails)
    many = TOY.with_scenarios([f"number {i}={1 + (i > 1)}e-2" for i in range(30)])
    ax = plots.plot_scenarios(many, plan)
    assert len(read.maps_of(ax)) == 24
    assert "the 24 most probable of 31 scenarios" in read.words(ax)
    with pytest.raises(ValueError, match="Expected a mission with scenarios, got <Mission 'toy'"):
        plots.plot_scenarios(TOY, plan)


class TestOutcomes:
    PLANS = (MUSEUM_PLAN, MUSEUM.plan([[1, 2, 1], [1], [1]]))

    def test_curves_and_bars_are_the_distributions(self):
        left, right = plots.plot_outcomes(MUSEUM, *self.PLANS, names=["bold", "shy"])
        curves = [line for line in left.lines if line.get_marker() == "None"]
        means = [[line for line in ax.lines if line.get_marker() in "o^"] for ax in (left, right)]
        for i, (plan, curve, bars) in enumerate(
            zip(self.PLANS, curves, right.containers, strict=True)
        ):
            reward, survivors = (
                f(MUSEUM, plan) for f in (reward_distribution, survivors_distribution)
            )
            # From each value on, what is left is the probability of more.
            x, y = curve.get_data()
            assert curve.get_drawstyle() == "steps-post"
            assert x[1:].tolist() == reward.values.tolist()
            assert (y[0], *y[1:]) == pytest.approx((1, *reward.at_least(x[1:] + 1e-6)), abs=1e-12)
            heights = {round(bar.get_x() + bar.get_width() / 2): bar.get_height() for bar in bars}
            for number, probability in zip(survivors.values, survivors.probabilities, strict=True):
                assert heights[number] == pytest.approx(probability)
            marks = [mark[i].get_xydata()[0].tolist() for mark in means]
            expected = MUSEUM.evaluate([plan])[0]
            assert marks[0] == pytest.approx([expected[0], reward.at_least(reward.mean)])
            assert marks[1] == pytest.approx([expected[1], 0])
            said = f"E[R] = {expected[0]:.2f}, E[S] = {expected[1]:.2f}"
            assert read.legend_texts(left)[i] == f"{['bold', 'shy'][i]}: {said}"
        assert left.get_xlim() == (0, MUSEUM.total_reward)

    def test_simulated_rewards_are_told(self, monkeypatch):
        monkeypatch.setattr(wishes, "MAX_OUTCOMES", 1)
        monkeypatch.setattr(wishes, "N_SAMPLES", 500)
        left, _ = plots.plot_outcomes(MUSEUM, MUSEUM_PLAN)
        (entry,) = read.legend_texts(left)
        assert entry.endswith("; R from 500 simulated missions")

    def test_what_is_refused(self):
        for mission, plans, names, fault in (
            (None, TOY_PLANS[:1], None, "Expected a Mission, got None"),
            (TOY, [TOY_PLANS[0], "x"], None, "Plan 1: expected a TrailPlan, got 'x'"),
            (TOY, [], None, "Expected at least one plan, got none"),
            (TOY, TOY_PLANS[:2], ["a", "a"], "Expected 2 different names, one a plan, got"),
        ):
            with pytest.raises((TypeError, ValueError), match=fault):
                plots.plot_outcomes(mission, *plans, names=names)


def test_policies_are_clouds_and_means():
    outcomes = simulate_policy(TOY, TOY_PLANS[2], "losses", price=2, missions=30)
    ax = plots.plot_policies(outcomes, TOY.evaluate(TOY_PLANS))
    clouds = [np.asarray(cloud.get_offsets()) for cloud in ax.collections if cloud.get_alpha()]
    groups = outcomes.played.groupby("policy", sort=False)
    for cloud, (_, played) in zip(clouds, groups, strict=True):
        assert cloud[:, 0].tolist() == played["reward"].tolist()
        assert abs(cloud[:, 1] - played["survivors"]).max() < 0.36
    gain, error = outcomes.table.loc[1, ["gain", "gain_se"]]
    assert read.legend_texts(ax) == ["front", "static", f"losses: {gain:+.2f} ± {error:.2f}"]
    means = [bars.lines[0].get_xydata()[0].tolist() for bars in ax.containers]
    assert means == outcomes.table[["reward", "survivors"]].to_numpy().tolist()
    assert "one more survivor costs 2 reward; 30 missions" in read.words(ax)
