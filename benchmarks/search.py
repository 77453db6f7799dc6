"""What Pareto local search reaches, and how soon: areas, times, and BO-ACO beside it."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission
from botohe_moo.algorithms.local_search.algorithm import ParetoLocalSearch

# Mission, evaluations, runs; what the mean area must reach, and every run's.
AREAS = (
    ("art_museum", 100_000, 10, 0.531, 0.0),
    ("art_museum", 1_000_000, 10, 0.5329, 0.5329),
    ("power_plant", 1_000_000, 10, 0.34, 0.0),
    ("power_plant", 10_000_000, 5, 0.341, 0.0),
    ("terrain_200", 100_000, 5, 0.0, 0.0),
    ("terrain_200", 1_000_000, 5, 0.45, 0.0),
)
COLONY_EVALUATIONS = (100_000, 1_000_000)
COLONY_RUNS = 3
SEARCHES = 10
TIMES_FASTER = 100
# Objectives that differ by less are equal: they are sums of products in another order.
EQUAL = 1e-9


class _Run(NamedTuple):
    front: NDArray[np.float64]
    seconds: float


def run(out: Path) -> bool:
    """Print areas and times, keep what does not differ from machine to machine; judge it."""
    _solve(ParetoLocalSearch, "toy", 300, 1)  # compiles
    _solve(BOACO.journal, "toy", 300, 1)
    areas, enough = _areas()
    areas.drop(columns="us_per_evaluation").to_csv(out / "areas.csv", index=False)
    print("ParetoLocalSearch(), seeds 1, 2, ...; one thread")
    print(areas.to_string(index=False), flush=True)
    covered, ahead = _beside_the_colony()
    covered.drop(columns=["seconds", "seconds_at_most", "colony_seconds", "times_faster"]).to_csv(
        out / "coverage.csv", index=False
    )
    print("\nBeside BOACO.journal() on the art museum; seconds: until its area is reached")
    print(covered.to_string(index=False))
    return enough and ahead


def _solve(algorithm: Callable[[], Any], name: str, evaluations: int, seed: int) -> _Run:
    problem = BOTOHE(load_mission(name))
    started = time.perf_counter()
    result = minimize(problem, algorithm(), ("n_eval", evaluations), seed=seed)
    return _Run(-result.F, time.perf_counter() - started)


def _areas() -> tuple[pd.DataFrame, bool]:
    rows, enough = [], True
    for name, evaluations, n_runs, mean, least in AREAS:
        mission = load_mission(name)
        runs = [_solve(ParetoLocalSearch, name, evaluations, 1 + i) for i in range(n_runs)]
        found = [area_indicator(run.front, mission) for run in runs]
        enough &= bool(np.mean(found) >= mean and min(found) >= least)
        rows.append(
            {
                "mission": name,
                "evaluations": evaluations,
                "runs": n_runs,
                "area": np.mean(found),
                "least": min(found),
                "mean_wanted": mean or "",
                "least_wanted": least or "",
                "us_per_evaluation": 1e6 * np.median([run.seconds for run in runs]) / evaluations,
            }
        )
    return pd.DataFrame(rows).round({"area": 5, "least": 5, "us_per_evaluation": 3}), enough


def _beside_the_colony() -> tuple[pd.DataFrame, bool]:
    """Search for as many evaluations as a colony, and until its area is reached."""
    mission, rows, enough, fast = load_mission("art_museum"), [], True, True
    for evaluations in COLONY_EVALUATIONS:
        searches = [
            _solve(ParetoLocalSearch, "art_museum", evaluations, 1 + i) for i in range(SEARCHES)
        ]
        for seed in range(1, COLONY_RUNS + 1):
            colony = _solve(BOACO.journal, "art_museum", evaluations, seed)
            area = area_indicator(colony.front, mission)
            seconds = [_seconds_to(area, 1 + i) for i in range(SEARCHES)]
            missed = [_missed(colony.front, search.front) for search in searches]
            ratio = colony.seconds / float(np.mean(seconds))
            late = evaluations == max(COLONY_EVALUATIONS)
            enough &= not (late and any(missed))
            fast &= ratio >= TIMES_FASTER or not late
            rows.append(
                {
                    "evaluations": evaluations,
                    "colony_seed": seed,
                    "colony_area": area,
                    "colony_points": len(colony.front),
                    "searches": SEARCHES,
                    "covering_all": sum(n == 0 for n in missed),
                    "points_missed": np.mean(missed),
                    "colony_seconds": colony.seconds,
                    "seconds": np.mean(seconds),
                    "seconds_at_most": max(seconds),
                    "times_faster": ratio,
                }
            )
    rounded = {
        "colony_area": 5,
        "colony_seconds": 1,
        "seconds": 4,
        "seconds_at_most": 4,
        "times_faster": 0,
    }
    return pd.DataFrame(rows).round(rounded), enough and fast


def _missed(points: NDArray[np.float64], front: NDArray[np.float64]) -> int:
    """Count the points that nothing in the front weakly dominates."""
    covered = (front[:, None] >= points * (1 - EQUAL)).all(axis=2).any(axis=0)
    return int((~covered).sum())


def _seconds_to(area: float, seed: int) -> float:
    """Give the seconds until the search's front has such an area, the area's own not counted."""
    problem = BOTOHE(load_mission("art_museum"))
    algorithm, spent, reached = ParetoLocalSearch(), 0.0, False
    started = time.perf_counter()
    algorithm.setup(problem, termination=("n_gen", 100_000), seed=seed)
    spent += time.perf_counter() - started
    while not reached:
        started = time.perf_counter()
        algorithm.next()
        spent += time.perf_counter() - started
        reached = area_indicator(algorithm.archive.objectives, problem.mission) >= area
    started = time.perf_counter()
    algorithm.result()
    return spent + time.perf_counter() - started
