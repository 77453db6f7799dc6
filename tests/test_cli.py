"""The ``botohe`` command, as real processes."""

import csv
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
from typing import NamedTuple

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
    read_solution,
    save_mission,
    simulate_policy,
)
from botohe_moo.cli.progress import showing
from botohe_moo.decide.plan_files import VEHICLES
from botohe_moo.explorer import replay_page
from botohe_moo.underway import play_mission
from tests.forked import run_forked

BOTOHE = Path(sys.executable).parent / "botohe"
FILES = ["front.csv", "front.png", "mission.json", "mission.png", "plans.json"]


class Ended(NamedTuple):
    status: int
    out: str
    err: str


@pytest.fixture
def botohe(tmp_path):
    """Run a command line in the test's own folder; code, if any, runs before it."""

    def botohe(*args, code="", **env):
        command = [BOTOHE, *map(str, args)]
        if code:
            start = f"import botohe_moo.cli, sys; sys.argv = {list(map(str, command))}"
            code = f"{start}\n{textwrap.dedent(code)}\nbotohe_moo.cli.main()"
            command = [sys.executable, "-c", code]
        usual = {name: value for name, value in os.environ.items() if name != "COLUMNS"}
        done = run_forked(command, cwd=tmp_path, env={**usual, **env})
        return Ended(done.returncode, done.stdout, done.stderr)

    return botohe


@pytest.fixture
def refused(botohe, tmp_path):
    """Run a command line that is refused: status 2, and nothing is left behind."""

    def refused(*args, **options):
        before = sorted(tmp_path.rglob("*"))
        ended = botohe(*args, **options)
        assert ended.status == 2, ended
        assert ended.out == ""
        assert ended.err.count("botohe: ") + ended.err.count("Error: ") == 1
        assert "Traceback" not in ended.err
        assert sorted(tmp_path.rglob("*")) == before
        return ended.err

    return refused


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A search that was started as users start it, and its folder."""
    folder = tmp_path_factory.mktemp("solved")
    args = ["solve", "toy", "--algorithm", "bo-aco", "--evaluations", "250", "--seed", "3"]
    # What makes matplotlib talk or fail, and rich take a file for a terminal.
    disturbing = {"MPLCONFIGDIR": "/dev/null/none", "MPLBACKEND": "none", "FORCE_COLOR": "1"}
    env = {**os.environ, **disturbing}
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


@pytest.fixture
def pier(tmp_path):
    """Write a mission file."""

    def pier(name="pier.json", **graph):
        content = {
            "directed": True,
            "multigraph": False,
            "graph": {"name": "pier", "base": "a", "robots": 2, **graph},
            "nodes": [{"id": "a", "reward": 0}, {"id": "b", "reward": 1.5}],
            "edges": [
                {"source": "a", "target": "b", "survival": 0.9},
                {"source": "b", "target": "a", "survival": 0.8},
            ],
        }
        (tmp_path / name).write_text(json.dumps(content))
        return name

    return pier


class TestSolve:
    def test_it_ends_well(self, solved):
        ended, folder = solved
        assert ended.status == 0
        assert all("compiling" in line for line in ended.err.splitlines())
        assert names_in(folder) == FILES
        assert [line for line in ended.out.splitlines() if line.startswith("wrote ")] == [
            f"wrote out/{name}"
            for name in ("front.csv", "plans.json", "mission.json", "front.png", "mission.png")
        ]
        assert "5 nodes, 12 arcs, 2 robots, total reward 10" in ended.out
        assert "spent 250 evaluations" in ended.out

    def test_islands_and_threads(self, botohe, tmp_path):
        given = ("-p", "n_islands=2", "-p", "n_threads=1")
        told = botohe("solve", "toy", "-n", 60, *given, "-o", "out")
        assert told.status == 0
        assert plans_in(tmp_path / "out")["parameters"] == {"n_islands": 2, "n_threads": 1}

    def test_what_comes_next(self, solved):
        ended, folder = solved
        commands = ended.out.partition("\nNext:\n")[2].splitlines()
        assert len(commands) == 2
        explore, choose = (shlex.split(command)[1:] for command in commands)
        assert explore == ["explore", "out", "--open"]
        chosen = subprocess.run(
            [BOTOHE, *choose], cwd=folder.parent, capture_output=True, text=True
        )
        assert (chosen.returncode, chosen.stderr) == (0, "")

    def test_the_numbers_are_those_of_the_trails(self, solved):
        _, folder = solved
        mission, plans = load_mission("toy"), plans_in(folder)["plans"]
        evaluated = mission.evaluate([mission.plan(plan["trails"]) for plan in plans]).tolist()
        front = front_in(folder)
        assert len(front) > 3
        assert [list(row[1:]) for row in front] == evaluated
        assert [(p["plan_id"], p["reward"], p["survivors"]) for p in plans] == front

    @pytest.mark.slow
    def test_the_seed_decides(self, solved, botohe, tmp_path):
        _, folder = solved
        again = ["solve", "toy", "-n", 250, "-a", "bo-aco"]
        for seed in (3, 4):
            assert botohe(*again, "-s", seed, "-o", f"seed{seed}").status == 0
        for name in FILES:
            same = (folder / name).read_bytes()
            assert (tmp_path / "seed3" / name).read_bytes() == same
            assert name.startswith("mission.") or (tmp_path / "seed4" / name).read_bytes() != same

    @pytest.mark.slow
    def test_a_travel_budget(self, botohe, refused, tmp_path):
        (tmp_path / "sites.txt").write_text("n 4\nm 1\ntmax 4.5\n0 0 0\n2 0 5\n0 3 1\n0 0 0\n")
        found = {}
        for limit, said in ((None, ", travel budget 4.5"), (3, ", travel budget 3"), ("inf", "")):
            given = [] if limit is None else ["--max-length", limit]
            ended = botohe("solve", "sites.txt", "-a", "nsga2", "-n", 200, *given, "-o", "found")
            assert ended.status == 0
            assert f"total reward 6{said}\n" in ended.out
            content = plans_in(tmp_path / "found")
            mission = load_mission(tmp_path / "found" / "mission.json")
            plans = [mission.plan(plan["trails"]) for plan in content["plans"]]
            found[content["max_length"]] = mission.trail_lengths(plans).max()
        assert found == {4.5: 4, 3: 0, None: pytest.approx(5 + 13**0.5)}
        assert re.search("max.length", refused("solve", "sites.txt", "--max-length", "nan"))

    def test_parameters(self, botohe, tmp_path):
        ended = botohe(
            *("solve", "terrain", "-m", "nodes=9", "-m", "seed=2", "--robots", 4, "-n", 60),
            *("-a", "bo-aco", "-p", "n_ants=20", "-p", "evaporation=1e-1", "-p", "heuristic=false"),
            *("-p", "initial_pheromone=bounds", "--seed", 10**30),
        )
        assert ended.status == 0, ended
        assert ended.err == ""
        content = plans_in(tmp_path / "results" / "solve" / "terrain")
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

    def test_without_a_folder_nothing_is_written_over(self, botohe, tmp_path):
        taken = tmp_path / "results" / "solve" / "toy" / "front.csv"
        taken.parent.mkdir(parents=True)
        taken.write_text("precious")
        ended = botohe("solve", "toy", "-n", 9)
        assert (ended.status, ended.err) == (0, "")
        assert "wrote results/solve/toy-2/front.csv\n" in ended.out
        assert names_in(taken.parent.parent / "toy-2") == FILES
        assert taken.read_text() == "precious"

    def test_the_front_is_printed_before_pictures_are_drawn(self, botohe, tmp_path):
        code = """
            import botohe_moo.plots

            def plot_front(*args):
                print("drawing", flush=True)
                raise RuntimeError("No such glyph.")

            botohe_moo.plots.plot_front = plot_front
        """
        ended = botohe("solve", "toy", "-n", 9, "-o", "out", code=code)
        assert ended.status == 1
        assert re.search(r"area 0\.\d{4}, \d+ plans on the front\ndrawing\n$", ended.out)
        assert ended.err == "botohe: no picture (No such glyph.); the tables are in out.\n"
        assert names_in(tmp_path / "out") == ["front.csv", "mission.json", "plans.json"]

    @pytest.mark.slow
    def test_pictures_are_not_waited_for(self, tmp_path):
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
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0
        front, pictures = (set(line.split()) for line in done.stderr.splitlines()[-2:])
        assert {"botohe_moo.solution", "numba"} <= front
        assert not front & {"matplotlib.pyplot", "scipy.spatial"}
        assert not pictures & {"seaborn", "pandas", "scipy.stats"}

    @pytest.mark.slow
    def test_output_that_holds_odd_characters(self, botohe, pier, tmp_path):
        code = "import sys; sys.stdout.reconfigure(encoding='latin-1', errors='strict')"
        ended = botohe("solve", pier(title="λ and more"), "-n", 9, "-o", "out\udcff", code=code)
        assert (ended.status, ended.err) == (0, "")
        assert ended.out.startswith(r"\u03bb and more: 2 nodes")
        assert r"wrote out\udcff/front.csv" in ended.out
        assert names_in(tmp_path / "out\udcff") == FILES

    @pytest.mark.slow
    def test_output_that_nobody_reads(self, botohe, tmp_path):
        assert botohe("solve", "toy", "-n", 9, "-o", "unread", code=UNREAD) == (0, "", "")
        assert names_in(tmp_path / "unread") == FILES
        code = "import sys; sys.stdout = None"
        assert botohe("solve", "toy", "-n", 9, "-o", "closed", code=code) == (0, "", "")
        assert names_in(tmp_path / "closed") == FILES


FULL = "import os; os.dup2(os.open('/dev/full', os.O_WRONLY), 1)"


@pytest.mark.parametrize(
    "args", [["solve", "toy", "-n", 9, "-o", "out"], ["missions"], ["--help"], ["solve", "--help"]]
)
def test_output_that_cannot_be_written(botohe, tmp_path, args):
    ended = botohe(*args, code=FULL)
    assert ended == (1, "", "botohe: standard output: No space left on device\n")
    assert names_in(tmp_path) == []


UNREAD = """
    import os
    reader, writer = os.pipe()
    os.close(reader)
    os.dup2(writer, 1)
