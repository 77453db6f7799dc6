"""The exact front: equal to enumeration on tiny missions, within limits on others; by pymoo."""

import time
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core import event
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Exact, TrailPlan, load_mission
from botohe_moo.algorithms.exact.front import FrontSearch, TooLargeError, exact_front
from tests.examples import examples
from tests.strategies import lengths, mission_of, small_missions
from tests.twins import all_objectives, within


def spurs(*survivals, rewards, robots):
    """The base, and nodes that are reached and left with one survival each way."""
    arcs = [(0, node, survival) for node, survival in enumerate(survivals, 1)]
    return mission_of(arcs, rewards, both_ways=True, robots=robots)


@examples(240)
@given(
    small_missions(max_trails=50, lengths=lengths) | small_missions(max_robots=1, max_trails=1000),
    st.sampled_from([0.0, 0.0, 0.3, 0.81, 1.0]),
    st.sampled_from([None, None, 0.0, 2.0, 4.0, 7.0]),
)
def test_it_equals_enumeration(case, least, longest):
    """One-way missions, safe arcs, nodes without reward, a base with reward among them."""
    mission, trails = case
    kept = within(mission, trails, least, inf if longest is None else longest)
    plans = exact_front(mission, min_survival=least, max_length=longest)
    found, every = mission.evaluate(plans), all_objectives(mission, kept)
    near = 1.5e-12 * np.array([mission.total_reward, mission.robots])
    assert (found[:, None] + near >= every).all(axis=2).any(axis=0).all()
    beaten = (every >= found[:, None]).all(axis=2) & (every > found[:, None] + near).any(axis=2)
    assert not beaten.any()
    assert (np.diff(found[:, 0]) < 0).all()
    assert (np.diff(found[:, 1]) > 0).all()
    assert (mission.robot_survival(plans) >= least).all()
    if longest is not None:
        assert (mission.trail_lengths(plans) <= longest * (1 + 1e-12)).all()


def test_two_robots_and_two_spurs():
    """4 behind survival 0.9, 3 behind 0.5, each way; counted by hand.

    Trails: stay (survives with 1), a (0.81), b (0.25), ab (0.2025: 3.6 + 0.405 · 3), ba
    (0.2025: 1.5 + 0.225 · 4).
    """
    mission = spurs(0.9, 0.5, rewards=[0, 4, 3], robots=2)
    plans, home = exact_front(mission), (0,)
    a, b, ab, ba = (0, 1, 0), (0, 2, 0), (0, 1, 0, 2, 0), (0, 2, 0, 1, 0)
    expected = {
        TrailPlan([home, home]): (0.0, 2.0),
        TrailPlan([a, home]): (3.6, 1.81),
        TrailPlan([a, a]): (3.96, 1.62),
        TrailPlan([ab, home]): (4.815, 1.2025),
        TrailPlan([a, b]): (5.1, 1.06),
        TrailPlan([a, ba]): (5.19, 1.0125),  # 1 − 0.1 · 0.775 of 4, and 1.5
        TrailPlan([ab, b]): (5.7075, 0.4525),  # 3.6, and 1 − 0.5 · 0.595 of 3
        TrailPlan([ab, ab]): (5.897925, 0.405),  # 3.96, and 1 − 0.595² of 3
    }
    found = dict(zip(plans, map(tuple, mission.evaluate(plans)), strict=True))
    assert {p: pytest.approx(v) for p, v in expected.items()} == found


@pytest.mark.parametrize(
    "mission",
    [
        mission_of([], [3.0], robots=2),
        spurs(0.9, rewards=[2.0, 0.0], robots=2),
        spurs(0.5, rewards=[1e15, 1e-3], robots=2),  # of what rounding leaves of their rewards
    ],
)
def test_nothing_to_find(mission):
    assert [plan.trails for plan in exact_front(mission)] == [((0,), (0,))]


def test_a_base_worth_more_than_all_else():
    mission = spurs(0.5, rewards=[1e6, 1.0], robots=2)
    assert mission.evaluate(exact_front(mission))[:, 0] - 1e6 == pytest.approx([0.75, 0.5, 0])


