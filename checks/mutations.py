"""Change one operator in two hundred places: `make test` has to notice what all tests notice.

``python -m checks.mutations [ENTRY ...] [--out CSV]`` draws the places from the source by a seed,
of kernels one for every fifty operators of a module, and works on a copy of the checkout. Each
change is tried with the tests of its entry: first with those of `make test`, and where these do not
notice it, with those that are marked slow and all examples of property tests. Compiling kernels
takes longer than most tests, so changes of kernels are tried first in plain Python, without the
tests for which this is too slow. A change that nothing notices may be one that changes nothing. The
exit status is 1 if `make test` notices less than 95 % of what all tests notice.
"""

import argparse
import ast
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
PACKAGE = Path("src", "botohe_moo")
# How many places of each entry, and the tests that look at it. Kernels: 0 for one in FIFTY.
ENTRIES: dict[str, tuple[int, tuple[str, ...]]] = {
    "core": (0, ("core", "operators", "test_outcomes.py", "algorithms")),
    "operators/kernels.py": (0, ("operators",)),
    "algorithms/annealing/kernels.py": (0, ("algorithms/annealing",)),
    "algorithms/bo_aco/kernels.py": (0, ("algorithms/bo_aco",)),
    "algorithms/exact/kernels.py": (0, ("algorithms/exact",)),
    "algorithms/greedy/kernels.py": (0, ("algorithms/greedy",)),
    "algorithms/local_search/kernels": (0, ("algorithms/local_search",)),
    "bounds/kernels": (0, ("bounds",)),
    "base": (10, ("base", "test_signals.py", "algorithms/test_registry.py")),
    "trails.py": (3, ("test_trails.py",)),
    "mission": (14, ("mission", "test_boundaries.py")),
    "outcomes.py": (5, ("test_outcomes.py",)),
    "problem.py": (3, ("test_problem.py",)),
    "indicators.py": (3, ("test_indicators.py", "study/test_indicators.py")),
    "mission/formats": (10, ("mission",)),
    "bounds": (12, ("bounds",)),
    "operators": (8, ("operators",)),
    "algorithms": (8, ("algorithms",)),
    "decide": (10, ("decide",)),
    "solution.py": (4, ("test_solve.py",)),
    "testing": (4, ("testing",)),
    "underway.py": (6, ("underway",)),
    "library.py": (5, ("library",)),
    "plots": (20, ("plots",)),
    "explorer": (8, ("explorer",)),
    "cli": (10, ("test_cli.py", "library/test_commands.py")),
    "study": (16, ("study",)),
}
FIFTY = 50  # operators of a module
MODULES_WITHOUT = {"compile.py", "threads.py"}  # how kernels are compiled and called
SWAPPED: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.LtE: ast.Gt,
    ast.Gt: ast.LtE,
    ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
QUICK, ALL = "make test", "make test-all"


class Run(NamedTuple):
    """A part of the tests of an entry."""

    target: str  # that runs these tests
    marked: str
    examples: float  # the share of the examples of property tests
    compiled: bool


RUNS = (
    Run(QUICK, "not slow and not compiled_only", 0.1, compiled=False),  # for kernels alone
    Run(QUICK, "not slow", 0.1, compiled=True),
    Run(ALL, "slow or hypothesis", 1.0, compiled=True),
)


def runs_of(entry: str) -> tuple[Run, ...]:
    """Return how the tests of an entry are run, one after another."""
    of_kernels = ENTRIES[entry][0] == 0
    return RUNS if of_kernels else RUNS[1:]


_PYTEST = ("-m", "pytest", "-x", "-p", "no:cacheprovider", "--tb=line", "--timeout=300")


class Mutant(NamedTuple):
    """A place in the source, and what stands there instead."""

    path: Path
    line: int
    source: str  # the statement as it is
    changed: str
    module: str  # the whole module with the change


