"""The commands ``botohe solve`` and ``botohe bound``: a front, and how good it is."""

from __future__ import annotations

import math
import shlex
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated, Any

import typer

import botohe_moo as bm
from botohe_moo import decide, plots
from botohe_moo.base import files, runtime
from botohe_moo.cli import common
from botohe_moo.cli.common import FAILED, brief, fail, failing, showing, stoppable, tell
from botohe_moo.cli.plans import tell_choice

if TYPE_CHECKING:
    from botohe_moo.solving import Progress

_STOP_SEARCH = "stopping; what was found will be written. Press Ctrl-C again to break off."
_STOP_PROOF = "stopping; what is proved will be shown. Press Ctrl-C again to break off."
_SECONDS_BETWEEN_UPDATES = 0.5  # computing the area takes a while on large fronts
_ROWS = 8  # of the table of a bound


def solve(
    mission: str,
    options: dict[str, Any],
    *,
    algorithm: str = "pareto-local-search",
    parameter: list[str] | None = None,
    evaluations: common.Count = 100_000,
    seed: common.Number = 1,
    min_survival: float = 0.0,
    max_length: float | None = None,
    out: Path | None = None,
    choose: list[str] | None = None,
    certify: Annotated[float | None, typer.Option(min=1e-3)] = None,
    problem: str | None = None,
) -> None:
    """Search for the Pareto front of a mission.

    Prints about ten plans along the front: its ends, its knee, and plans that represent the others.

    Writes the whole front: front.csv, plans.json, mission.json, front.png and mission.png. Files of
    an earlier search in the folder --out are replaced.

    Ctrl-C stops the search and writes what was found. While --certify works, Ctrl-C keeps what is
    proved.

    The exit status is 1 if nothing was found, if a file cannot be written, or if no plan meets all
    wishes of --choose. It is 2 for bad input.

    Parameters
    ----------
    algorithm : -a NAME
        One of `botohe algorithms`, or module:Class.
    out : -o DIR
        Folder to write to. By default a new one: results/solve/MISSION.
    certify : S
        Seconds for a proof of how far the front is from the best possible one. Writes bound.json,
        and draws the bound in front.png.
    problem : NAME
        Other objectives than E[R] and E[S]: least-survival adds the survival of the robot in the
        greatest danger. Or module:Class, a class derived from BOTOHE.
    """
    with failing():
        from botohe_moo.bounds.bound import check_boundable
        from botohe_moo.mission.formats.reading import stem_of
        from botohe_moo.problem import find_problem
        from botohe_moo.solving import make_for_this_machine

        parameters = common.read_parameters(parameter)
        loaded = bm.load_mission(mission, **options)
        wishes = decide.parse_wishes(loaded, choose) if choose else ()
        make_for_this_machine(algorithm, parameters)
        kind = bm.BOTOHE if problem is None else find_problem(problem)
        searched = kind(loaded, min_survival=min_survival, max_length=max_length)
        if certify is not None:
            if problem is not None:
                raise ValueError("Expected no --problem with --certify: it proves E[R] and E[S].")
            check_boundable(loaded, "--certify")
        default = Path("results", "solve", stem_of(mission))
        files.check_folder(default.parent if out is None else out)
    limits = {"min_survival": min_survival, "max_length": max_length}
    how = {"mission": loaded, "algorithm": algorithm, "problem": kind, **limits, **parameters}
    with stoppable(_STOP_SEARCH) as stop:
        tell(f"{loaded.title}: {brief(loaded, searched.max_length)}\n")
        solution = _search(stop, evaluations=evaluations, seed=seed, **how)
        solution = replace(solution, source={**options, "name_or_path": mission})
        tell(solution.describe())
        with failing(FAILED):
            folder = files.new_folder(default) if out is None else out
            try:
                paths = solution.write(folder)
            except (RuntimeError, ValueError) as error:  # fonts may fail on what texts hold
                raise ValueError(f"no picture ({error}); the tables are in {folder}.") from error
        tell("\n" + "\n".join(f"wrote {path}" for path in paths))
    choice = solution.choose(*wishes) if wishes else None
    if choice is not None:
        tell("")
        tell_choice(loaded, choice, folder)
    if certify is not None:
        _certify(solution, folder, certify)
    if choice is None:
        wish_for = f'"expected survivors >= {2 * loaded.robots / 3:.2g}"'
        where = shlex.quote(str(folder))
        tell(f"\nNext:\n  botohe explore {where} --open\n  botohe choose {where} {wish_for}")
    elif not choice.met:
        fail("no plan meets all wishes.", FAILED)


