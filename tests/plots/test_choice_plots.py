"""What the pictures show that plans are compared and chosen by."""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given

from botohe_moo import Event, replan, simulate_policy
from botohe_moo.decide import knees, representatives, wishes
from botohe_moo.outcomes import reward_distribution, survivors_distribution
from botohe_moo.plots import (
    plot_choices,
    plot_outcomes,
    plot_policies,
    plot_replan,
)
from tests.examples import examples
from tests.plots.test_plan_plots import arcs_drawn, arcs_of, map_name, maps_of
from tests.plots.test_plots import (
    MUSEUM_TRAILS,
    legend_texts,
    load,
    plan_names,
    title,
    words,
)
from tests.strategies import missions_with_plans

TOY_TRAILS = ([1], [1, 2, 1], [1, 2, 4, 2, 1], [1, 3, 2, 4, 2, 3, 1])


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    yield
    plt.close("all")


def toy_plans():
    """Plans of the toy of which the second and the fourth robot trail are not dominated."""
    mission = load("toy")
    return mission, [mission.plan([trail, [1]]) for trail in TOY_TRAILS]


def means_drawn(ax):
    marks = [line for line in ax.lines if line.get_marker() in ("o", "^")]
    return [mark.get_xydata()[0].tolist() for mark in marks]


def curves_drawn(ax):
    return [line for line in ax.lines if line.get_marker() == "None"]


class TestOutcomes:
    def test_curves_and_bars_are_the_distributions(self):
        mission = load("art_museum")
        plans = [mission.plan(MUSEUM_TRAILS), mission.plan([[1, 2, 1], [1], [1]])]
        left, right = plot_outcomes(mission, *plans)
        curves = curves_drawn(left)
        for plan, curve, bars in zip(plans, curves, right.containers, strict=True):
            reward = reward_distribution(mission, plan)
            # From each value on, what is left is the probability of more.
            x, y = curve.get_data()
            assert curve.get_drawstyle() == "steps-post"
            for value, more in zip(x[1:], y[1:], strict=True):
                assert more == pytest.approx(reward.at_least(value + 1e-6), abs=1e-12)
            assert x[1:].tolist() == reward.values.tolist()
            assert y[0] == 1
            survivors = survivors_distribution(mission, plan)
            middles = [round(bar.get_x() + bar.get_width() / 2) for bar in bars]
            heights = dict(zip(middles, [bar.get_height() for bar in bars], strict=True))
            for number, probability in zip(survivors.values, survivors.probabilities, strict=True):
                assert heights[number] == pytest.approx(probability)
        assert left.get_xlim() == (0, mission.total_reward)

    def test_expectations_are_marked_and_told(self):
        mission = load("art_museum")
        plans = [mission.plan(MUSEUM_TRAILS), mission.plan([[1, 2, 1], [1], [1]])]
        expected = mission.evaluate(plans)
        left, right = plot_outcomes(mission, *plans, names=["bold", "shy $<>$"], title="Two")
        assert [x for x, _ in means_drawn(left)] == pytest.approx(expected[:, 0])
        assert [x for x, _ in means_drawn(right)] == pytest.approx(expected[:, 1])
        for plan, (x, y) in zip(plans, means_drawn(left), strict=True):
            assert y == pytest.approx(reward_distribution(mission, plan).at_least(x))
        assert legend_texts(left) == [
            f"{name}: E[R] = {reward:.2f}, E[S] = {survivors:.2f}"
            for name, (reward, survivors) in zip(["bold", "shy $<>$"], expected, strict=True)
        ]
        assert title(left) == "Two"

    def test_simulated_rewards_are_told(self, monkeypatch):
        mission = load("art_museum")
        monkeypatch.setattr(wishes, "MAX_OUTCOMES", 1)
        monkeypatch.setattr(wishes, "N_SAMPLES", 500)
        left, _ = plot_outcomes(mission, mission.plan(MUSEUM_TRAILS))
        (entry,) = legend_texts(left)
        assert entry.endswith("; R from 500 simulated missions")

    @examples(10)
    @given(missions_with_plans())
    def test_any_plan_is_drawn(self, case):
        mission, plan = case
        left, right = plot_outcomes(mission, plan)
        (expected,) = mission.evaluate([plan])
        assert [means_drawn(ax)[0][0] for ax in (left, right)] == pytest.approx(expected)
        plt.close("all")

    def test_wrong_arguments_are_named(self):
        mission, plans = toy_plans()
        with pytest.raises(TypeError, match="Expected a Mission, got None"):
            plot_outcomes(None, plans[0])
        with pytest.raises(TypeError, match="Plan 1: expected a TrailPlan, got 'x'"):
            plot_outcomes(mission, plans[0], "x")
        with pytest.raises(ValueError, match="Expected at least one plan, got none"):
            plot_outcomes(mission)
        with pytest.raises(ValueError, match="Expected 2 different names, one a plan, got"):
            plot_outcomes(mission, *plans[:2], names=["a", "a"])


class TestChoices:
    def test_knee_and_representatives_are_numbered_and_have_maps(self):
        mission, plans = toy_plans()
        ax = plot_choices(mission, plans, k=2)
        marks = knees(mission, plans)
        rows = {*representatives(mission, plans, 2), *(mark.index for mark in marks)}
        expected = mission.evaluate(plans)
        order = sorted(rows, key=lambda row: -expected[row, 0])
        names = {row: [m.name for m in marks if m.index == row] for row in order}
        said = {row: f": {', '.join(found)}" if found else "" for row, found in names.items()}
        assert plan_names(ax) == [f"plan {row}{of_row}" for row, of_row in said.items()]
        _, *maps = maps_of(ax)
        for row, own in zip(order, maps, strict=True):
            assert arcs_drawn(mission, own) == arcs_of(*plans[row].trails)
            reward, survivors = expected[row]
            assert map_name(own).startswith(f"plan {row}")
            assert f": E[R] = {reward:.2f}, E[S] = {survivors:.2f}; " in map_name(own)
            assert "staying at 1: " in map_name(own)
        assert words(ax).endswith("numbered: the knee, and 2 representatives")


class TestUnderWay:
    def test_clouds_and_means(self):
        mission, plans = toy_plans()
        outcomes = simulate_policy(mission, plans[2], "losses", price=2, missions=30)
        front = mission.evaluate(plans)
        ax = plot_policies(outcomes, front)
        clouds = [np.asarray(cloud.get_offsets()) for cloud in ax.collections if cloud.get_alpha()]
        for cloud, (_, played) in zip(
            clouds, outcomes.played.groupby("policy", sort=False), strict=True
        ):
            assert cloud[:, 0].tolist() == played["reward"].tolist()
            assert abs(cloud[:, 1] - played["survivors"]).max() < 0.36
        gain, error = outcomes.table.loc[1, ["gain", "gain_se"]]
        assert legend_texts(ax) == ["front", "static", f"losses: {gain:+.2f} ± {error:.2f}"]
        assert "one more survivor costs 2 reward; 30 missions" in words(ax)

    def test_the_old_plan_and_the_new(self):
        mission, plans = toy_plans()
        found = replan(mission, plans[2], [Event("reached", 0, 4)], price=2)
        old, new, *_ = plot_replan(found).figure.axes
        assert [map_name(ax).partition(":")[0] for ax in (old, new)] == [
            "what is left of the plan",
            "the new plan",
        ]
        assert "staying at 1: R1" in map_name(old)
        assert old.get_xlim() == new.get_xlim()
        assert not old.axison
