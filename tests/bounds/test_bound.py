"""Bounds on fronts: no plan exceeds them, at any moment; and what can be asked of them."""

import json
import pickle
import threading
from fractions import Fraction
from itertools import combinations_with_replacement, count

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import FrontBound, Mission, area_indicator, bound_front, load_mission
from botohe_moo.algorithms.exact.front import exact_front
from botohe_moo.bounds import deadline
from botohe_moo.bounds.certificate import Facts
from botohe_moo.bounds.front_bound import Line, Step, convex_below, lower_envelope
from botohe_moo.bounds.lines import LineProver
from botohe_moo.bounds.net import new_net
from botohe_moo.bounds.prices import PricedTeam, most_levels, refine
from botohe_moo.bounds.proof import Proof
from botohe_moo.bounds.stairs import StairsProver
from tests.examples import examples, seeds
from tests.strategies import missions


def random_mission(seed):
    """One-way ones and trees, sure arcs, equal rewards, the base in the middle; and limits."""
    rng = np.random.default_rng(seed)
    n_nodes = int(rng.integers(4, 8))
    graph = nx.DiGraph()
    for node in range(n_nodes):
        drawn = float(np.round(rng.random() * (rng.random() < 0.8), 2))
        graph.add_node(node, reward=drawn if seed % 3 else 1.0)
    if seed % 2:
        nx.add_cycle(graph, rng.permutation(n_nodes).tolist())
    for node in range(1, n_nodes) if seed % 2 == 0 else ():
        before = int(rng.integers(0, node))
        graph.add_edges_from([(before, node), (node, before)])
    for _ in range(int(rng.integers(0, 7))):
        tail, head = rng.choice(n_nodes, 2, replace=False).tolist()
        graph.add_edge(tail, head)
    sure = rng.choice([0.0, 0.1, 1.0], p=[0.6, 0.25, 0.15])
    for arc in graph.edges:
        drawn = float(np.round(rng.uniform(0.5, 0.99), 2))
        graph.edges[arc]["survival"] = 1.0 if rng.random() < sure else drawn
    mission = Mission(graph, base=int(rng.integers(n_nodes)), robots=int(rng.integers(1, 4)))
    floor = float(rng.choice([0.0, 0.0, 0.3, 0.6]))
    longest = (None, None, 4.0, 6.0)[rng.integers(4)]
    return mission, {"min_survival": floor, "max_length": longest}


def bounded_at_all_stages(mission, limits, seed, **options):
    """The true front, and the bounds on the way, the last one last: no plan exceeds any of them."""
    true = mission.evaluate(exact_front(mission, **limits))
    stages = []
    options = {"time_limit": 60, "seed": seed, "callback": stages.append, **options}
    stages.append(bound_front(mission, **limits, **options))
    for bound in stages:
        assert (bound.bound(true[:, 1]) >= true[:, 0]).all(), seed
    return true, stages


@pytest.mark.slow
@pytest.mark.parametrize("seeds", seeds(10, 40))
def test_no_plan_exceeds_the_bound_at_any_stage(no_front, short_search, seeds):
    tight = n_stages = 0
    for seed in seeds:
        mission, limits = random_mission(seed)
        true, [*stages, last] = bounded_at_all_stages(mission, limits, seed)
        n_stages += len(stages)
        assert last.area >= area_indicator(true, mission) - 1e-12
        points = last.points
        assert (points[:, None] >= true * (1 - 1e-12)).all(axis=2).any(axis=0).all(), seed
        assert last.gap(true) < 0.02, seed
        tight += last.gap(true) < 1e-6
    assert n_stages > 5 * len(seeds)
    assert tight > 0.4 * len(seeds)


@pytest.mark.parametrize("seeds", seeds(3, 20))
def test_no_plan_exceeds_what_threads_prove(no_front, short_search, seeds):
    for seed in seeds:
        mission, limits = random_mission(seed)
        true, [*_, last] = bounded_at_all_stages(mission, limits, seed, n_threads=2 + seed % 3)
        assert last.gap(true) < 0.02, seed


