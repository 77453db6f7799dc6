"""How search grows with the mission and the team: terrains of up to 10 000 nodes, 50 robots.

Each run has a minute, in a process of its own: twenty minutes in all.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from benchmarks.measure import in_process
from benchmarks.one_search import ALGORITHMS, COLUMNS, EARLY
from botohe_moo.plots import save_plot
from botohe_moo.plots.style import colours, log_axis, theme

NODES = (100, 1_000, 10_000)
ROBOTS = (3, 10, 50)
SECONDS = 60.0
WHOLE = ("arcs", "evaluations", "generations", "front")


def run(out: Path) -> bool:
    """Print and keep how search grows; none of it is judged."""
    table = measured(SECONDS)
    table.to_csv(out / "growth.csv", index=False)
    _plot(table, out / "growth.png")
    return True


def measured(seconds: float) -> pd.DataFrame:
    """Measure every run in a process of its own, one at a time, and print the table."""
    for algorithm in ALGORITHMS:  # compiles, which takes memory, too
        in_process("benchmarks.one_search", 100, 3, algorithm, 0)
    rows = []
    for nodes in NODES:
        for robots in ROBOTS:
            for algorithm in ALGORITHMS:
                print(f"{nodes} nodes, {robots} robots, {algorithm}", file=sys.stderr, flush=True)
                fields = in_process("benchmarks.one_search", nodes, robots, algorithm, seconds)
                found = dict(zip(COLUMNS, map(float, fields), strict=True))
                rows.append({"nodes": nodes, "robots": robots, "algorithm": algorithm, **found})
    table = pd.DataFrame(rows).astype(dict.fromkeys(WHOLE, int))
    per_evaluation = (1e6 * table["seconds"] / table["evaluations"]).round(2)
    table.insert(list(table).index("evaluations") + 1, "us_per_evaluation", per_evaluation)
    early, late = f"area_{seconds / EARLY:g}s", f"area_{seconds:g}s"
    table = table.rename(columns={"early_area": early, "area": late})
    table = table.round({early: 5, late: 5, "seconds": 1, "first_generation_s": 3})
    memory = [name for name in COLUMNS if name.endswith("_mib")]
    table = table.astype(dict.fromkeys([*memory, "nodes_a_plan"], int))
    print(f"terrains, seed 0; {seconds:g} s for each run, one thread")
    print(table.to_string(index=False))
    return table


def _plot(table: pd.DataFrame, path: Path) -> None:
    shown = {
        "us_per_evaluation": "µs per evaluation",
        "search_mib": "MiB that the search adds",
        f"area_{SECONDS:g}s": f"area after {SECONDS:g} s",
    }
    table = table.assign(search_mib=np.maximum(table["peak_mib"] - table["before_mib"], 1))
    with theme():
        fig, panels = plt.subplots(1, len(shown), figsize=(14, 4.2), layout="constrained")
        for ax, (column, label) in zip(panels, shown.items(), strict=True):
            _panel(ax, table, column)
            ax.set(xlabel="nodes", ylabel=label)
        handles, labels = panels[0].get_legend_handles_labels()
        fig.legend(handles, labels, loc="outside right center", frameon=False)
        fig.suptitle(f"Terrains: searches of {SECONDS:g} s, by nodes and robots")
    save_plot(panels[0], path)


def _panel(ax: Axes, table: pd.DataFrame, column: str) -> None:
    for robots, colour in zip(ROBOTS, colours(len(ROBOTS)), strict=True):
        for algorithm, line in zip(ALGORITHMS, ("-", "--"), strict=True):
            mine = table[(table["robots"] == robots) & (table["algorithm"] == algorithm)]
            label = f"{algorithm}, {robots} robots"
            ax.plot(mine["nodes"], mine[column], line, marker="o", color=colour, label=label)
    log_axis(ax)
    log_axis(ax, "y")
