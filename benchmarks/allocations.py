"""What concurrent allocation is worth: areas with both allocations."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pymoo.optimize import minimize

from benchmarks.measure import standard_error
from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission

# Evaluations of each run, and runs: more where areas differ much from seed to seed, fewer where a
# plan has a hundred times the hops.
MISSIONS = {
    "art_museum": (100_000, 15),
    "power_plant": (100_000, 25),
    "two_communities": (100_000, 5),
    "terrain_200": (20_000, 5),
}


def run(out: Path) -> bool:
    """Print and keep the areas; none of them is judged."""
    rows = []
    for name, (evaluations, n_runs) in MISSIONS.items():
        problem = BOTOHE(load_mission(name))
        plain = None
        for allocation in ("sequential", "concurrent"):
            areas, seconds = _measure(problem, {"allocation": allocation}, evaluations, n_runs)
            plain = areas if plain is None else plain
            rows.append(
                {
                    "mission": name,
                    "evaluations": evaluations,
                    "allocation": allocation,
                    "runs": n_runs,
                    "area": np.mean(areas),
                    "sd": np.std(areas, ddof=1),
                    "difference": np.mean(areas) - np.mean(plain),
                    "standard_error": standard_error(areas, plain),
                    "seconds": seconds,
                }
            )
    table = pd.DataFrame(rows).round(5)
    print("BOACO.journal(), seeds 1, 2, ...; difference from each mission's first line")
    print(table.round({"seconds": 2}).to_string(index=False))
    # Times differ from machine to machine: they are printed, and not kept.
    table.drop(columns="seconds").to_csv(out / "variants.csv", index=False)
    return True


def _measure(
    problem: BOTOHE, variant: dict[str, Any], evaluations: int, n_runs: int
) -> tuple[list[float], float]:
    """Give the area of each seed's run, and the seconds of the fastest one."""
    minimize(problem, BOACO.journal(**variant), ("n_eval", 200), seed=1)  # compiles
    areas, seconds = [], []
    for seed in range(1, n_runs + 1):
        started = time.perf_counter()
        result = minimize(problem, BOACO.journal(**variant), ("n_eval", evaluations), seed=seed)
        seconds.append(time.perf_counter() - started)
        areas.append(area_indicator(-result.F, problem.mission))
    return areas, min(seconds)
