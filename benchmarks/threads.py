"""What threads bring: the clock of whole searches in one process.

``clock-N.csv``, of a machine with N processors, has seconds and their shares of those of one thread
with as many islands: medians of five repeats, in turn.
"""

import statistics
import time
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from botohe_moo import BOTOHE, Mission, load_mission, make_algorithm
from botohe_moo.base.runtime import n_cpus

THREADS = (1, 2, 4, 8, 16)
REPEATS = 5


class Case(NamedTuple):
    """A mission, an algorithm, evaluations, and islands where it has these."""

    mission: str
    algorithm: str
    evaluations: int
    islands: int | None = None


CASES = (
    Case("art_museum", "pareto-local-search", 1_000_000, 8),
    Case("power_plant", "pareto-local-search", 1_000_000, 8),
    Case("terrain_200", "pareto-local-search", 1_000_000, 8),
    Case("terrain, 1000 nodes", "pareto-local-search", 300_000, 8),
    Case("terrain_200", "pareto-local-search", 1_000_000, 16),
    Case("terrain_200", "bo-aco", 20_000),
    Case("art_museum", "nsga2", 20_000),
)


def run(out: Path) -> bool:
    """Print and keep the table; nothing is judged."""
    rows = []
    for case in CASES:
        mission, most = _mission(case.mission), case.islands or THREADS[-1]
        islands = {"n_islands": case.islands} if case.islands else {}
        seconds: dict[int, list[float]] = {n: [] for n in THREADS if n <= min(n_cpus(), most)}
        search(mission, make_algorithm(case.algorithm, **islands), 20_000)  # compiles
        for _ in range(REPEATS):
            for n, found in seconds.items():
                algorithm = make_algorithm(case.algorithm, **islands, n_threads=n)
                started = time.perf_counter()
                search(mission, algorithm, case.evaluations)
                found.append(time.perf_counter() - started)
        one = statistics.median(seconds[1])
        for n, found in seconds.items():
            median = statistics.median(found)
            of_one = {"seconds": round(median, 3), "of_one_thread": round(median / one, 3)}
            rows.append({**case._asdict(), "threads": n, "repeats": REPEATS, **of_one})
        table = pd.DataFrame(rows).astype({"islands": "Int64"})
        print(table.tail(len(seconds)).to_string(index=False), flush=True)
        table.to_csv(out / f"clock-{n_cpus()}.csv", index=False)
    return True


def _mission(name: str) -> Mission:
    if name == "terrain, 1000 nodes":
        return load_mission("terrain", nodes=1_000, robots=10, seed=0)
    return load_mission(name)


def search(mission: Mission, algorithm: Any, evaluations: int) -> None:
    """Search a mission, with seed 1."""
    algorithm.setup(BOTOHE(mission), termination=("n_eval", evaluations), seed=1)
    while algorithm.has_next():
        algorithm.next()
