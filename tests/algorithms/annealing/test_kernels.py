"""Annealing: moves and searches have the chances of readable twins, and the bits of `evaluate`."""

from collections import Counter, defaultdict
from functools import cache
from itertools import pairwise, product
from math import exp, log, prod

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo.algorithms.annealing import kernels
from botohe_moo.algorithms.annealing.kernels import (
    CANNOT,
    MOVES,
    AnnealRule,
    Records,
    anneal,
    change_trail,
    make_move,
    mark,
    new_state,
)
from botohe_moo.core.compile import kernel, shared
from botohe_moo.core.rng import seed_states
from botohe_moo.core.world import Limits, find_arc
from botohe_moo.mission import Kind, Mission, load_mission
from botohe_moo.trails import PlanBatch, TrailPlan
from tests import twins
from tests.examples import examples
from tests.strategies import (
    lengths,
    missions,
    missions_with_plans,
    small_missions,
    team_missions,
    team_missions_with_plans,
)

NUMBERS = {name: getattr(kernels, name.upper().replace("-", "_")) for name in MOVES}
PUBLISHED = np.array([1, 1, 1, 1, 1, 1, 0.1])


def test_moves_are_numbered_in_the_order_in_which_they_are_declared():
    assert [*NUMBERS.values()] == [*range(len(MOVES))]


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
            case "delete-segment":
                return self.at_positions(pairs, lambda p: [trail[: p[0]] + trail[p[1] + 1 :]])
            case "reverse":
                return self.at_positions([0] if inner else [], lambda _: [trail[::-1]])
            case "detour":
                return self.detours(trail)
            case "delete-loop":
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
        for kind, weight in zip(MOVES, weights, strict=False):
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


def items_of(world, trail):
    """A trail of nodes as kernels write it."""
    return [trail[0], *(find_arc(world.graph, *hop) for hop in pairwise(trail))]


def nodes_of(world, items):
    """The nodes of a trail that a kernel has written."""
    return (int(items[0]), *world.graph.head[items[1:]].tolist())


def buffer(world, trail):
    items = np.full(world.graph.n_arcs + 1, -7)
    items[: len(trail)] = items_of(world, trail)
    return items


def agree(counted, expected, n_times):
    assert set(counted) <= set(expected)
    for outcome, chance in expected.items():
        spread = abs(n_times * chance * (1 - chance)) ** 0.5
        assert abs(counted[outcome] - n_times * chance) <= 5 * spread + 3, outcome


@kernel
def move(world, state, trail, n, number):
    return make_move(world, shared(state), trail, n, number)


def crossroads_of_kinds():
    """The same for a rover, which goes from 0 to 3, and must not go from 1 to 2."""
    graph = crossroads().graph.copy()
    for arc, attributes in graph.edges.items():
        attributes["survival"] = {"drone": 0.5, "rover": attributes["survival"] * (arc != (1, 2))}
    return Mission(graph, base=0, kinds=[Kind("drone", 1), Kind("rover", 1, end=3)])


# Behind the nodes of the drone.
ROVERS = [(5, 6, 8), (5, 7, 8, 6, 8), (5, 7, 6, 5, 9, 8), (5, 9, 8, 7, 5, 6, 8)]


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
        given, found, n = buffer(world, trail), Counter(), len(trail) - 1
        mark(state, given, 1, n + 1, 1)
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
            if changed == CANNOT:
                assert items.tolist() == given.tolist()
            counted[None if changed == CANNOT else nodes_of(world, items[: changed + 1])] += times
        agree(counted, expected, n_times)
    assert makeable >= (0 if robot and name == "reverse" else 2)


WEIGHTS = [PUBLISHED, np.array([1, 0, 0.5, 2, 1, 1, 0, 3.0])]


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(TRAILS)))
def test_moves_are_drawn_again_until_one_can_be_made(number):
    trail, weights = TRAILS[number], WEIGHTS[number % 2]
    mission = crossroads().with_robots(1)
    n_times = 3_000
    changed = change(mission, [TrailPlan([trail])] * n_times, weights=weights)
    counted = Counter(plan.trails[0] for plan in changed)
    agree(counted, Moves(mission).drawn(weights, trail), n_times)


def limited(mission, least=0.0, longest=np.inf):
    """The mission for kernels, with limits that are the same for each robot."""
    floors, budgets = np.full(mission.robots, least), np.full(mission.robots, longest)
    return mission.world.with_limits(Limits(floors, budgets, longest < np.inf))


