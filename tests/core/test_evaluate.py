"""The objectives: by hand, by a readable twin, and by enumeration of everything that may happen."""

from fractions import Fraction
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from botohe_moo.mission import Kind, Mission, PlanError, load_mission
from botohe_moo.outcomes import plan_outcomes
from botohe_moo.trails import PlanBatch, TrailPlan
from tests import strategies, twins
from tests.examples import examples
from tests.strategies import (
    missions,
    missions_with_plans,
    plans,
    team_missions,
    team_missions_with_plans,
)


def test_by_hand():
    """Toy: 1 -.9- 3 -.81- 4 -.729- 5, 1 -.81- 2 -1- 4, 2 -.9- 3; rewards 3: 1, 4: 4, 5: 5."""
    toy = load_mission("toy")
    by_hand = [
        ([[1], [1]], 0, 2),
        ([[1, 3, 4, 2, 1], [1]], 0.9 * 1 + 0.9 * 0.81 * 4, 0.9 * 0.81 * 1.0 * 0.81 + 1),
        # Two robots share a node.
        ([[1, 3, 1], [1, 3, 2, 1]], 1 - 0.1 * 0.1, 0.81 + 0.9 * 0.9 * 0.81),
        # Only the first visit counts.
        ([[1, 2, 4, 5, 4, 2, 1], [1]], 0.81 * 4 + 0.81 * 0.729 * 5, (0.81 * 0.729) ** 2 + 1),
        # The base is revisited on the way.
        ([[1, 3, 1, 2, 4, 2, 1], [1]], 0.9 * 1 + 0.81 * 0.81 * 4, 0.81**3 + 1),
    ]
    for trails, reward, survivors in by_hand:
        found = toy.evaluate([toy.plan(trails)])[0]
        assert found == pytest.approx([reward, survivors], abs=1e-15)
    graph = toy.graph.copy()
    graph.nodes[1]["reward"] = 7.0  # that of the base is certain
    mission = Mission(graph)
    assert mission.evaluate([mission.plan([[1, 3, 1], [1]])])[0, 0] == pytest.approx(7.9, abs=1e-15)


def there_and_back(survival, robots):
    """A mission of one node, which every robot visits."""
    graph = nx.DiGraph(base=0, robots=robots)
    graph.add_nodes_from([(0, {"reward": 0.0}), (1, {"reward": 3.0})])
    graph.add_edges_from([(0, 1), (1, 0)], survival=survival)
    return Mission(graph), TrailPlan([[0, 1, 0]] * robots)


def large_and_small():
    """A mission of two rewards, of which one is lost beside the other in outcomes of both."""
    graph = nx.DiGraph(base=0, robots=1)
    graph.add_nodes_from((i, {"reward": reward}) for i, reward in enumerate([0.0, 1e-14, 1.0]))
    graph.add_weighted_edges_from([(0, 2, 0.1), (2, 1, 0.5), (1, 0, 1.0)], weight="survival")
    return Mission(graph), TrailPlan([[0, 2, 1, 0]])


@examples(600)
@given(missions_with_plans() | team_missions_with_plans())
def test_kernel_twin_and_enumeration_agree(drawn):
    """The objectives are those of the formulas, and of all that may happen to robots."""
    mission, plan = drawn
    trails = mission.labels(plan)
    reward, survivors = mission.evaluate([plan])[0]
    assert (reward, survivors) == pytest.approx(twins.evaluate(mission, trails), abs=1e-12)
    outcomes = list(twins.enumerate_outcomes(mission, trails))
    assert sum(p for p, _, _ in outcomes) == pytest.approx(1.0, abs=1e-12)
    assert reward == pytest.approx(sum(p * r for p, r, _ in outcomes), abs=1e-12)
    assert survivors == pytest.approx(sum(p * s for p, _, s in outcomes), abs=1e-12)


MUSEUM = load_mission("art_museum")


@examples(20)
@given(plans(MUSEUM))
def test_one_kind_that_is_paid_on_arrival_is_nothing_special(trails):
    for name in ("robot", "drone"):
        mission = Mission(MUSEUM.graph, kinds=[Kind(name, 3)])
        assert mission.is_plain
        for one, other in zip(mission.world.numbers(True), MUSEUM.world.numbers(True), strict=True):
            assert np.array_equal(one, other)
        found, expected = (each.evaluate([TrailPlan(trails)]) for each in (mission, MUSEUM))
        assert found.tobytes() == expected.tobytes()


ULP = 2.0**-52
tiny = st.integers(1, 300).map(lambda digits: 10.0**-digits)
all_survivals = st.one_of(tiny, tiny.map(lambda p: 1.0 - p), st.floats(1e-300, 1.0))


@examples(300)
@given(missions_with_plans(max_nodes=5, max_robots=4, survivals=all_survivals))
@example(there_and_back(1e-300, robots=4))
@example(there_and_back(1e-14, robots=3))
@example(there_and_back(1.0 - 1e-15, robots=3))
@example(large_and_small())
def test_small_chances_keep_their_digits(drawn):
    """Against fractions, which do not round: the error is relative, whatever the survivals."""
    mission, plan = drawn
    reward, survivors = twins.exact_figures(mission, mission.labels(plan))
    roundings = len(plan.nodes) + len(mission.nodes) + 4 * plan.n_robots
    found = mission.evaluate([plan])[0]
    distributions = plan_outcomes(mission, plan, max_outcomes=10**6)
    means = np.array([distributions.reward.mean, distributions.survivors.mean])
    floor = roundings * 5e-324 * max(1.0, mission.total_reward)  # products that underflow
    for name, pair in (("evaluate", found), ("distributions", means)):
        slack = roundings * ULP
        for value, expected in zip(pair, (reward, survivors), strict=True):
            error = abs(Fraction(float(value)) - expected)
            assert error <= Fraction(slack) * expected + Fraction(floor), (name, value, expected)


