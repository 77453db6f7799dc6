"""Trails worth having and the best teams of them, against all that there are."""

from itertools import combinations_with_replacement, pairwise
from math import inf, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.algorithms.exact import kernels as labelling
from botohe_moo.algorithms.exact import kernels as teams
from botohe_moo.algorithms.exact.front import TrailSearch, without_base_reward
from botohe_moo.core.ordered import best_reward, grow_front, insert, new_front, read_front
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

    def check_single(self, mission, every, least, longest):
        found = found_trails(search_for(mission, least, longest))
        kept = within(mission, every, least, longest)
        rows = np.array([figures_of(mission, trail) for trail in kept])
        reward = mission.rewards[goals_of(mission)]
        share = rows[:, :-1] @ reward / (reward.sum() or 1.0)
        rows = np.column_stack([share, rows[:, -1]])
        assert covers(found, rows)
        assert covers(rows, found)


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


@st.composite
def pools(draw):
    """Trails as a table by descending survival, rewards, and a team size."""
    n_goals = draw(st.integers(1, 4))
    share = st.one_of(st.just(0.0), st.just(1.0), st.sampled_from([0.5, 0.25]), st.floats(0, 1))
    row = st.lists(share, min_size=n_goals + 1, max_size=n_goals + 1)
    rows = np.array([[0.0] * n_goals + [1.0], *draw(st.lists(row, max_size=8))])
    rows = rows[np.argsort(-rows[:, -1], kind="stable")]
    reward = [draw(st.floats(0.01, 10.0)) for _ in range(n_goals)]
    return rows[:, :-1].copy(), rows[:, -1].copy(), np.array(reward), draw(st.integers(1, 4))


def team_figures(reached, survives, reward):
    """E[R] and E[S] of the robots in the rows."""
    missed = [prod(1 - p for p in column) for column in reached.T]
    return sum(r * (1 - m) for r, m in zip(reward, missed, strict=True)), sum(survives)


def every_team(reached, survives, reward, n_robots):
    for team in combinations_with_replacement(range(len(survives)), n_robots):
        yield team_figures(reached[list(team)], survives[list(team)], reward)


class TestTeams:
    @examples(200)
    @given(pools(), st.integers(1, 40))
    def test_every_team_is_covered(self, pool, n_looks):
        reached, survives, reward, n_robots = pool
        slack = 1e-13 * np.array([reward.sum(), n_robots])
        choices = teams.new_choices(survives, reached, reward, slack, n_robots)
        front = new_front(1, n_robots)
        while not teams.choose_teams(choices, front, n_looks, most_reward=False):
            if front.n.spare == 0:
                front = grow_front(front, 2 * len(front.plan))
        slots, found = read_front(front)
        every = np.array(list(every_team(*pool)))
        near = CHECKING * np.array([reward.sum(), n_robots])
        assert (found[:, None] + near >= every).all(axis=2).any(axis=0).all()
        assert (np.diff(found[:, 0]) < 0).all()
        assert (np.diff(found[:, 1]) > 0).all()
        for row, team in zip(found, front.plan[slots], strict=True):  # teams are what they say
            own = team_figures(reached[team], survives[team], reward)
            assert row == pytest.approx(own, rel=1e-9, abs=1e-12)

    @examples(200)
    @given(pools(), st.floats(0, 4), st.floats(0, 1))
    def test_the_most_rewarding_team_that_survives_well_enough(self, pool, least, share):
        """Beyond what a front covers that holds one reward for all, and all rewards for few."""
        reached, survives, reward, n_robots = pool
        least = min(least, n_robots * survives[-1])
        height = share * reward.sum()
        choices = teams.new_choices(survives, reached, reward, np.zeros(2), n_robots)
        front = new_front(3, n_robots)
        insert(front, inf, least * (1 - CHECKING) - 1e-300)
        insert(front, height, inf)
        assert teams.choose_teams(choices, front, 10**6, most_reward=True)
        every = np.array(list(every_team(*pool)))
        best = every[every[:, 1] >= least * (1 - 1e-11), 0].max(initial=height)
        strict = every[every[:, 1] >= least, 0].max(initial=height)
        rounded = 1e-15 * reward.sum()  # 1 − (1 − p) for a small p
        assert strict * (1 - 1e-12) <= best_reward(front, inf) <= best * (1 + 1e-12) + rounded
