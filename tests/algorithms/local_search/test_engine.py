"""The search and its front: plans come in, room grows, and a pickled search goes on."""

import pickle
import time

import networkx as nx
import numpy as np
import pytest
from numba.core import event

from botohe_moo import Mission, load_mission
from botohe_moo.algorithms.local_search import engine
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, RUIN_AND_RECREATE
from botohe_moo.algorithms.local_search.kernels.search import improve, trim
from tests.algorithms.local_search.made import (
    check,
    front_of,
    keeps_limits,
    outcome,
    random_plans,
    started,
    unstarted,
)

MUSEUM = load_mission("art_museum")


@pytest.mark.parametrize("robots", [1, 12])
def test_the_front_of_what_is_inserted(robots):
    mission = MUSEUM.with_robots(robots)
    search, batch = started(mission), random_plans(mission, 200)
    search.insert(batch)
    check(search)
    every = np.vstack([mission.evaluate(batch), search.objectives()[-1:]])
    assert search.objectives().tolist() == front_of(every).tolist()
    version = search.version
    search.insert(batch)  # nothing enters twice
    assert search.version == version


@pytest.mark.parametrize(("floor", "budget"), [(0.3, None), (0.0, 9.0)])
def test_given_plans_that_do_not_keep_the_limits_are_left_out(floor, budget):
    search = unstarted(MUSEUM, min_survival=floor, max_length=budget)
    batch = random_plans(MUSEUM, 300)
    keep = [keeps_limits(MUSEUM, [plan], floor, budget) for plan in batch]
    assert 5 < sum(keep) < 295
    search.insert(batch)
    check(search, floor, budget)
    expected = front_of(MUSEUM.evaluate(batch.take(np.flatnonzero(keep))))
    assert search.objectives().tolist() == expected.tolist()


@pytest.mark.compiled_only
def test_plans_are_inserted_where_others_wait_to_be_recreated(monkeypatch):
    """Also where there is little room at first."""
    found = started(MUSEUM)
    found.run(20_000)
    monkeypatch.setattr(engine, "_FIRST_PLANS", 3)
    search = started(MUSEUM)
    search._waiting[:] = MUSEUM.robots  # E[S] of the only plan
    search._memory[0].n_waiting = len(search._waiting)
    search.insert(found.plans()[0])
    assert search.objectives().tolist() == found.objectives().tolist()


def wheel(*, survival=0.9, reward=1.0, length=1.0):
    """The base, and five nodes round it, each of which leads to the next and the one before."""
    graph = nx.wheel_graph(6).to_directed()
    nx.set_node_attributes(graph, reward, "reward")
    nx.set_edge_attributes(graph, survival, "survival")
    nx.set_edge_attributes(graph, length, "length")
    return Mission(graph, base=0, robots=2)


TINY, HUGE = {"survival": 1.0, "reward": 1e-300}, {"survival": 1.0, "reward": 1e300}


@pytest.mark.compiled_only
@pytest.mark.parametrize(
    ("mission", "floor", "budget", "n_rewards", "survivors"),
    [
        # Nobody can leave, unless arcs have no length; or nobody uses the budget up.
        *(({}, 0.0, budget, 1.0, 2.0) for budget in (0.0, 1e-320)),
        *(({"length": 0.0}, 0.0, budget, 4.0, None) for budget in (0.0, 1e-320)),
        *(({"length": length}, 0.0, 1.7e308, 4.0, None) for length in (1.0, 1e300)),
        # Nothing is dangerous; two robots with 4 arcs each: three nodes to either.
        *((safe, 0.0, budget, 6.0, 2.0) for safe in (TINY, HUGE) for budget in (None, 4.0)),
        # Hardly anybody survives: probabilities of trails are rounded to 0, costs of arcs are not.
        ({"survival": 1e-150}, 0.0, None, 1.0, None),
        ({"survival": 5e-324}, 0.0, 5.0, 1.0, None),
        ({"survival": 5e-324}, 1e-310, None, 1.0, None),
    ],
)
def test_extremes(mission, floor, budget, n_rewards, survivors):
    """Rewards that are found at least, or exactly where all survive."""
    mission = wheel(**mission)
    search = started(mission, prob_recreate=0.8, min_survival=floor, max_length=budget)
    loops = [mission.plan([[0, 1, 2, 3, 0], [0, 4, 0]]), mission.plan([[0, 1, 0], [0]])]
    search.insert(mission.batch(loops))
    search.run(4_000)
    check(search, floor, budget)
    objectives = search.objectives() / [mission.rewards[0], 1.0]
    assert objectives[0, 0] >= n_rewards * (1 - 1e-12)
    assert objectives[-1, 1] == 2.0
    if survivors:
        assert objectives == pytest.approx(np.array([[n_rewards, survivors]]), rel=1e-12)


