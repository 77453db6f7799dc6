"""Searching from Python, and what becomes of the solution."""

import csv
import json
import math
import signal
import sys
import tempfile
import threading
from collections import Counter
from datetime import date
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.algorithm import Algorithm
from pymoo.core.individual import Individual
from pymoo.core.population import Population
from pymoo.optimize import minimize

from botohe_moo import (
    BOACO,
    BOTOHE,
    Mission,
    MissionError,
    area_indicator,
    load_mission,
    make_algorithm,
    plots,
    read_solution,
    save_mission,
    solve,
    solving,
)
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES
from botohe_moo.base.runtime import hold_signals
from botohe_moo.problem import LeastSurvival
from botohe_moo.solution import Solution
from tests.examples import examples
from tests.strategies import missions_with_plans

FILES = ["front.csv", "front.png", "mission.json", "mission.png", "plans.json"]


@pytest.fixture(scope="module")
def toy():
    return load_mission("toy")


@pytest.fixture(scope="module")
def solution(toy):
    return solve(toy, "bo-aco", evaluations=250, seed=3)


@pytest.fixture
def interruptible():
    """Let Ctrl-C do what it usually does, even if whoever runs the tests ignores it."""
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, usual)


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def pressing(*iterations):
    """A callback that presses Ctrl-C after some iterations."""
    return lambda algorithm: algorithm.n_iter in iterations and signal.raise_signal(signal.SIGINT)


def solution_of(mission, plans, **changed):
    """A solution with these plans, given as node labels."""
    plans = tuple(mission.plan(trails) for trails in plans)
    given = {
        "mission": mission,
        "plans": plans,
        "objectives": mission.evaluate(plans),
        "algorithm": "by hand",
        "parameters": {},
        "seed": 1,
        "evaluations": len(plans),
        "seconds": 0.0,
        "interrupted": False,
    }
    return Solution(**{**given, **changed})


def pair(base, other, **attributes):
    """A mission of two nodes with these labels."""
    graph = nx.DiGraph()
    graph.add_node(base, reward=0, **attributes)
    graph.add_node(other, reward=2)
    graph.add_edge(base, other, survival=0.5)
    graph.add_edge(other, base, survival=0.5)
    return Mission(graph, base=base, robots=1)


