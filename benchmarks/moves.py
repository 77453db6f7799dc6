"""What the moves of Pareto local search bring: areas without each of them in turn."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, ParetoLocalSearch, area_indicator, load_mission
from botohe_moo.algorithms.local_search.engine import DEFAULT_MOVES, RUIN_AND_RECREATE

MISSIONS = (
    "art_museum",
    "power_plant",
    "library:terrain-60",
    "library:orienteering-64",
    "library:town-64",
    "library:building-54-kinds",
    "library:terrain-60-depots",
)
EVALUATIONS, RUNS = 100_000, 10


def run(out: Path) -> bool:
    """Print and write mean areas, their standard errors, and what leaving a move out changes."""
    rows = []
    for name in MISSIONS:
        problem = BOTOHE(load_mission(name))
        everything = _areas(problem, "")
        for without in ("", *DEFAULT_MOVES, RUIN_AND_RECREATE):
            areas = _areas(problem, without) if without else everything
            row = {
                "mission": name,
                "without": without,
                "area": areas.mean(),
                "standard_error": areas.std(ddof=1) / np.sqrt(RUNS),
                "percent": 100 * (areas.mean() / everything.mean() - 1),
            }
            print(*row.values(), flush=True)
            rows.append(row)
    pd.DataFrame(rows).round(6).to_csv(out / "moves.csv", index=False)
    return True


def _areas(problem: BOTOHE, without: str) -> NDArray[np.float64]:
    """Compute the areas of some runs that draw all moves but one."""
    options: dict[str, Any] = {"moves": {k: w for k, w in DEFAULT_MOVES.items() if k != without}}
    if without == RUIN_AND_RECREATE:
        options["prob_recreate"] = 0.0
    areas = []
    for seed in range(1, RUNS + 1):
        algorithm = ParetoLocalSearch(**options)
        result = minimize(problem, algorithm, ("n_eval", EVALUATIONS), seed=seed)
        areas.append(area_indicator(-result.F, problem.mission))
    return np.array(areas)
