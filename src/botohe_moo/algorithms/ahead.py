"""Compiling what Pareto local search runs, by two processes, before its first search."""

import signal
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from botohe_moo._base.cpus import n_cpus
from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.algorithms.local_search.engine import LocalSearch
from botohe_moo.algorithms.local_search.islands import FIRST_ALONE
from botohe_moo.algorithms.local_search.kernels.refill import refill
from botohe_moo.algorithms.local_search.kernels.search import improve
from botohe_moo.core.graph import Limits
from botohe_moo.mission.model import Mission


def compile_ahead(mission: Mission, limits: Limits, n_evaluations: int) -> None:
    """Compile the kernels of a Pareto local search, unless that has been done.

    Another process compiles the largest, ``improve``; meanwhile this one compiles the others. Where
    there are enough evaluations for lanes, they share what these need as well. With one processor,
    or where machine code is not kept on disk, nothing is compiled ahead. Only the main thread may
    call this.
    """
    if n_cpus() == 1 or not _is_missing(improve):
        return
    lanes = n_evaluations > FIRST_ALONE
    other = get_context("spawn").Process(target=_compile_improve, args=(mission, limits, lanes))
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)  # which the other process inherits
    try:
        other.start()
    finally:
        signal.signal(signal.SIGINT, usual)
    try:
        if not mission.has_returns:  # else the search does not begin with such plans
            SequentialPlanner(mission, limits, beam_width=1).plan(1.0)
        search = _new_search(mission, limits)
        if search.parts.p_refill > 0.0:
            refill(search.parts, 0)
        if lanes:
            search.share_routes(())
        other.join()  # if it fails, the search compiles what is missing
    finally:
        other.kill()


def _is_missing(kernel: Any) -> bool:
    """Return whether no process has kept the kernel's machine code so far, but one could."""
    stats = getattr(kernel, "stats", None)  # none where numba is told to compile nothing
    folder = None if stats is None else stats.cache_path
    if folder is None:
        return False
    return not any(Path(folder).glob(f"*.{kernel.py_func.__qualname__}-*.nbi"))


def _compile_improve(mission: Mission, limits: Limits, lanes: bool) -> None:
    search = _new_search(mission, limits)
    search.insert(mission.batch([mission.stay_home(limits)]))
    if lanes:
        search.take_over(search.news(0))


def _new_search(mission: Mission, limits: Limits) -> LocalSearch:
    return LocalSearch(mission, limits, random_state=np.random.default_rng(0))
