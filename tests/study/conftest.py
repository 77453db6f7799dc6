"""Fixtures that tests of studies share."""

import functools
import os
import subprocess
import time
from dataclasses import replace
from unittest import mock

import pytest

from botohe_moo.study import pool, runner
from botohe_moo.study.perform import perform
from botohe_moo.study.pool import add_record, checked_outcome
from botohe_moo.study.task import THREAD_SETTINGS, BoundTask, environment
from botohe_moo.study.worker import perform_bound
from tests.forked import ForkedSubprocess


@functools.cache
def environment_there():
    """The environment of a worker, which has one thread."""
    with mock.patch.dict(os.environ, {name: os.environ.get(name, "1") for name in THREAD_SETTINGS}):
        return environment.__wrapped__()


class InProcess:
    """Performs tasks in this process, as a WorkerPool does in others."""

    def perform(self, tasks, *, workers, stopped, note=None):
        for task in tasks:
            if stopped():
                return
            do = self.bound if isinstance(task, BoundTask) else self.run
            yield task, do(task, note)

    def run(self, task, note):
        records, began = [], time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())

        def send(record):
            add_record(records, record)
            note(task, record)

        outcome = checked_outcome(task.run, perform(task.run, send), records)
        return replace(outcome, environment=environment_there(), began=began)

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
