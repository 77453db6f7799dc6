"""Missions with scenarios: what they are worth, what is refused, files, and who honours them."""

import pickle
import warnings
from collections import Counter
from dataclasses import replace
from itertools import product
from math import fsum

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pymoo.optimize import minimize
from scipy import stats

from botohe_moo import (
    BOTOHE,
    Event,
    FrontBound,
    Kind,
    Mission,
    MissionError,
    Scenario,
    algorithm_names,
    area_indicator,
    bound_front,
    independent_zones,
    load_mission,
    make_algorithm,
    mission_from_tables,
    plan_outcomes,
    replan,
    save_mission,
    scenarios_from_samples,
    simulate_policy,
    solve,
    worst_case,
)
from botohe_moo.algorithms import exact_front
from botohe_moo.decide import by_scenario, parse_wishes, robustness
from botohe_moo.decide.wishes import Candidates
from botohe_moo.explorer.data import page_data
from botohe_moo.outcomes import collect_probabilities, reach_probabilities, simulate
from botohe_moo.underway import under_way
from tests import twins
from tests.commands import run_botohe
from tests.decide.made import solution_of
from tests.examples import examples
from tests.strategies import missions_with_plans, scenario_missions_with_plans

TOY = load_mission("toy")
STORM = Scenario("storm", 0.25, factor=3.0)
SHUT = Scenario("shut", 0.25, survival={(1, 2): 0.0})
RICH = Scenario("rich", 0.2, reward={4: 9.0})
THREE = Mission(TOY.graph, scenarios=[STORM, SHUT, RICH])
PLAN = THREE.plan([[1, 2, 4, 2, 1], [1, 3, 1]])


def test_by_hand():
    """There and back to 2, each way survived with 0.5, or in a storm with 0.25; 4 or 6 at 2."""
    graph = nx.DiGraph([(1, 2), (2, 1)])
    nx.set_node_attributes(graph, {1: 0.0, 2: 4.0}, "reward")
    nx.set_edge_attributes(graph, 0.5, "survival")
    storm = Scenario("storm", 0.25, factor=2, reward={2: 6.0})
    mission = Mission(graph, base=1, robots=2, scenarios=[storm])
    assert [(s.name, s.probability) for s in mission.scenarios] == [
        ("storm", 0.25),
        ("otherwise", 0.75),
    ]
    assert (mission.rewards.tolist(), mission.total_reward) == ([0.0, 4.5], 4.5)
    plan = mission.plan([[1, 2, 1], [1, 2, 1]])
    reward = 0.25 * 6 * (1 - 0.75**2) + 0.75 * 4 * (1 - 0.5**2)
    survivors = 2 * (0.25 * 0.25**2 + 0.75 * 0.5**2)
    assert mission.evaluate([plan])[0].tolist() == [reward, survivors]
    assert mission.robot_survival([plan])[0].tolist() == [survivors / 2] * 2
    # If both were lost independently of each other also in what they meet, it would be more.
    alone = Mission(graph, base=1, robots=2).evaluate([plan])[0]
    assert alone.tolist() == [3.0, 0.5]


@examples(300)
@given(scenario_missions_with_plans())
def test_objectives_are_those_of_all_scenarios(case):
    mission, plan = case
    found, trails = mission.evaluate([plan])[0], mission.labels(plan)
    assert (mission.world.graph.cost >= 0.0).all()
    assert np.isfinite(mission.world.graph.cost).all()
    expected = twins.evaluate(mission, trails)
    near = {"rel": 1e-12, "abs": 1e-12 * (1 + mission.total_reward)}
    assert found.tolist() == pytest.approx(expected, **near)
    by_case = [one.evaluate([plan])[0] for _, one in mission.in_scenarios]
    chances = [p for p, _ in mission.in_scenarios]
    assert fsum(chances) == pytest.approx(1.0)
    assert np.dot(chances, by_case).tolist() == pytest.approx(expected, **near)
    alive = [
        sum(
            s.probability * twins.alive_along(one, kind, trail)[-1]
            for s, one in zip(mission.scenarios, twins.cases(mission), strict=True)
        )
        for kind, trail in zip(mission.kind_of, trails, strict=True)
    ]
    assert mission.robot_survival([plan])[0].tolist() == pytest.approx(alive, abs=1e-14)


@examples(60)
@given(scenario_missions_with_plans(missions_with_plans(max_nodes=4, max_robots=2)))
def test_outcomes_are_those_of_all_fates_in_all_scenarios(case):
    mission, plan = case
    reward, survivors = Counter(), Counter()
    for scenario, one in zip(mission.scenarios, twins.cases(mission), strict=True):
        for chance, collected, n in twins.enumerate_outcomes(one, mission.labels(plan)):
            reward[round(collected, 9)] += scenario.probability * chance
            survivors[n] += scenario.probability * chance
    found = plan_outcomes(mission, plan)
    assert found.reward.exact
    for wanted in [0.0, mission.total_reward / 3, mission.total_reward]:
        least = wanted * (1 - 1e-12)
        expected = sum(p for x, p in reward.items() if x >= least - 1e-8)
        # Near a value, rounding decides.
        if all(abs(x - wanted) > 1e-7 for x in reward):
            assert found.reward.at_least(wanted) == pytest.approx(expected, abs=1e-9)
    mean = sum(x * p for x, p in reward.items())
    assert found.reward.mean == pytest.approx(mean, abs=1e-7)
    for n in range(1, mission.robots + 1):
        expected = sum(p for x, p in survivors.items() if x >= n)
        assert found.survivors.at_least(n) == pytest.approx(expected, abs=1e-9)


