"""The objectives: by hand, by a readable twin, and by enumeration of everything that may happen."""

from fractions import Fraction
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from botohe_moo.mission import Mission, PlanError, load_mission
from botohe_moo.outcomes.outcomes import (
    plan_outcomes,
    reward_distribution,
    simulate,
    survivors_distribution,
)
from botohe_moo.trails import PlanBatch, TrailPlan
from tests import twins
from tests.examples import examples
from tests.strategies import missions, missions_with_plans, plans


@pytest.fixture(scope="module")
def toy():
    return load_mission("toy")


class TestByHand:
    """Toy: 1 -.9- 3 -.81- 4 -.729- 5, 1 -.81- 2 -1- 4, 2 -.9- 3; rewards 3: 1, 4: 4, 5: 5."""

    def evaluate(self, mission, *trails):
        return mission.evaluate([mission.plan(trails)])[0].tolist()

    def test_everybody_stays(self, toy):
        assert self.evaluate(toy, [1], [1]) == [0.0, 2.0]

    def test_one_robot_there_and_back(self, toy):
        reward, survivors = self.evaluate(toy, [1, 3, 4, 2, 1], [1])
        assert reward == pytest.approx(0.9 * 1 + 0.9 * 0.81 * 4, abs=1e-15)
        assert survivors == pytest.approx(0.9 * 0.81 * 1.0 * 0.81 + 1, abs=1e-15)

    def test_two_robots_share_a_node(self, toy):
        reward, survivors = self.evaluate(toy, [1, 3, 1], [1, 3, 2, 1])
        assert reward == pytest.approx(1 - 0.1 * 0.1, abs=1e-15)
        assert survivors == pytest.approx(0.81 + 0.9 * 0.9 * 0.81, abs=1e-15)

    def test_only_the_first_visit_counts(self, toy):
        reward, survivors = self.evaluate(toy, [1, 2, 4, 5, 4, 2, 1], [1])
        assert reward == pytest.approx(0.81 * 4 + 0.81 * 0.729 * 5, abs=1e-15)
        assert survivors == pytest.approx(0.81 * 0.729 * 0.729 * 0.81 + 1, abs=1e-15)

    def test_base_revisited_mid_trail(self, toy):
        reward, survivors = self.evaluate(toy, [1, 3, 1, 2, 4, 2, 1], [1])
        assert reward == pytest.approx(0.9 * 1 + 0.81 * 0.81 * 4, abs=1e-15)
        assert survivors == pytest.approx(0.81 * 0.81 * 0.81 + 1, abs=1e-15)

    def test_reward_of_the_base_is_certain(self, toy):
        graph = toy.graph.copy()
        graph.nodes[1]["reward"] = 7.0
        mission = type(toy)(graph)
        assert self.evaluate(mission, [1], [1]) == [7.0, 2.0]
        assert self.evaluate(mission, [1, 3, 1], [1])[0] == pytest.approx(7.9, abs=1e-15)


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


@examples(400)
@given(missions_with_plans())
def test_kernel_twin_and_enumeration_agree(drawn):
    mission, plan = drawn
    trails = mission.labels(plan)
    reward, survivors = mission.evaluate([plan])[0]
    assert (reward, survivors) == pytest.approx(twins.evaluate(mission, trails), abs=1e-12)
    outcomes = list(twins.enumerate_outcomes(mission, trails))
    assert sum(p for p, _, _ in outcomes) == pytest.approx(1.0, abs=1e-12)
    assert reward == pytest.approx(sum(p * r for p, r, _ in outcomes), abs=1e-12)
    assert survivors == pytest.approx(sum(p * s for p, _, s in outcomes), abs=1e-12)


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


def test_the_drawn_plans_are_of_all_the_kinds_that_matter():
    """What the comparison above rests on: one-way missions, loops through base, second visits."""
    kinds = {"in > out": 0, "stays home": 0, "node twice": 0, "base mid-trail": 0, "many robots": 0}

    @settings(max_examples=300, database=None, derandomize=True)
    @given(missions_with_plans())
    def count(drawn):
        mission, plan = drawn
        trails = mission.labels(plan)
        degrees = [mission.graph.in_degree(v) > mission.graph.out_degree(v) for v in mission.graph]
        kinds["in > out"] += any(degrees)
        kinds["stays home"] += any(len(trail) == 1 for trail in trails)
        kinds["node twice"] += any(len(set(trail[1:-1])) < len(trail[1:-1]) for trail in trails)
        kinds["base mid-trail"] += any(0 in trail[1:-1] for trail in trails)
        kinds["many robots"] += len(trails) > 2

    count()
    assert min(kinds.values()) >= 20, kinds


@given(missions(max_robots=4), st.data())
def test_equal_plans_get_equal_bits(mission, data):
    trails = data.draw(plans(mission))
    shuffled = data.draw(st.permutations(trails))
    one, other = mission.evaluate([TrailPlan(trails), TrailPlan(shuffled)])
    assert one.tobytes() == other.tobytes()


@given(missions(), st.data())
def test_a_batch_is_its_plans_one_by_one(mission, data):
    drawn = [TrailPlan(data.draw(plans(mission))) for _ in range(data.draw(st.integers(0, 4)))]
    together = mission.evaluate(drawn)
    assert together.shape == (len(drawn), 2)
    for plan, row in zip(drawn, together, strict=True):
        assert mission.evaluate([plan])[0].tobytes() == row.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("name", ["random", "two_communities"])
