"""Pareto local search beside population algorithms, at small budgets and large ones."""

from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pandas as pd
from pymoo.optimize import minimize

from botohe_moo import BOTOHE, Mission, area_indicator, load_mission, make_algorithm

BUDGETS = (300, 1_000, 3_000, 10_000, 30_000, 100_000, 1_000_000)
OTHERS = ("nsga2", "spea2", "sms-emoa")
RUNS = 10
# How many runs of a population algorithm go on to so many evaluations: a million take minutes.
RUNS_TO = {10_000: 10, 100_000: 3, 1_000_000: 1}


def missions() -> dict[str, Mission]:
    """Draw a dozen missions of different kinds."""
    return {
        "terrain, 40 nodes": load_mission("terrain", nodes=40, robots=2, seed=11),
        "terrain, 60 nodes": load_mission("terrain", nodes=60, robots=3, seed=12),
        "terrain, 110 nodes": load_mission("terrain", nodes=110, robots=4, seed=13),
        "corridors, 3 x 16": drawn_on(nx.grid_2d_graph(3, 16), 21),
        "corridors, 2 x 40": drawn_on(nx.grid_2d_graph(2, 40), 22),
        "tree, 40 nodes": drawn_on(_tree(40, 31), 31),
        "tree, 80 nodes": drawn_on(_tree(80, 32), 32),
        "one-way, 40 nodes": drawn_on(_one_way(40, 41), 41),
        "one-way, 80 nodes": drawn_on(_one_way(80, 42), 42),
        "communities": load_mission("two_communities", seed=51),
        "dense, 25 nodes": load_mission("complete", nodes=25, seed=61),
        "dense, 60 nodes": load_mission("complete", nodes=60, robots=3, seed=62),
    }


def _tree(nodes: int, seed: int) -> Any:
    rng = np.random.default_rng(seed)
    return nx.Graph([(node, int(rng.integers(max(0, node - 6), node))) for node in range(1, nodes)])


def _one_way(nodes: int, seed: int) -> Any:
    """Draw as many arcs again as a cycle has."""
    rng = np.random.default_rng(seed)
    arcs = [(node, (node + 1) % nodes) for node in range(nodes)]
    arcs += [tuple(rng.choice(nodes, 2, replace=False).tolist()) for _ in range(nodes)]
    return nx.DiGraph(arcs)


def drawn_on(graph: Any, seed: int) -> Mission:
    """Draw rewards and survivals for two robots that leave the first node."""
    rng = np.random.default_rng(seed)
    drawn: nx.DiGraph[Any] = nx.convert_node_labels_to_integers(graph).to_directed()
    for node in drawn:
        drawn.nodes[node]["reward"] = float(rng.uniform(0.1, 1.0))
    for arc in drawn.edges:
        drawn.edges[arc]["survival"] = float(rng.uniform(0.9, 1.0))
    return Mission(drawn, base=0, robots=2)


def run(out: Path) -> bool:
    """Print and keep mean areas; judge whether none is behind the best of the others."""
    rows = []
    for name, mission in missions().items():
        ours, theirs = _ours(mission), {other: _theirs(mission, other) for other in OTHERS}
        for i, budget in enumerate(BUDGETS):
            row: dict[str, Any] = {"mission": name, "evaluations": budget}
            row["pareto-local-search"] = ours[:, i].mean()
            row["standard_error"] = ours[:, i].std(ddof=1) / np.sqrt(RUNS)
            for other, areas in theirs.items():
                row[other] = np.nanmean(areas[:, i])
            row["ahead"] = row["pareto-local-search"] - max(row[other] for other in OTHERS)
            rows.append(row)
        print(pd.DataFrame(rows[-len(BUDGETS) :]).round(5).to_string(index=False), flush=True)
    table = pd.DataFrame(rows).round(6)
    table.to_csv(out / "budgets.csv", index=False)
    print("least ahead:", table["ahead"].min(), "rows behind:", int((table["ahead"] < 0).sum()))
    return bool((table["ahead"] >= 0).all())


def _ours(mission: Mission) -> Any:
    return np.array(
        [
            [_area(mission, "pareto-local-search", budget, 1 + i) for budget in BUDGETS]
            for i in range(RUNS)
        ]
    )


def _theirs(mission: Mission, name: str) -> Any:
    """Give areas as the runs went by (RUNS, n_budgets); nan behind the end of a run."""
    areas = np.full((RUNS, len(BUDGETS)), np.nan)
    for i in range(RUNS):
        most = max(budget for budget, n_runs in RUNS_TO.items() if i < n_runs)

        def note(algorithm: Any, row: int = i) -> None:
            for column, budget in enumerate(BUDGETS):
                if np.isnan(areas[row, column]) and algorithm.evaluator.n_eval >= budget:
                    areas[row, column] = area_indicator(-algorithm.opt.get("F"), mission)

        minimize(BOTOHE(mission), make_algorithm(name), ("n_eval", most), seed=1 + i, callback=note)
    return areas


def _area(mission: Mission, name: str, evaluations: int, seed: int) -> float:
    algorithm = make_algorithm(name)
    result = minimize(BOTOHE(mission), algorithm, ("n_eval", evaluations), seed=seed)
    return area_indicator(-result.F, mission)
