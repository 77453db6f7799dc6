"""What holds for every registered algorithm, and for pymoo's own classes by their dotted paths.

That they conform is tested in tests/testing: here are small populations, drawn missions, and what
this package's algorithms promise beyond that.
"""

from functools import cache
from importlib.metadata import distribution

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pymoo.core.termination import TerminateIfAny
from pymoo.optimize import minimize
from pymoo.problems import get_problem
from pymoo.termination.default import DefaultMultiObjectiveTermination
from pymoo.termination.max_eval import MaximumFunctionCallTermination
from pymoo.termination.max_gen import MaximumGenerationTermination

from botohe_moo import BOTOHE, Kind, Mission, area_indicator, load_mission, make_algorithm
from botohe_moo.algorithms.base import ArchiveAlgorithm
from botohe_moo.algorithms.exact.front import exact_front
from botohe_moo.algorithms.registry import algorithm_parameters
from tests.examples import examples
from tests.strategies import lengths, mission_of, small_missions, small_team_missions
from tests.twins import all_objectives, within

pytestmark = pytest.mark.slow

# Those of this package; other packages' are theirs to test.
NAMES = (
    *("bo-aco", "exact", "greedy", "moead", "nsga2", "pareto-local-search", "random"),
    *("simulated-annealing", "sms-emoa", "spea2"),
)
DOTTED = ("pymoo.algorithms.moo.age:AGEMOEA", "pymoo.algorithms.moo.nsga3:NSGA3")
SEARCHING = "bo-aco with local search"
ENDS_BY_ITSELF = {"exact", "greedy"}  # when the front is found, when its sweep is done
FOR_SMALL_MISSIONS = {"exact"}
N_TRIES = 10  # to make new plans, in a generation


def small(name):
    """The algorithm with populations that small budgets can renew.

    Where it has seen all plans of a mission, it is to notice after few tries.
    """
    options = {}
    if name == SEARCHING:
        name, options = "bo-aco", {"local_search": 0.5, "local_search_evaluations": 4}
    known = {parameter.name for parameter in algorithm_parameters(name)}
    sizes = {"n_ants": 20, "pop_size": 20, "beam_width": 10, "n_weights": 9}
    sizes["evaluations_per_generation"] = 20
    options |= {key: value for key, value in sizes.items() if key in known}
    made = make_algorithm(name, **options)
    if mating := getattr(made, "mating", None):
        assert mating.n_max_iterations > N_TRIES
        mating.n_max_iterations = N_TRIES
    return made


def mission_for(name):
    """The museum, or a mission in its place that algorithms for small missions can solve."""
    if name in FOR_SMALL_MISSIONS:
        return load_mission("random", nodes=8, arc_probability=0.4, robots=2, seed=3)
    return load_mission("art_museum")


def test_all_names_are_under_contract():
    ours = distribution("botohe-moo").entry_points.select(group="botohe_moo.algorithms")
    assert set(NAMES) == {entry.name for entry in ours}


@pytest.mark.parametrize("name", ["bo-aco", "nsga2"])
def test_budgets_are_found_in_combined_terminations(name):
    for termination in (
        TerminateIfAny(MaximumFunctionCallTermination(133), MaximumGenerationTermination(1_000)),
        DefaultMultiObjectiveTermination(n_max_evals=133),
    ):
        result = minimize(BOTOHE(mission_for(name)), small(name), termination, seed=1)
        assert result.algorithm.evaluator.n_eval <= 133


WITH_BUDGET = [*NAMES, *DOTTED, SEARCHING]


def assert_nothing_lies_above(objectives, front, mission):
    """Whether every point is one of a front or below it, to rounding."""
    near = 2e-12 * np.array([mission.total_reward, mission.robots])
    assert (front[:, None] + near >= objectives).all(axis=2).any(axis=0).all()


@pytest.mark.parametrize("name", WITH_BUDGET)
@examples(32)
@given(
    case=small_missions(max_trails=60, lengths=lengths).map(lambda case: (case[0], [case[1]]))
    | small_team_missions(),
    floor=st.sampled_from([0.0, 0.0, 0.3, 0.81, 1.0]),
    budget=st.sampled_from([None, 0.0, 2.0, 4.0, 6.0, 9.0]),
    seed=st.integers(0, 9),
)
def test_results_keep_limits_and_are_not_above_the_truth(name, case, floor, budget, seed):
    """One-way missions, kinds that cannot get everywhere, and rewards on return among them."""
    mission, trails = case
    assume(name != "exact" or mission.is_plain)
    try:
        problem = BOTOHE(mission, min_survival=floor, max_length=budget)
    except ValueError:  # no way to the end keeps the limits
        assume(False)
    algorithms = small(name), small(name)
    algorithms[1].n_threads = 2  # which only ants know of
    result, other = (minimize(problem, each, ("n_eval", 90), seed=seed) for each in algorithms)
    plans = mission.batch(result.X)
    assert [plan.trails for plan in plans] == [plan.trails for (plan,) in other.X]
    assert np.array_equal(-result.F, mission.evaluate(plans))
    assert (result.G <= 0).all()
    limits = problem.limits.loosened(1e-12)
    assert (mission.robot_survival(plans) >= limits.floors).all()
    assert (mission.trail_lengths(plans) <= limits.budgets).all()
    firsts = [mission.kind_of.index(kind) for kind in mission.kinds]
    allowed = [
        within(mission, every, limits.floors[robot], limits.budgets[robot])
        for robot, every in zip(firsts, trails, strict=True)
    ]
    truth = all_objectives(mission, *allowed)
    assert_nothing_lies_above(-result.F, truth, mission)
    if name == "exact":
        assert_nothing_lies_above(truth, -result.F, mission)


