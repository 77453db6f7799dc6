"""Islands: what migrates, the same result for any number of threads, and what they share."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search import engine as module
from botohe_moo.algorithms.local_search.engine import Islands, LocalSearchSettings
from botohe_moo.algorithms.local_search.kernels.state import N_CHILDREN, QUEUE
from botohe_moo.core.ordered import read_front
from tests.algorithms.local_search.made import check, front_of, outcome, started
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.twins import plain_local_search


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Islands begin after few evaluations, with few plans."""
    monkeypatch.setattr(module, "FIRST_ALONE", 300)
    monkeypatch.setattr(module, "N_MIGRANTS", 10)


MUSEUM, TOY = load_mission("art_museum"), load_mission("toy")


def begun(**settings):
    """Islands that know one plan: everybody at home."""
    islands = Islands(
        MUSEUM,
        MUSEUM.limited(),
        n_threads=1,
        random_state=np.random.default_rng(0),
        settings=LocalSearchSettings(**settings),
    )
    islands.first.insert(MUSEUM.batch([MUSEUM.stay_home()]))
    return islands


class TestMigration:
    """Of searches in plain Python."""

    # Plans of the toy mission, none of which dominates another one.
    PLANS = ([[1, 3, 1], [1]], [[1, 3, 1], [1, 3, 1]], [[1, 2, 4, 3, 1], [1]])

    @pytest.fixture(autouse=True)
    def plain(self):
        with plain_local_search():
            yield

    def searches(self, *given, n=2, mission=TOY):
        return [started(mission, map(mission.plan, given), seed=seed) for seed in range(n)]

    def insert(self, search, *given):
        search.insert(search.mission.batch([search.mission.plan(plan) for plan in given]))

    def exchange(self, found, known):
        """Send plans that are new in any front to all searches."""
        parts = [search.migrants(since) for search, since in zip(found, known, strict=True)]
        migrants = module._together(parts)
        for search in found:
            search.take_over(migrants)
            check(search)

    @examples(40)
    @given(missions_with_plans() | team_missions_with_plans(), st.integers(1, 3))
    def test_all_fronts_become_the_front_of_all(self, case, n):
        """Of plans as good, but for rounding, any stays."""
        mission, plan = case
        with plain_local_search():
            found = [started(mission, [plan], seed=seed) for seed in range(n)]
            known = [search.version for search in found]
            for search in found:
                search.run(30)
            expected = front_of(np.vstack([search.objectives() for search in found]), 1e-11)
            for _ in range(2):
                self.exchange(found, known)
                for search in found:
                    objectives = front_of(search.objectives(), 1e-11)
                    np.testing.assert_allclose(objectives, expected, rtol=1e-10)

    def test_migrants_are_what_has_entered_since(self):
        [search] = self.searches(n=1)
        assert len(search.migrants(search.version).plan) == 0
        self.insert(search, self.PLANS[0])
        migrants = search.migrants(1)
        assert migrants.objectives.tolist() == search.objectives()[:1].tolist()
        # Robots come in the order of their trails.
        trails = np.split(migrants.nodes, migrants.offsets[1:-1])
        assert [[trails[t].tolist() for t in plan] for plan in migrants.plan] == [[[0], [0, 2, 0]]]
        assert len(search.migrants(0).plan) == 2

    def test_turns_as_a_parent_are_those_of_the_finder(self):
        """The first one is, also where it is still to come."""
        one, other = self.searches()
        self.insert(one, *self.PLANS)
        one._front.slots["tried"][read_front(one._front)[0]] = 0, 5, 1, 2
        self.exchange([one, other], [1, 1])
        assert [outcome(search)[3] for search in (one, other)] == [[0, 5, 1, 2], [1, 5, 1, 0]]

    @pytest.mark.parametrize("room", [0, 1, 2])
    def test_where_there_is_no_room_there_will_be(self, room):
        one, other = self.searches()
        self.insert(one, *self.PLANS)
        spare, other._front.n.spare = other._front.n.spare, N_CHILDREN + room
        other.take_over(one.migrants(1))
        assert other._front.n.spare != spare
        assert np.array_equal(one.objectives(), other.objectives())

    @pytest.mark.parametrize("moves", [False, True])
    def test_trails_that_are_there_are_not_stored_again(self, moves):
        """Nor where they have moved to where there is more room."""
        one, other = self.searches(self.PLANS[0])
        if moves:
            other._make_room()
        before = n_stored(other)
        self.insert(one, *self.PLANS)
        self.exchange([one, other], [0, 0])
        assert len(other) == 4
        assert n_stored(other) == before + 1
        self.insert(one, ([1, 2, 4, 3, 1], [1, 3, 1]))
        self.exchange([one, other], [0, 0])
        assert len(other) == 5
        assert n_stored(other) == before + 1
        assert np.array_equal(one.objectives(), other.objectives())

    def test_a_trail_that_no_plan_has_any_more_is_stored_anew(self):
        one, other = self.searches([[1, 3, 4, 3, 1], [1]])
        migrants = one.migrants(0)
        other.restart()
        other.take_over(migrants)
        check(other)
        assert np.array_equal(one.objectives(), other.objectives())

    def test_trails_without_arcs_differ_by_kind(self):
        drones = load_mission("drones_and_rovers")
        [search] = self.searches(n=1, mission=drones)
        migrants = search.migrants(0)
        starts = migrants.nodes.tolist()  # of trails that go nowhere
        assert starts == drones.world.team.start.tolist()
        assert len({*zip(starts, migrants.hash.tolist(), strict=True)}) == len(drones.kinds)
        assert len(set(migrants.hash.tolist())) == len(drones.kinds)