def _search(stop: Event, **how: Any) -> bm.Solution:
    """Search and show it; the command ends if the algorithm refuses, or finds nothing."""
    from botohe_moo.solving import RefusalError

    try:
        with _showing_search(how["evaluations"]) as progress:
            solution = bm.solve(**how, progress=progress, stop=stop)
    except (RefusalError, bm.algorithms.TooLargeError) as error:
        fail(error)
    except Exception as error:  # whatever another package's algorithm may raise
        at = traceback.extract_tb(error.__traceback__)[-1]
        said = f"{type(error).__name__}: {error} ({at.filename}, line {at.lineno})"
        fail(f"algorithm {how['algorithm']!r} failed: {said}.", FAILED)
    if not solution.plans:
        found = f"{solution.algorithm} found no plan in {solution.evaluations} evaluations"
        status = common.INTERRUPTED if stop.is_set() else FAILED
        fail(f"{found}; nothing is written.", status)
    return solution


@contextmanager
def _showing_search(total: int) -> Iterator[Progress]:
    """Show how many evaluations are done, and the area of the front."""
    with showing("starting") as show:
        shown_at = -math.inf

        def progress(evaluations: int, area: Callable[[], float]) -> None:
            nonlocal shown_at
            elapsed = time.perf_counter() - shown_at
            if elapsed >= _SECONDS_BETWEEN_UPDATES or evaluations >= total:
                shown_at = time.perf_counter()
                show(f"{evaluations:,} evaluations  area {area():.4f}", evaluations, total)

        yield progress


def bound(
    mission: str,
    options: dict[str, Any],
    *,
    front: Path | None = None,
    time_limit: Annotated[float, typer.Option(min=1e-3)] = 60.0,
    min_survival: float = 0.0,
    max_length: float | None = None,
    threads: Annotated[int | None, typer.Option(min=1, max=1_024)] = None,
    out: Path | None = None,
) -> None:
    """Prove how far a front is from the best possible one.

    For each number of expected survivors, the bound is an expected reward that no plan exceeds.
    More time lowers it. Ctrl-C stops, and shows what is proved.

    With kinds of robots, the bound counts each robot as the best kind. It counts rewards on return
    as rewards on arrival.

    --front needs a front of the same mission: give --robots and the parameters of the mission as
    for `solve`. The limits of that search hold, so leave out --min-survival and --max-length.

    The exit status is 2 for bad input.

    Parameters
    ----------
    front : -f DIR
        Folder that `solve` wrote. Its front is judged.
    time_limit : -t S
        Seconds that it may take.
    threads : T
        Threads. By default one for each processor.
    out : -o FILE
        JSON file for the bound.
    """
    with failing():
        from botohe_moo.bounds.bound import check_boundable

        loaded = bm.load_mission(mission, **options)
        check_boundable(loaded, "botohe bound")
        limits: dict[str, Any] = {"min_survival": min_survival, "max_length": max_length}
        solution = None
        if front is not None:
            if min_survival or max_length is not None:
                expected = "neither --min-survival nor --max-length with --front"
                raise ValueError(f"Expected {expected}: the limits of its search hold.")
            solution = _read_front(front, loaded)
            limits = _limits_of(solution)
        if out is not None:
            files.check_file(out)
    longest = limits["max_length"]
    tell(f"{loaded.title}: {brief(loaded, loaded.max_length if longest is None else longest)}\n")
    with stoppable(_STOP_PROOF) as stop:
        how = {"time_limit": time_limit, "n_threads": threads}
        proved = _prove(loaded, solution, stop, **how, **limits)
        _tell_verdict(proved, solution)
        tell(f"\n{_bound_table(proved, solution)}")
        if out is not None:
            with failing():
                proved.save(out)
            tell(f"wrote {out}")


