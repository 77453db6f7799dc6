"""Outcomes of plans with kinds of robots and rewards on return, by hand and by enumeration."""

from collections import defaultdict
from itertools import product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, Mission
from botohe_moo.outcomes import (
    collect_probabilities,
    reach_probabilities,
    reward_distribution,
    simulate,
    survivors_distribution,
    team_reach,
)
from tests import twins
from tests.strategies import team_missions_with_plans


def harbour(kinds=None, **nodes):
    """Dock (base, pays 1) between reef (pays 4) and cape (pays 5); they pay on return."""
    graph = nx.DiGraph(base="dock", pays="return")
    for node, reward in (("dock", 1), ("reef", 4), ("cape", 5)):
        graph.add_node(node, reward=reward, **nodes.get(node, {}))
    for tail, head, survival in [
        ("dock", "reef", 0.5),
        ("reef", "dock", 0.75),
        ("reef", "cape", 0.25),
        ("cape", "dock", 0.5),
        ("dock", "cape", 1.0),
    ]:
        graph.add_edge(tail, head, survival=survival)
    return Mission(graph, kinds=kinds or [Kind("boat", 1)])


def as_dict(distribution):
    return dict(zip(distribution.values.tolist(), distribution.probabilities.tolist(), strict=True))


def test_what_one_sortie_brings_is_paid_together():
    trail = ["dock", "reef", "cape", "dock"]
    mission = harbour()
    assert as_dict(reward_distribution(mission, mission.plan([trail]))) == {1: 0.9375, 10: 0.0625}
    mission = harbour(cape={"depot": True})
    assert as_dict(reward_distribution(mission, mission.plan([trail]))) == {1: 0.875, 10: 0.125}
    mission = harbour(reef={"pays": "arrival"})
    plan = mission.plan([trail])
    assert as_dict(reward_distribution(mission, plan)) == {1: 0.5, 5: 0.4375, 10: 0.0625}
    assert collect_probabilities(mission, plan).tolist() == [[1, 0.5, 0.0625]]
    assert reach_probabilities(mission, plan).tolist() == [[1, 0.5, 0.125]]


def test_passing_the_base_deposits():
    mission = harbour()
    plan = mission.plan([["dock", "reef", "dock", "cape", "dock"]])
    assert as_dict(reward_distribution(mission, plan)) == {1: 0.625, 5: 0.1875, 10: 0.1875}


def test_each_robot_of_each_kind_collects_by_its_own_share():
    kinds = [Kind("boat", 2), Kind("diver", 1)]
    reef = {"pays": "arrival", "share": {"boat": 0.5, "diver": 0.25}}
    mission = harbour(kinds, reef=reef, dock={"share": {"diver": 0}})
    trail = ["dock", "reef", "dock"]
    plan = mission.plan([trail, trail, trail])
    assert collect_probabilities(mission, plan).tolist() == [
        [1, 0.25, 0],
        [1, 0.25, 0],
        [0, 0.125, 0],
    ]
    missed = 0.75 * 0.75 * 0.875
    assert as_dict(reward_distribution(mission, plan)) == {1: missed, 5: 1 - missed}
    assert as_dict(survivors_distribution(mission, plan, kind="diver")) == {0: 0.625, 1: 0.375}
    with pytest.raises(ValueError, match="Expected kind among diver, boat, got 'dive'"):
        survivors_distribution(mission, plan, kind="dive")


def test_simulation_agrees_with_the_exact_distribution():
    kinds = [Kind("boat", 2), Kind("diver", 1, start="cape")]
    shares = {"reef": {"share": 0.5}, "cape": {"share": {"boat": 0.75}, "pays": "arrival"}}
    mission = harbour(kinds, **shares)
    far, near = ["dock", "reef", "cape", "dock"], ["dock", "reef", "dock"]
    plan = mission.plan([far, near, ["cape", "dock", "reef", "dock"]])
    exact = reward_distribution(mission, plan)
    drawn = simulate(mission, plan, 40_000, random_state=1)
    assert exact.exact
    assert sorted(set(drawn["reward"])) == exact.values.tolist()
    for value, chance in as_dict(exact).items():
        error = (chance * (1 - chance) / 40_000) ** 0.5
        assert (drawn["reward"] == value).mean() == pytest.approx(chance, abs=4 * error + 1e-12)
    longer = simulate(mission, plan, 50_000, random_state=1)
    assert longer.head(40_000).equals(drawn)


def collected_sets(mission, kind, trail):
    """With what probability a robot collects each set of nodes."""
    nodes, found, alive = mission.graph.nodes, defaultdict(float), 0.0
    for chance, paid, survives in twins.fates(mission, kind, trail):
        alive += chance * survives
        shares = [twins.of_kind(nodes[node].get("share", 1.0), kind) for node in paid]
        for takes in product([False, True], repeat=len(paid)):
            p = np.prod([q if take else 1 - q for q, take in zip(shares, takes, strict=True)])
            found[frozenset(node for node, take in zip(paid, takes, strict=True) if take)] += (
                chance * p
            )
    return found, alive


@given(team_missions_with_plans(), st.integers(1, 30))
def test_distributions_equal_enumeration(drawn, few):
    mission, plan = drawn
    sets, survivors = {frozenset(): 1.0}, {0: 1.0}
    for kind, trail in zip(mission.kind_of, mission.labels(plan), strict=True):
        found, alive = collected_sets(mission, kind, trail)
        both, joint = defaultdict(float), defaultdict(float)
        for (a, p), (b, q) in product(sets.items(), found.items()):
            both[a | b] += p * q
        for n, p in survivors.items():
            joint[n] += p * (1 - alive)
            joint[n + 1] += p * alive
        sets, survivors = both, joint
    reward = reward_distribution(mission, plan)
    assert reward.exact
    rewards = dict.fromkeys(reward.values.round().tolist(), 0.0)
    for nodes, chance in sets.items():
        if chance > 0:
            rewards[sum(mission.graph.nodes[node]["reward"] for node in nodes)] += chance
    assert list(rewards.values()) == pytest.approx(reward.probabilities.tolist(), abs=1e-12)
    assert reward.values == pytest.approx(list(rewards))
    got = as_dict(survivors_distribution(mission, plan))
    assert all(got.get(n, 0) == pytest.approx(p, abs=1e-12) for n, p in survivors.items())
    expected = mission.evaluate([plan])[0, 0]
    assert reward.mean == pytest.approx(expected, rel=1e-12, abs=1e-12)
    collected = team_reach(collect_probabilities(mission, plan))
    assert collected @ mission.rewards == pytest.approx(expected, rel=1e-12, abs=1e-12)
    simulated = reward_distribution(
        mission, plan, max_outcomes=few, n_samples=200, random_state=1
    ).values
    assert np.isclose(simulated[:, None], reward.values, rtol=1e-9, atol=0).any(axis=1).all()