"""


@pytest.mark.slow
def test_terminal_and_interrupt(tmp_path):
    """A huge budget in a pseudo-terminal: watch the progress bar, then press Ctrl-C."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    process = subprocess.Popen(
        [BOTOHE, "solve", "toy", "-a", "bo-aco", "--evaluations", str(10**9), "--out", "out"],
        cwd=tmp_path,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
        stdout=subprocess.PIPE,
        stderr=theirs,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(theirs)
    shown, pressed = b"", False
    alarm = threading.Timer(120, process.kill)  # should Ctrl-C do nothing
    alarm.start()
    try:
        while True:
            try:
                shown += os.read(ours, 65536)
            except OSError:  # the other end is closed
                break
            plain = re.sub(rb"\x1b\[[0-9;?]*[A-Za-z]", b"", shown)
            times = rb"area 0\.[5-9]\d{3}  \d:\d\d:\d\d +\d+:\d\d:\d\d"  # passed and left
            if not pressed and re.search(times, plain):
                pressed = True
                process.send_signal(signal.SIGINT)
        out = process.communicate()[0]
    finally:
        alarm.cancel()
        process.kill()
        os.close(ours)
    assert pressed
    assert b"%" in plain
    assert b"evaluations" in plain
    assert b"Traceback" not in plain
    assert b"\n" + STOPPING.strip().encode() + b"\r\n" in plain
    assert shown.rindex(b"\x1b[?25h") > shown.rindex(b"\x1b[?25l")  # the cursor is there again
    assert process.returncode == 130
    assert "stopped after" in out
    assert names_in(tmp_path) == ["out"]
    assert names_in(tmp_path / "out") == FILES
    content = plans_in(tmp_path / "out")
    assert content["interrupted"] is True
    assert 0 < content["evaluations"] < 10**9
    assert content["evaluations"] % 100 == 0  # no iteration was left half-done
    assert len(front_in(tmp_path / "out")) == len(content["plans"]) > 3


def test_lines_where_there_is_no_terminal(capfd):
    with showing("starting", every=0.05) as show:
        time.sleep(0.2)
        show("half of it", 1, 2)
        time.sleep(0.2)
        assert numba.njit(lambda x: [x] * 2)(1) == [1, 1]  # which compiles for a while
        time.sleep(0.2)
    lines = [line.removeprefix("botohe: ") for line in capfd.readouterr().err.splitlines()]
    shown = [re.sub(r", \d:\d\d:\d\d$", "", line) for line in lines]
    assert [words for words, _ in itertools.groupby(shown)] == [
        "starting",
        "half of it",
        "compiling for this machine, once.",
        "compiling",
        "half of it",
    ]


# Sends a signal when something of a module is called.
WHEN_CALLED = """
    import os, signal, {module}

    def {name}(*args, usual={module}.{name}, **kwargs):
        for _ in range({times}):
            os.kill(os.getpid(), signal.{signal})
        return usual(*args, **kwargs)

    {module}.{name} = {name}
"""


def when_called(module, name, *, times=1, sent="SIGINT"):
    return WHEN_CALLED.format(module=module, name=name, times=times, signal=sent)


STOPPING = "botohe: stopping; what was found will be written. Press Ctrl-C again to break off.\n"


class TestSignals:
    @pytest.mark.slow
    def test_it_is_answered_at_once(self, tmp_path):
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
        process = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(code)],
            cwd=tmp_path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        alarm = threading.Timer(120, process.kill)
        alarm.start()
        try:
            assert "computing\n" in iter(process.stdout.readline, "")
            process.send_signal(signal.SIGINT)
            assert process.stderr.readline() == STOPPING  # while it computes
            out, err = process.communicate("x")
        finally:
            alarm.cancel()
            process.kill()
        assert (process.returncode, err) == (130, "")
        assert "stopped after" in out
        assert plans_in(tmp_path / "out")["interrupted"] is True

    @pytest.mark.slow
    def test_twice_while_searching(self, botohe, tmp_path):
        code = when_called("botohe_moo.cli.progress", "showing_search", times=2)
        ended = botohe("solve", "toy", "-o", "out", code=code)
        assert (ended.status, ended.err) == (130, STOPPING)
        assert names_in(tmp_path) == []


def test_an_option_given_twice(refused):
    given = ["solve", "site.geojson", "--base", "1", "-m", "base=2"]
    assert "Expected --base or -m base=VALUE, got both." in refused(*given)