def _certify(solution: bm.Solution, folder: Path, time_limit: float) -> None:
    """Bound the front of a solution, say how good it is, and write the bound to its folder."""
    from botohe_moo.solution import BOUND, FRONT_PICTURE

    with stoppable(_STOP_PROOF) as stop:
        how = {"time_limit": time_limit, "n_threads": None, "seed": solution.seed}
        bound = _prove(solution.mission, solution, stop, **how, **_limits_of(solution))
        tell("")
        _tell_verdict(bound, solution)
        shown = solution.expected, solution.mission
        with failing(FAILED):
            bound.save(folder / BOUND)
            tell(f"wrote {folder / BOUND}")
            plots.save_plot(plots.plot_front(*shown, bound=bound), folder / FRONT_PICTURE)
            tell(f"wrote {folder / FRONT_PICTURE}")


def _prove(
    mission: bm.Mission, solution: bm.Solution | None, stop: Event, **how: Any
) -> bm.FrontBound:
    """Bound the front of a mission until the time is over or the event is set."""
    how["n_threads"] = how["n_threads"] or min(runtime.n_cpus(), 1_024)
    front, limit = None if solution is None else solution.expected, how["time_limit"]
    with showing("starting") as show, failing():

        def report(bound: bm.FrontBound) -> None:
            if stop.is_set():
                raise KeyboardInterrupt
            gap = "" if front is None else f"  gap {100 * bound.gap(front):.2f} %"
            words = f"area at most {bound.area:.4f}{gap}"
            show(words, min(bound.seconds, limit), limit)

        return bm.bound_front(mission, front=front, callback=report, **how)


def _read_front(folder: Path, mission: bm.Mission) -> bm.Solution:
    from botohe_moo.mission.model import numbers_digest

    solution = bm.read_solution(folder)
    if numbers_digest(solution.mission) != numbers_digest(mission):
        other = f"another mission than {mission.name!r}, or of another number of robots"
        has = f"it has {solution.mission.robots}, the mission {mission.robots}"
        raise ValueError(f"{folder} is a front of {other}: {has}.")
    return solution


def _limits_of(solution: bm.Solution) -> dict[str, Any]:
    """Return the limits of a search; a travel budget of None would mean the mission's."""
    budget = math.inf if solution.max_length is None else solution.max_length
    return {"min_survival": solution.min_survival, "max_length": budget}


def _tell_verdict(bound: bm.FrontBound, solution: bm.Solution | None) -> None:
    """Print in a sentence how good a front is, or without one, what no front exceeds."""
    took = f"proved in {bound.seconds:.0f} s" if bound.seconds >= 1 else "proved at once"
    verdict = f"proven upper bound on area {bound.area:.4f}"
    if solution is not None:
        gap = bound.gap(solution.expected)
        within = f": within {100 * gap:.2f} % of the optimum" if math.isfinite(gap) else ""
        area = bm.area_indicator(solution.expected, solution.mission)
        verdict = f"area {area:.4f}; {verdict}{within}"
    tell("\n".join([f"{verdict}, {took}", *bound.notes]))


def _bound_table(bound: bm.FrontBound, solution: bm.Solution | None) -> str:
    rows = [("expected survivors", "reward at most", "found")[: 2 if solution is None else 3]]
    for i in range(_ROWS + 1):
        survivors = bound.mission.robots * i / _ROWS
        row = [survivors, bound.bound(survivors)]
        if solution is not None:
            enough = solution.expected[:, 1] >= survivors * (1 - 1e-12)
            row.append(solution.expected[enough, 0].max(initial=-math.inf))
        # Where there is no plan, the reward is -inf.
        rows.append(tuple(f"{value:.4g}" if value >= 0 else "-" for value in row))
    return common.table(rows, n_texts=0)


COMMANDS = (solve, bound)
