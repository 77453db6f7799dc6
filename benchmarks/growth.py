"""How the cost of a plan grows with the mission: terrains of 50 to 2 000 nodes."""

import sys
import time
from pathlib import Path

import pandas as pd
from pymoo.optimize import minimize

from benchmarks.measure import CountedBOACO, in_process, kernel_seconds
from benchmarks.memory import peak_resident
from botohe_moo import BOTOHE, area_indicator, load_mission

SIZES = (50, 100, 200, 500, 1_000, 2_000)
ITERATIONS = 30


def run(out: Path) -> bool:
    """Print and keep how cost grows."""
    rows = []
    for nodes in SIZES:
        fields = [float(field) for field in in_process("benchmarks.growth", nodes)]
        arcs, hops, construct, evaluate, total, area, memory = fields
        n_plans = 100 * ITERATIONS
        rows.append(
            {
                "nodes": nodes,
                "arcs": int(arcs),
                "hops a plan": round(hops / n_plans),
                "construct, µs a plan": round(construct / n_plans * 1e6, 1),
                "evaluate, µs a plan": round(evaluate / n_plans * 1e6, 1),
                "both, ns a hop": round((construct + evaluate) / hops * 1e9, 1),
                "whole run / (construct + evaluate)": round(total / (construct + evaluate), 3),
                "area": round(area, 4),
                "peak memory, MiB": round(memory),
            }
        )
    table = pd.DataFrame(rows)
    print(f"BOACO.journal(), {ITERATIONS} iterations of 100 ants, five robots, one thread")
    print(table.to_string(index=False))
    table.to_csv(out / "growth.csv", index=False)
    return True


def _measure(nodes: int) -> None:
    mission = load_mission("terrain", nodes=nodes, seed=1)
    minimize(BOTOHE(load_mission("toy")), CountedBOACO.journal(), ("n_gen", 2), seed=1)  # compiles
    with kernel_seconds() as seconds:
        started = time.perf_counter()
        result = minimize(BOTOHE(mission), CountedBOACO.journal(), ("n_gen", ITERATIONS), seed=1)
        total = time.perf_counter() - started
    print(
        mission.world.graph.n_arcs,
        result.algorithm.n_hops,
        seconds["construct"],
        seconds["evaluate"],
        total,
        area_indicator(-result.F, mission),
        peak_resident(),
    )


if __name__ == "__main__":
    _measure(int(sys.argv[1]))
