"""Hypothesis strategies for missions and for valid trail plans on them."""

from __future__ import annotations

import networkx as nx
from hypothesis import assume
from hypothesis import strategies as st

from botohe_moo.mission import Mission
from tests.twins import all_trails

survivals = st.one_of(st.just(1.0), st.floats(0.01, 1.0))
rewards = st.one_of(st.just(0.0), st.floats(0.0, 10.0))
lengths = st.one_of(st.sampled_from([0.0, 0.1, 0.2, 1.0, 2.0, 3.0]), st.floats(0.0, 3.0))
_LENGTHS = lengths


@st.composite
def missions(
    draw,
    min_nodes=2,
    max_nodes=7,
    max_robots=3,
    one_way=None,
    survivals=survivals,
    lengths=None,
):
    """Strongly connected missions; one-way ones have nodes with more arcs in than out.

    In half of them some arcs, or all, have a length; with ``lengths`` all arcs have one of these.
    """
    n_nodes = draw(st.integers(min_nodes, max_nodes))
    one_way = draw(st.booleans()) if one_way is None else one_way
    graph = nx.DiGraph()
    graph.add_node(0, reward=draw(rewards))
    for node in range(1, n_nodes):
        graph.add_node(node, reward=draw(rewards))
        before = st.integers(0, node - 1)
        entry = draw(before)
        graph.add_edge(entry, node)
        graph.add_edge(node, draw(before) if one_way else entry)
    if n_nodes > 1:
        for tail, offset in draw(
            st.lists(
                st.tuples(st.integers(0, n_nodes - 1), st.integers(1, n_nodes - 1)), max_size=6
            )
        ):
            head = (tail + offset) % n_nodes
            graph.add_edge(tail, head)
            if not one_way:
                graph.add_edge(head, tail)
    for tail, head in graph.edges:
        graph.edges[tail, head]["survival"] = draw(survivals)
    arcs = list(graph.edges)
    if lengths is None:
        lengths, arcs = _LENGTHS, draw(st.sampled_from([[], [], arcs[::2], arcs]))
    for arc in arcs:
        graph.edges[arc]["length"] = draw(lengths)
    return Mission(graph, base=0, robots=draw(st.integers(1, max_robots)), name="drawn")


@st.composite
def trails(draw, mission, max_hops=12):
    """A valid trail as node indices; it may visit nodes and the base several times."""
    arrays = mission.arrays
    unused = {node: [] for node in range(arrays.n_nodes)}
    for tail, head in zip(arrays.tail.tolist(), arrays.head.tolist(), strict=True):
        unused[tail].append(head)
    here, trail = arrays.base, [arrays.base]
    for _ in range(draw(st.integers(0, max_hops))):
        hops = [head for head in unused[here] if way_home(unused, (here, head), arrays.base)]
        if not hops:
            break
        head = draw(st.sampled_from(hops))
        unused[here].remove(head)
        trail.append(head)
        here = head
    return trail + way_home(unused, (None, here), arrays.base)[1:]


def way_home(unused, arc, base):
    """The shortest walk from an arc's head to the base that does not use the arc; None without."""
    before = {arc[1]: None}
    queue = [arc[1]]
    for node in queue:
        if node == base:
            walk = [node]
            while (node := before[node]) is not None:
                walk.append(node)
            return walk[::-1]
        for head in unused[node]:
            if head not in before and (node, head) != arc:
                before[head] = node
                queue.append(head)
    return None


@st.composite
def plans(draw, mission):
    """A valid plan, as a list of one trail of node indices per robot."""
    return [draw(trails(mission)) for _ in range(mission.robots)]


@st.composite
def missions_with_plans(draw, **options):
    mission = draw(missions(**options))
    return mission, mission.plan(draw(plans(mission)))  # the nodes' labels are their indices


@st.composite
def small_missions(draw, max_robots=3, max_trails=40, **options):
    """A mission with few trails, and all of them."""
    mission = draw(missions(min_nodes=1, max_nodes=5, max_robots=max_robots, **options))
    assume(not 0 < mission.total_reward < 1e-300)  # of which parts would be rounded to nothing
    trails = all_trails(mission, 1000)
    assume(trails is not None and len(trails) <= max_trails)
    return mission, trails
