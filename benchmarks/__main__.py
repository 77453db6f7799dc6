"""The numbers this project claims: ``python -m benchmarks [NAME ...] [--before PATH]``.

Each benchmark is a module, whose ``run`` writes to a folder of results/; by default all of them
run. ``made`` lists which command makes each result, and the commit that last changed it.
``--before`` names another checkout, which start and pace measure beside this one. The exit status
is 1 if a curve is not the published one, or an area, a reward, a gap, a gain or a size misses its
bound; times themselves, and ratios to another checkout, are never judged: machines differ.
"""

import argparse
import sys
from importlib import import_module
from pathlib import Path

import pandas as pd

RESULTS = Path(__file__).parents[1] / "results"
FOLDERS = {
    "speed": "bo-aco",
    "operators": "operators",
    "studies": "studies",
    "orienteering": "local-search",
    "islands": "islands",
    "threads": "islands",
    "fronts": "growth",
    "growth": "growth",
    "bounds": "bounds",
    "library": "library",
    "ranks": "algorithms",
    "explorer": "explorer",
    "pictures": "choosing",
    "gallery": "gallery",
    "teams": "teams",
    "underway": "underway",
    "learning": "underway",
    "scenarios": "scenarios",
    "start": "start",
    "pace": "start",
    "paper": "paper",
    "made": "",
}
BESIDE = ("pace", "start")  # which measure another checkout, too


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FOLDERS))
    parser.add_argument("--before", type=Path, help=f"another checkout, for {', '.join(BESIDE)}")
    given = parser.parse_args()
    if unknown := [name for name in given.names if name not in FOLDERS]:
        parser.error(f"there is no benchmark {unknown[0]!r}; known are {', '.join(FOLDERS)}.")
    failed = False
    with pd.option_context("display.width", 200, "display.max_columns", 30):
        for name in given.names or FOLDERS:
            print(f"\n== {name} " + "=" * (70 - len(name)), flush=True)
            (RESULTS / FOLDERS[name]).mkdir(parents=True, exist_ok=True)
            options = {"before": given.before} if name in BESIDE else {}
            benchmark = import_module(f"benchmarks.{name}")
            failed |= not benchmark.run(RESULTS / FOLDERS[name], **options)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
