"""The paper's study beside what was published: ``python -m benchmarks.paper results/paper``."""

import sys
from pathlib import Path

import pandas as pd

from benchmarks.curves import MARKS, OTHERS, PUBLISHED, TOLERANCE
from botohe_moo.study import StudyTables, read_study

ANTS = 100  # evaluations of an iteration
MISSION = "art-museum"
ORDER = ("BO-ACO", "no pheromone", "no heuristic", "random")


def main() -> int:
    """Write ``published.csv``; the exit status is 1 if a curve is not the published one."""
    tables = read_study(sys.argv[1])
    checks = compared(tables)
    checks.to_csv(Path(sys.argv[1]) / "published.csv", index=False)
    print(checks.to_string(index=False))
    areas = checks.set_index(["algorithm", "iteration"])["area"]
    at_1000 = [areas[name, 1_000] for name in ORDER]
    in_order = at_1000 == sorted(at_1000, reverse=True)
    print(f"\npublished order at 1 000 iterations: {in_order}")
    print(f"all within tolerance: {checks['within'].all()}")
    return int(not (in_order and checks["within"].all()))


def compared(tables: StudyTables) -> pd.DataFrame:
    """Put the areas at the published iterations beside the published ones."""
    trace = tables.trace[tables.trace["mission"] == MISSION]
    rows = []
    for name, (published, deviations) in PUBLISHED.items():
        curve = trace[trace["algorithm"] == name]
        tolerances = TOLERANCE.get(name, OTHERS)
        for mark, area, sd, tolerance in zip(MARKS, published, deviations, tolerances, strict=True):
            ours = curve.loc[curve["evaluations"] == mark * ANTS, "area"]
            assert len(ours) == len(tables.manifest["seeds"]), (name, mark)
            rows.append(
                {
                    "algorithm": name,
                    "iteration": mark,
                    "published": area,
                    "published_sd": sd,
                    "area": round(ours.mean(), 4),
                    "sd": round(ours.std(), 4),
                    "difference": round(ours.mean() - area, 4),
                    "tolerance": tolerance,
                    "within": abs(ours.mean() - area) <= tolerance,
                }
            )
    return pd.DataFrame(rows)


if __name__ == "__main__":
    sys.exit(main())
