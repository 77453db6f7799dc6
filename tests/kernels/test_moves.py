"""Moves of trails: every outcome with the probability of a readable twin, and never a fault."""

from collections import Counter, defaultdict
from itertools import pairwise, product
from math import log

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo.core.compile import kernel
from botohe_moo.core.graph import NO_LIMITS, Limits
from botohe_moo.core.rng import seed_states
from botohe_moo.core.trails import read_trails
from botohe_moo.mission import Kind, Mission, load_mission
from botohe_moo.operators.kernels import moves
from botohe_moo.operators.kernels.change import MoveRule, _take_detour, change_plans
from botohe_moo.operators.kernels.moves import DETOUR, mark_trail, move_trail, new_move_scratch
from botohe_moo.trails import PlanBatch
from tests import twins
from tests.examples import examples
from tests.strategies import (
    lengths,
    missions_with_plans,
    plans,
    small_missions,
    team_missions,
    team_missions_with_plans,
)

KINDS = {
    "insert": moves.INSERT,
    "delete": moves.DELETE,
    "substitute": moves.SUBSTITUTE,
    "swap": moves.SWAP,
    "grab": moves.GRAB,
    "delete segment": moves.DELETE_SEGMENT,
    "reverse": moves.REVERSE,
    "delete loop": moves.DELETE_LOOP,
    "detour": moves.DETOUR,
}
PUBLISHED = np.array([1, 1, 1, 1, 1, 1, 0.1])


class Moves:
    """Every outcome of a move, one rule a line; None stands for a move that cannot be made.

    Trails are those of a robot, of indices of kernels.
    """

    def __init__(self, mission, robot=0):
        self.repairer = twins.Repairer(mission, robot)
        self.arcs, self.nodes = set(self.repairer.arcs), self.repairer.nodes
        self.start, self.end = twins.ends_of(mission, robot)

    def is_trail(self, trail):
        hops = list(pairwise(trail))
        ends = trail[0] == self.start and trail[-1] == self.end
        return ends and set(hops) <= self.arcs and len(set(hops)) == len(hops)

    def evenly(self, outcomes):
        """Each of the outcomes is equally likely, those that are no trails not among them."""
        possible = [trail for trail in outcomes if self.is_trail(trail)]
        return possible or [None]

    def at_positions(self, positions, outcomes):
        """A position is drawn, then one of the outcomes possible there."""
        chances = defaultdict(float)
        for position in positions:
            possible = self.evenly(outcomes(position))
            for trail in possible:
                chances[trail] += 1 / len(positions) / len(possible)
        return dict(chances) or {None: 1.0}

    def outcomes(self, kind, trail):
        last = len(trail) - 1
        inner = range(1, last)
        others = [node for node in self.nodes if node != self.end]
        pairs = [(i, j) for i in inner for j in inner if i < j]
        match kind:
            case "insert":
                return self.at_positions(
                    range(last + 1),
                    lambda i: [
                        (*trail[: i + 1], v, *(trail[i + 1 :] or (self.end,))) for v in others
                    ],
                )
            case "delete":
                return self.at_positions(
                    inner,
                    lambda i: [
                        trail[:i] + trail[i + 2 :]
                        if trail[i - 1] == trail[i + 1]
                        else trail[:i] + trail[i + 1 :]
                    ],
                )
            case "substitute":
                return self.at_positions(
                    inner,
                    lambda i: [(*trail[:i], v, *trail[i + 1 :]) for v in others if v != trail[i]],
                )
            case "swap":
                return self.at_positions(
                    pairs, lambda p: [swapped(trail, *p)] if trail[p[0]] != trail[p[1]] else []
                )
            case "grab":
                return self.at_positions(
                    range(max(1, last)),
                    lambda i: [(*trail[: i + 1], v, trail[i], *trail[i + 1 :]) for v in others],
                )
            case "delete segment":
                return self.at_positions(pairs, lambda p: [trail[: p[0]] + trail[p[1] + 1 :]])
            case "reverse":
                return self.at_positions([0] if inner else [], lambda _: [trail[::-1]])
            case "detour":
                return self.detours(trail)
            case "delete loop":
                return self.at_positions(
                    range(last + 1) if inner else [],
                    lambda i: [
                        trail[: min(i, j)] + trail[max(i, j) :]
                        for j in range(last + 1)
                        if j != i and trail[i] == trail[j]
                    ],
                )

    def detour(self, trail, start, stop, via):
        """Another way between two positions, or None where there is none."""
        free = self.repairer.free(trail[: start + 1])
        free.remove_edges_from(pairwise(trail[stop:]))
        way = [trail[start]]
        if via not in (self.end, trail[start], trail[stop]):
            way = self.by_arc(free, trail[start], via) or self.safest(free, trail[start], via)
            free.remove_edges_from(list(pairwise(way or [])))
        back = self.safest(free, way[-1], trail[stop]) if way else None
        if not back or (*way, *back[1:]) == trail[start : stop + 1]:
            return None
        return (*trail[:start], *way, *back[1:], *trail[stop + 1 :])

    def by_arc(self, free, tail, head):
        return [tail, head] if free.has_edge(tail, head) else None

    def safest(self, free, source, target):
        if not nx.has_path(free, source, target):
            return None
        return nx.dijkstra_path(free, source, target, weight="cost")

    def detours(self, trail):
        """Short spans are drawn as often as long ones: evenly in their logarithms."""
        chances, n = defaultdict(float), len(trail)
        for start, via in product(range(n), self.nodes):
            room = n - start
            for span in range(room):
                chance = log((span + 2) / (span + 1)) / log(room + 1)
                outcome = self.detour(trail, start, start + span, via)
                chances[outcome] += chance / n / len(self.nodes)
        return dict(chances)

    def drawn(self, weights, trail):
        """Outcomes of drawing kinds until a move can be made; empty where none ever can."""
        chances = defaultdict(float)
        for kind, weight in zip(KINDS, weights, strict=False):
            for outcome, chance in self.outcomes(kind, trail).items():
                chances[outcome] += weight * chance
        chances.pop(None, None)
        total = sum(chances.values())
        return {outcome: chance / total for outcome, chance in chances.items()}


