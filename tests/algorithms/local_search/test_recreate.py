"""Ruin and recreate in plain Python: slack, stops and tours against readable twins, and walks."""

from collections import Counter
from itertools import pairwise
from math import exp, inf, log

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan
from botohe_moo.algorithms.local_search.kernels import plans
from botohe_moo.algorithms.local_search.kernels import recreate as kernels
from botohe_moo.algorithms.local_search.kernels.state import N_CHILDREN, new_store
from botohe_moo.core.rng import uniform
from botohe_moo.core.world import new_limits
from tests import twins
from tests.algorithms.local_search.made import check, keeps_limits, plan_of, unstarted, write_child
from tests.examples import examples
from tests.strategies import mission_of, missions_with_plans
from tests.twins import plain_local_search

FLOORS = st.sampled_from([0.0, 0.0, 0.2, 0.7, 1.0])
BUDGETS = st.sampled_from([inf, inf, 9.0, 4.0, 0.0])


@pytest.fixture(autouse=True)
def plain():
    """The search in plain Python, always stuck: children may be the steps of a walk."""
    with plain_local_search() as patch:
        patch.setattr(plans, "PATIENCE", -1)
        patch.setattr(kernels, "P_WALK", 0.0)
        patch.setattr(kernels, "SHUFFLED", 0.0)
        yield patch


def holding(mission, plan, chosen, **options):
    """A search with a plan as parent, and some of its robots chosen to change."""
    search = unstarted(mission, **options)
    work, limits = search._work, new_limits([0.0], [inf], [mission.robots])
    free = mission.world.with_limits(limits)
    for robot, trail in enumerate(plan):  # which may be beyond the limits
        n_arcs = write_child(search, trail)
        work.parent[robot] = plans.add_trail(search.parts._replace(world=free), robot, n_arcs)
    work.chosen[:] = [*chosen, *(k for k in range(mission.robots) if k not in chosen)]
    work.draft.n_chosen, work.draft.robot = len(chosen), chosen[0]
    plans.evaluate_others(search.world, search._store, work)
    return search


def tours_of(work):
    """The stops of each tour, with the base at both ends; every leg must be where it belongs."""
    tours = []
    for which in range(work.draft.n_chosen):
        number, stops = int(work.first[which]), [int(work.legs[work.first[which]].before)]
        while number != kernels.NONE:
            leg = work.legs[number]
            assert leg.tour == which
            assert leg.before == stops[-1]
            assert number < work.draft.n_legs
            stops.append(int(leg.after))
            number = int(leg.following)
        tours.append(stops)
    assert sum(len(stops) - 1 for stops in tours) == work.draft.n_legs
    return tours


def slacks_of(work):
    return [
        (float(slack.danger), float(slack.length)) for slack in work.slacks[: work.draft.n_chosen]
    ]


@pytest.mark.parametrize("robots", [1, 7])
def test_one_robot_is_chosen_or_a_pair_and_maybe_more_or_all(plain, robots):
    search, seen = holding(complete(3, 0, robots=robots), [(0,)] * robots, [0]), Counter()
    work = search._work
    for p_pair in (0.0, 0.5, 1.0):
        plain.setattr(kernels, "P_PAIR", p_pair)
        for trial in range(200):
            work.draft.robot = trial % robots
            kernels._draw_robots(search.parts)
            assert sorted(work.chosen.tolist()) == list(range(robots))
            assert work.chosen[0] == work.draft.robot
            seen[p_pair, int(work.draft.n_chosen)] += 1
    assert seen[0.0, 1] == seen[1.0, robots] == 200
    if robots == 7:
        assert seen[0.5, 1] == pytest.approx(100, abs=40)
        assert {n for p, n in seen if p == 0.5} >= {1, 2, 3, 4}


def slack(plain, p_full, spread, **rule):
    """Draw the slack of a trail of survival 0.5 · 0.8 = 0.4 and length 3 + 1."""
    plain.setattr(kernels, "P_FULL", p_full)
    plain.setattr(kernels, "SPREAD", spread)
    mission = mission_of([(0, 1, 0.5, 3.0), (1, 0, 0.8, 1.0)], [0, 1], robots=1)
    search = holding(mission, [(0, 1, 0)], [0], **rule)
    kernels._draw_slack(search.parts, 0)
    return slacks_of(search._work)[0]


