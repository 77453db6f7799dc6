"""The search and its front: plans come in, room grows, and a pickled search goes on."""

import pickle
import time

import networkx as nx
import numpy as np
import pytest
from numba.core import event

from botohe_moo import Mission, TrailPlan, load_mission
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


@pytest.fixture(scope="module")
def museum():
    return load_mission("art_museum")


@pytest.mark.parametrize("robots", [1, 12])
def test_the_front_of_what_is_inserted(museum, robots):
    mission = museum.with_robots(robots)
    search, batch = started(mission), random_plans(mission, 200)
    search.insert(batch)
    check(search)
    every = np.vstack([mission.evaluate(batch), search.objectives()[-1:]])
    assert search.objectives().tolist() == front_of(every).tolist()
    version = search.version
    search.insert(batch)  # nothing enters twice
    assert search.version == version


@pytest.mark.parametrize("limits", [{"min_survival": 0.3}, {"max_length": 9.0}])
def test_given_plans_that_do_not_keep_the_limits_are_left_out(museum, limits):
    search, batch = unstarted(museum, **limits), random_plans(museum, 300)
    floor, budget = limits.get("min_survival", 0.0), limits.get("max_length")
    keep = [keeps_limits(museum, [plan], floor, budget) for plan in batch]
    assert 5 < sum(keep) < 295
    search.insert(batch)
    check(search, floor, budget)
    expected = front_of(museum.evaluate(batch.take(np.flatnonzero(keep))))
    assert search.objectives().tolist() == expected.tolist()


@pytest.mark.compiled_only
def test_plans_are_inserted_where_others_wait_to_be_recreated(museum, monkeypatch):
    """Also where there is little room at first."""
    found = started(museum)
    found.run(20_000)
    monkeypatch.setattr(engine, "_FIRST_PLANS", 3)
    search = started(museum)
    search._waiting[:] = museum.robots  # E[S] of the only plan
    search._memory[0].n_waiting = len(search._waiting)
    search.insert(found.plans()[0])
    assert search.objectives().tolist() == found.objectives().tolist()


RECREATING = {"prob_recreate": 0.8}


def wheel(*, robots=2, survival=0.9, reward=1.0, length=1.0):
    """The base, and five nodes round it, each of which leads to the next and the one before."""
    graph = nx.wheel_graph(6).to_directed()
    nx.set_node_attributes(graph, reward, "reward")
    nx.set_edge_attributes(graph, survival, "survival")
    nx.set_edge_attributes(graph, length, "length")
    return Mission(graph, base=0, robots=robots)


@pytest.mark.parametrize("budget", [0.0, 1e-320])
def test_a_budget_of_nothing(budget):
    search = started(wheel(), max_length=budget, **RECREATING)
    search.run(2_000)
    assert search.objectives().tolist() == [[1.0, 2.0]]  # of the base
    # Where arcs have no length there is nothing to keep.
    free = started(wheel(length=0.0), max_length=budget, **RECREATING)
    free.run(2_000)
    check(free)
    assert free.objectives()[0, 0] > 4.0


def test_a_budget_that_nobody_uses_up():
    for length in (1.0, 1e300):
        search = started(wheel(length=length), max_length=1.7e308, **RECREATING)
        search.run(3_000)
        check(search)
        assert len(search) > 4


@pytest.mark.compiled_only
def test_what_each_move_brought(museum):
    begun, search = time.perf_counter(), started(museum, prob_recreate=0.2)
    assert not search.statistics[["tried", "entered"]].to_numpy().any()  # of plans that are given
    n_given, n_tried = search.version, 0
    for n in (1, 400, 5_000):
        n_tried += search.run(n)
        found = search.statistics
        assert found.index.tolist() == [*DEFAULT_MOVES, RUIN_AND_RECREATE]
        assert (found.index.name, found.columns.tolist()) == (
            "move",
            ["tried", "entered", "seconds"],
        )
        assert found["tried"].sum() == n_tried
        assert found["entered"].sum() == search.version - n_given
        assert (found["entered"] <= found["tried"]).all()
    assert (found["seconds"] >= 0).all()
    assert 0 < found["seconds"].sum() <= time.perf_counter() - begun
    assert (found.drop("swap-loops")["entered"] > 0).all()
    found[:] = 0  # a copy
    assert search.statistics["tried"].sum() == n_tried


