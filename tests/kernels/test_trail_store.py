"""Trails that plans share: what each reaches, who has it, and the bits of ``Mission.evaluate``."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan
from botohe_moo.kernels.local_search import trail_store as kernels
from botohe_moo.kernels.plans.evaluate import find_arc
from tests.strategies import missions, missions_with_plans, trails
from tests.twins import plain_local_search


@pytest.fixture(autouse=True, scope="module")
def plain():
    with plain_local_search():
        yield


class Stored:
    """A store, and the trails put into it, as node indices by number."""

    def __init__(self, mission, n_trails=40):
        arrays = mission.arrays
        self.mission, self.nodes = mission, {}
        self.store = kernels.new_store(n_trails, 1_000, 1_000, arrays.n_nodes)

    def add(self, nodes):
        arrays = self.mission.arrays
        arcs = [find_arc(arrays.first, arrays.head, u, v) for u, v in pairwise(nodes)]
        longer = np.array([*arcs, -1, -1], np.int32)  # callers hand in more than they use
        trail = kernels.add_trail(
            arrays.head, arrays.survival, arrays.reward, arrays.base, self.store, longer, len(arcs)
        )
        self.store.n_users[trail] += 1
        self.nodes[trail] = tuple(nodes)
        return trail

    def release(self, trail):
        kernels.release(self.store, trail)
        if self.store.n_users[trail] == 0:
            del self.nodes[trail]

    def check(self):
        """Whether the store holds these trails, with what they reach, and has the others free."""
        store, arrays = self.store, self.mission.arrays
        assert set(np.flatnonzero(store.n_users).tolist()) == set(self.nodes)
        spare = store.spare[: store.counts[kernels.N_SPARE_TRAILS]].tolist()
        assert sorted([*spare, *self.nodes]) == list(range(len(store.n_users)))
        for trail, nodes in self.nodes.items():
            arcs = store.arc[store.arcs_from[trail] :][: store.n_arcs[trail]]
            assert (arrays.base, *arrays.head[arcs].tolist()) == nodes
            reached, alive = {}, 1.0
            for arc in arcs:
                alive *= arrays.survival[arc]
                node = int(arrays.head[arc])
                if arrays.reward[node] > 0 and node != arrays.base:
                    reached.setdefault(node, alive)
            start, n = store.visits_from[trail], store.n_visits[trail]
            assert store.node[start : start + n].tolist() == list(reached)
            assert store.reach[start : start + n].tolist() == list(reached.values())
            assert store.alive[trail] == alive


@settings(max_examples=60)
@given(st.data())
def test_trails_are_kept_as_long_as_somebody_has_them(data):
    mission = data.draw(missions(min_nodes=1))
    stored = Stored(mission)
    for _ in range(data.draw(st.integers(0, 12))):
        trail = stored.add(data.draw(trails(mission)))
        again = data.draw(st.integers(0, 2))
        stored.store.n_users[trail] += again
        for _ in range(data.draw(st.integers(0, again + 1))):
            stored.release(trail)
    stored.check()
    # The copy has no gaps, room for more, and the same numbers.
    n_arcs = sum(len(nodes) - 1 for nodes in stored.nodes.values())
    n_visits = int(stored.store.n_visits[list(stored.nodes)].sum())
    into = kernels.new_store(60, n_arcs + 500, n_visits + 500, mission.arrays.n_nodes)
    users = stored.store.n_users.copy()
    kernels.copy_trails(stored.store, into)
    assert into.counts[kernels.N_ARCS] == n_arcs
    assert into.counts[kernels.N_VISITS] == n_visits
    assert into.n_users[:40].tolist() == users.tolist()
    stored.store = into
    stored.check()
    for _ in range(3):
        stored.add(data.draw(trails(mission)))
    stored.check()


@settings(max_examples=100)
@given(missions_with_plans(min_nodes=1, max_robots=5), st.randoms())
def test_objectives_have_the_bits_of_evaluate(case, random):
    mission, plan = case
    arrays, n_nodes = mission.arrays, mission.arrays.n_nodes
    stored = Stored(mission)
    nodes = list(plan.trails)
    random.shuffle(nodes)
    in_order = sorted(map(stored.add, nodes), key=stored.nodes.get)
    scratch = np.empty(n_nodes), np.empty(n_nodes, np.int32), np.full(n_nodes, -1, np.int64)
    for mark in (1, 2):
        objectives = kernels.evaluate_trails(
            arrays.reward,
            arrays.base,
            stored.store,
            np.array(in_order, np.int32),
            *scratch,
            mark,
        )
        assert list(objectives) == mission.evaluate([TrailPlan(nodes)])[0].tolist()


@settings(max_examples=60)
@given(st.data())
def test_trails_are_in_lexicographic_order(data):
    mission = data.draw(missions(min_nodes=1))
    stored = Stored(mission)
    one, other = (stored.add(data.draw(trails(mission))) for _ in range(2))
    before = stored.nodes[one] < stored.nodes[other]
    assert kernels.precedes(stored.store, one, other) == before
    assert not kernels.precedes(stored.store, one, one)


def test_room_for_trails_arcs_and_visits():
    store = kernels.new_store(10, 100, 30, 5)
    assert kernels.fits(store, 10, 10, 3)
    assert not kernels.fits(store, 11, 9, 2)
    assert not kernels.fits(store, 10, 11, 3)
    assert not kernels.fits(store, 10, 10, 4)
    assert kernels.fits(store, 5, 20, 6)


def test_a_released_trail_gives_its_number_to_the_next():
    graph = nx.DiGraph()
    graph.add_node(0, reward=7.0)
    graph.add_node(1, reward=2.0)
    graph.add_node(2, reward=0.0)
    graph.add_weighted_edges_from(
        [(0, 1, 0.5), (1, 0, 0.5), (0, 2, 0.8), (2, 0, 0.8)], weight="survival"
    )
    stored = Stored(Mission(graph, base=0, robots=1))
    trail = stored.add((0, 2, 0, 1, 0))
    store = stored.store
    assert store.alive[trail] == pytest.approx(0.8 * 0.8 * 0.5 * 0.5)
    # The base's reward is everybody's, and there is none at node 2.
    assert store.node[: store.n_visits[trail]].tolist() == [1]
    assert store.reach[0] == pytest.approx(0.8 * 0.8 * 0.5)
    stored.release(trail)
    assert stored.add((0,)) == trail
    assert (store.n_arcs[trail], store.n_visits[trail], store.alive[trail]) == (0, 0, 1.0)
