"""The ``botohe`` command: in this process, and as a process what only a process shows."""

import contextlib
import fcntl
import itertools
import json
import math
import os
import pty
import re
import shlex
import shutil
import signal
import struct
import subprocess
import sys
import termios
import textwrap
import threading
import time
from pathlib import Path
from typing import ClassVar

import networkx as nx
import numba
import numpy as np
import pytest
from PIL import Image

import botohe_moo.core.compile  # noqa: F401
from botohe_moo import (
    FrontBound,
    Kind,
    Mission,
    load_mission,
    plots,
    read_solution,
    save_mission,
    simulate_policy,
)
from botohe_moo.cli import common
from botohe_moo.decide.plan_files import VEHICLES
from botohe_moo.explorer import replay_page
from botohe_moo.underway import play_mission
from tests.commands import Ended, run_botohe, without_compiling
from tests.forked import run_forked

BOTOHE = Path(sys.executable).parent / "botohe"
TABLES = ["front.csv", "mission.json", "plans.json"]
FILES = sorted([*TABLES, "front.png", "mission.png"])


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder of its own, in which every command works."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def forked(tmp_path):
    """Run a command line as a process; code, if any, runs before it."""

    def forked(*args, code=""):
        command = [str(BOTOHE), *map(str, args)]
        lines = ["import botohe_moo.cli, sys", f"sys.argv = {command}", textwrap.dedent(code)]
        run = "\n".join([*lines, "botohe_moo.cli.main()"])
        env = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
        done = run_forked([sys.executable, "-c", run], cwd=tmp_path, env=env)
        return Ended(done.returncode, done.stdout, without_compiling(done.stderr))

    return forked


def refused(*args):
    """Run a command line that is refused: one message, status 2, and nothing is left behind."""
    before = sorted(Path().rglob("*"))
    ended = run_botohe(*args)
    assert (ended.status, ended.out) == (2, ""), ended
    assert ended.err.count("botohe: ") + ended.err.count("Error: ") == 1, ended.err
    assert sorted(Path().rglob("*")) == before
    return ended.err


def done(*args):
    """Run a command line that ends well and says nothing on standard error; return its output."""
    ended = run_botohe(*args)
    assert (ended.status, ended.err) == (0, ""), ended
    return ended.out


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """A search that was started as users start it, and its folder."""
    folder = tmp_path_factory.mktemp("solved")
    args = ["solve", "toy", "--algorithm", "bo-aco", "--evaluations", "250", "--seed", "3"]
    # What makes matplotlib talk or fail, and rich take a file for a terminal.
    disturbing = {"MPLCONFIGDIR": "/dev/null/none", "MPLBACKEND": "none", "FORCE_COLOR": "1"}
    env = {**os.environ, **disturbing}
    ran = subprocess.run(
        [BOTOHE, *args, "--out", "out"], cwd=folder, env=env, capture_output=True, text=True
    )
    return Ended(ran.returncode, ran.stdout, without_compiling(ran.stderr)), folder / "out"


@pytest.fixture(scope="module")
def solved(started):
    """The folder of a search, which nobody writes to."""
    return started[1]


def names_in(folder):
    return sorted(path.name for path in Path(folder).iterdir())


def front_in(folder):
    return [(p["plan_id"], p["reward"], p["survivors"]) for p in plans_in(folder)["plans"]]


def plans_in(folder):
    return json.loads((Path(folder) / "plans.json").read_text())


def flat(text):
    """Undo the wrapping of lines."""
    return " ".join(text.split())


def write_pier(name="pier.json", **graph):
    """Write a mission file with other attributes of the graph."""
    content = json.loads((Path(__file__).parent / "data" / "pier.json").read_text("utf-8"))
    content["graph"] |= graph
    Path(name).write_text(json.dumps(content))
    return name


