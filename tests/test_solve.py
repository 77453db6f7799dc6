"""Searching from Python, and what becomes of the solution."""

import dataclasses
import json
import math
import shutil
import signal
import sys
import tempfile
import threading
from datetime import date
from pathlib import Path
from unittest import mock

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.core.algorithm import Algorithm
from pymoo.core.population import Population
from pymoo.optimize import minimize

from botohe_moo import (
    BOACO,
    BOTOHE,
    Mission,
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
from botohe_moo.problem import LeastSurvival
from botohe_moo.solution import Solution
from tests.decide.made import solution_of, star
from tests.examples import examples
from tests.strategies import missions_with_plans

FILES = ["front.csv", "front.png", "mission.json", "mission.png", "plans.json"]


@pytest.fixture(scope="module")
def toy():
    return load_mission("toy")


@pytest.fixture(scope="module")
def solution(toy):
    return solve(toy, "bo-aco", evaluations=250, seed=3)


@pytest.fixture(scope="module")
def of_three():
    """A solution with three objectives."""
    return solve("toy", "nsga2", problem="least-survival", evaluations=300, seed=1)


@pytest.fixture(scope="module")
def drawn_once(solution, of_three, tmp_path_factory):
    """The folders of both solutions, with pictures."""
    folder = tmp_path_factory.mktemp("solutions")
    assert sorted(solution.write(folder / "two")) == [folder / "two" / name for name in FILES]
    assert len(of_three.write(folder / "three")) == len(FILES)
    return folder


@pytest.fixture
def written(drawn_once, tmp_path):
    """Copies of both folders, which a test may damage."""
    return shutil.copytree(drawn_once, tmp_path / "solutions")


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def by_hand(mission, plans, **changed):
    """A solution with these plans, given as node labels."""
    made = solution_of(mission, [mission.plan(trails) for trails in plans])
    return dataclasses.replace(made, **{"seconds": 0.5, "seed": 1, **changed})


def parts(solution):
    """All that is written of a solution, to be compared."""
    names = [field.name for field in dataclasses.fields(solution) if field.name != "seconds"]
    written = {name: getattr(solution, name) for name in names}
    written["objectives"] = solution.objectives.tolist()
    return written, solution.mission.name, [plan.trails for plan in solution.plans]


VAGUE = type("Vague", (BOTOHE,), {"evaluate_batch": None})


class TestSearch:
    def test_front_and_record(self, toy, solution):
        front = solution.table
        assert list(front.columns) == ["plan_id", "reward", "survivors"]
        assert list(front["plan_id"]) == list(range(len(solution.plans)))
        assert front[["reward", "survivors"]].to_numpy().tolist() == solution.objectives.tolist()
        assert np.array_equal(toy.evaluate(solution.plans), solution.objectives)
        assert (np.diff(front["reward"]) <= 0).all()
        assert (np.diff(front["survivors"]) >= 0).all()
        assert len(set(solution.plans)) == len(solution.plans) > 3
        assert (solution.worst_case() <= front["reward"]).all()
        assert solution.mission is toy
        assert (solution.algorithm, solution.seed, solution.parameters) == ("bo-aco", 3, {})
        assert (solution.moves, solution.interrupted) == ({}, False)
        assert solution.seconds > 0
        assert solution.area == area_indicator(solution.objectives, toy) > 0.5

    def test_record_of_moves(self, toy):
        found = solve(toy, evaluations=3_000, n_islands=1)
        assert list(found.moves) == [*DEFAULT_MOVES, "ruin-and-recreate"]
        tried, entered = zip(*(brought.values() for brought in found.moves.values()), strict=True)
        assert found.evaluations - 100 <= sum(tried) <= found.evaluations
        assert 0 < sum(entered) < sum(tried)
        assert json.loads(found.to_json())["moves"] == found.moves

    def test_the_budget_is_exact(self, toy, monkeypatch):
        usual = mock.Mock(side_effect=BOTOHE.evaluate_batch)
        monkeypatch.setattr(BOTOHE, "evaluate_batch", lambda self, batch: usual(self, batch))
        found = solve(toy, BOACO(), evaluations=101)
        counted = sum(len(call.args[1]) for call in usual.call_args_list)
        assert found.evaluations == counted == 101
        assert (found.algorithm, found.interrupted) == ("BOACO", False)

    def test_the_seed_decides(self, toy, solution):
        again, other = (solve(toy, "bo-aco", evaluations=250, seed=seed) for seed in (3, 4))
        assert [p.trails for p in again.plans] == [p.trails for p in solution.plans]
        assert again.objectives.tobytes() == solution.objectives.tobytes()
        assert set(other.plans) != set(solution.plans)

    def test_by_names_and_of_a_file(self, toy, tmp_path):
        found = solve("toy", "bo-aco", evaluations=60, seed=2, n_ants=20, min_survival=0.5)
        assert found.mission == toy
        assert (found.algorithm, found.parameters) == ("bo-aco", {"n_ants": 20})
        assert (found.source, found.min_survival) == ({"name_or_path": "toy"}, 0.5)
        assert toy.robot_survival(found.plans).min() >= 0.5
        save_mission(toy, tmp_path / "site.json")
        found = solve(tmp_path / "site.json", "greedy", evaluations=10)
        assert found.mission == toy
        assert found.source == {"name_or_path": str(tmp_path / "site.json")}

    def test_travel_budgets(self, toy):
        found = solve("toy", "nsga2", evaluations=300, seed=2, max_length=4)
        assert len(found.plans) > 1
        assert toy.trail_lengths(found.plans).max() == found.max_length == 4
        own = Mission(nx.DiGraph(toy.graph, max_length=2))
        for options, expected in (
            ({}, 2),
            ({"max_length": 3}, 3),
            ({"max_length": math.inf}, None),
        ):
            found = solve(own, "greedy", evaluations=20, **options)
            assert found.max_length == json.loads(found.to_json())["max_length"] == expected

    def test_progress(self, toy):
        shown = []
        found = solve(
            toy, "bo-aco", evaluations=250, progress=lambda n, area: shown.append((n, area()))
        )
        assert [n for n, _ in shown] == [100, 200, 250]
        assert shown[-1][1] == found.area

    @pytest.mark.parametrize(
        ("given", "options", "message"),
        [
            ((), {"evaluations": 0}, r"Expected evaluations >= 1, got 0\."),
            ((), {"seed": -1}, r"Expected seed >= 0, got -1\."),
            (("bo-ac",), {}, "'bo-ac': no such algorithm; known are bo-aco"),
            (("bo-aco",), {"n_ant": 3}, "there is no parameter 'n_ant'"),
            (("greedy",), {"n_islands": 2}, "there is no parameter 'n_islands'"),
            (("greedy",), {"n_threads": 2}, "there is no parameter 'n_threads'"),
            ((), {"n_islands": 0}, r"Expected n_islands in \[1, 1024\], got 0"),
            (("bo-aco",), {"n_threads": 0}, r"Expected n_threads in \[1, 1024\], got 0"),
            ((BOACO(),), {"n_islands": 2}, "given by its name, got n_islands for BOACO"),
            ((BOACO,), {}, r"algorithm: .* such as BOACO\(\), got <class .*BOACO"),
            ((), {"problem": "least-surviva"}, "no such problem; known are least-s"),
            ((), {"problem": "nowhere:Class"}, "Problem 'nowhere:Class': it cannot be imported"),
            ((), {"problem": "botohe_moo.mission:Mission"}, "a class derived from BOTOHE"),
            ((), {"problem": Mission}, "a class derived from BOTOHE"),
            ((), {"problem": VAGUE}, "Vague overrides evaluate_batch, and"),
        ],
    )
    def test_what_is_refused(self, given, options, message):
        with pytest.raises((ValueError, TypeError), match=message):
            solve("toy", *given, **options)

    def test_missions_and_algorithms_that_are_refused(self, toy):
        with pytest.raises(ValueError, match="no such mission; known are toy"):
            solve("toi")
        with pytest.raises(ValueError, match=r"\(Mission\(graph, base=.*\) takes graphs\), got"):
            solve(toy.graph)
        algorithm = BOACO()
        solve(toy, algorithm, evaluations=100)
        with pytest.raises(ValueError, match="has not run yet, got 'BOACO' after a run"):
            solve(toy, algorithm, evaluations=100)

        class Picky(BOACO):
            def _setup(self, problem, **_):
                raise ValueError("Expected at most 3 nodes, got 5.")

        with pytest.raises(ValueError, match=r"^Algorithm 'Picky': Expected at most 3 nodes"):
            solve(toy, Picky())


class TestThisMachine:
    def test_islands_are_stated_where_there_are_any(self):
        """The number of threads is not, unless it is given: it changes nothing."""
        stated = {"pareto-local-search": {"n_islands": 8}, "bo-aco": {}, "greedy": {}}
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
        for n_cpus, own, expected in (5, {}, 5), (5, {"n_threads": 2}, 2), (5_000, {}, 1_024):
            monkeypatch.setattr(solving, "n_cpus", lambda n=n_cpus: n)
            assert solving.make_for_this_machine(name, own)[0].n_threads == expected


class Given(Algorithm):
    """Has found what it was given."""

    def __init__(self, given):
        super().__init__()
        self.given = given

    def _initialize_advance(self, **_):
        self.evaluator.n_eval += 7

    _advance = _initialize_advance

    def _set_optimum(self):
        self.opt = self.given


class TestWhatOtherAlgorithmsFind:
    def test_only_what_is_feasible_and_not_dominated(self, toy):
        trails = [[1, 2, 1], [1], [1, 3, 2, 4, 2, 1], [1, 2, 4, 3, 1], [1, 3, 2, 4, 2, 3, 1]]
        plans = [toy.plan([trail, [1]]) for trail in trails]
        F = -toy.evaluate(plans)
        F[3] -= 9
        X = np.array([*plans, None], dtype=object)[:-1, None]
        population = Population.new(X=X, F=F, CV=np.array([[0.0], [0], [0], [1], [0]]))
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
        assert found.objectives.shape == (0, 2)
        assert (found.area, len(found.table)) == (0, 0)
        assert found.describe().startswith("no plans\n")
        found.write(tmp_path)
        assert names_in(tmp_path) == FILES
        assert (tmp_path / "front.csv").read_text() == "plan_id,reward,survivors\n"
        assert parts(read_solution(tmp_path)) == parts(found)


class TestInterrupt:
    @pytest.fixture(autouse=True)
    def interruptible(self):
        """Let Ctrl-C do what it usually does, even if whoever runs the tests ignores it."""
        usual = signal.signal(signal.SIGINT, signal.default_int_handler)
        yield
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        signal.signal(signal.SIGINT, usual)

    def test_the_search_stops_after_its_iteration_and_pressed_again_it_breaks_off(self, toy):
        def press(times):
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)

        calls = iter([0, 0, 1])
        algorithm = BOACO(n_ants=10, callback=lambda _: press(next(calls)))
        found = solve(toy, algorithm, evaluations=10**4)
        assert (found.interrupted, found.evaluations) == (True, 30)
        assert found.plans
        assert "stopped after 30 evaluations" in found.describe()
        with pytest.raises(KeyboardInterrupt):
            solve(toy, BOACO(callback=lambda _: press(2)))

    def test_by_an_event_that_is_set_before(self, toy):
        stop = threading.Event()
        stop.set()
        found = solve(toy, BOACO(n_ants=10), stop=stop)
        assert (found.interrupted, found.evaluations) == (True, 10)
        assert found.plans


