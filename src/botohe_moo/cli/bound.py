"""The command ``botohe bound``: how far a front is from the best there is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from botohe_moo.cli.options import (
    BaseOption,
    DangerOption,
    HazardOption,
    MaxLengthOption,
    MinSurvivalOption,
    MissionArgument,
    MissionParameterOption,
    RobotsOption,
    SeedOption,
    mission_source,
    out_option,
    path_option,
)
from botohe_moo.cli.shell import FAILED, brief, failing, stoppable, tell

if TYPE_CHECKING:
    from threading import Event

    from botohe_moo.bounds import FrontBound
    from botohe_moo.mission.model import Mission
    from botohe_moo.solution import Solution

_STOPPING = "stopping; what is proved will be shown. Press Ctrl-C again to break off."
_ROWS = 8  # of the table


def bound_mission(
    mission: MissionArgument,
    front: Annotated[
        Path | None,
        path_option(
            "--front",
            "-f",
            metavar="DIR",
            help="Folder that `solve` wrote, whose front is judged; by default one that a short "
            "search finds sets what is proved first.",
        ),
    ] = None,
    time_limit: Annotated[
        float,
        typer.Option("--time-limit", "-t", metavar="S", help="Seconds that it may take."),
    ] = 60.0,
    robots: RobotsOption = None,
    base: BaseOption = None,
    danger: DangerOption = None,
    hazard: HazardOption = None,
    mission_parameter: MissionParameterOption = None,
    min_survival: MinSurvivalOption = 0.0,
    max_length: MaxLengthOption = None,
    seed: SeedOption = 1,
    threads: Annotated[
        int | None,
        typer.Option("--threads", metavar="T", help="Threads; by default one for each processor."),
    ] = None,
    out: Annotated[
        Path | None,
        out_option("FILE", "Write the bound to this JSON file."),
    ] = None,
) -> None:
    """Prove how far a front is from the best there is.

    For each number of expected survivors, an expected reward that no plan whatsoever exceeds. More
    time lowers it; Ctrl-C stops, and shows what is proved. Kinds of robots are bounded as if each
    robot were the best of all, and rewards on return as if on arrival.

    The front has to be of the same mission: give --robots and the mission's parameters as to
    `solve`. Its limits count; no others can be given.

    The exit status is 2 for bad input.
    """
    with failing():
        own = {"robots": robots, "base": base, "danger": danger, "hazard": hazard}
        source = mission_source(mission, mission_parameter, **own)
        from botohe_moo.base.files import check_file
        from botohe_moo.base.messages import check_integer, check_number
        from botohe_moo.bounds.plain import check_boundable
        from botohe_moo.mission import load_mission

        check_number("--time-limit", time_limit, above=0)
        check_integer("--seed", seed, at_least=0)
        if threads is not None:
            check_integer("--threads", threads, at_least=1, at_most=1_024)
        loaded = load_mission(**source)
        check_boundable(loaded, "botohe bound")
        limits: dict[str, Any] = {"min_survival": min_survival, "max_length": max_length}
        solution = None
        if front is not None:
            if min_survival or max_length is not None:
                raise ValueError(
                    "Expected neither --min-survival nor --max-length beside --front, whose own "
                    "limits count."
                )
            solution = _read_front(front, loaded)
            limits = _limits_of(solution)
        if out is not None:
            check_file(out)
    longest = limits["max_length"]
    tell(f"{loaded.title}: {brief(loaded, loaded.max_length if longest is None else longest)}\n")
    with stoppable(_STOPPING) as stop:
        bound = _prove(loaded, solution, stop, time_limit, threads, seed=seed, **limits)
        _tell_bound(bound, solution)
        if out is not None:
            with failing():
                bound.save(out)
            tell(f"wrote {out}")


def certify(solution: Solution, folder: Path, time_limit: float, threads: int | None) -> None:
    """Bound the front of a solution, say how good it is, and write the bound to its folder."""
    from botohe_moo.plots import plot_front
    from botohe_moo.solution.model import BOUND, FRONT_PICTURE, draw_picture

    with stoppable(_STOPPING) as stop:
        how: dict[str, Any] = {"seed": solution.seed, **_limits_of(solution)}
        bound = _prove(solution.mission, solution, stop, time_limit, threads, **how)
        tell("")
        _tell_verdict(bound, solution)
        shown = solution.objectives, solution.mission
        with failing(FAILED):
            bound.save(folder / BOUND)
            tell(f"wrote {folder / BOUND}")
            draw_picture(folder / FRONT_PICTURE, plot_front, *shown, bound=bound)
            tell(f"wrote {folder / FRONT_PICTURE}")


def _prove(
    mission: Mission,
    solution: Solution | None,
    stop: Event,
    time_limit: float,
    threads: int | None,
    **how: Any,
) -> FrontBound:
    """Bound the front of a mission until the time is over or the event is set."""
    from botohe_moo.base.runtime import n_cpus
    from botohe_moo.bounds import bound_front
    from botohe_moo.cli.progress import showing

    with showing("starting") as show:

        def report(bound: FrontBound) -> None:
            if stop.is_set():
                raise KeyboardInterrupt
            words = f"area at most {bound.area:.4f}"
            if solution is not None:
                words += f"  gap {100 * bound.gap(solution.objectives):.2f} %"
            show(words, min(bound.seconds, time_limit), time_limit)

        how |= {"front": None if solution is None else solution.objectives, "callback": report}
        n_threads = min(n_cpus(), 1_024) if threads is None else threads
        with failing():
            return bound_front(mission, time_limit=time_limit, n_threads=n_threads, **how)


def _read_front(folder: Path, mission: Mission) -> Solution:
    from botohe_moo.mission.model import numbers_digest
    from botohe_moo.solution import read_solution

    solution = read_solution(folder)
    if numbers_digest(solution.mission) != numbers_digest(mission):
        raise ValueError(
            f"{folder} is a front of another mission than {mission.name!r}, or of another number "
            f"of robots: it has {solution.mission.robots}, the mission {mission.robots}."
        )
    return solution


def _limits_of(solution: Solution) -> dict[str, float]:
    """Return the limits of a search; a travel budget of None would mean the mission's."""
    budget = math.inf if solution.max_length is None else solution.max_length
    return {"min_survival": solution.min_survival, "max_length": budget}