@pytest.mark.parametrize("limits", [{"min_survival": 0.07}, {"max_length": 0.3}])
def test_a_plan_that_rounding_takes_beyond_a_limit_is_not_above_the_bound(limits):
    graph = nx.DiGraph()
    graph.add_nodes_from([(0, {"reward": 0.0}), (1, {"reward": 1.0})])
    graph.add_edge(0, 1, survival=0.7, length=0.1)
    graph.add_edge(1, 0, survival=0.1, length=0.2)
    assert 0.7 * 0.1 < 0.07
    assert 0.1 + 0.2 > 0.3
    front = [[0.7, 0.07], [0.0, 1.0]]
    bound = bound_front(Mission(graph, base=0, robots=1), front=front, **limits)
    assert bound.gap(front) < 1e-9


@pytest.mark.parametrize("n_threads", [1, 3])
def test_what_a_callback_raises_ends_all_threads(no_front, n_threads):
    """Ctrl-C returns what is proved; other errors are raised."""
    mission, limits = random_mission(4)
    seen, running = [], threading.active_count()

    def interrupt(bound):
        seen.append(bound)
        if len(seen) > 2:
            raise error

    error = KeyboardInterrupt()
    given = {"time_limit": 60, "callback": interrupt, "n_threads": n_threads}
    last = bound_front(mission, **limits, **given)
    assert last.area <= seen[-1].area
    assert len(seen) == 3
    seen.clear()
    error = RuntimeError("enough")
    with pytest.raises(RuntimeError, match="enough"):
        bound_front(mission, **limits, **given)
    assert len(seen) == 3
    assert threading.active_count() == running


def test_steps_are_raised_to_better_teams(no_front, monkeypatch):
    """Where plans that are known are poor, steps end at what teams collect."""
    prove = StairsProver.prove
    monkeypatch.setattr(Proof, "_find_trails", lambda _: None)
    monkeypatch.setattr(LineProver, "prove", lambda *_: Facts())
    monkeypatch.setattr(
        StairsProver, "prove", lambda s, t, c: prove(s, t, c) if t.moving == 1 else Facts()
    )
    n_steps = n_tight = 0
    for seed in range(60):
        mission, limits = random_mission(seed)
        true = mission.evaluate(exact_front(mission, **limits))
        known = true[:2] if seed % 2 else None
        bound = bound_front(mission, **limits, front=known, time_limit=60, seed=seed)
        assert (bound.bound(true[:, 1]) >= true[:, 0]).all(), seed
        n_steps += len(bound.steps)
        n_tight += bound.gap(true) < 1e-3
    assert n_steps > 80
    assert n_tight > 30


def test_small_missions_get_their_front():
    for seed in range(40):
        mission, limits = random_mission(seed)
        true = mission.evaluate(exact_front(mission, **limits))
        bound = bound_front(mission, **limits)
        assert bound.bound(true[:, 1]) == pytest.approx(true[:, 0], abs=1e-9)
        assert (bound.bound(true[:, 1]) >= true[:, 0]).all()
        assert bound.gap(true) <= 1e-9
        above = bound.bound(true[:-1, 1] + 1e-9)
        assert above == pytest.approx(true[1:, 0], abs=1e-9)


def test_notes_say_which_limits_weaken_it(no_front):
    bound = bound_front(load_mission("toy"), min_survival=0.1, max_length=8, time_limit=2)
    assert len(bound.notes) == 2
    assert "budget" in bound.notes[0]
    assert "floor" in bound.notes[1]


@pytest.mark.slow
def test_the_museum_is_bounded_within_one_per_cent():
    museum = load_mission("art_museum")
    gaps = []
    bound = bound_front(
        museum, time_limit=60, gap=0.01, callback=lambda each: gaps.append(each.area)
    )
    assert (np.diff(gaps) <= 1e-12).all()  # more time only lowers it
    assert 0.5331 < bound.area < 0.5331 * 1.02
    assert {line.proof for line in bound.lines} <= {"everything", "relaxed", "exact"}
    assert {step.proof for step in bound.steps} == {"exact"}


