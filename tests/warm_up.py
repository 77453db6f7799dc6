"""Compile the kernels that take longest: ``python -m tests.warm_up`` before the tests.

Two workers that begin with empty caches compile most kernels both. Here two processes compile half
of them each, and keep them for all that come after.
"""

import subprocess
import sys

SETTINGS = {
    "local": [
        ("pareto-local-search", {"greedy_start": False}),
        ("simulated-annealing", {}),
        ("simulated-annealing", {"schedule": "journal"}),
        ("nsga2", {}),
    ],
    "others": [
        ("greedy", {}),
        ("exact", {}),  # which plans greedily, too
        ("bo-aco", {}),
        ("bo-aco", {"allocation": "concurrent"}),
    ],
}


def main(names: list[str]) -> int:
    if not names:
        halves = [
            subprocess.Popen([sys.executable, "-m", "tests.warm_up", half]) for half in SETTINGS
        ]
        return max(half.wait() for half in halves)

    from pymoo.optimize import minimize

    from botohe_moo import BOTOHE, load_mission, make_algorithm

    problem = BOTOHE(load_mission("toy"))
    for algorithm, parameters in SETTINGS[names[0]]:
        minimize(problem, make_algorithm(algorithm, **parameters), ("n_eval", 300), seed=1)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
