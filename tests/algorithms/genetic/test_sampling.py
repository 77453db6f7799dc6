"""Samplings: valid plans that keep the limits, repeatable, and what each begins with."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import BOTOHE, TrailPlan, load_mission
from botohe_moo.algorithms import (
    CornerSampling,
    GivenSampling,
    GuidedTrailSampling,
    MixedSampling,
    PlanSampling,
    RandomTrailSampling,
)
from botohe_moo.algorithms.genetic import sampling
from tests.examples import examples
from tests.strategies import lengths, missions, team_missions

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
