"""Runs: their budgets, their records and how they end, in this process and in others."""

import contextlib
import copy
import os
import random
import re
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Mission, load_mission, make_algorithm
from botohe_moo.algorithms.base import PlanArchive
from botohe_moo.algorithms.local_search.kernels import moves, recreate, search
from botohe_moo.study.loading import load_study
from botohe_moo.study.perform import (
    BudgetSpentError,
    Meter,
    Recorder,
    metered,
    perform,
    record_counts,
    verify,
)
from botohe_moo.study.pool import WorkerPool
from tests.algorithms.test_contract import DOTTED, ENDS_BY_ITSELF, NAMES
from tests.study.made import MADE, study_of
from tests.study.problems_made import Weakest
from tests.twins import plain_local_search


def make_task(algorithm, *, mission="art_museum", parameters=(), evaluations=500, **changes):
    budget = {"evaluations": evaluations, "grace_seconds": 1.0, **changes.pop("budget", {})}
    content = study_of(
        missions={"m": mission},
        algorithms={"a": {"algorithm": algorithm, "parameters": dict(parameters)}},
        budget=budget,
        recording={"at": [*changes.pop("at", ())]},
        seeds=1,
    )
    return replace(load_study(content).runs()[0], **changes)


def performed(task):
    records = []
    return perform(task, records.append), records


class TestCounts:
    @pytest.mark.parametrize(
        ("evaluations", "per_decade", "start", "at", "expected"),
        [
            (1_000, 2, 0.001, (), [1, 3, 10, 32, 100, 316, 1_000]),
            (100, 1, 0.01, (7, 50, 200), [1, 7, 10, 50, 100]),
            (None, 1, 0.001, (), [10**i for i in range(13)]),  # without a budget they go on
        ],
    )
    def test_by_hand(self, evaluations, per_decade, start, at, expected):
        options = {"per_decade": per_decade, "start": start, "at": at}
        assert expected == record_counts(evaluations=evaluations, **options)

    @given(
        st.integers(1, 10**9),
        st.integers(1, 50),
        st.floats(1e-6, 0.01),
        st.lists(st.integers(1, 10**9), max_size=3),
    )
    def test_they_begin_early_enough(self, evaluations, per_decade, start, at):
        spacing = {"evaluations": evaluations, "per_decade": per_decade, "start": start}
        counts = record_counts(**spacing, at=tuple(at))
        assert counts == sorted(set(counts))
        assert 1 <= counts[0] <= max(1, np.ceil(0.01 * evaluations))
        assert counts[-1] == evaluations
        assert set(counts) >= {count for count in at if count <= evaluations}
        spaced = record_counts(**spacing, at=())
        assert set(spaced) <= set(counts)
        ratios = [b / a for a, b in pairwise(spaced) if a >= 100]
        assert all(ratio <= 10 ** (1 / per_decade) * 1.02 for ratio in ratios)


class Counted:
    """Counts the plans whose objectives are computed, whoever asks for them."""

    def __init__(self, monkeypatch):
        self.n = 0
        usual = Mission.evaluate

        def evaluate(mission, plans):
            F = usual(mission, plans)
            self.n += len(F)
            return F

        monkeypatch.setattr(Mission, "evaluate", evaluate)

    def calls_of(self, appraise):
        def watched(*arguments):
            self.n += 1
            return appraise(*arguments)

        return watched


# These compute objectives within their kernels, plan by plan; and exact refuses the museum.
IN_KERNELS = {"exact", "pareto-local-search", "simulated-annealing"}
WATCHED = [name for name in NAMES if name not in IN_KERNELS]


