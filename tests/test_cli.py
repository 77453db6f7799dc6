"""The ``botohe`` command, as real processes."""

import csv
import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import textwrap
from pathlib import Path
from typing import NamedTuple

import pytest

from botohe_moo import load_mission

BOTOHE = Path(sys.executable).parent / "botohe"
FILES = ["front.csv", "front.png", "mission.png", "plans.json"]

# Runs command lines, each in a process of its own that is forked where everything is imported
# already: a start costs seconds, a fork none. Code, if any, runs before the command.
SERVER = """
import json, os, signal, sys, tempfile, traceback
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells may start us with it ignored
import botohe_moo.cli, botohe_moo.solve, botohe_moo.algorithms, botohe_moo.plots
for line in sys.stdin:
    given = json.loads(line)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        child = os.fork()
        if child == 0:
            status = 1
            try:
                os.chdir(given["cwd"])
                os.environ.update(given["env"])
                os.dup2(out.fileno(), 1)
                os.dup2(err.fileno(), 2)
                sys.argv = ["botohe", *given["args"]]
                exec(given["code"], {})
                botohe_moo.cli.main()
            except SystemExit as stop:
                status = stop.code or 0
            except BaseException:
                traceback.print_exc()
            for stream in (sys.stdout, sys.stderr):
                stream and stream.flush()
            os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read().decode(errors="replace"))
    print(json.dumps([status, *texts]), flush=True)
"""


