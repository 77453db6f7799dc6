"""pymoo's population-based algorithms with this package's operators, archive and samplings."""

import inspect

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, TrailPlan, load_mission, make_algorithm, solve
from botohe_moo.algorithms import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
    PopulationAlgorithm,
    RandomTrailSampling,
)
from botohe_moo.algorithms.genetic import sampling
from botohe_moo.operators import (
    MixedMutation,
    PenaltyOnly,
    RuinRecreate,
    SafestPathRepair,
    TrailSplice,
    TruncateRepair,
)
from tests.examples import examples
from tests.strategies import lengths, missions, team_missions


@pytest.fixture(scope="module")
def museum():
    return load_mission("art_museum")


def test_population_stays_what_pymoo_makes_it(museum):
    result = minimize(BOTOHE(museum), make_algorithm("nsga2", pop_size=30), ("n_eval", 900), seed=1)
    assert len(result.pop) == 30
    assert len(result.opt) > 30
    best = set(result.X.ravel())
    for one in result.pop[result.pop.get("rank") == 0]:
        # The population may have dropped what dominates it, since it is full.
        dominating = (result.F <= one.F).all(axis=1) & (result.F < one.F).any(axis=1)
        assert one.X[0] in best or dominating.any()
    assert len({i.X[0] for i in result.pop}) == 30  # no duplicates


@pytest.mark.parametrize("name", ["nsga2", "moead"])
def test_repairs_count_what_they_did(museum, name):
    for repair, kind in [
        ("safest-path", SafestPathRepair),
        ("penalty", PenaltyOnly),
        (TruncateRepair(), TruncateRepair),
    ]:
        algorithm = make_algorithm(name, pop_size=20, repair=repair)
        result = minimize(BOTOHE(museum, min_survival=0.1), algorithm, ("n_eval", 200), seed=1)
        museum.evaluate(result.X.ravel())
        counts = result.algorithm.repair.counts
        assert type(result.algorithm.repair) is kind
        assert counts.plans >= 180
        assert (counts.repaired > 0) == (kind is not PenaltyOnly)
        assert (counts.arcs_changed > 0) == (kind is not PenaltyOnly)
        assert 0 < counts.seconds < 10


def test_penalty_is_seen_in_operators_given_as_objects(museum):
    for mutation in (
        RuinRecreate(repair=PenaltyOnly()),
        MixedMutation([RuinRecreate(repair=PenaltyOnly())]),
    ):
        algorithm = make_algorithm("nsga2", mutation=mutation, pop_size=20)
        result = minimize(BOTOHE(museum), algorithm, ("n_eval", 100), seed=1)
        assert result.problem.allow_invalid
        museum.evaluate(result.X)


def test_moead_wants_one_child_of_each_pair(museum):
    with pytest.raises(ValueError, match=r"Expected a crossover with n_offsprings = 1 .* got 2"):
        make_algorithm("moead", crossover=TrailSplice())
    make_algorithm("moead", crossover=TrailSplice(n_offsprings=1))


def test_moead_measures_objectives_by_their_bounds(museum):
    algorithm = make_algorithm("moead", pop_size=30)
    algorithm.setup(BOTOHE(museum), termination=("n_eval", 30), seed=1)
    half_of_each = algorithm.decomposition.do(
        -0.5 * np.array([[museum.total_reward, 0], [0, museum.robots]]),
        np.ones((2, 2)),
        ideal_point=-np.array([museum.total_reward, museum.robots]),
    )
    assert half_of_each == pytest.approx([1, 1])


def test_moead_forgets_the_ideal_of_a_start_that_breaks_the_floor(museum):
    start = RandomTrailSampling().sample_batch(BOTOHE(museum), 400, np.random.default_rng(1))
    broken = start.take(museum.robot_survival(start).min(axis=1) < 0.5)[:30]
    assert len(broken) == 30
    algorithm = make_algorithm("moead", pop_size=30, sampling=list(broken), corners=False)
    algorithm.setup(BOTOHE(museum, min_survival=0.5), termination=("n_eval", 3_000), seed=1)
    algorithm.next()
    assert not algorithm.pop.get("feas").any()
    algorithm.run()
    assert algorithm.opt.get("feas").all()
    assert algorithm.ideal.tolist() == algorithm.opt.get("F").min(axis=0).tolist()


def test_moead_replaces_by_violation_first(museum):
    problem = BOTOHE(museum, min_survival=0.95)
    algorithm = make_algorithm("moead", pop_size=30, sampling="random", corners=False)
    algorithm.setup(problem, termination=("n_eval", 3_000), seed=1)
    # Operators do not know the floor: children break it, and must not push out who keeps it.
    broken = 0
    while algorithm.has_next():
        algorithm.next()
        assert algorithm.pop.get("feas").all()
        broken += (~algorithm.off.get("feas")).sum()
    assert broken > 100


def test_classes_of_your_own_need_no_init():
    class Plain(PopulationAlgorithm, NSGA2):
        pass

    class Small(PopulationAlgorithm, NSGA2):
        def __init__(self):
            super().__init__({"pop_size": 10})

    stated = inspect.signature(Plain).parameters
    assert "mutation" in stated
    assert "arguments" not in stated
    assert not inspect.signature(Small).parameters  # it takes none
    for kind, size in [(Plain, 100), (Small, 10)]:
        solution = solve("toy", kind(), evaluations=130, seed=1)
        assert solution.evaluations == 130
        assert kind().pop_size == size