def swapped(trail, i, j):
    changed = list(trail)
    changed[i], changed[j] = changed[j], changed[i]
    return tuple(changed)


def crossroads():
    """Both ways but for two arcs; trails may pass nodes, and the base, several times."""
    graph = nx.DiGraph(base=0, robots=2)
    graph.add_nodes_from(range(5), reward=1.0)
    both = [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (3, 4)]
    graph.add_edges_from([*both, *((v, u) for u, v in both), (4, 1), (0, 4)])
    for i, arc in enumerate(graph.edges):
        graph.edges[arc]["survival"] = 0.99 - 0.03 * i
    return Mission(graph)


TRAILS = [
    (0,),
    (0, 1, 0),
    (0, 1, 2, 0),
    (0, 4, 1, 0),
    (0, 1, 3, 2, 0),
    (0, 1, 0, 2, 0),
    (0, 2, 3, 4, 3, 1, 0),
    (0, 1, 2, 1, 3, 4, 1, 0, 2, 3, 2, 0),
    (0, 4, 3, 2, 1, 3, 1, 2, 0),
]


def buffer(mission, trail):
    nodes = np.full(mission.arrays.n_arcs + 1, -7)
    nodes[: len(trail)] = trail
    return nodes


def agree(counted, expected, n_times):
    assert set(counted) <= set(expected)
    for outcome, chance in expected.items():
        spread = abs(n_times * chance * (1 - chance)) ** 0.5
        assert abs(counted[outcome] - n_times * chance) <= 5 * spread + 3, outcome


@kernel
def move(graph, scratch, nodes, length, kind, states):
    if kind == DETOUR:
        return _take_detour(graph, scratch, nodes, length, states)
    return move_trail(graph, scratch, nodes, length, kind, states)


def crossroads_of_kinds():
    """The same for a rover, which goes from 0 to 3, and must not go from 1 to 2."""
    graph = crossroads().graph.copy()
    for arc, attributes in graph.edges.items():
        attributes["survival"] = {"drone": 0.5, "rover": attributes["survival"] * (arc != (1, 2))}
    return Mission(graph, base=0, kinds=[Kind("drone", 1), Kind("rover", 1, end=3)])