def test_simulated_means_agree(name, seed):
    mission = load_mission(name, seed=seed)
    rng = np.random.default_rng(seed)
    plan = mission.plan([_wander(mission, rng) for _ in range(mission.robots)])
    played = simulate(mission, plan, 20_000, random_state=seed)[["reward", "survivors"]]
    spread = [reward_distribution(mission, plan).std, survivors_distribution(mission, plan).std]
    error = np.array(spread) / len(played) ** 0.5
    deviation = (played.mean() - mission.evaluate([plan])[0]).abs()
    assert (deviation <= 4 * error + 1e-12).all(), (deviation, error)


def _wander(mission, rng):
    """A random walk over unused arcs until it is home for the second time or at last."""
    here, trail, used, returns = mission.base, [mission.base], set(), 0
    while True:
        hops = [v for v in mission.graph[here] if (here, v) not in used]
        if not hops or (here == mission.base and returns == 2):
            return trail
        head = hops[rng.integers(len(hops))]
        used.add((here, head))
        trail.append(head)
        here = head
        returns += here == mission.base


class TestFaults:
    """A batch with a fault names the plan, the robot, the position and the arc."""

    @pytest.mark.parametrize(
        ("trails", "message"),
        [
            ([[0, 3, 0], [0]], r"Robot 0, position 1: arc 1 -> 4 is missing"),
            ([[0], [0, 2, 0, 2, 0]], r"Robot 1, position 3: arc 1 -> 3 is used twice"),
            ([[0, 2], [0]], r"Robot 0, position 1: expected the trail to end at base 1, got 3"),
            ([[0], [2, 0]], r"Robot 1, position 0: expected the trail to begin at base 1, got 3"),
            ([[0, 2, 17, 0], [0]], r"Robot 0, position 2: node index 17 is unknown"),
            ([[0], [99]], r"Robot 1, position 0: node index 99 is unknown"),
        ],
    )
    def test_each(self, toy, trails, message):
        with pytest.raises(PlanError, match=message):
            toy.evaluate([TrailPlan(trails)])
        home = TrailPlan([[0], [0]])
        with pytest.raises(PlanError, match=message.replace("Robot", "Plan 2, robot")):
            toy.evaluate([home, home, TrailPlan(trails), home])

    def test_an_empty_trail_in_a_batch(self, toy):
        batch = PlanBatch(np.array([0], np.int32), np.array([0, 1, 1]), 2)
        with pytest.raises(PlanError, match="Robot 1: expected a trail of at least one node"):
            toy.evaluate(batch)

    def test_a_negative_node_in_a_batch(self, toy):
        batch = PlanBatch(np.array([0, -1, 0, 0], np.int32), np.array([0, 3, 4]), 2)
        with pytest.raises(PlanError, match="Robot 0, position 1: node index -1 is unknown"):
            toy.evaluate(batch)

    @pytest.mark.parametrize("cut", [10**10, -5])
    def test_offsets_that_were_changed(self, toy, cut):
        batch = PlanBatch(np.zeros(2, np.int32), np.array([0, 1, 2]), 2)
        batch.arrays[1][1] = cut
        with pytest.raises(PlanError, match="expected"):
            toy.evaluate(batch)

    def test_another_team_size(self, toy):
        with pytest.raises(PlanError, match="2 robots"):
            toy.evaluate([TrailPlan([[0]])])
        with pytest.raises(PlanError, match="Plan 0: expected 2 trails, got 3"):
            toy.evaluate(PlanBatch(np.zeros(3, np.int32), np.arange(4), 3))


def drafted(mission, trails):
    """The readable twin of drafts: (E[R], E[S], faults, survival of each robot)."""
    arcs = {(u, v): s for u, v, s in mission.graph.edges(data="survival")}
    faults, walked, alive = 0, [], []
    for trail in trails:
        good, used, lost = [], set(), trail[0] != mission.base
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
        if trail[-1] != mission.base:
            faults += 1
            lost = True
        walked.append(good)
        alive.append(0.0 if lost else np.prod([arcs[hop] for hop in pairwise(good)]))
    reward, _ = twins.evaluate(mission, walked)
    return reward, sum(alive), faults, alive, twins.trail_lengths(mission, walked)


@examples(300)
@given(missions(max_nodes=6), st.data())
def test_drafts_are_their_readable_twin(mission, data):
    node = st.integers(0, len(mission.nodes) + 1)
    drawn = [data.draw(st.lists(node, min_size=1, max_size=8)) for _ in range(mission.robots)]
    plan = TrailPlan(drawn)
    objectives, faults = mission.evaluate_drafts([plan])
    reward, survivors, expected_faults, alive, lengths = drafted(mission, drawn)
    assert objectives[0] == pytest.approx([reward, survivors], abs=1e-12)
    assert faults.tolist() == [expected_faults]
    assert mission.robot_survival([plan])[0] == pytest.approx(alive, abs=1e-12)
    assert mission.trail_lengths([plan])[0] == pytest.approx(lengths, abs=1e-12)
    valid = True
    try:
        mission.evaluate([plan])
    except PlanError:
        valid = False
    assert (expected_faults == 0) == valid


@examples(200)
@given(missions_with_plans(max_nodes=7))
def test_valid_drafts_get_the_same_bits(drawn):
    mission, plan = drawn
    objectives, faults = mission.evaluate_drafts([plan])
    assert objectives.tolist() == mission.evaluate([plan]).tolist()
    assert faults.tolist() == [0]
    alive = mission.robot_survival([plan])
    assert alive.sum() == pytest.approx(objectives[0, 1])