@np.errstate(all="ignore")
def change(mission, batch, *, weights=PUBLISHED, world=None, seed=0):
    """Change every trail of plans by a move, in plain Python, which gives the same bits."""
    world = limited(mission) if world is None else world
    rule = AnnealRule(np.cumsum(weights), True, True, 1.0, 0.5, 1.0, 0.0)
    state = new_state(world, seed_states(np.random.default_rng(seed), 1))
    plans = []
    for plan in batch:
        trails = []
        for robot, trail in enumerate(plan.trails):
            start, stop = state.tried.starts[robot], state.tried.starts[robot] + len(trail)
            for each in (state.current, state.tried):
                each.items[start:stop], each.stops[robot] = items_of(world, trail), stop
            change_trail(world, rule, state, robot)
            assert nodes_of(world, state.current.items[start:stop]) == trail
            assert not state.used.any()
            trails.append(nodes_of(world, state.tried.items[start : state.tried.stops[robot]]))
        plans.append(TrailPlan(trails))
    return mission.batch(plans)


@examples(150)
@given(
    missions_with_plans(max_nodes=8, one_way=True) | team_missions_with_plans(),
    st.integers(0, 2**31),
)
def test_trails_stay_trails_on_one_way_missions(mission_and_plan, seed):
    mission, plan = mission_and_plan
    batch = mission.batch([plan] * 8)
    weights = np.ones(len(MOVES))
    for i in range(4):
        batch = change(mission, batch, weights=weights, seed=seed + i)
        mission.evaluate(batch)  # raises PlanError for any trail that is not valid


def test_the_limits_bind_and_leave_room():
    mission = load_mission("art_museum")
    batch = mission.batch([mission.plan([[1]] * 3)] * 60)
    for seed in range(30):
        free = change(mission, batch, seed=seed)
        batch = change(mission, batch, world=limited(mission, 0.5, 8.0), seed=seed)
    assert mission.robot_survival(free).min() < 0.5
    assert mission.trail_lengths(free).max() > 8
    assert 0.5 <= mission.robot_survival(batch).min() < 0.6
    assert max(len(trail) for plan in batch for trail in plan.trails) > 5


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
    out = change(mission, batch)
    assert {trail for plan in out for trail in plan.trails} == {(0, 1, 2, 0)}
    back = change(mission, out)
    assert {trail for plan in back for trail in plan.trails} == {(0, 1, 2, 0), (0,)}


def test_a_trail_that_no_move_can_change_stays():
    mission = round_trip()
    plan = mission.plan([[0], [0]])
    (out,) = change(mission, [plan], world=limited(mission, 0.73))  # one round survives with 0.729
    assert out.trails == plan.trails


@examples(60)
@given(small_missions(max_trails=30, one_way=True))
def test_moves_lead_from_every_trail_to_every_other(drawn):
    """With detours; by the twin, whose outcomes are the kernel's."""
    mission, trails = drawn
    found, fresh = {(0,)}, [(0,)]
    twin = Moves(mission)
    weights = np.ones(len(MOVES))
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


COOLED = np.array([1, 1, 1, 1, 1, 1, 0.1, 0.1])