def _tell_verdict(bound: FrontBound, solution: Solution | None) -> None:
    """Print in a sentence how good a front is, or without one, what no front exceeds."""
    took = f"proved in {bound.seconds:.0f} s" if bound.seconds >= 1 else "proved at once"
    most = f"no plans whatsoever reach more than {bound.area:.4f}"
    if solution is None:
        tell(f"{most} of the area, {took}")
    else:
        gap = bound.gap(solution.objectives)
        within = f": within {100 * gap:.2f} % of the optimum" if math.isfinite(gap) else ""
        tell(f"area {solution.area:.4f}; {most}{within}, {took}")
    for note in bound.notes:
        tell(note)


def _tell_bound(bound: FrontBound, solution: Solution | None) -> None:
    _tell_verdict(bound, solution)
    tell("\n survivors  reward at most" + ("" if solution is None else "     found"))
    for i in range(_ROWS + 1):
        survivors = bound.mission.robots * i / _ROWS
        most, found = bound.bound(survivors), ""
        if solution is not None:
            reached = solution.objectives[solution.objectives[:, 1] >= survivors * (1 - 1e-12), 0]
            found = f"{reached.max():10.4g}" if len(reached) else f"{'-':>10}"
        shown = f"{most:14.4g}" if most >= 0 else f"{'-':>14}"  # where there is no plan
        tell(f"{survivors:10.4g}  {shown}{found}")
