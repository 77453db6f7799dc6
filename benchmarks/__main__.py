"""Run the benchmarks, by default all: ``python -m benchmarks [NAME ...]``.

The names are curves, speed, growth, colonies (results/bo-aco/), operators, annealing
(results/operators/), studies (results/studies/), search, ideas (results/local-search/), fronts and
large (results/growth/). The exit status is 1 if a curve is not the published one, or an area or a
ratio of times misses its bound; times themselves are never judged, machines differ.
"""

import sys
from pathlib import Path

import pandas as pd

from benchmarks import (
    annealing,
    colonies,
    curves,
    fronts,
    growth,
    ideas,
    large,
    operators,
    search,
    speed,
    studies,
)

RESULTS = Path(__file__).parents[1] / "results"
BENCHMARKS = {
    "speed": (speed.run, "bo-aco"),
    "growth": (growth.run, "bo-aco"),
    "curves": (curves.run, "bo-aco"),
    "colonies": (colonies.run, "bo-aco"),
    "annealing": (annealing.run, "operators"),
    "operators": (operators.run, "operators"),
    "studies": (studies.run, "studies"),
    "search": (search.run, "local-search"),
    "ideas": (ideas.run, "local-search"),
    "fronts": (fronts.run, "growth"),
    "large": (large.run, "growth"),
}


def main() -> int:
    wanted = sys.argv[1:] or list(BENCHMARKS)
    if unknown := set(wanted) - set(BENCHMARKS):
        print(f"Unknown benchmark {', '.join(unknown)}; known are {', '.join(BENCHMARKS)}.")
        return 2
    failed = False
    with pd.option_context("display.width", 200, "display.max_columns", 30):
        for name in wanted:
            print(f"\n== {name} " + "=" * (70 - len(name)), flush=True)
            run, folder = BENCHMARKS[name]
            (RESULTS / folder).mkdir(parents=True, exist_ok=True)
            failed |= not run(RESULTS / folder)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
