"""How the benchmarks measure: time inside kernels, and processes of their own."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from botohe_moo import BOACO
from botohe_moo.algorithms import base as base_module
from botohe_moo.algorithms.bo_aco import kernels as ant_kernels
from botohe_moo.core import evaluate as evaluate_module

KERNELS = {
    "construct": (ant_kernels, "construct"),
    "evaluate": (evaluate_module, "evaluate"),
    "keep_front": (base_module, "keep_front"),
    "learn": (ant_kernels, "learn"),
}


@contextmanager
def kernel_seconds() -> Iterator[dict[str, float]]:
    """Sum up the time spent in each kernel while the context lasts."""
    seconds = dict.fromkeys(KERNELS, 0.0)

    def timed(name: str, kernel: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            started = time.perf_counter()
            result = kernel(*arguments)
            seconds[name] += time.perf_counter() - started
            return result

        return call

    usual = {name: getattr(module, attribute) for name, (module, attribute) in KERNELS.items()}
    try:
        for name, (module, attribute) in KERNELS.items():
            setattr(module, attribute, timed(name, usual[name]))
        yield seconds
    finally:
        for name, (module, attribute) in KERNELS.items():
            setattr(module, attribute, usual[name])


class CountedBOACO(BOACO):
    """Counts the hops of all plans: what construction and evaluation are measured by."""

    n_hops = 0

    def evaluate_plans(self, batch: Any) -> Any:
        """Count hops, and evaluate."""
        # A trail of n nodes takes n hops, the last along the base's self-loop.
        self.n_hops += len(batch.nodes)
        return super().evaluate_plans(batch)


def in_process(module: str, *arguments: object) -> list[str]:
    """Run a module's main part in a fresh process; give the fields of its last line."""
    command = [sys.executable, "-m", module, *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return done.stdout.splitlines()[-1].split()