class TestSolve:
    def test_files_and_what_is_printed(self, started, monkeypatch):
        ended, folder = started
        assert (ended.status, ended.err) == (0, "")
        assert names_in(folder) == FILES
        names = ["front.csv", "plans.json", "mission.json", "front.png", "mission.png"]
        wrote = [line for line in ended.out.splitlines() if line.startswith("wrote ")]
        assert wrote == [f"wrote out/{name}" for name in names]
        assert "5 nodes, 12 arcs, 2 robots, total reward 10" in ended.out
        assert "spent 250 evaluations" in ended.out
        assert len(front_in(folder)) > 3
        commands = ended.out.partition("\nNext:\n")[2].splitlines()
        explore, choose = (shlex.split(command)[1:] for command in commands)
        assert explore == ["explore", "out", "--open"]
        monkeypatch.chdir(folder.parent)
        assert done(*choose).startswith("plan ")

    def test_the_seed_decides(self, solved):
        for seed in (3, 4):
            done("solve", "toy", "-n", 250, "-a", "bo-aco", "-s", seed, "-o", f"seed{seed}")
        for name in FILES:
            same = (solved / name).read_bytes()
            assert Path("seed3", name).read_bytes() == same
            assert name.startswith("mission.") or Path("seed4", name).read_bytes() != same

    def test_a_travel_budget(self):
        Path("sites.txt").write_text("n 4\nm 1\ntmax 4.5\n0 0 0\n2 0 5\n0 3 1\n0 0 0\n")
        solve = ("solve", "sites.txt", "-a", "greedy", "-n", 50, "-o", "found")
        for given, said in ((), "6, travel budget 4.5"), (("--max-length", "inf"), "6"):
            assert f"total reward {said}\n" in done(*solve, *given)
        assert plans_in("found")["max_length"] is None

    def test_parameters(self):
        done(
            *("solve", "terrain", "-m", "nodes=9", "-m", "seed=2", "--robots", 4, "-n", 60),
            *("-a", "bo-aco", "-p", "n_ants=20", "-p", "evaporation=1e-1", "-p", "heuristic=false"),
            *("-p", "initial_pheromone=bounds", "--seed", 10**30),
        )
        content = plans_in("results/solve/terrain")
        expected = {"n_ants": 20, "evaporation": 0.1, "heuristic": False}
        assert content["parameters"] == expected | {"initial_pheromone": "bounds"}
        mission = load_mission(**content["mission_source"])
        sizes = len(mission.nodes), mission.robots, content["robots"], content["seed"]
        assert sizes == (9, 4, 4, 10**30)

    def test_without_a_folder_nothing_is_written_over(self):
        taken = Path("results", "solve", "toy", "front.csv")
        taken.parent.mkdir(parents=True)
        taken.write_text("precious")
        assert "wrote results/solve/toy-2/front.csv\n" in done("solve", "toy", "-n", 9)
        assert names_in("results/solve/toy-2") == FILES
        assert taken.read_text() == "precious"

    def test_the_front_is_printed_before_pictures_are_drawn(self, monkeypatch):
        def plot_front(*_):
            print("drawing")
            raise RuntimeError("No such glyph.")

        monkeypatch.setattr(plots, "plot_front", plot_front)
        ended = run_botohe("solve", "toy", "-n", 9, "-o", "out")
        assert ended.status == 1
        assert re.search(r"area 0\.\d{4}, \d+ plans on the front\ndrawing\n$", ended.out)
        assert ended.err == "botohe: no picture (No such glyph.); the tables are in out.\n"
        assert names_in("out") == TABLES

    def test_with_a_choice(self):
        args = ["solve", "toy", "-a", "greedy", "-n", 50, "--out", "out"]
        out = done(*args, "--choose", "survivors >= 1.5", "--choose", "reward >= 1")
        answer = out.partition("wrote out/mission.png\n\n")[2]
        assert answer == done("choose", "out", "survivors >= 1.5 and reward >= 1")
        done("explore", "out")
        assert names_in("out") == sorted([*FILES, "explorer.html"])
        ended = run_botohe(*args, "--choose", "survivors >= 2 and reward >= 9")
        assert (ended.status, ended.err) == (1, "botohe: no plan meets all wishes.\n")
        assert names_in("out") == FILES  # the page was of other plans


UNREAD = """
    import os
    reader, writer = os.pipe()
    os.close(reader)
    os.dup2(writer, 1)
"""
FULL = "import os; os.dup2(os.open('/dev/full', os.O_WRONLY), 1)"


class TestStreams:
    """Standard output that is closed, full, or of another encoding."""

    @pytest.mark.parametrize("args", [["solve", "toy", "-n", 9, "-o", "out"], ["solve", "--help"]])
    def test_output_that_cannot_be_written(self, forked, args):
        ended = forked(*args, code=FULL)
        assert ended == (1, "", "botohe: standard output: No space left on device\n")
        assert names_in(".") == []

    @pytest.mark.slow
    @pytest.mark.parametrize("code", [UNREAD, "sys.stdout = None"])
    def test_output_that_nobody_reads(self, forked, code):
        assert forked("solve", "toy", "-n", 9, "-o", "out", code=code) == (0, "", "")
        assert names_in("out") == FILES

    @pytest.mark.slow
    def test_output_that_holds_odd_characters(self, forked):
        code = "sys.stdout.reconfigure(encoding='latin-1', errors='strict')"
        pier = write_pier(title="λ and more")
        ended = forked("solve", pier, "-n", 9, "-o", "out\udcff", code=code)
        assert (ended.status, ended.err) == (0, "")
        assert ended.out.startswith(r"\u03bb and more: 3 nodes")
        assert r"wrote out\udcff/front.csv" in ended.out
        assert names_in("out\udcff") == FILES

    def test_too_much_for_the_memory(self, capsys, monkeypatch):
        def search():
            raise MemoryError("Unable to allocate 7.1 PiB.")

        monkeypatch.setenv("MPLBACKEND", "Agg")
        with pytest.raises(SystemExit) as ended:
            common.run(search)
        assert ended.value.code == 1
        said = "botohe: there is not enough memory. Unable to allocate 7.1 PiB.\n"
        assert capsys.readouterr().err == said


class TestWhatIsLoaded:
    """In a new interpreter, which says the names of modules."""

    @staticmethod
    def run_python(code):
        command = [sys.executable, "-c", textwrap.dedent(code)]
        ran = subprocess.run(command, capture_output=True, text=True)
        assert ran.returncode == 0
        return [set(line.split()) for line in ran.stderr.splitlines()]

    def test_help_waits_for_nothing(self):
        code = """
            import sys
            from botohe_moo import cli
            sys.argv = ["botohe", "solve", "--help"]
            try:
                cli.main()
            finally:
                print(*sys.modules, file=sys.stderr)
        """
        (loaded,) = self.run_python(code)
        assert {"typer", "botohe_moo"} <= loaded
        slow = {"numpy", "numba", "pandas", "pymoo", "matplotlib", "seaborn", "networkx", "yaml"}
        assert not loaded & slow

    @pytest.mark.slow
    def test_pictures_are_not_waited_for(self):
        code = """
            import sys
            from botohe_moo import cli
            app = sys.modules["botohe_moo.cli.solve"]

            def tell(message, usual=app.tell):
                usual(message)
                if "plan_id" in message or "mission.png" in message:
                    print(*sys.modules, file=sys.stderr)

            app.tell = tell
            sys.argv = ["botohe", "solve", "toy", "-n", "100", "-o", "out"]
            cli.main()
        """
        *_, front, pictures = self.run_python(code)
        assert {"botohe_moo.solution", "numba"} <= front
        assert not front & {"matplotlib.pyplot", "scipy.spatial"}
        assert not pictures & {"seaborn", "pandas", "scipy.stats"}


