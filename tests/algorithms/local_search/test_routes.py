"""Safest paths to a node against networkx, from all nodes or those that are safest to come from."""

from math import inf, log

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search.kernels import routes as kernels
from botohe_moo.algorithms.local_search.kernels.routes import UNKNOWN
from tests.core.test_paths import whole_graph
from tests.examples import examples
from tests.strategies import missions, team_missions


def distances_to(mission, goal):
    """Cost of the safest path from each node from which there is one."""
    backwards = whole_graph(mission).reverse()
    return nx.single_source_dijkstra_path_length(backwards, goal, weight="cost")


def new_routes(world, per_length=0.0):
    return kernels.new_routes(world, np.full(world.graph.n_nodes, per_length))


def assert_routes(mission, routes, goal, n_known):
    """Whether a row leads to its goal, as safely as possible, from the nodes nearest to it."""
    graph, safest = mission.world.graph, distances_to(mission, goal)
    assert routes.n_known[goal] == n_known
    entries = routes.entries[goal, :n_known]
    sources = entries["source"][np.isfinite(entries["cost"])].tolist()
    assert sources == sorted(set(sources))
    assert set(sources) <= set(safest)
    known = max(safest[node] for node in sources)
    assert all(safest[node] >= known - 1e-9 for node in set(safest) - set(sources))
    for node in range(graph.n_nodes):
        entry = kernels.route_entry(routes, goal, node)
        assert (entry == UNKNOWN) == (node not in sources)
        if entry == UNKNOWN:
            continue
        assert routes.entries[goal, entry].cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)
        cost, here = 0.0, node
        while here != goal:
            arc = routes.entries[goal, entry].arc
            assert graph.tail[arc] == here
            cost -= log(graph.survival[arc])
            here, entry = graph.head[arc], routes.entries[goal, entry].onward
            assert routes.entries[goal, entry].source == here
        assert routes.entries[goal, entry].arc == -1
        assert cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)


def search(mission, routes, goal):
    kernels.search_routes(mission.arrays, routes, goal)


@examples(60)
@given(missions(min_nodes=1, max_nodes=9), st.data())
def test_rows_hold_the_safest_paths_from_all_nodes(mission, data):
    routes, n_nodes = kernels.new_routes(mission.arrays, 0.0), mission.arrays.n_nodes
    assert not routes.n_known.any()  # nothing is searched before somebody asks
    goals = data.draw(st.permutations(range(n_nodes)))
    for i, goal in enumerate(goals):
        search(mission, routes, goal)
        assert (routes.n_known > 0).sum() == i + 1
    for goal in goals:
        assert_routes(mission, routes, goal, n_nodes)


@examples(60)
@given(missions(min_nodes=4, max_nodes=9), st.integers(1, 4))
def test_on_larger_missions_rows_are_truncated(mission, near):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "FULL_UP_TO", 3)
        patch.setattr(kernels, "NEAR", near)
        routes = kernels.new_routes(mission.arrays, 0.0)
    assert routes.entries.shape == (mission.arrays.n_nodes, near)
    for goal in range(mission.arrays.n_nodes):
        search(mission, routes, goal)
        assert_routes(mission, routes, goal, near)


@examples(40)
@given(missions(min_nodes=2, max_nodes=9), st.integers(1, 8))
def test_the_nearest_nodes_are_those_that_are_safest_to_reach(mission, n_near):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "_N_NEIGHBOURS", n_near)
        routes = kernels.new_routes(mission.arrays, 0.0)
    n_nodes = mission.arrays.n_nodes
    assert routes.near.shape == (n_nodes, min(n_near, n_nodes - 1))
    safest = [distances_to(mission, goal) for goal in range(n_nodes)]
    for node in range(n_nodes):
        assert (routes.near[node] == -1).all()
        kernels.search_near(mission.arrays, routes, node)
        near = routes.near[node].tolist()
        assert len({*near, node}) == len(near) + 1
        found = [safest[goal][node] for goal in near]
        others = sorted(safest[goal][node] for goal in range(n_nodes) if goal != node)
        assert found == pytest.approx(others[: len(near)], rel=1e-12, abs=1e-12)


