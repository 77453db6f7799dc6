"""Study files that were changed at random, or ask for too much: read or refused.

``BOTOHE_MUTATIONS=8000 pytest tests/study/test_mutations.py`` looks longer.
"""

import os
import re
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from botohe_moo.study.loading import load_study
from botohe_moo.study.model import StudyError
from tests.test_damaged_files import changed_bytes

ROOT = Path(__file__).parents[2]
N_EXAMPLES = int(os.environ.get("BOTOHE_MUTATIONS", "25"))

GUIDE = (ROOT / "docs" / "studies.md").read_text("utf-8").split("```yaml\n")[1].split("```")[0]
TEXTS = [path.read_text("utf-8") for path in sorted((ROOT / "experiments").glob("*.yaml"))]
TEXTS.append(GUIDE.replace("sites/mine.json", "art_museum"))
TEXTS.append(
    "name: merged\nseeds: [3, 1]\nbudget: &b {evaluations: 100}\n"
    "missions: {a: &m {mission: toy, budget: *b}, b: {<<: *m, min_survival: 0.5}}\n"
    "algorithms: {A: &n {algorithm: nsga2, grid: {pop_size: [5, 10]}}, "
    "B: {<<: [*n, {}], grid: {}}}\n"
)
WORD = re.compile(rb"[^\s\[\]{},:#]+")
PIECES = [
    *("", "0", "-1", "2", "1e3", "1e999", ".inf", ".nan", "1000", "20000", "100_000", "1000000"),
    *("4294967296", "9" * 30, "9" * 5_000, "9_" * 20_000, "true", "null", "~", "''", '""', "[]"),
    *("{}", "*a", "*b", "*m", "&a", "<<", "<<: *m", "!x", "!!str 5", "!!int x", "!!binary eA=="),
    *("'", '"', ":", "- ", "? ", "|", ">", "#", "%", "@", "`", "\t", "\n", "\n  ", "\n    "),
    *("\0", "\x7f", "é", "\u2028", "😀", '"\\ud800"', '"\\UFFFFFFFF"', "x" * 3_000, "[1, 2, 3]"),
    *("{a: 1}", "[" * 60 + "]" * 60, "{grid: {seed: [1, 2, 3]}}", "os:system", "botohe_moo:BOACO"),
    *("pymoo.algorithms.moo.nsga3:NSGA3", "terrain", "complete", "random", "../x.json", "a:b"),
]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("mutated") / "study.yaml"


def read(path, data):
    """Read a file: a study, or the lines that say what is wrong, which one can read."""
    path.write_bytes(data)
    try:
        return load_study(path)
    except StudyError as error:
        lines = str(error).splitlines()
        assert max(map(len, lines)) < 2_000
        return lines


@settings(max_examples=N_EXAMPLES)
@given(
    st.sampled_from(TEXTS).flatmap(
        lambda text: changed_bytes(text.encode(), WORD, [piece.encode() for piece in PIECES])
    )
)
def test_changed_files_are_read_or_refused(path, data):
    found = read(path, data)
    if isinstance(found, list):
        for line in found:
            assert line.startswith(f"{path}:")
    else:
        assert len({run.digest for run in found.runs()}) <= 250_000


HEAD = "name: x\nmissions: [toy]\nalgorithms: [random]\nbudget: {evaluations: 100}\n"
SEEDS = f"{HEAD}seeds: 1\n"
ALGORITHMS = "name: x\nmissions: [toy]\nbudget: {evaluations: 9}\nseeds: 1\nalgorithms: "
GRID = ", ".join(f"p{i}: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]" for i in range(3))
GROWING = {
    "a long file": f"{SEEDS}title: '{'x' * 1_000_000}'\n",
    "repeated keys": SEEDS + "key: 1\n" * 9_000,
    "a grid": ALGORITHMS + f"{{a: {{algorithm: nsga2, grid: {{{GRID}, q: [1, 2]}}}}}}\n",
    "a grid of many": ALGORITHMS
    + "{a: {algorithm: nsga2, grid: {"
    + ", ".join(f"p{i}: [1, 2]" for i in range(4_000))
    + "}}}\n",
    "runs": f"{HEAD}seeds: 100000\n".replace("[random]", "[random, greedy, nsga2]"),
}


@pytest.mark.slow
def test_what_would_grow_is_refused(path):
    """Each took minutes, gigabytes, or a message of megabytes."""
    for name, text in GROWING.items():
        assert isinstance(read(path, text.encode()), list), name


@pytest.mark.slow
def test_a_run_takes_little_memory(path):
    path.write_text(f"{HEAD}seeds: 100000\n")
    study = load_study(path)
    tracemalloc.start()
    runs = study.runs()
    taken = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(runs) == 100_000
    assert taken / len(runs) < 300
