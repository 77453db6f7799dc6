"""What it costs to plan as if hazards were independent, where they strike together."""

from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd

from benchmarks.gallery import make_small
from botohe_moo import Mission, Scenario, area_indicator, load_mission, solve
from botohe_moo.base.runtime import n_cpus
from botohe_moo.base.types import FloatArray
from botohe_moo.plots import plot_scenarios, save_plot

EVALUATIONS, SEEDS = 100_000, (1, 2, 3)
MISSIONS: dict[str, dict[str, Any]] = {
    "art_museum": {},
    "power_plant": {},
    "terrain": {"nodes": 60, "seed": 1, "robots": 5},
    "terrain_200": {},
}
CASES = (
    "2 scenarios",
    "4 scenarios",
    "8 scenarios",
    "16 scenarios",
    "16, independent zones",
    "an intruder in one of 3 wings",
)
# The areas that a rough trial reached with scenarios, on each mission. Those of the last two cases
# cannot be compared: its zones were others.
TRIAL = {
    "2 scenarios": (0.2721, 0.1900, 0.4608, 0.2785),
    "4 scenarios": (0.4839, 0.3664, 0.7267, 0.4847),
    "8 scenarios": (0.5821, 0.4070, 0.8092, 0.5530),
    "16 scenarios": (0.6458, 0.4462, 0.8581, 0.5851),
}
TITLES = {
    "independent": "Planned as if hazards were independent",
    "scenarios": "Planned with scenarios",
}
P_STRUCK, STRUCK, CALM = 0.6, 8.0, 0.5  # together, and factors on hazards


def run(folder: Path) -> bool:
    """Print and write areas of plans made with scenarios, and as if hazards were independent.

    Succeeds if planning with scenarios dominates, on average, what a rough trial did at least.
    """
    cases = list(product(MISSIONS, CASES, SEEDS))
    with ProcessPoolExecutor(n_cpus()) as pool:
        found = list(pool.map(_areas, *zip(*cases, strict=True)))
    table = pd.DataFrame(cases, columns=["mission", "scenarios", "seed"])
    table[["independent", "scenarios_area", "seconds_ratio"]] = found
    by = ["mission", "scenarios"]
    means = table.groupby(by, sort=False).mean().drop(columns="seed").reset_index()
    means["gained"] = 100 * (means["scenarios_area"] / means["independent"] - 1)
    names = list(MISSIONS)
    both = zip(means["mission"], means["scenarios"], strict=True)
    means["trial_area"] = [
        TRIAL[case][names.index(mission)] if case in TRIAL else np.nan for mission, case in both
    ]
    means.round(4).to_csv(folder / "areas.csv", index=False)
    print(means.round(4).to_string(index=False))
    _draw(folder)
    return bool((means["scenarios_area"] / means["trial_area"]).mean() >= 1.0)


def _draw(folder: Path) -> None:
    """Draw a plan of the flooded plant, and one that was made as if hazards were independent."""
    mission = load_mission("flooded_plant")
    for name, one in (("independent", load_mission("power_plant")), ("scenarios", mission)):
        found = solve(one, evaluations=EVALUATIONS, seed=SEEDS[0])
        row = found.choose("survivors >= 1").index
        ax = plot_scenarios(mission, found.plans[row], title=TITLES[name])
        save_plot(ax, folder / f"{name}.png")
    make_small(folder)


def _areas(name: str, case: str, seed: int) -> tuple[float, float, float]:
    """Return the true areas of plans made as if hazards were independent, and with scenarios.

    Also how much longer the latter takes.
    """
    mission = made(name, case)
    graph = mission.graph.copy()
    arcs = mission.world.graph
    numbers = {
        (mission.nodes[u], mission.nodes[v]): float(s)
        for u, v, s in zip(arcs.tail, arcs.head, arcs.mean_survival, strict=True)
    }
    nx.set_edge_attributes(graph, numbers, "survival")
    independent = Mission(graph, base=mission.base, robots=mission.robots)
    solutions = [solve(one, evaluations=EVALUATIONS, seed=seed) for one in (independent, mission)]
    areas = [area_indicator(mission.evaluate(found.plans), mission) for found in solutions]
    return areas[0], areas[1], solutions[1].seconds / max(solutions[0].seconds, 1e-9)


def made(name: str, case: str) -> Mission:
    """Return a mission whose zones are struck as ``case`` says."""
    mission = load_mission(name, **MISSIONS[name])
    if case == "16, independent zones":
        zone_of = zones(mission, 4)
        p = P_STRUCK / 4
        struck = [dict(enumerate(of)) for of in product((False, True), repeat=4)]
        chances = [float(np.prod([p if is_ else 1 - p for is_ in of.values()])) for of in struck]
    elif case == "an intruder in one of 3 wings":
        zone_of, chances = zones(mission, 3), [1 / 3] * 3
        struck = [{zone: zone == wing for zone in range(3)} for wing in range(3)]
        return _mission(mission, zone_of, struck, chances, 20.0, 0.05)
    else:
        n = int(case.split()[0]) - 1
        zone_of = zones(mission, n)
        struck = [{zone: zone == hit for zone in range(n)} for hit in range(-1, n)]
        chances = [1 - P_STRUCK, *[P_STRUCK / n] * n]
    return _mission(mission, zone_of, struck, chances, STRUCK, CALM)


def _mission(
    mission: Mission,
    zone_of: dict[Any, int],
    struck: list[dict[int, bool]],
    chances: list[float],
    factor: float,
    calm: float,
) -> Mission:
    """Return a mission in which hazards of arcs into zones that are struck are larger."""
    arcs = dict(nx.get_edge_attributes(mission.graph, "survival"))
    scenarios = []
    for number, (of, chance) in enumerate(zip(struck, chances, strict=True)):
        inside = [arc for arc in arcs if arc[1] != mission.base and of[zone_of[arc[1]]]]
        survival = {arc: arcs[arc] ** factor for arc in inside}
        scenarios.append(Scenario(f"number {number}", chance, factor=calm, survival=survival))
    return Mission(mission.graph, scenarios=scenarios, base=mission.base, robots=mission.robots)


def zones(mission: Mission, n: int) -> dict[Any, int]:
    """Return ``n`` zones: each node is in that of the nearest of nodes far from each other."""
    hops = dict(nx.all_pairs_shortest_path_length(mission.graph.to_undirected()))
    centres = [mission.base]
    while len(centres) <= n:
        far = {v: min(hops[v][u] for u in centres) for v in hops}
        centres.append(max(hops, key=lambda v: (far[v], str(v))))
    nearest: FloatArray = np.array([[hops[v][u] for u in centres[1:]] for v in hops])
    return dict(zip(hops, nearest.argmin(axis=1).tolist(), strict=True))
