"""The tests with the oldest and the newest libraries that are supported, on each Python.

``python -m checks.compatibility [PYTHON ...] [--libraries oldest|newest] [--whole] [--out CSV]``

Each Python that is here (on the path, or pyenv's) gets two environments: the lower bounds of
pyproject.toml, as constraints-oldest.txt has them, and whatever is newest. Wheels are preferred.
The tests are those of what libraries may change: numbers, kernels, files, tables and pictures.
Those left out start many processes, or compare the wording of pages and commands with what is
written in guides; ``--whole`` runs them, too. A Python that is not here is named in the table. The
exit status is 1 if a test fails or an environment cannot be made.
"""

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13")
LIBRARIES = ("oldest", "newest")
SHOWN = ("pymoo", "numpy", "numba")
TOOLS = ("hypothesis", "jsonschema", "psutil", "pytest", "pytest-timeout", "pytest-xdist")
STUDIES = ("loading", "report", "scores", "statistics")
CHOSEN = (
    "tests/algorithms", "tests/base", "tests/bounds", "tests/core", "tests/decide", "tests/mission",
    "tests/operators", "tests/outcomes", "tests/plots", "tests/test_indicators.py",
    "tests/test_problem.py", "tests/test_solve.py", "tests/test_trails.py",
    *(f"tests/study/test_{name}.py" for name in STUDIES),
)  # fmt: skip
COLUMNS = ("python", "libraries", *SHOWN, "passed", "failed", "skipped", "seconds", "outcome")


def main() -> int:
    """Look at what the command line asks for, print the table, and give the exit status."""
    parser = argparse.ArgumentParser(prog="python -m checks.compatibility")
    parser.add_argument("pythons", nargs="*", metavar="PYTHON", help=", ".join(PYTHONS))
    parser.add_argument("--libraries", choices=LIBRARIES, help="by default both")
    parser.add_argument("--whole", action="store_true", help="all tests")
    parser.add_argument("--out", type=Path, help="the table as CSV")
    given = parser.parse_args()
    if unknown := set(given.pythons) - set(PYTHONS):
        parser.error(f"unknown Python {', '.join(sorted(unknown))}")
    tests = ["tests"] if given.whole else list(CHOSEN)
    rows = []
    print(as_line({name: name for name in COLUMNS}), flush=True)
    for python in given.pythons or PYTHONS:
        for libraries in [given.libraries] if given.libraries else LIBRARIES:
            rows.append(look_at(python, libraries, tests))
            print(as_line(rows[-1]), flush=True)
    if given.out is not None:
        given.out.parent.mkdir(parents=True, exist_ok=True)
        with given.out.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    return int(any(row["outcome"] not in ("passed", "not here") for row in rows))


def as_line(row: dict[str, str]) -> str:
    """Lay out a row for a terminal."""
    return "".join(f"{row.get(name, ''):<10}" for name in COLUMNS).rstrip()


def look_at(python: str, libraries: str, tests: list[str]) -> dict[str, str]:
    """Make an environment, run the tests in it, and give a row of the table."""
    row = {"python": python, "libraries": libraries}
    interpreter = find_python(python)
    if interpreter is None:
        return row | {"outcome": "not here"}
    with tempfile.TemporaryDirectory(prefix=f"botohe-{python}-{libraries}-") as folder:
        began = time.monotonic()
        log = Path(folder) / "log"
        inside = make_environment(interpreter, Path(folder), libraries, log)
        if inside is None:
            print(log.read_text("utf-8")[-3000:], file=sys.stderr)
            return row | {"outcome": "cannot be installed"}
        row |= versions_of(inside)
        environment = clean_environment() | {"NUMBA_CACHE_DIR": f"{folder}/kernels"}
        command = [inside, "-m", "pytest", "-p", "no:cacheprovider", "--tb=short", *tests]
        command += ["--numprocesses", "2", "--maxprocesses", "2", "--dist", "worksteal"]
        with log.open("w") as file:
            status = subprocess.run(
                command, cwd=ROOT, env=environment, stdout=file, stderr=file, check=False
            ).returncode
        said = log.read_text("utf-8")
        if status != 0:
            print(said[-20_000:], file=sys.stderr)
        counts = {name: number for number, name in re.findall(r"(\d+) (\w+)", said[-300:])}
        row |= {name: counts.get(name, "0") for name in ("passed", "failed", "skipped")}
        seconds = str(round(time.monotonic() - began))
        return row | {"seconds": seconds, "outcome": "failed" if status else "passed"}


def find_python(version: str) -> str | None:
    """Find an interpreter of that version, which also can make environments."""
    for path in places(version):
        code = "import ensurepip, sys, venv; print('%d.%d' % sys.version_info[:2])"
        done = subprocess.run([path, "-c", code], capture_output=True, text=True, check=False)
        if done.returncode == 0 and done.stdout.strip() == version:
            return path
    return None


def places(version: str) -> Iterator[str]:
    """List where an interpreter of that version may be: pyenv's folders, and the path."""
    root = Path(os.environ.get("PYENV_ROOT", "~/.pyenv")).expanduser()
    yield from (str(path) for path in sorted(root.glob(f"versions/{version}.*/bin/python")))
    found = shutil.which(f"python{version}")
    yield from [found] if found else []


def clean_environment() -> dict[str, str]:
    """Return the environment without the options of this interpreter."""
    return {name: text for name, text in os.environ.items() if not name.startswith("PYTHON")}


def make_environment(interpreter: str, folder: Path, libraries: str, log: Path) -> str | None:
    """Make an environment with this checkout, its dependencies and what tests need."""
    inside = str(folder / "venv" / "bin" / "python")
    pip = [inside, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    oldest = ["--constraint", "constraints-oldest.txt"] if libraries == "oldest" else []
    commands = [
        [interpreter, "-m", "venv", str(folder / "venv")],
        [*pip, "--upgrade", "pip"],
        [*pip, "--prefer-binary", *oldest, "--editable", ".[dask,maps]", *TOOLS],
    ]
    with log.open("w") as file:
        for command in commands:
            done = subprocess.run(
                command, cwd=ROOT, env=clean_environment(), stdout=file, stderr=file, check=False
            )
            if done.returncode != 0:
                return None
    return inside


def versions_of(inside: str) -> dict[str, str]:
    """Tell which versions of the libraries in the table an environment has."""
    code = f"from importlib.metadata import version as v; print(*map(v, {SHOWN}))"
    said = subprocess.run([inside, "-c", code], capture_output=True, text=True, check=True).stdout
    return dict(zip(SHOWN, said.split(), strict=True))


if __name__ == "__main__":
    sys.exit(main())
