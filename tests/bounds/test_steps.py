"""Steps of bounds: stairs of trails, and what is to be proved next."""

import math
import threading
from fractions import Fraction
from itertools import combinations_with_replacement, product
from types import SimpleNamespace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, load_mission
from botohe_moo.bounds import lines as lines_module
from botohe_moo.bounds import master as master_module
from botohe_moo.bounds import proof as proof_module
from botohe_moo.bounds import stairs as module
from botohe_moo.bounds import steps as steps_module
from botohe_moo.bounds.front_bound import (
    FrontBound,
    Line,
    Step,
    add_stairs,
    falling,
    least_total,
    stairs_of,
)
from botohe_moo.bounds.lines import N_STEPS, Lines
from botohe_moo.bounds.master import Master
from botohe_moo.bounds.proof import Proof
from botohe_moo.bounds.schedule import Schedule
from botohe_moo.bounds.stairs import StairsMaster, TeamStairs
from botohe_moo.bounds.steps import Steps
from botohe_moo.bounds.targets import Known, LineTargets, StepTargets
from botohe_moo.bounds.turns import Clock, Turns
from tests import twins
from tests.bounds.test_bound import bounded_at_all_stages, random_mission
from tests.examples import seeds

worths = st.lists(st.tuples(st.floats(0, 10), st.floats(0, 1)), min_size=1, max_size=6)


@given(worths, st.integers(1, 3), st.floats(0, 3))
def test_stairs_of_several_trails_are_above_them_together(known, n_trails, x):
    """No trails whose survivals sum to x are worth more than the sum of stairs."""
    values, survival = np.array(known).T
    n_steps, width = 8, 1.0000001 / 8
    most = add_stairs(stairs_of(values, survival, width, n_steps), n_trails)
    chosen = list(product(range(len(values)), repeat=n_trails))
    sums = np.array([(values[list(team)].sum(), survival[list(team)].sum()) for team in chosen])
    within = sums[sums[:, 1] >= x, 0]
    total = int(least_total(np.array([x]), width, n_trails)[0])
    above = most[total] if total < len(most) else -np.inf
    assert above >= max(within, default=-np.inf) - 1e-12
    # And by no more than the width of steps explains.
    near = sums[sums[:, 1] >= x - (2 * n_trails + 1) * width, 0]
    assert above <= max(near, default=-np.inf) + 1e-12


def test_stairs_by_hand():
    stairs = stairs_of(np.array([5.0, 3.0, 1.0]), np.array([0.1, 0.5, 0.25]), 0.25, 4)
    assert stairs.tolist() == [5.0, 3.0, 3.0, -np.inf]
    assert add_stairs(stairs, 2).tolist() == [10.0, 8.0, 8.0, 6.0, 6.0, -np.inf, -np.inf]


@pytest.fixture
def known():
    """Two robots: everything for 0.5 survivors, half of it for 1.25, and nobody leaves."""
    known = Known(0.0, 2)
    known.add(np.array([[10.0, 0.5], [5.0, 1.25], [4.0, 1.2]]))
    return known


def test_what_is_reached(known):
    at = [np.searchsorted(known.survivors, x) for x in (0.4, 0.6, 1.2, 1.3)]
    assert known.reached[at].tolist() == [10.0, 5.0, 5.0, 0.0]
    starts, ends, heights = known.stairs()
    assert starts == pytest.approx([0.0, 0.5, 1.25])
    assert ends.tolist() == [0.5, 1.25, 2.0]
    assert heights.tolist() == [10.0, 5.0, 0.0]
    assert known.gap(known.reached) == 0.0
    assert known.gap(known.reached * 1.5) == pytest.approx(0.5)


def bound_of(*steps):
    lines = (Line(1, 8.0, 0.0, "everything"), Line(2, 12.0, 0.0, "everything"))
    toy = load_mission("toy", robots=2)
    return FrontBound(
        mission=toy,
        lines=lines,
        steps=steps,
        most_survival=0.8,
        min_survival=0.0,
        max_length=np.inf,
        seconds=0.0,
    )


