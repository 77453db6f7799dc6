"""What a plan costs in a whole run, kernel by kernel, beside the readable Python twin."""

import random
import sys
import time
from pathlib import Path

import pandas as pd
from pymoo.optimize import minimize
from tests import twins

from benchmarks.measure import CountedBOACO, in_process, kernel_seconds
from benchmarks.memory import peak_resident
from botohe_moo import BOACO, BOTOHE, load_mission

MISSIONS = ("art_museum", "power_plant")
ITERATIONS = 10_000
REPETITIONS = 3
TWIN_PLANS = 300


def run(out: Path) -> bool:
    """Print and keep what a plan costs."""
    table = pd.DataFrame([_row(name) for name in MISSIONS]).set_index("mission").T
    print(f"BOACO.journal(), {ITERATIONS} iterations of 100 ants, least of {REPETITIONS} runs")
    print(table.to_string())
    table.to_csv(out / "speed.csv")
    # Ratios of one process on one machine, which other machines should confirm.
    fast = table.loc["times faster than the twin"].min() >= 300
    lean = table.loc["whole run / (construct + evaluate)", "art_museum"] <= 1.5
    print(f"at least 300 times the twin: {fast}; museum's run within 1.5 of its kernels: {lean}")
    return bool(fast and lean)


def _row(name: str) -> dict[str, object]:
    mission = load_mission(name)
    problem = BOTOHE(mission)
    minimize(problem, BOACO.journal(), ("n_gen", 3), seed=1)  # compiles
    totals, runs = [], []
    for _ in range(REPETITIONS):
        started = time.perf_counter()
        minimize(problem, BOACO.journal(), ("n_gen", ITERATIONS), seed=1)
        totals.append(time.perf_counter() - started)
        with kernel_seconds() as seconds:
            result = minimize(problem, CountedBOACO.journal(), ("n_gen", ITERATIONS), seed=1)
        runs.append((seconds["construct"] + seconds["evaluate"], sum(seconds.values()), seconds))
    total = min(totals)
    built, in_kernels, seconds = min(runs, key=lambda run: run[0])
    n_plans, n_hops = result.algorithm.evaluator.n_eval, result.algorithm.n_hops
    twin = _twin_seconds_per_plan(result.algorithm)
    _, memory = in_process("benchmarks.speed", name)

    def per_iteration(*kernels: str) -> float:
        return round(sum(seconds[kernel] for kernel in kernels) / ITERATIONS * 1e6, 1)

    return {
        "mission": name,
        "hops a plan": round(n_hops / n_plans, 1),
        "construct, µs a plan": round(seconds["construct"] / n_plans * 1e6, 3),
        "evaluate, µs a plan": round(seconds["evaluate"] / n_plans * 1e6, 3),
        "both, µs a plan": round(built / n_plans * 1e6, 3),
        "both, ns a hop": round(built / n_hops * 1e9, 1),
        "both, plans a second": round(n_plans / built),
        "Python twin, µs a plan": round(twin * 1e6, 1),
        "times faster than the twin": round(twin / (built / n_plans)),
        "whole run, s": round(total, 3),
        "whole run / (construct + evaluate)": round(total / built, 3),
        "archive, µs an iteration": per_iteration("keep_front"),
        "deposit, µs an iteration": per_iteration("learn"),
        "share outside kernels": round(1 - in_kernels / total, 3),
        "peak memory, MiB": round(float(memory)),
    }


def _twin_seconds_per_plan(algorithm: BOACO) -> float:
    """Let the readable ants build plans where the colony stands at the end of its run."""
    mission, rule = algorithm.problem.mission, algorithm.colony.settings
    graph, base = mission.world.graph, mission.index(mission.base)
    arcs = [*zip(graph.tail.tolist(), graph.head.tolist(), strict=True), (base, base)]
    levels = dict(zip(arcs, map(tuple, algorithm.colony.pheromone[0].tolist()), strict=True))
    rng = random.Random(1)
    started = time.perf_counter()
    for i in range(TWIN_PLANS):
        ant = twins.Ant(mission, rule, [levels] * mission.robots, (i % 100) / 99)
        plan = [[mission.nodes[node] for node in trail] for trail in ant.build(rng)]
        twins.evaluate(mission, plan)
    return (time.perf_counter() - started) / TWIN_PLANS


if __name__ == "__main__":
    solved = minimize(
        BOTOHE(load_mission(sys.argv[1])), BOACO.journal(), ("n_gen", ITERATIONS), seed=1
    )
    print(len(solved.F), peak_resident())
