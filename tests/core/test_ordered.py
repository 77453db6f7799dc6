"""The front in order against a sorted list, in plain Python."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo.core import ordered as kernels
from botohe_moo.core.rng import below, seed_states
from tests.examples import examples


@pytest.fixture(autouse=True)
def no_warnings():
    """Kernels' integers wrap around, also where numpy would warn."""
    with np.errstate(all="ignore"):
        yield


class Pair:
    """A front of numbered plans, and its twin: (E[S], E[R], number) by ascending E[S]."""

    def __init__(self, n_slots):
        self.front, self.n, self.held = kernels.new_front(n_slots, 1), 0, []

    def enter(self, reward, survivors):
        """Put a plan into both, unless there is one as good."""
        entered = kernels.best_reward(self.front, survivors) < reward
        assert entered == all(r < reward or s < survivors for s, r, _ in self.held)
        if entered:
            slot = kernels.insert(self.front, reward, survivors)
            self.front.plan[slot] = self.n
            assert self.front.slots[slot].serial == self.front.n.entered - 1
            assert self.front.slots[slot].tried == 0
            better = [plan for plan in self.held if plan[0] > survivors or plan[1] > reward]
            self.held = sorted([*better, (survivors, reward, self.n)])
        self.n += 1

    def remove(self, index):
        """Take the plan at an index out of both."""
        slot = kernels.remove_place(self.front, index)
        assert self.front.plan[slot, 0] == self.held.pop(index)[2]

    def check(self):
        """Whether both hold the same, and nothing is lost in between."""
        front, (slots, objectives) = self.front, kernels.read_front(self.front)
        found = zip(*objectives.T[::-1].tolist(), front.plan[slots, 0].tolist(), strict=True)
        assert list(found) == self.held
        assert front.n.plans == len(self.held)
        slots, spare = slots.tolist(), front.members[front.n.plans :].tolist()
        assert sorted([*slots, *spare]) == list(range(len(front.slots)))
        assert front.n.spare == len(spare)
        held = front.slots[slots]
        assert np.column_stack([held["reward"], held["survivors"]]).tolist() == objectives.tolist()
        assert sorted(held["member"].tolist()) == list(range(len(slots)))
        assert front.members[held["member"]].tolist() == slots
        assert len(set(held["serial"].tolist())) == len(slots)

    def check_finding(self, survivors):
        index = sum(s < survivors for s, _, _ in self.held)
        assert kernels.find_place(self.front, survivors) == index
        best = self.held[index][1] if index < len(self.held) else -1.0
        assert kernels.best_reward(self.front, survivors) == best
        if self.held:  # or else the safest
            near = min(index, len(self.held) - 1)
            assert kernels.nearest_place(self.front, survivors) == near

    def check_neighbours(self):
        """What each plan contributes, and what its neighbours lose of E[R] for a survivor.

        At an end it is a neighbour of itself.
        """
        if not self.held:
            return
        survivors, rewards, _ = (np.pad(column, 1, "edge") for column in np.transpose(self.held))
        less, more = rewards[:-2] - rewards[2:], survivors[2:] - survivors[:-2]
        places = range(len(self.held))
        found = [kernels.slope_at(self.front, place) for place in places]
        assert found == (less / np.where(more > 0, more, 1.0) * (more > 0)).tolist()
        areas = less * more
        gaps = (rewards[0] - rewards[-1]) * (survivors[-1] - survivors[0])
        areas[[0, -1]] = 4 * gaps / len(places) ** 2
        found = [kernels.contribution(self.front, place) for place in places]
        assert found == pytest.approx(areas, rel=1e-12)


@examples(100)
@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=30), st.data())
def test_few_plans_with_many_ties(plans, data):
    pair = Pair(64)
    for reward, survivors in plans:
        pair.enter(float(reward), float(survivors))
        pair.check_finding(float(survivors))
        pair.check_finding(survivors + 0.5)
        pair.check_neighbours()
    pair.check()
    while pair.held:
        pair.remove(data.draw(st.integers(0, len(pair.held) - 1)))
        pair.check()


