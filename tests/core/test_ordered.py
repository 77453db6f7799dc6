"""The front in blocks against a sorted list, in plain Python."""

from bisect import bisect_left, bisect_right

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.algorithms.local_search.engine import _most_contributing
from botohe_moo.algorithms.local_search.kernels import plans
from botohe_moo.algorithms.local_search.kernels.trail_store import copy_trails, new_store, release
from botohe_moo.core import ordered as kernels
from botohe_moo.core.ordered import BLOCK
from botohe_moo.core.rng import seed_states
from tests.examples import examples


@pytest.fixture(autouse=True)
def no_warnings():
    """Kernels' integers wrap around, also where numpy would warn."""
    with np.errstate(all="ignore"):
        yield


class Pair:
    """A front of plans with one trail each, and its twin: lists by ascending E[S]."""

    def __init__(self, n_slots):
        self.front, self.store = kernels.new_front(n_slots, 1), new_store(n_slots + 1, 0, 0)
        self.survivors, self.rewards, self.trails = [], [], []

    def enter(self, reward, survivors):
        """Put a plan into both."""
        self.store.n.spare -= 1
        trail = int(self.store.spare[self.store.n.spare])
        self.store.trails[trail].n_users = 1
        entered = plans.insert(self.store, self.front, np.array([trail]), reward, survivors, 0.0)
        release(self.store, trail)
        assert entered == self._enter_list(reward, survivors, trail)

    def _enter_list(self, reward, survivors, trail):
        as_safe = bisect_left(self.survivors, survivors)
        if as_safe < len(self.rewards) and self.rewards[as_safe] >= reward:
            return False
        at = bisect_right(self.survivors, survivors)
        while at > 0 and self.rewards[at - 1] <= reward:
            at -= 1
            self._leave(at)
        for held, value in zip(self.lists, (survivors, reward, trail), strict=True):
            held.insert(at, value)
        return True

    def remove(self, index):
        """Take the plan at an index out of both."""
        at, place = self.place(index)
        slot = kernels.remove_place(self.front, at, place)
        release(self.store, self.front.plan[slot, 0])
        self._leave(index)

    def _leave(self, index):
        for held in self.lists:
            del held[index]

    @property
    def lists(self):
        return self.survivors, self.rewards, self.trails

    def place(self, index):
        """Where the plan at an index should be: block in the directory, and place."""
        n_blocks = int(self.front.n.blocks)
        for at in range(n_blocks):
            size = int(self.front.size[self.front.directory[at]])
            if index < size:
                return at, index
            index -= size
        return n_blocks, 0

    def read(self):
        slots, objectives = kernels.read_front(self.front)
        assert len(slots) == len(objectives) == self.front.n.plans
        return slots, objectives

    def check(self):
        """Whether both hold the same, and nothing is lost in between."""
        front, (slots, objectives) = self.front, self.read()
        assert objectives.tolist() == list(
            map(list, zip(self.rewards, self.survivors, strict=True))
        )
        assert front.plan[slots, 0].tolist() == self.trails
        users = self.store.trails["n_users"]
        used = np.flatnonzero(users)
        assert sorted(self.trails) == used.tolist()
        assert (users[used] == 1).all()
        spare = front.spare_slots[: front.n.spare].tolist()
        assert sorted([*slots.tolist(), *spare]) == list(range(len(front.serial)))
        blocks = front.directory[: front.n.blocks].tolist()
        spare = front.free_blocks[: front.n.free].tolist()
        assert sorted([*blocks, *spare]) == list(range(len(front.directory)))
        sizes = front.size[blocks]
        assert ((sizes > 0) & (sizes <= BLOCK)).all()
        assert (sizes[1:] + sizes[:-1] > BLOCK // 2).all()

    def check_finding(self, survivors):
        index = bisect_left(self.survivors, survivors)
        assert kernels.find_place(self.front, survivors) == self.place(index)
        best = self.rewards[index] if index < len(self.rewards) else -1.0
        assert kernels.best_reward(self.front, survivors) == best

    def check_contribution(self, index):
        area = kernels.contribution(self.front, *self.place(index))
        if 0 < index < len(self.rewards) - 1:
            width = self.rewards[index - 1] - self.rewards[index + 1]
            assert area == width * (self.survivors[index + 1] - self.survivors[index - 1])
        else:
            width, height = (
                self.rewards[0] - self.rewards[-1],
                self.survivors[-1] - self.survivors[0],
            )
            assert area == pytest.approx(4 * width * height / len(self.rewards) ** 2)

    def check_slopes(self):
        """What each plan's neighbours, or it itself at an end, lose of E[R] for a survivor."""
        rewards, survivors = (np.pad(column, 1, "edge") for column in self.lists[1::-1])
        more = survivors[2:] - survivors[:-2]
        expected = (rewards[:-2] - rewards[2:]) / np.where(more > 0, more, 1.0)
        found = [kernels.slope_at(self.front, *self.place(i)) for i in range(len(self.rewards))]
        assert found == expected.tolist()


@examples(100)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=30), st.data())
def test_few_plans_with_many_ties(plans, data):
    pair = Pair(64)
    for reward, survivors in plans:
        pair.enter(float(reward), float(survivors))
        pair.check_finding(float(survivors))
        pair.check_finding(survivors + 0.5)
        pair.check_slopes()
    pair.check()
    while pair.trails:
        pair.remove(data.draw(st.integers(0, len(pair.trails) - 1)))
        pair.check()


