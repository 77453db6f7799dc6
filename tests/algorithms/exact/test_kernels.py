"""Trails worth having and the best teams of them, against all that there are."""

from itertools import combinations_with_replacement, pairwise
from math import inf, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.algorithms.exact import kernels
from botohe_moo.algorithms.exact.front import TrailSearch, without_base_reward
from botohe_moo.core.ordered import best_reward, grow_front, insert, new_front, read_front
from botohe_moo.core.world import CHECKING
from tests.core.test_paths import whole_graph
from tests.examples import examples
from tests.strategies import lengths, mission_of, missions, small_missions, trails
from tests.twins import all_trails, length_of, survival_of, within


def figures_of(mission, trails):
    """Probability to reach each goal, and to survive; of a single robot its reward instead."""
    goals = [v for v, r in enumerate(mission.rewards) if r > 0 and v != mission.index(mission.base)]
    reward, reached = mission.rewards[goals], np.zeros((len(trails), len(goals)))
    for row, trail in zip(reached, trails, strict=True):
        alive = {v: survival_of(mission, trail[: trail.index(v) + 1]) for v in trail}
        row[:] = [alive.get(goal, 0.0) for goal in goals]
    if mission.robots == 1:
        reached = reached @ reward / (reward.sum() or 1.0)
    return np.column_stack([reached, [survival_of(mission, trail) for trail in trails]])


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


@examples(150)
@given(st.data(), missions(max_nodes=6, lengths=lengths), st.sampled_from([inf, 8.0, 3.0, 0.0]))
def test_ways_and_arcs_of_no_use(data, mission, longest):
    """The search skips arcs that are used, too long for the budget, or lead nowhere."""
    trail = data.draw(trails(mission))
    partial = trail[: data.draw(st.integers(1, len(trail)))]
    search, graph = search_for(mission, longest=longest)._search, mission.world.graph
    labels, new = search.labels, search.progress[0].n_labels
    arcs = list(zip(graph.tail.tolist(), graph.head.tolist(), strict=True))
    search.used[:] = [ends in set(pairwise(partial)) for ends in arcs]
    walked = labels.rows[new].length = length_of(mission, partial)
    labels.rows[new].node = partial[-1]
    with np.errstate(all="ignore"):
        kernels.look_around(search)
    free, base = whole_graph(mission), mission.index(mission.base)
    home = nx.single_source_dijkstra_path_length(free.reverse(), base, weight="length")
    free.remove_edges_from(list(pairwise(partial)))
    there = nx.single_source_dijkstra_path_length(free, partial[-1], weight="length")
    for u, v, length in list(free.edges(data="length")):
        if walked + there.get(u, inf) + length + home[v] > longest * (1 + CHECKING):
            free.remove_edge(u, v)
    costs = nx.single_source_dijkstra_path_length(free, partial[-1], weight="cost")
    expected = [np.exp(-costs.get(node, inf)) for node in range(graph.n_nodes)]
    assert search.reach == pytest.approx(expected, rel=1e-9)
    homeward = {base, *nx.ancestors(free, base)}
    for arc, (tail, head) in enumerate(arcs):
        useful = free.has_edge(tail, head) and tail in costs and head in homeward
        assert kernels.has(labels.used[new], arc) == search.used[arc] == (not useful)


@st.composite
def forked_missions(draw):
    """One robot on a ring whose stages have several ways on, the longer the safer.

    The best way home within a budget is often neither the safest nor the shortest one. Gives the
    mission, all its trails and a budget.
    """
    arcs, rewards = [], [0.0, 1.0, draw(st.sampled_from([0.0, 0.0, 2.0]))]
    for stage in range(3):
        for _ in range(draw(st.integers(2, 3))):
            length, way = draw(st.floats(0.0, 3.0)), len(rewards)
            rewards.append(0.0)
            survival = draw(st.sampled_from([0.4, 0.5])) + length / 6
            arcs += [(stage, way, survival, length), (way, (stage + 1) % 3, 1.0, 0.0)]
    mission = mission_of(arcs, rewards, robots=1)
    every = all_trails(mission)
    length = length_of(mission, draw(st.sampled_from(every)))
    return mission, every, length * (1 + CHECKING)


def check_trails(mission, every, least, longest):
    """The search finds all trails that a robot or a team may need, and no others."""
    search = search_for(mission, least, longest)
    found = found_trails(search)
    named = [tuple(search.trail(row)) for row in range(len(found))]
    rounded = least * (1 - CHECKING), longest * (1 + CHECKING)
    assert {*named} <= {*within(mission, every, *rounded)}
    assert found == pytest.approx(figures_of(mission, named), rel=1e-9, abs=1e-12)
    needed = figures_of(mission, within(mission, every, least, longest))
    assert covers(found, needed)
    assert covers(needed, found)
    better = (found[:, None] >= found).all(axis=2)
    assert not (better & (found[:, None] > found + CHECKING).any(axis=2)).any()
    assert (np.diff(found[:, -1]) <= 0).all()


@examples(250)
@given(
    small_missions(max_trails=1000, lengths=lengths),
    st.sampled_from([1, 2]),
    st.sampled_from([0.0, 0.3, 0.81]),
    st.sampled_from([inf, 9.0, 5.0, 2.0]),
)
def test_all_trails_are_found_that_may_be_needed(case, robots, least, longest):
    mission, every = case
    check_trails(mission.with_robots(robots), every, least, longest)


@examples(200)
@given(forked_missions(), st.sampled_from([0.0, 0.1]))
def test_ways_home_that_compromise_are_found(case, least):
    mission, every, longest = case
    check_trails(mission, every, least, longest)


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
        choices = kernels.new_choices(survives, reached, reward, slack, n_robots)
        front = new_front(1, n_robots)
        while not kernels.choose_teams(choices, front, n_looks, most_reward=False):
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
        choices = kernels.new_choices(survives, reached, reward, np.zeros(2), n_robots)
        front = new_front(3, n_robots)
        insert(front, inf, least * (1 - CHECKING) - 1e-300)
        insert(front, height, inf)
        assert kernels.choose_teams(choices, front, 10**6, most_reward=True)
        every = np.array(list(every_team(*pool)))
        best = every[every[:, 1] >= least * (1 - 1e-11), 0].max(initial=height)
        strict = every[every[:, 1] >= least, 0].max(initial=height)
        rounded = 1e-15 * reward.sum()  # 1 − (1 − p) for a small p
        assert strict * (1 - 1e-12) <= best_reward(front, inf) <= best * (1 + 1e-12) + rounded
