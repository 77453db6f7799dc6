"""Best known fronts, as plans, and the files that hold them."""

from __future__ import annotations

import gzip
import json
import math
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, field
from datetime import date
from functools import cached_property
from itertools import chain, groupby
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple
from unicodedata import category

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, NonNegativeInt

from botohe_moo.base.files import Source
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import json_record
from botohe_moo.base.types import FloatArray
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, Plans, TrailPlan

FORMAT: Literal["botohe-front-1"] = "botohe-front-1"
_DIGITS = 12  # of objectives; further digits depend on the order in which factors are multiplied
_AGREES = 1e-11  # how far, as a share, what files say may be from what is so: half of a last digit

_NOT_OF_A_LINE = {"Cc", "Cs", "Zl", "Zp"}  # controls, surrogates, separators of lines

_Trails = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, order=True)
class Finder:
    """Who found a plan, and when.

    Attributes
    ----------
    on
        Date, as 2026-11-27.
    by
        A name.
    method
        By what: the algorithm, its parameters, its budget and its seed.

    Raises
    ------
    ValueError
        If ``on`` is not a date, or ``by`` or ``method`` is not one printable line.

    Examples
    --------
    >>> from botohe_moo.library import Finder
    >>> Finder("2026-11-27", "me", "by hand").by
    'me'
    """

    on: str
    by: str
    method: str

    def __post_init__(self) -> None:
        try:
            is_date = date.fromisoformat(self.on).isoformat() == self.on
        except ValueError:
            is_date = False
        if not is_date:
            raise ValueError(f"Expected a date such as 2026-11-27, got {quoted(self.on)}.")
        for said, text in (("who found the plans", self.by), ("by what", self.method)):
            if not text.strip() or any(category(c) in _NOT_OF_A_LINE for c in text):
                raise ValueError(f"Expected a line that says {said}, got {quoted(text)}.")


class _Found(NamedTuple):
    """A plan of a front."""

    reward: float
    survivors: float
    finder: Finder
    trails: _Trails  # indices of nodes, those of robots of a kind in ascending order


class _Record(BaseModel, extra="forbid", strict=True):
    format: Literal["botohe-front-1"]
    mission: str
    mission_digest: str
    area: FiniteFloat
    finders: list[tuple[str, str, str]]
    trails: list[Annotated[list[int | str], Field(min_length=1)]]
    plans: list[tuple[FiniteFloat, FiniteFloat, NonNegativeInt, list[NonNegativeInt]]]


