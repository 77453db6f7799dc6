"""Trails that plans share: what each reaches, who has it, and the bits of ``Mission.evaluate``."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan
from botohe_moo.algorithms.local_search.kernels import plans, workspace
from botohe_moo.algorithms.local_search.kernels import trail_store as kernels
from botohe_moo.core.graph import find_arc
from botohe_moo.core.trails import sort_trails
from tests.examples import examples
from tests.strategies import missions, missions_with_plans, team_missions_with_plans, trails


class Stored:
    """A store, and the trails put into it, as node indices by number."""

    def __init__(self, mission, n_trails=40):
        self.mission, self.nodes = mission, {}
        self.store = kernels.new_store(n_trails, 1_000, 1_000)
        self.work = workspace.new_workspace(
            mission.arrays,
            mission.robots,
            memory=None,
            waiting=None,
            states=None,
            weights=None,
        )

    def add(self, nodes, robot=0):
        arcs = [find_arc(self.mission.arrays, u, v) for u, v in pairwise(nodes)]
        self.work.child[: len(arcs)] = arcs
        self.work.child[len(arcs) :] = -1  # there is room for more than is used
        trail = plans.add_trail(self.mission.arrays, self.store, self.work, robot, len(arcs))
        assert self.store.trails[trail].hash == 0
        self.store.trails[trail].hash = 7  # as if others had been told of it
        self.nodes[trail] = tuple(nodes)
        return trail

    def release(self, trail):
        kernels.release(self.store, trail)
        if self.store.trails[trail].n_users == 0:
            del self.nodes[trail]

    def check(self):
        """Whether the store holds these trails, with what they reach, and has the others free."""
        store, arrays = self.store, self.mission.arrays
        assert set(np.flatnonzero(store.trails["n_users"]).tolist()) == set(self.nodes)
        spare = store.spare[: store.n.spare].tolist()
        assert sorted([*spare, *self.nodes]) == list(range(len(store.trails)))
        for trail, nodes in self.nodes.items():
            stored = store.trails[trail]
            arcs = store.arc[stored.first_arc :][: stored.n_arcs]
            assert (arrays.base, *arrays.head[arcs].tolist()) == nodes
            reached, alive = {}, 1.0
            for arc in arcs:
                alive *= arrays.survival[arc]
                node = int(arrays.head[arc])
                if arrays.reward[node] > 0 and node != arrays.base:
                    reached.setdefault(node, alive)
            start, n = stored.first_visit, stored.n_visits
            assert store.node[start : start + n].tolist() == list(reached)
            assert store.reach[start : start + n].tolist() == list(reached.values())
            assert stored.alive == alive


@examples(60)
@given(st.data())
def test_trails_are_kept_as_long_as_somebody_has_them(data):
    mission = data.draw(missions(min_nodes=1))
    stored = Stored(mission)
    for _ in range(data.draw(st.integers(0, 12))):
        trail = stored.add(data.draw(trails(mission)))
        again = data.draw(st.integers(0, 2))
        stored.store.trails[trail].n_users += again
        for _ in range(data.draw(st.integers(0, again + 1))):
            stored.release(trail)
    stored.check()
    # The copy has no gaps, room for more, and the same numbers.
    n_arcs = sum(len(nodes) - 1 for nodes in stored.nodes.values())
    n_visits = int(stored.store.trails["n_visits"][list(stored.nodes)].sum())
    into = kernels.new_store(60, n_arcs + 500, n_visits + 500)
    users = stored.store.trails["n_users"].copy()
    kernels.copy_trails(stored.store, into)
    assert into.n.arcs == n_arcs
    assert into.n.visits == n_visits
    assert into.trails["n_users"][:40].tolist() == users.tolist()
    stored.store = into
    stored.check()
    for _ in range(3):
        stored.add(data.draw(trails(mission)))
    stored.check()


@examples(200)
@given(missions_with_plans(min_nodes=1, max_robots=5) | team_missions_with_plans(), st.randoms())
def test_objectives_have_the_bits_of_evaluate(case, random):
    mission, plan = case
    stored = Stored(mission)
    robots, nodes = list(range(mission.robots)), plan.trails
    random.shuffle(robots)
    trails = [stored.add(nodes[robot], robot) for robot in robots]
    stored.work.trails[:] = sorted(trails, key=stored.nodes.get)
    for _ in range(2):
        objectives = plans.evaluate_trails(mission.arrays, stored.store, stored.work)
        assert list(objectives) == mission.evaluate([TrailPlan(nodes)])[0].tolist()


@examples(60)
@given(st.data())
def test_trails_are_in_lexicographic_order(data):
    mission = data.draw(missions(min_nodes=1))
    stored = Stored(mission)
    order = np.array([stored.add(data.draw(trails(mission))) for _ in range(3)])
    expected = sorted(order.tolist(), key=stored.nodes.get)
    table = stored.store.trails
    sort_trails(stored.store.arc, table["first_arc"], table["end_arc"], order)
    assert order.tolist() == expected


def test_room_for_trails_arcs_and_visits():
    graph = nx.DiGraph([(0, 1), (1, 2), (2, 0), (1, 0), (2, 1)], robots=1)  # 3 nodes, 5 arcs
    nx.set_node_attributes(graph, 1.0, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    arrays, store = Mission(graph, base=0).arrays, kernels.new_store(10, 40, 30)
    assert kernels.fits(arrays, store, 8)
    assert not kernels.fits(arrays, store, 9)  # 45 arcs
    store.n.visits = 7
    assert kernels.fits(arrays, store, 7)
    assert not kernels.fits(arrays, store, 8)  # 24 visits and 7
    store.n.spare = 6
    assert kernels.fits(arrays, store, 6)
    assert not kernels.fits(arrays, store, 7)


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
    store, first = stored.store, stored.store.trails[trail]
    assert first.alive == pytest.approx(0.8 * 0.8 * 0.5 * 0.5)
    # The base's reward is everybody's, and there is none at node 2.
    assert store.node[: first.n_visits].tolist() == [1]
    assert store.reach[0] == pytest.approx(0.8 * 0.8 * 0.5)
    stored.release(trail)
    assert stored.add((0,)) == trail
    again = store.trails[trail]
    assert (again.n_arcs, again.n_visits, again.alive) == (0, 0, 1.0)


@examples(60)
@given(st.data())
def test_a_trail_that_is_taken_back_leaves_no_trace(data):
    mission = data.draw(missions(min_nodes=1))
    stored = Stored(mission)
    some = [stored.add(data.draw(trails(mission))) for _ in range(data.draw(st.integers(0, 3)))]
    before, users = stored.store.n.item(), stored.store.trails["n_users"].tolist()
    added = [stored.add(data.draw(trails(mission))) for _ in range(data.draw(st.integers(1, 3)))]
    for trail in reversed(added):
        kernels.discard(stored.store, trail)
        del stored.nodes[trail]
    assert stored.store.n.item() == before
    assert stored.store.trails["n_users"].tolist() == users
    stored.check()
    # Where another plan has it, and where others lie behind it, its room stays in use.
    for trail in some:
        stored.store.trails[trail].n_users += 1
        kernels.discard(stored.store, trail)
    assert stored.store.n.item() == before
    for trail in some[:-1]:
        kernels.discard(stored.store, trail)
        del stored.nodes[trail]
    stored.check()
    for _ in range(3):
        stored.add(data.draw(trails(mission)))
    stored.check()
