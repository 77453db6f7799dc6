"""The front in blocks against a sorted list, in plain Python."""

from bisect import bisect_left, bisect_right

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo.kernels.local_search import front as kernels
from botohe_moo.kernels.local_search import members
from botohe_moo.kernels.local_search.front import BLOCK
from botohe_moo.kernels.local_search.trail_store import N_SPARE_TRAILS, new_store
from botohe_moo.kernels.rng import seed_states
from botohe_moo.search import local_search
from tests.twins import plain_local_search


@pytest.fixture(autouse=True, scope="module")
def plain():
    with plain_local_search():
        yield


class Pair:
    """A front of plans with one trail each, and its twin: lists by ascending E[S]."""

    def __init__(self, n_slots):
        self.front, self.store = kernels.new_front(n_slots, 1), new_store(n_slots + 1, 0, 0, 1)
        self.survivors, self.rewards, self.trails = [], [], []

    def enter(self, reward, survivors):
        """Put a plan into both."""
        counts = self.store.counts
        counts[N_SPARE_TRAILS] -= 1
        trail = int(self.store.spare[counts[N_SPARE_TRAILS]])
        self.store.n_users[trail] = 1
        trails = np.array([trail], np.int32)
        entered = members.enter(self.store, self.front, trails, reward, survivors)
        members.release(self.store, trail)
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
        members.release(self.store, self.front.plan[slot, 0])
        self._leave(index)

    def _leave(self, index):
        for held in self.lists:
            del held[index]

    @property
    def lists(self):
        return self.survivors, self.rewards, self.trails

    def place(self, index):
        """Where the plan at an index should be: block in the directory, and place."""
        n_blocks = int(self.front.counts[kernels.N_BLOCKS])
        for at in range(n_blocks):
            size = int(self.front.size[self.front.directory[at]])
            if index < size:
                return at, index
            index -= size
        return n_blocks, 0

    def read(self):
        n = int(self.front.counts[kernels.N_PLANS])
        slots, objectives = np.empty(n, np.int32), np.empty((n, 2))
        kernels.read_front(self.front, slots, objectives)
        return slots, objectives

    def check(self):
        """Whether both hold the same, and nothing is lost in between."""
        front, (slots, objectives) = self.front, self.read()
        assert objectives.tolist() == list(
            map(list, zip(self.rewards, self.survivors, strict=True))
        )
        assert front.plan[slots, 0].tolist() == self.trails
        used = np.flatnonzero(self.store.n_users)
        assert sorted(self.trails) == used.tolist()
        assert (self.store.n_users[used] == 1).all()
        counts = front.counts
        spare = front.spare_slots[: counts[kernels.N_SPARE_SLOTS]].tolist()
        assert sorted([*slots.tolist(), *spare]) == list(range(len(front.serial)))
        blocks = front.directory[: counts[kernels.N_BLOCKS]].tolist()
        spare = front.spare_blocks[: counts[kernels.N_SPARE_BLOCKS]].tolist()
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


@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=30), st.data())
def test_few_plans_with_many_ties(plans, data):
    pair = Pair(64)
    for reward, survivors in plans:
        pair.enter(float(reward), float(survivors))
        pair.check_finding(float(survivors))
        pair.check_finding(survivors + 0.5)
    pair.check()
    while pair.trails:
        pair.remove(data.draw(st.integers(0, len(pair.trails) - 1)))
        pair.check()


@pytest.mark.parametrize("noise", [0.0, 1e-4, 0.01])
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
        most = max(most, int(pair.front.counts[kernels.N_BLOCKS]))
    assert most > (10 if noise < 0.01 else 1)


@pytest.mark.parametrize("place", [*range(0, BLOCK + 1, 8), 31, 33])
def test_a_full_block_splits_where_a_plan_enters(place):
    pair = Pair(100)
    for i in range(BLOCK + 1):
        if i != place:
            pair.enter(100.0 - i, float(i))
    assert pair.front.counts[kernels.N_BLOCKS] == 1
    pair.enter(100.0 - place, float(place))
    assert pair.front.counts[kernels.N_BLOCKS] == 2
    pair.check()


