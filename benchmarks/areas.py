"""Areas of Pareto local search beside those of another checkout, with the same seeds."""

import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from benchmarks import budgets
from benchmarks.start import HERE, Copy
from botohe_moo import Mission, load_mission
from botohe_moo.mission.formats.nodelink import write_node_link

BUDGETS = {10_000: 20, 100_000: 20, 1_000_000: 5}  # evaluations, and how many seeds
CODE = """
import json, sys
from pymoo.optimize import minimize
from botohe_moo import BOTOHE, ParetoLocalSearch, area_indicator, load_mission
path, evaluations, seeds = json.loads(sys.argv[1])
mission = load_mission(path)
areas = []
for seed in range(1, seeds + 1):
    result = minimize(BOTOHE(mission), ParetoLocalSearch(), ("n_eval", evaluations), seed=seed)
    areas.append(area_indicator(-result.F, mission))
print(json.dumps(areas))
"""


def missions() -> dict[str, Mission]:
    """Load missions of different kinds."""
    return {
        "museum": load_mission("art_museum"),
        "power plant": load_mission("power_plant"),
        "terrain, 200 nodes": load_mission("terrain_200"),
        "terrain, 60 nodes": load_mission("terrain", nodes=60, robots=3, seed=0),
        "tunnel": load_mission("tunnel"),
        "tunnel, 40 nodes": load_mission("tunnel", nodes=40),
        "one-way, 80 nodes": budgets.missions()["one-way, 80 nodes"],
        "drones and rovers": load_mission("drones_and_rovers"),
        "museum, on return": load_mission("art_museum_return"),
    }


def run(out: Path, before: Path | None = None) -> bool:
    """Print and write mean areas, and how far they differ in standard errors of the difference."""
    checkouts = {"now": HERE} if before is None else {"before": before, "now": HERE}
    rows = []
    with tempfile.TemporaryDirectory(prefix="botohe-areas-") as made:
        copies = {name: Copy(root, Path(made, name)) for name, root in checkouts.items()}
        for name, mission in missions().items():
            path = Path(made, "mission.json")
            path.write_bytes(write_node_link(mission))
            for evaluations, seeds in BUDGETS.items():
                row = {"mission": name, "evaluations": evaluations, "runs": seeds}
                error = 0.0
                for checkout, copy in copies.items():
                    areas = _areas(copy, path, evaluations, seeds)
                    row[f"area_{checkout}"] = areas.mean()
                    error = np.hypot(error, areas.std(ddof=1) / np.sqrt(seeds))
                if before is not None:
                    row["difference"] = row["area_now"] - row["area_before"]
                    row["standard_error"] = error
                print(*row.values(), flush=True)
                rows.append(row)
    table = pd.DataFrame(rows).round(6)
    print(table.to_string(index=False))
    if before is not None:
        table.to_csv(out / "areas-before.csv", index=False)
    return True


def _areas(copy: Copy, path: Path, evaluations: int, seeds: int) -> NDArray[np.float64]:
    done = subprocess.run(
        [str(copy.python), "-W", "ignore", "-c", CODE, json.dumps([str(path), evaluations, seeds])],
        cwd=copy.folder,
        env=copy.environment,
        stdout=subprocess.PIPE,
        check=True,
    )
    return np.array(json.loads(done.stdout))