class Ended(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture(scope="module")
def server():
    process = subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with process:
        yield process
        process.stdin.close()


@pytest.fixture
def botohe(server, tmp_path):
    """Run a command line in the test's own folder."""

    def botohe(*args, code="", **env):
        given = {"args": list(map(str, args)), "cwd": str(tmp_path), "env": env}
        print(json.dumps({**given, "code": textwrap.dedent(code)}), file=server.stdin, flush=True)
        return Ended(*json.loads(server.stdout.readline()))

    return botohe


@pytest.fixture
def refused(botohe, tmp_path):
    """Run a command line that is refused: one message, status 2, and nothing is left behind."""

    def refused(*args, **options):
        before = sorted(tmp_path.rglob("*"))
        ended = botohe(*args, **options)
        assert ended.status == 2, ended
        assert ended.out == ""
        assert ended.err.startswith("botohe: ")
        assert ended.err.count("botohe: ") == 1
        assert "Traceback" not in ended.err
        assert sorted(tmp_path.rglob("*")) == before
        return ended.err

    return refused


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A search that was started as users start it, and its folder."""
    folder = tmp_path_factory.mktemp("solved")
    args = ["solve", "toy", "--algorithm", "bo-aco", "--evaluations", "250", "--seed", "3"]
    # What makes matplotlib talk, and rich take a file for a terminal.
    env = {**os.environ, "MPLCONFIGDIR": "/dev/null/none", "FORCE_COLOR": "1"}
    done = subprocess.run(
        [BOTOHE, *args, "--out", "out"], cwd=folder, env=env, capture_output=True, text=True
    )
    return Ended(done.returncode, done.stdout, done.stderr), folder / "out"


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def front_in(folder):
    with (folder / "front.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == ["plan_id", "reward", "survivors"]
    return [(int(plan_id), float(reward), float(survivors)) for plan_id, reward, survivors in rows]


def plans_in(folder):
    return json.loads((folder / "plans.json").read_text())


def flat(text):
    """Undo the wrapping of lines."""
    return " ".join(text.split())


def node_link(nodes, arcs, **graph):
    return {
        "directed": True,
        "multigraph": False,
        "graph": {"name": "pier", "base": "a", "robots": 2, **graph},
        "nodes": [{"id": node, "reward": reward} for node, reward in nodes],
        "edges": [{"source": u, "target": v, "survival": s} for u, v, s in arcs],
    }


NODES = [("a", 0), ("b", 1.5)]
ARCS = [("a", "b", 0.9), ("b", "a", 0.8)]


@pytest.fixture
def pier(tmp_path):
    """Write a mission file."""

    def pier(nodes=NODES, arcs=ARCS, *, name="pier.json", **graph):
        (tmp_path / name).write_text(json.dumps(node_link(nodes, arcs, **graph)))
        return name

    return pier


class TestSolve:
    def test_it_ends_well(self, solved):
        ended, folder = solved
        assert ended.status == 0
        assert ended.err == ""
        assert names_in(folder) == FILES
        assert [line for line in ended.out.splitlines() if line.startswith("wrote ")] == [
            f"wrote out/{name}" for name in ("front.csv", "plans.json", "front.png", "mission.png")
        ]
        assert "5 nodes, 12 arcs, 2 robots, total reward 10" in ended.out
        assert "spent 250 evaluations" in ended.out

    def test_the_front_is_printed_with_its_area(self, solved):
        ended, folder = solved
        rows = [line.split() for line in ended.out.splitlines()]
        for plan_id, reward, survivors in front_in(folder):
            assert [str(plan_id), f"{reward:.4f}", f"{survivors:.4f}"] in rows
        assert f"area {plans_in(folder)['area']:.4f}, {len(front_in(folder))} plans" in ended.out

    def test_the_numbers_are_those_of_the_trails(self, solved):
        _, folder = solved
        mission, plans = load_mission("toy"), plans_in(folder)["plans"]
        evaluated = mission.evaluate([mission.plan(plan["trails"]) for plan in plans]).tolist()
        front = front_in(folder)
        assert len(front) > 3
        assert [list(row[1:]) for row in front] == evaluated
        assert [(p["plan_id"], p["reward"], p["survivors"]) for p in plans] == front

    def test_the_record(self, solved):
        content = plans_in(solved[1])
        assert content["evaluations"] == 250
        assert (content["mission"], content["algorithm"], content["seed"]) == ("toy", "bo-aco", 3)
        assert content["interrupted"] is False

    def test_the_seed_decides(self, solved, botohe, tmp_path):
        _, folder = solved
        again = ["solve", "toy", "-n", 250, "-a", "bo-aco"]
        for seed in (3, 4):
            assert botohe(*again, "-s", seed, "-o", f"seed{seed}").status == 0
        for name in FILES:
            same = (folder / name).read_bytes()
            assert (tmp_path / "seed3" / name).read_bytes() == same
            assert name == "mission.png" or (tmp_path / "seed4" / name).read_bytes() != same

    @pytest.mark.parametrize(("algorithm", "n"), [("random", 1), ("random", 101), ("bo-aco", 99)])
    def test_the_budget_is_exact(self, botohe, tmp_path, algorithm, n):
        assert botohe("solve", "toy", "-a", algorithm, "-n", n, "-o", "out").status == 0
        assert plans_in(tmp_path / "out")["evaluations"] == n

    def test_parameters(self, botohe, tmp_path):
        ended = botohe(
            *("solve", "terrain", "-m", "nodes=9", "-m", "seed=2", "--robots", 4, "-n", 60),
            *("-p", "n_ants=20", "-p", "evaporation=1e-1", "-p", "heuristic=false"),
            *("-p", "initial_pheromone=bounds", "--seed", 10**30),
        )
        assert ended.status == 0, ended
        assert ended.err == ""
        content = plans_in(tmp_path / "results" / "terrain")
        assert content["parameters"] == {
            "n_ants": 20,
            "evaporation": 0.1,
            "heuristic": False,
            "initial_pheromone": "bounds",
        }
        assert content["seed"] == 10**30
        mission = load_mission(**content["mission_source"])
        assert (len(mission.nodes), mission.robots, content["robots"]) == (9, 4, 4)
        for plan in content["plans"]:
            mission.plan(plan["trails"])

    def test_a_file_whose_name_and_labels_are_odd(self, botohe, pier, tmp_path):
        said = 'she said "no"\nand $left_{'
        name = pier(
            [(["floor", 1, None], 0), (said, 2), ("[red]漢字[/red]", 1)],
            [(["floor", 1, None], said, 0.9), (said, ["floor", 1, None], 1)]
            + [(said, "[red]漢字[/red]", 0.5), ("[red]漢字[/red]", said, 1)],
            base=["floor", 1, None],
            name="odd [bold]pier[/bold] ü.json",
            title="[link]a$b",
        )
        ended = botohe("solve", name, "-n", 300)
        assert ended.status == 0, ended
        assert ended.err == ""
        assert ended.out.startswith("[link]a$b: 3 nodes")
        folder = tmp_path / "results" / "odd [bold]pier[/bold] ü"
        assert f"wrote results/{folder.name}/front.csv" in ended.out
        mission, content = load_mission(tmp_path / name), plans_in(folder)
        plans = [
            mission.plan(
                [[tuple(v) if isinstance(v, list) else v for v in t] for t in plan["trails"]]
            )
            for plan in content["plans"]
        ]
        assert mission.evaluate(plans).tolist() == [list(row[1:]) for row in front_in(folder)]
        assert {said, "[red]漢字[/red]"} <= set(sum(mission.labels(plans[0]), ()))

    def test_a_mission_that_is_only_a_base(self, botohe, pier, tmp_path):
        assert botohe("solve", pier([("a", 0)], []), "-n", 5, "-o", "out").status == 0
        assert front_in(tmp_path / "out") == [(0, 0.0, 2.0)]

    def test_output_that_nobody_reads_or_that_is_not_unicode(self, botohe, pier, tmp_path):
        title = "λ 漢字 \udcff"
        ended = botohe("solve", pier(title=title), "-n", 9, PYTHONIOENCODING="ascii", code=ASCII)
        assert ended.status == 0, ended
        assert ended.out.startswith(r"\u03bb \u6f22\u5b57 \udcff: 2 nodes")
        ended = botohe("solve", "toy", "-n", 9, "-o", "unread", code=UNREAD)
        assert ended == (0, "", "")
        assert names_in(tmp_path / "unread") == FILES
        ended = botohe(
            "solve", "toy", "-n", 9, "-o", "closed", code="import sys; sys.stdout = None"
        )
        assert ended == (0, "", "")
        assert names_in(tmp_path / "closed") == FILES


ASCII = "import sys; sys.stdout.reconfigure(encoding='ascii', errors='strict')"
UNREAD = """
    import os
    reader, writer = os.pipe()
    os.close(reader)
    os.dup2(writer, 1)
"""


def test_terminal_and_interrupt(tmp_path):
    """A huge budget in a pseudo-terminal: watch the progress bar, then press Ctrl-C."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    process = subprocess.Popen(
        [BOTOHE, "solve", "toy", "--evaluations", str(10**9), "--out", "out"],
        cwd=tmp_path,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
        stdout=subprocess.PIPE,
        stderr=theirs,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(theirs)
    shown, pressed = b"", False
    try:
        while True:
            try:
                shown += os.read(ours, 65536)
            except OSError:  # the other end is closed
                break
            plain = re.sub(rb"\x1b\[[0-9;?]*[A-Za-z]", b"", shown)
            if not pressed and re.search(rb"area 0\.[5-9]\d{3}  \d+:\d\d:\d\d left", plain):
                pressed = True
                process.send_signal(signal.SIGINT)
        out = process.communicate()[0]
    finally:
        process.kill()
        os.close(ours)
    assert pressed
    assert b"%" in plain
    assert b"evaluations" in plain
    assert b"Traceback" not in plain
    assert shown.rstrip().endswith(b"\x1b[?25h")  # the cursor is there again
    assert process.returncode == 130
    assert "stopped after" in out
    assert names_in(tmp_path) == ["out"]
    assert names_in(tmp_path / "out") == FILES
    content = plans_in(tmp_path / "out")
    assert content["interrupted"] is True
    assert 0 < content["evaluations"] < 10**9
    assert content["evaluations"] % 100 == 0  # no iteration was left half-done
    assert len(front_in(tmp_path / "out")) == len(content["plans"]) > 3


# Sends a signal when something of a module is called.
WHEN_CALLED = """
    import os, signal, {module}
    usual = {module}.{name}

    def {name}(*args, **kwargs):
        for _ in range({times}):
            os.kill(os.getpid(), signal.{signal})
        return usual(*args, **kwargs)

    {module}.{name} = {name}
"""


def when_called(module, name, *, times=1, sent="SIGINT"):
    return WHEN_CALLED.format(module=module, name=name, times=times, signal=sent)


class TestSignals:
    @pytest.mark.parametrize("module", ["typer", "botohe_moo._options", "numpy", "pymoo"])
    def test_at_the_start(self, tmp_path, module):
        code = f"""
            import os, signal, sys
            signal.signal(signal.SIGINT, signal.default_int_handler)

            class Finder:
                def find_spec(name, path=None, target=None):
                    if name == {module!r}:
                        print("pressed", flush=True)
                        os.kill(os.getpid(), signal.SIGINT)

            sys.meta_path.insert(0, Finder)
            from botohe_moo.cli import main
            sys.argv = ["botohe", "solve", "toy", "--out", "out"]
            main()
        """
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.stdout == "pressed\n"
        assert done.stderr == ""
        assert done.returncode in (130, -signal.SIGINT)
        assert names_in(tmp_path) == []

    def test_before_the_first_iteration(self, botohe, tmp_path):
        code = when_called("botohe_moo.solve", "search")
        ended = botohe("solve", "toy", "-n", 10**9, "-o", "out", code=code)
        assert (ended.status, ended.err) == (130, "")
        assert plans_in(tmp_path / "out")["evaluations"] == 100
        assert names_in(tmp_path / "out") == FILES

    def test_while_writing(self, botohe, tmp_path):
        code = when_called("botohe_moo.plots", "save_plot")
        ended = botohe("solve", "toy", "-n", 9, "-o", "out", code=code.replace("usual(", "usual("))
        assert ended.status == 130

    def test_once_while_writing(self, botohe, tmp_path):
        code = when_called("botohe_moo.plots", "plot_mission")
        ended = botohe("solve", "toy", "-n", 9, "-o", "out", code=code)
        assert (ended.status, ended.err) == (130, "")
        assert names_in(tmp_path / "out") == FILES
        assert plans_in(tmp_path / "out")["interrupted"] is False

    def test_twice_while_writing(self, botohe, tmp_path):
        code = when_called("botohe_moo.plots", "plot_mission", times=2)
        ended = botohe("solve", "toy", "-n", 9, "-o", "out", code=code)
        assert (ended.status, ended.err) == (130, "")
        assert names_in(tmp_path / "out") == ["front.csv", "front.png", "plans.json"]

    def test_twice_while_searching(self, botohe, tmp_path):
        code = when_called("botohe_moo.solve", "progress_bar", times=2)
        ended = botohe("solve", "toy", "-o", "out", code=code)
        assert (ended.status, ended.err) == (130, "")
        assert names_in(tmp_path) == []

    def test_sigterm_does_what_it_usually_does(self, botohe):
        code = when_called("botohe_moo.solve", "search", sent="SIGTERM")
        assert botohe("solve", "toy", "-o", "out", code=code).status == -signal.SIGTERM
