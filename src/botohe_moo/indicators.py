"""Quality of a front as one number: area, IGD+ and additive epsilon."""

import inspect
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeAlias

import moocore
import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.base.messages import as_float, quoted
from botohe_moo.base.registry import Registry, is_path
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission
from botohe_moo.objectives import Objectives

__all__ = [
    "INDICATORS",
    "Indicator",
    "area_indicator",
    "epsilon_indicator",
    "igd_plus_indicator",
    "largest_objectives",
]

# Indicators that differ by less are equal: such differences come from the order of sums.
TIE = 1e-12
_ROUNDING = 1e-9

Scale: TypeAlias = Mission | Objectives
"""What says what objectives are at most: a mission, or ``objectives`` of a problem."""


def area_indicator(objectives: ArrayLike, mission: Scale) -> float:
    """Compute the share of the objective space that a front dominates, in [0, 1].

    The hypervolume with the origin as reference, divided by (total reward × robots), by which areas
    compare across runs and studies. 0 if there are no plans, or the mission has no reward.

    Parameters
    ----------
    objectives
        Shape (n, 2): E[R] and E[S] of each plan (``-result.F``); dominated plans add nothing.
    mission
        The mission of the plans. For a problem with other objectives, ``problem.objectives``; the
        points then have a column for each of them.

    Raises
    ------
    ValueError
        If ``objectives`` is not of shape (n, 2), holds NaN or infinity, is ``result.F``, which
        holds the negatives, or is above what there is on the mission: it is of another one. A point
        below 0, also of minus infinity, dominates nothing.

    Notes
    -----
    The area indicator of Simon, Richley, Overbey and Perez-Lavin, normalised; hypervolume by
    moocore (Fonseca, Paquete and López-Ibáñez, "An improved dimension-sweep algorithm for the
    hypervolume indicator", CEC 2006).

    Examples
    --------
    >>> from botohe_moo import area_indicator, load_mission
    >>> toy = load_mission("toy")  # a total reward of 10, and 2 robots
    >>> area_indicator([[5, 1], [2, 2]], toy)  # (5 · 1 + 2 · 1) / (10 · 2)
    0.35
    """
    stated = _objectives_of(mission)
    values, whole = stated.check("objectives", objectives), math.prod(stated.bounds)
    if whole == 0 or len(values) == 0:
        return 0.0
    area = float(moocore.hypervolume(values, ref=[0.0] * len(stated), maximise=True)) / whole
    # E[R] and the total reward are sums in different orders: the whole can be 1 + 4e-16.
    return 1.0 if 1.0 < area < 1.0 + _ROUNDING else area


def igd_plus_indicator(objectives: ArrayLike, reference: ArrayLike, mission: Scale) -> float:
    """Compute the IGD+ of a front: how far it is from a reference front on average.

    For each point of the reference, the distance to the nearest plan, of which only what the plan
    lacks counts; E[R] is divided by the total reward before and E[S] by the number of robots. 0 if
    every point is matched or exceeded.

    Parameters
    ----------
    objectives
        Shape (n, 2): E[R] and E[S] of each plan (``-result.F``). Without plans, (0, 0) is scored.
    reference
        Shape (m, 2): the points of the reference front, at least one.
    mission
        As for :func:`area_indicator`.

    Raises
    ------
    ValueError
        As for :func:`area_indicator`, if there is an infinity of either sign, and if ``reference``
        is empty.

    Notes
    -----
    Ishibuchi, Masuda, Tanigaki and Nojima, "Modified distance calculation in generational distance
    and inverted generational distance", EMO 2015; computed by moocore.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.indicators import igd_plus_indicator
    >>> toy = load_mission("toy")  # a total reward of 10, and 2 robots
    >>> igd_plus_indicator([[5, 1]], [[5, 1], [5, 2]], toy)  # no distance, and half of the robots
    0.25
    """
    points, targets = _normalised(objectives, reference, mission)
    return float(moocore.igd_plus(points, ref=targets, maximise=True))


def epsilon_indicator(objectives: ArrayLike, reference: ArrayLike, mission: Scale) -> float:
    """Compute the additive epsilon of a front with respect to a reference front.

    The smallest number that, added to both normalised objectives of all plans, lets some plan match
    each point of the reference; below 0 if the front is ahead of all of it. Both are normalised as
    for :func:`igd_plus_indicator`.

    Parameters
    ----------
    objectives, reference, mission
        As for :func:`igd_plus_indicator`.

    Raises
    ------
    ValueError
        As for :func:`igd_plus_indicator`.

    Notes
    -----
    Zitzler, Thiele, Laumanns, Fonseca and Grunert da Fonseca, "Performance assessment of
    multiobjective optimizers: an analysis and review", IEEE Transactions on Evolutionary
    Computation 7(2), 2003; computed by moocore.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.indicators import epsilon_indicator
    >>> toy = load_mission("toy")  # a total reward of 10, and 2 robots
    >>> epsilon_indicator([[5, 1]], [[5, 1], [5, 2]], toy)
    0.5
    """
    points, targets = _normalised(objectives, reference, mission)
    return float(moocore.epsilon_additive(points, ref=targets, maximise=True))