class TestDescription:
    def test_of_a_front(self, toy):
        text = by_hand(toy, [[[1, 2, 4, 2, 1], [1]], [[1], [1]]], seconds=0.5).describe()
        assert text.splitlines()[:3] == [  # 3.24 / (2 - 1.6561)
            "plan_id  expected reward  expected survivors  price of a survivor",
            "      0           3.2400              1.6561                9.421",
            "      1           0.0000              2.0000                9.421",
        ]
        assert "by hand, seed 1: spent 2 evaluations in 0.5 s" in text
        assert text.endswith("area 0.2683, 2 plans on the front")  # 3.24 · 1.6561 / 20
        assert by_hand(toy, [[[1], [1]]]).describe().endswith("1 plan on the front")

    def test_of_a_long_front(self, toy):
        survivors = np.linspace(0, 2, 1001)
        objectives = np.column_stack([10 - 2.5 * survivors**2, survivors])
        solution = by_hand(toy, [[[1], [1]]] * 1001, objectives=objectives)
        *table, _, _, summary = solution.describe().splitlines()
        assert len(table) <= 11
        assert f"1,001 plans on the front; the table shows {len(table) - 1}" in summary
        everything = solution.describe(all_plans=True)
        assert len(everything.splitlines()) > 1001
        assert everything.endswith("1,001 plans on the front")