@pytest.mark.parametrize("evaluations", [1, 40])
@pytest.mark.parametrize("name", [name for name in WITH_BUDGET if name != "exact"])
def test_where_the_safest_way_to_the_end_is_too_long(name, evaluations):
    short, long = [(*ends, 0.5, 2.0) for ends in ((0, 3), (3, 1), (0, 1))], [(0, 2), (2, 1)]
    arcs = [*short, *((*ends, 0.9, 9.0) for ends in long)]
    mission = mission_of(arcs, [1] * 4, kinds=[Kind("drone", 2, end=1)])
    problem = BOTOHE(mission, max_length=4.5)
    result = minimize(problem, small(name), ("n_eval", evaluations), seed=1)
    assert {trail for (plan,) in result.X for trail in plan.trails} <= {(0, 1), (0, 3, 1)}
    if evaluations > 1 and name != "greedy":
        assert result.F[:, 1].min() == -1.0


def test_exact_refuses_kinds_by_name():
    mission = load_mission("drones_and_rovers")
    told = "does not support mission 'drones_and_rovers', which has kinds of robots and rewards"
    with pytest.raises(TypeError, match=f"^Exact {told}"):
        minimize(BOTOHE(mission), make_algorithm("exact"), ("n_eval", 90))
    with pytest.raises(ValueError, match=f"^exact_front {told}"):
        exact_front(mission)


@cache
def area_on_sites(name):
    """The areas on a site, on it from elsewhere, and in the museum on return, all in all."""
    site = load_mission("drones_and_rovers")
    kinds = [Kind("rover", 2, start="lab 4"), Kind("drone", 1, end="roof")]
    found = 0.0
    for mission in (site, Mission(site.graph, kinds=kinds), load_mission("art_museum_return")):
        result = minimize(BOTOHE(mission), make_algorithm(name), ("n_eval", 1_000), seed=1)
        found += area_indicator(-result.F, mission)
    return found


@pytest.mark.parametrize("name", [name for name in NAMES if name not in ("exact", "random")])
def test_kinds_are_planned_better_than_at_random(name):
    assert area_on_sites(name) > 1.1 * area_on_sites("random")


@pytest.mark.parametrize("name", NAMES)
def test_starts_from_given_plans(name):
    museum = mission_for(name)
    start = minimize(BOTOHE(museum), make_algorithm("nsga2"), ("n_eval", 600), seed=1)
    algorithm = make_algorithm(name, sampling=start.X)
    result = minimize(BOTOHE(museum), algorithm, ("n_eval", len(start.X) + 40), seed=1)
    assert area_indicator(-result.F, museum) >= area_indicator(-start.F, museum) - 1e-12


# Greedy planning promises no more than plans that are best for some weight.
@pytest.mark.parametrize("name", [name for name in NAMES if name != "greedy"])
def test_one_way_missions_are_solved(name):
    """A spur, and a round trip of which no arc has a reverse: there annealing once stood still."""
    ends = [(0, 1), (1, 0), (0, 2), (2, 3), (3, 4), (4, 0)]
    mission = mission_of([(*arc, 0.95) for arc in ends], [0, 1, 5, 5, 5], robots=2)
    wanted = 0.9 * area_indicator(mission.evaluate(exact_front(mission)), mission)
    algorithm, area = make_algorithm(name), 0.0
    algorithm.setup(BOTOHE(mission), termination=("n_eval", 50_000), seed=1)
    while area < wanted and algorithm.has_next():
        algorithm.next()
        area = area_indicator(-algorithm.opt.get("F"), mission)
    assert area >= wanted


def test_problems_and_budgets_are_checked():
    for name in NAMES:
        with pytest.raises(TypeError, match="Expected a BOTOHE problem, got ZDT1"):
            make_algorithm(name).setup(get_problem("zdt1"), termination=("n_eval", 10))
        with pytest.raises(ValueError, match="Expected a budget of at least 1 evaluation, got 0"):
            make_algorithm(name).setup(BOTOHE(load_mission("toy")), termination=("n_eval", 0))


@pytest.mark.parametrize("name", NAMES)
def test_ask_and_tell_work_or_are_refused(name):
    problem, algorithm = BOTOHE(load_mission("toy")), small(name)
    algorithm.setup(problem, termination=("n_eval", 60), seed=1)
    if isinstance(algorithm, ArchiveAlgorithm):
        with pytest.raises(TypeError, match=r"evaluates its own plans: call next\(\), not ask"):
            algorithm.ask()
        return
    while algorithm.has_next():
        plans = algorithm.ask()
        algorithm.evaluator.eval(problem, plans)
        algorithm.tell(infills=plans)
    assert algorithm.evaluator.n_eval == 60
    assert len(algorithm.archive) > 0