@pytest.mark.slow
def test_the_speed_of_a_machine_does_not_decide_what_is_done_next(no_front, monkeypatch):
    """Time goes by whenever the clock is looked at; on the third machine it is over too early."""
    mission = load_mission("tunnel", nodes=14, robots=2, seed=1)
    found = []
    for step in (0.0, 1e-3, 8e-3):
        ticks, stages = count(), []
        now = lambda ticks=ticks, step=step: next(ticks) * step  # noqa: E731
        monkeypatch.setattr(deadline, "own_time", now)
        last = bound_front(mission, time_limit=5, callback=stages.append, gap=0.01)
        found.append([(each.lines, each.steps) for each in (*stages, last)])
    assert last.seconds > 5
    first, slower, slowest = found
    assert len(first) > 10
    assert slower == first
    assert 5 < len(slowest) < len(first)
    # The time was over in the middle of what the last stage has.
    assert slowest[:-2] == first[: len(slowest) - 2]


@pytest.mark.slow
def test_units_of_reward_do_not_matter(no_front):
    mission, _ = random_mission(2)
    options = {"gap": 0.02, "time_limit": 200}
    one = bound_front(mission, **options)
    again = bound_front(mission, seed=1, **options)
    assert again.lines == one.lines
    assert again.steps == one.steps
    for power in (-900, 990):
        graph = nx.DiGraph(mission.graph)
        for node in graph:
            graph.add_node(node, reward=graph.nodes[node]["reward"] * 2.0**power)
        scaled = Mission(graph, base=mission.base, robots=mission.robots)
        other = bound_front(scaled, **options)
        for name in ("most", "mu"):
            expected = [getattr(line, name) * 2.0**power for line in one.lines]
            assert [getattr(line, name) for line in other.lines] == expected
        assert one.area == pytest.approx(other.area, rel=1e-12)


@pytest.mark.slow
def test_sure_arcs_between_which_relaxed_trails_collect_without_end(no_front, short_search):
    """Until they remember enough, what lies ahead is at most all that there is."""
    for seed in range(8):
        mission, limits = random_mission(seed)
        graph = nx.DiGraph(mission.graph)
        for i, arc in enumerate(list(graph.edges)):
            if (i + seed) % 3:
                graph.edges[arc]["survival"] = 1.0
        mission = Mission(graph, base=mission.base, robots=mission.robots)
        true, [*_, last] = bounded_at_all_stages(mission, limits, seed)
        assert last.gap(true) < 0.02, seed


def test_the_solver_prints_nothing(no_front, capfd):
    bound_front(load_mission("toy"), time_limit=1)
    assert capfd.readouterr() == ("", "")


def test_nothing_to_collect_and_nowhere_to_go():
    robots = 3
    alone = nx.DiGraph()
    alone.add_node(0, reward=3.0)
    bound = bound_front(Mission(alone, base=0, robots=robots))
    assert bound.bound([0.0, robots]) == pytest.approx(3.0)
    assert bound.bound(robots + 0.1) == -np.inf
    assert bound.area == pytest.approx(1.0)
    pair = nx.DiGraph([(0, 1), (1, 0)])
    nx.set_edge_attributes(pair, 0.5, "survival")
    nx.set_node_attributes(pair, 0.0, "reward")
    nothing = bound_front(Mission(pair, base=0, robots=robots))
    assert nothing.area == 0.0
    assert nothing.gap(np.array([[0.0, robots]])) == 0.0


@pytest.mark.compiled_only
def test_little_memory_gives_a_weaker_bound(no_front):
    mission = load_mission("terrain", nodes=11, robots=2, seed=3)
    weakest = bound_front(mission, time_limit=0.5, memory_limit=0.001)
    weak = bound_front(mission, time_limit=0.5, memory_limit=0.02)
    found = bound_front(mission, time_limit=1.5)
    assert weakest.area >= weak.area >= found.area * (1 - 1e-3)
    assert weakest.notes == (
        "Prices for this number of robots and nodes do not fit into the memory.",
    )
    assert weak.notes == ("Relaxed trails remember less than they would with more memory.",)
    assert found.notes == ()


