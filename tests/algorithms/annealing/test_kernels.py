"""Annealing: moves and searches have the chances of readable twins, and the bits of `evaluate`."""

from collections import Counter, defaultdict
from functools import cache
from itertools import pairwise, product
from math import exp, inf, log, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import BOTOHE, Kind, Mission, load_mission
from botohe_moo.algorithms.annealing import kernels
from botohe_moo.algorithms.annealing.kernels import MOVES, AnnealRule, Records, anneal, new_state
from botohe_moo.core.compile import kernel, shared
from botohe_moo.core.rng import seed_states
from botohe_moo.core.world import find_arc
from botohe_moo.trails import PlanBatch, TrailPlan
from tests import twins
from tests.examples import examples
from tests.strategies import lengths, mission_of, missions, team_missions
from tests.twins import assert_frequencies

NUMBERS = {name: getattr(kernels, name.upper().replace("-", "_")) for name in MOVES}
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

    def positions(self, move, trail):
        """Where a move may be made: at one position, or at two."""
        last = len(trail) - 1
        match move:
            case "insert":
                return [(i, i) for i in range(last + 1)]
            case "grab":
                return [(i, i) for i in range(max(1, last))]
            case "delete-loop":
                return [(i, i) for i in range(last + 1)] if last > 1 else []
            case "reverse":
                return [(0, 0)] if last > 1 else []
            case "delete" | "substitute":
                return [(i, i) for i in range(1, last)]
            case "swap" | "delete-segment":
                return [(i, j) for j in range(1, last) for i in range(1, j)]

    def changes(self, move, trail, i, j):
        """Return what a move can make of a trail at these positions, valid or not."""
        others = [node for node in self.nodes if node != self.end]
        before, after = trail[:i], trail[j + 1 :]
        match move:
            case "insert":
                return [(*before, trail[i], v, *(after or (self.end,))) for v in others]
            case "grab":
                return [(*before, trail[i], v, *trail[i:]) for v in others]
            case "substitute":
                return [(*before, v, *after) for v in others if v != trail[i]]
            case "delete":
                return [before + after[1 if trail[i - 1] == trail[i + 1] else 0 :]]
            case "delete-segment":
                return [before + after]
            case "swap" if trail[i] != trail[j]:
                return [(*before, trail[j], *trail[i + 1 : j], trail[i], *after)]
            case "reverse":
                return [trail[::-1]]
            case "delete-loop":
                equal = [k for k, node in enumerate(trail) if node == trail[i] and k != i]
                return [trail[: min(i, k)] + trail[max(i, k) :] for k in equal]
        return []

    def outcomes(self, move, trail):
        """A position is drawn, then one of the trails possible there."""
        if move == "detour":
            return self.detours(trail)
        chances, positions = defaultdict(float), self.positions(move, trail)
        for i, j in positions:
            possible = [*filter(self.is_trail, self.changes(move, trail, i, j))] or [None]
            for outcome in possible:
                chances[outcome] += 1 / len(positions) / len(possible)
        return dict(chances) or {None: 1.0}

    def detour(self, trail, start, stop, via):
        """Another way between two positions, or None where there is none."""
        free = self.repairer.free(trail[: start + 1])
        free.remove_edges_from(pairwise(trail[stop:]))
        way = [trail[start]]
        if via not in (self.end, trail[start], trail[stop]):
            by_arc = free.has_edge(trail[start], via)
            way = [trail[start], via] if by_arc else self.safest(free, trail[start], via)
            free.remove_edges_from(list(pairwise(way)))
        back = self.safest(free, way[-1], trail[stop]) if way else []
        if not back or (*way, *back[1:]) == trail[start : stop + 1]:
            return None
        return (*trail[:start], *way, *back[1:], *trail[stop + 1 :])

    def safest(self, free, source, target):
        if not nx.has_path(free, source, target):
            return []
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
        """Return the probability of each outcome when moves are drawn until one is possible."""
        chances = defaultdict(float)
        for move, weight in zip(MOVES, weights, strict=False):
            for outcome, chance in self.outcomes(move, trail).items():
                chances[outcome] += weight * chance
        chances.pop(None, None)
        total = sum(chances.values())
        return {outcome: chance / total for outcome, chance in chances.items()}


