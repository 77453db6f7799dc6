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

DOING, SAMPLER = f"{MADE}:Doing", f"{MADE}:Sampler"
FOR_EVER = "time.sleep(3600)"


def make_task(algorithm, *, mission="art_museum", evaluations=500, at=(), budget=(), **changes):
    own = {name: changes.pop(name) for name in ("what", "n") if name in changes}
    content = study_of(
        missions={"m": mission},
        algorithms={"a": {"algorithm": algorithm, "parameters": own}},
        budget={"evaluations": evaluations, "grace_seconds": 1.0, **dict(budget)},
        recording={"at": [*at]},
        seeds=1,
    )
    return replace(load_study(content).runs()[0], **changes)


def doing(what, **options):
    return make_task(DOING, what=what, **options)


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

    @given(st.integers(1, 10**9), st.integers(1, 50), st.floats(1e-6, 0.01))
    def test_they_begin_early_enough_and_any_smaller_budget_is_near(self, n, per_decade, start):
        counts = record_counts(evaluations=n, per_decade=per_decade, start=start, at=())
        assert counts == sorted(set(counts))
        assert 1 <= counts[0] <= max(1, np.ceil(0.01 * n))
        assert counts[-1] == n
        ratios = [b / a for a, b in pairwise(counts) if a >= 100]
        assert all(ratio <= 10 ** (1 / per_decade) * 1.02 for ratio in ratios)


class Counted:
    """Counts the plans whose objectives are computed, whoever asks for them."""

    def __init__(self, monkeypatch):
        self.n = 0
        usual = Mission.evaluate

        def evaluate(mission, plans):
            self.n += len(plans)
            return usual(mission, plans)

        monkeypatch.setattr(Mission, "evaluate", evaluate)

    def calls_of(self, appraise):
        def watched(*arguments):
            self.n += 1
            return appraise(*arguments)

        return watched

    def check(self, name, budget, **options):
        """Perform a run, which may not evaluate more than its budget."""
        self.n = 0
        outcome, records = performed(make_task(name, evaluations=budget, **options))
        assert outcome.status == "done", outcome.error
        assert self.n == outcome.evaluations == records[-1].evaluations <= budget
        if name not in ENDS_BY_ITSELF:
            assert (outcome.evaluations, outcome.stopped_by) == (budget, "evaluations")


# These compute objectives within their kernels, plan by plan; and exact refuses the museum.
IN_KERNELS = {"exact", "pareto-local-search", "simulated-annealing"}
WATCHED = [name for name in NAMES if name not in IN_KERNELS]