STOPPING = "botohe: stopping; what was found will be written. Press Ctrl-C again to break off.\n"
# Sends signals when something of a module is called.
PRESSED = """
    import os, signal, {module}

    def {name}(*args, usual={module}.{name}, **kwargs):
        for _ in range({times}):
            os.kill(os.getpid(), signal.SIGINT)
        return usual(*args, **kwargs)

    {module}.{name} = {name}
"""


@contextlib.contextmanager
def killed_after(seconds, process):
    """Kill the process after some seconds if Ctrl-C did not end it."""
    alarm = threading.Timer(seconds, process.kill)
    alarm.start()
    try:
        yield
    finally:
        alarm.cancel()
        process.kill()


@pytest.mark.slow
class TestInterruption:
    def test_in_a_terminal(self):
        """A huge budget in a pseudo-terminal: watch the progress bar, then press Ctrl-C."""
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        process = subprocess.Popen(
            [BOTOHE, "solve", "toy", "-a", "bo-aco", "--evaluations", str(10**9), "--out", "out"],
            env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
            stdout=subprocess.PIPE,
            stderr=theirs,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )
        os.close(theirs)
        shown, pressed = b"", False
        times = rb"area 0\.[5-9]\d{3}  \d:\d\d:\d\d +\d+:\d\d:\d\d"  # passed and left
        with killed_after(120, process):
            with contextlib.suppress(OSError):  # the other end is closed
                while True:
                    shown += os.read(ours, 65536)
                    plain = re.sub(rb"\x1b\[[0-9;?]*[A-Za-z]", b"", shown)
                    if not pressed and re.search(times, plain):
                        pressed = True
                        process.send_signal(signal.SIGINT)
            out = process.communicate()[0]
        os.close(ours)
        assert b"% " in plain
        assert b" evaluations " in plain
        assert b"\n" + STOPPING.strip().encode() + b"\r\n" in plain
        assert shown.rindex(b"\x1b[?25h") > shown.rindex(b"\x1b[?25l")  # the cursor is there again
        assert process.returncode == 130
        assert "stopped after" in out
        assert names_in("out") == FILES
        content = plans_in("out")
        assert content["interrupted"] is True
        assert content["evaluations"] % 100 == 0  # no iteration was left half-done

    def test_it_is_answered_at_once(self):
        """The answer comes while the first iteration goes on, which ends when we say so."""
        code = """
            import ctypes, os, signal, sys
            signal.signal(signal.SIGINT, signal.default_int_handler)
            import botohe_moo.cli, botohe_moo.algorithms
            read = ctypes.CDLL(None).read  # takes no lock, like a kernel; nor do signals end it
            signal.siginterrupt(signal.SIGINT, False)

            def _infill(self, usual=botohe_moo.algorithms.RandomTrails._infill):
                signal.siginterrupt(signal.SIGINT, False)
                print("computing", flush=True)
                read(0, ctypes.create_string_buffer(1), 1)
                return usual(self)

            botohe_moo.algorithms.RandomTrails._infill = _infill
            botohe_moo.algorithms.RandomTrails._initialize_infill = _infill
            sys.argv = ["botohe", "solve", "toy", "-a", "random", "-n", "1000000", "-o", "out"]
            botohe_moo.cli.main()
        """
        streams = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        command = [sys.executable, "-c", textwrap.dedent(code)]
        process = subprocess.Popen(command, text=True, **streams)
        with killed_after(120, process):
            assert "computing\n" in iter(process.stdout.readline, "")
            process.send_signal(signal.SIGINT)
            assert process.stderr.readline() == STOPPING  # while it computes
            out, err = process.communicate("x")
        assert (process.returncode, err) == (130, "")
        assert "stopped after" in out
        assert plans_in("out")["interrupted"] is True

    def test_twice_while_searching(self, forked):
        code = PRESSED.format(module="botohe_moo.cli.solve", name="_showing_search", times=2)
        ended = forked("solve", "toy", "-o", "out", code=code)
        assert (ended.status, ended.err) == (130, STOPPING)
        assert names_in(".") == []

    def test_while_bounding_it_keeps_what_is_proved(self, forked):
        code = PRESSED.format(module="botohe_moo.bounds.proof", name="LocalSearch", times=1)
        args = ["solve", "art_museum", "-n", 200, "--out", "out", "--certify", 20]
        ended = forked(*args, code=code)
        assert ended.status == 130
        assert ended.err.count("botohe: stopping") == 1  # a slow start may be reported, too
        assert "stopping; what is proved will be shown" in ended.err
        assert "; proven upper bound on area" in ended.out
        assert names_in("out") == sorted([*FILES, "bound.json"])
        assert FrontBound.load("out/bound.json", read_solution("out").mission).area < 1


def test_progress_in_lines_where_there_is_no_terminal(capfd):
    with common.showing("starting", every=0.05) as show:
        time.sleep(0.2)
        show("half of it", 1, 2)
        time.sleep(0.2)
        assert numba.njit(lambda x: [x] * 2)(1) == [1, 1]  # which compiles for a while
        time.sleep(0.2)
    lines = [line.removeprefix("botohe: ") for line in capfd.readouterr().err.splitlines()]
    shown = [re.sub(r", \d:\d\d:\d\d$", "", line) for line in lines]
    compiling = ["compiling for this machine, once.", "compiling"]
    expected = ["starting", "half of it", *compiling, "half of it"]
    assert [words for words, _ in itertools.groupby(shown)] == expected


