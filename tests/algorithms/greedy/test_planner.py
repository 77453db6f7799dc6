"""Robot by robot: the guarantee of the method, its corners, and the algorithm of pymoo's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Greedy, TrailPlan, area_indicator, load_mission
from botohe_moo.algorithms.greedy.planner import (
    MAX_BEAM_WIDTH,
    SequentialPlanner,
    plan_sequentially,
)
from tests.examples import examples
from tests.strategies import mission_of, missions, small_missions
from tests.twins import all_objectives, worth

WIDE = MAX_BEAM_WIDTH  # cuts nothing
MUSEUM = load_mission("art_museum")


@examples(150)
@given(small_missions(), st.sampled_from([0.0, 0.1, 0.35, 0.6, 0.9, 0.99, 1.0]))
def test_at_least_the_share_that_submodularity_promises(case, weight):
    mission, trails = case
    n_robots = mission.robots
    plan = plan_sequentially(mission, weight, beam_width=WIDE)
    found = worth(mission, mission.evaluate([plan]), weight)[0]
    best = worth(mission, all_objectives(mission, trails), weight).max()
    promised = 1 - (1 - 1 / n_robots) ** n_robots
    assert promised * best - 1e-9 <= found <= best + 1e-9


def test_robots_share_the_work():
    """Two spurs: 4 behind survival 0.9, 3 behind 0.8, each way; counted by hand."""
    mission = mission_of([(0, 1, 0.9), (0, 2, 0.8)], [1, 4, 3], both_ways=True, robots=3)
    # With 0.5, survival weighs 1/6 a robot, reward 1/16 a unit. Going to 1, then to 2 and home
    # collects 3.6 + 1.944 and survives with 0.5184: 0.433, against 0.36 for 1 only and
    # 0.257 for 2 only. That leaves 0.4 at 1 and 1.056 at 2, for which nobody goes out.
    assert plan_sequentially(mission, 0.5).trails == ((0, 1, 0, 2, 0), (0,), (0,))
    # With 0.6 (0.1333 and 0.075) the next robot gathers what is left, where more is left
    # first: 0.8448 + 0.2304, surviving with 0.5184: 0.1498, against 0.1474 in the other order,
    # 0.1487 for 2 only and 0.1333 at base. For the third 0.0424 of 4 and 0.0704 of 3 are left.
    planned = ((0, 1, 0, 2, 0), (0, 2, 0, 1, 0), (0,))
    assert plan_sequentially(mission, 0.6).trails == planned
    assert plan_sequentially(mission, 0.1).trails == ((0,),) * 3


@examples(60)
@given(missions(min_nodes=1))
def test_weight_0_puts_nobody_in_danger(mission):
    plan = plan_sequentially(mission, 0.0, beam_width=20)
    assert mission.evaluate([plan])[0, 1] == mission.robots


@examples(60)
@given(small_missions(max_robots=1, max_trails=1000))
def test_weight_0_takes_what_is_free_and_weight_1_ignores_danger(case):
    mission, trails = case
    every = all_objectives(mission, trails)
    for weight, possible in ((0.0, every[every[:, 1] == 1.0]), (1.0, every)):
        reward, _ = mission.evaluate([plan_sequentially(mission, weight, beam_width=WIDE)])[0]
        assert reward == pytest.approx(possible[:, 0].max(), rel=1e-9)


@pytest.mark.parametrize(("longest", "least", "most"), [(None, 13, 99), (12, 12, 12), (1, 0, 0)])
def test_a_budget_that_binds(longest, least, most):
    plan = plan_sequentially(MUSEUM, 1.0, max_length=longest, beam_width=30)
    lengths = MUSEUM.trail_lengths([plan])  # every hop is 1 long
    assert ((lengths >= least) & (lengths <= most)).all()


def test_a_base_worth_more_than_all_else():
    mission = mission_of([(0, 1, 0.9), (1, 2, 0.9)], [1e15, 1, 1], both_ways=True, robots=2)
    assert plan_sequentially(mission, 1.0).trails == ((0, 1, 2, 1, 0),) * 2


def test_plans_with_the_last_robots_at_base():
    museum = load_mission("art_museum", robots=4)
    base = (museum.index(museum.base),)
    planner = SequentialPlanner(museum, beam_width=30)
    team = planner.plan(0.8)
    away = [trail for trail in team.trails if trail != base]
    assert len(away) >= 2
    plans = planner.plans(0.8)
    assert plans[0] == team
    expected = [(*away[:n], *[base] * (4 - n)) for n in range(len(away), 0, -1)]
    assert [plan.trails for plan in plans] == expected
    assert planner.plans(0.0) == [TrailPlan([base] * 4)]


PLENTY = ("n_eval", 10**6)


class Watched(BOTOHE):
    """Remembers every plan that was evaluated, in order."""

    def __init__(self, mission):
        super().__init__(mission)
        self.seen = []

    def evaluate_batch(self, batch):
        self.seen += batch
        return super().evaluate_batch(batch)


class TestGreedy:
    def test_nothing_is_evaluated_twice_whatever_the_budget(self):
        whole, few = Watched(MUSEUM), Watched(MUSEUM)
        result = minimize(whole, Greedy(n_weights=30, beam_width=10), PLENTY)
        assert len(set(whole.seen)) == len(whole.seen) == result.algorithm.evaluator.n_eval
        minimize(few, Greedy(n_weights=30, beam_width=10), ("n_eval", 7))
        assert few.seen == whole.seen[:7]

    def test_weights_come_coarse_first(self, monkeypatch):
        asked, plans = [], SequentialPlanner.plans
        monkeypatch.setattr(
            SequentialPlanner, "plans", lambda self, w: asked.append(w) or plans(self, w)
        )
        for n_weights in (2, 3, 9, 10, 100):
            asked.clear()
            minimize(BOTOHE(MUSEUM), Greedy(n_weights=n_weights, beam_width=1), PLENTY)
            assert asked[:5] == [0, 1, 1 / 2, 1 / 4, 3 / 4] or n_weights != 9
            assert sorted(asked) == [i / (n_weights - 1) for i in range(n_weights)]
            for n in range(2, n_weights):  # no gap is more than about twice another
                gaps = np.diff(np.rint(np.sort(asked[:n]) * (n_weights - 1)))
                assert gaps.max() <= 2 * gaps.min() + 2

    @pytest.mark.compiled_only
    def test_area(self):
        """In fewer than a hundred evaluations what took the colony thousands."""
        result = minimize(BOTOHE(MUSEUM), Greedy(beam_width=30), PLENTY)
        assert area_indicator(-result.F, MUSEUM) > 0.48
        assert result.algorithm.evaluator.n_eval < 100
        away = {sum(len(trail) > 1 for trail in plan.trails) for plan in result.X[:, 0]}
        assert away == {0, 1, 2, 3}  # plans in which only the first robots leave belong to it
