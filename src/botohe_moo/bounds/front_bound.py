"""A bound on a front, what it is made of, and its files."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, FiniteFloat, PositiveInt, ValidationError

from botohe_moo.base.files import replace_file
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import NotNegative, Probability
from botohe_moo.base.types import FloatArray, OffsetArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission, check_mission, numbers_digest
from botohe_moo.objectives import check_objectives

LineProof = Literal["everything", "relaxed", "exact"]


class Line(NamedTuple):
    """E[R] ≤ most − mu · x, where ``n_robots`` move whose survivals sum to x or more.

    Attributes
    ----------
    n_robots
        How many robots move, 1 or more.
    most, mu
        Where the line begins, and by how much it falls for each robot that survives.
    proof
        ``"everything"`` (each node is reached along the safest way), ``"relaxed"`` (no relaxed
        trail is worth more than the line says, or it follows from bounds of all scenarios) or
        ``"exact"`` (no trail is).
    """

    n_robots: PositiveInt
    most: FiniteFloat
    mu: NotNegative
    proof: LineProof


class Step(NamedTuple):
    """E[R] ≤ most, where ``n_robots`` move whose survivals sum to ``least`` or more.

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

    n_robots: PositiveInt
    most: FiniteFloat
    least: NotNegative
    proof: Literal["front", "exact"]


