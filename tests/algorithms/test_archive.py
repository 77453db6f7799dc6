"""The archive against a readable twin that remembers every plan it was ever shown."""

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.algorithms.base import PlanArchive, PopulationArchive
from botohe_moo.core.walk import plan_hashes
from botohe_moo.trails import PlanBatch, TrailPlan
from tests.examples import examples

# Plans whose objectives are small integers, so that ties and repetitions abound; the last two
# are one plan with its robots in two orders, the two before are {A, A, B} and {A, B, B}.
HOME, A, B, C = (0,), (0, 1, 0), (0, 2, 0), (0, 1, 2, 0)
TRAILS = [[A] * 3, [B] * 3, [C] * 3, [HOME, A, C], [HOME] * 3, [A, A, B], [A, B, B]]
PLANS = [TrailPlan(trails) for trails in (*TRAILS, [A, B, C], [C, A, B])]


@st.composite
def showings(draw, n_objectives=2):
    """Draw what an archive is given at a time: numbers of plans, plans, objectives."""
    values, n = st.tuples(*[st.integers(0, 4)] * n_objectives), len(PLANS)
    drawn = draw(st.lists(values, min_size=n - 1, max_size=n - 1))
    objectives = np.array([*drawn, drawn[-1]], float)  # equal plans have equal objectives
    some = st.lists(st.integers(0, n - 1), min_size=1, max_size=8)
    return [
        (chosen, PlanBatch.from_plans([PLANS[i] for i in chosen], 3), objectives[chosen])
        for chosen in draw(st.lists(some, min_size=1, max_size=5))
    ]


def front(shown):
    """The twin: plans (each once) that nothing shown dominates."""
    every = np.array([*shown.values()])
    better = [(every >= f).all(axis=1) & (every > f).any(axis=1) for f in every]
    return {plan for plan, by in zip(shown, better, strict=True) if not by.any()}


@examples(500)
@given(st.data(), st.integers(2, 4))
def test_archive_is_the_front_of_all_it_was_shown(data, n_objectives):
    archive, shown = PlanArchive(3, n_objectives=n_objectives), {}
    for chosen, batch, objectives in data.draw(showings(n_objectives)):
        version, before = archive.version, set(archive.plans)
        members = archive.insert(batch, objectives)
        iteration = dict(zip(batch, objectives, strict=True))
        assert {PLANS[chosen[i]] for i in members} == front(iteration)
        assert len(members) == len(front(iteration))
        shown.update(iteration)
        assert set(archive.plans) == front(shown)
        assert len(archive) == len(archive.plans) == len(front(shown))
        assert (archive.version != version) == (set(archive.plans) != before)
        assert archive.objectives.tolist() == [shown[plan].tolist() for plan in archive.plans]
        assert (np.diff(archive.objectives[:, 0]) <= 0).all()
        assert n_objectives > 2 or (np.diff(archive.objectives[:, 1]) >= 0).all()


@examples(200)
@given(st.data(), st.integers(1, 3), st.integers(2, 3))
def test_no_more_ties_than_asked_for(data, max_ties, n):
    archive, free = (PlanArchive(3, max_ties=most, n_objectives=n) for most in (max_ties, 1_000))
    for _, batch, objectives in data.draw(showings(n)):
        for one in (archive, free):
            one.insert(batch, objectives)
        all_ties = Counter(map(tuple, free.objectives.tolist()))
        kept = Counter(map(tuple, archive.objectives.tolist()))
        assert kept == {key: min(n, max_ties) for key, n in all_ties.items()}
        assert set(archive.plans) <= set(free.plans)


@given(showings())
def test_individuals_stay_the_same_as_long_as_their_plans_do(shown):
    archive, made = PopulationArchive(3), {}
    for _, batch, objectives in shown:
        archive.insert(batch, objectives)
        population = archive.population()
        assert population is archive.population()
        assert [ind.X[0] for ind in population] == list(archive.plans)
        assert np.array_equal(-population.get("F"), archive.objectives)
        now = {ind.X[0]: ind for ind in population}
        assert all(made[plan] is now[plan] for plan in now if plan in made)
        made = now


def test_hashes_of_many_short_plans_differ():
    rng = np.random.default_rng(0)
    plans = {
        TrailPlan([[0, *rng.integers(1, 40, rng.integers(0, 4)), 0] for _ in range(2)])
        for _ in range(5_000)
    }
    hashes = plan_hashes(*PlanBatch.from_plans(plans, 2).arrays, 2)
    assert len({*hashes.tolist()}) == len(plans)


def test_plans_with_nan_objectives_are_left_out():
    objectives = np.array([[1.0, 1.0], [np.nan, 5.0], [0.5, 2.0]])
    batch, archive = PlanBatch.from_plans(PLANS[:3], 3), PlanArchive(3)
    assert archive.insert(batch, objectives).tolist() == [0, 2]
    assert list(archive.plans) == [PLANS[0], PLANS[2]]
