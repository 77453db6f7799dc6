"""Moves, children, bounds and the whole search: plain Python finds what the kernels find."""

from math import inf

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan, load_mission
from botohe_moo.algorithms.local_search import engine
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, LocalSearch
from botohe_moo.algorithms.local_search.kernels import moves, plans, recreate, search, state
from botohe_moo.algorithms.local_search.kernels.moves import N_MOVES, Move
from botohe_moo.algorithms.local_search.kernels.state import N_TRAILS, new_store
from tests import twins
from tests.algorithms.local_search.made import check, note_entering, outcome, started, watched
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.twins import plain_local_search

FLOORS = st.sampled_from([0.0, 0.0, 0.3, 1.0])
BUDGETS = st.sampled_from([inf, inf, 7.0, 3.0, 0.0])


@examples(120)
@given(
    missions_with_plans(min_nodes=2) | team_missions_with_plans(),
    st.sampled_from([*DEFAULT_MOVES, "all"]),
    FLOORS,
    BUDGETS,
    st.sampled_from([2, 1_000]),
    st.sampled_from([0.0, 0.0, 0.02]),
    st.integers(0, 9),
)
def test_every_child_is_a_trail_and_is_appraised_right(
    case, move, floor, budget, full_up_to, p_recreate, seed
):
    """One-way missions, safe arcs, nodes without reward; paths known from all nodes or few."""
    mission, plan = case
    options = {
        "moves": DEFAULT_MOVES if move == "all" else {move: 1.0},
        "seed": seed,
        "min_survival": floor,
        "max_length": budget,
        "prob_recreate": p_recreate,
    }
    found, made = watched(mission, [plan], 60, full_up_to=full_up_to, **options)
    for child in made:
        child.check()
    check(found, floor, budget)


@examples(80)
@given(
    missions_with_plans(min_nodes=2) | team_missions_with_plans(),
    FLOORS,
    BUDGETS,
    st.sampled_from([-1, 20, 10**6]),
    st.integers(0, 9),
)
def test_every_plan_that_enters_is_valid_and_has_the_bits_of_evaluate(
    case, floor, budget, patience, seed
):
    """Whatever makes it: moves, changes of other robots once the search is stuck, recreation."""
    mission, plan = case
    with plain_local_search() as patch:
        for module, name, value in (
            (plans, "PATIENCE", patience),
            (search, "MAX_FRUITLESS", 50),
            (recreate, "P_WALK", 0.5),
            (recreate, "N_WALK", 2),
            (state, "QUEUE", 2),
        ):
            patch.setattr(module, name, value)
        entering = note_entering(patch)
        limits = {"min_survival": floor, "max_length": budget}
        found = started(mission, [plan], seed=seed, prob_recreate=0.2, **limits)
        n_given = found.version
        if len(found):
            found.run(80)
    assert len(entering) == found.version
    assert found.statistics["entered"].sum() == found.version - n_given
    for plan, objectives in entering:
        assert mission.evaluate([plan])[0].tolist() == objectives
    check(found, floor, budget)


def test_small_chances_of_the_others_keep_their_digits():
    """Appraised in fractions: what the other robots bring must not drown what this one does."""
    graph = nx.DiGraph((arc for node in (1, 2, 3) for arc in ((0, node), (node, 0))), robots=3)
    nx.set_node_attributes(graph, {0: 0.0, 1: 2.0, 2: 3.0, 3: 5.0}, "reward")
    nx.set_edge_attributes(graph, 1e-9, "survival")
    mission = Mission(graph, base=0)
    plan = TrailPlan([[0, 1, 0, 2, 0], [0, 1, 0], [0, 3, 0]])
    searches = (watched(mission, [plan], 500, prob_recreate=0.0, seed=seed) for seed in range(4))
    appraised = [child for _, made in searches for child in made if child.gained >= 0]
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


LARGER = ["drones_and_rovers", "art_museum_return"]


def least_room(found, n_trails, n_arcs, n_visits):
    """A store with room for what one parent needs beside what is there, and no more."""
    n_new = max(N_TRAILS, found.mission.robots + 1)
    graph = found.world.graph
    n_arcs, n_visits = n_arcs // 4 + n_new * graph.n_arcs, n_visits // 4 + n_new * graph.n_nodes
    return new_store(n_trails + n_new, n_arcs, n_visits)


