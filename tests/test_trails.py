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

from botohe_moo.trails import PlanBatch, TrailPlan, listed_plans

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
    def test_plans_are_multisets_of_trails(self):
        # The set of trails, which the journal's code compared, is {A, B} for both.
        assert TrailPlan([A, A, B]) != TrailPlan([A, B, B])
        assert TrailPlan([A]) not in (TrailPlan([A, A]), [A])

    @given(plan_lists(), st.randoms(use_true_random=False))
    def test_equal_exactly_when_the_sorted_trails_are(self, drawn, random):
        for trails in drawn[1]:
            shuffled = random.sample(trails, len(trails))
            assert TrailPlan(trails) == TrailPlan(shuffled)
            assert hash(TrailPlan(trails)) == hash(TrailPlan(shuffled))
            for other in drawn[1]:
                assert (TrailPlan(trails) == TrailPlan(other)) == (sorted(trails) == sorted(other))

    def test_a_hash_does_not_travel(self):
        # Python salts the hashes of bytes: one from another process would find nothing in a set.
        code = "import pickle, sys; from botohe_moo import TrailPlan; plan = TrailPlan([[0, 1, 0], "
        code += "[0]]); hash(plan); sys.stdout.buffer.write(pickle.dumps(plan))"
        env = {**os.environ, "PYTHONHASHSEED": "1"}
        done = subprocess.run(
            [sys.executable, "-c", code], env=env, capture_output=True, check=True
        )
        assert pickle.loads(done.stdout) in {TrailPlan([[0], A])}


class TestPlan:
    def test_the_layout_is_ragged_and_in_the_order_of_the_robots(self):
        plan = TrailPlan([B, [0], A])
        assert plan.trails == ((0, 2, 3, 0), (0,), (0, 1, 0))
        assert plan.n_robots == 3
        assert plan.nodes.tolist() == [0, 2, 3, 0, 0, 0, 1, 0]
        assert plan.offsets.tolist() == [0, 4, 5, 8]
        assert (plan.nodes.dtype, plan.offsets.dtype) == (np.int32, np.int64)
        assert repr(plan) == "TrailPlan([[0, 2, 3, 0], [0], [0, 1, 0]])"
        for again in (eval(repr(plan)), pickle.loads(pickle.dumps(plan))):
            assert (again, again.trails) == (plan, plan.trails)
        assert copy.deepcopy([plan])[0] is plan

    def test_any_sequences_of_integers_will_do(self):
        for trails in (
            iter([(0, 1, 0), [0, 2, 0]]),
            np.array([[0, 1, 0], [0, 2, 0]]),
            [np.array([0, 1, 0], np.uint8), [np.int64(0), 2, 0]],
        ):
            assert TrailPlan(trails).trails == ((0, 1, 0), (0, 2, 0))

    def test_it_cannot_be_changed(self):
        array = np.array([0, 1, 0], np.int32)
        plan = TrailPlan([array])
        array[1] = 7  # the plan has its own
        assert plan.trails == ((0, 1, 0),)
        batch = PlanBatch.from_plans([plan], 1)
        for view in (plan.nodes, plan.offsets, batch.nodes, batch.offsets, batch[0].nodes):
            with pytest.raises(ValueError, match="read-only"):
                view[0] = 5
        with pytest.raises(AttributeError):
            plan.nodes = 1

    def test_what_is_no_plan_is_refused(self):
        for trails, message in (
            ([], "Expected at least one trail, got none"),
            ([0, 1, 0], "Robot 0: expected a trail, a sequence .*, got 0;"),
            ([[0], []], "Robot 1: expected a trail, a sequence"),
            ([[0], [[0, 1], [0]]], "Robot 1: expected a trail, a sequence"),
            *(([[0], [0, n, 0]], "Robot 1: expected node indices") for n in (-1, 1.0, 2**31)),
        ):
            with pytest.raises(ValueError, match=f"^{message}"):
                TrailPlan(trails)

    def test_numpy_leaves_plans_whole(self):
        """Numpy unpacks whatever looks like a sequence."""
        plan = TrailPlan([A, B])
        for array, shape in (
            (np.array([plan]), (1,)),
            (np.array([[plan], [plan]], dtype=object), (2, 1)),
            (np.asarray(plan), ()),
        ):
            assert (array.shape, array.dtype) == (shape, object)
            assert all(item is plan for item in array.ravel())
        x = Population.new(X=PlanBatch.from_plans([plan] * 3, 2).to_array()).get("X")
        assert (x.shape, x.dtype) == ((3, 1), object)
        assert listed_plans(Population.new(X=x)) == x[:, 0].tolist() == [plan] * 3


