"""Stairs of bounds: teams whose survivals are kept whole, and the prices made for them."""

from itertools import combinations_with_replacement
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from botohe_moo import load_mission
from botohe_moo.bounds import stairs as module
from botohe_moo.bounds.front_bound import add_stairs, falling, least_total
from botohe_moo.bounds.schedule import Schedule
from botohe_moo.bounds.stairs import StairsMaster, TeamStairs
from tests.bounds.test_bound import bounded_at_all_stages, random_mission
from tests.examples import seeds

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


@pytest.mark.slow
def test_fronts_of_small_tunnels(no_front):
    for seed in range(10):
        mission = load_mission("tunnel", nodes=12 + seed % 5, robots=1 + seed % 3, seed=seed)
        true, [*_, last] = bounded_at_all_stages(mission, {}, seed, gap=0.02)
        assert last.gap(true) < 0.05, seed