class TestSearch:
    def test_front(self, toy, solution):
        front = solution.table
        assert isinstance(front, pd.DataFrame)
        assert list(front.columns) == ["plan_id", "reward", "survivors"]
        assert list(front["plan_id"]) == list(range(len(solution.plans)))
        assert front[["reward", "survivors"]].to_numpy().tolist() == solution.objectives.tolist()
        assert np.array_equal(toy.evaluate(solution.plans), solution.objectives)
        assert (np.diff(front["reward"]) <= 0).all()
        assert (np.diff(front["survivors"]) >= 0).all()
        assert len(set(solution.plans)) == len(solution.plans) > 3

    def test_worst_case_as_a_column(self, solution):
        table = solution.table.assign(worst_case=solution.worst_case())
        assert (table["worst_case"] < table["reward"]).any()
        assert (table["worst_case"] <= table["reward"]).all()

    def test_record(self, toy, solution):
        assert solution.mission is toy
        assert (solution.algorithm, solution.seed, solution.parameters) == ("bo-aco", 3, {})
        assert solution.seconds > 0
        assert not solution.interrupted
        assert solution.area == area_indicator(solution.objectives, toy) > 0.5
        assert solve(toy, BOACO(), evaluations=1).algorithm == "BOACO"
        assert solution.moves == {}

    def test_record_of_moves(self, toy):
        found = solve(toy, evaluations=3_000, n_islands=1)
        assert list(found.moves) == [*DEFAULT_MOVES, "ruin-and-recreate"]
        tried, entered = zip(*(brought.values() for brought in found.moves.values()), strict=True)
        assert found.evaluations - 100 <= sum(tried) <= found.evaluations
        assert 0 < sum(entered) < sum(tried)
        assert json.loads(found.to_json())["moves"] == found.moves

    def test_the_budget_is_exact(self, toy, monkeypatch):
        counted = []
        evaluate = BOTOHE.evaluate_batch
        monkeypatch.setattr(
            BOTOHE, "evaluate_batch", lambda self, b: counted.append(len(b)) or evaluate(self, b)
        )
        found = solve(toy, BOACO(), evaluations=101)
        assert found.evaluations == sum(counted) == 101
        assert not found.interrupted

    def test_the_seed_decides(self, toy, solution):
        again, other = (solve(toy, "bo-aco", evaluations=250, seed=seed) for seed in (3, 4))
        assert [p.trails for p in again.plans] == [p.trails for p in solution.plans]
        assert again.objectives.tobytes() == solution.objectives.tobytes()
        assert set(other.plans) != set(solution.plans)

    def test_bad_options(self, toy):
        with pytest.raises(ValueError, match=r"Expected evaluations >= 1, got 0\."):
            solve(toy, BOACO(), evaluations=0)
        with pytest.raises(ValueError, match=r"Expected seed >= 0, got -1\."):
            solve(toy, BOACO(), seed=-1)

    def test_an_algorithm_runs_once(self, toy):
        algorithm = BOACO()
        solve(toy, algorithm, evaluations=100)
        with pytest.raises(ValueError, match="has not run yet, got 'BOACO' after a run"):
            solve(toy, algorithm, evaluations=100)

    def test_by_names(self, toy):
        found = solve("toy", "bo-aco", evaluations=60, seed=2, n_ants=20, min_survival=0.5)
        assert found.mission == toy
        assert (found.algorithm, found.parameters) == ("bo-aco", {"n_ants": 20})
        assert (found.source, found.min_survival) == ({"name_or_path": "toy"}, 0.5)
        assert toy.robot_survival(found.plans).min() >= 0.5

    def test_a_travel_budget(self, toy):
        found = solve("toy", "nsga2", evaluations=300, seed=2, max_length=4)
        assert found.max_length == 4
        assert len(found.plans) > 1
        assert toy.trail_lengths(found.plans).max() == 4
        assert json.loads(found.to_json())["max_length"] == 4

    def test_a_travel_budget_of_the_mission_s_own(self, toy):
        graph = toy.graph.copy()
        graph.graph["max_length"] = 2
        mission = Mission(graph)
        assert solve(mission, "nsga2", evaluations=20).max_length == 2
        assert solve(mission, "nsga2", evaluations=20, max_length=3).max_length == 3
        lifted = solve(mission, "nsga2", evaluations=20, max_length=math.inf)
        assert lifted.max_length is None
        assert json.loads(lifted.to_json())["max_length"] is None

    def test_of_a_file(self, toy, tmp_path):
        save_mission(toy, tmp_path / "site.json")
        found = solve(tmp_path / "site.json", "greedy", evaluations=10)
        assert found.mission == toy
        assert found.source == {"name_or_path": str(tmp_path / "site.json")}

    def test_names_that_are_unknown(self, toy):
        with pytest.raises(
            ValueError, match="'bo-ac': there is no such algorithm; known are bo-aco"
        ):
            solve(toy, "bo-ac")
        with pytest.raises(ValueError, match="there is no parameter 'n_ant'"):
            solve(toy, "bo-aco", n_ant=3)
        with pytest.raises(MissionError, match="there is no such mission; known are toy"):
            solve("toi")
        with pytest.raises(ValueError, match="given by its name, got n_ants for BOACO"):
            solve(toy, BOACO(), n_ants=3)

    def test_what_is_of_another_type(self, toy):
        with pytest.raises(ValueError, match=r"\(Mission\(graph, base=.*\) takes graphs\), got"):
            solve(toy.graph)
        with pytest.raises(TypeError, match=r"algorithm: .* such as BOACO\(\), got <class .*BOACO"):
            solve(toy, BOACO)

    def test_progress(self, toy):
        shown = []
        found = solve(
            toy, "bo-aco", evaluations=250, progress=lambda n, area: shown.append((n, area()))
        )
        assert [n for n, _ in shown] == [100, 200, 250]
        assert shown[-1][1] == found.area

    def test_an_algorithm_may_refuse_the_mission(self, toy):
        class Picky(BOACO):
            def _setup(self, problem, **_):
                raise ValueError("Expected at most 3 nodes, got 5.")

        with pytest.raises(ValueError, match=r"^Algorithm 'Picky': Expected at most 3 nodes"):
            solve(toy, Picky())


class Given(Algorithm):
    """Has found what it was given."""

    def __init__(self, opt):
        super().__init__()
        self.given = opt

    def _initialize_advance(self, **_):
        self.evaluator.n_eval += 7

    _advance = _initialize_advance

    def _set_optimum(self):
        self.opt = self.given