def test_a_route_graph_needs_a_base_and_a_danger(botohe, refused, tmp_path):
    """From the file that Nav2 has to a front, and what is left out of it is said."""
    save_mission(load_mission("art_museum"), tmp_path / "site.geojson")
    content = json.loads((tmp_path / "site.geojson").read_text())
    del content["mission"], content["generator"]
    for feature in content["features"]:
        del feature["properties"]["metadata"]
    last = content["features"][-1]["properties"]
    last["startid"] = last["endid"]
    (tmp_path / "site.geojson").write_text(json.dumps(content))
    site = ("solve", "site.geojson", "--evaluations", 500, "--robots", 2)
    assert "give base" in refused(*site)
    assert "give danger" in refused(*site, "--base", 1)
    assert "there is no such node" in refused(*site, "--base", 99, "--danger", 1)
    assert "no parameter 'base'" in refused("solve", "toy", "--base", 1)
    done = botohe(*site, "--base", 1, "--danger", 2, "--out", "out")
    assert done.status == 0, done.err
    assert "Left out arcs from a node to itself: features[100]; " in done.err
    assert "have no way back: 26." in done.err
    mission = read_solution(tmp_path / "out").mission
    assert (mission.base, mission.robots, len(mission.nodes)) == (1, 2, 26)
    checked = botohe("missions", "check", "site.geojson", "--base", 1, "--danger", 2, "--robots", 2)
    assert checked.out.startswith("site.geojson: a valid mission, 26 nodes")
    text = "image: map.png\nmode: scale\nresolution: 1\norigin: [-1, -1]\nnegate: 1\n"
    (tmp_path / "map.yaml").write_text(text)
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(tmp_path / "map.png")
    done = botohe(*site, "--base", 1, "--danger", 2, "--hazard", "map.yaml", "--out", "safe")
    assert done.status == 0, done.err
    assert (read_solution(tmp_path / "safe").mission.world.graph.survival == 1).all()


class TestBadMissions:
    """What is wrong with a mission file, and what the message must name."""

    def test_malformed(self, refused, tmp_path):
        (tmp_path / "pier.json").write_text("[1, 2]")
        for command in (["solve"], ["missions", "show"], ["missions", "check"]):
            message = refused(*command, "pier.json")
            assert message.startswith("botohe: pier.json: expected the file to be a mapping")

    def test_missing(self, refused):
        for command in (["solve"], ["missions", "show"]):
            message = refused(*command, "lost.json")
            assert message.startswith("botohe: lost.json: no such file")
            message = refused(*command, "power-plant")
            assert "there is no such mission; known are power_plant" in message

    def test_parameters(self, refused):
        for command in (["solve"], ["missions", "show"]):
            message = refused(*command, "terrain", "-m", "nodes=many")
            assert "Expected nodes to be an integer >= 2, got 'many'." in message


class TestBadOptions:
    @pytest.mark.parametrize(
        ("given", "named"),
        [
            (["--evaluations", "0"], ["'--evaluations'", "greater than or equal to 1"]),
            (["-n", "2.5"], ["--evaluations", "integer"]),
            (["--min-survival", "1.5"], ["Expected min_survival in [0, 1], got 1.5."]),
            (["--sed", "1"], ["--sed", "--seed"]),
            (["--algorithm", "boaco"], ["'boaco': there is no such algorithm; known are bo-aco, "]),
            (
                ["-a", "bo-aco", "-p", "evaporation=1.3", "-p", "heuristic=maybe"],
                [
                    "'bo-aco': Expected evaporation in (0, 1), got 1.3.",
                    "Expected heuristic to be true or false, got 'maybe'.",
                ],
            ),
            (["-p", "n_islands=0"], ["Expected n_islands in [1, ", "got 0."]),
            (["-p", "n_threads=1025"], ["Expected n_threads in [1, 1024], got 1025."]),
            (["-a", "greedy", "-p", "n_threads=2"], ["there is no parameter 'n_threads'"]),
            (["--certify", "0"], ["'--certify': Input should be greater than or equal to"]),
            (["-p", "n_ants=1", "-p", "n_ants=2"], ["Expected 'n_ants' once, got it again"]),
            (["-p", "n_ants"], ["Expected a parameter as NAME=VALUE, got 'n_ants'."]),
            (["-p", "n_ants=[1"], ["a number, true, false or text for 'n_ants', got '[1'"]),
        ],
    )
    def test_of_solve(self, refused, given, named):
        message = refused("solve", "toy", "--out", "out", *given)
        assert all(name in message for name in named), message

    def test_folder(self, refused, tmp_path):
        (tmp_path / "file").touch()
        message = refused("solve", "toy", "--out", "file")
        assert message == "botohe: file: expected a folder to write to\n"

    @pytest.mark.parametrize(
        "given", [["solve", "toy", "--out"], ["missions", "show", "toy", "--picture"]]
    )
    def test_empty_path(self, refused, given):
        message = refused(*given, "")  # as the shell makes of an unset variable
        assert "expected a path, got an empty text" in message

    def test_of_others(self, refused):
        message = refused("slove")
        assert all(name in message for name in ("'slove'", "'solve'", "botohe --help"))
        assert "known are bo-aco, " in refused("algorithms", "boaco")

    @pytest.mark.slow
    def test_too_much_for_the_memory(self, botohe, tmp_path):
        code = """
            import botohe_moo

            def search(*args, **kwargs):
                raise MemoryError("Unable to allocate 7.1 PiB.")

            botohe_moo.solve = search
        """
        ended = botohe("solve", "toy", "--out", "out", code=code)
        assert ended.status == 1
        assert ended.err == "botohe: there is not enough memory. Unable to allocate 7.1 PiB.\n"
        assert names_in(tmp_path) == []


ODD = """
    from pymoo.core.algorithm import Algorithm

    class Nothing(Algorithm):
        '''Find nothing, which is hard to :class:`beat`.'''

        def _initialize_advance(self, **_):
            self.evaluator.n_eval += 10

        _advance = _initialize_advance

        def _set_optimum(self):
            pass

    class Picky(Nothing):
        '''Refuse every mission.

        Parameters
        ----------
        limit
            How many ``nodes`` there may be at most.
        style
            How to refuse: rudely.
        '''

        def __init__(self, *, limit: int, style: "str | None" = None, start: list[Algorithm] = ()):
            super().__init__()

        def _setup(self, problem, **_):
            raise ValueError(f"Expected at most 3 nodes, got {len(problem.mission.nodes)}.")
"""


@pytest.fixture
def odd(tmp_path_factory):
    """Install another package; gives the code that makes it known."""
    site = tmp_path_factory.mktemp("site")
    (site / "odd.py").write_text(textwrap.dedent(ODD))
    info = site / "odd-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: odd\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[botohe_moo.algorithms]\nnothing = odd:Nothing\npicky = odd:Picky\n"
    )
    return f"import sys; sys.path.insert(0, {str(site)!r})"


@pytest.mark.slow
class TestOtherPackages:
    def test_nothing_is_found(self, botohe, tmp_path, odd):
        ended = botohe("solve", "toy", "-a", "nothing", "-n", 30, code=odd)
        assert ended.status == 1
        expected = "botohe: nothing found no plan in 30 evaluations; nothing is written.\n"
        assert ended.err == expected
        assert names_in(tmp_path) == []

    def test_the_mission_is_refused(self, refused, botohe, odd):
        args = ["solve", "toy", "-a", "picky"]
        message = refused(*args, code=odd)
        assert message.startswith("botohe: Algorithm 'picky': ")
        ended = botohe(*args, "-p", "limit=3", code=odd)
        assert ended.status == 2
        assert ended.err == "botohe: Algorithm 'picky': Expected at most 3 nodes, got 5.\n"

    def test_their_parameters(self, botohe, odd):
        out = botohe("algorithms", "picky", code=odd).out
        assert out == (
            "picky: Refuse every mission.\n"
            "\n"
            "  limit  (int)\n"
            "      How many nodes there may be at most.\n"
            "\n"
            "  style = null  (str or None)\n"
            "      How to refuse: rudely.\n"
            "\n"
            "  start  (from Python only)\n"
            "\n"
            "Give one as in `botohe solve MISSION -a picky -p limit=VALUE`.\n"
        )
        out = botohe("algorithms", "nothing", code=odd).out
        assert out == "nothing: Find nothing, which is hard to beat.\n"


