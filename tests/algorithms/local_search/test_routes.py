"""Safest paths to a node against networkx, from all nodes or those that are safest to come from."""

from math import log

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search.kernels import state as kernels
from botohe_moo.algorithms.local_search.kernels.state import FAR, UNKNOWN
from botohe_moo.core.paths import find_near
from tests.core.test_paths import whole_graph
from tests.examples import examples
from tests.strategies import missions, team_missions


def distances_to(mission, goal):
    """Cost of the safest path from each node from which there is one."""
    backwards = whole_graph(mission).reverse()
    return nx.single_source_dijkstra_path_length(backwards, goal, weight="cost")


def find_routes(world, per_length=0.0):
    return kernels.find_routes(world, np.full(world.graph.n_nodes, per_length))


def assert_routes(mission, routes, goal, n_known):
    """Whether a row leads to its goal, as safely as possible, from the nodes nearest to it."""
    graph, safest = mission.world.graph, distances_to(mission, goal)
    assert routes.n_known[goal] == n_known
    entries = [kernels.route_entry(routes, goal, node) for node in range(graph.n_nodes)]
    known = {node: entry for node, entry in enumerate(entries) if entry != UNKNOWN}
    assert len(known) == min(n_known, len(safest))
    farthest = max(safest[node] for node in known)
    assert all(safest[node] >= farthest - 1e-9 for node in safest.keys() - known.keys())
    for node, entry in known.items():
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


@examples(60)
@given(missions(min_nodes=1, max_nodes=9) | team_missions())
def test_rows_hold_the_safest_paths_from_all_nodes(mission):
    routes = find_routes(mission.world)
    for goal in range(mission.world.graph.n_nodes):
        assert_routes(mission, routes, goal, mission.world.graph.n_nodes)


@examples(60)
@given(missions(min_nodes=4, max_nodes=9), st.integers(1, 4))
def test_on_larger_missions_rows_are_truncated(mission, near):
    graph = mission.world.graph
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "FULL_UP_TO", 3)
        patch.setattr(kernels, "NEAR", near)
        routes = find_routes(mission.world)
    assert routes.entries.shape == (graph.n_nodes, near)
    assert routes.leaving.size == 0
    for goal in range(graph.n_nodes):
        assert_routes(mission, routes, goal, near)


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
    missions(min_nodes=1, max_nodes=6) | team_missions(max_nodes=4),
    st.sampled_from([None, None, 0.2, 1.0, 30.0]),
)
def test_costs_and_lengths_of_the_cheapest_paths_there_and_back(mission, per_length):
    """Without a travel budget lengths cost nothing, and are not known."""
    world = mission.world.with_limits(mission.limits()._replace(has_budgets=per_length is not None))
    price, graph = per_length or 0.0, whole_graph(mission)
    for _, _, arc in graph.edges(data=True):
        arc["cost"] += price * arc["length"]
    priced = world.with_costs(world.graph.cost + price * world.graph.length)
    routes, n_nodes = find_routes(priced, price), world.graph.n_nodes
    assert routes.prices_length == (per_length is not None)
    costs = dict(nx.all_pairs_dijkstra_path_length(graph, weight="cost"))
    for node in range(n_nodes):
        for other in range(n_nodes):
            for there, found, lengths in (
                ((node, other), routes.leaving, routes.leaving_length),
                ((other, node), routes.coming, routes.coming_length),
            ):
                least = costs[there[0]].get(there[1], FAR)
                assert found[node, other] == pytest.approx(least, rel=1e-12, abs=1e-12)
                if per_length is None:
                    assert lengths.size == 0
                elif least < FAR:
                    possible = ways(graph, *there, least * (1 + 1e-9) + 1e-9)
                    length = pytest.approx(lengths[node, other], rel=1e-9, abs=1e-9)
                    assert any(way == length for way in possible)


def test_a_named_mission():
    museum = load_mission("art_museum")
    routes = find_routes(museum.world)
    assert (routes.near == find_near(museum.world, 12).nodes).all()
    for goal in range(len(museum.nodes)):
        assert_routes(museum, routes, goal, len(museum.nodes))