class TestThisMachine:
    def test_islands_are_stated_where_there_are_any(self):
        """The number of threads is not, unless it is given: it changes nothing."""
        stated = {
            "pareto-local-search": {"n_islands": 8},
            "bo-aco": {},
            "greedy": {},
        }
        for name, parameters in stated.items():
            assert solve("toy", name, evaluations=60).parameters == parameters
        given = solve("toy", evaluations=60, n_islands=3, n_threads=2)
        assert given.parameters == {"n_islands": 3, "n_threads": 2}

    def test_the_stated_parameters_repeat_the_search(self):
        found = solve("art_museum", evaluations=22_000, seed=3)
        algorithm = make_algorithm("pareto-local-search", **found.parameters)
        again = minimize(BOTOHE(load_mission("art_museum")), algorithm, ("n_eval", 22_000), seed=3)
        assert np.array_equal(-again.F, found.objectives)
        alone = solve("art_museum", evaluations=22_000, seed=3, n_islands=1)
        assert not np.array_equal(alone.objectives, found.objectives)

    @pytest.mark.parametrize("name", ["pareto-local-search", "bo-aco", "nsga2"])
    def test_all_processors_are_used(self, monkeypatch, name):
        monkeypatch.setattr(solving, "n_cpus", lambda: 5)
        assert solving.make_for_this_machine(name, {})[0].n_threads == 5
        assert solving.make_for_this_machine(name, {"n_threads": 2})[0].n_threads == 2
        monkeypatch.setattr(solving, "n_cpus", lambda: 5_000)
        assert solving.make_for_this_machine(name, {})[0].n_threads == 1_024

    @pytest.mark.parametrize(
        ("name", "given", "message"),
        [
            ("greedy", {"n_islands": 2}, "there is no parameter 'n_islands'"),
            ("greedy", {"n_threads": 2}, "there is no parameter 'n_threads'"),
            ("pareto-local-search", {"n_islands": 0}, r"Expected n_islands in \[1, 1024\], got 0"),
            ("bo-aco", {"n_threads": 0}, r"Expected n_threads in \[1, 1024\], got 0"),
            ("pareto-local-search", {"n_islands": 2.5}, "Expected n_islands to be an integer"),
        ],
    )
    def test_bad_numbers(self, name, given, message):
        with pytest.raises(ValueError, match=message):
            solve("toy", name, **given)

    def test_an_algorithm_that_is_made_has_its_own(self):
        with pytest.raises(ValueError, match="that is given by its name, got n_islands for BOACO"):
            solve("toy", BOACO(), n_islands=2)


class TestWhatOtherAlgorithmsFind:
    def test_only_what_is_feasible_and_not_dominated(self, toy):
        trails = [[1, 2, 1], [1], [1, 3, 2, 4, 2, 1], [1, 2, 4, 3, 1], [1, 3, 2, 4, 2, 3, 1]]
        plans = [toy.plan([trail, [1]]) for trail in trails]
        individuals = []
        for i, plan in enumerate(plans):
            x = np.empty(1, dtype=object)
            x[0] = plan
            better, fault = (9, 1.0) if i == 3 else (0, 0.0)
            objectives = toy.evaluate([plan])[0] + better
            individuals.append(Individual(X=x, F=-objectives, CV=np.array([fault])))
        population = Population.create(*individuals)
        assert population.get("feas").tolist() == [True, True, True, False, True]
        found = solve(toy, Given(population), evaluations=14)
        # Two bring the same, [1, 2, 1] brings nothing and costs robots, [1, 2, 4, 3, 1] is faulty.
        assert found.plans == (plans[2], plans[4], plans[1])
        assert found.objectives.tolist() == toy.evaluate(found.plans).tolist()
        assert found.evaluations == 14

    def test_nothing(self, toy, tmp_path):
        assert solve(toy, Given(None), evaluations=20).plans == ()
        found = solve(toy, Given(Population.empty()), evaluations=20)
        assert found.evaluations == 21  # an overdrawn budget is not hidden
        assert found.plans == ()
        assert found.objectives.shape == (0, 2)
        assert found.area == 0
        assert len(found.table) == 0
        assert found.describe().startswith("no plans\n")
        assert json.loads(found.to_json())["plans"] == []
        assert sorted(path.name for path in found.write(tmp_path)) == FILES
        assert (tmp_path / "front.csv").read_text() == "plan_id,reward,survivors\n"
        assert parts(read_solution(tmp_path)) == parts(found)


