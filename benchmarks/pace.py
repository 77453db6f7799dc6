"""How fast searches are beside those of another checkout: processor time of whole runs, in ratios.

Of ``evaluate`` it is the time that the evaluation of plans drawn at random takes. Runs are in
processes of their own, the checkouts in turn, after kernels are compiled or loaded.
"""

import json
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.start import HERE, Copy

# Mission, its parameters, robots, algorithm, evaluations.
_PLAIN: tuple[tuple[str, dict[str, Any], int | None, str, int], ...] = (
    ("art_museum", {}, None, "evaluate", 2_000_000),
    ("power_plant", {}, None, "evaluate", 500_000),
    ("terrain_200", {}, None, "evaluate", 10_000),
    ("art_museum", {}, None, "bo-aco", 1_000_000),
    ("terrain_200", {}, None, "bo-aco", 20_000),
    ("art_museum", {}, None, "pareto-local-search", 1_000_000),
    ("power_plant", {}, None, "pareto-local-search", 1_000_000),
    ("terrain_200", {}, None, "pareto-local-search", 100_000),
    ("art_museum", {}, None, "nsga2", 20_000),
    ("terrain", {"nodes": 10_000, "seed": 1}, 50, "pareto-local-search", 20_000),
)
# The same with three kinds of robots, which survive and collect alike, and paid on return. A
# checkout that does not know these is measured on the mission as it is.
CASES = tuple(
    (*case, variant)
    for variant in ("plain", "kinds", "return")
    for case in _PLAIN
    if variant == "plain" or (case[0] in ("art_museum", "terrain_200") and case[3] != "nsga2")
)
SEEDS = 3
ROUNDS = 3
CODE = """
import json, sys, time
import numpy as np
from pymoo.optimize import minimize
from botohe_moo import BOTOHE, Mission, area_indicator, load_mission, make_algorithm
from botohe_moo.algorithms import RandomTrailSampling
name, parameters, robots, algorithm, evaluations, variant, seeds = json.loads(sys.argv[1])
mission = load_mission(name, **parameters)
mission = mission.with_robots(robots) if robots else mission
if variant == "return":
    mission = Mission(mission.graph, base=mission.base, robots=mission.robots, pays="return")
elif variant == "kinds":
    counts = [(mission.robots + k) // 3 for k in range(3)]
    kinds = [{"name": str(k), "robots": n} for k, n in enumerate(counts) if n]
    mission = Mission(mission.graph, base=mission.base, kinds=kinds)
problem = BOTOHE(mission)

def run(seed, n):
    if algorithm != "evaluate":
        found = -minimize(problem, make_algorithm(algorithm), ("n_eval", n), seed=seed).F
        return lambda: float(area_indicator(found, mission))
    drawn = RandomTrailSampling().sample_batch(problem, 1_000, np.random.default_rng(seed))
    began = time.process_time()
    for _ in range(max(1, n // 1_000)):
        found = mission.evaluate(drawn)
    return time.process_time() - began, float(found.mean())

run(1, 300)
found = []
for seed in range(1, seeds + 1):
    began = time.process_time()
    result = run(seed, evaluations)
    seconds = time.process_time() - began
    found.append(result if algorithm == "evaluate" else (seconds, result()))
print(json.dumps(found))
"""


def run(folder: Path, before: Path | None = None) -> bool:
    """Print and write the ratio of the two checkouts' seconds, and the mean areas.

    Other processes only make a run slower, so the least of several times counts for each seed.
    """
    checkouts = {"now": HERE} if before is None else {"before": before, "now": HERE}
    rows = []
    with tempfile.TemporaryDirectory(prefix="botohe-pace-") as made:
        copies = {name: Copy(root, Path(made, name)) for name, root in checkouts.items()}
        for case in CASES:
            columns = ("mission", "parameters", "robots", "algorithm", "evaluations", "variant")
            row = dict(zip(columns, case, strict=True)) | _measured(copies, case)
            if before is not None:
                row["ratio"] = row["seconds_now"] / row["seconds_before"]
            print(*row.values(), flush=True)
            rows.append(row)
    table = pd.DataFrame(rows).drop(columns="parameters").round(4)
    print(table.to_string(index=False))
    if before is not None:  # ratios are what is kept: seconds differ from machine to machine
        seconds = [name for name in table if name.startswith("seconds")]
        table.drop(columns=seconds).to_csv(folder / "pace.csv", index=False)
    return True


def _measured(copies: Mapping[str, Copy], case: tuple[Any, ...]) -> dict[str, float]:
    """Give the seconds of all seeds and their mean area, for each checkout; these take turns."""
    for copy in copies.values():
        _measure(copy, (*case[:4], 300, case[5], 1))  # compiles
    found: dict[str, list[Any]] = {name: [] for name in copies}
    for turn in range(ROUNDS):
        for name in list(copies)[:: -1 if turn % 2 else 1]:
            found[name].append(_measure(copies[name], (*case, SEEDS)))
    row = {}
    for name, rounds in found.items():
        seconds, areas = np.min(rounds, axis=0).T
        assert (np.array(rounds)[..., 1] == areas).all(), "the same seeds gave other fronts"
        row[f"seconds_{name}"], row[f"area_{name}"] = float(seconds.sum()), float(areas.mean())
    return row


def _measure(copy: Copy, case: tuple[Any, ...]) -> list[list[float]]:
    """Give the processor seconds and the area of each seed's run, in a process of their own."""
    done = subprocess.run(
        [str(copy.python), "-c", CODE, json.dumps(case)],
        cwd=copy.folder,
        env=copy.environment,
        stdout=subprocess.PIPE,
        check=True,
    )
    found: list[list[float]] = json.loads(done.stdout)
    return found
