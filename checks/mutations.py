"""Change one operator in each module of kernels: some test has to notice.

``python -m checks.mutations [MODULE ...] [--out CSV]`` works on a copy of the checkout, with
kernels that are not compiled. The tests have to pass as long as nothing is changed. Then each line
of ``checks/mutants.py`` is changed in turn, its test is run, and the line is put back. The exit
status is 1 if a change is not noticed, if a module has no change listed, or if one cannot be made.
"""

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from checks.mutants import MUTANTS, Mutant

ROOT = Path(__file__).parents[1]
KERNELS = Path("src", "botohe_moo", "kernels")
NO_KERNELS = {"compile", "linking"}  # how kernels are compiled
COLUMNS = ("kernel", "line", "changed", "caught by")
_PYTEST = ("-m", "pytest", "-x", "-p", "no:cacheprovider", "--tb=line", "--timeout=120")


def main() -> int:
    """Try the changes that the command line names, and give the exit status."""
    parser = argparse.ArgumentParser(prog="python -m checks.mutations")
    parser.add_argument("modules", nargs="*", metavar="MODULE", help="by default all")
    parser.add_argument("--out", type=Path, help="the table as CSV")
    given = parser.parse_args()
    chosen = [one for one in MUTANTS if not given.modules or one.module in given.modules]
    faults = list_faults()
    for fault in faults:
        print(fault)
    if faults or not chosen:
        return 1
    with tempfile.TemporaryDirectory(prefix="botohe-mutations-") as folder:
        copy = copy_checkout(Path(folder))
        said = run_tests(copy, sorted({one.test for one in chosen}))
        if said is not None:
            print(f"Without any change, this fails: {said}")
            return 1
        rows = [(one, try_mutant(copy, one)) for one in chosen]
    if given.out is not None:
        write_table(rows, given.out)
    n_survived = sum(caught is None for _, caught in rows)
    print(f"{len(rows)} changes, {n_survived} not noticed")
    return int(n_survived > 0)


def list_faults() -> list[str]:
    """List the modules without a change, and the changes that cannot be made."""
    modules = {
        str(path.relative_to(ROOT / KERNELS).with_suffix(""))
        for path in (ROOT / KERNELS).rglob("*.py")
        if path.name != "__init__.py"
    } - NO_KERNELS
    faults = [f"{name}: no change is listed" for name in modules - {one.module for one in MUTANTS}]
    for one in MUTANTS:
        if one.module not in modules:
            faults.append(f"{one.module}: there is no such module")
        elif (n := path_of(ROOT, one).read_text("utf-8").count(one.line)) != 1:
            faults.append(f"{one.module}: {one.line!r} is there {n} times")
    return sorted(faults)


def path_of(root: Path, one: Mutant) -> Path:
    """Give the path of the module that is changed."""
    return root / KERNELS / f"{one.module}.py"


def copy_checkout(folder: Path) -> Path:
    """Copy what the tests need."""
    ignore = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
    for name in ("src", "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def run_tests(copy: Path, tests: list[str]) -> str | None:
    """Run tests of a copy; give the first that fails, or None."""
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": os.pathsep.join([str(copy / "src"), str(copy)]),
    }
    done = subprocess.run(
        [sys.executable, *_PYTEST, *(f"tests/{test}" for test in tests)],
        cwd=copy, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode == 0:
        return None
    found = re.search(r"^(?:FAILED|ERROR) tests/(\S+)", done.stdout, re.M)
    if found is None:
        raise RuntimeError(f"pytest did not run: {done.stdout}{done.stderr}")
    return found.group(1)


def try_mutant(copy: Path, one: Mutant) -> str | None:
    """Change a line of a copy, run its test, put the line back; give the test that failed."""
    path = path_of(copy, one)
    source = path.read_text("utf-8")
    path.write_text(source.replace(one.line, one.changed), "utf-8")
    try:
        caught = run_tests(copy, [one.test])
    finally:
        path.write_text(source, "utf-8")
    lines = (one.module, one.line, one.changed, caught or "NOT NOTICED")
    print("\n    ".join(lines), flush=True)
    return caught


def write_table(rows: list[tuple[Mutant, str | None]], out: Path) -> None:
    """Write a line for each change."""
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows((one.module, one.line, one.changed, caught or "") for one, caught in rows)


if __name__ == "__main__":
    sys.exit(main())
