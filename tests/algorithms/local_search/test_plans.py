"""Plans of the front: laid out, evaluated, and inserted."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search.kernels import plans
from botohe_moo.algorithms.local_search.kernels.state import NOT_STORED, TOLERANCE
from botohe_moo.core.world import aboard_at, aboard_of
from tests import twins
from tests.algorithms.local_search.made import check_clean, unstarted, write_child
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.twins import plain_local_search


@pytest.fixture(autouse=True)
def plain():
    with plain_local_search():
        yield


def add(search, nodes, robot=0):
    return plans.add_trail(search.parts, robot, write_child(search, nodes))


class Laid:
    """What the search notes of each position of a trail, straight from the formulas."""

    def __init__(self, mission, kind, nodes):
        self.mission, self.kind = mission, kind
        self.trail = [mission.nodes[node % len(mission.nodes)] for node in nodes]
        self.reward = dict(mission.graph.nodes(data="reward"))

    def brings(self, trail, aboard):
        """What a robot brings that carries some rewards; of those aboard no other counts."""
        chances = twins.collects(self.mission, self.kind, trail, aboard)
        # The reward of its start counts as collected there, whether it is aboard or not.
        taken = set(self.kind.aboard) - {*aboard, self.trail[0]}
        return sum(self.reward[node] * p for node, p in chances.items() if node not in taken)

    def at(self, i):
        """What lies ahead, what is banked and what is carried, and the chance to bring that."""
        before, after = self.trail[: i + 1], self.trail[i + 1 :]
        alive = twins.alive_along(self.mission, self.kind, self.trail)
        ahead = alive[i + 1] / alive[i] * self.brings(after, ()) if after else 0.0
        banked = dict(twins.credited(self.mission, before, self.kind.aboard))
        nodes = self.mission.graph.nodes
        carried = sum(
            self.reward[v] * twins.share_of(self.mission, self.kind, v)
            for v in {*before, *self.kind.aboard} - set(banked)
        )
        depots = [j for j, v in enumerate(self.trail) if v == 0 or nodes[v].get("depot")]
        to_depot = next((alive[j] / alive[i] for j in depots if j > i), 0.0)
        return [ahead, self.brings(before, self.kind.aboard), carried, to_depot]


@examples(120)
@given(missions_with_plans(max_robots=2) | team_missions_with_plans())
def test_what_lies_ahead(case):
    """What a robot with empty hands would collect that is sure to be at each position.

    And what it has collected and carries there, and the chance to bring that to a depot. What it
    carries from the start is worth nothing on the way.
    """
    mission, plan = case
    search = unstarted(mission, max_length=np.inf)
    world, store, work = search.world, search._store, search._work
    returns = world.returns
    for robot, nodes in enumerate(plan.trails):
        trail, work.draft.robot = add(search, nodes, robot), robot
        if trail == NOT_STORED:  # it does not keep the limits of its kind
            continue
        work.draft.layer = world.team.start[robot] - world.team.origin[world.team.start[robot]]
        work.draft.carried = 0.0
        plans._load(world, work)
        plans.lay_out(world, returns, store, work, trail)
        laid_out = Laid(mission, mission.kind_of[robot], nodes)
        for i, step in enumerate(work.steps[: len(nodes)]):
            found = [step.ahead, step.gained]
            if returns is not None:
                found += [work.loads[i].carried, work.loads[i].to_depot]
            expected = laid_out.at(i)[: len(found)]
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-14)
            assert step.node == nodes[i]
            assert step.alive == pytest.approx(twins.survival_of(mission, nodes[: i + 1]))
            assert step.walked == pytest.approx(twins.length_of(mission, nodes[: i + 1]))
        first, stop = aboard_of(returns, robot)
        aboard = [aboard_at(returns, work.draft.layer, i) for i in range(first, stop)]
        assert not work.nodes["marginal"][aboard].any()
        assert {v: int(work.nodes[v].met) for v in nodes} == {v: nodes.index(v) for v in nodes}
        plans.clear_trail(work)
        plans.clear_others(world, work)
    check_clean(search)


@examples(120)
@given(missions_with_plans(max_robots=4) | team_missions_with_plans(max_robots=3), st.data())
def test_marginal_rewards_are_what_the_others_leave(case, data):
    """To the robot that changes, or the robots of its kind that do."""
    mission, plan = case
    search = unstarted(mission, max_length=np.inf)
    work, n_nodes = search._work, len(mission.nodes)
    work.parent[:] = [add(search, nodes, robot) for robot, nodes in enumerate(plan.trails)]
    assume(NOT_STORED not in work.parent)
    robot = data.draw(st.integers(0, mission.robots - 1))
    kind = mission.kind_of[robot]
    alike = [k for k, other in enumerate(mission.kind_of) if other is kind and k != robot]
    chosen = [robot, *data.draw(st.lists(st.sampled_from(alike or [robot]), unique=True))]
    chosen = list(dict.fromkeys(chosen))
    work.draft.robot, work.draft.n_chosen, work.chosen[: len(chosen)] = robot, len(chosen), chosen
    plans.evaluate_others(search.world, search._store, work)
    others = [k for k in range(mission.robots) if k not in chosen]
    labels = mission.labels(plan)
    chances = [twins.collects(mission, mission.kind_of[k], labels[k]) for k in others]
    trails, kinds = [labels[k] for k in others], [mission.kind_of[k] for k in others]
    reward, survivors = twins.evaluate(mission, trails, kinds) if others else (0.0, 0.0)
    assert work.draft.others == pytest.approx(reward)
    assert work.draft.survivors == pytest.approx(survivors)
    layer = n_nodes * mission.kinds.index(kind)
    # The reward of its start counts as collected there, whether it is aboard or not.
    carried = set(kind.aboard) - {labels[robot][0]}
    for v, label in enumerate(mission.nodes):
        left = np.prod([1 - chance.get(label, 0.0) for chance in chances])
        expected = search.world.graph.reward[layer + v] * left * (label not in carried)
        assert work.nodes[layer + v].marginal == pytest.approx(expected)
    plans.clear_others(search.world, work)
    check_clean(search)


@examples(200)
@given(missions_with_plans(min_nodes=1, max_robots=5) | team_missions_with_plans(), st.randoms())
def test_objectives_have_the_bits_of_evaluate(case, random):
    mission, plan = case
    search = unstarted(mission, max_length=np.inf)
    robots, nodes = list(range(mission.robots)), plan.trails
    random.shuffle(robots)
    stored = {robot: add(search, nodes[robot], robot) for robot in robots}
    assume(NOT_STORED not in stored.values())
    search._work.trails[:] = [stored[robot] for robot in sorted(robots, key=nodes.__getitem__)]
    for _ in range(2):
        objectives = plans.evaluate_trails(search.world, search._store, search._work)
        assert list(objectives) == mission.evaluate([plan])[0].tolist()


@pytest.mark.parametrize(
    ("more_reward", "more_survivors", "tolerance", "enters"),
    [
        (1e-13, 0.0, TOLERANCE, False),
        (0.0, 1e-13, TOLERANCE, False),
        (1e-13, 0.0, 0.0, True),
        (0.0, 1e-13, 0.0, True),
        (1e-11, 0.0, TOLERANCE, True),
        (0.0, 1e-11, TOLERANCE, True),
        (-1e-11, 1e-11, TOLERANCE, True),
    ],
)
def test_what_is_better_by_rounding_alone(more_reward, more_survivors, tolerance, enters):
    """A plan that enters takes the place of one that is better by rounding."""
    search = unstarted(load_mission("toy"))
    trails, store, front = np.array([add(search, (0,))] * 2), search._store, search._front
    assert plans._insert(store, front, trails, 3.0, 2.0, tolerance)
    reward, survivors = 3.0 * (1 + more_reward), 2.0 * (1 + more_survivors)
    assert plans._insert(store, front, trails, reward, survivors, tolerance) == enters
    assert len(search) == 1 + (more_reward < 0)
    assert store.trails[trails[0]].n_users == 1 + 2 * len(search)
