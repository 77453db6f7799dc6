"""Fixtures that tests of studies share."""

import functools
import os
import subprocess
import time
from unittest import mock

import pytest

from botohe_moo.study.run import pool, sandbox
from botohe_moo.study.run.bound import find_bound
from botohe_moo.study.run.environment import THREAD_SETTINGS, environment
from botohe_moo.study.run.perform import perform
from botohe_moo.study.run.sandbox import _RunState
from tests.forked import ForkedSubprocess


@functools.cache
def environment_there():
    """The environment of a sandbox's process, which has one thread."""
    with mock.patch.dict(os.environ, {name: os.environ.get(name, "1") for name in THREAD_SETTINGS}):
        return environment.__wrapped__()


class InProcess:
    """Performs runs in this process, as a sandbox does in one of its own."""

    def perform(self, task, *, stopped, note):
        began = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        state = _RunState(task, environment_there(), deadline=0.0, began=began)

        def send(record):
            state.note(record)
            note(record)

        return state.ended(perform(task, send))

    def bound(self, task, *, stopped):
        return find_bound(task)

    def close(self):
        pass


@pytest.fixture
def in_process(monkeypatch):
    """No processes for runs, each of which takes a second to start.

    For tests of what becomes of runs; fixtures of a module come first, and have real ones.
    """
    monkeypatch.setattr(pool, "Sandbox", InProcess)


@pytest.fixture(scope="module", autouse=True)
def forked_runs():
    """Fork the processes of runs from one that has loaded all that they need."""
    with mock.patch.object(sandbox, "subprocess", ForkedSubprocess):
        yield


@pytest.fixture
def new_interpreters(monkeypatch):
    """Start the processes of runs as users do."""
    monkeypatch.setattr(sandbox, "subprocess", subprocess)
