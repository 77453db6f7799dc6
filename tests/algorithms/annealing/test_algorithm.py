"""Simulated annealing through pymoo: budgets, sweeps, floors, and the published curve."""

import numpy as np
import pytest
from pymoo.core.termination import NoTermination

from botohe_moo import BOTOHE, area_indicator, load_mission
from botohe_moo.algorithms.annealing.algorithm import Annealing, SimulatedAnnealing
from botohe_moo.algorithms.annealing.kernels import DETOUR, MOVES

journal = SimulatedAnnealing.journal
both = pytest.mark.parametrize("made", [SimulatedAnnealing, journal], ids=["usual", "journal"])
MUSEUM = load_mission("art_museum")


def begun(algorithm, budget, *, seed=1, **limits):
    termination = NoTermination() if budget is None else ("n_eval", budget)
    return algorithm.setup(BOTOHE(MUSEUM, **limits), termination=termination, seed=seed)


def generations(algorithm, n=None):
    """Run an algorithm for ``n`` generations or to its end; yield its search after each."""
    while n != 0 and algorithm.has_next():
        algorithm.next()
        yield algorithm._search
        n = n and n - 1


def front(algorithm):
    [*generations(algorithm)]
    return sorted((each.F.tobytes(), each.X[0].trails) for each in algorithm.opt)


@both
def test_generations_do_not_change_what_is_found(made):
    whole, parts = front(begun(made(), 300)), front(begun(made(steps_per_generation=1), 300))
    assert whole == parts


@both
def test_a_weight_starts_from_the_best_given_plan(made):
    good = begun(SimulatedAnnealing(), 5_000, seed=9).run()
    algorithm = begun(made(sampling=good.X), 100_000)
    [search] = generations(algorithm, 1)
    search._rule = search._rule._replace(weight=0.6)
    search.start_from(algorithm.archive)
    best = np.argmax(-good.F @ [0.6 / MUSEUM.total_reward, 0.4 / MUSEUM.robots])
    [found], objectives = search.best()
    assert objectives.tolist() == (-good.F[[best]]).tolist()
    assert found == good.X[best, 0]


@both
def test_plans_below_the_floor_are_nothing_to_start_from(made):
    daring = MUSEUM.plan([[1, 2, 21, 27, 25, 27, 21, 2, 1]] * 3)
    result = begun(made(sampling=[daring]), 500, min_survival=0.6).run()
    assert MUSEUM.robot_survival([daring]).max() < 0.6 <= MUSEUM.robot_survival(result.X).min()
    assert len(result.X) > 1


@both
def test_sweep_after_sweep_without_a_budget(made):
    algorithm = begun(made(sweep_evaluations=100, n_weights=5), None)
    spent, weights = [], []
    for search in generations(algorithm, 25):
        spent.append(algorithm.evaluator.n_eval)
        weights.append(search.weight)
    up = [0.0, 0.25, 0.5, 0.75, 1.0]
    sweep = up if made is journal else (up + up[::-1]) * 2
    assert weights == (sweep * 5)[:25]
    assert np.diff(spent).tolist() == [100 // len(sweep)] * 24


def test_weights_go_up_once_or_up_and_down():
    weights = [search.weight for search in generations(begun(SimulatedAnnealing(n_passes=3), 1001))]
    up = np.linspace(0, 1, 10).tolist()
    assert weights == pytest.approx([*up, *up[::-1], *up])
    algorithm = begun(journal(), 1_003)
    spent = [0]
    for search, weight in zip(generations(algorithm), np.linspace(0, 1, 32), strict=True):
        assert search.weight == pytest.approx(weight)
        spent.append(algorithm.evaluator.n_eval)
    assert {*np.diff(spent).tolist()} == {31, 32}
    assert spent[-1] == 1_003


def test_the_journal_keeps_only_the_best_plans_of_the_weights():
    algorithm = begun(journal(steps_per_generation=5), 400, seed=3)
    best = [search.best()[1][0] for search in generations(algorithm) if search.steps_left == 0]
    assert len(best) == 20
    better = [(best >= f).all(1) & (best > f).any(1) for f in best]
    expected = {tuple(f) for f, by in zip(best, better, strict=True) if not by.any()}
    assert {*map(tuple, -algorithm.result().F)} == expected


def test_temperatures():
    """The journal's fall by a twentieth a step, ours to a hundredth of the first temperature."""
    algorithm = begun(journal(steps_per_generation=4), 100, seed=3)
    searches = zip((4, 8, 10, 4, 8, 10), generations(algorithm, 6), strict=True)
    for steps, search in searches:
        assert search.state.temperature[0] == pytest.approx(0.2 * 0.95**steps)
    share = (MUSEUM.rewards**2).sum() / MUSEUM.rewards.sum() ** 2
    for given, first in ((None, 0.2 * share), (0.5, 0.5)):
        algorithm = begun(SimulatedAnnealing(initial_temperature=given), 1_001, seed=3)
        for search in generations(algorithm, 7):  # each a weight's 25 steps
            assert search.steps_left == 0
            assert search.state.temperature[0] == pytest.approx(first / 100)


@pytest.mark.parametrize(
    ("budget", "published", "deviation"),
    [(10_000, 0.4141, 0.0179), pytest.param(99_856, 0.4728, 0.0053, marks=pytest.mark.slow)],
)
def test_the_published_curve_in_short(budget, published, deviation):
    """Four runs; `python -m benchmarks annealing` goes on to 1 000 000 evaluations."""
    results = [begun(journal(), budget, seed=seed).run() for seed in range(1, 5)]
    areas = [area_indicator(-result.F, MUSEUM) for result in results]
    assert np.mean(areas) == pytest.approx(published, abs=2 * deviation)


def test_moves_that_are_not_named_are_not_drawn():
    usual, named = (begun(SimulatedAnnealing(**m), 1_001) for m in ({}, {"moves": {"grab": 2}}))
    assert front(named) != front(usual)
    weights = named._search.weights_of_moves()
    assert dict(zip(MOVES, weights, strict=True)) == dict.fromkeys(MOVES, 0) | {"grab": 2}


def test_detours_are_for_one_way_arcs(monkeypatch):
    """Where every arc has a reverse none is drawn: published runs stay as they were published."""
    usual = begun(SimulatedAnnealing(), 3_000)
    expected, weights = front(usual), usual._search.weights_of_moves()
    assert weights[DETOUR] == 0
    monkeypatch.setattr(Annealing, "weights_of_moves", lambda _: np.append(weights[:DETOUR], 1.0))
    assert front(begun(SimulatedAnnealing(), 3_000)) != expected


@pytest.mark.parametrize("made", [SimulatedAnnealing, journal])
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"cooling": 1.5}, r"Expected cooling in \(0, 1\], got 1\.5"),
        ({"moves": {"jump": 1}}, "Expected moves among .*insert.*, got 'jump'"),
        ({"moves": {"insert": 0}}, "Expected a move of weight above 0"),
        ({"moves": {"insert": -1}}, r"Expected moves\['insert'\] >= 0, got -1"),
    ],
)
def test_settings_are_checked(made, wrong, message):
    with pytest.raises(ValueError, match=message):
        made(**wrong)