@pytest.mark.parametrize(
    ("p_full", "rule", "danger", "length"),
    [
        (0.0, {}, -log(0.4), inf),
        (1.0, {"min_survival": 0.2}, -log(0.2), inf),
        (0.0, {"min_survival": 0.2}, -log(0.4), inf),
        (0.0, {"max_length": 9.0}, -log(0.4), 4.0),
        (1.0, {"max_length": 10.0}, -2.5 * log(0.4), 10.0),
        (1.0, {"max_length": 10.0, "min_survival": 0.3}, -log(0.3), 10.0),
    ],
)
def test_slack_by_hand(plain, p_full, rule, danger, length):
    assert slack(plain, p_full, 0.0, **rule) == pytest.approx((danger, length), rel=1e-12)


def test_danger_spreads_on_the_scale_of_logarithms(plain):
    found = [slack(plain, 0.0, 0.6, seed=seed)[0] for seed in range(200)]
    logs = np.log(np.array(found) / -log(0.4))
    assert -0.6 <= logs.min() < -0.5
    assert 0.5 < logs.max() <= 0.6
    assert slack(plain, 0.0, 0.5, max_length=9.0)[1] == pytest.approx(6.0)
    assert slack(plain, 0.0, 0.5, max_length=5.0)[1] == pytest.approx(5.0)
    floored = [slack(plain, 0.0, 0.6, min_survival=0.4, seed=seed)[0] for seed in range(50)]
    assert max(floored) == pytest.approx(-log(0.4))


@examples(100)
@given(missions_with_plans(min_nodes=1, max_nodes=9), st.data())
def test_stops_that_stay_are_some_of_those_there_were(case, data):
    mission, plan = case
    chosen = data.draw(st.permutations(range(mission.robots)))
    search = holding(mission, plan.trails, chosen[:1], seed=data.draw(st.integers(0, 99)))
    work, visited = search._work, dict.fromkeys(plan.trails[chosen[0]])
    stops = [node for node in visited if node != 0 and work.nodes[node].marginal > 0]
    for _ in range(20):
        n = kernels._draw_stops(search.parts, 0, 0)
        kept = work.goals[:n].tolist()
        assert n == 0 if len(stops) <= 1 else 0 < n < len(stops)
        rest = iter(stops)
        assert all(node in rest for node in kept)  # in this order


def complete(n_nodes, seed, *, robots, scale=0.1, returns=False):
    """A mission whose direct arcs are the cheapest paths; with depots, and rewards on return."""
    rng, graph = np.random.default_rng(seed), nx.complete_graph(n_nodes, nx.DiGraph)
    for node in graph:
        graph.nodes[node]["reward"] = 10 * rng.random() * (rng.random() < 0.8)
        if returns:
            graph.nodes[node]["pays"] = "return" if rng.random() < 0.7 else "arrival"
            graph.nodes[node]["depot"] = bool(rng.random() < 0.2)
    for arc in graph.edges:
        danger, length = rng.uniform(1, 1.9, 2)
        graph.edges[arc].update(survival=exp(-scale * danger), length=length)
    return Mission(graph, base=0, robots=robots)


def random_tours(mission, seed):
    """A plan of single loops through some nodes each."""
    rng, n_nodes = np.random.default_rng(seed), len(mission.nodes)
    some = [rng.permutation(np.arange(1, n_nodes))[: rng.integers(n_nodes)] for _ in range(9)]
    return [(0, *stops.tolist(), 0) if len(stops) else (0,) for stops in some[: mission.robots]]


