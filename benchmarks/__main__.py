"""Run the benchmarks, by default all: ``python -m benchmarks [NAME ...] [--before PATH]``.

The names are curves, speed, growth, allocations (results/bo-aco/), operators, annealing
(results/operators/), studies (results/studies/), search, budgets, orienteering, moves, areas
(results/local-search/), islands, threads (results/islands/), fronts, large (results/growth/),
bounds (results/bounds/), pictures (results/choosing/), gallery (results/gallery/), explorer,
explorer_pictures (results/explorer/), teams (results/teams/), underway, learning
(results/underway/), library (results/library/; two hours), ranks (results/algorithms/), start and
pace (results/start/).
``--before`` names another checkout, which areas, start and pace measure beside this one, and whose
page explorer_pictures draws. The exit status is 1 if a curve is not the published one, or an area,
a reward, a gap, a gain, a ratio to BO-ACO or a size misses its bound; times themselves, and ratios
to another checkout, are never judged, machines differ.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd

from benchmarks import (
    allocations,
    annealing,
    areas,
    bounds,
    budgets,
    curves,
    explorer,
    explorer_pictures,
    fronts,
    gallery,
    growth,
    islands,
    large,
    learning,
    library,
    moves,
    operators,
    orienteering,
    pace,
    pictures,
    search,
    speed,
    start,
    studies,
    teams,
    threads,
    underway,
)

RESULTS = Path(__file__).parents[1] / "results"
BENCHMARKS = {
    "speed": (speed.run, "bo-aco"),
    "growth": (growth.run, "bo-aco"),
    "curves": (curves.run, "bo-aco"),
    "allocations": (allocations.run, "bo-aco"),
    "annealing": (annealing.run, "operators"),
    "operators": (operators.run, "operators"),
    "studies": (studies.run, "studies"),
    "search": (search.run, "local-search"),
    "budgets": (budgets.run, "local-search"),
    "orienteering": (orienteering.run, "local-search"),
    "moves": (moves.run, "local-search"),
    "areas": (areas.run, "local-search"),
    "islands": (islands.run, "islands"),
    "threads": (threads.run, "islands"),
    "fronts": (fronts.run, "growth"),
    "large": (large.run, "growth"),
    "bounds": (bounds.run, "bounds"),
    "library": (library.run, "library"),
    "ranks": (library.ranks, "algorithms"),
    "explorer": (explorer.run, "explorer"),
    "explorer_pictures": (explorer_pictures.run, "explorer"),
    "pictures": (pictures.run, "choosing"),
    "gallery": (gallery.run, "gallery"),
    "teams": (teams.run, "teams"),
    "underway": (underway.run, "underway"),
    "learning": (learning.run, "underway"),
    "start": (start.run, "start"),
    "pace": (pace.run, "start"),
}
BESIDE = ("areas", "explorer_pictures", "pace", "start")  # which measure another checkout, too


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(BENCHMARKS))
    parser.add_argument("--before", type=Path, help=f"another checkout, for {', '.join(BESIDE)}")
    given = parser.parse_args()
    wanted = given.names or list(BENCHMARKS)
    if unknown := set(wanted) - set(BENCHMARKS):
        print(f"Unknown benchmark {', '.join(unknown)}; known are {', '.join(BENCHMARKS)}.")
        return 2
    if given.before is not None and not (given.before / "src" / "botohe_moo").is_dir():
        print(f"Expected a checkout of this repository, got {given.before}.")
        return 2
    failed = False
    with pd.option_context("display.width", 200, "display.max_columns", 30):
        for name in wanted:
            print(f"\n== {name} " + "=" * (70 - len(name)), flush=True)
            run, folder = BENCHMARKS[name]
            (RESULTS / folder).mkdir(parents=True, exist_ok=True)
            options = {"before": given.before} if name in BESIDE else {}
            failed |= not run(RESULTS / folder, **options)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