REFUSED = {
    "solve toy --evaluations 0": ["'--evaluations'", "greater than or equal to 1"],
    "solve toy --min-survival 1.5": ["Expected min_survival in [0, 1], got 1.5."],
    "solve toy --sed 1": ["--sed", "--seed"],
    "solve toy -a boaco": ["'boaco': no such algorithm; known are bo-aco, "],
    "solve toy -a bo-aco -p evaporation=1.3 -p heuristic=maybe": [
        "'bo-aco': Expected evaporation in (0, 1), got 1.3.",
        "Expected heuristic to be true or false, got 'maybe'.",
    ],
    "solve toy -a greedy -p n_threads=2": ["there is no parameter 'n_threads'"],
    "solve toy --certify 0": ["'--certify': Input should be greater than or equal to"],
    "solve toy --certify 1 --problem least-survival": ["no --problem with --certify"],
    "solve toy -p n_ants=1 -p n_ants=2": ["Expected 'n_ants' once, got it again"],
    "solve toy -p n_ants=[1": ["a number, true, false or text for 'n_ants', got '[1'"],
    "solve toy --out file": ["botohe: file: expected a folder to write to\n"],
    "solve toy --out ''": ["expected a path, got an empty text"],  # a variable that is not set
    "solve toy --choose win": ["Expected a wish, got 'win'"],
    "solve site.geojson --base 1 -m base=2": ["Expected --base or -m base=VALUE, got both."],
    "solve toy --base 1": ["no parameter 'base'"],
    "solve drones_and_rovers --robots 3": ["4 robots (2 drone, 2 rover): expected no number"],
    "solve list.json": ["botohe: list.json: expected the file to be a mapping"],
    "solve lost.json": ["botohe: lost.json: no such file"],
    "solve power-plant": ["no such mission; known are power_plant"],
    "missions show terrain -m nodes=many": ["Expected nodes to be an integer >= 2, got 'many'."],
    "slove": ["'slove'", "'solve'", "botohe --help"],
    "choose SOLVED 'survivors >= 1' --plan 1": ["only one of wishes", "got wishes and --plan."],
    "choose SOLVED --out plan.json": ["Expected wishes, --toward or --plan with --out, got none"],
    "choose SOLVED --most reward": ["Expected wishes with --most, got none"],
    "choose SOLVED --plan 99": ["Expected --plan in [0, ", "], got 99"],
    "choose SOLVED --plan 2 --out folder.png": ["folder.png: expected a file, found a folder"],
    "choose SOLVED --plan 1 --out SOLVED/plans.json": ["a file of the solution itself"],
    "choose SOLVED --plan 2 --out site.plan --altitude 30": [
        "geographic=true); 'toy' does not say"
    ],
    "bound toy --front SOLVED --max-length 5": ["neither --min-survival nor --max-length"],
    "bound toy --robots 3 --front SOLVED": [
        "another mission than 'toy'",
        "it has 2, the mission 3",
    ],
    "bound rest.json": ["botohe bound does not support mission 'toy'"],
    "solve rest.json --certify 5": ["--certify does not support mission 'toy', in which robots"],
    "replan SOLVED events.csv --plan 0": ["events.csv, row 3: robot 0 reached 2: it is lost"],
    "replan SOLVED events.csv --plan 0 --out SOLVED": ["the folder of the plan itself"],
    "replay SOLVED --plan 0 --policy often --out page.html": ["Expected policy"],
    "replay SOLVED --plan 0 --out a.txt": ["ends in one of .html"],
    "simulate SOLVED --plan 0 --out a.txt": ["ends in one of .png"],
    "explore SOLVED --background no.yaml": ["no.yaml: no such file"],
    "explore SOLVED --out page.pdf": ["ends in one of .html"],
}


@pytest.mark.parametrize("line", REFUSED)
def test_what_is_refused(solved, line):
    Path("file").touch()
    Path("folder.png").mkdir()
    Path("list.json").write_text("[1, 2]")
    Path("events.csv").write_text("robot,event,node\n0,lost,\n0,reached,2\n")
    if "rest.json" in line:
        kinds = [Kind("drone", 1, aboard=(4,))]
        mission = Mission(load_mission("toy").graph, base=1, kinds=kinds, pays="return")
        save_mission(mission, "rest.json")
    message = refused(*shlex.split(line.replace("SOLVED", str(solved))))
    for words in REFUSED[line]:
        assert words in message or words in flat(message)


ODD = """
    from tests.study.algorithms_made import Infeasible

    class Picky(Infeasible):
        '''Refuse every :class:`mission`.

        Parameters
        ----------
        limit
            How many ``nodes`` there may be at most.
        '''

        def __init__(self, *, limit: int, style: "str | None" = None, start: list[Infeasible] = ()):
            super().__init__()

        def _setup(self, problem, **_):
            raise ValueError(f"Expected at most 3 nodes, got {len(problem.mission.nodes)}.")

    class Broken(Infeasible):
        def _infill(self):
            return {}["lost"]
"""