def test_points_that_rounding_tells_apart_are_one():
    """Two rings, alike but for the order of their arcs and a trace of reward."""
    arcs = [(0, 1, 0.7), (1, 2, 0.9), (2, 0, 0.9), (0, 3, 0.9), (3, 4, 0.9), (4, 0, 0.7)]
    mission = mission_of(arcs, [0, 0, 1 / 0.63, 0, (1 + 1e-14) / 0.81], robots=1)
    less, more = mission.evaluate([TrailPlan([[0, 1, 2, 0]]), TrailPlan([[0, 3, 4, 0]])])
    assert less[0] < more[0]
    assert less[1] > more[1]
    assert len(exact_front(mission)) == 3  # both rings, one of them, none


@pytest.mark.parametrize(
    ("limits", "n"),
    [
        ({"min_survival": 0.9 * 0.9}, 2),
        ({"min_survival": np.nextafter(0.9 * 0.9, 1)}, 1),
        ({"max_length": 2.0}, 2),  # every hop is 1 long
        ({"max_length": np.nextafter(2, 1)}, 1),
    ],
)
def test_limits_that_are_met_exactly(limits, n):
    mission = spurs(0.9, rewards=[0, 1], robots=1)
    assert len(exact_front(mission, **{key: float(limit) for key, limit in limits.items()})) == n


def test_more_arcs_and_goals_than_a_word_has_bits():
    arcs, there = [(i, i + 1, 0.99) for i in range(70)], [*range(71)]
    plans = exact_front(mission_of(arcs, [0] + [1] * 70, both_ways=True, robots=1))
    expected = [(*there[: n + 1], *there[:n][::-1]) for n in range(70, -1, -1)]
    assert [plan.trails[0] for plan in plans] == expected


def search_for(name, nodes, **options):
    mission = load_mission(name, nodes=nodes, robots=2)
    given = {"time_limit": 60.0, "memory_limit": 1024.0, **options}
    return FrontSearch(mission, mission.world, **given)


def run(search):
    while search.plans is None:
        search.advance()


def test_no_time_limit_is_meant_for_compiling(monkeypatch):
    search, advance = search_for("complete", 5), FrontSearch._advance_trails

    def compiled(self):
        with event.trigger_event("numba:compiler_lock"):
            time.sleep(0.3)
        advance(self)

    monkeypatch.setattr(FrontSearch, "_advance_trails", compiled)
    began = time.perf_counter()
    search.advance()
    assert search._spent <= time.perf_counter() - began - 0.3


def test_limits_of_time_and_memory():
    search = search_for("complete", 9)
    search.advance()
    search.time_limit = search._spent
    with pytest.raises(TooLargeError, match=r"time_limit = \S+ seconds\. The search had tried"):
        search.advance()
    search = search_for("complete", 8, memory_limit=1)
    said = (
        r"^Mission 'complete' \(8 nodes, 56 arcs, 2 robots\): the exact .*memory_limit = 1 MiB\. "
        r"The search had tried [1-9]\d* of [1-9]\d* partial trails.* such as BOACO\.$"
    )
    with pytest.raises(TooLargeError, match=said):
        run(search)
    assert issubclass(TooLargeError, ValueError)
    assert 2**16 < search._trails.n_bytes < 2**20


@pytest.fixture(scope="module")
def mission():
    """Of some thousand labels, so that the search takes several generations."""
    return load_mission("random", nodes=8, arc_probability=0.4, robots=2, seed=3)


@pytest.fixture(scope="module")
def front(mission):
    return list(exact_front(mission))


@pytest.mark.compiled_only
class TestExact:
    def test_result(self, mission, front):
        result = minimize(BOTOHE(mission), Exact(), ("n_eval", 10**6))
        assert list(result.X[:, 0]) == front
        assert np.array_equal(-result.F, mission.evaluate(front))
        assert not result.algorithm.has_next()
        assert result.algorithm.evaluator.n_eval == len({*front, mission.stay_home()})
        assert result.algorithm.n_gen > 5

    def test_budget_is_exact(self, mission, front):
        for budget in (1, 2, 5):
            result = minimize(BOTOHE(mission), Exact(), ("n_eval", budget))
            assert result.algorithm.evaluator.n_eval == len(result.X) == budget
            # Everybody at base, and those with most reward.
            assert {*front[: budget - 1]} <= {*result.X[:, 0]}

    def test_ended_before_the_search_is(self, mission):
        for termination in (("n_gen", 2), ("time", 1e-6)):
            result = minimize(BOTOHE(mission), Exact(), termination)
            assert [plan.trails for plan in result.X[:, 0]] == [((0,), (0,))]
            assert result.algorithm.evaluator.n_eval == 1
