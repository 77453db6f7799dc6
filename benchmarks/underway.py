"""What replanning is worth: missions played with plans that stay, and that are made anew."""

import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.explorer import photograph
from botohe_moo import Mission, load_mission, simulate_policy, solve
from botohe_moo.explorer import replay
from botohe_moo.underway import play_mission, robot_price

# Missions with their parameters, and when they pay.
SITES: tuple[tuple[str, dict[str, Any], str], ...] = (
    ("art_museum", {}, "arrival"),
    ("art_museum", {}, "return"),
    ("power_plant", {}, "arrival"),
    ("power_plant", {}, "return"),
    ("terrain", {"nodes": 30, "seed": 3}, "arrival"),
    ("terrain", {"nodes": 30, "seed": 3}, "return"),
    ("terrain", {"nodes": 60, "seed": 3}, "arrival"),
    ("terrain", {"nodes": 60, "seed": 3}, "return"),
)
# The share of the robots that are expected to survive the plans that are played.
SHARES = {"arrival": (0.35, 0.55, 0.8), "return": (0.4, 0.6, 0.75)}
POLICIES = ("losses", "one by one", "one by one, shortest first")
MISSIONS, EVALUATIONS = 2_000, 300_000


def run(folder: Path) -> bool:
    """Print and write the table, a row for each site, plan and policy; and show one mission."""
    picture(folder / "replay.png")
    rows = []
    for name, parameters, pays in SITES:
        mission = load_mission(name, **parameters)
        if pays == "return":
            mission = Mission(mission.graph, pays=pays, robots=mission.robots)
        solution = solve(mission, evaluations=EVALUATIONS)
        for share in SHARES[pays]:
            distances = abs(solution.objectives[:, 1] - share * mission.robots)
            row = int(np.argmin(distances))
            price = robot_price(mission, solution.objectives, row)
            outcomes = simulate_policy(
                mission,
                solution.plans[row],
                POLICIES,
                price=price,
                missions=MISSIONS,
                workers=os.cpu_count() or 1,
            )
            table = outcomes.table
            reward, survivors = solution.objectives[row]
            table.insert(0, "mission", name)
            table.insert(1, "nodes", len(mission.nodes))
            table.insert(2, "pays", pays)
            table.insert(3, "E[R]", reward)
            table.insert(4, "E[S]", survivors)
            table.insert(5, "price", price)
            table["percent"] = 100 * table["gain"] / reward
            table["percent_se"] = 100 * table["gain_se"] / reward
            print(table.round(3).to_string(index=False), flush=True)
            rows.append(table)
    whole = pd.concat(rows).drop(columns="seconds").round(4)
    whole.to_csv(folder / "underway.csv", index=False)
    return True


def picture(path: Path) -> None:
    """Take a picture of the mission of docs/explorer.md, at the step in which a robot is lost."""
    museum = load_mission("art_museum")
    solution = solve(museum, evaluations=20_000)
    price = robot_price(museum, solution.objectives, 159)
    played = play_mission(museum, solution.plans[159], price=price, number=1)
    step = next(i for i, step in enumerate(played.steps) if step.lost)
    with tempfile.TemporaryDirectory() as folder:
        photograph(replay(played, Path(folder, "replay.html")), path, f"#step={step}")