@dataclass(frozen=True)
class Indicator:
    """An indicator as studies use it: their tables, reports and files follow from it.

    Packages register instances in the entry-point group ``botohe_moo.indicators``, and a study file
    may name one as ``module:NAME``.

    Parameters
    ----------
    label
        Its name in reports.
    function
        Takes points (n, 2), the non-dominated E[R] and E[S] of a run or none, the mission, and
        between them, if it needs one, the reference front (m, 2). It gives a finite number, without
        points that of the single plan that brings nothing back, (0, 0). In a study of another
        problem, points are of its objectives, and it gets its ``objectives`` for the mission.
    higher_is_better
        None: it describes a front and does not judge it.
    needs_reference
        Whether ``function`` takes a reference front.
    long_label
        Its name beside axes and in descriptions of columns; default: the label.

    Examples
    --------
    >>> import numpy as np
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.indicators import Indicator, largest_objectives
    >>> def most_reward(points, mission):
    ...     return float(points[:, 0].max(initial=0.0)) / largest_objectives(mission)[0]
    >>> best = Indicator("most reward", most_reward, higher_is_better=True)
    >>> best(np.array([[5.0, 1.0], [2.0, 2.0]]), None, load_mission("toy"))
    0.5
    """

    label: str
    function: Callable[..., float]
    higher_is_better: bool | None
    needs_reference: bool = False
    long_label: str = ""

    @property
    def is_loaded(self) -> bool:
        """Whether it can be computed; False where only a folder of results describes it."""
        return self.function is not _not_loaded

    @property
    def in_words(self) -> str:
        """The long label, or else the label."""
        return self.long_label or self.label

    @property
    def is_distance(self) -> bool:
        """Whether it measures how far a front is from the reference: less is better."""
        return self.needs_reference and self.higher_is_better is False

    def __call__(self, points: FloatArray, reference: FloatArray | None, mission: Scale) -> float:
        """Compute it for the points of a front; a ValueError if it gives no finite number."""
        given = (points, reference, mission) if self.needs_reference else (points, mission)
        try:
            value = self.function(*given)
            value = value.item() if hasattr(value, "item") else value
        except (Exception, SystemExit) as error:  # whatever another package's code may raise
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise ValueError(f"Indicator {self.label!r}: {said}") from error
        number = as_float(value)
        if not math.isfinite(number):
            expected = f"expected a finite number, got {quoted(value)}"
            raise ValueError(f"Indicator {self.label!r}: {expected}.")
        return number


class _Indicators(Registry):
    """The indicators that a study file may name, in the order of tables.

    ``module:NAME`` names one of a module, which only `load` imports. Folders of results name such
    indicators, too, and code that a folder names is not run.
    """

    def find(self, name: str, makes: type | None = None) -> Any:
        """Return the indicator of a name, or a stand-in for one of a module that is not loaded."""
        if is_path(name) and name not in self:
            return _KNOWN.get(name) or Indicator(name, _not_loaded, higher_is_better=None)
        return self._imported(name, makes)

    def load(self, name: str) -> None:
        """Import the module of an indicator that is named ``module:NAME``."""
        _KNOWN[name] = self._imported(name)

    def describe(self, name: str, **known: Any) -> None:
        """Keep what tables say of an indicator that is named ``module:NAME``."""
        if not self.find(name).is_loaded:
            _KNOWN[name] = Indicator(**{**known, "function": _not_loaded})

    def _imported(self, name: str, makes: type | None = None) -> Any:
        """Import what a name stands for; a function of a front and a mission describes fronts."""
        found = super().find(name, makes)
        if not isinstance(found, Indicator):
            needs_reference = "reference" in inspect.signature(found).parameters
            found = Indicator(found.__name__, found, None, needs_reference)
        return found


def _not_loaded(*_: Any) -> float:
    raise ValueError("code that a folder of results names is not run; `study run FILE` runs it")


_KNOWN: dict[str, Indicator] = {}  # those of modules
_DISTANCE: Any = {"higher_is_better": False, "needs_reference": True}
_OURS = {
    "area": Indicator(
        "area", area_indicator, higher_is_better=True, long_label="area (normalised hypervolume)"
    ),
    "igd_plus": Indicator("IGD+", igd_plus_indicator, **_DISTANCE),
    "epsilon": Indicator("epsilon", epsilon_indicator, **_DISTANCE, long_label="additive epsilon"),
    "front_size": Indicator("front size", lambda points, _: float(len(points)), None),
}
INDICATORS = _Indicators("botohe_moo.indicators", "indicator", own=_OURS)


def further_indicators(named: Iterable[str] = ()) -> tuple[str, ...]:
    """Return all but the area and the size of the front, which are in every table anyway.

    These are the registered ones, and those among ``named`` that are ``module:NAME``.
    """
    names = dict.fromkeys([*INDICATORS, *filter(is_path, named)])
    return tuple(name for name in names if name not in ("area", "front_size"))


def largest_objectives(scale: Scale) -> tuple[float, ...]:
    """Return what the objectives are at most, each at least 0.

    Parameters
    ----------
    scale
        A mission, or the ``objectives`` of a problem. A TypeError is raised for anything else.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.indicators import largest_objectives
    >>> largest_objectives(load_mission("toy"))
    (10.0, 2.0)
    """
    return _objectives_of(scale).bounds


def _objectives_of(scale: Scale) -> Objectives:
    return scale if isinstance(scale, Objectives) else Objectives.of(scale)


def _normalised(objectives: ArrayLike, reference: ArrayLike, scale: Scale) -> list[FloatArray]:
    """Divide objectives by what they are at most; by 0 gives 0."""
    stated, normalised = _objectives_of(scale), []
    most = np.array(stated.bounds)
    for name, given in (("objectives", objectives), ("reference", reference)):
        values = stated.check(name, given)
        if not np.isfinite(values).all():
            found = values[~np.isfinite(values).all(axis=1)][0].tolist()
            raise ValueError(f"Expected {name} without NaN and infinity, got {found}.")
        if not len(values):
            if name == "reference":
                raise ValueError("Expected at least one point in reference, got none.")
            values = np.zeros((1, len(stated)))  # moocore scores an empty set as perfect
        normalised.append(values / np.where(most > 0, most, np.inf))
    return normalised