def n_stored(search):
    return np.count_nonzero(search._store.trails["n_users"])


def test_one_island_is_the_search_alone():
    islands, alone = begun(), started(MUSEUM)
    for n in (100, 400, 501):
        assert islands.run(n) == alone.run(n) == n
    assert [outcome(island) for island in islands._islands] == [outcome(alone)]
    assert islands.statistics[["tried", "entered"]].equals(alone.statistics[["tried", "entered"]])


def test_all_islands_take_over_what_others_found():
    islands = begun(n_islands=3)
    for n in (300, 1, 400, 1_000):
        first, version, before = islands.first, islands.first.version, islands.first.objectives()
        islands.run(n)
        assert (first.version > version) == (first.objectives().tobytes() != before.tobytes())
        for island in islands._islands:  # each took over before it went on
            check(island)
            for point in before:
                assert (island.objectives() >= point * (1 - 1e-11)).all(1).any()
    assert islands._migrants[0] is None
    for island, migrants in zip(islands._islands[1:], islands._migrants[1:], strict=True):
        island.take_over(migrants)
        np.testing.assert_allclose(island.objectives(), islands.first.objectives(), rtol=1e-11)
    # Each draws for itself.
    assert len({island._states.tobytes() for island in islands._islands}) == 3


def test_what_each_move_brought_on_all_islands():
    islands = begun(n_islands=3)
    n = sum(islands.run(n) for n in (300, 1, 700))
    found, parts = islands.statistics, [island.statistics for island in islands._islands]
    assert found.index.name == "move"
    np.testing.assert_allclose(found, sum(parts), rtol=1e-9)
    assert found["tried"].sum() == n
    assert min(part["tried"].sum() for part in parts) > 100
    assert pickle.loads(pickle.dumps(islands)).statistics.equals(found)


def test_islands_begin_when_the_first_has_searched_for_long_and_then_fewer_plans_wait():
    islands, found = begun(n_islands=5), []
    for n in (100, 100, 100, 1):
        islands.run(n)
        found.append([int(island._memory[0].most_waiting) for island in islands._islands])
    assert found == [[QUEUE]] * 3 + [[module._QUEUE] * 5]
    again = pickle.loads(pickle.dumps(islands))
    assert [island._memory[0].most_waiting for island in again._islands] == found[-1]


def test_islands_that_find_no_move_leave_the_evaluations_to_others():
    search = started(MUSEUM)
    search.run(3_000)
    islands = begun(n_islands=8, moves={"adopt": 1.0}, prob_recreate=0.0)
    islands.first.insert(search.plans()[0])
    for _ in range(3):
        assert islands.run(20_000) == 20_000
