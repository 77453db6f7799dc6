"""Walks by hand and against readable twins: what is visited, and with what probability credited."""

from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given

from botohe_moo import Kind, Mission
from botohe_moo.core.walk import new_visits, walk
from botohe_moo.core.world import find_arc
from tests import twins
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans


@np.errstate(all="ignore")
def walk_all(world, arcs, offsets, visits, nodes, chances, found):
    """Walk the trails of all robots; write what each visits, and (visits, survival, length)."""
    for robot in range(len(offsets) - 1):
        start, stop = offsets[robot], offsets[robot + 1]
        of_robot = arcs[start:stop]
        n, alive, length = walk(world, world.returns, of_robot, stop - start, robot, visits)
        found[robot, 0], found[robot, 1], found[robot, 2] = n, alive, length
        nodes[robot, :n], chances[robot, :n] = visits.node[:n], visits.chance[:n]


def walked(mission, trails, visits=None):
    """For each robot's trail, in indices of kernels: visits in order, survival and length."""
    world = mission.world
    arcs = [[find_arc(world.graph, *hop) for hop in pairwise(trail)] for trail in trails]
    offsets, shape = np.cumsum([0, *map(len, arcs)]), (len(trails), world.graph.n_nodes)
    arcs = np.array([arc for of_robot in arcs for arc in of_robot], np.int64)
    nodes, chances, found = np.zeros(shape, np.int64), np.zeros(shape), np.zeros((shape[0], 3))
    visits = new_visits(world.graph.n_nodes) if visits is None else visits
    walk_all(world, arcs, offsets, visits, nodes, chances, found)
    return [
        (list(zip(nodes[k, :n].tolist(), chances[k, :n].tolist(), strict=True)), alive, length)
        for k, (n, alive, length) in enumerate((int(n), *rest) for n, *rest in found.tolist())
    ]


def ring(*, kinds=None, pays="arrival", robots=None, rewards=(0, 2, 3, 4), nodes=()):
    """Nodes 0 to 3 in a ring, there and back; arcs forth survive with 0.5, and are 2 long."""
    graph = nx.DiGraph()
    graph.add_nodes_from((v, {"reward": float(reward)}) for v, reward in enumerate(rewards))
    for v in range(4):
        graph.add_edge(v, (v + 1) % 4, survival=0.5, length=2.0)
        graph.add_edge((v + 1) % 4, v, survival=0.75)
    for v, attributes in dict(nodes).items():
        graph.nodes[v].update(attributes)
    return Mission(graph, base=0, kinds=kinds, robots=robots, pays=pays)


def test_on_arrival_the_first_visit_counts():
    [(visits, alive, length)] = walked(ring(robots=1), [(0, 1, 2, 1, 0)])
    assert visits == [(1, 0.5), (2, 0.25)]
    assert (alive, length) == (0.5**2 * 0.75**2, 6.0)


def test_the_base_is_visited_first_where_it_has_a_reward():
    mission = ring(robots=2, rewards=(7, 2, 0, 4))
    [(visits, alive, length), other] = walked(mission, [(0, 3, 2, 3, 0), (0,)])
    assert visits == [(0, 1.0), (3, 0.75)]  # there is nothing at node 2
    assert (alive, length) == (0.75**2 * 0.5**2, 6.0)
    assert other == ([(0, 1.0)], 1.0, 0.0)


def test_what_a_kind_collects_is_its_share():
    kinds, nodes = [Kind("one", 1), Kind("other", 1)], {1: {"share": {"one": 0.25, "other": 0.0}}}
    found = walked(ring(kinds=kinds, nodes=nodes), [(0, 1, 2, 3, 0), (4, 5, 6, 7, 4)])
    # Nodes are those of the mission, and what one cannot collect it does not visit.
    assert found[0] == ([(1, 0.5 * 0.25), (2, 0.25), (3, 0.125)], 0.0625, 8.0)
    assert found[1] == ([(2, 0.25), (3, 0.125)], 0.0625, 8.0)


def test_on_return_the_next_depot_counts():
    """Node 2 is a depot, where what is there counts at once; at node 3, on arrival."""
    nodes = {2: {"depot": True}, 3: {"pays": "arrival"}}
    [(visits, _, _)] = walked(ring(robots=1, pays="return", nodes=nodes), [(0, 1, 2, 3, 0)])
    assert visits == [(1, 0.25), (2, 0.25), (3, 0.125)]
    # A depot that was passed before does not count: the way back to it does.
    [(visits, _, _)] = walked(ring(robots=1, pays="return", nodes=nodes), [(0, 3, 2, 1, 2, 3, 0)])
    assert visits == [(3, 0.75), (2, 0.75**2), (1, 0.75**3 * 0.5)]
    [(visits, _, _)] = walked(ring(robots=1, pays="return"), [(0, 1, 2, 1, 0)])
    assert visits == [(1, 0.5**2 * 0.75**2), (2, 0.5**2 * 0.75**2)]


def test_what_is_aboard_comes_first_and_what_is_left_at_the_end_is_lost():
    kinds = [Kind("one", 1, start=3, aboard=(1, 2)), Kind("other", 1, end=2)]
    one, other = walked(ring(kinds=kinds, pays="return"), [(3, 2, 1, 0, 1, 0), (4, 5, 6)])
    home = 0.75**3  # what was at nodes 1 and 2 is not collected again on the way
    assert one == ([(1, home), (2, home), (3, home)], home * 0.375, 6.0)
    assert other == ([(1, 0.0), (2, 0.0)], 0.25, 4.0)  # it ends its trail where no depot is
    # Where the start is a depot, it counts at once.
    [(visits, _, _)] = walked(ring(kinds=[Kind("one", 1, aboard=(3,))], pays="return"), [(0, 1, 0)])
    assert visits == [(3, 1.0), (1, 0.375)]


def test_one_scratch_serves_all_walks():
    mission = ring(robots=3, pays="return")
    trails, visits = [(0, 1, 0), (0,), (0, 3, 2, 1, 0)], new_visits(4)
    once = walked(mission, trails, visits)
    assert walked(mission, trails, visits) == once == walked(mission, trails)
    assert visits.n_walks == [6]


@examples(200)
@given(missions_with_plans() | team_missions_with_plans())
def test_walks_are_their_readable_twin(case):
    mission, plan = case
    robots = zip(mission.kind_of, mission.labels(plan), walked(mission, plan.trails), strict=True)
    for kind, trail, (visits, alive, length) in robots:
        expected = {
            mission.index(node): chance
            for node, chance in twins.collects(mission, kind, trail).items()
            if mission.graph.nodes[node]["reward"] > 0 and chance > 0
        }
        found = dict(visits)
        assert len(found) == len(visits)
        assert {v: chance for v, chance in found.items() if chance > 0} == pytest.approx(expected)
        aboard = [node for node in kind.aboard if node != trail[0]]
        order = [mission.index(node) for node in dict.fromkeys([*aboard, *trail])]
        assert sorted(found, key=order.index) == list(found)
        assert alive == pytest.approx(twins.alive_along(mission, kind, trail)[-1])
        assert length == pytest.approx(twins.trail_lengths(mission, [trail])[0])
