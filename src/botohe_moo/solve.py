"""From a mission and an algorithm to a front, in one call."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import moocore
import numpy as np
from pymoo.core.algorithm import Algorithm

from botohe_moo._base.checks import check_integer
from botohe_moo._base.interrupts import hold_interrupt
from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE
from botohe_moo.search.exact import TooLargeError
from botohe_moo.solution import Solution
from botohe_moo.trails import TrailPlan

__all__ = ["Progress", "RefusalError", "search"]

Progress = Callable[[int, Callable[[], float]], None]
"""Takes the evaluations so far, and a function that gives the area of what was found."""


class RefusalError(ValueError):
    """An algorithm that does not take on a mission; says why."""


def search(
    mission: Mission,
    algorithm: Algorithm,
    *,
    evaluations: int = 100_000,
    seed: int = 1,
    min_survival: float = 0.0,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
    name: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    source: Mapping[str, Any] | None = None,
) -> Solution:
    """Run an algorithm on a mission until its budget is spent, or Ctrl-C is pressed.

    Parameters
    ----------
    mission
        What to plan for.
    algorithm
        A pymoo algorithm for :class:`BOTOHE` that has not run yet.
    evaluations
        Budget: trail plans to evaluate, at least 1.
    seed
        Seed of all random numbers, at least 0.
    min_survival
        Survival floor: every robot has to survive with at least this probability, in [0, 1].
    progress
        Called after each iteration with the evaluations so far, and a function that gives the area
        of what was found; may show both.
    stop
        Ends the search, after the iteration that is going on, when it is set; default: one that
        Ctrl-C sets.
    name, parameters
        What to call the algorithm in the solution; default: the name of its class.
    source
        Where the mission is from, for the solution's record.

    Returns
    -------
    Solution
        What was found so far, even if the search was stopped.

    Raises
    ------
    ValueError
        If ``evaluations``, ``seed`` or ``min_survival`` is out of its range, or the algorithm has
        run before.
    RefusalError
        If the algorithm does not take on this mission.
    """
    evaluations = check_integer("evaluations", evaluations, at_least=1)
    seed = check_integer("seed", seed, at_least=0)
    name = type(algorithm).__name__ if name is None else name
    problem = BOTOHE(mission, min_survival=min_survival)
    if algorithm.is_initialized:
        raise ValueError(f"Expected an algorithm that has not run yet, got {name!r} after a run.")
    try:
        algorithm.setup(problem, termination=("n_eval", evaluations), seed=seed)
    except (AssertionError, TypeError, ValueError) as error:  # pymoo asserts what it demands
        raise RefusalError(f"Algorithm {name!r}: {error}") from error
    started = time.perf_counter()
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(hold_interrupt()) if stop is None else stop
        going_on, startup_seconds = True, 0.0
        while going_on:  # once at least, so that something is found however soon it is stopped
            try:
                algorithm.next()
            except TooLargeError as error:
                raise RefusalError(f"Algorithm {name!r}: {error}") from error
            startup_seconds = startup_seconds or time.perf_counter() - started
            going_on = algorithm.has_next() and not stop.is_set()
            if progress is not None:
                found = partial(_area, algorithm, mission)
                progress(algorithm.evaluator.n_eval, found)
    seconds = time.perf_counter() - started
    objectives, plans = _front(algorithm)
    return Solution(
        mission=mission,
        plans=plans,
        objectives=objectives,
        algorithm=name,
        parameters=dict(parameters or {}),
        seed=seed,
        min_survival=problem.min_survival,
        evaluations=algorithm.evaluator.n_eval,
        seconds=seconds,
        interrupted=algorithm.has_next(),
        startup_seconds=startup_seconds,
        source=dict(source or {}),
    )


def _area(algorithm: Algorithm, mission: Mission) -> float:
    return area_indicator(_front(algorithm)[0], mission)


def _front(algorithm: Algorithm) -> tuple[FloatArray, tuple[TrailPlan, ...]]:
    """Give what an algorithm has found: feasible and non-dominated, by descending reward."""
    opt = algorithm.opt
    if opt is None or not len(opt) or not opt.get("feas").any():
        return np.empty((0, 2)), ()
    opt = opt[opt.get("feas")]
    objectives = np.asarray(-opt.get("F"), np.float64)
    kept = moocore.is_nondominated(objectives, maximise=True, keep_weakly=True)
    opt, objectives = opt[kept], objectives[kept]
    order = np.lexsort((objectives[:, 1], -objectives[:, 0]))
    return objectives[order], tuple(opt[int(i)].X[0] for i in order)