# Behind the nodes of the drone.
ROVERS = [(5, 6, 8), (5, 7, 8, 6, 8), (5, 7, 6, 5, 9, 8), (5, 9, 8, 7, 5, 6, 8)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("robot", "trails"), [(0, TRAILS), (1, ROVERS)])
def test_one_move_has_the_outcomes_of_the_twin(kind, robot, trails):
    mission = crossroads_of_kinds() if robot else crossroads()
    graph, n_times = mission.arrays, 3_000
    states = seed_states(np.random.default_rng(1), 1)
    scratch = new_move_scratch(graph)
    makeable = 0
    for trail in trails:
        expected = Moves(mission, robot).outcomes(kind, trail)
        assert sum(expected.values()) == pytest.approx(1)
        makeable += set(expected) != {None}
        counted = Counter()
        mark_trail(graph, scratch, buffer(mission, trail), len(trail))
        marked = scratch.used == scratch.mark
        assert marked.sum() == len(trail) - 1
        for _ in range(n_times):
            nodes = buffer(mission, trail)
            length = move(graph, scratch, nodes, len(trail), KINDS[kind], states)
            if length == moves.CANNOT:
                assert nodes.tolist() == buffer(mission, trail).tolist()
            counted[None if length == moves.CANNOT else tuple(nodes[:length].tolist())] += 1
        assert np.array_equal(scratch.used == scratch.mark, marked)
        agree(counted, expected, n_times)
    assert makeable >= (0 if robot and kind == "reverse" else 2)


@pytest.mark.slow
@pytest.mark.parametrize("weights", [PUBLISHED, np.array([1, 0, 0.5, 2, 1, 1, 0, 3.0])])
@pytest.mark.parametrize("trail", TRAILS)
def test_moves_are_drawn_again_until_one_can_be_made(trail, weights):
    mission = crossroads()
    n_times = 3_000
    batch = PlanBatch(np.tile(np.int32(trail), n_times), np.arange(n_times + 1) * len(trail), 1)
    changed = PlanBatch(*change(mission, batch, weights=weights), 1)
    counted = Counter(plan.trails[0] for plan in changed)
    agree(counted, Moves(mission).drawn(weights, trail), n_times)


def change(
    mission, batch, *, weights=PUBLISHED, every_robot=True, limits=NO_LIMITS, seed=0, tries=1_000
):
    states = seed_states(np.random.default_rng(seed), 1)
    rule, given = MoveRule(weights, tries, every_robot, limits), read_trails(*batch.arrays)
    before = [array.copy() for array in batch.arrays]
    changed = change_plans(mission.arrays, rule, given, batch.n_robots, states)
    assert all(map(np.array_equal, batch.arrays, before))
    return changed


@examples(150)
@given(
    missions_with_plans(max_nodes=8, one_way=True) | team_missions_with_plans(),
    st.booleans(),
    st.integers(0, 2**31),
)
def test_trails_stay_trails_on_one_way_missions(mission_and_plan, every_robot, seed):
    mission, plan = mission_and_plan
    batch = mission.batch([plan] * 20)
    weights = np.ones(moves.N_KINDS)
    for i in range(5):
        batch = PlanBatch(
            *change(
                mission, batch, weights=weights, every_robot=every_robot, seed=seed + i, tries=20
            ),
            mission.robots,
        )
        mission.evaluate(batch)  # raises PlanError for any trail that is not valid


@examples(60)
@given(missions_with_plans(max_nodes=7, lengths=lengths), st.booleans(), st.booleans(), st.data())
def test_no_move_leaves_the_limits(mission_and_plan, floor, budget, data):
    mission, plan = mission_and_plan
    other = mission.plan(data.draw(plans(mission)))
    batch = mission.batch([plan, other] * 10)
    least = float(mission.robot_survival(batch).min()) if floor else 0.0
    longest = float(mission.trail_lengths(batch).max()) if budget else np.inf
    for seed in range(3):
        changed = change(mission, batch, limits=Limits(least, longest), seed=seed, tries=20)
        batch = PlanBatch(*changed, mission.robots)
        assert (mission.robot_survival(batch) >= least).all()
        assert (mission.trail_lengths(batch) <= longest).all()