class Search:
    """The kernel with its arrays; starts with everybody at base, or from given trails."""

    def __init__(self, mission, *, seed=0, temperature=0.02, weight=0.7, **options):
        self.mission, self.weight = mission, weight
        self.options = {
            "world": limited(mission),
            "kinds": COOLED,
            "every_robot": False,
            "cooling": 1.0,
            "returning": 0.0,
            "record": True,
            **options,
        }
        self.world = self.options["world"]
        self.state = new_state(self.world, seed_states(np.random.default_rng(seed), 1))
        self.begun = {}  # the items, stops and objectives of plans that it has started from
        self.state.temperature[0] = temperature
        self.start(mission.stay_home(self.world).trails)

    def start(self, trails):
        state, best, key = self.state, self.state.best, tuple(map(tuple, trails))
        if key not in self.begun:
            for robot, trail in enumerate(trails):
                best.stops[robot] = best.starts[robot] + len(trail)
                best.items[best.starts[robot] : best.stops[robot]] = items_of(self.world, trail)
            best.objectives[:] = self.mission.evaluate([TrailPlan(trails)])[0]
            self.begun[key] = [values.copy() for values in best]
        for values, of_plan in zip(best, self.begun[key], strict=True):
            values[:] = of_plan
        state.best_score[0] = self.score(best.objectives)
        for values, of_best in zip(state.current, best, strict=True):
            values[:] = of_best

    def score(self, objectives):
        mission, weight = self.mission, self.weight
        reward, survivors = objectives
        total = mission.total_reward or 1.0
        return weight * (reward / total) + (1 - weight) * (survivors / mission.robots)

    def run(self, n_steps):
        """Let the kernel make steps; gives the plans recorded, and their objectives."""
        options, robots = self.options, self.mission.robots
        rule = AnnealRule(
            moves=np.cumsum(options["kinds"]),
            every_robot=options["every_robot"],
            records=options["record"],
            total_reward=self.mission.total_reward or 1.0,
            weight=self.weight,
            cooling=options["cooling"],
            return_probability=options["returning"],
        )
        room = n_steps * len(self.state.tried.items)
        offsets = np.zeros(n_steps * robots + 1, np.int64)
        records = Records(np.empty((n_steps, 2)), np.empty(room, np.int32), offsets)
        n = anneal(self.world, rule, self.state, records, n_steps)
        offsets = offsets[: n * robots + 1]
        return PlanBatch(records.nodes[: offsets[-1]], offsets, robots), records.objectives[:n]

    @property
    def objectives(self):
        return self.state.current.objectives

    @property
    def trails(self):
        return self.trails_of(self.state.current)

    @property
    def best_trails(self):
        return self.trails_of(self.state.best)

    def trails_of(self, plan):
        ends = zip(plan.starts, plan.stops, strict=True)
        return tuple(nodes_of(self.world, plan.items[start:stop]) for start, stop in ends)


class Annealing:
    """What a search may be at after some steps, with its chances: one rule a line."""

    def __init__(self, mission, weight, temperature, cooling, returning, kinds, every_robot):
        self.mission, self.weight, self.temperature = mission, weight, temperature
        self.cooling, self.returning = cooling, returning
        self.every_robot, self.moves, self.scores = every_robot, Moves(mission), {}
        self.drawn = cache(lambda trail: self.moves.drawn(kinds, trail))

    def score(self, trails):
        if trails not in self.scores:
            reward, survivors = twins.evaluate(self.mission, trails)
            share = reward / self.mission.total_reward
            alive = survivors / self.mission.robots
            self.scores[trails] = self.weight * share + (1 - self.weight) * alive
        return self.scores[trails]

    def tried(self, trails):
        """Every plan a step may try, with its chance."""
        robots = range(len(trails))
        chances = [self.drawn(trail) for trail in trails]
        if self.every_robot:
            for joint in product(*(chance.items() for chance in chances)):
                yield tuple(trail for trail, _ in joint), prod(p for _, p in joint)
            return
        for robot in robots:
            for trail, chance in chances[robot].items():
                yield (*trails[:robot], trail, *trails[robot + 1 :]), chance / len(trails)

    def after(self, n_steps, trails):
        """Chances of (plan, best plan)."""
        states, temperature = {(trails, trails): 1.0}, self.temperature
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
                    following[new_best, new_best] += joint * (1 - accepted) * self.returning
                    following[here, new_best] += joint * (1 - accepted) * (1 - self.returning)
            states, temperature = following, temperature * self.cooling
        return dict(states)


# Three steps from here are told apart from those of any other rule (the test after the next).
START = ((0, 1, 3, 2, 0), (0,))
RULE = {
    "weight": 0.6,
    "temperature": 0.06,
    "cooling": 1.0,
    "returning": 0.0,
    "every_robot": False,
    "kinds": np.array([1, 2, 0, 0, 0, 0, 0.3]),
}
N_STEPS, N_TIMES = 3, 12_000


@pytest.mark.slow
@pytest.mark.compiled_only
@pytest.mark.parametrize(
    ("every_robot", "cooling", "returning"),
    [(False, 1.0, 0.0), (False, 0.3, 0.4), (True, 1.0, 0.4), (True, 0.3, 0.0)],
)
def test_searches_end_with_the_chances_of_the_twin(every_robot, cooling, returning):
    mission = crossroads()
    rule = {**RULE, "every_robot": every_robot, "cooling": cooling, "returning": returning}
    search = Search(mission, seed=3, **rule)
    counted = Counter()
    for _ in range(N_TIMES):
        search.start(START)
        search.state.temperature[0] = rule["temperature"]
        search.run(N_STEPS)
        counted[alike(search.trails, search.best_trails)] += 1
    agree(counted, chances_after(rule), N_TIMES)
    assert len(counted) > 50


