"""The one model of a mission: its layers, limits by robot, and ways against networkx."""

import pickle
from math import inf

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, load_mission
from botohe_moo.core import world as worlds
from tests.core.test_paths import open_nodes, whole_graph
from tests.examples import examples
from tests.strategies import lengths, mission_of, missions, team_missions
from tests.twins import end_at


def assert_ways(graph, homeward, node, end):
    """Follow the first arcs of ways from a node to the end; return the arcs."""
    arcs = []
    while node != end:
        arcs.append(int(homeward[node]))
        assert graph.tail[arcs[-1]] == node
        node = graph.head[arcs[-1]]
        assert len(arcs) < graph.n_nodes
    assert homeward[end] == -1
    return arcs


@examples(200)
@given(missions(max_nodes=9, one_way=True) | team_missions())
def test_the_graph(mission):
    graph, free = mission.world.graph, whole_graph(mission)
    assert np.array_equal(graph.first[graph.tail], np.searchsorted(graph.tail, graph.tail))
    assert np.exp(-graph.cost) == pytest.approx(graph.mean_survival)
    pairs = list(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    assert pairs == sorted(pairs)
    for arc, (tail, head) in enumerate(pairs):
        assert graph.reverse[arc] == (pairs.index((head, tail)) if (head, tail) in pairs else -1)
        assert worlds.find_arc(graph, tail, head) == arc
    for node in range(graph.n_nodes):
        entering = graph.entering[graph.first_entering[node] : graph.first_entering[node + 1]]
        assert entering.tolist() == [arc for arc, (_, head) in enumerate(pairs) if head == node]
        if node not in open_nodes(mission):
            assert free.degree(node) == 0
        heads = [head for tail, head in pairs if tail == node]
        others = {*range(graph.n_nodes)} - {*heads}
        assert {worlds.find_arc(graph, node, head) for head in others} <= {-1}
    degrees = [free.in_degree(node) == free.out_degree(node) for node in free]
    closed = [len(set(kind.ends(mission.base))) == 1 for kind in mission.kinds]
    assert graph.balanced == all(degrees + closed)


@examples(200)
@given(
    missions(max_nodes=9, lengths=lengths) | team_missions(lengths=lengths),
    st.sampled_from([inf, 5.0]),
    st.sampled_from([0.0, 0.0, 0.5, 3.0]),
)
def test_ways_to_the_ends(mission, longest, per_length):
    """The safest ways, or the cheapest at other costs, and with a travel budget the shortest."""
    usual = mission.world.with_limits(mission.limits(0.0, longest))
    world = usual.with_costs(usual.graph.cost + per_length * usual.graph.length)
    graph, free, shortest = world.graph, whole_graph(mission), world.ways.shortest
    assert (shortest is usual.ways.shortest, world.limits is usual.limits) == (True, True)
    assert (shortest is None) == (not world.limits.has_budgets)
    for _, _, arc in free.edges(data=True):
        arc["cost"] += per_length * arc["length"]
    for node in open_nodes(mission):
        end = end_at(mission, node)
        cost = nx.dijkstra_path_length(free, node, end, weight="cost")
        for one in (world, usual) if per_length == 0.0 else (world,):
            arcs = assert_ways(graph, one.ways.homeward, node, end)
            assert graph.cost[arcs].sum() == pytest.approx(cost, abs=1e-12)
            assert one.ways.home[node] == pytest.approx(graph.mean_survival[arcs].prod())
        if shortest is not None:
            assert np.array_equal(shortest.graph.cost, graph.length)
            expected = nx.dijkstra_path_length(free, node, end, weight="length")
            arcs = assert_ways(graph, shortest.homeward, node, end)
            assert shortest.length[node] == pytest.approx(expected)
            assert graph.length[arcs].sum() == pytest.approx(expected)


def rover_and_drones(**of_rover):
    arcs, drone = (
        [(0, 1, 0.9), (1, 2, 0.9), (2, 0, 0.9)],
        Kind("drone", 2, min_survival=0.5, max_length=7),
    )
    return mission_of(arcs, [1] * 3, kinds=[Kind("rover", 1, **of_rover), drone])


@pytest.mark.parametrize(
    ("asked", "floors", "budgets"),
    [
        ((), [0.0, 0.5, 0.5], [inf, 7.0, 7.0]),
        ((0.6,), [0.6, 0.6, 0.6], [inf, 7.0, 7.0]),
        ((0.3, 9), [0.3, 0.5, 0.5], [9.0, 7.0, 7.0]),
        ((0.0, 4), [0.0, 0.5, 0.5], [4.0, 4.0, 4.0]),
    ],
)
def test_limits_are_by_robot(asked, floors, budgets):
    mission = rover_and_drones()
    limits, limited = mission.limits(*asked), mission.limited(*asked)
    assert (limits.floors.tolist(), limits.budgets.tolist()) == (floors, budgets)
    assert (limits.has_budgets, limits.has_floors) == (True, True)
    loosened = limits.loosened(0.25)
    assert loosened.floors.tolist() == [0.75 * floor for floor in floors]
    assert loosened.budgets.tolist() == [1.25 * budget for budget in budgets]
    for found, expected in zip(limited.limits, limits.loosened(worlds.PLANNING), strict=True):
        assert np.array_equal(found, expected)
    assert limited.graph is mission.world.graph


def test_without_limits_there_are_none_and_those_that_are_checked_are_wider_than_planned():
    free = load_mission("toy").limits()
    assert (free.has_floors, free.has_budgets) == (False, False)
    assert 0 < worlds.PLANNING < worlds.CHECKING


def test_ways_that_do_not_keep_the_limits_of_a_kind():
    """The ring of three arcs takes 3 and survives 0.729; the rover goes on from where it stands."""
    mission = rover_and_drones(start=1, end=0)
    world = mission.limited(0.6, 9)
    assert list(worlds.failing_ways(world)) == []
    ways = worlds.ways_to_ends(world)
    n = len(mission.nodes)
    assert [way.nodes for way in ways] == [[1, 2, 0], [n], [n]]
    assert [way.length for way in ways] == [2.0, 0.0, 0.0]
    assert ways[0].survival == pytest.approx(0.81)
    for limits in ((0.9, 9), (0.0, 1.5)):
        [(robot, way)] = worlds.failing_ways(mission.limited(*limits))
        assert (robot, way.nodes) == (0, [1, 2, 0])


@pytest.mark.parametrize("name", ["toy", "drones_and_rovers", "art_museum_return"])
def test_it_is_read_only_also_after_pickling(name):
    world = load_mission(name).limited(0.1, 9)
    for each in (world, pickle.loads(pickle.dumps(world)), world.with_costs(world.graph.length)):
        assert type(each) is worlds.World
        parts = [*each, each.ways.shortest, each.ways.shortest.graph]
        arrays = [array for part in parts for array in part or () if isinstance(array, np.ndarray)]
        assert len(arrays) > 30
        for array in arrays:
            assert not array.flags.writeable
            with pytest.raises(ValueError, match="read-only"):
                array[:] = 2
