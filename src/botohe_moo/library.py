"""The library: missions with their best known fronts and certified bounds, and their files."""

from __future__ import annotations

import gzip
import json
import math
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import astuple, dataclass, field
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat, NonNegativeInt

from botohe_moo.base.files import FilePath, Source, replace_file
from botohe_moo.base.messages import quoted
from botohe_moo.base.parameters import validated
from botohe_moo.base.types import FloatArray
from botohe_moo.bounds import FrontBound
from botohe_moo.indicators import area_indicator
from botohe_moo.mission.loading import ENTRIES, PREFIX, library_names, load_mission
from botohe_moo.mission.model import Mission, numbers_digest
from botohe_moo.problem import BOTOHE
from botohe_moo.trails import PlanBatch, Plans, TrailPlan

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Added",
    "BestKnown",
    "Finder",
    "add_plans",
    "best_known",
    "certified_bound",
    "check_library",
    "library_names",
    "library_table",
]

_PACKAGE = Path(__file__).parent
# An installed package has the files beside the missions, a clone in its results.
_FILES = _PACKAGE / "mission" / "data" / "library"
FOLDER = _FILES if _FILES.is_dir() else _PACKAGE.parents[1] / "results" / "library"
_DIGITS = 12  # of objectives; further digits depend on the order in which factors are multiplied
_AGREES = 1e-11  # how far, as a share, files may be from what is computed: half of a last digit

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
        date.fromisoformat(self.on)
        for text in (self.by, self.method):
            if not text.strip() or not text.isprintable():
                raise ValueError(f"Expected a line that says who, or by what, got {quoted(text)}.")


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


@dataclass(frozen=True)
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
    _found: tuple[_Found, ...] = field(default=(), repr=False)

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
        return self.mission.pack([found.trails for found in self._found])

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
        BOTOHE(self.mission).check_limits(batch)
        objectives = self.mission.evaluate(batch).tolist()
        found = [
            _Found(_rounded(reward), _rounded(survivors), finder, self._canonical(plan))
            for (reward, survivors), plan in zip(objectives, batch, strict=True)
        ]
        return BestKnown(self.mission, _non_dominated([*self._found, *found]))

    def _canonical(self, plan: TrailPlan) -> _Trails:
        """Return the trails with those of robots of a kind, which are alike, in ascending order."""
        # Nodes of a kind come before those of the next one.
        return self.mission.trails(TrailPlan(sorted(plan.trails)))

    def check(self) -> None:
        """Evaluate all plans again, and compare them with what is said of them.

        A ValueError names a plan that is not valid, does not keep the mission's limits, or has
        other objectives, or says that one is dominated or its robots are in another order.
        """
        evaluated = self.mission.evaluate(self.plans)
        BOTOHE(self.mission).check_limits(self.plans)
        near = np.isclose(self.objectives, evaluated, rtol=_AGREES, atol=0.0).all(axis=1)
        if (wrong := np.flatnonzero(~near)).size:
            expected, got = evaluated[wrong[0]].tolist(), self.objectives[wrong[0]].tolist()
            raise ValueError(f"Plan {wrong[0]}: expected the objectives {expected}, got {got}.")
        pairs = zip(self._found, map(self._canonical, self.plans), strict=True)
        if _non_dominated(found._replace(trails=trails) for found, trails in pairs) != self._found:
            expected = "non-dominated plans by descending reward, each once, with sorted trails"
            raise ValueError(f"Expected {expected}.")

    def to_bytes(self) -> bytes:
        """Return the content of its file: the same front has the same content."""
        finders = sorted(set(self.finders))
        trails = sorted({trail for found in self._found for trail in found.trails})
        number_of = {trail: i for i, trail in enumerate(trails)}
        content: dict[str, Any] = {
            "format": "botohe-front-1",
            "mission": self.mission.name,
            "mission_digest": numbers_digest(self.mission),
            "area": _rounded(self.area),
            "finders": [astuple(finder) for finder in finders],
            "trails": [[self.mission.nodes[v] for v in trail] for trail in trails],
            "plans": [
                [r, s, finders.index(finder), [number_of[trail] for trail in of_robots]]
                for r, s, finder, of_robots in self._found
            ],
        }
        lines = []
        for key, value in content.items():
            text = json.dumps(value)
            if isinstance(value, list):  # a line for each, so that differences are readable
                each = (json.dumps(v, separators=(",", ":")) for v in value)
                text = "[\n" + ",\n".join(each) + "\n]"
            lines.append(f"{json.dumps(key)}: {text}")
        return ("{\n" + ",\n".join(lines) + "\n}\n").encode()

    @classmethod
    def read(cls, path: Path, mission: Mission, *, check: bool = False) -> BestKnown:
        """Read the front of a mission; a ValueError names the file and what is wrong in it.

        The plans themselves are looked at by :meth:`check`, which is called if ``check`` is set.
        """
        record = validated(unpacked(path), _Record, source=str(path))
        if record.mission_digest != (digest := numbers_digest(mission)):
            expected = f"the digest {digest} of {mission.name!r}"
            got = f"that of another mission, {quoted(record.mission_digest)}"
            raise ValueError(f"{path}: expected {expected}, found {got}.")
        index_of = {node: i for i, node in enumerate(mission.nodes)}
        try:
            finders = [Finder(*finder) for finder in record.finders]
            trails = [tuple(index_of[label] for label in trail) for trail in record.trails]
            found = tuple(
                _Found(r, s, finders[i], tuple(trails[t] for t in of_robots))
                for r, s, i, of_robots in record.plans
            )
            front = cls(mission, found)
            if check:
                front.check()
        except LookupError as error:
            raise ValueError(f"{path}: no such node, trail or finder ({error}).") from None
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        return front


