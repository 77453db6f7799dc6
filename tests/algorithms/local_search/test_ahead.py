"""Kernels that two processes compile before the first search."""

import os
import signal
import subprocess
import sys
from multiprocessing.context import SpawnProcess

import pytest

from botohe_moo import load_mission
from botohe_moo.algorithms.local_search import ahead


@pytest.fixture
def started(monkeypatch):
    """The processes that were started, as if nothing was compiled and there were two processors."""
    found, start = [], SpawnProcess.start

    def recorded(process):
        start(process)
        found.append(process)

    monkeypatch.setattr(SpawnProcess, "start", recorded)
    monkeypatch.setattr(ahead, "n_cpus", lambda: 2)
    monkeypatch.setattr(ahead, "is_kept", lambda _: False)
    return found


@pytest.mark.parametrize("name", ["toy", "drones_and_rovers", "art_museum_return"])
def test_both_processes_come_to_an_end(started, name):
    mission, handler = load_mission(name), signal.getsignal(signal.SIGINT)
    ahead.compile_ahead(mission, mission.limited())
    assert [process.exitcode for process in started] == [0]
    assert signal.getsignal(signal.SIGINT) is handler


def test_the_other_process_ends_when_this_one_is_interrupted(started, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(ahead, "recreate", interrupt)
    mission = load_mission("toy")
    with pytest.raises(KeyboardInterrupt):
        ahead.compile_ahead(mission, mission.world)
    [process] = started
    process.join()
    assert process.exitcode == -signal.SIGKILL


def test_nothing_is_started_with_one_processor(started, monkeypatch):
    monkeypatch.setattr(ahead, "n_cpus", lambda: 1)
    mission = load_mission("toy")
    ahead.compile_ahead(mission, mission.world)
    assert started == []


def test_nothing_is_started_when_all_is_compiled(started, monkeypatch):
    monkeypatch.setattr(ahead, "is_kept", lambda _: True)
    mission = load_mission("toy")
    ahead.compile_ahead(mission, mission.world)
    assert started == []


SEARCH = """
from botohe_moo import load_mission, solve
from botohe_moo.algorithms.local_search import ahead
from botohe_moo.algorithms.local_search.kernels.recreate import recreate
from botohe_moo.algorithms.local_search.kernels.routes import _search_all
from botohe_moo.algorithms.local_search.kernels.search import improve

if __name__ == "__main__":
    ahead.n_cpus = lambda: 2  # also where there is one
    mission = load_mission("art_museum")
    assert not ahead.is_kept(improve)
    ahead.compile_ahead(mission, mission.limited())
    assert ahead.is_kept(improve)
    solve(mission, evaluations=30_000, n_islands=2, n_threads=1)
    assert sum(improve.stats.cache_misses.values()) == 0
    assert sum(improve.stats.cache_hits.values()) == 1
    for kernel in (improve, recreate, _search_all):  # what was compiled ahead is what is called
        assert len(kernel.signatures) == 1, kernel
"""


@pytest.mark.slow
def test_the_search_loads_what_the_other_process_compiled(tmp_path):
    script = tmp_path / "search.py"
    script.write_text(SEARCH)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    subprocess.run([sys.executable, script], env=environment, check=True)
