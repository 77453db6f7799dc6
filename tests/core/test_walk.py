"""Walks by hand and against readable twins: what is visited, and with what probability credited."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given

from botohe_moo import Kind, Mission
from botohe_moo.core.walk import new_visits, walk
from botohe_moo.core.world import find_arc
from tests import twins
from tests.examples import examples
from tests.strategies import mission_of, missions_with_plans, team_missions_with_plans


@np.errstate(all="ignore")
def walked(mission, trails, visits=None):
    """For each robot's trail, in indices of kernels: visits in order, survival and length."""
    world, found = mission.world, []
    graph, team = world.graph, world.team
    visits = new_visits(graph.n_nodes, graph.n_scenarios) if visits is None else visits
    for robot, trail in enumerate(trails):
        arcs = np.array([find_arc(graph, *hop) for hop in pairwise(trail)], np.int64)
        n, alive, length = walk(graph, team, world.returns, arcs, len(arcs), robot, visits)
        listed = zip(visits.node[:n].tolist(), visits.chance[:n].tolist(), strict=True)
        found.append(([*listed], alive, length))
    return found


def ring(rewards=(0, 2, 3, 4), *, nodes=(), **options):
    """Nodes 0 to 3 in a ring, there and back; arcs forth survive with 0.5, and are 2 long."""
    forth = [(v, (v + 1) % 4, 0.5, 2.0) for v in range(4)]
    plain = mission_of([*forth, *((v, u, 0.75) for u, v, *_ in forth)], rewards, robots=1)
    graph = plain.graph.copy()
    for v, attributes in dict(nodes).items():
        graph.nodes[v].update(attributes)
    return Mission(graph, base=0, **({"robots": 1} if "kinds" not in options else {}), **options)


def test_on_arrival_the_first_visit_counts_and_the_base_comes_first_where_it_has_a_reward():
    [(visits, alive, length)] = walked(ring(), [(0, 1, 2, 1, 0)])
    assert visits == [(1, 0.5), (2, 0.25)]
    assert (alive, length) == (0.5**2 * 0.75**2, 6.0)
    mission = ring((7, 2, 0, 4)).with_robots(2)
    one, other = walked(mission, [(0, 3, 2, 3, 0), (0,)])
    assert one == ([(0, 1.0), (3, 0.75)], 0.75**2 * 0.5**2, 6.0)  # there is nothing at node 2
    assert other == ([(0, 1.0)], 1.0, 0.0)


def test_what_a_kind_collects_is_its_share():
    kinds, nodes = [Kind("one", 1), Kind("other", 1)], {1: {"share": {"one": 0.25, "other": 0.0}}}
    found = walked(ring(kinds=kinds, nodes=nodes), [(0, 1, 2, 3, 0), (4, 5, 6, 7, 4)])
    # Nodes are those of the mission, and what one cannot collect it does not visit.
    assert found[0] == ([(1, 0.5 * 0.25), (2, 0.25), (3, 0.125)], 0.0625, 8.0)
    assert found[1] == ([(2, 0.25), (3, 0.125)], 0.0625, 8.0)


@pytest.mark.parametrize(
    ("nodes", "trail", "expected"),
    [
        # Node 2 is a depot, where what is there counts at once; at node 3, on arrival.
        ((2, 3), (0, 1, 2, 3, 0), [(1, 0.25), (2, 0.25), (3, 0.125)]),
        # A depot that was passed before does not count: the way back to it does.
        ((2, 3), (0, 3, 2, 1, 2, 3, 0), [(3, 0.75), (2, 0.75**2), (1, 0.75**3 * 0.5)]),
        ((), (0, 1, 2, 1, 0), [(1, 0.5**2 * 0.75**2), (2, 0.5**2 * 0.75**2)]),
    ],
)
def test_on_return_the_next_depot_counts(nodes, trail, expected):
    attributes = {2: {"depot": True}, 3: {"pays": "arrival"}}
    mission = ring(pays="return", nodes={node: attributes[node] for node in nodes})
    assert walked(mission, [trail])[0][0] == expected


def test_what_is_aboard_comes_first_and_what_is_left_at_the_end_is_lost():
    kinds = [Kind("one", 1, start=3, aboard=(1, 2)), Kind("other", 1, end=2)]
    one, other = walked(ring(kinds=kinds, pays="return"), [(3, 2, 1, 0, 1, 0), (4, 5, 6)])
    home = 0.75**3  # what was at nodes 1 and 2 is not collected again on the way
    assert one == ([(1, home), (2, home), (3, home)], home * 0.375, 6.0)
    assert other == ([(1, 0.0), (2, 0.0)], 0.25, 4.0)  # it ends its trail where no depot is
    # Where the start is a depot, it counts at once.
    [(visits, _, _)] = walked(ring(kinds=[Kind("one", 1, aboard=(3,))], pays="return"), [(0, 1, 0)])
    assert visits == [(3, 1.0), (1, 0.375)]


@examples(200)
@given(missions_with_plans() | team_missions_with_plans())
def test_walks_are_their_readable_twin(case):
    mission, plan = case
    visits = new_visits(mission.world.graph.n_nodes, 1)  # one scratch serves all walks
    found = walked(mission, plan.trails, visits)
    assert walked(mission, plan.trails, visits) == found
    assert visits.n_walks == [2 * mission.robots]
    robots = zip(mission.kind_of, mission.labels(plan), found, strict=True)
    for kind, trail, (visited, alive, length) in robots:
        expected = {
            mission.index(node): chance
            for node, chance in twins.collects(mission, kind, trail).items()
            if mission.graph.nodes[node]["reward"] > 0 and chance > 0
        }
        chances = dict(visited)
        assert len(chances) == len(visited)
        assert {v: chance for v, chance in visited if chance > 0} == pytest.approx(expected)
        aboard = [node for node in kind.aboard if node != trail[0]]
        order = [mission.index(node) for node in dict.fromkeys([*aboard, *trail])]
        assert sorted(chances, key=order.index) == list(chances)
        assert alive == pytest.approx(twins.alive_along(mission, kind, trail)[-1])
        assert length == pytest.approx(twins.trail_lengths(mission, [trail])[0])
