"""What a second worker brings to a study, and what recording costs a run."""

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import pandas as pd
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, load_mission, make_algorithm
from botohe_moo.study import run_study

REPETITIONS = 3
FASTER = 1.7
COSTS = 0.05
COSTLY: dict[str, tuple[str, dict[str, Any]]] = {
    "BO-ACO": ("bo-aco", {}),
    "BO-ACO, journal": ("botohe_moo.algorithms.bo_aco:BOACO.journal", {}),
    "NSGA-II": ("nsga2", {}),
    "simulated annealing": ("simulated-annealing", {}),
}


def equal_runs() -> dict[str, Any]:
    """Give a study of runs that take the same time, some seconds each."""
    return {
        "name": "equal",
        "missions": ["art_museum"],
        "algorithms": {"BO-ACO": "bo-aco"},
        "budget": {"evaluations": 2_000_000},
        "seeds": 12,
    }


def run(out: Path) -> bool:
    """Print and keep both; tell whether they are within their bounds."""
    speed_up = _speed_up()
    print(speed_up.to_string(index=False))
    speed_up.to_csv(out / "workers.csv", index=False)
    recording = _recording()
    print(f"\n{recording.to_string(index=False)}")
    recording.to_csv(out / "recording.csv", index=False)
    faster = bool(speed_up["times faster"].median() >= FASTER)
    ours = recording["algorithm"].str.startswith("BO-ACO")
    cheap = bool((recording.loc[ours, "recording / run"] < COSTS).all())
    print(f"\ntwo workers at least {FASTER} times faster than one: {faster}")
    print(f"recording costs less than {COSTS:.0%} of BO-ACO's runs: {cheap}")
    return faster and cheap


def _speed_up() -> pd.DataFrame:
    """Time a study of equal runs with one and with two workers, in turns."""
    rows = []
    for repetition in range(1, REPETITIONS + 1):
        seconds = {}
        for workers in (1, 2):
            with tempfile.TemporaryDirectory() as folder:
                started = time.perf_counter()
                run_study(equal_runs(), folder, workers=workers)
                seconds[workers] = time.perf_counter() - started
        rows.append(
            {
                "repetition": repetition,
                "one worker, s": round(seconds[1], 2),
                "two workers, s": round(seconds[2], 2),
                "times faster": round(seconds[1] / seconds[2], 3),
            }
        )
    return pd.DataFrame(rows)


def _recording() -> pd.DataFrame:
    """Compare the time of recording with the algorithm's own, and that with a run without."""
    algorithms = {
        label: {"algorithm": name, "parameters": parameters}
        for label, (name, parameters) in COSTLY.items()
    }
    rows = []
    for mission in ("art_museum", "power_plant"):
        for evaluations in (100_000, 1_000_000):
            chosen = {
                label: entry
                for label, entry in algorithms.items()
                if label != "NSGA-II" or evaluations == 100_000
            }
            with tempfile.TemporaryDirectory() as folder:
                tables = run_study(
                    {
                        "name": "recording",
                        "missions": [mission],
                        "algorithms": chosen,
                        "budget": {"evaluations": evaluations},
                        "seeds": REPETITIONS,
                    },
                    folder,
                )
            for label in chosen:
                runs = tables.runs[tables.runs["algorithm"] == label]
                records = tables.trace[tables.trace["algorithm"] == label]
                times = [_alone(mission, label, evaluations) for _ in range(REPETITIONS)]
                rows.append(
                    {
                        "mission": mission,
                        "evaluations": evaluations,
                        "algorithm": label,
                        "records": round(len(records) / REPETITIONS),
                        "recording, ms": round(1e3 * runs["recording_seconds"].median(), 2),
                        "run, s": round(runs["seconds"].median(), 3),
                        "recording / run": round(
                            (runs["recording_seconds"] / runs["seconds"]).median(), 4
                        ),
                        "run by minimize, s": round(statistics.median(times), 3),
                    }
                )
    return pd.DataFrame(rows)


def _alone(mission: str, label: str, evaluations: int) -> float:
    name, parameters = COSTLY[label]
    problem = BOTOHE(load_mission(mission))
    algorithm = make_algorithm(name, **parameters)
    started = time.perf_counter()
    minimize(problem, algorithm, ("n_eval", evaluations), seed=1)
    return time.perf_counter() - started