def test_the_step_that_lowers_the_bound_the_most_is_next(known):
    """Two robots are bounded by 12 up to 1.6, and one by 8 up to 1.8; 10, 5 and 0 are known.

    For two, a goal of 10 from 0 on saves 2 x 1.6, one of 5 from 0.5 on 4 x 1.1 (8 is left for one),
    and one of 0 from 1.25 on 4 x 0.35. Then 5 for one from 0.5 on saves 3 x 1.3, and 0 from 1.25 on
    3 x 0.35 + 8 x 0.2. In the end there is one robot from 1.6 to 1.8.
    """
    targets = StepTargets(known, 2, 0.8)
    steps = []
    for expected in ((2, 1, 5.0), (1, 1, 5.0), (1, 2, 0.0)):
        target = targets.take(bound_of(*steps), 2, 1)
        assert (target.moving, target.corner, target.goal) == expected
        targets.give_back(target, is_proved=True)
        stay = 2 - target.moving
        least = max(0.0, target.survivors - stay)
        steps.append(Step(target.moving, target.goal, least, "exact"))
    again = StepTargets(known, 2, 0.8)
    assert again.take(bound_of(), 0, 1) is None  # nobody moves


def test_what_is_too_hard_is_made_easier_before_more_effort(known):
    """One robot has no goals; a quarter of what is between 5 and 12 is 1.75 for two."""
    for moving, expected in (
        (1, [(5.0, 1), (5.0, 8), (5.0, 64)]),
        (2, [(5.0, 1), (6.75, 1), (8.5, 1), (5.0, 8)]),
    ):
        targets, found = StepTargets(known, 2, 0.8), []
        while len(found) < len(expected):
            target = targets.take(bound_of(), 2, 64)
            is_hard = target.moving == moving and target.corner == 1
            if is_hard:
                found.append((target.goal, target.effort))
            targets.give_back(target, is_proved=not is_hard)
        assert found == expected
    assert StepTargets(known, 2, 0.8).take(bound_of(), 2, 0.5) is None  # no time for any


def test_lines_are_found_where_the_gap_is_the_widest(known):
    targets = LineTargets(known, 24)
    first = targets.take(bound_of())
    assert first.moving == 2
    assert 1.25 < first.survivors < 1.6  # 12 above 0
    found = set()
    while (target := targets.take(bound_of())) is not None:
        assert target not in found
        found.add(target)
    assert first not in found
    targets.reopen(first)
    assert targets.take(bound_of()) == first
    assert {target.moving for target in found} == {1, 2}


def test_targets_may_be_made_anew_while_a_thread_has_one(monkeypatch):
    """The target is opened again where it came from, and work ends when all were tried twice."""
    proof = new_proof(load_mission("toy", robots=2))
    bound, efforts = proof.bound(), []
    work = Schedule(proof, gap=0.0, callback=None)._lines_work()

    def tighten(_, x, effort, until):
        is_first = not efforts
        efforts.append(effort)
        while is_first and work(bound, until):
            pass  # of another thread
        return is_first

    monkeypatch.setattr(Lines, "tighten", tighten)
    assert work(bound, math.inf)
    assert not work(bound, math.inf)
    assert sorted(set(efforts)) == [1, 16]


def test_a_step_is_judged_as_it_was_taken(known):
    """Another thread has raised its goal meanwhile."""
    targets = StepTargets(known, 2, 0.8)
    taken = targets.take(bound_of(), 2, 64)
    targets._share[:] += 0.25
    targets.give_back(taken, is_proved=True)
    assert not targets._is_open[taken.moving, taken.corner]


MOST_TEAMS = 20_000


def new_proof(mission, **limits):
    """A proof that has time."""
    world = mission.limited(**limits)
    return Proof(mission, world, seed=1, memory=1_024, clock=Clock(1_000), turns=Turns(1))


def all_teams(mission, trails, n_robots):
    """The E[R], and the sums of survivals, of all teams of these trails."""
    missed, survival = np.ones((len(trails), len(mission.nodes))), np.empty(len(trails))
    for i, trail in enumerate(trails):
        for node, alive in twins.reach_of(mission, trail).items():
            missed[i, node] = 1.0 - alive
        survival[i] = twins.survival_of(mission, trail)
    missed[:, mission.index(mission.base)] = 0.0
    teams = np.array(list(combinations_with_replacement(range(len(trails)), n_robots)))
    return (1.0 - missed[teams].prod(axis=1)) @ mission.rewards, survival[teams].sum(axis=1)


