"""What crossovers and mutations draft, by hand and by enumeration."""

import math
from collections import Counter
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import BOTOHE, TrailPlan, load_mission
from botohe_moo.algorithms import GuidedTrailSampling
from botohe_moo.operators import PenaltyOnly, RuinRecreate, ShareTrails, TrailSplice
from botohe_moo.trails import PlanBatch
from tests.examples import examples
from tests.strategies import plans, team_missions
from tests.twins import assert_frequencies, ends_of

N = 6_000


TOY = load_mission("toy")
ALONE = TOY.with_robots(1)


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


HOME, A, B, C = (1,), (1, 2, 1), (1, 3, 1), (1, 2, 4, 3, 1)


@pytest.mark.parametrize("operator", [TrailSplice, ShareTrails, RuinRecreate])
@examples(60)
@given(team_missions(max_robots=3), st.data())
def test_robots_get_trails_of_their_kind(operator, mission, data):
    made = operator(repair=PenaltyOnly())
    parents = [TrailPlan(data.draw(plans(mission))) for _ in range(2)]
    X = np.array(parents, dtype=object).reshape(2, 1, 1).repeat(20, axis=1)
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    X = X if operator is TrailSplice else X.reshape(-1, 1)
    children = made._do(BOTOHE(mission), X, random_state=rng)
    for child in children.ravel():
        for robot, trail in enumerate(child.trails):
            assert operator is not TrailSplice or (trail[0], trail[-1]) == ends_of(mission, robot)
            assert len({node // len(mission.nodes) for node in trail}) == 1


class TestSplice:
    def test_children_swap_what_comes_after_a_shared_node(self):
        # The one robot of each that is out; both visit 2 once.
        found = crossed(TrailSplice, TOY, [HOME, C], [A, HOME])
        child, other = (HOME, A), (HOME, C)
        assert found == {(tuple(sorted(child)), tuple(sorted(other))): N}

    def test_places_are_equally_likely(self):
        mine, others = (1, 2, 4, 2, 1), (1, 3, 4, 2, 1)
        expected = Counter()
        places = [(i, j) for i, j in product((1, 2, 3), repeat=2) if mine[i] == others[j]]
        assert len(places) == 3
        for i, j in places:
            first, second = mine[:i] + others[j:], others[:j] + mine[i:]
            expected[(first,), (second,)] += 1 / 3
        assert_frequencies(crossed(TrailSplice, ALONE, [mine], [others]), expected)

    def test_trails_that_share_no_node_change_places(self):
        found = crossed(TrailSplice, TOY, [A, A], [B, HOME])
        assert found == {(tuple(sorted((A, B))), tuple(sorted((A, HOME)))): N}


class TestRuin:
    def test_frequencies(self):
        trail = (1, 2, 1)
        expected = Counter()
        for i, j, n_via in product(range(3), range(3), range(2)):
            low, high = min(i, j), max(i, j)
            if n_via == 0 and high - low < 2:
                n_via = 1
            for node in ALONE.nodes if n_via else [None]:
                put_in = (node,) * n_via
                weight = 1 / 18 / (len(ALONE.nodes) if n_via else 1)
                expected[(trail[: low + 1] + put_in + trail[high:],)] += weight
        mutation = RuinRecreate(max_via=1, prob_small=0)
        assert_frequencies(mutated(mutation, ALONE, [trail], 20_000), expected)

    def test_small_changes_are_short_and_lead_to_neighbours(self):
        trail = (1, 2, 4, 2, 1)
        expected = Counter()
        for low, n_via in product(range(5), range(2)):
            room = 5 - low
            for span in range(room):
                high = low + span
                n_new = 1 if span < 2 else n_via
                neighbours = sorted(ALONE.graph.successors(trail[low])) if n_new else [None]
                weight = math.log((span + 2) / (span + 1), room + 1) / 10 / len(neighbours)
                for node in neighbours:
                    draft = trail[: low + 1] + (node,) * n_new + trail[high:]
                    expected[(draft,)] += weight
        mutation = RuinRecreate(max_via=1, prob_small=1)
        assert_frequencies(mutated(mutation, ALONE, [trail], 20_000), expected)

    def test_small_changes_of_valid_plans_often_need_no_repair(self):
        # Where faults only count as violation, plans could hardly change otherwise.
        mission = load_mission("two_communities", seed=0)
        plans = GuidedTrailSampling().sample_batch(BOTOHE(mission), 500, np.random.default_rng(1))
        valid = []
        for prob_small in (0, 1):
            mutation = RuinRecreate(prob_small=prob_small, repair=PenaltyOnly())
            drafts = mutation.mutate_batch(mission, plans, np.random.default_rng(5))
            is_new = [draft != plan for draft, plan in zip(drafts, plans, strict=True)]
            valid.append(np.mean((mission.evaluate_drafts(drafts)[1] == 0) & is_new))
        assert valid[1] > 2 * valid[0]

    def test_one_robot_is_changed_also_one_at_base(self):
        for draft in mutated(RuinRecreate(), TOY, [A, B], 500):
            assert A in draft or B in draft
        found = mutated(RuinRecreate(), TOY, [HOME, HOME], 500)
        assert any(len(trail) == 4 for draft in found for trail in draft)


class TestShare:
    def test_who_is_out_is_copied(self):
        found = mutated(ShareTrails(prob_copy=1), TOY, [A, B])
        assert_frequencies(found, {(A, A): 0.5, (B, B): 0.5})
        assert mutated(ShareTrails(prob_copy=1), TOY, [A, HOME], 50) == {(A, A): 50}

    def test_copies_are_as_frequent_as_they_should_be(self):
        found = mutated(ShareTrails(prob_copy=0.3), TOY, [A, B])
        n_copies = found[A, A] + found[B, B]
        assert_frequencies(Counter(copy=n_copies, swap=N - n_copies), {"copy": 0.3, "swap": 0.7})

    def test_swaps_at_a_shared_node(self):
        one, other = (1, 2, 4, 3, 1), (1, 3, 4, 2, 1)
        # At 2, at 4, or at 3: what comes before in one, what comes after in the other.
        swaps = [
            tuple(sorted((one[:i] + other[j:], other[:j] + one[i:])))
            for i, j in [(1, 3), (2, 2), (3, 1)]
        ]
        expected = Counter()
        for swap in swaps:
            expected[swap] += 1 / 3
        assert_frequencies(mutated(ShareTrails(prob_copy=0), TOY, [one, other]), expected)

    def test_swaps_anywhere_where_nothing_is_shared(self):
        expected = Counter()
        for i, j in product(range(3), repeat=2):
            expected[tuple(sorted((A[:i] + B[j:], B[:j] + A[i:])))] += 1 / 9
        assert_frequencies(mutated(ShareTrails(prob_copy=0), TOY, [A, B]), expected)

    def test_a_single_robot_has_nobody_to_share_with(self):
        assert mutated(ShareTrails(), ALONE, [A], 10) == {(A,): 10}