class TestListings:
    def test_algorithms(self, botohe):
        ended = botohe("algorithms")
        assert (ended.status, ended.err) == (0, "")
        assert re.search(r"^bo-aco +Bi-objective ant colony", ended.out, re.MULTILINE)
        assert re.search(r"^random +\S", ended.out, re.MULTILINE)

    def test_parameters(self, botohe):
        ended = botohe("algorithms", "bo-aco")
        assert (ended.status, ended.err) == (0, "")
        assert "\n  n_ants = 100  (int, in [1, 1000000])\n" in ended.out
        assert "\n  evaporation = 0.04  (float, in (0, 1))\n" in ended.out
        assert "evaporates in an iteration.\n" in ended.out
        assert "\n  heuristic = true  (bool)\n" in ended.out
        assert "\n  initial_pheromone = 1.0  (float or 'bounds', > 0)\n" in ended.out
        assert "\n  sampling  (from Python only)\n" in ended.out
        assert "-p n_ants=100`" in ended.out

    @pytest.mark.slow
    def test_they_are_wrapped_to_the_terminal(self, botohe):
        for args in (["missions"], ["algorithms", "bo-aco"]):
            wide = botohe(*args).out
            lines = botohe(*args, COLUMNS="30").out.splitlines()
            assert flat("\n".join(lines)) == flat(wide)
            long = [line for line in lines if len(line) > 30]
            # No more than an example, or a word that is longer than the rest of a line.
            assert all("`" in line or len(line.split()) <= 6 for line in long), long
            assert len(lines) > len(wide.splitlines())

    def test_a_mission(self, botohe, tmp_path):
        ended = botohe("missions", "show", "toy", "--robots", 1, "--picture", "toy.png")
        assert (ended.status, ended.err) == (0, "")
        assert ended.out == (
            "toy: Five nodes, each danger on an arc destroys one robot in ten\n"
            "  nodes         5 (3 with a reward)\n"
            "  arcs          12\n"
            "  team          1 robot at base 1\n"
            "  total reward  10\n"
            "  survival      0.729 to 1\n"
            "wrote toy.png\n"
        )
        assert (tmp_path / "toy.png").read_bytes().startswith(b"\x89PNG")

    def test_checks(self, botohe, pier):
        good, bad = pier(), pier(robots=0, name="bad.json")
        ended = botohe("missions", "check", good)
        assert ended == (
            0,
            "pier.json: a valid mission, 2 nodes, 2 arcs, 2 robots, total reward 1.5\n",
            "",
        )
        ended = botohe("missions", "check", bad, "lost.json", good)
        assert ended.status == 2
        assert ended.out.startswith("pier.json: a valid mission")
        messages = ended.err.splitlines()
        assert len(messages) == 2
        assert messages[0].startswith("botohe: bad.json: expected robots")
        assert messages[1] == "botohe: lost.json: no such file or directory"


class TestChoose:
    """On the front that `solved` has found; the toy has two robots and a total reward of 10."""

    def test_by_a_wish(self, botohe, solved):
        _, folder = solved
        ended = botohe("choose", folder, "survivors >= 1.5")
        assert (ended.status, ended.err) == (0, "")
        rows = [row for row in front_in(folder) if row[2] >= 1.5]
        plan_id, reward, survivors = max(rows, key=lambda row: row[1])
        lines = ended.out.splitlines()
        assert lines[0] == f"plan {plan_id}: reward {reward:.4g}, survivors {survivors:.4g}"
        assert lines[1].startswith("The best among these plans (")
        assert f"plan {plan_id} has the most reward with survivors >= 1.5" in lines[1]
        assert lines[-1] == f"`botohe explore {folder}` makes a page that shows it on the map."
        trails = plans_in(folder)["plans"][plan_id]["trails"]
        for robot, trail in enumerate(trails):
            [line] = [line for line in lines if line.startswith(f"robot {robot} (survival ")]
            assert line.split(":  ")[1].removeprefix("stays at ") == " -> ".join(map(str, trail))

    def test_what_to_look_at(self, botohe, solved):
        _, folder = solved
        ended = botohe("choose", folder)
        assert (ended.status, ended.err) == (0, "")
        assert ended.out.startswith(f"{read_solution(folder).describe()}\n\nThe knee is a mark")

    def test_a_plan_is_written(self, botohe, solved, tmp_path):
        _, folder = solved
        ended = botohe("choose", folder, "--plan", 2, "--out", "plan.csv")
        assert (ended.status, ended.err) == (0, "")
        assert ended.out.endswith("wrote plan.csv\n")
        found = [[], []]
        for row in csv.DictReader((tmp_path / "plan.csv").read_text().splitlines()):
            found[int(row["robot"])].append(int(row["node"]))
        assert found == plans_in(folder)["plans"][2]["trails"]

    def test_files_for_robots(self, botohe, refused, solved, tmp_path):
        ended = botohe("choose", solved[1], "--plan", 2, "--out", "robots/nav2")
        assert (ended.status, ended.err) == (0, "")
        names = ["graph.geojson", "robot_0.json", "robot_1.json"]
        assert ended.out.splitlines()[-3:] == [f"wrote robots/nav2/{name}" for name in names]
        assert names_in(tmp_path / "robots" / "nav2") == names

    def test_files_for_what_flies_and_dives(self, botohe, refused, solved, tmp_path):
        """Only on earth: positions of the toy may as well be metres."""
        path = shutil.copytree(solved[1], tmp_path / "solved") / "mission.json"
        said = refused("choose", "solved", "--plan", 2, "--out", "site.plan", "--altitude", 30)
        assert "-m geographic=true); 'toy' does not say so." in flat(said)
        content = json.loads(path.read_text())
        content["graph"]["geographic"] = True
        path.write_text(json.dumps(content))
        fly = ["choose", "solved", "--plan", 2, "--out", "site.plan"]
        ended = botohe(*fly, "--altitude", 30)
        assert ended.out.splitlines()[-1] == "wrote site-1.plan"
        said = refused(*fly)
        expected = "altitude (of a multicopter, in metres) to be a number > 0, got None"
        assert said == f"botohe: Expected {expected}.\n"
        dive = ["choose", "solved", "--plan", 2, "--out", "sea.plan", "--vehicle", "submarine"]
        botohe(*dive, "--altitude", -4)
        sea = json.loads((tmp_path / "sea-1.plan").read_text())["mission"]
        assert (sea["vehicleType"], sea["items"][0]["Altitude"]) == (12, -4)
        assert "got 4.0." in refused(*dive, "--altitude", 4)

    def test_the_help_names_all_vehicles(self, botohe):
        names = re.search(r"Vehicle of a .plan file: (.*?)\.", flat(botohe("choose", "--help").out))
        assert re.split(", | or ", names[1]) == list(VEHICLES)

    def test_a_plan_is_drawn(self, botohe, solved, tmp_path):
        ended = botohe("choose", solved[1], "--plan", 2, "--out", "plan.pdf")
        assert (ended.status, ended.err) == (0, "")
        assert (tmp_path / "plan.pdf").read_bytes().startswith(b"%PDF")

    def test_a_file_that_cannot_be_written_has_another_status(self, refused, solved, tmp_path):
        (tmp_path / "plan.png").mkdir()
        said = refused("choose", solved[1], "--plan", 2, "--out", "plan.png")
        assert said == "botohe: plan.png: expected a file, found a folder, device or pipe\n"

    def test_the_impossible(self, botohe, solved, tmp_path):
        args = ["choose", solved[1], "survivors >= 1.9", "reward >= 9", "--out", "plan.json"]
        ended = botohe(*args)
        assert ended.status == 1
        assert "None of these plans (" in ended.out
        assert "comes nearest: it misses " in ended.out
        assert ended.err == "botohe: no plan meets all wishes; nothing is written.\n"
        assert names_in(tmp_path) == []

    @pytest.mark.parametrize(
        ("args", "words"),
        [
            (
                ["survivors >= 1", "--plan", 1],
                ["Expected only one of wishes", "got wishes and --plan."],
            ),
            (["--out", "plan.json"], ["Expected wishes, --toward or --plan with --out, got none"]),
            (["--plan", 99], ["Expected --plan in [0, ", "], got 99"]),
            (["--plan", 1, "--out", "a/plan.csv"], ["a: there is no such folder"]),
        ],
    )
    def test_bad_options(self, refused, solved, args, words):
        message = refused("choose", solved[1], *args)
        for word in words:
            assert word in message

    @pytest.mark.slow
    def test_after_solving(self, botohe, tmp_path):
        args = ["solve", "toy", "-a", "greedy", "-n", 50, "--out", "out"]
        ended = botohe(*args, "--choose", "survivors >= 1.5", "--choose", "reward >= 1")
        assert (ended.status, ended.err) == (0, "")
        answer = ended.out.partition("wrote out/mission.png\n\n")[2]
        assert answer == botohe("choose", "out", "survivors >= 1.5 and reward >= 1").out
        ended = botohe(*args, "--choose", "survivors >= 2 and reward >= 9")
        assert (ended.status, ended.err) == (1, "botohe: no plan meets all wishes.\n")
        assert names_in(tmp_path / "out") == FILES

    def test_a_bad_wish_is_refused_before_the_search(self, refused):
        assert "Expected a wish, got 'win'" in refused("solve", "toy", "--choose", "win")