def crossroads(**options):
    """Both ways but for two arcs; trails may pass nodes, and the base, several times."""
    both = [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3), (3, 4)]
    ends = [*both, *((v, u) for u, v in both), (4, 1), (0, 4)]
    arcs = [(*arc, 0.99 - 0.03 * i) for i, arc in enumerate(sorted(ends))]
    return mission_of(arcs, [1] * 5, **(options or {"robots": 2}))


def crossroads_of_kinds():
    """The same for a rover, which goes from 0 to 3, and must not go from 1 to 2."""
    graph = crossroads().graph.copy()
    for arc, attributes in graph.edges.items():
        attributes["survival"] = {"drone": 0.5, "rover": attributes["survival"] * (arc != (1, 2))}
    return Mission(graph, base=0, kinds=[Kind("drone", 1), Kind("rover", 1, end=3)])


TRAILS = [
    *((0,), (0, 1, 0), (0, 1, 2, 0), (0, 4, 1, 0), (0, 1, 3, 2, 0), (0, 1, 0, 2, 0)),
    *((0, 2, 3, 4, 3, 1, 0), (0, 1, 2, 1, 3, 4, 1, 0, 2, 3, 2, 0), (0, 4, 3, 2, 1, 3, 1, 2, 0)),
]
# Behind the nodes of the drone.
ROVERS = [(5, 6, 8), (5, 7, 8, 6, 8), (5, 7, 6, 5, 9, 8), (5, 9, 8, 7, 5, 6, 8)]


def items_of(world, trail):
    """A trail of nodes as kernels write it."""
    return [trail[0], *(find_arc(world.graph, *hop) for hop in pairwise(trail))]


def nodes_of(world, items):
    """The nodes of a trail that a kernel has written."""
    return (int(items[0]), *world.graph.head[items[1:]].tolist())


@kernel
def move(world, state, trail, n, number):
    return kernels.make_move(world, shared(state), trail, n, number)


@pytest.mark.slow
@pytest.mark.parametrize("name", MOVES)
@pytest.mark.parametrize(("robot", "trails"), [(0, TRAILS), (1, ROVERS)])
def test_one_move_has_the_outcomes_of_the_twin(name, robot, trails):
    mission = crossroads_of_kinds() if robot else crossroads()
    world, n_times = mission.world, 3_000
    state = new_state(world, seed_states(np.random.default_rng(1), 1))
    makeable = 0
    for trail in trails:
        expected = Moves(mission, robot).outcomes(name, trail)
        assert sum(expected.values()) == pytest.approx(1)
        makeable += set(expected) != {None}
        given, found, n = np.full(world.graph.n_arcs + 1, -7), Counter(), len(trail) - 1
        given[: n + 1] = items_of(world, trail)
        kernels.mark(state, given, 1, n + 1, 1)
        marked = state.used.copy()
        assert marked.sum() == n
        for _ in range(n_times):
            items = given.copy()
            changed = move(world, state, items, n, NUMBERS[name])
            found[items.tobytes(), changed] += 1
        assert np.array_equal(state.used, marked)
        state.used[:] = 0
        counted = Counter()
        for (written, changed), times in found.items():
            items = np.frombuffer(written, given.dtype)
            if changed == kernels.CANNOT:
                assert items.tolist() == given.tolist()
            counted[
                None if changed == kernels.CANNOT else nodes_of(world, items[: changed + 1])
            ] += times
        assert_frequencies(counted, expected)
    assert makeable >= (0 if robot and name == "reverse" else 2)


COOLED = np.array([1, 1, 1, 1, 1, 1, 0.1, 0.1])


