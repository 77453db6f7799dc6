"""Simulated annealing through pymoo: budgets, sweeps, floors, and the published curve."""

import numpy as np
import pytest
from pymoo.core.callback import Callback
from pymoo.core.termination import NoTermination
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, area_indicator, load_mission
from botohe_moo.algorithms.annealing.algorithm import Annealing, SimulatedAnnealing
from botohe_moo.algorithms.annealing.kernels import DETOUR, MOVES

journal = SimulatedAnnealing.journal
settings = pytest.mark.parametrize("made", [SimulatedAnnealing, journal], ids=["usual", "journal"])


@pytest.fixture(scope="module")
def museum():
    return load_mission("art_museum")


class EveryGeneration(Callback):
    def __init__(self):
        super().__init__()
        self.evaluations, self.weights = [], []

    def notify(self, algorithm):
        self.evaluations.append(algorithm.evaluator.n_eval)
        self.weights.append(algorithm._search.weight)


def solve(mission, n_eval, *, made=SimulatedAnnealing, seed=1, callback=None, **parameters):
    callback = callback or EveryGeneration()
    algorithm = made(**parameters)
    return minimize(BOTOHE(mission), algorithm, ("n_eval", n_eval), seed=seed, callback=callback)


def area(result):
    return area_indicator(-result.F, result.problem.mission)


def same(one, other):
    return one.F.tobytes() == other.F.tobytes() and [p.trails for p in one.X[:, 0]] == [
        p.trails for p in other.X[:, 0]
    ]


@settings
class TestContract:
    def test_generations_do_not_change_what_is_found(self, made, museum):
        whole = solve(museum, 300, made=made)
        parts = solve(museum, 300, made=made, steps_per_generation=1)
        assert same(whole, parts)

    def test_a_weight_starts_from_the_best_given_plan(self, made, museum):
        good = solve(museum, 5_000, seed=9)
        algorithm = made(sampling=good.X)
        algorithm.setup(BOTOHE(museum), termination=("n_eval", 100_000), seed=1)
        algorithm.next()
        search = algorithm._search
        search._rule = search._rule._replace(weight=0.6)
        search.start_from(algorithm.archive)
        rewards, survivors = -good.F[:, 0] / museum.total_reward, -good.F[:, 1] / museum.robots
        best = np.argmax(0.6 * rewards + 0.4 * survivors)
        found, objectives = search.best()
        assert objectives.tolist() == (-good.F[[best]]).tolist()
        assert found[0] == good.X[best, 0]

    def test_plans_below_the_floor_are_nothing_to_start_from(self, made, museum):
        daring = museum.plan([[1, 2, 21, 27, 25, 27, 21, 2, 1]] * 3)
        problem = BOTOHE(museum, min_survival=0.6)
        algorithm = made(sampling=[daring])
        result = minimize(problem, algorithm, ("n_eval", 500), seed=1)
        assert museum.robot_survival([daring]).max() < 0.6
        assert (museum.robot_survival(result.X) >= 0.6).all()
        assert len(result.X) > 1

    def test_sweep_after_sweep_without_a_budget(self, made, museum):
        callback = EveryGeneration()
        algorithm = made(sweep_evaluations=100, n_weights=5)
        algorithm.setup(BOTOHE(museum), termination=NoTermination(), seed=1, callback=callback)
        for _ in range(25):
            algorithm.next()
        up = [0.0, 0.25, 0.5, 0.75, 1.0]
        sweep = up if made is journal else (up + up[::-1]) * 2
        assert callback.weights == (sweep * 5)[:25]
        steps = 100 // len(sweep)
        assert np.diff(callback.evaluations).tolist() == [steps] * 24


def dominated(f, others):
    return ((others <= f).all(axis=1) & (others < f).any(axis=1)).any()


