"""Moves, children, bounds and the whole search: plain Python finds what the kernels find."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan, load_mission
from botohe_moo.algorithms.local_search import engine
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, LocalSearch
from botohe_moo.algorithms.local_search.kernels import plans, recreate, search, state
from botohe_moo.algorithms.local_search.kernels.state import N_TRAILS, new_store
from tests import twins
from tests.algorithms.local_search.made import check, outcome, started, watched
from tests.examples import examples
from tests.strategies import (
    mission_of,
    missions_with_plans,
    scenario_missions_with_plans,
    team_missions_with_plans,
)
from tests.twins import plain_local_search

FLOORS = st.sampled_from([0.0, 0.0, 0.3, 1.0])
BUDGETS = st.sampled_from([inf, inf, 7.0, 3.0, 0.0])


@examples(200)
@given(
    missions_with_plans(min_nodes=2)
    | team_missions_with_plans()
    | team_missions_with_plans(pays="return")
    | scenario_missions_with_plans()
    | scenario_missions_with_plans(team_missions_with_plans(pays="return")),
    st.sampled_from([*DEFAULT_MOVES, "all", "all"]),
    FLOORS,
    BUDGETS,
    st.sampled_from([2, 1_000]),
    st.sampled_from([0.0, 0.02, 0.2, 1.0]),
    st.sampled_from([-1, 20, 10**6]),
    st.integers(0, 9),
)
def test_children_are_appraised_right_and_what_enters_is_valid_and_has_the_bits_of_evaluate(
    case, move, floor, budget, full_up_to, prob_recreate, patience, seed
):
    """Of moves, of changes of other robots once the search is stuck, and of recreation.

    One-way missions, safe arcs, nodes without reward; paths known from all nodes or few.
    """
    mission, plan = case
    rule = {
        "moves": DEFAULT_MOVES if move == "all" else {move: 1.0},
        "prob_recreate": prob_recreate,
    }
    limits = {"min_survival": floor, "max_length": budget}
    known = [(module, "FULL_UP_TO", full_up_to) for module in (state, engine)]
    walks = [(recreate, "P_WALK", 0.5), (recreate, "N_WALK", 2), (plans, "PATIENCE", patience)]
    others = [(state, "NEAR", 2), (state, "QUEUE", 2)]
    constants = [*known, *walks, *others]
    found, made, entering = watched(mission, [plan], 70, *constants, seed=seed, **rule, **limits)
    for child in made:
        child.check()
    assert len(entering) == found.version
    for entered, objectives in entering:
        assert mission.evaluate([entered])[0].tolist() == objectives
    check(found, floor, budget)


def test_small_chances_of_the_others_keep_their_digits():
    """Appraised in fractions: what the other robots bring must not drown what this one does."""
    arcs = [(0, node, 1e-9) for node in (1, 2, 3)]
    mission = mission_of(arcs, [0, 2, 3, 5], both_ways=True, robots=3)
    plan = TrailPlan([[0, 1, 0, 2, 0], [0, 1, 0], [0, 3, 0]])
    searches = (watched(mission, [plan], 500, prob_recreate=0.0, seed=seed) for seed in range(4))
    appraised = [child for _, made, _ in searches for child in made if child.gained >= 0]
    assert len(appraised) >= 10
    for child in appraised:
        reward, _ = twins.exact_figures(mission, [*child.others, child.trail])
        found = child.fixed + child.gained
        assert found == pytest.approx(float(reward), rel=1e-14, abs=0)


@pytest.mark.compiled_only
@pytest.mark.parametrize("pays", ["arrival", "return"])
def test_the_bound_changes_nothing_but_the_time_it_takes(pays):
    mission = Mission(load_mission("toy").graph, pays=pays)
    outcomes = []
    for bounded in (True, False):
        with plain_local_search() as patch:
            found = started(mission)
            if not bounded:
                lay_out = plans.lay_out

                def unbounded(world, returns, store, work, trail, lay_out=lay_out):
                    lay_out(world, returns, store, work, trail)
                    work.steps["ahead"] = np.inf

                patch.setattr(plans, "lay_out", unbounded)
            found.run(500)
        outcomes.append(outcome(found))
    assert outcomes[0] == outcomes[1]


def slow(*case):
    return pytest.param(*case, marks=pytest.mark.slow)


def least_room(found, n_trails, n_arcs, n_visits):
    """A store with room for what one parent needs beside what is there, and no more."""
    n_new = max(N_TRAILS, found.mission.robots + 1)
    graph = found.world.graph
    n_arcs, n_visits = n_arcs // 4 + n_new * graph.n_arcs, n_visits // 4 + n_new * graph.n_nodes
    return new_store(n_trails + n_new, n_arcs, n_visits)


@pytest.mark.compiled_only
@pytest.mark.parametrize(
    "name", ["art_museum", slow("drones_and_rovers"), slow("art_museum_return")]
)
def test_where_plans_lie_in_memory_changes_nothing(monkeypatch, name):
    """Where room is scarce, and plans and trails are moved all the time, it finds the same."""
    mission, make_room, made = load_mission(name), LocalSearch._make_room, []
    options = {"prob_recreate": 0.0, "seed": 2}
    usual = started(mission, **options)
    monkeypatch.setattr(LocalSearch, "_new_store", least_room)
    monkeypatch.setattr(engine, "_FIRST_PLANS", 0)
    monkeypatch.setattr(LocalSearch, "_make_room", lambda own: (made.append(1), make_room(own)))
    scarce = started(mission, **options)
    for n in (3_000, 1, 2_000):
        assert usual.run(n) == scarce.run(n) == n
        assert outcome(usual) == outcome(scarce)
    assert len(made) > 20
    check(scarce)


# A ring with chords: some nodes have more arcs in than out.
RING = [(node, (node + 1) % 9, 0.97 - 0.02 * node) for node in range(9)]
CHORDS = [(0, 4, 0.86), (2, 0, 0.93), (6, 2, 0.9), (7, 4, 0.84), (1, 4, 0.96)]
ONE_WAY = mission_of(RING + CHORDS, [2, 3, 0, 1, 3, 0, 2, 1, 3], robots=3)


@pytest.mark.parametrize(
    ("mission", "n_evaluations", "rule"),
    [
        (load_mission("art_museum"), 400, {"max_size": 12, "min_survival": 0.3}),
        slow(load_mission("terrain", nodes=30, robots=4), 300, {}),
        (ONE_WAY, 1_000, {"prob_recreate": 0.0}),
        slow(load_mission("drones_and_rovers"), 300, {"prob_recreate": 0.5}),
        slow(load_mission("art_museum_return"), 900, {"prob_recreate": 0.5}),
        slow(load_mission("two_communities"), 800, {"prob_recreate": 0.5, "max_length": 12.0}),
        (load_mission("toy"), 800, {"prob_recreate": 1.0, "max_length": 6.0, "min_survival": 0.2}),
        (load_mission("toy"), 3_500, {}),  # solved soon, and what the search does when it is stuck
    ],
)
def test_plain_python_finds_the_same_to_the_bit(monkeypatch, mission, n_evaluations, rule):
    for module in (state, engine):  # the terrain's paths are known in part
        monkeypatch.setattr(module, "FULL_UP_TO", 25)
    monkeypatch.setattr(state, "NEAR", 8)
    compiled = started(mission, seed=3, **rule)
    parts = (n_evaluations - 100, 1, 99)
    spent = [compiled.run(n) for n in parts]
    with plain_local_search():
        plain = started(mission, seed=3, **rule)
        assert [plain.run(n) for n in parts] == spent == list(parts)
        assert outcome(plain) == outcome(compiled)
    assert len(compiled) > 5
    check(compiled, rule.get("min_survival", 0.0), rule.get("max_length"))


def test_children_find_room(monkeypatch):
    """In plain Python, where a plan that is written beside its front is an error."""
    monkeypatch.setattr(engine, "_FIRST_PLANS", 3)
    with plain_local_search():
        assert started(load_mission("toy")).run(2_500) == 2_500


@pytest.fixture(scope="module")
def found():
    museum = load_mission("art_museum")
    search = started(museum)
    search.run(5_000)
    return museum, search.plans()[0]


@pytest.mark.compiled_only
@pytest.mark.parametrize("name", DEFAULT_MOVES)
def test_each_alone_makes_children(found, name):
    museum, batch = found
    search = started(museum, batch, moves={name: 1.0}, prob_recreate=0.0)
    assert search.run(500) == 500
    tried = search.statistics["tried"]
    assert tried[name] == tried.sum() == 500
    check(search)


@pytest.mark.compiled_only
def test_moves_that_lead_nowhere_end_the_search():
    for name in ("splice", "graft", "swap-loops"):
        search = started(load_mission("art_museum"), moves={name: 1.0}, prob_recreate=0.0)
        assert search.run(100_000) == 0  # there is only the trail that stays at base
        assert len(search) == 1


class TestByHand:
    """Nodes 1 to 3 round the base; 1 and 2 are neighbours; the richest trail is in front."""

    MISSION = mission_of(
        [(*arc, 0.9) for arc in ((0, 1), (0, 2), (0, 3), (1, 2))],
        range(4),
        both_ways=True,
        robots=1,
    )

    def made(self, trail, move):
        """Return all children of one robot's trail, over several seeds."""
        constants, seen = [(plans, "P_NEWEST", 0.0), (search, "P_END", 1.0)], set()
        rule = {"moves": {move: 1.0}, "prob_recreate": 0.0}
        for seed in range(9):
            start = [TrailPlan([trail])]
            _, made, _ = watched(self.MISSION, start, 100, *constants, seed=seed, **rule)
            seen |= {child.trail for child in made if child.parent == trail}
        return seen

    @pytest.mark.parametrize(
        ("move", "trail", "children"),
        [
            (
                "shortcut",
                (0, 3, 0, 2, 1, 0),
                [(0,), (0, 2, 1, 0), (0, 3, 0), (0, 3, 0, 1, 0), (0, 3, 0, 2, 0), (0, 1, 0)],
            ),
            # The order by which 3 comes first is the best, and is the parent.
            ("swap-loops", (0, 3, 0, 2, 0, 1, 0), [(0, 2, 0, 3, 0, 1, 0), (0, 3, 0, 1, 0, 2, 0)]),
        ],
    )
    def test_all_children(self, move, trail, children):
        assert self.made(trail, move) == {*children}

    def test_visit(self):
        found = self.made((0, 3, 0), "visit")
        # Before it and behind it; in its place; and on the way back from it.
        assert {(0, 1, 0), (0, 2, 0), (0, 1, 0, 3, 0), (0, 3, 0, 2, 0)} <= found
        assert all(len(trail) <= 5 for trail in found)

    def test_adopt(self):
        start = [TrailPlan([[0, 3, 0], [0, 2, 0]])]
        rule = {"moves": {"adopt": 1.0}, "prob_recreate": 0.0}
        found = watched(self.MISSION.with_robots(2), start, 50, **rule)[0].plans()[0]
        assert {plan.trails for plan in found} == {
            ((0,), (0,)),
            ((0,), (0, 3, 0)),
            ((0, 2, 0), (0, 3, 0)),
        }
