"""What a second worker brings to a study, what recording costs a run, and a study that is done."""

import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, load_mission, make_algorithm
from botohe_moo.study import load_study, make_tables, run_study
from botohe_moo.study.folder import StudyFolder
from botohe_moo.study.perform import Record, perform

REPETITIONS = 3
FASTER = 1.7
COSTS = 0.05
AGAIN = 0.1
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


def tiny_runs() -> dict[str, Any]:
    """Give a study of 3 000 runs that are next to nothing."""
    ants = {"algorithm": "bo-aco", "parameters": {"n_ants": 5}}
    return {
        "name": "tiny",
        "missions": {"toy": "toy", "trio": {"mission": "toy", "robots": 3}},
        "algorithms": {"random": "random", "greedy": "greedy", "small": ants},
        "budget": {"evaluations": 10},
        "seeds": 500,
        "recording": {"per_decade": 1},
    }


def run(out: Path) -> bool:
    """Print and keep both; tell whether they are within their bounds."""
    speed_up = _speed_up()
    print(speed_up.to_string(index=False))
    speed_up.to_csv(out / "workers.csv", index=False)
    recording = _recording()
    print(f"\n{recording.to_string(index=False)}")
    recording.to_csv(out / "recording.csv", index=False)
    again = _again()
    print(f"\n{again.to_string(index=False)}")
    again.to_csv(out / "again.csv", index=False)
    faster = bool(speed_up["times faster"].median() >= FASTER)
    ours = recording["algorithm"].str.startswith("BO-ACO")
    cheap = bool((recording.loc[ours, "recording / run"] < COSTS).all())
    print(f"\ntwo workers at least {FASTER} times faster than one: {faster}")
    print(f"recording costs less than {COSTS:.0%} of BO-ACO's runs: {cheap}")
    seconds = again.set_index("what")["s"]
    quick = bool(seconds["study run, nothing new"] < AGAIN * seconds["study run, all files new"])
    print(f"a finished study takes less than {AGAIN:.0%} of reading and making it anew: {quick}")
    return faster and cheap and quick


def _again() -> pd.DataFrame:
    """Time a study of 3 000 tiny runs that are all done, first with files it has not seen yet."""
    study = load_study(tiny_runs())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        store = StudyFolder(folder)
        with store.locked(study):
            store.write_study(study)
            for one in study.runs():
                records: list[Record] = []
                outcome = perform(one, records.append)
                # As a study keeps them: the plans of the last one only.
                kept = {record.evaluations: replace(record, plans=None) for record in records}
                kept[records[-1].evaluations] = records[-1]
                store.save(one, replace(outcome, records=tuple(kept.values())))
        command = [sys.executable, "-m", "botohe_moo.cli", "study", "run"]
        command += [str(folder / "study.yaml"), "--out", str(folder)]
        rows = []
        for what, act in (
            ("study run, all files new", lambda: run_study(study, folder)),
            ("study run, nothing new", lambda: run_study(study, folder)),
            (
                "study run, nothing new, as a command",
                lambda: subprocess.run(command, check=True, capture_output=True),
            ),
            ("study tables", lambda: make_tables(folder)),
        ):
            started = time.perf_counter()
            act()
            rows.append({"what": what, "s": round(time.perf_counter() - started, 2)})
    return pd.DataFrame(rows)


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