class TestBudgets:
    @pytest.mark.slow
    @pytest.mark.parametrize("name", [*WATCHED, DOTTED[1], f"{MADE}:Sampler"])
    def test_nobody_is_given_more(self, monkeypatch, name):
        counted = Counted(monkeypatch)
        for budget in (1, 97, 209):
            counted.n = 0
            outcome, records = performed(make_task(name, evaluations=budget))
            assert outcome.status == "done", outcome.error
            assert counted.n == outcome.evaluations == records[-1].evaluations
            assert outcome.evaluations <= budget
            if name not in ENDS_BY_ITSELF:
                assert outcome.evaluations == budget
                assert outcome.stopped_by == "evaluations"

    @pytest.mark.slow
    def test_nor_is_annealing_which_evaluates_in_its_kernel(self):
        # As plain Python, where somebody can watch the kernel.
        code = """if True:
            from botohe_moo import Mission
            from botohe_moo.algorithms.annealing import kernels
            from tests.study.test_perform import make_task, performed

            n, appraise, evaluate = [0], kernels._evaluate, Mission.evaluate
            def watched(*arguments):
                n[0] += 1
                return appraise(*arguments)
            def evaluated(mission, plans):
                n[0] += len(plans)
                return evaluate(mission, plans)
            kernels._evaluate, Mission.evaluate = watched, evaluated
            for name in ("simulated-annealing", "botohe_moo:SimulatedAnnealing.journal"):
                for budget in (1, 97, 131):
                    n[0] = 0
                    outcome, _ = performed(make_task(name, mission="toy", evaluations=budget))
                    assert outcome.status == "done"
                    assert outcome.evaluations == n[0] <= budget, (outcome.evaluations, n[0])
        """
        paths = os.pathsep.join(sys.path)
        environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": paths}
        command = [sys.executable, "-c", code]
        done = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr

    def test_nor_is_local_search(self, monkeypatch):
        counted = Counted(monkeypatch)
        with plain_local_search() as patch:
            # Each inserts a plan to start from, tells what a child brings, or makes one.
            for module, name in (
                (search, "_insert_given"),
                (moves, "evaluate_child"),
                (moves, "evaluate_trail"),
                (recreate, "_make_child"),
            ):
                patch.setattr(module, name, counted.calls_of(getattr(module, name)))
            for budget in (1, 5, 97):
                counted.n = 0
                outcome, records = performed(make_task("pareto-local-search", evaluations=budget))
                assert outcome.status == "done", outcome.error
                assert counted.n == outcome.evaluations == records[-1].evaluations == budget

    def test_the_last_generation_is_cut_where_the_budget_is(self):
        outcome, records = performed(make_task(f"{MADE}:Sampler", evaluations=1_000))
        assert outcome.evaluations == records[-1].evaluations == 1_000
        problem = BOTOHE(load_mission("art_museum"))
        algorithm = make_algorithm(f"{MADE}:Sampler")
        algorithm.setup(problem, termination=("n_eval", 1_000), seed=1)
        algorithm.run()
        assert algorithm.evaluator.n_eval == 1_050  # what pymoo alone lets it spend

    def test_spending_more_is_a_failure(self):
        for name, n in (("Overdrawing", 100), ("Understating", 10)):
            outcome, _ = performed(make_task(f"{MADE}:{name}", evaluations=n))
            assert outcome.status == "failed"
            assert f"plans of the {n} allowed" in outcome.error

    def test_what_copies_of_the_problem_evaluate_counts(self):
        outcome, records = performed(make_task(f"{MADE}:Copying", evaluations=200))
        assert (outcome.status, outcome.evaluations) == ("done", 200)
        assert records[-1].evaluations == 200

    def test_compiling_is_not_the_own_time_of_any_algorithm(self):
        began = time.perf_counter()
        outcome, _ = performed(make_task(f"{MADE}:Compiling", evaluations=40))
        assert outcome.seconds <= time.perf_counter() - began - 2 * 0.3

    def test_seconds_end_a_run_at_the_end_of_an_iteration(self):
        slow = {"parameters": {"seconds": 0.02}, "evaluations": None, "budget": {"seconds": 0.2}}
        task = make_task(f"{MADE}:Slow", **slow)
        outcome, _ = performed(task)
        assert (outcome.status, outcome.stopped_by) == ("done", "seconds")
        assert outcome.seconds >= 0.2
        assert outcome.evaluations % 10 == 0