class TestDottedPaths:
    def test_directions_are_spread_over_the_population(self):
        algorithm = make_algorithm("pymoo.algorithms.moo.nsga3:NSGA3", pop_size=11)
        assert algorithm.ref_dirs.tolist() == [[w, 1 - w] for w in np.linspace(0, 1, 11)]

    def test_own_parameters_reach_pymoo(self):
        assert make_algorithm("pymoo.algorithms.moo.rvea:RVEA", alpha=3.0).survival.alpha == 3.0

    def test_what_cannot_be_used_is_refused(self):
        for path, message in [
            ("pymoo.nowhere:X", "cannot be imported .ModuleNotFoundError"),
            ("pymoo.algorithms.moo.cmopso:CMOPSO", "expected a population-based class of pymoo's"),
            ("pymoo.algorithms.moo.gde3:GDE3", "mates in a way of its own"),
            ("pymoo.algorithms.moo.moead:MOEAD", "it is wired already, as 'moead'"),
            ("pymoo.algorithms.moo.dnsga2:DNSGA2", "it evaluates plans beside any budget"),
            ("pymoo.algorithms.soo.nonconvex.ga:GA", "it minimises one objective"),
            ("pymoo.algorithms.moo.ctaea:CTAEA", "it never ends where"),
            ("numpy:pi", "expected a class derived from Algorithm, or a function"),
        ]:
            with pytest.raises(ValueError, match=message):
                make_algorithm(path)


SAMPLINGS = {
    "random": RandomTrailSampling,
    "guided": GuidedTrailSampling,
    "corners": CornerSampling,
    "none given": lambda: GivenSampling([]),
    "mixed": lambda: MixedSampling({RandomTrailSampling(): 1, GuidedTrailSampling(): 2}),
}


def test_every_sampling_is_under_contract():
    concrete = {
        kind
        for name, kind in vars(sampling).items()
        if isinstance(kind, type) and issubclass(kind, PlanSampling) and not name.startswith("_")
    }
    assert concrete - {PlanSampling} == {type(make()) for make in SAMPLINGS.values()}


def generator(seed):
    return np.random.default_rng(seed)


def trails_of(pop):
    return [individual.X[0].trails for individual in pop]


@pytest.fixture
def toy():
    return load_mission("toy")


def problem_of(mission, **limits):
    """A problem, if every kind has a way to its end within the limits."""
    try:
        return BOTOHE(mission, **limits)
    except ValueError:
        assume(False)


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLINGS)
@examples(60)
@given(
    mission=missions(max_nodes=8, lengths=lengths) | team_missions(lengths=lengths),
    floor=st.sampled_from([0.0, 0.5, 0.9]),
    budget=st.sampled_from([None, 0.0, 3.0, 7.0]),
    n=st.integers(1, 7),
)
def test_samplings(name, mission, floor, budget, n):
    problem = problem_of(mission, min_survival=floor, max_length=budget)
    pop = SAMPLINGS[name]()(problem, n, random_state=generator(n))
    assert len(pop) == n
    batch = mission.batch(pop.get("X"))
    mission.evaluate(batch)
    assert (problem.constrain_batch(batch) <= 0).all()
    again = SAMPLINGS[name]()(problem, n, random_state=generator(n))
    assert trails_of(again) == trails_of(pop)


def test_given_plans_come_first_and_all():
    toy = load_mission("toy")
    plans = [toy.plan([[1, 2, 1], [1]]), toy.plan([[1, 3, 1], [1, 2, 1]])]
    for n, more in ((1, 0), (2, 0), (5, 3)):
        batch = GivenSampling(plans).sample_batch(BOTOHE(toy), n, generator(1))
        assert list(batch)[:2] == plans
        assert len(batch) == 2 + more
    with pytest.raises(ValueError, match="is missing in mission 'toy'"):
        GivenSampling([TrailPlan([[0, 4, 0], [0]])]).sample_batch(BOTOHE(toy), 3, generator(1))


def test_corners(toy):
    batch = CornerSampling().sample_batch(BOTOHE(toy), 5, np.random.default_rng(1))
    assert toy.labels(batch[0]) == ((1,), (1,))
    greedy = toy.evaluate([batch[1]])[0, 0]
    others = toy.evaluate(
        RandomTrailSampling().sample_batch(BOTOHE(toy), 300, np.random.default_rng(1))
    )
    assert greedy >= others[:, 0].max()
    assert len(batch) == 5
    assert len(CornerSampling().sample_batch(BOTOHE(toy), 1, np.random.default_rng(1))) == 1


def test_mixtures(toy):
    mixed = MixedSampling([RandomTrailSampling(), GuidedTrailSampling()])
    assert len(mixed.sample_batch(BOTOHE(toy), 9, np.random.default_rng(1))) == 9
    with pytest.raises(TypeError, match="Expected a sampling to be a PlanSampling"):
        MixedSampling([TrailPlan([[0]])])
    with pytest.raises(TypeError, match="Expected rest to be a PlanSampling"):
        CornerSampling("guided")


class Short(PlanSampling):
    """A sampling that loses a plan."""

    def _sample(self, problem, n_samples, rng):
        return problem.mission.batch([problem.mission.stay_home()] * (n_samples - 1))


def test_a_sampling_that_loses_plans_is_named(toy):
    with pytest.raises(ValueError, match=r"_sample of Short to give 6 plans, got 5\."):
        Short().sample_batch(BOTOHE(toy), 6, np.random.default_rng(0))
