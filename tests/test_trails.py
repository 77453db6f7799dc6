"""Trail plans as multisets, what numpy and pickle make of them, and batches of them."""

import copy
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.population import Population

from botohe_moo.trails import PlanBatch, TrailPlan

A, B = [0, 1, 0], [0, 2, 3, 0]
MAX_INDEX = 2**31 - 1

trail_lists = st.lists(st.integers(0, MAX_INDEX), min_size=1, max_size=6)


@st.composite
def plan_lists(draw):
    """A team size, and the trails of several plans of that team."""
    n_robots = draw(st.integers(1, 4))
    plans = st.lists(trail_lists, min_size=n_robots, max_size=n_robots)
    return n_robots, draw(st.lists(plans, max_size=6))


class TestEquality:
    def test_robots_are_identical(self):
        assert TrailPlan([A, B, [0]]) == TrailPlan([[0], A, B])

    def test_how_often_a_trail_occurs_counts(self):
        # The set of trails, which the journal's code compared, is {A, B} for both.
        assert TrailPlan([A, A, B]) != TrailPlan([A, B, B])
        assert TrailPlan([A]) != TrailPlan([A, A])

    def test_plans_work_in_sets_and_dicts(self):
        plans = [TrailPlan(trails) for trails in ([A, A, B], [A, B, A], [A, B, B], [B, A, A])]
        assert len(set(plans)) == 2
        assert {plans[0]: "first"}[plans[3]] == "first"
        assert plans[2] not in {plans[0], plans[1]}
        assert plans.index(plans[2]) == 2

    @given(plan_lists(), st.randoms(use_true_random=False))
    def test_equal_exactly_when_the_sorted_trails_are(self, drawn, random):
        _, listed = drawn
        for trails in listed:
            shuffled = random.sample(trails, len(trails))
            assert TrailPlan(trails) == TrailPlan(shuffled)
            assert hash(TrailPlan(trails)) == hash(TrailPlan(shuffled))
        for one in listed:
            for other in listed:
                assert (TrailPlan(one) == TrailPlan(other)) == (sorted(one) == sorted(other))


class TestPlan:
    def test_the_order_of_the_robots_is_kept(self):
        plan = TrailPlan([B, [0], A])
        assert plan.trails == ((0, 2, 3, 0), (0,), (0, 1, 0))
        assert plan.n_robots == 3

    def test_the_layout_is_ragged(self):
        plan = TrailPlan([B, [0], A])
        assert plan.nodes.tolist() == [0, 2, 3, 0, 0, 0, 1, 0]
        assert plan.offsets.tolist() == [0, 4, 5, 8]
        assert (plan.nodes.dtype, plan.offsets.dtype) == (np.int32, np.int64)

    def test_any_sequences_of_integers_will_do(self):
        for trails in (
            iter([(0, 1, 0), [0, 2, 0]]),
            np.array([[0, 1, 0], [0, 2, 0]]),
            [np.array([0, 1, 0], np.uint8), [np.int64(0), 2, 0]],
        ):
            assert TrailPlan(trails).trails == ((0, 1, 0), (0, 2, 0))

    def test_repr_makes_the_plan_again(self):
        plan = TrailPlan([B, [0], A])
        assert repr(plan) == "TrailPlan([[0, 2, 3, 0], [0], [0, 1, 0]])"
        assert eval(repr(plan)).trails == plan.trails

    @given(plan_lists())
    def test_trails_come_back(self, drawn):
        for trails in drawn[1]:
            assert [list(trail) for trail in TrailPlan(trails).trails] == trails


class TestImmutability:
    def test_arrays_cannot_be_written(self):
        plan = TrailPlan([A, B])
        for array in (plan.nodes, plan.offsets):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 5

    def test_a_single_array_is_not_taken_over(self):
        array = np.array([0, 1, 0], np.int32)
        plan = TrailPlan([array])
        array[1] = 7
        assert plan.trails == ((0, 1, 0),)

    def test_attributes_cannot_be_set(self):
        with pytest.raises(AttributeError):
            TrailPlan([A]).nodes = 1


