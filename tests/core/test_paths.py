"""Safest paths and the graph under them against networkx, with any arcs used."""

import pickle
from math import log, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from botohe_moo import load_mission
from botohe_moo.core import graph as graphs
from botohe_moo.core import paths
from botohe_moo.core.graph import Limits, with_costs
from tests.examples import examples
from tests.strategies import lengths, missions, team_missions
from tests.twins import end_at

USED, TRAIL = 7, 7


def compiled(name, module=paths):
    return njit(getattr(module, name))


find_path, find_home = compiled("safest_path"), compiled("way_home")
search_paths, way_within = compiled("search_paths"), compiled("way_within")
leads_home = compiled("leads_home")


def free_graph(mission, used):
    graph = mission.arrays
    free = nx.DiGraph()
    free.add_nodes_from(range(graph.n_nodes))
    for arc, (tail, head) in enumerate(zip(graph.tail.tolist(), graph.head.tolist(), strict=True)):
        if used[arc] != USED:
            free.add_edge(tail, head, cost=-log(graph.survival[arc]), length=graph.length[arc])
    return free


def open_nodes(mission):
    """The nodes from which a way leads to the end; others are of no use to a kind."""
    free = free_graph(mission, np.zeros(mission.arrays.n_arcs, np.int64))
    return [node for node in free if nx.has_path(free, node, end_at(mission, node))]


def draw_used(mission, data):
    n_arcs = mission.arrays.n_arcs
    marks = data.draw(st.lists(st.sampled_from([3, USED]), min_size=n_arcs, max_size=n_arcs))
    return np.array(marks, np.int64)


def assert_path(graph, used, path, source, target, survival):
    """Whether arcs lead from source to target, unused ones, each once, as safely as possible."""
    here = source
    for arc in path:
        assert graph.tail[arc] == here
        assert used[arc] != USED
        here = graph.head[arc]
    assert here == target
    assert len(set(path)) == len(path)
    assert prod(graph.survival[list(path)]) == pytest.approx(survival)


@examples(200)
@given(mission=missions(max_nodes=9) | team_missions(), data=st.data())
def test_paths_are_the_safest_over_unused_arcs(mission, data):
    graph, nodes = mission.arrays, st.sampled_from(open_nodes(mission))
    scratch = paths.new_paths(graph)
    for _ in range(5):
        used = draw_used(mission, data)
        source, target = data.draw(nodes), data.draw(nodes)
        free = free_graph(mission, used)
        end = end_at(mission, source)
        for goal in (target, end):
            if goal == end and data.draw(st.booleans()):
                n = find_home(graph, scratch, used, TRAIL, source)
            else:
                n = find_path(graph, scratch, used, TRAIL, source, goal)
            if not nx.has_path(free, source, goal):
                assert n == -1
                continue
            cost = nx.dijkstra_path_length(free, source, goal, weight="cost")
            assert_path(graph, used, scratch.path[:n].tolist(), source, goal, np.exp(-cost))


@examples(200)
@given(mission=missions(max_nodes=9) | team_missions(), data=st.data(), backwards=st.booleans())
def test_searches_find_the_nearest_nodes_first(mission, data, backwards):
    graph, scratch = mission.arrays, paths.new_paths(mission.arrays)
    used, n_nodes = draw_used(mission, data), graph.n_nodes
    source, n_most = data.draw(st.integers(0, n_nodes - 1)), data.draw(st.integers(1, n_nodes))
    n = search_paths(graph, scratch, used, TRAIL, source, paths.ANYWHERE, n_most, backwards)
    free = free_graph(mission, used)
    free = free.reverse() if backwards else free
    costs = nx.single_source_dijkstra_path_length(free, source, weight="cost")
    assert n == min(n_most, len(costs))
    found = scratch.order[:n]
    assert len(set(found.tolist())) == n
    assert scratch.distance[found] == pytest.approx(sorted(costs.values())[:n])
    assert [costs[node] for node in found.tolist()] == pytest.approx(sorted(costs.values())[:n])
    for node in found.tolist():
        arc = scratch.entry[node]
        if node == source:
            assert arc == -1
        else:
            ends = (graph.tail[arc], graph.head[arc])
            assert ends[0 if backwards else 1] == node
            assert used[arc] != USED