def test_algorithms_of_others(folder, monkeypatch):
    Path("odd.py").write_text(textwrap.dedent(ODD))
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    infeasible, picky, broken = (
        ("solve", "toy", "-a", f"odd:{name}") for name in ("Infeasible", "Picky", "Broken")
    )
    assert refused(*picky).startswith("botohe: Algorithm 'odd:Picky': ")
    failed = r"algorithm 'odd:Broken' failed: KeyError: 'lost' \(\S+odd\.py, line \d+\)\.\n"
    for status, args, said in (
        (1, (*infeasible, "-n", 70, "--min-survival", 1), "odd:Infeasible found no plan in 70 "),
        (2, (*picky, "-p", "limit=3"), "Algorithm 'odd:Picky': Expected at most 3 nodes, got 5.\n"),
        (1, broken, failed),
    ):
        ended = run_botohe(*args)
        assert ended.status == status
        assert re.match(f"botohe: {said}", ended.err)
    assert done("algorithms", "odd:Picky") == (
        "odd:Picky: Refuse every mission.\n\n"
        "  limit  (int)\n      How many nodes there may be at most.\n\n"
        "  style = null  (str or None)\n\n"
        "  start  (from Python only)\n\n"
        "Give one as in `botohe solve MISSION -a odd:Picky -p limit=VALUE`.\n"
    )


class TestListings:
    def test_algorithms_and_parameters(self):
        out = done("algorithms")
        assert re.search(r"^bo-aco +Bi-objective ant colony", out, re.MULTILINE)
        assert re.search(r"^exact .* Not for kinds of robots", out, re.MULTILINE)
        out = done("algorithms", "bo-aco")
        for said in (
            "\n  evaporation = 0.04  (float, in (0, 1))\n",
            "evaporates in an iteration.\n",
            "\n  initial_pheromone = 1.0  (float or 'bounds', > 0)\n",
            "\n  sampling  (from Python only)\n",
            "-p n_ants=100`",
        ):
            assert said in out

    def test_they_are_wrapped_to_the_terminal(self):
        for args in (["missions"], ["algorithms", "bo-aco"]):
            wide, lines = done(*args), run_botohe(*args, COLUMNS="30").out.splitlines()
            assert flat("\n".join(lines)) == flat(wide)
            long = [line for line in lines if len(line) > 30]
            # No more than an example, or a word that is longer than the rest of a line.
            assert all("`" in line or len(line.split()) <= 6 for line in long), long
            assert len(lines) > len(wide.splitlines())

    def test_a_mission(self):
        out = done("missions", "show", "toy", "--robots", 1, "--picture", "toy.png")
        assert out == f"{load_mission('toy', robots=1).describe()}\nwrote toy.png\n"
        assert Path("toy.png").read_bytes().startswith(b"\x89PNG")

    def test_checks(self):
        good, bad = write_pier(), write_pier(robots=0, name="bad.json")
        said = "pier.json: a valid mission, 3 nodes, 3 arcs, 2 robots, total reward 3.5\n"
        said += "  rewards 0 to 2.5, survivals 0.8 to 1; without effect: dangers\n"
        assert done("missions", "check", good) == said
        ended = run_botohe("missions", "check", bad, "lost.json", "art_musuem", good)
        assert (ended.status, ended.out) == (2, said)
        first, second, third = ended.err.splitlines()
        assert first.startswith("botohe: bad.json: expected robots")
        assert "no such mission; known are art_museum, " in third
        assert second == "botohe: lost.json: no such file or directory"

    def test_help(self):
        out = done("solve", "--help")
        assert "By default a new one: results/solve/MISSION." in flat(out)
        assert not re.search("<bool>|BOOLEAN", out)
        ended = run_botohe("study")  # without a command
        assert ended.out + ended.err == done("study", "--help")
        names = re.search(r"Vehicle of a .plan file: (.*?)\.", flat(done("choose", "--help")))
        assert re.split(", | or ", names[1]) == list(VEHICLES)
        assert re.fullmatch(r"botohe-moo \d+\.\d+\S*\n", done("--version"))


def test_options_of_missions():
    """They are those of a route graph, which says neither what is dangerous nor where to start."""
    save_mission(load_mission("toy"), "site.geojson")
    content = json.loads(Path("site.geojson").read_text())
    del content["mission"], content["generator"]
    for feature in content["features"]:
        del feature["properties"]["metadata"]
    last = content["features"][-1]["properties"]
    last["startid"] = last["endid"]
    Path("site.geojson").write_text(json.dumps(content))
    site = ("solve", "site.geojson", "-a", "greedy", "-n", 50, "--robots", 3, "--base", 2)
    assert "give danger" in refused(*site)
    with pytest.warns(UserWarning, match=r"Left out arcs from a node to itself: features\[\d+\]"):
        done(*site, "--danger", 2, "-m", "reward=3", "--out", "out")
    mission = read_solution("out").mission
    assert (mission.base, mission.robots, mission.total_reward) == (2, 3, 9)  # 3 of 4 are left


