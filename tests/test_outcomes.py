"""Distributions against hand-computed numbers and enumeration; simulation against both."""

from collections import defaultdict
from itertools import compress, product

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Kind, Mission
from botohe_moo.mission import PlanError
from botohe_moo.outcomes import (
    Distribution,
    Outcomes,
    collect_probabilities,
    plan_outcomes,
    reach_probabilities,
    reward_distribution,
    simulate,
    survivors_distribution,
    team_reach,
)
from tests import twins
from tests.strategies import team_missions_with_plans


def harbour(robots=2, *, kinds=None, pays=None, **nodes):
    """Dock (base, pays 1) between reef (pays 4) and cape (pays 5); powers of two survive."""
    graph = nx.DiGraph()
    for node, reward in (("dock", 1), ("reef", 4), ("cape", 5)):
        graph.add_node(node, reward=reward, **nodes.get(node, {}))
    for tail, head, survival, back in (
        ("dock", "reef", 0.5, 0.75),
        ("reef", "cape", 0.25, 1.0),
        ("dock", "cape", 1.0, 0.5),
    ):
        graph.add_edge(tail, head, survival=survival)
        graph.add_edge(head, tail, survival=back)
    team = {"robots": robots} if kinds is None else {"kinds": kinds}
    return Mission(graph, base="dock", pays=pays, **team)


FAR = ["dock", "reef", "cape", "dock"]
NEAR = ["dock", "reef", "dock"]
LONG = ["dock", "cape", "reef", "dock", "reef", "cape", "dock"]  # its first two arcs are safe


def as_dict(distribution):
    return dict(zip(distribution.values.tolist(), distribution.probabilities.tolist(), strict=True))


def ring(n_nodes, survival):
    """Base 0 and nodes that pay 1 each, in a circle that can be walked both ways."""
    graph = nx.cycle_graph(n_nodes).to_directed()
    nx.set_node_attributes(graph, 1, "reward")
    nx.set_edge_attributes(graph, survival, "survival")
    return graph


# --- distributions of tiny plans, by hand


@pytest.mark.parametrize(
    ("pays", "nodes", "trails", "expected"),
    [
        # The base, and what its fate reaches.
        (None, {}, [FAR], {1: 0.5, 5: 0.375, 10: 0.125}),
        # Nodes and base visited again pay once: the cape is behind two more arcs, 1/2 · 3/4.
        (None, {}, [LONG], {10: 1.0}),
        (None, {}, [[*NEAR, "cape", "reef", "cape", "dock"]], {1: 0.5, 5: 0.125, 10: 0.375}),
        # Nobody at the reef: 1/4; the second at the cape: 1/8, for which it was at the reef.
        (None, {}, [NEAR, FAR], {1: 0.25, 5: 0.625, 10: 0.125}),
        # What one sortie brings is paid together, at the base or at a depot.
        ("return", {}, [FAR], {1: 0.9375, 10: 0.0625}),
        ("return", {"cape": {"depot": True}}, [FAR], {1: 0.875, 10: 0.125}),
        ("return", {"reef": {"pays": "arrival"}}, [FAR], {1: 0.5, 5: 0.4375, 10: 0.0625}),
        # Passing the base deposits.
        ("return", {}, [[*NEAR, "cape", "dock"]], {1: 0.625, 5: 0.1875, 10: 0.1875}),
    ],
)
def test_rewards_by_hand(pays, nodes, trails, expected):
    mission = harbour(len(trails), pays=pays, **nodes)
    found = reward_distribution(mission, mission.plan(trails))
    assert as_dict(found) == expected
    assert (found.exact, found.n_samples) == (True, None)