class TestBound:
    def test_a_front_is_judged(self, botohe, solved, tmp_path):
        ended = botohe("bound", "toy", "--front", solved[1], "--out", "bound.json")
        assert (ended.status, ended.err) == (0, "")
        toy, solution = load_mission("toy"), read_solution(solved[1])
        bound = FrontBound.load(tmp_path / "bound.json", toy)
        gap = bound.gap(solution.objectives)
        title, empty, verdict, blank, head, *rows, wrote = ended.out.splitlines()
        assert title.startswith(toy.title)
        assert "budget" not in title
        assert (empty, blank, wrote) == ("", "", "wrote bound.json")
        assert verdict.startswith(
            f"area {solution.area:.4f}; proven upper bound on area {bound.area:.4f}: "
            f"within {100 * gap:.2f} % of the optimum, proved "
        )
        assert head.split() == ["survivors", "reward", "at", "most", "found"]
        assert len(rows) == 9
        for row in rows:
            survivors, most, found = map(float, row.split())
            assert most == pytest.approx(bound.bound(survivors), rel=1e-3)
            assert found <= most * 1.001

    @pytest.mark.slow
    def test_ctrl_c_shows_what_is_proved(self, botohe):
        code = when_called("botohe_moo.bounds.proof", "LocalSearch")
        ended = botohe("bound", "art_museum", "--time-limit", 500, code=code)
        assert ended.status == 130
        assert "stopping; what is proved will be shown" in ended.err
        assert "proven upper bound on area" in ended.out

    def test_bad_options(self, refused):
        message = refused("bound", "toy", "--time-limit", "0")
        assert "'--time-limit' / '-t': Input should be greater than or equal to" in message
        message = refused("bound", "toy", "--threads", "0")
        assert "'--threads': Input should be greater than or equal to" in message
        message = refused("bound", "toy", "--out", ".")
        assert ".: expected a file, found a folder" in message

    @pytest.mark.slow
    def test_the_limits_of_the_front_count(self, botohe, refused, tmp_path):
        args = ["solve", "toy", "-n", 500, "--min-survival", 0.4, "--max-length", 6]
        assert botohe(*args, "--out", "kept").status == 0
        ended = botohe("bound", "toy", "--front", "kept", "--out", "bound.json")
        assert ended.status == 0
        assert "travel budget 6" in ended.out.splitlines()[0]
        record = json.loads((tmp_path / "bound.json").read_text())
        assert (record["min_survival"], record["max_length"]) == (0.4, 6.0)
        message = refused("bound", "toy", "--front", "kept", "--max-length", 5)
        assert message == (
            "botohe: Expected neither --min-survival nor --max-length with --front: the limits of "
            "its search hold.\n"
        )

    def test_a_front_of_another_mission(self, refused, solved):
        message = refused("bound", "toy", "--robots", 3, "--front", solved[1])
        assert "another mission than 'toy'" in message
        assert "it has 2, the mission 3" in message


class TestReplan:
    @pytest.fixture
    def out(self, botohe, tmp_path):
        assert botohe("solve", "toy", "-a", "greedy", "-n", 50, "--out", "out").status == 0
        return tmp_path / "out"

    def test_a_robot_is_lost(self, botohe, out, tmp_path):
        (tmp_path / "events.csv").write_text("robot,event,node\n0,lost,\n")
        ended = botohe("replan", "out", "events.csv", "--plan", 0, "--out", "rest")
        assert (ended.status, ended.err) == (0, "")
        assert "One more survivor costs" in flat(ended.out)
        rest = read_solution(tmp_path / "rest")
        assert rest.mission.robots == read_solution(out).mission.robots - 1
        assert names_in(tmp_path / "rest") == sorted([*FILES, "replan.png"])

    def test_bad_input(self, refused, out, tmp_path):
        (tmp_path / "events.csv").write_text("robot,event,node\n0,lost,\n0,reached,2\n")
        message = refused("replan", "out", "events.csv", "--plan", 0, "--out", "rest")
        assert "events.csv, row 3: robot 0 reached 2: it is lost already." in message
        assert not (tmp_path / "rest").exists()
        message = refused("replan", "out", "events.csv", "--plan", 99)
        assert "Expected --plan" in message
        message = refused("replan", "out", "events.csv", "--plan", 0, "--out", out)
        assert "the folder of the plan itself" in message


class TestReplay:
    """What is on the page is tested in tests/explorer."""

    def test_a_page_of_a_mission(self, botohe, solved, tmp_path):
        code = "import webbrowser; webbrowser.open = lambda url: True"
        given = ("--plan", 0, "--price", 2, "--number", 3)
        ended = botohe("replay", solved[1], *given, "--out", "page.html", "--open", code=code)
        assert (ended.status, ended.err) == (0, "")
        solution = read_solution(solved[1])
        played = play_mission(solution.mission, solution.plans[0], price=2, number=3)
        assert flat(ended.out) == f"{played} wrote page.html"
        assert (tmp_path / "page.html").read_text("utf-8") == replay_page(played)

    def test_bad_input(self, refused, solved, tmp_path):
        given = ("replay", solved[1], "--out", "page.html", "--plan")
        assert "Expected --plan" in refused(*given, 999)
        assert "Expected policy" in refused(*given, 0, "--policy", "often")
        assert "'--number': Input should be greater than or equal to" in refused(
            *given, 0, "--number", -1
        )
        assert "ends in one of .html" in refused("replay", solved[1], "--plan", 0, "--out", "a.txt")
        assert not (tmp_path / "page.html").exists()