@pytest.mark.usefixtures("interruptible")
class TestInterrupt:
    def test_the_search_stops_after_its_iteration(self, toy):
        found = solve(toy, BOACO(n_ants=10, callback=pressing(3)), evaluations=10**4)
        assert found.interrupted
        assert found.evaluations == 30
        assert found.plans
        assert "stopped after 30 evaluations" in found.describe()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

    def test_pressed_again_it_breaks_off(self, toy):
        def press_twice(algorithm):
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)

        with pytest.raises(KeyboardInterrupt):
            solve(toy, BOACO(callback=press_twice))
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler

    def test_by_an_event_that_is_set_before(self, toy):
        stop = threading.Event()
        stop.set()
        found = solve(toy, BOACO(n_ants=10), stop=stop)
        assert found.interrupted
        assert found.evaluations == 10
        assert found.plans

    def test_what_is_to_be_ignored_stays_ignored(self):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with hold_signals(signal.SIGINT) as pressed:
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            signal.raise_signal(signal.SIGINT)
        assert not pressed.is_set()


class TestDescription:
    def test_of_a_front(self, toy):
        text = solution_of(toy, [[[1, 2, 4, 2, 1], [1]], [[1], [1]]], seconds=0.5).describe()
        assert text.splitlines()[:3] == [  # 3.24 / (2 - 1.6561)
            "plan_id      reward  survivors  price of a survivor",
            "      0      3.2400     1.6561                9.421",
            "      1      0.0000     2.0000                9.421",
        ]
        assert "by hand, seed 1: spent 2 evaluations in 0.5 s" in text
        assert text.endswith("area 0.2683, 2 plans on the front")  # 3.24 · 1.6561 / 20
        assert solution_of(toy, [[[1], [1]]]).describe().endswith("1 plan on the front")

    def test_of_a_long_front(self, toy):
        survivors = np.linspace(0, 2, 1001)
        objectives = np.column_stack([10 - 2.5 * survivors**2, survivors])
        plans = [[[1], [1]]] * len(objectives)
        solution = solution_of(toy, plans, objectives=objectives)
        lines = [line.split() for line in solution.describe().splitlines()]
        rows = lines[1 : lines.index([])]
        found = [int(row[0]) for row in rows]
        assert len(rows) <= 10
        assert found[0] == 0
        assert found[-1] == 1000
        assert [int(row[0]) for row in rows if "knee" in row] == [500]
        for i, row in zip(found, rows, strict=True):
            # Slopes are 2.5 (x² - y²) / (y - x) from one plan to the next.
            cost = 2.5 * (survivors[max(i - 1, 0)] + survivors[min(i + 1, 1000)])
            assert row[:4] == [
                f"{i}",
                f"{objectives[i, 0]:.4f}",
                f"{survivors[i]:.4f}",
                f"{cost:.4g}",
            ]
        assert f"1,001 plans on the front; the table shows {len(rows)}" in solution.describe()
        everything = solution.describe(all_plans=True)
        assert len(everything.splitlines()) > 1001
        assert everything.endswith("1,001 plans on the front")


class TestJson:
    def test_of_a_front(self, toy, solution):
        content = json.loads(solution.to_json())
        assert content["mission"] == "toy"
        assert (content["algorithm"], content["seed"], content["evaluations"]) == ("bo-aco", 3, 250)
        assert (content["interrupted"], content["area"]) == (False, solution.area)
        assert (content["robots"], content["total_reward"]) == (2, 10.0)
        for i, (plan, found) in enumerate(zip(content["plans"], solution.plans, strict=True)):
            assert plan["plan_id"] == i
            assert toy.plan(plan["trails"]) == found
            assert [plan["reward"], plan["survivors"]] == solution.objectives[i].tolist()

    def test_of_labels(self):
        for label, written in (
            (("floor", 2, None), ["floor", 2, None]),
            ('he said "no"\n\ttwice', 'he said "no"\n\ttwice'),
            ("漢字 \ud800", "漢字 \ud800"),
            (np.int64(7), 7),
            (frozenset({3}), "frozenset({3})"),
        ):
            mission = pair("base", label)
            text = solution_of(mission, [[["base", label, "base"]]]).to_json()
            text.encode()
            assert json.loads(text)["plans"][0]["trails"] == [["base", written, "base"]]