def test_each_robot_of_each_kind_collects_by_its_own_share():
    kinds = [Kind("boat", 2), Kind("diver", 1)]
    reef = {"pays": "arrival", "share": {"boat": 0.5, "diver": 0.25}}
    mission = harbour(kinds=kinds, pays="return", reef=reef, dock={"share": {"diver": 0}})
    plan = mission.plan([NEAR] * 3)
    collected = [[1, 0.25, 0], [1, 0.25, 0], [0, 0.125, 0]]
    assert collect_probabilities(mission, plan).tolist() == collected
    missed = 0.75 * 0.75 * 0.875
    assert as_dict(reward_distribution(mission, plan)) == {1: missed, 5: 1 - missed}
    assert as_dict(survivors_distribution(mission, plan, kind="diver")) == {0: 0.625, 1: 0.375}
    with pytest.raises(ValueError, match="Expected kind among diver, boat, got 'dive'"):
        survivors_distribution(mission, plan, kind="dive")


def test_rewards_of_robots_apart_add_up_and_equal_sums_merge():
    graph = nx.DiGraph(base="b", robots=3)
    for node, reward, survival in (("b", 0, 1), ("x", 0.1, 0.5), ("y", 0.2, 0.5), ("z", 0.3, 0.25)):
        graph.add_node(node, reward=reward)
        if node != "b":
            graph.add_edge("b", node, survival=survival)
            graph.add_edge(node, "b", survival=1.0)
    mission = Mission(graph)
    plan = mission.plan([["b", node, "b"] for node in "xyz"])
    reward = reward_distribution(mission, plan)
    # 0.1 + 0.2 is not 0.3 in binary, yet one outcome: x, y without z, or z alone
    assert reward.values == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6], abs=1e-15)
    three, one = 3 / 16, 1 / 16
    assert reward.probabilities.tolist() == [three, three, three, three + one, one, one, one]
    assert reward.at_least(0.3) == reward.at_least(0.1 + 0.2) == 7 / 16


def test_more_than_64_shared_nodes():
    mission = Mission(ring(70, 0.98), base=0, robots=2)
    there = [*range(70), 0]
    plan = mission.plan([there, there[::-1]])
    expected = defaultdict(float)
    for chance, value, _ in twins.enumerate_outcomes(mission, mission.labels(plan)):
        expected[value] += chance
    assert as_dict(reward_distribution(mission, plan)) == pytest.approx(expected, abs=1e-12)


def test_survivals_that_vanish_leave_no_outcome():
    mission = Mission(ring(400, 0.1), base=0, robots=2)
    plan = mission.plan([[*range(400), 0], [0]])
    found = plan_outcomes(mission, plan)
    assert (as_dict(found.survivors), found.reward.values[-1] < 400) == ({1.0: 1.0}, True)
    assert found.reward.mean == pytest.approx(1 + 1 / 9, rel=1e-12)
    assert simulate(mission, plan, 100, random_state=0)["survivors"].eq(1).all()


# --- distributions of drawn plans, against the enumeration of all joint fates


def test_the_probabilities_to_reach_nodes_by_hand():
    mission = harbour()
    plan = mission.plan([["dock", "reef", "cape", "reef", "dock"], ["dock", "cape", "dock"]])
    # 0.5 to the reef, 0.125 to the cape; the second visit of the reef does not count.
    reached = reach_probabilities(mission, plan)
    assert reached.tolist() == [[1, 0.5, 0.125], [1, 0, 1]]
    assert team_reach(reached).tolist() == [1, 0.5, 1]
    with pytest.raises(PlanError):
        reach_probabilities(mission.with_robots(3), plan)


