"""What studies rest on: the rules for algorithms."""

from __future__ import annotations

import moocore
import numpy as np
from pymoo.core.algorithm import Algorithm

from botohe_moo.algorithms.registry import accepted_by
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.testing.rules import Rules, Subject, expect
from botohe_moo.testing.watching import (
    Counted,
    Halved,
    Run,
    Watched,
    kinds_of_robots,
    measured,
    missing,
    one_way,
    refuses,
    run,
    streets,
)

_EVALUATIONS = 300
_BUDGETS = (1, 7, 45, 171)

RULES = Rules()


@RULES.add(
    "Let it be called without arguments, and return a new pymoo Algorithm each time.",
    comes_first=True,
)
def can_be_made(subject: Subject) -> None:
    """Without arguments, a new algorithm is made at each call."""
    one, other = subject.make(), subject.make()
    expect(isinstance(one, Algorithm), f"it gives {type(one).__name__}, not a pymoo Algorithm")
    expect(one is not other, "it gives the same object twice")


@RULES.add(
    "Evaluate plans in every generation, and set `self.termination.force_termination` when done.",
    comes_first=True,
)
def runs_end(subject: Subject) -> None:
    """A run ends when its budget is spent, or before."""
    _run(subject, BOTOHE(streets()))


@RULES.add("State each parameter in the signature, by name, with its type and its default.")
def parameters_stated(subject: Subject) -> None:
    """All parameters are in the signature, with their types."""
    stated = accepted_by(subject.factory)
    untyped = [parameter.name for parameter in stated if not parameter.annotation]
    expect(not untyped, f"no type is stated of {', '.join(untyped)}")


@RULES.add(
    "Put TrailPlans into X, made with the mission's arcs alone, and leave F as it is evaluated."
)
def valid_plans(subject: Subject) -> None:
    """The result holds valid plans, and the objectives that the problem computes of them."""
    for mission in (streets(), measured()):
        found = _true_run(subject, BOTOHE(mission))
        expect(found.plans, "its result holds no plan")


@RULES.add(
    "Evaluate by the problem that `setup` is given; if that cannot be, raise a TypeError in "
    "`setup` that names the problem's class."
)
def own_objectives(subject: Subject) -> None:
    """Another objective, by a subclass of BOTOHE, is used, or the problem is refused by name."""
    problem = Halved(streets())
    if not refuses(subject.make(), problem):
        _true_run(subject, problem)


@RULES.add("Keep all non-dominated plans of all generations: ArchiveAlgorithm has an archive.")
def front_of_all_evaluated(subject: Subject) -> None:
    """The result is the front of all plans that were evaluated; none is lost on the way."""
    for floor in (0.0, 0.3):
        problem = Watched(streets(), min_survival=floor)
        watched = not refuses(subject.make(), Watched(streets(), min_survival=floor))
        plain = BOTOHE(problem.mission, min_survival=floor)
        found = _run(subject, problem if watched else plain)
        feasible = [point for _, point, is_feasible in problem.seen if is_feasible]
        seen = np.reshape(feasible, (-1, 2))
        for points in (*found.fronts, seen if watched else found.fronts[-1]):
            lost = missing(points, found.objectives)
            expect(not len(lost), f"its result lacks a plan that it found, {_points(lost)}")
        distinct = np.unique(found.objectives, axis=0)
        dominated = distinct[~moocore.is_nondominated(distinct, maximise=True)]
        expect(not len(dominated), f"its result holds a dominated plan, {_points(dominated)}")


@RULES.add("Evaluate no more plans than the termination still allows, and as many.")
def exact_budget(subject: Subject) -> None:
    """Budgets are spent to the last evaluation, and not beyond, unless it ends by itself."""
    problem = BOTOHE(streets())
    for budget in _BUDGETS:
        spent = _run(subject, problem, budget).spent
        expect(spent <= budget, f"it spent {spent} of {budget} evaluations")
        if spent < budget:
            more = _run(subject, problem, 2 * budget).spent
            expect(
                more == spent, f"it spent {spent} of {budget} evaluations, {more} of twice as many"
            )


@RULES.add(
    "Evaluate plans by `self.evaluator.eval(self.problem, population)` alone: it counts them."
)
def true_budget(subject: Subject) -> None:
    """Every plan that is evaluated is counted."""
    plain = streets()
    mission = Counted(plain.graph, base=plain.base, robots=plain.robots)
    problem = Watched(mission)
    if not refuses(subject.make(), Watched(plain)):  # what happens in kernels cannot be seen
        spent = _run(subject, problem).spent
        evaluated = max(len(problem.seen), mission.n_evaluated)
        expect(spent == evaluated, f"it evaluated {evaluated} plans, and counted {spent}")


@RULES.add(
    "Draw all random numbers from `self.random_state`, depend on no time and no order of sets, and "
    "keep nothing in the class, the module or default arguments."
)
def same_seed_same_front(subject: Subject) -> None:
    """The same seed gives the same plans in the same order, whatever ran before."""
    one = _run(subject, BOTOHE(streets()), seed=5)
    _run(subject, BOTOHE(one_way()), seed=7)
    same = _run(subject, BOTOHE(streets()), seed=5)
    _expect_same(one, same, "two runs with the same seed differ")