class TestWriting:
    def test_all_files(self, toy, solution, written):
        folder = written / "two"
        table = pd.read_csv(folder / "front.csv", float_precision="round_trip")
        pd.testing.assert_frame_equal(table, solution.table, check_exact=True)
        for picture in ("front.png", "mission.png"):
            assert (folder / picture).read_bytes().startswith(b"\x89PNG")
        assert (folder / "plans.json").read_text() == solution.to_json()
        content = json.loads(solution.to_json())
        expected = {"mission": "toy", "algorithm": "bo-aco", "seed": 3, "evaluations": 250}
        expected |= {"interrupted": False, "area": solution.area, "robots": 2, "total_reward": 10.0}
        assert content.items() >= expected.items()
        for i, (plan, found) in enumerate(zip(content["plans"], solution.plans, strict=True)):
            assert plan["plan_id"] == i
            assert toy.plan(plan["trails"]) == found
            assert [plan["reward"], plan["survivors"]] == solution.objectives[i].tolist()

    def test_again(self, toy, written):
        folder = written / "two"
        for name in ("notes.txt", "bound.json"):  # the bound is of an earlier front
            (folder / name).write_text("mine")
        before = {name: (folder / name).read_bytes() for name in FILES}
        by_hand(toy, [[[1], [1]]]).write(str(folder))
        same = [name for name in FILES if before[name] == (folder / name).read_bytes()]
        assert same == ["mission.json", "mission.png"]
        assert names_in(folder) == sorted([*FILES, "notes.txt"])

    def test_a_picture_that_fails_costs_no_table(self, solution, tmp_path, monkeypatch):
        def save(ax, path):
            raise RuntimeError("\nNo such glyph.\nMore.")

        monkeypatch.setattr(plots, "save_plot", save)
        for name in FILES:
            (tmp_path / name).write_text("of an earlier search")
        with pytest.raises(RuntimeError, match="No such glyph"):
            solution.write(tmp_path)
        assert names_in(tmp_path) == ["front.csv", "mission.json", "plans.json"]
        assert (tmp_path / "plans.json").read_text() == solution.to_json()

    def test_what_cannot_be_written_leaves_all_as_it_was(self, solution, tmp_path, monkeypatch):
        monkeypatch.setattr(Solution, "to_json", lambda self: 1 / 0)
        (tmp_path / "front.csv").write_text("of an earlier search")
        with pytest.raises(ZeroDivisionError):
            solution.write(tmp_path)
        assert names_in(tmp_path) == ["front.csv"]
        assert (tmp_path / "front.csv").read_text() == "of an earlier search"