@examples(100)
@given(team_missions(lengths=lengths), st.integers(0, 2**31))
def test_no_move_leaves_the_limits_of_a_kind(mission, seed):
    limits = mission.limits()
    batch = mission.batch([mission.stay_home(limits)] * 30)
    least, longest = np.transpose(
        [(k.min_survival, k.max_length or np.inf) for k in mission.kind_of]
    )
    assume((mission.robot_survival(batch) >= least).all())  # no way that compromises
    for _ in range(3):
        batch = PlanBatch(
            *change(mission, batch, limits=limits, seed=seed, tries=20), mission.robots
        )
        mission.evaluate(batch)
        assert (mission.robot_survival(batch) >= least).all()
        assert (mission.trail_lengths(batch) <= longest).all()


def test_the_limits_bind_and_leave_room():
    mission = load_mission("art_museum")
    batch = mission.batch([mission.plan([[1]] * 3)] * 200)
    for seed in range(30):
        free = PlanBatch(*change(mission, batch, seed=seed), 3)
        batch = PlanBatch(*change(mission, batch, limits=Limits(0.5, 8.0), seed=seed), 3)
    assert mission.robot_survival(free).min() < 0.5
    assert mission.trail_lengths(free).max() > 8
    assert 0.5 <= mission.robot_survival(batch).min() < 0.6
    assert max(len(trail) for plan in batch for trail in plan.trails) > 5


@pytest.mark.parametrize("every_robot", [False, True])
def test_one_robot_drawn_uniformly_or_every_robot(every_robot):
    mission = load_mission("art_museum").with_robots(4)
    plan = mission.plan([[1, 2, 8, 2, 1], [1], [1, 2, 1], [1, 2, 3, 2, 1]])
    batch = mission.batch([plan] * 4_000)
    weights = np.array([0, 0, 0, 0, 1, 0, 0.0])  # every one of these trails can grab
    changed = PlanBatch(*change(mission, batch, weights=weights, every_robot=every_robot), 4)
    differs = np.array(
        [
            [now != before for now, before in zip(new.trails, plan.trails, strict=True)]
            for new in changed
        ]
    )
    if every_robot:
        assert differs.all()
    else:
        assert (differs.sum(axis=1) == 1).all()
        assert np.abs(differs.mean(axis=0) - 0.25).max() < 5 * (0.25 * 0.75 / 4_000) ** 0.5


def round_trip():
    """A cycle of one-way arcs, which only detours leave the base for."""
    graph = nx.DiGraph(base=0, robots=2)
    graph.add_nodes_from(range(3), reward=1.0)
    nx.add_cycle(graph, range(3), survival=0.9)
    return Mission(graph)


def test_where_no_move_drawn_can_be_made_there_are_detours():
    mission = round_trip()
    assert Moves(mission).drawn(PUBLISHED, (0,)) == {}
    batch = mission.batch([mission.plan([[0], [0]])] * 50)
    out = PlanBatch(*change(mission, batch), 2)
    assert {trail for plan in out for trail in plan.trails} == {(0, 1, 2, 0)}
    back = PlanBatch(*change(mission, out), 2)
    assert {trail for plan in back for trail in plan.trails} == {(0, 1, 2, 0), (0,)}


def test_a_trail_that_no_move_can_change_stays():
    mission = round_trip()
    batch = mission.batch([mission.plan([[0], [0]])])
    nodes, offsets = change(mission, batch, limits=Limits(0.73))  # one round survives with 0.729
    assert nodes.tolist() == [0, 0]
    assert offsets.tolist() == [0, 1, 2]


@examples(60)
@given(small_missions(max_trails=30, one_way=True))
def test_moves_lead_from_every_trail_to_every_other(drawn):
    """With detours; by the twin, whose outcomes are the kernel's."""
    mission, trails = drawn
    found, fresh = {(0,)}, [(0,)]
    twin = Moves(mission)
    weights = np.ones(moves.N_KINDS)
    while fresh:
        following = set(twin.drawn(weights, fresh.pop())) - found
        found |= following
        fresh += following
    assert found == {tuple(trail) for trail in trails}
    for trail in found:
        home = {trail}
        while (0,) not in home:
            larger = home.union(*(twin.drawn(weights, one) for one in home))
            assert larger != home
            home = larger


def test_no_plans():
    mission = load_mission("toy")
    nodes, offsets = change(mission, mission.batch([]))
    assert nodes.tolist() == []
    assert offsets.tolist() == [0]
