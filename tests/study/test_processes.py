"""Studies as real processes: killed, stopped, two at a time, at a terminal, on a cluster."""

import contextlib
import fcntl
import json
import os
import pty
import random
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path
from unittest import mock

import pytest

from botohe_moo.study import StudyError, make_tables, pool, read_study, run_study
from tests.forked import Forked, run_forked
from tests.study.made import MADE, Watcher, assert_same, study_of

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]

STUDY = """
name: trial
missions: [toy, art_museum]
algorithms:
  NSGA-II: {algorithm: nsga2, parameters: {pop_size: 20}}
  few: {algorithm: random, parameters: {n_ants: 20}}
  random: random
budget: {evaluations: 1_000}
seeds: 4
comparison: {control: random}
"""

SMALL = study_of(algorithms=["random"], budget={"evaluations": 40})


def start(*arguments, popen=Forked, **options):
    """Start ``botohe study`` from the folder that has the tests' algorithms.

    With ``subprocess.Popen`` it is started as a user would, and loads everything anew.
    """
    return popen(
        [sys.executable, "-m", "botohe_moo.cli", "study", *map(str, arguments)],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )


def finish(process, timeout=120):
    out, err = process.communicate(timeout=timeout)
    return process.returncode, out, err


@pytest.fixture(autouse=True)
def interruptible():
    """Let Ctrl-C reach the processes that tests start, even if the tests are run without it."""
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, usual)


@pytest.fixture(autouse=True)
def environment_as_it_was():
    """Take back what Dask puts into the environment of its workers, which comes from this one."""
    with mock.patch.dict(os.environ):
        yield


@pytest.fixture(scope="module")
def study_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("file") / "study.yaml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="module")
def uninterrupted(study_file, tmp_path_factory):
    return run_study(study_file, tmp_path_factory.mktemp("one"))


def wait_until(condition, timeout=60):
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def n_done(folder):
    return len(list(folder.glob("runs/*.npz")))


def test_five_kills_at_random_moments_change_nothing(
    study_file, uninterrupted, processes_there, tmp_path
):
    folder = tmp_path / "killed"
    rng = random.Random(5)
    counts = []
    for i in range(5):
        command = ("run", study_file, "--out", folder, "--workers", 2)
        # The last with processes whose environment can be looked at.
        process = start(*command, popen=subprocess.Popen if i == 4 else Forked)
        # Past the start, so that some of the kills meet runs and files; never waits for the end.
        aim = n_done(folder) + rng.randint(0, 3)
        wait_until(
            lambda aim=aim, process=process: n_done(folder) >= aim or process.poll() is not None
        )
        time.sleep(rng.random() * 0.1)
        process.kill()
        process.communicate()
        counts.append(n_done(folder))
    assert counts == sorted(counts)  # what is done stays done
    assert counts[0] < 24  # it was at work
    wait_until(lambda: not processes_there(), timeout=20)  # nobody works for a dead runner
    partial = make_tables(folder)
    assert (len(partial.runs), partial.missing["missing"].sum()) == (counts[-1], 24 - counts[-1])
    status, _, err = finish(start("run", study_file, "--out", folder, "--workers", 2))
    assert status == 0, err
    assert f"{counts[-1]} are there" in err
    assert_same(read_study(folder), uninterrupted)
    assert not list(folder.rglob("*.tmp"))


def test_a_signal_stops_it_cleanly_and_what_is_done_is_kept(
    study_file, uninterrupted, processes_there, tmp_path
):
    folder = tmp_path / "stopped"
    command = ("run", study_file, "--out", folder, "--workers", 1)
    process = start(*command, popen=subprocess.Popen)
    wait_until(lambda: n_done(folder) >= 2)
    os.kill(process.pid, signal.SIGTERM)
    status, _, err = finish(process)
    assert status == 128 + signal.SIGTERM, err
    assert "stopped; what is done is in" in err
    assert "Traceback" not in err
    assert not processes_there()
    partial = read_study(folder)
    assert 2 <= len(partial.runs) == n_done(folder) < 24
    assert set(partial.runs["status"]) == {"done"}
    assert partial.missing["missing"].sum() == 24 - len(partial.runs)