@pytest.mark.slow
def test_hundreds_of_robots():
    """All of them look for the reward of 10, for which only the first ones matter."""
    robots = 150
    toy = load_mission("toy", robots=robots)
    bound = bound_front(toy, time_limit=1)
    plan = toy.evaluate([toy.plan([[1, 2, 1]] * robots)])[0]
    assert bound.bound(plan[1]) >= plan[0]
    area = bound.area  # takes seconds for thousands of robots
    assert 0.9 < area < 1
    assert isinstance(area, float)
    with pytest.raises(ValueError, match="at most 5,000 robots, got 5,001"):
        bound_front(load_mission("toy", robots=5_001))


class TestByHand:
    """A base and one node of reward 10; two robots, each half-way lost on each of two arcs."""

    @pytest.fixture
    def mission(self):
        graph = nx.DiGraph([(0, 1), (1, 0)])
        nx.set_node_attributes(graph, {0: 0.0, 1: 10.0}, "reward")
        nx.set_edge_attributes(graph, 0.5, "survival")
        return Mission(graph, base=0, robots=2)

    @pytest.fixture
    def bound(self, mission):
        lines = (Line(1, 6.0, 4.0, "relaxed"), Line(2, 8.0, 0.0, "everything"))
        steps = (Step(2, 7.5, 0.25, "front"),)
        return FrontBound(
            mission=mission,
            lines=lines,
            steps=steps,
            most_survival=0.25,
            min_survival=0.0,
            max_length=np.inf,
            seconds=1.0,
        )

    def test_values(self, bound):
        """One robot moves from 1 to 1.25 survivors; both do up to 0.5."""
        survivors = [0.0, 0.2, 0.3, 0.5, 0.6, 1.0, 1.125, 1.25, 1.3, 2.0, 2.1]
        expected = [8.0, 8.0, 7.5, 7.5, 6.0, 6.0, 5.5, 5.0, 0.0, 0.0, -np.inf]
        assert bound.bound(survivors) == pytest.approx(expected)
        assert bound.bound(0.2) == 8.0
        assert isinstance(bound.bound(0.2), float)
        assert bound.bound([[0.2, 0.6]]).shape == (1, 2)

    def test_area(self, bound):
        """8 to 0.25, 7.5 to 0.5, 6 to 1, and from 6 to 5 up to 1.25; of 10 × 2."""
        expected = (8 * 0.25 + 7.5 * 0.25 + 6 * 0.5 + 5.5 * 0.25) / 20
        assert bound.area == pytest.approx(expected)
        assert bound.gap([[8.0, 0.25]]) == pytest.approx(expected * 20 / 2 - 1)
        assert bound.gap([[0.0, 2.0]]) == np.inf

    def test_true_figures_lie_below(self, mission):
        """Reward 7.5 with both, 0.5 survivors; 5 with one, 1.25 survivors; 0, 2 survivors."""
        bound = bound_front(mission)
        assert bound.bound([0.5, 1.25, 2.0]) == pytest.approx([7.5, 5.0, 0.0])
        assert bound.area == pytest.approx((7.5 * 0.5 + 5 * 0.75) / 20)
        assert bound.gap([[7.5, 0.5], [5.0, 1.25], [0.0, 2.0]]) == pytest.approx(0.0, abs=1e-9)

    def test_what_is_not_numbers_is_refused(self, bound):
        for survivors in ([0.5, np.nan], "a"):
            with pytest.raises(ValueError, match=r"survivors (without NaN|as numbers), got"):
                bound.bound(survivors)

    def test_a_front_above_is_refused(self, bound, mission):
        for plan, most in (([7.6, 0.3], "7.5"), ([0.0, 2.1], "no plan")):
            found = rf"front: row 1 has {plan[0]:g} expected reward with {plan[1]:g}.* {most}"
            with pytest.raises(ValueError, match=found):
                bound.gap([[1.0, 0.1], plan])
        for reward in (7.6, 10.1):  # too many, and more than there are
            with pytest.raises(ValueError, match=f"front: row 0 has {reward} expected reward"):
                bound_front(mission, front=[[reward, 0.5]], time_limit=5)

    def test_files_and_pickles(self, bound, mission, tmp_path):
        path = tmp_path / "bound.json"
        bound.save(path)
        read = FrontBound.load(path, mission)
        assert (read.lines, read.steps, read.max_length) == (bound.lines, bound.steps, np.inf)
        assert read.area == bound.area
        assert pickle.loads(pickle.dumps(bound)).lines == bound.lines

    def test_what_is_not_a_bound_is_named(self, bound, mission, tmp_path):
        path = tmp_path / "bound.json"
        bound.save(path)
        whole = json.loads(path.read_text())
        for change, named in [
            ({"format": "other"}, "format"),
            ({"lines": [[1, "x", 0.0, "exact"]]}, "lines.0.1: .* number, found 'x'"),
            (
                {"lines": [[n, 1.0, 0.0, "exact"] for n in (1, 2, 3)]},
                r"expected lines for 1 to 2 robots that move, found lines for \[1, 2, 3\]",
            ),
            (
                {"steps": [[4, 1.0, 0.0, "exact"]]},
                r"expected steps for 1 to 2 robots that move, found steps for \[4\]",
            ),
            ({"mission_digest": "0"}, "another mission"),
        ]:
            path.write_text(json.dumps(whole | change))
            with pytest.raises(ValueError, match=named):
                FrontBound.load(path, mission)
        for text in (b"{", b"[]", b"\xff"):
            path.write_bytes(text)
            with pytest.raises(ValueError, match=r"bound.json is not a bound: .*\.$"):
                FrontBound.load(path, mission)