@examples(40)
@given(missions(min_nodes=1, max_nodes=9))
def test_everywhere_the_way_home_is_known(mission):
    arrays, safest = mission.arrays, distances_to(mission, 0)
    for node in range(graph.n_nodes):
        cost, here = 0.0, node
        while here != arrays.base:
            assert arrays.tail[arrays.homeward[here]] == here
            cost -= log(arrays.survival[arrays.homeward[here]])
            here = arrays.head[arrays.homeward[here]]
        assert cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)


def ways(graph, source, target, limit):
    """Lengths of all simple paths that cost at most so much."""
    if source == target:
        return [0.0]
    found = nx.all_simple_edge_paths(graph, source, target)
    labelled = [[graph.edges[arc] for arc in path] for path in found]
    return [
        sum(arc["length"] for arc in path)
        for path in labelled
        if sum(arc["cost"] for arc in path) <= limit
    ]


@examples(60)
@given(
    missions(min_nodes=1, max_nodes=6), st.sampled_from([0.0, 0.0, 0.2, 1.0, 30.0]), st.randoms()
)
def test_costs_and_lengths_of_the_cheapest_paths_there_and_back(mission, per_length, random):
    arrays = mission.arrays
    priced = with_costs(arrays, arrays.cost + per_length * arrays.length)
    routes, n_nodes = kernels.new_routes(priced, per_length), arrays.n_nodes
    graph = nx.DiGraph()
    graph.add_nodes_from(range(n_nodes))
    for arc in range(arrays.n_arcs):
        ends = int(arrays.tail[arc]), int(arrays.head[arc])
        cost = -log(arrays.survival[arc]) + per_length * arrays.length[arc]
        graph.add_edge(*ends, cost=cost, length=arrays.length[arc])
    costs = dict(nx.all_pairs_dijkstra_path_length(graph, weight="cost"))
    for node in random.sample(range(n_nodes), n_nodes):
        assert routes.is_known[node] == 0
        for _ in range(2):  # the second time it is known
            kernels.search_costs(priced, routes, node)
        for other in range(n_nodes):
            for there, found, lengths in (
                ((node, other), routes.leaving, routes.leaving_length),
                ((other, node), routes.coming, routes.coming_length),
            ):
                least = costs[there[0]][there[1]]
                assert found[node, other] == pytest.approx(least, rel=1e-12, abs=1e-12)
                if per_length == 0.0:
                    assert routes.per_length == 0.0
                    continue
                possible = ways(graph, *there, least * (1 + 1e-9) + 1e-9)
                length = pytest.approx(lengths[node, other], rel=1e-9, abs=1e-9)
                assert any(way == length for way in possible)


def test_a_named_mission():
    museum = load_mission("art_museum")
    routes = kernels.new_routes(museum.arrays, 0.0)
    for goal in range(len(museum.nodes)):
        search(museum, routes, goal)
        assert_routes(museum, routes, goal, len(museum.nodes))


@pytest.mark.parametrize("full_up_to", [3, 100])
@pytest.mark.parametrize("with_costs", [False, True])
def test_all_at_once_are_those_one_by_one(monkeypatch, full_up_to, with_costs):
    monkeypatch.setattr(kernels, "FULL_UP_TO", full_up_to)
    monkeypatch.setattr(kernels, "NEAR", 4)
    graph = load_mission("art_museum").arrays
    with_costs = with_costs and full_up_to == 100
    whole, single = kernels.new_routes(graph, 0.0), kernels.new_routes(graph, 0.0)
    kernels.search_routes(graph, whole, 7)  # some may be known
    if with_costs:
        kernels.search_costs(graph, whole, 5)
    search_all = getattr(kernels.search_all, "py_func", kernels.search_all)
    search_all(graph, whole, with_costs)
    for node in range(graph.n_nodes):
        kernels.search_near(graph, single, node)
        kernels.search_routes(graph, single, node)
        if with_costs:
            kernels.search_costs(graph, single, node)
    for name in ("n_known", "near", *(("is_known", "leaving", "coming") if with_costs else ())):
        assert (getattr(whole, name) == getattr(single, name)).all(), name
    for node, n in enumerate(single.n_known):
        assert (whole.entries[node, :n] == single.entries[node, :n]).all()
