"""BOTOHE through pymoo's own machinery, its limits, and what pymoo prints."""

import copy
import itertools
import math
import pickle

import networkx as nx
import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.evaluator import Evaluator
from pymoo.core.population import Population
from pymoo.optimize import minimize

from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.mission import Mission, load_mission
from botohe_moo.operators import PlanDuplicates, RuinRecreate, TrailSplice
from botohe_moo.problem import BOTOHE, FrontOutput, LeastSurvival
from botohe_moo.trails import PlanBatch, TrailPlan

TOY = load_mission("toy")
# Nobody goes, one goes to 3, one each to 2 and to 4 and 5.
TRAILS = ([[1], [1]], [[1, 3, 1], [1]], [[1, 2, 1], [1, 2, 4, 5, 4, 2, 1]])
PLANS = [TOY.plan(trails) for trails in TRAILS]
BATCH = TOY.batch(PLANS)
# From the survivals of the toy mission; nodes 2 to 5 pay 0, 1, 4 and 5.
REACH_4, REACH_5 = 0.81, 0.81 * 0.729
LEAST = np.array([1, 0.9**2, 0.81**2 * 0.729**2])  # survival of a robot
EXPECTED = np.array(
    [(0.0, 2.0), (0.9, 0.9**2 + 1), (4 * REACH_4 + 5 * REACH_5, 0.81**2 + 0.81**2 * 0.729**2)]
)


@pytest.fixture
def x():
    return BATCH.to_array()


def plain(**options):
    """An algorithm of pymoo's with this package's operators."""
    operators = {"crossover": TrailSplice(), "mutation": RuinRecreate()}
    return NSGA2(pop_size=16, **operators, eliminate_duplicates=PlanDuplicates(), **options)


class TestProblem:
    def test_objectives_are_the_negatives_of_the_mission_s(self, x):
        f = BOTOHE(TOY).evaluate_batch(BATCH)
        assert (f.shape, f.dtype) == ((3, 2), np.float64)
        assert np.array_equal(-f, TOY.evaluate(PLANS))
        assert -f == pytest.approx(EXPECTED, abs=1e-15)
        evaluator = Evaluator()
        population = evaluator.eval(BOTOHE(TOY), Population.new(X=x))
        assert population.get("F").tolist() == f.tolist()
        assert population.get("feas").all()
        assert evaluator.n_eval == 3

    def test_it_says_what_it_is_also_as_a_copy_and_in_another_process(self, x):
        problem = BOTOHE(TOY)
        assert copy.deepcopy(problem).mission is problem.mission is TOY
        for each in (problem, copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))):
            assert (each.mission, each.name()) == (TOY, "BOTOHE(toy)")
            assert (each.n_var, each.n_obj, each.n_constr, each.vtype) == (1, 2, 0, object)
            assert (each.has_bounds(), each.has_constraints()) == (False, False)
            assert np.array_equal(each.evaluate(x), problem.evaluate(x))

    def test_algorithms_of_pymoo_find_plans(self, x):
        result = minimize(BOTOHE(TOY), plain(sampling=x), ("n_gen", 12), seed=1)
        assert (result.X.shape, result.X.dtype) == ((len(result.F), 1), object)
        assert {*map(type, result.X[:, 0])} == {TrailPlan}
        assert len(set(result.X[:, 0])) == len(result.X) > 3
        assert np.array_equal(-result.F, TOY.evaluate(result.X))

    def test_operators_of_pymoo_are_refused_with_what_to_take_instead(self):
        with pytest.raises(TypeError, match=r"got numbers.*make_algorithm\('nsga2'\) has sampling"):
            minimize(BOTOHE(TOY), NSGA2(pop_size=10), ("n_gen", 1), seed=1)


class Doubled(BOTOHE):
    """Counts the robots that survive twice."""

    def evaluate_batch(self, batch):
        assert isinstance(batch, PlanBatch)
        return super().evaluate_batch(batch) * [1, 2]


class ShortOfTarget(BOTOHE):
    """Plans below an expected reward are infeasible."""

    def __init__(self, mission, target):
        super().__init__(mission)
        self.target = target
        self.n_ieq_constr = 1

    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out, *args, **kwargs)
        out["G"] = self.target + out["F"][:, :1]