@RULES.add(
    "Draw random numbers from `self.random_state`; an algorithm that draws none states so: "
    "`deterministic = True` in its class."
)
def other_seed_other_front(subject: Subject) -> None:
    """Another seed gives other plans, unless the algorithm says that it is deterministic."""
    problem = BOTOHE(streets())
    differs = any(
        _run(subject, problem, budget, seed=1).trails
        != _run(subject, problem, budget, seed=2).trails
        for budget in (20, 60, 200)
    )
    if getattr(subject.make(), "deterministic", False):
        expect(not differs, "it says that it is deterministic, and two seeds give other plans")
    else:
        expect(differs, "two seeds give the same plans with 20, with 60 and with 200 evaluations")


@RULES.add(
    "Hold nothing that cannot be pickled, such as lambdas, generators and open files, and leave "
    "nothing out that the run needs."
)
def resumes_when_pickled(subject: Subject) -> None:
    """A run that is pickled on its way, and unpickled, ends bit for bit as one that is not."""
    problem = BOTOHE(streets())
    whole = _run(subject, problem)
    n = len(whole.fronts)
    for stop in sorted({0, 1, n // 2}):
        resumed = _run(subject, problem, pickled_after=stop)
        _expect_same(
            whole, resumed, f"a run that is pickled after {stop} of {n} generations differs"
        )


@RULES.add("Lead trails along the mission's arcs, in their direction, and home over unused ones.")
def one_way_mission(subject: Subject) -> None:
    """Missions whose arcs have no reverse are planned, and robots leave the base."""
    _expect_gain(subject, one_way(), "no robot collects anything where all arcs are one-way")


@RULES.add("Do not take for granted that there are two robots.")
def one_robot(subject: Subject) -> None:
    """A team of one robot is planned."""
    _expect_gain(subject, streets().with_robots(1), "a single robot collects nothing")


@RULES.add(
    "Compare CV first: `result.X` holds feasible plans alone, and is None where there are none."
)
def survival_floor(subject: Subject) -> None:
    """A survival floor is kept, also one that nothing but staying home satisfies."""
    for floor in (0.5, 1.0):
        problem = BOTOHE(streets(), min_survival=floor)
        _expect_limits(problem, _true_run(subject, problem))


@RULES.add(
    "Compare CV first: `result.X` holds feasible plans alone, and is None where there are none."
)
def travel_budget(subject: Subject) -> None:
    """A travel budget is kept."""
    for budget in (0.0, 4.0):
        problem = BOTOHE(measured(), max_length=budget)
        _expect_limits(problem, _true_run(subject, problem))


@RULES.add(
    "Plan with `problem.world`, in which each kind has nodes of its own, from `team.start` to "
    "`team.end`; or let `supports(mission)` be `mission.is_plain`."
)
def kinds(subject: Subject) -> None:
    """Each kind of robots keeps its start, end and limits, unless `supports` says it cannot."""
    mission = kinds_of_robots()
    supports = getattr(subject.make(), "supports", None)
    if supports is not None and not supports(mission):
        return
    problem = BOTOHE(mission)
    found = _true_run(subject, problem)
    expect(found.plans, "its result holds no plan for kinds of robots")
    _expect_limits(problem, found)


def _expect_limits(problem: BOTOHE, found: Run) -> None:
    """Expect that every robot keeps its limits."""
    try:
        problem.check_limits(found.plans)
    except ValueError as error:
        expect(False, f"a limit is broken: {error}")


def _run(subject: Subject, problem: BOTOHE, evaluations: int = _EVALUATIONS, **how: int) -> Run:
    return run(subject.make(), problem, evaluations, **how)


def _expect_gain(subject: Subject, mission: Mission, message: str) -> None:
    """Expect plans of a mission in which robots collect something."""
    found = _true_run(subject, BOTOHE(mission))
    expect(any(found.objectives[:, 0] > 0.0), message)


def _true_run(subject: Subject, problem: BOTOHE) -> Run:
    """Run, and compare the objectives of the result with what the problem computes."""
    found = _run(subject, problem)
    true = -problem.evaluate_batch(problem.mission.batch(found.plans))
    wrong = np.flatnonzero((true != found.objectives).any(axis=1))
    if len(wrong):
        claimed, computed = (_points(values[wrong]) for values in (found.objectives, true))
        expect(False, f"it claims {claimed} of a plan that has {computed}")
    return found


def _expect_same(one: Run, other: Run, message: str) -> None:
    same = one.trails == other.trails and one.objectives.tolist() == other.objectives.tolist()
    expect(same, message)


def _points(points: FloatArray) -> str:
    """Write the first of some points (n, 2); nothing if there is none."""
    return "".join(
        f"E[R] {reward:.6g} and E[S] {survivors:.6g}" for reward, survivors in points[:1]
    )
