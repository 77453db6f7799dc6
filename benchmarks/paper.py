"""The paper's curves and points on the art museum beside ours: ``make paper``.

Read are the studies ``paper`` and ``annealing``, once they have run.
"""

from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from botohe_moo.plots import plot_curves, save_plot
from botohe_moo.study import read_study

# Means and standard deviations of the four published runs on the art museum (Simon, Richley,
# Overbey and Perez-Lavin, PeerJ Computer Science, 2025), read off the figures.
MARKS = (1, 10, 100, 1_000, 10_000)  # iterations
ANTS = 100  # evaluations of an iteration
CURVES = {
    "BO-ACO": (
        (0.4128, 0.4646, 0.5007, 0.5245, 0.5295),
        (0.0070, 0.0023, 0.0022, 0.0009, 0.0003),
    ),
    "no pheromone": (
        (0.4232, 0.4611, 0.4833, 0.4977, 0.5069),
        (0.0052, 0.0036, 0.0028, 0.0012, 0.0010),
    ),
    "no heuristic": (
        (0.3061, 0.3583, 0.4049, 0.4859, 0.5002),
        (0.0167, 0.0200, 0.0140, 0.0050, 0.0028),
    ),
    "random": (
        (0.3061, 0.3736, 0.4118, 0.4366, 0.4550),
        (0.0167, 0.0099, 0.0026, 0.0037, 0.0023),
    ),
}
TOLERANCE = {"BO-ACO": (0.02, 0.01, 0.01, 0.003, 0.003)}
OTHERS = (0.02,) * len(MARKS)
ANNEALING = {  # by evaluations; the first point is not judged
    1_024: (0.3071, 0.0306),
    10_000: (0.4141, 0.0179),
    99_856: (0.4728, 0.0053),
    1_000_000: (0.4993, 0.0018),
}
WITHIN = 2  # published standard deviations


def run(out: Path) -> bool:
    """Write both tables and the figure; tell whether our curves are the published ones."""
    tables = read_study(out)
    trace = tables.trace[tables.trace["mission"] == "art-museum"]
    curves = pd.DataFrame(_compared(trace))
    curves.to_csv(out / "published.csv", index=False)
    annealing = _annealing(out.parent / "annealing")
    annealing.to_csv(out / "annealing.csv", index=False)
    print(curves.to_string(index=False), annealing.to_string(index=False), sep="\n\n")
    _draw(trace[trace["algorithm"].isin(CURVES)], out / "curves.png")
    at_1000 = curves[curves["iteration"] == 1_000]["area"]
    print(f"\npublished order at 1 000 iterations: {at_1000.is_monotonic_decreasing}")
    judged = [*curves["within"], *annealing["within"][1:], *annealing["ours ahead"]]
    return all(judged) and at_1000.is_monotonic_decreasing


def _compared(trace: pd.DataFrame) -> Iterator[dict[str, object]]:
    """Yield areas at the published iterations beside the published ones."""
    for name, (published, deviations) in CURVES.items():
        curve = trace[trace["algorithm"] == name]
        tolerances = TOLERANCE.get(name, OTHERS)
        for mark, area, sd, tolerance in zip(MARKS, published, deviations, tolerances, strict=True):
            ours = curve.loc[curve["evaluations"] == mark * ANTS, "area"]
            yield {
                "algorithm": name,
                "iteration": mark,
                "published": area,
                "published_sd": sd,
                "area": round(ours.mean(), 4),
                "sd": round(ours.std(), 4),
                "difference": round(ours.mean() - area, 4),
                "tolerance": tolerance,
                "within": abs(ours.mean() - area) <= tolerance,
            }


def _annealing(folder: Path) -> pd.DataFrame:
    """Compare the published points of simulated annealing, each of a schedule of its own."""
    summary = pd.read_csv(folder / "summary.csv")
    areas = summary.pivot_table("area_mean", "evaluations_median", "algorithm")
    table = pd.DataFrame(ANNEALING, ["published", "published_sd"]).T.join(areas)
    table["off_by_sd"] = (table["journal"] - table["published"]) / table["published_sd"]
    table["within"] = table["off_by_sd"].abs() <= WITHIN
    table["ours ahead"] = table["ours"] > table["journal"]
    return table.round(4).rename_axis("evaluations").reset_index()


def _draw(trace: pd.DataFrame, path: Path) -> None:
    ax = plot_curves(trace, band="range")
    lines = {line.get_label(): line.get_color() for line in ax.get_lines()}
    for name, (published, deviations) in CURVES.items():
        at = [mark * ANTS for mark in MARKS]
        ax.errorbar(at, published, deviations, fmt="s", mfc="w", c=lines[name], capsize=3)
    ax.set_title("Art museum: our curves, and the published means ± sd (white squares)")
    save_plot(ax, path)
