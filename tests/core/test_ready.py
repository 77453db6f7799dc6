"""Kernels that run as plain Python until they are compiled, here or by another process."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest

from botohe_moo.core import compile as ready
from botohe_moo.core.compile import at_once, begin_run, kernels, prepare, remaining

pytestmark = pytest.mark.compiled_only


class Process:
    """A process that runs, but never compiles anything; what is written to it is kept."""

    def __init__(self):
        self.running, self.stdin = True, io.BytesIO()

    def poll(self):
        return None if self.running else 0


@pytest.fixture
def elsewhere(monkeypatch):
    """The process that compiles, started when it is needed; nothing is on disk."""
    process = Process()
    process.started = []
    monkeypatch.setattr(ready, "_elsewhere", ready._Elsewhere())
    monkeypatch.setattr(ready, "_start", lambda: process.started.append(1) or process)
    monkeypatch.setattr(ready, "n_cpus", lambda: 2)
    monkeypatch.setattr(ready, "can_keep", lambda _: True)
    monkeypatch.setattr(ready, "is_kept", lambda *_: False)
    return process


def simple(seconds=0.001, spent=None):
    """A kernel that doubles; Python is said to take so many seconds for it, and spent some."""

    @at_once(lambda _: seconds)
    def double(x):
        return 2 * x

    if spent is not None:
        double._run, double._spent = ready._Run.number, spent
    return double


def n_compiled(*kernels):
    return sum(len(kernel.compiled.overloads) for kernel in kernels)


def n_tasks(elsewhere):
    """Return how many kernels were sent to the other process."""
    return elsewhere.stdin.getvalue().count(b"simple.<locals>.double")


class TestRule:
    @pytest.mark.parametrize(("seconds", "is_compiled"), [(0.001, False), (100.0, True)])
    def test_a_long_call_is_compiled_at_once_and_short_ones_are_interpreted(
        self, elsewhere, seconds, is_compiled
    ):
        double = simple(seconds)
        assert [double(i) for i in range(5)] == [0, 2, 4, 6, 8]
        assert n_compiled(double) == is_compiled
        assert elsewhere.started == []

    def test_a_long_call_waits_for_a_process_that_has_begun(self, elsewhere, monkeypatch):
        def sleep(_):
            elsewhere.running = False  # it fails

        monkeypatch.setattr(ready.time, "sleep", sleep)
        double = simple(100.0)
        prepare(double, 3)
        assert n_tasks(elsewhere) == 1
        assert double(3) == 6
        assert not elsewhere.running
        assert n_compiled(double) == 1

    def test_with_one_processor_it_is_compiled_here(self, elsewhere, monkeypatch):
        monkeypatch.setattr(ready, "n_cpus", lambda: 1)
        double = simple(spent=1.0)
        with remaining(1_000.0):
            assert double(3) == 6
        assert n_compiled(double) == 1
        assert elsewhere.started == []

    def test_python_goes_on_while_the_other_process_compiles(self, elsewhere):
        double, other = simple(spent=1.0), simple(spent=1.0)
        with remaining(2.0):
            double(0)
        assert elsewhere.started == []  # what the rest of the run would take decides
        with remaining(1_000.0):
            assert [double(1), double(2)] == [2, 4]
            assert n_compiled(double) == 0
            assert other(0.5) == 1.0
            assert n_compiled(other) == 1  # the other process has no time for it
            assert n_tasks(elsewhere) == 1
            elsewhere.running = False
            assert double(3) == 6
        assert n_compiled(double) == 1
        assert len(elsewhere.started) == 1  # it is not tried again

    def test_it_begins_to_be_compiled_before_it_is_called(self, elsewhere):
        double = simple()
        for kernel in (double, double, simple()):
            prepare(kernel, 1)
        assert n_tasks(elsewhere) == 1  # one at a time
        assert double(1) == 2
        assert n_compiled(double) == 0

    def test_what_took_long_is_compiled_for_later_runs_if_anything_is(self, elsewhere):
        double = simple(spent=1.0)
        double(1)
        assert elsewhere.started == []
        prepare(simple(), 0.5)
        for _ in range(3):
            double(1)
        assert n_tasks(elsewhere) == 2

    def test_modes(self, elsewhere):
        long, short = simple(100.0), simple(0.0)
        with kernels("interpreted"):
            long(1)
        with kernels("compiled"):
            short(1)
            prepare(simple(0.0), 1)
        assert (n_compiled(long), n_compiled(short)) == (0, 1)
        assert elsewhere.started == []
        begin_run()
        assert short(0.5) == 1.0  # other types are another matter
        assert n_compiled(short) == 1


def test_warnings_of_numpy_are_none_of_kernels():
    @at_once(lambda _: 0.0)
    def invert(x):
        return 1.0 / x

    with np.errstate(all="raise"):
        assert invert(np.float64(0.0)) == np.inf


COLD = """
import sys
from botohe_moo import load_mission, solve
from botohe_moo.algorithms.local_search.kernels.search import improve
from botohe_moo.core import compile

compile.n_cpus = lambda: int(sys.argv[1])
found = solve("toy", evaluations=int(sys.argv[2]), seed=1)
stats = improve.compiled.stats
misses, hits = sum(stats.cache_misses.values()), sum(stats.cache_hits.values())
print(misses, hits, found.objectives.tobytes().hex())
"""


def begin(folder, n_cpus, n_evaluations):
    """Begin to solve with machine code in a folder."""
    command = [sys.executable, "-c", COLD, str(n_cpus), str(n_evaluations)]
    env = {**os.environ, "NUMBA_CACHE_DIR": str(folder)}
    return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)


def end(process):
    """Wait for the end; how often `improve` was compiled and loaded, and the front."""
    misses, hits, front = process.communicate()[0].split()
    return int(misses), int(hits), front


@pytest.mark.slow
def test_the_other_process_compiles_what_this_one_loads(tmp_path):
    alone, both = tmp_path / "alone", tmp_path / "both"
    misses, hits, front = end(begin(alone, 2, 200_000))
    assert (misses, hits) == (0, 1)
    assert end(begin(alone, 2, 200_000)) == (0, 1, front)  # from disk
    # Two at once compile into one folder.
    processes = [begin(both, n_cpus, 200_000) for n_cpus in (1, 2)]
    assert [end(process)[2] for process in processes] == [front, front]
    assert end(begin(both, 1, 200_000)) == (0, 1, front)


def test_a_short_run_compiles_nothing(tmp_path):
    assert end(begin(tmp_path, 2, 100))[:2] == (0, 0)
    assert not list(tmp_path.rglob("*.nbi"))
