"""What a second worker brings to a study, and what recording costs a run."""

import tempfile
import time
from pathlib import Path
from typing import Any

import pandas as pd

from botohe_moo.study import run_study

REPETITIONS = 3
FASTER, COSTS = 1.7, 0.05  # what is judged
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


def run(out: Path) -> bool:
    """Print and keep the tables; tell whether they are within their bounds."""
    tables = {"workers": _speed_up(), "recording": _recording()}
    for name, table in tables.items():
        print(f"\n{table.to_string(index=False)}")
        table.to_csv(out / f"{name}.csv", index=False)
    return bool(
        tables["workers"]["times faster"].median() >= FASTER
        and (tables["recording"].query("algorithm == 'bo-aco'")["recording / run"] < COSTS).all()
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
