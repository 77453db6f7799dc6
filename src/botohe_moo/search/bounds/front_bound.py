"""A bound on a front: what no plan whatsoever exceeds."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from botohe_moo._base.files import read_bytes, replace_file
from botohe_moo._base.types import FloatArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.digest import numbers_digest
from botohe_moo.mission.model import Mission
from botohe_moo.search.bounds.envelopes import area_under_highest, lower_envelope

# By how much survivors are taken to be fewer than given, relative: they are sums of products.
_ROUNDING = 1e-12
_N_POINTS = 1_000
# What a file says may be as large as numbers are; infinite ones bound nothing, or bound all.
_OVERFLOW = np.errstate(over="ignore")
_FORMAT: Literal["botohe-front-bound-1"] = "botohe-front-bound-1"


class Line(NamedTuple):
    """E[R] ≤ most − mu · x, where so many robots move whose survivals sum to x or more.

    Attributes
    ----------
    n_robots
        How many robots move, 1 or more.
    most, mu
        Where the line begins, and by how much it falls for each robot that survives.
    proof
        ``"everything"`` (each node is reached along the safest way), ``"relaxed"`` (no relaxed
        trail is worth more than the line says) or ``"exact"`` (no trail is).
    """

    n_robots: int
    most: FiniteFloat
    mu: FiniteFloat
    proof: str


class Step(NamedTuple):
    """E[R] ≤ most, where so many robots move whose survivals sum to ``least`` or more.

    Attributes
    ----------
    n_robots
        How many robots move, 1 or more.
    most, least
        The E[R] that is not exceeded, and where the step begins.
    proof
        ``"front"`` (it follows from the true front) or ``"exact"`` (no team of trails collects
        more).
    """

    n_robots: int
    most: FiniteFloat
    least: FiniteFloat
    proof: str


@dataclass(frozen=True, kw_only=True)
class FrontBound:
    """For each E[S], an E[R] that no plan of a mission exceeds; see :func:`bound_front`.

    Plans are told apart by how many of their robots move. Where j do, the others stay at base and
    survive, and E[R] lies on or below all lines and steps for j; the bound is the largest of these
    over all j.

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
        """Give the E[R] that no plan exceeds whose E[S] is so large, or larger.

        −inf where no plan has so many survivors.

        Parameters
        ----------
        survivors
            E[S]: a number, which gives a float, or an array, which gives one of its shape.

        Raises
        ------
        ValueError
            If there is a NaN.
        """
        given = np.asarray(survivors, np.float64)
        if np.isnan(given).any():
            raise ValueError(f"Expected survivors without NaN, got {given}.")
        bounds = self.by_robots(given).max(axis=0)
        return float(bounds) if given.ndim == 0 else bounds

    @_OVERFLOW
    def by_robots(self, survivors: ArrayLike) -> FloatArray:
        """Bound E[R] of plans in which 0, 1, ... all robots move.

        Parameters
        ----------
        survivors
            E[S], of any shape, which follows the number of robots in the shape of what is given.
        """
        n_robots, graph = self.mission.robots, self.mission.arrays
        given = np.asarray(survivors, np.float64)
        wanted = given.ravel() * (1.0 - _ROUNDING)
        bounds = np.full((n_robots + 1, wanted.size), -np.inf)
        bounds[0, wanted <= n_robots] = graph.reward[graph.base]
        for moving in range(1, n_robots + 1):
            floor = moving * self.min_survival * (1.0 - _ROUNDING)
            x = np.maximum(wanted - (n_robots - moving), floor)
            possible = np.flatnonzero(x <= moving * self.most_survival * (1.0 + _ROUNDING))
            x = x[possible]
            most, mu = self._lines_of(moving)
            bound = (most[:, None] - np.multiply.outer(mu, x)).min(axis=0)
            least, capped = self._steps_of(moving)
            bounds[moving, possible] = np.minimum(bound, capped[np.searchsorted(least, x, "right")])
        shaped: FloatArray = bounds.reshape(n_robots + 1, *given.shape)
        return shaped

    def _lines_of(self, moving: int) -> tuple[FloatArray, FloatArray]:
        lines = [(line.most, line.mu) for line in self.lines if line.n_robots == moving]
        most, mu = np.array(lines).reshape(-1, 2).T
        return most, mu

    def _steps_of(self, moving: int) -> tuple[FloatArray, FloatArray]:
        """Give where steps begin, ascending, and the bound before each and after the last."""
        steps = [(step.least, step.most) for step in self.steps if step.n_robots == moving]
        least, most = np.array(sorted(steps)).reshape(-1, 2).T
        return least, np.append(np.inf, np.minimum.accumulate(most))

    @_OVERFLOW
    def _corners(self) -> FloatArray:
        """Give each E[S] where the bound for some number of robots may jump or bend, ascending."""
        n_robots = self.mission.robots
        found = [0.0, float(n_robots)]
        for moving in range(1, n_robots + 1):
            most, mu = self._lines_of(moving)
            order = lower_envelope(most, mu)
            bends = np.diff(most[order]) / np.diff(mu[order])
            ends = np.array(
                [self.min_survival * (1 - _ROUNDING), self.most_survival * (1 + _ROUNDING)]
            )
            ends *= moving
            x = np.concatenate([[0.0], bends, ends, self._steps_of(moving)[0]])
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
        width = np.diff(corners)
        # Between two corners each number of robots has a straight line.
        low, high = (self.by_robots(corners[:-1] + share * width) for share in (0.25, 0.75))
        with np.errstate(invalid="ignore"):
            rise = np.where(np.isfinite(low) & np.isfinite(high), high - low, 0.0)
        area = 0.0
        for heights, rises, wide in zip((low - rise / 2).T, rise.T * 2, width, strict=True):
            area += wide * area_under_highest(heights, rises)
        return min(1.0, area / whole)

    def gap(self, front: ArrayLike) -> float:
        """Give by which share of its area a front may be improved at most.

        inf if its area is 0 and the bound's is not.

        Parameters
        ----------
        front
            E[R] and E[S] of its plans (n, 2): ``-result.F``.

        Raises
        ------
        ValueError
            Like :func:`area_indicator`.
        """
        area = area_indicator(front, self.mission)
        if area == 0.0:
            return 0.0 if self.area == 0.0 else float("inf")
        return max(0.0, self.area / area - 1.0)

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
        record = _Record(
            format=_FORMAT,
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
        ValueError
            If it is not such a file, or bounds another mission.
        """
        path = Path(path)
        try:
            record = _Record.model_validate_json(read_bytes(path))
        except ValidationError as error:
            fault = error.errors()[0]
            where = ".".join(map(str, fault["loc"])) or "the whole"
            raise ValueError(f"{path} is not a bound: {where}: {fault['msg']}.") from error
        if record.mission_digest != numbers_digest(mission):
            raise ValueError(f"{path} bounds another mission than {mission.name!r}.")
        missing = set(range(1, mission.robots + 1)) - {line.n_robots for line in record.lines}
        if missing:
            raise ValueError(f"{path} is not a bound: no line for {min(missing)} robots that move.")
        return cls(
            mission=mission,
            max_length=np.inf if record.max_length is None else record.max_length,
            **{name: getattr(record, name) for name in _PLAIN},
        )


_PLAIN = ("lines", "steps", "most_survival", "min_survival", "seconds", "notes")


class _Record(BaseModel):
    """A bound as it is in files."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    format: Literal["botohe-front-bound-1"]
    mission_digest: str
    lines: tuple[Line, ...]
    steps: tuple[Step, ...]
    most_survival: float = Field(ge=0, le=1)
    min_survival: float = Field(ge=0, le=1)
    max_length: float | None
    seconds: float
    notes: tuple[str, ...]