class Filler:
    """Fills tours the naive way: every node is tried in every leg each time."""

    def __init__(self, mission, per_length, marginal, worth, power):
        graph, n_nodes = mission.world.graph, len(mission.nodes)
        self.danger, self.length = np.zeros((2, n_nodes, n_nodes))
        self.danger[graph.tail, graph.head] = -np.log(graph.mean_survival)
        self.length[graph.tail, graph.head] = graph.length
        self.cost = self.danger + per_length * self.length
        self.marginal, self.worth, self.power = marginal, worth, power

    @staticmethod
    def more(of, before, node, after):
        """What a node adds to a leg."""
        return of[before, node] + of[node, after] - of[before, after]

    def gain(self, stops, i, node):
        """What a node gains between stops i and i + 1, less what the stops behind it lose."""
        dangers = [self.danger[hop] for hop in pairwise(stops)]
        alive = [exp(-sum(dangers[:j])) for j in range(len(stops))]
        behind = range(i + 1, len(stops) - 1)
        at_stake = sum(self.marginal[stops[j]] * alive[j] for j in behind)
        danger = self.more(self.danger, stops[i], node, stops[i + 1])
        reached = self.worth[node] * alive[i] / (1 + self.danger[stops[i], node])
        return reached - at_stake * danger / (1 + danger)

    def choices(self, tours, slacks):
        """Each node that gains something where it costs least, if there is room."""
        for node in np.flatnonzero(self.worth).tolist():
            extra, which, i = min(
                (self.more(self.cost, *hop[:1], node, hop[1]), which, i)
                for which, stops in enumerate(tours)
                for i, hop in enumerate(pairwise(stops))
            )
            ends = tours[which][i], node, tours[which][i + 1]
            danger, longer = (self.more(of, *ends) for of in (self.danger, self.length))
            if danger > slacks[which][0] or longer > slacks[which][1]:
                continue
            gain = self.gain(tours[which], i, node)
            if gain > 0:
                yield gain**self.power / extra, node, which, i, danger, longer

    def fill(self, tours, slacks):
        tours, slacks = [list(stops) for stops in tours], [list(slack) for slack in slacks]
        while found := max(self.choices(tours, slacks), default=None):
            _, node, which, i, danger, longer = found
            tours[which].insert(i + 1, node)
            self.worth[node] = 0.0
            slacks[which][0] -= danger
            slacks[which][1] -= longer
        return tours, slacks


@examples(250)
@given(
    st.sampled_from([2, 4, 7, 8, 9, 10]),
    st.integers(1, 4),
    st.sampled_from([0.005, 0.1, 0.6]),
    st.sampled_from([0.0, 0.3]),
    st.sampled_from([inf, inf, 6.0, 15.0]),
    st.integers(0, 999),
    st.booleans(),
)
def test_tours_are_filled_as_the_naive_way(n_nodes, robots, scale, floor, budget, seed, returns):
    mission = complete(n_nodes, seed, robots=robots, scale=scale, returns=returns)
    limits = {"min_survival": floor, "max_length": budget}
    chosen = np.random.default_rng(seed).permutation(robots)[: 1 + seed % robots].tolist()
    plan = random_tours(mission, seed)
    search = holding(mission, plan, chosen, seed=seed, **limits)
    routes, work = search.costs.routes, search._work
    work.draft.mark += 1
    work.draft.n_legs = 0
    drawn, draw_slack = [], kernels._draw_slack

    def noted(*arguments):
        draw_slack(*arguments)
        drawn.append(slacks_of(work)[arguments[-1]])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "_draw_slack", noted)
        for which in range(len(chosen)):
            kernels._build_tour(search.parts, which)
    opened, slacks = tours_of(work), slacks_of(work)
    for which, slack in enumerate(slacks):  # what is left when the first legs are laid out
        legs = [leg for leg in work.legs[: work.draft.n_legs] if leg.tour == which]
        used = [sum(leg.danger for leg in legs), sum(leg.length for leg in legs)]
        assert slack == pytest.approx(np.subtract(drawn[which], used), rel=1e-9, abs=1e-9)
    states, marginal = work.states.copy(), work.nodes["marginal"].copy()
    left = mission.rewards.copy()
    for trail in (trail for robot, trail in enumerate(plan) if robot not in chosen):
        for node, chance in twins.collects(mission, mission.kinds[0], trail).items():
            left[node] *= 1 - chance
    assert marginal == pytest.approx(left)
    noise, worth, power = uniform(states, 0), np.zeros(n_nodes), 1
    if floor > 0 or budget < inf:
        power += uniform(states, 0) < kernels.P_SQUARED
    for node in range(n_nodes):
        if marginal[node] > 0 and all(node not in stops for stops in opened):
            worth[node] = marginal[node] * (1 - noise * uniform(states, 0))
    expected = Filler(mission, routes.per_length[0], marginal, worth, power).fill(opened, slacks)
    kernels._fill_tours(search.parts)
    n_inserted = sum(map(len, expected[0])) - sum(map(len, opened))
    for _ in range(2 * n_inserted):  # for the two legs that each makes of one
        uniform(states, 0)
    assert work.states.tolist() == states.tolist()
    assert tours_of(work) == expected[0]
    assert np.allclose(slacks_of(work), expected[1], rtol=1e-9, atol=1e-9)


