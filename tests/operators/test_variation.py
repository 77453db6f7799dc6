"""What crossovers and mutations draft, by hand and by enumeration."""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import BOTOHE, TrailPlan, area_indicator, load_mission
from botohe_moo.operators import (
    CornerSampling,
    GuidedTrailSampling,
    MixedSampling,
    PenaltyOnly,
    PlanMutation,
    PlanSampling,
    RandomTrailSampling,
    RuinRecreate,
    ShareTrails,
    TrailExchange,
    TrailSplice,
)
from botohe_moo.trails import PlanBatch
from tests.examples import examples
from tests.strategies import plans, team_missions
from tests.twins import ends_of

N = 6_000


@pytest.fixture
def toy():
    return load_mission("toy")


def crossed(crossover, mission, one, other, n=N):
    """The pairs of children of two plans of labels, with how often each was drafted."""
    pair = [mission.plan(one), mission.plan(other)]
    X = np.array(pair, dtype=object).reshape(2, 1, 1).repeat(n, axis=1)
    rng = np.random.default_rng(5)
    children = crossover(repair=PenaltyOnly())._do(BOTOHE(mission), X, random_state=rng)
    labels = [mission.labels(plan) for plan in children.ravel()]
    return Counter(
        (tuple(sorted(a)), tuple(sorted(b))) for a, b in zip(labels[:n], labels[n:], strict=True)
    )


def mutated(mutation, mission, plan, n=N):
    """The plans that a mutation drafts of one, with how often each was drafted."""
    batch = PlanBatch.from_plans([mission.plan(plan)] * n, mission.robots)
    drafts = mutation._draft(mission, batch, np.random.default_rng(5))
    return Counter(tuple(sorted(mission.labels(draft))) for draft in drafts)


def assert_frequencies(found, expected):
    """Compare counts with probabilities, within four and a half standard deviations."""
    n = sum(found.values())
    assert sum(expected.values()) == pytest.approx(1)
    assert set(found) <= set(expected)
    for key, probability in expected.items():
        deviation = 4.5 * np.sqrt(n * probability * (1 - probability)) + 1e-9
        assert abs(found[key] - n * probability) <= deviation, key


HOME, A, B, C = (1,), (1, 2, 1), (1, 3, 1), (1, 2, 4, 3, 1)


class TestExchange:
    def test_every_sharing_out_is_equally_likely(self, toy):
        toy3 = toy.with_robots(3)
        mine, others = [A, A, B], [C, C, HOME]
        expected = Counter()
        # One or two of my trails, filled up from the others; the rest is the second child.
        for cut, mine_order, other_order in product(
            (1, 2), permutations3(mine), permutations3(others)
        ):
            first = tuple(sorted(mine_order[:cut] + other_order[cut:]))
            second = tuple(sorted(other_order[:cut] + mine_order[cut:]))
            expected[first, second] += 1 / 72
        assert_frequencies(crossed(TrailExchange, toy3, mine, others), expected)

    def test_a_single_robot_splices(self, toy):
        alone = toy.with_robots(1)
        found = crossed(TrailExchange, alone, [A], [C], n=50)
        assert found == crossed(TrailSplice, alone, [A], [C], n=50)


