"""Fixtures that tests of studies share."""

import subprocess
import time
from dataclasses import replace
from unittest import mock

import matplotlib as mpl
import matplotlib.pyplot as plt
import psutil
import pytest

from botohe_moo.study import pool, report, runner
from botohe_moo.study.perform import perform
from botohe_moo.study.pool import BoundTask, checked_outcome, environment, perform_bound
from tests.forked import ForkedSubprocess


class InProcess:
    """Performs tasks in this process, as a WorkerPool does in others."""

    def perform(self, tasks, *, workers, stopped, note=None):
        for task in tasks:
            if stopped():
                return
            do = self.bound if isinstance(task, BoundTask) else self.run
            yield task, do(task, note)

    def run(self, run, note):
        records, began = {}, time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())

        def send(record):
            records[record.evaluations] = record
            note(run, record)

        outcome = checked_outcome(run, perform(run, send), [*records.values()])
        return replace(outcome, environment=environment(), began=began)

    def bound(self, task, _):
        return perform_bound(task)

    def close(self):
        pass


@pytest.fixture(scope="module")
def in_process():
    """No processes for runs, each of which takes a second to start."""
    with mock.patch.object(runner, "WorkerPool", InProcess):
        yield


@pytest.fixture(scope="module", autouse=True)
def forked_runs():
    """Fork the processes of runs from one that has loaded all that they need."""
    with mock.patch.object(pool, "subprocess", ForkedSubprocess):
        yield


@pytest.fixture
def new_interpreters(monkeypatch):
    """Start the processes of runs as users do."""
    monkeypatch.setattr(pool, "subprocess", subprocess)


@pytest.fixture
def processes_there(new_interpreters, monkeypatch, tmp_path):
    """Gives a function that lists the processes of runs that the test has started."""
    monkeypatch.setenv("BOTOHE_TEST_FOLDER", str(tmp_path))

    def found():
        listed = psutil.process_iter(["cmdline", "environ"])
        there = [(of, of.info["cmdline"] or [], of.info["environ"] or {}) for of in listed]
        return [
            process
            for process, command, variables in there
            if pool._WORK in command and variables.get("BOTOHE_TEST_FOLDER") == str(tmp_path)
        ]

    return found


@pytest.fixture(scope="module")
def sketched():
    """Make figures, but write files that are no pictures: drawing takes many seconds."""

    def save_plot(ax, *paths):
        for path in paths:
            path.write_bytes(b"\x89PNG")
        plt.close(ax.figure.figure)

    mpl.use("Agg")
    with (
        mock.patch.object(report, "save_plot", save_plot),
        mock.patch.object(report, "FORMATS", ("png",)),
    ):
        yield
