"""What a search works with: stored trails, plans laid out and inserted, cheapest paths."""

from math import log

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search.kernels import plans, state
from botohe_moo.algorithms.local_search.kernels.state import N_CHILDREN, N_TRAILS, NOT_STORED
from tests import twins
from tests.algorithms.local_search.made import check_clean, unstarted, write_child
from tests.core.test_paths import best_ways, whole_graph
from tests.examples import examples
from tests.strategies import (
    mission_of,
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


@pytest.mark.parametrize("robots", [1, N_TRAILS, N_TRAILS + 7])
def test_there_is_room_for_what_one_parent_needs(robots):
    """Of plans, trails, arcs and visits; for a team that is large, a whole new plan is more."""
    mission = mission_of([(0, 1, 0.5), (0, 2, 0.8)], [7, 2, 0], both_ways=True, robots=robots)
    search, n_trails = unstarted(mission), max(N_TRAILS, robots + 1)

    def has_room(plans=0, trails=0, arcs=0, visits=0, stored=0):
        """Return whether the search has room, with this much less than it needs."""
        search._front.n.spare = N_CHILDREN + 1 - plans
        n_arcs, n_visits = 4 * n_trails - arcs, 3 * n_trails - visits
        search._store = state.new_store(n_trails - trails, n_arcs, n_visits)
        search._store.n.visits = stored
        return state.has_room(search.parts)

    assert has_room()
    for less in ("plans", "trails", "arcs", "visits", "stored"):
        assert not has_room(**{less: 1})


def find_routes(world, per_length=0.0):
    return state.find_routes([world], np.full(world.graph.n_nodes, per_length))


def assert_routes(mission, routes, goal, near=None):
    """Whether a row leads to its goal, as safely as possible, from the nodes nearest to it."""
    graph, backwards = mission.world.graph, whole_graph(mission).reverse()
    safest = nx.single_source_dijkstra_path_length(backwards, goal, weight="cost")
    n_known = graph.n_nodes if near is None else min(near, len(safest))
    assert routes.n_known[goal] == n_known
    entries = [state.route_entry(routes, goal, node) for node in range(graph.n_nodes)]
    row = routes.entries[goal]
    known = {node: entry for node, entry in enumerate(entries) if entry != state.UNKNOWN}
    assert len(known) == min(n_known, len(safest))
    farthest = max(safest[node] for node in known)
    assert all(safest[node] >= farthest - 1e-9 for node in safest.keys() - known.keys())
    for node, entry in known.items():
        assert row[entry].cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)
        cost, here = 0.0, node
        while here != goal:
            arc = row[entry].arc
            assert graph.tail[arc] == here
            cost -= log(graph.mean_survival[arc])
            here, entry = graph.head[arc], row[entry].onward
            assert row[entry].source == here
        assert row[entry].arc == -1
        assert cost == pytest.approx(safest[node], rel=1e-12, abs=1e-12)


@examples(120)
@given(missions(min_nodes=4, max_nodes=9) | team_missions(), st.integers(1, 4), st.booleans())
def test_rows_hold_the_safest_paths_and_on_larger_missions_those_from_near_nodes(
    mission, near, is_larger
):
    n_nodes = mission.world.graph.n_nodes
    near = min(near, n_nodes)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(state, "FULL_UP_TO", 0 if is_larger else 1_000)
        patch.setattr(state, "NEAR", near)
        routes = find_routes(mission.world)
    n_most = near if is_larger else n_nodes
    assert (routes.entries.shape, routes.leaving.size == 0) == ((n_nodes, n_most), is_larger)
    for goal in range(n_nodes):
        assert_routes(mission, routes, goal, near if is_larger and near < n_nodes else None)


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
                least = costs[there[0]].get(there[1], state.FAR)
                assert found[node, other] == pytest.approx(least, rel=1e-12, abs=1e-12)
                if per_length is None:
                    assert lengths.size == 0
                elif least < state.FAR:
                    ways = best_ways(graph, *there, "cost")
                    possible = [nx.path_weight(graph, way, "length") for way in ways]
                    length = pytest.approx(lengths[node, other], rel=1e-9, abs=1e-9)
                    assert any(each == length for each in possible)