def collected_sets(mission, kind, trail):
    """With what probability a robot collects each set of nodes."""
    nodes, found, alive = mission.graph.nodes, defaultdict(float), 0.0
    for chance, paid, survives in twins.fates(mission, kind, trail):
        alive += chance * survives
        shares = [twins.of_kind(nodes[node].get("share", 1.0), kind) for node in paid]
        for takes in product([False, True], repeat=len(paid)):
            p = np.prod([q if take else 1 - q for q, take in zip(shares, takes, strict=True)])
            found[frozenset(compress(paid, takes))] += chance * p
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
    reached = reach_probabilities(mission, plan)
    for kind, trail, chances in zip(mission.kind_of, plan.trails, reached, strict=True):
        visited = {node % len(mission.nodes) for node in trail}
        aboard = {mission.index(label) for label in kind.aboard}
        assert visited <= set(np.flatnonzero(chances).tolist()) <= visited | aboard
    collected = team_reach(collect_probabilities(mission, plan))
    assert collected @ mission.rewards == pytest.approx(expected, rel=1e-12, abs=1e-12)
    given = {"max_outcomes": few, "n_samples": 200, "random_state": 1}
    bounded = reward_distribution(mission, plan, **given)
    if bounded.exact:
        assert as_dict(bounded) == as_dict(reward)
    else:
        seen = np.isclose(bounded.values[:, None], reward.values, rtol=1e-9, atol=0)
        assert (bounded.n_samples, seen.any(axis=1).all()) == (200, True)


# --- the bound on the exact computation, and the simulation beyond it


def test_max_outcomes_counts_what_is_looked_at():
    mission = harbour()
    for trails, needed in (
        ([["dock"], FAR], 3),
        ([NEAR, FAR], 2 + 2 * 3),
        ([["dock", "cape", "dock"], FAR], 2),
    ):
        plan = mission.plan(trails)
        assert reward_distribution(mission, plan, max_outcomes=needed).exact
        assert not reward_distribution(mission, plan, max_outcomes=needed - 1, n_samples=10).exact


def test_robots_that_share_nodes_in_a_row_stay_exact():
    graph = nx.complete_graph(31, nx.DiGraph)
    nx.set_node_attributes(graph, {node: int(node > 0) for node in graph}, "reward")
    nx.set_edge_attributes(graph, 0.5, "survival")
    mission = Mission(graph, base=0, robots=29)
    plan = mission.plan([[0, node, node + 1, 0] for node in range(1, 30)])
    # 3^29 joint fates, but what matters to the next robot is one node and the count so far
    reward = reward_distribution(mission, plan, max_outcomes=3 * 29 * 2 * 31)
    assert reward.exact
    assert reward.values.tolist() == list(range(31))
    assert reward.probabilities[0] == 0.5**29
    assert reward.mean == pytest.approx(mission.evaluate([plan])[0, 0], abs=1e-9)
    drawn = simulate(mission, plan, 50_000, random_state=4)["reward"]
    assert reward.std == pytest.approx(drawn.std(), rel=0.02)


def test_the_order_of_the_robots_does_not_show():
    mission = harbour(3)
    plans = mission.plan([LONG, FAR, NEAR]), mission.plan([FAR, NEAR, LONG])
    for most in (1, 1_000_000):
        options = {"max_outcomes": most, "n_samples": 1000, "random_state": 8}
        one, two = (plan_outcomes(mission, plan, **options) for plan in plans)
        assert as_dict(one.reward) == as_dict(two.reward)
        assert as_dict(one.survivors) == as_dict(two.survivors)


# --- reading a distribution


def test_reading_a_distribution_by_hand():
    found = Distribution(np.array([0.0, 4.0, 9.0]), np.array([0.125, 0.375, 0.5]))
    assert found.mean == 6
    assert found.variance == 0.125 * 36 + 0.375 * 4 + 0.5 * 9
    assert found.std == np.sqrt(10.5)
    assert found.quantile([0, 0.125, 0.126, 0.5, 0.51, 1]).tolist() == [0, 0, 4, 4, 9, 9]
    assert found.at_least([-np.inf, -1, 0, 0.1, 4, 5, 9, 9.1, np.inf]).tolist() == [
        *(1, 1, 1, 0.875, 0.875, 0.5, 0.5, 0, 0)
    ]
    assert [found.cvar(alpha) for alpha in (0.1, 0.125, 0.25, 0.5, 0.75, 1)] == [
        *(0, 0, 2, 3, (1.5 + 0.25 * 9) / 0.75, 6)
    ]
    assert isinstance(found.quantile(0.5), float)
    assert isinstance(found.at_least(4), float)
    table = found.to_frame()
    assert list(table.columns) == ["value", "probability"]
    assert table.to_numpy().tolist() == [[0, 0.125], [4, 0.375], [9, 0.5]]
    assert np.isnan(Distribution(np.array([3.0]), np.array([1.0]), 1).standard_error)


