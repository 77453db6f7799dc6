"""Plans whose survivals are wrong, or whose robots are missing."""

from dataclasses import replace
from itertools import combinations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, Mission
from botohe_moo.decide import hazards, robustness, worst_case
from tests import twins
from tests.decide.made import MISSION, NAMES, PLANS, star, trips
from tests.decide.test_choosing import fronts
from tests.strategies import missions_with_plans, team_missions_with_plans


def with_hazards(mission, factor):
    graph = nx.DiGraph(mission.graph)
    for _, _, arc in graph.edges(data=True):
        by_kind, given = isinstance(arc["survival"], dict), arc["survival"]
        powers = {kind: x**factor for kind, x in given.items()} if by_kind else given**factor
        arc["survival"] = powers
    kinds = [replace(kind, min_survival=0.0) for kind in mission.kinds]
    return Mission(graph, base=mission.base, kinds=kinds, pays=mission.pays)


def plain_regrets(objectives):
    """How much more of one objective a plan has that has no less of the other."""
    found = []
    for own in objectives:
        beside = [max(o[k] for o in objectives if o[1 - k] >= own[1 - k]) for k in (0, 1)]
        found.append([beside[0] - own[0], beside[1] - own[1]])
    return found


class TestRobustness:
    def test_twice_as_harsh(self):
        # a: 0.25, b: 0.81 out, c: 1. E[R] and E[S]: AB 1 + 1.62 = 2.62 and 1.06, AC 2 and 1.25,
        # AA 4 (1 - 0.75 ^ 2) = 1.75 and 0.5, BC 2.62 and 1.81, BB 2 (1 - 0.19 ^ 2) = 1.9278 and
        # 1.62, C 1 and 2.
        table = robustness(MISSION, PLANS, factors=[2])
        assert list(table.columns) == [
            *("plan_id", "reward", "reward_low", "reward_high", "reward_regret"),
            *("survivors", "survivors_low", "survivors_high", "survivors_regret"),
        ]
        at_worst = [2.62, 2, 1.75, 2.62, 1.9278, 1]
        assert table["reward_low"].to_numpy() == pytest.approx(np.array(at_worst))
        assert table["reward_high"].to_numpy() == pytest.approx(table["reward"].to_numpy())
        # As expected, AA lacks 0.8 to AB; if twice as harsh, 0.87. AC lacks 0.62 to BC then.
        regrets = dict(zip(NAMES, table["reward_regret"], strict=True))
        expected = {"AB": 0, "AC": 0.62, "AA": 0.87, "BC": 0, "BB": 0.82, "C": 0}
        assert regrets == pytest.approx(expected)
        # AB has 0.75 fewer survivors than BC, which then has as much reward.
        assert table["survivors_regret"][0] == pytest.approx(0.75)

    @pytest.mark.filterwarnings("ignore:.*no kind of robots can collect")
    @given(fronts(), st.lists(st.floats(0.1, 4), max_size=3))
    def test_brute_force(self, front, factors):
        mission, plans = front
        table = robustness(mission, plans, factors=factors)
        scenarios = [mission.evaluate(plans)]
        scenarios += [with_hazards(mission, factor).evaluate(plans) for factor in factors]
        for column, name in enumerate(("reward", "survivors")):
            values = np.array([objectives[:, column] for objectives in scenarios])
            assert table[name].to_numpy() == pytest.approx(values[0])
            assert table[f"{name}_low"].to_numpy() == pytest.approx(values.min(axis=0))
            assert table[f"{name}_high"].to_numpy() == pytest.approx(values.max(axis=0))

    @given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=8))
    def test_regrets(self, points):
        objectives = np.array(points, float)
        assert hazards._regrets(objectives).tolist() == plain_regrets(objectives.tolist())

    def test_draws_are_seeded_and_have_the_stated_spread(self):
        # Of one robot to b and back, ln E[S] is h ln 0.9; ln h is normal.
        mission = star({"b": (2, 0.9)}, robots=1)
        plan = trips(mission, "b")
        survivals = []
        for seed in range(300):
            table = robustness(mission, [plan], factors=(), spread=0.5, n_draws=1, seed=seed)
            low, high = table.loc[0, ["survivors_low", "survivors_high"]]
            assert 0.9 in (pytest.approx(low), pytest.approx(high))
            survivals.append(low if high == pytest.approx(0.9) else high)
        logs = np.log(np.log(survivals) / np.log(0.9))
        assert logs.mean() == pytest.approx(0, abs=0.12)
        assert logs.std() == pytest.approx(0.5, abs=0.08)


class TestWorstCase:
    def test_by_hand(self):
        # Without the robot to a, AB and AC keep b 1.8 and c 1; AA keeps 2, BC c, BB 1.8, C nothing.
        left = [1.8, 1, 2, 1, 1.8, 0]
        assert worst_case(MISSION, PLANS, 1).tolist() == pytest.approx(left)
        assert worst_case(MISSION, PLANS, 2).tolist() == [0] * 6

    @given(missions_with_plans() | team_missions_with_plans(), st.data())
    def test_brute_force(self, drawn, data):
        mission, plan = drawn
        losses = data.draw(st.integers(0, mission.robots))
        rewards = []
        for lost in combinations(range(mission.robots), losses):
            missed = dict.fromkeys(mission.nodes, 1.0)
            for robot, trail in enumerate(mission.labels(plan)):
                followed = trail[:1] if robot in lost else trail
                chances = twins.collects(mission, mission.kind_of[robot], followed)
                for node, chance in chances.items():
                    missed[node] *= 1 - chance
            nodes = mission.graph.nodes
            rewards.append(sum(nodes[node]["reward"] * (1 - of) for node, of in missed.items()))
        assert worst_case(mission, [plan], losses)[0] == pytest.approx(min(rewards), abs=1e-9)

    def test_what_is_refused(self):
        mission = star(robots=40)
        with pytest.raises(ValueError, match=r"at most 1,000,000 sets .* 3,838,380: 6 of 40"):
            worst_case(mission, [mission.stay_home()], 6)
        with pytest.raises(ValueError, match=r"^Expected losses in \[0, 2\], got 3\.$"):
            worst_case(MISSION, PLANS, 3)
        with pytest.raises(ValueError, match=r"^Expected each of factors > 0, got 0\.$"):
            robustness(MISSION, PLANS, factors=[1, 0])


def test_an_arc_is_as_wrong_for_all_kinds():
    kinds = [Kind("drone", 1), Kind("rover", 1)]
    mission = Mission(MISSION.graph, base="dock", kinds=kinds)
    out = ["dock", "b", "dock"]
    plans = [mission.plan([out, ["dock"]]), mission.plan([["dock"], out])]
    table = robustness(mission, plans, factors=(), spread=0.5, n_draws=3)
    assert table["survivors_low"].nunique() == 1
    assert table["survivors_low"][0] < 1.9
