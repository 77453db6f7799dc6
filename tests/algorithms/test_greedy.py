"""Greedy through pymoo: the contract of all algorithms, and what its front holds."""

import numpy as np
import pytest
from hypothesis import given
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission
from botohe_moo.algorithms.baselines import Greedy
from botohe_moo.search.sequential import MAX_BEAM_WIDTH, SequentialPlanner
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

    def __init__(self, mission, **options):
        super().__init__(mission, **options)
        self.seen, self.values = [], []

    def evaluate_batch(self, batch):
        values = super().evaluate_batch(batch)
        self.seen += batch
        self.values += (-values).tolist()
        return values


class TestContract:
    def test_result(self, museum):
        problem = Watched(museum)
        result = minimize(problem, Greedy(n_weights=30, beam_width=20), PLENTY)
        plans = list(result.X[:, 0])
        assert np.array_equal(-result.F, museum.evaluate(plans))
        assert len(set(plans)) == len(plans)
        values = np.array(problem.values)
        better = (values[:, None] >= values).all(axis=2) & (values[:, None] > values).any(axis=2)
        kept = ~better.any(axis=0)
        assert set(plans) == {
            plan for plan, is_kept in zip(problem.seen, kept, strict=True) if is_kept
        }
        # Nothing twice, and everything counted.
        assert len(set(problem.seen)) == len(problem.seen) == result.algorithm.evaluator.n_eval

    @pytest.mark.parametrize("budget", [1, 2, 7])
    def test_budget_is_exact(self, museum, budget):
        problem = Watched(museum)
        result = minimize(problem, Greedy(beam_width=10), ("n_eval", budget))
        assert result.algorithm.evaluator.n_eval == len(problem.seen) == budget
        # The same plans come first, whatever the budget.
        whole = Watched(museum)
        minimize(whole, Greedy(beam_width=10), ("n_eval", 20))
        assert whole.seen[:budget] == problem.seen

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


class TestFront:
    @examples(60)
    @given(small_missions(max_robots=1, max_trails=1000))
    def test_one_robot_finds_what_is_best_for_its_weights(self, case):
        mission, trails = case
        every = all_objectives(mission, trails)
        result = minimize(BOTOHE(mission), Greedy(n_weights=9, beam_width=WIDE), PLENTY)
        for weight in np.linspace(0, 1, 9):
            best = worth(mission, every, weight).max()
            assert worth(mission, -result.F, weight).max() == pytest.approx(best, rel=1e-9)

    def test_partial_plans_belong_to_it(self, museum):
        base = (museum.arrays.base,)
        result = minimize(BOTOHE(museum), Greedy(beam_width=30), PLENTY)
        away = {sum(trail != base for trail in plan.trails) for plan in result.X[:, 0]}
        assert away == {0, 1, 2, 3}

    @pytest.mark.parametrize(("name", "area"), [("art_museum", 0.48), ("power_plant", 0.28)])
    def test_area(self, name, area):
        """In fewer than a hundred evaluations what took the colony thousands."""
        mission = load_mission(name)
        result = minimize(BOTOHE(mission), Greedy(beam_width=30), PLENTY)
        assert area_indicator(-result.F, mission) > area
        assert result.algorithm.evaluator.n_eval < 100