@given(missions(max_robots=4) | team_missions(max_robots=3), st.data())
def test_equal_plans_get_equal_bits(mission, data):
    trails = data.draw(plans(mission))
    of_kinds, n = [], 0
    for kind in mission.kinds:
        of_kinds.append(trails[n : n + kind.robots])
        n += kind.robots
    shuffled = [trail for some in of_kinds for trail in data.draw(st.permutations(some))]
    one, other = mission.evaluate([TrailPlan(trails), TrailPlan(shuffled)])
    assert one.tobytes() == other.tobytes()
    assert mission.evaluate_drafts([TrailPlan(trails)])[0].tolist() == [one.tolist()]


@given(missions() | team_missions(), st.data())
def test_a_batch_is_its_plans_one_by_one(mission, data):
    drawn = [TrailPlan(data.draw(plans(mission))) for _ in range(data.draw(st.integers(0, 4)))]
    together = mission.evaluate(drawn)
    assert together.shape == (len(drawn), 2)
    for plan, row in zip(drawn, together, strict=True):
        assert mission.evaluate([plan])[0].tobytes() == row.tobytes()


def test_faults_name_the_plan_the_robot_the_position_and_the_arc():
    toy, home = load_mission("toy"), TrailPlan([[0], [0]])
    for trails, message in (
        ([[0, 3, 0], [0]], r"Robot 0, position 1: arc 1 -> 4 is missing"),
        ([[0], [0, 2, 0, 2, 0]], r"Robot 1, position 3: arc 1 -> 3 is used twice"),
        ([[0, 2], [0]], r"Robot 0, position 1: expected the trail to end at base 1, got 3"),
        ([[0], [2, 0]], r"Robot 1, position 0: expected the trail to begin at base 1, got 3"),
        ([[0, 2, 17, 0], [0]], r"Robot 0, position 2: node index 17 is unknown"),
        ([[0], [99]], r"Robot 1, position 0: node index 99 is unknown"),
    ):
        with pytest.raises(PlanError, match=message):
            toy.evaluate([TrailPlan(trails)])
        with pytest.raises(PlanError, match=message.replace("Robot", "Plan 2, robot")):
            toy.evaluate([home, home, TrailPlan(trails), home])
    changed = [PlanBatch(np.zeros(2, np.int32), np.array([0, 1, 2]), 2) for _ in range(2)]
    changed[0].arrays[1][1], changed[1].arrays[1][1] = 10**10, -5
    for batch, message in (
        (PlanBatch([0], [0, 1, 1], 2), "Robot 1: expected a trail of at least one node"),
        (PlanBatch([0, -1, 0, 0], [0, 3, 4], 2), "position 1: node index -1 is unknown"),
        ([TrailPlan([[0]])], "2 robots"),
        (PlanBatch(np.zeros(3, np.int32), np.arange(4), 3), "Plan 0: expected 2 trails, got 3"),
        *((each, "expected") for each in changed),
    ):
        with pytest.raises(PlanError, match=message):
            toy.evaluate(batch)


def drafted(mission, trails):
    """The readable twin of drafts: (E[R], E[S], faults, survival and length of each robot).

    Nodes are numbered as in kernels, those of each kind behind those of the kind before.
    """
    faults, walked, alive, n_nodes = 0, [], [], len(mission.nodes)
    arcs = {
        (u + k * n_nodes, v + k * n_nodes): survival
        for k, kind in enumerate(mission.kinds)
        for (u, v), survival in twins.survivals(mission, kind).items()
    }
    for kind, trail in zip(mission.kind_of, trails, strict=True):
        layer = n_nodes * mission.kinds.index(kind)
        start, end = (layer + label for label in kind.ends(mission.base))
        good, used, lost = [], set(), trail[0] != start
        faults += lost
        if not lost:
            good.append(trail[0])
        for hop in pairwise(trail):
            if hop not in arcs or hop in used:
                faults += 1
                lost = True
            used.add(hop)
            if not lost:
                good.append(hop[1])
        if trail[-1] != end:
            faults += 1
            lost = True
        walked.append([node - layer for node in good])
        alive.append(0.0 if lost else np.prod([arcs[hop] for hop in pairwise(good)]))
    reward, _ = twins.evaluate(mission, walked)
    return reward, sum(alive), faults, alive, twins.trail_lengths(mission, walked)


@examples(300)
@given(missions(max_nodes=6) | team_missions(max_nodes=4), st.data())
def test_drafts_are_their_readable_twin(mission, data):
    node = st.integers(0, mission.world.graph.n_nodes + 1)
    some = st.lists(node, max_size=3)
    drawn = [
        data.draw(some)
        + data.draw(strategies.trails(mission, robot=robot, max_hops=4))
        + data.draw(some)
        for robot in range(mission.robots)
    ]
    plan = TrailPlan(drawn)
    objectives, faults = mission.evaluate_drafts([plan])
    reward, survivors, expected_faults, alive, lengths = drafted(mission, drawn)
    assert objectives[0] == pytest.approx([reward, survivors], abs=1e-12)
    assert faults.tolist() == [expected_faults]
    assert mission.robot_survival([plan])[0] == pytest.approx(alive, abs=1e-12)
    assert mission.trail_lengths([plan])[0] == pytest.approx(lengths, abs=1e-12)
    if expected_faults:
        with pytest.raises(PlanError):
            mission.evaluate([plan])
    else:
        assert mission.evaluate([plan]).tolist() == objectives.tolist()
