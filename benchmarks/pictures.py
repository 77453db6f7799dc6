"""The pictures of the guide to choosing, and those of the README that show the museum."""

import tempfile
from pathlib import Path

from benchmarks.explorer import photograph
from botohe_moo import load_mission, solve
from botohe_moo.decide import knees
from botohe_moo.explorer import explore
from botohe_moo.plots import (
    plot_front,
    plot_mission,
    plot_outcomes,
    plot_plan,
    save_figure,
    save_plot,
)

MUSEUM = Path(__file__).parents[1] / "results" / "art_museum"
DPI = 100  # enough for a page, and small files


def run(out: Path) -> bool:
    """Draw the museum, and the front of a million evaluations."""
    mission = load_mission("art_museum")
    solution = solve(mission, evaluations=1_000_000, seed=1, n_islands=1)
    plans, objectives = solution.plans, solution.objectives
    MUSEUM.mkdir(exist_ok=True)
    save_plot(plot_mission(mission), MUSEUM / "mission.png")
    save_plot(plot_front(objectives, mission), MUSEUM / "front.png")

    knee = knees(mission, objectives)[0].index
    bold = next(row for row, (reward, _) in enumerate(objectives) if reward < 9.5)
    drawn = {
        "plan": plot_plan(mission, plans[bold]),
        "outcomes": plot_outcomes(
            mission, plans[bold], plans[knee], names=[f"plan {bold}", f"plan {knee}, the knee"]
        )[0],
    }
    for name, ax in drawn.items():
        save_figure(ax.figure.figure, out / f"{name}.png", dpi=DPI)
        print(out / f"{name}.png")
    with tempfile.TemporaryDirectory() as folder:
        page = explore(solution, Path(folder, "museum.html"), wishes=["survivors >= 1"])
        photograph(page, out / "explorer.png")
    return True
