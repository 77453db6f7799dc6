"""What searches give each other, in plain Python, against the front of all that they hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import TrailPlan, load_mission
from botohe_moo.algorithms.local_search.engine import LocalSearch
from botohe_moo.algorithms.local_search.kernels import exchange
from botohe_moo.algorithms.local_search.kernels import plans as plans_module
from botohe_moo.algorithms.local_search.kernels.exchange import join_news
from botohe_moo.core.ordered import count_turn
from botohe_moo.core.rng import hash_stretch
from tests import twins
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.twins import plain_local_search

# Plans of the toy mission, none of which dominates another one.
PLANS = ([[1, 3, 1], [1]], [[1, 3, 1], [1, 3, 1]], [[1, 2, 4, 3, 1], [1]])


@pytest.fixture(autouse=True)
def plain():
    with plain_local_search() as patch:
        yield patch


def searches(mission, plan, n, *, evaluations=30, **options):
    """Searches from the same start that have gone on by themselves."""
    found = []
    for seed in range(n):
        rng = np.random.default_rng(seed)
        search = LocalSearch(mission, twins.alike(mission, 0.0, np.inf), random_state=rng)
        search.insert(mission.batch([mission.stay_home(), plan]))
        search.run(evaluations)
        found.append(search)
    return found


def front(objectives):
    """The non-dominated of some points, by descending reward, as far as doubles tell them apart."""
    kept, most = [], -1.0
    for reward, survivors in sorted(objectives.tolist(), reverse=True):
        if survivors > most * (1 + 1e-11):
            kept.append((reward, survivors))
            most = survivors
    return np.array(kept)


def assert_whole(search):
    """The front's objectives are those of its plans, and each trail is counted by its users."""
    plans, objectives, numbers = search.plans()
    assert np.array_equal(search.mission.evaluate(plans), objectives)
    assert len(set(numbers.tolist())) == len(plans)
    users = np.bincount(search._front.plan[twins.slots(search)].ravel())
    stored = search._store.trails["n_users"]
    assert np.array_equal(stored[: len(users)], users)
    assert not stored[len(users) :].any()
    store = search._store
    used = np.flatnonzero(stored)
    assert not np.isin(store.spare[: store.n.spare], used).any()
    for trail in store.trails[used]:  # those that were told have a hash
        arcs = store.arc[trail["first_arc"] : trail["end_arc"]]
        assert trail["hash"] in (0, hash_stretch(arcs, 0, len(arcs)))
    kinds, plan = search.mission.arrays.kinds, search._front.plan[twins.slots(search)]
    if kinds is not None:  # trails without arcs differ by where they start
        starts = np.broadcast_to(kinds.start, plan.shape)
        assert len({*zip(plan.ravel(), starts.ravel(), strict=True)}) == len(np.unique(plan))
    work = search._work
    for slot, found in zip(twins.slots(search), objectives, strict=True):
        work.trails[:] = search._front.plan[slot]  # what they reach is stored, too
        assert list(plans_module.evaluate_trails(search._graph, store, work)) == found.tolist()


@examples(40)
@given(case=st.one_of(missions_with_plans(), team_missions_with_plans()), n=st.integers(1, 3))
def test_all_fronts_become_the_front_of_all(case, n):
    mission, plan = case
    found = searches(mission, plan, n)
    expected = front(np.vstack([search.objectives() for search in found]))
    news = join_news([search.news(0) for search in found])
    assert len(news.reward) == sum(map(len, found))
    for search in found:
        search.take_over(news)
        assert_whole(search)
        np.testing.assert_allclose(front(search.objectives()), expected, rtol=1e-10)


def test_news_are_what_has_entered_since():
    mission = load_mission("toy")
    [search] = searches(mission, mission.stay_home(), 1, evaluations=0)
    known = search.version
    assert len(search.news(known).reward) == 0
    search.insert(mission.batch([mission.plan([[1, 3, 1], [1]])]))
    news = search.news(known)
    assert news.reward.tolist() == [search.objectives()[0, 0]]
    assert news.survivors.tolist() == [search.objectives()[0, 1]]
    # Robots come in the order of their trails; each trail is given once, also one without arcs.
    arcs = search._graph.head[news.arc].tolist()
    assert (news.plan.tolist(), news.first.tolist(), arcs) == ([[0, 1]], [0, 0, 2], [2, 0])


def turns(search):
    return search._front.tried[twins.slots(search)].tolist()


def take_turns(search, *numbers):
    for slot, n in zip(twins.slots(search), numbers, strict=True):
        for _ in range(n):
            count_turn(search._front, slot)


def exchanged(found, known):
    news = join_news([search.news(n) for search, n in zip(found, known, strict=True)])
    for search in found:
        search.take_over(news)
        assert not search._front.untold.any()
    return [search.version for search in found]


def test_turns_are_those_of_all():
    mission = load_mission("toy")
    found = searches(mission, mission.stay_home(), 2, evaluations=0)
    found[0].insert(mission.batch([mission.plan(plan) for plan in PLANS]))
    take_turns(found[0], 0, 5, 1, 2)
    # The first turn of a new plan is its finder's, also where it is still to come.
    known = exchanged(found, [1, 1])
    assert [turns(search) for search in found] == [[0, 5, 1, 2], [1, 5, 1, 2]]
    take_turns(found[0], 3, 0, 1, 0)
    take_turns(found[1], 2, 4, 0, 0)
    for _ in range(2):  # each is told once
        known = exchanged(found, known)
        assert [turns(search) for search in found] == [[5, 9, 2, 2], [6, 9, 2, 2]]


