"""Fixtures that several test modules share."""

import gc
import hashlib
import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numba
import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.examples import SHARE, examples
from tests.forked import ADDRESS, start_server

# Shared CI machines stall now and then: what counts is the result, never the time an example took.
# `make test-long` draws others each time; the rest the same ones, so that what passes once passes
# everywhere.
patient = examples(
    100, deadline=None, derandomize=SHARE <= 1, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("botohe", patient)
settings.load_profile("botohe")

# For `make coverage`: a hundred times slower, so few examples have to do, and none is made smaller.
UNCOMPILED = bool(numba.config.DISABLE_JIT)
MOST_UNCOMPILED_EXAMPLES = 10
if UNCOMPILED:
    settings.register_profile("uncompiled", phases=(Phase.explicit, Phase.generate))
    settings.load_profile("uncompiled")


def pytest_collection_modifyitems(items):
    """Leave examples of docstrings to `make test-all`; draw few where kernels are not compiled."""
    for item in items:
        if isinstance(item, pytest.DoctestItem):
            item.add_marker(pytest.mark.slow)
    name = "_hypothesis_internal_use_settings"  # what hypothesis's own plugin reads, too
    for item in items if UNCOMPILED else ():
        test = getattr(item, "obj", None)
        given = getattr(test, name, None)
        if given is not None:
            fewer = min(given.max_examples, MOST_UNCOMPILED_EXAMPLES)
            setattr(getattr(test, "__func__", test), name, settings(given, max_examples=fewer))


# Under nohup, or in the background of a script, these are ignored, and so would all processes do.
for name, usual in {"SIGHUP": signal.SIG_DFL, "SIGINT": signal.default_int_handler}.items():
    number = getattr(signal, name, None)  # Windows has no SIGHUP
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

# What most tests call: of other arguments, kernels are compiled where they are called.
COMPILE = """
import sys
from pymoo.optimize import minimize
from botohe_moo import BOTOHE, bound_front, load_mission, make_algorithm
from botohe_moo.core.compile import kernels
for name in sys.argv[1:]:
    if name == "bounds":  # its limit of time is for its own steps
        bound_front(load_mission("terrain", nodes=30, robots=2, seed=3), time_limit=2)
        continue
    n_eval = 3_000 if name == "pareto-local-search" else 200  # it ruins plans late
    for limits in ({}, {"max_length": 6}):
        with kernels("compiled"):
            problem = BOTOHE(load_mission("toy"), **limits)
            minimize(problem, make_algorithm(name), ("n_eval", n_eval), seed=1)
"""


def pytest_collection_finish():
    """Let the garbage collector pass over libraries and tests, which stay: 8 % less time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def pytest_sessionstart(session):
    """Compile the kernels of searches before there are workers, who would each compile them."""
    config = session.config
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        if not UNCOMPILED:
            compile_kernels(getattr(config, "cache", None))
        os.environ[ADDRESS] = start_server()  # for all workers


def compile_kernels(cache):
    """Compile kernels on two cores, unless that was done with the present sources."""
    package, done = Path(find_spec("botohe_moo").origin).parent, "botohe_moo/compiled"
    sources = b"".join(path.read_bytes() for path in sorted(package.rglob("*.py")))
    digest = hashlib.sha256(sources + numba.__version__.encode()).hexdigest()
    if cache is not None and cache.get(done, None) == digest:
        return
    names = [["pareto-local-search", "simulated-annealing"], ["bo-aco", "nsga2", "exact", "bounds"]]
    processes = [subprocess.Popen([sys.executable, "-c", COMPILE, *given]) for given in names]
    statuses = [process.wait() for process in processes]
    if cache is not None and not any(statuses):
        cache.set(done, digest)