class Search:
    """The kernel with its arrays; starts with everybody at base, or from given trails."""

    def __init__(self, mission, *, seed=0, temperature=0.02, kinds=COOLED, world=None, **rule):
        self.mission, self.world = mission, world or twins.alike(mission)
        usual = {"weight": 0.7, "every_robot": False, "cooling": 1.0, "return_probability": 0.0}
        rule = usual | {"records": True, "total_reward": mission.total_reward or 1.0} | rule
        self.rule = AnnealRule(np.cumsum(kinds), **rule)
        self.state = new_state(self.world, seed_states(np.random.default_rng(seed), 1))
        self.state.temperature[0] = temperature
        self.start(mission.stay_home(self.world).trails)

    def start(self, trails):
        state, best = self.state, self.state.best
        for robot, trail in enumerate(trails):
            best.stops[robot] = best.starts[robot] + len(trail)
            best.items[best.starts[robot] : best.stops[robot]] = items_of(self.world, trail)
        best.objectives[:] = self.mission.evaluate([TrailPlan(trails)])[0]
        state.best_score[0] = self.score(best.objectives)
        for values, of_best in zip(state.current, best, strict=True):
            values[:] = of_best

    def score(self, objectives):
        (reward, survivors), rule = objectives, self.rule
        alive = survivors / self.mission.robots
        return rule.weight * (reward / rule.total_reward) + (1 - rule.weight) * alive

    def run(self, n_steps):
        """Let the kernel make steps; gives the plans recorded, and their objectives."""
        robots, room = self.mission.robots, n_steps * len(self.state.tried.items)
        offsets = np.zeros(n_steps * robots + 1, np.int64)
        records = Records(np.empty((n_steps, 2)), np.empty(room, np.int32), offsets)
        n = anneal(self.world, self.rule, self.state, records, n_steps)
        offsets = offsets[: n * robots + 1]
        return PlanBatch(records.nodes[: offsets[-1]], offsets, robots), records.objectives[:n]

    @property
    def trails(self):
        """Return the trails of the current plan and of the best plan."""
        return [
            tuple(
                nodes_of(self.world, plan.items[start:stop])
                for start, stop in zip(plan.starts, plan.stops, strict=True)
            )
            for plan in (self.state.current, self.state.best)
        ]


def test_the_limits_bind_and_leave_room():
    mission, found = load_mission("art_museum"), []
    for world in (None, twins.alike(mission, 0.5, 8.0)):
        search = Search(mission, world=world, temperature=1e9, kinds=PUBLISHED, records=False)
        plans = []
        for _ in range(600):
            search.run(1)
            plans.append(TrailPlan(search.trails[0]))
        found.append(mission.batch(plans))
    free, bound = found
    assert mission.robot_survival(free).min() < 0.5
    assert mission.trail_lengths(free).max() > 8
    assert 0.5 <= mission.robot_survival(bound).min() < 0.6
    assert max(len(trail) for plan in bound for trail in plan.trails) > 5


def test_where_no_move_drawn_can_be_made_there_are_detours():
    """On a cycle of one-way arcs, only a detour leaves the base."""
    mission = mission_of([(0, 1, 0.9), (1, 2, 0.9), (2, 0, 0.9)], [1] * 3, robots=1)
    assert Moves(mission).drawn(PUBLISHED, (0,)) == {}
    for least, expected in ((0.0, {(0,), (0, 1, 2, 0)}), (0.73, {(0,)})):  # one round: 0.729
        world = twins.alike(mission, least)
        search, seen = Search(mission, world=world, temperature=1e9, kinds=PUBLISHED), set()
        for _ in range(20):
            search.run(1)
            seen.add(search.trails[0][0])
        assert seen == expected


class Annealing:
    """What a search may be at after some steps, with its chances: one rule a line."""

    def __init__(self, search, kinds, temperature):
        self.rule, self.temperature, moves = search.rule, temperature, Moves(search.mission)
        self.drawn = cache(lambda trail: moves.drawn(kinds, trail))
        self.score = cache(lambda trails: search.score(twins.evaluate(search.mission, trails)))

    def tried(self, trails):
        """Every plan a step may try, with its chance."""
        chances = [self.drawn(trail) for trail in trails]
        if self.rule.every_robot:
            for joint in product(*(chance.items() for chance in chances)):
                yield tuple(trail for trail, _ in joint), prod(p for _, p in joint)
            return
        for robot in range(len(trails)):
            for trail, chance in chances[robot].items():
                yield (*trails[:robot], trail, *trails[robot + 1 :]), chance / len(trails)

    def after(self, n_steps, trails):
        """Chances of (plan, best plan)."""
        states, temperature = {(trails, trails): 1.0}, self.temperature
        back = self.rule.return_probability
        for _ in range(n_steps):
            following = defaultdict(float)
            for (here, best), chance in states.items():
                for tried, probability in self.tried(here):
                    score = self.score(tried)
                    change = score - self.score(here)
                    accepted = 1.0 if change > -1e-15 else exp(change / temperature)
                    new_best = tried if score > self.score(best) + 1e-15 else best
                    joint = chance * probability
                    following[tried, new_best] += joint * accepted
                    following[new_best, new_best] += joint * (1 - accepted) * back
                    following[here, new_best] += joint * (1 - accepted) * (1 - back)
            states, temperature = following, temperature * self.rule.cooling
        return dict(states)


