"""Fixtures that several test modules share."""

import subprocess
import sys

from hypothesis import HealthCheck, settings

# Shared CI machines stall now and then: what counts is the result, never the time an example took.
settings.register_profile("botohe", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("botohe")

COMPILE = """
import sys
from pymoo.optimize import minimize
from botohe_moo import BOTOHE, load_mission, make_algorithm
for name in sys.argv[1:]:
    minimize(BOTOHE(load_mission("toy")), make_algorithm(name), ("n_eval", 200), seed=1)
"""


def pytest_sessionstart(session):
    """Compile the largest kernels before there are workers, each of which would compile them."""
    config = session.config
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        names = [["pareto-local-search"], ["bo-aco", "nsga2", "exact"]]
        processes = [subprocess.Popen([sys.executable, "-c", COMPILE, *given]) for given in names]
        for process in processes:
            process.wait()
