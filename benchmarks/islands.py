"""What islands bring: areas by evaluations of an island and of all, and what memory they take.

``areas.csv`` has a row for each mission, number of islands, and mark. A mark is a number of
evaluations, either of the longest island, which the clock would see if each island had a processor
(``counted`` is "an island"), or of all islands ("all"). Areas between the ends of two generations
are interpolated by the logarithm of evaluations; ``evaluations`` are those of all islands at the
mark. ``behind`` is by how much the area is smaller than that of one island after as many
evaluations of all, with its standard error: means of seeds 1, 2, ... ``memory.csv`` has the peak
memory of a search on 10 000 nodes with 50 robots, and what each island after the first has added.
``threads`` has the clock.
"""

import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from benchmarks.bounds import one_way
from benchmarks.measure import in_process
from benchmarks.memory import peak_resident
from benchmarks.threads import search
from botohe_moo import BOTOHE, Mission, area_indicator, load_mission, make_algorithm
from botohe_moo.base.runtime import n_cpus

ISLANDS = (1, 2, 4, 8, 16)
MARKS = (1_000, 3_000, 10_000, 30_000, 100_000, 125_000, 300_000, 1_000_000)
USUAL = 8  # islands: those that are judged
MOST_BEHIND = 0.0003  # of the area of one island after as many evaluations
WANTED = ("terrain_200", 125_000, 0.4640)  # after as many evaluations of one of the usual islands
LARGEST = {"nodes": 10_000, "robots": 50, "seed": 0}
IN_LARGEST = 200_000  # evaluations


class Site(NamedTuple):
    """A mission, its seeds, and evaluations of all islands and of one."""

    mission: Mission
    seeds: int
    of_all: int
    of_one: int


@cache
def sites() -> dict[str, Site]:
    """Return the missions by name."""
    large = load_mission("terrain", nodes=1_000, robots=10, seed=0)
    return {
        "art_museum": Site(load_mission("art_museum"), 10, 1_000_000, 125_000),
        "power_plant": Site(load_mission("power_plant"), 10, 1_000_000, 125_000),
        "one-way, 80 nodes": Site(one_way(80), 10, 300_000, 30_000),
        "terrain_200": Site(load_mission("terrain_200"), 10, 1_000_000, 125_000),
        "terrain, 1000 nodes": Site(large, 3, 300_000, 30_000),
    }


def run(out: Path) -> bool:
    """Print and keep the tables; judge areas."""
    memory = pd.DataFrame(_memory())
    print(memory.to_string(index=False), flush=True)
    memory.to_csv(out / "memory.csv", index=False)
    table = _areas()
    print(table.to_string(index=False))
    table.to_csv(out / "areas.csv", index=False)
    usual = table[table["islands"] == USUAL]
    behind = usual["behind"] - 2 * usual["behind_se"] > MOST_BEHIND
    found = usual.set_index(["mission", "counted", "mark"])["area"]
    return not behind.any() and bool(found[WANTED[0], "an island", WANTED[1]] >= WANTED[2])


def _memory() -> Iterator[dict[str, object]]:
    alone = 0.0
    for islands in ISLANDS[:-1]:
        evaluations, front, mib = map(float, in_process("benchmarks.islands", islands))
        alone = alone or mib
        of_each = (mib - alone) / (islands - 1) if islands > 1 else float("nan")
        row = {"islands": islands, "evaluations": int(evaluations), "front": int(front)}
        yield {**row, "peak_mib": round(mib), "mib_of_each_further": round(of_each, 1)}


def _areas() -> pd.DataFrame:
    cases = [
        (name, islands, seed)
        for name, site in sites().items()
        for islands in ISLANDS
        for seed in range(1, site.seeds + 1)
    ]
    with ProcessPoolExecutor(n_cpus()) as pool:
        rows = [row for found in pool.map(_found, *zip(*cases, strict=True)) for row in found]
    case, keys = ["mission", "islands", "counted", "mark"], ["mission", "counted", "mark", "seed"]
    runs = pd.DataFrame(rows)
    alone = runs[(runs["islands"] == 1) & (runs["counted"] == "all")].set_index(keys)["area"]
    runs["behind"] = runs.set_index(keys).index.map(alone).to_numpy() - runs["area"]
    grouped = runs.groupby(case, sort=False)
    table = grouped[["evaluations", "area", "behind"]].mean()
    table["behind_se"] = grouped["behind"].sem()
    table["seeds"] = grouped.size()
    rounded = {"evaluations": 0, "area": 5, "behind": 5, "behind_se": 5}
    return table.round(rounded).astype({"evaluations": int}).reset_index()


def _found(name: str, islands: int, seed: int) -> list[dict[str, object]]:
    """Search with some islands; give the areas at all marks."""
    site = sites()[name]
    algorithm = make_algorithm("pareto-local-search", n_islands=islands)
    algorithm.setup(BOTOHE(site.mission), termination=("n_eval", 10**9), seed=seed)
    last = {"all": site.of_all, "an island": site.of_one}
    marks = {counted: [m for m in MARKS if m <= most] for counted, most in last.items()}
    before, rows = State(0.0, 0.0, 0.0), []
    while any(marks.values()):
        algorithm.next()
        spent = algorithm.evaluator.n_eval
        area = area_indicator(algorithm.archive.objectives, site.mission)
        of_one = before.of_one + (spent - before.of_all) / algorithm._search.n_running
        now = State(spent, of_one, area)
        for counted, n_before, n in (
            ("all", before.of_all, now.of_all),
            ("an island", before.of_one, now.of_one),
        ):
            while marks[counted] and n >= marks[counted][0]:
                mark = marks[counted].pop(0)
                share = math.log(mark / n_before) / math.log(n / n_before) if n_before else 1.0
                at = [(1 - share) * old + share * new for old, new in zip(before, now, strict=True)]
                row = {"mission": name, "islands": islands, "counted": counted, "mark": mark}
                rows.append({**row, "seed": seed, "evaluations": at[0], "area": at[2]})
        before = now
    return rows


class State(NamedTuple):
    """Evaluations of all islands and of one, and the area, after a generation."""

    of_all: float
    of_one: float
    area: float


if __name__ == "__main__":  # one search of the largest mission: evaluations, front, peak memory
    searching = make_algorithm("pareto-local-search", n_islands=int(sys.argv[1]))
    search(load_mission("terrain", **LARGEST), searching, IN_LARGEST)
    print(searching.evaluator.n_eval, len(searching.archive), peak_resident())
