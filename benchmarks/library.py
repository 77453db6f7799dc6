"""The files of the library: searches for best known fronts, and proofs of bounds."""

from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from botohe_moo import FrontBound, TrailPlan, bound_front, load_mission, solve
from botohe_moo.base.runtime import n_cpus
from botohe_moo.library import (
    Finder,
    add_plans,
    best_known,
    check_library,
    library_names,
    library_table,
)

FINDER = "the developers of botohe-moo"
# Evaluations, and seeds. Fronts differ by seed, so that many short runs add to few long ones.
RUNS = ((30_000_000, range(1, 4)), (3_000_000, range(101, 107)), (1_000_000, range(107, 151)))
SECONDS = 120.0  # for the bound of a mission, on one thread


def run(folder: Path) -> bool:
    """Search with new seeds, prove, keep what is better, print the table; judge by the checks."""
    searched(folder)
    proved(folder)
    print(library_table(folder=folder).to_string(index=False))
    faults = check_library(folder=folder)
    print(faults or "all plans were evaluated again")
    return not faults


def searched(folder: Path) -> None:
    """Add the plans of Pareto local search."""
    with ProcessPoolExecutor(n_cpus()) as pool:
        for evaluations, seeds in RUNS:
            for name in library_names():
                search = partial(_search, name, evaluations)
                before, after, _ = add_plans({name: pool.map(search, seeds)}, folder=folder)[name]
                print(name, evaluations, before.area, after.area, len(after.objectives), flush=True)


def _search(name: str, evaluations: int, seed: int) -> tuple[tuple[TrailPlan, ...], Finder]:
    found = solve(f"library:{name}", evaluations=evaluations, seed=seed, n_threads=1)
    method = f"pareto-local-search (n_islands=8), {evaluations:,} evaluations, seed {seed}"
    return found.plans, Finder(f"{datetime.now(UTC):%Y-%m-%d}", FINDER, method)


def proved(folder: Path, seconds: float = SECONDS) -> None:
    """Bound each mission, and keep the bound if it is lower than the one that is there."""
    with ProcessPoolExecutor(n_cpus()) as pool:
        names = library_names()
        prove = partial(_prove, folder=folder, seconds=seconds)
        for name, gaps in zip(names, pool.map(prove, names), strict=True):
            print(name, *gaps, flush=True)


def _prove(name: str, folder: Path, seconds: float) -> tuple[float, float]:
    """Return the gaps before and after, in per cent."""
    mission, front = load_mission(f"library:{name}"), best_known(name, folder=folder).objectives
    path = folder / f"{name}.bound.json"
    bound = bound_front(mission, front=front, time_limit=seconds)
    before = FrontBound.load(path, mission) if path.exists() else None
    if before is None or bound.area < before.area:
        bound.save(path)
    after = FrontBound.load(path, mission)
    return (100 * before.gap(front) if before else float("inf")), 100 * after.gap(front)
