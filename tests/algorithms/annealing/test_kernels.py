"""Annealing: the exact chances of a readable twin, the bits of ``evaluate``, and no lost plans."""

from collections import Counter, defaultdict
from functools import cache
from itertools import product
from math import exp, prod

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo.algorithms.annealing.kernels import AnnealRule, Records, anneal, new_state
from botohe_moo.core.rng import seed_states
from botohe_moo.mission import load_mission
from botohe_moo.trails import PlanBatch, TrailPlan
from tests import twins
from tests.algorithms.annealing.test_moves import (
    Moves,
    agree,
    crossroads,
    items_of,
    limited,
    nodes_of,
)
from tests.examples import examples
from tests.strategies import lengths, missions, team_missions

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
