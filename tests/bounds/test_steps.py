"""Stairs and steps of bounds, and what is to be proved next."""

from fractions import Fraction
from itertools import combinations_with_replacement, product
from types import SimpleNamespace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import Mission, load_mission
from botohe_moo.bounds import certificate as certificate_module
from botohe_moo.bounds import ground as ground_module
from botohe_moo.bounds import lines as lines_module
from botohe_moo.bounds import net as net_module
from botohe_moo.bounds import stairs as module
from botohe_moo.bounds import teams as teams_module
from botohe_moo.bounds.certificate import Certificate, Facts
from botohe_moo.bounds.deadline import Deadline
from botohe_moo.bounds.front_bound import (
    FrontBound,
    Line,
    Step,
    add_stairs,
    falling,
    least_total,
    stairs_of,
)
from botohe_moo.bounds.ground import N_STEPS, Target
from botohe_moo.bounds.lines import LineProver, LinesProgramme
from botohe_moo.bounds.proof import Proof
from botohe_moo.bounds.schedule import CellTargets, Known, StepTargets
from botohe_moo.bounds.stairs import StairsProgramme, StairsProver
from botohe_moo.bounds.teams import TeamProver
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
    starts, ends, heights = known.steps()
    assert starts == pytest.approx([0.0, 0.5, 1.25])
    assert ends.tolist() == [0.5, 1.25, 2.0]
    assert heights.tolist() == [10.0, 5.0, 0.0]
    for times in (1.0, 1.5):
        bound = SimpleNamespace(bound=lambda _, times=times: known.reached * times)
        assert known.gap(bound) == pytest.approx(times - 1.0)


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


ground = SimpleNamespace(unit=1.0, most_survival=0.8)


def test_the_step_that_lowers_the_bound_the_most_is_next(known):
    """Two robots are bounded by 12 up to 1.6, and one by 8 up to 1.8; 10, 5 and 0 are known.

    A goal of 10 from 0 on saves 2 x 1.6, one of 5 from 0.5 on 4 x 1.1 (8 is left for one), and one
    of 0 from 1.25 on 4 x 0.35. After the second, 10 saves 2 x 0.5, and 0 nothing. Steps of one
    robot are left to stairs.
    """
    targets = StepTargets(known, ground)
    steps = []
    for corner, x, goal in ((1, 0.5, 5.0), (0, 0.0, 10.0)):
        target, place = targets.take(bound_of(*steps))
        assert (target.moving, place[1]) == (2, corner)
        assert (target.x, target.goal, target.effort) == pytest.approx((x, goal, 1))
        targets.judge(place, Facts(), has_learned=False)
        steps.append(Step(2, target.goal, target.x, "exact"))
    assert targets.take(bound_of(*steps)) is None


def test_what_is_too_hard_is_made_easier_before_more_effort(known):
    """A quarter of what is between 5 and 12 is 1.75."""
    targets, found = StepTargets(known, ground), []
    while len(found) < 5:
        target, place = targets.take(bound_of())
        is_hard = place[1] == 1
        if is_hard:
            found.append((target.goal, target.effort))
        targets.judge(place, Facts(is_proved=not is_hard), has_learned=False)
    assert found == [(5.0, 1), (6.75, 1), (8.5, 1), (5.0, 8), (6.75, 8)]


@pytest.mark.parametrize("stairs", [False, True])
def test_cells_are_tried_where_the_gap_is_the_widest(known, stairs):
    """12 above 0 from 1.25 to 1.6; a cell has a width of 1/12, and stairs are for its beginning."""
    targets, found = CellTargets(known, 24, 3, stairs=stairs), []
    while (taken := targets.take(bound_of())) is not None:
        assert taken[1] not in [place for _, place in found]
        found.append(taken)
        targets.judge(taken[1], Facts(), has_learned=True)
    first, place = found[0]
    assert (first.moving, first.effort) == (2, 3)
    assert 1.25 <= first.x < 1.6
    begins = [target.x * 12 for target, _ in found if target.x > 0.0]
    assert (begins == pytest.approx(np.round(begins))) == stairs
    assert {target.moving for target, _ in found} == {1, 2}
    # Where relaxed trails have learned what they repeated there, it is tried again.
    targets.judge(place, Facts(repeating=(([0], [True]),)), has_learned=False)
    assert targets.take(bound_of()) is None
    targets.judge(place, Facts(repeating=(([0], [True]),)), has_learned=True)
    assert targets.take(bound_of()) == (first, place)


MOST_TEAMS = 20_000


def new_proof(mission, **limits):
    """A proof that has time."""
    world = mission.limited(**limits)
    return Proof(mission, world, seed=1, memory=1_024, deadline=Deadline(1_000), n_threads=1)


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
    for each in (ground_module, module, teams_module):
        monkeypatch.setattr(each, "N_STEPS", n_steps)
    monkeypatch.setattr(teams_module, "_N_HEIGHTS", n_heights)


