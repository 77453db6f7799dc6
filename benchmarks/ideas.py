"""What each idea of Pareto local search is worth, at equal evaluations and at equal time."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pymoo.optimize import minimize

from benchmarks.measure import standard_error
from botohe_moo import BOTOHE, area_indicator, load_mission
from botohe_moo.algorithms.pareto_local_search import ParetoLocalSearch
from botohe_moo.search.local_search import DEFAULT_MOVES, MOVES

# Name, parameters, evaluations: missions of several kinds, each where areas still differ.
MISSIONS: tuple[tuple[str, dict[str, Any], int], ...] = (
    ("art_museum", {}, 100_000),
    ("power_plant", {}, 300_000),
    ("two_communities", {}, 100_000),
    ("terrain", {"nodes": 60, "robots": 3, "seed": 1}, 300_000),
    ("terrain_200", {}, 100_000),
)
RUNS = 10


def _variants() -> dict[str, dict[str, Any]]:
    without = {name: {key: DEFAULT_MOVES[key] for key in MOVES if key != name} for name in MOVES}
    return {
        "default": {},
        "no greedy start": {"greedy_start": False},
        "parents drawn uniformly": {"n_drawn": 1},
        "no refilling": {"prob_refill": 0.0},
        **{f"no {name}": {"moves": moves} for name, moves in without.items()},
        "no splice, no graft": {
            "moves": {key: DEFAULT_MOVES[key] for key in MOVES if key not in ("splice", "graft")}
        },
        "all moves equally likely": {"moves": dict.fromkeys(MOVES, 1.0)},
        "1 child": {"n_children": 1},
        "100 children": {"n_children": 100},
        "at most 50 plans": {"max_size": 50},
        "at most 100 plans": {"max_size": 100},
        "at most 200 plans": {"max_size": 200},
    }


def run(out: Path) -> bool:
    """Print and keep what areas become without each idea; none of it is judged."""
    minimize(BOTOHE(load_mission("toy")), ParetoLocalSearch(), ("n_eval", 300), seed=1)  # compiles
    rows = []
    for name, parameters, evaluations in MISSIONS:
        problem = BOTOHE(load_mission(name, **parameters))
        label = f"{name} ({parameters['nodes']} nodes)" if parameters else name
        plain: tuple[list[float], list[float]] | None = None
        usual_seconds = 0.0
        for variant, options in _variants().items():
            equal, seconds = _at(problem, options, evaluations)
            usual_seconds = usual_seconds or seconds
            as_many = round(evaluations * usual_seconds / seconds)
            timed, _ = _at(problem, options, as_many)
            plain = plain or (equal, timed)
            row: dict[str, Any] = {"mission": label, "evaluations": evaluations, "variant": variant}
            for kind, areas, usual in zip(
                ("evaluations", "time"), (equal, timed), plain, strict=True
            ):
                row[f"area_equal_{kind}"] = np.mean(areas)
                row[f"difference_equal_{kind}"] = np.mean(areas) - np.mean(usual)
                row[f"error_equal_{kind}"] = standard_error(areas, usual)
            row["us_per_evaluation"] = 1e6 * seconds / evaluations
            rows.append(row)
    table = pd.DataFrame(rows).round(6)
    table.drop(columns="us_per_evaluation").to_csv(out / "ideas.csv", index=False)
    print(f"ParetoLocalSearch(...), seeds 1 to {RUNS}")
    print("equal time: as many evaluations as take the processor as long as the default's")
    print(table.round({"us_per_evaluation": 2}).to_string(index=False))
    return True


def _at(problem: BOTOHE, options: dict[str, Any], evaluations: int) -> tuple[list[float], float]:
    """Give the area of each seed's run, and the seconds of processor time of a usual one."""
    areas, seconds = [], []
    for seed in range(1, RUNS + 1):
        started = time.process_time()
        result = minimize(problem, ParetoLocalSearch(**options), ("n_eval", evaluations), seed=seed)
        seconds.append(time.process_time() - started)
        areas.append(area_indicator(-result.F, problem.mission))
    return areas, float(np.median(seconds))