def test_contributions_by_hand():
    pair = Pair(8)
    for reward, survivors in ((10.0, 1.0), (7.0, 2.0), (3.0, 4.0)):
        pair.enter(reward, survivors)
    assert kernels.contribution(pair.front, 0, 1) == (10 - 3) * (4 - 1)
    # Three plans, evenly spaced, over 7 rewards and 3 survivors: two gaps of three either way.
    for end in (0, 2):
        assert kernels.contribution(pair.front, 0, end) == pytest.approx(2 / 3 * 7 * 2 / 3 * 3)


@pytest.mark.parametrize("n", [1, 5, 64, 65, 300])
def test_plans_are_drawn_uniformly(n):
    pair = Pair(n)
    for i in np.random.default_rng(1).permutation(n).tolist():
        pair.enter(float(n - i), float(i))
    sizes = pair.front.size[pair.front.directory[: pair.front.counts[kernels.N_BLOCKS]]]
    assert n < 300 or len(set(sizes.tolist())) > 2
    starts = np.concatenate([[0], np.cumsum(sizes)])
    states, drawn = seed_states(np.random.default_rng(7), 1), np.zeros(n)
    for _ in range(40 * n):
        at, place = kernels.draw_place(pair.front, states)
        drawn[starts[at] + place] += 1
    chi_square = ((drawn - 40) ** 2 / 40).sum()
    assert chi_square <= (n - 1) + 5 * np.sqrt(2 * n)


def test_room_is_there_until_it_is_not():
    pair = Pair(200)
    for i in range(200):
        assert kernels.has_room(pair.front, 1)
        pair.enter(200.0 - i, float(i))
    assert not kernels.has_room(pair.front, 1)
    assert kernels.has_room(pair.front, 0)
    pair.remove(77)
    assert kernels.has_room(pair.front, 1)
    assert not kernels.has_room(pair.front, 2)
    pair.check()


@pytest.mark.parametrize("n", [0, 1, 40, 300])
def test_a_larger_front_holds_the_same_and_goes_on(n):
    rng = np.random.default_rng(n)
    pair = Pair(300)
    for _ in range(n):
        survivors = rng.random()
        pair.enter(1.0 - survivors, survivors)
    for index in rng.permutation(len(pair.trails))[: n // 3]:
        pair.remove(int(index) % len(pair.trails))
    serials = pair.front.serial[pair.read()[0]].tolist()
    pair.front = local_search._larger_front(pair.front, 5)
    assert len(pair.front.serial) == 605
    pair.store = larger_store(pair.store, 606)
    pair.check()
    assert pair.front.serial[pair.read()[0]].tolist() == serials
    assert pair.front.counts[kernels.N_ENTERED] == n
    for _ in range(300):
        survivors = rng.random()
        pair.enter(1.0 - survivors, survivors)
    pair.check()


def larger_store(store, n_trails):
    larger = new_store(n_trails, 0, 0, 1)
    local_search.copy_trails(store, larger)
    return larger


def test_thinning_takes_what_contributes_least_and_leaves_the_ends():
    pair = Pair(100)
    for i in range(100):
        pair.enter(100.0 - i - 0.9 * (i == 50), float(i))  # the next one stands close to it
    states = seed_states(np.random.default_rng(3), 1)
    areas = [kernels.contribution(pair.front, *pair.place(i)) for i in range(100)]
    before = pair.trails.copy()
    gone = []
    for n in range(99, 1, -1):
        members.thin(pair.store, pair.front, n, states)
        trails = pair.front.plan[pair.read()[0], 0].tolist()
        gone += set(before) - set(trails)
        before = trails
        assert len(trails) == n
        assert (trails[0], trails[-1]) == (pair.trails[0], pair.trails[-1])
        if n == 99:
            # Sixteen of a hundred are drawn: the worst of them is among the worse half.
            assert areas[pair.trails.index(gone[0])] <= np.median(areas)
    for max_size in (0, 2, 3):  # no limit, or kept: nothing to take
        members.thin(pair.store, pair.front, max_size, states)
    assert pair.front.counts[kernels.N_PLANS] == 2
    assert pair.store.n_users.sum() == 2