@examples(150)
@given(missions_with_plans(min_nodes=1, max_nodes=9, max_robots=4), FLOORS, BUDGETS, st.data())
def test_children_are_plans_within_the_limits(case, floor, budget, data):
    mission, plan = case
    limits = {"min_survival": floor, "max_length": budget}
    if not keeps_limits(mission, [plan], floor, budget):
        plan = mission.stay_home()
    order = data.draw(st.permutations(range(mission.robots)))
    chosen = order[: data.draw(st.integers(1, mission.robots))]
    search = holding(mission, plan.trails, chosen, seed=data.draw(st.integers(0, 99)), **limits)
    work, opened, fill_tours = search._work, [], kernels._fill_tours
    parent = work.parent.tolist()

    def noted(*arguments):
        opened[:] = tours_of(work)
        fill_tours(*arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "_fill_tours", noted)
        is_new = kernels._make_child(search.parts)
    tours = tours_of(work)
    for start, stops in zip(opened, tours, strict=True):
        rest = iter(stops)
        assert all(node in rest for node in start)  # in this order
    stops = Counter(node for tour in tours for node in tour[1:-1])
    twice = Counter(node for tour in opened for node in tour[1:-1])
    assert all(n == max(1, twice[node]) for node, n in stops.items())
    recreated = work.recreated.tolist()
    child = plan_of(search.parts, recreated)
    mission.evaluate([child])  # which must be valid
    assert keeps_limits(mission, [child], floor, budget)
    assert all(recreated[robot] == parent[robot] for robot in order[len(chosen) :])
    assert is_new == (recreated != parent)
    assert work.parent.tolist() == parent
    assert Counter(work.trails.tolist()) == Counter(recreated)
    users = Counter(parent) + Counter(recreated[robot] for robot in chosen)
    n_users = search._store.trails["n_users"].tolist()
    assert {i: n for i, n in enumerate(n_users) if n} == users


def recreating(mission, given, *, n_waiting=3, **options):
    """A search in which plans wait for ruin and recreate."""
    search = unstarted(mission, prob_recreate=1.0, **options)
    search._store = new_store(3_000, 100_000, 100_000)  # room for all children
    search.insert(mission.batch([mission.stay_home(search.world), *given]))
    survivors, work = search.objectives()[:, 1], search._work
    work.memory.newest, work.memory.n_waiting = -1.0, n_waiting if len(search) else 0
    work.waiting[:n_waiting] = np.resize(survivors, n_waiting)
    return search


@pytest.mark.parametrize("p_walk", [0.0, 1.0])
def test_children_that_do_not_enter_use_no_room_up(plain, p_walk):
    for name, value in (("P_WALK", p_walk), ("N_WALK", 1), ("THRESHOLD", -1.0)):
        plain.setattr(kernels, name, value)
    mission = complete(5, 2, robots=3)
    start = [TrailPlan(random_tours(mission, seed)) for seed in range(9)]
    search = recreating(mission, start)
    unchanged = 0
    for _ in range(60):
        search._memory[0].n_waiting = 1
        before, entered = search._store.n.item(), int(search._front.n.entered)
        kernels.recreate(search.parts, 7)
        if search._front.n.entered == entered:
            assert search._store.n.item() == before
            unchanged += 1
    assert unchanged >= 5