def test_quantiles_do_not_fall_to_rounding():
    rare = Distribution(np.array([0.0, 1.0]), np.array([1 - 1e-14, 1e-14]))
    assert (rare.quantile(1), rare.at_least(1)) == (1, 1e-14)


samples = st.lists(st.integers(-5, 20), min_size=1, max_size=40).map(np.array)


def shares_of(sample):
    values, counts = np.unique(sample, return_counts=True)
    return Distribution(values, counts / len(sample), len(sample))


@given(samples, st.data())
def test_quantile_and_at_least_equal_counting(sample, data):
    found, n = shares_of(sample), len(sample)
    q = data.draw(st.one_of(st.integers(0, n).map(lambda i: i / n), st.floats(1e-9, 1 - 1e-9)))
    # the smallest value with at least q n observations up to it, free of binary fractions
    needed = max(1, int(np.ceil(q * n - 1e-9)))
    assert found.quantile(q) == np.sort(sample)[needed - 1]
    x = data.draw(st.integers(-6, 21))
    assert found.at_least(x) == pytest.approx(np.mean(sample >= x), abs=1e-12)


@given(samples, st.integers(1, 200))
def test_cvar_equals_the_mean_of_the_worst_observations(sample, share):
    found = shares_of(sample)
    # each observation 200 times over, so that a share of 1/200 cuts between two of them
    worst = np.sort(np.repeat(sample, 200))[: share * len(sample)]
    assert found.cvar(share / 200) == pytest.approx(worst.mean(), abs=1e-9)


def test_summary():
    mission = harbour()
    found = plan_outcomes(mission, mission.plan([FAR, ["dock"]]))
    table = found.summary(alpha=0.625)
    assert list(table.columns) == ["mean", "std", "q05", "median", "q95", "cvar", "exact"]
    assert list(table.index) == ["reward", "survivors"]
    cvar = (0.5 * 1 + 0.125 * 5) / 0.625
    values = table[["mean", "q05", "median", "q95", "cvar", "exact"]].to_numpy().tolist()
    assert values[0] == [0.5 + 0.375 * 5 + 0.125 * 10, 1, 1, 10, cvar, True]
    assert values[1] == [1.0625, 1, 1, 2, 1, True]
    assert table.loc["survivors", "std"] == np.sqrt(0.9375 * 0.0625)
    assert found.summary().loc["reward", "cvar"] == 1


# --- simulation


def test_a_simulated_row_tells_one_mission():
    mission = harbour(3)
    trails = [FAR, ["dock"], LONG]
    frame = simulate(mission, mission.plan(trails), 500, random_state=0)
    assert list(frame.columns) == ["reward", "survivors", "hops_0", "hops_1", "hops_2"]
    for row in frame.itertuples():
        hops = [row.hops_0, row.hops_1, row.hops_2]
        reached = {node for h, trail in zip(hops, trails, strict=True) for node in trail[: h + 1]}
        assert row.reward == sum(mission.graph.nodes[node]["reward"] for node in reached)
        assert row.survivors == sum(h == len(t) - 1 for h, t in zip(hops, trails, strict=True))
    hops = [{*frame[f"hops_{i}"].tolist()} for i in range(3)]
    assert hops == [{0, 1, 2, 3}, {0}, {2, 3, 4, 5, 6}]
    assert frame["reward"].dtype == float
    assert frame["survivors"].dtype.kind == "i"


