"""Run the benchmarks: ``python -m benchmarks [curves] [speed] [growth]``, by default all.

Tables and pictures go to results/bo-aco/. The exit status is 1 if a curve is not the published
one or a ratio of times misses its bound; times themselves are never judged, machines differ.
"""

import sys
from pathlib import Path

import pandas as pd

from benchmarks import curves, growth, speed

OUT = Path(__file__).parents[1] / "results" / "bo-aco"
BENCHMARKS = {"speed": speed.run, "growth": growth.run, "curves": curves.run}


def main() -> int:
    wanted = sys.argv[1:] or list(BENCHMARKS)
    if unknown := set(wanted) - set(BENCHMARKS):
        print(f"Unknown benchmark {', '.join(unknown)}; known are {', '.join(BENCHMARKS)}.")
        return 2
    OUT.mkdir(parents=True, exist_ok=True)
    failed = False
    with pd.option_context("display.width", 200, "display.max_columns", 30):
        for name in wanted:
            print(f"\n== {name} " + "=" * (70 - len(name)), flush=True)
            failed |= not BENCHMARKS[name](OUT)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