def unpacked(path: Path) -> bytes:
    """Return the content of a front's file; a ValueError names one that cannot be read."""
    data = Source(path).data
    try:
        return gzip.decompress(data) if path.suffix == ".gz" else data
    except (OSError, EOFError, zlib.error) as error:
        raise ValueError(f"{path}: the file cannot be read ({error}).") from None


def _non_dominated(found: Iterable[_Found]) -> tuple[_Found, ...]:
    """Return those that are not dominated, by descending reward, and of equal ones the first."""
    front: list[_Found] = []
    for each in sorted(found, key=lambda f: (-f.reward, -f.survivors, f.finder, f.trails)):
        if not front or each.survivors > front[-1].survivors:
            front.append(each)
    return tuple(front)


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def library_mission(name: str) -> Mission:
    """Return a mission of the library: ``load_mission("library:NAME")``."""
    return load_mission(f"{PREFIX}{name}")


def best_known(name: str, *, folder: FilePath = FOLDER) -> BestKnown:
    """Return the best front that is known of a mission of the library.

    Parameters
    ----------
    name
        One of `library_names`.
    folder
        Where the files are; default: those that come with this package.

    Raises
    ------
    ValueError
        If no mission has that name, or its file is damaged or belongs to another mission.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.library import best_known
    >>> known = best_known("lattice-12")
    >>> found = solve("library:lattice-12", evaluations=20_000, seed=1)
    >>> found.area / known.area > 0.999
    True
    """
    mission = library_mission(name)
    return BestKnown.read(_front_file(name, Path(folder)), mission)


def certified_bound(name: str, *, folder: FilePath = FOLDER) -> FrontBound:
    """Return the bound that is proved of a mission of the library.

    Parameters
    ----------
    name
        One of `library_names`.
    folder
        Where the files are; default: those that come with this package.

    Raises
    ------
    ValueError
        If no mission has that name, or its file is damaged or belongs to another mission.
    OSError
        If the file does not exist.

    Examples
    --------
    >>> from botohe_moo.library import best_known, certified_bound
    >>> gap = certified_bound("town-16").gap(best_known("town-16").objectives)
    >>> gap < 1e-6
    True
    """
    return FrontBound.load(_bound_file(name, Path(folder)), library_mission(name))


def check_library(
    names: str | Iterable[str] = "all", *, folder: FilePath = FOLDER
) -> dict[str, str]:
    """Check missions of the library: make them, and evaluate all plans of their fronts again.

    A mission has to have its digest. Its plans have to be valid, to keep its limits, to have the
    objectives that the file says, and none may be dominated. The file has to be what `add_plans`
    writes, and the bound has to lie above the plans. That bounds are true is not proved again;
    :func:`~botohe_moo.bound_front` does that.

    Parameters
    ----------
    names
        Names of missions, or a selection as for `library_names`.
    folder
        Where the files are; default: those that come with this package.

    Returns
    -------
    dict
        What is wrong, by name; empty if nothing is.

    Examples
    --------
    >>> from botohe_moo.library import check_library
    >>> check_library(["town-16", "terrain-10"])
    {}
    """
    faults = {}
    for name in library_names(names) if isinstance(names, str) else names:
        try:
            mission = library_mission(name)
            path = _front_file(name, Path(folder))
            known = BestKnown.read(path, mission, check=True)
            if unpacked(path) != known.to_bytes():
                raise ValueError(f"{path}: expected what `botohe library add` writes.")
            path = _bound_file(name, Path(folder))
            FrontBound.load(path, mission).check(f"{path}: front", known.objectives)
        except (OSError, ValueError) as error:
            faults[name] = str(error)
    return faults


