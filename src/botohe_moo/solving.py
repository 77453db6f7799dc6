"""From a mission and an algorithm to a front, in one call."""

import os
import signal
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from typing import Any

import moocore
import numpy as np
from pymoo.core.algorithm import Algorithm

from botohe_moo.algorithms.base import MOST_THREADS
from botohe_moo.algorithms.registry import algorithm_parameters, make_algorithm
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import check
from botohe_moo.base.runtime import hold_signals, n_cpus
from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.loading import load_mission
from botohe_moo.mission.model import Mission
from botohe_moo.problem import BOTOHE, find_problem, problem_path
from botohe_moo.solution import Solution
from botohe_moo.trails import TrailPlan

__all__ = ["RefusalError", "solve"]

N_ISLANDS = 8  # of a search that nobody has told how many

Progress = Callable[[int, Callable[[], float]], None]
"""Takes the evaluations so far, and a function that computes the area of what was found."""


class RefusalError(ValueError):
    """The algorithm cannot search this mission; says why.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.solving import RefusalError
    >>> try:
    ...     solve("toy", "exact", evaluations=10, problem="least-survival")
    ... except RefusalError as error:
    ...     print(str(error)[:32])
    Algorithm 'exact': LeastSurvival
    """


def solve(
    mission: Mission | str | os.PathLike[str],
    algorithm: str | Algorithm = "pareto-local-search",
    *,
    evaluations: int = 100_000,
    seed: int = 1,
    min_survival: float = 0.0,
    max_length: float | None = None,
    problem: str | type[BOTOHE] = BOTOHE,
    n_islands: int | None = None,
    n_threads: int | None = None,
    progress: Progress | None = None,
    stop: threading.Event | None = None,
    **parameters: Any,
) -> Solution:
    """Search for the Pareto front of a mission until the budget is spent, or Ctrl-C is pressed.

    The solution has the plans found, also if the search was stopped.

    Parameters
    ----------
    mission
        A mission, or what :func:`load_mission` makes one from: a name or the path of a file.
    algorithm
        Name of an algorithm, as for :func:`make_algorithm`, or a pymoo algorithm for
        :class:`BOTOHE` that has not run yet; ``evaluations`` and ``seed`` take the place of its
        own termination and seed.
    evaluations
        Budget: trail plans to evaluate, at least 1.
    seed
        Seed of all random numbers, at least 0.
    min_survival
        Survival floor: every robot survives with at least this probability, in [0, 1].
    max_length
        Travel budget: how long every robot's trail may be, at least 0. Default: the mission's own
        (``mission.max_length``), if it has one; ``math.inf`` for none.
    problem
        The problem to solve: a class derived from :class:`BOTOHE` that states its ``objectives``,
        its registered name, or ``module:Class``.
    n_islands
        Searches that go on side by side once that pays. Default: 8, where the algorithm has them.
        The result depends on it.
    n_threads
        Threads. Default: as many as there are processors for this process, for algorithms that have
        threads. The result does not depend on it.
    progress
        Called after each iteration with the evaluations so far, and a function that computes the
        area of the front so far.
    stop
        An event that ends the search after the current iteration; default: one that Ctrl-C sets,
        also where a handler of the application's own would have handled it.
    **parameters
        Parameters of the algorithm, if it is given by its name.

    Raises
    ------
    TypeError
        If ``algorithm`` is of another type.
    MissionError
        If there is no such mission, or it is not valid.
    ValueError
        If an argument is out of its range, the algorithm or a parameter is unknown, or the
        algorithm has run before or cannot search this mission.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> solution = solve("toy", "greedy", evaluations=100)
    >>> solution.table.round(2).tail(2)
       plan_id  reward  survivors
    2        2    4.14       1.66
    3        3    0.00       2.00
    >>> solution.mission.labels(solution.plans[3])
    ((1,), (1,))
    """
    evaluations = check("evaluations", evaluations, int, ge=1)
    seed = check("seed", seed, int, ge=0)
    source: dict[str, Any] = {}
    if not isinstance(algorithm, str | Algorithm):
        expected = "algorithm: expected a name, or an algorithm of pymoo's such as BOACO()"
        raise TypeError(f"{expected}, got {quoted(algorithm)}.")
    if not isinstance(mission, Mission):
        path, mission = mission, load_mission(mission)
        source = {"name_or_path": os.fspath(path)}
    kind, name = find_problem(problem), type(algorithm).__name__
    searched = kind(mission, min_survival=min_survival, max_length=max_length)
    given = {"n_islands": n_islands, "n_threads": n_threads}
    parameters |= {key: value for key, value in given.items() if value is not None}
    if isinstance(algorithm, str):
        name, (algorithm, parameters) = algorithm, make_for_this_machine(algorithm, parameters)
    elif parameters:
        expected = "parameters only for an algorithm that is given by its name"
        raise ValueError(f"Expected {expected}, got {', '.join(parameters)} for {name}.")
    started = time.perf_counter()
    if algorithm.is_initialized:
        raise ValueError(f"Expected an algorithm that has not run yet, got {name!r} after a run.")
    try:
        algorithm.setup(searched, termination=("n_eval", evaluations), seed=seed)
    except (AssertionError, TypeError, ValueError) as error:  # pymoo asserts what it demands
        raise RefusalError(f"Algorithm {name!r}: {error}") from error

    def area() -> float:
        return area_indicator(_front(algorithm)[0], searched.objectives)

    with hold_signals(signal.SIGINT, handled=True) if stop is None else nullcontext(stop) as stop:
        going_on = True
        while going_on:  # at least once, so that something is found however soon it is stopped
            algorithm.next()
            going_on = algorithm.has_next() and not stop.is_set()
            if progress is not None:
                progress(algorithm.evaluator.n_eval, area)
    seconds = time.perf_counter() - started
    objectives, plans = _front(algorithm)
    return Solution(
        mission=mission,
        plans=plans,
        objectives=objectives,
        algorithm=name,
        parameters=parameters,
        seed=seed,
        source=source,
        min_survival=searched.min_survival,
        max_length=searched.max_length,
        evaluations=algorithm.evaluator.n_eval,
        seconds=seconds,
        interrupted=algorithm.has_next(),
        moves=getattr(algorithm, "move_counts", {}),
        problem=None if kind is BOTOHE else problem_path(kind),
        problem_objectives=searched.objectives,
    )