def test_turns_of_plans_that_have_left_are_forgotten():
    mission = load_mission("toy")
    found = searches(mission, mission.plan([[1, 2, 1], [1, 3, 1]]), 2, evaluations=0)
    known = exchanged(found, [0, 0])
    take_turns(found[0], 7, 0)
    found[1].insert(mission.batch([mission.plan([[1, 3, 1], [1]])]))
    exchanged(found, known)
    assert [turns(search) for search in found] == [[1, 0], [0, 0]]


@pytest.mark.parametrize("room", [0, 1, 2])
def test_where_there_is_no_room_it_says_how_far_it_came(room):
    mission = load_mission("toy")
    one, other = searches(mission, mission.stay_home(), 2, evaluations=0)
    one.insert(mission.batch([mission.plan(plan) for plan in PLANS]))
    news = join_news([one.news(1)])
    other._front.n.spare = room
    n = exchange.take_over(other.parts, news, 0)
    assert n <= len(news.reward)
    assert (other._front.n.spare == 0) == (n < len(news.reward))
    other.take_over(news)
    assert np.array_equal(one.objectives(), other.objectives())
    assert_whole(other)


def test_trails_that_are_there_are_not_stored_again():
    mission = load_mission("toy")
    one, other = searches(mission, mission.plan(PLANS[0]), 2, evaluations=0)
    one.insert(mission.batch([mission.plan(plan) for plan in PLANS]))
    before = np.count_nonzero(other._store.trails["n_users"])
    other.take_over(join_news([one.news(0), other.news(0), one.news(0)]))
    assert len(other) == 4
    assert np.count_nonzero(other._store.trails["n_users"]) == before + 1
    assert_whole(other)


def test_a_plan_that_is_as_good_is_not_taken_over():
    mission = load_mission("toy")
    one, other = searches(mission, TrailPlan([[0, 1, 0], [0]]), 2, evaluations=0)
    before = other.version
    other.take_over(join_news([one.news(0), one.news(0)]))
    assert other.version == before


def with_trails_of_plans():
    """A search that was told of all trails in PLANS, and another one, of the toy mission."""
    mission = load_mission("toy")
    one, other = searches(mission, mission.plan(PLANS[0]), 2, evaluations=0)
    one.insert(mission.batch([mission.plan(plan) for plan in PLANS]))
    other.take_over(join_news([one.news(0), other.news(0)]))
    return one, other


def told_of_another_plan(one, other):
    """Tell a search of a plan that consists of known trails; return how many it has stored."""
    known, before = one.version, np.count_nonzero(other._store.trails["n_users"])
    one.insert(one.mission.batch([one.mission.plan(([1, 2, 4, 3, 1], [1, 3, 1]))]))
    other.take_over(join_news([one.news(known), other.news(other.version)]))
    assert len(other) == len(one) == 5
    assert np.array_equal(one.objectives(), other.objectives())
    assert_whole(other)
    return np.count_nonzero(other._store.trails["n_users"]) - before


def test_trails_are_found_again_where_there_is_more_room():
    one, other = with_trails_of_plans()
    other._keep(twins.slots(other))
    assert told_of_another_plan(one, other) == 0


@pytest.mark.parametrize(("n_arcs", "n_stored"), [(0, 2), (2, 1), (4, 1)])
def test_what_is_noted_of_trails_may_be_out_of_date(n_arcs, n_stored):
    """All places lead to a trail of some length."""
    one, other = with_trails_of_plans()
    trails = other._store.trails
    other._store.told[:] = np.flatnonzero((trails["n_users"] > 0) & (trails["n_arcs"] == n_arcs))[0]
    assert told_of_another_plan(one, other) == n_stored


def test_a_trail_that_no_plan_has_any_more_is_stored_anew():
    one, other = with_trails_of_plans()
    trails = other._store.trails
    longest = (trails["n_arcs"] * (trails["n_users"] > 0)).argmax()
    [*_, unused] = np.flatnonzero(trails["n_users"] == 0)
    trails[unused] = trails[longest]
    trails["n_users"][unused] = 0
    other._store.told[:] = unused
    assert told_of_another_plan(one, other) == 2


def test_trails_of_equal_length_are_told_apart():
    mission = load_mission("toy")
    one, other = searches(mission, mission.plan(([1, 3, 4, 3, 1], [1])), 2, evaluations=0)
    trails = other._store.trails
    [stored] = np.flatnonzero((trails["n_users"] > 0) & (trails["n_arcs"] == 4))
    other._store.told[:] = stored
    known = one.version
    one.insert(mission.batch([mission.plan(([1, 2, 4, 3, 1], [1]))]))
    other.take_over(join_news([one.news(known), other.news(other.version)]))
    assert one.version > known
    assert np.array_equal(one.objectives(), other.objectives())
    assert_whole(other)


def test_trails_without_arcs_differ_by_kind():
    mission = load_mission("drones_and_rovers")
    one, other = searches(mission, mission.stay_home(), 2, evaluations=0)
    other._store.told[:] = other._front.plan[twins.slots(other)[0], 0]
    known = one.version
    one.run(30)
    other.take_over(join_news([one.news(known), other.news(other.version)]))
    assert len(other) > 1
    assert_whole(other)