class TestWriting:
    def test_all_files(self, solution, tmp_path):
        folder = tmp_path / "some" / "where"
        assert sorted(solution.write(folder)) == [folder / name for name in FILES]
        assert names_in(folder) == FILES
        with (folder / "front.csv").open(newline="") as file:
            names, *rows = csv.reader(file)
        assert names == ["plan_id", "reward", "survivors"]
        assert [[float(value) for value in row] for row in rows] == solution.table.values.tolist()
        assert (folder / "plans.json").read_text() == solution.to_json()
        for picture in ("front.png", "mission.png"):
            assert (folder / picture).read_bytes().startswith(b"\x89PNG")

    def test_again(self, toy, solution, tmp_path):
        for name in ("notes.txt", "bound.json"):  # the bound is of an earlier front
            (tmp_path / name).write_text("mine")
        solution.write(tmp_path)
        before = {name: (tmp_path / name).read_bytes() for name in FILES}
        solution_of(toy, [[[1], [1]]]).write(str(tmp_path))
        after = {name: (tmp_path / name).read_bytes() for name in FILES}
        assert [name for name in FILES if before[name] == after[name]] == [
            "mission.json",
            "mission.png",
        ]
        assert names_in(tmp_path) == sorted([*FILES, "notes.txt"])

    def test_a_picture_that_fails_costs_no_table(self, solution, tmp_path, monkeypatch):
        save_plot, error = plots.save_plot, RuntimeError("\nNo such glyph.\nMore.")

        def save(ax, path):
            if path.name == "mission.png":
                raise error
            save_plot(ax, path)

        monkeypatch.setattr(plots, "save_plot", save)
        for name in FILES:
            (tmp_path / name).write_text("of an earlier search")
        with pytest.raises(RuntimeError, match="No such glyph"):
            solution.write(tmp_path)
        assert names_in(tmp_path) == ["front.csv", "front.png", "mission.json", "plans.json"]
        assert (tmp_path / "plans.json").read_text() == solution.to_json()
        assert (tmp_path / "front.png").read_bytes().startswith(b"\x89PNG")

    def test_a_mission_that_json_cannot_hold_is_left_out(self, tmp_path):
        (tmp_path / "mission.json").write_text("of an earlier search")
        label = frozenset({3})
        found = solution_of(pair("base", label), [[["base", label, "base"]]])
        names = sorted({*FILES} - {"mission.json"})
        assert sorted(found.write(tmp_path)) == [tmp_path / name for name in names]
        assert names_in(tmp_path) == names
        with pytest.raises(ValueError, match=r"mission\.json: no such file"):
            read_solution(tmp_path)

    def test_what_cannot_be_written_leaves_all_as_it_was(self, solution, tmp_path, monkeypatch):
        monkeypatch.setattr(Solution, "to_json", lambda self: 1 / 0)
        (tmp_path / "front.csv").write_text("of an earlier search")
        with pytest.raises(ZeroDivisionError):
            solution.write(tmp_path)
        assert names_in(tmp_path) == ["front.csv"]
        assert (tmp_path / "front.csv").read_text() == "of an earlier search"


def parts(solution):
    """All that is written of a solution, to be compared."""
    return (
        solution.mission,
        solution.mission.name,
        solution.plans,
        [plan.trails for plan in solution.plans],
        solution.objectives.tolist(),
        *(solution.algorithm, solution.parameters, solution.seed, solution.evaluations),
        *(solution.interrupted, solution.source, solution.min_survival, solution.max_length),
        solution.moves,
    )