def noted(mission, kind, nodes, i):
    """Return the reward ahead of a position, what is banked and carried there, and the probability
    to bring that to a depot; of the rewards aboard at the start no other counts.
    """
    trail, of = [mission.nodes[node % len(mission.nodes)] for node in nodes], mission.graph.nodes
    alive, before, after = twins.alive_along(mission, kind, trail), trail[: i + 1], trail[i + 1 :]

    def brings(part, aboard):
        # The reward of its start counts as collected there, whether it is aboard or not.
        taken = set(kind.aboard) - {*aboard, trail[0]}
        chances = twins.collects(mission, kind, part, aboard).items()
        return sum(of[v]["reward"] * p for v, p in chances if v not in taken)

    ahead = alive[i + 1] / alive[i] * brings(after, ()) if after else 0.0
    left = {*before, *kind.aboard} - set(dict(twins.credited(mission, before, kind.aboard)))
    carried = sum(of[v]["reward"] * twins.share_of(mission, kind, v) for v in left)
    depots = [j for j, v in enumerate(trail) if j > i and (v == 0 or of[v].get("depot"))]
    to_depot = alive[depots[0]] / alive[i] if depots else 0.0
    return [ahead, brings(before, kind.aboard), carried, to_depot]


@examples(120)
@given(missions_with_plans(max_robots=2) | team_missions_with_plans())
def test_what_lies_ahead(case):
    """To a robot with empty hands that is sure to be at a position of a stored trail."""
    mission, plan = case
    search = unstarted(mission, max_length=np.inf)
    world, work = search.world, search._work
    for robot, nodes in enumerate(plan.trails):
        trail = plans.add_trail(search.parts, robot, write_child(search, nodes))
        if trail == NOT_STORED:  # it does not keep the limits of its kind
            continue
        start, work.draft.robot = world.team.start[robot], robot
        work.draft.layer = start - world.team.origin[start]
        plans._load(world, work)
        plans.lay_out(world, world.returns, search._store, work, trail)
        for i, step in enumerate(work.steps[0, : len(nodes)]):
            found = [step.ahead, step.gained]
            if world.returns is not None:
                found += [work.loads[0, i].carried, work.loads[0, i].to_depot]
            expected = noted(mission, mission.kind_of[robot], nodes, i)[: len(found)]
            assert found == pytest.approx(expected, rel=1e-12, abs=1e-14)
        plans.clear_trail(work, world.graph.n_nodes)
        plans.clear_others(world, work)
    check_clean(search)


@pytest.mark.parametrize("tolerance", [state.TOLERANCE, 0.0])
@pytest.mark.parametrize(
    ("more_reward", "more_survivors"), [(1e-13, 0.0), (0.0, 1e-13), (1e-11, 0.0), (-1e-11, 1e-11)]
)
def test_what_is_better_by_rounding_alone(more_reward, more_survivors, tolerance):
    """A plan that enters takes the place of one that is better by rounding."""
    search, enters = unstarted(load_mission("toy")), max(more_reward, more_survivors) > tolerance
    trails, store, front = (
        np.array([plans.add_trail(search.parts, 0, 0)] * 2),
        search._store,
        search._front,
    )
    assert plans._insert(store, front, trails, 3.0, 2.0, tolerance)
    reward, survivors = 3.0 * (1 + more_reward), 2.0 * (1 + more_survivors)
    assert plans._insert(store, front, trails, reward, survivors, tolerance) == enters
    assert len(search) == 1 + (more_reward < 0)
    assert store.trails[trails[0]].n_users == 1 + 2 * len(search)
