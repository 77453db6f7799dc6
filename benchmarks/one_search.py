"""One search of a terrain, in a process of its own: how long, how much memory, how good.

``benchmarks.growth`` starts it; it imports nothing that a search does without.
"""

import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from pymoo.optimize import minimize

from benchmarks.memory import peak_resident
from botohe_moo import BOACO, BOTOHE, area_indicator, load_mission
from botohe_moo.algorithms.local_search.algorithm import ParetoLocalSearch

ALGORITHMS: dict[str, Callable[[], Any]] = {
    "pareto-local-search": ParetoLocalSearch,
    "BOACO.journal": BOACO.journal,
}
# Areas are told at a sixth of the time, and at its end.
EARLY = 6

COLUMNS = (
    "arcs",
    "evaluations",
    "generations",
    "seconds",
    "first_generation_s",
    "early_area",
    "area",
    "front",
    "nodes_a_plan",
    "before_mib",
    "peak_mib",
)


def measure(nodes: int, robots: int, name: str, seconds: float) -> Iterable[float]:
    """Search for so long; give what ``COLUMNS`` names."""
    minimize(BOTOHE(load_mission("toy")), ALGORITHMS[name](), ("n_eval", 300), seed=1)  # compiles
    problem = BOTOHE(load_mission("terrain", nodes=nodes, robots=robots, seed=0))
    mission, algorithm = problem.mission, ALGORITHMS[name]()
    before = peak_resident()

    first, spent = 0.0, 0.0
    # A generation that is not over when time is up does not count: its plans come too late.
    fronts = dict.fromkeys((seconds / EARLY, seconds), np.empty((0, 2)))
    started = time.perf_counter()
    algorithm.setup(problem, termination=("n_gen", sys.maxsize), seed=1)
    spent += time.perf_counter() - started
    while algorithm.has_next() and (spent < seconds or not first):
        started = time.perf_counter()
        algorithm.next()
        spent += time.perf_counter() - started
        first = first or spent
        for mark in fronts:
            if spent <= mark:
                fronts[mark] = algorithm.archive.objectives
    peak = peak_resident()

    lengths = len(algorithm.archive.plans.nodes) / len(algorithm.archive)
    return (
        mission.world.graph.n_arcs,
        algorithm.evaluator.n_eval,
        algorithm.n_iter - 1,
        spent,
        first,
        *(area_indicator(front, mission) for front in fronts.values()),
        len(algorithm.archive),
        lengths,
        before,
        peak,
    )


if __name__ == "__main__":
    print(*measure(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], float(sys.argv[4])))