class TestMeter:
    def test_it_archives_what_the_budget_allows(self):
        mission = load_mission("toy")
        meter = Meter(25, PlanArchive(mission.robots))
        problem = metered(BOTOHE(mission, min_survival=0.5), meter)
        sampled = make_algorithm("random", n_ants=40)
        batch = mission.batch(
            minimize(BOTOHE(mission), sampled, ("n_gen", 1), seed=1).algorithm.archive.plans
        )
        batch = batch.take(np.arange(40) % len(batch))
        problem.evaluate_batch(batch[:20])
        with pytest.raises(BudgetSpentError):
            problem.evaluate_batch(batch[20:])
        assert meter.spent == 25
        assert (mission.robot_survival(meter.archive.plans) >= 0.5 * (1 - 1e-12)).all()
        with pytest.raises(BudgetSpentError):
            problem.evaluate_batch(batch[:1])
        assert meter.spent == 25

    def test_it_is_the_problem_for_algorithms(self):
        inner = Weakest(load_mission("toy"), min_survival=0.25)
        problem = metered(inner, Meter(5))
        assert isinstance(problem, BOTOHE)
        for name in ("n_obj", "n_ieq_constr", "min_survival", "objectives", "max_length"):
            assert getattr(problem, name) == getattr(inner, name)
        assert problem.name() == inner.name()
        assert problem.advice() == inner.advice()
        with pytest.raises(AttributeError, match="no attribute 'advise'"):
            problem.advise()
        other = copy.deepcopy(problem).allowing_invalid()
        assert other.n_ieq_constr == inner.n_ieq_constr + 1
        plans = inner.mission.batch([inner.mission.plan([[1], [1]])])
        assert other.evaluate_batch(plans).tolist() == inner.evaluate_batch(plans).tolist()
        assert other.constrain_batch(plans).shape == (1, 2)
        assert problem.meter.spent == 1


class TestRecords:
    @pytest.mark.parametrize("name", ["bo-aco", f"{MADE}:Sampler"])
    def test_a_smaller_budget_can_be_read_off(self, name):
        outcome, records = performed(make_task(name, evaluations=2_000))
        counts = [record.evaluations for record in records]
        assert counts == sorted(counts)
        assert counts[0] <= 200  # the first generation, where 1 % is less
        steps = np.diff(np.unique(counts))
        assert (steps <= np.maximum(100, 0.15 * np.array(sorted(set(counts))[1:])) + 100).all()
        mission = load_mission("art_museum")
        plans, objectives = records[-1].plans
        assert np.allclose(mission.evaluate(plans), objectives, rtol=1e-9)
        assert len(records[-1].objectives) == records[-1].front_size
        assert len(plans) == records[-1].front_size + records[-1].ties
        assert {tuple(p) for p in objectives} == {tuple(p) for p in records[-1].objectives}
        assert (np.diff(records[-1].objectives[:, 0]) < 0).all()
        assert outcome.recording_seconds > 0

    def test_recording_does_not_change_the_run(self):
        _, records = performed(make_task("nsga2", evaluations=777))
        result = minimize(
            BOTOHE(load_mission("art_museum")), make_algorithm("nsga2"), ("n_eval", 777), seed=1
        )
        assert {tuple(p) for p in -result.F} == {tuple(p) for p in records[-1].objectives}

    def test_times_leave_recording_out(self, monkeypatch):
        usual = PlanArchive.plans.fget

        def slow(archive):
            time.sleep(0.05)
            return usual(archive)

        monkeypatch.setattr(PlanArchive, "plans", property(slow))
        # With a budget of seconds, plans are kept each time.
        task = make_task("random", evaluations=500, budget={"seconds": 1_000})
        outcome, records = performed(task)
        assert len(records) >= 5
        assert outcome.recording_seconds >= 0.05 * len(records)
        assert outcome.seconds < 0.05 * len(records)
        assert records[-1].seconds < 0.05 * len(records)

    def test_points_and_ties_are_counted(self):
        """Two rocks that are alike: each of them alone is worth the same, both are worth more."""
        graph = nx.DiGraph()
        graph.add_node("dock", reward=0)
        for rock in ("a", "b"):
            graph.add_node(rock, reward=1)
            graph.add_edge("dock", rock, survival=0.9)
            graph.add_edge(rock, "dock", survival=0.9)
        mission = Mission(graph, base="dock", robots=1)
        trails = [["dock"], ["dock", "a", "dock"], ["dock", "b", "dock"]]
        plans = mission.batch([mission.plan([trail]) for trail in trails])
        archive, records = PlanArchive(1), []
        archive.insert(plans, mission.evaluate(plans))
        recorder = Recorder(make_task("random"), lambda: archive, records.append)
        recorder.record(3, 0.1, with_plans=True)
        [record] = records
        assert (len(record.plans[0]), record.front_size, record.ties) == (3, 2, 1)


