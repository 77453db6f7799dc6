"""The exact front: equal to enumeration on tiny missions, within limits on others; by pymoo."""

import time
from math import inf

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba.core import event
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Exact, Mission, TrailPlan, load_mission
from botohe_moo.algorithms.exact.front import FrontSearch, TooLargeError, exact_front
from botohe_moo.algorithms.greedy.planner import MAX_BEAM_WIDTH
from tests.examples import examples
from tests.strategies import lengths, small_missions
from tests.twins import all_objectives, within


def mission_of(arcs, rewards, robots):
    graph = nx.DiGraph(base=0, robots=robots)
    graph.add_nodes_from((node, {"reward": r}) for node, r in enumerate(rewards))
    graph.add_weighted_edges_from(arcs, weight="survival")
    return Mission(graph, name="made")


def spurs(*survivals, rewards, robots):
    """The base, and nodes that are reached and left with one survival each way."""
    arcs = [(0, i, s) for i, s in enumerate(survivals, 1)]
    arcs += [(i, 0, s) for i, s in enumerate(survivals, 1)]
    return mission_of(arcs, rewards, robots)


def assert_is_front(mission, plans, every):
    """Within rounding: every team is covered, and no point of the front is beaten."""
    found = mission.evaluate(plans)
    near = 1.5e-12 * np.array([mission.total_reward, mission.robots])
    assert (found[:, None] + near >= every).all(axis=2).any(axis=0).all()
    beaten = (every >= found[:, None]).all(axis=2) & (every > found[:, None] + near).any(axis=2)
    assert not beaten.any()
    assert (np.diff(found[:, 0]) < 0).all()
    assert (np.diff(found[:, 1]) > 0).all()


def search_for(mission):
    return FrontSearch(mission, mission.world)


def run(search):
    while search.plans is None:
        search.advance()


class TestTruth:
    @examples(200)
    @given(
        small_missions(max_trails=50, lengths=lengths),
        st.sampled_from([0.0, 0.0, 0.3, 0.81, 1.0]),
        st.sampled_from([None, 0.0, 2.0, 4.0, 7.0]),
    )
    def test_it_equals_enumeration(self, case, least, longest):
        """One-way missions, safe arcs, nodes without reward, a base with reward among them."""
        mission, trails = case
        kept = within(mission, trails, least, inf if longest is None else longest)
        plans = exact_front(mission, min_survival=least, max_length=longest)
        assert_is_front(mission, plans, all_objectives(mission, kept))
        assert (mission.robot_survival(plans) >= least).all()
        if longest is not None:
            assert (mission.trail_lengths(plans) <= longest * (1 + 1e-12)).all()

    @examples(40)
    @given(small_missions(max_robots=1, max_trails=1000))
    def test_it_equals_enumeration_for_one_robot(self, case):
        mission, trails = case
        assert_is_front(mission, exact_front(mission), all_objectives(mission, trails))

    def test_two_robots_and_two_spurs(self):
        """4 behind survival 0.9, 3 behind 0.5, each way; counted by hand.

        Trails: stay (survives with 1), a (0.81), b (0.25), ab (0.2025: 3.6 + 0.405 · 3), ba
        (0.2025: 1.5 + 0.225 · 4).
        """
        plans = exact_front(spurs(0.9, 0.5, rewards=[0, 4, 3], robots=2))
        a, b, ab, ba = (0, 1, 0), (0, 2, 0), (0, 1, 0, 2, 0), (0, 2, 0, 1, 0)
        expected = {
            TrailPlan([(0,), (0,)]): (0.0, 2.0),
            TrailPlan([a, (0,)]): (3.6, 1.81),
            TrailPlan([a, a]): (3.96, 1.62),
            TrailPlan([ab, (0,)]): (4.815, 1.2025),
            TrailPlan([a, b]): (5.1, 1.06),
            TrailPlan([a, ba]): (5.19, 1.0125),  # 1 − 0.1 · 0.775 of 4, and 1.5
            TrailPlan([ab, b]): (5.7075, 0.4525),  # 3.6, and 1 − 0.5 · 0.595 of 3
            TrailPlan([ab, ab]): (5.897925, 0.405),  # 3.96, and 1 − 0.595² of 3
        }
        found = dict(zip(plans, mission_objectives(plans), strict=True))
        assert {p: pytest.approx(v) for p, v in expected.items()} == found