@pytest.mark.compiled_only
def test_what_each_move_brought():
    begun, search = time.perf_counter(), started(MUSEUM, prob_recreate=0.2)
    assert not search.statistics[["tried", "entered"]].to_numpy().any()  # of plans that are given
    n_given, n_tried = search.version, 0
    for n in (1, 400, 5_000):
        n_tried += search.run(n)
        found = search.statistics
        assert found[["tried", "entered"]].sum().tolist() == [n_tried, search.version - n_given]
        assert (found["entered"] <= found["tried"]).all()
    assert (found.index.name, [*found.index]) == ("move", [*DEFAULT_MOVES, RUIN_AND_RECREATE])
    assert (found["seconds"] >= 0).all()
    assert 0 < found["seconds"].sum() <= time.perf_counter() - begun
    assert (found.drop("swap-loops")["entered"] > 0).all()
    found[:] = 0  # a copy
    assert search.statistics["tried"].sum() == n_tried


@pytest.mark.compiled_only
def test_compiling_is_not_what_moves_spend(monkeypatch):
    def compile_and_improve(*given):
        with event.trigger_event("numba:compiler_lock"):
            time.sleep(0.5)
        return improve(*given)

    monkeypatch.setattr(engine, "improve", compile_and_improve)
    search = started(load_mission("toy"), prob_recreate=1.0)
    assert search.run(300) == 300
    assert 0.0 < search.statistics["seconds"].sum() < 0.5


def test_fifty_robots_are_changed_together(monkeypatch):
    """A single child adds more trails than a parent has children."""
    monkeypatch.setattr(engine, "_FIRST_PLANS", 3)
    mission = MUSEUM.with_robots(50)
    search = started(mission, random_plans(mission, 30), prob_recreate=1.0, max_length=30.0)
    for n_evaluations in (1, 400, 400):
        assert search.run(n_evaluations) == n_evaluations
        check(search, 0.0, 30.0)
        store = search._store
        assert 0 <= store.n.arcs <= len(store.arc)
        assert 0 <= store.n.visits <= len(store.node)
        assert 0 <= store.n.spare <= len(store.trails)


def test_a_pickled_search_starts_again_as_the_other():
    search = started(MUSEUM)
    search.run(60)
    other = pickle.loads(pickle.dumps(search))
    for each in (search, other):
        each.restart()
        each.insert(MUSEUM.batch([MUSEUM.stay_home()]))
        each.run(60)
    assert outcome(search) == outcome(other)


@pytest.mark.compiled_only
def test_trimming_takes_what_contributes_least_and_leaves_the_ends():
    search = started(MUSEUM, seed=1)
    search.run(20_000)
    expected, n_users = search.objectives(), search._store.trails["n_users"].sum()
    for _ in range(60):
        reward, survivors = expected.T
        area = (reward[:-2] - reward[2:]) * (survivors[2:] - survivors[:-2])
        expected = np.delete(expected, np.argmin(area) + 1, axis=0)
    trim(search.parts, len(expected))
    assert search.objectives().tolist() == expected.tolist()
    assert search._store.trails["n_users"].sum() == n_users - 60 * MUSEUM.robots
    trim(search.parts, 2)
    assert search.objectives().tolist() == expected[[0, -1]].tolist()
    search.run(2_000)
    check(search)
