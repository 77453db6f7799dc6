"""What a start costs: from a command to the printed front, cold and warm, and the parts of it.

Everything runs in a process of its own, on a copy of a checkout's package whose caches are empty at
first: a cold start compiles kernels and Python's bytecode. Each number is the median of five
starts, checkouts in turn. CPU seconds are those of the whole process tree. Each row says on how
many processors (``cores``), as ``taskset`` would set it.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import psutil

from botohe_moo.base.runtime import n_cpus

HERE = Path(__file__).parents[1]
COLD = (  # missions, evaluations and algorithms
    ("art_museum", 100, "pareto-local-search"),
    ("art_museum", 1_000_000, "pareto-local-search"),
    ("power_plant", 100, "pareto-local-search"),
    ("terrain_200", 100, "pareto-local-search"),
    ("art_museum", 100, "bo-aco"),
    ("art_museum", 1_000_000, "bo-aco"),
    ("art_museum", 100, "nsga2"),
    ("toy", 100, "exact"),
)
CORES = tuple(n for n in (1, 2) if n <= n_cpus())
REPEATS = 5


class Cost(NamedTuple):
    """CPU seconds and seconds until a process printed what was waited for, and until its end."""

    cpu_to_front: float
    seconds_to_front: float
    cpu: float
    seconds: float


def run(folder: Path, before: Path | None = None) -> bool:
    """Print and write the table, for this checkout and for another."""
    checkouts = {"now": HERE} if before is None else {"before": before, "now": HERE}
    rows = []
    with tempfile.TemporaryDirectory(prefix="botohe-start-") as made:
        copies = {name: Copy(root, Path(made, name)) for name, root in checkouts.items()}
        for start, cores, checkout, cost in measured(copies):
            row = {"start": start, "cores": cores, "checkout": checkout}
            rows.append({**row, **cost._asdict()})
    table = pd.DataFrame(rows).round(2)
    print(table.to_string(index=False))
    table.to_csv(folder / "start.csv", index=False)
    return True


class Copy:
    """A copy of a checkout's package, used in its own environment."""

    def __init__(self, root: Path, folder: Path) -> None:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(root / "src" / "botohe_moo", folder / "src" / "botohe_moo", ignore=ignored)
        own = root / ".venv" / "bin" / "python"
        self.python = own if own.exists() else Path(sys.executable)
        self.folder = folder
        unset = ("NUMBA_CACHE_DIR", "PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX")
        self.environment: Mapping[str, str] = {
            **{name: value for name, value in os.environ.items() if name not in unset},
            "PYTHONPATH": str(folder / "src"),
        }

    def forget(self) -> None:
        """Empty the caches of kernels and bytecode."""
        for cache in list(self.folder.rglob("__pycache__")):
            shutil.rmtree(cache)

    def cost(self, *arguments: str, cores: int, until: str = "") -> Cost:
        """Run Python on some cores and wait for a line with a text, and for the end."""
        usual = resource.getrusage(resource.RUSAGE_CHILDREN)
        started = time.perf_counter()
        command = [str(self.python), *arguments]
        usable = set(sorted(os.sched_getaffinity(0))[:cores])
        with subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: os.sched_setaffinity(0, usable),
        ) as process:
            front = None
            for line in process.stdout or ():
                if front is None and until and until in line:
                    front = cpu_of_tree(process.pid), time.perf_counter() - started
        if process.returncode:
            raise subprocess.CalledProcessError(process.returncode, command)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = used.ru_utime + used.ru_stime - usual.ru_utime - usual.ru_stime
        end = cpu, time.perf_counter() - started
        return Cost(*(front or end), *end)

    def solve(self, mission: str, evaluations: int, algorithm: str, cores: int) -> Cost:
        """Run ``botohe solve`` and wait for its front."""
        search = ("solve", mission, "-n", str(evaluations), "-a", algorithm, "--out", "out")
        return self.cost("-m", "botohe_moo.cli", *search, cores=cores, until="plan_id")


def cpu_of_tree(pid: int) -> float:
    """CPU seconds so far of a process and of all that it started."""
    process = psutil.Process(pid)
    processes = [process, *process.children(recursive=True)]
    return sum(sum(one.cpu_times()[:4]) for one in processes)  # ended children included


def measured(copies: Mapping[str, Copy]) -> Iterator[tuple[str, int, str, Cost]]:
    """Measure all starts, each several times, copies in turn, and give medians."""
    for start, cores, is_cold, measure in starts():
        costs: dict[str, list[Cost]] = {name: [] for name in copies}
        for repeat in range(REPEATS + (not is_cold)):
            for name, copy in copies.items():
                if is_cold:
                    copy.forget()
                cost = measure(copy, cores)
                if is_cold or repeat:  # the first of warm starts fills the caches
                    costs[name].append(cost)
        for name, of_copy in costs.items():
            cost = Cost(*pd.DataFrame(of_copy).median())
            print(f"{name}: {start} on {cores}: {cost.seconds_to_front:.1f} s", flush=True)
            yield start, cores, name, cost


def starts() -> Iterator[tuple[str, int, bool, Callable[[Copy, int], Cost]]]:
    """Name each start: on how many cores, whether caches are empty, how to measure it."""
    for case in COLD:
        for cores in CORES:
            yield "cold {} -n {} -a {}".format(*case), cores, True, partial(_solve, case)
    most = max(CORES)
    yield "warm art_museum -n 100", most, False, partial(_solve, COLD[0])
    yield "warm botohe --help", most, False, partial(_python, ("-m", "botohe_moo.cli", "--help"))
    yield "warm import botohe_moo", most, False, partial(_python, ("-c", "import botohe_moo"))
    yield "warm python", most, False, partial(_python, ("-c", ""))


def _solve(case: tuple[str, int, str], copy: Copy, cores: int) -> Cost:
    return copy.solve(*case, cores)


def _python(arguments: tuple[str, ...], copy: Copy, cores: int) -> Cost:
    return copy.cost(*arguments, cores=cores)