class TestSimulate:
    def test_a_table_and_a_picture(self, botohe, solved, tmp_path):
        given = ("--plan", 0, "--price", 2, "--missions", 30, "--policy", "losses")
        ended = botohe("simulate", solved[1], *given, "--out", "policies.png")
        assert ended.status == 0
        solution = read_solution(solved[1])
        outcomes = simulate_policy(
            solution.mission, solution.plans[0], "losses", price=2, missions=30
        )
        header, *rows = (line.split() for line in ended.out.splitlines()[1:4])
        table = outcomes.table
        assert header == list(table.columns)
        found = np.array([row[1:-1] for row in rows], float)
        assert found == pytest.approx(table.iloc[:, 1:-1].to_numpy(float), abs=1e-4)
        assert ended.out.startswith("One more survivor costs 2 reward.")
        assert (tmp_path / "policies.png").stat().st_size > 10_000

    def test_bad_input(self, refused, solved):
        given = ("simulate", solved[1], "--plan", 0)
        assert "Expected policy" in refused(*given, "--policy", "often")
        assert "'--missions': Input should be greater than or equal to" in refused(
            *given, "--missions", 1
        )
        assert "ends in one of .png" in refused(*given, "--out", "a.txt")


@pytest.mark.slow
class TestCertify:
    SOLVE = ("solve", "toy", "-a", "greedy", "-n", 50, "--out", "out")

    def test_a_front_is_judged_and_drawn_with_its_bound(self, botohe, tmp_path):
        folder = tmp_path / "out"
        assert botohe(*self.SOLVE).status == 0
        plain = {name: (folder / name).read_bytes() for name in FILES}
        ended = botohe(*self.SOLVE, "--certify", 5)
        assert (ended.status, ended.err) == (0, "")
        assert names_in(folder) == sorted([*FILES, "bound.json"])
        solution = read_solution(folder)
        bound = FrontBound.load(folder / "bound.json", solution.mission)
        gap = bound.gap(solution.objectives)
        assert gap > 0.01
        *_, empty, verdict, first, second = ended.out.partition("\n\nNext:")[0].splitlines()
        assert (empty, first, second) == ("", "wrote out/bound.json", "wrote out/front.png")
        assert verdict.startswith(
            f"area {solution.area:.4f}; proven upper bound on area {bound.area:.4f}: "
            f"within {100 * gap:.2f} % of the optimum, proved "
        )
        changed = [name for name in FILES if (folder / name).read_bytes() != plain[name]]
        assert changed == ["front.png"]
        assert botohe("choose", "out").status == botohe("explore", "out").status == 0

    def test_kinds_of_robots(self, botohe, tmp_path):
        site = Mission(load_mission("toy").graph, base=1, kinds=[Kind("drone", 2, end=4)])
        save_mission(site, tmp_path / "site.json")
        ended = botohe("solve", "site.json", "-n", 200, "--out", "out", "--certify", 5)
        assert (ended.status, ended.err) == (0, "")
        assert "as if each were the best of all kinds, and rewards counted on arrival." in ended.out
        assert FrontBound.load(tmp_path / "out" / "bound.json", site).area < 1
        rows = botohe("bound", "site.json", "--front", "out").out.splitlines()
        assert rows[-1].split() == ["2", "-", "-"]  # nobody can stay at the base

    def test_ctrl_c_keeps_what_is_proved(self, botohe, tmp_path):
        code = when_called("botohe_moo.bounds.proof", "LocalSearch")
        args = ["solve", "art_museum", "-n", 200, "--out", "out", "--certify", 20]
        ended = botohe(*args, code=code)
        assert ended.status == 130
        assert ended.err.count("botohe: stopping") == 1  # a slow start may be reported, too
        assert "stopping; what is proved will be shown" in ended.err
        assert "; proven upper bound on area" in ended.out
        folder = tmp_path / "out"
        assert names_in(folder) == sorted([*FILES, "bound.json"])
        assert FrontBound.load(folder / "bound.json", read_solution(folder).mission).area < 1


class TestExplore:
    """What is on the page is tested in tests/explorer."""

    def test_a_page_of_the_folder(self, botohe, solved, tmp_path):
        wishes = ["--choose", "survivors >= 1.5", "--choose", "reward >= 1"]
        ended = botohe("explore", solved[1], "--out", "page.html", *wishes)
        assert (ended.status, ended.err) == (0, "")
        chosen = botohe("choose", solved[1], "survivors >= 1.5", "reward >= 1").out.splitlines()
        assert ended.out == f"{chosen[1]}\nwrote page.html\n"
        page = (tmp_path / "page.html").read_text("utf-8")
        assert page.startswith("<!DOCTYPE html>")
        plain = botohe("explore", solved[1], "--out", "plain.html")
        assert plain.status == 0
        assert (tmp_path / "plain.html").read_text("utf-8") != page

    def test_a_map_of_the_site_lies_behind(self, botohe, solved, tmp_path):
        Image.new("L", (2, 2)).save(tmp_path / "map.png")
        said = "image: map.png\nresolution: 1.0\norigin: [0, 0, 0]\n"
        (tmp_path / "map.yaml").write_text(said, "utf-8")
        ended = botohe("explore", solved[1], "--out", "page.html", "--background", "map.yaml")
        assert (ended.status, ended.out) == (0, "wrote page.html\n")
        ended = botohe("explore", solved[1], "--out", "page.html", "--background", "no.yaml")
        assert ended.status == 2
        assert "no.yaml: no such file" in ended.err

    def test_it_is_opened(self, botohe, solved, tmp_path):
        code = "import webbrowser; webbrowser.open = lambda url: bool(print(url))"
        ended = botohe("explore", solved[1], "--out", "page.html", "--open", code=code)
        assert ended.status == 0
        assert ended.out == f"wrote page.html\n{(tmp_path / 'page.html').as_uri()}\n"
        assert "no browser here that could be started; open page.html" in ended.err

    @pytest.mark.slow
    def test_after_solving(self, botohe, tmp_path):
        args = ["solve", "toy", "-a", "greedy", "-n", 50, "--out", "out"]
        assert botohe(*args).status == 0
        assert botohe("explore", "out", "--choose", "survivors >= 1.5 and reward >= 1").status == 0
        assert names_in(tmp_path / "out") == sorted([*FILES, "explorer.html"])
        assert botohe(*args).status == 0
        assert names_in(tmp_path / "out") == FILES  # the page was of other plans


