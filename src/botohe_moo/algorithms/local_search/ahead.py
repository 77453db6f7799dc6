"""Compiling what Pareto local search runs, by two processes, before its first search."""

import signal
from multiprocessing import get_context

import numpy as np

from botohe_moo._base.cpus import n_cpus
from botohe_moo.algorithms.greedy.planner import SequentialPlanner
from botohe_moo.algorithms.local_search.engine import Costs, LocalSearch
from botohe_moo.algorithms.local_search.kernels.recreate import recreate
from botohe_moo.algorithms.local_search.kernels.search import improve
from botohe_moo.core.compile import is_kept
from botohe_moo.core.world import World
from botohe_moo.mission.model import Mission


def compile_ahead(mission: Mission, world: World) -> None:
    """Compile the kernels of a Pareto local search, unless that has been done.

    Another process compiles the largest, ``improve``; meanwhile this one compiles the others. With
    one processor, or where machine code is not kept on disk, nothing is compiled ahead. Only the
    main thread may call this.
    """
    if n_cpus() == 1 or is_kept(improve):
        return
    other = get_context("spawn").Process(target=_compile_improve, args=(mission, world))
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)  # which the other process inherits
    try:
        other.start()
    finally:
        signal.signal(signal.SIGINT, usual)
    try:
        if not mission.has_returns:  # else the search does not begin with such plans
            SequentialPlanner(mission, world, beam_width=1).plan(1.0)
        search = _new_search(mission, world)
        if search.is_recreating:
            recreate(search.parts, 0)
        other.join()  # if it fails, the search compiles what is missing
    finally:
        other.kill()


def _compile_improve(mission: Mission, world: World) -> None:
    _new_search(mission, world).insert(mission.batch([mission.stay_home(world)]))


def _new_search(mission: Mission, world: World) -> LocalSearch:
    return LocalSearch(mission, Costs(world), random_state=np.random.default_rng(0))