class Added(NamedTuple):
    """What became of a front to which plans were added.

    Attributes
    ----------
    before, after
        The front.
    path
        The file that was written; None if it has this content already.

    Examples
    --------
    >>> from botohe_moo import load_mission
    >>> from botohe_moo.library import Added, Finder, add_plans
    >>> home = load_mission("library:town-16").stay_home()
    >>> finder = Finder("2026-11-27", "me", "by hand")
    >>> added = add_plans({"town-16": [([home], finder)]}, folder="home")["town-16"]
    >>> isinstance(added, Added), added.path.name
    (True, 'town-16.front.json')
    """

    before: BestKnown
    after: BestKnown
    path: Path | None


def add_plans(
    found: Mapping[str, Iterable[tuple[Plans, Finder]]], *, folder: FilePath = FOLDER
) -> dict[str, Added]:
    """Merge plans into the best known fronts, and write those that change.

    All plans are checked, those of the fronts, too, before any file is written. Each file is
    replaced in one step.

    Parameters
    ----------
    found
        Lists of plans, and who found them, by name of the mission.
    folder
        Where the files are; made if it does not exist.

    Returns
    -------
    dict
        What became of each front, by name of the mission.

    Raises
    ------
    ValueError
        If a plan is not valid or does not keep the mission's limits, or a file is damaged.
    OSError
        If a file cannot be written.

    Examples
    --------
    >>> from botohe_moo import solve
    >>> from botohe_moo.library import Finder, add_plans
    >>> found = solve("library:town-16", evaluations=1_000, seed=1)
    >>> finder = Finder("2026-11-27", "me", "pareto-local-search, 1,000 evaluations, seed 1")
    >>> added = add_plans({"town-16": [(found.plans, finder)]}, folder="mine")["town-16"]
    >>> added.before.area, round(added.after.area, 2)
    (0.0, 0.66)
    """
    added = {}
    for name, lists in found.items():
        before = BestKnown(library_mission(name))
        if (path := _front_file(name, Path(folder))).exists():
            before = BestKnown.read(path, before.mission, check=True)
        after = before
        for plans, finder in lists:
            try:
                after = after.merged(plans, finder)
            except ValueError as error:
                raise ValueError(f"{name}, {finder.method}: {error}") from None
        added[name] = Added(before, after, path if after != before else None)
    Path(folder).mkdir(parents=True, exist_ok=True)
    for _, after, written in added.values():
        if written is not None:
            data = after.to_bytes()
            replace_file(written, gzip.compress(data, mtime=0) if written.suffix == ".gz" else data)
    return added


def library_table(names: str | Iterable[str] = "all", *, folder: FilePath = FOLDER) -> pd.DataFrame:
    """List missions of the library: their sizes, best known areas, and certified gaps.

    Parameters
    ----------
    names
        Names of missions, or a selection as for `library_names`.
    folder
        Where the files are; default: those that come with this package.

    Returns
    -------
    pandas.DataFrame
        The columns ``mission``, ``family``, ``size``, ``nodes``, ``arcs``, ``robots``, ``plans``,
        ``area``, ``bound_area`` and ``gap``: the largest share by which the area can grow. The last
        two are missing where there is no bound.

    Examples
    --------
    >>> from botohe_moo.library import library_table
    >>> table = library_table(["town-16", "town-64"])
    >>> table[["mission", "nodes", "arcs", "robots"]]
       mission  nodes  arcs  robots
    0  town-16     16    24       2
    1  town-64     64   112       2
    """
    import pandas as pd

    columns = "mission family size nodes arcs robots plans area bound_area gap"
    rows = []
    for name in library_names(names) if isinstance(names, str) else names:
        known, entry = best_known(name, folder=folder), ENTRIES[name]
        graph, path = known.mission.graph, _bound_file(name, Path(folder))
        bound = FrontBound.load(path, known.mission) if path.exists() else None
        certified = (bound.area, bound.gap(known.objectives)) if bound else (math.nan, math.nan)
        sizes = len(graph), graph.number_of_edges(), known.mission.robots, len(known.objectives)
        rows.append((name, entry.family, entry.size, *sizes, known.area, *certified))
    return pd.DataFrame(rows, columns=columns.split())


def _front_file(name: str, folder: Path) -> Path:
    return folder / f"{name}.front.json{'.gz' if ENTRIES[name].size == 'large' else ''}"


def _bound_file(name: str, folder: Path) -> Path:
    return folder / f"{name}.bound.json"