class TestImport:
    ARGS = ("--nodes", "nodes.csv", "--arcs", "arcs.csv", "--base", "1", "--robots", 2)

    @pytest.fixture
    def site(self, tmp_path):
        """A site of 6 x 10 rooms, drawn up by hand as two tables."""
        nodes, arcs = ["Label;Reward;X;Y"], ["Tail,Head,Survival"]
        for room in range(1, 61):
            row, column = divmod(room - 1, 10)
            nodes.append(f"{room};{room % 7};{column};{row}")
            if column < 9:
                arcs.append(f"{room},{room + 1},0.9{room % 10}")
            if row < 5:
                arcs.append(f"{room},{room + 10},0.9")
        (tmp_path / "nodes.csv").write_text("\n".join(nodes), "utf-8-sig")
        (tmp_path / "arcs.csv").write_text("\n".join([*arcs, ""]))

    @pytest.mark.usefixtures("site")
    def test_from_tables_to_a_plan(self, botohe, tmp_path):
        args = ["missions", "import", *self.ARGS, "--both-ways", "-m", "title=Rooms"]
        ended = botohe(*args, "--out", "site.json")
        brief = "60 nodes, 208 arcs, 2 robots, total reward 178"
        assert ended == (0, f"wrote site.json: {brief}\n", "")
        assert botohe("missions", "check", "site.json").status == 0
        mission = load_mission(tmp_path / "site.json")
        assert (mission.name, mission.title, mission.base) == ("site", "Rooms", "1")
        solve = ["solve", "site.json", "-n", 2000, "--out", "found"]
        assert botohe(*solve).status == 0
        wish = "P(survivors >= 1) >= 0.6 and reach 12 >= 0.5"
        for name in ("plan.json", "plan.csv", "plan.geojson"):
            ended = botohe("choose", "found", wish, "--out", name)
            assert (ended.status, ended.err) == (0, ""), ended
        content = json.loads((tmp_path / "plan.json").read_text())
        plan = mission.plan(content["trails"])
        assert mission.evaluate([plan]).tolist() == [[content["reward"], content["survivors"]]]
        shapes = json.loads((tmp_path / "plan.geojson").read_text())["features"]
        assert shapes[0]["geometry"]["coordinates"][0] == [0, 0]

    @pytest.mark.slow
    @pytest.mark.usefixtures("site")
    @pytest.mark.parametrize(
        ("file", "damage", "words"),
        [
            (
                "nodes.csv",
                ("7;0;6;0", "7;0,5;6;0"),
                ["node '7': expected a finite reward >= 0, got '0,5'"],
            ),
            ("arcs.csv", ("7,8,", "7,88,"), ["arcs.csv, row 14: arc '7' -> '88'", "no node '88'"]),
            ("arcs.csv", None, ["arcs.csv: no such file"]),
            ("nodes.csv", ("X;Y", "Pos;Z"), ["node '1': expected pos [x, y]"]),
        ],
    )
    def test_what_is_wrong_is_named(self, refused, tmp_path, file, damage, words):
        path = tmp_path / file
        if damage is None:
            path.unlink()
        else:
            text = path.read_text("utf-8-sig")
            assert damage[0] in text
            path.write_text(text.replace(*damage, 1))
        message = refused("missions", "import", *self.ARGS, "--both-ways", "--out", "site.json")
        for word in words:
            assert word in message

    KINDS = ("--nodes", "nodes.csv", "--arcs", "arcs.csv", "--base", "dock", "--both-ways")

    @pytest.fixture
    def pads(self, tmp_path):
        """A dock, a roof that only drones get to, and a lab with a sample."""
        nodes = 'label,reward,share:drone,pays\ndock,0,,\n"roof, east",2,,\nlab,5,0.5,return\n'
        arcs = 'tail,head,Survival:drone,survival:rover\ndock,lab,0.8,0.9\nlab,"roof, east",0.7,\n'
        (tmp_path / "nodes.csv").write_text(nodes)
        (tmp_path / "arcs.csv").write_text(arcs)

    @pytest.mark.usefixtures("pads")
    def test_kinds_of_robots(self, botohe, tmp_path):
        kinds = [
            *("--kind", "drone=2,start=roof, east,max_length=4"),
            *("--kind", "rover = 1, min_survival=0.5"),
        ]
        ended = botohe("missions", "import", *self.KINDS, *kinds, "--out", "site.json")
        brief = "3 nodes, 4 arcs, 3 robots (2 drone, 1 rover), total reward 7"
        assert ended == (0, f"wrote site.json: {brief}\n", "")
        assert load_mission(tmp_path / "site.json").kinds == (
            Kind("drone", 2, start="roof, east", max_length=4),
            Kind("rover", 1, min_survival=0.5),
        )
        checked = botohe("missions", "check", "site.json")
        assert checked.out == f"site.json: a valid mission, {brief}\n"
        shown = botohe("missions", "show", "site.json")
        assert shown.out == (
            "site: site\n"
            "  nodes         3 (2 with a reward)\n"
            "  arcs          4, dead ends possible\n"
            "  team          3 robots (2 drone, 1 rover) at base 'dock'\n"
            "  total reward  7\n"
            "  drone         2 robots from 'roof, east' to 'dock', can take 4 arcs, collects at 2 "
            "of 2 paying nodes, max_length 4\n"
            "  rover         1 robot from 'dock' to 'dock', can take 2 arcs, collects at 1 of 2 "
            "paying nodes, min_survival 0.5\n"
            "  on return     1 of 2 paying nodes\n"
            "  depots        'dock'\n"
            "  survival      0.7 to 0.9\n"
        )

    @pytest.mark.usefixtures("pads")
    @pytest.mark.parametrize(
        ("given", "words"),
        [
            ([], ["column 'share:drone': no such kind; the mission lists no kinds"]),
            (["--kind", "drone"], ["Expected a kind as NAME=ROBOTS or", "got 'drone'."]),
            (["--kind", "drone=1,stat=lab"], ["kinds[0]: there is no 'stat' of a kind"]),
            (["--kind", "drone=1,robots=2"], ["Expected 'robots' once, got it again: 'robots=2'."]),
            (
                ["--kind", "drone=x,max_length=2,5", "--kind", "rover=1,end=la", "-m", "pays=home"],
                [
                    "has 4 faults",
                    "kind 'drone': expected robots to be an integer in [1, 1000000], got 'x'",
                    "kind 'drone': expected a finite max_length >= 0, got '2,5'",
                    "kind 'rover': end 'la': there is no such node; most alike are lab, ",
                    "expected pays to be 'arrival' or 'return', got 'home'",
                ],
            ),
            (
                ["--robots", 2],
                ["nodes.csv, row 4: column 'share:drone': no such kind; the mission lists no"],
            ),
        ],
    )
    def test_bad_kinds(self, refused, given, words):
        message = refused("missions", "import", *self.KINDS, *given, "--out", "site.json")
        for word in words:
            assert word in message

    @pytest.mark.usefixtures("pads")
    def test_columns_without_the_name_of_what_they_hold(self, refused, tmp_path):
        (tmp_path / "arcs.csv").write_text("tail,head,drone\ndock,lab,0.8\n")
        message = refused(
            "missions", "import", *self.KINDS, "--kind", "drone=1", "--out", "site.json"
        )
        expected = "arcs.csv, row 2: arc 'dock' -> 'lab': expected a survival, found none"
        assert expected in message

    def test_bounds_of_robots_that_carry_something_are_refused_before_the_search(
        self, refused, tmp_path
    ):
        kinds = [Kind("drone", 1, aboard=(4,))]
        rest = Mission(load_mission("toy").graph, base=1, kinds=kinds, pays="return")
        save_mission(rest, tmp_path / "rest.json")
        message = refused("solve", "rest.json", "--certify", 5, "--out", "out")
        assert "--certify does not support mission 'toy', in which robots carry some" in message
        assert "botohe bound does not support mission 'toy'" in refused("bound", "rest.json")

    def test_a_number_of_robots_of_several_kinds(self, refused):
        message = refused("solve", "drones_and_rovers", "--robots", 3)
        assert "it has 4 robots (2 drone, 2 rover): expected no number of robots, got 3" in message

    @pytest.mark.usefixtures("site")
    def test_the_mission_and_its_file(self, refused):
        args = ["missions", "import", *self.ARGS]
        message = refused(*args, "--out", "site.json")
        assert message.startswith("botohe: The mission has 60 faults:")
        assert "both_ways makes every arc passable both ways" in message
        message = refused(*args, "--both-ways", "--out", "site.txt")
        assert "site.txt: expected a file name that ends in one of .graphml, .json" in message
        assert "no: there is no such folder" in refused(
            *args, "--both-ways", "--out", "no/site.json"
        )
        base = ["--base", "dock", "--both-ways", "--out", "site.json"]
        message = refused(*args, *base)
        assert "base 'dock': there is no such node; most alike are 1, 10, 11, 12, 13\n" in message
        assert "Missing option '--out'" in refused(*args)