class TestChoose:
    """On the front that `solved` has; the toy has two robots and a total reward of 10."""

    def test_by_a_wish(self, solved):
        lines = done("choose", solved, "survivors >= 1.5").splitlines()
        rows = [row for row in front_in(solved) if row[2] >= 1.5]
        plan_id, reward, survivors = max(rows, key=lambda row: row[1])
        means = f"expected reward {reward:.4g}, expected survivors {survivors:.4g}"
        assert lines[0] == f"plan {plan_id}: {means}"
        assert f"plan {plan_id} has the most reward with survivors >= 1.5" in lines[1]
        assert lines[-1] == f"`botohe explore {solved}` makes a page that shows it on the map."
        for robot, trail in enumerate(plans_in(solved)["plans"][plan_id]["trails"]):
            [line] = [line for line in lines if line.startswith(f"robot {robot} (survival ")]
            assert line.split(":  ")[1].removeprefix("stays at ") == " -> ".join(map(str, trail))

    def test_without_a_wish(self, solved):
        solution = read_solution(solved)
        said = f"{solution.describe()}\n\nThe knee is a mark"
        assert done("choose", solved).startswith(said)
        choice = solution.toward(reward=5, survivors=1.5)
        assert done("choose", solved, "--toward", 5, 1.5).startswith(f"plan {choice.index}: ")

    def test_files(self, solved):
        """What is in them is tested where they are written."""
        pick = ("choose", solved, "--plan", 2, "--out")
        assert done(*pick, "plan.csv").endswith("wrote plan.csv\n")
        assert Path("plan.csv").read_text().startswith("robot,")
        names = ["graph.geojson", "robot_0.json", "robot_1.json"]
        wrote = [f"wrote robots/nav2/{name}" for name in names]
        assert done(*pick, "robots/nav2").splitlines()[-3:] == wrote
        done(*pick, "plan.pdf")
        assert Path("plan.pdf").read_bytes().startswith(b"%PDF")

    def test_files_for_what_flies_and_dives(self, solved):
        path = shutil.copytree(solved, "solved") / Path("mission.json")
        content = json.loads(path.read_text())
        content["graph"]["geographic"] = True
        path.write_text(json.dumps(content))
        fly = ["choose", "solved", "--plan", 2, "--out", "site.plan"]
        assert done(*fly, "--altitude", 30).splitlines()[-1] == "wrote site-1.plan"
        assert "an altitude for the multicopter, in metres (--altitude)" in refused(*fly)
        done(*fly, "--vehicle", "submarine", "--altitude", -4)
        sea = json.loads(Path("site-1.plan").read_text())["mission"]
        assert (sea["vehicleType"], sea["items"][0]["Altitude"]) == (12, -4)

    def test_the_impossible(self, solved):
        args = ["choose", solved, "survivors >= 1.9", "reward >= 9", "--out", "plan.json"]
        ended = run_botohe(*args)
        assert ended.status == 1
        assert "comes nearest: it misses " in ended.out
        assert ended.err == "botohe: no plan meets all wishes; nothing is written.\n"
        assert names_in(".") == []


class TestBound:
    def check(self, verdict, bound, solution):
        """Check the sentence that says how good a front is."""
        gap = bound.gap(solution.objectives)
        assert verdict.startswith(
            f"area {solution.area:.4f}; proven upper bound on area {bound.area:.4f}: "
            f"within {100 * gap:.2f} % of the optimum, proved "
        )
        return gap

    def test_a_front_is_judged(self, solved):
        out = done("bound", "toy", "--front", solved, "--out", "bound.json")
        toy, solution = load_mission("toy"), read_solution(solved)
        bound = FrontBound.load("bound.json", toy)
        title, _, verdict, _, head, *rows, wrote = out.splitlines()
        assert title == f"{toy.title}: 5 nodes, 12 arcs, 2 robots, total reward 10"
        assert wrote == "wrote bound.json"
        self.check(verdict, bound, solution)
        assert head.split() == ["expected", "survivors", "reward", "at", "most", "found"]
        assert len(rows) == 9
        for row in rows:
            survivors, most, found = map(float, row.split())
            within = solution.objectives[solution.objectives[:, 1] >= survivors - 1e-9, 0]
            assert (most, found) == pytest.approx((bound.bound(survivors), within.max()), rel=1e-3)

    def test_the_limits_of_the_front_count(self):
        args = ["solve", "toy", "-a", "greedy", "-n", 50, "--min-survival", 0.4]
        done(*args, "--max-length", 6, "--out", "kept")
        out = done("bound", "toy", "--front", "kept", "--out", "bound.json")
        assert "travel budget 6" in out.splitlines()[0]
        record = json.loads(Path("bound.json").read_text())
        assert (record["min_survival"], record["max_length"]) == (0.4, 6.0)

    def test_a_front_is_certified_and_drawn_with_its_bound(self):
        solve = ("solve", "toy", "-a", "greedy", "-n", 50, "--out", "out")
        done(*solve)
        plain = {name: Path("out", name).read_bytes() for name in FILES}
        out = done(*solve, "--certify", 5)
        assert names_in("out") == sorted([*FILES, "bound.json"])
        *_, empty, verdict, first, second = out.partition("\n\nNext:")[0].splitlines()
        assert (empty, first, second) == ("", "wrote out/bound.json", "wrote out/front.png")
        solution = read_solution("out")
        bound = FrontBound.load("out/bound.json", solution.mission)
        assert self.check(verdict, bound, solution) > 0.01
        changed = [name for name in FILES if Path("out", name).read_bytes() != plain[name]]
        assert changed == ["front.png"]
        done("choose", "out")

    def test_kinds_of_robots(self):
        site = Mission(load_mission("toy").graph, base=1, kinds=[Kind("drone", 2, end=4)])
        save_mission(site, "site.json")
        out = done("solve", "site.json", "-a", "greedy", "-n", 50, "--out", "out", "--certify", 5)
        assert "as if each were the best of all kinds, and rewards counted on arrival." in out
        rows = done("bound", "site.json", "--front", "out").splitlines()
        assert rows[-1].split() == ["2", "-", "-"]  # nobody can stay at the base