def test_a_terminal_that_is_closed(study_file, tmp_path):
    """The hang-up stops the study, though there is nobody any more to tell."""
    folder, shown = tmp_path / "out", b""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 120, 0, 0))
    process = Forked(
        [sys.executable, "-m", "botohe_moo.cli", "study", "run", study_file, "--out", folder],
        cwd=ROOT,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "120"},
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    )
    os.close(theirs)
    while process.poll() is None and not n_done(folder):
        if select.select([ours], [], [], 0.05)[0]:
            shown += os.read(ours, 65536)
    os.close(ours)
    assert b" of 24 runs" in shown  # on a bar
    with contextlib.suppress(ProcessLookupError):
        process.send_signal(signal.SIGHUP)
    assert process.wait(60) == 129
    assert 1 <= len(read_study(folder).runs) <= 24


@pytest.mark.skipif(sys.platform != "linux", reason="threads are counted in /proc")
def test_no_thread_is_left_that_may_outlive_python(tmp_path):
    """Arrow's threads abort the interpreter now and then where they do."""
    code = f"""if True:
        import os
        from botohe_moo.study import read_study, run_study
        run_study({SMALL | {"seeds": 1}}, "out")
        read_study("out")
        print(len(os.listdir("/proc/self/task")))
    """
    done = run_forked([sys.executable, "-c", code], cwd=tmp_path)
    assert done.stdout == "1\n", done.stderr


def test_two_workers_work_at_the_same_time(tmp_path):
    # Runs that sleep: at the same time they overlap, whatever else the machine does.
    source = study_of(
        algorithms={"slow": {"algorithm": f"{MADE}:Slow", "parameters": {"seconds": 0.2}}},
        budget={"evaluations": 40, "seconds": 60},  # each record is sent at once
    )

    class Overlap(Watcher):
        def __init__(self):
            super().__init__()
            self.times = {}

        def record(self, run, record):
            self.times.setdefault(run.digest, []).append(time.monotonic())

        def most(self):
            """Most runs that were at work at one moment."""
            spans = [(min(times), max(times)) for times in self.times.values()]
            return max(sum(a <= moment <= b for a, b in spans) for moment, _ in spans)

    two = Overlap()
    run_study(source, tmp_path, workers=2, progress=two)
    assert two.most() == 2


