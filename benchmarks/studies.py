"""What a second worker brings to a study, what recording costs a run, and a study that is done."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pandas as pd

from botohe_moo.study import make_tables, run_study

REPETITIONS = 3
FASTER, COSTS, AGAIN = 1.7, 0.05, 0.1  # what is judged
ANTS = {"algorithm": "bo-aco", "parameters": {"n_ants": 5}}
# Runs that take the same time, some seconds each.
EQUAL: dict[str, Any] = {
    "name": "equal",
    "missions": ["art_museum"],
    "algorithms": ["bo-aco"],
    "budget": {"evaluations": 2_000_000},
    "seeds": 12,
}
RECORDED: dict[str, Any] = {
    "name": "recording",
    "missions": ["art_museum", "power_plant"],
    "algorithms": ["bo-aco", "nsga2", "simulated-annealing", "pareto-local-search"],
    "budget": {"evaluations": 100_000},
    "seeds": 5,
}
# 3 000 runs that are next to nothing.
TINY: dict[str, Any] = {
    "name": "tiny",
    "missions": {"toy": "toy", "trio": {"mission": "toy", "robots": 3}},
    "algorithms": {"random": "random", "greedy": "greedy", "small": ANTS},
    "budget": {"evaluations": 10},
    "seeds": 500,
    "recording": {"per_decade": 1},
}


def run(out: Path) -> bool:
    """Print and keep the tables; tell whether they are within their bounds."""
    tables = {"workers": _speed_up(), "recording": _recording(), "again": _again()}
    for name, table in tables.items():
        print(f"\n{table.to_string(index=False)}")
        table.to_csv(out / f"{name}.csv", index=False)
    seconds = tables["again"].set_index("what")["s"]
    return bool(
        tables["workers"]["times faster"].median() >= FASTER
        and (tables["recording"].query("algorithm == 'bo-aco'")["recording / run"] < COSTS).all()
        and seconds["study run, nothing new"] < AGAIN * seconds["study run"]
    )


def _speed_up() -> pd.DataFrame:
    """Time a study of equal runs with one and with two workers, in turns."""
    rows = []
    for repetition in range(1, REPETITIONS + 1):
        seconds = []
        for workers in (1, 2):
            with tempfile.TemporaryDirectory() as folder:
                started = time.perf_counter()
                run_study(EQUAL, folder, workers=workers)
                seconds.append(time.perf_counter() - started)
        rows.append((repetition, *seconds, seconds[0] / seconds[1]))
    columns = ["repetition", "one worker, s", "two workers, s", "times faster"]
    return pd.DataFrame(rows, columns=columns).round(3)


def _recording() -> pd.DataFrame:
    """Compare the time of recording with the algorithm's own."""
    with tempfile.TemporaryDirectory() as folder:
        runs = run_study(RECORDED, folder).runs
    runs["recording / run"] = runs["recording_seconds"] / runs["seconds"]
    columns = ["recording_seconds", "seconds", "recording / run"]
    return runs.groupby(["mission", "algorithm"])[columns].median().round(4).reset_index()


def _again() -> pd.DataFrame:
    """Time a study of 3 000 tiny runs, and how soon it is done again."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "botohe_moo.cli", "study", "run"]
        command += [f"{folder}/study.yaml", "--out", folder]
        acts = {
            "study run": lambda: run_study(TINY, folder, workers=2),
            "study run, nothing new": lambda: run_study(TINY, folder),
            "study run, nothing new, as a command": lambda: subprocess.run(
                command, check=True, capture_output=True
            ),
            "study tables": lambda: make_tables(folder),
        }
        rows = []
        for what, act in acts.items():
            started = time.perf_counter()
            act()
            rows.append({"what": what, "s": round(time.perf_counter() - started, 2)})
    return pd.DataFrame(rows)