class TestUnderWay:
    def test_replan(self, solved):
        Path("events.csv").write_text("robot,event,node\n0,lost,\n")
        out = done("replan", solved, "events.csv", "--plan", 0, "--out", "rest")
        assert "One more survivor costs" in flat(out)
        rest = read_solution("rest")
        assert rest.mission.robots == 1
        assert "Robots have new rows: row 0 was row 1." in out
        assert names_in("rest") == sorted([*FILES, "replan.png"])
        *_, said, choose = out.splitlines()
        assert said.startswith("The new plan is plan ")
        assert done(*shlex.split(choose)[1:]).startswith("plan ")

    def test_replay(self, solved, monkeypatch):
        monkeypatch.setattr("webbrowser.open", lambda _: True)
        given = ("--plan", 0, "--price", 2, "--number", 3)
        out = done("replay", solved, *given, "--out", "page.html", "--open")
        solution = read_solution(solved)
        played = play_mission(solution.mission, solution.plans[0], price=2, number=3)
        assert flat(out) == f"{played} wrote page.html"
        assert Path("page.html").read_text("utf-8") == replay_page(played)

    def test_simulate(self, solved):
        given = ("--plan", 0, "--price", 2, "--missions", 30, "--policy", "losses")
        out = done("simulate", solved, *given, "--out", "policies.png")
        solution = read_solution(solved)
        played = {"price": 2, "missions": 30}
        outcomes = simulate_policy(solution.mission, solution.plans[0], "losses", **played)
        tables = (text.splitlines()[1:4] for text in (out, str(outcomes)))
        told, made = ([line.split()[:-1] for line in lines] for lines in tables)
        assert told == made  # the last are seconds
        assert out.startswith("One more survivor costs 2 reward.")
        assert Path("policies.png").stat().st_size > 10_000


def test_explore(solved, folder, monkeypatch):
    """What is on the page is tested in tests/explorer."""
    wishes = ["--choose", "survivors >= 1.5", "--choose", "reward >= 1"]
    out = done("explore", solved, "--out", "page.html", *wishes)
    chosen = done("choose", solved, "survivors >= 1.5", "reward >= 1").splitlines()
    assert out == f"{chosen[1]}\nwrote page.html\n"
    page = Path("page.html").read_text("utf-8")
    assert page.startswith("<!DOCTYPE html>")
    Image.new("L", (2, 2)).save("map.png")
    Path("map.yaml").write_text("image: map.png\nresolution: 1.0\norigin: [0, 0, 0]\n", "utf-8")
    done("explore", solved, "--out", "plain.html", "--background", "map.yaml")
    assert Path("plain.html").read_text("utf-8") != page
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    ended = run_botohe("explore", solved, "--out", "page.html", "--open")
    assert opened == [(folder / "page.html").as_uri()]
    assert (ended.status, ended.out) == (0, "wrote page.html\n")
    assert "no browser here that could be started; open page.html" in ended.err


class TestImport:
    TABLES = ("missions", "import", "--nodes", "nodes.csv", "--arcs", "arcs.csv", "--both-ways")

    def test_from_tables_to_a_plan(self):
        nodes = [f"{room};{room % 7};{(room - 1) % 4};{(room - 1) // 4}" for room in range(1, 9)]
        arcs = [f"{room},{room + 1},0.9{room}" for room in (1, 2, 3, 5, 6, 7)]
        arcs += [f"{room},{room + 4},0.9" for room in range(1, 5)]
        Path("nodes.csv").write_text("\n".join(["Label;Reward;X;Y", *nodes]), "utf-8-sig")
        Path("arcs.csv").write_text("\n".join(["Tail,Head,Survival", *arcs, ""]))
        args = [*self.TABLES, "--base", 1, "--robots", 2, "-m", "title=Rooms"]
        brief = (
            "8 nodes, 20 arcs, 2 robots, total reward 22\n  rewards 0 to 6, survivals 0.9 to 0.97"
        )
        assert done(*args, "--out", "site.json") == f"wrote site.json: {brief}\n"
        mission = load_mission("site.json")
        assert (mission.name, mission.title, mission.base) == ("site", "Rooms", "1")
        done("solve", "site.json", "-n", 200, "--out", "found")
        done("choose", "found", "P(survivors >= 1) >= 0.6 and reach 4 >= 0.5", "--out", "plan.json")
        content = json.loads(Path("plan.json").read_text())
        plan = mission.plan(content["trails"])
        assert mission.evaluate([plan]).tolist() == [[content["reward"], content["survivors"]]]
        done(*args, "-m", "lengths_from_pos=true", "--max-length", 9, "--out", "long.json")
        mission = load_mission("long.json")
        assert (mission.max_length, mission.graph.edges["1", "5"]["length"]) == (9, 1)

    def test_kinds_of_robots(self):
        """A dock, a roof that only drones get to, and a lab with a sample."""
        self.pads()
        kinds = [
            *("--kind", "drone=2,start=roof, east,max_length=4"),
            *("--kind", "rover = 1, min_survival=0.5"),
        ]
        out = done(*self.TABLES, "--base", "dock", *kinds, "--out", "site.json")
        brief = "3 nodes, 4 arcs, 3 robots (2 drone, 1 rover), total reward 7"
        assert out == f"wrote site.json: {brief}\n  rewards 0 to 5, survivals 0 to 0.9\n"
        assert load_mission("site.json").kinds == (
            Kind("drone", 2, start="roof, east", max_length=4),
            Kind("rover", 1, min_survival=0.5),
        )
        assert done("missions", "show", "site.json").splitlines()[3:] == [
            "  team          3 robots (2 drone, 1 rover) at base 'dock'",
            "  total reward  7",
            "  drone         2 robots from 'roof, east' to 'dock', can take 4 arcs, collects at 2 "
            "of 2 paying nodes, max_length 4",
            "  rover         1 robot from 'dock' to 'dock', can take 2 arcs, collects at 1 of 2 "
            "paying nodes, min_survival 0.5",
            "  on return     1 of 2 paying nodes",
            "  depots        'dock'",
            "  survival      0.7 to 0.9",
        ]

    def pads(self):
        nodes = 'label,reward,share:drone,pays\ndock,0,,\n"roof, east",2,,\nlab,5,0.5,return\n'
        arcs = 'tail,head,Survival:drone,survival:rover\ndock,lab,0.8,0.9\nlab,"roof, east",0.7,\n'
        Path("nodes.csv").write_text(nodes)
        Path("arcs.csv").write_text(arcs)

    BAD: ClassVar = {
        "": ["column 'share:drone': no such kind; the mission lists no kinds"],
        "--kind drone": ["Expected a kind as NAME=ROBOTS or", "got 'drone'."],
        "--kind drone=1,stat=lab": ["kinds[0]: there is no 'stat' of a kind"],
        "--kind drone=1,robots=2": ["Expected 'robots' once, got it again: 'robots=2'."],
        "--kind drone=x,max_length=2,5 --kind rover=1,end=la": [
            "kind 'drone': expected robots to be an integer in [1, 1000000], got 'x'",
            "kind 'drone': expected a finite max_length >= 0, got '2,5'",
            "kind 'rover': end 'la': no such node; most alike are lab, ",
        ],
        "-m depots=2": ["no parameter 'depots'"],
        "--arcs lost.csv": ["lost.csv: no such file"],
        "--kind drone=1 --kind rover=1 --out no/site.json": ["no: no such folder"],
        "--kind drone=1 --kind rover=1 --out site.txt": ["ends in one of .graphml, .json"],
    }

    @pytest.mark.parametrize("line", BAD)
    def test_what_is_refused(self, line):
        self.pads()
        given = [*self.TABLES, "--base", "dock", "--out", "site.json", *shlex.split(line)]
        message = refused(*given)
        for words in self.BAD[line]:
            assert words in message


