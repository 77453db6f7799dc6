"""Compiling what Pareto local search runs, by two processes, before its first search."""

from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from botohe_moo._base.cpus import n_cpus
from botohe_moo.kernels.graph.graph import Limits
from botohe_moo.kernels.local_search.exchange import take_over
from botohe_moo.kernels.local_search.refill import refill
from botohe_moo.kernels.local_search.search import improve
from botohe_moo.mission.model import Mission
from botohe_moo.search.lanes import FIRST_ALONE
from botohe_moo.search.local_search import LocalSearch
from botohe_moo.search.sequential import SequentialPlanner


def compile_ahead(mission: Mission, limits: Limits, n_evaluations: int) -> None:
    """Compile the kernels of a Pareto local search, unless that has been done.

    The largest takes as long as the others together: a process of its own compiles it, while this
    one compiles the others, in the order in which the search needs them. With one processor,
    nothing is compiled ahead.
    """
    if n_cpus() == 1 or _is_compiled(improve):
        return
    steps: list[Callable[[Mission, Limits], None]] = []
    if not mission.has_returns:
        steps.append(_compile_planner)
    if n_evaluations > FIRST_ALONE:
        steps += [_compile_refill, _compile_exchange]
    other = get_context("spawn").Process(target=_compile_improve, args=(mission, limits))
    other.start()
    try:
        for compile_step in steps:
            if other.is_alive():
                compile_step(mission, limits)
        other.join()  # where it failed, the search compiles what is missing
    finally:
        other.kill()


def _is_compiled(kernel: Any) -> bool:
    """Return whether some process has kept the kernel's machine code."""
    folder, name = kernel.stats.cache_path, kernel.py_func.__qualname__
    return folder is not None and any(Path(folder).glob(f"*.{name}-*.nbi"))


def _compile_improve(mission: Mission, limits: Limits) -> None:
    _new_search(mission, limits).insert(mission.batch([mission.stay_home(limits)]))


def _compile_planner(mission: Mission, limits: Limits) -> None:
    SequentialPlanner(mission, limits, beam_width=1).plan(1.0)


def _compile_refill(mission: Mission, limits: Limits) -> None:
    refill(_new_search(mission, limits).parts, 0)


def _compile_exchange(mission: Mission, limits: Limits) -> None:
    search = _new_search(mission, limits)
    take_over(search.parts, search.news(0), 0)


def _new_search(mission: Mission, limits: Limits) -> LocalSearch:
    return LocalSearch(mission, limits, random_state=np.random.default_rng(0))
