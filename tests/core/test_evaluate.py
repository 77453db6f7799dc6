"""The objectives: by hand, by a readable twin, and by enumeration of everything that may happen."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from botohe_moo.mission import Kind, Mission, PlanError, load_mission
from botohe_moo.outcomes import plan_outcomes
from botohe_moo.trails import PlanBatch, TrailPlan
from tests import strategies, twins
from tests.examples import examples
from tests.strategies import mission_of, missions, missions_with_plans, plans, team_missions

TOY = load_mission("toy")


@pytest.mark.parametrize(
    ("trails", "reward", "survivors"),
    [
        ([[1], [1]], 0, 2),
        ([[1, 3, 4, 2, 1], [1]], 0.9 * 1 + 0.9 * 0.81 * 4, 0.9 * 0.81 * 1.0 * 0.81 + 1),
        # Two robots share a node.
        ([[1, 3, 1], [1, 3, 2, 1]], 1 - 0.1 * 0.1, 0.81 + 0.9 * 0.9 * 0.81),
        # Only the first visit counts.
        ([[1, 2, 4, 5, 4, 2, 1], [1]], 0.81 * 4 + 0.81 * 0.729 * 5, (0.81 * 0.729) ** 2 + 1),
        # The base is revisited on the way.
        ([[1, 3, 1, 2, 4, 2, 1], [1]], 0.9 * 1 + 0.81 * 0.81 * 4, 0.81**3 + 1),
    ],
)
def test_by_hand(trails, reward, survivors):
    """Toy: 1 -.9- 3 -.81- 4 -.729- 5, 1 -.81- 2 -1- 4, 2 -.9- 3; rewards 3: 1, 4: 4, 5: 5."""
    found = TOY.evaluate([TOY.plan(trails)])[0]
    assert found == pytest.approx([reward, survivors], abs=1e-15)
    graph = TOY.graph.copy()
    graph.nodes[1]["reward"] = 7.0  # that of the base is certain
    found = Mission(graph).evaluate([TOY.plan(trails)])[0]
    assert found == pytest.approx([7 + reward, survivors], abs=1e-14)


@examples(600)
@given(missions(max_robots=4) | team_missions(max_robots=3), st.data())
def test_kernel_twin_and_enumeration_agree_in_any_batch_and_order_of_robots(mission, data):
    """The objectives are those of the formulas, and of all that may happen to robots."""
    drawn = [data.draw(plans(mission)) for _ in range(data.draw(st.integers(0, 2)))]
    together = mission.evaluate(map(TrailPlan, drawn))
    assert together.shape == (len(drawn), 2)
    for trails, row in zip(drawn, together, strict=True):
        labels = mission.labels(TrailPlan(trails))
        assert row == pytest.approx(twins.evaluate(mission, labels), abs=1e-12)
        outcomes = np.array(list(twins.enumerate_outcomes(mission, labels)))
        assert outcomes[:, 0].sum() == pytest.approx(1.0, abs=1e-12)
        assert row == pytest.approx(outcomes[:, 0] @ outcomes[:, 1:], abs=1e-12)
        keyed = data.draw(st.permutations(range(mission.robots)))
        order = sorted(keyed, key=lambda robot: mission.kinds.index(mission.kind_of[robot]))
        shuffled = TrailPlan([trails[robot] for robot in order])
        assert mission.evaluate([shuffled]).tobytes() == row.tobytes()
        assert mission.evaluate_drafts([TrailPlan(trails)])[0].tobytes() == row.tobytes()


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


def there_and_back(survival, robots):
    """A mission of one node, which every robot visits."""
    mission = mission_of([(0, 1, survival), (1, 0, survival)], [0, 3], robots=robots)
    return mission, TrailPlan([[0, 1, 0]] * robots)


# Of two rewards one is lost beside the other in outcomes of both.
LARGE_AND_SMALL = mission_of([(0, 2, 0.1), (2, 1, 0.5), (1, 0, 1.0)], [0, 1e-14, 1], robots=1)


@examples(300)
@given(missions_with_plans(max_nodes=5, max_robots=4, survivals=all_survivals))
@example(there_and_back(1e-300, robots=4))
@example(there_and_back(1e-14, robots=3))
@example(there_and_back(1.0 - 1e-15, robots=3))
@example((LARGE_AND_SMALL, TrailPlan([[0, 2, 1, 0]])))
def test_small_chances_keep_their_digits(drawn):
    """Against fractions, which do not round: the error is relative, whatever the survivals."""
    mission, plan = drawn
    exact = twins.exact_figures(mission, mission.labels(plan))
    roundings = len(plan.nodes) + len(mission.nodes) + 4 * plan.n_robots
    distributions = plan_outcomes(mission, plan, max_outcomes=10**6)
    means = [distributions.reward.mean, distributions.survivors.mean]
    floor = roundings * 5e-324 * max(1.0, mission.total_reward)  # products that underflow
    for pair in (mission.evaluate([plan])[0], means):
        for value, expected in zip(pair, exact, strict=True):
            error = abs(Fraction(float(value)) - expected)
            assert error <= Fraction(roundings * ULP) * expected + Fraction(floor)


@pytest.mark.parametrize(
    ("trails", "message"),
    [
        ([[0, 3, 0], [0]], "Robot 0, position 1: arc 1 -> 4 is missing"),
        ([[0], [0, 2, 0, 2, 0]], "Robot 1, position 3: arc 1 -> 3 is used twice"),
        ([[0, 2], [0]], "Robot 0, position 1: expected the trail to end at base 1, got 3"),
        ([[0], [2, 0]], "Robot 1, position 0: expected the trail to begin at base 1, got 3"),
        ([[0, 2, 17, 0], [0]], "Robot 0, position 2: node index 17 is unknown"),
        ([[0], [99]], "Robot 1, position 0: node index 99 is unknown"),
    ],
)
def test_faults_name_the_plan_the_robot_the_position_and_the_arc(trails, message):
    home, plan = TOY.stay_home(), TrailPlan(trails)
    for batch, said in (
        ([plan], message),
        ([home, home, plan, home], message.replace("Robot", "Plan 2, robot")),
    ):
        with pytest.raises(PlanError, match=said):
            TOY.evaluate(batch)


def changed_later(offset):
    batch = PlanBatch(np.zeros(2, np.int32), np.array([0, 1, 2]), 2)
    batch.arrays[1][1] = offset
    return batch


@pytest.mark.parametrize(
    ("batch", "message"),
    [
        (PlanBatch([0], [0, 1, 1], 2), "Robot 1: expected a trail of at least one node"),
        (PlanBatch([0, -1, 0, 0], [0, 3, 4], 2), "position 1: node index -1 is unknown"),
        ([TrailPlan([[0]])], "2 robots"),
        (PlanBatch(np.zeros(3, np.int32), np.arange(4), 3), "Plan 0: expected 2 trails, got 3"),
        (changed_later(10**10), "expected"),
        (changed_later(-5), "expected"),
    ],
)
def test_batches_that_are_refused(batch, message):
    with pytest.raises(PlanError, match=message):
        TOY.evaluate(batch)


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
