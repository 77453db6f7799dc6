"""How far fronts are from the best there are: certified bounds, and the time they take."""

import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd
from pymoo.optimize import minimize

from botohe_moo import (
    BOTOHE,
    FrontBound,
    Mission,
    ParetoLocalSearch,
    area_indicator,
    bound_front,
    load_mission,
)
from botohe_moo.base.runtime import n_cpus
from botohe_moo.base.types import FloatArray
from botohe_moo.plots import plot_front

RESULTS = Path(__file__).parents[1] / "results"
# Nodes of tunnels, and the gaps that are wanted after some seconds, in per cent.
TUNNELS, TUNNEL_SEEDS = ((45, {60: 1.5, 300: 0.8}), (75, {60: 2.5, 300: 1.2})), (1, 2, 3)
# Maps that are nearly trees: their nodes, and the gaps that are wanted after some seconds.
MAPS: tuple[tuple[str, int, dict[int, float]], ...] = (
    ("rooms", 45, {60: math.inf}),
    ("rooms", 80, {300: 2.0}),
    ("rooms", 110, {120: math.inf}),
    ("mine", 45, {60: 3.0}),
    ("mine", 80, {120: math.inf}),
    ("mine", 110, {120: math.inf}),
)
MAP_SEEDS = 0, 1, 2
# Mission, and seconds with the gap that is wanted then, in per cent; inf where none is.
CASES: tuple[tuple[str, dict[int, float]], ...] = (
    ("terrain_200", {600: 4.0}),
    ("terrain, 60 nodes, 3 robots", {60: math.inf, 180: 1.5}),
    ("terrain, 60 nodes, 5 robots", {60: math.inf, 180: 1.2}),
    ("art_museum", {30: 0.65, 120: 0.45}),
    ("power_plant", {30: 0.84, 90: 0.77}),
    ("terrain, 1 000 nodes, 10 robots", {120: math.inf}),
    *(
        (f"tunnel, {n} nodes, seed {seed}", wanted)
        for n, wanted in TUNNELS
        for seed in TUNNEL_SEEDS
    ),
    *(
        (f"{family}, {n} nodes, seed {seed}", wanted)
        for family, n, wanted in MAPS
        for seed in MAP_SEEDS
    ),
    ("lattice, 5 x 13", {60: math.inf}),
    ("town of one-way streets, 8 x 8", {60: math.inf}),
    ("corridors, 2 x 40", {60: math.inf}),
    ("one-way, 40 nodes", {60: math.inf}),
    ("one-way, 80 nodes", {60: math.inf}),
    ("two_communities", {30: math.inf}),
)
EVALUATIONS = 1_000_000
CASE_STUDIES = ("art_museum", "power_plant", "two_communities")


def run(folder: Path) -> bool:
    """Print and write gaps, also of all algorithms, and a picture; judge."""
    bound_front(load_mission("terrain", nodes=12, robots=3, seed=1), time_limit=5)  # compiles
    rows: list[dict[str, object]] = []
    bounds = {}
    with ProcessPoolExecutor(n_cpus()) as pool:
        for found, last, front in pool.map(_bounded, *zip(*CASES, strict=True)):
            rows += found
            bounds[found[0]["mission"]] = last, front
            print(pd.DataFrame(found).to_string(index=False), flush=True)
            pd.DataFrame(rows).to_csv(folder / "bounds.csv", index=False)
    gaps = _of_algorithms(lambda name: bounds[name][0].area)
    gaps.to_csv(folder / "algorithms.csv", index=False)
    print("\nResults of studies, mean areas\n" + gaps.to_string(index=False))
    published = pd.read_csv(RESULTS / "paper" / "published.csv")["published"]
    below = bool(published.max() <= bounds["art_museum"][0].area)
    print(f"\npublished areas of the art museum are below the bound: {below}")
    bound, front = bounds["art_museum"]
    plot_front(front, bound.mission, bound=bound).figure.savefig(folder / "front.png", dpi=150)
    return below and all(row["gap"] <= row["gap_wanted"] for row in rows)


def _bounded(
    name: str, wanted: dict[int, float]
) -> tuple[list[dict[str, object]], FrontBound, FloatArray]:
    """Bound the front of a mission, for some times; return rows, the last bound, and the front."""
    mission = _mission(name)
    result = minimize(BOTOHE(mission), ParetoLocalSearch(), ("n_eval", EVALUATIONS), seed=1)
    rows = []
    for seconds, most in wanted.items():
        bound = bound_front(mission, front=-result.F, time_limit=seconds)
        rows.append(_row(name, mission, bound, -result.F, seconds, most))
    return rows, bound, -result.F


