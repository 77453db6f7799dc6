"""What it costs to plan as if hazards were independent, where they strike together."""

from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd

from botohe_moo import Mission, Scenario, area_indicator, load_mission, solve
from botohe_moo.base.runtime import n_cpus
from botohe_moo.base.types import FloatArray

EVALUATIONS, SEEDS = 100_000, (1, 2, 3)
MISSIONS: dict[str, dict[str, Any]] = {
    "art_museum": {},
    "power_plant": {},
    "terrain": {"nodes": 60, "seed": 1, "robots": 5},
    "terrain_200": {},
}
# For each number of scenarios, what a rough trial gained on each mission, in per cent of the area.
TRIAL = {
    "2 scenarios": (1.0, 5.0, 2.2, 16.7),
    "4 scenarios": (1.6, 9.3, 2.9, 13.1),
    "8 scenarios": (2.2, 2.5, 0.5, 5.2),
    "16 scenarios": (0.6, 1.0, 0.2, 0.6),
    "16, independent zones": (4.2, 12.2, 2.7, 16.3),
    "an intruder in one of 3 wings": (9.6, 29.6, 12.9, 40.7),
}
P_STRUCK, STRUCK, CALM = 0.6, 8.0, 0.5  # together, and factors on hazards


def run(folder: Path) -> bool:
    """Print and write areas of plans made with scenarios, and as if hazards were independent."""
    cases = list(product(MISSIONS, TRIAL, SEEDS))
    with ProcessPoolExecutor(n_cpus()) as pool:
        found = list(pool.map(_areas, *zip(*cases, strict=True)))
    table = pd.DataFrame(cases, columns=["mission", "scenarios", "seed"])
    table[["independent", "scenarios_area", "seconds_ratio"]] = found
    by = ["mission", "scenarios"]
    means = table.groupby(by, sort=False).mean().drop(columns="seed").reset_index()
    means["gained"] = 100 * (means["scenarios_area"] / means["independent"] - 1)
    names = list(MISSIONS)
    both = zip(means["mission"], means["scenarios"], strict=True)
    means["gained_in_trial"] = [TRIAL[case][names.index(mission)] for mission, case in both]
    means.round(4).to_csv(folder / "areas.csv", index=False)
    print(means.round(4).to_string(index=False))
    return bool((means["gained"] >= means["gained_in_trial"]).all())


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