class TestBudgets:
    @pytest.mark.slow
    @pytest.mark.parametrize("name", [*WATCHED, DOTTED[1], SAMPLER])
    def test_nobody_is_given_more(self, monkeypatch, name):
        counted = Counted(monkeypatch)
        for budget in (1, 97, 209):
            counted.check(name, budget)

    @pytest.mark.slow
    def test_nor_is_annealing_which_evaluates_in_its_kernel(self):
        # As plain Python, where somebody can watch the kernel.
        code = """if True:
            from pytest import MonkeyPatch
            from botohe_moo.algorithms.annealing import kernels
            from tests.study.test_perform import Counted

            counted = Counted(MonkeyPatch())
            kernels._evaluate = counted.calls_of(kernels._evaluate)
            for name in ("simulated-annealing", "botohe_moo:SimulatedAnnealing.journal"):
                for budget in (1, 97, 131):
                    counted.check(name, budget, mission="toy")
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
                counted.check("pareto-local-search", budget)

    def test_spending_more_is_a_failure(self):
        for what in ("self.sample(90)", "self.problem.evaluate_batch(self.draw(90))"):
            outcome, _ = performed(doing(what, evaluations=100))
            assert (outcome.status, outcome.records) == ("failed", ())
            assert "plans of the 100 allowed" in outcome.error

    def test_what_copies_of_the_problem_evaluate_counts(self):
        outcome, records = performed(make_task(f"{MADE}:Copying", evaluations=200))
        assert (outcome.status, outcome.evaluations) == ("done", 200)
        assert records[-1].evaluations == 200

    def test_compiling_is_not_the_own_time_of_any_algorithm(self):
        began = time.perf_counter()
        compiling = "with event.trigger_event('numba:compiler_lock'): time.sleep(0.3)"
        outcome, _ = performed(doing(compiling, evaluations=60))
        assert outcome.seconds <= time.perf_counter() - began - 2 * 0.3

    def test_seconds_end_a_run_at_the_end_of_an_iteration(self):
        outcome, _ = performed(doing("time.sleep(0.02)", evaluations=None, budget={"seconds": 0.2}))
        assert (outcome.status, outcome.stopped_by) == ("done", "seconds")
        assert outcome.seconds >= 0.2
        assert outcome.evaluations % 20 == 0


class TestMeter:
    def test_it_archives_what_the_budget_allows(self):
        mission = load_mission("toy")
        meter = Meter(25, PlanArchive(mission.robots))
        problem = metered(BOTOHE(mission, min_survival=0.5), meter)
        found = minimize(BOTOHE(mission), make_algorithm("random", n_ants=40), ("n_gen", 1), seed=1)
        batch = mission.batch(found.algorithm.archive.plans)
        batch = batch.take(np.arange(40) % len(batch))
        problem.evaluate_batch(batch[:20])
        for more in (batch[20:], batch[:1]):
            with pytest.raises(BudgetSpentError):
                problem.evaluate_batch(more)
            assert meter.spent == 25
        assert (mission.robot_survival(meter.archive.plans) >= 0.5 * (1 - 1e-12)).all()

    def test_it_is_the_problem_for_algorithms(self):
        inner = Weakest(load_mission("toy"), min_survival=0.25)
        problem = metered(inner, Meter(5))
        assert isinstance(problem, BOTOHE)
        for name in ("n_obj", "n_ieq_constr", "min_survival", "objectives", "max_length"):
            assert getattr(problem, name) == getattr(inner, name)
        assert (problem.name(), problem.advice()) == (inner.name(), inner.advice())
        other = copy.deepcopy(problem).allowing_invalid()
        assert other.n_ieq_constr == inner.n_ieq_constr + 1
        plans = inner.mission.batch([inner.mission.plan([[1], [1]])])
        assert other.evaluate_batch(plans).tolist() == inner.evaluate_batch(plans).tolist()
        assert other.constrain_batch(plans).shape == (1, 2)
        assert problem.meter.spent == 1


class TestRecords:
    @pytest.mark.parametrize("name", ["bo-aco", SAMPLER])
    def test_a_smaller_budget_can_be_read_off(self, name):
        outcome, records = performed(make_task(name, evaluations=2_000))
        counts = [record.evaluations for record in records]
        assert counts == sorted(counts)
        assert counts[0] <= 200  # the first generation, where 1 % is less
        steps = np.diff(np.unique(counts))
        assert (steps <= np.maximum(100, 0.15 * np.array(sorted(set(counts))[1:])) + 100).all()
        last = records[-1]
        plans, objectives = last.plans
        assert np.allclose(load_mission("art_museum").evaluate(plans), objectives, rtol=1e-9)
        assert len(plans) == last.front_size + last.ties
        assert {tuple(p) for p in objectives} == {tuple(p) for p in last.objectives}
        assert (np.diff(last.objectives[:, 0]) < 0).all()
        assert outcome.recording_seconds > 0

    def test_recording_does_not_change_the_run(self):
        _, records = performed(make_task("nsga2", evaluations=777))
        problem = BOTOHE(load_mission("art_museum"))
        result = minimize(problem, make_algorithm("nsga2"), ("n_eval", 777), seed=1)
        assert {tuple(p) for p in -result.F} == {tuple(p) for p in records[-1].objectives}

    def test_times_leave_recording_out(self, monkeypatch):
        usual = PlanArchive.plans.fget

        def slow(archive):
            time.sleep(0.05)
            return usual(archive)

        monkeypatch.setattr(PlanArchive, "plans", property(slow))
        # With a budget of seconds, plans are kept each time.
        outcome, records = performed(make_task("random", budget={"seconds": 1_000}))
        assert len(records) >= 5
        assert outcome.recording_seconds >= 0.05 * len(records)
        assert records[-1].seconds <= outcome.seconds < 0.05 * len(records)

    def test_points_and_ties_are_counted(self):
        toy, archive, records = load_mission("toy"), PlanArchive(2), []
        there = [[[1], [1]], [[1, 2, 4, 2, 1], [1]], [[1, 2, 4, 3, 1], [1]]]
        plans = toy.batch([toy.plan(trails) for trails in there])
        archive.insert(plans, np.array([(0, 2), (4, 1), (4, 1)], float))
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


CHANGING = """if True:
    rewards = self.problem.mission.world.team.worth
    rewards.setflags(write=True)
    rewards *= 10
    rewards.setflags(write=False)  # or kernels would be compiled for another type
