"""Study files that were changed at random: read or refused, and at a bounded cost.

``BOTOHE_MUTATIONS=8000 pytest tests/study/test_mutations.py`` looks longer.
"""

import gc
import json
import os
import re
import subprocess
import sys
import tracemalloc
import warnings
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo.study.file import document
from botohe_moo.study.file.document import Document
from botohe_moo.study.file.loading import load_study
from botohe_moo.study.file.model import StudyError

ROOT = Path(__file__).parents[2]
N_EXAMPLES = int(os.environ.get("BOTOHE_MUTATIONS", "25"))
MIB = 2**20

GUIDE = (ROOT / "docs" / "studies.md").read_text("utf-8").split("```yaml\n")[1].split("```")[0]
TEXTS = [path.read_text("utf-8") for path in sorted((ROOT / "experiments").glob("*.yaml"))]
TEXTS.append(GUIDE.replace("sites/mine.json", "art_museum"))
TEXTS.append(
    "name: merged\nseeds: {count: 3, seed: 1}\nbudget: &b {evaluations: 100}\n"
    "missions: {a: &m {mission: toy, budget: *b}, b: {<<: *m, min_survival: 0.5}}\n"
    "algorithms: {A: &n {algorithm: nsga2, grid: {pop_size: [5, 10]}}, "
    "B: {<<: [*n, {}], grid: {}}}\n"
)
WORD = re.compile(r"[^\s\[\]{},:#]+")
PIECES = [
    *("", "0", "-1", "2", "1e3", "1e999", ".inf", ".nan", "1000", "20000", "100_000", "1000000"),
    *("4294967296", "9" * 30, "9" * 5_000, "9_" * 20_000, "true", "null", "~", "''", '""', "[]"),
    *("{}", "*a", "*b", "*m", "&a", "<<", "<<: *m", "!x", "!!str 5", "!!int x", "!!binary eA=="),
    *("'", '"', ":", "- ", "? ", "|", ">", "#", "%", "@", "`", "\t", "\n", "\n  ", "\n    "),
    *("\0", "\x7f", "é", "\u2028", "😀", '"\\ud800"', '"\\UFFFFFFFF"', "x" * 3_000, "[1, 2, 3]"),
    *("{a: 1}", "[" * 60 + "]" * 60, "{grid: {seed: [1, 2, 3]}}", "os:system", "botohe_moo:BOACO"),
    *("pymoo.algorithms.moo.nsga3:NSGA3", "terrain", "complete", "random", "../x.json", "a:b"),
]


@st.composite
def mutated(draw):
    """A study file with a few changes: pieces put in, cut out, moved, multiplied."""
    text = draw(st.sampled_from(TEXTS))
    for _ in range(draw(st.integers(1, 4))):
        way = draw(
            st.sampled_from(["insert", "cut", "word", "word", "word", "line", "many", "move"])
        )
        lines = text.split("\n")
        here = draw(st.integers(0, len(lines) - 1))
        there = draw(st.integers(0, len(lines) - 1))
        at = draw(st.integers(0, len(text)))
        words = list(WORD.finditer(text))
        if way == "insert":
            text = text[:at] + draw(st.sampled_from(PIECES)) + text[at:]
        elif way == "cut":
            text = text[:at] + text[at + draw(st.sampled_from([1, 5, 30])) :]
        elif way == "word" and words:
            word = draw(st.sampled_from(words))
            others = [other.group() for other in words[:40]]
            other = draw(st.sampled_from(PIECES) | st.sampled_from(others))
            text = text[: word.start()] + other + text[word.end() :]
        elif way == "many":
            lines[here:here] = [lines[here]] * draw(st.sampled_from([2, 10, 500]))
            text = "\n".join(lines)
        elif way == "line":
            lines[here] = draw(st.sampled_from(["", "  ", "    "])) + lines[here].lstrip()
            text = "\n".join(lines)
        elif way == "move":
            lines.insert(there, lines.pop(here))
            text = "\n".join(lines)
    return text


def cost(path):
    """What is said of a file, or its study; and the most memory that reading it took, in MiB."""
    before = reset_peak()
    try:
        with warnings.catch_warnings(action="ignore"):
            found = load_study(path)
    except StudyError as error:
        found = str(error).splitlines()
    return found, memory() - before