@pytest.fixture(scope="module")
def pool():
    with contextlib.closing(WorkerPool()) as made:
        yield made


def outcome_of(pool, task):
    [(performed, outcome)] = pool.perform([task])
    assert performed is task
    return outcome


@pytest.mark.slow
class TestPool:
    def test_it_gives_the_same_as_this_process(self, new_interpreters):
        task = make_task("bo-aco", evaluations=1_000)
        outcome, records = performed(task)
        before = datetime.now(UTC).replace(microsecond=0)
        with contextlib.closing(WorkerPool()) as pool:
            other = outcome_of(pool, task)
        assert (other.status, other.evaluations) == (outcome.status, outcome.evaluations)
        last = {record.evaluations: record.objectives.tolist() for record in records}
        assert {r.evaluations: r.objectives.tolist() for r in other.records} == last
        assert [r.plans is None for r in other.records] == [*[True] * (len(last) - 1), False]
        assert other.environment["botohe_moo"] == version("botohe-moo")
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", other.began)
        assert before <= datetime.fromisoformat(other.began) <= datetime.now(UTC)

    def test_what_goes_wrong_in_one_run_disturbs_no_other(self, pool):
        """Whatever becomes of it, in two processes at a time."""
        expected = {
            "random": ("done", None),
            "Dying": ("failed", "its process died (signal SIGABRT)"),
            "Exiting": ("failed", "SystemExit: 0"),
            "Asking": ("failed", "EOFError: EOF when reading a line"),
            "Changing": ("failed", "claimed to bring"),
            "Printing": ("done", None),
            "greedy": ("done", None),
        }
        tasks = [
            make_task(name if name.islower() else f"{MADE}:{name}", evaluations=100, digest=name)
            for name in expected
        ]
        found = {task.digest: outcome for task, outcome in pool.perform(tasks, workers=2)}
        for name, (status, error) in expected.items():
            assert found[name].status == status, name
            assert error is None or error in found[name].error
            assert (found[name].records == ()) == (status == "failed")
        assert found["Dying"].traceback == "last words"

    def test_killed_processes_fail_their_own_runs_only(self, processes_there):
        """At random moments, also in the middle of messages."""
        rng = random.Random(1)
        tasks = [
            make_task("random", evaluations=8_000, at=range(100, 8_000, 50), digest=str(i))
            for i in range(8)
        ]
        killed, noted, outcomes = [], [0], {}

        def note(run, _):
            noted[0] += 1
            if len(killed) < 3 and noted[0] % 150 == 0:
                process = rng.choice(processes_there())
                process.kill()
                killed.append(process.pid)

        with contextlib.closing(WorkerPool()) as pool:
            for task, outcome in pool.perform(tasks, workers=2, note=note):
                outcomes[task.digest] = outcome
        assert len(outcomes) == 8
        failed = [outcome for outcome in outcomes.values() if outcome.status == "failed"]
        assert 1 <= len(failed) <= len(killed) == 3
        assert {outcome.error for outcome in failed} == {"its process died (signal SIGKILL)"}
        done = [o.records[-1].objectives.tolist() for o in outcomes.values() if o.status == "done"]
        assert len(done) == 8 - len(failed)
        assert all(front == done[0] for front in done)

    def test_what_does_not_end_in_its_seconds_is_killed_and_its_front_counts(self, pool):
        task = make_task(
            f"{MADE}:NeverEnding",
            budget={"seconds": 0.3, "grace_seconds": 0.2},
            parameters={"busy": True},
        )
        outcome = outcome_of(pool, task)
        assert (outcome.status, outcome.stopped_by) == ("timeout", "limit")
        assert "killed: 0.2 s after its 0.3 s were up" in outcome.error
        assert outcome.evaluations == 20
        assert outcome.began is not None
        assert len(outcome.records[-1].plans[0]) == outcome.records[-1].front_size

    def test_claims_of_killed_runs_are_not_taken_on_trust(self, pool):
        outcome = outcome_of(pool, make_task(f"{MADE}:Overstating", budget={"seconds": 0.3}))
        assert outcome.status == "failed"
        assert "claimed to bring" in outcome.error
        assert outcome.records == ()

    def test_the_clock_stands_still_while_kernels_are_compiled(self, pool):
        """Compiling takes 3 seconds here, and a run is killed after 1.5."""
        budget = {"evaluations": 40, "seconds": 1.0, "grace_seconds": 0.5}
        task = make_task(f"{MADE}:Compiling", budget=budget, parameters={"seconds": 1.5})
        outcome = outcome_of(pool, task)
        assert (outcome.status, outcome.stopped_by) == ("done", "evaluations")

    def test_what_evaluates_nothing_any_more_is_killed_without_seconds_too(self, pool):
        task = make_task(f"{MADE}:NeverEnding", patience=0.5)
        outcome = outcome_of(pool, task)
        assert (outcome.status, outcome.stopped_by) == ("failed", "error")
        assert outcome.error.startswith("killed: it had evaluated no plan for 0.5 s")
        assert outcome.records == ()

    def test_what_goes_on_evaluating_is_waited_for(self, pool):
        """However long it takes, within one iteration or many; as are this package's algorithms."""
        for name in ("Slow", "SlowWithin"):
            task = make_task(
                f"{MADE}:{name}", evaluations=70, patience=1.0, parameters={"seconds": 0.2}
            )
            outcome = outcome_of(pool, task)
            assert (outcome.status, outcome.evaluations) == ("done", 70)
            assert outcome.seconds > task.patience
        ours = make_task("bo-aco", evaluations=5_000, patience=1e-3)
        assert outcome_of(pool, ours).status == "done"

    @pytest.mark.parametrize("stay", [False, True])
    def test_no_process_is_left_behind(self, stay, processes_there):
        task = make_task(f"{MADE}:Forking", budget={"seconds": 0.3}, parameters={"stay": stay})
        outcome = outcome_of(WorkerPool(), task)
        if stay:
            assert outcome.status == "timeout"
        else:
            assert outcome.error == "its process died (exit status 3)"
        time.sleep(0.1)
        assert processes_there() == []

    def test_runs_of_other_peoples_algorithms_know_nothing_of_each_other(self, pool):
        """And generators that everybody shares begin with the seed."""
        task = make_task(f"{MADE}:Remembering", evaluations=30)
        assert [outcome_of(pool, task).status for _ in range(2)] == ["done", "done"]
        drawing = (make_task(f"{MADE}:Drawing", seed=seed) for seed in (1, 1, 2))
        one, again, other = (outcome_of(pool, task).error for task in drawing)
        assert one == again != other

    def test_it_stops_when_it_is_asked_to_and_ends_its_processes(self, processes_there):
        pool, began = WorkerPool(), time.monotonic()
        tasks = [make_task(f"{MADE}:NeverEnding")] * 3
        stopped = lambda: time.monotonic() - began > 0.5  # noqa: E731
        assert list(pool.perform(tasks, workers=2, stopped=stopped)) == []
        assert processes_there() == []

    def test_other_code_is_refused(self, pool):
        task = make_task("random")
        for change in ({"botohe-moo": "99.0"}, {"package": "other"}):
            algorithm = replace(task.algorithm, origin={**task.algorithm.origin, **change})
            outcome = outcome_of(pool, replace(task, algorithm=algorithm))
            assert outcome.status == "failed"
            assert f"the study from {algorithm.origin}" in outcome.error


class TestVerification:
    """Limits of the final front, whatever the algorithm says."""

    trails = ([[1], [1]], [[1, 3, 1], [1, 2, 4, 5, 4, 2, 1]])

    def verify(self, **limits):
        run = make_task("random", mission={"mission": "toy", **limits})
        mission = run.mission.mission
        plans = mission.batch([mission.plan(trails) for trails in self.trails])
        verify(run, plans, mission.evaluate(plans))

    def test_those_that_are_kept_and_those_that_are_not(self):
        self.verify(min_survival=0.34, max_length=6.0)
        self.verify()
        empty = load_mission("toy").batch([])
        verify(make_task("random", mission="toy"), empty, np.empty((0, 2)))
        with pytest.raises(ValueError, match=r"survival of at least 0\.5 in .*, got 0\.34"):
            self.verify(min_survival=0.5)
        with pytest.raises(ValueError, match=r"length of at most 5\.5 in .*, got 6\."):
            self.verify(max_length=5.5)
