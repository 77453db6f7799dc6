"""Safest paths to a node against networkx, from all nodes or those that are safest to come from."""

from math import log

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search.kernels import routes as kernels
from botohe_moo.algorithms.local_search.kernels.routes import UNKNOWN
from botohe_moo.core.graph import with_costs
from botohe_moo.core.paths import search_near
from tests.examples import examples
from tests.strategies import missions


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
    sources = routes.entries["source"][goal, :n_known].tolist()
    assert sources == sorted(set(sources))
    known = max(safest[node] for node in sources)
    assert all(safest[node] >= known - 1e-9 for node in set(safest) - set(sources))
    for node in range(arrays.n_nodes):
        entry = kernels.route_entry(routes, goal, node)
        assert (entry == UNKNOWN) == (node not in sources)
        if entry == UNKNOWN:
            continue
        assert routes.entries[goal, entry].cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)
        cost, here = 0.0, node
        while here != goal:
            arc = routes.entries[goal, entry].arc
            assert arrays.tail[arc] == here
            cost -= log(arrays.survival[arc])
            here, entry = arrays.head[arc], routes.entries[goal, entry].onward
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
@given(missions(min_nodes=1, max_nodes=9))
def test_everywhere_the_way_home_is_known(mission):
    arrays, safest = mission.arrays, distances_to(mission, 0)
    for node in range(arrays.n_nodes):
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
        search_near(graph, single.paths, single.used, single.near, node)
        kernels.search_routes(graph, single, node)
        if with_costs:
            kernels.search_costs(graph, single, node)
    assert (whole.near.nodes == single.near.nodes).all()
    for name in ("n_known", *(("is_known", "leaving", "coming") if with_costs else ())):
        assert (getattr(whole, name) == getattr(single, name)).all(), name
    for node, n in enumerate(single.n_known):
        assert (whole.entries[node, :n] == single.entries[node, :n]).all()