def reset_peak():
    """Let the peak of this process's memory count from here on; give the memory, in MiB.

    Tracing every allocation would take ten times as long.
    """
    if sys.platform == "linux":
        Path("/proc/self/clear_refs").write_text("5")
    return memory()


def memory():
    """The peak of this process's memory in MiB; 0 where the system does not tell it."""
    if sys.platform != "linux":
        return 0.0
    return int(re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())[1]) / 1024


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    load_study(ROOT / "experiments" / "baselines.yaml")  # imports what is not counted here
    return tmp_path_factory.mktemp("mutated") / "study.yaml"


def bounded(path, text, most):
    """What is said of a text, which took less than so many MiB to say, in lines one can read."""
    path.write_text(text, encoding="utf-8")
    found, peak = cost(path)
    assert peak < most
    if isinstance(found, list):
        assert len(found) <= 101
        assert max(map(len, found)) < 2_000
    return found


@settings(max_examples=N_EXAMPLES)
@given(text=mutated())
def test_mutated_files_are_read_or_refused_at_a_bounded_cost(path, text):
    found = bounded(path, text, 64)
    if isinstance(found, list):
        for line in found:
            assert line.startswith((f"{path}:", "These are the first 100 faults"))
            assert not re.search(r"while (scanning|parsing|constructing)|Traceback", line)
    else:
        assert len(found.missions) <= 1_000
        assert len(found.algorithms) <= 1_000
        assert len({run.digest for run in found.runs()}) <= 250_000


HEAD = "name: x\nmissions: [toy]\nalgorithms: [random]\nbudget: {evaluations: 100}\n"
SEEDS = f"{HEAD}seeds: 1\n"


def entries(kind, text):
    other = {"missions": "algorithms: [random]\n", "algorithms": "missions: [toy]\n"}[kind]
    return f"name: x\n{other}budget: {{evaluations: 9}}\nseeds: 1\n{kind}: {text}\n"


MERGES = ", ".join(
    ["&m0 {a: 1, b: 2}", *(f"&m{i} {{<<: [*m{i - 1}, *m{i - 1}]}}" for i in range(1, 40))]
)
GRID = ", ".join(f"p{i}: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]" for i in range(3))
GROWING = {
    "digits and a letter": f"{SEEDS}title: {'1' * 300_000}x\n",
    "digits of a tag": f"{SEEDS}title: !!float {'1' * 300_000}x\n",
    "digits and lines": f"{HEAD}seeds: {'9_' * 200_000}9\n",
    "an integer": f"{HEAD}seeds: {'9' * 4_200}\n",
    "seeds": f"{HEAD}seeds: [{', '.join(str(10**9 + i) for i in range(22_000))}]\n",
    "seeds twice": f"{HEAD}seeds: [{', '.join(str(i % 9_000) for i in range(19_000))}]\n",
    "derived seeds": f"{HEAD}seeds: {{count: 100000, seed: 3}}\n",
    "indicators": f"{SEEDS}indicators: [{', '.join(['area'] * 19_000)}]\n",
    "records": f"{SEEDS}recording: {{at: [{', '.join(map(str, range(1, 19_000)))}]}}\n",
    "unknown keys": SEEDS + "".join(f"{'key' * 100}{i}: 1\n" for i in range(2_000)),
    "repeated keys": SEEDS + "key: 1\n" * 9_000,
    "a long key": f"{SEEDS}{'k' * 1_000}: 1\n",
    "a long title": f"{SEEDS}title: '{'x' * 900_000}'\n",
    "a long control": f"{SEEDS}comparison: {{control: {'abc' * 60}}}\n",
    "a long alias": f"{SEEDS}title: *{'m' * 5_000}\n",
    "a long anchor": f"{SEEDS}title: [&{'m' * 5_000} 1, &{'m' * 5_000} 2]\n",
    "levels": f"{HEAD}seeds: {'[' * 900}{']' * 900}\n",
    "levels of blocks": f"{HEAD}seeds: {'- ' * 900}\n",
    "aliases": f"{SEEDS}x: &a [{', '.join('1' * 9)}]\ny: [{', '.join(['*a'] * 9_000)}]\n",
    "merges within one": f"{SEEDS}x: {{<<: [{MERGES}]}}\n",
    "merges of many keys": f"{SEEDS}x: &a {{{', '.join(f'k{i}: 1' for i in range(300))}}}\n"
    + "".join(f"y{i}: {{<<: *a}}\n" for i in range(300)),
    "missions": entries("missions", f"{{{', '.join(f'm{i}: toyy' for i in range(3_000))}}}"),
    "the same missions": entries(
        "missions", f"{{{', '.join(f'm{i}: toy' for i in range(3_000))}}}"
    ),
    "algorithms": entries("algorithms", f"{{{', '.join(f'm{i}: boaco' for i in range(3_000))}}}"),
    "a grid": entries("algorithms", f"{{a: {{algorithm: nsga2, grid: {{{GRID}, q: [1, 2]}}}}}}"),
    "grids": entries(
        "algorithms",
        f"{{a: &a {{algorithm: nsga2, grid: {{{GRID}}}}}, "
        f"{', '.join(f'a{i}: *a' for i in range(500))}}}",
    ),
    "a grid of many": entries(
        "algorithms",
        "{a: {algorithm: nsga2, grid: {" + ", ".join(f"p{i}: [1, 2]" for i in range(4_000)) + "}}}",
    ),
    "long values of a grid": entries(
        "algorithms",
        f"{{a: {{algorithm: nsga2, grid: {{repair: [{'x' * 5_000}, {'y' * 5_000}]}}}}}}",
    ),
}


