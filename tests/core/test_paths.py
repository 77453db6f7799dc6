"""Cheapest paths against networkx, with any arcs used, in plain Python, which gives equal bits."""

from math import log, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.core import paths
from tests.examples import examples
from tests.strategies import lengths, missions, team_missions
from tests.twins import end_at

USED, TRAIL = 7, 7


@pytest.fixture(autouse=True)
def no_warnings():
    with np.errstate(all="ignore"):
        yield


def free_graph(mission, used):
    graph = mission.world.graph
    free = nx.DiGraph()
    free.add_nodes_from(range(graph.n_nodes))
    for arc, (tail, head) in enumerate(zip(graph.tail.tolist(), graph.head.tolist(), strict=True)):
        if used[arc] != USED:
            free.add_edge(tail, head, cost=-log(graph.mean_survival[arc]), length=graph.length[arc])
    return free


def whole_graph(mission):
    return free_graph(mission, np.zeros(mission.world.graph.n_arcs))


def open_nodes(mission):
    """The nodes from which a way leads to the end; others are of no use to a kind."""
    free = whole_graph(mission)
    return [node for node in free if nx.has_path(free, node, end_at(mission, node))]


def draw_used(mission, data):
    n_arcs = mission.world.graph.n_arcs
    marks = data.draw(st.lists(st.sampled_from([3, USED]), min_size=n_arcs, max_size=n_arcs))
    return np.array(marks, np.int64)


def assert_path(graph, used, path, source, target):
    """Whether arcs lead from source to target, unused ones, each once; their survival, length."""
    here = source
    for arc in path:
        assert graph.tail[arc] == here
        assert used[arc] != USED
        here = graph.head[arc]
    assert here == target
    assert len(set(path)) == len(path)
    return prod(graph.mean_survival[path]), sum(graph.length[path])


@examples(200)
@given(mission=missions(max_nodes=9) | team_missions(), data=st.data())
def test_paths_are_the_safest_over_unused_arcs(mission, data):
    world, nodes = mission.world, st.sampled_from(open_nodes(mission))
    scratch = paths.new_paths(world)
    for _ in range(5):
        used = draw_used(mission, data)
        source, target = data.draw(nodes), data.draw(nodes)
        free = free_graph(mission, used)
        end = end_at(mission, source)
        for goal in (target, end):
            if goal == end and data.draw(st.booleans()):
                n = paths.way_home(world, scratch, used, TRAIL, source)
            else:
                n = paths.safest_path(world.graph, scratch, used, TRAIL, source, goal)
            if not nx.has_path(free, source, goal):
                assert n == -1
                continue
            cost = nx.dijkstra_path_length(free, source, goal, weight="cost")
            found = assert_path(world.graph, used, scratch.path[:n].tolist(), source, goal)
            assert found[0] == pytest.approx(np.exp(-cost))


@examples(100)
@given(missions(min_nodes=1, max_nodes=9) | team_missions(), st.integers(1, 8))
def test_the_nearest_nodes_are_those_that_are_safest_to_reach(mission, n_near):
    n_nodes = mission.world.graph.n_nodes
    assert (paths.new_near(n_nodes, n_near).nodes == -1).all()
    near, free = paths.find_near(mission.world, n_near), whole_graph(mission)
    assert near.nodes.shape == near.reach.shape == (n_nodes, min(n_near, n_nodes - 1))
    for node in range(n_nodes):
        costs = nx.single_source_dijkstra_path_length(free, node, weight="cost")
        del costs[node]
        n = min(len(costs), near.nodes.shape[1])
        found, reach = near.nodes[node].tolist(), near.reach[node]
        assert len({*found[:n], node}) == n + 1
        assert found[n:] == [node] * (len(found) - n)
        assert not reach[n:].any()
        for nearest in ([costs[other] for other in found[:n]], sorted(costs.values())[:n]):
            assert reach[:n] == pytest.approx(np.exp(-np.array(nearest)), rel=1e-12)


@examples(300)
@given(
    missions(max_nodes=8, lengths=lengths) | team_missions(lengths=lengths),
    st.data(),
    st.sampled_from([0.0, 0.2, 0.6]),
    st.sampled_from([0.0, 2.0, 4.0, 7.0]),
)
def test_ways_within_limits_are_the_safest_or_else_the_shortest(mission, data, least, longest):
    """Each robot keeps its own limits."""
    world = mission.world.with_limits(mission.limits(least, longest))
    scratch, used = paths.new_paths(world), draw_used(mission, data)
    free, shortest = free_graph(mission, used), world.ways.shortest
    alive, length = data.draw(st.floats(0.3, 1.0)), data.draw(st.floats(0.0, 2.0))
    for node in open_nodes(mission):
        kind, end = mission.kinds[node // len(mission.nodes)], end_at(mission, node)
        limits = max(least, kind.min_survival), min(longest, kind.max_length or np.inf)
        trail = 7 * mission.robots + mission.kind_of.index(kind)
        marks = np.where(used == USED, trail, 3)
        n = paths.way_within(world, shortest, scratch, marks, trail, node, alive, length)
        if n >= 0:
            path = scratch.path[:n].tolist()
            survival, walked = assert_path(world.graph, used, path, node, end)
            assert alive * survival >= limits[0] * (1 - 1e-15)
            assert length + walked <= limits[1] * (1 + 1e-15)
        elif nx.has_path(free, node, end):
            for weight in ("cost", "length"):  # where ways tie, it is any of them
                found = best_ways(free, node, end, weight)
                assert len(found) > 1 or not_kept(free, found[0], alive, length, limits)


def best_ways(free, node, base, weight):
    """All ways to the base of least weight, to rounding."""
    if node == base:
        return [[node]]
    least = nx.dijkstra_path_length(free, node, base, weight=weight)
    found = nx.all_simple_paths(free, node, base)
    return [way for way in found if nx.path_weight(free, way, weight) <= least + 1e-9]


def not_kept(free, way, alive, length, limits):
    """Whether a trail that goes on by a way breaks a limit, or only just keeps it."""
    alive *= np.exp(-nx.path_weight(free, way, "cost"))
    length += nx.path_weight(free, way, "length")
    return alive < limits[0] + 1e-9 or length > limits[1] - 1e-9


@examples(200)
@given(missions(max_nodes=8) | team_missions(), st.data())
def test_leads_home_is_reachability_over_unused_arcs(mission, data):
    """Whatever is remembered: of other trails, or ways that go round in circles."""
    world, scratch = mission.world, paths.new_paths(mission.world)
    graph = world.graph
    for node in [node for node in open_nodes(mission) if node != end_at(mission, node)]:
        arcs = st.integers(graph.first[node], graph.first[node + 1] - 1)
        scratch.onward[node] = data.draw(arcs)
    for _ in range(4):
        used = draw_used(mission, data)
        free = free_graph(mission, used)
        for node in open_nodes(mission):
            found, end = paths.leads_home(world, scratch, used, TRAIL, node), end_at(mission, node)
            assert found == nx.has_path(free, node, end)
            while found and node != end:
                arc = scratch.onward[node]
                assert used[arc] != USED
                node = graph.head[arc]
