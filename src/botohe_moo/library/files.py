"""The files of the library: where they are, what is in them, and whether it is true."""

from __future__ import annotations

import gzip
import hashlib
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from filelock import FileLock

from botohe_moo.base.files import replace_file
from botohe_moo.bounds import FrontBound
from botohe_moo.library.fronts import BestKnown, Finder, unpacked
from botohe_moo.mission.loading import ENTRIES, PREFIX, library_names, load_mission
from botohe_moo.mission.model import Mission
from botohe_moo.trails import Plans

if TYPE_CHECKING:
    import pandas as pd

_PACKAGE = Path(__file__).parent
# A package that is installed has the files beside this one, a clone in its results.
_FILES = _PACKAGE / "data"
FOLDER = _FILES if _FILES.is_dir() else _PACKAGE.parents[2] / "results" / "library"


def library_mission(name: str) -> Mission:
    """Return a mission of the library: ``load_mission("library:NAME")``."""
    return load_mission(f"{PREFIX}{name}")


def best_known(name: str, *, folder: str | os.PathLike[str] = FOLDER) -> BestKnown:
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
        If there is no such mission, or its file is damaged or of another mission.

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


def certified_bound(name: str, *, folder: str | os.PathLike[str] = FOLDER) -> FrontBound:
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
        If there is no such mission, or its file is damaged or of another mission.
    OSError
        If there is no such file.

    Examples
    --------
    >>> from botohe_moo.library import best_known, certified_bound
    >>> gap = certified_bound("town-16").gap(best_known("town-16").objectives)
    >>> gap < 1e-6
    True
    """
    mission = library_mission(name)
    return FrontBound.load(_bound_file(name, Path(folder)), mission)


def check_library(
    names: str | Iterable[str] = "all", *, folder: str | os.PathLike[str] = FOLDER
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
        except OSError as error:
            faults[name] = f"{path}: {error.strerror}."
        except ValueError as error:
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
    found: Mapping[str, Iterable[tuple[Plans, Finder]]],
    *,
    folder: str | os.PathLike[str] = FOLDER,
) -> dict[str, Added]:
    """Merge plans into the best known fronts, and write those that change.

    Nothing is written before all plans are checked, those of the fronts, too. Then each file is
    replaced in one step, one after another. Calls on the same folder wait for each other.

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
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    # Beside the folder, all of which comes with the package; one lock, however it is called.
    where = folder.resolve()
    with FileLock(where.with_name(f".{where.name}.lock")):
        fronts = {name: _merged(name, lists, folder) for name, lists in found.items()}
        return {
            name: Added(before, after, _written(name, before, after, folder))
            for name, (before, after) in fronts.items()
        }


def _merged(
    name: str, lists: Iterable[tuple[Plans, Finder]], folder: Path
) -> tuple[BestKnown, BestKnown]:
    before = after = BestKnown(library_mission(name))
    if (path := _front_file(name, folder)).exists():
        before = after = BestKnown.read(path, before.mission, check=True)
    for plans, finder in lists:
        try:
            after = after.merged(plans, finder)
        except ValueError as error:
            raise ValueError(f"{name}, {finder.method}: {error}") from None
    return before, after


def _written(name: str, before: BestKnown, after: BestKnown, folder: Path) -> Path | None:
    """Write a front and return its file, or None if that has this content."""
    path, data = _front_file(name, folder), after.to_bytes()
    if data == (unpacked(path) if path.exists() else before.to_bytes()):
        return None
    replace_file(path, gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)
    return path


def library_table(
    names: str | Iterable[str] = "all", *, folder: str | os.PathLike[str] = FOLDER
) -> pd.DataFrame:
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

    rows: list[dict[str, Any]] = []
    for name in library_names(names) if isinstance(names, str) else names:
        known, entry = best_known(name, folder=folder), ENTRIES[name]
        path = _bound_file(name, Path(folder))
        bound = FrontBound.load(path, known.mission) if path.exists() else None
        rows.append(
            {
                "mission": name,
                "family": entry.family,
                "size": entry.size,
                "nodes": len(known.mission.nodes),
                "arcs": known.mission.graph.number_of_edges(),
                "robots": known.mission.robots,
                "plans": len(known.objectives),
                "area": known.area,
                "bound_area": bound.area if bound else math.nan,
                "gap": bound.gap(known.objectives) if bound else math.nan,
            }
        )
    return pd.DataFrame(rows)


def library_digest(name: str, *, folder: str | os.PathLike[str] = FOLDER) -> str:
    """Return a digest of the files of a mission, which changes when they do."""
    paths = _front_file(name, Path(folder)), _bound_file(name, Path(folder))
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def _front_file(name: str, folder: Path) -> Path:
    return folder / f"{name}.front.json{'.gz' if ENTRIES[name].size == 'large' else ''}"


def _bound_file(name: str, folder: Path) -> Path:
    return folder / f"{name}.bound.json"
