"""The search and its front: plans come in, room grows, and a pickled search goes on."""

import copy
import pickle

import networkx as nx
import numpy as np
import pytest

from botohe_moo import BOTOHE, Mission, TrailPlan, load_mission
from botohe_moo.kernels.fronts.ordered import has_room
from botohe_moo.kernels.local_search.trail_store import fits
from botohe_moo.kernels.local_search.workspace import SearchRule
from botohe_moo.operators import RandomTrailSampling
from botohe_moo.search import local_search
from botohe_moo.search.local_search import DEFAULT_MOVES, MOVES, LocalSearch
from botohe_moo.trails import PlanBatch


@pytest.fixture(scope="module")
def museum():
    return load_mission("art_museum")


def started(mission, *, seed=0, moves=DEFAULT_MOVES, **rule):
    """A search that knows one plan: everybody at base."""
    search = LocalSearch(
        mission,
        SearchRule(**rule),
        moves=moves,
        random_state=np.random.default_rng(seed),
    )
    home = TrailPlan([[mission.arrays.base]] * mission.robots)
    search.admit(PlanBatch.from_plans([home], mission.robots))
    return search


def random_plans(mission, n):
    rng = np.random.default_rng(3)
    plans = RandomTrailSampling()(BOTOHE(mission), n, random_state=rng).get("X")
    return PlanBatch.from_plans(plans, mission.robots)


def same(one, other):
    found, again = one.plans(), other.plans()
    return (
        [plan.trails for plan in found[0]] == [plan.trails for plan in again[0]]
        and found[1].tobytes() == again[1].tobytes()
        and found[2].tobytes() == again[2].tobytes()
    )


def check(search):
    """Whether the front is one, its objectives are exact, and every trail is somebody's."""
    plans, objectives, serials = search.plans()
    mission, store = search.mission, search._store
    assert len(search) == len(plans) == len(serials) == len(set(serials.tolist()))
    assert serials.max() < search.version
    assert np.array_equal(mission.evaluate(plans), objectives)
    assert (np.diff(objectives[:, 0]) < 0).all()
    assert (np.diff(objectives[:, 1]) > 0).all()
    assert store.trails["n_users"].sum() == len(plans) * mission.robots
    assert (store.trails["n_users"] >= 0).all()


def nondominated(objectives):
    better = (objectives[:, None] >= objectives).all(axis=2)
    better &= (objectives[:, None] > objectives).any(axis=2)
    return objectives[~better.any(axis=0)]


@pytest.mark.parametrize("robots", [1, 3, 12])
def test_the_front_of_what_is_admitted(museum, robots):
    mission = museum.with_robots(robots)
    search, batch = started(mission), random_plans(mission, 600)
    search.admit(batch)
    check(search)
    every = np.vstack([mission.evaluate(batch), search.plans()[1][-1:]])
    front = np.unique(nondominated(every), axis=0)[::-1]
    assert search.plans()[1].tolist() == front.tolist()
    search.admit(batch)  # nothing enters twice
    version = search.version
    search.admit(batch)
    assert search.version == version


def test_room_grows_with_the_front(museum, monkeypatch):
    monkeypatch.setattr(local_search, "_FIRST_PLANS", 3)
    search = started(museum)
    rooms = set()
    for n_evaluations in [*[1_500] * 12, 60_000]:
        assert search.run(n_evaluations) == n_evaluations
        check(search)
        rooms.add((len(search._front.serial), len(search._store.arc), len(search._store.trails)))
    assert len(search) > 150
    assert len({slots for slots, _, _ in rooms}) > 1
    assert len({arcs for _, arcs, _ in rooms}) > 1
    # Whatever came and went: what is there now decides how much room there is.
    trails = search._store.trails
    used = trails["n_arcs"][trails["n_users"] > 0].sum()
    assert len(search._store.arc) < 4 * used + 4 * 25 * museum.arrays.n_arcs


@pytest.mark.parametrize("n_children", [1, 50, 3_000])
def test_children_find_room(museum, n_children):
    search = started(museum, n_children=n_children)
    assert search.run(7_001) == 7_001
    check(search)
    room = n_children + 1
    search._make_room()
    assert has_room(search._front, room)
    assert fits(museum.arrays, search._store, room)


def test_a_copy_and_a_pickled_search_go_on_alike(museum):
    search = started(museum)
    for n in (1, 500, 3_000):
        search.run(n)
        copied, pickled = copy.deepcopy(search), pickle.loads(pickle.dumps(search))
        for other in (copied, pickled):
            other.run(400)
        search.run(400)
        for other in (copied, pickled):
            assert same(search, other)
            check(other)
            assert other.tally.tolist() == search.tally.tolist()
        search = pickled


def test_looking_changes_nothing(museum):
    one, other = started(museum), started(museum)
    for _ in range(5):
        one.run(300)
        other.run(300)
        other.plans()
    assert same(one, other)
    plans, objectives, _ = one.plans()
    before = plans.nodes.tobytes(), objectives.tobytes()
    one.run(2_000)
    assert (plans.nodes.tobytes(), objectives.tobytes()) == before


def test_every_kind_of_move_is_counted(museum):
    search = started(museum)
    search.run(20_000)
    made, entered = search.tally
    assert 19_000 < made.sum() <= 20_000
    assert (made > 0).all()
    assert (entered <= made).all()
    assert 300 < entered.sum() < search.version
    shares = made / made.sum()
    for name, share in zip(MOVES, shares, strict=True):
        assert share < 2 * DEFAULT_MOVES[name] + 0.02


def test_moves_that_lead_nowhere_end_the_search(museum):
    for move in ("splice", "graft", "swap-loops", "reverse"):
        search = started(museum, moves={move: 1.0})
        assert search.run(100_000) == 0  # there is only the trail that stays at base
        assert len(search) == 1


def test_a_mission_without_arcs_has_one_plan():
    graph = nx.DiGraph()
    graph.add_node("base", reward=2.0)
    search = started(Mission(graph, base="base", robots=4))
    assert search.run(1_000) == 0
    assert search.plans()[1].tolist() == [[2.0, 4.0]]


def test_dangers_that_nobody_survives():
    """Products of survivals that are rounded to 0 hurt neither the front nor its objectives."""
    graph = nx.DiGraph()
    for node in range(5):
        graph.add_node(node, reward=1.0)
        graph.add_edge(node, (node + 1) % 5, survival=1e-200)
    graph.add_edge(1, 0, survival=1e-200)
    graph.add_edge(0, 4, survival=1e-5)
    search = started(Mission(graph, base=0, robots=2))
    search.admit(PlanBatch.from_plans([TrailPlan([[0, 1, 2, 3, 4, 0], [0, 4, 0]])], 2))
    search.run(5_000)
    check(search)