def test_same_seed_same_missions():
    mission = harbour(3)
    plan = mission.plan([LONG, FAR, NEAR])
    frame = simulate(mission, plan, 300, random_state=1)
    generator = np.random.default_rng(1)
    for seed in (1, generator):
        pd.testing.assert_frame_equal(frame, simulate(mission, plan, 300, random_state=seed))
    for seed in (2, generator, None):
        assert not frame.equals(simulate(mission, plan, 300, random_state=seed))
    longer = simulate(mission, plan, 400, random_state=1)
    pd.testing.assert_frame_equal(frame, longer.head(300))


def test_simulation_agrees_with_the_exact_distribution():
    kinds = [Kind("boat", 2), Kind("diver", 1, start="cape")]
    shares = {"reef": {"share": 0.5}, "cape": {"share": {"boat": 0.75}, "pays": "arrival"}}
    mission = harbour(kinds=kinds, pays="return", **shares)
    plan = mission.plan([FAR, NEAR, ["cape", "dock", "reef", "dock"]])
    exact = reward_distribution(mission, plan)
    drawn = reward_distribution(mission, plan, max_outcomes=1, random_state=5)
    assert (exact.exact, exact.standard_error) == (True, 0)
    assert (drawn.exact, drawn.n_samples) == (False, 100_000)
    assert drawn.standard_error == pytest.approx(exact.std / 100_000**0.5, rel=0.02)
    assert abs(drawn.mean - exact.mean) < 4 * drawn.standard_error
    assert drawn.values.tolist() == exact.values.tolist()
    frame = simulate(mission, plan, 100_000, random_state=3)
    alive = survivors_distribution(mission, plan)
    found = [frame["survivors"].eq(n).mean() for n in alive.values]
    for shares, said in ((drawn.probabilities, exact), (np.array(found), alive)):
        errors = np.sqrt(said.probabilities * (1 - said.probabilities) / 100_000)
        assert (abs(shares - said.probabilities) <= 4 * errors + 1e-12).all()


# --- what is refused


def test_what_distributions_refuse():
    found = Distribution(np.array([1.0]), np.array([1.0]))
    for q in (-0.1, [0.5, 2.0]):
        with pytest.raises(ValueError, match=r"Expected q in \[0, 1\], got "):
            found.quantile(q)
    for alpha in (0, 1.3):
        with pytest.raises(ValueError, match=rf"^Expected alpha in \(0, 1\], got {alpha}\.$"):
            Outcomes(found, found).summary(alpha)
    for values, probabilities, message in [
        ([], [], "at least one"),
        ([1, 2], [1], "as many probabilities as values"),
        ([2, 1], [0.5, 0.5], "values that ascend"),
        ([1, 2], [0.5, 0.6], "sum to 1"),
        ([1, 2], [1, 0], "above 0"),
    ]:
        with pytest.raises(ValueError, match=message):
            Distribution(values, probabilities)


def test_what_outcomes_refuse():
    mission, other = harbour(), harbour(1).stay_home()
    plan = mission.stay_home()
    for number in (0, 2.0):
        with pytest.raises(ValueError, match=f"Expected n_missions .*>= 1, got {number!r}"):
            simulate(mission, plan, number)
        for name in ("n_samples", "max_outcomes"):
            with pytest.raises(ValueError, match=f"Expected {name} (to be an integer )?>= 1, got"):
                plan_outcomes(mission, plan, **{name: number})
    for function in (plan_outcomes, lambda *args, **seed: simulate(*args, 3, **seed)):
        with pytest.raises(PlanError, match="expected 2 trails, got 1"):
            function(mission, other)
        with pytest.raises(TypeError, match="expected a TrailPlan"):
            function(mission, [["dock"], ["dock"]])
        with pytest.raises(ValueError, match=r"^Expected random_state to be None, an integer >= 0"):
            function(mission, plan, random_state=-1)