def set_sizes(monkeypatch, n_steps, n_heights):
    """Let stairs have as many steps, and thresholds as many heights."""
    monkeypatch.setattr(lines_module, "N_STEPS", n_steps)
    monkeypatch.setattr(steps_module, "N_STEPS", n_steps)
    monkeypatch.setattr(steps_module, "_N_HEIGHTS", n_heights)


@pytest.mark.parametrize("seeds", seeds(15, 30))
def test_no_team_of_all_trails_exceeds_a_step(short_search, monkeypatch, seeds):
    """Whatever the goal: of plans, beyond them, and 0; at any sum of survivals, and just above."""
    n_steps = n_tight = 0
    for seed in seeds:
        mission, given = random_mission(seed)
        rng, limits = np.random.default_rng(seed), mission.limits(**given)
        every = twins.all_trails(mission, 2_000)
        if every is None or len(every) ** mission.robots > MOST_TEAMS:
            continue
        leaving = [trail for trail in every if len(trail) > 1]
        trails = twins.within(mission, leaving, limits.floors[0], limits.budgets[0])
        proof = new_proof(mission, **given)
        nearest, n_bits = [(8, 10), (0, 0), (2, 2)][seed % 3]
        monkeypatch.setattr(proof_module, "_NEAREST", nearest)
        proof._prepare(n_bits, int(rng.integers(1, 7)))
        if seed % 2:
            proof._find_trails()
        coarse = int(rng.integers(2, 12)), int(rng.integers(1, 20))
        usual = N_STEPS, 40
        for moving, sizes in product(
            range(1, mission.robots + 1) if trails else (), (usual, coarse)
        ):
            collected, sums = all_teams(mission, trails, moving)
            set_sizes(monkeypatch, *sizes)
            steps = Steps(proof.lines[moving - 1], proof.most_survival)
            for _ in range(4):
                most = moving * proof.most_survival
                x = rng.choice([0.0, rng.choice(sums), rng.choice(sums) * (1 + 1e-9), most])
                best = max(collected[sums >= x], default=0.0)
                goal = rng.choice([0.0, rng.choice(collected), best * rng.uniform(0.9, 1), 2.0])
                steps.tighten(min(x, most), goal / proof.unit, 8, math.inf)
            for step in steps.found:
                within = collected[sums >= step.least]
                assert step.most * proof.unit >= max(within, default=0.0)
                n_tight += step.most * proof.unit < max(within, default=0.0) + 1e-6
                n_steps += 1
    assert n_steps > 2.5 * len(seeds)
    assert n_tight > 0.7 * n_steps


def test_rows_without_effect_are_left_out(monkeypatch):
    """The programme's value stays, and rows are still known by their trails."""
    proof = new_proof(load_mission("art_museum"))
    proof.prepare()
    lines, pool = proof.lines[1], proof.lines[1].pool
    master = Master(lines.team, lines.relaxation)
    value, _, _ = master.solve(pool, 0.8, math.inf)
    n_rows, n_trails = master._n_rows, len(master._rows)
    master.allow_relaxed(pool, allowed=False)
    assert master._n_rows == n_rows  # there are few
    monkeypatch.setattr(master_module, "_MOST_ROWS", 0)
    master.allow_relaxed(pool, allowed=False)
    assert master._lp.getNumRow() == master._n_rows < n_rows
    assert 0 < len(master._rows) < n_trails
    again, prices, theta = master.solve(pool, 0.8, math.inf)
    assert again == pytest.approx(value, rel=1e-9)
    assert master.active()
    for number in master.active():
        assert pool.value(number, prices) == pytest.approx(theta, abs=1e-6)
    # Elsewhere some rows have to come back.
    fresh, _, _ = Master(lines.team, lines.relaxation).solve(pool, 0.3, math.inf)
    assert master.solve(pool, 0.3, math.inf)[0] == pytest.approx(fresh, rel=1e-9)


