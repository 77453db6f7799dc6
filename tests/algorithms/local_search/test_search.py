"""Moves, bounds and the whole search, in plain Python, which finds what the kernels find."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from botohe_moo import Mission, TrailPlan, load_mission
from botohe_moo.algorithms.local_search import engine as search_module
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, MOVES, LocalSearch
from botohe_moo.algorithms.local_search.kernels import children, plans, routes
from botohe_moo.algorithms.local_search.kernels import moves as kernels_of_moves
from botohe_moo.algorithms.local_search.kernels import search as kernels
from botohe_moo.core.ordered import best_reward
from botohe_moo.search.sequential import plan_sequentially
from botohe_moo.trails import PlanBatch
from tests import twins
from tests.examples import examples
from tests.strategies import missions_with_plans, team_missions_with_plans
from tests.twins import plain_local_search

# In plain Python ten thousand fruitless parents would take their time.
FEW = 50


def local_search(mission, start=(), *, seed=0, min_survival=0.0, max_length=np.inf, **options):
    """A search that has been started with everybody at home, and with given plans."""
    limits = mission.limits(min_survival, max_length)
    random_state = np.random.default_rng(seed)
    search = LocalSearch(mission, limits, random_state=random_state, **options)
    home = mission.stay_home(limits)
    search.insert(PlanBatch.from_plans([home, *start], mission.robots))
    return search


def outcome(search):
    """All that a search has found, to the bit."""
    batch, objectives, serials = search.plans()
    return (
        [plan.trails for plan in batch],
        objectives.tolist(),
        serials.tolist(),
        search._states.tolist(),
        search._memory[0].item(),
        int(search._store.trails["n_users"].sum()),
    )


def trail_of(search, trail, robot=0):
    """A stored trail of a robot as node indices."""
    store, graph = search._store, search.mission.arrays
    arcs = store.arc[store.trails[trail].first_arc :][: store.trails[trail].n_arcs]
    return (twins.ends_of(search.mission, robot)[0], *graph.head[arcs].tolist())


class Child:
    """What a move has made, and what the search takes it for.

    ``others`` are the trails of the other robots, ``fixed`` their E[R] as the search adds it, and
    ``gained`` is what the robot gains, −1 where the child does not enter; ``needed`` is the E[R] to
    exceed.
    """

    def __init__(self, search, gained):
        front, work, graph = search._front, search._work, search.mission.arrays
        draft, self.robot = work.draft, int(work.draft.robot)
        parent = [trail_of(search, trail, robot) for robot, trail in enumerate(work.parent)]
        self.others = [trail for robot, trail in enumerate(parent) if robot != draft.robot]
        trail, base = work.steps["arc"].tolist(), parent[self.robot][:1]
        self.parent = (*base, *graph.head[trail[: draft.length]].tolist())
        self.fixed, self.gained = float(draft.others), gained
        self.arcs = [
            *trail[: draft.prefix],
            *work.middle[: draft.n_middle].tolist(),
            *trail[draft.suffix : draft.length],
        ]
        n = children.write_child(work)
        assert work.child[:n].tolist() == self.arcs
        self.tails, self.heads = graph.tail[self.arcs].tolist(), graph.head[self.arcs].tolist()
        self.trail = (*base, *self.heads)
        survivors = draft.survivors + twins.survival_of(search.mission, self.trail)
        self.needed = best_reward(front, survivors * (1 - 1e-12))

    def check(self, mission, floor, budget=np.inf):
        """Whether it is a trail, another one, and its figures are those of the formulas."""
        start, end = twins.ends_of(mission, self.robot)
        assert [start, *self.heads] == [*self.tails, end]
        assert len(set(self.arcs)) == len(self.arcs)
        assert self.trail != self.parent
        kind, others = mission.kind_of[self.robot], list(mission.kind_of)
        del others[self.robot]
        floor = max(floor, kind.min_survival)
        budget = min(budget, kind.max_length or np.inf)
        named = [[node % len(mission.nodes) for node in trail] for trail in self.others]
        trail = [node % len(mission.nodes) for node in self.trail]
        before = twins.evaluate(mission, named, others)[0]
        if mission.is_plain:  # what all robots collect anyway
            before = twins.evaluate(mission, [*named, (start,)], [*others, kind])[0]
        gains = twins.evaluate(mission, [*named, trail], [*others, kind])[0] - before
        near = {"rel": 1e-12, "abs": 1e-13 * (mission.total_reward + mission.robots)}
        gained, alive = self.gained, twins.survival_of(mission, self.trail)
        walked = twins.length_of(mission, self.trail)
        if gained >= 0:
            assert gained == pytest.approx(gains, **near)
            assert self.fixed + gained > self.needed
            assert alive >= floor * (1 - 1e-12)
            assert walked <= budget * (1 + 1e-12)
        elif alive >= floor * (1 + 1e-12) and walked <= budget * (
            1 - 1e-12
        ):  # there is a plan as good
            assert self.needed >= (self.fixed + gains) * (1 - 2e-12) - near["abs"]


def watched(
    mission, start, n_evaluations, floor=0.0, full_up_to=routes.FULL_UP_TO, constants=(), **options
):
    """Search in plain Python, with other constants; the search, and every child made on the way."""
    with plain_local_search() as patch:
        for module, name, value in constants:
            patch.setattr(module, name, value)
        for module in (routes, search_module):
            patch.setattr(module, "FULL_UP_TO", full_up_to)
        patch.setattr(routes, "NEAR", 2)
        search = local_search(mission, start, min_survival=floor, **options)
        patch.setattr(kernels, "MAX_FRUITLESS", FEW)
        evaluate_child, made = kernels.evaluate_child, []

        def noted(*arguments):
            gained = evaluate_child(*arguments)
            made.append(Child(search, gained))
            return gained

        patch.setattr(kernels, "evaluate_child", noted)
        search.run(n_evaluations)
    return search, made


@examples(120)
@given(
    missions_with_plans(min_nodes=2) | team_missions_with_plans(),
    st.sampled_from([*MOVES, "all"]),
    st.sampled_from([0.0, 0.0, 0.3, 1.0]),
    st.sampled_from([np.inf, np.inf, 7.0, 3.0, 0.0]),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.sampled_from([2, 1_000]),
    st.sampled_from([0.0, 0.0, 0.02]),
    st.integers(0, 9),
)
def test_every_child_is_a_trail_and_is_appraised_right(
    case, move, floor, budget, p_detour, full_up_to, p_refill, seed
):
    """One-way missions, safe arcs, nodes without reward; paths known from all nodes or few."""
    mission, plan = case
    plan, home = (
        each if keeps_limits(mission, each, floor, budget) else None
        for each in (plan, mission.stay_home(mission.limits(floor, budget)))
    )
    assume(home)
    moves = DEFAULT_MOVES if move == "all" else {move: 1.0}
    options = {"moves": moves, "seed": seed, "max_length": budget, "p_refill": p_refill}
    options["constants"] = [(kernels_of_moves, "P_DETOUR", p_detour)]
    search, made = watched(mission, [plan] if plan else [], 60, floor, full_up_to, **options)
    for child in made:
        child.check(mission, floor, budget)
    batch, objectives, _ = search.plans()
    assert np.array_equal(mission.evaluate(batch), objectives)
    assert (np.diff(objectives[:, 0]) < 0).all()
    assert (np.diff(objectives[:, 1]) > 0).all()
    for found in batch:
        assert keeps_limits(mission, found, floor, budget)


def keeps_limits(mission, plan, floor, budget):
    """Whether all robots of a plan keep limits, and those of their kinds, to rounding."""
    robots = zip(
        mission.kind_of,
        mission.robot_survival([plan])[0],
        mission.trail_lengths([plan])[0],
        strict=True,
    )
    return all(
        alive >= max(floor, kind.min_survival) * (1 - 1e-12)
        and length <= min(budget, kind.max_length or np.inf) * (1 + 1e-12)
        for kind, alive, length in robots
    )


def test_small_chances_of_the_others_keep_their_digits():
    """Appraised in fractions: what the other robots bring must not drown what this one does."""
    graph = nx.DiGraph((arc for node in (1, 2, 3) for arc in ((0, node), (node, 0))), robots=3)
    nx.set_node_attributes(graph, {0: 0.0, 1: 2.0, 2: 3.0, 3: 5.0}, "reward")
    nx.set_edge_attributes(graph, 1e-9, "survival")
    mission = Mission(graph, base=0)
    plan = TrailPlan([[0, 1, 0, 2, 0], [0, 1, 0], [0, 3, 0]])
    _, made = watched(mission, [plan], 1_500, p_refill=0.0)
    appraised = [child for child in made if child.gained >= 0]
    assert len(appraised) >= 5
    for child in appraised:
        reward, _ = twins.exact_figures(mission, [*child.others, child.trail])
        found = child.fixed + child.gained
        assert found == pytest.approx(float(reward), rel=1e-14, abs=0)


class TestMovesByHand:
    """One robot, and all children that it can have."""

    def made(self, mission, trail, move, constants=()):
        """The children of one trail, whatever else is found."""
        seen = set()
        for seed in range(9):
            options = {"constants": [(plans, "P_NEWEST", 0.0), (kernels, "P_END", 1.0), *constants]}
            _, made = watched(
                mission,
                [TrailPlan([trail])],
                100,
                moves={move: 1.0},
                seed=seed,
                p_refill=0.0,
                **options,
            )
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

    def test_reverse(self, mission):
        found = self.made(mission, (0, 3, 0, 2, 1, 0), "reverse")
        assert found == {
            (0, 3, 0, 1, 2, 0),  # the loop of 2 and 1
            (0, 1, 2, 0, 3, 0),  # all of it
            (0, 2, 0, 3, 0, 1, 0),  # 3, base and 2
            (0, 3, 0, 2, 0, 1, 0),  # base and 2
        }

    def test_one_way_segments_are_not_reversed(self):
        graph = nx.DiGraph([(0, 1), (1, 2), (2, 0)])
        nx.set_node_attributes(graph, 1.0, "reward")
        nx.set_edge_attributes(graph, 0.9, "survival")
        mission = Mission(graph, base=0, robots=1)
        assert self.made(mission, (0, 1, 2, 0), "reverse") == set()

    def test_adopt(self, mission):
        two = mission.with_robots(2)
        start = [TrailPlan([[0, 3, 0], [0, 2, 0]])]
        search, _ = watched(two, start, 50, moves={"adopt": 1.0}, p_refill=0.0)
        found = {tuple(sorted(plan.trails)) for plan in search.plans()[0]}
        assert found == {((0,), (0,)), ((0,), (0, 3, 0)), ((0, 2, 0), (0, 3, 0))}

    def test_visit(self, mission):
        found = self.made(mission, (0, 3, 0), "visit", [(kernels_of_moves, "P_DETOUR", 0.0)])
        # Before it and behind it; in its place; and on the way back from it.
        assert {(0, 1, 0), (0, 2, 0), (0, 1, 0, 3, 0), (0, 3, 0, 2, 0)} <= found
        assert all(len(trail) <= 5 for trail in found)


class Laid:
    """What the search notes of each position of a trail, straight from the formulas."""

    def __init__(self, mission, kind, nodes):
        self.mission, self.kind = mission, kind
        self.trail = [node % len(mission.nodes) for node in nodes]
        self.reward = dict(mission.graph.nodes(data="reward"))
        if mission.is_plain:
            self.reward[mission.base] = 0.0  # which all robots collect, whatever they do

    def brings(self, trail, aboard=None):
        chances = twins.collects(self.mission, self.kind, trail, aboard)
        return sum(self.reward[node] * chance for node, chance in chances.items())

    def at(self, i):
        """What lies ahead, what is banked and what is carried, and the chance to bring that."""
        before, after = self.trail[: i + 1], self.trail[i + 1 :]
        alive = twins.alive_along(self.mission, self.kind, self.trail)
        ahead = alive[i + 1] / alive[i] * self.brings(after, ()) if after else 0.0
        banked = dict(twins.credited(self.mission, before, self.kind.aboard))
        nodes = self.mission.graph.nodes
        carried = sum(
            self.reward[v] * twins.share_of(self.mission, self.kind, v)
            for v in {*before, *self.kind.aboard} - set(banked)
        )
        depots = [j for j, v in enumerate(self.trail) if v == 0 or nodes[v].get("depot")]
        to_depot = next((alive[j] / alive[i] for j in depots if j > i), 0.0)
        return [ahead, self.brings(before), carried, to_depot]


@examples(120)
@given(missions_with_plans(max_robots=2) | team_missions_with_plans())
def test_what_lies_ahead(case):
    """What a robot with empty hands would collect that is sure to be at each position.

    And what it has collected and carries there, and the chance to bring that to a depot.
    """
    mission, plan = case
    with plain_local_search():
        search = local_search(mission, [plan])
        store, work = search._store, search._work
        for robot, trail in enumerate(search._front.plan[0].tolist()):
            work.draft.robot = robot
            kernels.lay_out(mission.arrays, store, work, trail)
            nodes = trail_of(search, trail, robot)
            laid_out = Laid(mission, mission.kind_of[robot], nodes)
            for i, step in enumerate(work.steps[: len(nodes)]):
                found = [step.ahead, step.gained]
                if not mission.is_plain:
                    found += [work.loads[i].carried, work.loads[i].to_depot]
                expected = laid_out.at(i)[: len(found)]
                assert found == pytest.approx(expected, rel=1e-12, abs=1e-14)
            kernels.clear_trail(mission.arrays, work)


@pytest.mark.compiled_only
@pytest.mark.parametrize("pays", ["arrival", "return"])
def test_the_bound_changes_nothing_but_the_time_it_takes(pays):
    mission = Mission(load_mission("toy").graph, pays=pays)
    outcomes = []
    for bounded in (True, False):
        with plain_local_search() as patch:
            search = local_search(mission)
            if not bounded:
                lay_out = kernels.lay_out

                def unbounded(graph, store, work, trail, lay_out=lay_out):
                    lay_out(graph, store, work, trail)
                    work.steps["ahead"] = np.inf

                patch.setattr(kernels, "lay_out", unbounded)
            search.run(500)
        outcomes.append(outcome(search))
    assert outcomes[0] == outcomes[1]


@pytest.mark.compiled_only
def test_paths_searched_before_change_nothing():
    mission = load_mission("art_museum")
    with plain_local_search():
        one, other = local_search(mission), local_search(mission)
        for goal in range(len(mission.nodes)):
            routes.search_routes(mission.arrays, other._routes, goal)
        one.run(100)
        other.run(100)
        assert outcome(one) == outcome(other)


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
        pytest.param(load_mission("terrain", nodes=30, robots=4), 300, {}, marks=pytest.mark.slow),
        (one_way(), 1_000, {"p_refill": 0.0}),
        pytest.param(
            load_mission("drones_and_rovers"), 300, {"p_refill": 0.5}, marks=pytest.mark.slow
        ),
        pytest.param(
            load_mission("two_communities"),
            800,
            {"p_refill": 0.5, "max_length": 12.0},
            marks=pytest.mark.slow,
        ),
        (load_mission("toy"), 800, {"p_refill": 1.0, "max_length": 6.0, "min_survival": 0.2}),
        (load_mission("toy"), 3_500, {}),  # solved soon, and what the search does when it is stuck
    ],
)
def test_plain_python_finds_the_same_to_the_bit(monkeypatch, mission, n_evaluations, rule):
    for module in (routes, search_module):  # the terrain's paths are known in part
        monkeypatch.setattr(module, "FULL_UP_TO", 25)
    monkeypatch.setattr(routes, "NEAR", 8)
    floor = rule.get("min_survival", 0.0)
    limits = {"min_survival": floor, "max_length": rule.get("max_length", np.inf)}
    start = [plan_sequentially(mission, 1.0, beam_width=5, **limits)]
    compiled = local_search(mission, start, seed=3, **rule)
    parts = (n_evaluations - 100, 1, 99)
    spent = [compiled.run(n) for n in parts]
    with plain_local_search():
        plain = local_search(mission, start, seed=3, **rule)
        assert [plain.run(n) for n in parts] == spent == list(parts)
        assert outcome(plain) == outcome(compiled)
    assert len(compiled) > 5


def test_children_find_room(monkeypatch):
    """In plain Python, where a plan that is written beside its front is an error."""
    monkeypatch.setattr(search_module, "_FIRST_PLANS", 3)
    with plain_local_search():
        search = local_search(load_mission("toy"))
        assert search.run(2_500) == 2_500