"""
OVERSTATING = f"""if True:
    if self.evaluator.n_eval > 20: {FOR_EVER}
    front = self.archive.front
    self.archive._front = front._replace(objectives=front.objectives * 1.5)
"""
SECOND = "if self is not SEEN.setdefault('run', self): raise RuntimeError('somebody was here')"


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
            "pass": None,
            "print('last words', flush=True); os.abort()": "its process died (signal SIGABRT)",
            "os.fork() or time.sleep(3600); os._exit(3)": "its process died (exit status 3)",
            "raise SystemExit(0)": "SystemExit: 0",
            "input('How many? ')": "EOFError: EOF when reading a line",
            CHANGING: "claimed to bring",
            "print('to whomever', flush=True); os.write(1, b'more of it')": None,
        }
        tasks = [doing(what, evaluations=100, digest=what) for what in expected]
        found = {task.digest: outcome for task, outcome in pool.perform(tasks, workers=2)}
        for what, error in expected.items():
            assert found[what].status == ("failed" if error else "done"), what
            assert error is None or error in found[what].error
            assert (found[what].records == ()) == (error is not None)
        assert "last words" in {outcome.traceback for outcome in found.values()}

    def test_killed_processes_fail_their_own_runs_only(self, processes_there):
        """At random moments, also in the middle of messages."""
        rng = random.Random(1)
        tasks = [
            make_task("random", evaluations=8_000, at=range(100, 8_000, 50), digest=str(i))
            for i in range(8)
        ]
        killed, noted = [], [0]

        def note(run, _):
            noted[0] += 1
            if len(killed) < 3 and noted[0] % 150 == 0:
                process = rng.choice(processes_there())
                process.kill()
                killed.append(process.pid)

        with contextlib.closing(WorkerPool()) as pool:
            found = [outcome for _, outcome in pool.perform(tasks, workers=2, note=note)]
        assert len(found) == 8
        errors = [outcome.error for outcome in found if outcome.status == "failed"]
        assert 1 <= len(errors) <= len(killed) == 3
        assert set(errors) == {"its process died (signal SIGKILL)"}
        done = [o.records[-1].objectives.tolist() for o in found if o.status == "done"]
        assert len(done) == 8 - len(errors)
        assert all(front == done[0] for front in done)

    def test_what_does_not_end_in_its_seconds_is_killed_and_its_front_counts(self, pool):
        budget = {"seconds": 0.3, "grace_seconds": 0.2}
        outcome = outcome_of(pool, doing("while True: pass", budget=budget))
        assert (outcome.status, outcome.stopped_by) == ("timeout", "limit")
        assert "killed: 0.2 s after its 0.3 s were up" in outcome.error
        assert outcome.evaluations == 20
        assert outcome.began is not None
        assert len(outcome.records[-1].plans[0]) == outcome.records[-1].front_size

    def test_claims_of_killed_runs_are_not_taken_on_trust(self, pool):
        outcome = outcome_of(pool, doing(OVERSTATING, budget={"seconds": 0.3}))
        assert (outcome.status, outcome.records) == ("failed", ())
        assert "claimed to bring" in outcome.error

    def test_the_clock_stands_still_while_kernels_are_compiled(self, pool):
        """Compiling takes 2 seconds here, and a run is killed after 1.5."""
        budget = {"evaluations": 40, "seconds": 1.0, "grace_seconds": 0.5}
        what = "with event.trigger_event('numba:compiler_lock'): time.sleep(2)"
        outcome = outcome_of(pool, doing(what, budget=budget))
        assert (outcome.status, outcome.stopped_by) == ("done", "evaluations")

    def test_what_evaluates_nothing_any_more_is_killed_without_seconds_too(self, pool):
        outcome = outcome_of(pool, doing(FOR_EVER, patience=0.5))
        assert (outcome.status, outcome.stopped_by) == ("failed", "error")
        assert outcome.error.startswith("killed: it had evaluated no plan for 0.5 s")
        assert outcome.records == ()

    def test_what_goes_on_evaluating_is_waited_for(self, pool):
        """However long it takes, within one iteration or many; as are this package's algorithms."""
        for what in ("time.sleep(0.2)", "while self.n_left: time.sleep(0.2); self.sample(10)"):
            outcome = outcome_of(pool, doing(what, n=10, evaluations=70, patience=1.0))
            assert (outcome.status, outcome.evaluations) == ("done", 70)
            assert outcome.seconds > 1.0
        ours = make_task("bo-aco", evaluations=5_000, patience=1e-3)
        assert outcome_of(pool, ours).status == "done"

    def test_no_process_is_left_behind(self, processes_there):
        """Not after a run is killed, not after it dies, and not after the pool is stopped."""
        what, budget = f"os.fork(); {FOR_EVER}", {"seconds": 0.3}
        assert outcome_of(WorkerPool(), doing(what, budget=budget)).status == "timeout"
        dying = "os.fork() or time.sleep(3600); os._exit(3)"
        assert outcome_of(WorkerPool(), doing(dying)).error.endswith("(exit status 3)")
        began = time.monotonic()
        stopped = lambda: time.monotonic() - began > 0.5  # noqa: E731
        tasks = [doing(FOR_EVER)] * 3
        assert list(WorkerPool().perform(tasks, workers=2, stopped=stopped)) == []
        time.sleep(0.1)
        assert processes_there() == []

    def test_runs_of_other_peoples_algorithms_know_nothing_of_each_other(self, pool):
        """And generators that everybody shares begin with the seed."""
        assert [outcome_of(pool, doing(SECOND)).status for _ in range(2)] == ["done", "done"]
        drawing = "raise RuntimeError(f'{random.random()} {np.random.random()}')"
        one, again, other = (outcome_of(pool, doing(drawing, seed=s)).error for s in (1, 1, 2))
        assert one == again != other

    def test_other_code_is_refused(self, pool):
        task = make_task("random")
        for change in ({"botohe-moo": "99.0"}, {"package": "other"}):
            algorithm = replace(task.algorithm, origin={**task.algorithm.origin, **change})
            outcome = outcome_of(pool, replace(task, algorithm=algorithm))
            assert outcome.status == "failed"
            assert f"the study from {algorithm.origin}" in outcome.error


def test_limits_of_the_final_front_are_checked_whatever_the_algorithm_says():
    toy = load_mission("toy")
    plans = toy.batch([toy.plan(p) for p in ([[1], [1]], [[1, 3, 1], [1, 2, 4, 5, 4, 2, 1]])])

    def check(plans, **limits):
        verify(
            make_task("random", mission={"mission": "toy", **limits}), plans, toy.evaluate(plans)
        )

    check(plans, min_survival=0.34, max_length=6.0)
    check(toy.batch([]), min_survival=1.0)
    with pytest.raises(ValueError, match=r"survival of at least 0\.5 in .*, got 0\.34"):
        check(plans, min_survival=0.5)
    with pytest.raises(ValueError, match=r"length of at most 5\.5 in .*, got 6\."):
        check(plans, max_length=5.5)