@examples(60)
@given(missions_with_plans(), st.floats(0.01, 1.0))
def test_scenarios_that_say_nothing_change_nothing(case, probability):
    mission, plan = case
    given = {"base": 0, "robots": mission.robots, "name": "drawn"}
    same = Mission(mission.graph, scenarios=[Scenario("same", 1.0)], **given)
    assert same.evaluate([plan]).tolist() == mission.evaluate([plan]).tolist()
    split = Mission(mission.graph, scenarios=[Scenario("same", probability)], **given)
    assert split.evaluate([plan])[0] == pytest.approx(mission.evaluate([plan])[0], rel=1e-13)
    assert split.in_scenario("same") == mission


def test_one_scenario_gives_the_front_of_none():
    one = Mission(TOY.graph, scenarios=[Scenario("the only one", 1.0)])
    fronts = [solve(mission, evaluations=3_000, seed=1).objectives for mission in (TOY, one)]
    assert np.array_equal(*fronts)


def test_a_factor_holds_for_arcs_of_a_zone_and_not_where_a_survival_is_given():
    graph = TOY.graph.copy()
    graph.nodes[4]["zone"] = "east"
    mission = Mission(
        graph, scenarios=[Scenario("flood", 0.5, factor=2, zone="east", survival={(4, 2): 0.25})]
    )
    usual, flooded = (
        dict(nx.get_edge_attributes(one.graph, "survival"))
        for one in (mission, mission.in_scenario("flood"))
    )
    expected = {arc: s**2 if 4 in arc else s for arc, s in usual.items()} | {(4, 2): 0.25}
    assert flooded == expected


def test_each_fault_is_named():
    graph = TOY.graph.copy()
    graph.nodes[4]["zone"] = "east"
    for scenarios, faults in (
        ("storm", ["expected scenarios to be a list of scenarios, got 'storm'"]),
        ([3], ["scenarios[0]: expected a Scenario, or an object, got 3"]),
        (
            [{"name": "x", "probability": 0.5, "factors": 2}],
            ["scenarios[0]: there is no 'factors' of a scenario; most alike are factor"],
        ),
        ([Scenario("x", 0.0)], ["scenario 'x': expected probability in (0, 1], got 0.0"]),
        ([Scenario("x", 0.5, factor=-1)], ["scenario 'x': expected a finite factor >= 0, got -1"]),
        ([Scenario("x", 0.5), Scenario("x", 0.5)], ["scenario 'x': there are two of this name"]),
        ([{"name": ["x"], "probability": 0.5}], ["scenario ['x']: expected a printable name"]),
        (
            [Scenario("x", 0.5), Scenario("y", 0.6)],
            ["expected probabilities of scenarios that sum to at most 1, got 1.1"],
        ),
        (
            [Scenario("x", 0.5, survival={(1, 9): 0.5})],
            ["scenario 'x': survival of (1, 9): expected the tail and the head of an arc"],
        ),
        (
            [Scenario("x", 0.5, survival={(1, 2): 1.5})],
            ["scenario 'x': arc 1 -> 2: expected survival in [0, 1], got 1.5"],
        ),
        ([Scenario("x", 0.5, reward={4: -1})], ["scenario 'x': node 4: expected a finite reward"]),
        ([Scenario("x", 0.5, reward={9: 1})], ["scenario 'x': reward 9: no such node"]),
        ([Scenario("x", 0.5, zone="est")], ["scenario 'x': zone 'est': no node has this zone"]),
        ([Scenario("a:b", 0.5)], ["scenario 'a:b': expected a printable name"]),
    ):
        with pytest.raises(MissionError) as caught:
            Mission(graph, scenarios=scenarios)
        assert len(caught.value.faults) == len(faults)
        for found, expected in zip(caught.value.faults, faults, strict=True):
            assert found.startswith(expected)
    with pytest.raises(ValueError, match="scenario"):
        THREE.in_scenario("strom")


@pytest.mark.parametrize("suffix", [".json", ".graphml"])
def test_files_hold_scenarios(tmp_path, suffix):
    graph = nx.relabel_nodes(TOY.graph, str)
    graph.graph.update(base="1")
    graph.nodes["4"]["zone"] = "east"
    mission = Mission(
        graph,
        scenarios=[
            Scenario("storm", 0.25, factor=3.0, zone="east"),
            Scenario("shut", 0.25, survival={("1", "2"): 0.0}, reward={"4": 9.0}),
        ],
    )
    path = tmp_path / f"site{suffix}"
    save_mission(mission, path)
    read = load_mission(path)
    assert read == mission
    assert [s.name for s in read.scenarios] == ["storm", "shut", "otherwise"]
    assert read.with_robots(5).scenarios == read.scenarios