@dataclass(frozen=True, repr=False)
class BestKnown:
    """The best front that is known of a mission.

    No plan dominates another, and no two have the same objectives. Objectives are rounded to 12
    significant digits, so that the order in which a plan's survivals are multiplied makes no other
    plan of it.

    Attributes
    ----------
    mission
        The mission.

    Examples
    --------
    >>> from botohe_moo.library import BestKnown, best_known
    >>> front = best_known("town-16")
    >>> isinstance(front, BestKnown), front.objectives[0].round(2).tolist()
    (True, [7.55, 0.76])
    """

    mission: Mission
    _found: tuple[_Found, ...] = field(default=())

    @property
    def objectives(self) -> FloatArray:
        """E[R] and E[S] of the plans, by descending E[R] (n, 2)."""
        return np.array([found[:2] for found in self._found], np.float64).reshape(-1, 2)

    @property
    def finders(self) -> tuple[Finder, ...]:
        """Who found each plan, and when."""
        return tuple(found.finder for found in self._found)

    @cached_property
    def plans(self) -> PlanBatch:
        """The plans, in the order of ``objectives``; they are valid if `check` finds no fault."""
        return batch_of(self.mission, [found.trails for found in self._found])

    @property
    def area(self) -> float:
        """Its area indicator, in [0, 1]."""
        return area_indicator(self.objectives, self.mission)

    def merged(self, plans: Plans, finder: Finder) -> BestKnown:
        """Return the front with the plans that improve it, and without those that they dominate.

        Of plans with the same objectives, that of the earliest date stays, then that of the first
        finder and method in alphabetical order. So fronts that are merged in any order are the
        same.

        Parameters
        ----------
        plans
            Plans of the mission. A ValueError names one that is not valid, or a robot that does not
            keep the mission's limits.
        finder
            Who found them.
        """
        batch = self.mission.batch(plans)
        if not len(batch):
            return self
        BOTOHE(self.mission).check_limits(batch)
        objectives = self.mission.evaluate(batch).tolist()
        found = [
            _Found(_rounded(reward), _rounded(survivors), finder, self._canonical(plan))
            for (reward, survivors), plan in zip(objectives, batch, strict=True)
        ]
        return BestKnown(self.mission, _non_dominated([*self._found, *found]))

    def _canonical(self, plan: TrailPlan) -> _Trails:
        """Return the trails with those of robots of a kind, which are alike, in ascending order."""
        of_kinds = zip(self.mission.kind_of, self.mission.trails(plan), strict=True)
        alike = groupby(of_kinds, key=lambda pair: pair[0])
        return tuple(trail for _, pairs in alike for trail in sorted(trail for _, trail in pairs))

    def check(self) -> None:
        """Evaluate all plans again, and compare them with what is said of them.

        A ValueError names a plan that is not valid, does not keep the mission's limits, or has
        other objectives, or says that one is dominated or its robots are in another order.
        """
        evaluated = self.mission.evaluate(self.plans)
        BOTOHE(self.mission).check_limits(self.plans)
        near = np.isclose(self.objectives, evaluated, rtol=_AGREES, atol=0.0).all(axis=1)
        if (wrong := np.flatnonzero(~near)).size:
            i = wrong[0]
            said, found = self.objectives[i].tolist(), evaluated[i].tolist()
            raise ValueError(
                f"Plan {i}: expected the objectives {found} of its trails, got {said}."
            )
        for i, (found, plan) in enumerate(zip(self._found, self.plans, strict=True)):
            if found.trails != self._canonical(plan):
                raise ValueError(f"Plan {i}: expected the trails of robots that are alike sorted.")
        if _non_dominated(self._found) != self._found:
            raise ValueError("Expected plans by descending reward, none dominated, each once.")

    def to_bytes(self) -> bytes:
        """Return the content of its file: the same front has the same content."""
        finders = sorted(set(self.finders))
        trails = sorted({trail for found in self._found for trail in found.trails})
        number_of = {trail: i for i, trail in enumerate(trails)}
        nodes = self.mission.nodes
        content: dict[str, list[Any]] = {
            "finders": [astuple(finder) for finder in finders],
            "trails": [[nodes[v] for v in trail] for trail in trails],
            "plans": [
                [*found[:2], finders.index(found.finder), [number_of[t] for t in found.trails]]
                for found in self._found
            ],
        }
        head = {
            "format": FORMAT,
            "mission": self.mission.name,
            "mission_digest": numbers_digest(self.mission),
            "area": _rounded(self.area),
        }
        lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
        for key, values in content.items():  # a line for each, so that differences are readable
            each = ",\n".join(json.dumps(v, separators=(",", ":")) for v in values)
            lines.append(f"{json.dumps(key)}: [\n{each}\n]")
        return ("{\n" + ",\n".join(lines) + "\n}\n").encode()

    @classmethod
    def read(cls, path: Path, mission: Mission, *, check: bool = False) -> BestKnown:
        """Read the front of a mission; a ValueError names the file and what is wrong in it.

        The plans themselves are looked at by :meth:`check`, which is called if ``check`` is set.
        """
        record = json_record(path, unpacked(path), _Record)
        if record.mission_digest != (digest := numbers_digest(mission)):
            raise ValueError(
                f"{path}: expected the digest {digest} of {mission.name!r}, found that of another "
                f"mission, {quoted(record.mission_digest)}."
            )
        index_of = {node: i for i, node in enumerate(mission.nodes)}
        try:
            finders = [Finder(*finder) for finder in record.finders]
            trails = [tuple(index_of[label] for label in trail) for trail in record.trails]
            found = tuple(
                _Found(r, s, finders[i], tuple(trails[t] for t in of_robots))
                for r, s, i, of_robots in record.plans
            )
            if any(len(each.trails) != mission.robots for each in found):
                raise ValueError(f"expected {mission.robots} trails in each plan.")
            front = cls(mission, found)
            if not math.isclose(front.area, record.area, rel_tol=_AGREES):
                raise ValueError(f"expected the area {front.area}, found {record.area}.")
            if check:
                front.check()
        except LookupError:
            raise ValueError(
                f"{path}: a plan has a node, a trail or a finder that is not there."
            ) from None
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        return front

    def __repr__(self) -> str:
        return (
            f"<BestKnown of {self.mission.name!r}: {len(self._found)} plans, area {self.area:.6f}>"
        )


def unpacked(path: Path) -> bytes:
    """Return the content of a front's file; a ValueError names one that cannot be read."""
    data = Source(path).data
    try:
        return gzip.decompress(data) if path.suffix == ".gz" else data
    except (OSError, EOFError, zlib.error) as error:
        raise ValueError(f"{path}: the file cannot be read ({error}).") from None


def batch_of(mission: Mission, plans: Sequence[Sequence[Sequence[int]]]) -> PlanBatch:
    """Return plans of a mission as a batch, without looking at them.

    ``plans`` has a trail for each robot, as indices of nodes in ``mission.nodes``.
    """
    n_nodes = len(mission.nodes)
    first = [n_nodes * mission.kinds.index(kind) for kind in mission.kind_of]  # of each layer
    trails = [trail for plan in plans for trail in plan]
    lengths = np.fromiter(map(len, trails), np.int64, len(trails))
    nodes = np.fromiter(chain.from_iterable(trails), np.int32, int(lengths.sum()))
    nodes += np.repeat(np.tile(np.array(first, np.int32), len(plans)), lengths)
    return PlanBatch(nodes, np.concatenate([[0], np.cumsum(lengths)]), mission.robots)


def _non_dominated(found: Iterable[_Found]) -> tuple[_Found, ...]:
    """Return those that are not dominated, by descending reward, and of equal ones the first."""
    front: list[_Found] = []
    for each in sorted(found, key=lambda f: (-f.reward, -f.survivors, f.finder, f.trails)):
        if not front or each.survivors > front[-1].survivors:
            front.append(each)
    return tuple(front)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