def undraw(patch):
    """Draw no pictures, which would take most of the time."""
    for name in ("plot_front", "plot_mission", "save_plot"):
        patch.setattr(plots, name, lambda *_: None)


@pytest.fixture
def undrawn(monkeypatch):
    undraw(monkeypatch)


class TestReading:
    def test_what_was_written(self, solution, of_three, written):
        again = read_solution(str(written / "two"))
        assert parts(again) == parts(solution)
        assert again.table.equals(solution.table)
        assert again.to_json() == solution.to_json()
        assert again.seconds is None
        assert "bo-aco, seed 3: spent 250 evaluations\narea" in again.describe()
        again = read_solution(written / "three")
        assert parts(again) == parts(of_three)
        assert again.problem == "botohe_moo.problem:LeastSurvival"
        assert again.choose("survivors >= 1").plan in again.plans

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
        longest = mission.trail_lengths([plan]).max()
        found = solution_of(mission, [plan])
        solved = dataclasses.replace(
            found,
            parameters={"n": 3, "λ": [0.1, None, "x"]},
            seed=seed,
            interrupted=stopped,
            source={"name_or_path": "somewhere", "robots": mission.robots},
            min_survival=floor * mission.robot_survival([plan]).min(),
            max_length=None if budget is None else budget + longest,
            moves={"graft": {"tried": 7, "entered": 2}},
        )
        with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patched:
            undraw(patched)
            solved.write(Path(folder))
            assert parts(read_solution(folder)) == parts(solved)

    @pytest.mark.usefixtures("undrawn")
    @pytest.mark.parametrize(
        ("labels", "fits_json"),
        [
            (["dock", ("at", 2, None), 1.5, 7, "漢字", (), ((0, (1,)), "a"), "[0, 1]"], True),
            (["dock", date(2025, 3, 1), ("at", date(2025, 3, 2)), b"x", frozenset({1})], False),
        ],
    )
    def test_labels_of_every_kind(self, tmp_path, labels, fits_json):
        """Tuples come back as tuples, and what JSON cannot hold as the mission's own labels."""
        graph = nx.cycle_graph(labels, nx.DiGraph)
        nx.set_node_attributes(graph, 1, "reward")
        nx.set_edge_attributes(graph, 0.9, "survival")
        mission = Mission(graph, base="dock", robots=1, name="pier")
        solved = by_hand(mission, [[[*labels, "dock"]], [["dock"]]])
        (tmp_path / "mission.json").write_text("of an earlier search")
        solved.write(tmp_path)
        assert parts(read_solution(tmp_path, mission=mission)) == parts(solved)
        if fits_json:
            again = read_solution(tmp_path)
            assert parts(again) == parts(solved)
            assert set(again.mission.labels(again.plans[0])[0]) == set(labels)
        else:
            with pytest.raises(ValueError, match=r"mission\.json: no such file"):
                read_solution(tmp_path)

    def test_a_mission_that_changed_is_named(self, toy, solution, written):
        folder = written / "two"
        with pytest.raises(ValueError, match=r"^mission 'toy' does not match "):
            read_solution(folder, mission=toy.with_robots(3))
        path = folder / "mission.json"
        head, key, tail = path.read_text().rpartition('"survival": ')
        path.write_text(f"{head}{key}0.5{tail[tail.index('}') :]}")
        with pytest.raises(ValueError, match=r"plans\.json: the mission was changed") as caught:
            read_solution(folder)
        assert str(caught.value).startswith(f"{path} does not match {folder}")
        assert parts(read_solution(folder, mission=toy)) == parts(solution)

    @pytest.mark.parametrize(
        ("damage", "fault"),
        [
            ("{", r"line 1: not valid JSON: the file is empty or ends"),
            (None, r"no such file"),
            (('"seed": 3', '"sea": 3'), "expected the key 'seed', which is missing"),
            (
                ('"reward": ', '"reward": 9, "x": '),
                r"Plan 0: expected the objectives .*: the plans or the mission",
            ),
            (("     1,", "     77,"), r"Robot 0, position 0: .* no node 77"),
        ],
    )
    def test_damage_is_named(self, written, damage, fault):
        path = written / "two" / "plans.json"
        if damage is None:
            path.unlink()
        elif isinstance(damage, str):
            path.write_text(damage)
        else:
            text = path.read_text()
            assert damage[0] in text
            path.write_text(text.replace(*damage, 1))
        with pytest.raises(ValueError, match=fault) as caught:
            read_solution(path.parent)
        assert str(caught.value).startswith(str(path))

    @pytest.mark.usefixtures("undrawn")
    @pytest.mark.parametrize("labels", [["dock", "reef"], [("dock", 1), ("reef", 2)]])
    def test_plans_are_read_all_at_once(self, tmp_path, monkeypatch, labels):
        """What takes long is done once for a front, whatever the number of its plans."""
        new = dict(zip(["dock", "reef"], labels, strict=True))
        graph = nx.relabel_nodes(star({"reef": (1, 0.5)}).graph, new)
        mission = Mission(graph, base=labels[0], robots=1)
        found = by_hand(mission, [[[labels[0], labels[1], labels[0]]]] * 300)
        found.write(tmp_path)
        counts = []
        for owner, name in ((Mission, "_values"), (Mission, "plan"), (np, "isclose")):
            of = getattr(owner, name)
            counts.append(mock.create_autospec(of, side_effect=of))
            monkeypatch.setattr(owner, name, counts[-1])
        assert parts(read_solution(tmp_path)) == parts(found)
        assert [count.call_count for count in counts] == [1, 0, 1]

    def test_a_source_that_names_code_is_not_run(self, written):
        path = written / "two" / "plans.json"
        content = json.loads(path.read_text()) | {
            "mission_source": {"name_or_path": "antigravity:x"}
        }
        path.write_text(json.dumps(content))
        read_solution(path.parent)
        assert "antigravity" not in sys.modules


