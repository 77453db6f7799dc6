"""The paper's curves: mean area of four runs over iterations, beside the published means."""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
from pymoo.core.callback import Callback
from pymoo.optimize import minimize

from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission
from botohe_moo.plots import save_plot
from botohe_moo.plots.shared import log_axis
from botohe_moo.plots.style import colours, new_axes, theme

SEEDS = (1, 2, 3, 4)
MARKS = (1, 10, 100, 1_000, 10_000)

# Means and standard deviations of the four published runs on the art museum (Simon, Richley,
# Overbey and Perez-Lavin, PeerJ Computer Science, 2025), read off the figure, at MARKS.
PUBLISHED = {
    "BO-ACO": (
        (0.4128, 0.4646, 0.5007, 0.5245, 0.5295),
        (0.0070, 0.0023, 0.0022, 0.0009, 0.0003),
    ),
    "no heuristic": (
        (0.3061, 0.3583, 0.4049, 0.4859, 0.5002),
        (0.0167, 0.0200, 0.0140, 0.0050, 0.0028),
    ),
    "no pheromone": (
        (0.4232, 0.4611, 0.4833, 0.4977, 0.5069),
        (0.0052, 0.0036, 0.0028, 0.0012, 0.0010),
    ),
    "random": (
        (0.3061, 0.3736, 0.4118, 0.4366, 0.4550),
        (0.0167, 0.0099, 0.0026, 0.0037, 0.0023),
    ),
}
TOLERANCE = {"BO-ACO": (0.02, 0.01, 0.01, 0.003, 0.003)}
OTHERS = (0.02,) * len(MARKS)

COLONIES: dict[str, Callable[[], BOACO]] = {
    "BO-ACO": BOACO.journal,
    "no pheromone": lambda: BOACO.journal(pheromone=False),
    "no heuristic": lambda: BOACO.journal(heuristic=False),
    "random": lambda: BOACO.journal(heuristic=False, pheromone=False),
    "BO-ACO, first settings": BOACO,
}
POWER_PLANT_ITERATIONS = 100_000


class Trace(Callback):
    """Records the area at chosen iterations."""

    def __init__(self, at: list[int]) -> None:
        super().__init__()
        self.at, self.areas = set(at), {}

    def notify(self, algorithm: BOACO) -> None:
        """Look at the archive itself: asking for the population would cost time."""
        if algorithm.n_gen in self.at:
            mission = algorithm.problem.mission
            self.areas[algorithm.n_gen] = area_indicator(algorithm.archive.objectives, mission)


def trace(job: tuple[str, str, int, int]) -> pd.DataFrame:
    """Run one colony once; one row a recorded iteration."""
    name, colony, iterations, seed = job
    at = sorted({*MARKS, *np.geomspace(1, iterations, 60).round().astype(int).tolist()})
    callback = Trace(at)
    mission = load_mission(name)
    minimize(
        BOTOHE(mission), COLONIES[colony](), ("n_gen", iterations), seed=seed, callback=callback
    )
    frame = pd.DataFrame(callback.areas.items(), columns=["iteration", "area"])
    return frame.assign(mission=name, algorithm=colony, seed=seed)


def run(out: Path) -> bool:
    """Print and keep the curves; tell whether they are the published ones."""
    jobs = [("art_museum", colony, max(MARKS), seed) for colony in COLONIES for seed in SEEDS]
    jobs += [("power_plant", "BO-ACO", POWER_PLANT_ITERATIONS, seed) for seed in SEEDS]
    with ProcessPoolExecutor(2) as pool:
        traces = pd.concat(pool.map(trace, jobs))
    summary = (
        traces.groupby(["mission", "algorithm", "iteration"], sort=False)["area"]
        .agg(["mean", "std", "min", "max"])
        .reset_index()
    )
    summary.round(5).to_csv(out / "curves.csv", index=False)

    museum = summary[summary["mission"] == "art_museum"]
    checks = _compare(museum)
    checks.to_csv(out / "published.csv", index=False)
    print(checks.to_string(index=False))
    plant = summary[summary["mission"] == "power_plant"]
    marks = plant[plant["iteration"].isin([*MARKS, POWER_PLANT_ITERATIONS])]
    print(f"\n{marks.round(4).to_string(index=False)}")
    _plot(museum, out / "curves.png")

    means = museum.set_index(["algorithm", "iteration"])["mean"]
    order = [means[name, 1_000] for name in ("BO-ACO", "no pheromone", "no heuristic", "random")]
    in_order = order == sorted(order, reverse=True)
    first = means["BO-ACO, first settings", 10_000]
    print(f"\npublished order at 1 000 iterations: {in_order}")
    print(f"first settings at 10 000 iterations: {first:.4f} (to reach: 0.529)")
    return bool(checks["within"].all()) and in_order and first >= 0.529


def _compare(museum: pd.DataFrame) -> pd.DataFrame:
    means = museum.set_index(["algorithm", "iteration"])
    rows = []
    for name, (published, deviations) in PUBLISHED.items():
        tolerances = TOLERANCE.get(name, OTHERS)
        for mark, area, sd, tolerance in zip(MARKS, published, deviations, tolerances, strict=True):
            mean, ours_sd = means.loc[(name, mark), ["mean", "std"]]
            rows.append(
                {
                    "algorithm": name,
                    "iteration": mark,
                    "published": area,
                    "published_sd": sd,
                    "area": round(mean, 4),
                    "sd": round(ours_sd, 4),
                    "difference": round(mean - area, 4),
                    "tolerance": tolerance,
                    "within": abs(mean - area) <= tolerance,
                }
            )
    return pd.DataFrame(rows)


def _plot(museum: pd.DataFrame, path: Path) -> None:
    ax = new_axes(8, 4.8)
    with theme():
        for name, colour in zip(PUBLISHED, colours(len(PUBLISHED)), strict=True):
            curve = museum[museum["algorithm"] == name]
            ax.plot(curve["iteration"], curve["mean"], color=colour, label=name)
            ax.fill_between(curve["iteration"], curve["min"], curve["max"], color=colour, alpha=0.2)
            mean, sd = PUBLISHED[name]
            ax.errorbar(MARKS, mean, sd, fmt="o", color=colour, capsize=3, markersize=5)
        ax.errorbar([], [], [], fmt="o", color="grey", capsize=3, label="published mean ± sd")
        log_axis(ax)
        ax.set(xlabel="iterations of 100 ants", ylabel="area")
        ax.set_title("Art museum, journal settings: four runs (mean and range)")
        ax.legend()
    save_plot(ax, path)