def make_for_this_machine(
    name: str, parameters: Mapping[str, Any]
) -> tuple[Algorithm, dict[str, Any]]:
    """Make an algorithm that uses all processors that this process may use.

    Returns it with its parameters: those given and, if it has islands, their number. The number of
    threads is added to these only if it was given, since results do not depend on it.
    """
    known = {parameter.name for parameter in algorithm_parameters(name)}
    stated = {"n_islands": N_ISLANDS, **parameters} if "n_islands" in known else dict(parameters)
    threads = {"n_threads": min(n_cpus(), MOST_THREADS)} if "n_threads" in known else {}
    return make_algorithm(name, **{**threads, **stated}), stated


def _front(algorithm: Algorithm) -> tuple[FloatArray, tuple[TrailPlan, ...]]:
    """Return the feasible, non-dominated plans an algorithm has found, by descending reward."""
    opt = algorithm.opt
    if opt is None or not len(opt) or not opt.get("feas").any():
        return np.empty((0, algorithm.problem.n_obj)), ()
    opt = opt[opt.get("feas")]
    objectives = np.asarray(-opt.get("F"), np.float64)
    kept = moocore.is_nondominated(objectives, maximise=True, keep_weakly=True)
    opt, objectives = opt[kept], objectives[kept]
    order = np.lexsort(-objectives.T[::-1])
    return objectives[order], tuple(opt[int(i)].X[0] for i in order)
