"""Safest paths to a node against networkx, from all nodes or those that are safest to come from."""

from math import log

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.kernels.local_search import routes as kernels
from botohe_moo.kernels.local_search.routes import UNKNOWN
from botohe_moo.search.local_search import _routes
from tests.strategies import missions
from tests.twins import plain_local_search


@pytest.fixture(autouse=True, scope="module")
def plain():
    with plain_local_search():
        yield


def distances_to(mission, goal):
    """Cost of the safest path from each node."""
    graph = nx.DiGraph()
    graph.add_nodes_from(range(mission.arrays.n_nodes))
    labelled = mission.graph.edges(data="survival")
    graph.add_weighted_edges_from(
        (mission.index(v), mission.index(u), -log(survival)) for u, v, survival in labelled
    )
    return nx.single_source_dijkstra_path_length(graph, goal)


def assert_routes(mission, routes, goal, n_known):
    """Whether a row leads to its goal, as safely as possible, from the nodes nearest to it."""
    arrays, safest = mission.arrays, distances_to(mission, goal)
    assert routes.n_known[goal] == n_known
    sources = routes.source[goal, :n_known].tolist()
    assert sources == sorted(set(sources))
    known = max(safest[node] for node in sources)
    assert all(safest[node] >= known - 1e-9 for node in set(safest) - set(sources))
    for node in range(arrays.n_nodes):
        entry = kernels.route_entry(routes, goal, node)
        assert (entry == UNKNOWN) == (node not in sources)
        if entry == UNKNOWN:
            continue
        assert routes.cost[goal, entry] == pytest.approx(safest[node], rel=1e-12, abs=1e-12)
        cost, here = 0.0, node
        while here != goal:
            arc = routes.arc[goal, entry]
            assert arrays.tail[arc] == here
            cost -= log(arrays.survival[arc])
            here, entry = arrays.head[arc], routes.onward[goal, entry]
            assert routes.source[goal, entry] == here
        assert routes.arc[goal, entry] == -1
        assert cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)


def search(mission, routes, goal):
    cost = -np.log(mission.arrays.survival) + 0.0
    kernels.search_routes(mission.arrays.tail, mission.arrays.head, cost, routes, goal)


@settings(max_examples=60)
@given(missions(min_nodes=1, max_nodes=9), st.data())
def test_rows_hold_the_safest_paths_from_all_nodes(mission, data):
    routes, n_nodes = _routes(mission), mission.arrays.n_nodes
    assert not routes.n_known.any()  # nothing is searched before somebody asks
    goals = data.draw(st.permutations(range(n_nodes)))
    for i, goal in enumerate(goals):
        search(mission, routes, goal)
        assert (routes.n_known > 0).sum() == i + 1
    for goal in goals:
        assert_routes(mission, routes, goal, n_nodes)


@settings(max_examples=60)
@given(missions(min_nodes=4, max_nodes=9), st.integers(1, 4))
def test_on_larger_missions_rows_are_truncated(mission, near):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "FULL_UP_TO", 3)
        patch.setattr(kernels, "NEAR", near)
        routes = _routes(mission)
    assert routes.source.shape == (mission.arrays.n_nodes, near)
    for goal in range(mission.arrays.n_nodes):
        search(mission, routes, goal)
        assert_routes(mission, routes, goal, near)


@settings(max_examples=40)
@given(missions(min_nodes=1, max_nodes=9))
def test_everywhere_the_way_home_is_known(mission):
    routes, arrays, safest = _routes(mission), mission.arrays, distances_to(mission, 0)
    for node in range(arrays.n_nodes):
        cost, here = 0.0, node
        while here != arrays.base:
            assert arrays.tail[routes.homeward[here]] == here
            cost -= log(arrays.survival[routes.homeward[here]])
            here = arrays.head[routes.homeward[here]]
        assert cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)


def test_a_named_mission():
    museum = load_mission("art_museum")
    routes = _routes(museum)
    for goal in range(len(museum.nodes)):
        search(museum, routes, goal)
        assert_routes(museum, routes, goal, len(museum.nodes))