@pytest.mark.parametrize("seeds", seeds(15, 30))
def test_no_team_of_all_trails_exceeds_a_step(monkeypatch, seeds):
    """Whatever the goal: of plans, beyond them, and 0; at any sum of survivals, and just above."""
    n_steps, n_tight, most_moves = 0, 0, module._MOST_MOVES
    for seed in seeds:
        mission, given = random_mission(seed)
        rng, limits = np.random.default_rng(seed), mission.limits(**given)
        every = twins.all_trails(mission, 2_000)
        if every is None or len(every) ** mission.robots > MOST_TEAMS:
            continue
        leaving = [trail for trail in every if len(trail) > 1]
        trails = twins.within(mission, leaving, limits.floors[0], limits.budgets[0])
        n_bits, nearest = [(14, 8), (0, 0), (2, 2)][seed % 3]
        monkeypatch.setattr(net_module, "_NEAREST", nearest)
        proof, n_levels = new_proof(mission, **given), int(rng.integers(1, 7))
        coarse = int(rng.integers(2, 12)), int(rng.integers(1, 20))
        for moving, sizes in product(
            range(1, mission.robots + 1) if trails else (), ((N_STEPS, 40), coarse)
        ):
            collected, sums = all_teams(mission, trails, moving)
            set_sizes(monkeypatch, *sizes)
            proof.ground = proof._new_ground(n_bits, n_levels)
            if seed % 2:
                proof._find_trails()
            # Elsewhere searches give up, and labels are left.
            monkeypatch.setattr(module, "_MOST_MOVES", [most_moves, 0][seed // 2 % 2])
            certificate = proof.ground.certificate()
            prover = (StairsProver if moving == 1 else TeamProver)(proof.ground)
            for _ in range(4):
                most = moving * proof.ground.most_survival
                x = rng.choice([0.0, rng.choice(sums), rng.choice(sums) * (1 + 1e-9), most])
                best = max(collected[sums >= x], default=0.0)
                goal = rng.choice([0.0, rng.choice(collected), best * rng.uniform(0.9, 1), 2.0])
                target = Target(moving, min(x, most), goal / proof.unit, 8)
                certificate.add(prover.prove(target, certificate))
            for step in certificate.steps():
                if step.n_robots != moving:
                    continue
                within = max(collected[sums >= step.least], default=0.0)
                assert step.most * proof.unit >= within
                if moving > 1:
                    n_tight += step.most * proof.unit < within + 1e-6
                    n_steps += 1
    assert n_steps > 0.6 * len(seeds)
    assert n_tight > 0.7 * n_steps


def test_a_programme_without_rows_that_have_no_effect_has_the_same_value(monkeypatch):
    """Elsewhere, some of these rows have to come back."""
    proof = new_proof(load_mission("art_museum"))
    proof._prepare()
    ground, values = proof.ground, {}
    for x in (0.8, 0.3):
        programme = LinesProgramme(ground, 2, relaxed=True)
        programme.aim(x)
        values[x], _, _ = programme.solve(ground.pool)
    assert programme.renewed(ground) is programme
    assert {name[0] for name in programme.tight()} == {"gains", "trail"}
    assert {*programme.used()} <= {*programme.tight()}
    monkeypatch.setattr(lines_module, "_MOST_ROWS", 0)
    again = programme.renewed(ground)
    n_rows = len(again.rows)
    assert n_rows < len(programme.rows)
    for x, most_new in ((0.3, n_rows / 10), (0.8, np.inf)):
        again.aim(x)
        assert again.solve(ground.pool)[0] == pytest.approx(values[x], rel=1e-9)
        assert len(again.rows) - n_rows < most_new
    # Nor has it rows of relaxed trails that are forbidden.
    dropped = next(number for kind, number, _ in filter(None, again.rows) if kind == "trail")
    monkeypatch.setattr(lines_module, "_MOST_ROWS", 9)
    assert again.renewed(ground) is again
    ground.pool._is_dropped[dropped], ground.pool._trails = True, None
    assert ("trail", dropped, 0) not in again.renewed(ground).rows


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
        ground = proof._new_ground(10, 1)
        certificate = ground.certificate()
        certificate.add(TeamProver(ground).prove(Target(robots, 0.0, 0.0, 8), certificate))
        true = 1 - (1 - Fraction(float(there))) ** robots
        assert certificate.steps()
        for step in certificate.steps():
            assert true <= Fraction(step.most * proof.unit) < true + Fraction(1e-9)


def test_what_a_trail_has_to_be_worth_by_hand(monkeypatch):
    """Two robots, four steps of 0.2; what the other one is worth falls from 10 by 5 s.

    A trail on the second step, from 0.2 to 0.4, leaves at least 0.6 to the other, which is then
    worth 7 at most: of a goal of 8 there is 1 left.
    """
    set_sizes(monkeypatch, 4, 4)
    prover = TeamProver(SimpleNamespace(most_survival=0.8, width=0.2 * (1 + 1e-9)))
    line = SimpleNamespace(most=10.0, worth=SimpleNamespace(mu=5.0))
    needed = prover._needed(2, 1.0, 8.0, [line], None)
    assert needed == pytest.approx([2.0, 1.0, 0.0, -1.0], abs=1e-6)
    # Stairs say that nobody is worth more than 6 and survives with 0.4 or more.
    needed = prover._needed(2, 1.0, 8.0, [line], np.array([9.0, 9.0, 6.0, 6.0]))
    assert needed == pytest.approx([2.0, 2.0, 0.0, -1.0], abs=1e-6)


heights = st.lists(st.floats(0, 10), min_size=4, max_size=7)


@given(heights, st.integers(1, 4), st.data())
def test_the_best_teams_of_bins(known, n_robots, data):
    """The first is the best of all teams that survive as needed; the others do, too."""
    stairs = falling(np.array(known))
    needed = data.draw(st.integers(0, n_robots * (len(stairs) - 1)))
    programme = SimpleNamespace(_needed=needed, team=SimpleNamespace(n_robots=n_robots))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_BINS", len(stairs))
        found = StairsProgramme._best_teams(programme, stairs)
    teams = combinations_with_replacement(range(len(stairs)), n_robots)
    best = max(stairs[list(team)].sum() for team in teams if sum(team) >= needed)
    assert stairs[found[0]].sum() == pytest.approx(best)
    assert all(len(team) == n_robots and sum(team) >= needed for team in found)


def test_sums_of_many_robots_hold_where_they_are_wanted():
    """Searches begin so far below a target that sums of twenty robots cover it."""
    ground = new_proof(load_mission("toy", robots=20))._new_ground(4, 1)
    n_found = 0
    for moving, share in product((2, 7, 20), (0.5, 0.9, 0.999, 1.0)):
        x = share * moving * ground.most_survival
        facts = StairsProver(ground).prove(Target(moving, x, effort=8), ground.certificate())
        total = int(least_total(x, ground.width, moving))
        for sums in facts.sums:
            if sums.moving == moving:
                assert sums.first <= total < sums.first + len(sums.most)
                n_found += 1
    assert n_found > 5


@given(heights, st.integers(1, 3), st.floats(0, 3), st.floats(0, 30))
def test_lifted_stairs_leave_teams_where_they_may_be(known, moving, x, worth):
    """No team that survives with x is worth more than before or than it may be."""
    stairs, width = falling(np.array(known)), 1 / len(known)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "N_STEPS", len(known))
        ground = SimpleNamespace(width=width, relaxation=SimpleNamespace(total=100.0))
        prover = StairsProver(ground)
        best = prover._teams(stairs, moving, x)
        lifted = prover._lifted(stairs, best, moving, worth)
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
    fall, width = certificate_module._FALL * 1e4, 0.1
    row = before = np.full(len(first), np.inf)
    for later in (row, first, first - falls * fall, first * 0.9):
        row = np.minimum(row, later)
        given = SimpleNamespace(_sums=[row], _steps=[[]], _total=1e4, _width=width)
        found = Certificate.steps(given)
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
    """Bounds by stairs, and by lines of relaxed trails, which set their first prices."""
    monkeypatch.setattr(TeamProver, "prove", lambda *_: Facts(is_proved=False))
    prove = LineProver.prove
    monkeypatch.setattr(
        LineProver, "prove", lambda s, t, c: prove(s, t, c) if t.moving == 1 else Facts()
    )


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


@pytest.mark.slow
@pytest.mark.parametrize("seeds", seeds(3, 50))
@pytest.mark.parametrize("name", ["tunnel", "rooms", "mine"])
def test_fronts_of_small_maps(no_front, monkeypatch, name, seeds):
    """Also where searches for trails give up, so that labels are left, which prove less.

    Rooms have fewer dead ends and robots than usual: their true fronts are quicker to find.
    """
    most_moves = module._MOST_MOVES
    for seed in seeds:
        given = {"nodes": 12 + seed % 4, "robots": 1 + seed % 3, "seed": seed}
        if name == "rooms":
            few = {"robots": 1 + seed % 2, "dead_ends": 0.3, "loops": 1 + seed // 2 % 2}
            given |= {"nodes": 12, **few}
        monkeypatch.setattr(module, "_MOST_MOVES", [most_moves, 0][seed % 2])
        mission = load_mission(name, **given)
        true, [*_, last] = bounded_at_all_stages(mission, {}, seed, gap=0.02)
        assert last.gap(true) < (0.15 if seed % 2 else 0.05), seed
