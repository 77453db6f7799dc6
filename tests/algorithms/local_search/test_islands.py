"""Lanes: what they are told, the same result for any number of threads, and what they share."""

import copy
import pickle

import networkx as nx
import numpy as np
import pytest

from botohe_moo import Mission, load_mission
from botohe_moo.algorithms.local_search import islands as module
from botohe_moo.algorithms.local_search.engine import LocalSearch
from botohe_moo.algorithms.local_search.islands import Lanes
from botohe_moo.algorithms.local_search.kernels.workspace import REFILLED_AT_ONCE, REFILLED_IN_LANES
from botohe_moo.search.sequential import SequentialPlanner


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Lanes begin after few evaluations, with few plans."""
    monkeypatch.setattr(module, "FIRST_ALONE", 300)
    monkeypatch.setattr(module, "N_NEWS", 10)


@pytest.fixture(scope="module", params=["art_museum", "drones_and_rovers", "art_museum_return"])
def mission(request):
    return load_mission(request.param)


def started(mission, *, n_lanes, n_threads=1, seed=0, **options):
    search = Lanes(
        mission,
        mission.limits(),
        n_lanes=n_lanes,
        n_threads=n_threads,
        random_state=np.random.default_rng(seed),
        **options,
    )
    search.insert(mission.batch([mission.stay_home()]))
    return search


def same(one, other):
    found, again = one.plans(), other.plans()
    return [plan.trails for plan in found[0]] == [plan.trails for plan in again[0]] and all(
        a.tobytes() == b.tobytes() for a, b in zip(found[1:], again[1:], strict=True)
    )


def test_one_lane_is_the_search_alone(mission):
    lanes, rng = started(mission, n_lanes=1), np.random.default_rng(0)
    alone = LocalSearch(mission, mission.limits(), random_state=rng)
    alone.insert(mission.batch([mission.stay_home()]))
    for n in (100, 400, 501):
        assert lanes.run(n) == alone.run(n) == n
    assert same(lanes, alone)


@pytest.mark.parametrize("n_threads", [2, 3, 8])
def test_threads_do_not_change_results(mission, n_threads):
    one, other = (started(mission, n_lanes=4, n_threads=n) for n in (1, n_threads))
    for n in (300, 403, 5, 2, 900):
        assert one.run(n) == other.run(n) == n
        assert same(one, other)


def test_all_lanes_are_told_what_others_found(mission):
    lanes = started(mission, n_lanes=3)
    for n in (300, 1, 400, 1_000):
        version, before = lanes.version, lanes.objectives()
        lanes.run(n)
        assert (lanes.version > version) == (lanes.objectives().tobytes() != before.tobytes())
        for lane in lanes._lanes:  # each was told before it went on
            assert all((lane.objectives() >= point * (1 - 1e-11)).all(1).any() for point in before)
        plans, objectives, numbers = lanes.plans()
        assert np.array_equal(mission.evaluate(plans), objectives)
        assert len(set(numbers.tolist())) == len(lanes)
    assert len(lanes._lanes) == 3
    assert lanes._untold[0] is None
    for lane, news in zip(lanes._lanes[1:], lanes._untold[1:], strict=True):
        lane.take_over(news)
        np.testing.assert_allclose(lane.objectives(), lanes.objectives(), rtol=1e-11)
    assert len({lane._states.tobytes() for lane in lanes._lanes}) == 3  # each draws for itself


def test_lanes_begin_when_the_first_has_searched_for_long(mission):
    lanes = started(mission, n_lanes=5)
    numbers = []
    for _ in range(4):
        lanes.run(100)
        numbers.append(len(lanes._lanes))
    assert numbers == [1, 1, 1, 5]


def test_small_fronts_need_no_lanes(mission):
    lanes = started(mission, n_lanes=3, max_size=9)
    assert lanes.run(300) == 300
    assert lanes.run(300) == 300
    assert lanes.n_running == 1


def test_lanes_that_find_no_move_leave_the_evaluations_to_others():
    museum = load_mission("art_museum")
    lanes = started(museum, n_lanes=8, moves={"adopt": 1.0}, p_refill=0.0)
    plans = SequentialPlanner(museum, museum.limits(), beam_width=20).plans(1.0)
    lanes.insert(museum.batch(plans))
    for _ in range(3):
        assert lanes.run(20_000) == 20_000


def pickled(search):
    return pickle.loads(pickle.dumps(search))


def test_lanes_refill_fewer_plans_at_once(mission):
    lanes = started(mission, n_lanes=3)
    lanes.run(300)
    assert [lane._memory[0].most_waiting for lane in lanes._lanes] == [REFILLED_AT_ONCE]
    lanes.run(1)
    for each in (lanes, pickled(lanes)):
        most = [lane._memory[0].most_waiting for lane in each._lanes]
        assert most == [REFILLED_IN_LANES] * 3


@pytest.mark.parametrize("again", [copy.deepcopy, pickled])
@pytest.mark.parametrize("n", [200, 700])
def test_a_copy_goes_on_the_same_way(mission, again, n):
    """Before there are lanes, and when there are."""
    lanes = started(mission, n_lanes=3, n_threads=2)
    lanes.run(300)
    lanes.run(n - 100)
    other = again(lanes)
    assert other.run(800) == lanes.run(800)
    assert same(lanes, other)


def test_fronts_of_limited_size(mission):
    lanes = started(mission, n_lanes=3, max_size=10)
    for n in (300, 600, 900):
        lanes.run(n)
        assert all(len(lane) <= 10 for lane in lanes._lanes)


def test_a_mission_without_arcs():
    graph = nx.DiGraph()
    graph.add_node("base", reward=1.0)
    mission = Mission(graph, base="base", robots=2)
    lanes = started(mission, n_lanes=3)
    assert lanes.run(500) == 0
