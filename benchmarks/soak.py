"""A study of many small runs: does its memory stay flat? ``python -m benchmarks.soak [SECONDS]``.

``botohe study run`` works for so long, by default an hour, with two workers; then it is stopped, as
by Ctrl-C, and makes its tables. The resident memory of the runner and of each worker is sampled
meanwhile, and kept in results/soak/memory.csv. The exit status is 1 if one of them grows: if the
median of all slopes between two samples, a fifth of the way after the first run has ended, is above
its bound and makes more than noise.
"""

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
from scipy import stats

RESULTS = Path(__file__).parents[1] / "results" / "soak"
SECONDS = 3_600.0
WORKERS = 2
SAMPLES = 600  # at most, of the whole time
WARM_UP = 0.2  # of the time since the first run: kernels are loaded, buffers grow to their size
# MiB for each thousand runs. The runner keeps a line about each of them; workers keep nothing.
MOST_GROWTH = {"runner": 1.0, "worker": 0.25}
NOISE = 8.0  # MiB that memory may seem to grow by in all


def study(seconds: float) -> dict[str, Any]:
    """Give a study of runs of about a tenth of a second, more than two workers have time for."""
    return {
        "name": "soak",
        "missions": {
            "terrain": {
                "mission": "terrain",
                "parameters": {"nodes": 30},
                "grid": {"seed": list(range(100))},
            },
        },
        "algorithms": {
            "BO-ACO": {"algorithm": "bo-aco", "parameters": {"n_ants": 20}},
            "NSGA-II": {"algorithm": "nsga2", "parameters": {"pop_size": 20}},
            "Pareto local search": "pareto-local-search",
            "random": "random",
        },
        "budget": {"evaluations": 2_000},
        "seeds": max(10, math.ceil(seconds / 18)),
        "recording": {"per_decade": 5},
        "indicators": ["area", "front_size"],
    }


def main() -> int:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else SECONDS
    folder = RESULTS / "study"
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    file = RESULTS / "study.yaml"
    file.write_text(json.dumps(study(seconds)))
    command = [sys.executable, "-m", "botohe_moo.cli", "study", "run", str(file)]
    command += ["--out", str(folder), "--workers", str(WORKERS)]
    with (
        (RESULTS / "log.txt").open("w") as log,
        subprocess.Popen(command, stdout=log, stderr=log) as runner,
    ):
        try:
            rows = list(samples(runner, folder / "runs", seconds))
            table = pd.DataFrame(rows, columns=["s", "process", "pid", "runs", "resident MiB"])
            table.to_csv(RESULTS / "memory.csv", index=False)
            runner.send_signal(signal.SIGTERM)
            status = runner.wait(1_800)  # seconds to make the tables
        finally:
            runner.kill()
    return judge(table, stopped=status == 128 + signal.SIGTERM)


def samples(
    runner: subprocess.Popen[bytes], runs: Path, seconds: float
) -> Iterator[tuple[float, str, int, int, float]]:
    """Sample the memory of a runner and its workers while it works, and how many runs are done."""
    began = time.monotonic()
    pause = max(0.5, seconds / SAMPLES)
    while (now := time.monotonic() - began) < seconds and runner.poll() is None:
        n_runs = sum(1 for _ in os.scandir(runs)) if runs.is_dir() else 0
        main = psutil.Process(runner.pid)
        for process in (main, *main.children(recursive=True)):
            try:
                name = "runner" if process.pid == runner.pid else "worker"
                resident = process.memory_info().rss / 2**20
            except psutil.NoSuchProcess:
                continue
            if resident > 1:  # not one that has just begun or ended
                yield round(now, 1), name, process.pid, n_runs, round(resident, 2)
        time.sleep(pause)


def growth(table: pd.DataFrame) -> pd.DataFrame:
    """Give the growth of each process's memory after warming up, in MiB for a thousand runs."""
    began, ended = table.loc[table["runs"] > 0, "s"].agg(["min", "max"])
    late = table[table["s"] >= began + WARM_UP * (ended - began)]
    rows = []
    for (name, pid), own in late.groupby(["process", "pid"], sort=False):
        runs = own["runs"].iloc[-1] - own["runs"].iloc[0]
        if len(own) < 10 or runs == 0:
            continue
        slope = stats.theilslopes(own["resident MiB"], own["runs"])[0] * 1_000
        rows.append(
            {
                "process": name,
                "pid": pid,
                "runs meanwhile": runs,
                "first MiB": own["resident MiB"].iloc[0],
                "last MiB": own["resident MiB"].iloc[-1],
                "MiB / 1000 runs": round(slope, 3),
                "grows": slope > MOST_GROWTH[str(name)] and slope * runs / 1_000 > NOISE,
            }
        )
    return pd.DataFrame(rows)


def judge(table: pd.DataFrame, *, stopped: bool) -> int:
    """Print what has grown; 1 if that is more than it may, or the study was not simply stopped."""
    found = growth(table)
    print(found.to_string(index=False))
    print(f"\n{table['runs'].max()} runs in {table['s'].max():.0f} s, bounds {MOST_GROWTH}")
    names = set() if found.empty else set(found["process"])
    if not stopped or names != MOST_GROWTH.keys():
        print("the study did not work until it was stopped; results/soak/log.txt says why")
        return 1
    print(f"memory is flat: {not found['grows'].any()}")
    return int(found["grows"].any())


if __name__ == "__main__":
    sys.exit(main())