@pytest.mark.parametrize("name", algorithm_names())
def test_every_algorithm_honours_scenarios_or_refuses(name):
    """What it returns is worth what it says, and floors hold over all scenarios."""
    if not type(make_algorithm(name)).supports(THREE):
        with pytest.raises(Exception, match="which has scenarios"):
            solve(THREE, make_algorithm(name), evaluations=300, seed=1)
        return
    found = solve(THREE, make_algorithm(name), evaluations=300, seed=1, min_survival=0.5)
    assert np.array_equal(THREE.evaluate(found.plans), found.objectives)
    assert (THREE.robot_survival(found.plans) >= 0.5 * (1 - 1e-12)).all()
    assert area_indicator(found.objectives, THREE) > 0.2
    problem, algorithm = BOTOHE(THREE, risk=0.3), make_algorithm(name)
    if getattr(algorithm, "evaluates_in_kernels", False) and not algorithm.honours_risk:
        with pytest.raises(TypeError, match="cannot plan for risk"):
            minimize(problem, algorithm, ("n_eval", 300), seed=1)
        return
    done = minimize(problem, algorithm, ("n_eval", 300), seed=1)
    assert np.array_equal(done.F, problem.evaluate_batch(THREE.batch(done.X)))


def test_the_whole_front_of_small_missions():
    """Of all plans of two robots: of each the objectives are the formulas'."""
    trails = twins.all_trails(THREE)
    plans = [THREE.pack([[one, other]])[0] for i, one in enumerate(trails) for other in trails[i:]]
    best = area_indicator(THREE.evaluate(plans), THREE)
    found = solve(THREE, evaluations=20_000, seed=1)
    assert area_indicator(found.objectives, THREE) == pytest.approx(best, rel=1e-12)


def test_who_cannot_honour_scenarios_refuses():
    with pytest.raises((TypeError, ValueError), match="scenarios"):
        exact_front(THREE)


def test_what_robots_have_survived_says_which_scenario_is_true():
    """By hand: robot 0 got over 1 -> 2, in a storm with the cube, and not where it is shut."""
    rest = THREE.after(PLAN, [Event("reached", 0, 2)])
    usual = TOY.graph.edges[1, 2]["survival"]
    weights = {"storm": 0.25 * usual**3, "rich": 0.2 * usual, "otherwise": 0.3 * usual}
    total = sum(weights.values())
    assert {s.name: s.probability for s in rest.scenarios} == pytest.approx(
        {name: weight / total for name, weight in weights.items()}
    )
    # What is left is what each scenario's mission would leave.
    [_, plan] = [PLAN, under_way(THREE, PLAN, [Event("reached", 0, 2)]).plan]
    for scenario in rest.scenarios:
        alone = under_way(THREE.in_scenario(scenario.name), PLAN, [Event("reached", 0, 2)])
        found = rest.in_scenario(scenario.name).evaluate([plan])
        assert found[0] == pytest.approx(alone.mission.evaluate([alone.plan])[0])
    # Nobody knows where robot 1 was lost: the longer its way, the more dangerous it was.
    lost = THREE.after(PLAN, [Event("lost", 1)])
    chances = {
        s.name: s.probability * (1 - one.robot_survival([PLAN])[0, 1])
        for s, (_, one) in zip(THREE.scenarios, THREE.in_scenarios, strict=True)
    }
    total = sum(chances.values())
    assert {s.name: s.probability for s in lost.scenarios} == pytest.approx(
        {name: chance / total for name, chance in chances.items()}
    )
    # Where no scenario allows it, nothing is learned.
    sure = Mission(TOY.graph, scenarios=[Scenario("sure", 0.5, survival={(1, 2): 1.0})])
    sure = sure.with_scenarios([replace(s, survival={(1, 2): 1.0}) for s in sure.scenarios])
    rest = sure.after(PLAN, [Event("lost", 0, 2)])
    assert [s.probability for s in rest.scenarios] == [0.5, 0.5]
    assert "storm 0.2" in str(replan(THREE, PLAN, [Event("reached", 0, 2)], price=1))


def test_the_static_policy_plays_what_plans_are_worth():
    found = simulate_policy(THREE, PLAN, "static", missions=4_000, seed=1, price=1)
    expected = THREE.evaluate([PLAN])[0]
    means = [found.table[name].mean() for name in ("reward", "survivors")]
    assert means == pytest.approx(expected.tolist(), abs=0.12)


@pytest.mark.compiled_only
def test_no_plan_lies_above_the_bound():
    trails = twins.all_trails(THREE)
    plans = [THREE.pack([[one, other]])[0] for i, one in enumerate(trails) for other in trails[i:]]
    objectives = THREE.evaluate(plans)
    bound = bound_front(THREE, time_limit=4)
    assert (objectives[:, 0] <= bound.bound(objectives[:, 1]) + 1e-9).all()
    assert bound.area < 1.6 * area_indicator(objectives, THREE)


