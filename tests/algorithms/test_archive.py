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
A, B, C = (0, 1, 0), (0, 2, 0), (0, 1, 2, 0)
TRAILS = [
    [A, A, A],
    [B, B, B],
    [C, C, C],
    [(0,), A, C],
    [(0,), (0,), (0,)],
    [A, A, B],
    [A, B, B],
    [A, B, C],
    [C, A, B],
]
PLANS = [TrailPlan(trails) for trails in TRAILS]


def dominates(one, other):
    return all(one >= other) and any(one > other)


def front(shown):
    """The twin: plans (each once) that nothing shown dominates."""
    return {
        plan
        for plan, objectives in shown.items()
        if not any(dominates(other, objectives) for other in shown.values())
    }


def draw_objectives(data, n_objectives=2):
    values = data.draw(
        st.lists(
            st.tuples(*[st.integers(0, 4)] * n_objectives),
            min_size=len(PLANS) - 1,
            max_size=len(PLANS) - 1,
        )
    )
    return np.array([*values, values[-1]], float)  # equal plans have equal objectives


@examples(500)
@given(st.data(), st.integers(2, 4))
def test_archive_is_the_front_of_all_it_was_shown(data, n_objectives):
    objectives = draw_objectives(data, n_objectives)
    archive, shown = PlanArchive(3, n_objectives=n_objectives), {}
    for _ in range(data.draw(st.integers(1, 5))):
        drawn = data.draw(st.lists(st.integers(0, len(PLANS) - 1), min_size=1, max_size=8))
        batch = PlanBatch.from_plans([PLANS[i] for i in drawn], 3)
        version, before = archive.version, set(archive.plans)
        members = archive.insert(batch, objectives[drawn])

        iteration = {PLANS[i]: objectives[i] for i in drawn}
        assert {PLANS[drawn[i]] for i in members} == front(iteration)
        assert len(members) == len(front(iteration))
        shown.update(iteration)
        assert set(archive.plans) == front(shown)
        assert len(archive) == len(archive.plans) == len(front(shown))
        assert (archive.version != version) == (set(archive.plans) != before)
        for plan, found in zip(archive.plans, archive.objectives, strict=True):
            assert found.tolist() == shown[plan].tolist()
        order = archive.objectives[:, 0]
        assert (np.diff(order) <= 0).all()
        assert n_objectives > 2 or (np.diff(archive.objectives[:, 1]) >= 0).all()


@examples(200)
@given(st.data(), st.integers(1, 3), st.integers(2, 3))
def test_no_more_ties_than_asked_for(data, max_ties, n):
    objectives = draw_objectives(data, n)
    archive, free = (PlanArchive(3, max_ties=most, n_objectives=n) for most in (max_ties, 1_000))
    for _ in range(3):
        drawn = data.draw(st.lists(st.integers(0, len(PLANS) - 1), min_size=1, max_size=8))
        batch = PlanBatch.from_plans([PLANS[i] for i in drawn], 3)
        for one in (archive, free):
            one.insert(batch, objectives[drawn])
        all_ties = Counter(map(tuple, free.objectives.tolist()))
        kept = Counter(map(tuple, archive.objectives.tolist()))
        assert kept == {key: min(n, max_ties) for key, n in all_ties.items()}
        assert set(archive.plans) <= set(free.plans)


@given(st.data())
def test_individuals_stay_the_same_as_long_as_their_plans_do(data):
    objectives = draw_objectives(data)
    archive, made = PopulationArchive(3), {}
    for _ in range(4):
        drawn = data.draw(st.lists(st.integers(0, len(PLANS) - 1), min_size=1, max_size=4))
        batch = PlanBatch.from_plans([PLANS[i] for i in drawn], 3)
        archive.insert(batch, objectives[drawn])
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
    batch = PlanBatch.from_plans(plans, 2)
    hashes = set(plan_hashes(*batch.arrays, 2).tolist())
    assert len(hashes) == len(plans)


def test_plans_with_nan_objectives_are_left_out():
    objectives = np.array([[1.0, 1.0], [np.nan, 5.0], [0.5, 2.0]])
    batch, archive = PlanBatch.from_plans(PLANS[:3], 3), PlanArchive(3)
    assert archive.insert(batch, objectives).tolist() == [0, 2]
    assert list(archive.plans) == [PLANS[0], PLANS[2]]