class TestCopies:
    def test_pickle(self):
        plan = TrailPlan([B, [0], A])
        again = pickle.loads(pickle.dumps(plan))
        assert again == plan
        assert again.trails == plan.trails
        assert hash(again) == hash(plan)

    def test_a_hash_does_not_travel(self):
        # Python salts the hashes of bytes: one from another process would find nothing in a set.
        code = (
            "import pickle, sys; from botohe_moo.trails import TrailPlan; "
            "plan = TrailPlan([[0, 1, 0], [0]]); hash(plan); "
            "sys.stdout.buffer.write(pickle.dumps(plan))"
        )
        for salt in ("1", "2"):
            done = subprocess.run(
                [sys.executable, "-c", code],
                env={**os.environ, "PYTHONHASHSEED": salt},
                capture_output=True,
                check=True,
            )
            assert pickle.loads(done.stdout) in {TrailPlan([[0], A])}

    def test_a_copy_is_the_plan_itself(self):
        plan = TrailPlan([A, B])
        assert copy.deepcopy(plan) is plan
        assert copy.deepcopy([plan])[0] is plan


class TestNumpy:
    """Numpy unpacks whatever looks like a sequence; plans must stay whole in its arrays."""

    def test_arrays_hold_whole_plans(self):
        plan = TrailPlan([A, B])
        for array, shape in [
            (np.array([plan], dtype=object), (1,)),
            (np.array([plan]), (1,)),
            (np.array([[plan], [plan]], dtype=object), (2, 1)),
            (np.asarray(plan), ()),
            (np.full((2, 1), plan, dtype=object), (2, 1)),
        ]:
            assert (array.shape, array.dtype) == (shape, object)
            assert all(item is plan for item in array.ravel())

    def test_a_population_gives_a_column(self):
        plans = [TrailPlan([A]), TrailPlan([B]), TrailPlan([[0]])]
        column = PlanBatch.from_plans(plans, 1).to_array()
        x = Population.new(X=column).get("X")
        assert (x.shape, x.dtype) == ((3, 1), object)
        assert x[:, 0].tolist() == plans


class TestBadPlans:
    def test_no_trail(self):
        for trail in ([], [[0, 1], [0]]):
            with pytest.raises(ValueError, match=r"^Robot 1: expected a trail, a sequence"):
                TrailPlan([[0], trail])

    @pytest.mark.parametrize("trail", [[0, -1, 0], [0, 1.0, 0], [0, MAX_INDEX + 1, 0]])
    def test_no_indices(self, trail):
        with pytest.raises(ValueError, match=r"^Robot 1: expected node indices .*, got .+\.$"):
            TrailPlan([[0], trail])

    def test_no_trails(self):
        with pytest.raises(ValueError, match=r"^Expected at least one trail, got none"):
            TrailPlan([])

    def test_a_flat_list(self):
        with pytest.raises(ValueError, match=r"^Robot 0: expected a trail, a sequence .*, got 0;"):
            TrailPlan([0, 1, 0])


@pytest.fixture
def plans():
    return [TrailPlan(trails) for trails in ([A, [0]], [[0], B], [[0], [0]], [B, A], [A, [0]])]


@pytest.fixture
def batch(plans):
    return PlanBatch.from_plans(plans, 2)


def trails_of(plans):
    """The trails, because equality of plans would not see another order of the robots."""
    return [plan.trails for plan in plans]


