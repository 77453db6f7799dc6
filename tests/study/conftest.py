"""Fixtures that tests of studies share."""

import subprocess
import time
from dataclasses import replace
from unittest import mock

import pytest

from botohe_moo.study import pool, runner
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
