"""Ways home that are remembered, against networkx."""

from math import log

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from botohe_moo import Mission
from botohe_moo.kernels.graph import paths, ways
from botohe_moo.kernels.graph.arcs import find_arc
from tests.examples import examples
from tests.strategies import missions

FREE, TRAIL = 3, 7

leads_home, survives_home, go_without_choice, end_trail = (
    njit(getattr(ways, name))
    for name in ("leads_home", "survives_home", "go_without_choice", "end_trail")
)


def free_graph(graph, used):
    """Give what is left of a graph."""
    free = nx.DiGraph()
    free.add_nodes_from(range(graph.n_nodes))
    for arc in np.flatnonzero(used != TRAIL):
        free.add_edge(graph.tail[arc], graph.head[arc], cost=-log(graph.survival[arc]), arc=arc)
    return free


def survival_home(free, node, base):
    """Give the survival of the safest way home, −1 where there is none."""
    if not nx.has_path(free, node, base):
        return -1.0
    return np.exp(-nx.dijkstra_path_length(free, node, base, weight="cost"))


@examples(200)
@given(missions(max_nodes=8), st.data())
def test_leads_home_is_reachability_over_unused_arcs(mission, data):
    """Whatever has been remembered of other trails."""
    graph, scratch = mission.arrays, paths.new_paths(mission.arrays)
    marks = st.lists(st.sampled_from([FREE, TRAIL]), min_size=graph.n_arcs, max_size=graph.n_arcs)
    for _ in range(4):
        used = np.array(data.draw(marks), np.int64)
        free = free_graph(graph, used)
        for node in free:
            found = leads_home(graph, scratch, used, TRAIL, node)
            assert found == nx.has_path(free, node, graph.base)


@examples(200)
@given(missions(max_nodes=8), st.integers(0, 2**32), st.sampled_from([0.0, 0.1, 0.4]))
def test_trails_that_ask_at_each_hop_are_told_the_truth(mission, seed, least):
    """Trails of one number, one after another: nothing of one may be taken for another's."""
    graph, scratch = mission.arrays, paths.new_paths(mission.arrays)
    rng = np.random.default_rng(seed)
    for _ in range(5):
        used = np.full(graph.n_arcs, FREE, np.int64)
        here, alive = graph.base, 1.0
        while True:
            arcs = np.arange(graph.first[here], graph.first[here + 1])
            arcs = arcs[used[arcs] != TRAIL]
            if len(arcs) == 0 or (here == graph.base and rng.random() < 0.2):
                break
            taken = -1
            for arc in rng.permutation(arcs):
                used[arc] = TRAIL
                if len(arcs) == 1 and here != graph.base:
                    go_without_choice(graph, scratch, TRAIL, graph.head[arc])
                    taken = arc
                    break
                arriving = alive * graph.survival[arc]
                safest = survival_home(free_graph(graph, used), graph.head[arc], graph.base)
                found = survives_home(graph, scratch, used, TRAIL, graph.head[arc], arriving, least)
                if arriving * safest != pytest.approx(least, rel=1e-9):
                    assert found == (safest > 0.0 and arriving * safest >= least)
                if found:
                    taken = arc
                    break
                used[arc] = FREE
            if taken < 0:
                assert here == graph.base or least > 0.0
                break
            here, alive = graph.head[taken], alive * graph.survival[taken]
        end_trail(scratch)


def two_nodes():
    """Give a base, 0, and two nodes from which arcs lead to each other and home."""
    graph = nx.DiGraph([(0, 1), (1, 2), (2, 1), (1, 0), (2, 0)])
    nx.set_node_attributes(graph, 1.0, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    return Mission(graph, base=0, robots=1).arrays


def test_ways_that_are_remembered_may_go_round_in_circles():
    """Each of two nodes remembers the other: neither way is free, and the arc home is found."""
    graph = two_nodes()
    scratch, used = paths.new_paths(graph), np.zeros(graph.n_arcs, np.int64)
    there, back = (find_arc(graph, *ends) for ends in ((1, 2), (2, 1)))
    scratch.ways["onward"][[1, 2]] = there, back
    assert leads_home(graph, scratch, used, TRAIL, 2)
    assert scratch.ways["onward"][2] == find_arc(graph, 2, 0)
    used[find_arc(graph, 1, 0)] = TRAIL
    assert leads_home(graph, scratch, used, TRAIL, 1)  # by the node whose way is known by now
    used[there] = TRAIL
    assert not leads_home(graph, scratch, used, TRAIL, 1)


def test_what_is_known_of_a_trail_ends_with_it():
    """Of two trails of one number the first one finds a node from which none leads home."""
    graph = two_nodes()
    scratch, used = paths.new_paths(graph), np.zeros(graph.n_arcs, np.int64)
    used[find_arc(graph, 1, 0)] = used[find_arc(graph, 2, 0)] = TRAIL
    assert not survives_home(graph, scratch, used, TRAIL, 1, 0.9, 0.0)
    used[:] = 0
    end_trail(scratch)
    assert survives_home(graph, scratch, used, TRAIL, 1, 0.9, 0.0)
