"""Safest paths against networkx, with any arcs used."""

from math import log, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo.kernels.graph.old_paths import safest_path, way_home
from tests.strategies import missions


def free_graph(mission, used):
    walk = mission.walk
    graph = nx.DiGraph()
    graph.add_nodes_from(range(len(walk.home)))
    for arc, (tail, head) in enumerate(zip(walk.tail.tolist(), walk.head.tolist(), strict=True)):
        if arc != walk.loop and used[arc] != 7:
            graph.add_edge(tail, head, cost=-log(walk.survival[arc]))
    return graph


def scratch(mission):
    n_nodes, n_arcs = len(mission.walk.home), len(mission.walk.head)
    return {
        "met": np.full(n_nodes, -1, np.int64),
        "distance": np.empty(n_nodes),
        "entry": np.empty(n_nodes, np.int32),
        "keys": np.empty(n_arcs + 1),
        "held": np.empty(n_arcs + 1, np.int32),
        "path": np.empty(n_nodes, np.int32),
    }


def assert_path(mission, used, arcs, source, target, survival):
    """Whether arcs lead from source to target, unused ones, each once, as safely as possible."""
    walk = mission.walk
    here = source
    for arc in arcs:
        assert walk.tail[arc] == here
        assert used[arc] != 7
        here = walk.head[arc]
    assert here == target
    assert len(set(arcs)) == len(arcs)
    assert prod(walk.survival[list(arcs)]) == pytest.approx(survival)


@settings(max_examples=200)
@given(mission=missions(max_nodes=9), data=st.data())
def test_paths_are_the_safest_over_unused_arcs(mission, data):
    walk, n_nodes = mission.walk, len(mission.nodes)
    space = scratch(mission)
    nodes = st.integers(0, n_nodes - 1)
    for search in range(5):
        used = np.array(
            data.draw(
                st.lists(st.sampled_from([3, 7]), min_size=len(walk.head), max_size=len(walk.head))
            )
        )
        source, target = data.draw(nodes), data.draw(nodes)
        graph = free_graph(mission, used)
        for leg, goal in enumerate((target, walk.base)):
            number = 2 * search + leg
            by_home = goal == walk.base and data.draw(st.booleans())
            common = (walk.first, walk.tail, walk.head, walk.cost)
            if by_home:
                n = way_home(
                    *common, walk.homeward, walk.base, used, 7, source, number, *space.values()
                )
            else:
                n = safest_path(*common, used, 7, source, goal, number, *space.values())
            if not nx.has_path(graph, source, goal):
                assert n == -1
                continue
            cost = nx.dijkstra_path_length(graph, source, goal, weight="cost")
            assert_path(mission, used, space["path"][:n].tolist(), source, goal, np.exp(-cost))


@settings(max_examples=200)
@given(missions(max_nodes=9))
def test_homes_are_the_safest(mission):
    walk = mission.walk
    graph = free_graph(mission, np.zeros(len(walk.head), np.int64))
    for node in range(len(mission.nodes)):
        cost = nx.dijkstra_path_length(graph, node, walk.base, weight="cost")
        assert walk.home[node] == pytest.approx(np.exp(-cost))
        if node != walk.base:
            assert walk.tail[walk.homeward[node]] == node
    assert walk.homeward[walk.base] == -1


def test_walk_is_read_only_and_left_out_of_pickles():
    import pickle

    from botohe_moo import load_mission

    mission = load_mission("toy")
    assert mission.walk is mission.walk
    with pytest.raises(ValueError, match="read-only"):
        mission.walk.home[0] = 2.0
    assert "walk" not in pickle.loads(pickle.dumps(mission)).__dict__