class TestReading:
    def test_what_was_written(self, solution, tmp_path):
        solution.write(tmp_path)
        again = read_solution(str(tmp_path))
        assert parts(again) == parts(solution)
        assert again.table.equals(solution.table)
        assert again.to_json() == solution.to_json()
        assert again.seconds is None
        assert "bo-aco, seed 3: spent 250 evaluations\narea" in again.describe()

    @examples(40)
    @given(
        missions_with_plans(),
        st.integers(0, 10**30),
        st.floats(0, 1),
        st.none() | st.floats(0, allow_infinity=False),
        st.booleans(),
    )
    def test_whatever_was_written(self, drawn, seed, floor, budget, stopped):
        mission, plan = drawn
        plans = (plan,)
        floor *= mission.robot_survival(plans).min()
        longest = mission.trail_lengths(plans).max()
        budget = None if budget is None else budget + longest
        written = Solution(
            mission=mission,
            plans=plans,
            objectives=mission.evaluate(plans),
            algorithm="by hand",
            parameters={"n": 3, "λ": [0.1, None, "x"]},
            seed=seed,
            evaluations=len(plans),
            seconds=1.5,
            interrupted=stopped,
            source={"name_or_path": "somewhere", "robots": mission.robots},
            min_survival=floor,
            max_length=budget,
            moves={"graft": {"tried": 7, "entered": 2}},
        )
        with tempfile.TemporaryDirectory() as folder:
            written.write(Path(folder))
            assert parts(read_solution(folder)) == parts(written)

    @pytest.mark.parametrize(
        ("labels", "needs_mission"),
        [
            (["dock", ("floor", 2, None), 1.5, 7, "漢字", (), ((0, (1,)), "a"), "[0, 1]"], False),
            (["dock", date(2025, 3, 1), ("at", date(2025, 3, 2)), b"x", frozenset({1})], True),
        ],
    )
    def test_labels_of_every_kind(self, tmp_path, labels, needs_mission):
        """Tuples come back as tuples, and what JSON cannot hold as the mission's own labels."""
        graph = nx.DiGraph()
        graph.add_nodes_from(labels, reward=1)
        for tail, head in [*pairwise(labels), (labels[-1], labels[0])]:
            graph.add_edge(tail, head, survival=0.9)
        mission = Mission(graph, base="dock", robots=1, name="pier")
        written = solution_of(mission, [[[*labels, "dock"]], [["dock"]]])
        written.write(tmp_path)
        assert parts(read_solution(tmp_path, mission=mission)) == parts(written)
        if needs_mission:
            return
        again = read_solution(tmp_path)
        assert parts(again) == parts(written)
        assert set(again.mission.labels(again.plans[0])[0]) == set(labels)
        content = json.loads((tmp_path / "plans.json").read_text())
        read = [mission.plan(entry["trails"]) for entry in content["plans"]]
        assert tuple(read) == written.plans

    def test_a_folder_without_its_mission(self, toy, solution, tmp_path):
        solution.write(tmp_path)
        (tmp_path / "mission.json").unlink()
        missing = r"mission\.json: no such file"
        with pytest.raises(ValueError, match=missing):
            read_solution(tmp_path)
        assert parts(read_solution(tmp_path, mission=toy)) == parts(solution)
        with pytest.raises(ValueError, match=r"^mission 'toy' does not match "):
            read_solution(tmp_path, mission=toy.with_robots(3))

    def test_a_mission_that_changed_is_named(self, solution, tmp_path):
        solution.write(tmp_path)
        path = tmp_path / "mission.json"
        head, key, tail = path.read_text().rpartition('"survival": ')
        path.write_text(f"{head}{key}0.5{tail[tail.index('}') :]}")
        with pytest.raises(ValueError, match="the mission was changed") as caught:
            read_solution(tmp_path)
        expected = f"{path} does not match {tmp_path / 'plans.json'}: "
        assert str(caught.value).startswith(expected)

    @pytest.mark.parametrize(
        ("damage", "fault"),
        [
            ("{", r"Expecting property name .* line 1 column 2"),
            (None, r"no such file"),
            (
                ('"seed": 3', '"sea": 3'),
                "expected the key 'seed', which is missing",
            ),
            (
                ('"reward": ', '"reward": 9, "x": '),
                r"Plan 0: expected the objectives .*: the plans or the mission",
            ),
            (("     1,", "     77,"), r"Robot 0, position 0: .* no node 77"),
        ],
    )
    def test_damage_is_named(self, solution, tmp_path, damage, fault):
        solution.write(tmp_path)
        path = tmp_path / "plans.json"
        if damage is None:
            path.unlink()
        elif isinstance(damage, str):
            path.write_text(damage)
        else:
            text = path.read_text()
            assert damage[0] in text
            path.write_text(text.replace(*damage, 1))
        with pytest.raises(ValueError, match=fault) as caught:
            read_solution(tmp_path)
        assert str(caught.value).startswith(str(path))

    @pytest.mark.parametrize("labels", [["dock", "reef"], [("dock", 1), ("reef", 2)]])
    def test_plans_are_read_all_at_once(self, tmp_path, monkeypatch, labels):
        """What takes long is done once for a front, whatever the number of its plans."""
        mission = pair(*labels)
        found = solution_of(mission, [[[labels[0], labels[1], labels[0]]]] * 300)
        found.write(tmp_path)
        calls = Counter()

        def counting(owner, name):
            real = getattr(owner, name)
            counted = lambda *a, **k: calls.update([name]) or real(*a, **k)  # noqa: E731
            monkeypatch.setattr(owner, name, counted)

        counting(Mission, "_values")
        counting(Mission, "plan")
        counting(np, "isclose")
        assert parts(read_solution(tmp_path)) == parts(found)
        assert calls == {"_values": 1, "isclose": 1}

    def test_a_source_that_names_code_is_not_run(self, solution, tmp_path):
        solution.write(tmp_path)
        path = tmp_path / "plans.json"
        content = json.loads(path.read_text()) | {
            "mission_source": {"name_or_path": "antigravity:x"}
        }
        path.write_text(json.dumps(content))
        read_solution(tmp_path)
        assert "antigravity" not in sys.modules


