"""Objectives of your own: each algorithm finds their front, or refuses them by name."""

import re

import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, load_mission, make_algorithm
from botohe_moo.algorithms import ArchiveAlgorithm
from tests.algorithms.test_contract import DOTTED, NAMES, SEARCHING, mission_for, small

EVERY = [*NAMES, *DOTTED, SEARCHING]
IN_KERNELS = {"exact", "pareto-local-search", "simulated-annealing", SEARCHING}
POPULATIONS = {"moead", "nsga2", "sms-emoa", "spea2", *DOTTED}
DIRECTED = {"moead", "pymoo.algorithms.moo.nsga3:NSGA3"}


def longest(problem, batch):
    return problem.mission.trail_lengths(batch).max(axis=1)


class Hasty(BOTOHE):
    """Expected reward, against how long the last robot is on its way."""

    def evaluate_batch(self, batch):
        F = super().evaluate_batch(batch)
        return np.column_stack([F[:, 0], longest(self, batch)])


class HastyForPymoo(BOTOHE):
    """The same, as problems of pymoo's are written."""

    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out, *args, **kwargs)
        out["F"] = np.column_stack([out["F"][:, 0], longest(self, self.mission.batch(x))])


class Three(BOTOHE):
    """The length besides both of the model's."""

    def __init__(self, mission, **limits):
        super().__init__(mission, **limits)
        self.n_obj = 3

    def evaluate_batch(self, batch):
        return np.column_stack([super().evaluate_batch(batch), longest(self, batch)])


class ThreeForPymoo(Three):
    evaluate_batch = BOTOHE.evaluate_batch

    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out, *args, **kwargs)
        out["F"] = np.column_stack([out["F"], longest(self, self.mission.batch(x))])


HONOURED = {
    Hasty: set(EVERY) - IN_KERNELS,
    HastyForPymoo: POPULATIONS,
    Three: set(EVERY) - IN_KERNELS - DIRECTED,
    ThreeForPymoo: POPULATIONS - DIRECTED,
}


SOME, OTHERS = (Hasty, ThreeForPymoo), (Three, HastyForPymoo)


@pytest.mark.parametrize("kinds", [SOME, pytest.param(OTHERS, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", EVERY)
def test_each_honours_them_or_refuses_them_by_name(name, kinds):
    for kind in kinds:
        check_objectives(name, kind)


def check_objectives(name, kind):
    problem = kind(mission_for(name), min_survival=0.2, max_length=9)
    algorithm = small(name)
    if name not in HONOURED[kind]:
        names = [re.escape(each) for each in (type(algorithm).__name__, kind.__name__)]
        with pytest.raises(TypeError, match=rf"(?=.*\b{names[0]}\b)(?=.*\b{names[1]}\b)"):
            minimize(problem, algorithm, ("n_eval", 200), seed=1)
        return
    result = minimize(problem, algorithm, ("n_eval", 200), seed=1, verbose=True)
    assert result.algorithm.evaluator.n_eval == 200 or name == "greedy"  # ends with its sweep
    found = problem.evaluate(result.X, return_values_of=["F"])
    assert result.F.tolist() == found.tolist()
    assert len({plan for (plan,) in result.X}) == len(result.X) > 1
    worse = (result.F[:, None] >= result.F).all(axis=2) & (result.F[:, None] > result.F).any(axis=2)
    assert not worse.any()
    assert set(result.algorithm.archive.plans) == set(result.X.ravel())
    assert sorted((-result.algorithm.archive.objectives).tolist()) == sorted(result.F.tolist())
    assert (problem.constrain_batch(problem.mission.batch(result.X)) <= 0).all()


def test_three_objectives_have_the_front_of_all_that_was_evaluated():
    seen = []

    class Watched(Three):
        def evaluate_batch(self, batch):
            seen.extend(batch)
            return super().evaluate_batch(batch)

    problem = Watched(load_mission("toy"))
    result = minimize(problem, small("nsga2"), ("n_eval", 300), seed=4)
    plans = list(dict.fromkeys(seen))
    F = problem.evaluate(np.array([[plan] for plan in plans], object))
    beaten = ((F[:, None] >= F).all(axis=2) & (F[:, None] > F).any(axis=2)).any(axis=1)
    assert set(result.X.ravel()) == {
        plan for plan, lost in zip(plans, beaten, strict=True) if not lost
    }
    few = minimize(
        problem, make_algorithm("nsga2", pop_size=20, max_ties=1), ("n_eval", 300), seed=4
    )
    points = np.unique(result.F, axis=0)
    assert len(few.F) == len(points) < len(result.F)
    assert np.array_equal(np.unique(few.F, axis=0), points)


def test_three_objectives_that_are_no_numbers_are_refused():
    class Broken(BOTOHE):
        def _evaluate(self, x, out, *args, **kwargs):
            super()._evaluate(x, out, *args, **kwargs)
            out["F"] = out["F"] * np.nan

    with pytest.raises(ValueError, match="Expected _evaluate of Broken to give finite F"):
        minimize(Broken(load_mission("toy")), small("nsga2"), ("n_eval", 40), seed=1)


def test_algorithms_of_other_people_honour_them_unless_they_say_otherwise():
    class Home(ArchiveAlgorithm):
        def _advance(self, **_):
            mission = self.problem.mission
            self.evaluate_plans(mission.batch([mission.stay_home()]))

    class InKernel(Home):
        evaluates_in_kernels = True

    problem = Hasty(load_mission("toy"))
    assert minimize(problem, Home(), ("n_eval", 2)).F.tolist() == [[0.0, 0.0]]
    with pytest.raises(TypeError, match="Hasty overrides evaluate_batch, which InKernel does not"):
        minimize(problem, InKernel(), ("n_eval", 2))


def test_one_objective_is_refused():
    problem = BOTOHE(load_mission("toy"))
    problem.n_obj = 1
    with pytest.raises(
        TypeError, match="PlanNSGA2 searches for fronts of two objectives or more, and BOTOHE has 1"
    ):
        minimize(problem, small("nsga2"), ("n_eval", 40), seed=1)


class Uncounted(BOTOHE):
    """Has a constraint that it does not count."""

    def constrain_batch(self, batch):
        return np.column_stack([super().constrain_batch(batch), np.ones(len(batch))])


class Impossible(Uncounted):
    def __init__(self, mission, **limits):
        super().__init__(mission, **limits)
        self.n_ieq_constr += 1


@pytest.mark.parametrize("name", ["bo-aco", "nsga2"])
def test_constraints_of_your_own_are_kept_and_have_to_be_counted(name):
    toy = load_mission("toy")
    with pytest.raises(ValueError, match=r"Uncounted.*(n_ieq_constr = 0|beside those of super)"):
        minimize(Uncounted(toy), small(name), ("n_eval", 40), seed=1)
    for limits in ({}, {"min_survival": 0.2}):
        result = minimize(Impossible(toy, **limits), small(name), ("n_eval", 40), seed=1)
        assert result.X is None


def test_only_plans_are_taken_in():
    class Listed(ArchiveAlgorithm):
        def _advance(self, **_):
            self.evaluate_plans([1, 2])

    with pytest.raises(TypeError, match=r"Plan 0: expected a TrailPlan, got 1; mission\.plan"):
        minimize(BOTOHE(load_mission("toy")), Listed(), ("n_eval", 40), seed=1)
