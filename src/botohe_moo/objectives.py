"""What a problem maximises: names, upper bounds and columns of its objectives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import NotNegative, check
from botohe_moo.base.types import FloatArray
from botohe_moo.mission.model import Mission, check_mission

__all__ = ["Objectives"]

_ROUNDING = 1e-9
SLACK = 1e-12  # by which rounding may exceed a bound of 0, or fall below 0
# Columns of the tables in which objectives stand.
_TAKEN = ("run", "mission", "algorithm", "seed", "evaluations", "plan_id", "trails")


@dataclass(frozen=True)
class Objectives:
    """The objectives of a problem, in the order of the columns of −F.

    All of them are maximised, and at least 0.

    Parameters
    ----------
    names
        What axes and reports call them. ``E[R]`` and ``E[S]`` are always expected reward and
        survivors.
    bounds
        An upper bound of each, finite and not negative. Area, IGD+ and epsilon are computed from
        objectives divided by these.
    columns
        What tables call them, such as ``reward``.

    Raises
    ------
    ValueError
        If there are fewer than two objectives, if names, bounds and columns differ in number, if a
        bound is negative or infinite, or if a column is not an identifier, appears twice or has a
        name that tables need themselves.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.objectives import Objectives
    >>> Objectives.of(load_mission("toy"))
    Objectives(names=('E[R]', 'E[S]'), bounds=(10.0, 2.0), columns=('reward', 'survivors'))
    """

    names: tuple[str, ...]
    bounds: tuple[float, ...]
    columns: tuple[str, ...]

    def __post_init__(self) -> None:
        for field in ("names", "bounds", "columns"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        n = {len(self.names), len(self.bounds), len(self.columns)}
        if len(n) > 1 or min(n) < 2:
            expected = "names, bounds and columns of two objectives or more"
            raise ValueError(f"Expected {expected}: {self}.")
        bounds = [check("the bound of an objective", b, NotNegative) for b in self.bounds]
        object.__setattr__(self, "bounds", tuple(bounds))
        if len(set(self.names)) < len(self.names):
            raise ValueError(f"Expected different names of objectives, got {quoted(self.names)}.")
        for i, column in enumerate(self.columns):
            is_name = isinstance(column, str) and column.isidentifier()
            if not is_name or column in _TAKEN or column in self.columns[:i]:
                raise ValueError(
                    "Expected columns of objectives to be different identifiers, none of "
                    f"{', '.join(_TAKEN)}, got {quoted(column)}."
                )

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def of(cls, mission: Mission) -> Self:
        """Return the objectives of a mission: E[R] and E[S]."""
        bounds = check_mission(mission).total_reward, float(mission.robots)
        return cls(("E[R]", "E[S]"), bounds, ("reward", "survivors"))

    @property
    def bounds_with_slack(self) -> FloatArray:
        """The upper bounds, with room for rounding."""
        return np.array(self.bounds) * (1.0 + _ROUNDING) + SLACK

    @property
    def is_plain(self) -> bool:
        """Whether they are E[R] and E[S]."""
        return self.names == ("E[R]", "E[S]") and self.columns == ("reward", "survivors")

    def check(self, name: str, given: ArrayLike) -> FloatArray:
        """Convert points to an array, as ``check_objectives``, and refuse those above a bound.

        Parameters
        ----------
        name
            Of the parameter, for messages.
        given
            The points to convert.
        """
        values = check_objectives(name, given, self.names)
        above = (values > self.bounds_with_slack).any(axis=1)
        if above.any():
            most = zip(self.names, self.bounds, strict=True)
            expected = " and ".join(f"{each} <= {bound:g}" for each, bound in most)
            found = f"{_row(values, above)}: the front is of another mission"
            raise ValueError(f"Expected {expected}, got {found}.")
        return values


def check_objectives(
    name: str, given: ArrayLike, names: Sequence[str] = ("E[R]", "E[S]")
) -> FloatArray:
    """Convert points to an array (n, n_objectives); n may be 0, and minus infinity is accepted.

    Parameters
    ----------
    name
        Of the parameter, for messages.
    given
        The points to convert.
    names
        Those of the objectives.

    Raises
    ------
    ValueError
        If it is not of that shape, holds NaN or infinity, or is ``result.F``, which holds the
        negatives.
    """
    n = len(names)
    try:
        values = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"Expected {name} of shape (n, {n}), got {quoted(given)}.") from None
    if values.shape == (0,):
        return np.empty((0, n))
    if values.ndim != 2 or values.shape[1] != n:
        raise ValueError(f"Expected {name} of shape (n, {n}), got {values.shape}.")
    is_wrong = ~(values < np.inf).all(axis=1)
    if is_wrong.any():
        raise ValueError(f"Expected {name} without NaN and infinity, got {_row(values, is_wrong)}.")
    is_negative = (values < -SLACK).any(axis=1)
    if is_negative.any() and np.isfinite(values).all() and (values <= 0).all():
        raise ValueError(
            f"Expected {' and '.join(names)}, which are at least 0, got "
            f"{_row(values, is_negative)}; pymoo's F holds their negatives: give -result.F."
        )
    return values


def _row(values: FloatArray, is_wrong: Any) -> str:
    """Name the first row in which something is wrong."""
    row = int(is_wrong.argmax())
    return f"{values[row].tolist()} in row {row}"
