"""A bound on a front: what no plan whatsoever exceeds."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo._base.checks import quoted
from botohe_moo._base.files import replace_file
from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import area_indicator, check_objectives
from botohe_moo.mission.model import Mission, check_mission, numbers_digest
from botohe_moo.search.bounds.envelopes import area_under_highest, lower_envelope
from botohe_moo.search.bounds.record import FORMAT, Line, Record, Step, read_record

# By how much survivors are taken to be fewer than given, relative: they are sums of products.
_ROUNDING = 1e-12
_TIE = 1e-9  # plans this little above, relative, are on the bound: sums in other orders
_N_POINTS = 1_000
_MOST_BOUNDS = 1_000_000  # that are computed at once, for an area
# What a file says may be as large as numbers are; infinite ones bound nothing, or bound all.
_OVERFLOW = np.errstate(over="ignore")
_PLAIN = ("lines", "steps", "most_survival", "min_survival", "seconds", "notes")


class _Proved(NamedTuple):
    """Lines, where steps begin by ascending survivors, and the bound before each and after."""

    most: FloatArray
    mu: FloatArray
    least: FloatArray
    capped: FloatArray


@dataclass(frozen=True, kw_only=True, repr=False)
class FrontBound:
    """For each E[S], an E[R] that no plan of a mission exceeds; see :func:`bound_front`.

    Plans are bounded separately for each number of robots that move. Where j do, the others stay
    at base and survive, and E[R] lies on or below all lines and steps for j. The bound is the
    largest of these over all j.

    Attributes
    ----------
    mission
        The mission that is bounded.
    lines, steps
        What was proved, each with its ``n_robots`` that move and its ``proof``. A line says that
        E[R] ≤ ``most`` − ``mu`` · x where their survivals sum to x or more, a step that
        E[R] ≤ ``most`` where they sum to ``least`` or more.
    most_survival
        What a robot that moves survives with at most.
    min_survival, max_length
        The limits that plans keep: survival floor, and travel budget (inf for none).
    seconds
        How long it was computed.
    notes
        What makes it weaker than it might be, in words.

    Examples
    --------
    >>> from botohe_moo import FrontBound, bound_front, load_mission
    >>> bound = bound_front(load_mission("toy"))  # so small that it gets its true front
    >>> round(bound.bound(1.5), 2)  # no plan with 1.5 expected survivors has more reward
    4.14
    >>> bound.save("bound.json")
    >>> FrontBound.load("bound.json", load_mission("toy")) == bound
    True
    """

    mission: Mission = field(repr=False)
    lines: tuple[Line, ...] = field(repr=False)
    steps: tuple[Step, ...] = field(repr=False)
    most_survival: float
    min_survival: float
    max_length: float
    seconds: float
    notes: tuple[str, ...] = ()

    def bound(self, survivors: ArrayLike) -> Any:
        """Return the E[R] that no plan exceeds with this E[S] or more.

        It is −inf where no plan has such an E[S].

        Parameters
        ----------
        survivors
            E[S]: a number, which gives a float, or an array, which gives one of its shape.

        Raises
        ------
        ValueError
            If there is a NaN, or something else than numbers.
        """
        given = _without_nan(survivors)
        bounds = np.full(given.shape, -np.inf)
        for moving in range(self.mission.robots + 1):
            np.maximum(bounds, self._bound_where(moving, given), out=bounds)
        return float(bounds) if given.ndim == 0 else bounds

    def by_robots(self, survivors: ArrayLike) -> FloatArray:
        """Bound E[R] of plans in which 0, 1, ... all robots move.

        Parameters
        ----------
        survivors
            E[S], of any shape, which follows the number of robots in the shape of what is given.

        Raises
        ------
        ValueError
            If there is a NaN, or something else than numbers.
        """
        given = _without_nan(survivors)
        return np.stack([self._bound_where(n, given) for n in range(self.mission.robots + 1)])

    @_OVERFLOW
    def _bound_where(self, moving: int, survivors: FloatArray) -> FloatArray:
        """Bound E[R] of plans in which a number of robots move."""
        n_robots, graph = self.mission.robots, self.mission.arrays
        bounds = np.full(survivors.shape, -np.inf)
        wanted = survivors * (1.0 - _ROUNDING)
        if moving == 0:
            bounds[wanted <= n_robots] = graph.reward[graph.base]
            return bounds
        floor = moving * self.min_survival * (1.0 - _ROUNDING)
        x = np.maximum(wanted - (n_robots - moving), floor)
        possible = x <= moving * self.most_survival * (1.0 + _ROUNDING)
        proved = self._proved[moving]
        x = x[possible]
        bound = (proved.most[:, None] - np.multiply.outer(proved.mu, x)).min(axis=0)
        capped = proved.capped[np.searchsorted(proved.least, x, "right")]
        bounds[possible] = np.minimum(bound, capped)
        return bounds

    @cached_property
    def _proved(self) -> list[_Proved]:
        """What is proved for each number of robots that move."""
        n_robots = self.mission.robots
        lines = [list[tuple[float, float]]() for _ in range(n_robots + 1)]
        steps = [list[tuple[float, float]]() for _ in range(n_robots + 1)]
        for line in self.lines:
            lines[line.n_robots].append((line.most, line.mu))
        for step in self.steps:
            steps[step.n_robots].append((step.least, step.most))
        found = []
        for own, stairs in zip(lines, steps, strict=True):
            least, height = np.array(sorted(stairs)).reshape(-1, 2).T
            capped = np.append(np.inf, np.minimum.accumulate(height))
            most, mu = np.array(own).reshape(-1, 2).T
            found.append(_Proved(most, mu, least, capped))
        return found

    @_OVERFLOW
    def _corners(self) -> FloatArray:
        """Return each E[S] where a bound for some number of robots may jump or bend, ascending."""
        n_robots = self.mission.robots
        found = [0.0, float(n_robots)]
        for moving in range(1, n_robots + 1):
            proved = self._proved[moving]
            order = lower_envelope(proved.most, proved.mu)
            bends = np.diff(proved.most[order]) / np.diff(proved.mu[order])
            ends = np.array(
                [self.min_survival * (1 - _ROUNDING), self.most_survival * (1 + _ROUNDING)]
            )
            ends *= moving
            x = np.concatenate([[0.0], bends, ends, proved.least])
            found += ((n_robots - moving + x) / (1.0 - _ROUNDING)).tolist()
        corners = np.unique(found)
        inside: FloatArray = corners[(corners >= 0.0) & (corners <= n_robots)]
        return inside

    @property
    def points(self) -> FloatArray:
        """E[R] and E[S] of a staircase (n, 2), by ascending E[S].

        Every plan is weakly dominated by one of the points.
        """
        grid = np.linspace(0.0, self.mission.robots, _N_POINTS)
        survivors = np.unique(np.append(grid, self._corners()))
        # What has more survivors than one point is bounded by the next.
        before = np.append(0.0, np.nextafter(survivors[:-1], np.inf))
        found = np.column_stack([self.bound(before), survivors])
        found = found[np.isfinite(found[:, 0])]
        last: FloatArray = found[np.append(np.diff(found[:, 0]) < 0.0, True)]
        return last

    @property
    def area(self) -> float:
        """The share of the objective space below the bound, in [0, 1]; no front's area is larger.

        Normalised as :func:`area_indicator` is.
        """
        whole = self.mission.total_reward * self.mission.robots
        if whole == 0.0:
            return 0.0
        corners = self._corners()
        n_at_once = max(1, _MOST_BOUNDS // (self.mission.robots + 1))
        firsts = range(0, len(corners) - 1, n_at_once)
        area = sum(self._area_between(corners[i : i + n_at_once + 1]) for i in firsts)
        return float(min(1.0, area / whole))

    def _area_between(self, corners: FloatArray) -> float:
        """Integrate the bound: between two corners each number of robots has a straight line."""
        width = np.diff(corners)
        low, high = (self.by_robots(corners[:-1] + share * width) for share in (0.25, 0.75))
        with np.errstate(invalid="ignore"):
            rise = np.where(np.isfinite(low) & np.isfinite(high), high - low, 0.0)
        area = 0.0
        for heights, rises, wide in zip((low - rise / 2).T, rise.T * 2, width, strict=True):
            area += wide * area_under_highest(heights, rises)
        return area

    def gap(self, front: ArrayLike) -> float:
        """Return the largest share of its area by which a front can be improved.

        inf if its area is 0 and the bound's is not.

        Parameters
        ----------
        front
            E[R] and E[S] of its plans (n, 2): ``-result.F``.

        Raises
        ------
        ValueError
            Like :func:`area_indicator`, and if a plan lies above the bound: then the front is of
            another mission, or its plans do not keep the limits.
        """
        self.check("front", front)
        area = area_indicator(front, self.mission)
        if area == 0.0:
            return 0.0 if self.area == 0.0 else float("inf")
        return max(0.0, self.area / area - 1.0)

    def __repr__(self) -> str:
        return f"<FrontBound of {self.mission.name!r}: area at most {self.area:.4g}>"

    def check(self, name: str, front: ArrayLike) -> None:
        """Refuse a front that has a plan above the bound.

        Parameters
        ----------
        name
            Of the front, for the message.
        front
            E[R] and E[S] of its plans (n, 2).

        Raises
        ------
        ValueError
            If there is such a plan, or ``front`` is not of that shape.
        """
        points = check_objectives(name, front)
        most = self.bound(points[:, 1] * (1.0 - _TIE)) * (1.0 + _TIE)
        above = np.flatnonzero(points[:, 0] > most)
        if len(above):
            reward, survivors = points[above[0]].tolist()
            limit = most[above[0]]
            found = f"at most {limit:.6g} expected reward" if limit > -np.inf else "no plan"
            raise ValueError(
                f"{name}: row {above[0]} has {reward:.6g} expected reward with {survivors:.6g} "
                f"expected survivors, where the bound of {self.mission.name!r} has {found}. It is "
                "of another mission, or does not keep the limits."
            )

    def save(self, path: str | Path) -> None:
        """Write the bound as JSON, without its mission.

        Parameters
        ----------
        path
            The file, which is replaced if there is one.

        Raises
        ------
        OSError
            If the file cannot be written.
        """
        record = Record(
            format=FORMAT,
            mission_digest=numbers_digest(self.mission),
            max_length=None if self.max_length == np.inf else self.max_length,
            **{name: getattr(self, name) for name in _PLAIN},
        )
        replace_file(Path(path), record.model_dump_json(indent=1).encode())

    @classmethod
    def load(cls, path: str | Path, mission: Mission) -> FrontBound:
        """Read what :meth:`save` has written.

        Parameters
        ----------
        path
            The file.
        mission
            The mission that is bounded.

        Raises
        ------
        OSError
            If the file cannot be read.
        TypeError
            If ``mission`` is not a Mission.
        ValueError
            If it is not such a file, or bounds another mission.
        """
        check_mission(mission)
        record = read_record(Path(path), mission)
        return cls(
            mission=mission,
            max_length=np.inf if record.max_length is None else record.max_length,
            **{name: getattr(record, name) for name in _PLAIN},
        )


def _without_nan(survivors: ArrayLike) -> FloatArray:
    try:
        given = np.asarray(survivors, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"Expected survivors as numbers, got {quoted(survivors)}.") from None
    if np.isnan(given).any():
        raise ValueError(f"Expected survivors without NaN, got {quoted(survivors)}.")
    return given