def test_bad_parameters_are_named():
    for options in ({"time_limit": 0}, {"gap": -0.1}):
        with pytest.raises(ValueError, match=f"Expected {next(iter(options))} "):
            bound_front(load_mission("toy"), **options)


def test_a_programme_without_a_solution_does_no_harm(no_front, monkeypatch):
    """As if HiGHS ran out of time at once, each time."""
    import highspy

    monkeypatch.setattr(highspy.Highs, "run", lambda _: None)
    mission = load_mission("toy")
    true = mission.evaluate(exact_front(mission))
    bound = bound_front(mission, time_limit=3)
    assert (bound.bound(true[:, 1]) >= true[:, 0]).all()
    assert bound.gap(true) < 5


def test_nodes_beyond_the_limits_pay_nothing():
    """Two hops lead to node 2, and two back: too long for the budget."""
    graph = nx.DiGraph([(0, 1), (1, 0), (1, 2), (2, 1)])
    nx.set_node_attributes(graph, {0: 0.0, 1: 1.0, 2: 100.0}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    net = new_net(Mission(graph, base=0, robots=1).limited(0.0, 3.0))
    assert net.graph.reward.tolist() == [0.0, 1.0, 0.0]


def test_ctrl_c_keeps_what_is_proved(no_front):
    seen = []

    def interrupt(bound):
        seen.append(bound)
        if len(seen) == 3:
            raise KeyboardInterrupt

    mission = load_mission("toy")
    true = mission.evaluate(exact_front(mission))
    bound = bound_front(mission, callback=interrupt)
    assert {line.proof for line in bound.lines} & {"relaxed", "exact"}
    assert bound.area <= seen[1].area < seen[0].area
    assert (bound.bound(true[:, 1]) >= true[:, 0]).all()


def both_ways(arcs, *, survival=0.9, reward=1.0, robots=2):
    graph = nx.DiGraph([*arcs, *((head, tail) for tail, head in arcs)])
    nx.set_node_attributes(graph, reward, "reward")
    nx.set_edge_attributes(graph, survival, "survival")
    return Mission(graph, base=0, robots=robots)


@pytest.mark.slow
def test_ways_that_nobody_survives(no_front):
    """A chain so long that its survival is 0 as a float; both robots reach its first node."""
    mission = both_ways([(i, i + 1) for i in range(330)], survival=0.1, reward=1.0)
    bound = bound_front(mission, time_limit=2)
    plan = mission.evaluate([mission.plan([[0, 1, 0], [0, 1, 2, 1, 0]])])[0]
    assert np.isfinite(bound.area)
    assert bound.bound(plan[1]) >= plan[0]


@pytest.mark.slow
def test_thousands_of_bridges(no_front):
    """Each node hangs on one."""
    mission = both_ways([(0, i + 1) for i in range(3_000)], survival=0.99)
    bound = bound_front(mission, time_limit=1)
    assert 0 < bound.area < 1
    assert bound.bound(2.0) == pytest.approx(1.0)


@given(st.lists(st.tuples(st.floats(0, 9), st.floats(0, 5)), min_size=1, max_size=9))
def test_lowest_lines(lines):
    most, mu = np.array(lines).T
    lowest = lower_envelope(most, mu)
    x = np.linspace(0, 20, 300)
    every = (most[:, None] - np.outer(mu, x)).min(axis=0)
    assert (most[lowest, None] - np.outer(mu[lowest], x)).min(axis=0) == pytest.approx(every)
    assert (np.diff(mu[lowest]) > 0).all()
    assert (np.diff(most[lowest]) > 0).all()


def drawn_prices(team, seed):
    rng = np.random.default_rng(seed)
    drawn = rng.uniform(0, 1, (len(team.nodes), team.n_levels + 1))
    drawn *= np.arange(team.n_levels + 1)
    for row, each in enumerate(drawn):
        drawn[row] = convex_below(each)
    return drawn * team.reward[:, None] / team.n_levels**2


@examples(60)
@given(missions(max_robots=4), st.integers(1, 4), st.integers(1, 5), st.integers(0, 99))
def test_what_a_node_gives_beside_prices(mission, n_robots, n_levels, seed):
    """In fractions: nothing that any levels give is above, without a tolerance."""
    team = PricedTeam(new_net(mission.world), n_robots, n_levels)
    prices = drawn_prices(team, seed)
    for paid in (prices, team.tidy(prices)):
        assert (paid == 0)[:, :1].all()
        assert (np.diff(paid, 2) >= -1e-12).all()
        most = team.most(paid)
        for row, node in enumerate(team.nodes.tolist()):
            reward = Fraction(float(mission.rewards[node]))
            reach = Fraction(float(team.alive[row, -1]))
            exact = max(
                reward * (1 - prod(1 - reach * level / n_levels for level in levels))
                - sum(Fraction(float(paid[row, level])) for level in levels)
                for levels in combinations_with_replacement(range(n_levels + 1), n_robots)
            )
            assert Fraction(float(most[row])) >= exact
            assert float(most[row]) == pytest.approx(float(exact), abs=1e-12)
    tidied = team.tidy(prices)
    assert (tidied <= prices + 1e-12).all()
    assert team.most(tidied).sum() == pytest.approx(team.most(prices).sum(), abs=1e-9)
    fine = refine(prices, 3)
    assert fine[:, ::3] == pytest.approx(prices)


def prod(factors):
    product = Fraction(1)
    for factor in factors:
        product *= factor
    return product


def test_large_teams_get_fewer_levels():
    assert [most_levels(robots, 12, 6_000) for robots in (3, 50)] == [12, 2]


def test_convex_functions_from_below():
    values = np.array([0.0, 1.0, 1.0, 2.0, 8.0])
    assert convex_below(values).tolist() == pytest.approx([0.0, 0.5, 1.0, 2.0, 8.0])
    assert convex_below(np.array([0.0, -1.0, 2.0])).tolist() == [0.0, 0.0, 2.0]


@given(
    st.lists(st.tuples(st.integers(1, 2), st.floats(2, 12), st.floats(0, 6)), max_size=6),
    st.lists(st.tuples(st.integers(1, 2), st.floats(0, 10), st.floats(0, 2)), max_size=6),
    st.sampled_from([0.0, 0.1]),
)
def test_the_area_is_that_below_the_bound(lines, steps, floor):
    """The bound falls, so that its values at both ends of short pieces enclose the area."""
    mission = load_mission("toy")
    everywhere = [Line(moving, 10.0, 0.0, "everything") for moving in (1, 2)]
    bound = FrontBound(
        mission=mission,
        lines=(*everywhere, *(Line(*line, "relaxed") for line in lines)),
        steps=tuple(Step(moving, most, least, "exact") for moving, most, least in steps),
        most_survival=0.9,
        min_survival=floor,
        max_length=np.inf,
        seconds=1.0,
    )
    n, whole = 50_000, mission.total_reward * mission.robots
    values = bound.bound(np.linspace(0.0, mission.robots, n + 1)) * mission.robots / n / whole
    assert values[1:].sum() - 1e-9 <= bound.area <= values[:-1].sum() + 1e-6