class TestOtherObjectives:
    def test_a_problem_of_three(self, of_three, written):
        mission, plans, objectives = of_three.mission, of_three.plans, of_three.objectives
        least = mission.robot_survival(plans).min(axis=1)
        assert objectives == pytest.approx(np.column_stack([mission.evaluate(plans), least]))
        assert (np.diff(objectives[:, 0]) <= 0).all()
        assert [*of_three.table] == ["plan_id", "reward", "survivors", "least_survival"]
        assert of_three.area == area_indicator(objectives, of_three.problem_objectives)
        assert "least_survival" in of_three.describe()
        assert [*pd.read_csv(written / "three" / "front.csv")] == [*of_three.table]

    @pytest.mark.parametrize(
        ("key", "value", "message"),
        [
            ("min_survival", 0.9, r"Plan \d+, robot \d: expected a survival of at least 0\.9"),
            ("problem", None, "Plan 0: expected the objectives"),
            ("reward", 99, "Plan 0: expected the objectives .*: the plans or the mission"),
            ("least_survival", None, "Plan 0: expected the objectives .* got .*nan"),
        ],
    )
    def test_what_was_changed_is_noticed(self, key, value, message, written):
        path = written / "three" / "plans.json"
        content = json.loads(path.read_text())
        of = content if key in content else content["plans"][0]
        of[key] = value
        if key == "least_survival":
            del of[key]
        if key == "problem":  # nor do names of other objectives hide E[R]
            content["plans"][0]["reward"] += 0.5
            content["problem_objectives"]["names"] = ["a", "b", "c"]
        path.write_text(json.dumps(content))
        with pytest.raises(ValueError, match=message):
            read_solution(path.parent)

    def test_a_class_is_a_problem_too(self):
        found = solve("toy", "nsga2", problem=LeastSurvival, evaluations=20)
        assert found.problem == "botohe_moo.problem:LeastSurvival"