def test_room_that_is_used_up_ends_a_walk(plain):
    plain.setattr(kernels, "P_WALK", 1.0)
    plain.setattr(kernels, "N_WALK", 50)
    mission = complete(8, 3, robots=3)
    search = recreating(mission, [TrailPlan(random_tours(mission, 4))])
    front = search._front
    front.n.spare, spare = N_CHILDREN + 4, front.n.spare
    assert kernels.recreate(search.parts, 1_000) < 400
    assert front.n.spare == N_CHILDREN
    front.n.spare += spare - N_CHILDREN - 4
    check(search)


@pytest.mark.parametrize(("patience", "p_walk"), [(10**6, 1.0), (-1, 0.0), (-1, 1.0)])
def test_walks_begin_once_the_search_is_stuck(plain, patience, p_walk):
    plain.setattr(plans, "PATIENCE", patience)
    plain.setattr(kernels, "P_WALK", p_walk)
    mission = complete(8, 3, robots=2)
    search = recreating(mission, [], n_waiting=1)
    draw_others, steps = kernels._draw_other_robots, []
    plain.setattr(kernels, "_draw_other_robots", lambda search: steps.append(draw_others(search)))
    n = kernels.recreate(search.parts, kernels.N_WALK * 8)
    assert len(steps) == (n - 1 if (patience, p_walk) == (-1, 1.0) else 0)


@pytest.mark.parametrize(
    ("robots", "threshold"),
    [(3, 0.05), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((3, 0.0), (1, 0.5)))],
)
def test_a_walk_goes_on_from_what_loses_no_more_than_allowed(plain, robots, threshold):
    for name, value in (("P_WALK", 1.0), ("N_WALK", 10), ("THRESHOLD", threshold)):
        plain.setattr(kernels, name, value)
    mission = complete(8, 5, robots=robots)
    start = [TrailPlan(random_tours(mission, seed)) for seed in range(9)]
    search, steps, n_worse = recreating(mission, start, seed=4), [], 0
    work, make_child, release_parent = search._work, kernels._make_child, plans.release_parent

    def trails_of(numbers):
        return plan_of(search.parts, numbers).trails

    def noted(*arguments):
        before = trails_of(work.parent)
        is_new = make_child(*arguments)
        steps.append((before, trails_of(work.recreated), is_new))
        return is_new

    def check(*arguments):
        nonlocal n_worse
        worth, n = [1.0, float(work.draft.slope)], len(steps)
        steps.append((trails_of(work.parent), None, None))
        for i, ((parent, child, is_new), (following, _, _)) in enumerate(pairwise(steps)):
            value, new = (np.dot(twins.evaluate(mission, plan), worth) for plan in (parent, child))
            least = value * (1 - threshold * (1 - i / n))
            assert following in (parent, child)
            if abs(new - least) > 1e-9 and is_new:
                assert following == (child if new > least else parent)
            n_worse += following == child and new < value - 1e-9
        assert n == 80
        steps.clear()
        release_parent(*arguments)

    plain.setattr(kernels, "_make_child", noted)
    plain.setattr(plans, "release_parent", check)
    assert kernels.recreate(search.parts, 400) in (240, 320, 400)
    assert (n_worse > 0) == (threshold > 0)


def test_plans_that_enter_are_next():
    """Two plans waited: those that enter when the first is recreated come before the second."""
    mission, n_recreated = complete(8, 3, robots=2), []
    for seed in range(9):
        search = recreating(mission, [], n_waiting=2, seed=seed)
        n = kernels.recreate(search.parts, 1_000)
        assert n % kernels.N_RECREATED == 0
        assert search.n_waiting == 0
        n_recreated.append(n // kernels.N_RECREATED)
    assert min(n_recreated) >= 2
    assert max(n_recreated) > 3
