"""What a plan costs when the front is large: up to a million plans, on a mission made for it."""

import sys
import time
from pathlib import Path

import networkx as nx
import numpy as np
import pandas as pd
from pymoo.optimize import minimize

from benchmarks.measure import in_process
from benchmarks.memory import peak_resident
from botohe_moo import BOTOHE, Mission
from botohe_moo.algorithms.local_search.algorithm import ParetoLocalSearch

ROBOTS = 30
SIZES = (10_000, 100_000, 1_000_000)
# A hundred times the plans: a step through the whole front would cost a hundred times as much.
AT_MOST = 5

COLUMNS = ("us_per_evaluation", "us_per_entry", "longest_generation_ms", "peak_mib")


def even_star(robots: int) -> Mission:
    """Make a mission of as many nodes as robots, around the base, in which hardly a plan dominates.

    A node's reward is such that E[R] + E[S] is the same for all plans in which every robot visits
    one node, which no other visits, or none: 2 to the number of robots.
    """
    survivals = np.random.default_rng(0).uniform(0.9, 0.995, (robots, 2))
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_node(0, reward=0.0)
    for node, (there, back) in enumerate(survivals.tolist(), start=1):
        graph.add_node(node, reward=(1 - there * back) / there)
        graph.add_edge(0, node, survival=there)
        graph.add_edge(node, 0, survival=back)
    return Mission(graph, base=0, robots=robots)


def run(out: Path) -> bool:
    """Print and keep what plans cost; tell whether one costs hardly more in a large front."""
    fields = np.array(in_process("benchmarks.fronts"), float)
    table = pd.DataFrame(fields.reshape(len(SIZES), -1), columns=COLUMNS).round(2)
    table.insert(0, "plans", SIZES)
    table.to_csv(out / "fronts.csv", index=False)
    print(f"ParetoLocalSearch(), {ROBOTS} robots; the front's second half of each size")
    print(table.to_string(index=False))
    costs = table.set_index("plans")["us_per_entry"]
    times = costs[max(SIZES)] / costs[min(SIZES)]
    print(f"a plan that enters the largest front at most {AT_MOST} times as costly: {times:.1f}")
    return bool(times <= AT_MOST)


def _measure() -> list[float]:
    """Search until the front is as large as it should be; give ``COLUMNS`` for each size."""
    minimize(BOTOHE(even_star(3)), ParetoLocalSearch(), ("n_eval", 300), seed=1)  # compiles
    algorithm = ParetoLocalSearch()
    algorithm.setup(BOTOHE(even_star(ROBOTS)), termination=("n_gen", sys.maxsize), seed=1)
    return [field for size in SIZES for field in _grow(algorithm, size)]


def _grow(algorithm: ParetoLocalSearch, size: int) -> list[float]:
    """Search on until the front has so many plans; measure what its second half costs."""
    while algorithm._search is None or not algorithm.is_initialized:
        algorithm.next()
    search = algorithm._search.first  # the one island
    while len(search) < size // 2:
        algorithm.next()
    evaluations, entries, seconds = algorithm.evaluator.n_eval, search.version, [0.0]
    while len(search) < size:
        started = time.perf_counter()
        algorithm.next()
        seconds.append(time.perf_counter() - started)
    evaluations, entries = algorithm.evaluator.n_eval - evaluations, search.version - entries
    spent = 1e6 * sum(seconds)
    return [
        spent / max(1, evaluations),
        spent / max(1, entries),
        1e3 * max(seconds),
        peak_resident(),
    ]


if __name__ == "__main__":
    print(*_measure())
