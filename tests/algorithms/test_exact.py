"""Exact through pymoo: the contract of all algorithms, and what is its own."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.problem import Problem
from pymoo.optimize import minimize
from pymoo.termination import get_termination

from botohe_moo import BOACO, BOTOHE, Exact, Greedy, area_indicator, load_mission, make_algorithm
from botohe_moo.search.exact import TooLargeError, exact_front
from tests.examples import examples
from tests.strategies import small_missions

PLENTY = ("n_eval", 10**6)


@pytest.fixture(scope="module")
def mission():
    """Of some thousand labels, so that the search takes several generations."""
    return load_mission("random", nodes=8, arc_probability=0.4, robots=2, seed=3)


@pytest.fixture(scope="module")
def front(mission):
    return list(exact_front(mission))


def same_result(one, other):
    return one.F.tobytes() == other.F.tobytes() and [p.trails for p in one.X[:, 0]] == [
        p.trails for p in other.X[:, 0]
    ]


class TestContract:
    def test_result(self, mission, front):
        result = minimize(BOTOHE(mission), Exact(), PLENTY)
        assert list(result.X[:, 0]) == front
        assert np.array_equal(-result.F, mission.evaluate(front))
        assert not result.algorithm.has_next()
        home = mission.stay_home()
        assert result.algorithm.evaluator.n_eval == len({*front, home})
        assert result.algorithm.n_gen > 5

    def test_by_name(self, mission, front):
        algorithm = make_algorithm("exact", time_limit=30, memory_limit=500)
        result = minimize(BOTOHE(mission), algorithm, PLENTY, seed=1)
        assert list(result.X[:, 0]) == front

    def test_seeds_change_nothing(self, mission):
        one, other = (minimize(BOTOHE(mission), Exact(), PLENTY, seed=seed) for seed in (1, 2))
        assert same_result(one, other)

    @pytest.mark.parametrize("budget", [1, 2, 5])
    def test_budget_is_exact(self, mission, front, budget):
        result = minimize(BOTOHE(mission), Exact(), ("n_eval", budget))
        assert result.algorithm.evaluator.n_eval == budget
        # Everybody at base, and those with most reward.
        assert {*front[: budget - 1]} <= {*result.X[:, 0]}
        assert len(result.X) == budget

    def test_pickle_in_the_middle_of_a_run(self, mission):
        whole = minimize(BOTOHE(mission), Exact(), PLENTY)
        algorithm = Exact()
        algorithm.setup(BOTOHE(mission), termination=PLENTY)
        while algorithm.has_next():
            algorithm.next()
            if algorithm.n_gen in (2, 5):
                algorithm = pickle.loads(pickle.dumps(algorithm))
        assert same_result(whole, algorithm.result())
        assert algorithm.evaluator.n_eval == whole.algorithm.evaluator.n_eval

    def test_copies_go_their_own_ways(self, mission):
        algorithm = Exact()
        algorithm.setup(BOTOHE(mission), termination=PLENTY)
        algorithm.next()
        twin = copy.deepcopy(algorithm)
        for one in (twin, algorithm):
            while one.has_next():
                one.next()
        assert same_result(twin.result(), algorithm.result())

    def test_warm_start(self, mission, front):
        good = minimize(BOTOHE(mission), BOACO(), ("n_gen", 20), seed=9)
        warm = minimize(BOTOHE(mission), Exact(sampling=good.X), PLENTY)
        assert area_indicator(-warm.F, mission) >= area_indicator(-good.F, mission)
        n_new = len({*front} - {*good.X[:, 0]})
        assert warm.algorithm.evaluator.n_eval == len(good.X) + n_new
        cut = minimize(BOTOHE(mission), Exact(sampling=front), ("n_eval", 3))
        assert cut.algorithm.evaluator.n_eval == len(cut.X) == 3

    @pytest.mark.parametrize("termination", [("n_gen", 2), ("time", 1e-6)])
    def test_ended_before_the_search_is(self, mission, termination):
        result = minimize(BOTOHE(mission), Exact(), termination)
        assert [plan.trails for plan in result.X[:, 0]] == [((0,), (0,))]
        assert result.algorithm.evaluator.n_eval == 1

    def test_the_same_termination_serves_again(self, mission):
        limit = get_termination(*PLENTY)
        one, again = (minimize(BOTOHE(mission), Exact(), limit) for _ in range(2))
        assert same_result(one, again)

    def test_verbose_output(self, mission, capsys):
        result = minimize(BOTOHE(mission), Exact(), PLENTY, verbose=True)
        *_, area, _, size = capsys.readouterr().out.splitlines()[-1].split("|")
        assert float(area) == pytest.approx(area_indicator(-result.F, mission), abs=1e-4)
        assert int(size) == len(result.F)

    @examples(40)
    @given(small_missions(max_trails=40), st.sampled_from([0.3, 0.81, 1.0]))
    def test_a_survival_floor(self, case, least):
        mission, _ = case
        problem = BOTOHE(mission, min_survival=least)
        result = minimize(problem, Exact(), PLENTY)
        assert (result.G <= 0).all()
        other = minimize(problem, Greedy(n_weights=5, beam_width=50), PLENTY)
        near = 1e-11 * np.array([mission.total_reward, mission.robots])
        assert (result.F[:, None] - near <= other.F).all(axis=2).any(axis=0).all()


class TestRefusals:
    def test_what_is_too_large(self):
        with pytest.raises(TooLargeError, match=r"'art_museum' \(27 nodes, 74 arcs, 3 robots\)"):
            minimize(BOTOHE(load_mission("art_museum")), Exact(), PLENTY)
        with pytest.raises(TooLargeError, match=r"time_limit = 0\.02 seconds"):
            minimize(BOTOHE(load_mission("complete", nodes=9)), Exact(time_limit=0.02), PLENTY)

    def test_another_evaluation(self, mission):
        class Doubled(BOTOHE):
            def evaluate_batch(self, batch):
                return 2 * super().evaluate_batch(batch)

        with pytest.raises(TypeError, match="Doubled overrides evaluate_batch, which Exact does"):
            minimize(Doubled(mission), Exact(), PLENTY)
        with pytest.raises(TypeError, match="Expected a BOTOHE problem, got Problem"):
            minimize(Problem(n_var=1, n_obj=2), Exact(), PLENTY)

    @pytest.mark.parametrize(
        ("parameters", "message"),
        [
            ({"time_limit": 0}, r"Expected time_limit > 0, got 0\."),
            ({"memory_limit": "2"}, r"Expected memory_limit to be a number > 0, got '2'\."),
            ({"max_ties": 0}, r"Expected max_ties in \[1, 1000000000\], got 0\."),
        ],
    )
    def test_parameters_out_of_range(self, parameters, message):
        with pytest.raises(ValueError, match=message):
            Exact(**parameters)

    def test_unknown_parameters(self):
        with pytest.raises(TypeError, match="Exact has no parameter 'limit'"):
            Exact(limit=3)
