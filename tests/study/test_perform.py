"""Runs: their budgets, their records and how they end, in this process and in sandboxes."""

import contextlib
import math
import os
import pickle
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from itertools import pairwise

import numpy as np
import psutil
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Mission, load_mission, make_algorithm
from botohe_moo.algorithms.origin import algorithm_origin
from botohe_moo.kernels.local_search import refill, search
from botohe_moo.study.run.metered import BudgetSpentError, MeteredBOTOHE
from botohe_moo.study.run.perform import perform, record_counts, verify
from botohe_moo.study.run.pool import SandboxPool
from botohe_moo.study.run.sandbox import Sandbox
from botohe_moo.study.run.task import Task
from tests.algorithms.test_contract import DOTTED, ENDS_BY_ITSELF, NAMES
from tests.twins import plain_local_search

MADE = "tests.study.algorithms_made"


def make_task(algorithm, *, mission="art_museum", evaluations=500, **changes):
    task = Task(
        digest="x",
        mission=load_mission(mission),
        min_survival=0.0,
        algorithm=algorithm,
        parameters={},
        origin={},
        seed=1,
        evaluations=evaluations,
        seconds=None,
        grace_seconds=1.0,
        per_decade=20,
        start=0.001,
        at=(),
        version=version("botohe-moo"),
    )
    task = replace(task, **changes)
    return replace(task, origin=algorithm_origin(task.algorithm))


def performed(task):
    records = []
    return perform(task, records.append), records