def test_probabilities_of_robots_are_means_over_scenarios():
    for chances in (reach_probabilities, collect_probabilities):
        expected = sum(p * chances(one, PLAN) for p, one in THREE.in_scenarios)
        assert chances(THREE, PLAN) == pytest.approx(expected)


def test_simulation_draws_a_scenario_first():
    table = simulate(THREE, PLAN, 20_000, random_state=1)
    assert table[:1_000].equals(simulate(THREE, PLAN, 1_000, random_state=1))
    shares = table["scenario"].value_counts(normalize=True)
    for scenario in THREE.scenarios:
        assert shares[scenario.name] == pytest.approx(scenario.probability, abs=0.015)
        mean = THREE.in_scenario(scenario.name).evaluate([PLAN])[0]
        own = table[table["scenario"] == scenario.name][["reward", "survivors"]].mean()
        assert own.tolist() == pytest.approx(mean.tolist(), abs=0.15)


def test_the_worst_case_is_one_set_of_robots_for_all_scenarios():
    lost = [THREE.plan([[1], [1, 3, 1]]), THREE.plan([[1, 2, 4, 2, 1], [1]])]
    expected = min(THREE.evaluate(lost)[:, 0])
    assert worst_case(THREE, [PLAN])[0] == pytest.approx(expected)


def test_robustness_changes_hazards_in_all_scenarios():
    [row] = robustness(THREE, [PLAN], factors=[2.0]).to_dict("records")
    doubled = [
        Mission(_with_hazards(one.graph, 2.0)).evaluate([PLAN])[0] for _, one in THREE.in_scenarios
    ]
    expected = np.dot([p for p, _ in THREE.in_scenarios], doubled)
    assert [row["reward_low"], row["survivors_low"]] == pytest.approx(expected.tolist())


def _with_hazards(graph, factor):
    graph = graph.copy()
    for _, _, arc in graph.edges(data=True):
        arc["survival"] = max(arc["survival"] ** factor, 5e-324)
    return graph