@pytest.fixture
def scheduler(tmp_path):
    """A Dask scheduler without workers; gives its address."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=0, dashboard_address=None, local_directory=tmp_path / "dask"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def hire(scheduler, tmp_path):
    """Starts Dask workers as processes: by default one that has all a worker needs."""
    hired = []

    def start_worker(*flags, path=()):
        name = f"w{len(hired)}"
        folders = (*path, ROOT) if "-S" in flags else (*path, ROOT, ROOT / "src")
        popen = subprocess.Popen if flags or path else Forked
        begin = "import sys; sys.path[:] = [p for p in sys.path if p] + eval(sys.argv.pop()); "
        work = "from distributed.cli.dask_worker import main; main()"
        hired.append(
            popen(
                [
                    sys.executable, *flags, "-c", begin + work, scheduler, "--no-nanny",
                    "--no-dashboard", "--nthreads", "1", "--name", name,
                    "--local-directory", str(tmp_path / name), repr([str(p) for p in path]),
                ],
                cwd=tmp_path,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))},
            )
        )  # fmt: skip
        return hired[-1]

    yield start_worker
    for worker in hired:
        worker.kill()
        worker.wait()


def lines_until(process, wanted):
    """Read what a process says until it says that; it is killed if it does not."""
    said = []
    with contextlib.suppress(StopIteration):
        while wanted not in "".join(said):
            said.append(next(process.stderr))
    return "".join(said)


def wait_for_workers(scheduler, n):
    import distributed

    with distributed.Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(n, timeout=60)


def test_a_worker_that_lacks_the_package_is_named(scheduler, hire, tmp_path):
    import distributed

    # Without site, what is installed for editing is not found.
    hire("-S", path=[Path(distributed.__file__).parents[1]])
    wait_for_workers(scheduler, 1)
    (tmp_path / "s.json").write_text(json.dumps(SMALL))
    folder = tmp_path / "out"
    process = start("run", tmp_path / "s.json", "--out", folder, "--dask", scheduler)
    status, _, err = finish(process)
    assert status == 1, err
    assert re.search(r"tcp://\S+ cannot perform runs: .*ModuleNotFoundError", err)
    assert "No module named 'botohe_moo" in err.replace("\\", "")
    assert "Traceback" not in err


def test_killed_dask_workers_change_nothing(study_file, uninterrupted, scheduler, hire, tmp_path):
    """Five are killed while they perform runs; others are hired, at times when none is left."""
    rng = random.Random(3)
    workers, aims = [hire(), hire()], sorted(rng.sample(range(1, 20), 5))

    class Killing(Watcher):
        def end(self, run, outcome):
            super().end(run, outcome)
            if aims and len(self.performed) >= aims[0]:
                aims.pop(0)
                workers.pop(rng.randrange(2)).kill()
                if len(aims) == 2:
                    workers.pop().kill()
                    workers.append(hire())
                workers.append(hire())

    watcher = Killing()
    tables = run_study(study_file, tmp_path / "out", dask=scheduler, progress=watcher)
    assert aims == []
    assert len(watcher.performed) == 24
    assert_same(tables, uninterrupted)


def test_waiting_for_workers_can_be_stopped(study_file, scheduler, tmp_path):
    process = start("run", study_file, "--out", tmp_path / "out", "--dask", scheduler)
    lines_until(process, "waiting for one")
    os.kill(process.pid, signal.SIGINT)
    status, _, err = finish(process)
    assert status == 130, err
    assert "Traceback" not in err


def test_no_scheduler_at_the_address(study_file, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "_SECONDS_TO_CONNECT", 0.5)
    with pytest.raises(StudyError, match=r"No Dask scheduler answers at 'tcp://127\.0\.0\.1:1'"):
        run_study(study_file, tmp_path, dask="tcp://127.0.0.1:1")
    for address in ("localhost", "tcp://127.0.0.1:99999"):
        with pytest.raises(StudyError, match=f"No Dask scheduler answers at '{address}'"):
            run_study(study_file, tmp_path, dask=address)


def test_a_cluster_that_goes_away(study_file, tmp_path):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        dashboard_address=None,
        local_directory=tmp_path / "dask",
        protocol="tcp",
    )

    class Closing(Watcher):
        def end(self, run, outcome):
            super().end(run, outcome)
            if len(self.performed) == 2:
                cluster.close()

    watcher = Closing()
    with pytest.raises(StudyError, match="The Dask scheduler is gone"):
        run_study(study_file, tmp_path / "out", dask=cluster.scheduler_address, progress=watcher)
    assert len(list((tmp_path / "out" / "runs").glob("*.npz"))) >= 2


def test_the_current_folder_has_algorithms(tmp_path):
    code = "from botohe_moo.algorithms.bo_aco.algorithm import RandomTrails as Ants\n"
    (tmp_path / "mine.py").write_text(code)
    (tmp_path / "random.py").write_text("raise SystemExit('not the standard module')\n")
    (tmp_path / "s.yaml").write_text(json.dumps(SMALL | {"algorithms": {"mine": "mine:Ants"}}))
    command = [Path(sys.executable).parent / "botohe", "study", "run", "s.yaml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert set(read_study(tmp_path / "results" / "trial").runs["status"]) == {"done"}