def mission_objectives(plans):
    mission = spurs(0.9, 0.5, rewards=[0, 4, 3], robots=2)
    return [tuple(row) for row in mission.evaluate(plans)]


class TestCorners:
    def test_nothing_to_find(self):
        robots = 2
        for mission in (
            mission_of([], [3.0], robots),
            spurs(0.9, rewards=[2.0, 0.0], robots=robots),
        ):
            assert list(exact_front(mission)) == [TrailPlan([(0,)] * robots)]

    def test_a_base_worth_more_than_all_else(self):
        mission = spurs(0.5, rewards=[1e15, 1e-3], robots=2)
        plans = exact_front(mission)  # of what rounding leaves of their rewards
        assert list(plans) == [TrailPlan([(0,), (0,)])]
        mission = spurs(0.5, rewards=[1e6, 1.0], robots=2)
        assert mission.evaluate(exact_front(mission))[:, 0] - 1e6 == pytest.approx([0.75, 0.5, 0])

    def test_points_that_rounding_tells_apart_are_one(self):
        """Two rings, alike but for the order of their arcs and a trace of reward."""
        arcs = [(0, 1, 0.7), (1, 2, 0.9), (2, 0, 0.9), (0, 3, 0.9), (3, 4, 0.9), (4, 0, 0.7)]
        mission = mission_of(arcs, [0, 0, 1 / 0.63, 0, (1 + 1e-14) / 0.81], 1)
        one, other = (TrailPlan([trail]) for trail in ([0, 1, 2, 0], [0, 3, 4, 0]))
        less, more = mission.evaluate([one, other])
        assert less[0] < more[0]
        assert less[1] > more[1]
        assert len(exact_front(mission)) == 3  # both rings, one of them, none

    def test_a_floor_that_is_met_exactly(self):
        mission = spurs(0.9, rewards=[0, 1], robots=1)
        survival = float(mission.robot_survival([TrailPlan([(0, 1, 0)])])[0, 0])
        for least, n in ((survival, 2), (np.nextafter(survival, 1), 1)):
            assert len(exact_front(mission, min_survival=float(least))) == n

    def test_a_budget_that_is_met_exactly(self):
        mission = spurs(0.9, rewards=[0, 1], robots=1)  # every hop is 1 long
        for longest, n in ((2, 2), (np.nextafter(2, 1), 1), (0, 1)):
            assert len(exact_front(mission, max_length=float(longest))) == n

    def test_more_arcs_and_goals_than_a_word_has_bits(self):
        arcs = [(i, i + 1, 0.99) for i in range(70)]
        mission = mission_of(arcs + [(v, u, s) for u, v, s in arcs], [0] + [1] * 70, 1)
        plans = exact_front(mission)
        there = [*range(71)]
        expected = [(*there[: n + 1], *there[:n][::-1]) for n in range(70, -1, -1)]
        assert [plan.trails[0] for plan in plans] == expected


class TestLimits:
    def test_none_is_meant_for_compiling(self, monkeypatch):
        search, advance = search_for(load_mission("toy")), FrontSearch._advance_trails

        def compiled(self):
            with event.trigger_event("numba:compiler_lock"):
                time.sleep(0.3)
            advance(self)

        monkeypatch.setattr(FrontSearch, "_advance_trails", compiled)
        began = time.perf_counter()
        search.advance()
        assert search._spent <= time.perf_counter() - began - 0.3

    def test_time(self):
        search = search_for(load_mission("complete", nodes=9, robots=2))
        search.advance()
        search.time_limit = search._spent
        with pytest.raises(TooLargeError, match=r"time_limit = \S+ seconds\. The search had tried"):
            search.advance()

    def test_memory(self):
        mission = load_mission("complete", nodes=8, robots=2)
        search = FrontSearch(mission, mission.world, memory_limit=1)
        said = r"memory_limit = 1 MiB\. The search had tried [1-9]\d* of [1-9]\d* partial trails"
        with pytest.raises(TooLargeError, match=said) as caught:
            run(search)
        message = str(caught.value)
        assert message.startswith("Mission 'complete' (8 nodes, 56 arcs, 2 robots): the exact")
        assert message.endswith("such as BOACO.")
        assert isinstance(caught.value, ValueError)
        assert 2**16 < search._trails.n_bytes < 2**20


PLENTY = ("n_eval", 10**6)
WIDE = MAX_BEAM_WIDTH  # cuts nothing


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
        result = minimize(BOTOHE(mission), Exact(), PLENTY)
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