def trails_of(plans):
    """The trails, because equality of plans would not see another order of the robots."""
    return [plan.trails for plan in plans]


class TestBatch:
    def test_the_layout_is_ragged(self):
        plans = [TrailPlan([A, [0]]), TrailPlan([[0], B])]
        column = np.array([[plan] for plan in plans], dtype=object)
        for container in (plans, tuple(plans), iter(plans), column, column[:, 0]):
            batch = PlanBatch.from_plans(container, 2)
            assert batch.nodes.tolist() == [0, 1, 0, 0, 0, 0, 2, 3, 0]
            assert batch.offsets.tolist() == [0, 3, 4, 5, 9]
            assert (batch.nodes.dtype, batch.offsets.dtype) == (np.int32, np.int64)
            assert (batch.n_robots, len(batch)) == (2, 2)
        assert repr(batch) == "<PlanBatch of 2 plans, 2 robots, 9 nodes>"
        listed = PlanBatch([0, 1, 0, 0], [0, 3, 4], 2)  # lists will do
        assert trails_of(listed) == [((0, 1, 0), (0,))]

    @given(plan_lists(), st.slices(6))
    def test_plans_come_back(self, drawn, cut):
        n_robots, listed = drawn
        plans = [TrailPlan(trails) for trails in listed]
        trails = [tuple(map(tuple, trails)) for trails in listed]
        batch, n = PlanBatch.from_plans(plans, n_robots), len(plans)
        array, part = batch.to_array(), batch[cut]
        assert (array.shape, array.dtype, len(batch)) == ((n, 1), object, n)
        for again in (
            *(plans, batch, [batch[i] for i in range(n)], [batch[i - n] for i in range(n)]),
            *(array[:, 0], PlanBatch.from_plans(array, n_robots), batch.take(np.ones(n, bool))),
            PlanBatch(batch.nodes, batch.offsets, n_robots),
            pickle.loads(pickle.dumps(batch)),
        ):
            assert trails_of(again) == trails
        assert trails_of(part) == trails[cut]
        assert (type(part), part.n_robots) == (PlanBatch, n_robots)
        assert (part.nodes.dtype, part.offsets.dtype) == (np.int32, np.int64)
        assert part.offsets[-1] == len(part.nodes)
        assert trails_of(PlanBatch.concatenate([part, batch])) == [*trails[cut], *trails]
        for index in (n, -n - 1):
            with pytest.raises(IndexError):
                batch[index]

    def test_what_is_refused(self):
        of_plans, one = PlanBatch.from_plans, TrailPlan([A])
        for make, arguments, message in (
            (of_plans, (one, 1), "a sequence of TrailPlans, got one"),
            (of_plans, ([one, [A]], 1), "Plan 1: expected a TrailPlan, got"),
            (of_plans, ([one], 2), r"Plan 0: expected 2 trails, got 1\.$"),
            (PlanBatch, ([0], [0, 1], 0), r"Expected n_robots >= 1, got 0\."),
            (PlanBatch, ([0, 0], [1, 2], 1), r"Expected offsets that .* \(2\), got \[1 2\]"),
            (PlanBatch, ([0, 0], [0, 1], 1), r"Expected offsets that .* \(2\), got \[0 1\]"),
            (PlanBatch, ([0, 0], [0, 2, 1, 2], 1), "Expected offsets that ascend from 0"),
            (PlanBatch, ([0, 0, 0], [0, 1, 2, 3], 2), "a multiple of n_robots = 2 trails, got 3"),
            (listed_plans, ([[A]],), "Expected sampling to hold TrailPlans, got"),
        ):
            with pytest.raises((TypeError, ValueError), match=message):
                make(*arguments)