def chances_after(rule):
    expected = defaultdict(float)
    for (here, best), chance in Annealing(crossroads(), **rule).after(N_STEPS, START).items():
        expected[alike(here, best)] += chance
    assert sum(expected.values()) == pytest.approx(1)
    return expected


def alike(here, best):
    """Ties are broken by rounding where robots change places."""
    return tuple(sorted(here)), tuple(sorted(best))


def test_a_cold_search_climbs():
    search = Search(crossroads(), temperature=1e-12, weight=0.9)
    scores = []
    for _ in range(200):
        search.run(5)
        scores.append(search.score(search.objectives))
        assert search.state.best_score[0] == pytest.approx(scores[-1], abs=1e-9)
    assert scores == sorted(scores)
    assert scores[-1] > scores[0]


@examples(120)
@given(
    missions(min_nodes=1, max_nodes=8, max_robots=4) | team_missions(),
    st.booleans(),
    st.sampled_from([0.0, 0.3, 1.0]),
    st.sampled_from([0.0, 0.2]),
    st.integers(0, 2**31),
)
def test_figures_and_records_are_those_of_evaluate(mission, every_robot, weight, returning, seed):
    search = Search(
        mission,
        seed=seed,
        weight=weight,
        every_robot=every_robot,
        returning=returning,
        temperature=0.1,
        cooling=0.95,
    )
    for n_steps in (1, 40, 3):
        batch, objectives = search.run(n_steps)
        assert len(batch) == len(objectives) <= n_steps
        assert objectives.tolist() == mission.evaluate(batch).tolist()
        at_hand = PlanBatch.from_plans(
            [TrailPlan(search.trails), TrailPlan(search.best_trails)], mission.robots
        )
        found = [search.objectives.tolist(), search.state.best.objectives.tolist()]
        assert found == mission.evaluate(at_hand).tolist()


def test_records_leave_out_only_what_is_dominated():
    """The plan the search is at, and its best, can always be found among what it recorded."""
    mission = load_mission("art_museum")
    search = Search(mission, seed=1, temperature=0.01)
    recorded = {(mission.rewards[0], 3.0)}
    n_recorded = 0
    for _ in range(400):
        _, objectives = search.run(1)
        recorded |= set(map(tuple, objectives.tolist()))
        n_recorded += len(objectives)
        for pair in (search.objectives, search.state.best.objectives):
            assert any(r >= pair[0] and s >= pair[1] for r, s in recorded)
    assert 20 < n_recorded < 400
    searches = [
        Search(mission, seed=1, temperature=0.01, record=record) for record in (True, False)
    ]
    kept, (none, _) = searches[0].run(400)[0], searches[1].run(400)
    assert len(kept) == n_recorded
    assert len(none) == 0
    assert searches[0].trails == searches[1].trails


@examples(60)
@given(
    missions(max_nodes=7, lengths=lengths) | team_missions(lengths=lengths),
    st.sampled_from([0.0, 0.3, 0.7, 1.0]),
    st.sampled_from([np.inf, 8.0, 3.0, 0.0]),
    st.integers(0, 2**31),
)
def test_no_plan_leaves_the_limits(mission, least, longest, seed):
    world = mission.limited(least, longest)
    least = np.array([max(least, kind.min_survival) for kind in mission.kind_of])
    longest = np.array([min(longest, kind.max_length or np.inf) for kind in mission.kind_of])
    home = mission.batch([mission.stay_home(world)])
    assume((mission.robot_survival(home) >= least).all())
    assume((mission.trail_lengths(home) <= longest).all())
    search = Search(mission, seed=seed, world=world, temperature=0.5, weight=0.9)
    batch, _ = search.run(60)
    current = mission.batch([TrailPlan(search.trails), TrailPlan(search.best_trails)])
    for plans in (batch, current):
        assert (mission.robot_survival(plans) >= least).all()
        assert (mission.trail_lengths(plans) <= longest).all()
