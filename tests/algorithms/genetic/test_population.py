"""pymoo's population-based algorithms with this package's operators, archive and samplings."""

import inspect

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pymoo.algorithms.moo.nsga2 import NSGA2

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
from botohe_moo.operators import MixedMutation, PenaltyOnly, RuinRecreate, TrailSplice
from tests.examples import examples
from tests.strategies import lengths, missions, team_missions

MUSEUM, TOY = load_mission("art_museum"), load_mission("toy")


def begun(name, n_eval, *, pop_size=30, limits=(), **parameters):
    problem = BOTOHE(MUSEUM, **dict(limits))
    algorithm = make_algorithm(name, pop_size=pop_size, **parameters)
    return algorithm.setup(problem, termination=("n_eval", n_eval), seed=1)


def test_population_stays_what_pymoo_makes_it():
    result = begun("nsga2", 900).run()
    assert len(result.pop) == 30
    assert len(result.opt) > 30
    best = set(result.X.ravel())
    for one in result.pop[result.pop.get("rank") == 0]:
        # The population may have dropped what dominates it, since it is full.
        dominating = (result.F <= one.F).all(axis=1) & (result.F < one.F).any(axis=1)
        assert one.X[0] in best or dominating.any()
    assert len({i.X[0] for i in result.pop}) == 30  # no duplicates


RUIN = RuinRecreate(repair=PenaltyOnly())


@pytest.mark.parametrize("name", ["nsga2", "moead"])
@pytest.mark.parametrize(
    ("options", "are_repaired"),
    [
        ({"repair": "safest-path"}, True),
        ({"repair": "penalty"}, False),
        ({"mutation": RUIN}, True),
        ({"mutation": MixedMutation([RUIN])}, True),
    ],
)
def test_penalty_is_noticed_and_repairs_count_what_they_did(name, options, are_repaired):
    algorithm = begun(name, 200, pop_size=20, **options)
    result = algorithm.run()
    assert result.problem.allow_invalid == (options != {"repair": "safest-path"})
    MUSEUM.evaluate(result.X)
    counts = algorithm.repair.counts
    assert counts.plans > 0
    assert (counts.repaired > 0) == (counts.arcs_changed > 0) == are_repaired
    assert 0 < counts.seconds < 10


class TestMOEAD:
    def test_it_wants_one_child_of_each_pair(self):
        with pytest.raises(ValueError, match=r"crossover with n_offsprings = 1 .* got 2"):
            make_algorithm("moead", crossover=TrailSplice())
        make_algorithm("moead", crossover=TrailSplice(n_offsprings=1))

    def test_it_measures_objectives_by_their_bounds(self):
        most = np.array([MUSEUM.total_reward, MUSEUM.robots])
        half_of_each = begun("moead", 30).decomposition.do(
            -0.5 * np.diag(most), np.ones((2, 2)), ideal_point=-most
        )
        assert half_of_each == pytest.approx([1, 1])

    def test_it_forgets_the_ideal_of_a_start_that_breaks_the_floor(self):
        start = RandomTrailSampling().sample_batch(BOTOHE(MUSEUM), 400, np.random.default_rng(1))
        broken = start.take(MUSEUM.robot_survival(start).min(axis=1) < 0.5)[:30]
        limits = {"min_survival": 0.5}
        algorithm = begun("moead", 3_000, limits=limits, sampling=list(broken), corners=False)
        algorithm.next()
        assert not algorithm.pop.get("feas").any()
        algorithm.run()
        assert algorithm.opt.get("feas").all()
        assert algorithm.ideal.tolist() == algorithm.opt.get("F").min(axis=0).tolist()

    def test_it_replaces_by_violation_first(self):
        """Operators do not know the floor: children break it, and push out nobody who keeps it."""
        limits, broken = {"min_survival": 0.95}, 0
        algorithm = begun("moead", 3_000, limits=limits, sampling="random", corners=False)
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
        assert solve("toy", kind(), evaluations=130, seed=1).evaluations == 130
        assert kind().pop_size == size


