"""Greedy planning through pymoo."""

import numpy as np
import pytest
from hypothesis import given
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, Greedy, area_indicator, load_mission
from botohe_moo.algorithms.greedy.planner import MAX_BEAM_WIDTH, SequentialPlanner
from tests.examples import examples
from tests.strategies import small_missions
from tests.twins import all_objectives, worth

PLENTY = ("n_eval", 10**6)
WIDE = MAX_BEAM_WIDTH  # cuts nothing


@pytest.fixture(scope="module")
def museum():
    return load_mission("art_museum")


class Watched(BOTOHE):
    """Remembers every plan that was evaluated, in order."""

    def __init__(self, mission):
        super().__init__(mission)
        self.seen = []

    def evaluate_batch(self, batch):
        self.seen += batch
        return super().evaluate_batch(batch)


class TestGreedy:
    def test_nothing_is_evaluated_twice_whatever_the_budget(self, museum):
        whole, few = Watched(museum), Watched(museum)
        result = minimize(whole, Greedy(n_weights=30, beam_width=10), PLENTY)
        assert len(set(whole.seen)) == len(whole.seen) == result.algorithm.evaluator.n_eval
        minimize(few, Greedy(n_weights=30, beam_width=10), ("n_eval", 7))
        assert few.seen == whole.seen[:7]

    def test_weights_come_coarse_first(self, museum, monkeypatch):
        asked = []
        plans = SequentialPlanner.plans
        monkeypatch.setattr(
            SequentialPlanner, "plans", lambda self, w: asked.append(w) or plans(self, w)
        )
        minimize(BOTOHE(museum), Greedy(n_weights=9, beam_width=1), ("n_gen", 5))
        assert asked == [0, 1, 1 / 2, 1 / 4, 3 / 4]
        for n_weights in (2, 3, 10, 100):
            asked.clear()
            minimize(BOTOHE(museum), Greedy(n_weights=n_weights, beam_width=1), PLENTY)
            assert sorted(asked) == [i / (n_weights - 1) for i in range(n_weights)]
            for n in range(2, n_weights):  # no gap is more than about twice another
                gaps = np.diff(np.rint(np.sort(asked[:n]) * (n_weights - 1)))
                assert gaps.max() <= 2 * gaps.min() + 2

    def test_warm_start(self, museum):
        good = minimize(BOTOHE(museum), BOACO(), ("n_gen", 50), seed=9)
        problem = Watched(museum)
        warm = minimize(problem, Greedy(n_weights=5, beam_width=10, sampling=good.X), PLENTY)
        assert set(problem.seen[: len(good.X)]) == set(good.X[:, 0])
        assert area_indicator(-warm.F, museum) > area_indicator(-good.F, museum)
        cut = minimize(BOTOHE(museum), Greedy(sampling=good.X), ("n_eval", 5))
        assert cut.algorithm.evaluator.n_eval == len(cut.X) == 5
        own = minimize(BOTOHE(museum), Greedy(n_weights=5, beam_width=10), PLENTY)
        again = minimize(BOTOHE(museum), Greedy(n_weights=5, beam_width=10, sampling=own.X), PLENTY)
        assert again.algorithm.evaluator.n_eval == own.algorithm.evaluator.n_eval

    @examples(60)
    @given(small_missions(max_robots=1, max_trails=1000))
    def test_one_robot_finds_what_is_best_for_its_weights(self, case):
        mission, trails = case
        every = all_objectives(mission, trails)
        result = minimize(BOTOHE(mission), Greedy(n_weights=9, beam_width=WIDE), PLENTY)
        for weight in np.linspace(0, 1, 9):
            best = worth(mission, every, weight).max()
            assert worth(mission, -result.F, weight).max() == pytest.approx(best, rel=1e-9)

    def test_area(self, museum):
        """In fewer than a hundred evaluations what took the colony thousands."""
        base = (museum.index(museum.base),)
        result = minimize(BOTOHE(museum), Greedy(beam_width=30), PLENTY)
        assert area_indicator(-result.F, museum) > 0.48
        assert result.algorithm.evaluator.n_eval < 100
        away = {sum(trail != base for trail in plan.trails) for plan in result.X[:, 0]}
        assert away == {0, 1, 2, 3}  # plans in which only the first robots leave belong to it
