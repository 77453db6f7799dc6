"""Bounding the front of one mission: from a task to a bound."""

import functools
import math
import traceback

from botohe_moo.mission.library import load_mission
from botohe_moo.search.bounds import FrontBound, bound_front
from botohe_moo.study.run.perform import WARM_UP_LENGTH, WARM_UP_SURVIVAL
from botohe_moo.study.run.task import BoundTask

# Small missions: one that gets its true front, and one that does not.
_WARM_UP_MISSIONS = ("toy", "power_plant")
_WARM_UP_SECONDS = 600.0  # kernels may have to be compiled
_WARM_UP_GAP = 0.5  # which is soon reached


def find_bound(task: BoundTask) -> FrontBound | str:
    """Bound the front of a mission; an exception becomes a line that says what it was."""
    try:
        return bound_front(
            task.mission,
            front=task.front,
            time_limit=task.seconds,
            min_survival=task.min_survival,
            max_length=task.max_length,
        )
    except Exception as error:
        return " ".join("".join(traceback.format_exception_only(error)).split())


@functools.cache
def warm_up_bounds(*, floor: bool, budget: bool) -> None:
    """Compile, or load from the cache, the kernels that a bound needs, so that it is not timed.

    A limit, however loose, has kernels of its own: a survival floor, and a travel budget.
    """
    for name in _WARM_UP_MISSIONS:
        bound_front(
            load_mission(name),
            time_limit=_WARM_UP_SECONDS,
            gap=_WARM_UP_GAP,
            min_survival=WARM_UP_SURVIVAL if floor else 0.0,
            max_length=WARM_UP_LENGTH if budget else math.inf,
        )