@pytest.mark.slow
def test_steps_of_large_teams_are_rounded_upwards():
    """Two nodes: everybody goes there, and the same error is made in every factor."""
    robots, rng = 100, np.random.default_rng(1)
    for _ in range(20):
        graph = nx.DiGraph([(0, 1), (1, 0)])
        nx.set_node_attributes(graph, {0: 0.0, 1: 1.0}, "reward")
        graph.edges[0, 1]["survival"] = there = rng.uniform(0.2, 2) / robots
        graph.edges[1, 0]["survival"] = rng.uniform(0.1, 0.9)
        mission = Mission(graph, base=0, robots=robots)
        proof = new_proof(mission)
        proof._prepare(10, 1)
        steps = proof.steps[robots - 1]
        assert steps.tighten(0.0, 0.0, 8, math.inf)
        true = 1 - (1 - Fraction(float(there))) ** robots
        assert steps.found
        for step in steps.found:
            assert true <= Fraction(step.most * proof.unit) < true + Fraction(1e-9)


def test_what_a_trail_has_to_be_worth_by_hand(monkeypatch):
    """Two robots, four steps of 0.2; what the other one is worth falls from 10 by 5 s.

    A trail on the second step, from 0.2 to 0.4, leaves at least 0.6 to the other, which is then
    worth 7 at most: of a goal of 8 there is 1 left.
    """
    proof = new_proof(load_mission("toy", robots=2))
    set_sizes(monkeypatch, 4, 4)
    steps = Steps(proof.lines[1], 0.8)
    line = SimpleNamespace(most=10.0, worth=SimpleNamespace(mu=5.0))
    assert steps._needed(1.0, 8.0, [line], None) == pytest.approx([2.0, 1.0, 0.0, -1.0], abs=1e-6)
    # Stairs say that nobody is worth more than 6 and survives with 0.4 or more.
    stairs = np.array([9.0, 9.0, 6.0, 6.0])
    assert steps._needed(1.0, 8.0, [line], stairs) == pytest.approx([2.0, 2.0, 0.0, -1.0], abs=1e-6)


heights = st.lists(st.floats(0, 10), min_size=4, max_size=7)


@given(heights, st.integers(1, 4), st.data())
def test_the_best_teams_of_bins(known, n_robots, data):
    """The first is the best of all teams that survive as needed; the others do, too."""
    stairs = falling(np.array(known))
    needed = data.draw(st.integers(0, n_robots * (len(stairs) - 1)))
    master = SimpleNamespace(_needed=needed, team=SimpleNamespace(n_robots=n_robots))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_BINS", len(stairs))
        found = StairsMaster._best_teams(master, stairs)
    teams = combinations_with_replacement(range(len(stairs)), n_robots)
    best = max(stairs[list(team)].sum() for team in teams if sum(team) >= needed)
    assert stairs[found[0]].sum() == pytest.approx(best)
    assert all(len(team) == n_robots and sum(team) >= needed for team in found)


ZERO_TEAM = SimpleNamespace(most=lambda _: np.zeros(1))  # nothing is gained beside prices


@given(st.integers(2, 20), st.floats(0, 1), st.floats(1e-3, 1))
def test_searches_begin_low_enough_for_sums_of_many_robots(moving, share, most):
    """What holds for survivals of ``least`` or more holds for teams that survive with x."""
    width = most * (1 + 1e-9) / N_STEPS
    x, team = share * moving * most, SimpleNamespace(_width=width, _most_survival=most)
    least = TeamStairs._first_step(team, moving, x)
    lines = SimpleNamespace(base_reward=0.0, rounding=0.0, team=ZERO_TEAM)
    team._relaxation, team._lines = SimpleNamespace(total=0.0), [lines] * moving
    team._most = [np.full(j * (N_STEPS - 1) + 1, np.inf) for j in range(1, moving + 1)]
    TeamStairs._keep(team, np.zeros(0), np.zeros(N_STEPS), least)
    assert team._most[-1][: int(least_total(x, width, moving)) + 1].min() == 0.0