def test_parameters_of_dotted_paths():
    algorithm = make_algorithm("pymoo.algorithms.moo.nsga3:NSGA3", pop_size=11)
    assert algorithm.ref_dirs.tolist() == [[w, 1 - w] for w in np.linspace(0, 1, 11)]
    assert make_algorithm("pymoo.algorithms.moo.rvea:RVEA", alpha=3.0).survival.alpha == 3.0


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("pymoo.nowhere:X", "cannot be imported .ModuleNotFoundError"),
        ("pymoo.algorithms.moo.cmopso:CMOPSO", "expected a population-based class of pymoo's"),
        ("pymoo.algorithms.moo.gde3:GDE3", "mates in a way of its own"),
        ("pymoo.algorithms.moo.moead:MOEAD", "it is wired already, as 'moead'"),
        ("pymoo.algorithms.moo.dnsga2:DNSGA2", "it evaluates plans beside any budget"),
        ("pymoo.algorithms.soo.nonconvex.ga:GA", "it minimises one objective"),
        ("pymoo.algorithms.moo.ctaea:CTAEA", "it never ends where"),
        ("numpy:pi", "expected a class derived from Algorithm, or a function"),
    ],
)
def test_dotted_paths_that_cannot_be_used(path, message):
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
    public = [kind for name, kind in vars(sampling).items() if not name.startswith("_")]
    concrete = {k for k in public if isinstance(k, type) and issubclass(k, PlanSampling)}
    assert concrete - {PlanSampling} == {type(make()) for make in SAMPLINGS.values()}


def sampled(maker, problem, n, seed=1):
    return maker.sample_batch(problem, n, np.random.default_rng(seed))


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
    try:
        problem = BOTOHE(mission, min_survival=floor, max_length=budget)
    except ValueError:  # a kind has no way to its end within the limits
        assume(False)
    batch, again = (sampled(SAMPLINGS[name](), problem, n) for _ in range(2))
    assert len(batch) == n
    mission.evaluate(batch)
    assert (problem.constrain_batch(batch) <= 0).all()
    assert [plan.trails for plan in again] == [plan.trails for plan in batch]


def test_given_plans_come_first_and_all():
    plans = [TOY.plan([[1, 2, 1], [1]]), TOY.plan([[1, 3, 1], [1, 2, 1]])]
    for n in (1, 2, 5):
        batch = sampled(GivenSampling(plans), BOTOHE(TOY), n)
        assert list(batch)[:2] == plans
        assert len(batch) == max(n, 2)


@pytest.mark.parametrize("n", [1, 5])
def test_corners_are_everybody_at_home_and_the_greedy_plan(n):
    batch = sampled(CornerSampling(), BOTOHE(TOY), n)
    assert len(batch) == n
    assert batch[0] == TOY.stay_home()
    others = TOY.evaluate(sampled(RandomTrailSampling(), BOTOHE(TOY), 300))
    assert n == 1 or TOY.evaluate([batch[1]])[0, 0] >= others[:, 0].max()


class Short(PlanSampling):
    """A sampling that loses a plan."""

    def _sample(self, problem, n_samples, rng):
        return problem.mission.batch([problem.mission.stay_home()] * (n_samples - 1))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MixedSampling([TrailPlan([[0]])]), "Expected a sampling to be a PlanSampling"),
        (lambda: CornerSampling("guided"), "Expected rest to be a PlanSampling"),
        (lambda: sampled(Short(), BOTOHE(TOY), 6), r"_sample of Short to give 6 plans, got 5\."),
        (
            lambda: sampled(GivenSampling([TrailPlan([[0, 4, 0], [0]])]), BOTOHE(TOY), 3),
            "is missing in mission 'toy'",
        ),
    ],
)
def test_samplings_that_are_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()