class BoundRecord(BaseModel):
    """A bound as it is in files."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    format: Literal["botohe-front-bound-1"]
    mission_digest: str
    lines: tuple[Line, ...]
    steps: tuple[Step, ...]
    most_survival: Probability
    min_survival: Probability
    max_length: NotNegative | None
    seconds: NotNegative
    notes: tuple[str, ...]
    version: str | None = None  # of this package, which proved it; not in earlier versions' files


def read_record(path: Path, mission: Mission) -> BoundRecord:
    """Read the bound of a mission; an OSError or a ValueError names the file."""
    try:
        record = BoundRecord.model_validate_json(path.read_bytes())
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(map(str, fault["loc"])) or "the whole"
        found = "" if fault["type"] == "missing" else f", found {quoted(fault['input'])}"
        raise ValueError(f"{path} is not a bound: {where}: {fault['msg']}{found}.") from None
    if record.mission_digest != numbers_digest(mission):
        raise ValueError(f"{path} bounds another mission than {mission.name!r}.")
    numbers = set(range(1, mission.robots + 1))
    with_lines = {line.n_robots for line in record.lines}
    with_steps = {step.n_robots for step in record.steps}
    for what, moving in (("lines", with_lines), ("steps", with_steps)):
        if not moving <= numbers or (what == "lines" and moving != numbers):
            raise ValueError(
                f"{path} is not a bound: expected {what} for 1 to {mission.robots} robots that "
                f"move, found {what} for {sorted(moving)}."
            )
    return record


EDGE = 1e-12  # survivals this much below a step count as on it, relative


def lower_hull(x: FloatArray, y: FloatArray) -> OffsetArray:
    """Return the corners of the largest convex function below all points, by ascending x.

    Andrew, "Another efficient algorithm for convex hulls in two dimensions", Information Processing
    Letters 9(5), 1979; scipy's refuses points on one line.
    """
    corners: list[int] = []
    for i in np.lexsort((y, x)).tolist():
        if corners and x[i] == x[corners[-1]]:
            continue
        while len(corners) > 1:
            one, last = corners[-2:]
            if (y[last] - y[one]) * (x[i] - x[one]) < (y[i] - y[one]) * (x[last] - x[one]):
                break
            corners.pop()
        corners.append(i)
    return np.array(corners, np.int64)


def convex_below(values: FloatArray) -> FloatArray:
    """Return the largest convex function on a grid that is nowhere above values, at least 0."""
    levels = np.arange(len(values), dtype=float)
    corners = lower_hull(levels, values)
    envelope: FloatArray = np.maximum(np.interp(levels, corners, values[corners]), 0.0)
    return envelope


def lower_envelope(most: ArrayLike, mu: ArrayLike) -> OffsetArray:
    """Return which lines ``most`` − ``mu`` · x are the lowest at some x ≥ 0, by ascending mu."""
    # So that products do not overflow.
    y, x = (np.asarray(each) / (np.max(each) or 1.0) for each in (most, mu))
    corners = lower_hull(x, y)
    # Of lines with the least ``most``, the last one is the lowest.
    lowest: Any = np.flatnonzero(y[corners] == y[corners].min())[-1]
    return corners[lowest:]


def stairs_of(values: FloatArray, survival: FloatArray, width: float, n_steps: int) -> FloatArray:
    """Return for each step the most of ``values`` on it or above, −inf for none (n_steps)."""
    stairs = np.full(n_steps, -np.inf)
    steps = np.minimum((survival / width * (1 + EDGE)).astype(np.int64), n_steps - 1)
    np.maximum.at(stairs, steps, values)
    return falling(stairs)


def falling(stairs: FloatArray) -> FloatArray:
    """Raise each step to the highest of those after it, so that stairs never rise."""
    raised: FloatArray = np.maximum.accumulate(stairs[::-1])[::-1]
    return raised


def least_total(x: FloatArray | float, width: float, n_trails: int) -> OffsetArray:
    """Return the least sum of steps of ``n_trails`` trails whose survivals sum to ``x`` or more.

    Σ ⌊s_k / width⌋ > Σ s_k / width − n_trails, and so it is at least ⌊x / width⌋ − n_trails + 1.
    """
    totals: OffsetArray = np.floor(np.divide(x, width) * (1 - EDGE)).astype(np.int64)
    return np.maximum(totals - n_trails + 1, 0)


def add_stairs(stairs: FloatArray, n_trails: int) -> FloatArray:
    """Return the most that ``n_trails`` trails are worth together, by the sum of their steps."""
    most = np.zeros(1)
    for _ in range(n_trails):
        most = add_two(stairs, most)
    return most


def add_two(stairs: FloatArray, others: FloatArray) -> FloatArray:
    """Return the most that a trail and others are worth together, by the sum of their steps."""
    after = np.full(len(others) + len(stairs) - 1, -np.inf)
    is_last = np.append(stairs[1:] < stairs[:-1], True) & np.isfinite(stairs)  # of its height
    for step in np.flatnonzero(is_last).tolist():
        reached = after[step : step + len(others)]
        np.maximum(reached, others + stairs[step], out=reached)
    return falling(after)


_ROUNDING = 1e-12  # survivors are lowered by this share: they are sums of rounded products
_TIE = 1e-9  # plans above the bound by this share are on it: their sums have other orders
_N_POINTS = 1_000
_MOST_BOUNDS = 1_000_000  # that are computed at once, for an area
# Numbers in files may be so large that their products are infinite, which is no error.
_OVERFLOW = np.errstate(over="ignore")
_PLAIN = ("lines", "steps", "most_survival", "min_survival", "seconds", "notes")


class _Proved(NamedTuple):
    """What is proved for a number of moving robots."""

    most: FloatArray  # of each line
    mu: FloatArray
    least: FloatArray  # where steps begin, ascending
    capped: FloatArray  # the lowest of the first i steps, inf for none (n_steps + 1)


@dataclass(frozen=True, kw_only=True, repr=False)
class FrontBound:
    """For each E[S], an E[R] that no plan of a mission exceeds; see :func:`bound_front`.

    Plans are bounded for each number j of robots that move, while the others stay at base and
    survive. E[R] lies on or below all lines and steps for j. The bound is the largest over all j
    that a plan can have: robots that end elsewhere than they start always move.

    Attributes
    ----------
    mission
        The mission that is bounded.
    lines, steps
        What was proved, each for the ``n_robots`` that move and with its ``proof``. A line says
        that E[R] ≤ ``most`` − ``mu`` · x where their survivals sum to x or more; a step says that
        E[R] ≤ ``most`` where they sum to ``least`` or more.
    most_survival
        The largest probability to survive of a robot that moves.
    min_survival, max_length
        The limits that plans keep: survival floor, and travel budget (inf for none). Of kinds that
        differ, the loosest.
    seconds
        How long the bound was computed.
    notes
        Sentences that say what makes the bound weaker than it might be.

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
        """Return the E[R] that no plan with this E[S] or more exceeds; −inf if there is no plan.

        Parameters
        ----------
        survivors
            E[S]: a number, for which a float is returned, or an array of any shape. A ValueError is
            raised for a NaN and for what is not a number.
        """
        given = _without_nan(survivors)
        bounds = np.full(given.shape, -np.inf)
        for moving in range(self.mission.robots + 1):
            np.maximum(bounds, self.where(moving, given), out=bounds)
        return float(bounds) if given.ndim == 0 else bounds

    def by_robots(self, survivors: ArrayLike) -> FloatArray:
        """Return the bound for each number of robots that move (robots + 1, ...).

        Parameters
        ----------
        survivors
            E[S], of any shape, as for :meth:`bound`.
        """
        given = _without_nan(survivors)
        return np.stack([self.where(n, given) for n in range(self.mission.robots + 1)])

    @_OVERFLOW
    def where(self, moving: int, survivors: FloatArray) -> FloatArray:
        """Bound E[R] of plans in which a number of robots move."""
        n_robots, mission = self.mission.robots, self.mission
        bounds = np.full(survivors.shape, -np.inf)
        wanted = survivors * (1.0 - _ROUNDING)
        if moving < self._fewest_moving:
            return bounds
        if moving == 0:
            bounds[wanted <= n_robots] = mission.rewards[mission.index(mission.base)]
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
    def _fewest_moving(self) -> int:
        mission = self.mission
        return sum(k.robots for k in mission.kinds if len({*k.ends(mission.base)}) > 1)

    @cached_property
    def _proved(self) -> list[_Proved]:
        """What is proved, by the number of robots that move."""
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
        """Return where the bound for some number of robots may jump or bend, in ascending E[S].

        With a grid between.
        """
        n_robots = self.mission.robots
        low, high = self.min_survival * (1 - _ROUNDING), self.most_survival * (1 + _ROUNDING)
        found = np.linspace(0.0, n_robots, _N_POINTS).tolist()
        for moving in range(1, n_robots + 1):
            proved = self._proved[moving]
            order = lower_envelope(proved.most, proved.mu)
            bends = np.diff(proved.most[order]) / np.diff(proved.mu[order])
            falls = proved.mu > 0.0
            drops = np.subtract.outer(proved.most[falls], proved.capped[1:])
            # Where the lowest line falls below each step.
            meets = (drops / proved.mu[falls, None]).min(axis=0, initial=np.inf)
            x = np.concatenate([[0.0, moving * low, moving * high], bends, proved.least, meets])
            found += ((n_robots - moving + x) / (1.0 - _ROUNDING)).tolist()
        corners = np.unique(found)
        inside: FloatArray = corners[(corners >= 0.0) & (corners <= n_robots)]
        return inside

    @property
    def points(self) -> FloatArray:
        """E[R] and E[S] of a staircase (n, 2), by ascending E[S].

        Every plan is weakly dominated by one of the points.
        """
        survivors = self._corners()
        # Plans with more survivors than one point are below the next.
        before = np.append(0.0, np.nextafter(survivors[:-1], np.inf))
        found = np.column_stack([self.bound(before), survivors])
        found = found[np.isfinite(found[:, 0])]
        last: FloatArray = found[np.diff(found[:, 0], append=-np.inf) < 0.0]
        return last

    @property
    def area(self) -> float:
        """The area below the bound, normalised like :func:`area_indicator`."""
        whole = self.mission.total_reward * self.mission.robots
        if whole == 0.0:
            return 0.0
        corners = self._corners()
        n_at_once = max(1, _MOST_BOUNDS // (self.mission.robots + 1))
        firsts = range(0, len(corners) - 1, n_at_once)
        area = sum(self._area_between(corners[i : i + n_at_once + 1]) for i in firsts)
        return float(min(1.0, area / whole))

    def _area_between(self, corners: FloatArray) -> float:
        """Integrate the bound, which has a line for each number of robots between corners.

        The result may be slightly larger.
        """
        width = np.diff(corners)
        low, high = (self.by_robots(corners[:-1] + share * width) for share in (0.25, 0.75))
        with np.errstate(invalid="ignore"):
            rise = np.where(np.isfinite(low) & np.isfinite(high), high - low, 0.0)
        # The highest of these lines, and 0, is convex, and below the chord between its ends.
        ends = sum(each.max(axis=0, initial=0.0) for each in (low - rise / 2, low + 1.5 * rise))
        return float(width @ ends / 2)

    def gap(self, front: ArrayLike) -> float:
        """Return the largest share by which the area of a front can grow; inf if it is 0 and can.

        Parameters
        ----------
        front
            E[R] and E[S] of its plans (n, 2): ``-result.F``. A ValueError is raised like that of
            :func:`area_indicator`, and if a plan lies above the bound.
        """
        self.check("front", front)
        return self.gap_of_area(area_indicator(front, self.mission))

    def gap_of_area(self, area: float) -> float:
        """Return the largest share by which an area can grow; inf if it is 0 and can."""
        if area == 0.0:
            return 0.0 if self.area == 0.0 else float("inf")
        return max(0.0, self.area / area - 1.0)

    def __repr__(self) -> str:
        return f"<FrontBound of {self.mission.name!r}: area at most {self.area:.4g}>"

    def check(self, name: str, front: ArrayLike) -> None:
        """Raise a ValueError if a front has a plan above the bound, or is not of shape (n, 2).

        Parameters
        ----------
        name
            Name of the front in the message.
        front
            E[R] and E[S] of its plans (n, 2).
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
        """
        record = BoundRecord(
            format="botohe-front-bound-1",
            mission_digest=numbers_digest(self.mission),
            version=version("botohe-moo"),
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
            The file. A ValueError is raised if it is not such a file, or bounds another mission.
        mission
            The mission that is bounded.
        """
        check_mission(mission)
        record = read_record(Path(path), mission)
        return cls(
            mission=mission,
            max_length=np.inf if record.max_length is None else record.max_length,
            **{name: getattr(record, name) for name in _PLAIN},
        )


def _without_nan(survivors: ArrayLike) -> FloatArray:
    """Convert survivors to an array; a ValueError names what is not a number."""
    try:
        given = np.asarray(survivors, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"Expected survivors as numbers, got {quoted(survivors)}.") from None
    if np.isnan(given).any():
        raise ValueError(f"Expected survivors without NaN, got {quoted(survivors)}.")
    return given