@given(heights, st.integers(1, 3), st.floats(0, 3), st.floats(0, 30))
def test_lifted_stairs_leave_teams_where_they_may_be(known, moving, x, worth):
    """No team that survives with x is worth more than before or than it may be."""
    stairs, width = falling(np.array(known)), 1 / len(known)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "N_STEPS", len(known))
        team = SimpleNamespace(_width=width, _relaxation=SimpleNamespace(total=100.0))
        best = TeamStairs._teams(team, stairs, moving, x)
        lifted = TeamStairs._lifted(team, stairs, best, moving, worth)
    assert (lifted >= stairs).all()
    assert (np.diff(lifted) <= 0).all()
    total = int(least_total(np.array([x]), width, moving)[0])
    before, after = add_stairs(stairs, moving), add_stairs(lifted, moving)
    if total < len(before):
        assert best.max() == before[total]
        assert after[total] <= max(before[total], worth) + 1e-9


@given(st.lists(st.tuples(st.floats(0, 10), st.floats(0, 1)), min_size=1, max_size=9))
def test_steps_only_fall_with_time(heights):
    """Also where steps that hardly fall are put together."""
    first, falls = np.array(heights).T
    fall, width = module._FALL * 1e4, 0.1
    row = before = np.full(len(first), np.inf)
    for later in (row, first, first - falls * fall, first * 0.9):
        row = np.minimum(row, later)
        relaxation = SimpleNamespace(total=1e4)
        found = TeamStairs.found.fget(
            SimpleNamespace(_most=[row], _relaxation=relaxation, _width=width)
        )
        x = (np.arange(len(row)) + 0.5) * width
        steps = np.array([(step.least, step.most) for step in found]).reshape(-1, 2)
        most = np.where(steps[:, 0] <= x[:, None], steps[:, 1], np.inf)
        after = most.min(axis=1, initial=np.inf)
        lowest = np.minimum.accumulate(row)
        assert (after >= lowest).all()
        assert (after <= np.maximum(lowest + fall * 1.001, 0)).all()
        assert (after <= before).all()
        before = after


@pytest.fixture
def stairs_alone(no_front, monkeypatch):
    """Bounds by stairs, and by the first lines of one robot, which give others to more robots."""
    for work in ("_lines_work", "_steps_work"):
        monkeypatch.setattr(Schedule, work, lambda *_, **__: lambda *_: False)


@pytest.mark.slow
@pytest.mark.parametrize("seeds", seeds(10, 40))
def test_no_plan_exceeds_stairs_at_any_stage(stairs_alone, short_search, seeds):
    n_steps = n_tight = 0
    for seed in seeds:
        true, [*_, last] = bounded_at_all_stages(*random_mission(seed), seed)
        n_steps += len(last.steps)
        n_tight += last.gap(true) < 0.03
    assert n_steps > 5 * len(seeds)
    assert n_tight > 0.5 * len(seeds)


@pytest.mark.parametrize("n_threads", [1, 4])
def test_one_thread_works_at_a_time_and_kernels_side_by_side(n_threads):
    turns, left = Turns(n_threads), list(range(40))
    working = aside = most_aside = 0
    lock = threading.Lock()
    everyone = threading.Barrier(n_threads, timeout=30)

    def work():
        nonlocal working, aside, most_aside
        working += 1
        assert working == 1
        if not left:
            working -= 1
            return False
        left.pop()
        is_first = len(left) >= 40 - n_threads
        working -= 1
        with turns.aside():
            with lock:
                aside += 1
                most_aside = max(most_aside, aside)
            if is_first:
                everyone.wait()  # for which all have to be here
            with lock:
                aside -= 1
        return True

    turns.repeat(work)
    assert left == []
    assert most_aside == n_threads
    with turns.aside():  # outside of work there is one thread
        pass


@pytest.mark.slow
def test_fronts_of_small_tunnels(no_front):
    for seed in range(10):
        mission = load_mission("tunnel", nodes=12 + seed % 5, robots=1 + seed % 3, seed=seed)
        true, [*_, last] = bounded_at_all_stages(mission, {}, seed, gap=0.02)
        assert last.gap(true) < 0.05, seed
