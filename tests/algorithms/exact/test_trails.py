"""All trails worth having, found by kernels, against all trails there are."""

from itertools import pairwise
from math import inf

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.algorithms.exact import kernels as labelling
from botohe_moo.algorithms.exact.front import TrailSearch, without_base_reward
from botohe_moo.core.world import CHECKING
from botohe_moo.mission import Mission
from tests.examples import examples
from tests.strategies import lengths, missions, small_missions, trails
from tests.twins import all_trails, arc_survivals, length_of, survival_of, within


def goals_of(mission):
    reward, base = mission.rewards, mission.index(mission.base)
    return [v for v in range(len(reward)) if reward[v] > 0 and v != base]


def figures_of(mission, trail):
    """Probability to reach each goal, and to survive."""
    reached = [
        survival_of(mission, trail[: trail.index(goal) + 1]) if goal in trail else 0.0
        for goal in goals_of(mission)
    ]
    return [*reached, survival_of(mission, trail)]


def search_for(mission, least=0.0, longest=inf):
    """A search that knows no trail but the one that stays at base."""
    return TrailSearch(without_base_reward(mission.limited(least, longest)))


def found_trails(search):
    """The table of trails once no label is left, as rows of probabilities with survival last."""
    while not search.advance(1_000, lambda n_bytes: None):
        pass
    survives, reached = search.found()
    return np.column_stack([reached, survives])


def covers(some, others):
    """Whether each row of ``others`` is one of ``some`` to rounding, or worse."""
    return (some[:, None] + CHECKING >= others).all(axis=2).any(axis=0).all()


