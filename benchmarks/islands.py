"""What islands bring: areas by the number of islands, and what memory they take.

``areas.csv`` has mean areas of seeds 1, 2, ... after some evaluations of each island, which search
at the same time where each has a processor. ``alone`` is the area of one island after as many
evaluations as all of them. ``memory.csv`` has the peak memory of a search on 10 000 nodes with 50
robots, and what each island after the first has added. ``threads`` has the clock.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.measure import in_process
from benchmarks.memory import peak_resident
from benchmarks.missions import one_way
from benchmarks.threads import search
from botohe_moo import Mission, area_indicator, load_mission, make_algorithm
from botohe_moo.base.runtime import n_cpus

ISLANDS = (1, 2, 4, 8, 16)
CASES = (  # mission, evaluations of each island, seeds
    ("art_museum", 30_000, 10),
    ("art_museum", 125_000, 10),
    ("power_plant", 30_000, 10),
    ("power_plant", 125_000, 10),
    ("one-way, 80 nodes", 30_000, 10),
    ("terrain_200", 30_000, 10),
    ("terrain_200", 125_000, 10),
    ("terrain, 1000 nodes", 30_000, 3),
)
USUAL = 8  # islands: those that are judged
MOST_BEHIND = 0.0003  # of the area of one island after as many evaluations
LARGEST = {"nodes": 10_000, "robots": 50, "seed": 0}
IN_LARGEST = 200_000  # evaluations


@cache
def _mission(name: str) -> Mission:
    if name == "one-way, 80 nodes":
        return one_way(80)
    if name == "terrain, 1000 nodes":
        return load_mission("terrain", nodes=1_000, robots=10, seed=0)
    return load_mission(name)


def run(out: Path) -> bool:
    """Print and keep the tables; judge areas."""
    memory = pd.DataFrame(_memory())
    print(memory.to_string(index=False), flush=True)
    memory.to_csv(out / "memory.csv", index=False)
    with ProcessPoolExecutor(n_cpus()) as pool:
        rows = [row for case in CASES for row in _rows(pool, *case)]
    table = pd.DataFrame(rows).round(5)
    table.to_csv(out / "areas.csv", index=False)
    usual = table[table["islands"] == USUAL]
    behind = usual["alone"] - usual["area"] - 2 * usual["standard_error"]
    return not (behind > MOST_BEHIND).any()


def _rows(
    pool: ProcessPoolExecutor, mission: str, evaluations: int, seeds: int
) -> Iterator[dict[str, object]]:
    for islands in ISLANDS:
        searches = [
            [pool.submit(_area, mission, n, evaluations * islands, seed) for n in (islands, 1)]
            for seed in range(1, seeds + 1)
        ]
        areas = np.array([[one.result() for one in pair] for pair in searches])
        row = {
            "mission": mission,
            "evaluations": evaluations,
            "islands": islands,
            "area": areas[:, 0].mean(),
            "alone": areas[:, 1].mean(),
            "standard_error": np.diff(areas).std(ddof=1) / seeds**0.5,
            "seeds": seeds,
        }
        print(*row.values(), flush=True)
        yield row


def _area(mission: str, islands: int, evaluations: int, seed: int) -> float:
    algorithm = make_algorithm("pareto-local-search", n_islands=islands)
    search(_mission(mission), algorithm, evaluations, seed=seed)
    return area_indicator(algorithm.archive.objectives, _mission(mission))


def _memory() -> Iterator[dict[str, object]]:
    alone = 0.0
    for islands in ISLANDS[:-1]:
        evaluations, front, mib = map(float, in_process("benchmarks.islands", islands))
        alone = alone or mib
        of_each = (mib - alone) / (islands - 1) if islands > 1 else float("nan")
        row = {"islands": islands, "evaluations": int(evaluations), "front": int(front)}
        yield {**row, "peak_mib": round(mib), "mib_of_each_further": round(of_each, 1)}


if __name__ == "__main__":  # one search of the largest mission: evaluations, front, peak memory
    searching = make_algorithm("pareto-local-search", n_islands=int(sys.argv[1]))
    search(load_mission("terrain", **LARGEST), searching, IN_LARGEST)
    print(searching.evaluator.n_eval, len(searching.archive), peak_resident())