class TestFromMap:
    @pytest.fixture(autouse=True)
    def site(self):
        """A corridor of 12 metres, half a metre wide, with another one across it."""
        cells = np.zeros((60, 120), np.uint8)
        cells[28:33, 2:118] = cells[2:58, 50:55] = 254
        Image.fromarray(cells).save("site.png")
        text = "image: site.png\nresolution: 0.1\norigin: [0, 0, 0]\nmode: scale\n"
        Path("site.yaml").write_text(text)

    def test_a_mission_and_its_picture(self):
        """The picture does not take the place of the map, which has the mission's own name."""
        before = Path("site.png").read_bytes()
        given = ["site.yaml", "--radius", 0.25, "--out", "site.json", "--hazard", "site.yaml"]
        brief = "5 nodes, 8 arcs, 3 robots, total reward 4"
        out = f"wrote site.json: {brief}\nwrote site-graph.png\n"
        assert done("missions", "from-map", *given) == out
        assert Path("site-graph.png").stat().st_size > 10_000
        assert Path("site.png").read_bytes() == before
        mission = load_mission("site.json")
        assert mission.graph.nodes[mission.base]["pos"] == pytest.approx([0.45, 2.95])
        assert (
            mission.world.graph.mean_survival.min() > 0.99
        )  # free space is white, where it is safe

    def test_options(self):
        given = ["--radius", 0.25, "--spacing", 2, "--robots", 2, "--danger", 0.5, "--base", "9,3"]
        done("missions", "from-map", "site.yaml", *given, "--out", "a.json")
        mission = load_mission("a.json")
        assert mission.robots == 2
        assert math.dist(mission.graph.nodes[mission.base]["pos"], (9, 3)) < 1
        for _, _, arc in mission.graph.edges(data=True):
            assert arc["length"] <= 2
            assert arc["survival"] == pytest.approx(math.exp(-0.5 * arc["length"]))

    def test_what_is_refused(self):
        for line, words in {
            "site.yaml --base a,b": "a node's number, or a place X,Y, got 'a,b'",
            "site.yaml --radius 2": "site.yaml: expected ways through free space for a",
            "lost.yaml": "lost.yaml: no such file",
            "site.yaml --out no/a.json": "no: no such folder",
            "site.yaml --out a.csv": "a.csv: expected a file name that ends in one",
        }.items():
            assert words in refused("missions", "from-map", "--out", "a.json", *shlex.split(line))


def test_what_a_terminal_would_obey_is_written_as_escapes_but_kept_in_files():
    codes = "\x1b]0;x\x07\x9b31m\u202e"
    label, title = f"reef{codes}", f"Pier{codes}, 漁夫 👨\u200d👩"
    graph = nx.DiGraph([("dock", label), (label, "dock")], title=title)
    nx.set_node_attributes(graph, {"dock": 0, label: 1}, "reward")
    nx.set_edge_attributes(graph, 0.9, "survival")
    save_mission(Mission(graph, base="dock", robots=1), "pier.json")
    shown = done("missions", "show", "pier.json")
    assert r"Pier\x1b]0;x\x07\x9b31m\u202e, 漁夫 👨‍👩" in shown
    done("solve", "pier.json", "-a", "greedy", "-n", 50, "--out", "found")
    chosen = done("choose", "found", "reward >= 0.5", "--out", "plan.json")
    assert r"reef\u001b]0;x\u0007\x9b31m\u202e" in chosen  # partly escaped in its quotes
    assert label in json.loads(Path("plan.json").read_text())["trails"][0]
    unknown = refused("choose", "found", "reach ref >= 0.5")
    assert r"has no node 'ref'; most alike are reef\x1b]0;x\x07\x9b31m\u202e" in unknown
    for text in (shown, chosen, unknown):
        assert not set(text) & set(codes) - set("]0;x31m")
