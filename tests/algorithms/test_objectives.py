"""Objectives of your own: each algorithm finds their front, or refuses them by name."""

import re

import numpy as np
import pytest
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, ParetoLocalSearch, TrailPlan, load_mission
from botohe_moo.algorithms import ArchiveAlgorithm
from tests.algorithms.test_contract import DOTTED, NAMES, SEARCHING, mission_for, small

TOY = load_mission("toy")
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
    Three: set(EVERY) - IN_KERNELS - DIRECTED,
    ThreeForPymoo: POPULATIONS - DIRECTED,
}


@pytest.mark.parametrize(
    "kind", [Hasty, ThreeForPymoo, pytest.param(Three, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", EVERY)
def test_each_honours_them_or_refuses_them_by_name(name, kind):
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


class Home(ArchiveAlgorithm):
    """Of other people: evaluates that nobody leaves."""

    def _advance(self, **_):
        mission = self.problem.mission
        self.evaluate_plans(mission.batch([mission.stay_home()]))


class InKernel(Home):
    evaluates_in_kernels = True


class Listed(Home):
    def _advance(self, **_):
        self.evaluate_plans([1, 2])


def test_algorithms_of_other_people_honour_them_unless_they_say_otherwise():
    assert minimize(Hasty(TOY), Home(), ("n_eval", 2)).F.tolist() == [[0.0, 0.0]]
    with pytest.raises(TypeError, match="Hasty overrides evaluate_batch, which InKernel does not"):
        minimize(Hasty(TOY), InKernel(), ("n_eval", 2))


class Broken(BOTOHE):
    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out, *args, **kwargs)
        out["F"] = out["F"] * np.nan


class Uncounted(BOTOHE):
    """Has a constraint that it does not count."""

    def constrain_batch(self, batch):
        return np.column_stack([super().constrain_batch(batch), np.ones(len(batch))])


class Impossible(Uncounted):
    def __init__(self, mission, **limits):
        super().__init__(mission, **limits)
        self.n_ieq_constr += 1


def changed(**attributes):
    problem = BOTOHE(TOY)
    vars(problem).update(attributes)
    return problem


FLAT = changed(evaluate_batch=lambda batch: np.ones(len(batch)))
BLIND = changed(evaluate_batch=lambda batch: np.ones((len(batch), 2)))


def from_trails(*trails, kind=BOACO):
    return kind(sampling=[TrailPlan(trails)])


@pytest.mark.parametrize(
    ("problem", "algorithm", "said"),
    [
        (Broken(TOY), "nsga2", "Expected _evaluate of Broken to give finite F"),
        (FLAT, "bo-aco", r"BOTOHE to give F of shape \(20, 2\), got \(20,\)"),
        (Uncounted(TOY), "bo-aco", "Uncounted.*(n_ieq_constr = 0|beside those of super)"),
        (Uncounted(TOY), "nsga2", "Uncounted.*(n_ieq_constr = 0|beside those of super)"),
        (BOTOHE(TOY), Listed(), r"Plan 0: expected a TrailPlan, got 1; mission\.plan"),
        (BLIND, from_trails([0, 10**6, 0], [0]), "position 1: node index 1000000 is unknown"),
        (BOTOHE(TOY), from_trails([0, 4, 0], [0]), "Robot 0, position 1: arc 1 -> 5 is missing"),
        (BOTOHE(TOY), from_trails([0], [0], [0]), "expected 2 trails, got 3"),
        (BOTOHE(TOY), from_trails([0, 0], [0], kind=ParetoLocalSearch), "Robot 0, position 1: arc"),
    ],
)
def test_what_cannot_be_searched_is_said(problem, algorithm, said):
    made = small(algorithm) if isinstance(algorithm, str) else algorithm
    with pytest.raises((TypeError, ValueError), match=said):
        minimize(problem, made, ("n_eval", 40), seed=1)


@pytest.mark.parametrize("name", ["bo-aco", "nsga2"])
def test_constraints_of_your_own_are_kept(name):
    for limits in ({}, {"min_survival": 0.2}):
        result = minimize(Impossible(TOY, **limits), small(name), ("n_eval", 40), seed=1)
        assert result.X is None