def test_kinds_meet_the_same_scenario():
    graph = nx.DiGraph([(1, 2), (2, 1)], base=1)
    nx.set_node_attributes(graph, {1: 0.0, 2: 4.0}, "reward")
    for arc in graph.edges:
        graph.edges[arc]["survival"] = {"drone": 0.5, "rover": 0.9}
    wind = Scenario("wind", 0.5, survival={(1, 2): {"drone": 0.0, "rover": 0.9}})
    kinds = [Kind("drone", 1), Kind("rover", 1)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mission = Mission(graph, kinds=kinds, scenarios=[wind])
    plan = mission.plan([[1, 2, 1], [1, 2, 1]])
    reward = 0.5 * 4 * 0.9 + 0.5 * 4 * (1 - 0.5 * 0.1)
    assert mission.evaluate([plan])[0].tolist() == pytest.approx([reward, 0.5 * 0.25 + 0.81])
    assert BOTOHE(mission).n_obj == 2


def test_an_arc_that_the_graph_closes_for_a_kind_stays_closed():
    graph = TOY.graph.copy()
    graph.graph.pop("robots")
    graph.edges[2, 4]["survival"] = {"drone": 0.9, "rover": 0.0}
    kinds = [Kind("drone", 1), Kind("rover", 1)]
    survival = {(2, 4): {"drone": 0.7, "rover": 0.7}}
    mission = Mission(graph, kinds=kinds, scenarios=[Scenario("open", 0.5, survival=survival)])
    survival[2, 4]["drone"] = 0.1  # the mission has its own numbers
    one = mission.in_scenario("open")
    assert one.graph.edges[2, 4]["survival"] == {"drone": 0.7, "rover": 0.0}
    assert one.world.graph.n_arcs == mission.world.graph.n_arcs == 2 * len(graph.edges) - 1


def test_risk_is_the_mean_of_the_worst_scenarios():
    problem = BOTOHE(THREE, risk=0.3)
    rewards = sorted((one.evaluate([PLAN])[0, 0], p) for p, one in THREE.in_scenarios)
    (first, p), (second, _), *_ = rewards
    expected = (p * first + (0.3 - p) * second) / 0.3
    found = -problem.evaluate_batch(THREE.batch([PLAN]))[0]
    assert found[0] == pytest.approx(expected)
    assert found[1] == THREE.evaluate([PLAN])[0, 1]
    assert (problem.is_plain, problem.objectives.names[0]) == (False, "E[R] in the worst 30 %")
    done = minimize(problem, make_algorithm("nsga2", pop_size=20), ("n_eval", 200), seed=1)
    assert np.array_equal(done.F, problem.evaluate_batch(THREE.batch(done.X)))
    with pytest.raises(TypeError, match="SimulatedAnnealing cannot plan for risk"):
        minimize(problem, make_algorithm("simulated-annealing"), ("n_eval", 200), seed=1)
    for risk, mission in ((0.0, THREE), (1.0, THREE), (0.3, TOY)):
        with pytest.raises(ValueError, match="risk"):
            BOTOHE(mission, risk=risk)


def test_local_search_for_the_worst_scenarios():
    problem = BOTOHE(THREE, risk=0.3)
    trails = twins.all_trails(THREE)
    plans = [THREE.pack([[one, other]])[0] for i, one in enumerate(trails) for other in trails[i:]]
    best = -problem.evaluate_batch(THREE.batch(plans))
    found = minimize(problem, make_algorithm("pareto-local-search"), ("n_eval", 20_000), seed=1)
    assert found.algorithm.evaluator.n_eval == 20_000
    assert np.array_equal(found.F, problem.evaluate_batch(THREE.batch(found.X)))
    area = area_indicator(-found.F, problem.objectives)
    assert area == pytest.approx(area_indicator(best, problem.objectives), rel=1e-9)
    # A plan that is good in all scenarios, but best under no weights of them.
    graph = nx.DiGraph([(0, v) for v in "abc"] + [(v, 0) for v in "abc"], base=0, robots=1)
    nx.set_node_attributes(graph, {0: 0.0, "a": 0.0, "b": 0.0, "c": 4.0}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    pays = [Scenario(f"pays {v}", 0.5, reward={v: 10.0}) for v in "ab"]
    one = BOTOHE(Mission(graph, scenarios=pays), risk=0.3, max_length=2)
    found = minimize(one, make_algorithm("pareto-local-search"), ("n_eval", 1_000), seed=1)
    assert found.F[:, 0].min() == pytest.approx(-3.6)
    half = make_algorithm("pareto-local-search")
    half.setup(problem, termination=("n_eval", 3_000), seed=1)
    half.next()
    copied = pickle.loads(pickle.dumps(half))  # goes on as the other does
    for algorithm in (half, copied):
        while algorithm.has_next():
            algorithm.next()
    assert np.array_equal(half.archive.objectives, copied.archive.objectives)
    floor = BOTOHE(THREE, risk=0.3, min_survival=0.8)
    found = minimize(floor, make_algorithm("pareto-local-search"), ("n_eval", 2_000), seed=1)
    assert THREE.robot_survival(found.X).min() >= 0.8 - 1e-12


def test_scenarios_of_named_missions_and_in_texts():
    given = load_mission(
        "toy", scenarios=["storm=0.25,factor=3", {"name": "x", "probability": 0.5}]
    )
    assert [(s.name, s.probability) for s in given.scenarios] == [
        ("storm", 0.25),
        ("x", 0.5),
        ("otherwise", 0.25),
    ]
    with pytest.raises(MissionError, match="expected probability in"):
        load_mission("toy", scenarios=["storm=much"])


ZONED = TOY.graph.copy()
nx.set_node_attributes(ZONED, {2: "east", 4: "east", 3: "west"}, "zone")


def test_a_factor_may_hold_in_several_zones(tmp_path):
    mission = Mission(ZONED, scenarios=[Scenario("flood", 0.5, 2, ["east", "west"])])
    flooded = nx.get_edge_attributes(mission.in_scenario("flood").graph, "survival")
    for arc, survival in nx.get_edge_attributes(ZONED, "survival").items():
        assert flooded[arc] == (survival if arc in ((1, 5), (5, 1)) else survival**2)
    save_mission(mission, tmp_path / "zones.json")
    assert load_mission(tmp_path / "zones.json") == mission
    assert (
        load_mission(tmp_path / "zones.json", scenarios=["flood=0.5,factor=2,zone=east+west"])
        == mission
    )
    for zones, fault in (
        (["east", "wst"], "zone 'wst': no node"),
        ([3], "expected zone"),
        ([], "expected zone"),
    ):
        with pytest.raises(MissionError, match=fault):
            Mission(ZONED, scenarios=[Scenario("flood", 0.5, 2, zones)])


def test_zones_that_are_struck_independently():
    found = independent_zones({"east": 0.5, "west": 0.25}, factor=8, calm=0.5)
    assert found == [
        Scenario("calm", 0.5 * 0.75, 0.5),
        Scenario("west", 0.5 * 0.25, 8, ("west",)),
        Scenario("east", 0.5 * 0.75, 8, ("east",)),
        Scenario("east and west", 0.5 * 0.25, 8, ("east", "west")),
    ]
    assert len(Mission(ZONED, scenarios=found).scenarios) == 4
    [never] = independent_zones({"east": 0.0}, factor=8)
    assert never.name == "calm"
    with pytest.raises(ValueError, match=r"the probability of 'east'.*got 1\.5"):
        independent_zones({"east": 1.5}, factor=8)


@examples(60)
@given(scenario_missions_with_plans())
def test_marginals_can_be_kept(case):
    mission, _ = case
    given = [scenario for scenario in mission.scenarios if scenario.name != "otherwise"]
    plain = mission.with_scenarios([])
    try:
        kept = plain.with_scenarios(given, keep_marginals=True)
    except MissionError as error:
        assume("no hazard gives a mean survival of" not in str(error))
        raise
    # The world has no arcs that are closed in all scenarios.
    means, wanted = (
        dict(zip(zip(arcs.tail, arcs.head, strict=True), arcs.mean_survival, strict=True))
        for arcs in (kept.world.graph, plain.world.graph)
    )
    for (tail, head), mean in means.items():
        labels = kept.nodes[tail % len(kept.nodes)], kept.nodes[head % len(kept.nodes)]
        if not all(labels in s.survival for s in mission.scenarios):
            assert mean == pytest.approx(wanted[tail, head], abs=1e-9)


def test_marginals_by_hand():
    """In half of all cases the hazard is three times as large: (x + x³) / 2 = 0.55."""
    storm = Scenario("storm", 0.5, factor=3)
    graph = TOY.graph.copy()
    nx.set_edge_attributes(graph, (0.8 + 0.8**3) / 2, "survival")
    kept = Mission(graph).with_scenarios([storm], keep_marginals=True)
    assert all(s == pytest.approx(0.8) for *_, s in kept.graph.edges(data="survival"))
    sure = Scenario("sure", 0.9, factor=0)
    with pytest.raises(MissionError, match=r"arc 1 -> 2: no hazard gives .* of 0\.656"):
        Mission(graph).with_scenarios([sure], keep_marginals=True)


def test_survivals_that_are_known_from_few_crossings():
    graph = TOY.graph.copy()
    nx.set_edge_attributes(graph, {(1, 2): "stairs", (2, 1): "stairs", (2, 4): "hall"}, "class")
    counts = {"stairs": (20, 2), "hall": (0, 0)}
    found = scenarios_from_samples(graph, counts, n_scenarios=32, prior=(9, 1), seed=4)
    assert found == scenarios_from_samples(graph, counts, n_scenarios=32, prior=(9, 1), seed=4)
    assert {arc for scenario in found for arc in scenario.survival} == {(1, 2), (2, 1), (2, 4)}
    for arc, (a, b) in (((1, 2), (27, 3)), ((2, 4), (9, 1))):
        drawn = np.array([scenario.survival[arc] for scenario in found])
        strata = np.floor(32 * stats.beta.cdf(drawn, a, b)).astype(int)
        assert sorted(strata) == [*range(32)]
        assert drawn.mean() == pytest.approx(a / (a + b), abs=0.01)
    assert all(scenario.survival[1, 2] == scenario.survival[2, 1] for scenario in found)
    assert len(Mission(graph, scenarios=found).scenarios) == 32
    for wrong, fault in (
        ({"stairs": (3, 4)}, "losses of 'stairs' in .0, 3"),
        ({"stair": (3, 1)}, "Expected arcs with class 'stair', found none"),
    ):
        with pytest.raises(ValueError, match=fault):
            scenarios_from_samples(graph, wrong)


def test_tables_have_a_column_for_a_scenario():
    nodes = pd.DataFrame({"label": ["dock", "reef", "cape"], "reward": [0, 5, 3]})
    arcs = pd.DataFrame(
        {
            "tail": ["dock", "reef"],
            "head": ["reef", "cape"],
            "survival": [0.9, 0.8],
            "survival:storm": ["0.5", None],
        }
    )
    given = {"base": "dock", "robots": 2, "both_ways": True}
    mission = mission_from_tables(
        nodes, arcs, scenarios=[Scenario("storm", 0.25, factor=2)], **given
    )
    stormy = nx.get_edge_attributes(mission.in_scenario("storm").graph, "survival")
    assert stormy == {
        ("dock", "reef"): 0.5,
        ("reef", "dock"): 0.5,
        ("reef", "cape"): 0.8**2,
        ("cape", "reef"): 0.8**2,
    }
    assert mission.graph.edges["dock", "reef"] == {"survival": 0.9}
    with pytest.raises(MissionError, match="column 'survival:storm': no such kind or scenario"):
        mission_from_tables(nodes, arcs, scenarios=["strom=0.25"], **given)
    with pytest.raises(MissionError, match=r"expected survival in .0, 1., got 1\.5"):
        mission_from_tables(
            nodes, arcs.assign(**{"survival:storm": 1.5}), scenarios=["storm=0.25"], **given
        )


def test_a_wish_for_the_worst_scenario():
    plans = [THREE.stay_home(), PLAN, THREE.plan([[1, 3, 1], [1, 2, 1]])]
    candidates = Candidates(THREE, plans)
    for quantity, place in (("reward", 0), ("survivors", 1)):
        [wish] = parse_wishes(THREE, [f"worst scenario {quantity} >= 1"])
        assert str(wish) == f"worst scenario {quantity} >= 1"
        for i, plan in enumerate(plans):
            worst = min(one.evaluate([plan])[0, place] for _, one in THREE.in_scenarios)
            assert candidates.value(wish, i) == worst
    [plain] = parse_wishes(TOY, ["worst scenario reward >= 1"])
    assert Candidates(TOY, [PLAN]).value(plain, 0) == TOY.evaluate([PLAN])[0, 0]


def test_a_table_of_plans_by_scenario():
    table = by_scenario(THREE, [THREE.stay_home(), PLAN])
    assert table["plan"].tolist() == [0] * 4 + [1] * 4
    means = table[["reward", "survivors"]].mul(table["probability"], axis=0).groupby(table["plan"])
    assert means.sum().to_numpy() == pytest.approx(THREE.evaluate([THREE.stay_home(), PLAN]))
    assert table["scenario"].tolist() == [scenario.name for scenario in THREE.scenarios] * 2
    with pytest.raises(ValueError, match="Expected a mission with scenarios"):
        by_scenario(TOY, [PLAN])


def test_from_a_route_graph_and_a_storm_to_a_plan_without_code(tmp_path):
    graph = nx.convert_node_labels_to_integers(ZONED)
    nx.set_node_attributes(graph, {v: [v, v % 2] for v in graph}, "pos")
    save_mission(Mission(graph, base=0, robots=2), tmp_path / "site.geojson")
    storm, out = "storm=0.2,factor=8,zone=east", str(tmp_path / "found")
    given = ["--base", "0", "--robots", "2", "--scenario", storm, "--evaluations", "300"]
    solved = run_botohe("solve", tmp_path / "site.geojson", *given, "--out", out)
    assert "2 scenarios: storm 0.2, otherwise 0.8" in solved.out
    wish = "worst scenario reward >= 0.5"
    chosen = run_botohe("choose", out, wish, "--out", tmp_path / "plan.png").out
    rows = [line.split() for line in chosen.splitlines() if line.startswith(("storm", "otherwise"))]
    assert [row[:2] for row in rows] == [["storm", "0.200"], ["otherwise", "0.800"]]
    assert float(rows[0][2]) >= 0.5
    assert (tmp_path / "plan.png").exists()


def test_the_flooded_plant_is_the_plant_on_average():
    flooded, plant = load_mission("flooded_plant"), load_mission("power_plant")
    assert [s.probability for s in flooded.scenarios] == pytest.approx([0.3, 0.3, 0.4])
    means, usual = (one.world.graph.mean_survival for one in (flooded, plant))
    assert means == pytest.approx(usual, abs=1e-9)
    plan = solve(plant, evaluations=2_000, seed=1).plans[0]
    wet = flooded.in_scenario("water on floor 2")
    assert wet.evaluate([plan])[0, 1] < plant.evaluate([plan])[0, 1]
    assert flooded.rewards.tolist() == plant.rewards.tolist()


@pytest.mark.slow
@examples(60)
@given(scenario_missions_with_plans(missions_with_plans(max_nodes=4, max_robots=2)))
def test_local_search_finds_the_fronts_of_small_missions(case):
    mission, _ = case
    trails = twins.all_trails(mission)
    assume(trails is not None and len(trails) ** mission.robots <= 20_000)
    plans = mission.pack([list(team) for team in product(trails, repeat=mission.robots)])
    best = area_indicator(mission.evaluate(plans), mission)
    found = solve(mission, evaluations=10_000, seed=1)
    assert area_indicator(found.objectives, mission) >= best - 0.002


def test_a_floor_that_the_rest_of_a_plan_cannot_keep_any_more_is_lowered():
    """What has happened shows that there is a storm: a search from such a plan once crashed."""
    graph = nx.DiGraph([(0, 1), (1, 0), (1, 2), (2, 1), (0, 2), (2, 0), (2, 3), (3, 2)])
    nx.set_node_attributes(graph, 1.0, "reward")
    nx.set_edge_attributes(graph, 0.99, "survival")
    storm = Scenario("storm", 0.2, factor=60)
    team = [Kind("boat", 3, min_survival=0.6)]
    mission = Mission(graph, base=0, kinds=team, scenarios=[storm])
    plan = mission.plan([[0, 1, 2, 3, 2, 0], [0, 2, 0], [0, 2, 1, 0]])
    events = [Event("reached", 0, 1), Event("lost", 1, 2), Event("lost", 2, 2)]
    found = replan(mission, plan, events, evaluations=500, seed=1)
    [kind] = found.left.mission.kinds
    [alive] = found.left.mission.robot_survival([found.left.plan])[0]
    assert alive < 0.1
    assert kind.min_survival == alive
    assert found.left.mission.robot_survival([found.plan])[0, 0] >= alive * (1 - 1e-12)


def test_probabilities_sum_to_one_everywhere():
    thirds = [Scenario(f"number {i}", 0.333333333, factor=i) for i in (1, 2, 3)]
    mission = Mission(TOY.graph, scenarios=thirds)
    assert fsum(s.probability for s in mission.scenarios) == pytest.approx(1.0, abs=1e-15)
    means = sum(p * one.evaluate([PLAN])[0] for p, one in mission.in_scenarios)
    assert means == pytest.approx(mission.evaluate([PLAN])[0], rel=1e-14)
    [sure] = Mission(TOY.graph, scenarios=[Scenario("sure", 1)]).scenarios
    assert (type(sure.probability), sure.probability) == (float, 1.0)


def test_what_is_aboard_may_pay_in_one_scenario_only():
    graph = TOY.graph.copy()
    graph.nodes[4]["reward"] = 0.0
    found = Mission(
        graph,
        kinds=[Kind("truck", 1, aboard=(4,))],
        pays="return",
        scenarios=[Scenario("rich", 0.5, reward={4: 10.0})],
    )
    plan = found.plan([[1, 2, 1]])
    expected = sum(p * one.evaluate([plan])[0] for p, one in found.in_scenarios)
    assert found.evaluate([plan])[0] == pytest.approx(expected)
    assert expected[0] > 4.0
    with pytest.raises(ValueError, match="carry something from the start"):
        bound_front(found)


def test_arcs_that_are_closed_in_all_scenarios_are_no_arcs():
    shut = Mission(TOY.graph, scenarios=[Scenario("shut", 1.0, survival={(2, 4): 0.0})])
    alone = shut.in_scenario("shut")
    assert shut.world.graph.n_arcs == alone.world.graph.n_arcs == 11
    data = page_data(solution_of(shut, [shut.plan([[1, 3, 1], [1]])]))
    assert len(data["arc_survival"][0][0]) == len(data["arcs"][0]) == 11


def test_few_chances_of_the_worst_scenarios_sum_to_one():
    tiny = Scenario("storm", 1e-17, factor=8)
    problem = BOTOHE(Mission(TOY.graph, scenarios=[tiny, Scenario("half", 0.5, 2)]), risk=1e-17)
    weights = problem.worst_weights(TOY.batch([PLAN]))
    assert weights[:, 0].tolist() == [1.0, 0.0, 0.0]


def test_a_mission_keeps_its_own_scenarios():
    survival = {(1, 2): 0.5}
    mission = Mission(TOY.graph, scenarios=[Scenario("storm", 0.5, survival=survival)])
    before = mission.evaluate([PLAN]).tolist()
    survival[1, 2] = 1.0
    assert np.dot([0.5, 0.5], [one.evaluate([PLAN])[0] for _, one in mission.in_scenarios]) == (
        pytest.approx(before[0])
    )
    assert {hash(scenario) for scenario in mission.scenarios}
    assert len(pickle.dumps(mission)) < 3 * len(pickle.dumps(TOY))
    assert pickle.loads(pickle.dumps(mission)).in_scenarios == mission.in_scenarios


def test_scenarios_that_were_taken_away_are_not_saved(tmp_path):
    graph = TOY.graph.copy()
    graph.graph["scenarios"] = [STORM]
    none = Mission(graph).with_scenarios([])
    save_mission(none, tmp_path / "none.json")
    assert load_mission(tmp_path / "none.json").scenarios == ()
    several = Mission(ZONED, scenarios=[Scenario("flood", 0.5, 2, {"west", "east"})])
    save_mission(several, tmp_path / "several.json")
    assert load_mission(tmp_path / "several.json").scenarios == several.scenarios


def test_outcomes_where_nobody_gets_to_a_node_with_a_share():
    graph = TOY.graph.copy()
    graph.nodes[4]["share"] = 0.5
    mission = Mission(graph, scenarios=[Scenario("trap", 0.5, survival={(2, 4): 0.0})])
    found = plan_outcomes(mission, PLAN).reward
    assert found.mean == pytest.approx(mission.evaluate([PLAN])[0, 0])


def test_bounds_fall_with_survivors_and_are_kept_in_files(tmp_path):
    kinds = [Kind("boat", 2, start=1, end=2)]
    mission = Mission(TOY.graph, kinds=kinds, scenarios=[STORM])
    bound = bound_front(mission, time_limit=4)
    bound.save(tmp_path / "bound.json")
    assert FrontBound.load(tmp_path / "bound.json", mission).bound([0.5]) == bound.bound([0.5])
    most = bound_front(THREE, time_limit=4).bound([0.0, 1.0, 1.5])
    assert most[0] > most[1] > most[2]


def test_more_that_is_refused():
    with pytest.raises(MissionError, match="expected zone to be a text, or several"):
        Mission(ZONED, scenarios=[Scenario("flood", 0.5, 2, iter(["east"]))])
    with pytest.raises(MissionError, match="a kind of robots has this name"):
        Mission(TOY.graph, kinds=[Kind("boat", 1)], scenarios=[Scenario("boat", 0.5)])
    with pytest.raises(ValueError, match="Mission 'toy' has no scenarios"):
        TOY.in_scenario("storm")
    graph = TOY.graph.copy()
    for wrong in (5, "storm", {"name": "storm"}):
        graph.graph["scenarios"] = wrong
        with pytest.raises(MissionError, match="expected scenarios to be a list"):
            Mission(graph)
    with pytest.raises(ValueError, match="counts of at least one class"):
        scenarios_from_samples(TOY.graph, {})
    with pytest.raises(ValueError, match="crossings and losses of 'hall', two numbers"):
        scenarios_from_samples(TOY.graph, {"hall": 5})
    with pytest.raises(ValueError, match="factor"):
        independent_zones({"east": 0.5}, factor=-1)