class TestSubclasses:
    def test_pymoo_sees_an_overridden_evaluate_batch(self, x):
        problem = Doubled(TOY)
        assert -problem.evaluate(x) == pytest.approx(EXPECTED * [1, 2])
        result = minimize(problem, plain(sampling=x), ("n_gen", 3), seed=1)
        assert pytest.approx(TOY.evaluate(result.X) * [1, 2]) == -result.F

    def test_constraints_can_be_added(self, x):
        f, g = ShortOfTarget(TOY, 0.5).evaluate(x)
        assert -f == pytest.approx(EXPECTED, abs=1e-15)
        assert g[:, 0] == pytest.approx(0.5 - EXPECTED[:, 0])
        problem = ShortOfTarget(TOY, 3.0)
        result = minimize(problem, make_algorithm("nsga2", pop_size=20), ("n_eval", 200), seed=1)
        assert (-result.F[:, 0] >= 3.0).all()
        assert result.G.tolist() == (3.0 + result.F[:, :1]).tolist()


def test_the_least_survival_is_a_third_objective(x):
    """A robot that stays survives; of a pair on the way, the one in the greater danger counts."""
    expected = np.column_stack([EXPECTED, LEAST])
    assert -LeastSurvival(TOY).evaluate(x) == pytest.approx(expected)
    assert LeastSurvival(TOY).objectives.bounds == (10.0, 2.0, 1.0)


class TestFrontOutput:
    @pytest.mark.parametrize("target", [None, 0.95, 9.5])
    def test_by_hand(self, x, capsys, target):
        """The toy pays 10 to 2 robots, so its objective space is 20; the plans are a staircase.

        With a target only the last of them is feasible, or none.
        """
        problem = BOTOHE(TOY) if target is None else ShortOfTarget(TOY, target)
        sampled = plain(sampling=x, output=FrontOutput())
        minimize(problem, sampled, ("n_gen", 1), seed=1, verbose=True)
        _, head, _, *rows = capsys.readouterr().out.splitlines()
        header, *rows = ([cell.strip() for cell in row.split("|")] for row in (head, *rows))
        assert header == ["n_gen", "n_eval", "area", "max E[R]", "n_front"]
        reward, survivors = EXPECTED[2]
        of_one, of_others = reward * survivors / 20, 0.9 * (0.9**2 + 1 - survivors) / 20
        expected = {
            None: [f"{of_one + of_others:.5f}", f"{reward:.7f}", "3"],
            0.95: [f"{of_one:.5f}", f"{reward:.7f}", "1"],
            9.5: ["0.0E+00", "-", "0"],
        }
        assert rows == [["1", "3", *expected[target]]]


def there_and_back(*lengths, **own):
    """A base with as many islands, each as far away as half of a length."""
    graph = nx.DiGraph(base="dock", robots=1, **own)
    graph.add_node("dock", reward=0)
    for island, length in enumerate(lengths):
        graph.add_node(island, reward=1)
        graph.add_edge("dock", island, survival=0.9, length=length)
        graph.add_edge(island, "dock", survival=0.9, length=0)
    return Mission(graph)


class TestTravelBudget:
    def constraints(self, mission, *trails, **limits):
        batch = mission.batch([mission.plan([trail]) for trail in trails])
        return BOTOHE(mission, **limits).constrain_batch(batch)

    def test_by_hand_beside_the_survival_floor_and_invalid_plans(self):
        problem = BOTOHE(TOY, max_length=4)
        assert (problem.n_ieq_constr, problem.max_length) == (1, 4)
        length = [-1, -0.5, 0.5]  # hops of the longest trails: none, 2 and 6
        assert problem.constrain_batch(BATCH)[:, 0] == pytest.approx(length)
        problem = BOTOHE(TOY, min_survival=0.5, max_length=4).allowing_invalid()
        G = problem.constrain_batch(BATCH)
        assert pytest.approx(np.column_stack([[0, 0, 0], 0.5 - LEAST, length])) == G
        drafts = [TrailPlan([[0, 2, 0, 1, 3, 4, 3], [1]])]  # not back at base; from elsewhere
        G = problem.constrain_batch(PlanBatch.from_plans(drafts, 2))
        assert G[0, ::2].tolist() == [3, pytest.approx(6 / 4 - 1)]

    def test_a_trail_just_as_long_as_the_budget_is_kept_whatever_rounding_does(self):
        lengths = [0.1, 0.2, 0.3, 0.7, 1.1]
        mission = there_and_back(*lengths)
        budget = math.fsum(lengths)
        sums = set()
        for order in itertools.permutations(range(5)):
            trail = ["dock", *(stop for island in order for stop in (island, "dock"))]
            sums.add(float(mission.trail_lengths([mission.plan([trail])])[0, 0]))
            assert self.constraints(mission, trail, max_length=budget) <= 0
            assert self.constraints(mission, trail, max_length=budget - 1e-9) > 0
        assert len(sums) > 1  # the order makes a difference
        assert max(sums) > budget
        problem = BOTOHE(mission, max_length=budget)
        assert max(sums) <= problem.world.limits.budgets[0] < problem.limits.budgets[0]

    def test_a_budget_of_nothing(self):
        mission = there_and_back(0, 3)
        trails = [["dock"], ["dock", 0, "dock"], ["dock", 1, "dock"]]
        G = self.constraints(mission, *trails, max_length=0)
        assert G[:, 0].tolist() == [0, 0, 3]  # of what cannot be reached and left is no fault

    def test_the_mission_s_own(self):
        mission = there_and_back(3, max_length=2.5)
        trail = ["dock", 0, "dock"]
        assert BOTOHE(mission).max_length == 2.5
        assert self.constraints(mission, trail) == pytest.approx(0.5 / 2.5)
        assert self.constraints(mission, trail, max_length=6) == pytest.approx(-0.5)
        assert self.constraints(mission, trail, max_length=None).shape == (1, 1)

    def test_no_budget_is_no_constraint(self):
        for problem in (BOTOHE(TOY), BOTOHE(TOY, max_length=math.inf)):
            assert (problem.n_ieq_constr, problem.max_length) == (0, None)
            for limits in (problem.limits, problem.world.limits):
                assert (limits.has_budgets, limits.has_floors) == (False, False)
                assert np.isinf(limits.budgets).all()
        lifted = BOTOHE(there_and_back(3, max_length=2.5), max_length=math.inf)
        assert (lifted.n_ieq_constr, lifted.max_length) == (0, None)


