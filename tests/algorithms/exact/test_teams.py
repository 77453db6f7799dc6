"""The best teams of trails, found by kernels, against all teams there are."""

from itertools import combinations_with_replacement
from math import inf, prod

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.algorithms.exact import kernels as teams
from botohe_moo.core.ordered import best_reward, grow_front, insert, new_front, read_front
from botohe_moo.core.world import CHECKING
from tests.examples import examples


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