@pytest.mark.compiled_only
@pytest.mark.parametrize("name", ["art_museum", *map(slow, LARGER)])
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


def one_way():
    """A ring with chords: some nodes have more arcs in than out."""
    rng, graph = np.random.default_rng(5), nx.DiGraph()
    for node in range(9):
        graph.add_node(node, reward=float(rng.integers(0, 4)))
        graph.add_edge(node, (node + 1) % 9, survival=rng.uniform(0.8, 1.0))
    for one, other in ((0, 4), (2, 0), (6, 2), (7, 4), (1, 4)):
        graph.add_edge(one, other, survival=rng.uniform(0.8, 1.0))
    return Mission(graph, base=0, robots=3)


@pytest.mark.parametrize(
    ("mission", "n_evaluations", "rule"),
    [
        (load_mission("art_museum"), 400, {"max_size": 12, "min_survival": 0.3}),
        slow(load_mission("terrain", nodes=30, robots=4), 300, {}),
        (one_way(), 1_000, {"prob_recreate": 0.0}),
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


def test_children_find_room(monkeypatch):
    """In plain Python, where a plan that is written beside its front is an error."""
    monkeypatch.setattr(engine, "_FIRST_PLANS", 3)
    with plain_local_search():
        assert started(load_mission("toy")).run(2_500) == 2_500


class TestDeclarations:
    @pytest.mark.parametrize("n", [1, 2, N_MOVES + 1])
    def test_one_is_called_by_its_number(self, monkeypatch, n):
        called = [Move(f"move {i}", 1.0, lambda of, i: of.append(i), i) for i in range(n)]
        monkeypatch.setattr(moves, "MOVES", called)
        monkeypatch.setattr(moves, "N_MOVES", n)
        make_move, made = moves._chained(0), []
        for number in range(n):
            make_move(made, number)
        assert made == list(range(n))


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
    """One robot, and all children that it can have."""

    def made(self, mission, trail, move):
        """The children of one trail, whatever else is found."""
        constants, seen = [(plans, "P_NEWEST", 0.0), (search, "P_END", 1.0)], set()
        options = {"moves": {move: 1.0}, "prob_recreate": 0.0, "constants": constants}
        for seed in range(9):
            _, made = watched(mission, [TrailPlan([trail])], 100, seed=seed, **options)
            seen |= {child.trail for child in made if child.parent == tuple(trail)}
        return seen

    @pytest.fixture
    def mission(self):
        """Nodes 1 to 3 round the base; 1 and 2 are neighbours; the richest trail is in front."""
        graph = nx.DiGraph()
        graph.add_nodes_from((node, {"reward": float(node)}) for node in range(4))
        for one, other in ((0, 1), (0, 2), (0, 3), (1, 2)):
            graph.add_edge(one, other, survival=0.9)
            graph.add_edge(other, one, survival=0.9)
        return Mission(graph, base=0, robots=1)

    def test_shortcut(self, mission):
        found = self.made(mission, (0, 3, 0, 2, 1, 0), "shortcut")
        assert found == {(0,), (0, 2, 1, 0), (0, 3, 0), (0, 3, 0, 1, 0), (0, 3, 0, 2, 0), (0, 1, 0)}

    def test_swap_loops(self, mission):
        # Loops: 1, 2 and 3; the order by which 3 comes first is the best, and is the parent.
        found = self.made(mission, (0, 3, 0, 2, 0, 1, 0), "swap-loops")
        assert found == {(0, 2, 0, 3, 0, 1, 0), (0, 3, 0, 1, 0, 2, 0)}

    def test_adopt(self, mission):
        start = [TrailPlan([[0, 3, 0], [0, 2, 0]])]
        options = {"moves": {"adopt": 1.0}, "prob_recreate": 0.0}
        search, _ = watched(mission.with_robots(2), start, 50, **options)
        found = {tuple(sorted(plan.trails)) for plan in search.plans()[0]}
        assert found == {((0,), (0,)), ((0,), (0, 3, 0)), ((0, 2, 0), (0, 3, 0))}

    def test_visit(self, mission):
        found = self.made(mission, (0, 3, 0), "visit")
        # Before it and behind it; in its place; and on the way back from it.
        assert {(0, 1, 0), (0, 2, 0), (0, 1, 0, 3, 0), (0, 3, 0, 2, 0)} <= found
        assert all(len(trail) <= 5 for trail in found)