@pytest.mark.parametrize("noise", [pytest.param(1e-4, marks=pytest.mark.slow), 0.01])
def test_thousands_of_plans_come_and_go(noise):
    """Blocks split and merge; the noise decides how many plans those that enter dominate."""
    rng = np.random.default_rng(5)
    pair = Pair(1_500)
    most = 0
    for share_entering in (1.0, 0.8, 0.1, 0.7, 0.0):
        for _ in range(800):
            if rng.random() < share_entering and len(pair.trails) < 1_500:
                survivors = rng.random()
                pair.enter(1.0 - survivors + noise * rng.random(), survivors)
            elif pair.trails:
                pair.remove(int(rng.integers(len(pair.trails))))
        pair.check()
        for survivors in (*rng.random(20), *pair.survivors[::200], 0.0, 1.0):
            pair.check_finding(survivors)
        for index in range(0, len(pair.trails), 17):
            pair.check_contribution(index)
        if pair.trails:
            pair.check_slopes()
            most = max(most, int(pair.front.n.blocks))
    assert most > (10 if noise < 0.01 else 1)


@pytest.mark.parametrize("place", [0, 32, BLOCK])
def test_a_full_block_splits_where_a_plan_enters(place):
    pair = Pair(100)
    for i in range(BLOCK + 1):
        if i != place:
            pair.enter(100.0 - i, float(i))
    assert pair.front.n.blocks == 1
    pair.enter(100.0 - place, float(place))
    assert pair.front.n.blocks == 2
    pair.check()


def test_contributions_by_hand():
    pair = Pair(8)
    for reward, survivors in ((10.0, 1.0), (7.0, 2.0), (3.0, 4.0)):
        pair.enter(reward, survivors)
    assert kernels.contribution(pair.front, 0, 1) == (10 - 3) * (4 - 1)
    # Three plans, evenly spaced, over 7 rewards and 3 survivors: two gaps of three either way.
    for end in (0, 2):
        assert kernels.contribution(pair.front, 0, end) == pytest.approx(2 / 3 * 7 * 2 / 3 * 3)


@pytest.mark.parametrize("n", [5, 300])
def test_plans_are_drawn_uniformly(n):
    pair = Pair(n)
    for i in np.random.default_rng(1).permutation(n).tolist():
        pair.enter(float(n - i), float(i))
    sizes = pair.front.size[pair.front.directory[: pair.front.n.blocks]]
    assert n < 300 or len(set(sizes.tolist())) > 2
    starts = np.concatenate([[0], np.cumsum(sizes)])
    states, drawn = seed_states(np.random.default_rng(7), 1), np.zeros(n)
    for _ in range(40 * n):
        at, place = kernels.draw_place(pair.front, states)
        drawn[starts[at] + place] += 1
    chi_square = ((drawn - 40) ** 2 / 40).sum()
    assert chi_square <= (n - 1) + 5 * np.sqrt(2 * n)


@pytest.mark.parametrize(("n", "every"), [(0, 1), (300, 3)])
def test_a_larger_front_holds_the_same_and_goes_on(n, every):
    rng = np.random.default_rng(n)
    pair = Pair(300)
    for _ in range(n):
        survivors = rng.random()
        pair.enter(1.0 - survivors, survivors)
    for index in rng.permutation(len(pair.trails))[: n // 3]:
        pair.remove(int(index) % len(pair.trails))
    slots = pair.read()[0]
    kept = slots[::every]
    serials, tried = pair.front.serial[kept].tolist(), rng.integers(0, 9, len(kept))
    pair.front.tried[kept] = tried
    pair.front = kernels.copy_front(pair.front, kept, 605)
    for index in reversed(range(len(slots))):
        if index % every:
            release(pair.store, pair.trails[index])
            pair._leave(index)
    assert len(pair.front.serial) == 605
    pair.store = larger_store(pair.store, 606)
    pair.check()
    slots = pair.read()[0]
    assert pair.front.serial[slots].tolist() == serials
    assert pair.front.tried[slots].tolist() == tried.tolist()
    assert pair.front.n.entered == n
    for _ in range(300):
        survivors = rng.random()
        pair.enter(1.0 - survivors, survivors)
    pair.check()


def larger_store(store, n_trails):
    larger = new_store(n_trails, 0, 0)
    copy_trails(store, larger)
    return larger


def test_thinning_takes_what_contributes_least_and_leaves_the_ends():
    n = 100
    objectives = np.column_stack([100.0 - np.arange(n), np.arange(n)])
    objectives[50, 0] -= 0.9  # the next one stands close to it
    assert np.delete(np.arange(n), 51).tolist() == _most_contributing(objectives, n - 1).tolist()
    for n_most in range(n, 1, -1):
        kept = _most_contributing(objectives, n_most)
        assert len(kept) == n_most
        assert (kept[0], kept[-1]) == (0, n - 1)
        assert (np.diff(kept) > 0).all()
    # Evenly spaced plans: no gap is wide.
    assert np.diff(_most_contributing(objectives, 50)).max() <= 3
