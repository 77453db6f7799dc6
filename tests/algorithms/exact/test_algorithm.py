"""The exact front through pymoo."""

import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, Exact, area_indicator, load_mission
from botohe_moo.algorithms.exact.front import TooLargeError, exact_front
from botohe_moo.algorithms.greedy.planner import MAX_BEAM_WIDTH

PLENTY = ("n_eval", 10**6)
WIDE = MAX_BEAM_WIDTH  # cuts nothing


@pytest.fixture(scope="module")
def mission():
    """Of some thousand labels, so that the search takes several generations."""
    return load_mission("random", nodes=8, arc_probability=0.4, robots=2, seed=3)


@pytest.fixture(scope="module")
def front(mission):
    return list(exact_front(mission))


class TestExact:
    def test_result(self, mission, front):
        result = minimize(BOTOHE(mission), Exact(), PLENTY)
        assert list(result.X[:, 0]) == front
        assert np.array_equal(-result.F, mission.evaluate(front))
        assert not result.algorithm.has_next()
        assert result.algorithm.evaluator.n_eval == len({*front, mission.stay_home()})
        assert result.algorithm.n_gen > 5

    def test_budget_is_exact(self, mission, front):
        for budget in (1, 2, 5):
            result = minimize(BOTOHE(mission), Exact(), ("n_eval", budget))
            assert result.algorithm.evaluator.n_eval == len(result.X) == budget
            # Everybody at base, and those with most reward.
            assert {*front[: budget - 1]} <= {*result.X[:, 0]}

    def test_warm_start(self, mission, front):
        good = minimize(BOTOHE(mission), BOACO(), ("n_gen", 20), seed=9)
        warm = minimize(BOTOHE(mission), Exact(sampling=good.X), PLENTY)
        assert area_indicator(-warm.F, mission) >= area_indicator(-good.F, mission)
        n_new = len({*front} - {*good.X[:, 0]})
        assert warm.algorithm.evaluator.n_eval == len(good.X) + n_new
        cut = minimize(BOTOHE(mission), Exact(sampling=front), ("n_eval", 3))
        assert cut.algorithm.evaluator.n_eval == len(cut.X) == 3

    def test_ended_before_the_search_is(self, mission):
        for termination in (("n_gen", 2), ("time", 1e-6)):
            result = minimize(BOTOHE(mission), Exact(), termination)
            assert [plan.trails for plan in result.X[:, 0]] == [((0,), (0,))]
            assert result.algorithm.evaluator.n_eval == 1

    def test_what_is_too_large_is_refused(self):
        museum = load_mission("art_museum")
        with pytest.raises(TooLargeError, match=r"'art_museum' \(27 nodes, 74 arcs, 3 robots\)"):
            minimize(BOTOHE(museum), Exact(time_limit=2), PLENTY)
