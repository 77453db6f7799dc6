"""The code that a study names: problems of your own, and whether a worker has the same."""

import functools
import math
from collections.abc import Iterable, Mapping
from pkgutil import resolve_name
from typing import Any

import numpy as np

from botohe_moo.algorithms.registry import make_algorithm
from botohe_moo.base.messages import quoted
from botohe_moo.base.registry import imported
from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import largest_objectives
from botohe_moo.problem import BOTOHE
from botohe_moo.study.file.model import PACKAGES, StudyAlgorithm, StudyMission, installed_versions
from botohe_moo.study.file.origin import algorithm_origin

_ROUNDING = 1e-9


def find_problem(path: str | None) -> type[BOTOHE]:
    """Import the class of a problem, BOTOHE for None; a ValueError says why it cannot be used.

    Importing its module runs it.
    """
    if path is None:
        return BOTOHE
    found: Any = imported(functools.partial(resolve_name, path), "it")
    if not (isinstance(found, type) and issubclass(found, BOTOHE)):
        raise ValueError(f"expected a class derived from BOTOHE, got {quoted(found)}")
    if found._evaluate is not BOTOHE._evaluate:
        raise ValueError(
            f"{found.__name__} overrides _evaluate, which studies do not call: override "
            "evaluate_batch"
        )
    overrides = found.evaluate_batch is not BOTOHE.evaluate_batch
    if overrides and found.objective_bounds is BOTOHE.objective_bounds:
        raise ValueError(
            f"{found.__name__} overrides evaluate_batch, and does not state objective_bounds: "
            "areas are shares of what both objectives are at most"
        )
    return found


def problem_on(mission: StudyMission, path: str | None) -> BOTOHE:
    """Make the problem of a class, or BOTOHE, on a mission with its limits."""
    limit = math.inf if mission.max_length is None else mission.max_length
    kind = find_problem(path)
    return kind(mission.mission, min_survival=mission.min_survival, max_length=limit)


def stated_bounds(mission: StudyMission, path: str) -> tuple[float, float]:
    """Return upper bounds of a problem's two objectives; a ValueError says what is wrong."""
    try:
        problem = problem_on(mission, path)
    except (Exception, SystemExit) as error:  # whatever another package's code may raise
        raise ValueError(f"it cannot be made ({type(error).__name__}: {error})") from error
    if problem.n_obj != 2:
        raise ValueError(f"expected two objectives, got n_obj = {problem.n_obj}")
    try:
        given: Any = problem.objective_bounds  # perhaps a list
        return largest_objectives(tuple(given))
    except Exception as error:
        what = f"objective_bounds of {type(problem).__name__}"
        said = str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
        raise ValueError(f"{what}: {said}".rstrip(".")) from error


def refusal(problem: BOTOHE, algorithm: str, parameters: dict[str, Any]) -> str | None:
    """Return why an algorithm refuses a problem, in the words of ``minimize``; None if not."""
    try:
        made = make_algorithm(algorithm, **parameters)
        made.setup(problem, termination=("n_eval", 1), seed=1)
    except TypeError as error:
        return str(error)
    except (Exception, SystemExit):  # not a refusal: its runs will fail, and say why
        pass
    return None


def check_objectives(problem: BOTOHE, points: FloatArray) -> None:
    """Raise a ValueError if points (n, 2) are outside the bounds that a problem states."""
    most = np.array(problem.objective_bounds)
    outside = points[~((points >= 0) & (points <= most * (1 + _ROUNDING))).all(axis=1)]
    if len(outside):
        kind = type(problem)
        raise ValueError(
            f"{kind.__module__}:{kind.__qualname__} says by objective_bounds that −F is in "
            f"[0, {most[0]:g}] and [0, {most[1]:g}], and gives {outside[0].tolist()}"
        )


def code_mismatch(versions: Mapping[str, str], algorithms: Iterable[StudyAlgorithm]) -> str | None:
    """Return how this process's code differs from that of a study; None if it is the same.

    ``versions`` and ``algorithms`` are those of the study. The text continues a sentence about the
    worker.
    """
    ours = installed_versions()
    differing = [name for name in versions if versions[name] != ours[name]]
    if differing:
        installed = " and ".join(f"{PACKAGES[name]} {ours[name]}" for name in differing)
        return f"has {installed}, the study {' and '.join(versions[name] for name in differing)}"
    for algorithm in algorithms:
        name, problem = algorithm.algorithm, algorithm.origin.get("problem")
        try:
            found = algorithm_origin(name, algorithm.parameters, problem)
        except Exception as error:
            also = f" or the problem {problem!r}" if problem else ""
            return f"cannot import the algorithm {name!r}{also}: {str(error).rstrip('.')}"
        if found != algorithm.origin:
            return f"has {name!r} from {found}, the study from {algorithm.origin}"
    return None
