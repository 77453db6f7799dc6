"""Studies as real processes: killed, stopped, two at a time, at a terminal, on a cluster."""

import contextlib
import fcntl
import json
import os
import pty
import random
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
from botohe_moo.study.perform import Outcome, Record
from tests.forked import Forked, run_forked
from tests.study.made import MADE, Watcher, assert_same, study_of

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]

NSGA = {"algorithm": "nsga2", "parameters": {"pop_size": 20}}
STUDY = study_of(
    missions=["toy", "art_museum"],
    algorithms={"NSGA-II": NSGA, "random": "random", "greedy": "greedy"},
    budget={"evaluations": 1_000},
    seeds=4,
)
SMALL = study_of(algorithms=["random"], budget={"evaluations": 40})


def start(*arguments, popen=Forked):
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
    )


def finish(process, timeout=120):
    out, err = process.communicate(timeout=timeout)
    return process.returncode, out, err


@pytest.fixture(autouse=True)
def environment_as_it_was():
    """Let Ctrl-C reach what tests start; take back what Dask puts into its workers' environment."""
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    with mock.patch.dict(os.environ):
        yield
    signal.signal(signal.SIGINT, usual)


@pytest.fixture(scope="module")
def study_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("file") / "study.yaml"
    path.write_text(json.dumps(STUDY))
    return path


@pytest.fixture(scope="module")
def uninterrupted(study_file, tmp_path_factory):
    return run_study(study_file, tmp_path_factory.mktemp("one"))


def wait_until(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def n_done(folder):
    return len(list(folder.glob("runs/*.npz")))


def test_five_kills_at_random_moments_change_nothing(
    study_file, uninterrupted, processes_there, tmp_path
):
    folder, rng, counts = tmp_path / "killed", random.Random(5), []
    command = ("run", study_file, "--out", folder, "--workers", 2)
    for i in range(5):
        # The last with processes whose environment can be looked at.
        process = start(*command, popen=subprocess.Popen if i == 4 else Forked)
        # Past the start, so that some of the kills meet runs and files; never waits for the end.
        aim = n_done(folder) + rng.randint(0, 3)
        while n_done(folder) < aim and process.poll() is None:
            time.sleep(0.02)
        time.sleep(rng.random() * 0.1)
        process.kill()
        process.communicate()
        counts.append(n_done(folder))
    assert counts == sorted(counts)  # what is done stays done
    assert counts[0] < 24  # it was at work
    wait_until(lambda: not processes_there())  # nobody works for a dead runner
    partial = make_tables(folder)
    assert (len(partial.runs), partial.missing["missing"].sum()) == (counts[-1], 24 - counts[-1])
    status, _, err = finish(start(*command))
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
    entry = {"algorithm": f"{MADE}:Doing", "parameters": {"what": "time.sleep(0.2)", "n": 10}}
    # With a budget of seconds, each record is sent at once.
    source = study_of(algorithms={"slow": entry}, budget={"evaluations": 40, "seconds": 60})
    times = {}

    def progress(about, news):
        if isinstance(news, Record):
            times.setdefault(about.digest, []).append(time.monotonic())

    run_study(source, tmp_path, workers=2, progress=progress)
    (one_began, *_, one_ended), (other_began, *_, other_ended) = times.values()
    assert max(one_began, other_began) < min(one_ended, other_ended)


@pytest.fixture
def scheduler(tmp_path):
    """A Dask scheduler without workers; gives its address."""
    distributed = pytest.importorskip("distributed")
    options = {"dashboard_address": None, "local_directory": tmp_path / "dask"}
    with distributed.LocalCluster(n_workers=0, **options) as cluster:
        yield cluster.scheduler_address


@pytest.fixture
def hire(scheduler, tmp_path):
    """Starts Dask workers as processes: by default one that has all a worker needs."""
    hired = []

    def start_worker(*flags, path=()):
        name = f"w{len(hired)}"
        folders = (*path, ROOT) if flags else (*path, ROOT, ROOT / "src")
        begin = "import sys; sys.path[:] = [p for p in sys.path if p] + eval(sys.argv.pop()); "
        work = "from distributed.cli.dask_worker import main; main()"
        command = [
            sys.executable, *flags, "-c", begin + work, scheduler, "--no-nanny", "--no-dashboard",
            "--nthreads", "1", "--name", name, "--local-directory", str(tmp_path / name),
            repr([str(p) for p in path]),
        ]  # fmt: skip
        env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
        popen = subprocess.Popen if flags else Forked
        hired.append(popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL, env=env))
        return hired[-1]

    yield start_worker
    for worker in hired:
        worker.kill()
        worker.wait()


def test_a_worker_that_lacks_the_package_is_named(scheduler, hire, tmp_path):
    import distributed

    # Without site, what is installed for editing is not found.
    hire("-S", path=[Path(distributed.__file__).parents[1]])
    with distributed.Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(1, timeout=60)
    said = r"tcp://\S+ cannot perform runs: .*ModuleNotFoundError.*No module named .*botohe_moo"
    with pytest.raises(StudyError, match=said):
        run_study(SMALL, tmp_path / "out", dask=scheduler)


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
    assert any("waiting for one" in line for line in process.stderr)
    os.kill(process.pid, signal.SIGINT)
    status, _, err = finish(process)
    assert status == 130, err
    assert "Traceback" not in err


def test_no_scheduler_at_the_address(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "_SECONDS_TO_CONNECT", 0.5)
    for address in ("tcp://127.0.0.1:1", "localhost", "tcp://127.0.0.1:99999"):
        with pytest.raises(StudyError, match=f"No Dask scheduler answers at '{address}'"):
            run_study(SMALL, tmp_path, dask=address)


def test_a_cluster_that_goes_away(study_file, tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {"dashboard_address": None, "local_directory": tmp_path / "dask", "protocol": "tcp"}
    cluster = distributed.LocalCluster(1, threads_per_worker=1, processes=False, **options)
    ended = []

    def progress(about, news):
        ended.extend([about] * isinstance(news, Outcome))
        if len(ended) == 2:
            cluster.close()

    folder = tmp_path / "out"
    with pytest.raises(StudyError, match="The Dask scheduler is gone"):
        run_study(study_file, folder, dask=cluster.scheduler_address, progress=progress)
    assert n_done(folder) >= 2


def test_the_current_folder_has_algorithms(tmp_path):
    code = "from botohe_moo.algorithms.bo_aco.algorithm import RandomTrails as Ants\n"
    (tmp_path / "mine.py").write_text(code)
    (tmp_path / "random.py").write_text("raise SystemExit('not the standard module')\n")
    (tmp_path / "s.yaml").write_text(json.dumps(SMALL | {"algorithms": {"mine": "mine:Ants"}}))
    command = [Path(sys.executable).parent / "botohe", "study", "run", "s.yaml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert set(read_study(tmp_path / "results" / "trial").runs["status"]) == {"done"}