def measure():
    """Read each of the texts in a process of its own, and print what that took, as JSON."""
    path = Path(sys.argv[1]) / "study.yaml"
    baseline = ROOT / "experiments" / "smoke.yaml"
    load_study(baseline)  # imports what is not counted here
    for name, text in GROWING.items():
        path.write_text(text, encoding="utf-8")
        if not os.fork():
            load_study(baseline)  # so that code which all need is in this process's memory
            counted = []
            Document._count = counting(Document._count, counted)
            document._Loader.compose_node = counting(document._Loader.compose_node, counted)
            gc.collect()
            found, peak = cost(path)
            lines = found if isinstance(found, list) else []
            print(json.dumps([name, peak, len(counted), lines]), flush=True)
            os._exit(0)
        assert os.wait()[1] == 0, name


def counting(function, counted):
    def count(*args):
        counted.append(None)
        return function(*args)

    return count


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Memory in MiB, values made, and what is said, by name of the text."""
    code = "from tests.study.test_mutations import measure; measure()"
    done = subprocess.run(
        [sys.executable, "-c", code, tmp_path_factory.mktemp("grown")],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return {name: found for name, *found in map(json.loads, done.stdout.splitlines())}


@pytest.mark.skipif(sys.platform != "linux", reason="the system tells no peak elsewhere")
@pytest.mark.parametrize("name", GROWING)
def test_what_would_grow_is_bounded(measured, name):
    """Each took minutes, gigabytes, or a message of megabytes."""
    peak, n_counted, lines = measured[name]
    assert 0 <= peak < 32
    assert n_counted <= 2 * 20_001  # no more values are made than a study has
    assert len(lines) <= 101
    assert max(map(len, lines), default=0) < 2_000
    assert sum(map(len, lines)) < 60_000


@pytest.mark.skipif(sys.platform != "linux", reason="the system tells no peak elsewhere")
def test_memory_is_measured(tmp_path):
    """A reader that takes memory is found out."""
    code = (
        "from tests.study import test_mutations as tests\n"
        "tests.GROWING = {'a study': tests.SEEDS}\n"
        "tests.load_study = lambda path: len(b'x' * 65 * tests.MIB)\n"
        "tests.measure()"
    )
    command = [sys.executable, "-c", code, tmp_path]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert 64 <= json.loads(done.stdout)[1] < 66


def test_a_run_takes_little_memory(path):
    path.write_text(f"{HEAD}seeds: 100000\n")
    study = load_study(path)
    tracemalloc.start()
    runs = study.runs()
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(runs) == 100_000
    assert taken / len(runs) < 300