class TestLookingAround:
    @examples(150)
    @given(st.data(), missions(max_nodes=6, lengths=lengths), st.sampled_from([inf, 8.0, 3.0, 0.0]))
    def test_ways_and_arcs_of_no_use(self, data, mission, longest):
        trail = data.draw(trails(mission))
        partial = trail[: data.draw(st.integers(1, len(trail)))]
        search = search_for(mission, longest=longest)
        graph, search = mission.world.graph, search._search
        labels, new = search.labels, search.progress[0].n_labels
        arcs = list(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
        used = set(pairwise(partial))
        search.used[:] = [ends in used for ends in arcs]
        labels.rows[new].length, labels.rows[new].node = length_of(mission, partial), partial[-1]
        with np.errstate(all="ignore"):
            labelling.look_around(search)
        left = nx.DiGraph(arc for arc in arcs if arc not in used)
        left.add_nodes_from(range(graph.n_nodes))
        if longest < inf:
            left.remove_edges_from(list(arcs_too_far(mission, left, partial, longest)))
        survival = arc_survivals(mission)
        for u, v in left.edges:
            left.edges[u, v]["cost"] = -np.log(survival[u, v])
        costs = nx.single_source_dijkstra_path_length(left, partial[-1], weight="cost")
        for node in range(graph.n_nodes):
            expected = np.exp(-costs[node]) if node in costs else 0.0
            assert search.reach[node] == pytest.approx(expected, rel=1e-9)
        base = mission.index(mission.base)
        homeward = {base, *nx.ancestors(left, base)}
        for arc, (tail, head) in enumerate(arcs):
            useful = (tail, head) in left.edges and tail in costs and head in homeward
            assert labelling.has(labels.used[new], arc) == search.used[arc] == (not useful)


def arcs_too_far(mission, left, partial, longest):
    """The arcs that are left over which a partial trail cannot get home within a budget."""
    every = nx.DiGraph()
    every.add_nodes_from(left)
    graph, base = mission.world.graph, mission.index(mission.base)
    for tail, head, length in zip(graph.tail, graph.head, graph.length, strict=True):
        every.add_edge(int(tail), int(head), length=length)
    home = nx.single_source_dijkstra_path_length(every.reverse(), base, weight="length")
    ahead = nx.DiGraph()
    ahead.add_nodes_from(left)
    ahead.add_edges_from((arc[0], arc[1], every.edges[arc]) for arc in left.edges)
    to = nx.single_source_dijkstra_path_length(ahead, partial[-1], weight="length")
    for tail, head in left.edges:
        onward = every.edges[tail, head]["length"] + home[head]
        least = length_of(mission, partial) + to.get(tail, inf) + onward
        if least > longest * (1 + CHECKING):
            yield tail, head


@st.composite
def forked_missions(draw):
    """One robot on a ring whose stages have several ways on, the longer the safer.

    The best way home within a budget is often neither the safest nor the shortest one. Gives the
    mission, all its trails and a budget.
    """
    graph = nx.DiGraph(base=0, robots=1)
    for stage, reward in enumerate([0.0, 1.0, draw(st.sampled_from([0.0, 0.0, 2.0]))]):
        graph.add_node(stage, reward=reward)
        for way in range(draw(st.integers(2, 3))):
            length = draw(st.floats(0.0, 3.0))
            survival = draw(st.sampled_from([0.4, 0.5])) + length / 6
            graph.add_edge(stage, (stage, way), survival=survival, length=length)
            graph.add_edge((stage, way), (stage + 1) % 3, survival=1.0, length=0.0)
    nx.set_node_attributes(graph, {v: 0.0 for v in graph if isinstance(v, tuple)}, "reward")
    mission = Mission(graph)
    every = all_trails(mission)
    length = length_of(mission, draw(st.sampled_from(every)))
    return mission, every, length * (1 + CHECKING)


class TestTrails:
    @examples(150)
    @given(
        small_missions(max_trails=1000, lengths=lengths),
        st.sampled_from([0.0, 0.3, 0.81]),
        st.sampled_from([inf, 9.0, 5.0, 2.0]),
    )
    def test_a_team_finds_all_it_may_need(self, case, least, longest):
        mission, every = case
        mission = mission.with_robots(2)
        found = found_trails(search_for(mission, least, longest))
        kept = within(mission, every, least, longest)
        rows = np.array([figures_of(mission, trail) for trail in kept])
        assert covers(found, rows)
        assert covers(rows, found)
        better = (found[:, None] >= found).all(axis=2)
        assert not (better & (found[:, None] > found + CHECKING).any(axis=2)).any()
        assert (np.diff(found[:, -1]) <= 0).all()

    @examples(150)
    @given(
        small_missions(max_trails=1000, lengths=lengths),
        st.sampled_from([0.0, 0.3, 0.81]),
        st.sampled_from([inf, 9.0, 5.0, 2.0]),
    )
    def test_a_single_robot_finds_its_front(self, case, least, longest):
        mission, every = case
        self.check_single(mission.with_robots(1), every, least, longest)

    @examples(200)
    @given(forked_missions(), st.sampled_from([0.0, 0.1]))
    def test_ways_home_that_compromise_are_found(self, case, least):
        mission, every, longest = case
        self.check_single(mission, every, least, longest)

    def test_what_is_safer_but_longer_does_not_replace_what_is_short(self):
        """One goal, and three stages home: 0.9 or 0.5, then 0.9 or 0.1 twice; 0.9 takes 3, not 1.

        With a budget of 7 the short first stage leaves room for both other long ones, of which the
        long first stage leaves room for either.
        """
        graph = nx.DiGraph(base=0, robots=1)
        for node in range(10):
            graph.add_node(node, reward=float(node == 1))
        graph.add_edge(0, 1, survival=1.0, length=0.0)
        for start, stop, risky in [(1, 2, 0.5), (2, 3, 0.1), (3, 0, 0.1)]:
            for way, survival, length in [(2 * start + 2, 0.9, 3.0), (2 * start + 3, risky, 1.0)]:
                graph.add_edge(start, way, survival=survival, length=length)
                graph.add_edge(way, stop, survival=1.0, length=0.0)
        for longest, survives in ((2, []), (3, [0.005]), (5, [0.045]), (7, [0.405]), (9, [0.729])):
            found = found_trails(search_for(Mission(graph), longest=float(longest)))
            assert found[found[:, 0] > 0, 1] == pytest.approx(np.array(survives))

    def test_orders_of_three_spurs_that_collect_more_are_kept(self):
        """All orders of the same spurs are equally safe; a single robot needs the best ones."""
        graph = nx.DiGraph(base=0, robots=1)
        graph.add_nodes_from([(0, {"reward": 0.0}), (1, {"reward": 2.0})])
        graph.add_nodes_from([2, 3], reward=4.0)
        for node, out, back in ((1, 0.9, 0.7), (2, 0.7, 0.7), (3, 0.7, 0.9)):
            graph.add_edge(0, node, survival=out)
            graph.add_edge(node, 0, survival=back)
        mission = Mission(graph)
        self.check_single(mission, all_trails(mission), 0.0, inf)

    def check_single(self, mission, every, least, longest):
        found = found_trails(search_for(mission, least, longest))
        kept = within(mission, every, least, longest)
        rows = np.array([figures_of(mission, trail) for trail in kept])
        reward = mission.rewards[goals_of(mission)]
        share = rows[:, :-1] @ reward / (reward.sum() or 1.0)
        rows = np.column_stack([share, rows[:, -1]])
        assert covers(found, rows)
        assert covers(rows, found)

    def test_two_spurs(self):
        """Rewards behind 0.9 and 0.8, each way; counted by hand."""
        graph = nx.DiGraph(base=0, robots=2)
        graph.add_nodes_from([(0, {"reward": 1.0}), (1, {"reward": 4.0}), (2, {"reward": 3.0})])
        for node, survival in ((1, 0.9), (2, 0.8)):
            graph.add_edge(0, node, survival=survival)
            graph.add_edge(node, 0, survival=survival)
        search = search_for(Mission(graph))
        found = found_trails(search)
        expected = [[0, 0, 1], [0.9, 0, 0.81], [0, 0.8, 0.64], [0.9, 0.648, 0.5184]]
        expected.append([0.576, 0.8, 0.5184])
        assert len(found) == 5
        assert found[:3] == pytest.approx(np.array(expected[:3]))
        assert sorted(found[3:].tolist()) == pytest.approx(np.array(sorted(expected[3:])))
        # At base, at either end, and back at base with one end left to see.
        assert search.progress.n_labels == 5

    def test_the_other_way_round_is_no_better(self):
        """On a ring only direction and how far to go matter; going round twice is not possible."""
        graph = nx.cycle_graph(4, nx.DiGraph)
        nx.set_node_attributes(graph, 1.0, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        found = found_trails(search_for(Mission(graph, base=0, robots=2)))
        assert found.tolist() == [[0, 0, 0, 1], [0.5, 0.25, 0.125, 0.0625]]


class TestTrailsAsNodes:
    @examples(50)
    @given(
        small_missions(max_trails=200, lengths=lengths),
        st.sampled_from([1, 2]),
        st.sampled_from([inf, 4.0]),
    )
    def test_trails_are_what_the_table_says(self, case, robots, longest):
        mission, every = case
        every = within(mission, every, 0.0, longest * (1 + CHECKING))
        search = search_for(mission.with_robots(robots), longest=longest)
        found = found_trails(search)
        for row, figures in enumerate(found):
            trail = tuple(search.trail(row))
            assert trail in every
            expected = figures_of(mission, trail)
            assert figures[-1] == pytest.approx(expected[-1])
            if robots == 2:
                assert figures == pytest.approx(expected)