START = ((0, 1, 3, 2, 0), (0,))
KINDS = np.array([1, 2, 0, 0, 0, 0, 0.3])
TEMPERATURE, N_STEPS, N_TIMES = 0.06, 3, 12_000


@pytest.mark.slow
@pytest.mark.compiled_only
@pytest.mark.parametrize(
    ("every_robot", "cooling", "returning"),
    [(False, 1.0, 0.0), (False, 0.3, 0.4), (True, 1.0, 0.4), (True, 0.3, 0.0)],
)
def test_searches_end_with_the_chances_of_the_twin(every_robot, cooling, returning):
    """Frequencies of the current and the best plan after three steps; ties are sorted."""
    rule = {"weight": 0.6, "cooling": cooling, "return_probability": returning}
    search = Search(crossroads(), seed=3, kinds=KINDS, every_robot=every_robot, **rule)
    counted, expected = Counter(), Counter()
    for _ in range(N_TIMES):
        search.start(START)
        search.state.temperature[0] = TEMPERATURE
        search.run(N_STEPS)
        counted[tuple(tuple(sorted(trails)) for trails in search.trails)] += 1
    for trails, chance in Annealing(search, KINDS, TEMPERATURE).after(N_STEPS, START).items():
        expected[tuple(tuple(sorted(one)) for one in trails)] += chance
    assert_frequencies(counted, expected)
    assert len(counted) > 50


def test_a_cold_search_climbs():
    search, scores = Search(crossroads(), temperature=1e-12, weight=0.9), []
    for _ in range(200):
        search.run(5)
        scores.append(search.score(search.state.current.objectives))
        assert search.state.best_score[0] == pytest.approx(scores[-1], abs=1e-9)
    assert scores == sorted(scores)
    assert scores[-1] > scores[0]


@examples(200)
@given(
    missions(min_nodes=1, max_nodes=8, max_robots=4, lengths=lengths)
    | team_missions(lengths=lengths),
    st.booleans(),
    st.sampled_from([0.0, 0.3, 1.0]),
    st.sampled_from([0.0, 0.2]),
    st.sampled_from([0.0, 0.0, 0.3, 0.7, 1.0]),
    st.sampled_from([inf, inf, 8.0, 3.0, 0.0]),
    st.integers(0, 2**31),
)
def test_plans_are_valid_keep_limits_and_have_the_bits_of_evaluate(
    mission, every_robot, weight, returning, least, longest, seed
):
    try:
        problem = BOTOHE(mission, min_survival=least, max_length=longest)
    except ValueError:  # a kind has no way to its end that is within them
        assume(False)
    options = {"every_robot": every_robot, "weight": weight, "return_probability": returning}
    options |= {"kinds": np.ones(len(MOVES)), "temperature": 0.1, "cooling": 0.95}
    search = Search(mission, seed=seed, world=problem.world, **options)
    for n_steps in (1, 40, 3):
        batch, objectives = search.run(n_steps)
        assert len(batch) == len(objectives) <= n_steps
        at_hand = mission.batch(map(TrailPlan, search.trails))
        found = [search.state.current.objectives, search.state.best.objectives]
        for plans, claimed in ((batch, objectives), (at_hand, np.array(found))):
            assert claimed.tolist() == mission.evaluate(plans).tolist()
            assert (mission.robot_survival(plans) >= problem.limits.floors).all()
            assert (mission.trail_lengths(plans) <= problem.limits.budgets).all()


def test_records_leave_out_what_the_plan_before_or_the_best_one_dominates():
    """The plan the search is at, and its best, can always be found among what it recorded."""
    mission = load_mission("art_museum")
    search = Search(mission, seed=1, temperature=0.01)
    recorded, n_recorded = {(mission.rewards[0], 3.0)}, 0
    for _ in range(400):
        before = [plan.objectives.copy() for plan in (search.state.current, search.state.best)]
        _, objectives = search.run(1)
        for pair in objectives:
            assert not any((f >= pair).all() and (f > pair).any() for f in before)
        recorded |= set(map(tuple, objectives.tolist()))
        n_recorded += len(objectives)
        for plan in (search.state.current, search.state.best):
            assert any((plan.objectives <= pair).all() for pair in recorded)
    assert 20 < n_recorded < 400
    quiet = Search(mission, seed=1, temperature=0.01, records=False)
    assert len(quiet.run(400)[0]) == 0
    assert quiet.trails == search.trails