def assert_limited(mission, used, path, node, trail, limits):
    """Whether arcs lead home from a node, and a trail that goes on by them keeps the limits."""
    graph, (alive, length), here = mission.arrays, trail, node
    for arc in path:
        assert graph.tail[arc] == here
        assert used[arc] != USED
        here = graph.head[arc]
        alive, length = alive * graph.survival[arc], length + graph.length[arc]
    assert here == end_at(mission, node)
    kind = mission.kinds[node // len(mission.nodes)]
    assert alive >= max(limits.min_survival, kind.min_survival)
    assert length <= min(limits.max_length, kind.max_length or np.inf)


@examples(300)
@given(
    missions(max_nodes=8, lengths=lengths) | team_missions(lengths=lengths),
    st.data(),
    st.sampled_from([0.0, 0.2, 0.6]),
    st.sampled_from([0.0, 2.0, 4.0, 7.0]),
)
def test_ways_within_limits_are_the_safest_or_else_the_shortest(mission, data, least, longest):
    graph, scratch = mission.arrays, paths.new_paths(mission.arrays)
    used, limits = draw_used(mission, data), mission.limits(least, longest)
    free, budget = free_graph(mission, used), paths.new_budget(graph, limits)
    alive, length = data.draw(st.floats(0.3, 1.0)), data.draw(st.floats(0.0, 2.0))
    for node in open_nodes(mission):
        end = end_at(mission, node)
        n = way_within(graph, budget, scratch, used, TRAIL, node, alive, length)
        if n >= 0:
            path = scratch.path[:n].tolist()
            assert_limited(mission, used, path, node, (alive, length), Limits(least, longest))
            continue
        if not nx.has_path(free, node, end):
            continue
        floors, budgets = limits.floors, limits.budgets
        here = limits if floors is None else Limits(floors[node], budgets[node])
        for weight in ("cost", "length"):  # where ways tie, it is any of them
            found = best_ways(free, node, end, weight)
            assert len(found) > 1 or not_kept(free, found[0], alive, length, here)


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
    return alive < limits.min_survival + 1e-9 or length > limits.max_length - 1e-9


@examples(200)
@given(missions(max_nodes=8) | team_missions(), st.data())
def test_leads_home_is_reachability_over_unused_arcs(mission, data):
    """Whatever is remembered: of other trails, or ways that go round in circles."""
    graph, scratch = mission.arrays, paths.new_paths(mission.arrays)
    for node in [node for node in open_nodes(mission) if node != end_at(mission, node)]:
        arcs = st.integers(graph.first[node], graph.first[node + 1] - 1)
        scratch.onward[node] = data.draw(arcs)
    for _ in range(4):
        used = draw_used(mission, data)
        free = free_graph(mission, used)
        for node in open_nodes(mission):
            found, end = leads_home(graph, scratch, used, TRAIL, node), end_at(mission, node)
            assert found == nx.has_path(free, node, end)
            while found and node != end:
                arc = scratch.onward[node]
                assert used[arc] != USED
                node = graph.head[arc]


@examples(100)
@given(missions(max_nodes=9, lengths=lengths) | team_missions(lengths=lengths))
def test_the_graph_by_length(mission):
    graph = mission.arrays
    short = with_costs(graph, graph.length)
    free = free_graph(mission, np.zeros(graph.n_arcs, np.int64))
    assert np.array_equal(short.cost, graph.length)
    for node in open_nodes(mission):
        end = end_at(mission, node)
        expected = nx.dijkstra_path_length(free, node, end, weight="length")
        assert short.home[node] == pytest.approx(expected)
        here, total = node, 0.0
        while here != end:
            arc = short.homeward[here]
            assert graph.tail[arc] == here
            here, total = graph.head[arc], total + graph.length[arc]
        assert total == pytest.approx(expected)
    assert paths.new_budget(graph, Limits(0.5)) is None


@examples(200)
@given(missions(max_nodes=9, one_way=True) | team_missions())
def test_the_graph(mission):
    graph = mission.arrays
    free = free_graph(mission, np.zeros(graph.n_arcs, np.int64))
    assert np.array_equal(graph.first[graph.tail], np.searchsorted(graph.tail, graph.tail))
    assert np.exp(-graph.cost) == pytest.approx(graph.survival)
    pairs = list(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    assert pairs == sorted(pairs)
    for arc, (tail, head) in enumerate(pairs):
        back = graph.reverse[arc]
        assert (back >= 0) == ((head, tail) in pairs)
        assert back < 0 or pairs[back] == (head, tail)
    for node in range(graph.n_nodes):
        entering = graph.entering[graph.first_entering[node] : graph.first_entering[node + 1]]
        assert entering.tolist() == [arc for arc, (_, head) in enumerate(pairs) if head == node]
        if node not in open_nodes(mission):
            assert free.degree(node) == 0
            continue
        end = end_at(mission, node)
        cost = nx.dijkstra_path_length(free, node, end, weight="cost")
        assert graph.home[node] == pytest.approx(np.exp(-cost))
        here, hops = node, 0
        while here != end:
            assert graph.tail[graph.homeward[here]] == here
            here = graph.head[graph.homeward[here]]
            hops += 1
            assert hops < graph.n_nodes
        assert graph.homeward[end] == -1
    degrees = [free.in_degree(node) == free.out_degree(node) for node in free]
    closed = [len(set(kind.ends(mission.base))) == 1 for kind in mission.kinds]
    assert graph.balanced == all(degrees + closed)


@examples(200)
@given(missions(max_nodes=30))
def test_find_arc(mission):
    graph, find = mission.arrays, graphs.find_arc
    known = {
        pair: i for i, pair in enumerate(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    }
    for tail in range(graph.n_nodes):
        for head in range(graph.n_nodes):
            assert find(graph, tail, head) == known.get((tail, head), -1)


def test_it_is_read_only_also_after_pickling():
    for graph in (
        load_mission("toy").arrays,
        pickle.loads(pickle.dumps(load_mission("toy").arrays)),
    ):
        for array in graph:
            if isinstance(array, np.ndarray):
                with pytest.raises(ValueError, match="read-only"):
                    array[0] = 2