@pytest.mark.compiled_only
def test_compiling_is_not_what_moves_spend(monkeypatch):
    compiling = []

    def compile_and_improve(*given):
        with event.trigger_event("numba:compiler_lock"):
            time.sleep(0.05)
        compiling.append(0.05)
        return improve(*given)

    monkeypatch.setattr(engine, "improve", compile_and_improve)
    search = started(load_mission("toy"), prob_recreate=1.0)
    assert search.run(300) == 300
    assert search.statistics["tried"][RUIN_AND_RECREATE] > 0
    assert 0.0 < search.statistics["seconds"].sum() < sum(compiling)


def test_fifty_robots_are_changed_together(museum, monkeypatch):
    """A single child adds more trails than a parent has children."""
    monkeypatch.setattr(engine, "_FIRST_PLANS", 3)
    mission = museum.with_robots(50)
    search = started(mission, random_plans(mission, 30), prob_recreate=1.0, max_length=30.0)
    for n_evaluations in (1, 400, 400):
        assert search.run(n_evaluations) == n_evaluations
        check(search, 0.0, 30.0)
        store = search._store
        assert 0 <= store.n.arcs <= len(store.arc)
        assert 0 <= store.n.visits <= len(store.node)
        assert 0 <= store.n.spare <= len(store.trails)


@pytest.mark.compiled_only
@pytest.mark.parametrize("reward", [1e-300, 1e300])
def test_nothing_is_dangerous(reward):
    search = started(wheel(survival=1.0, reward=reward), **RECREATING)
    search.run(2_000)
    assert np.allclose(search.objectives(), [[6 * reward, 2.0]], rtol=1e-12, atol=0)
    # Two robots with 4 arcs each: three nodes to either.
    search = started(wheel(survival=1.0, reward=reward), max_length=4.0, **RECREATING)
    search.run(4_000)
    assert np.allclose(search.objectives(), [[6 * reward, 2.0]], rtol=1e-12, atol=0)
    assert search.mission.trail_lengths(search.plans()[0]).max() <= 4.0


@pytest.mark.parametrize(
    ("survival", "limits"),
    [(1e-150, {}), (5e-324, {"max_length": 5.0}), (5e-324, {"min_survival": 1e-310})],
)
def test_hardly_anybody_survives(survival, limits):
    """Probabilities of trails are rounded to 0; costs of 700 an arc are not."""
    mission = wheel(survival=survival)
    search = started(mission, **RECREATING, **limits)
    loops = [TrailPlan([[0, 1, 2, 3, 0], [0, 4, 0]]), TrailPlan([[0, 1, 0], [0]])]
    search.insert(mission.batch(loops))
    assert search.run(3_000) == 3_000
    check(search)
    assert search.objectives()[-1].tolist() == [1.0, 2.0]


def test_a_pickled_search_starts_again_as_the_other(museum):
    search = started(museum)
    search.run(60)
    other = pickle.loads(pickle.dumps(search))
    home = museum.batch([museum.stay_home()])
    for each in (search, other):
        each.restart()
        each.insert(home)
        each.run(60)
    assert outcome(search) == outcome(other)


@pytest.mark.compiled_only
def test_trimming_takes_what_contributes_least_and_leaves_the_ends(museum):
    search = started(museum, seed=1)
    search.run(20_000)
    expected, n_users = search.objectives(), search._store.trails["n_users"].sum()
    for _ in range(60):
        reward, survivors = expected.T
        area = (reward[:-2] - reward[2:]) * (survivors[2:] - survivors[:-2])
        expected = np.delete(expected, np.argmin(area) + 1, axis=0)
    trim(search.parts, len(expected))
    assert search.objectives().tolist() == expected.tolist()
    assert search._store.trails["n_users"].sum() == n_users - 60 * museum.robots
    trim(search.parts, 2)
    assert search.objectives().tolist() == expected[[0, -1]].tolist()
    search.run(2_000)
    check(search)