class TestOtherObjectives:
    def test_a_problem_of_three_is_solved_written_and_read(self, tmp_path):
        solution = solve("toy", "nsga2", problem="least-survival", evaluations=300)
        least = solution.mission.robot_survival(solution.plans).min(axis=1)
        assert solution.objectives[:, 2] == pytest.approx(least)
        assert solution.objectives[:, :2] == pytest.approx(
            solution.mission.evaluate(solution.plans)
        )
        assert (np.diff(solution.objectives[:, 0]) <= 0).all()
        assert [*solution.table] == ["plan_id", "reward", "survivors", "least_survival"]
        assert solution.area == area_indicator(solution.objectives, solution.problem_objectives)
        assert "least_survival" in solution.describe()
        written = solution.write(tmp_path)
        assert tmp_path / "front.png" in written
        assert pd.read_csv(tmp_path / "front.csv").columns.tolist() == [*solution.table]
        again = read_solution(tmp_path)
        assert again.objectives.tolist() == solution.objectives.tolist()
        assert again.problem_objectives == solution.problem_objectives
        assert again.problem == solution.problem == "botohe_moo.problem:LeastSurvival"
        assert again.choose("survivors >= 1").plan in again.plans

    @pytest.mark.parametrize(
        ("key", "value", "message"),
        [
            ("min_survival", 0.9, r"Plan \d+, robot \d: expected a survival of at least 0\.9"),
            ("problem", None, "Plan 0: expected the objectives"),
            ("plans", None, "Plan 0: expected the objectives .*: the plans or the mission"),
        ],
    )
    def test_what_was_changed_is_noticed(self, key, value, message, tmp_path):
        solve("toy", "nsga2", problem=LeastSurvival, evaluations=300, seed=1).write(tmp_path)
        path = tmp_path / "plans.json"
        content = json.loads(path.read_text())
        content["plans"][0]["reward"] += 0.5 * (value is None)
        if key == "problem":  # nor do names of other objectives hide E[R]
            content |= {"problem": None}
            content["problem_objectives"]["names"] = ["a", "b", "c"]
        path.write_text(json.dumps(content | ({} if value is None else {key: value})))
        with pytest.raises(ValueError, match=message):
            read_solution(tmp_path)

    def test_a_column_that_is_missing_is_named(self, tmp_path):
        solve("toy", "nsga2", problem=LeastSurvival, evaluations=100).write(tmp_path)
        path = tmp_path / "plans.json"
        path.write_text(path.read_text().replace('"least_survival": ', '"most_survival": ', 1))
        with pytest.raises(ValueError, match=r"Plan 0: expected the objectives .* got .*nan"):
            read_solution(tmp_path)

    @pytest.mark.parametrize(
        ("problem", "message"),
        [
            (
                "least-surviva",
                "Problem 'least-surviva': there is no such problem; known are least-s",
            ),
            ("nowhere:Class", "Problem 'nowhere:Class': it cannot be imported"),
            ("botohe_moo.mission:Mission", "a class derived from BOTOHE"),
            (Mission, "a class derived from BOTOHE"),
            (
                type("Vague", (BOTOHE,), {"evaluate_batch": None}),
                "Vague overrides evaluate_batch, and",
            ),
        ],
    )
    def test_what_is_no_problem_is_refused(self, problem, message):
        with pytest.raises(ValueError, match=message):
            solve("toy", "nsga2", problem=problem, evaluations=100)