def main() -> int:
    """Try the changes in the entries that the command line names, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m checks.mutations")
    parser.add_argument("entries", nargs="*", metavar="ENTRY", help=", ".join(ENTRIES))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="the table as CSV")
    given = parser.parse_args()
    if unknown := sorted({*given.entries} - {*ENTRIES}):
        parser.error(f"expected some of {', '.join(ENTRIES)}, found {', '.join(unknown)}")
    rows = []
    with tempfile.TemporaryDirectory(prefix="botohe-mutations-") as folder:
        copy_checkout(Path(folder))
        for entry in given.entries or ENTRIES:
            for run in runs_of(entry):
                if failed := run_tests(Path(folder), entry, run):
                    print(f"Without any change, this fails: {failed}")
                    return 1
            for mutant in draw_mutants(entry, np.random.default_rng(given.seed)):
                row = try_mutant(Path(folder), entry, mutant)
                print(*row.values(), sep="\n    ", flush=True)
                rows.append(row)
                if given.out is not None:  # it takes hours: what is known is kept
                    pd.DataFrame(rows).to_csv(given.out, index=False)
    table = pd.DataFrame(rows)
    counts = table["noticed by"].value_counts()
    by_quick, by_slow = (int(counts.get(name, 0)) for name in (QUICK, ALL))
    print(f"{len(table)} changes: {by_quick} noticed by make test, {by_slow} by slow tests alone")
    return int(by_quick < 0.95 * (by_quick + by_slow))


def draw_mutants(entry: str, rng: np.random.Generator) -> Iterator[Mutant]:
    """Draw one place of every fifty in each module of kernels, or as many as the entry has."""
    n_places, _ = ENTRIES[entry]
    place = ROOT / PACKAGE / entry
    paths = [place] if place.is_file() else sorted(place.rglob("*.py"))
    modules = [list(mutants(path)) for path in paths if path.name not in MODULES_WITHOUT]
    if n_places:
        modules = [[mutant for module in modules for mutant in module]]
    for places in filter(None, modules):
        for i in sorted(
            rng.choice(len(places), n_places or math.ceil(len(places) / FIFTY), replace=False)
        ):
            yield places[i]


def mutants(path: Path) -> Iterator[Mutant]:
    """List each operator of a module's functions with the module in which it is another."""
    source = path.read_text("utf-8")
    tree = ast.parse(source)
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        for statement in ast.walk(ast.Module(function.body, [])):
            if not isinstance(statement, ast.stmt) or isinstance(statement, ast.FunctionDef):
                continue
            for owner, name, operator in operators(statement):
                before = ast.unparse(statement).splitlines()[0]
                _set(owner, name, SWAPPED[type(operator)]())
                after, module = ast.unparse(statement).splitlines()[0], ast.unparse(tree)
                _set(owner, name, operator)
                relative = path.relative_to(ROOT)
                yield Mutant(relative, statement.lineno, before, after, module)


def operators(statement: ast.stmt) -> Iterator[tuple[ast.AST, str, ast.AST]]:
    """List the operators of a statement's own expressions: their owner, its field, and they."""
    inner = [one for one in ast.iter_child_nodes(statement) if isinstance(one, ast.expr)]
    for node in (statement, *(one for expression in inner for one in ast.walk(expression))):
        if isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign) and type(node.op) in SWAPPED:
            yield node, "op", node.op
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPPED:
            yield node, "ops", node.ops[0]


def _set(owner: ast.AST, name: str, operator: ast.AST) -> None:
    if name == "ops":
        owner.ops[0] = operator  # type: ignore[attr-defined]
    else:
        setattr(owner, name, operator)


def copy_checkout(folder: Path) -> None:
    """Copy the files that git tracks: tests read guides, studies and results, too."""
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, listed.split("\0")):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, target)


def try_mutant(copy: Path, entry: str, mutant: Mutant) -> dict[str, object]:
    """Change a module of a copy, run the tests of its entry, and put the module back."""
    path, caught, noticed = copy / mutant.path, None, "neither"
    source = path.read_text("utf-8")
    path.write_text(mutant.module, "utf-8")
    try:
        for run in runs_of(entry):
            if caught := run_tests(copy, entry, run):
                noticed = run.target
                break
    finally:
        path.write_text(source, "utf-8")
    return {
        "module": str(mutant.path.relative_to(PACKAGE)),
        "line": mutant.line,
        "statement": mutant.source,
        "changed": mutant.changed,
        "noticed by": noticed,
        "test": caught or "",
    }


def run_tests(copy: Path, entry: str, run: Run) -> str | None:
    """Run tests of an entry; return the first that fails, or None."""
    environment = os.environ | {
        "BOTOHE_EXAMPLES": str(run.examples),
        "NUMBA_DISABLE_JIT": str(int(not run.compiled)),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": os.pathsep.join([str(copy / "src"), str(copy)]),
    }
    tests = [f"tests/{name}" for name in ENTRIES[entry][1]]
    try:
        done = subprocess.run(
            [sys.executable, *_PYTEST, "-m", run.marked, *tests],
            cwd=copy, env=environment, capture_output=True, text=True, check=False, timeout=1800,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "the tests do not end"
    if done.returncode in (0, 5):  # 5: there are none
        return None
    found = re.search(r"^(?:FAILED|ERROR) tests/(\S+)", done.stdout, re.M)
    return found.group(1) if found else "pytest itself fails"


if __name__ == "__main__":
    sys.exit(main())