class TestJournal:
    def test_as_many_weights_as_steps(self, museum):
        callback, budget = EveryGeneration(), 1003
        solve(museum, budget, made=journal, callback=callback)
        n_weights = round(budget**0.5)
        assert callback.weights == pytest.approx(np.linspace(0, 1, n_weights))
        steps = np.diff([0, *callback.evaluations])
        assert steps.sum() == budget
        assert set(steps) <= {budget // n_weights, budget // n_weights + 1}

    def test_only_the_best_plans_of_the_weights(self, museum):
        algorithm = journal(steps_per_generation=5)
        algorithm.setup(BOTOHE(museum), termination=("n_eval", 400), seed=3)
        best = []
        while algorithm.has_next():
            algorithm.next()
            if algorithm._search.steps_left == 0:
                best.append(tuple(-algorithm._search.best()[1][0]))
        assert len(best) == 20
        fronts = {f for f in best if not dominated(np.array(f), np.array(best))}
        assert set(map(tuple, algorithm.result().F)) == fronts

    def test_temperatures(self, museum):
        algorithm = journal(steps_per_generation=4)
        algorithm.setup(BOTOHE(museum), termination=("n_eval", 100), seed=3)
        for steps in (4, 8, 10, 4, 8, 10):
            algorithm.next()
            temperature = algorithm._search.state.temperature[0]
            assert temperature == pytest.approx(0.2 * 0.95**steps)

    @pytest.mark.parametrize(
        ("budget", "published", "deviation"),
        [(10_000, 0.4141, 0.0179), pytest.param(99_856, 0.4728, 0.0053, marks=pytest.mark.slow)],
    )
    def test_the_published_curve_in_short(self, museum, budget, published, deviation):
        """Four runs; `python -m benchmarks annealing` goes on to 1 000 000 evaluations."""
        areas = [area(solve(museum, budget, made=journal, seed=s)) for s in range(1, 5)]
        assert np.mean(areas) == pytest.approx(published, abs=2 * deviation)


class TestUsual:
    def test_temperatures_fall_to_a_hundredth(self, museum):
        rewards = museum.rewards
        share = (rewards**2).sum() / rewards.sum() ** 2
        for given, begin in ((None, 0.2 * share), (0.5, 0.5)):
            algorithm = SimulatedAnnealing(initial_temperature=given)
            algorithm.setup(BOTOHE(museum), termination=("n_eval", 1_001), seed=3)
            for _ in range(7):  # each a weight's 25 steps
                algorithm.next()
                assert algorithm._search.steps_left == 0
                temperature = algorithm._search.state.temperature[0]
                assert temperature == pytest.approx(begin / 100)

    def test_moves_that_are_not_named_are_not_drawn(self, museum):
        usual, result = solve(museum, 1_001), solve(museum, 1_001, moves={"grab": 2, "swap": 1})
        weights = result.algorithm._search.weights_of_moves()
        assert dict(zip(MOVES, weights, strict=True)) == dict.fromkeys(MOVES, 0) | {
            "grab": 2,
            "swap": 1,
        }
        assert not same(result, usual)

    def test_weights_go_up_and_down(self, museum):
        callback = EveryGeneration()
        solve(museum, 1_001, callback=callback, n_passes=3)
        up = np.linspace(0, 1, 10).tolist()
        assert callback.weights == pytest.approx([*up, *up[::-1], *up])


def test_detours_are_for_one_way_arcs(monkeypatch, museum):
    """Where every arc has a reverse none is drawn: published runs stay as they were published."""
    usual = solve(museum, 3_000)
    weights = usual.algorithm._search.weights_of_moves()
    assert weights[DETOUR] == 0
    monkeypatch.setattr(Annealing, "weights_of_moves", lambda _: np.append(weights[:DETOUR], 1.0))
    assert not same(solve(museum, 3_000), usual)


def test_settings_are_checked():
    for wrong, message in [
        ({"cooling": 1.5}, r"Expected cooling in \(0, 1\], got 1\.5"),
        ({"moves": {"jump": 1}}, "Expected moves among .*insert.*, got 'jump'"),
        ({"moves": {"insert": 0}}, "Expected a move of weight above 0"),
        ({"moves": {"insert": -1}}, r"Expected moves\['insert'\] >= 0, got -1"),
    ]:
        for made in (SimulatedAnnealing, journal):
            with pytest.raises(ValueError, match=message):
                made(**wrong)