class TestCounts:
    def test_they_are_log_spaced_and_end_with_the_budget(self):
        counts = record_counts(evaluations=1_000, per_decade=2, start=0.001, at=())
        assert counts == [1, 3, 10, 32, 100, 316, 1_000]

    def test_further_ones_are_added(self):
        counts = record_counts(evaluations=100, per_decade=1, start=0.01, at=(7, 50, 200))
        assert counts == [1, 7, 10, 50, 100]

    def test_without_a_budget_they_go_on(self):
        counts = record_counts(evaluations=None, per_decade=1, start=0.001, at=())
        assert counts == [10**i for i in range(13)]

    @given(
        st.integers(1, 10**9),
        st.integers(1, 50),
        st.floats(1e-6, 0.01),
        st.lists(st.integers(1, 10**9), max_size=3),
    )
    def test_they_begin_early_enough(self, evaluations, per_decade, start, at):
        counts = record_counts(
            evaluations=evaluations, per_decade=per_decade, start=start, at=tuple(at)
        )
        assert counts == sorted(set(counts))
        assert 1 <= counts[0] <= max(1, np.ceil(0.01 * evaluations))
        assert counts[-1] == evaluations
        assert set(counts) >= {count for count in at if count <= evaluations}
        spaced = record_counts(evaluations=evaluations, per_decade=per_decade, start=start, at=())
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
    @pytest.mark.parametrize("name", [*WATCHED, *DOTTED, f"{MADE}:Sampler"])
    @pytest.mark.parametrize("budget", [1, 97, 1_009])
    def test_nobody_is_given_more(self, name, budget, monkeypatch):
        counted = Counted(monkeypatch)
        outcome, records = performed(make_task(name, evaluations=budget))
        assert outcome.status == "done", outcome.error
        assert counted.n == outcome.evaluations == records[-1].evaluations
        assert outcome.evaluations <= budget
        if name not in ENDS_BY_ITSELF:
            assert outcome.evaluations == budget
            assert outcome.stopped_by == "evaluations"

    @pytest.mark.parametrize("schedule", ["cooled", "journal"])
    def test_nor_is_annealing_which_evaluates_in_its_kernel(self, schedule):
        # As plain Python, where somebody can watch the kernel.
        code = f"""
from botohe_moo import Mission
from botohe_moo.kernels.anneal import schedule as anneal
from tests.study.test_perform import make_task, performed

n, appraise, evaluate = [0], anneal._evaluate, Mission.evaluate
def watched(*arguments):
    n[0] += 1
    return appraise(*arguments)
def evaluated(mission, plans):
    F = evaluate(mission, plans)
    n[0] += len(F)
    return F
anneal._evaluate, Mission.evaluate = watched, evaluated
for budget in (1, 97, 331):
    n[0] = 0
    schedule = {{"schedule": {schedule!r}}}
    task = make_task("simulated-annealing", evaluations=budget, parameters=schedule)
    outcome, records = performed(task)
    print(outcome.evaluations, n[0])
"""
        said = subprocess.run(
            [sys.executable, "-c", code],
            check=True,
            capture_output=True,
            text=True,
            env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        for budget, line in zip((1, 97, 331), said.stdout.splitlines(), strict=True):
            reported, counted = map(int, line.split())
            assert reported == counted <= budget

    @pytest.mark.parametrize("budget", [1, 5, 97, 503])
    def test_nor_is_local_search(self, budget, monkeypatch):
        counted = Counted(monkeypatch)
        with plain_local_search() as patch:
            # Each tells what a child brings, or makes one.
            for module, name in (
                (search, "appraise"),
                (search, "appraise_trail"),
                (refill, "_make_child"),
            ):
                patch.setattr(module, name, counted.calls_of(getattr(module, name)))
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

    def test_overdrawing_is_a_failure(self):
        outcome, _ = performed(make_task(f"{MADE}:Overdrawing", evaluations=100))
        assert outcome.status == "failed"
        assert "evaluated 120 plans of the 100 allowed" in outcome.error

    def test_what_copies_of_the_problem_evaluate_counts(self):
        outcome, records = performed(make_task(f"{MADE}:Copying", evaluations=200))
        assert (outcome.status, outcome.evaluations) == ("done", 200)
        assert records[-1].evaluations == 200

    def test_so_does_what_an_algorithm_keeps_to_itself(self):
        outcome, _ = performed(make_task(f"{MADE}:Understating", evaluations=10))
        assert outcome.status == "failed"
        assert "of the 10 allowed" in outcome.error

    def test_seconds_end_a_run_at_the_end_of_an_iteration(self):
        task = make_task(
            f"{MADE}:Slow", evaluations=None, seconds=0.2, parameters={"seconds": 0.02}
        )
        outcome, _ = performed(task)
        assert (outcome.status, outcome.stopped_by) == ("done", "seconds")
        assert outcome.seconds >= 0.2
        assert outcome.evaluations % 10 == 0

    def test_whichever_is_spent_first(self):
        outcome, _ = performed(make_task("random", evaluations=300, seconds=1_000.0))
        assert (outcome.stopped_by, outcome.evaluations) == ("evaluations", 300)


class TestMeter:
    def test_it_archives_what_the_budget_allows(self):
        mission = load_mission("toy")
        problem = MeteredBOTOHE(mission, min_survival=0.5, evaluations=25)
        sampled = make_algorithm("random", n_ants=40)
        batch = mission.batch(
            minimize(BOTOHE(mission), sampled, ("n_gen", 1), seed=1).algorithm.archive.plans
        )
        batch = batch.take(np.arange(40) % len(batch))
        problem.evaluate_batch(batch[:20])
        with pytest.raises(BudgetSpentError):
            problem.evaluate_batch(batch[20:])
        assert problem.meter.spent == 25
        assert (mission.robot_survival(problem.archive.plans) >= 0.5 * (1 - 1e-12)).all()
        with pytest.raises(BudgetSpentError):
            problem.evaluate_batch(batch[:1])
        assert problem.meter.spent == 25


class TestRecords:
    @pytest.mark.parametrize("name", [*sorted({*NAMES} - {"exact"}), f"{MADE}:Sampler"])
    def test_a_smaller_budget_can_be_read_off(self, name):
        outcome, records = performed(make_task(name, evaluations=2_000))
        counts = [record.evaluations for record in records]
        assert counts == sorted(counts)
        if name not in ENDS_BY_ITSELF:
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
        from botohe_moo.search.archive import PlanArchive

        usual = PlanArchive.plans.fget

        def slow(archive):
            time.sleep(0.2)
            return usual(archive)

        monkeypatch.setattr(PlanArchive, "plans", property(slow))
        task = make_task("random", evaluations=500, seconds=1_000.0)  # keeps plans each time
        outcome, records = performed(task)
        assert len(records) >= 5
        assert outcome.recording_seconds >= 0.2 * len(records)
        assert outcome.seconds < 0.2 * len(records)
        assert records[-1].seconds < 0.2 * len(records)


class TestFailures:
    def test_what_an_algorithm_raises(self):
        outcome, _ = performed(make_task(f"{MADE}:Raising", parameters={"message": "no way"}))
        assert outcome.status == "failed"
        assert outcome.error == "RuntimeError: no way"
        assert "_advance" in outcome.traceback
        assert outcome.evaluations == 20

    def test_ending_the_process_as_if_all_were_well(self):
        outcome, _ = performed(make_task(f"{MADE}:Exiting"))
        assert (outcome.status, outcome.error) == ("failed", "SystemExit: 0")

    def test_nothing_feasible(self):
        task = make_task(f"{MADE}:Infeasible", mission="power_plant", min_survival=0.9999)
        outcome, records = performed(replace(task, evaluations=100))
        assert outcome.status == "infeasible", outcome.error
        assert outcome.evaluations > 0
        assert records == []


@pytest.fixture(scope="module")
def sandbox():
    made = Sandbox()
    yield made
    made.close()


def marked_processes(folder):
    """Processes that perform runs, started with that folder in their environment."""
    found = []
    for process in psutil.process_iter(["cmdline", "environ"]):
        marked = (process.info["environ"] or {}).get("BOTOHE_TEST_FOLDER") == str(folder)
        if "botohe_moo.study.run.child" in (process.info["cmdline"] or []) and marked:
            found.append(process)
    return found


def sandboxed(sandbox, task):
    return sandbox.perform(task, stopped=lambda: False, note=lambda _: None)


class TestSandbox:
    def test_it_gives_the_same_as_this_process(self, new_interpreters):
        task = make_task("bo-aco", evaluations=1_000)
        outcome, records = performed(task)
        with contextlib.closing(Sandbox()) as sandbox:
            other = sandboxed(sandbox, task)
        assert (other.status, other.evaluations) == (outcome.status, outcome.evaluations)
        last = {record.evaluations: record.objectives.tolist() for record in records}
        assert {r.evaluations: r.objectives.tolist() for r in other.records} == last
        assert other.environment["botohe_moo"] == version("botohe-moo")
        assert [r.plans is None for r in other.records] == [True] * (len(other.records) - 1) + [
            False
        ]

    @pytest.mark.parametrize("busy", [False, True])
    def test_what_never_ends_is_killed(self, sandbox, busy):
        task = make_task(f"{MADE}:NeverEnding", seconds=0.3, parameters={"busy": busy})
        outcome = sandboxed(sandbox, task)
        assert (outcome.status, outcome.stopped_by) == ("timeout", "limit")
        assert "killed" in outcome.error
        assert outcome.evaluations == 20
        assert len(outcome.records[-1].plans[0]) == outcome.records[-1].front_size

    @pytest.mark.parametrize(
        ("algorithm", "status"),
        [("random", "done"), (f"{MADE}:Dying", "failed"), (f"{MADE}:NeverEnding", "timeout")],
    )
    def test_when_a_run_began_is_told_however_it_ends(self, sandbox, algorithm, status):
        task = make_task(algorithm, mission="toy", seconds=0.5, grace_seconds=0.1)
        before = datetime.now(UTC).replace(microsecond=0)
        outcome = sandboxed(sandbox, task)
        assert outcome.status == status
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", outcome.began)
        assert before <= datetime.fromisoformat(outcome.began) <= datetime.now(UTC)

    def test_a_run_that_never_began_did_not_begin(self, sandbox):
        assert sandboxed(sandbox, replace(make_task("random"), version="0.0.1")).began is None

    @pytest.mark.parametrize(
        ("name", "parameters"),
        [("NeverEnding", {"busy": False}), ("NeverEnding", {"busy": True}), ("Refusing", {})],
    )
    def test_what_evaluates_nothing_any_more_is_killed_without_seconds_too(
        self, sandbox, name, parameters
    ):
        task = make_task(f"{MADE}:{name}", patience=0.5, parameters=parameters)
        outcome = sandboxed(sandbox, task)
        assert (outcome.status, outcome.stopped_by) == ("failed", "error")
        assert outcome.error.startswith("killed: it had evaluated no plan for 0.5 s")
        assert outcome.records == ()
        assert sandboxed(sandbox, make_task("random")).status == "done"

    def test_what_goes_on_evaluating_is_waited_for(self):
        """However long it takes, within one iteration or many."""
        patience = 4.0
        tasks = [
            make_task(
                f"{MADE}:{name}", evaluations=210, patience=patience, parameters={"seconds": 0.2}
            )
            for name in ("Slow", "SlowWithin")
        ]
        pool = SandboxPool()
        with ThreadPoolExecutor(2) as threads:  # they sleep
            outcomes = list(threads.map(lambda task: sandboxed(pool, task), tasks))
        pool.close()
        for outcome in outcomes:
            assert (outcome.status, outcome.evaluations) == ("done", 210)
            assert outcome.seconds > patience

    def test_patience_is_for_other_peoples_algorithms_and_changes_no_run(self, sandbox):
        ours = make_task("bo-aco", evaluations=5_000, patience=1e-3)
        assert sandboxed(sandbox, ours).status == "done"
        [one], [other] = (
            [sandboxed(sandbox, make_task(f"{MADE}:Sampler", patience=p)).records[-1].objectives]
            for p in (100.0, 1e6)
        )
        assert one.tolist() == other.tolist()

    def test_problems_can_be_pickled_while_they_are_watched(self):
        problem = MeteredBOTOHE(load_mission("toy"), evaluations=5)
        problem.meter.watch = lambda: None
        problem.meter.count(3)
        assert pickle.loads(pickle.dumps(problem)).meter.spent == 3

    def test_a_process_that_dies_fails_its_run_only(self, sandbox):
        outcome = sandboxed(sandbox, make_task(f"{MADE}:Dying"))
        assert outcome.status == "failed"
        assert "SIGABRT" in outcome.error
        assert "last words" in outcome.traceback
        assert sandboxed(sandbox, make_task("random")).status == "done"

    @pytest.mark.parametrize("stay", [False, True])
    def test_no_process_is_left_behind(self, stay, new_interpreters, monkeypatch, tmp_path):
        monkeypatch.setenv("BOTOHE_TEST_FOLDER", str(tmp_path))
        sandbox = Sandbox()
        task = make_task(f"{MADE}:Forking", seconds=0.3, parameters={"stay": stay})
        outcome = sandboxed(sandbox, task)
        if stay:
            assert outcome.status == "timeout"
        else:
            assert outcome.error == "its process died (exit status 3)"
        time.sleep(0.1)
        assert marked_processes(tmp_path) == []

    def test_nobody_answers_questions(self, sandbox):
        outcome = sandboxed(sandbox, make_task(f"{MADE}:Asking"))
        assert outcome.status == "failed"
        assert "EOFError" in outcome.error

    @pytest.mark.parametrize("name", ["Lying", "Changing"])
    def test_objectives_are_not_taken_on_trust(self, sandbox, name):
        outcome = sandboxed(sandbox, make_task(f"{MADE}:{name}", evaluations=100))
        assert outcome.status == "failed"
        assert "claimed to bring" in outcome.error
        assert outcome.records == ()

    def test_runs_of_other_peoples_algorithms_know_nothing_of_each_other(self, sandbox):
        task = make_task(f"{MADE}:Remembering", evaluations=30)
        outcomes = [sandboxed(sandbox, task) for _ in range(2)]
        assert [outcome.status for outcome in outcomes] == ["done", "done"]

    def test_copies_of_a_process_are_not_heard(self, sandbox):
        expected = sandboxed(sandbox, make_task("random", evaluations=60))
        outcome = sandboxed(sandbox, make_task(f"{MADE}:Doubling", evaluations=60))
        assert (outcome.status, outcome.evaluations) == ("done", 60)
        after = sandboxed(sandbox, make_task("random", evaluations=60))
        assert [r.objectives.tolist() for r in after.records] == [
            r.objectives.tolist() for r in expected.records
        ]

    def test_generators_that_everybody_shares_begin_with_the_seed(self, sandbox):
        said = {sandboxed(sandbox, make_task(f"{MADE}:Drawing")).error for _ in range(2)}
        assert len(said) == 1
        assert said != {sandboxed(sandbox, make_task(f"{MADE}:Drawing", seed=2)).error}

    def test_claims_of_killed_runs_are_not_taken_on_trust(self, sandbox):
        outcome = sandboxed(sandbox, make_task(f"{MADE}:Overstating", seconds=0.3))
        assert outcome.status == "failed"
        assert "claimed to bring" in outcome.error
        assert outcome.records == ()

    def test_it_stops_at_once_while_records_come(self, sandbox):
        asked = []

        def stopped():
            asked.append(time.monotonic())
            return len(asked) > 20

        task = make_task(f"{MADE}:Chatty", evaluations=5_000, seconds=600.0, at=tuple(range(5_000)))
        assert sandbox.perform(task, stopped=stopped, note=lambda _: None) is None
        assert len(asked) == 21

    def test_last_words_are_those_of_the_run(self, sandbox):
        assert sandboxed(sandbox, make_task(f"{MADE}:Printing", evaluations=30)).status == "done"
        outcome = sandboxed(sandbox, make_task(f"{MADE}:Dying"))
        assert "last words" in outcome.traceback
        assert "more of it" not in outcome.traceback

    def test_who_notes_records_may_raise(self, sandbox):
        def note(record):
            raise BrokenPipeError("nobody reads")

        with pytest.raises(BrokenPipeError):
            sandbox.perform(make_task("random"), stopped=lambda: False, note=note)
        assert sandboxed(sandbox, make_task("random")).status == "done"

    def test_what_is_printed_does_not_come_between(self, sandbox):
        outcome = sandboxed(sandbox, make_task(f"{MADE}:Printing", evaluations=30))
        assert outcome.status == "done"

    def test_it_stops_when_told(self, sandbox):
        task = make_task(f"{MADE}:NeverEnding")
        started = time.monotonic()
        stopped = sandbox.perform(
            task, stopped=lambda: time.monotonic() - started > 0.5, note=lambda _: None
        )
        assert stopped is None

    def test_another_version_is_refused(self, sandbox):
        outcome = sandboxed(sandbox, make_task("random", version="99.0"))
        assert outcome.status == "failed"
        assert "the study 99.0" in outcome.error
        origin = {"package": "other", "version": "1", "source": None}
        outcome = sandboxed(sandbox, replace(make_task("random"), origin=origin))
        assert "the study from" in outcome.error


class TestVerification:
    """Limits of the final front, whatever the algorithm says."""

    trails = ([[1], [1]], [[1, 3, 1], [1, 2, 4, 5, 4, 2, 1]])

    def verify(self, **limits):
        task = make_task("random", mission="toy", **limits)
        mission = task.mission
        plans = mission.batch([mission.plan(trails) for trails in self.trails])
        verify(task, plans, mission.evaluate(plans))

    def test_what_keeps_them(self):
        self.verify(min_survival=0.34, max_length=6.0)
        self.verify()
        empty = load_mission("toy").batch([])
        verify(make_task("random", mission="toy", max_length=0.0), empty, np.empty((0, 2)))

    def test_a_robot_in_too_great_danger(self):
        with pytest.raises(ValueError, match=r"final front survives with 0\.34\d+, below 0\.5"):
            self.verify(min_survival=0.5)

    def test_a_trail_that_is_too_long(self):
        with pytest.raises(ValueError, match=r"trail of the final front is 6 long, beyond 5\.5"):
            self.verify(max_length=5.5)


def test_the_travel_budget_reaches_every_kind_of_problem(monkeypatch):
    seen = []
    build = BOTOHE.__init__

    def noting(problem, mission, **limits):
        build(problem, mission, **limits)
        seen.append(problem.max_length)

    monkeypatch.setattr(BOTOHE, "__init__", noting)
    for name in (
        "random",
        f"{MADE}:Sampler",
        "simulated-annealing",
        "pymoo.algorithms.moo.nsga2:NSGA2",
    ):
        for limit, expected in ((math.inf, None), (4.0, 4.0)):
            seen.clear()
            performed(make_task(name, mission="toy", max_length=limit, evaluations=5))
            assert set(seen) == {expected}, name