class TestBatch:
    def test_the_layout_is_ragged(self):
        batch = PlanBatch.from_plans([TrailPlan([A, [0]]), TrailPlan([[0], B])], 2)
        assert batch.nodes.tolist() == [0, 1, 0, 0, 0, 0, 2, 3, 0]
        assert batch.offsets.tolist() == [0, 3, 4, 5, 9]
        assert (batch.nodes.dtype, batch.offsets.dtype) == (np.int32, np.int64)
        assert (batch.n_robots, len(batch)) == (2, 2)

    def test_plans_come_back(self, plans, batch):
        assert trails_of(batch) == trails_of(plans)
        assert trails_of(batch[i] for i in range(len(plans))) == trails_of(plans)

    def test_indices_beyond_the_batch(self, batch):
        for index in (5, -6):
            with pytest.raises(IndexError):
                batch[index]

    def test_slices_are_batches(self, plans, batch):
        cut = slice(4, 0, -2)
        part = batch[cut]
        assert isinstance(part, PlanBatch)
        assert part.n_robots == 2
        assert trails_of(part) == trails_of(plans[cut])
        assert (part.nodes.dtype, part.offsets.dtype) == (np.int32, np.int64)
        assert part.offsets[-1] == len(part.nodes)

    def test_arrays_are_read_only(self, batch):
        for array in (batch[0].nodes, batch[0].offsets, batch.nodes, batch.offsets):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1

    def test_to_array_is_what_pymoo_calls_x(self, plans, batch):
        array = batch.to_array()
        assert (array.shape, array.dtype) == ((5, 1), object)
        assert trails_of(array[:, 0]) == trails_of(plans)

    def test_an_empty_batch(self):
        batch = PlanBatch.from_plans([], 3)
        assert (len(batch), batch.n_robots, list(batch)) == (0, 3, [])
        assert batch.offsets.tolist() == [0]
        assert batch.to_array().shape == (0, 1)
        assert len(batch[:]) == 0

    def test_repr(self, batch):
        assert repr(batch) == "<PlanBatch of 5 plans, 2 robots, 22 nodes>"

    def test_pickle(self, plans, batch):
        again = pickle.loads(pickle.dumps(batch))
        assert trails_of(again) == trails_of(plans)
        assert again.n_robots == 2

    @given(plan_lists(), st.slices(6))
    def test_round_trips(self, drawn, cut):
        n_robots, listed = drawn
        plans = [TrailPlan(trails) for trails in listed]
        batch = PlanBatch.from_plans(plans, n_robots)
        assert trails_of(batch) == trails_of(plans)
        assert trails_of(PlanBatch.from_plans(batch.to_array(), n_robots)) == trails_of(plans)
        assert trails_of(batch[cut]) == trails_of(plans[cut])
        again = PlanBatch(batch.nodes, batch.offsets, n_robots)
        assert trails_of(again) == trails_of(plans)


class TestBatchFromPlans:
    def test_any_container_will_do(self, plans):
        column = np.array([[plan] for plan in plans], dtype=object)
        for container in (tuple(plans), iter(plans), column, column[:, 0]):
            assert trails_of(PlanBatch.from_plans(container, 2)) == trails_of(plans)

    def test_one_plan_alone(self):
        with pytest.raises(TypeError, match=r"^Expected a sequence of TrailPlans, got one"):
            PlanBatch.from_plans(TrailPlan([A]), 1)

    def test_something_else_among_plans(self):
        with pytest.raises(TypeError, match=r"^Plan 1: expected a TrailPlan, got"):
            PlanBatch.from_plans([TrailPlan([A]), [A]], 1)

    def test_another_team_size(self):
        with pytest.raises(ValueError, match=r"^Plan 1: expected 2 trails, got 3\.$"):
            PlanBatch.from_plans([TrailPlan([A, A]), TrailPlan([A, A, A])], 2)


class TestBatchFromArrays:
    def test_lists_will_do(self):
        batch = PlanBatch([0, 1, 0, 0], [0, 3, 4], 2)
        assert trails_of(batch) == [((0, 1, 0), (0,))]
        assert (batch.nodes.dtype, batch.offsets.dtype) == (np.int32, np.int64)

    @pytest.mark.parametrize(
        ("nodes", "offsets", "n_robots", "message"),
        [
            ([0], [0, 1], 0, r"Expected n_robots >= 1, got 0\."),
            ([0, 0], [1, 2], 1, r"Expected offsets that ascend from 0 .* \(2\), got \[1 2\]"),
            ([0, 0], [0, 1], 1, r"Expected offsets that ascend from 0 .* \(2\), got \[0 1\]"),
            ([0, 0], [0, 2, 1, 2], 1, r"Expected offsets that ascend from 0"),
            ([0, 0, 0], [0, 1, 2, 3], 2, "Expected a multiple of n_robots = 2 trails, got 3"),
        ],
    )
    def test_bad_arrays(self, nodes, offsets, n_robots, message):
        with pytest.raises(ValueError, match=f"^{message}"):
            PlanBatch(nodes, offsets, n_robots)
