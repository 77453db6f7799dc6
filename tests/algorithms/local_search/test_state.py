"""What a search works with: stored trails, plans laid out and inserted, cheapest paths."""

from math import log

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Mission, load_mission
from botohe_moo.algorithms.local_search.kernels import plans, state
from botohe_moo.algorithms.local_search.kernels.state import (
    FAR,
    N_CHILDREN,
    N_TRAILS,
    NOT_STORED,
    TOLERANCE,
    UNKNOWN,
)
from botohe_moo.core.world import aboard_at, aboard_of
from tests import twins
from tests.algorithms.local_search.made import check_clean, unstarted, write_child
from tests.core.test_paths import whole_graph
from tests.examples import examples
from tests.strategies import (
    missions,
    missions_with_plans,
    team_missions,
    team_missions_with_plans,
)
from tests.twins import plain_local_search


@pytest.fixture(autouse=True)
def plain():
    with plain_local_search():
        yield


def fork():
    """The base, node 1 with a reward, and node 2 without any."""
    graph = nx.DiGraph(robots=1)
    graph.add_nodes_from((node, {"reward": reward}) for node, reward in enumerate([7.0, 2.0, 0.0]))
    for node, survival, length in ((1, 0.5, 2.0), (2, 0.8, 1.0)):
        for arc in ((0, node), (node, 0)):
            graph.add_edge(*arc, survival=survival, length=length)
    return Mission(graph, base=0)


@pytest.mark.parametrize("robots", [1, N_TRAILS, N_TRAILS + 7])
def test_there_is_room_for_what_one_parent_needs(robots):
    """Of plans, trails, arcs and visits; for a team that is large, a whole new plan is more."""
    search = unstarted(fork().with_robots(robots))
    n_trails = max(N_TRAILS, robots + 1)
    least = n_trails, n_trails * 4, n_trails * 3  # of a mission of 4 arcs and 3 nodes
    search._front.n.spare = N_CHILDREN + 1
    search._store = state.new_store(*least)
    assert state.has_room(search.parts)
    for i in range(3):
        search._store = state.new_store(*(n - (i == j) for j, n in enumerate(least)))
        assert not state.has_room(search.parts)
    search._store = state.new_store(*least)
    search._front.n.spare -= 1
    assert not state.has_room(search.parts)
    search._front.n.spare += 1
    search._store.n.visits = 1
    assert not state.has_room(search.parts)


def distances_to(mission, goal):
    """Cost of the safest path from each node from which there is one."""
    backwards = whole_graph(mission).reverse()
    return nx.single_source_dijkstra_path_length(backwards, goal, weight="cost")


def find_routes(world, per_length=0.0):
    return state.find_routes(world, np.full(world.graph.n_nodes, per_length))


def assert_routes(mission, routes, goal, n_known):
    """Whether a row leads to its goal, as safely as possible, from the nodes nearest to it."""
    graph, safest = mission.world.graph, distances_to(mission, goal)
    assert routes.n_known[goal] == n_known
    entries = [state.route_entry(routes, goal, node) for node in range(graph.n_nodes)]
    known = {node: entry for node, entry in enumerate(entries) if entry != UNKNOWN}
    assert len(known) == min(n_known, len(safest))
    farthest = max(safest[node] for node in known)
    assert all(safest[node] >= farthest - 1e-9 for node in safest.keys() - known.keys())
    for node, entry in known.items():
        assert routes.entries[goal, entry].cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)
        cost, here = 0.0, node
        while here != goal:
            arc = routes.entries[goal, entry].arc
            assert graph.tail[arc] == here
            cost -= log(graph.survival[arc])
            here, entry = graph.head[arc], routes.entries[goal, entry].onward
            assert routes.entries[goal, entry].source == here
        assert routes.entries[goal, entry].arc == -1
        assert cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)


@examples(60)
@given(missions(min_nodes=1, max_nodes=9) | team_missions())
def test_rows_hold_the_safest_paths_from_all_nodes(mission):
    routes = find_routes(mission.world)
    for goal in range(mission.world.graph.n_nodes):
        assert_routes(mission, routes, goal, mission.world.graph.n_nodes)


@examples(60)
@given(missions(min_nodes=4, max_nodes=9), st.integers(1, 4))
def test_on_larger_missions_rows_are_truncated(mission, near):
    graph = mission.world.graph
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(state, "FULL_UP_TO", 3)
        patch.setattr(state, "NEAR", near)
        routes = find_routes(mission.world)
    assert routes.entries.shape == (graph.n_nodes, near)
    assert routes.leaving.size == 0
    for goal in range(graph.n_nodes):
        assert_routes(mission, routes, goal, near)


def ways(graph, source, target, limit):
    """Lengths of all simple paths that cost at most so much."""
    if source == target:
        return [0.0]
    found = nx.all_simple_edge_paths(graph, source, target)
    labelled = [[graph.edges[arc] for arc in path] for path in found]
    return [
        sum(arc["length"] for arc in path)
        for path in labelled
        if sum(arc["cost"] for arc in path) <= limit
    ]


@examples(60)
@given(
    missions(min_nodes=1, max_nodes=6) | team_missions(max_nodes=4),
    st.sampled_from([None, None, 0.2, 1.0, 30.0]),
)
def test_costs_and_lengths_of_the_cheapest_paths_there_and_back(mission, per_length):
    """Without a travel budget lengths cost nothing, and are not known."""
    world = mission.world.with_limits(mission.limits()._replace(has_budgets=per_length is not None))
    price, graph = per_length or 0.0, whole_graph(mission)
    for _, _, arc in graph.edges(data=True):
        arc["cost"] += price * arc["length"]
    priced = world.with_costs(world.graph.cost + price * world.graph.length)
    routes, n_nodes = find_routes(priced, price), world.graph.n_nodes
    assert routes.prices_length == (per_length is not None)
    costs = dict(nx.all_pairs_dijkstra_path_length(graph, weight="cost"))
    for node in range(n_nodes):
        for other in range(n_nodes):
            for there, found, lengths in (
                ((node, other), routes.leaving, routes.leaving_length),
                ((other, node), routes.coming, routes.coming_length),
            ):
                least = costs[there[0]].get(there[1], FAR)
                assert found[node, other] == pytest.approx(least, rel=1e-12, abs=1e-12)
                if per_length is None:
                    assert lengths.size == 0
                elif least < FAR:
                    possible = ways(graph, *there, least * (1 + 1e-9) + 1e-9)
                    length = pytest.approx(lengths[node, other], rel=1e-9, abs=1e-9)
                    assert any(way == length for way in possible)


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