@examples(100)
@given(team_missions(max_robots=3), st.sampled_from([TrailExchange, TrailSplice]), st.data())
def test_robots_get_trails_of_their_kind(mission, crossover, data):
    parents = [TrailPlan(data.draw(plans(mission))) for _ in range(2)]
    X = np.array(parents, dtype=object).reshape(2, 1, 1).repeat(20, axis=1)
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    children = crossover(repair=PenaltyOnly())._do(BOTOHE(mission), X, random_state=rng)
    n_robots = mission.robots
    for pair in zip(*children[..., 0].tolist(), strict=True):
        for robot in range(n_robots):
            for trail in (plan.trails[robot] for plan in pair):
                assert (trail[0], trail[-1]) == ends_of(mission, robot)
                assert len({node // len(mission.nodes) for node in trail}) == 1
        if crossover is TrailExchange and n_robots > 1:
            both, given = ([t for plan in some for t in plan.trails] for some in (pair, parents))
            assert Counter(both) == Counter(given)


def permutations3(items):
    a, b, c = items
    return [[a, b, c], [a, c, b], [b, a, c], [b, c, a], [c, a, b], [c, b, a]]


class TestSplice:
    def test_children_swap_what_comes_after_a_shared_node(self, toy):
        # The one robot of each that is out; both visit 2 once.
        found = crossed(TrailSplice, toy, [HOME, C], [A, HOME])
        child, other = (HOME, A), (HOME, C)
        assert found == {(tuple(sorted(child)), tuple(sorted(other))): N}

    def test_places_are_equally_likely(self, toy):
        alone = toy.with_robots(1)
        mine, others = (1, 2, 4, 2, 1), (1, 3, 4, 2, 1)
        expected = Counter()
        places = [(i, j) for i, j in product((1, 2, 3), repeat=2) if mine[i] == others[j]]
        assert len(places) == 3
        for i, j in places:
            first, second = mine[:i] + others[j:], others[:j] + mine[i:]
            expected[(first,), (second,)] += 1 / 3
        assert_frequencies(crossed(TrailSplice, alone, [mine], [others]), expected)

    def test_trails_that_share_no_node_change_places(self, toy):
        found = crossed(TrailSplice, toy, [A, A], [B, HOME])
        assert found == {(tuple(sorted((A, B))), tuple(sorted((A, HOME)))): N}


class TestRuin:
    def test_frequencies(self, toy):
        alone = toy.with_robots(1)
        trail = (1, 2, 1)
        expected = Counter()
        for i, j, n_via in product(range(3), range(3), range(2)):
            low, high = min(i, j), max(i, j)
            if n_via == 0 and high - low < 2:
                n_via = 1
            for node in alone.nodes if n_via else [None]:
                put_in = (node,) * n_via
                weight = 1 / 18 / (len(alone.nodes) if n_via else 1)
                expected[(trail[: low + 1] + put_in + trail[high:],)] += weight
        assert_frequencies(mutated(RuinRecreate(max_via=1), alone, [trail], 20_000), expected)

    def test_only_one_robot_is_changed(self, toy):
        for draft in mutated(RuinRecreate(), toy, [A, B], 500):
            assert A in draft or B in draft

    def test_a_robot_at_base_may_go_out(self, toy):
        found = mutated(RuinRecreate(), toy, [HOME, HOME], 500)
        assert any(len(trail) == 4 for draft in found for trail in draft)


class TestShare:
    def test_copies(self, toy):
        found = mutated(ShareTrails(prob_copy=1), toy, [A, B])
        assert_frequencies(found, {(A, A): 0.5, (B, B): 0.5})

    def test_who_is_out_is_copied(self, toy):
        assert mutated(ShareTrails(prob_copy=1), toy, [A, HOME], 50) == {(A, A): 50}

    def test_swaps_at_a_shared_node(self, toy):
        one, other = (1, 2, 4, 3, 1), (1, 3, 4, 2, 1)
        # At 2, at 4, or at 3: what comes before in one, what comes after in the other.
        swaps = [
            tuple(sorted((one[:i] + other[j:], other[:j] + one[i:])))
            for i, j in [(1, 3), (2, 2), (3, 1)]
        ]
        expected = Counter()
        for swap in swaps:
            expected[swap] += 1 / 3
        assert_frequencies(mutated(ShareTrails(prob_copy=0), toy, [one, other]), expected)

    def test_swaps_anywhere_where_nothing_is_shared(self, toy):
        expected = Counter()
        for i, j in product(range(3), repeat=2):
            expected[tuple(sorted((A[:i] + B[j:], B[:j] + A[i:])))] += 1 / 9
        assert_frequencies(mutated(ShareTrails(prob_copy=0), toy, [A, B]), expected)

    def test_a_single_robot_has_nobody_to_share_with(self, toy):
        assert mutated(ShareTrails(), toy.with_robots(1), [A], 10) == {(A,): 10}


class TestSampling:
    def test_corners(self, toy):
        batch = CornerSampling().sample_batch(BOTOHE(toy), 5, np.random.default_rng(1))
        assert toy.labels(batch[0]) == ((1,), (1,))
        greedy = toy.evaluate([batch[1]])[0, 0]
        others = toy.evaluate(
            RandomTrailSampling().sample_batch(BOTOHE(toy), 300, np.random.default_rng(1))
        )
        assert greedy >= others[:, 0].max()
        assert len(batch) == 5
        assert len(CornerSampling().sample_batch(BOTOHE(toy), 1, np.random.default_rng(1))) == 1

    def test_guided_trails_are_better_than_random_ones(self):
        museum = load_mission("art_museum")
        guided, blind = (
            museum.evaluate(sampling.sample_batch(BOTOHE(museum), 500, np.random.default_rng(1)))
            for sampling in (GuidedTrailSampling(), RandomTrailSampling())
        )
        assert area_indicator(guided, museum) > 1.2 * area_indicator(blind, museum)

    def test_mixture(self, toy):
        mixed = MixedSampling([RandomTrailSampling(), GuidedTrailSampling()])
        assert len(mixed.sample_batch(BOTOHE(toy), 9, np.random.default_rng(1))) == 9
        with pytest.raises(TypeError, match="Expected a sampling to be a PlanSampling"):
            MixedSampling([TrailPlan([[0]])])
        with pytest.raises(TypeError, match="Expected rest to be a PlanSampling"):
            CornerSampling("guided")


class Short(PlanMutation, PlanSampling):
    """An operator that loses a plan."""

    def _draft(self, mission, plans, rng):
        return plans.take(np.arange(len(plans) - 1))

    def _sample(self, problem, n_samples, rng):
        return problem.mission.batch([problem.mission.stay_home()] * (n_samples - 1))


def test_operators_that_lose_plans_are_named(toy):
    rng = np.random.default_rng(0)
    plans = GuidedTrailSampling().sample_batch(BOTOHE(toy), 4, rng)
    with pytest.raises(ValueError, match=r"_draft of Short to give 4 drafts, got 3\."):
        Short().mutate_batch(toy, plans, rng)
    with pytest.raises(ValueError, match=r"_sample of Short to give 6 plans, got 5\."):
        Short().sample_batch(BOTOHE(toy), 6, rng)