class TestSurvivalFloor:
    def test_by_hand(self, x):
        problem = BOTOHE(TOY, min_survival=0.5)
        assert problem.n_ieq_constr == 1
        assert problem.constrain_batch(BATCH)[:, 0] == pytest.approx(0.5 - LEAST)
        out = problem.evaluate(x, return_as_dictionary=True)
        assert out["G"].tolist() == problem.constrain_batch(BATCH).tolist()
        assert out["F"].tolist() == BOTOHE(TOY).evaluate(x).tolist()
        assert BOTOHE(TOY).constrain_batch(BATCH).shape == (3, 0)  # without a floor

    def test_a_floor_that_is_just_met_is_kept_whatever_rounding_does(self):
        graph = nx.DiGraph([(0, 1), (1, 0)])
        nx.set_node_attributes(graph, 1.0, "reward")
        for survival in np.arange(1, 200) / 200:
            nx.set_edge_attributes(graph, survival, "survival")
            mission = Mission(graph, base=0, robots=1)
            problem = BOTOHE(mission, min_survival=round(survival * survival, 10))
            assert problem.constrain_batch(mission.batch([mission.plan([[0, 1, 0]])])) <= 0

    def test_invalid_plans_may_be_allowed(self):
        problem = BOTOHE(TOY, min_survival=0.5)
        assert problem.allowing_invalid().n_ieq_constr == 2
        assert problem.n_ieq_constr == 1
        drafts = [TrailPlan([[0, 4, 0], [1]])]
        G = problem.allowing_invalid().constrain_batch(PlanBatch.from_plans(drafts, 2))
        # Two missing arcs; a trail from elsewhere to elsewhere. Both robots are lost.
        assert G.tolist() == [[4.0, pytest.approx(0.5)]]


def test_what_is_refused():
    for options, message in (
        ({"min_survival": -0.1}, r"Expected min_survival .*in \[0, 1\], got"),
        ({"min_survival": 1.01}, r"Expected min_survival .*in \[0, 1\], got"),
        ({"max_length": -1}, "Expected max_length >= 0, got -1"),
        ({"allow_invalid": 1}, "Expected allow_invalid to be true or false, got 1"),
    ):
        with pytest.raises(ValueError, match=message):
            BOTOHE(TOY, **options)
    for what, values, message in (
        ("F", np.zeros((2, 3)), r"evaluate_batch of BOTOHE to give F of shape \(2, 2\), got"),
        ("F", [[0, 1], [0, np.nan]], r"evaluate_batch of .* finite F, got \[ 0\. nan\]"),
        ("G", np.zeros((2, 1)), r"constrain_batch .* G of shape \(2, 0\) \(columns of its own"),
    ):
        with pytest.raises(ValueError, match=f"^Expected {message}"):
            BOTOHE(TOY).checked(what, values, 2)
    assert BOTOHE(TOY).checked("F", [[0, 1], [2, 3]], 2).tolist() == [[0, 1], [2, 3]]