def _mission(name: str) -> Mission:
    families = [("tunnel", nodes, seed) for nodes, _ in TUNNELS for seed in TUNNEL_SEEDS]
    families += [(family, nodes, seed) for family, nodes, _ in MAPS for seed in MAP_SEEDS]
    drawn: dict[str, Callable[[], Mission]] = {
        f"{family}, {nodes} nodes, seed {seed}": partial(
            load_mission, family, nodes=nodes, seed=seed
        )
        for family, nodes, seed in families
    }
    drawn |= {
        "lattice, 5 x 13": lambda: drawn_on(nx.grid_2d_graph(5, 13), 71),
        "town of one-way streets, 8 x 8": lambda: drawn_on(_one_way_streets(8), 72),
        "corridors, 2 x 40": lambda: drawn_on(nx.grid_2d_graph(2, 40), 22),
        "one-way, 40 nodes": lambda: one_way(40),
        "one-way, 80 nodes": lambda: one_way(80),
        "two_communities": lambda: load_mission("two_communities", seed=0),
        "terrain, 60 nodes, 3 robots": lambda: load_mission("terrain", nodes=60, robots=3, seed=12),
        "terrain, 60 nodes, 5 robots": lambda: load_mission("terrain", nodes=60, robots=5, seed=12),
        "terrain, 1 000 nodes, 10 robots": lambda: load_mission(
            "terrain", nodes=1_000, robots=10, seed=1
        ),
    }
    return drawn[name]() if name in drawn else load_mission(name)


def _one_way_streets(n: int) -> "nx.DiGraph[tuple[int, int]]":
    """Return the crossings of ``n`` streets with ``n`` others, each the other way than the last."""
    town: nx.DiGraph[tuple[int, int]] = nx.DiGraph()
    for street in range(n):
        along = [(street, i) for i in range(n)][:: 1 if street % 2 else -1]
        across = [(i, street) for i in range(n)][:: -1 if street % 2 else 1]
        nx.add_path(town, along)
        nx.add_path(town, across)
    return town


def _row(
    name: str, mission: Mission, bound: FrontBound, front: object, seconds: int, most: float
) -> dict[str, object]:
    """Say what was proved; gaps in per cent of the front's area."""
    return {
        "mission": name,
        "nodes": len(mission.graph),
        "robots": mission.robots,
        "area": area_indicator(front, mission),
        "bound_area": bound.area,
        "gap": 100 * bound.gap(front),
        "gap_wanted": most,
        "seconds_given": seconds,
        "seconds": round(bound.seconds, 1),
        "lines": len(bound.lines),
        "steps": len(bound.steps),
    }


def _of_algorithms(bound_of: Callable[[str], float]) -> pd.DataFrame:
    """Compare mean areas of committed studies, 100 000 evaluations, with the bounds."""
    summary = pd.read_csv(RESULTS / "state-of-the-art" / "summary.csv")
    rows = []
    for name in CASE_STUDIES:
        bound = bound_of(name)
        of_mission = summary[summary["mission"] == name.replace("_", "-")]
        for algorithm, area in zip(of_mission["algorithm"], of_mission["area_mean"], strict=True):
            rows.append((name, algorithm, area, bound, 100 * (bound / area - 1)))
    columns = ["mission", "algorithm", "area_mean", "bound_area", "gap"]
    return pd.DataFrame(rows, columns=columns)


def one_way(nodes: int) -> Mission:
    """Draw as many arcs again as a cycle of one-way arcs has."""
    rng = np.random.default_rng(nodes // 40 + 40)
    arcs = [(node, (node + 1) % nodes) for node in range(nodes)]
    arcs += [tuple(rng.choice(nodes, 2, replace=False).tolist()) for _ in range(nodes)]
    return drawn_on(nx.DiGraph(arcs), nodes // 40 + 40)


def drawn_on(graph: Any, seed: int) -> Mission:
    """Draw rewards and survivals for two robots that leave the first node."""
    rng = np.random.default_rng(seed)
    drawn: nx.DiGraph[Any] = nx.convert_node_labels_to_integers(graph).to_directed()
    for node in drawn:
        drawn.nodes[node]["reward"] = float(rng.uniform(0.1, 1.0))
    for arc in drawn.edges:
        drawn.edges[arc]["survival"] = float(rng.uniform(0.9, 1.0))
    return Mission(drawn, base=0, robots=2)
