"""What replanning is worth: missions played with plans that stay, and that are made anew."""

import os
import tempfile
import time
from collections.abc import Callable
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.explorer import photograph
from botohe_moo import Event, Mission, load_mission, replan, simulate_policy, solve, worst_case
from botohe_moo.base.types import FloatArray
from botohe_moo.explorer import replay
from botohe_moo.plots import plot_policies, save_plot
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
# The shares of the robots that are expected to survive the plans that are played.
SHARES = {"arrival": (0.35, 0.55, 0.8), "return": (0.4, 0.6, 0.75)}
# Per cent of E[R] that a first trial gained on the same plans, by the two policies that it played.
WANTED = {
    ("art_museum", "arrival"): ((6.1, 14.0), (7.4, 17.8)),
    ("art_museum", "return"): ((5.5, 12.4), (8.1, 9.9), (-0.9, -0.9)),
    ("power_plant", "arrival"): ((5.1, 0.2), (5.8, 6.7), (2.5, 2.5)),
}
POLICIES = ("losses", "one by one", "shortest first")
MISSIONS, EVALUATIONS = 2_000, 300_000


def run(folder: Path) -> bool:
    """Print and write the gains, a row for each site, plan and policy; times; and two pictures."""
    photograph_replay(folder / "replay.png")
    time_replans(folder / "seconds.csv")
    rows = []
    for name, parameters, pays in SITES:
        mission = load_mission(name, **parameters)
        mission = Mission(mission.graph, pays=pays, robots=mission.robots)
        solution = solve(mission, evaluations=EVALUATIONS, n_islands=1)
        wanted = WANTED.get((name, pays), ())
        for share, trial in zip_longest(SHARES[pays], wanted, fillvalue=()):
            row = supported_row(solution.objectives, share * mission.robots)
            outcomes = simulate_policy(
                mission,
                solution.plans[row],
                POLICIES,
                price=robot_price(mission, solution.objectives, row),
                missions=MISSIONS,
                workers=os.cpu_count() or 1,
            )
            if not rows:
                plot = plot_policies(outcomes, solution.objectives)
                save_plot(plot, folder / "policies.png")
            table = outcomes.table
            reward, survivors = solution.objectives[row]
            table.insert(0, "mission", name)
            table.insert(1, "nodes", len(mission.nodes))
            table.insert(2, "pays", pays)
            table.insert(3, "E[R]", reward)
            table.insert(4, "E[S]", survivors)
            table.insert(5, "price", outcomes.price)
            table["percent"] = 100 * table["gain"] / reward
            table["percent_se"] = 100 * table["gain_se"] / reward
            table["percent_wanted"] = table["policy"].map(dict(zip(POLICIES, trial, strict=False)))
            print(table.round(3).to_string(index=False), flush=True)
            rows.append(table)
    whole = pd.concat(rows).drop(columns="seconds").round(4)
    whole.to_csv(folder / "underway.csv", index=False)
    # Both have standard errors: two of their difference.
    short = whole["percent"] < whole["percent_wanted"] - 2 * 2**0.5 * whole["percent_se"]
    return not short.any()


def time_replans(path: Path) -> None:
    """Write how long a warm replan takes after a loss, and the worst case of a plan."""
    rows = []
    for name in ("art_museum", "power_plant", "terrain_200"):
        mission = load_mission(name)
        solution = solve(mission, evaluations=20_000, n_islands=1)
        row = supported_row(solution.objectives, 0.55 * mission.robots)
        plan = solution.plans[row]
        price = robot_price(mission, solution.objectives, row)
        trails = mission.labels(plan)
        out = [robot for robot, trail in enumerate(trails) if len(trail) > 3]
        events = [Event("reached", robot, trails[robot][2]) for robot in out]
        events.append(Event("lost", out[0]))
        times = {
            "replan_ms": partial(replan, mission, plan, events, price=price),
            "replan_without_price_ms": partial(replan, mission, plan, events),
            "worst_case_ms": partial(worst_case, mission, [plan]),
        }
        found = {column: 1e3 * median_seconds(run) for column, run in times.items()}
        rows.append(
            {"mission": name, "nodes": len(mission.nodes), "robots": mission.robots, **found}
        )
    table = pd.DataFrame(rows).round(2)
    print(table.to_string(index=False), flush=True)
    table.to_csv(path, index=False)


def median_seconds(run: Callable[[], object]) -> float:
    """Time a function that has run once before."""
    run()
    times = []
    for _ in range(20):
        began = time.perf_counter()
        run()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def supported_row(objectives: FloatArray, survivors: float) -> int:
    """Return the plan nearest to some survivors, of those that are best at some price."""
    best = {int(np.argmax(objectives @ [1, price])) for price in np.geomspace(1e-3, 1e3, 10_000)}
    return min(best, key=lambda row: abs(objectives[row, 1] - survivors))


def photograph_replay(path: Path) -> None:
    """Take a picture of the mission of docs/explorer.md, at the step in which a robot is lost."""
    museum = load_mission("art_museum")
    solution = solve(museum, evaluations=20_000, n_islands=1)
    price = robot_price(museum, solution.objectives, 159)
    played = play_mission(museum, solution.plans[159], price=price, number=1)
    step = next(i for i, step in enumerate(played.steps) if step.lost)
    with tempfile.TemporaryDirectory() as folder:
        photograph(replay(played, Path(folder, "replay.html")), path, f"#step={step}")