@pytest.mark.slow
class TestFromMap:
    @pytest.fixture
    def site(self, tmp_path):
        """A corridor of 12 metres, half a metre wide, with another one across it."""
        cells = np.zeros((60, 120), np.uint8)
        cells[28:33, 2:118] = cells[2:58, 50:55] = 254
        Image.fromarray(cells).save(tmp_path / "site.pgm")
        (tmp_path / "site.yaml").write_text("image: site.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n")

    @pytest.mark.usefixtures("site")
    def test_from_a_map_to_a_plan(self, botohe, tmp_path):
        ended = botohe("missions", "from-map", "site.yaml", "--radius", 0.25, "--out", "site.json")
        brief = "5 nodes, 8 arcs, 3 robots, total reward 4"
        assert ended == (0, f"wrote site.json: {brief}\nwrote site-graph.png\n", "")
        assert (tmp_path / "site-graph.png").stat().st_size > 10_000
        mission = load_mission(tmp_path / "site.json")
        assert mission.graph.nodes[mission.base]["pos"] == pytest.approx([0.45, 2.95])
        assert botohe("solve", "site.json", "-n", 500, "--out", "found").status == 0

    @pytest.mark.usefixtures("site")
    def test_options(self, botohe, tmp_path):
        given = ["--radius", 0.25, "--spacing", 2, "--robots", 2, "--danger", 0.5, "--base", "9,3"]
        ended = botohe("missions", "from-map", "site.yaml", *given, "--out", "a.json")
        assert ended.out.endswith("wrote a-graph.png\n")
        mission = load_mission(tmp_path / "a.json")
        assert mission.robots == 2
        assert math.dist(mission.graph.nodes[mission.base]["pos"], (9, 3)) < 1
        for _, _, arc in mission.graph.edges(data=True):
            assert arc["length"] <= 2
            assert arc["survival"] == pytest.approx(math.exp(-0.5 * arc["length"]))

    @pytest.mark.usefixtures("site")
    @pytest.mark.parametrize(
        ("given", "message"),
        [
            (["site.yaml", "--base", "a,b"], "a node's number, or a place X,Y, got 'a,b'"),
            (["site.yaml", "--radius", 2], "site.yaml: expected ways through free space for a"),
            (["lost.yaml"], "lost.yaml: no such file"),
            (["site.yaml", "--hazard", "lost.yaml"], "lost.yaml: no such file"),
            (["site.yaml", "--out", "no/a.json"], "no: there is no such folder"),
            (
                ["site.yaml", "--out", "a.csv"],
                "a.csv: expected a file name that ends in one",
            ),
        ],
    )
    def test_what_is_wrong(self, refused, given, message):
        assert message in refused("missions", "from-map", "--out", "a.json", *given)

    @pytest.mark.usefixtures("site")
    def test_the_image_of_the_map_stays(self, botohe, tmp_path):
        """Beside a mission file of the map's own name, and with dangers of a map."""
        Image.open(tmp_path / "site.pgm").save(tmp_path / "site.png")
        text = (tmp_path / "site.yaml").read_text().replace("pgm", "png") + "mode: scale\n"
        (tmp_path / "site.yaml").write_text(text)
        before = (tmp_path / "site.png").read_bytes()
        given = ["--radius", 0.25, "--hazard", "site.yaml", "--out", "site.geojson"]
        assert botohe("missions", "from-map", "site.yaml", *given).status == 0
        assert (tmp_path / "site.png").read_bytes() == before
        # Free space is white, where it is safe.
        assert load_mission(tmp_path / "site.geojson").world.graph.survival.min() > 0.99


@pytest.mark.slow
class TestWhatATerminalWouldObey:
    CODES = "\x1b]0;x\x07\x9b31m\u202e"

    def test_is_written_as_escapes_but_kept_in_files(self, botohe, tmp_path):
        label, title = f"reef{self.CODES}", f"Pier{self.CODES}, 漁夫 👨\u200d👩"
        graph = nx.DiGraph(title=title)
        for node, reward in ((f"dock{self.CODES}", 0), (label, 1)):
            graph.add_node(node, reward=reward)
        graph.add_edge(f"dock{self.CODES}", label, survival=0.9)
        graph.add_edge(label, f"dock{self.CODES}", survival=0.9)
        mission = Mission(graph, base=f"dock{self.CODES}", robots=1)
        save_mission(mission, tmp_path / "pier.json")
        shown = botohe("missions", "show", "pier.json")
        assert r"Pier\x1b]0;x\x07\x9b31m\u202e, 漁夫 👨‍👩" in shown.out
        assert botohe("solve", "pier.json", "-n", 100, "--out", "found").status == 0
        chosen = botohe("choose", "found", "reward >= 0.5", "--out", "plan.json")
        assert r"reef\u001b]0;x\u0007\x9b31m\u202e" in chosen.out  # partly escaped in its quotes
        assert label in json.loads((tmp_path / "plan.json").read_text())["trails"][0]
        unknown = botohe("choose", "found", "reach ref >= 0.5")
        assert r"has no node 'ref'; most alike are reef\x1b]0;x\x07\x9b31m\u202e" in unknown.err
        for text in (*shown[1:], *chosen[1:], *unknown[1:]):
            assert not set(text) & set(self.CODES) - set("]0;x31m")


class TestHelp:
    def test_of_commands(self, botohe):
        ended = botohe("solve", "--help")
        assert (ended.status, ended.err) == (0, "")
        for word in (
            "--algorithm",
            "--evaluations",
            "--seed",
            "--out",
            "--certify",
            "results/solve/MISSION",
            "Ctrl-C",
        ):
            assert word in ended.out
        assert "By default a new one: results/solve/MISSION." in flat(ended.out)
        assert not re.search("<bool>|BOOLEAN", ended.out)
        assert "check" in botohe("missions", "--help").out

    def test_without_a_command(self, botohe):
        ended = botohe("study")
        assert ended.out + ended.err == botohe("study", "--help").out

    def test_version(self, botohe):
        assert re.fullmatch(r"botohe-moo \d+\.\d+\S*\n", botohe("--version").out)

    def test_it_waits_for_nothing(self):
        code = """
            import sys
            from botohe_moo import cli
            sys.argv = ["botohe", "solve", "--help"]
            try:
                cli.main()
            finally:
                print(*sorted({name.partition(".")[0] for name in sys.modules}), file=sys.stderr)
        """
        done = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True
        )
        assert done.returncode == 0
        loaded = set(done.stderr.split())
        assert {"typer", "botohe_moo"} <= loaded
        slow = {"numpy", "numba", "pandas", "pymoo", "matplotlib", "seaborn", "networkx", "yaml"}
        assert not loaded & slow


def test_files_of_a_solution_are_not_replaced_by_a_plan(refused, solved, tmp_path):
    shutil.copytree(solved[1], tmp_path / "found")
    said = refused("choose", "found", "survivors >= 1", "--out", "found/plans.json")
    assert "a file of the solution itself; give another name" in said
    assert read_solution(tmp_path / "found").plans == read_solution(solved[1]).plans