@pytest.mark.parametrize("noise", [pytest.param(1e-4, marks=pytest.mark.slow), 0.01])
def test_thousands_of_plans_come_and_go(noise):
    """The noise decides how many plans those that enter dominate."""
    rng = np.random.default_rng(5)
    pair = Pair(1_500)
    most = 0
    for share_entering in (1.0, 0.8, 0.1, 0.7, 0.0):
        for _ in range(800):
            if rng.random() < share_entering and len(pair.held) < 1_500:
                survivors = rng.random()
                pair.enter(1.0 - survivors + noise * rng.random(), survivors)
            elif pair.held:
                pair.remove(int(rng.integers(len(pair.held))))
        pair.check()
        for survivors in (*rng.random(20), *(s for s, _, _ in pair.held[::200]), 0.0, 1.0):
            pair.check_finding(survivors)
        pair.check_neighbours()
        most = max(most, len(pair.held))
    assert most > (640 if noise < 0.01 else 64)


def test_contributions_by_hand():
    pair = Pair(8)
    for reward, survivors in ((10.0, 1.0), (7.0, 2.0), (3.0, 4.0)):
        pair.enter(reward, survivors)
    first, middle, last = (kernels.contribution(pair.front, place) for place in range(3))
    assert middle == (10 - 3) * (4 - 1)
    # Three plans, evenly spaced, over 7 rewards and 3 survivors: two gaps of three either way.
    assert first == last == pytest.approx(2 / 3 * 7 * 2 / 3 * 3)


def shuffled(n):
    """A front of this many plans, after some have entered and left."""
    pair, rng = Pair(n), np.random.default_rng(1)
    for _ in range(2):
        for i in rng.permutation(n).tolist():
            pair.enter(float(n - i), float(i))
        for index in rng.permutation(n)[: n // 3]:
            pair.remove(int(index) % len(pair.held))
    for i in range(n):
        pair.enter(float(n - i), float(i))
    assert [survivors for survivors, _, _ in pair.held] == list(range(n))
    return pair


@pytest.mark.parametrize("n", [5, 300])
def test_plans_are_drawn_uniformly(n):
    pair = shuffled(n)
    states, drawn = seed_states(np.random.default_rng(7), 1), np.zeros(n)
    for _ in range(40 * n):
        drawn[int(pair.front.slots[kernels.draw_slot(pair.front, states)].survivors)] += 1
    chi_square = ((drawn - 40) ** 2 / 40).sum()
    assert chi_square <= (n - 1) + 5 * np.sqrt(2 * n)


@pytest.mark.parametrize("n", [1, 5, 2 * kernels._NEAR, 2 * kernels._NEAR + 1, 300])
def test_neighbours_are_drawn_on_either_side(n):
    """Of a front with plans enough: near an end also those farther away on the other side."""
    pair, near = shuffled(n), kernels._NEAR
    states = seed_states(np.random.default_rng(7), 1)
    for index in {0, 1, n // 3, n // 2, n - 1} & {*range(n)}:
        for _ in range(300):
            before = states.copy()
            slot = kernels.draw_near(pair.front, states, index)
            if n <= 2 * near:
                assert slot == kernels.draw_slot(pair.front, before)
                continue
            offset = below(before, 2 * near + 1) - near
            expected = index + offset if 0 <= index + offset < n else index - offset
            assert pair.front.slots[slot].survivors == expected


@pytest.mark.parametrize("n", [0, 300])
def test_a_larger_front_holds_the_same_and_goes_on(n):
    """What is drawn from it follows from what entered and left, not from where plans lie."""
    rng = np.random.default_rng(n)
    pair = Pair(300)
    for _ in range(n):
        survivors = rng.random()
        pair.enter(1.0 - survivors, survivors)
    for index in rng.permutation(len(pair.held))[: n // 3]:
        pair.remove(int(index) % len(pair.held))
    slots = kernels.read_front(pair.front)[0]
    pair.front.slots["tried"][slots] = rng.integers(0, 9, len(slots))
    expected = pair.front.slots[["serial", "tried"]][slots].tolist()
    drawn_from = pair.front.plan[pair.front.members[: len(slots)], 0].tolist()
    pair.front = kernels.grow_front(pair.front, 605)
    assert len(pair.front.slots) == 605
    pair.check()
    slots, front = kernels.read_front(pair.front)[0], pair.front
    assert front.slots[["serial", "tried"]][slots].tolist() == expected
    assert front.plan[front.members[: len(slots)], 0].tolist() == drawn_from
    assert front.n.entered == n
    for _ in range(300):
        survivors = rng.random()
        pair.enter(1.0 - survivors, survivors)
    pair.check()
